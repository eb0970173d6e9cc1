"""Bezier pieces and power tables of many plane curves at once: what `NurbsCurve.packed` makes of one.

The Bezier points of a span [a, b] are values of its blossom, f(a, ..., a, b, ..., b) (`geometry/splines/bezier.py`).
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.splines.evaluate import curve_lanes, spline_curve_at, xyz

# A curve among others. points, weights, knots: those of all curves; point, knot: its first ones; degree; count: of its
# points.
PlaneCurve = namedtuple("PlaneCurve", "points weights knots point knot degree count")


@kernel(inner=True)
def blossoms(curve, j, bezier, at, d):
    """Bezier points of the span that begins at knot j of a curve, to bezier[at:]; d is room for de Boor's algorithm."""
    p = curve.degree
    a, b = curve.knots[curve.knot + j], curve.knots[curve.knot + j + 1]
    for k in range(p + 1):
        for i in range(p + 1):
            n = curve.point + j - p + i
            w = curve.weights[n]
            d[i, 0] = curve.points[n, 0] * w
            d[i, 1] = curve.points[n, 1] * w
            d[i, 2] = w
        for r in range(1, p + 1):
            t = a if r <= p - k else b
            for i in range(p, r - 1, -1):
                left = curve.knots[curve.knot + j - p + i]
                alpha = (t - left) / (curve.knots[curve.knot + j + 1 + i - r] - left)
                for axis in range(3):
                    d[i, axis] = (1.0 - alpha) * d[i - 1, axis] + alpha * d[i, axis]
        for axis in range(3):
            bezier[at + 3 * k + axis] = d[p, axis]


@kernel(inner=True)
def power_table(powers, bezier, at, width, pool, place):
    """Coefficients in (t - middle) of a span from its Bezier points, to pool[place:]; whether all are finite."""
    p = powers.shape[0] - 1
    finite = True
    scale = 0.5**p
    for m in range(p + 1):
        for axis in range(3):
            total = 0.0
            for k in range(p + 1):
                total += powers[m, k] * bezier[at + 3 * k + axis]
            pool[place + 4 * m + (3 if axis == 2 else axis)] = total * scale
            finite = finite and np.isfinite(total * scale)
        pool[place + 4 * m + 2] = 0.0
        scale *= 2.0 / width
    return finite


@kernel(inner=True)
def closes(curve, bezier, begin, end, coincident):
    """Whether a curve with the Bezier points bezier[begin:end] ends where it begins, up to a part of its size."""
    points = curve.points
    low_u = high_u = points[curve.point, 0]
    low_v = high_v = points[curve.point, 1]
    for k in range(curve.point, curve.point + curve.count):
        low_u = min(low_u, points[k, 0])
        high_u = max(high_u, points[k, 0])
        low_v = min(low_v, points[k, 1])
        high_v = max(high_v, points[k, 1])
    size = np.sqrt((high_u - low_u) ** 2 + (high_v - low_v) ** 2)
    gap_u = bezier[begin] / bezier[begin + 2] - bezier[end - 3] / bezier[end - 1]
    gap_v = bezier[begin + 1] / bezier[begin + 2] - bezier[end - 2] / bezier[end - 1]
    return size > 0.0 and np.sqrt(gap_u**2 + gap_v**2) <= coincident * size


@kernel(inner=True, allocates=True)
def lay_bezier_tables(curves, shape, powers, coincident, bezier, pool, records):
    """Fill Bezier points (u w, v w, w), pools and records of curves.

    `curves` are points, weights and knots of all in order, `shape` (curves, 2) their degrees and numbers of control
    points, `powers` the matrices of `bezier.power_matrix` by degree. Offsets in a record count from the start of the
    first pool. Returns the doubles filled in `bezier` and in `pool`, and False where a value of a table is not finite.
    """
    points, weights, knots = curves
    d = np.empty((16, 3))
    first_point = 0
    first_knot = 0
    at = 0
    place = 0
    finite = True
    for number in range(shape.shape[0]):
        arc = spline_curve_at(records, number)
        p, n = shape[number, 0], shape[number, 1]
        curve = PlaneCurve(points, weights, knots, first_point, first_knot, p, n)
        # The ends of the spans.
        arc.breaks = place
        spans = -1
        for j in range(first_knot + p, first_knot + n + 1):
            if spans < 0 or knots[j] > pool[place - 1]:
                pool[place] = knots[j]
                place += 1
                spans += 1
        arc.degree = p
        arc.spans = spans
        arc.coefficients = place
        begin = at
        for j in range(p, n):
            width = knots[first_knot + j + 1] - knots[first_knot + j]
            if not width > 0.0:
                continue
            blossoms(curve, j, bezier, at, d)
            if at > begin:
                # Neighbors share an end in exact arithmetic; make them share it in doubles too.
                for axis in range(3):
                    bezier[at + axis] = bezier[at - 3 + axis]
            fits = power_table(powers[p, : p + 1, : p + 1], bezier, at, width, pool, place)
            finite = finite and fits
            at += 3 * (p + 1)
            place += 4 * (p + 1)
        arc.closed = 1 if closes(curve, bezier, begin, at, coincident) else 0
        first_point += n
        first_knot += n + p + 1
    return at, place, finite


@kernel(
    signatures="(Tuple((f8[:, ::1], f8[::1], f8[::1])), i8[:, ::1], f8[:, :, ::1], f8, f8[::1], f8[::1], i8[:, ::1])",
    allocates=True,
)
def bezier_tables(curves, shape, powers, coincident, bezier, pool, records):
    """`lay_bezier_tables` for Python."""
    return lay_bezier_tables(curves, shape, powers, coincident, bezier, pool, records)


@kernel(signatures="(f8[::1], i8[:, ::1], f8, f8, f8[::1], f8[::1])", allocates=True)
def swept_area(pool, records, u, v, nodes, weights):
    """The signed area that the segment from (u, v) to a point sweeps as the point runs along curves."""
    total = 0.0
    table = records.ravel()
    for curve in range(records.shape[0]):
        arc = spline_curve_at(records, curve)
        r = curve * records.shape[1]
        breaks = arc.breaks
        for span in range(arc.spans):
            half = 0.5 * (pool[breaks + span + 1] - pool[breaks + span])
            middle = 0.5 * (pool[breaks + span + 1] + pool[breaks + span])
            for k in range(nodes.size):
                a, b, _c = curve_lanes(Store(table, pool), r, middle + half * nodes[k])
                x, y, _z = xyz(a)
                dx, dy, _dz = xyz(b)
                total += 0.5 * half * weights[k] * ((x - u) * dy - (y - v) * dx)
    return total
