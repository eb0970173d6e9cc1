"""The point of a face's boundary that is nearest in space: branch and bound over the pieces of its curves S(c(t)).

The bounds on the derivatives of S(c(t)) follow from those of the piece c (m1, m2, m3) and of the surface (g1, g2, g3):

    g1 m1,    g2 m1^2 + g1 m2,    g3 m1^3 + 3 g2 m1 m2 + g1 m3.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly._newton import bracketed_newton
from assembly._record import Store
from assembly.geometry.faces.trim_pieces import (
    LET_GO,
    bounds_of,
    links_of,
    next_part,
    piece_bend,
    piece_of,
    trim_at,
)
from assembly.geometry.nearest_place import sight_of
from assembly.geometry.splines.evaluate import into_domain, surface_at, surface_point
from assembly.geometry.vec import add, blend, dot, scale, sub

_BUDGET = 100_000
_ROUNDING = 4e-15


@kernel(inner=True)
def _on_surface(store, surface, u, v):
    """The point and derivatives at parameters wrapped into the domain; beyond an open end, those at the end."""
    patch = surface_at(store.table, surface)
    x, _fits = into_domain(store.pool, patch.breaks_u, patch.spans_u, patch.closed_u, u)
    y, _fits = into_domain(store.pool, patch.breaks_v, patch.spans_v, patch.closed_v, v)
    return surface_point(store.table, store.pool, surface, x, y)


# A piece of a boundary on its surface, a record. shift: moves the piece into the cell.
SpacePiece = namedtuple("SpacePiece", "surface piece shift")


@kernel(inline=True)
def _space_piece(store, surface, trim, k):
    """Piece k of a trim, a record, on its surface."""
    bounds = bounds_of(store, trim, k)
    return SpacePiece(surface, piece_of(store, trim, k), (bounds.shift_u, bounds.shift_v))


@kernel(inner=True)
def _on_curve(store, curve, t):
    """A point of S(c(t)) with its first two derivatives."""
    (u, v), (du, dv), (ddu, ddv) = piece_bend(store.pool, curve.piece, t)
    s, su, sv, suu, suv, svv = _on_surface(store, curve.surface, u + curve.shift[0], v + curve.shift[1])
    bend = add(blend(du * du, suu, 2.0 * du * dv, suv), blend(dv * dv, svv, 1.0, blend(ddu, su, ddv, sv)))
    return s, blend(du, su, dv, sv), bend


# A piece on its surface and a point.
SpaceQuery = namedtuple("SpaceQuery", "store curve q")


@kernel(inline=True)
def _seen(query, t):
    """The `Sight` of the query point from the curve point at t."""
    p, d, h = _on_curve(query.store, query.curve, t)
    return sight_of(sub(p, query.q), d, h)


_nearest_in = kernel(inline=True)(bracketed_newton(_seen, inside=False))


@kernel(inner=True)
def _search(store, curve, bounds, q, best):
    """As `trim_pieces.nearest_on_piece`, in space."""
    t0, t1 = curve.piece.t0, curve.piece.t1
    m1, m2, m3 = bounds
    found = t0 - 1.0
    level = 0
    index = 0
    h = t1 - t0
    for _ in range(_BUDGET):
        half = 0.5 * h
        m = t0 + (index + 0.5) * h
        p, d, dd = _on_curve(store, curve, m)
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
                t, near = _nearest_in(SpaceQuery(store, curve, q), begin, min(begin + h, t1), m)
                if near.merit < best:
                    best = near.merit
                    found = t
            elif low < best - LET_GO * best and level < 50:
                level += 1
                index *= 2
                h = half
                continue
        level, index, h = next_part(level, index, h)
        if level == 0:
            break
    return best, found


@kernel(signatures="(i8[::1], f8[::1], i8, i8, f8[::1], f8[::1], f8[::1], f8[:, ::1])")
def nearest_in_space(table, pool, surface, trim, bounds, u, v, out):
    """For flat parameters: distance in space to the boundary, index of the curve and its parameter, a row each.

    `bounds` are g1, g2, g3 of the surface.
    """
    store = Store(table, pool)
    record = trim_at(table, trim)
    for n in range(u.size):
        q, _su, _sv, _suu, _suv, _svv = _on_surface(store, surface, u[n], v[n])
        best = np.inf
        out[n, 1] = -1.0
        out[n, 2] = 0.0
        for k in range(2 * record.pieces):
            curve = _space_piece(store, surface, record, k >> 1)
            t = curve.piece.t0 if k % 2 == 0 else curve.piece.t1
            p, _d, _h = _on_curve(store, curve, t)
            e = sub(p, q)
            if 0.5 * dot(e, e) < best:
                best = 0.5 * dot(e, e)
                out[n, 1] = links_of(store, record, k >> 1).curve
                out[n, 2] = t
        for k in range(record.pieces):
            curve = _space_piece(store, surface, record, k)
            piece = bounds_of(store, record, k)
            c1, c2, c3 = piece.bound_1, piece.bound_2, piece.bound_3
            m1 = bounds[0] * c1
            m2 = bounds[1] * c1 * c1 + bounds[0] * c2
            m3 = bounds[2] * c1**3 + 3.0 * bounds[1] * c1 * c2 + bounds[0] * c3
            best, t = _search(store, curve, (m1, m2, m3), q, best)
            if t >= curve.piece.t0:
                out[n, 1] = links_of(store, record, k).curve
                out[n, 2] = t
        out[n, 0] = np.sqrt(2.0 * best)
