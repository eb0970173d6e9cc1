"""Surfaces of arrays that are known to fit, as those of planes, cylinders, cones, spheres and tori of files."""

from __future__ import annotations

from math import dist, isfinite

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["known_surface"]

Array = NDArray[np.float64]


def known_surface(
    points: Array, knots: tuple[Array, Array], degree: tuple[int, int], weights: Array | None = None
) -> NurbsSurface:
    """A surface of arrays that are its own from now on.

    Shapes, the order of knots and the signs of weights are not looked at. Where numbers are not finite, or a side of
    the domain has no length, `NurbsSurface` says so. It also makes those of knots that are not clamped, whose domain
    is shorter than their row, as profiles of files may have them.

    Parameters
    ----------
    points : (n, m, 3)
    knots : of u and of v
    degree : of u and of v
    weights : (n, m), optional
        Ones by default.
    """
    row_u, row_v = knots[0].tolist(), knots[1].tolist()
    if weights is None:
        weights = np.ones(points.shape[:2])
    # A sum may overflow: that is seen where all is checked.
    row = points.ravel().tolist()
    finite = isfinite(sum(row) + sum(row_u) + sum(row_v))
    if not (finite and _is_clamped(row_u, degree[0]) and _is_clamped(row_v, degree[1])):
        return NurbsSurface(points, knots, degree, weights)
    made = object.__new__(NurbsSurface)
    for array in (points, weights, *knots):
        array.flags.writeable = False
    made.control_points, made.knots, made.degree, made.weights = points, knots, degree, weights
    made.name, made.domain = None, ((row_u[0], row_u[-1]), (row_v[0], row_v[-1]))
    if len(row) == 12:
        _know_corners(made, row[0:3], row[6:9], row[3:6], row[9:12])
    return made


def _know_corners(made: NurbsSurface, a: list[float], b: list[float], c: list[float], d: list[float]) -> None:
    """Keep the size of a surface of four corners, and which are apart, where that is clear from plain floats.

    They are those at low u and v, high u and low v, low u and high v, high u and v.
    """
    size = dist([min(row) for row in zip(a, b, c, d, strict=True)], [max(row) for row in zip(a, b, c, d, strict=True)])
    least = 2e-11 * size
    if min(_gap(a, b), _gap(c, d), _gap(a, c), _gap(b, d)) > least:
        made.__dict__.update(size=size, _apart=(True, True))


def _gap(p: list[float], q: list[float]) -> float:
    return max(abs(p[0] - q[0]), abs(p[1] - q[1]), abs(p[2] - q[2]))


def _is_clamped(row: list[float], degree: int) -> bool:
    """Whether a row of knots begins and ends with as many equal ones as it takes, and has a length."""
    return row[0] == row[degree] < row[-1 - degree] == row[-1]
