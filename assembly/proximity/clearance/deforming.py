"""Bodies that hold each other without play: an affine map of one of them that opens every face that lies on another.

A map T that takes no point of a body farther than t does what slimming does (`slimming.py`): a ball of a larger radius
than t in what both bodies have in common has its middle m in the body that is mapped, and T(m) in the ball, and so in
the other body. Where the mapped body is clear of that there is no such ball. T need not be rigid: a key that is made
smaller is clear of both flanks of its keyway, and a translation takes it off the floor. So asked is

    the least |v|^2 + R^2 |W|^2   with   n_i.(v + W p_i) >= g - gap_i   for all rows i of all contact manifolds,

first with W = s I, after which what is round still is, and has an exact hull; then with any W.
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
from assembly.proximity.clearance.cones import seated_answer
from assembly.proximity.clearance.overlapped import balls_answer, overlap_answer
from assembly.proximity.clearance.parting import least_affine, least_similar
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.proximity.clearance.records import NODE
from assembly.proximity.clearance.slimming import slim_answer
from assembly.proximity.clearance.touching import OPENED
from assembly.proximity.manifolds.flat_manifolds import flat_manifolds
from assembly.proximity.manifolds.line_manifolds import line_manifolds

__all__ = ["deformed_answer", "smaller_answer"]

Array = NDArray[np.float64]
Faces = tuple[Face, ...]


def smaller_answer(proof: ClearanceProof, k: int, q: Array, touching: float) -> Answer | None:
    """What is proven of pair k with one body made slimmer, taken off its seat, or mapped; None if nothing is.

    That they cross where they lie on each other, too: samples do not see what is in each other by little.
    """
    crossing = balls_answer(proof, k, q, touching)
    if crossing is not None:
        return crossing
    shapes = tuple(proof.faces[body] for body in proof.pairs[k])
    slim = slim_answer(proof, k, q, touching, (shapes[0], shapes[1]))
    if slim is not None:
        return slim
    seated = seated_answer(proof, k, q, touching)
    if seated is not None:
        return seated
    deformed = deformed_answer(proof, k, q, touching)
    return overlap_answer(proof, k, q, touching) if deformed is None else deformed


def deformed_answer(proof: ClearanceProof, k: int, q: Array, touching: float) -> Answer | None:
    """What is proven of pair k, whose faces lie on each other, by an affine map of one body; None if nothing is.

    Parameters
    ----------
    proof : ClearanceProof
    k : int
    q : (n, 7)
    touching : float
        How far a point may be taken.
    """
    shapes = tuple(proof.faces[body] for body in proof.pairs[k])
    turn, shift = proof.relative(k, q)
    least = float(proof.minimum[k])
    both, within = (shapes[0], shapes[1]), (least - touching, least + touching)
    found = [*flat_manifolds(both, turn, shift, within), *line_manifolds(both, turn, shift, within)]
    if not found:
        return None
    normals, places, gaps = (
        np.concatenate([getattr(manifold, name) for _, manifold in found]) for name in ("normals", "places", "gaps")
    )
    cells, at = proof.cells_of(k), q[list(proof.pairs[k])]
    arms = places - (turn @ cells.middle + shift)
    for least_map in (least_similar, least_affine):
        # What opens by a part of what a point may be taken, with the first part for which none is taken farther.
        for part in OPENED if touching > 0.0 else ():
            opening = least_map(normals, arms, part * touching - (gaps - least), cells.extent)
            if opening is None:
                break
            # Of the second body, in its own axes.
            matrix = turn.T @ opening[1:].T @ turn
            offset = turn.T @ opening[0] - matrix @ cells.middle
            far = _farthest(cells, matrix, offset)
            if far <= touching:
                mapped = _mapped(shapes[1], tuple(matrix.ravel().tolist()), tuple(offset.tolist()))
                (answer,) = ClearanceProof((shapes[0], mapped), [(0, 1)], [least]).look(at, touching)
                if answer.verdict is Verdict.CLEAR:
                    return Answer(Verdict.TOUCHING, answer.bound - far, far)
                break
    return None


def _farthest(cells: BodyCells, matrix: Array, offset: Array) -> float:
    """How far x -> x + matrix x + offset takes a point of a body, at most: it does so at a corner of its cells."""
    nodes = rows_of(NODE, cells.nodes)[cells.first]
    far = np.linalg.norm(nodes.corner @ matrix.T + offset, axis=2).max(axis=1)
    return float((far + np.linalg.norm(matrix) * (nodes.disc + nodes.rho)).max())


@lru_cache(maxsize=128)
def _mapped(faces: Faces, matrix: tuple[float, ...], offset: tuple[float, ...]) -> Faces:
    """The faces of a body after x -> x + matrix x + offset."""
    strain, shift = np.array(matrix).reshape(3, 3), np.array(offset)
    made = []
    for face in faces:
        surface = face.surface
        points = surface.control_points + (surface.control_points @ strain.T + shift)
        mapped = NurbsSurface(points, surface.knots, surface.degree, surface.weights)
        made.append(Face(mapped, face.outer, face.holes, name=face.name, reversed=face.reversed))
    return tuple(made)
