"""Several hands of a tracker: forces in balance, poses as two terms solved from scratch have them, clear refusals."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.tracking.tick import TrackStatus

BAR = asm.shapes.box(2.0, 0.2, 0.2)


@pytest.fixture
def bar():
    """A free bar."""
    body = asm.Body("bar", BAR)
    return asm.Assembly([body]), body


def linked():
    """Two links that hang on each other, the first one in a fixed pivot."""
    base, upper, lower = (asm.Body(name, position=(k, 0, 0), fixed=k == 0) for k, name in enumerate("xyz"))
    scene = asm.Assembly([base, upper, lower])
    scene.constrain(
        asm.Spherical(base.frame(), upper.frame(at=(-1.0, 0, 0))),
        asm.Spherical(upper.frame(), lower.frame(at=(-1.0, 0, 0)), name="second"),
    )
    return scene, upper, lower


def settled(tracker, targets, ticks=80):
    for _ in range(ticks):
        step = tracker.step(targets)
    assert step.status is TrackStatus.FOLLOWED
    return step


def test_two_hands_carry_a_weight(bar):
    scene, body = bar
    scene.minimize(asm.Weight(body, weight=3.0))
    tracker = scene.tracker([body.point(-1.0, 0, 0), body.point(0.5, 0, 0)], stiffness=[40.0, 70.0])
    step = settled(tracker, [(-1.0, 0.1, 0.3), (0.5, 0.1, 0.2)])
    pose = asm.Pose(step.q[0, :3], step.q[0, 3:])
    held = pose.apply(np.array([[-1.0, 0.0, 0.0], [0.5, 0.0, 0.0]]))
    # What the hands do to the bar and its weight: no force and no moment is left, to the stationarity of a tick.
    weight = np.array([0.0, 0.0, -3.0 * body.mass])
    assert np.abs(weight - step.forces.sum(axis=0)).max() < 1e-8
    moment = np.cross(pose.apply(body.center_of_mass), weight) - np.cross(held, step.forces).sum(axis=0)
    assert np.abs(moment).max() < 1e-8
    # Both carry, and the one that is nearer to the center more.
    assert 0.0 < -step.forces[0, 2] < -step.forces[1, 2]
    with pytest.raises(asm.errors.InputError, match="2 hands; read forces or wrenches"):
        _ = step.force


def test_joints_balance_what_two_hands_do():
    scene, upper, lower = linked()
    tracker = scene.tracker([upper.point(0.0, 0.5, 0), lower.frame()], stiffness=[2.0, 5.0])
    turned = asm.Pose.from_axis_angle((0, 1, 1), 0.7, (1.2, 0.9, 0.4))
    step = settled(tracker, [(0.8, 0.7, 0.6), turned])
    for body, k, at in ((upper, 0, (0.0, 0.5, 0.0)), (lower, 1, (0.0, 0.0, 0.0))):
        row = step.q[scene.bodies.index(body)]
        place = asm.Pose(row[:3], row[3:]).apply(at)
        pushed = [sides[body.name].at(place) for sides in step.solution.wrenches.values() if body.name in sides]
        assert np.abs(np.sum(pushed, axis=0) - step.wrenches[k]).max() < 1e-7
        assert np.abs(step.forces[k]).max() > 0.1


def test_poses_are_those_of_two_terms_solved_from_scratch():
    scene, upper, lower = linked()
    points = upper.point(0.0, 0.5, 0.2), lower.point(0.3, 0.0, 0.1)
    targets = np.array([(0.8, 0.7, 0.6), (1.4, 0.9, -0.5)])
    tracker = scene.tracker(points, stiffness=[2.0, 5.0])
    # A turn about the line from the pivot of a link to its hand is free for neither of both.
    step = settled(tracker, targets)
    scene.minimize(
        *(asm.PointDistance(point, at, 0.5 * k) for point, at, k in zip(points, targets, (2, 5), strict=True))
    )
    solved = scene.solve(tracker.q)
    begun = scene.solve()
    assert solved.success and begun.success
    assert step.objective == pytest.approx(solved.objective, rel=1e-10)
    assert step.objective == pytest.approx(begun.objective, rel=1e-8)
    for point in points:
        k = scene.bodies.index(point.body)
        one, two = (asm.Pose(q[k, :3], q[k, 3:]).apply(point.coordinates) for q in (step.q, begun.q))
        assert np.abs(one - two).max() < 1e-6


@pytest.mark.parametrize("kind", ["point", "frame"])
def test_a_list_of_one_is_one_hand_to_the_last_bit(kind):
    scene, _, lower = linked()
    follow = lower.point(0.3, 0.0, 0.1) if kind == "point" else lower.frame()
    one, listed = scene.tracker(follow, stiffness=3.0), scene.tracker([follow], stiffness=3.0)
    for k in range(20):
        place = np.array([1.9 - 0.05 * k, 0.04 * k, 0.03 * k])
        target = place if kind == "point" else np.append(place, asm.Pose.from_axis_angle((0, 0, 1), 0.1 * k).quaternion)
        a, b = one.step(target), listed.step([target])
        assert np.array_equal(a.q, b.q) and a.status is b.status and np.array_equal(a.wrench, b.wrenches[0])
    assert np.array_equal(b.force, a.force) and listed.follow == (follow,)


@pytest.mark.parametrize(
    "targets",
    [
        None,
        (0.8, 0.7, 0.6),
        [(0.8, 0.7, 0.6)],
        [(0.8, 0.7, 0.6), (1.0, 0.0, np.nan)],
        [(0.8, 0.7, 0.6), (1.0, 0.0, 1e200)],
        [(0.8, 0.7, 0.6), "there"],
        [(0.8, 0.7, 0.6), None],
        [(0.8, 0.7, 0.6), (1.4, 0.9, -0.5), (0.0, 0.0, 0.0)],
        [(0.8, 0.7, 0.6), (1.4, 0.9, -0.5, 1.0, 0.0, 0.0, 0.0)],
    ],
)
def test_where_one_target_is_none_no_hand_moves(targets):
    scene, upper, lower = linked()
    tracker = scene.tracker([upper.point(0.0, 0.5, 0.2), lower.point(0.3, 0.0, 0.1)])
    before, where = tracker.q, tracker._hands.where()
    step = tracker.step(targets)
    assert step.status is TrackStatus.BAD_TARGET
    assert np.array_equal(step.q, before) and np.isfinite(step.wrenches).all()
    assert all(map(np.array_equal, tracker._hands.where(), where))
    assert tracker.step([(0.8, 0.7, 0.6), (1.4, 0.9, -0.5)]).status is not TrackStatus.BAD_TARGET


def test_contacts_hold_under_two_hands():
    floor = asm.Body("floor", asm.shapes.plane(8.0, 8.0), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(0.5), (0.0, 0.0, 0.5))
    other = asm.Body("other", asm.shapes.sphere(0.5), (1.0, 0.0, 0.5))
    scene = asm.Assembly([floor, ball, other])
    scene.constrain(asm.Contact(floor, ball), asm.Contact(floor, other), asm.Contact(ball, other))
    tracker = scene.tracker([ball.point(0, 0, 0), other.point(0, 0, 0)], stiffness=[1.0, 2.0])
    step = settled(tracker, [(0.0, 1.0, 0.5), (3.0, 1.0, 0.5)])
    # Drawn apart the balls stay on each other: what one hand feels the other one does too.
    assert step.feasibility < 1e-11
    assert np.abs(step.forces.sum(axis=0)).max() < 1e-8
    assert step.forces[0, 0] == pytest.approx(2.0 / (1.0 + 0.5), abs=1e-8)


def test_recorded_hands_are_followed():
    scene, upper, lower = linked()
    times = [0.0, 0.4]
    first = asm.Trace.through([(1.0, 0.5, 0.2), (0.8, 0.7, 0.6)], times, rate=50.0)
    second = asm.Trace.through([(2.3, 0.0, 0.1), (1.4, 0.9, -0.5)], times, rate=50.0)
    hands = [upper.point(0.0, 0.5, 0.2), lower.point(0.3, 0.0, 0.1)]
    log = scene.tracker(hands).run([first, second])
    stepped = scene.tracker(hands)
    for pair in zip(first.targets, second.targets, strict=True):
        step = stepped.step(pair)
    assert np.array_equal(log.q[-1], step.q) and log.worst_violation < 1e-11
    with pytest.raises(TypeError, match="a Trace for each of 2 hands"):
        stepped.run(first)
    with pytest.raises(asm.errors.InputError, match="has 1 traces"):
        stepped.run([first])
    with pytest.raises(asm.errors.InputError, match="other times"):
        stepped.run([first, second.resampled(100.0)])


@pytest.mark.parametrize(
    ("follow", "stiffness", "message"),
    [
        ([], 1.0, "follow is empty"),
        (["point", "here"], 1.0, r"follow\[1\] is 'here'"),
        (["point", "point"], [1.0], "stiffness has 1 numbers"),
        (["point", "point"], [1.0, -1.0], r"stiffness\[1\] is -1"),
        (["point", "point"], 0.0, "stiffness is 0"),
        ("point", [1.0], "stiffness"),
        (["point", "foreign"], 1.0, r"follow\[1\] is of body 'other'"),
    ],
)
def test_hands_are_checked(bar, follow, stiffness, message):
    scene, body = bar
    known = {"point": body.point(0, 0, 0), "foreign": asm.Body("other", BAR).point(0, 0, 0)}
    held = known.get(follow) if isinstance(follow, str) else [known.get(item, item) for item in follow]
    with pytest.raises((asm.errors.InputError, TypeError), match=message):
        scene.tracker(held, stiffness=stiffness)
