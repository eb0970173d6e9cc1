"""Bodies that are stuck through each other at the start of a solve, parted by the shortest translations found.

Rows of a clearance lead bodies apart that are in each other by a little. Of those that are stuck through each other, or
of which one is within the other, rows may lead anywhere: a solve is begun where they are parted as well, and the least
way, measured from where the user's bodies were, is the answer.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.body import Body
from assembly.proximity.clearance.answers import Answer, Verdict
from assembly.proximity.clearance.least_translation import least_translation
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.solve.clearance_proof import can_prove, lent_proof
from assembly.solve.interruption import Interruption

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["is_stuck", "parted"]

Array = NDArray[np.float64]
# Rounds in which all pairs that are stuck are parted: to part one may drive another together.
ROUNDS = 12


def parted(scene: Assembly, q: Array, touching: float, interruption: Interruption) -> Array | None:
    """Where no bodies that clearances keep apart are stuck in each other, near poses (n, 7).

    None where none are stuck at q by more than what is called touching, and where no way apart is found.
    """
    packed = scene.packed()
    if not can_prove(packed):
        return None
    moved = q.copy()
    with lent_proof(packed, scene.bodies) as proof:
        for _ in range(ROUNDS):
            stuck = [k for k, answer in enumerate(proof.look(moved, touching)) if is_stuck(answer, touching)]
            if not stuck:
                return moved if (moved != q).any() else None
            for k in stuck:
                if interruption.is_over() or not _part(proof, k, moved, scene.bodies):
                    return None
    return None


def is_stuck(answer: Answer, touching: float) -> bool:
    """Whether an answer says that two bodies are in each other by more than what is called touching."""
    if answer.verdict is Verdict.CROSSING:
        return answer.depth > touching
    return answer.verdict is Verdict.ENCLOSED


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
