"""Splines of files evaluated at OCCT's parameters, with their points in ours: quicker than curves made for users."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.splines import bezier
from assembly.geometry.splines.evaluate import CURVE_RECORD
from assembly.step.profiles import Direction, Spline, Straight, Turning
from assembly.step.track_points import fill_points, fill_table, find_crossings

__all__ = ["KEPT", "Track", "track"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
# A parameter that is kept.
KEPT = Straight(is_length=False)


class Track:
    """A spline as kernels read it, with the map of its parameter and those of its coordinates."""

    def __init__(self, tables: tuple[Ints, Array], ways: Array, dimension: int) -> None:
        self._record, self._pool, self._ways, self._dimension = *tables, ways, dimension

    def __call__(self, t: Array) -> Array:
        """Points (n, d) at parameters (n,) of OCCT's, beyond the ends those of the ends."""
        out = np.empty((t.size, self._dimension))
        fill_points(self._record, self._pool, self._ways, np.ascontiguousarray(t), out)
        return out

    @property
    def breaks(self) -> Array:
        """The distinct knots of the domain."""
        return self._pool[: int(self._record[1]) + 1]

    def with_maps(self, maps: Sequence[Direction]) -> Track:
        """The same curve with its coordinates mapped."""
        ways = self._ways.copy()
        for row, map_ in zip(ways[1:], maps, strict=True):
            row[:] = _way(map_)
        return Track((self._record, self._pool), ways, self._dimension)

    def crossings(self, at: Array, joints: Sequence[Array]) -> Array:
        """Parameters at which a coordinate takes one of its values: all between parameters, and those among them."""
        values = self(at)
        found = []
        axes: list[Ints] = []
        brackets: list[Array] = []
        for axis, row in enumerate(joints):
            if not row.size:
                continue
            sides = values[:, axis, None] - row
            found.append(at[(sides == 0.0).any(axis=1)])
            k, j = np.nonzero(sides[:-1] * sides[1:] < 0.0)
            if k.size:
                axes.append(np.full(k.size, axis))
                brackets.append(np.column_stack([at[k], at[k + 1], sides[k, j], sides[k + 1, j], row[j]]))
        if axes:
            rows = np.concatenate(brackets)
            roots = np.empty(len(rows))
            find_crossings(self._record, self._pool, self._ways, np.concatenate(axes), rows, roots)
            found.append(roots)
        return np.concatenate(found) if found else np.empty(0)


def _way(map_: Direction) -> tuple[float, float, float, float]:
    """A map as kernels read it."""
    return (float(map_.spans), map_.low, map_.high, map_.radius) if isinstance(map_, Turning) else (0.0, 0.0, 0.0, 0.0)


@cache
def _powers(degree: int) -> Array:
    """`bezier.power_matrix` as kernels take it; not to be changed."""
    return bezier.power_matrix(degree).copy()


def track(source: Spline, along: Direction = KEPT, maps: Sequence[Direction] = (KEPT, KEPT)) -> Track | None:
    """A spline of homogeneous control points, and maps of its parameter and of its coordinates.

    None where it cannot be evaluated from a table.
    """
    points, degree = source.points, source.degree
    n, dimension = points.shape[0], points.shape[1] - 1
    if degree > bezier.MAX_DEGREE or len(source.knots) != n + degree + 1:
        return None
    lanes = np.zeros((n, 4))
    lanes[:, :dimension], lanes[:, 3] = points[:, :-1], points[:, -1]
    record, pool = np.empty(CURVE_RECORD, dtype=np.int64), np.empty((n - degree) * (4 * degree + 5) + 1)
    knots = np.ascontiguousarray(source.knots, dtype=np.float64)
    if not fill_table(lanes, knots, _powers(degree), record, pool):
        return None
    ways = np.array([_way(along), *map(_way, maps)])
    return Track((record, pool), ways, dimension)
