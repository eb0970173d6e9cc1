"""What ticks promise under clearances, proven: at their poses bodies are clear or touch, and on the way to them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.clearance.proof import Answer, ClearanceProof, Verdict, is_proven
from assembly.solve.clearance_proof import new_proof, opening_moves
from assembly.solve.solution import Solution

__all__ = ["ClearTicks"]

Array = NDArray[np.float64]
# Pairs of nodes that a tick looks at for a pair of bodies.
BUDGET = 4000
# How deep the way of a contact that rolls may go in, times the square of its length over the size: a chord of a curve of
# radius r is s^2 / (8 r) off it, and the arc of a body that turns as much.
ROLLED = 4.0
# It may go in by so much of the size in any case: directions that part bodies are then found at once.
ROOM = 1e-6


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

    Attributes
    ----------
    proved : bool
        Whether all pairs were proven clear, or touching, at the last tick that holds; else faces lie on each other.
    way_depth : float
        How deep bodies may be in each other on the way to it, at most.
    """

    def __init__(self, first: Solution, touching: float) -> None:
        self._touching = touching
        self._proof: ClearanceProof = new_proof(first._packed, first._scene.bodies)
        self._proof.fronts.counts.budget = BUDGET
        self._moves = np.zeros((len(self._proof.pairs), 6))
        self._q = first.q
        self.proved, self.way_depth = True, 0.0
        self._moves = opening_moves(first, self._proof, touching)
        self.proved = all(map(is_proven, self._proof.look(first.q, touching, self._moves)))

    def holds(self, solution: Solution) -> bool:
        """Whether all pairs hold at the pose of a tick, and on the way there from the last one that did."""
        proof, q = self._proof, solution.q
        answers = proof.look(q, self._touching, self._moves, swept=True)
        left = [k for k, answer in enumerate(answers) if not is_proven(answer)]
        self.way_depth = 0.0
        moves = self._moves
        if left:
            opened = opening_moves(solution, proof, self._touching)
            moves = moves.copy()
            moves[left] = opened[left]
            for k, answer in zip(left, self._rolled(q, moves, left), strict=True):
                answers[k] = answer
        self.proved = all(map(is_proven, answers))
        doubtful = [(k, answer) for k, answer in enumerate(answers) if not is_proven(answer)]
        if not all(
            answer.verdict is Verdict.UNDECIDED and proof.conforms(k, q, self._touching) for k, answer in doubtful
        ):
            return False
        self._q, self._moves = q, moves
        return True

    def _rolled(self, q: Array, moves: Array, which: list[int]) -> list[Answer]:
        """What is proven of pairs that are opened on the way."""
        proof = self._proof
        before, after = self._moves.copy(), moves.copy()
        for k in which:
            way = proof.way_length(k, self._q, q)
            depth = max(ROLLED * way * way / proof.size(k), ROOM * proof.size(k))
            self.way_depth = max(self.way_depth, depth)
            for pose, move in ((self._q, before[k]), (q, after[k])):
                length = proof.move_length(k, pose, move)
                if 0.0 < length < depth:
                    move *= depth / length
        proof.look(self._q, self._touching, before, which=which, swept=True)
        proof.look(q, self._touching, after, which=which, swept=True)
        return proof.look(q, self._touching, moves, which=which, swept=True)
