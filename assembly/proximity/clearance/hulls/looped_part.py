"""The part of a surface on which a face's loops are: surfaces of files reach beyond their faces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.splines import bezier
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["looped_part"]

Array = NDArray[np.float64]


def looped_part(face: Face) -> NurbsSurface:
    """A part of a face's surface that contains the face: in directions that are not closed, from loop to loop.

    A face reaches farthest in u, and in v, on its boundary, or at a pole, if that is in the face.
    """
    surface = face.surface
    if (face.outer is None and not face.holes) or not surface._is_clamped:
        return surface
    nets = np.concatenate([curve.control_points for curve in face.boundary])
    points, knots, poles = surface._homogeneous, list(surface.knots), surface._pole_bits
    is_less = False
    for way in (0, 1):
        first, last = surface.domain[way]
        low, high = max(first, float(nets[:, way].min())), min(last, float(nets[:, way].max()))
        if poles & (1 << 2 * way) and _has(face, way, first, low):
            low = first
        if poles & (2 << 2 * way) and _has(face, way, high, last):
            high = last
        if surface.closed[way] or not low < high or (low, high) == (first, last):
            continue
        rows, knots[way] = _cut(np.moveaxis(points, way, 0), knots[way], surface.degree[way], low, high)
        points, is_less = np.moveaxis(rows, 0, way), True
    return surface._from_homogeneous(points, knots, surface.degree) if is_less else surface


def _has(face: Face, way: int, begin: float, end: float) -> bool:
    """Whether what is between a pole and the boundary, where no boundary curve is, belongs to a face."""
    at = [0.5 * (first + last) for first, last in face.surface.domain]
    at[way] = 0.5 * (begin + end)
    return not begin < end or bool(face.contains(*at))


def _cut(points: Array, knots: Array, degree: int, low: float, high: float) -> tuple[Array, Array]:
    """Control points (n, ..., 4) and knots of the part of a clamped spline between two parameters."""
    for value in (low, high):
        missing = degree - int((knots == value).sum())
        if missing > 0:
            points, knots = bezier.insert(points, knots, degree, value, missing)
    # The point at a knot of full multiplicity is the control point before the first of its knots.
    first, last = (int(np.searchsorted(knots, value)) for value in (low, high))
    within = knots[(knots > low) & (knots < high)]
    ends = np.full(degree + 1, low), np.full(degree + 1, high)
    return points[max(first - 1, 0) : last], np.concatenate([ends[0], within, ends[1]])
