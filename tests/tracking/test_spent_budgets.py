"""Ticks whose time is spent: poses that hold are returned, and the next ticks go on with what is not done."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import assembly as asm
from assembly._kernel import kernel
from assembly._record import place_of
from assembly.constraints.program.records import MANAGER_RECORD, RESULTS
from assembly.kinematics.frame import Point
from assembly.proximity.manager.events import EventKind
from assembly.proximity.manager.records import (
    DEADLINE,
    MEMORY_HEADER,
    PAIR_MEMORY,
    PAIR_STATE,
    PAIRS,
    memory_header_at,
)
from assembly.solve.loop.deadline import begin_tick
from assembly.solve.loop.parameters import EXTRA_TIME, HALF, UPDATES_ALONE
from assembly.solve.loop.settings import CARRIED, CARRIES, SETTINGS
from assembly.tracking.clear_ticks import ClearTicks
from assembly.tracking.tick import TrackStatus
from benchmarks.hands import WIRE, paper_clips
from benchmarks.running import example

# So little time is spent before anything is done: every call ends at its first chance, whatever the machine.
NO_TIME = 1e-9
SPENT = (TrackStatus.LATE, TrackStatus.HELD)


@pytest.fixture(scope="module")
def chain():
    return example("follow_the_hand")


@pytest.fixture(scope="module")
def clips(chain):
    """The example's scene, for trackers, which leave it as it is."""
    return chain.paper_clips()


def dragged(chain, scene, **options):
    """A tracker of the example's clips, and where its hand begins."""
    tracker = scene.tracker(scene.body("blue").point(*chain.END), **options)
    return tracker, held_point(chain, tracker.q)


def held_point(chain, q):
    return asm.Pose(q[2, :3], q[2, 3:]).apply(chain.END)


def ball_on_ball(**options):
    ball = asm.shapes.sphere(1.0)
    a, b = asm.Body("a", ball, fixed=True), asm.Body("b", ball, (0.0, 0.0, 2.0))
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Contact(a, b))
    return scene.tracker(b.point(0, 0, 0), **options)


def doubts(tracker):
    """How far pairs are beyond where contacts may have been born beside others since their last update."""
    packed = tracker._packed
    at = packed.memory_at + MEMORY_HEADER
    return tracker._state[at : at + PAIR_MEMORY * packed.table[packed.table[MANAGER_RECORD] + PAIRS]][
        place_of(PAIR_STATE, "doubt") :: PAIR_MEMORY
    ]


def settled(tracker, target, ticks):
    """The first tick that is FOLLOWED, and how ticks ended."""
    statuses = []
    for _ in range(ticks):
        step = tracker.step(target)
        statuses.append(step.status)
        if step.status is TrackStatus.FOLLOWED:
            break
    return step, Counter(statuses)


def test_ticks_without_time_come_to_the_same_pose():
    target = np.array([1.0, 0.5, 2.5])
    step, statuses = settled(ball_on_ball(budget=NO_TIME), target, 60)
    assert step.status is TrackStatus.FOLLOWED and statuses[TrackStatus.LATE] > 0
    # The center of the ball that is held is on a sphere of radius 2; ticks are stationary to 1e-9.
    assert np.abs(step.q[1, :3] - 2.0 * target / np.linalg.norm(target)).max() < 1e-8


@pytest.mark.parametrize("way", [(0.5, 0.2, -0.8), (-2.0, 3.0, -3.0), (4.0, -1.0, -9.0)])
def test_a_chain_comes_to_where_it_does_with_time(chain, clips, way, cases):
    judge = paper_clips()
    ends = []
    for time in (None, NO_TIME):
        tracker, begin = dragged(chain, clips, budget=time)
        target = begin + way
        moved = 0
        for k in range(1500):
            before = tracker.q
            step = tracker.step(target)
            assert np.array_equal(step.q, tracker.q)
            assert step.feasibility <= 1e-9 * WIRE
            # Whatever is not done, what is returned holds, found from the center curves alone.
            assert k % cases(16, 1) != 0 or judge.deepest(step.q) > -1e-9
            if step.status in SPENT:
                # A tick may be spent where its pose holds, and it has moved; one that is carried returns what was.
                moved += not np.array_equal(step.q, before)
            if step.status is TrackStatus.FOLLOWED:
                break
        assert step.status is TrackStatus.FOLLOWED and judge.deepest(step.q) > -1e-9
        ends.append(np.linalg.norm(held_point(chain, step.q) - target))
    # Both are as near to the hand as their contacts allow; which contacts these are may differ.
    assert ends[1] < 1.02 * ends[0] + 1e-6


def test_time_is_spent_at_every_place(chain, clips):
    """With little time ticks end after updates, after steps and on the way back, and the next ones go on from there."""
    tracker, begin = dragged(chain, clips, budget=NO_TIME)
    steps = Counter()
    for k in range(400):
        tracker.step(begin + 6.0 * np.array([np.sin(0.02 * k), 1.0 - np.cos(0.02 * k), -np.sin(0.03 * k)]))
        carried = int(tracker._state[tracker._packed.results_at + CARRIED])
        steps[carried] += 1
    # None, only updates, one, two, and more than the two after which a tick ends where its pose holds.
    assert {0, 1, 2, 3, 4} <= set(steps), steps


def test_events_of_ticks_that_go_on_are_told_once(chain, clips):
    tracker, begin = dragged(chain, clips, budget=NO_TIME)
    told, late = [], 0
    # Most of the motion of the example's hand, at twice its speed.
    for target in chain.hand(begin).targets[:4000:2]:
        step = tracker.step(target)
        told += step.events
        if step.status is TrackStatus.LATE and tracker._state[tracker._packed.results_at + CARRIED] > 0:
            late += 1
            assert step.events == ()
    assert late > 100
    born = [event.contact for event in told if event.kind is EventKind.ADDED]
    assert len(born) > 4 and len(set(born)) == len(born)
    gone = [event.contact for event in told if event.kind in (EventKind.REMOVED, EventKind.MERGED)]
    assert len(set(gone)) == len(gone)


def refuse_at_random(monkeypatch, seed):
    """Have one in twenty proofs of ticks refused though they came to an end. No contact is opened for them."""
    rng, begun = np.random.default_rng(seed), []

    def judged(usual, ticks, *given):
        holds = usual(ticks, *given)
        if not holds or rng.random() > 0.05:
            return holds
        ticks.last.proof.go_back(ticks.last.proof.poses_before())
        ticks.last.at = begun[-1]
        return False

    def first(usual, ticks, *given):
        begun[:] = [ticks.last.at]
        return judged(usual, ticks, *given)

    hold_at, go_on = ClearTicks.hold_at, ClearTicks.go_on
    within = []

    def holds_at(ticks, *given):
        within.append(1)
        try:
            return first(hold_at, ticks, *given)
        finally:
            within.pop()

    def goes_on(ticks, *given):
        return go_on(ticks, *given) if within else judged(go_on, ticks, *given)

    monkeypatch.setattr(ClearTicks, "hold_at", holds_at)
    monkeypatch.setattr(ClearTicks, "go_on", goes_on)


def test_a_tick_that_fails_goes_back_to_what_held(chain, clips, monkeypatch):
    """Far jumps: what is HELD is the last pose that held, to the last bit, after as many steps as with time.

    And nothing is returned beside whose contacts others may have been born that nobody looked for.
    """
    iterations, statuses, most = 3, Counter(), 0
    refuse_at_random(monkeypatch, 7)
    for seed in range(3):
        tracker, begin = dragged(chain, clips, budget=NO_TIME, iterations=iterations)
        rng, hand = np.random.default_rng(seed), begin
        for _ in range(1200):
            if rng.random() < 0.05:
                hand = begin + rng.normal(scale=25.0, size=3)
            before = tracker.q
            step = tracker.step(hand)
            statuses[step.status] += 1
            carried = tracker._state[tracker._packed.results_at + CARRIED]
            most = max(most, int(carried) - 1)
            assert step.status is not TrackStatus.VIOLATED and step.feasibility <= 1e-9 * WIRE
            if step.status is TrackStatus.HELD or carried > 0.0:
                assert np.array_equal(step.q, before)
            else:
                assert (doubts(tracker) <= 1.0).all()
    assert statuses[TrackStatus.HELD] > 0
    # A tick ends after four times its steps; the last of them is not carried any more. After ticks whose way is not
    # proven to be clear steps are shorter, and most ticks need fewer.
    assert iterations < most <= EXTRA_TIME * iterations


@pytest.mark.parametrize("held", ["frame", "body", "with another objective"])
def test_every_hand_goes_on(chain, clips, held):
    """Its orientation or another objective has a target, too; that constraints ask for nothing else is what counts."""
    ends = []
    for time in (None, NO_TIME):
        scene = asm.Assembly(clips.bodies)
        scene.constrain(*clips.constraints)
        blue = scene.body("blue")
        if held == "with another objective":
            other = scene.body("green")
            scene.minimize(asm.PointDistance(other.point(0.0, 0.0, 0.0), other.pose.position, 0.1))
        follow = {"frame": blue.frame(chain.END), "body": blue}.get(held, blue.point(*chain.END))
        tracker = scene.tracker(follow=follow, budget=time)
        pose = asm.Pose(tracker.q[2, :3], tracker.q[2, 3:])
        if held == "body":
            begin = pose
        else:
            begin = pose @ asm.Pose(chain.END)
        to = np.array([0.4, 0.3, -0.9])
        target = begin.position + to if isinstance(follow, Point) else asm.Pose(begin.position + to, begin.quaternion)
        for _ in range(1500):
            step = tracker.step(target)
            assert step.status is not TrackStatus.HELD
            if step.status is TrackStatus.FOLLOWED:
                break
        assert step.status is TrackStatus.FOLLOWED
        ends.append(step.objective)
    assert ends[1] == pytest.approx(ends[0], rel=0.02, abs=1e-9)


@pytest.mark.parametrize("offset", [1e3, 1e5, 1e7])
@pytest.mark.parametrize("tolerance", [1e-12, 1e-14])
def test_far_from_the_origin(offset, tolerance):
    """What is carried is rounded to the user's coordinates; that is no violation, nor is it for the tracker."""
    ball = asm.shapes.sphere(1.0)
    a, b = asm.Body("a", ball, (offset, 0.0, 0.0), fixed=True), asm.Body("b", ball, (offset, 0.0, 2.0))
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Contact(a, b))
    tracker = scene.tracker(b.point(0, 0, 0), budget=NO_TIME, tolerance=tolerance)
    target, new = np.array([offset + 1.0, 0.5, 2.5]), 0
    for _ in range(200):
        before = tracker.q
        step = tracker.step(target)
        assert step.status in (TrackStatus.LATE, TrackStatus.APPROACHING, TrackStatus.FOLLOWED)
        new += not np.array_equal(before, step.q)
        assert step.feasibility <= 1e-15 * offset + 2e-11
    nearest = 2.0 * (target - (offset, 0.0, 0.0)) / np.linalg.norm(target - (offset, 0.0, 0.0))
    # To the stationarity of a tick, and to what rounding of the gap is along the ball, where steps end as it holds.
    assert np.abs(step.q[1, :3] - (offset, 0.0, 0.0) - nearest).max() < 1e-8 + 1e-13 * offset
    assert new >= 2


@kernel
def begun(table, settings, results, memory):
    return begin_tick(table, settings, results, memory)


def test_updates_alone_do_not_go_on_for_ever():
    """However many pairs are due time and again: after four updates of each a step comes first."""
    watch, pairs = 100, 3
    table, settings, results = np.zeros(200, np.int64), np.zeros(SETTINGS), np.zeros(RESULTS)
    table[MANAGER_RECORD], table[watch + PAIRS], settings[CARRIES] = watch, pairs, 1.0
    memory = np.zeros(MEMORY_HEADER)
    known = memory_header_at(memory, 0)
    known.updates = 7.0
    assert begun(table, settings, results, memory) == (0, 0, 7.0) and known.earlier == 7.0
    for updates, steps in ((4 * pairs - 1, 0), (4 * pairs, 0), (4 * pairs + 5, 2)):
        results[CARRIED], known.updates = 1.0 + steps, 7.0 + updates
        _, done, before = begun(table, settings, results, memory)
        assert done == steps and known.earlier == 7.0 and results[CARRIED] == 0.0
        assert before == (7.0 + updates if updates < UPDATES_ALONE * pairs else np.inf)
        assert (memory[DEADLINE] < np.inf) == (updates < UPDATES_ALONE * pairs)


def test_driven_values_that_change_end_what_is_not_done():
    """A tick is not gone on with where another value may ask for another pose: the one that held may do so no more."""
    base, arm = asm.Body("base", fixed=True), asm.Body("arm", position=(1.0, 0.0, 0.0))
    drive = asm.Revolute(base.frame(), arm.frame(at=(-1.0, 0.0, 0.0)), "drive", angle=0.0)
    scene = asm.Assembly([base, arm])
    scene.constrain(drive)
    tracker = scene.tracker(arm.point(0, 0, 0), budget=NO_TIME)
    for k in range(40):
        drive.angle = 0.02 * k
        step = tracker.step((1.0, 0.0, 0.0))
        x, y = np.cos(0.02 * k), np.sin(0.02 * k)
        holds = np.abs(step.q[1, :2] - (x, y)).max() < 1e-9
        assert holds == (step.status is not TrackStatus.VIOLATED)


def test_a_budget_is_spent_by_its_clock():
    assert 0.0 < HALF < 1.0
    tracker = ball_on_ball(budget=10.0)
    # Ten seconds are enough for every tick: none is LATE.
    assert all(tracker.step((np.sin(0.1 * k), np.cos(0.1 * k), 2.0)).status is not TrackStatus.LATE for k in range(200))
