"""What ticks promise under clearances, proven: at their poses bodies are clear or touch, and on the way to them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.clearance.answers import Answer, Contacts, Verdict, is_proven
from assembly.proximity.clearance.conforming import conforms
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.solve.clearance_proof import near_contacts, new_proof, opening_move
from assembly.solve.solution import Solution

__all__ = ["ClearTicks", "WayLimits"]

Array = NDArray[np.float64]
# Pairs of nodes that a look takes for a pair of bodies; and in ticks after one that holds, which are brief: what is not
# proven costs all of them, and the tick after it looks longer.
BUDGET, BRIEF_BUDGET = 4000, 1000
# How deep the way of a contact that rolls may go in, in parts of the square of its length over the least radius: a
# chord of a curve of radius r is s^2 / (8 r) off it, there are two, and a contact may go farther than the bodies.
ROLLED = 1.0
# Parts of it that bodies are opened by, one after the other: as they are, they may cross elsewhere. A brief tick tries
# the first only: where that is not proven the next one goes a quarter as far, by which it opens a sixteenth.
OPENED = (1.0, 0.1, 0.01)
# The part of what is called touching that such a way may go in without being opened.
SLIGHTLY = 0.1
# It may go in by so much of the size in any case: directions that part bodies are then found at once.
ROOM = 1e-6
# Contacts that are nearer, in parts of the size, are remembered of a pose.
NEAR = 1e-2


class _Standing:
    """Where bodies of a solution stand, and which contacts are near there, once that is asked."""

    def __init__(self, solution: Solution) -> None:
        self.solution = solution
        self.q = solution.q
        self._near: dict[int, Contacts] | None = None

    def near(self, proof: ClearanceProof) -> dict[int, Contacts]:
        """The contacts that are near, by the number of their pair."""
        if self._near is None:
            self._near = near_contacts(self.solution, proof, NEAR * max(map(proof.size, range(len(proof.pairs)))))
        return self._near

    def opened(self, proof: ClearanceProof, k: int, depth: float) -> Array:
        """The least move (6) of the second body of pair k, by no more than a depth, that opens its contacts."""
        return opening_move(proof, k, self.q, self.near(proof).get(k), depth)


class WayLimits(NamedTuple):
    """Where ways of bodies that touch end to be known.

    Attributes
    ----------
    sampled : float
        How far bodies whose faces lie on each other may go in one way, in parts of their size.
    depth : float
        How deep a way may go in, in the unit of the scene.
    """

    sampled: float = np.inf
    depth: float = np.inf


class ClearTicks:
    """The proofs of the pairs that a tracker's clearances keep apart, from tick to tick.

    At its pose a tick is proven to what is called touching. The straight way between two ticks that touch goes in by
    what is quadratic in its length: what is proven is the way of bodies that are opened by so much, from the last pose,
    where they are opened, to this one, where they are closed again.

    Parameters
    ----------
    first : Solution
        Where the tracker begins.
    touching : float
        What bodies may be in each other and touch, in the unit of the scene.
    proof : ClearanceProof, optional
        That of the same pairs, whose last poses are forgotten.
    limits : WayLimits

    Attributes
    ----------
    doubtful : dict of int -> Answer
        Where the last tick does not hold, or the first one: the pairs of which it is not known.
    proved : bool
        Whether all pairs were proven clear, or touching, at the last tick that holds; else faces lie on each other.
    way_depth : float
        How deep bodies may be in each other on the way to it, at most.
    """

    def __init__(
        self,
        first: Solution,
        touching: float,
        proof: ClearanceProof | None = None,
        limits: WayLimits | None = None,
    ) -> None:
        self._touching, self._limits = touching, limits or WayLimits()
        # What others lend looks as long as they say.
        self._is_lent, self._is_brief = proof is not None, False
        if proof is None:
            proof = new_proof(first._packed, first._scene.bodies)
            proof.fronts.counts.budget = BUDGET
        proof.forget_poses()
        self._proof = proof
        self._at = _Standing(first)
        self._moves = np.array([self._at.opened(self._proof, k, touching) for k in range(len(self._proof.pairs))])
        self.way_depth = 0.0
        answers = dict(enumerate(proof.look(first.q, touching, self._moves)))
        self.proved = all(map(is_proven, answers.values()))
        self.doubtful = self._not_known(answers, self._at)

    def holds(self, solution: Solution) -> bool:
        """Whether all pairs hold at the pose of a tick, and on the way there from the last one that did.

        The solution is of a state that nobody writes to.
        """
        held = self._holds(solution)
        if not self._is_lent:
            self._is_brief = held
            self._proof.fronts.counts.budget = BRIEF_BUDGET if held else BUDGET
        return held

    def _holds(self, solution: Solution) -> bool:
        proof, touching = self._proof, self._touching
        there, moves = _Standing(solution), self._moves
        self.way_depth = 0.0
        rolling, last = self._rolling(there), proof.last_poses()
        # Contacts stay for many ticks, and so does what opens them.
        if not rolling and proof.stays_clear(there.q, touching, moves):
            self._at, self.proved = there, True
            return True
        answers: dict[int, Answer] = {}
        # Where a long way may not go in by its square, one along flat faces still may do.
        rolling = [k for k in rolling if self._may_go_in(k, there, OPENED[0])]
        others = [k for k in range(len(proof.pairs)) if k not in rolling]
        for k, answer in zip(others, proof.look(there.q, touching, moves, others, swept=True), strict=True):
            answers[k] = answer
            if not is_proven(answer):
                rolling.append(k)
        if rolling:
            moves = moves.copy()
            for k in rolling:
                moves[k] = there.opened(proof, k, touching)
            for part in OPENED[:1] if self._is_brief else OPENED:
                left = [
                    k
                    for k in rolling
                    if not (k in answers and is_proven(answers[k])) and self._may_go_in(k, there, part)
                ]
                answers.update(zip(left, self._rolled(there, moves, left, part), strict=True) if left else ())
        self.doubtful = self._not_known(answers, there)
        if self.doubtful:
            proof.go_back(last)
            return False
        self.proved = all(map(is_proven, answers.values()))
        self._at, self._moves = there, moves
        return True

    def _not_known(self, answers: dict[int, Answer], there: _Standing) -> dict[int, Answer]:
        """The pairs that are not proven to be clear, or to touch, and whose faces do not lie on each other."""
        proof, q = self._proof, there.q
        return {
            k: answer
            for k, answer in answers.items()
            if not is_proven(answer)
            and not (
                answer.verdict is Verdict.UNDECIDED
                and conforms(proof, k, q, self._touching)
                and proof.way_length(k, self._at.q, q) <= self._limits.sampled * proof.size(k)
            )
        }

    def _rolling(self, there: _Standing) -> list[int]:
        """The pairs that touch and go so far that the straight way goes in by what counts beside what is touching."""
        proof, q = self._proof, self._at.q
        found = []
        for k in np.flatnonzero(self._moves.any(axis=1)).tolist():
            way = proof.way_length(k, q, there.q)
            if ROLLED * way * way > SLIGHTLY * self._touching * proof.radius(k):
                found.append(k)
        return found

    def _may_go_in(self, k: int, there: _Standing, part: float) -> bool:
        """Whether pair k may go in by a part of what it may if it touches all along."""
        return self._limits.depth == np.inf or self._roll_depth(k, there, part) <= self._limits.depth

    def _roll_depth(self, k: int, there: _Standing, part: float) -> float:
        """A part of what the way of pair k may go in if it touches all along."""
        way = self._proof.way_length(k, self._at.q, there.q)
        return max(part * ROLLED * way * way / self._proof.radius(k), ROOM * self._proof.size(k))

    def _rolled(self, there: _Standing, moves: Array, which: list[int], part: float) -> list[Answer]:
        """What is proven of pairs that are opened on the way, by a part of what it may go in."""
        proof, begin = self._proof, self._at
        before, after = self._moves.copy(), moves.copy()
        for k in which:
            depth = self._roll_depth(k, there, part)
            self.way_depth = max(self.way_depth, depth)
            for standing, opened in ((begin, before), (there, after)):
                move = standing.opened(proof, k, depth)
                if move.any():
                    opened[k] = move
        opened_at = dict(zip(which, proof.look(begin.q, self._touching, before, which=which, swept=True), strict=True))
        known = [k for k in which if is_proven(opened_at[k])]
        ways = proof.look(there.q, self._touching, after, which=known, swept=True) if known else []
        known = [k for k, answer in zip(known, ways, strict=True) if is_proven(answer)]
        # Where the way is not known, a pose at its end that is clear is none that was come to.
        ends = proof.look(there.q, self._touching, moves, which=which, swept=True)
        return [
            answer if k in known or not is_proven(answer) else Answer(Verdict.UNDECIDED)
            for k, answer in zip(which, ends, strict=True)
        ]
