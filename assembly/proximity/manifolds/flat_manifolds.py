"""Manifolds of plane faces of two bodies that lie on each other, or nearly so."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.proximity.manifolds.flat_pair import FULL, flat_rows
from assembly.proximity.manifolds.manifold import NORMAL, Manifold
from assembly.proximity.manifolds.records import ROW_SIZE
from assembly.proximity.manifolds.regions import PlaneRegion, plane_of, plane_region

__all__ = ["flat_manifold", "flat_manifolds"]

Array = NDArray[np.float64]
# What is as near to a border is on it, in parts of the larger face's size.
ON_BORDER = 1e-12
# Places for rows that are tried first.
PLACES = 128


@dataclass(frozen=True, eq=False)
class _PlaneFaces:
    """Those of a body's faces that are in planes; regions are made of those only that lie near another body's.

    Attributes
    ----------
    numbers : list of int
        Which faces they are.
    faces : list of Face
    points, normals : (f, 3)
    sizes : (f,)
    """

    numbers: list[int]
    faces: list[Face]
    points: Array
    normals: Array
    sizes: Array


@lru_cache(maxsize=256)
def _plane_faces(faces: tuple[Face, ...]) -> _PlaneFaces:
    found = [(k, face, *plane) for k, face in enumerate(faces) if (plane := plane_of(face)) is not None]
    return _PlaneFaces(
        [k for k, *_ in found],
        [face for _, face, *_ in found],
        np.array([point for *_, point, _ in found]).reshape(-1, 3),
        np.array([normal for *_, normal in found]).reshape(-1, 3),
        np.array([face.surface.size for _, face, *_ in found]),
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
    if not (a.numbers and b.numbers):
        return []
    low, high = within
    opposed = a.normals @ (b.normals @ turn.T).T < -0.5
    # A plane that leans is as far as asked somewhere on the faces, and nowhere farther than they are large.
    away = ((b.points @ turn.T + shift)[None] - a.points[:, None]) * a.normals[:, None]
    sizes = a.sizes[:, None] + b.sizes
    lean = np.linalg.norm(a.normals[:, None] + b.normals @ turn.T, axis=2)
    off = away.sum(axis=2)
    near = opposed & (off <= high + 2.0 * lean * sizes) & (off >= low - 2.0 * lean * sizes)
    found = []
    for i, j in np.argwhere(near).tolist():
        one, other = plane_region(a.faces[i]), plane_region(b.faces[j])
        manifold = None if one is None or other is None else flat_manifold(one, other, turn, shift)
        if manifold is not None and low <= manifold.gaps.min() and manifold.gaps.max() <= high:
            found.append(((a.numbers[i], b.numbers[j]), manifold))
    return found
