"""Films: everything moves as the trajectory says, in a page that plays by itself and in a window."""

from __future__ import annotations

import json

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.kinematics.ellipsoid import Ellipsoid
from assembly.view import browser
from assembly.view.commands import ROOT, commands, motion
from assembly.view.picture import draw, film
from tests.view.test_page import drawn


def places(thing, times):
    """Positions (k, 3), rotations (k, 3, 3) and scales (k, 3) of an item at all times."""
    k = len(times)
    return (
        np.broadcast_to(thing.position, (k, 3)),
        np.broadcast_to(thing.rotation, (k, 3, 3)),
        np.broadcast_to(thing.scale, (k, 3)),
    )


def numbers(data):
    return np.frombuffer(data.data, "<f4")


def test_each_frame_is_the_picture_of_its_poses(balls, rolling):
    picture = film(balls, rolling)
    scene = asm.Assembly(balls.bodies)
    scene.minimize(balls.objectives[0][1])
    whole = {i.path: places(i, picture.times) for i in picture.items}
    for frame, q in enumerate(rolling):
        for body, row in zip(balls.bodies, q, strict=True):
            body.pose = asm.Pose(row[:3], row[3:])
        still = draw(scene)
        k = int(np.flatnonzero(picture.times == frame)[0])
        # Each picture has its own middle and scale: those of the red ball.
        red = next(i for i in still.items if i.path == ("bodies", "red"))
        position, _, scale = (values[k] for values in whole["bodies", "red"])
        ratio = scale[0] / red.scale[0]
        for item in still.items:
            if item.path[0] == "bodies" or item.path[-1] == "point":
                there = position + ratio * (item.position[0] - red.position[0])
                # Rounding of numbers near one, scaled twice.
                assert whole[item.path][0][k] == pytest.approx(there, abs=1e-13)
            if item.path[0] == "bodies":
                assert whole[item.path][1][k] == pytest.approx(item.rotation[0], abs=1e-14)
    # The line from the point to its target has its ends there, at every time.
    (start, turn, scale), (target, _, _) = (whole["targets", "target 1", name] for name in ("line", "target"))
    assert start == pytest.approx(whole["targets", "target 1", "point"][0], abs=1e-15)
    assert start + scale[:, 2:] * turn[:, :, 2] == pytest.approx(target, abs=1e-13)


def test_between_frames_bodies_turn_in_small_steps(balls, rolling):
    picture = film(balls, rolling[::6])
    # Two steps of an eighth of a turn, in at most five degrees each.
    assert np.diff(picture.times).max() <= 5.0 / 45.0 + 1e-12
    assert {0.0, 1.0, 2.0} <= set(picture.times)
    green, blue = (next(i for i in picture.items if i.path[1] == name) for name in ("green", "blue"))
    # The blue ball turns about the green one's middle all the way.
    radius = np.linalg.norm(blue.position - green.position, axis=1)
    assert np.ptp(radius) < 1e-13 < radius[0]


def test_everything_is_in_view_at_every_time(balls, rolling, four_bar):
    turn = np.array([[asm.Pose.from_axis_angle((0, 0, 1), angle).q] * 4 for angle in np.linspace(0, 3, 5)])
    turn[:, :, :3] = [[0, 0, 0], [0, 0, 0], [1, 0, 0], [5, 0, 0]]
    for scene, q in ((balls, rolling), (four_bar, turn)):
        picture = film(scene, q)
        toward = picture.eye / np.linalg.norm(picture.eye)
        side = np.cross([0.0, 0.0, 1.0], toward) / np.linalg.norm(np.cross([0.0, 0.0, 1.0], toward))
        half, seen = np.tan(np.deg2rad(15.0)), []
        for item in picture.items:
            for position, rotation, scale in zip(*places(item, picture.times), strict=True):
                seen.append(item.mesh.vertices * scale @ rotation.T + position)
        points = np.concatenate(seen)
        depth = np.linalg.norm(picture.eye) - points @ toward
        across, upright = points @ side / depth / half, points @ np.cross(toward, side) / depth / half
        fill = max(np.abs(across).max() / 1.4, np.abs(upright).max())
        assert 0.75 < fill < 0.97


def test_contacts_of_solutions_move(balls):
    solutions = [balls.solve()]
    for x in (4.0, 2.0):
        balls.objectives[0][1].target = (5.0, x, 2.0)
        solutions.append(balls.solve(solutions[-1]))
    balls.constraints[0].body_b.pose = asm.Pose((0.0, 2.1, 0.0))
    solutions.append(balls.solve())
    assert all(solution.success for solution in solutions)
    picture = film(balls, solutions)
    contact = {i.path[2]: i for i in picture.items if i.path[0] == "contacts"}
    assert set(contact) == {"point", "other point", "normal"}
    red, green = (next(i for i in picture.items if i.path[1] == name).position for name in ("red", "green"))
    frames = np.flatnonzero(np.isin(picture.times, range(4)))
    # The solver's tolerance, in parts of the scene, is 1e-12 or so.
    assert contact["point"].position[frames] == pytest.approx(0.5 * (red + green)[frames], abs=1e-10)
    way = (green - red)[frames] / np.linalg.norm((green - red)[frames], axis=1, keepdims=True)
    assert contact["normal"].rotation[frames][:, :, 2] == pytest.approx(way, abs=1e-9)
    assert np.ptp(contact["point"].position, axis=0).max() > 0.1
    assert {i.color for i in contact.values()} == {(1.00, 0.72, 0.10)}
    assert not [i for i in film(balls, [s.q for s in solutions]).items if i.path[0] == "contacts"]


def test_ellipsoids_of_every_frame(balls, rolling):
    shapes = [Ellipsoid((5, 0, k), np.eye(3), (1 + k, 1, 0)) for k in range(13)]
    picture = film(balls, rolling, ellipsoids=shapes)
    solid = next(i for i in picture.items if i.path[0] == "ellipsoids" and i.path[2] == "solid")
    unit = next(i for i in picture.items if i.path == ("bodies", "red")).scale[0]
    frames = np.flatnonzero(np.isin(picture.times, range(13)))
    assert solid.scale[frames] / unit == pytest.approx(
        np.array([[1 + k, 1.0, 0.004 / unit] for k in range(13)]), abs=1e-12
    )
    assert np.diff(solid.position[frames][:, 2]) / unit == pytest.approx(1.0, abs=1e-12)


def test_a_page_holds_the_motion(balls, rolling, tmp_path):
    assert asm.view.animate(balls, rolling, tmp_path / "roll.html", seconds=3.0, loop=False) is None
    page = (tmp_path / "roll.html").read_text(encoding="utf-8")
    *still, last = drawn(page)
    picture = film(balls, rolling)
    assert len(still) == len(list(commands(picture)))
    assert last["type"] == "set_animation" and last["options"] == {"play": True, "repetitions": 1}
    clips = {clip["path"]: {t["name"]: t for t in clip["clip"]["tracks"]} for clip in last["animations"]}
    # What does not move has no track: the first item's is for the length of all.
    assert set(clips) == {
        f"{ROOT}/{path}" for path in ("bodies/red", "bodies/blue", "targets/target 1/point", "targets/target 1/line")
    }
    assert set(clips[f"{ROOT}/bodies/blue"]) == {".position", ".quaternion"}
    assert set(clips[f"{ROOT}/targets/target 1/line"]) == {".position", ".quaternion", ".scale"}
    for item in picture.items:
        path = "/".join([ROOT, *item.path])
        position, rotation, scale = places(item, picture.times)
        for name, track in clips.get(path, {}).items():
            # Single precision is the browser's.
            assert numbers(track["times"]) == pytest.approx(picture.times * 3.0 / 12.0, abs=1e-6)
            values = numbers(track["values"])
            if name == ".quaternion":
                x, y, z, w = values.reshape(-1, 4).astype(float).T
                found = [asm.Pose((0, 0, 0), e).matrix[:3, :3] for e in np.stack([w, x, y, z], axis=1)]
                assert np.array(found) == pytest.approx(rotation, abs=1e-6)
            else:
                expected = {".position": position, ".scale": scale}[name]
                assert values.reshape(-1, 3) == pytest.approx(expected, abs=1e-6)
    # The picture begins at the first frame.
    places_at_start = {c["path"]: c["matrix"] for c in still if c["type"] == "set_transform"}
    for item in picture.items:
        expected = item.matrix.T.ravel()
        assert places_at_start["/".join([ROOT, *item.path])] == pytest.approx(expected.tolist(), abs=0)
    assert '<input id="loop" type="checkbox"> loop' in page and 'max="12"' in page
    # As without a motion: nothing from outside.
    assert "http" not in page and "src=" not in page


def test_a_trajectory_that_stands_still_has_a_length(balls):
    command = motion(film(balls, [balls.q, balls.q]), 2.0, True)
    assert command["options"]["repetitions"] == float("inf")
    (clip,) = command["animations"]
    assert numbers(clip["clip"]["tracks"][0]["times"]).tolist() == [0.0, 2.0]


def blue_column(pixels):
    """Middle column of what is blue."""
    blue = (pixels[:, :, 2].astype(int) - pixels[:, :, 0] > 70) & (pixels[:, :, 2] > 120)
    assert blue.sum() > 300
    return np.median(np.nonzero(blue)[1])


def test_a_browser_shows_the_frame_that_is_asked_for(balls, rolling, photo, tmp_path):
    page = tmp_path / "roll.html"
    asm.view.animate(balls, rolling, page, direction=(0, -1, 0.2))
    first, middle, last = (blue_column(photo(page, fragment=f"#frame={frame}")) for frame in (0, 6, 12))
    # Seen from the front the ball goes from the right to the middle: 2.5 (1, cos 45, 0) from the green one.
    assert first > middle > last
    assert (first - middle) / (first - last) == pytest.approx(1.0 - np.sqrt(0.5), abs=0.1)


# Chromium's virtual time passes between its frames, so the script asks for them.
CONTROLS = """
const log = [];
const show = () => { animator.update(); follow(); };
const note = () => log.push([animator.playing, animator.time, part.frame.value, animator.actions[0].loop]);
const later = action => new Promise(done => setTimeout(() => { show(); action(); show(); note(); done(); }, 150));
(async () => {
  await later(() => {});
  await later(() => part.play.click());
  await later(() => {});
  await later(() => { part.slider.value = 6; part.slider.oninput(); });
  await later(() => part.play.click());
  await later(() => {});
  await later(() => part.loop.click());
  await later(() => part.loop.click());
  document.title = JSON.stringify(log);
})();
"""


def test_play_pause_slider_and_loop(balls, rolling, browser, tmp_path):
    asm.view.animate(balls, rolling, tmp_path / "roll.html", seconds=100.0)
    log = json.loads(browser.title_after(tmp_path / "roll.html", CONTROLS))
    playing, time, frame, loop = map(list, zip(*log, strict=True))
    assert playing == [True, False, False, False, True, True, True, True]
    # It plays, stands still when paused, goes where the slider is, and on from there.
    assert 0.0 < time[0] <= time[1] == time[2] < time[3] == 50.0 <= time[4] < time[5] < time[6] < 60.0
    assert frame == [f"{t:.2f} of 100.00 s" for t in time]
    # three.js: LoopRepeat is 2201, LoopOnce 2200.
    assert loop == [2201] * 6 + [2200, 2201]


ONCE = """
for (const time of [200, 700, 1200]) setTimeout(() => animator.update(), time);
setTimeout(() => { document.title = JSON.stringify([animator.playing, animator.time]); }, 1500);
"""


@pytest.mark.parametrize("loop", [False, True])
def test_a_motion_ends_unless_it_loops(balls, rolling, browser, tmp_path, loop):
    asm.view.animate(balls, rolling, tmp_path / "roll.html", seconds=0.5, loop=loop)
    playing, time = json.loads(browser.title_after(tmp_path / "roll.html", ONCE))
    assert playing == loop
    assert 0.0 <= time <= 0.5 and (loop or time == 0.5)


def test_animating_into_a_file_starts_nothing_and_does_not_import_meshcat(run_python, tmp_path):
    code = f"""
import subprocess, sys
def refuse(*args, **kwargs):
    raise AssertionError("a process was started")
subprocess.Popen = refuse
import assembly as asm
scene = asm.Assembly([asm.Body("ball", asm.shapes.sphere(1.0))])
asm.view.animate(scene, [scene.q, scene.q + [[1, 0, 0, 0, 0, 0, 0]]], {str(tmp_path / "page.html")!r})
print([m for m in ("meshcat", "zmq", "tornado", "casadi") if m in sys.modules])
"""
    assert run_python(code).strip() == "[]"


def test_bad_input_writes_and_starts_nothing(balls, rolling, tmp_path):
    page = tmp_path / "page.html"
    for change, kind, message in (
        ({"seconds": 0.0}, InputError, "seconds is 0; expected a positive number"),
        ({"seconds": "long"}, InputError, "seconds is 'long'; expected a finite real number"),
        ({"trajectory": rolling[:, :, :6]}, InputError, r"trajectory has shape \(13, 3, 6\)"),
        ({"scene": 3}, TypeError, "scene is 3; expected an Assembly"),
        ({"scene": asm.Assembly()}, InputError, "scene has no bodies"),
        ({"direction": (0, 0, 0)}, InputError, "direction is"),
        ({"ellipsoids": 3}, TypeError, "ellipsoids is 3"),
        ({"loop": 2}, InputError, "loop is 2; expected True or False"),
        ({"open": True}, InputError, "open or visualizer is given with a path; expected either a file or a window"),
        ({"path": None, "title": "x"}, InputError, "title is 'x' without a path"),
        ({"path": None, "visualizer": 3}, TypeError, "visualizer is 3; expected a meshcat.Visualizer"),
    ):
        with pytest.raises(kind, match=message):
            asm.view.animate(**{"scene": balls, "trajectory": rolling, "path": page, **change})
    assert not page.exists() and browser._running == []


@pytest.fixture
def stopped():
    """Stop the server of `show` after the test."""
    yield
    while browser._running:
        window = browser._running.pop().window
        window.server_proc.kill()
        window.server_proc.communicate()
        window.zmq_socket.close(linger=0)


LENGTH = """
setTimeout(() => { document.title = JSON.stringify([viewer.animator.duration, viewer.animator.actions.length]); }, 500);
"""


def test_a_window_plays_until_it_shows_something_else(balls, rolling, stopped, capfd, tmp_path, request):
    window = asm.view.animate(balls, rolling, seconds=2.5)
    assert capfd.readouterr() == ("", "")
    (tmp_path / "moving.html").write_text(window.static_html(), encoding="utf-8")
    assert asm.view.show(balls).window is window.window
    (tmp_path / "still.html").write_text(window.static_html(), encoding="utf-8")
    title_after = request.getfixturevalue("browser").title_after
    assert json.loads(title_after(tmp_path / "moving.html", LENGTH)) == [2.5, 4]
    assert json.loads(title_after(tmp_path / "still.html", LENGTH)) == [0, 0]


def test_the_play_bar_says_what_it_is_given(balls, rolling, browser, tmp_path):
    page = tmp_path / "said.html"
    said = [f"{k} deg </script> <b>" for k in range(len(rolling))]
    asm.view.animate(balls, rolling, page, captions=said)
    script = "setTimeout(() => { animator.update(); follow(); document.title = part.frame.value; }, 300);"
    assert browser.title_after(page, script, fragment="#frame=6") == said[6]


@pytest.mark.parametrize(
    ("captions", "message"),
    [(["a"], "captions has 1 texts"), ("abc", "captions is 'abc'"), ([1] * 13, r"captions\[0\] is 1")],
)
def test_captions_are_one_a_frame(balls, rolling, tmp_path, captions, message):
    with pytest.raises((InputError, TypeError), match=message):
        asm.view.animate(balls, rolling, tmp_path / "none.html", captions=captions)
    with pytest.raises(InputError, match="without a path"):
        asm.view.animate(balls, rolling, captions=["a"] * 13)
    assert not any(tmp_path.iterdir())
