"""Replays: what a log says, in its own time, with its events beside it."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from enum import Enum
from html import unescape

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.tracking.log import LoggedEvent
from assembly.view.overlay import legend_rows
from assembly.view.picture import film
from tests.view.test_page import drawn


class Ended(Enum):
    WELL = "it did"


def poses(times):
    """Poses (k, 3, 7) of the three balls: the blue one goes round the green one and turns, faster and faster."""
    angle = 0.2 * times**2
    q = np.zeros((len(times), 3, 7))
    q[:, :, 3] = 1.0
    q[:, 1, 0] = 2.3
    q[:, 2, 0], q[:, 2, 1] = 2.3 + 2.5 * np.cos(angle), 2.5 * np.sin(angle)
    q[:, 2, 3], q[:, 2, 6] = np.cos(0.5 * angle), np.sin(0.5 * angle)
    return q


def logged(times, stride=1, events=()):
    recorder = asm.TrackLog.recorder(times, 3, Ended, stride=stride)
    for k, q in enumerate(poses(np.asarray(times))):
        recorder.record(k, q, 1e-5, 0.0, 0, 1)
    for k, text in events:
        recorder.note(k, [LoggedEvent("ADDED", text)])
    return recorder.log()


@pytest.fixture
def log():
    """Four seconds at 100 Hz, with two events."""
    return logged(5.0 + 0.01 * np.arange(401), events=[(100, "red <> blue & near"), (350, "far")])


def seen(monkeypatch, scene, log, **options):
    """The picture that is made of a log, and how many seconds it takes."""
    shown = []
    monkeypatch.setattr("assembly.view.browser.display", lambda picture, *rest: shown.append((picture, *rest)))
    asm.view.replay(scene, log, **options)
    ((picture, _, _, seconds, _),) = shown
    return picture, seconds


def blue_track(picture, scene):
    """Positions of the blue ball relative to the red one, in the world, at the picture's whole frames."""
    items = {item.path: item for item in picture.items}
    red, blue = items["bodies", "red"], items["bodies", "blue"]
    # Both balls' meshes are about their origins.
    return ((blue.position - red.position) / red.scale)[picture.times == np.round(picture.times)]


def test_frames_are_those_of_the_log(monkeypatch, balls, log):
    # As many frames as poses: these are shown, in the time they took.
    picture, seconds = seen(monkeypatch, balls, log, frames=1000)
    assert seconds == pytest.approx(4.0, abs=1e-12)
    assert picture.times[-1] == 400.0
    np.testing.assert_allclose(blue_track(picture, balls), log.q[:, 2, :3], rtol=0, atol=1e-12)
    # Fewer: evenly in time.
    picture, seconds = seen(monkeypatch, balls, log, frames=101, speed=2.0)
    assert seconds == pytest.approx(2.0, abs=1e-12)
    np.testing.assert_allclose(blue_track(picture, balls), log.q[::4, 2, :3], rtol=0, atol=1e-12)


def test_its_own_time_is_kept_where_ticks_are_uneven(monkeypatch, balls):
    rng = np.random.default_rng(0)
    times = np.sort(rng.uniform(0.0, 4.0, 2000))
    picture, _ = seen(monkeypatch, balls, logged(times, stride=2), frames=41)
    even = np.linspace(times[0], times[1998], 41)
    # Between poses 4 ms apart at speeds up to 4 the way is straight to 1e-4.
    np.testing.assert_allclose(blue_track(picture, balls), poses(even)[:, 2, :3], rtol=0, atol=1e-4)


def test_the_hand_is_a_ball(monkeypatch, balls, log):
    hand = asm.Trace.through([asm.Pose((1, 2, 3)), asm.Pose.from_axis_angle((0, 0, 1), 1.0, (4, 4, 4))], [5.0, 9.0])
    picture, _ = seen(monkeypatch, balls, log, frames=41, hand=hand)
    items = {item.path: item for item in picture.items}
    red, ball = items["bodies", "red"], items["ellipsoids", "ellipsoid 1", "solid"]
    whole = picture.times == np.round(picture.times)
    expected = hand.at(np.linspace(5.0, 9.0, 41))
    np.testing.assert_allclose(((ball.position - red.position) / red.scale)[whole], expected[:, :3], atol=1e-12)
    angle = 2.0 * np.arctan2(expected[:, 6], expected[:, 3])
    np.testing.assert_allclose(np.arctan2(*ball.rotation[whole][:, 1::-1, 0].T), angle, atol=1e-12)
    assert ball.said == "hand" and [text for _, text, _ in legend_rows(picture)][-2:] == ["target", "hand"]
    points = asm.Trace(hand.times, hand.positions)
    again, _ = seen(monkeypatch, balls, log, frames=41, hand=points)
    assert len(again.items) == len(picture.items) == len(film(balls, log.q[:2]).items) + 4
    with pytest.raises(InputError, match="hand has numbers"):
        asm.view.replay(balls, log, hand=asm.Trace([0.0, 1.0], [0.0, 0.5]))


# Where the viewer has put the balls, the clock and the events, at the frame in the address and after a click.
LOOK = """
const errors = [];
window.addEventListener("error", event => errors.push(event.message));
const place = name => {
  const thing = viewer.scene_tree.find(["assembly", "bodies", name]).object;
  return [...thing.position.toArray(), ...thing.quaternion.toArray(), thing.scale.x];
};
const look = () => {
  animator.update(); follow(); tell();
  return [place("red"), place("blue"), part.frame.value, document.getElementById("clock").value,
          happened.map(entry => [entry.textContent, entry.className])];
};
setTimeout(() => {
  const first = look();
  happened[1].click();
  document.title = JSON.stringify([errors, first, look()]);
}, 300);
"""


def test_a_browser_shows_the_poses_and_the_events(balls, log, browser, tmp_path):
    page = tmp_path / "replay.html"
    assert asm.view.replay(balls, log, page, frames=101, direction=(0, -1, 0.2)) is None
    errors, first, second = json.loads(unescape(browser.title_after(page, LOOK, "#frame=50")))
    assert errors == []
    # Frame 50 is the middle of the log, tick 200; the second event is in tick 350, between two frames.
    for (red, blue, said, clock, events), tick, ahead in (
        (first, 200, [False, True]),
        (second, 350, [False, False]),
    ):
        red, blue = np.array(red), np.array(blue)
        expected = log.q[tick, 2]
        # Half way between two frames: the viewer goes on the chord, 1.2 * 0.04 long, of a circle of 2.5.
        close = 2e-4 if tick == 350 else 1e-5
        np.testing.assert_allclose((blue - red)[:3] / red[-1], expected[:3], rtol=0, atol=close)
        # Either sign is the same turn; single precision, squared.
        assert abs(blue[3:7] @ np.roll(expected[3:], -1)) == pytest.approx(1.0, abs=1e-6)
        assert said == clock == f"{5.0 + 0.01 * tick:.3f} s"
        assert [text for text, _ in events] == ["6.000 s red <> blue & near", "8.500 s far"]
        assert [name == "ahead" for _, name in events] == ahead


def test_a_page_plays_in_the_log_s_time(balls, log, tmp_path):
    asm.view.replay(balls, log, tmp_path / "slow.html", speed=0.5, loop=False, title="A <hand>")
    text = (tmp_path / "slow.html").read_text(encoding="utf-8")
    assert "<title>A &lt;hand&gt;</title>" in text
    motion = drawn(text)[-1]
    assert motion["options"]["repetitions"] == 1
    times = np.frombuffer(motion["animations"][0]["clip"]["tracks"][0]["times"].data, "<f4")
    assert (times[0], times[-1]) == (0.0, 8.0)


def test_long_lists_say_what_is_missing(balls, log, tmp_path):
    many = replace(log, events=tuple((k % 401, LoggedEvent("ADDED", f"event {k}")) for k in range(777)))
    asm.view.replay(balls, many, tmp_path / "long.html")
    text = (tmp_path / "long.html").read_text(encoding="utf-8")
    assert text.count("data-frame=") == 500 and "and 277 more" in text
    # An event after the last pose that was kept stands at the end.
    late = logged(0.01 * np.arange(10), stride=4, events=[(9, "last")])
    asm.view.replay(balls, late, tmp_path / "late.html")
    (frame,) = re.findall(r'data-frame="([^"]*)"', (tmp_path / "late.html").read_text(encoding="utf-8"))
    assert float(frame) == 2.0


def test_bad_input_writes_and_starts_nothing(balls, log, tmp_path):
    page = tmp_path / "page.html"
    two = asm.Assembly(balls.bodies[:2])
    for change, kind, message in (
        ({"scene": 3}, TypeError, "scene is 3; expected an Assembly"),
        ({"log": log.q}, TypeError, "log is of type ndarray; expected a TrackLog"),
        ({"hand": (0, 0, 0)}, TypeError, r"hand is \(0, 0, 0\); expected a Trace, or None"),
        ({"speed": 0.0}, InputError, "speed is 0; expected a positive number"),
        ({"frames": 1}, InputError, "frames is 1; expected an integer from 2"),
        ({"loop": 2}, InputError, "loop is 2; expected True or False"),
        ({"scene": two}, InputError, "log has poses of 3 bodies; expected 2, those of the scene"),
        ({"log": logged(0.01 * np.arange(5), stride=5)}, InputError, "log has poses of 1 tick; expected two at least"),
        ({"log": replace(log, q=0.0 * log.q)}, InputError, "trajectory.* expected a unit quaternion"),
        ({"direction": (0, 0, 0)}, InputError, "direction is"),
        ({"open": True}, InputError, "open or visualizer is given with a path"),
        ({"path": None, "title": "x"}, InputError, "title is 'x' without a path"),
    ):
        arguments = {"scene": balls, "log": log, "path": page} | change
        with pytest.raises(kind, match=message):
            asm.view.replay(arguments.pop("scene"), arguments.pop("log"), arguments.pop("path"), **arguments)
        assert not page.exists()
