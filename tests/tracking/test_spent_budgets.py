"""Ticks whose time is spent: poses that hold are returned, and the next ticks go on with what is not done."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import assembly as asm
from assembly.proximity.events import EventKind
from assembly.solve.budget import HALF
from assembly.solve.settings import CARRIED
from assembly.tracking.tick import TrackStatus
from benchmarks.hands import WIRE, paper_clips
from benchmarks.running import example

# So little time is spent before anything is done: every call ends at its first chance, whatever the machine.
NO_TIME = 1e-9
SPENT = (TrackStatus.LATE, TrackStatus.HELD)


@pytest.fixture(scope="module")
def chain():
    return example("follow_the_hand")


def dragged(chain, **options):
    """A tracker of the example's clips, and where its hand begins."""
    scene = chain.paper_clips()
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
def test_a_chain_comes_to_where_it_does_with_time(chain, way):
    judge = paper_clips()
    ends = []
    for time in (None, NO_TIME):
        tracker, begin = dragged(chain, budget=time)
        target = begin + way
        moved = 0
        for _ in range(1500):
            before = tracker.q
            step = tracker.step(target)
            assert np.array_equal(step.q, tracker.q)
            assert step.feasibility <= 1e-9 * WIRE
            # Whatever is not done, what is returned holds, found from the center curves alone.
            assert judge.deepest(step.q) > -1e-9
            if step.status in SPENT:
                # A tick may be spent where its pose holds, and it has moved; one that is carried returns what was.
                moved += not np.array_equal(step.q, before)
            if step.status is TrackStatus.FOLLOWED:
                break
        assert step.status is TrackStatus.FOLLOWED
        ends.append(np.linalg.norm(held_point(chain, step.q) - target))
    # Both are as near to the hand as their contacts allow; which contacts these are may differ.
    assert ends[1] < 1.02 * ends[0] + 1e-6


def test_time_is_spent_at_every_place(chain):
    """With little time ticks end after looks, after steps and on the way back, and the next ones go on from there."""
    tracker, begin = dragged(chain, budget=NO_TIME)
    steps = Counter()
    for k in range(400):
        tracker.step(begin + 6.0 * np.array([np.sin(0.02 * k), 1.0 - np.cos(0.02 * k), -np.sin(0.03 * k)]))
        carried = int(tracker._state[tracker._packed.results_at + CARRIED])
        steps[carried] += 1
    # None, only looks, one, two, and more than the two after which a tick ends where its pose holds.
    assert {0, 1, 2, 3, 4} <= set(steps), steps


def test_a_tick_that_goes_on_counts_its_steps(chain):
    """However little time there is, a tick takes no more steps than one that has time: then it is HELD."""
    tracker, begin = dragged(chain, budget=NO_TIME, iterations=1)
    most = 0
    for k in range(300):
        step = tracker.step(begin + np.array([9.0 * np.sin(0.9 * k), -9.0 * np.cos(1.1 * k), -15.0]))
        most = max(most, int(tracker._state[tracker._packed.results_at + CARRIED]) - 1)
        assert step.feasibility <= 1e-9 * WIRE
    assert 1 <= most <= 4


def test_events_of_ticks_that_go_on_are_told_once(chain):
    tracker, begin = dragged(chain, budget=NO_TIME)
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


def test_a_tick_that_fails_goes_back_to_what_held(chain):
    """Far jumps of the hand, too few steps: the pose that is returned is the last one that held, to the last bit."""
    tracker, begin = dragged(chain, budget=NO_TIME, iterations=1)
    statuses = Counter()
    rng = np.random.default_rng(5)
    for _ in range(600):
        before = tracker.q
        step = tracker.step(begin + rng.normal(scale=12.0, size=3))
        statuses[step.status] += 1
        assert step.status is not TrackStatus.VIOLATED
        if step.status is TrackStatus.HELD:
            assert np.array_equal(step.q, before)
    assert statuses[TrackStatus.LATE] > 0


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
