"""Triangles of a polygon that is not convex: ears are cut off, one after the other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["triangles_of"]

Array = NDArray[np.float64]


def triangles_of(corners: Array, normal: Array) -> list[tuple[int, ...]]:
    """Triangles, numbers of corners, that together are a polygon; what no ear is found of in the end is one part.

    Parameters
    ----------
    corners : (n, 3)
        Of a polygon without holes, counterclockwise seen against its normal, which may have corners on straight lines.
    normal : (3,)
    """
    left = list(range(len(corners)))
    found: list[tuple[int, ...]] = []
    while len(left) > 3:
        k = _ear(corners[left], normal)
        if k is None:
            break
        found.append((left[k - 1], left[k], left[(k + 1) % len(left)]))
        del left[k]
    return [*found, tuple(left)]


def _ear(corners: Array, normal: Array) -> int | None:
    """A corner that can be cut off: that with the largest triangle that no other corner is in, or on the border of."""
    before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
    areas = np.cross(corners - before, after - corners) @ normal
    for k in np.argsort(-areas).tolist():
        # A corner on a straight line has no area, and nothing is lost by it.
        if areas[k] < 0.0:
            return None
        triangle = np.stack([before[k], corners[k], after[k]])
        ways = np.cross(normal, np.roll(triangle, -1, axis=0) - triangle)
        sides = ((corners[:, None] - triangle) * ways).sum(axis=2).min(axis=1)
        same = (corners[:, None] == triangle).all(axis=2).any(axis=1)
        if (sides[~same] < 0.0).all():
            return int(k)
    return None
