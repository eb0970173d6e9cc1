"""Proofs by hulls of faces for all pairs of bodies of a scene, before anything else is made of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.clearance.answers import Answer, Verdict
from assembly.proximity.clearance.hulls.body_hulls import hulls_of_body
from assembly.proximity.clearance.hulls.crossing import crossing_by_hulls
from assembly.proximity.clearance.hulls.pair import ROUNDING, answer_by_hulls

__all__ = ["answers_by_hulls", "crossings_by_hulls", "told_by_hulls"]

Array = NDArray[np.float64]


def answers_by_hulls(
    shapes: Sequence[tuple[Face, ...]],
    pairs: Sequence[tuple[int, int]],
    minimum: Sequence[float],
    q: Array,
    touching: float,
) -> list[Answer] | None:
    """That all pairs are clear or touch, or None at the first of which hulls do not tell it; see `told_by_hulls`."""
    found = []
    for answer in told_by_hulls(shapes, pairs, minimum, q, touching):
        if answer is None:
            return None
        found.append(answer)
    return found


def told_by_hulls(
    shapes: Sequence[tuple[Face, ...]],
    pairs: Sequence[tuple[int, int]],
    minimum: Sequence[float],
    q: Array,
    touching: float,
) -> Iterator[Answer | None]:
    """Of one pair after the other that it is clear or touches, or None where hulls do not tell it.

    Parameters
    ----------
    shapes : sequence of tuple of Face
        Of every body its faces.
    pairs : sequence of (int, int)
        Numbers of bodies.
    minimum : sequence of float
        Of every pair, what its gap is to be at least.
    q : (n, 7)
        One row per body.
    touching : float
        How far a point of a body may be taken to have the gap so large.
    """
    if not pairs:
        return
    hulls = {body: hulls_of_body(shapes[body]) for body in sorted({body for pair in pairs for body in pair})}
    turns = {body: rotation_matrix(q[body, 3:]) for body in hulls}
    middle, radius = np.zeros((len(q), 3)), np.zeros(len(q))
    for body, made in hulls.items():
        center, radius[body] = made.ball
        middle[body] = turns[body] @ center + q[body, :3]
    a, b = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    apart = np.linalg.norm(middle[b] - middle[a], axis=1) - radius[a] - radius[b]
    apart -= ROUNDING * (float(np.abs(middle).max(initial=0.0)) + radius.max(initial=0.0))
    for k, (one, other) in enumerate(pairs):
        if apart[k] > minimum[k]:
            yield Answer(Verdict.CLEAR, float(apart[k]))
            continue
        turn = turns[one].T @ turns[other]
        shift = (q[other, :3] - q[one, :3]) @ turns[one]
        yield answer_by_hulls(hulls[one], hulls[other].posed(turn, shift), float(minimum[k]), touching)


def crossings_by_hulls(
    shapes: Sequence[tuple[Face, ...]], pairs: Sequence[tuple[int, int]], q: Array, touching: float
) -> Iterator[Answer | None]:
    """Of one pair after the other that it crosses by more than `touching`, or None where hulls do not tell it.

    Parameters
    ----------
    shapes : sequence of tuple of Face
        Of every body its faces.
    pairs : sequence of (int, int)
        Numbers of bodies.
    q : (n, 7)
        One row per body.
    touching : float
    """
    for one, other in pairs:
        turns = [rotation_matrix(q[body, 3:]) for body in (one, other)]
        middles, radii = zip(*(hulls_of_body(shapes[body]).ball for body in (one, other)), strict=True)
        places = [turn @ middle + q[k, :3] for turn, middle, k in zip(turns, middles, (one, other), strict=True)]
        if float(np.linalg.norm(places[1] - places[0])) > sum(radii):
            yield None
            continue
        shift = (q[other, :3] - q[one, :3]) @ turns[0]
        found = crossing_by_hulls((shapes[one], shapes[other]), turns[0].T @ turns[1], shift, touching)
        yield found and replace(found, place=turns[0] @ found.place + q[one, :3])
