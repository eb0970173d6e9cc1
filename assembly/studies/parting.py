"""Bodies that are stuck through each other at the start of a solve, parted by the shortest translations found.

Rows of a clearance separate bodies that overlap slightly. For bodies that are stuck through each other, or enclose each
other, rows may lead anywhere: a solve also begins where they are parted, and the result with the least move from the
user's poses is the answer.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.body import Body
from assembly.proximity.clearance.answers import Answer, Verdict
from assembly.proximity.clearance.least_translation import least_translation
from assembly.proximity.clearance.overlapped import balls_answer
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.solve.clearance_proof import can_prove, lent_proof
from assembly.solve.interruption import Interruption

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["is_stuck", "parted"]

Array = NDArray[np.float64]
# Rounds in which all stuck pairs are parted: parting one may push another one together.
ROUNDS = 12


def parted(scene: Assembly, q: Array, touching: float, interruption: Interruption) -> Array | None:
    """Poses near poses (n, 7) at which no bodies that clearances keep apart are stuck in each other.

    None if none overlap at q by more than `touching`, or if no way apart is found.
    """
    packed = scene.packed()
    if not can_prove(packed):
        return None
    moved = q.copy()
    with lent_proof(packed, scene.bodies) as proof:
        for _ in range(ROUNDS):
            answers = enumerate(proof.as_they_stand(moved, touching))
            stuck = [k for k, answer in answers if is_stuck(_told(proof, k, moved, answer, touching), touching)]
            if not stuck:
                return moved if (moved != q).any() else None
            for k in stuck:
                if interruption.is_over() or not _part(proof, k, moved, scene.bodies):
                    return None
    return None


def is_stuck(answer: Answer, touching: float) -> bool:
    """Whether an answer says that two bodies overlap by more than `touching`."""
    if answer.verdict is Verdict.CROSSING:
        return answer.depth > touching
    return answer.verdict is Verdict.ENCLOSED


def _told(proof: ClearanceProof, k: int, q: Array, answer: Answer, touching: float) -> Answer:
    """The answer to pair k; where cells tell nothing, as of equal bodies in one place, that of balls inside of both."""
    if answer.verdict is not Verdict.UNDECIDED:
        return answer
    return balls_answer(proof, k, q, touching) or answer


def _part(proof: ClearanceProof, k: int, q: Array, bodies: tuple[Body, ...]) -> bool:
    """Part pair k, in place: the body that is free, or each of both by half. Whether a way was found."""
    way = least_translation(proof, k, q)
    a, b = proof.pairs[k]
    if way is None or (bodies[a].fixed and bodies[b].fixed):
        return False
    share = 0.0 if bodies[b].fixed else 1.0 if bodies[a].fixed else 0.5
    q[b, :3] += share * way
    q[a, :3] -= (1.0 - share) * way
    return True
