"""Points along boundary curves of faces, C(t) = S(c(t)), and the nearest ones to given points: many at once."""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._newton import damped_newton
from assembly._record import Store
from assembly.geometry.nearest_place import Interval, held_in, move_along, sight_of, step_along
from assembly.geometry.splines.domain import into_domain
from assembly.geometry.splines.evaluate import curve_lanes, surface_point, xyz
from assembly.geometry.vec import blend, cross, sub


@kernel(inner=True)
def _jet(store, surface, curve, t):
    """C, C_t and S_u x S_v."""
    c, d, _h = curve_lanes(store, curve, t)
    at = xyz(c)
    rate = xyz(d)
    u, v, _clamped = into_domain(store, surface, at[0], at[1])
    s, su, sv, _suu, _suv, _svv = surface_point(store.table, store.pool, surface, u, v)
    return s, blend(rate[0], su, rate[1], sv), cross(su, sv)


@kernel(signatures="(i8[::1], f8[::1], i8[::1], i8[::1], i8[::1], f8[::1], f8[:, ::1])")
def along_boundaries(table, pool, surfaces, curves, which, t, out):
    """C, C_t and S_u x S_v of curves `which` at parameters t into rows of nine."""
    for i in range(t.size):
        k = which[i]
        jet = _jet(Store(table, pool), surfaces[k], curves[k], t[i])
        for j in range(3):
            for m in range(3):
                out[i, 3 * j + m] = jet[j][m]


# A boundary curve and a point in space.
BoundaryQuery = namedtuple("BoundaryQuery", "store surface curve p interval")


@kernel(inline=True)
def _seen(query, t):
    """The query's point as seen from the curve at t, without curvature (Gauss-Newton)."""
    c, rate, _normal = _jet(query.store, query.surface, query.curve, t)
    return sight_of(sub(c, query.p), rate, (0.0, 0.0, 0.0))


_nearest_from = kernel(inner=True)(damped_newton(_seen, step_along, move_along, steps=12))


@kernel(inner=True)
def _nearest_sample(samples, first, stop, p):
    """Index of the row (t, x, y, z) that is nearest to a point, and the square of its distance."""
    best = math.inf
    found = first
    for i in range(first, stop):
        x = samples[i, 1] - p[0]
        y = samples[i, 2] - p[1]
        z = samples[i, 3] - p[2]
        d = x * x + y * y + z * z
        if d < best:
            best = d
            found = i
    return found, best


@kernel(
    signatures=(
        "(Tuple((i8[::1], f8[::1])), Tuple((i8[::1], i8[::1], b1[::1], i8[::1], f8[:, ::1])), i8[::1], f8[:, ::1], "
        "f8[::1], f8, f8[:, ::1])"
    ),
)
def nearest_on_boundaries(store, boundaries, which, points, guess, close, out):
    """Nearest points of boundary curves `which` to points near them: rows of the parameter and the distance.

    `boundaries` are the surfaces and the curves, whether these are closed, where their samples (t, x, y, z) begin, and
    the samples.

    A guess whose point is within `close` is kept; else the Gauss-Newton method starts there or at the curve's nearest
    sample, whichever is nearer. It converges quadratically for points on the curve. The distance is that of the iterate
    before the last step.
    """
    table, pool = store
    surfaces, curves, closed, begins, samples = boundaries
    for i in range(which.size):
        k = which[i]
        p = (points[i, 0], points[i, 1], points[i, 2])
        first = begins[k]
        stop = begins[k + 1]
        interval = Interval(samples[first, 0], samples[stop - 1, 0], closed[k])
        query = BoundaryQuery(Store(table, pool), surfaces[k], curves[k], p, interval)
        t = held_in(interval, guess[i])
        at = _seen(query, t)
        if 2.0 * at.merit > close * close:
            sample, square = _nearest_sample(samples, first, stop, p)
            _t, at, t = _nearest_from(query, samples[sample, 0] if square < 2.0 * at.merit else t)
        out[i, 0] = t
        out[i, 1] = math.sqrt(2.0 * at.merit)
