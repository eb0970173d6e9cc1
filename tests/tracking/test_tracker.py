"""Trackers: never an exception, honest statuses, forces against differences, the same poses from the same hand."""

from __future__ import annotations

from copy import copy
from time import process_time

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.errors import InputError
from assembly.tracking.tick import TrackStatus
from benchmarks.hands import paper_clips

BALL = asm.shapes.sphere(1.0)


def ball_on_ball(unit=1.0, **options):
    """A ball that a hand holds by its center, on a fixed one."""
    ball = asm.shapes.sphere(unit)
    a, b = asm.Body("a", ball, fixed=True), asm.Body("b", ball, (0.0, 0.0, 2.0 * unit))
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Contact(a, b))
    return scene.tracker(b.point(0, 0, 0), **options)


def arm():
    """Two links in a plane, the hand at the end of the second one."""
    base, upper, lower = (asm.Body(name, position=(k, 0, 0), fixed=k == 0) for k, name in enumerate("xyz"))
    scene = asm.Assembly([base, upper, lower])
    scene.constrain(
        asm.Revolute(base.frame(), upper.frame(at=(-1.0, 0, 0)), name="shoulder"),
        asm.Revolute(upper.frame(), lower.frame(at=(-1.0, 0, 0)), name="elbow"),
    )
    return scene, lower.point(0, 0, 0)


def clips(**options):
    drag = paper_clips()
    ((_, grip),) = drag.scene.objectives
    body = next(item for item in drag.scene.bodies if item is grip.point.body)
    chain = asm.Assembly(drag.scene.bodies)
    chain.constrain(*drag.scene.constraints)
    return chain.tracker(body.point(*grip.point.coordinates), **options)


def circling(center, radius, ticks, turns=1.0):
    t = np.linspace(0.0, 2.0 * np.pi * turns, ticks)
    return center + radius * np.stack([np.sin(t), 1.0 - np.cos(t), 0.5 * np.sin(2.0 * t)], axis=1)


@pytest.mark.parametrize(
    "target",
    [
        None,
        "here",
        (0.0, 1.0),
        (np.nan, 0.0, 0.0),
        (np.inf, 0.0, 0.0),
        np.zeros((3, 3)),
        [[1.0], [2.0, 3.0], [4.0]],
        (1j, 0.0, 0.0),
        {},
        object(),
        asm.Pose(),
        10**400,
        (1e160, 0.0, 0.0),
        ["1", "2", "3"],
        (True, False, True),
        np.array(["2026-01-01"] * 3, dtype="datetime64[D]"),
        np.ma.masked_array([1.0, 2.0, 3.0], mask=True),
    ],
    ids=lambda value: type(value).__name__,
)
def test_a_target_that_is_none_moves_nothing(target):
    tracker = ball_on_ball()
    tracker.step((1.0, 0.0, 1.5))
    before = tracker.q
    step = tracker.step(target)
    assert step.status is TrackStatus.BAD_TARGET
    assert step.q.tobytes() == before.tobytes() == tracker.q.tobytes()
    assert step.feasibility < 1e-11 and np.isfinite(step.wrench).all() and step.events == ()
    assert tracker.step((1.0, 0.0, 1.5)).status is not TrackStatus.BAD_TARGET


@pytest.mark.parametrize(
    "target",
    [None, (0, 0, 0), np.zeros(7), np.full(7, np.nan), (0, 0, 0, 3, 0, 0, 0), "pose", (0, 1e160, 0, 1, 0, 0, 0)],
)
def test_a_pose_that_is_none_moves_nothing(target):
    scene, _ = arm()
    tracker = scene.tracker(scene.bodies[2])
    before = tracker.q
    assert tracker.step(target).status is TrackStatus.BAD_TARGET
    assert tracker.q.tobytes() == before.tobytes()


def test_it_comes_to_the_nearest_pose_and_says_so():
    tracker = ball_on_ball()
    target = np.array([1.0, 0.5, 2.5])
    statuses = [tracker.step(target).status for _ in range(30)]
    step = tracker.step(target)
    assert statuses[0] is TrackStatus.APPROACHING and step.status is TrackStatus.FOLLOWED
    # The center of the ball that is held is on a sphere of radius 2.
    nearest = 2.0 * target / np.linalg.norm(target)
    assert np.abs(step.q[1, :3] - nearest).max() < 1e-8
    # What the hand feels is the spring, 1 by default, between it and the point it holds.
    assert np.abs(step.force - (nearest - target)).max() < 1e-8
    assert np.abs(step.wrench[3:]).max() == 0.0
    # The contact holds the ball in balance with that force.
    push = step.solution.wrenches["a-b"]["b"]
    assert np.abs(push.force - step.force).max() < 1e-7 and np.abs(push.torque).max() < 1e-7
    assert step.solution.success and step.solution.contacts["a-b"].gap == pytest.approx(0.0, abs=1e-11)


@pytest.mark.parametrize("stiffness", [0.5, 3.0])
def test_the_force_is_the_slope_of_the_energy(stiffness):
    tracker = ball_on_ball(stiffness=stiffness)
    target = np.array([0.8, -0.4, 2.6])

    def energy(at):
        for _ in range(40):
            step = tracker.step(at)
        assert step.status is TrackStatus.FOLLOWED
        return step.objective

    force = None
    for _ in range(40):
        force = tracker.step(target).force
    h = 1e-4
    slope = [(energy(target + h * e) - energy(target - h * e)) / (2.0 * h) for e in np.eye(3)]
    # Work done by the hand is energy of the spring; differences of step h err by h^2 and by 1e-12 / h.
    assert np.abs(force + np.array(slope)).max() < 1e-7


def test_forces_of_a_held_frame_are_those_of_its_energy():
    scene, _ = arm()
    hand = scene.bodies[2]
    tracker = scene.tracker(hand, stiffness=2.0)
    turn = Rotation.from_rotvec([0.3, -0.2, 0.4])
    place = np.array([1.5, 0.7, 0.3])
    for _ in range(60):
        step = tracker.step(np.append(place, turn.as_quat(scalar_first=True)))
    force, torque, h = step.force, step.wrench[3:], 1e-5

    def energy(position, rotation):
        target = asm.Pose(position, rotation.as_quat(scalar_first=True))
        term = asm.FrameDistance(hand.frame(), target, weight=1.0, length=tracker._hands.terms[0].length)
        other = asm.Assembly(scene.bodies)
        other.minimize(term)
        return other.solve(step.q, max_iterations=0).objective

    slopes = []
    for e in np.eye(3):
        slopes.append((energy(place + h * e, turn) - energy(place - h * e, turn)) / (2.0 * h))
    for e in np.eye(3):
        ahead, back = (Rotation.from_rotvec(s * h * e) * turn for s in (1.0, -1.0))
        slopes.append((energy(place, ahead) - energy(place, back)) / (2.0 * h))
    assert np.abs(np.append(force, torque) + slopes).max() < 1e-7


def test_the_followed_clip_is_in_balance():
    tracker = clips()
    hold = tracker.q
    body = tracker.follow.body
    k = [item.name for item in tracker.scene.bodies].index(body.name)
    point = asm.Pose(hold[k, :3], hold[k, 3:]).apply(tracker.follow.coordinates)
    for target in np.linspace(point, point + [2.0, 1.0, -3.0], 50):
        step = tracker.step(target)
    for _ in range(30):
        step = tracker.step(target)
    assert step.status is TrackStatus.FOLLOWED
    pushed = [sides[body.name].at(target) for sides in step.solution.wrenches.values() if body.name in sides]
    held = asm.Pose(step.q[k, :3], step.q[k, 3:]).apply(tracker.follow.coordinates)
    spring = np.append(-step.force, np.cross(held - target, -step.force))
    # To the stationarity of a tick, 1e-9, in forces of order one on arms of up to 33.
    assert np.abs(np.sum(pushed, axis=0) + spring).max() < 1e-6


def test_a_spent_budget_returns_a_pose_that_holds():
    tracker = clips(budget=1e-9, iterations=50)
    first = tracker.q
    target = first[2, :3] + [5.0, 5.0, -20.0]
    begin = process_time()
    steps = [tracker.step(target) for _ in range(5)]
    # Of this process: others may have the machine meanwhile.
    assert process_time() - begin < 5.0
    for step in steps:
        # One step of the loop was all there was time for: from where it did not hold there is no way but back.
        assert step.status in (TrackStatus.LATE, TrackStatus.HELD)
        assert step.feasibility <= 1.25e-12 * 40.0 and np.isfinite(step.q).all()


def test_a_budget_that_is_not_spent_changes_nothing():
    runs = []
    for budget in (None, 10.0):
        tracker = ball_on_ball(budget=budget)
        runs.append([tracker.step(target).q.tobytes() for target in circling(np.array([0.0, 0.0, 2.2]), 0.3, 100)])
    assert runs[0] == runs[1]


def test_second_order_tells_minima_from_saddles():
    tracker = ball_on_ball(second_order=True)
    for _ in range(10):
        step = tracker.step((0.0, 0.0, 5.0))
    # Free are two tilts about the fixed ball, along which the distance grows, and turns of the ball about itself,
    # along which nothing does.
    assert step.status is TrackStatus.FOLLOWED
    near = step.is_minimum
    # From below, through the fixed ball, the ball on top is as far from the hand as it can be.
    tracker = ball_on_ball(second_order=True)
    step = tracker.step((0.0, 0.0, -5.0))
    assert step.is_minimum is False
    assert near in (True, False)
    assert ball_on_ball().step((0.0, 0.0, 5.0)).is_minimum is None


def test_an_arm_is_at_a_minimum_or_at_a_saddle():
    scene, tip = arm()
    tracker = scene.tracker(tip, second_order=True)
    for _ in range(60):
        step = tracker.step((1.2, 0.9, 0.0))
    assert step.status is TrackStatus.FOLLOWED and step.is_minimum is True
    assert np.linalg.norm(step.q[2, :3] - [1.2, 0.9, 0.0]) < 1e-9
    # Stretched out, and drawn back along itself: it would fold.
    tracker = scene.tracker(
        tip, q0=[[0, 0, 0, 1, 0, 0, 0], [1, 0, 0, 1, 0, 0, 0], [2, 0, 0, 1, 0, 0, 0]], second_order=True
    )
    assert tracker.step((0.5, 0.0, 0.0)).is_minimum is False


def test_the_sign_of_quaternions_does_not_matter():
    runs = []
    for sign in (1.0, -1.0):
        scene, tip = arm()
        q = scene.q.copy()
        q[:, 3:] *= sign
        tracker = scene.tracker(tip, q0=q)
        runs.append([tracker.step(target) for target in circling([1.8, 0.0, 0.0], 0.2, 200)])
    for one, other in zip(*runs, strict=True):
        assert np.abs(one.q[:, :3] - other.q[:, :3]).max() < 1e-12
        assert np.abs(np.abs((one.q[:, 3:] * other.q[:, 3:]).sum(axis=1)) - 1.0).max() < 1e-12


def test_the_unit_of_length_does_not_matter():
    one, other = ball_on_ball(), ball_on_ball(unit=1e-3)
    # Without the last target, above a pole of the ball: there roundings of the way decide what stationarity leaves.
    for target in circling(np.array([0.0, 0.0, 2.2]), 0.3, 200)[:-1]:
        mm, m = one.step(target), other.step(1e-3 * target)
        assert mm.status is m.status
        # Roundings of the coordinates of the same pose, carried from tick to tick.
        assert np.abs(mm.q[1, :3] - 1e3 * m.q[1, :3]).max() < 1e-10


def test_the_same_hand_gives_the_same_poses_to_the_bit():
    runs = []
    for _ in range(2):
        tracker = clips()
        start = tracker.q[2, :3] + [0.0, 0.0, -10.0]
        runs.append([tracker.step(target) for target in circling(start, 1.0, 300)])
    assert [step.q.tobytes() for step in runs[0]] == [step.q.tobytes() for step in runs[1]]
    assert [step.status for step in runs[0]] == [step.status for step in runs[1]]


def test_driven_values_change_between_ticks():
    scene, tip = arm()
    elbow = scene.constraints[1]
    elbow.angle = 0.3
    tracker = scene.tracker(tip)
    for angle in np.linspace(0.3, 1.2, 50):
        elbow.angle = angle
        step = tracker.step((1.5, 0.5, 0.0))
        assert step.feasibility < 1e-11
        assert step.solution.values["elbow.angle"] == pytest.approx(angle, abs=1e-11)


def test_twenty_thousand_ticks_do_not_drift():
    tracker = ball_on_ball()
    targets = circling(np.array([0.0, 0.0, 2.2]), 0.3, 1000)
    worst = []
    for _ in range(20):
        held = 0.0
        for target in targets:
            step = tracker.step(target)
            held = max(held, step.feasibility)
        worst.append(held)
        lengths = np.linalg.norm(step.q[:, 3:], axis=1)
        assert np.abs(lengths - 1.0).max() <= 1e-15
    # The tolerance, 1e-12 of the size of 3.5, and the rounding of the user's coordinates.
    assert max(worst) <= 1.25e-12 * 3.5
    assert worst[-1] <= 2.0 * worst[0] + 1e-15


def test_a_clearance_is_kept_while_a_hand_pushes_through():
    a, b = asm.Body("a", BALL, fixed=True), asm.Body("b", BALL, (3.0, 0.1, 0.0))
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Clearance())
    tracker = scene.tracker(b.point(0, 0, 0))
    seen, pushed = [], 0
    for k, x in enumerate(np.linspace(3.0, -3.0, 400)):
        step = tracker.step((x, 0.1, 0.0))
        seen += [event.kind.value for event in step.events]
        assert np.linalg.norm(step.q[1, :3]) >= 2.0 - 1e-11
        assert step.status is not TrackStatus.VIOLATED
        if k % 20 == 0 and np.linalg.norm(step.q[1, :3]) < 2.0 + 1e-9 and step.status is TrackStatus.FOLLOWED:
            # It stands before the fixed one: the contact pushes as hard as the hand.
            pushed += 1
            assert list(step.solution.contacts) == ["clearance: a-b"]
            assert np.abs(step.solution.wrenches["clearance"]["b"].force - step.force).max() < 1e-4
    assert "added" in seen and pushed > 0


def hinge(**values):
    """A hinge at the origin, about z, and a tracker that holds a point of what it carries."""
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm")
    scene = asm.Assembly([ground, arm])
    joint = asm.Revolute(ground, arm, "hinge", **values)
    scene.constrain(joint)
    return joint, scene.tracker(arm.point(1.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("values", "attribute", "value"),
    [({}, "angle", 0.1), ({"angle": 0.3}, "angle", None), ({"limits": (-0.5, 0.5)}, "limits", None)],
    ids=["driven", "released", "no longer limited"],
)
def test_a_tracker_says_that_a_row_came_or_went(values, attribute, value):
    joint, tracker = hinge(**values)
    tracker.step((1.0, 0.1, 0.0))
    before, was = tracker.q, getattr(joint, attribute)
    setattr(joint, attribute, value)
    step = tracker.step((0.0, 1.0, 0.0))
    assert step.status is TrackStatus.CHANGED and "another" in step.status.value
    assert step.q.tobytes() == before.tobytes() == tracker.q.tobytes() and step.feasibility < 1e-12
    # Rows that are there again may be followed; so may rows while those of another scene change.
    setattr(joint, attribute, was)
    hinge()[0].angle = 0.2
    assert tracker.step((1.0, 0.1, 0.0)).status is not TrackStatus.CHANGED


def test_a_tracker_says_that_something_was_set_anew():
    """What a tick has in its table does not follow: a frame, what is fixed, what is enabled, a least gap."""
    ground, arm = asm.Body("ground", asm.shapes.sphere(0.1), (5, 5, 5), fixed=True), asm.Body("arm")
    ball = asm.Body("ball", asm.shapes.sphere(0.1), (2, 0, 0))
    scene = asm.Assembly([ground, arm, ball])
    shoulder, elbow = asm.Revolute(ground.frame(at=(-5, -5, -5)), arm, "s"), asm.Revolute(arm.frame(at=(2, 0, 0)), ball)
    gap = asm.Clearance(minimum=0.1)
    scene.constrain(shoulder, elbow, gap)
    tracker = scene.tracker(ball.point(1, 0, 0))
    place = asm.Parameter(elbow.frame_a, "origin", "x")
    edits = [(place, "value", 1.5, 2.0), (elbow, "enabled", False, True), (arm, "fixed", True, False)]
    edits.append((asm.Parameter(gap, "minimum"), "value", 0.2, 0.1))
    for thing, name, other, was in edits:
        assert tracker.step((2.9, 0.3, 0.0)).status is not TrackStatus.CHANGED
        before = tracker.q
        setattr(thing, name, other)
        step = tracker.step((0.0, 2.9, 0.0))
        assert step.status is TrackStatus.CHANGED and np.array_equal(step.q, before)
        setattr(thing, name, was)
    # Another scene's numbers are no concern of it; nor are constraints that were disabled when it was made.
    elbow.enabled = False
    tracker = scene.tracker(arm.point(2, 0, 0))
    hinge()[0].frame_a.place(at=(0.0, 0.0, 1.0))
    hinge()[0].angle = 0.2
    assert tracker.step((1.9, 0.3, 0.0)).status is not TrackStatus.CHANGED


def test_a_tracker_says_that_its_scene_is_made_of_other_things():
    """Whatever is added or removed is not followed; once it is there again, or gone, it is."""
    scene, point = arm()
    shoulder, elbow = scene.constraints
    term, more = asm.Posture(), asm.Revolute(elbow.frame_a, elbow.frame_b, name="more")
    scene.minimize(term)
    tracker = scene.tracker([point])
    edits = [
        (lambda: scene.remove(elbow), lambda: scene.constrain(elbow)),
        (lambda: scene.constrain(more), lambda: scene.remove(more)),
        (lambda: scene.remove(term), lambda: scene.minimize(term)),
        (lambda: scene.maximize(term), lambda: (scene.remove(term), scene.minimize(term))),
    ]
    for k, (edit, back) in enumerate(edits):
        assert tracker.step([(1.9, 0.3, 0.0)]).status is not TrackStatus.CHANGED
        before = tracker.q
        edit()
        for _ in range(2):
            step = tracker.step([(0.0, 1.9, 0.0)])
            assert step.status is TrackStatus.CHANGED and "added or removed" in step.status.value, k
            assert np.array_equal(step.q, before) and np.array_equal(tracker.q, before)
        with pytest.raises(InputError, match="other bodies, constraints or terms"):
            tracker.restart(before)
        back()
    # A constraint of the same numbers is another one.
    scene.remove(elbow)
    scene.constrain(asm.Revolute(elbow.frame_a, elbow.frame_b, name="elbow"))
    assert tracker.step([(1.9, 0.3, 0.0)]).status is TrackStatus.CHANGED
    scene.remove("elbow")
    scene.constrain(elbow)
    assert tracker.step([(1.9, 0.3, 0.0)]).status is not TrackStatus.CHANGED
    scene.add(asm.Body("one more"))
    assert tracker.step([(1.9, 0.3, 0.0)]).status is TrackStatus.CHANGED
    # Copies go their own way; what another scene is made of is no concern.
    other, grip = arm()
    tracker = other.tracker(grip)
    copied = copy(other)
    copied.remove("shoulder")
    scene.remove(shoulder)
    assert tracker.step((1.9, 0.3, 0.0)).status is not TrackStatus.CHANGED


def test_a_driven_value_or_a_limit_may_change_between_ticks():
    joint, tracker = hinge(limits=(-0.5, 0.5))
    for limit in (0.5, 0.2):
        joint.limits = (-0.5, limit)
        for _ in range(20):
            step = tracker.step((0.0, 1.0, 0.0))
        assert step.status is TrackStatus.FOLLOWED
        assert step.solution.values["hinge.angle"] == pytest.approx(limit, abs=1e-11)


def test_what_is_no_hand_and_no_trace():
    scene, _ = arm()
    with pytest.raises(InputError, match="other"):
        scene.tracker(asm.Body("other"))
    with pytest.raises(TypeError, match="trace"):
        scene.tracker(scene.bodies[2]).run("trace")


def test_a_fixed_body_is_not_held():
    scene, _ = arm()
    with pytest.raises(InputError, match="follow is of body 'x', which is fixed; expected a body that moves"):
        scene.tracker(scene.bodies[0].point(0, 0, 0))
