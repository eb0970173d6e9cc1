"""Manifolds of cylinders in bores and of cones in hollow cones, of two bodies."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.geometry.recognition.forms import Cone, Cylinder
from assembly.proximity.manifolds.elementary_faces import ElementaryFace
from assembly.proximity.manifolds.manifold import Manifold
from assembly.proximity.manifolds.records import ROUND, ROUND_SIZE, ROW_SIZE
from assembly.proximity.manifolds.round_pair import ROWS_OF_RING, round_rows

__all__ = ["round_manifold", "round_manifolds", "round_record"]

Array = NDArray[np.float64]
Faces = tuple[ElementaryFace, ...]
# Of cones that differ by more than this, neither is the other one's seat [rad].
SAME_ANGLE = 1e-6


@lru_cache(maxsize=256)
def round_record(form: Cylinder | Cone) -> Array:
    """The ROUND record of a surface, kept."""
    record = np.zeros(ROUND_SIZE)
    one = rows_of(ROUND, record[None])[0]
    one.axis, (one.low, one.high) = form.axis, form.heights
    if isinstance(form, Cone):
        one.origin, one.half_angle = form.apex, form.half_angle
    else:
        one.origin, one.radius = form.point, form.radius
    return record


def round_manifold(hollow: Cylinder | Cone, full: Cylinder | Cone, turn: Array, shift: Array) -> Manifold | None:
    """The manifold of a cylinder in a bore, or of a cone in a hollow one, which is at x -> turn x + shift.

    Its rows lead from the hollow wall to what is full, in the axes of the first, all around; which part of either is
    there is not asked. None where they have nothing in common along the axis, or lean by more than 60 degrees. The
    bound is that of `round_rows`, with what the faces are off taken from it.
    """
    rows = np.zeros((2 * ROWS_OF_RING, ROW_SIZE))
    rotation, place = np.ascontiguousarray(turn, dtype=float).ravel(), np.array(shift, dtype=float)
    count, bound = round_rows(round_record(hollow), round_record(full), rotation, place, rows)
    if count == 0:
        return None
    return Manifold.of_rows(rows[:count], float(bound) - hollow.deviation - full.deviation)


def round_manifolds(
    shapes: tuple[Faces, Faces], turn: Array, shift: Array, within: tuple[float, float]
) -> list[tuple[tuple[int, int], Manifold]]:
    """Manifolds of all pairs of a bore and a shaft, or a cone and its seat, whose gaps are all between two lengths.

    Parameters
    ----------
    shapes : (tuple of ElementaryFace, tuple of ElementaryFace)
        Of both bodies.
    turn, shift : (3, 3), (3,)
        The second body is at x -> turn x + shift, seen from the first.
    within : (float, float)

    Returns
    -------
    list of ((int, int), Manifold)
        With the numbers of the faces in both tuples.
    """
    low, high = within
    found = []
    for i, j in _fitting(*shapes):
        one, other = shapes[0][i].form, shapes[1][j].form
        assert isinstance(one, Cylinder | Cone) and isinstance(other, Cylinder | Cone)
        if not shapes[0][i].is_outward:
            manifold = round_manifold(one, other, turn, shift)
        else:
            turned = round_manifold(other, one, turn.T, -turn.T @ shift)
            manifold = None if turned is None else turned.turned(turn, shift)
        if manifold is not None and low <= manifold.gaps.min() and manifold.gaps.max() <= high:
            found.append(((i, j), manifold))
    return found


def _fitting(ones: Faces, others: Faces) -> Iterator[tuple[int, int]]:
    """Pairs of faces of one kind, one hollow and one full; cones of one angle."""
    for i, one in enumerate(ones):
        for j, other in enumerate(others):
            if one.is_outward == other.is_outward:
                continue
            if isinstance(one.form, Cone) and isinstance(other.form, Cone):
                if abs(one.form.half_angle - other.form.half_angle) <= SAME_ANGLE:
                    yield i, j
            elif isinstance(one.form, Cylinder) and isinstance(other.form, Cylinder):
                yield i, j
