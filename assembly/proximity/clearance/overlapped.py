"""Bodies that overlap where cells do not tell, because faces lie on each other.

Equal bodies in one place have no cells that cross. Balls inside of both that overlap tell that they do.

Others overlap behind flat faces, by less than samples detect. Two flat faces that look at each other from inside do not
tell that bodies cross: they may be far sides of thin parts, or belong to bodies that are beside each other there. A
ball between both planes that is inside of both bodies does.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.shapes.surfaces import sphere
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.brep.solid import solid_of
from assembly.proximity.clearance.answers import Answer, Verdict
from assembly.proximity.clearance.inscribed import overlaps_at
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.proximity.features.body_distance import DistanceStatus, distance
from assembly.proximity.manifolds.flat_manifolds import flat_manifolds

__all__ = ["balls_answer", "overlap_answer"]

Array = NDArray[np.float64]
# [size of the bodies] Flat faces that are deeper in each other are seen by samples.
_DEEPEST = 1e-3
# The ball's radius, over the distance of both planes.
_PART = 0.25
_IDENTITY = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


def balls_answer(proof: ClearanceProof, k: int, q: Array, touching: float) -> Answer | None:
    """That bodies of pair k cross at poses q (n, 7), by balls inside of each that overlap by more; None if none do."""
    a, b = proof.pairs[k]
    overlaps = overlaps_at((proof.faces[a], proof.faces[b]), (q[a], q[b]))
    if not len(overlaps.radii):
        return None
    depth, place = overlaps.deepest()
    return Answer(Verdict.CROSSING, depth=depth, place=place) if depth > touching else None


def overlap_answer(proof: ClearanceProof, k: int, q: Array, touching: float) -> Answer | None:
    """That bodies of pair k cross at poses q (n, 7), by a ball inside of both between two flat faces; None if not.

    The depth is that of the two planes: what the bodies are to be moved by along the normal, as these faces have it.
    """
    numbers = proof.pairs[k]
    shapes = proof.faces[numbers[0]], proof.faces[numbers[1]]
    if not all(solid_of(faces).is_closed for faces in shapes):
        return None
    turn, shift = proof.relative(k, q)
    found = flat_manifolds(shapes, turn, shift, (-_DEEPEST * proof.size(k), -touching))
    for _, manifold in sorted(found, key=lambda item: float(item[1].gaps.mean())):
        depth = -float(manifold.gaps.mean())
        if manifold.gaps.max() > -touching:
            continue
        middle = manifold.places.mean(axis=0) + 0.5 * depth * manifold.normals.mean(axis=0)
        first = rotation_matrix(q[numbers[0], 3:])
        point = first @ middle + q[numbers[0], :3]
        if all(_has_inside(faces, q[body], point, _PART * depth) for faces, body in zip(shapes, numbers, strict=True)):
            return Answer(Verdict.CROSSING, depth=depth, place=point)
    return None


def _has_inside(faces: tuple[Face, ...], row: Array, point: Array, radius: float) -> bool:
    """Whether a ball is wholly inside of a body at a pose."""
    at = np.concatenate([point, _IDENTITY[3:]])
    return distance(faces, _ball(radius), poses=(row, at), tolerance=0.1 * radius).status is DistanceStatus.ENCLOSED


@lru_cache(maxsize=16)
def _ball(radius: float) -> Face:
    return Face(sphere(radius))
