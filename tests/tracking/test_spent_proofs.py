"""Proofs of ticks whose time is over go on in the next ticks, and nothing is returned that is not proven."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import assembly as asm
from assembly._record import place_of
from assembly.proximity.clearance.kept_looks import NEVER
from assembly.proximity.manager.records import MEMORY_DTYPE
from assembly.solve.loop.settings import BUDGET
from assembly.tracking.tick import TrackStatus
from benchmarks.hands import WIRE, paper_clips
from benchmarks.running import example
from tests.tracking.test_bores import bearing, shaft_depth
from tests.tracking.test_spent_budgets import NO_TIME, dragged, held_point


@pytest.fixture(scope="module")
def chain():
    return example("follow_the_hand")


@pytest.fixture(scope="module")
def clips(chain):
    return chain.paper_clips()


def jumping(seed, begin, ticks):
    """Targets of a hand that drags fast, and jumps now and then; then it rests near where it was at first."""
    rng, hand, way = np.random.default_rng(seed), begin.copy(), np.zeros(3)
    for _ in range(ticks):
        way = 0.9 * way + 0.05 * rng.normal(size=3)
        if rng.random() < 0.01:
            hand = begin + rng.normal(scale=6.0, size=3)
        hand = hand + way
        yield hand
    while True:
        yield begin + (0.3, 0.2, -0.5)


def test_what_is_returned_is_proven_and_the_hand_is_reached(chain, clips, cases):
    """Ticks in which there is never time: a pose is returned once its proof has come to an end, and not before."""
    judge, found = paper_clips(), Counter()
    ticks = cases(250, 5000)
    for seed in range(cases(1, 20)):
        tracker, begin = dragged(chain, clips, budget=NO_TIME)
        for k, target in enumerate(jumping(seed, begin, ticks)):
            before, proven = tracker.q, tracker._clear.last.at
            step = tracker.step(target)
            found[step.status] += 1
            assert step.proved and step.feasibility <= 1e-9 * WIRE
            if tracker._clear.goes_on:
                found["goes on"] += 1
                assert step.status is TrackStatus.LATE and np.array_equal(step.q, before) and step.events == ()
            if not np.array_equal(step.q, before):
                # Found from the center curves alone; and the proof has come to an end at this pose.
                assert tracker._clear.last.at is not proven and np.array_equal(tracker._clear.last.at.q, step.q)
                assert judge.deepest(step.q) > -1e-9
                found["moved"] += 1
            if k > ticks and step.status is TrackStatus.FOLLOWED:
                break
            assert k < ticks + 4000
        at_once = dragged(chain, clips)[0]
        for _ in range(200):
            with_time = at_once.step(begin + (0.3, 0.2, -0.5))
            if with_time.status is TrackStatus.FOLLOWED:
                break
        # As near as it comes with time, from wherever it was dragged to.
        ahead, least = (np.linalg.norm(held_point(chain, each.q) - target) for each in (step, with_time))
        assert ahead < 1.02 * least + 1e-6
    # The clock is read once for so many nodes that most proofs come to an end at once.
    assert found["goes on"] > 8 and found["moved"] > 20


def test_a_shaft_in_a_bore_comes_to_where_it_does_with_time():
    """What leans in a bore is asked at every pose, and its way is taken in parts: neither keeps a tick for ever."""
    ends, path = [], [(0.01 * k, 0.0, 30.0) for k in range(1, 13)]
    path += [(0.12, 0.0, 30.0 + 0.1 * k) for k in range(1, 21)]
    for budget in (None, NO_TIME):
        scene, shaft = bearing(90.0)
        tracker = scene.tracker(shaft.point(0, 0, 30), budget=budget)
        before = tracker.q
        for k in range(20000):
            step = tracker.step(path[min(k, len(path) - 1)])
            assert step.proved
            if not np.array_equal(step.q, before):
                assert shaft_depth(step.q[1], 90.0) <= 1e-9 * 90.0
                before = step.q
            if k >= len(path) and step.status is TrackStatus.FOLLOWED:
                break
        assert step.status is TrackStatus.FOLLOWED
        # It may turn about its axis as it likes.
        ends.append(step.q[1, :3])
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)


def test_a_proof_that_ends_for_another_target_is_late(chain, clips):
    """FOLLOWED is said of the target that was asked for when it was found, and of no later one."""
    tracker, begin = dragged(chain, clips, budget=NO_TIME)
    seen = 0
    for k in range(2000):
        target = begin + (0.01 * k, 0.0, 0.0) if k < 1900 else begin
        waits = tracker._clear.goes_on
        step = tracker.step(target)
        if waits and not tracker._clear.goes_on and k < 1900:
            seen += 1
            assert step.status in (TrackStatus.LATE, TrackStatus.HELD)
        if seen > 3:
            break
    assert seen > 3


def test_other_values_leave_no_proof_to_the_next_tick():
    """Where driven values may ask for another pose, a tick takes the time that its proof needs."""
    base, arm = asm.Body("base", asm.shapes.sphere(0.3), fixed=True), asm.Body("arm", asm.shapes.sphere(0.3), (1, 0, 0))
    drive = asm.Revolute(base.frame(), arm.frame(at=(-1.0, 0.0, 0.0)), "drive", angle=0.0)
    scene = asm.Assembly([base, arm])
    scene.constrain(drive, asm.Clearance())
    tracker = scene.tracker(arm.point(0, 0, 0), budget=NO_TIME)
    for k in range(10):
        drive.angle = 0.05 * k
        step = tracker.step((1.0, 0.0, 0.0))
        assert not tracker._clear.goes_on and step.status is TrackStatus.FOLLOWED
        assert np.abs(step.q[1, :2] - (np.cos(0.05 * k), np.sin(0.05 * k))).max() < 1e-9


def test_events_of_proofs_that_go_on_are_told_once(chain, clips, monkeypatch):
    """Every event is told, and by one step: as many as happened, in ticks whose proof ends in the next one as well.

    In every second tick the proof has no time; in the others a proof that goes on ends, and the loop has time for one
    step toward the next target, so that the tick goes on behind a pose that is new.
    """
    tracker, begin = dragged(chain, clips, budget=10.0)
    at = tracker._packed.memory_at
    count = at + place_of(MEMORY_DTYPE, "event_count")
    usual, found, told = tracker._until, Counter(), []
    happened = tracker._seen
    targets = chain.hand(begin).targets[2000:3600:2]
    for k, target in enumerate(targets):
        has_time = k % 2 == 1
        monkeypatch.setattr(tracker, "_until", usual if has_time else lambda _: (usual(0.0)[0], 1))
        tracker._settings[BUDGET] = 1.0 if has_time else 1e10
        waited, before = tracker._clear.goes_on, tracker.q
        step = tracker.step(target)
        assert step.status is not TrackStatus.HELD and len(step.events) < 64
        assert step.events is step.events
        told += [(event.kind, event.contact) for event in step.events]
        is_late = step.status is TrackStatus.LATE and not tracker._clear.goes_on
        found["a proof ended behind which the loop goes on"] += (
            waited and is_late and not np.array_equal(step.q, before)
        )
        found["goes on"] += tracker._clear.goes_on
    monkeypatch.setattr(tracker, "_until", lambda _: NEVER)
    tracker._settings[BUDGET] = 1e10
    for _ in range(3):
        step = tracker.step(targets[-1])
        told += [(event.kind, event.contact) for event in step.events]
    assert step.status is not TrackStatus.LATE
    assert len(told) == tracker._state[count] - happened > 4
    assert len(set(told)) == len(told)
    assert min(found.values()) > 10, found
