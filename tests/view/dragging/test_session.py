"""A scene that is dragged, without a browser: calls are made on this thread, or on the session's own."""

import threading
import time

import numpy as np
import pytest

import assembly as asm
from assembly.view.dragging.joint_values import freedoms_of, reach_of, set_value
from assembly.view.dragging.pointer import LONGEST_INTERVAL, Pointer, between
from assembly.view.dragging.session import Session


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
        session._pointer.at = lambda now, pointer=session._pointer: pointer.target
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
    assert session.shown.status == "ball is held in another window" and session.shown.holder == 1
    session.move(np.full(3, np.nan), 1)
    assert "not of finite numbers" in session.shown.status
    session._tick()
    assert np.isfinite(session.shown.q).all() and session.shown.violation < 1e-11


def test_a_frame_is_turned(ball):
    session = Session(ball, rate=1000.0)
    session.grab("ball", None, 1)
    target = asm.Pose.from_axis_angle((0, 0, 1), 0.3, (0.1, 0.0, 0.5)).q
    session.move(target, 1)
    session._pointer.at = lambda now: target
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
