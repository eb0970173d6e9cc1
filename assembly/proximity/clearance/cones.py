"""Cones in their seats: a translation opens them, but no cells are fine enough to tell.

Of a gap g between two cones cells tell once their chords are off by less: that takes (size / g)^(1/2) of them around,
and g is a part of what is called touching. So faces of both bodies are parted by levels of the seat's cone, and of flat
faces that touch as well (`levels.py`), and cells are asked of those that none of these parts.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.forms import Cone
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.brep.solid import solid_of
from assembly.proximity.clearance.answers import Answer, Verdict
from assembly.proximity.clearance.levels import Level
from assembly.proximity.clearance.parting import least_shift
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.proximity.clearance.touching import OPENED
from assembly.proximity.manifolds.elementary_faces import ElementaryFace, elementary_faces
from assembly.proximity.manifolds.flat_manifolds import flat_manifolds
from assembly.proximity.manifolds.records import FRAME
from assembly.proximity.manifolds.regions import plane_region
from assembly.proximity.manifolds.round_manifolds import round_manifolds

__all__ = ["seated_answer"]

Array = NDArray[np.float64]
Faces = tuple[Face, ...]
# What rounding does to a level, in parts of the largest coordinates: some thirty roundings.
ROUNDING = 8e-15


class _Parting(NamedTuple):
    """A level, in the axes of the first body; which body is outside of it, and of that the face that is the wall."""

    level: Level
    outer: int
    wall: int | None


class _Moved(NamedTuple):
    """Poses (2, 7) of two bodies, a move (1, 6) of the second one, and what their distance is to be more than."""

    at: Array
    move: Array
    least: float


def seated_answer(proof: ClearanceProof, k: int, q: Array, touching: float) -> Answer | None:
    """What is proven of pair k, of which a cone lies in a hollow one, by a translation; None if nothing is.

    Parameters
    ----------
    proof : ClearanceProof
    k : int
    q : (n, 7)
    touching : float
        How far a point may be taken.
    """
    turn, shift = proof.relative(k, q)
    least = float(proof.minimum[k])
    shapes = tuple(solid_of(proof.faces[body]).faces for body in proof.pairs[k])
    both = (shapes[0], shapes[1])
    cones = (_cones(both[0]), _cones(both[1]))
    within = (least - touching, least + touching)
    seats = round_manifolds((tuple(cones[0].values()), tuple(cones[1].values())), turn, shift, within)
    if not seats:
        return None
    flats = flat_manifolds(both, turn, shift, within)
    rows = [manifold for _, manifold in [*seats, *flats]]
    normals, gaps = (np.concatenate([getattr(rows_, name) for rows_ in rows]) for name in ("normals", "gaps"))
    for part in OPENED if touching > 0.0 else ():
        move = least_shift(normals, part * touching - (gaps - least))
        if move is None:
            return None
        if np.linalg.norm(move) <= touching:
            break
    else:
        return None
    pose = (turn, shift + move)
    levels = [_of_seat(both, (list(cones[0])[i], list(cones[1])[j]), pose) for (i, j), _ in seats]
    levels += [_of_plane(both[0][i]) for (i, _), _ in flats]
    at, moved = q[list(proof.pairs[k])], np.zeros((1, 6))
    moved[0, :3] = rotation_matrix(at[0, 3:]) @ move
    bound = _parted(both, levels, pose, _Moved(at, moved, least))
    if bound is None:
        return None
    far = float(np.linalg.norm(move))
    return Answer(Verdict.TOUCHING, bound - far, far)


def _cones(faces: Faces) -> dict[int, ElementaryFace]:
    """Those of a body's faces that are cones, by their numbers."""
    found = {k: elementary_faces((face,)) for k, face in enumerate(faces)}
    return {k: one[0] for k, one in found.items() if one and isinstance(one[0].form, Cone)}


def _parted(
    shapes: tuple[Faces, Faces], levels: list[_Parting], pose: tuple[Array, Array], asked: _Moved
) -> float | None:
    """A lower bound of the distance of two bodies, neither of which is in the other one; None where none is known.

    Parameters
    ----------
    shapes : (tuple of Face, tuple of Face)
    levels : list of _Parting
    pose : (3, 3), (3,)
        The second body, seen from the first.
    asked : _Moved
        The same in the world, and what the distance has to be more than.
    """
    gaps = np.full((len(shapes[0]), len(shapes[1])), -np.inf)
    far = np.abs(np.concatenate([face.surface.control_points.reshape(-1, 3) for both in shapes for face in both])).max()
    needed = asked.least + ROUNDING * (far + np.linalg.norm(pose[1]))
    for level in levels:
        gaps = np.maximum(gaps, _level_gaps(shapes, level, pose))
    bound = float(gaps[gaps > needed].min(initial=np.inf))
    partners: dict[bytes, list[int]] = {}
    for i, row in enumerate(gaps <= needed):
        if row.any():
            partners.setdefault(row.tobytes(), []).append(i)
    for row, some in partners.items():
        others = np.flatnonzero(np.frombuffer(row, dtype=bool)).tolist()
        pieces = [tuple(shapes[0][i] for i in some), tuple(shapes[1][j] for j in others)]
        some_proof = ClearanceProof(pieces, [(0, 1)], [asked.least])
        (answer,) = some_proof.look(asked.at, 0.0, asked.move)
        if answer.verdict is not Verdict.TOUCHING:
            return None
        bound = min(bound, some_proof.bound(0))
    whole = ClearanceProof(shapes, [(0, 1)], [asked.least])
    last = whole.fronts.pair
    last.turn[0], last.shift[0] = pose[0].ravel(), pose[1]
    return bound if whole.nested(0) is False else None


def _level_gaps(shapes: tuple[Faces, Faces], parting: _Parting, pose: tuple[Array, Array]) -> Array:
    """How far faces of the first body are from faces of the second one, at least, by one level."""
    level, outer, wall = parting
    other = level.seen_from(*pose)
    if outer == 0:
        return np.subtract.outer(level.least_of_faces(shapes[0], wall), other.most_of_faces(shapes[1]))
    return np.add.outer(-level.most_of_faces(shapes[0]), other.least_of_faces(shapes[1], wall))


def _of_seat(shapes: tuple[Faces, Faces], wall: tuple[int, int], pose: tuple[Array, Array]) -> _Parting:
    """The level of a hollow cone, which is a face of either body."""
    faces = [elementary_faces((both[k],))[0] for both, k in zip(shapes, wall, strict=True)]
    outer = int(faces[0].is_outward)
    form = faces[outer].form
    assert isinstance(form, Cone)
    level = Level(form.apex, form.axis, form.half_angle)
    if outer == 1:
        turn, shift = pose
        level = level.seen_from(turn.T, -turn.T @ shift)
    return _Parting(level, outer, wall[outer])


def _of_plane(face: Face) -> _Parting:
    """The level of a flat face of the first body."""
    region = plane_region(face)
    assert region is not None
    frame = rows_of(FRAME, region.frame[None])[0]
    return _Parting(Level(frame.origin.copy(), frame.normal.copy(), -0.5 * np.pi), 1, None)
