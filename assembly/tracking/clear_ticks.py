"""What ticks promise under clearances, proven: at their poses bodies are clear or touch, and on the way to them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.clearance.proof import ClearanceProof, Verdict, is_proven
from assembly.solve.clearance_proof import new_proof, opening_moves
from assembly.solve.solution import Solution

__all__ = ["ClearTicks"]

Array = NDArray[np.float64]
# Pairs of nodes that a tick looks at for a pair of bodies.
BUDGET = 4000


class ClearTicks:
    """The proofs of the pairs that a tracker's clearances keep apart, from tick to tick.

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
    """

    def __init__(self, first: Solution, touching: float) -> None:
        self._touching = touching
        self._proof: ClearanceProof = new_proof(first._packed, first._scene.bodies)
        self._proof.fronts.counts.budget = BUDGET
        self._moves = np.zeros((len(self._proof.pairs), 6))
        self.proved = True
        self.holds(first)

    def holds(self, solution: Solution) -> bool:
        """Whether all pairs hold at the pose of a tick, and on the way there from the last one that did."""
        proof, q = self._proof, solution.q
        # Contacts stay for many ticks, and so does what opens them.
        answers = proof.look(q, self._touching, self._moves, swept=True)
        left = [k for k, answer in enumerate(answers) if not is_proven(answer)]
        if left:
            self._moves = opening_moves(solution, proof, self._touching)
            for k, answer in zip(left, proof.look(q, self._touching, self._moves, which=left, swept=True), strict=True):
                answers[k] = answer
        self.proved = all(map(is_proven, answers))
        doubtful = [(k, answer) for k, answer in enumerate(answers) if not is_proven(answer)]
        return all(
            answer.verdict is Verdict.UNDECIDED and proof.conforms(k, q, self._touching) for k, answer in doubtful
        )
