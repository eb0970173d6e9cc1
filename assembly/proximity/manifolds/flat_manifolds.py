"""Manifolds of plane faces of two bodies that lie on each other, or nearly so."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.geometry.faces.face import Face
from assembly.proximity.manifolds.flat_pair import FULL, flat_rows
from assembly.proximity.manifolds.manifold import NORMAL, Manifold
from assembly.proximity.manifolds.records import FRAME, ROW_SIZE
from assembly.proximity.manifolds.regions import PlaneRegion, plane_region

__all__ = ["flat_manifold", "flat_manifolds"]

Array = NDArray[np.float64]
# What is as near to a border is on it, in parts of the larger face's size.
ON_BORDER = 1e-12
# Places for rows that are tried first.
PLACES = 128


@dataclass(frozen=True, eq=False)
class _PlaneFaces:
    """Those of a body's faces that are regions of planes.

    Attributes
    ----------
    numbers : (f,) of int
        Which faces they are.
    regions : tuple of PlaneRegion
    points, normals : (f, 3)
    """

    numbers: NDArray[np.int64]
    regions: tuple[PlaneRegion, ...]
    points: Array
    normals: Array


@lru_cache(maxsize=256)
def _plane_faces(faces: tuple[Face, ...]) -> _PlaneFaces:
    found = [(k, region) for k, face in enumerate(faces) if (region := plane_region(face)) is not None]
    regions = tuple(region for _, region in found)
    frames = [rows_of(FRAME, region.frame[None])[0] for region in regions]
    return _PlaneFaces(
        np.array([k for k, _ in found], dtype=np.int64),
        regions,
        np.array([frame.origin for frame in frames]).reshape(-1, 3),
        np.array([frame.normal for frame in frames]).reshape(-1, 3),
    )


def flat_manifold(a: PlaneRegion, b: PlaneRegion, turn: Array, shift: Array) -> Manifold | None:
    """The manifold of two plane faces, the second one at x -> turn x + shift seen from the first.

    None where they do not face each other, or have no area in common as seen along the first normal. The bound is of
    gaps along that normal, with what the faces are off their planes taken from it: no point of the second face is
    nearer, or deeper, over one of the first.
    """
    places, rotation = PLACES, np.ascontiguousarray(turn, dtype=float).ravel()
    place = np.array(shift, dtype=float)
    tolerance = ON_BORDER * max(a.size, b.size)
    while True:
        rows = np.empty((places, ROW_SIZE))
        count, bound = flat_rows(a.frame, a.segments, b.frame, b.segments, rotation, place, tolerance, rows)
        if count != FULL:
            break
        places *= 2
    if count == 0:
        return None
    normals = rows[:count, NORMAL]
    off = a.deviation + b.deviation / sqrt((normals * normals).sum(axis=1).min())
    return Manifold.of_rows(rows[:count], float(bound) - 2.0 * off)


def flat_manifolds(
    shapes: tuple[tuple[Face, ...], tuple[Face, ...]], turn: Array, shift: Array, within: tuple[float, float]
) -> list[tuple[tuple[int, int], Manifold]]:
    """Manifolds of all pairs of plane faces of two bodies whose gaps are between two lengths wherever they face.

    Parameters
    ----------
    shapes : (tuple of Face, tuple of Face)
        Of both bodies.
    turn, shift : (3, 3), (3,)
        The second body is at x -> turn x + shift, seen from the first.
    within : (float, float)

    Returns
    -------
    list of ((int, int), Manifold)
        With the numbers of the faces.
    """
    a, b = map(_plane_faces, shapes)
    if not (len(a.numbers) and len(b.numbers)):
        return []
    low, high = within
    opposed = a.normals @ (b.normals @ turn.T).T < -0.5
    # A plane that leans is as far as asked somewhere on the faces, and nowhere farther than they are large.
    away = ((b.points @ turn.T + shift)[None] - a.points[:, None]) * a.normals[:, None]
    sizes = np.array([r.size for r in a.regions])[:, None] + np.array([r.size for r in b.regions])
    lean = np.linalg.norm(a.normals[:, None] + b.normals @ turn.T, axis=2)
    off = away.sum(axis=2)
    near = opposed & (off <= high + 2.0 * lean * sizes) & (off >= low - 2.0 * lean * sizes)
    found = []
    for i, j in np.argwhere(near).tolist():
        manifold = flat_manifold(a.regions[i], b.regions[j], turn, shift)
        if manifold is not None and low <= manifold.gaps.min() and manifold.gaps.max() <= high:
            found.append(((int(a.numbers[i]), int(b.numbers[j])), manifold))
    return found
