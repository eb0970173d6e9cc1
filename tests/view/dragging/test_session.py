"""A scene that is dragged, without a browser: calls are made on this thread, or on the session's own."""

import threading
import time

import numpy as np
import pytest

import assembly as asm
from assembly.view.dragging import session as module
from assembly.view.dragging.joint_values import freedoms_of, reach_of, set_value
from assembly.view.dragging.pointer import LONGEST_INTERVAL, Pointer, between
from assembly.view.dragging.session import Session


@pytest.fixture(autouse=True)
def no_haste(monkeypatch):
    """Nothing is let go or forgotten because the machine is busy, and contacts are looked at in every tick."""
    monkeypatch.setattr(module, "SLIDER_LEFT", 60.0)
    monkeypatch.setattr(module, "NOTICED", 60.0)
    monkeypatch.setattr(module, "CONTACTS_EVERY", 0.0)


@pytest.fixture
def ball():
    floor = asm.Body("floor", asm.shapes.plane(4.0, 4.0), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(0.5), position=(0.0, 0.0, 0.5))
    scene = asm.Assembly([floor, ball])
    scene.constrain(asm.Contact(floor, ball))
    return scene


@pytest.fixture
def crank():
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm")
    scene = asm.Assembly([ground, arm])
    scene.constrain(asm.Revolute(ground.frame(), arm.frame(), name="hinge", limits=(-1.0, 2.0)))
    return scene


def test_a_pointer_goes_from_message_to_message():
    pointer = Pointer(np.zeros(3), 0.0)
    assert pointer.move(np.array([1.0, 0.0, 0.0]), 0.1)
    # It goes there in the time that lay between the messages.
    assert pointer.at(0.1).tolist() == [0.0, 0.0, 0.0]
    assert pointer.at(0.15) == pytest.approx([0.5, 0.0, 0.0], abs=1e-15)
    assert pointer.move(np.array([1.0, 1.0, 0.0]), 0.15)
    # No jump where a message comes early.
    assert pointer.at(0.15) == pytest.approx([0.5, 0.0, 0.0], abs=1e-15)
    assert pointer.at(0.15 + LONGEST_INTERVAL).tolist() == [1.0, 1.0, 0.0]
    for bad in (np.array([np.nan, 0.0, 0.0]), np.array([np.inf, 0.0, 0.0]), np.zeros(7), np.zeros(2)):
        assert not pointer.move(bad, 0.3)
    assert pointer.at(9.0).tolist() == [1.0, 1.0, 0.0]


def test_turns_go_the_shorter_way():
    a = asm.Pose.from_axis_angle((0, 0, 1), 0.2).q
    b = asm.Pose.from_axis_angle((0, 0, 1), 0.6).q.copy()
    b[3:] *= -1.0
    half = asm.Pose.from_axis_angle((0, 0, 1), 0.4)
    assert np.abs(between(a, b, 0.5)[3:] - half.quaternion).max() < 1e-15


def test_a_body_is_dragged_and_put_back(ball):
    session = Session(ball, rate=1000.0)
    session.grab("ball", np.array([0.0, 0.0, 1.0]), 1)
    assert session.shown.held == "ball" and session.shown.holder == 1
    begin = session.shown.q
    for k in range(1, 60):
        session.move(np.array([0.01 * k, 0.0, 1.0]), 1)
        (grip,) = session._grips
        grip.pointer.at = lambda now, pointer=grip.pointer: pointer.target
        session._tick()
    assert session.shown.q[1, 0] > 0.4
    # The ball stays on the floor to the tolerance of ticks.
    assert abs(session.shown.q[1, 2] - 0.5) < 1e-11 and session.shown.violation < 1e-11
    assert session.shown.ticks == 59 and "the constraints hold" in session.shown.status
    session.release(2)
    assert session.shown.holder == 1, "another browser does not let go"
    session.release(1)
    assert session.shown.holder is None
    session.undo()
    assert np.array_equal(session.shown.q, begin)


def test_what_cannot_be_taken_is_said(ball):
    session = Session(ball)
    session.grab("floor", np.zeros(3), 1)
    assert session.shown.status == "floor is fixed" and session.shown.holder is None
    session.grab("ball", np.array([0.0, 0.0, 1.0]), 1)
    session.grab("ball", np.array([0.0, 0.0, 1.0]), 2)
    assert session.shown.status == "ball is held in another window, that of browser 1" and session.shown.holder == 1
    session.move(np.full(3, np.nan), 1)
    assert "not of finite numbers" in session.shown.notice
    session._tick()
    assert np.isfinite(session.shown.q).all() and session.shown.violation < 1e-11


def test_a_frame_is_turned(ball):
    session = Session(ball, rate=1000.0)
    session.grab("ball", None, 1)
    target = asm.Pose.from_axis_angle((0, 0, 1), 0.3, (0.1, 0.0, 0.5)).q
    session.move(target, 1)
    session._grips[0].pointer.at = lambda now: target
    for _ in range(30):
        session._tick()
    assert np.abs(session.shown.q[1] - target).max() < 1e-6


def test_sliders_drive_for_one_solve(crank):
    session = Session(crank)
    session.set_value("hinge.angle", 0.7)
    row = session.shown.q[1]
    assert 2.0 * np.arctan2(row[6], row[3]) == pytest.approx(0.7, abs=1e-12)
    assert crank.constraint("hinge").angle is None
    freedom = freedoms_of(crank)["hinge.angle"]
    assert reach_of(freedom, 1.0) == (-1.0, 2.0)
    # A slider that was rounded beyond a limit stands at it.
    assert set_value(crank, "hinge.angle", 2.0 + 1e-9, session.shown.q).values["hinge.angle"] == pytest.approx(2.0)
    with pytest.raises(asm.errors.InputError, match="name is 'hinge.slide'; expected one of 'hinge.angle'"):
        set_value(crank, "hinge.slide", 0.0, session.shown.q)
    with pytest.raises(asm.errors.InputError, match="hinge.angle"):
        set_value(crank, "hinge.angle", np.nan, session.shown.q)


def test_a_drag_is_recorded_and_played(ball):
    session = Session(ball, rate=2000.0)
    with pytest.raises(asm.errors.InputError, match="0 ticks were recorded"):
        _ = session.trace
    session.record(True)
    session.grab("ball", np.array([0.0, 0.0, 1.0]), 1)
    session.move(np.array([0.3, 0.0, 1.0]), 1)
    for _ in range(20):
        session._tick()
    session.release(1)
    session.record(False)
    times, poses = session.recorded
    assert len(times) == len(poses) == 20 and len(session.trace.times) == 20
    session.play(True)
    session._show_frame()
    assert np.array_equal(session.shown.q, poses[0])
    session.play(False)
    assert session._frames is None


def test_what_is_recorded_twice_stays_and_a_trace_is_of_one_drag(ball):
    session = Session(ball)
    session.record(True)
    for place, ticks in (((0.0, 0.0, 1.0), 3), ((0.1, 0.0, 0.9), 5)):
        session.grab("ball", np.array(place), 1)
        for _ in range(ticks):
            session._tick()
        session.record(True)
        session.release(1)
    session.record(False)
    session.record(False)
    assert len(session.recorded[0]) == 8
    assert len(session.trace.times) == 5 and session.trace.targets[0] == pytest.approx((0.1, 0.0, 0.9))


def test_what_cannot_be_grabbed_leaves_no_pose_to_go_back_to(ball):
    session = Session(ball)
    with pytest.raises(asm.errors.InputError):
        session.grab("ball", np.full(3, np.nan), 1)
    assert session.shown.holder is None and not session._undone


def test_values_and_buttons_wait_until_a_body_is_let_go(crank):
    session = Session(crank)
    session.set_value("hinge.angle", 0.5)
    turned = session.shown.q
    session.grab("arm", np.array([1.0, 0.0, 0.0]), 1)
    for call in (session.solve, session.undo, session.reset, lambda: session.set_value("hinge.angle", 1.0)):
        call()
        assert np.array_equal(session.shown.q, turned)
    session.release(1)
    session.reset()
    assert session.shown.values["hinge.angle"] == pytest.approx(0.0, abs=1e-12)
    session.undo()
    assert np.array_equal(session.shown.q, turned)
    assert session.shown.values["hinge.angle"] == pytest.approx(0.5, abs=1e-12)


def test_the_loop_runs_beside_its_callers_and_ends(ball):
    session = Session(ball, rate=500.0)
    session.start()
    session.ask(lambda: session.grab("ball", np.array([0.0, 0.0, 1.0]), 7))
    session.ask(lambda: session.grab("nobody", np.zeros(3), 7))
    session.ask(lambda: session.move(np.array([0.2, 0.0, 1.0]), 7))
    end = time.monotonic() + 60.0
    while session.shown.q[1, 0] < 0.19 and time.monotonic() < end:
        time.sleep(0.01)
    assert session.shown.q[1, 0] >= 0.19 and threading.active_count() > 1
    session.ask(lambda: 1 / 0)
    asked = threading.Event()
    session.ask(asked.set)
    assert asked.wait(60.0), "a fault of one call does not end the loop"
    session.stop()
    assert not session.is_alive()


def test_a_start_that_does_not_hold_is_refused():
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm")
    scene = asm.Assembly([ground, arm])
    scene.constrain(asm.Fixed(ground.frame(), arm.frame()), asm.Fixed(ground.frame((1, 0, 0)), arm.frame(), name="b"))
    with pytest.raises(asm.errors.InputError, match="q0 leads to no pose at which the constraints hold"):
        Session(scene)


@pytest.fixture
def pair():
    """Two balls on a floor."""
    floor = asm.Body("floor", asm.shapes.plane(4.0, 4.0), fixed=True)
    red, blue = (asm.Body(n, asm.shapes.sphere(0.5), position=(x, 0.0, 0.5)) for n, x in (("red", -1.0), ("blue", 1.0)))
    scene = asm.Assembly([floor, red, blue])
    scene.constrain(asm.Contact(floor, red), asm.Contact(floor, blue))
    return scene


def test_two_people_drag_two_bodies_at_once(pair):
    session = Session(pair)
    session.grab("red", np.array([-1.0, 0.0, 1.0]), 1)
    session.grab("blue", np.array([1.0, 0.0, 1.0]), 2)
    tracker = session._tracker
    goals = np.array([(-1.0, 0.6, 1.0), (1.0, -0.4, 1.0)])
    for grip, goal in zip(session._grips, goals, strict=True):
        session.move(goal, grip.client)
        grip.pointer.at = lambda now, goal=goal: goal
    for _ in range(60):
        session._tick()
    q, shown = session.shown.q, session.shown
    held = [asm.Pose(row[:3], row[3:]).apply((0.0, 0.0, 0.5)) for row in q[1:]]
    # Both hands have what they hold where they are, on the floor to the tolerance of ticks.
    assert np.abs(np.array(held) - [(-1.0, 0.6, 1.0), (1.0, -0.4, 1.0)]).max() < 1e-6
    assert np.abs(q[1:, 2] - 0.5).max() < 1e-11
    assert shown.who == "red (browser 1), blue (browser 2)" and len(shown.hands) == 2
    session.grab("red", np.array([-1.0, 0.6, 1.0]), 2)
    assert "red is held in another window, that of browser 1" == session.shown.notice
    session._tick()
    # It is still read while ticks have their own words.
    assert session.shown.notice.startswith("red is held") and session.shown.status != session.shown.notice
    session.release(1)
    # What nobody holds any more stays, and the other one goes on.
    still = session.shown.q[1]
    session._grips[0].pointer.at = lambda now: np.array([1.5, -0.4, 1.0])
    for _ in range(30):
        session._tick()
    assert np.abs(session.shown.q[1] - still).max() < 1e-13 and session.shown.q[2, 0] > 1.3
    session.release(2)
    session.grab("red", np.array(still[:3]), 1)
    assert session._tracker is tracker, "one tracker for all"


def test_a_scene_that_is_edited_gets_another_tracker(pair):
    """While nothing is held, and while something is: that is let go, and the page says why."""
    session = Session(pair)
    session.grab("red", np.array([-1.0, 0.0, 1.0]), 1)
    tracker, goal = session._tracker, asm.PointDistance(pair.body("blue").point(0.0, 0.0, 0.0), (2.0, 0.0, 1.0))
    pair.minimize(goal)
    session._tick()
    assert session._tracker is None and not session.shown.hands and "added or removed" in session.shown.notice
    session.grab("red", np.array([-1.0, 0.0, 1.0]), 1)
    tracker = session._tracker
    session.release(1)
    pair.remove(goal)
    session.grab("red", np.array([-1.0, 0.0, 1.0]), 1)
    assert session._tracker is not tracker
    session._tick()
    assert session.shown.hands


def test_a_slider_is_a_hand(crank):
    session = Session(crank)
    for wanted in (0.8, 1.4):
        session.slide("hinge.angle", wanted, 3)
        (grip,) = session._grips
        grip.pointer.at = lambda now, wanted=wanted: np.array([wanted])
        for _ in range(25):
            session._tick()
        row = session.shown.q[1]
        assert 2.0 * np.arctan2(row[6], row[3]) == pytest.approx(wanted, abs=1e-6)
        assert session.shown.who == "arm by hinge.angle (browser 3)" and session.shown.violation < 1e-12
    # It stops at the limit, which a tracker holds; and lets go when nothing more is said.
    session.slide("hinge.angle", 3.0, 3)
    grip.pointer.at = lambda now: np.array([3.0])
    for _ in range(40):
        session._tick()
    assert session.shown.values["hinge.angle"] == pytest.approx(2.0, abs=1e-9)
    grip.pointer._since -= 2.0 * module.SLIDER_LEFT
    session._tick()
    assert not session._grips and session.shown.status == "nothing is held"
    with pytest.raises(asm.errors.InputError, match="value is nan"):
        session.slide("hinge.angle", float("nan"), 3)
    with pytest.raises(asm.errors.InputError, match="expected one of 'hinge.angle'"):
        session.slide("hinge.turn", 0.0, 3)
    # One that has a value is driven to another one.
    crank.constraint("hinge").angle = 0.5
    session = Session(crank)
    session.slide("hinge.angle", 0.75, 3)
    assert not session._grips and session.shown.values["hinge.angle"] == pytest.approx(0.75, abs=1e-12)


@pytest.mark.parametrize("first", [False, True])
def test_a_way_is_dragged_from_either_side(first):
    """Of a joint whose second body stands still the first one is moved."""
    rail, cart = asm.Body("rail", fixed=True), asm.Body("cart")
    scene = asm.Assembly([rail, cart])
    frames = (cart.frame((0.0, 0.3, 0.0)), rail.frame()) if first else (rail.frame(), cart.frame((0.0, 0.3, 0.0)))
    scene.constrain(asm.Cylindrical(*frames, name="slide"))
    session = Session(scene)
    for name, wanted in (("slide.slide", 0.7), ("slide.angle", -2.5)):
        session.slide(name, wanted, 1)
        session._grips[0].pointer.at = lambda now, wanted=wanted: np.array([wanted])
        for _ in range(40):
            session._tick()
        session.release(1)
        assert scene.solve(session.shown.q, max_iterations=0).values[name] == pytest.approx(wanted, abs=1e-6)
    # What was dragged first stayed: a hand that turns is at the place where the body was a tick ago.
    assert scene.solve(session.shown.q, max_iterations=0).values["slide.slide"] == pytest.approx(0.7, abs=1e-5)


def test_a_grab_after_undo_goes_on_from_there(ball):
    session = Session(ball)
    session.grab("ball", np.array([0.0, 0.0, 1.0]), 1)
    session._grips[0].pointer.at = lambda now: np.array([0.5, 0.0, 1.0])
    for _ in range(20):
        session._tick()
    session.release(1)
    session.undo()
    begin = session.shown.q
    session.grab("ball", np.array([0.0, 0.5, 0.5]), 1)
    session._tick()
    # At rest where it was taken.
    assert np.abs(session.shown.q - begin).max() < 1e-9
