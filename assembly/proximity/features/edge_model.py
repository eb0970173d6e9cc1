"""The model of `proximity/features/quadratic_model.py` for a part of an edge S(c(t)), t = t0 + h x with |x| <= 1.

With c = c0 + c1 x + c2 x^2 + r_c, |r_c| <= (e_u, e_v), the part lies over the box c0 +- (a, b), and with S quadratic
there, the terms of C(x) = S(c(x)) to second order follow; all others are bounded one by one.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.splines.domain import into_domain
from assembly.geometry.splines.evaluate import (
    curve_point,
    find_span,
    spline_curve_at,
    surface_at,
    surface_point,
)
from assembly.geometry.vec import add, blend, dot, scale
from assembly.proximity.brep.records import edge_at
from assembly.proximity.features.quadratic_model import (
    COEFFICIENT_ROUNDING,
    Box,
    Quadratic,
    expand,
    place_model,
    quadratic_over,
    remainder,
    term_off,
)


@kernel(inner=True)
def curve_remainder(store, curve, box, quadratic, work):
    """Bounds of |x|, |y|, |z| of the difference of a curve and its quadratic over a part of one span."""
    arc = spline_curve_at(store.table, curve)
    span = find_span(store.pool, arc.breaks, arc.spans, box.u)
    at = arc.breaks + span
    n = arc.degree
    o = arc.coefficients + 4 * (n + 1) * span
    for i in range(n + 1):
        w = store.pool[o + 4 * i + 3]
        for c in range(3):
            work[c, i, 0] = store.pool[o + 4 * i + c] - w * quadratic.point[c]
        work[3, i, 0] = w
    least = expand(work, (n, 0), Box(box.u - 0.5 * (store.pool[at] + store.pool[at + 1]), 0.0, box.half_u, 0.0))
    if not least > 0.0:
        return (math.inf, math.inf, math.inf)
    ex = 0.0
    ey = 0.0
    ez = 0.0
    for i in range(n + 3):
        x, y, z = term_off(work, (n, 0), quadratic, i, 0)
        ex += abs(x)
        ey += abs(y)
        ez += abs(z)
    return (ex / least, ey / least, ez / least)


@kernel(inline=True)
def meets(pool, breaks, k, move, u, a):
    """Whether span k, moved by `move`, meets the interval u - a to u + a."""
    return pool[breaks + k] + move <= u + a and pool[breaks + k + 1] + move >= u - a


@kernel(inner=True)
def wide_remainder(store, r, box, quadratic, work):
    """`remainder` over a box that may lie over several spans, and over seams."""
    patch = surface_at(store.table, r)
    u0, v0, a, b = box
    bu = patch.breaks_u
    bv = patch.breaks_v
    nu = patch.spans_u
    nv = patch.spans_v
    period_u = store.pool[bu + nu] - store.pool[bu]
    period_v = store.pool[bv + nv] - store.pool[bv]
    around_u = 1 if patch.closed_u == 1 else 0
    around_v = 1 if patch.closed_v == 1 else 0
    if (around_u == 1 and a >= 0.5 * period_u) or (around_v == 1 and b >= 0.5 * period_v):
        return math.inf
    most = 0.0
    none = (0.0, 0.0, 0.0)
    for turn_u in range(-around_u, around_u + 1):
        move_u = turn_u * period_u
        for iu in range(nu):
            if not meets(store.pool, bu, iu, move_u, u0, a):
                continue
            for turn_v in range(-around_v, around_v + 1):
                move_v = turn_v * period_v
                for iv in range(nv):
                    if meets(store.pool, bv, iv, move_v, v0, b):
                        there = Box(u0 - move_u, v0 - move_v, a, b)
                        most = max(most, remainder(store, r, (iu, iv), there, quadratic, none, work).rest)
    return most


@kernel(inline=True)
def length(a):
    return math.sqrt(dot(a, a))


@kernel(inner=True)
def edge_model(store, edge, pose, model, work):
    """Fill in the model of a part of an edge, moved by a pose; the model has its interval already."""
    edge_record = edge_at(store.table, edge)
    h = model.half_u
    curve = edge_record.curve
    zero = (0.0, 0.0, 0.0)
    c0, d, w = curve_point(store.table, store.pool, curve, model.u0)
    c1 = scale(h, d)
    c2 = scale(0.5 * h * h, w)
    own = Quadratic(c0, c1, zero, c2, zero, zero)
    left = curve_remainder(store, curve, Box(model.u0, 0.0, h, 0.0), own, work)
    r = edge_record.surface
    far = abs(pose.shift[0]) + abs(pose.shift[1]) + abs(pose.shift[2])
    if r < 0:
        e = length(left) + COEFFICIENT_ROUNDING * (far + abs(c0[0]) + abs(c0[1]) + abs(c0[2]))
        place_model(pose, own, e, model)
        return
    u0, v0, _clamped = into_domain(store, r, c0[0], c0[1])
    s0, su, sv, suu, suv, svv = surface_point(store.table, store.pool, r, u0, v0)
    linear = blend(c1[0], su, c1[1], sv)
    bent = add(blend(c1[0] * c1[0], suu, 2.0 * c1[0] * c1[1], suv), scale(c1[1] * c1[1], svv))
    square = add(blend(c2[0], su, c2[1], sv), scale(0.5, bent))
    # Bounds of the terms of u and v beyond first order; and of all terms: a and b.
    more_u = abs(c2[0]) + left[0]
    more_v = abs(c2[1]) + left[1]
    a = abs(c1[0]) + more_u
    b = abs(c1[1]) + more_v
    e = math.inf
    if a < math.inf and b < math.inf:
        box = Box(u0, v0, a, b)
        e = wide_remainder(store, r, box, quadratic_over(box, s0, su, sv, suu, suv, svv), work)
        e += left[0] * length(su) + left[1] * length(sv)
        e += 0.5 * length(suu) * more_u * (2.0 * abs(c1[0]) + more_u)
        e += 0.5 * length(svv) * more_v * (2.0 * abs(c1[1]) + more_v)
        e += length(suv) * (abs(c1[0]) * more_v + abs(c1[1]) * more_u + more_u * more_v)
        e += COEFFICIENT_ROUNDING * (far + abs(s0[0]) + abs(s0[1]) + abs(s0[2]))
    place_model(pose, Quadratic(s0, linear, zero, square, zero, zero), e, model)
