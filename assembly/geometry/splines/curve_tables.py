"""Bezier pieces and power tables of many plane curves at once: what `NurbsCurve.packed` makes of one.

The Bezier points of a span [a, b] are values of its blossom, f(a, ..., a, b, ..., b) (`geometry/splines/bezier.py`).
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.splines.evaluate import (
    curve_lanes,
    spline_curve_at,
    xyz,
)


@kernel(signatures="(f8[:, ::1], f8[::1], f8[::1], i8[:, ::1], f8[:, :, ::1], f8, f8[::1], f8[::1], i8[:, ::1])")
def bezier_tables(points, weights, knots, shape, powers, coincident, bezier, pool, records):
    """Fill Bezier points (u w, v w, w), pools and records of curves.

    `points`, `weights` and `knots` are those of all curves in order, `shape` (curves, 2) their degrees and numbers
    of control points, `powers` the matrices of `bezier.power_matrix` by degree. Offsets in a record count from the
    start of the first pool. Returns the doubles filled in `bezier` and in `pool`, and False where a value of a
    table is not finite.
    """
    d = np.empty((16, 3))
    first_point = 0
    first_knot = 0
    at = 0
    place = 0
    finite = True
    for curve in range(shape.shape[0]):
        arc = spline_curve_at(records, curve)
        p = shape[curve, 0]
        n = shape[curve, 1]
        # The ends of the spans.
        breaks = place
        spans = -1
        for j in range(first_knot + p, first_knot + n + 1):
            if spans < 0 or knots[j] > pool[place - 1]:
                pool[place] = knots[j]
                place += 1
                spans += 1
        arc.degree = p
        arc.spans = spans
        arc.breaks = breaks
        arc.coefficients = place
        begin = at
        for j in range(p, n):
            a = knots[first_knot + j]
            b = knots[first_knot + j + 1]
            if not b > a:
                continue
            piece = at
            for k in range(p + 1):
                for i in range(p + 1):
                    w = weights[first_point + j - p + i]
                    d[i, 0] = points[first_point + j - p + i, 0] * w
                    d[i, 1] = points[first_point + j - p + i, 1] * w
                    d[i, 2] = w
                for r in range(1, p + 1):
                    t = a if r <= p - k else b
                    for i in range(p, r - 1, -1):
                        left = knots[first_knot + j - p + i]
                        alpha = (t - left) / (knots[first_knot + j + 1 + i - r] - left)
                        for axis in range(3):
                            d[i, axis] = (1.0 - alpha) * d[i - 1, axis] + alpha * d[i, axis]
                for axis in range(3):
                    bezier[at] = d[p, axis]
                    at += 1
            if piece > begin:
                # Neighbors share an end in exact arithmetic; make them share it in doubles too.
                for axis in range(3):
                    bezier[piece + axis] = bezier[piece - 3 + axis]
            scale = 0.5**p
            for m in range(p + 1):
                for axis in range(3):
                    total = 0.0
                    for k in range(p + 1):
                        total += powers[p, m, k] * bezier[piece + 3 * k + axis]
                    pool[place + (3 if axis == 2 else axis)] = total * scale
                    finite = finite and np.isfinite(total * scale)
                pool[place + 2] = 0.0
                place += 4
                scale *= 2.0 / (b - a)
        low_u = high_u = points[first_point, 0]
        low_v = high_v = points[first_point, 1]
        for k in range(first_point, first_point + n):
            low_u = min(low_u, points[k, 0])
            high_u = max(high_u, points[k, 0])
            low_v = min(low_v, points[k, 1])
            high_v = max(high_v, points[k, 1])
        size = np.sqrt((high_u - low_u) ** 2 + (high_v - low_v) ** 2)
        gap_u = bezier[begin] / bezier[begin + 2] - bezier[at - 3] / bezier[at - 1]
        gap_v = bezier[begin + 1] / bezier[begin + 2] - bezier[at - 2] / bezier[at - 1]
        arc.closed = 1 if size > 0.0 and np.sqrt(gap_u**2 + gap_v**2) <= coincident * size else 0
        first_point += n
        first_knot += n + p + 1
    return at, place, finite


@kernel(signatures="(f8[::1], i8[:, ::1], f8, f8, f8[::1], f8[::1])")
def swept_area(pool, records, u, v, nodes, weights):
    """The area that the way from (u, v) to a point sweeps as the point runs along curves."""
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
