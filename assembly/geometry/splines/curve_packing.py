"""Many plane curves packed at once, and what loops need of them: `NurbsCurve.packed` for the curves of a face."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError
from assembly.geometry.splines.bezier import MAX_DEGREE, power_matrix
from assembly.geometry.splines.curve import COINCIDENT, NurbsCurve, checked_table_degree
from assembly.geometry.splines.curve_tables import bezier_tables, swept_area
from assembly.geometry.splines.evaluate import CURVE_RECORD

__all__ = ["NOT_FINITE", "joined_curves", "packed_curves", "power_matrices", "signed_area"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
NOT_FINITE = "knots span a domain too short for doubles at this degree; expected a scale nearer to one"


def joined_curves(curves: Sequence[NurbsCurve]) -> tuple[tuple[Array, Array, Array], Ints]:
    """Points, weights and knots of plane curves in order, and a row of degree and number of points of each."""
    sizes = [(curve.degree, len(curve.weights)) for curve in curves]
    if max(sizes)[0] > MAX_DEGREE:
        for curve in curves:
            checked_table_degree(curve)
    shape = np.array(sizes, dtype=np.int64)
    points = np.concatenate([curve.control_points for curve in curves])
    weights = np.concatenate([curve.weights for curve in curves])
    knots = np.concatenate([curve.knots for curve in curves])
    return (points, weights, knots), shape


def packed_curves(curves: Sequence[NurbsCurve]) -> tuple[Array, Array, Ints]:
    """Bezier points, pool and records of plane curves."""
    if not curves:
        return np.empty(0), np.empty(0), np.empty((0, CURVE_RECORD), dtype=np.int64)
    given, shape = joined_curves(curves)
    sizes = shape.tolist()
    # Of all spans that there may be.
    breaks = sum(count - degree + 1 for degree, count in sizes)
    coefficients = sum((count - degree) * (degree + 1) for degree, count in sizes)
    bezier, pool = np.empty(3 * coefficients), np.empty(4 * coefficients + breaks)
    records = np.empty((len(curves), CURVE_RECORD), dtype=np.int64)
    filled, used, finite = bezier_tables(given, shape, power_matrices(), COINCIDENT, bezier, pool, records)
    if not finite:
        raise InputError(NOT_FINITE)
    return bezier[:filled], pool[:used], records


@cache
def power_matrices() -> Array:
    """`bezier.power_matrix` by degree, in one array."""
    matrices = np.zeros((MAX_DEGREE + 1, MAX_DEGREE + 1, MAX_DEGREE + 1))
    for degree in range(MAX_DEGREE + 1):
        matrices[degree, : degree + 1, : degree + 1] = power_matrix(degree)
    return matrices


@cache
def _gauss() -> tuple[Array, Array]:
    nodes, weights = np.polynomial.legendre.leggauss(8)
    return nodes, weights


def signed_area(curves: Sequence[NurbsCurve]) -> float:
    """Area to the left of curves that close, by Green's theorem with eight nodes a span: enough for its sign."""
    _, pool, records = packed_curves(curves)
    u, v = curves[0].control_points[0]
    return float(swept_area(pool, records, float(u), float(v), *_gauss()))
