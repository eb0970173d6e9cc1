"""Looks whose time is over go on where they were, and say what looks say that take their time.

The time of `until` is over before anything is done, whatever the machine: every call ends at its first chance.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from assembly._address import clock_address
from assembly.proximity.clearance.answers import Verdict
from assembly.proximity.clearance.kept_looks import NEVER
from tests.proximity.clearance.scenes import direction, moved, poses, proof_of, quaternion, start_of, way_of
from tests.proximity.clearance.test_proof import CLOSE, check_answer, seen
from tests.validation.clearance_scenes import TOUCHING
from tests.validation.crossing_judge import least_signed_distance

OVER = (clock_address(), 1)
pytestmark = pytest.mark.skipif(OVER[0] == 0, reason="this interpreter has no clock for compiled code")


def in_pieces(proof, looks, most=np.inf):
    """What looks return whose time is always over, or None after so many pieces; and how many these were."""
    proof.until, pieces = OVER, 0
    try:
        while pieces < most:
            next(looks)
            pieces += 1
    except StopIteration as end:
        return end.value, pieces
    finally:
        proof.until = NEVER
    return None, pieces


def test_poses_that_are_looked_at_in_pieces(cases):
    pieces = 0
    for number in range(cases(12, 4000)):
        begin = start_of(number)
        proof = proof_of(begin.a.shape, begin.b.shape)
        (answer,), more = in_pieces(proof, proof.looking(poses(begin.pose), 0.0))
        check_answer(answer, begin)
        (usual,) = proof_of(begin.a.shape, begin.b.shape).look(poses(begin.pose), 0.0)
        assert answer.verdict is usual.verdict, begin
        pieces += more
    assert pieces > 20


def test_ways_that_are_looked_at_in_pieces(cases):
    """Of a way that is proven no pose crosses; and what takes its time says nearly always the same."""
    count, looks, found = cases(8, 3000), cases(3, 25), Counter()
    for number in range(count):
        begin, step = way_of(number)
        proof = proof_of(begin.a.shape, begin.b.shape)
        proof.look(poses(begin.pose), 0.0)
        (answer,), pieces = in_pieces(proof, proof.looking(poses(step.end), 0.0, swept=True))
        found["pieces"] += pieces
        if answer.verdict is Verdict.CLEAR:
            assert step.least(looks) > -TOUCHING, begin
            assert answer.bound <= least_signed_distance(begin.a, begin.b, step.at(1.0)) + CLOSE
        usual = proof_of(begin.a.shape, begin.b.shape)
        usual.look(poses(begin.pose), 0.0)
        found["same"] += usual.look(poses(step.end), 0.0, swept=True)[0].verdict is answer.verdict
        found[answer.verdict] += 1
    assert found[Verdict.CLEAR] > 0.4 * count and found["pieces"] > count
    # Budgets are of looks, and those of a way that is taken in other parts are other ones.
    assert found["same"] >= 0.95 * count - 1


def test_what_is_not_proven_leaves_the_front_as_it_was(cases):
    """Pieces of what could not be parted are many: the next looks do not begin with these."""
    pieces = 0
    for number in range(cases(12, 2000)):
        begin, _ = way_of(number)
        proof = proof_of(begin.a.shape, begin.b.shape)
        (answer,) = proof.look(poses(begin.pose), 0.0)
        assert answer.verdict is Verdict.CLEAR
        fronts, count = proof.fronts, int(proof.fronts.counts.count[0])
        nodes, parted = fronts.nodes[0, :count].copy(), fronts.parted[0, :count].copy()
        within = moved(begin.pose, -0.5 * begin.way)
        (answer,), more = in_pieces(proof, proof.looking(poses(within), 0.0))
        if answer.verdict not in (Verdict.CROSSING, Verdict.UNDECIDED):
            continue
        pieces += more
        assert int(fronts.counts.count[0]) == count
        assert (fronts.nodes[0, :count] == nodes).all() and (fronts.parted[0, :count] == parted).all()
    assert pieces > 20


def test_staying_clear_in_pieces(cases):
    found = Counter()
    for number in range(cases(10, 3000)):
        begin, step = way_of(number)
        proof, usual = (proof_of(begin.a.shape, begin.b.shape) for _ in range(2))
        proof.look(poses(begin.pose), 0.0)
        usual.look(poses(begin.pose), 0.0)
        still = np.zeros((1, 6))
        clear, pieces = in_pieces(proof, proof.staying_clear(poses(step.end), 0.0, still))
        found["pieces"] += pieces
        found[clear] += 1
        found["same"] += usual.stays_clear(poses(step.end), 0.0, still) == clear
        if clear:
            assert step.least(3) > -TOUCHING, begin
            (answer,) = proof.clear_answers(poses(step.end), still)
            assert answer.bound <= least_signed_distance(begin.a, begin.b, step.at(1.0)) + CLOSE
    assert found[True] > 2 and found["pieces"] > 10
    assert found["same"] >= 0.95 * (found[True] + found[False]) - 1


def test_what_is_given_up_is_no_proof_of_anything(cases):
    """After some pieces of a look elsewhere, and a way back, what is said of other poses is so."""
    said, given_up = Counter(), 0
    for number in range(cases(4, 400)):
        rng, (begin, _) = np.random.default_rng([28, number]), way_of(number)
        kept, pose = proof_of(begin.a.shape, begin.b.shape), begin.pose
        kept.look(poses(pose), 0.0)
        for _ in range(6):
            far, near = rng.uniform(0.1, 1.0), 10.0 ** rng.uniform(-3.0, -0.5)
            turn = quaternion(np.r_[0, 0, 0, 1.0, 0.3 * far * rng.normal(size=3)])
            elsewhere = moved(pose, far * direction(rng) - 0.3 * far * begin.way, turn)
            last = kept.last_poses()
            looks = kept.looking(poses(elsewhere), 0.0, swept=bool(rng.random() < 0.7))
            answers, _ = in_pieces(kept, looks, most=rng.integers(1, 6))
            given_up += answers is None
            kept.go_back(last)
            assert (kept.fronts.pair.underway == 0.0).all()
            tried = moved(pose, near * direction(rng) - 0.3 * near * begin.way)
            (answer,) = kept.look(poses(tried), 0.0, swept=True)
            said[answer.verdict] += 1
            if answer.verdict is Verdict.CLEAR:
                distance = least_signed_distance(begin.a, begin.b, seen(tried))
                assert 0.0 < answer.bound <= distance + CLOSE
                pose = tried
    assert said[Verdict.CLEAR] > 5 and given_up > 5
