"""Hands that hold something else of their bodies, or nothing, and trackers that go on from other poses."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import assembly as asm


@pytest.fixture
def scene():
    """Two balls on a floor that may touch each other."""
    floor = asm.Body("floor", asm.shapes.plane(6.0, 6.0), fixed=True)
    red, blue = (asm.Body(n, asm.shapes.sphere(0.5), position=(x, 0.0, 0.5)) for n, x in (("red", -1.0), ("blue", 1.0)))
    made = asm.Assembly([floor, red, blue])
    made.constrain(asm.Contact(floor, red), asm.Contact(floor, blue))
    return made


def held(step, body, point):
    row = step.q[body]
    return asm.Pose(row[:3], row[3:]).apply(point)


def test_a_hand_holds_another_point(scene):
    red, blue = scene["red"], scene["blue"]
    tracker = scene.tracker([red, blue])
    tracker.hold(0, red.point(0.0, 0.0, 0.5), 3.0)
    tracker.hold(1, None)
    assert tracker.follow[1] is None and tracker.follow[0].body is red
    goal = np.array([-1.2, 0.4, 0.9])
    for _ in range(60):
        step = tracker.step([goal, None])
    # The same as a tracker that was made with it: force and place, whose stiffness is 3.
    other = scene.tracker(red.point(0.0, 0.0, 0.5), stiffness=3.0)
    for _ in range(60):
        alone = other.step(goal)
    assert np.abs(step.forces[0] - alone.force).max() < 1e-6
    assert np.abs(held(step, 1, (0.0, 0.0, 0.5)) - held(alone, 1, (0.0, 0.0, 0.5))).max() < 1e-6
    # The spring lacks what the floor does not allow.
    assert np.abs(step.forces[0] - 3.0 * (held(step, 1, (0.0, 0.0, 0.5)) - goal)).max() < 1e-12
    # A hand that holds nothing draws nothing.
    assert np.array_equal(step.q[2], scene.q[2]) and not step.forces[1].any()
    tracker.hold(0, None)
    tracker.hold(1, blue)
    target = asm.Pose.from_axis_angle((0.0, 0.0, 1.0), 0.5, (1.5, 0.0, 0.5))
    for _ in range(60):
        last = tracker.step([None, target])
    # What was let go of stays, to the tolerance of ticks.
    assert np.abs(last.q[2] - target.q).max() < 1e-6 and np.abs(last.q[1] - step.q[1]).max() < 1e-11
    # What a step was told stays what it was, also in copies.
    for kept in (copy.deepcopy(step), pickle.loads(pickle.dumps(step))):
        assert np.array_equal(kept.forces, step.forces)
    assert np.abs(step.forces[0] - alone.force).max() < 1e-6


def test_a_tracker_goes_on_from_other_poses(scene):
    red, blue = scene["red"], scene["blue"]
    tracker = scene.tracker([red, blue])
    tracker.hold(0, red.point(0.0, 0.0, 0.5))
    tracker.hold(1, None)
    for _ in range(20):
        tracker.step([(0.0, 1.0, 1.0), None])
    q = np.array(scene.q)
    q[1, :2] = 0.3, -0.8
    tracker.restart(q)
    assert np.abs(tracker.q - q).max() < 1e-12
    # At rest there.
    step = tracker.step([(0.3, -0.8, 1.0), None])
    assert np.abs(step.q - q).max() < 1e-9 and np.abs(step.forces).max() < 1e-9
    for _ in range(60):
        step = tracker.step([(0.9, -0.8, 1.0), None])
    assert held(step, 1, (0.0, 0.0, 0.5)) == pytest.approx((0.9, -0.8, 1.0), abs=1e-6)


def test_a_start_that_does_not_hold_changes_nothing():
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm", position=(1.0, 0.0, 0.0))
    scene = asm.Assembly([ground, arm])
    rod = asm.Distance(ground.point(0, 0, 0), arm.point(0, 0, 0), limits=(None, 2.0))
    scene.constrain(rod)
    tracker = scene.tracker([arm])
    before = tracker.q
    with pytest.raises(asm.errors.InputError, match="q0"):
        tracker.restart(np.zeros((2, 6)))
    assert np.array_equal(tracker.q, before)
    step = tracker.step([asm.Pose((5.0, 0.0, 0.0))])
    for _ in range(40):
        step = tracker.step([asm.Pose((5.0, 0.0, 0.0))])
    assert step.q[1, 0] == pytest.approx(2.0, abs=1e-9)


def test_what_cannot_be_held_is_refused(scene):
    red, blue = scene["red"], scene["blue"]
    with pytest.raises(asm.errors.InputError, match="single hand"):
        scene.tracker(red).hold(0, None)
    with pytest.raises(asm.errors.InputError, match="single hand"):
        scene.tracker(red).restart(scene.q)
    tracker = scene.tracker([red.point(0, 0, 0), blue])
    with pytest.raises(asm.errors.InputError, match="hand is 2; expected an integer from 0 to 1"):
        tracker.hold(2, None)
    with pytest.raises(asm.errors.InputError, match="expected something of body 'red', which hand 0 holds"):
        tracker.hold(0, blue.point(0, 0, 0))
    with pytest.raises(asm.errors.InputError, match="expected a Point, which is what hand 0 was made with"):
        tracker.hold(0, red)
    with pytest.raises(TypeError, match="follow is 'red'"):
        tracker.hold(0, "red")
    with pytest.raises(asm.errors.InputError, match="q0 is None; expected real numbers"):
        tracker.restart(None)
    with pytest.raises(asm.errors.InputError, match="stiffness"):
        tracker.hold(1, blue, -1.0)
