"""The point of a face's boundary that is nearest in space: branch and bound over the pieces of its curves S(c(t)).

The bounds on the derivatives of S(c(t)) follow from those of the piece c (m1, m2, m3) and of the surface (g1, g2, g3):

    g1 m1,    g2 m1^2 + g1 m2,    g3 m1^3 + 3 g2 m1 m2 + g1 m3.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.faces.trim_pieces import (
    LET_GO,
    PIECE_DOUBLES,
    PIECE_INTS,
    piece_bend,
    piece_bounds_at,
    piece_links_at,
    trim_at,
)
from assembly.geometry.splines.evaluate import (
    into_domain,
    surface_at,
    surface_point,
)
from assembly.geometry.vec import add, blend, dot, scale, sub

_BUDGET = 100_000
_ROUNDING = 4e-15


@kernel(inner=True)
def _on_surface(store, surface, u, v):
    """The point and derivatives at parameters of any sheet; beyond an open end, those of the end."""
    patch = surface_at(store.table, surface)
    x, _fits = into_domain(store.pool, patch.breaks_u, patch.spans_u, patch.closed_u, u)
    y, _fits = into_domain(store.pool, patch.breaks_v, patch.spans_v, patch.closed_v, v)
    return surface_point(store.table, store.pool, surface, x, y)


@kernel(inner=True)
def _on_curve(store, surface, o, i, t):
    """A point of S(c(t)) with its first two derivatives."""
    piece = piece_bounds_at(store.pool, i)
    links = piece_links_at(store.table, o)
    u, v, du, dv, ddu, ddv = piece_bend(store.pool, links.coefficients, links.degree, t - piece.middle)
    s, su, sv, suu, suv, svv = _on_surface(store, surface, u + piece.shift_u, v + piece.shift_v)
    bend = add(blend(du * du, suu, 2.0 * du * dv, suv), blend(dv * dv, svv, 1.0, blend(ddu, su, ddv, sv)))
    return s, blend(du, su, dv, sv), bend


@kernel(inner=True)
def _newton(store, surface, o, i, a, b, t, q):
    """The nearest point of an interval on which the distance is convex; half its square and its parameter."""
    low = a
    high = b
    f = 0.0
    for _ in range(60):
        p, d, h = _on_curve(store, surface, o, i, t)
        e = sub(p, q)
        f = 0.5 * dot(e, e)
        g = dot(e, d)
        if g == 0.0:
            break
        if g > 0.0:
            high = t
            if t == a:
                break
        else:
            low = t
            if t == b:
                break
        curvature = dot(d, d) + dot(e, h)
        step = t - g / curvature if curvature > 0.0 else 0.5 * (low + high)
        if step <= a:
            step = a
        elif step >= b:
            step = b
        elif not low < step < high:
            step = 0.5 * (low + high)
        if abs(step - t) <= 2e-16 * max(abs(t), b - a):
            break
        t = step
    return f, t


@kernel(inner=True)
def _search(store, surface, o, i, q, m1, m2, m3, best):
    """As `trim.nearest_on_piece`, in space."""
    piece = piece_bounds_at(store.pool, i)
    t0 = piece.t0
    t1 = piece.t1
    found = t0 - 1.0
    level = 0
    index = 0
    h = t1 - t0
    for _ in range(_BUDGET):
        half = 0.5 * h
        m = t0 + (index + 0.5) * h
        p, d, dd = _on_curve(store, surface, o, i, m)
        e = sub(p, q)
        f = 0.5 * dot(e, e)
        if f < best:
            best = f
            found = m
        g = dot(e, d)
        speed = dot(d, d)
        curvature = speed + dot(e, dd)
        third = 3.0 * m1 * m2 + (np.sqrt(2.0 * f) + m1 * half) * m3
        bent = curvature - third * half / 3.0
        reach = min(half, abs(g) / bent) if bent > 0.0 else half
        low = f - abs(g) * reach + 0.5 * bent * reach * reach - _ROUNDING * (f + abs(g) * half)
        along = min(max(-g / speed, -half), half) if speed > 0.0 else 0.0
        beside = add(e, scale(along, d))
        apart = np.sqrt(dot(beside, beside)) - 0.5 * m2 * half * half - _ROUNDING * (np.sqrt(2.0 * f) + m1 * half)
        if apart > 0.0:
            low = max(low, 0.5 * apart * apart)
        if low < best:
            if curvature > third * half:
                begin = t0 + index * h
                f, t = _newton(store, surface, o, i, begin, min(begin + h, t1), m, q)
                if f < best:
                    best = f
                    found = t
            elif low < best - LET_GO * best and level < 50:
                level += 1
                index *= 2
                h = half
                continue
        index += 1
        while level > 0 and index % 2 == 0:
            index //= 2
            level -= 1
            h *= 2.0
        if level == 0:
            break
    return best, found


@kernel(signatures="(i8[::1], f8[::1], i8, i8, f8[::1], f8[::1], f8[::1], f8[:, ::1])")
def nearest_in_space(table, pool, surface, trim, bounds, u, v, out):
    """For flat parameters: distance in space to the boundary, index of the curve and its parameter, a row each.

    `bounds` are g1, g2, g3 of the surface.
    """
    store = Store(table, pool)
    trim_record = trim_at(table, trim)
    count = trim_record.pieces
    for n in range(u.size):
        q, _su, _sv, _suu, _suv, _svv = _on_surface(store, surface, u[n], v[n])
        best = np.inf
        out[n, 1] = -1.0
        out[n, 2] = 0.0
        for k in range(2 * count):
            o = trim_record.piece_table + PIECE_INTS * (k >> 1)
            i = trim_record.piece_pool + PIECE_DOUBLES * (k >> 1)
            t = piece_bounds_at(pool, i).t0 if k % 2 == 0 else piece_bounds_at(pool, i).t1
            p, _d, _h = _on_curve(store, surface, o, i, t)
            e = sub(p, q)
            if 0.5 * dot(e, e) < best:
                best = 0.5 * dot(e, e)
                out[n, 1] = piece_links_at(table, o).curve
                out[n, 2] = t
        for k in range(count):
            o = trim_record.piece_table + PIECE_INTS * k
            i = trim_record.piece_pool + PIECE_DOUBLES * k
            c1 = piece_bounds_at(pool, i).bound_1
            c2 = piece_bounds_at(pool, i).bound_2
            m1 = bounds[0] * c1
            m2 = bounds[1] * c1 * c1 + bounds[0] * c2
            m3 = bounds[2] * c1**3 + 3.0 * bounds[1] * c1 * c2 + bounds[0] * piece_bounds_at(pool, i).bound_3
            best, t = _search(store, surface, o, i, q, m1, m2, m3, best)
            if t >= piece_bounds_at(pool, i).t0:
                out[n, 1] = piece_links_at(table, o).curve
                out[n, 2] = t
        out[n, 0] = np.sqrt(2.0 * best)
