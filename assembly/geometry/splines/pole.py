"""The neighborhood of a pole: an edge of the domain that is one point, where Su x Sv vanishes.

The surface itself is smooth there; only its coordinates are polar. With v the parameter that runs into the pole at v0,
s = +1 or -1 the inward direction, delta the distance of v from v0 and E(u) = s S_v(u, v0),

    w = E(u) delta + (tangential part of S_vv) delta^2 / 2,
    S = p + w - (w.A w / 2) n,    normal = n + A w,    n ~ s S_uv x S_v,

up to third order in delta, A the shape operator at the pole. It is found from the normal curvatures
-S_vv.n / |S_v|^2 in three directions. An apex, where n depends on u, has no such frame.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._newton import bracketed_newton
from assembly.geometry.nearest_place import Interval, held_in
from assembly.geometry.splines.evaluate import surface_at, surface_point
from assembly.geometry.vec import add, blend, cross, dot, scale, sub

# Within this part of the domain a pole's own chart replaces its polar coordinates; the chart's error is of third order.
CHART = 1e-6

# A surface's tangent plane at a point of it, in its body's axes: [S_u S_v] = [x y] E.
SurfaceFrame = namedtuple(
    "SurfaceFrame",
    [
        "point",
        "normal",  # outward, of length one
        "tangent_x",
        "tangent_y",  # normal times tangent_x
        "rates",  # E^-1 (11, 12, 22), upper triangular; zero at a pole
        "shape",  # shape operator (11, 12, 22), +1/r on a ball
        "regular",  # whether there is a tangent plane
    ],
)


@kernel(inline=True)
def limits(store, r, across):
    """Low and high end of u (across = 0) or v (1), and whether it is closed."""
    patch = surface_at(store.table, r)
    if across == 0:
        o = patch.breaks_u
        return store.pool[o], store.pool[o + patch.spans_u], patch.closed_u
    o = patch.breaks_v
    return store.pool[o], store.pool[o + patch.spans_v], patch.closed_v


@kernel(inner=True)
def nearest_pole(store, r, u, v):
    """The pole edge nearest to (u, v): its bit, and the distance as a part of the domain."""
    ulo, uhi, _ = limits(store, r, 0)
    vlo, vhi, _ = limits(store, r, 1)
    poles = surface_at(store.table, r).poles
    edge = 0
    least = 2.0
    for k in range(4):
        bit = 1 << k
        if poles & bit == 0:
            continue
        if k < 2:
            d = ((u - ulo) if k == 0 else (uhi - u)) / (uhi - ulo)
        else:
            d = ((v - vlo) if k == 2 else (vhi - v)) / (vhi - vlo)
        if d < least:
            least = d
            edge = bit
    return edge, least


@kernel(inner=True)
def spoke(store, r, edge, along):
    """At the pole of `edge`: the point, E, dE/d(along), S_vv (v into the pole) for the other parameter `along`."""
    if edge <= 2:
        lo, hi, _ = limits(store, r, 0)
        at = lo if edge == 1 else hi
        p, su, _sv, suu, suv, _svv = surface_point(store.table, store.pool, r, at, along)
        s = 1.0 if edge == 1 else -1.0
        return p, scale(s, su), scale(s, suv), suu
    lo, hi, _ = limits(store, r, 1)
    at = lo if edge == 4 else hi
    p, _su, sv, _suu, suv, svv = surface_point(store.table, store.pool, r, along, at)
    s = 1.0 if edge == 4 else -1.0
    return p, scale(s, sv), scale(s, suv), svv


@kernel(inline=True)
def spoke_normal(table, r, edge, e, turn):
    """Outward normal from E and dE/d(along), not normalized: S_uv x S_v, or S_u x S_uv for a pole in u."""
    sign = float(surface_at(table, r).sign)
    if edge <= 2:
        # d/du inward of Su x Sv is Su x Suv, and E = s Su, turn = s Suv: s (E x turn).
        return scale(sign if edge == 1 else -sign, cross(e, turn))
    return scale(sign if edge == 4 else -sign, cross(turn, e))


@kernel(inner=True)
def pole_frame(store, r, edge, u, v):
    """The `SurfaceFrame` near a pole, whose coordinates have no rates."""
    across = 0 if edge <= 2 else 1
    lo, hi, _ = limits(store, r, across)
    other_lo, other_hi, _ = limits(store, r, 1 - across)
    along = v if edge <= 2 else u
    depth = u if edge <= 2 else v
    delta = depth - lo if edge == 1 or edge == 4 else hi - depth
    p, e, turn, bent = spoke(store, r, edge, along)
    n = spoke_normal(store.table, r, edge, e, turn)
    length = math.sqrt(dot(n, n))
    ee = dot(e, e)
    zero = (0.0, 0.0, 0.0)
    if not (length > 0.0 and ee > 0.0):
        return SurfaceFrame(p, zero, zero, zero, zero, zero, False)
    n = scale(1.0 / length, n)
    x = scale(1.0 / math.sqrt(ee), e)
    y = cross(n, x)
    # Normal curvature k = a11 c^2 + 2 a12 c s + a22 s^2 along three spokes: this one gives a11.
    a11 = -dot(bent, n) / ee
    m11 = 0.0
    m12 = 0.0
    m22 = 0.0
    r1 = 0.0
    r2 = 0.0
    smooth = True
    for k in range(3):
        _p, ek, tk, bk = spoke(store, r, edge, other_lo + (other_hi - other_lo) * k / 3.0)
        nk = spoke_normal(store.table, r, edge, ek, tk)
        lk = math.sqrt(dot(nk, nk))
        # At an apex the normals differ from spoke to spoke.
        smooth = smooth and dot(nk, n) > (1.0 - 1e-6) * lk
        ekk = dot(ek, ek)
        c = dot(ek, x)
        s = dot(ek, y)
        rest = -dot(bk, n) - a11 * c * c
        # Least squares over the spokes for a12 and a22.
        g1 = 2.0 * c * s / ekk
        g2 = s * s / ekk
        m11 += g1 * g1
        m12 += g1 * g2
        m22 += g2 * g2
        r1 += g1 * rest / ekk
        r2 += g2 * rest / ekk
    det = m11 * m22 - m12 * m12
    if not (smooth and det > 0.0):
        return SurfaceFrame(p, n, x, y, zero, zero, False)
    a12 = (m22 * r1 - m12 * r2) / det
    a22 = (m11 * r2 - m12 * r1) / det
    # From the pole to the point, in the pole's own chart.
    wx = delta * (math.sqrt(ee) + 0.5 * delta * dot(bent, x))
    wy = 0.5 * delta * delta * dot(bent, y)
    lean_x = a11 * wx + a12 * wy
    lean_y = a12 * wx + a22 * wy
    q = add(p, add(blend(wx, x, wy, y), scale(-0.5 * (wx * lean_x + wy * lean_y), n)))
    # n + A w is longer than one in second order.
    stretch = 0.5 * (lean_x * lean_x + lean_y * lean_y)
    return SurfaceFrame(
        point=q,
        normal=add(scale(1.0 - stretch, n), blend(lean_x, x, lean_y, y)),
        tangent_x=sub(x, scale(lean_x, n)),
        tangent_y=sub(y, scale(lean_y, n)),
        rates=zero,
        shape=(a11, a12, a22),
        regular=True,
    )


# A query: which spoke of a pole points along w in its tangent plane. sense: 1 if spokes turn counterclockwise about n
# as their parameter rises, else -1.
SpokeQuery = namedtuple("SpokeQuery", "store surface edge w n sense interval")
SpokeTurn = namedtuple("SpokeTurn", "slope curvature")


@kernel(inline=True)
def _spoke_turn(query, angle):
    """As slope and curvature: (w x E).n times sense, which rises through zero where a spoke E passes w; its rate."""
    _p, e, turn, _bent = spoke(query.store, query.surface, query.edge, held_in(query.interval, angle))
    return SpokeTurn(-query.sense * dot(cross(e, query.w), query.n), -query.sense * dot(cross(turn, query.w), query.n))


_spoke_along = kernel(inner=True)(bracketed_newton(_spoke_turn, inside=False))


@kernel(inner=True)
def polar_step(store, r, edge, u, v, step):
    """Parameters after a tangential step (body axes) from (u, v) near the pole of `edge`, which it may lead across."""
    across = 0 if edge <= 2 else 1
    lo, hi, _ = limits(store, r, across)
    other_lo, other_hi, closed = limits(store, r, 1 - across)
    along = v if edge <= 2 else u
    depth = u if edge <= 2 else v
    delta = depth - lo if edge == 1 or edge == 4 else hi - depth
    _p, e, turn, _bent = spoke(store, r, edge, along)
    n = spoke_normal(store.table, r, edge, e, turn)
    flat = sub(step, scale(dot(step, n) / dot(n, n), n))
    w = add(scale(delta, e), flat)
    reach = math.sqrt(dot(w, w))
    if not reach > 1e-300:
        return (lo if edge == 1 else hi, v) if edge <= 2 else (u, lo if edge == 4 else hi)
    # The spoke that points along w is close to the best of 16 samples.
    best = -2.0
    angle = along
    for k in range(16):
        candidate = other_lo + (other_hi - other_lo) * (k + 0.5) / 16.0
        _p, ek, _tk, _bk = spoke(store, r, edge, candidate)
        cosine = dot(ek, w) / (math.sqrt(dot(ek, ek)) * reach)
        if cosine > best:
            best = cosine
            angle = candidate
    interval = Interval(other_lo, other_hi, closed == 1)
    wide = (other_hi - other_lo) / 16.0
    low = angle - wide if interval.closed else max(angle - wide, other_lo)
    high = angle + wide if interval.closed else min(angle + wide, other_hi)
    query = SpokeQuery(store, r, edge, w, n, 1.0 if dot(cross(e, turn), n) > 0.0 else -1.0, interval)
    angle = held_in(interval, _spoke_along(query, low, high, angle)[0])
    _p, ek, _tk, _bk = spoke(store, r, edge, angle)
    delta = min(reach / math.sqrt(dot(ek, ek)), hi - lo)
    depth = lo + delta if edge == 1 or edge == 4 else hi - delta
    return (depth, angle) if edge <= 2 else (angle, depth)
