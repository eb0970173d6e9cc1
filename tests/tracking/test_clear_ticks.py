"""Ticks under clearances end clear, or touching, and HELD where no proof is found: then nothing has moved.

Judged by closed forms, to 1e-9 of the size (`clearance_scenes.TOUCHING`).
"""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.tracking.clear_ticks import ClearTicks
from assembly.tracking.proven_pose import WayLimits
from assembly.tracking.tick import TrackStatus
from benchmarks.running import example
from tests.validation import exact_solids as exact
from tests.validation.clearance_scenes import PROMISE_NOTHING, TOUCHING, tracked
from tests.validation.crossing_judge import Motion, crossing_depth


def tracker_of(first, second, place):
    """A tracker of the middle of the second part, and its scene."""
    bodies = [asm.Body("a", first.shape, fixed=True), asm.Body("b", second.shape, place)]
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())
    return scene, scene.tracker(bodies[1].point(0, 0, 0))


def depth_of(first, second, q):
    return crossing_depth(first, second, Motion.of(q[1]).seen_from(Motion.of(q[0])))


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (exact.box(1.0, 0.7, 0.5), exact.ball(0.4)),
        (exact.box(1.6, 1.2, 1e-4), exact.box(0.4, 0.3, 0.2)),
        (exact.torus(0.6, 0.15), exact.pin(0.1, 0.8)),
    ],
)
def test_a_hand_through_a_body(first, second):
    """However fast: no tick that promises anything ends in the other body, nor beyond what it cannot pass."""
    for many in (4, 14):
        _, tracker = tracker_of(first, second, (0.55, 0.0, 1.0))
        for z in np.linspace(1.0, -1.0, many):
            step = tracker.step((0.55, 0.0, z))
            if step.status.name not in PROMISE_NOTHING:
                assert depth_of(first, second, step.q) <= TOUCHING * 2.0


def test_what_is_held_has_gone_back(monkeypatch):
    """Where nothing is proven a tick has the pose of the one before, and the next one starts from there."""
    first, second = exact.box(1.0, 0.7, 0.5), exact.ball(0.4)
    _, tracker = tracker_of(first, second, (0.0, 0.0, 1.5))
    before = tracker.step((0.0, 0.0, 1.3))
    assert before.status is TrackStatus.FOLLOWED
    usual = ClearTicks.hold_at
    monkeypatch.setattr(ClearTicks, "hold_at", lambda self, there, until, code: False)
    held = tracker.step((0.0, 0.0, 1.1))
    assert held.status is TrackStatus.HELD and held.q.tobytes() == before.q.tobytes()
    monkeypatch.setattr(ClearTicks, "hold_at", usual)
    statuses = [tracker.step((0.0, 0.0, 1.1)).status for _ in range(12)]
    assert statuses[-1] is TrackStatus.FOLLOWED


def solution_at(scene, q):
    """The state of the scene's bodies at poses, as it stands."""
    return scene.solve(q, max_iterations=0)


def test_a_way_through_a_plate_does_not_hold():
    """Clear at both poses. What does not hold leaves all as it was: the same again, and ways that do."""
    plate, ball = exact.box(1.6, 1.2, 1e-2), exact.ball(0.4)
    scene, _ = tracker_of(plate, ball, (0.0, 0.0, 0.6))

    def q(z):
        return np.array([[0, 0, 0, 1, 0, 0, 0], [0, 0, z, 1, 0, 0, 0]], dtype=float)

    ticks = ClearTicks(solution_at(scene, q(0.6)), 1e-9)
    assert ticks.proved
    for _ in range(2):
        assert not ticks.holds(solution_at(scene, q(-0.6)))
        assert ticks.holds(solution_at(scene, q(0.5))) and ticks.proved
        assert ticks.holds(solution_at(scene, q(0.6)))
    assert not ticks.holds(solution_at(scene, q(0.3)))


def test_a_ball_that_slides_on_a_face_holds():
    """It touches at every tick; the straight way between two is in the face."""
    plate, ball = exact.box(1.6, 1.2, 0.1), exact.ball(0.4)
    scene, tracker = tracker_of(plate, ball, (-0.5, 0.0, 0.6))
    for x in np.linspace(-0.5, 0.5, 15):
        step = tracker.step((x, 0.0, 0.3))
        assert step.status.name not in PROMISE_NOTHING
        assert depth_of(plate, ball, step.q) <= TOUCHING * 2.0
    assert step.q[1, 0] == pytest.approx(0.5, abs=1e-6) and step.q[1, 2] == pytest.approx(0.45, abs=1e-8)


def test_a_wheel_that_rolls_over_an_edge():
    """Ticks of a hand around a box's edge: of rolling contacts nearly none are held."""
    box, pin = exact.box(1.0, 0.7, 0.5), exact.pin(0.1, 0.8)
    _, tracker = tracker_of(box, pin, (0.0, 0.0, 0.9))
    statuses = []
    for angle in np.linspace(0.0, 1.6, 30):
        step = tracker.step((0.62 * np.sin(angle), 0.05, 0.8 * np.cos(angle)))
        statuses.append(step.status)
        if step.status.name not in PROMISE_NOTHING:
            assert depth_of(box, pin, step.q) <= TOUCHING * 2.0
    assert statuses.count(TrackStatus.HELD) <= 6


def test_random_hands(cases):
    outcomes = [tracked(1000 + number) for number in range(cases(1, 200))]
    assert {outcome.number: outcome.wrong for outcome in outcomes if outcome.wrong} == {}


def around_a_pin():
    """Solutions by the angle at which a ball touches a pin."""
    pin, ball = exact.pin(0.5, 2.0), exact.ball(0.2)
    scene, _ = tracker_of(pin, ball, (0.7, 0.0, 0.0))

    def there(angle):
        q = np.array([[0, 0, 0, 1, 0, 0, 0], [0.7 * np.cos(angle), 0.7 * np.sin(angle), 0, 1, 0, 0, 0]], dtype=float)
        return solution_at(scene, q)

    return there


def test_a_way_that_touches_may_be_asked_to_go_in_by_less():
    """A ball that goes over an arc of a cylinder in one step: the chord is in it, by less than is allowed or not."""
    there = around_a_pin()
    for depth, holds in ((1e-2, True), (1e-4, False), (np.inf, True)):
        ticks = ClearTicks(there(0.0), 1e-9, limits=WayLimits(depth=depth))
        assert ticks.proved and not ticks.doubtful
        assert ticks.holds(there(0.05)) is holds
        assert list(ticks.doubtful) == ([] if holds else [0])
        assert ticks.way_depth <= depth


def test_what_is_refused_has_the_depth_of_the_way_before():
    """Where a tick is refused, the last pose stands, and what is told of the way is that of the way to it."""
    there = around_a_pin()
    ticks = ClearTicks(there(0.0), 1e-9)
    assert ticks.holds(there(0.05))
    depth = ticks.way_depth
    # The chord is in the pin by its height, and by no more than the square of its length over the least radius, or over
    # a lower bound of that.
    assert 0.7 * (1.0 - np.cos(0.025)) <= depth <= (0.7 * 0.05) ** 2 / 0.2 * 1.2
    # The other way around is through the pin, by as much as the ball is thick.
    assert not ticks.holds(there(3.0)) and ticks.in_the_way == [0]
    assert ticks.way_depth == depth and ticks.proved
    assert ticks.holds(there(0.051)) and ticks.way_depth < 0.01 * depth and not ticks.doubtful


def test_a_step_that_is_held_tells_of_the_way_before(monkeypatch):
    """As above, of a tracker: wires that touch go in on their way, by less where it is shorter."""
    chain = example("follow_the_hand")
    scene = chain.paper_clips()
    tracker = scene.tracker(scene.body("blue").point(*chain.END))
    targets = chain.hand(asm.Pose(tracker.q[2, :3], tracker.q[2, 3:]).apply(chain.END)).targets
    for target in targets[1000:1010]:
        before = tracker.step(target)
    usual = ClearTicks.hold_at

    def refused(ticks, *given):
        standing, depth = ticks.last.at, ticks.way_depth
        assert usual(ticks, *given) and ticks.way_depth != depth
        ticks.last.proof.go_back(ticks.last.proof.poses_before())
        ticks.last.at, ticks.last.way_depth = standing, depth
        return False

    monkeypatch.setattr(ClearTicks, "hold_at", refused)
    held = tracker.step(targets[1030])
    assert held.status is TrackStatus.HELD and held.proved
    assert held.way_depth == before.way_depth > 0.0


def test_faces_on_each_other_may_be_asked_to_be_looked_at_often():
    """A shaft that fills its bore: its way is not proven, and no longer than is allowed without."""
    bore = asm.Body("bore", asm.shapes.plate(1.0, 1.0, 0.4, holes=[(0.0, 0.0, 0.1)]), fixed=True)
    shaft = asm.Body("shaft", asm.shapes.solid_cylinder(0.1, 0.6))
    scene = asm.Assembly([bore, shaft])
    scene.constrain(asm.Clearance())

    def there(z):
        return solution_at(scene, np.array([[0, 0, 0, 1, 0, 0, 0], [0, 0, z, 1, 0, 0, 0]], dtype=float))

    for sampled, holds in ((0.01, False), (0.1, True)):
        ticks = ClearTicks(there(0.0), 1e-9, limits=WayLimits(sampled=sampled))
        assert not ticks.proved and not ticks.doubtful
        assert ticks.holds(there(0.05)) is holds
