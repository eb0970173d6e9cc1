"""Looks whose memory is full go on where they were once there is more, and begin anew where there may be no more."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import assembly.proximity.clearance.kept_looks as kept_looks
from assembly.proximity.clearance import forest
from assembly.proximity.clearance.answers import Verdict
from assembly.proximity.clearance.look import SWEPT_BUDGET
from tests.proximity.clearance.scenes import poses, proof_of, way_of


@pytest.fixture
def calls(monkeypatch):
    """The pairs of nodes for which directions are sought, call by call of the kernel that looks."""
    found, looks, look = [], kept_looks.KeptLooks._look, kept_looks.look_at_pairs
    asked = []

    def of_proof(self, *given):
        asked.append(self)
        yield from looks(self, *given)

    def counted(*given):
        look(*given)
        found.append(int(asked[-1].fronts.counts.sought.sum()))

    monkeypatch.setattr(kept_looks.KeptLooks, "_look", of_proof)
    monkeypatch.setattr(kept_looks, "look_at_pairs", counted)
    return found


def way_with(begin, step, room, monkeypatch):
    """The proof of a way, and what is found, with so much room for cells and for fronts at first."""
    monkeypatch.setattr(forest, "SPARE", room)
    monkeypatch.setattr(forest, "ROOM", max(room, 128))
    proof = proof_of(begin.a.shape, begin.b.shape)
    proof.look(poses(begin.pose), 0.0)
    return proof, proof.look(poses(step.end), 0.0, swept=True)[0]


def test_what_memory_there_is_changes_nothing(cases, calls, monkeypatch):
    """The same is found with little room, and nothing is sought twice but the pair that was without."""
    grown = 0
    for number in range(cases(15, 2000)):
        begin, step = way_of(number)
        answers, sought, times = [], [], []
        for room in (16384, 4):
            calls.clear()
            _, answer = way_with(begin, step, room, monkeypatch)
            answers.append(answer)
            sought.append(sum(calls))
            times.append(len(calls))
        usual, tight = answers
        assert tight.verdict is usual.verdict and tight.part == pytest.approx(usual.part, abs=1e-12), begin
        assert tight.bound == pytest.approx(usual.bound, abs=1e-12) or usual.verdict is not Verdict.CLEAR
        # Budgets are of looks: of a way that is interrupted the first one goes on with the rest of its own.
        assert sought[1] <= sought[0] + times[1] + (SWEPT_BUDGET if usual.verdict is Verdict.UNDECIDED else 0), begin
        grown += times[1] > times[0]
    assert grown > cases(2, 300)


def test_looks_that_find_no_room_are_given_up(cases, monkeypatch):
    """Last poses are those before, and the next looks go from there."""
    found = Counter()
    for number in range(cases(15, 2000)):
        begin, step = way_of(number)
        with monkeypatch.context() as less:
            less.setattr(forest, "SPARE", 4)
            proof = proof_of(begin.a.shape, begin.b.shape)
            if proof.look(poses(begin.pose), 0.0)[0].verdict is not Verdict.CLEAR:
                continue
            before = proof.last_poses()
            less.setattr(forest, "MOST", 0)
            (answer,) = proof.look(poses(step.end), 0.0, swept=True)
        found[answer.verdict] += 1
        if answer.verdict is not Verdict.UNDECIDED:
            continue
        assert (proof.fronts.pair.underway == 0.0).all()
        for one, other in zip(before, proof.last_poses(), strict=True):
            assert np.array_equal(one, other)
        _, usual = way_with(begin, step, 16384, monkeypatch)
        assert proof.look(poses(step.end), 0.0, swept=True)[0].verdict is usual.verdict
        found["again"] += 1
    assert found["again"] >= cases(1, 100) and found[Verdict.CLEAR] > 0
