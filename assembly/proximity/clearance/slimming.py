"""Bodies that fill bores of their own radius: no move opens them, but one of the two made slimmer is clear.

About the axis of a cylinder, or the center of a ball, by P across the axis, or all of it,

    T(x) = x - s P (x - c)

takes no point of the body farther than s times its radius R from there. A ball in what both bodies have in common, of a
larger radius, has its middle m in the body that is made slimmer: T(m) is in the slimmer one, and no farther from m than
that, so that it is in the ball, and in the other body. Where these two are clear there is no such ball. So it is with a
translation after T, which takes the slimmer body off flat faces.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity.clearance.answers import Answer, Verdict
from assembly.proximity.clearance.body_cells import BodyCells
from assembly.proximity.clearance.kept_proofs import kept_proof
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.proximity.clearance.records import NODE
from assembly.proximity.clearance.touching import filled_bore, off_contacts

__all__ = ["slim_answer"]

Array = NDArray[np.float64]
Faces = tuple[Face, ...]
# Of what bodies may be in each other, the part that one of them is made slimmer by; the rest is for a translation. The
# wider gaps are, the fewer cells it takes to tell that they are there.
SLIMMER = 0.95


def slim_answer(proof: ClearanceProof, k: int, q: Array, touching: float, shapes: tuple[Faces, Faces]) -> Answer | None:
    """What is proven of pair k where one body fills a bore of the other one, by making it slimmer; None if nothing is.

    Parameters
    ----------
    proof : ClearanceProof
    k : int
    q : (n, 7)
    touching : float
        How far a point may be taken in all.
    shapes : (tuple of Face, tuple of Face)
        Of both bodies.
    """
    found = filled_bore(proof, k, q, touching)
    if found is None:
        return None
    inner, ends = found
    center, across = ends.mean(axis=0), _across(ends)
    radius = _radius(proof.cells_of_both(k)[inner], center, across)
    part = SLIMMER * touching / radius
    slim = _slimmer(shapes[inner], tuple(center.tolist()), tuple(across.ravel().tolist()), part)
    both = (slim, shapes[1]) if inner == 0 else (shapes[0], slim)
    at = q[list(proof.pairs[k])]
    left = (1.0 - SLIMMER) * touching
    with kept_proof(both, [(0, 1)], [float(proof.minimum[k])]) as other:
        move = off_contacts(other, 0, at, left, lambda: None)
        if move is None:
            return None
        (answer,) = other.look(at, touching, move[None])
    if answer.verdict not in (Verdict.CLEAR, Verdict.TOUCHING):
        return None
    return Answer(Verdict.TOUCHING, answer.bound - SLIMMER * touching, answer.depth + SLIMMER * touching)


def _across(ends: Array) -> Array:
    """What is across the axis through two points, as a matrix; all of it where they are one."""
    way = ends[1] - ends[0]
    length = float(np.linalg.norm(way))
    return np.eye(3) if length == 0.0 else np.eye(3) - np.outer(way, way) / length**2


def _radius(cells: BodyCells, center: Array, across: Array) -> float:
    """How far a body reaches from an axis or a center, at most."""
    nodes = rows_of(NODE, cells.nodes)[cells.first]
    off = np.linalg.norm((nodes.corner - center) @ across, axis=2).max(axis=1)
    return float((off + nodes.disc + nodes.rho).max())


@lru_cache(maxsize=128)
def _slimmer(faces: Faces, center: tuple[float, ...], across: tuple[float, ...], part: float) -> Faces:
    """The faces of a body that is made slimmer."""
    c, p = np.array(center), np.array(across).reshape(3, 3)
    made = []
    for face in faces:
        surface = face.surface
        points = surface.control_points - part * (surface.control_points - c) @ p
        slim = NurbsSurface(points, surface.knots, surface.degree, surface.weights)
        made.append(Face(slim, face.outer, face.holes, name=face.name, reversed=face.reversed))
    return tuple(made)
