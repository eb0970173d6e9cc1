"""Monotone pieces of boundary curves: where they pass a given u or v, and where they are nearest to a point.

Nearest points are found by branch and bound. With F(t) = |C(t) - (u, v)|^2 / 2 around the middle m of an interval
of half width h, and a bound L on |F'''|,

    F(t) >= F(m) + F'(m) (t - m) + (F''(m) - L h / 3) (t - m)^2 / 2,

and |C(t) - C(m) - C'(m) (t - m)| <= max |C''| h^2 / 2; an interval with F'' > L h is convex and left to Newton.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly._lanes import lane, load_lanes
from assembly._newton import bracketed_newton, damped_newton
from assembly._record import record_dtype, record_view, size_of
from assembly.geometry.nearest_place import Interval, Sight, move_along, step_along

# A trim in the table: the boundary of a face in its parameters.
TRIM = record_dtype(
    "i8",
    curves=1,  # how many boundary curves
    first=1,  # where in the table their records begin
    all_pieces=1,  # how many pieces
    pieces=1,  # how many of them are of the boundary alone
    piece_table=1,  # where in the table the pieces begin
    piece_pool=1,  # where in the pool the pieces begin
    curve_pieces=1,  # where in the table the first piece of every curve stands
    frame=1,  # where in the pool the frame stands
    steps=1,  # how many steps of w along the bottom
    step_pool=1,  # where in the pool the steps begin
)
trim_at = record_view(TRIM)
TRIM_RECORD = size_of(TRIM)
# The frame of a trim in the pool; everything is in parameters.
TRIM_FRAME_RECORD = record_dtype(
    "f8",
    low_u=1,  # the cell of a periodic surface, or the domain
    low_v=1,
    high_u=1,
    high_v=1,
    period_u=1,  # 0: open
    period_v=1,
    on=1,  # points nearer to the boundary than this are on it
    bottom=1,  # winding number w at the bottom left
    extent=1,  # size of the cell or domain
)
trim_frame_at = record_view(TRIM_FRAME_RECORD)
FRAME = size_of(TRIM_FRAME_RECORD)
# A piece of a boundary curve, its integers.
PIECE_LINKS = record_dtype(
    "i8",
    curve=1,  # number of its boundary curve
    coefficients=1,  # where in the pool its coefficients are
    degree=1,
    before=1,  # the piece before it; -1: none
    after=1,  # the piece after it; -1: none
    sign_u=1,  # of u' all along
    sign_v=1,  # of v' all along
    major=1,  # the coordinate that changes faster (0: u, 1: v)
)
piece_links_at = record_view(PIECE_LINKS)
PIECE_INTS = size_of(PIECE_LINKS)
# The same piece, its doubles.
PIECE_BOUNDS = record_dtype(
    "f8",
    box=4,  # low u, high u, low v, high v
    t0=1,  # its interval on the curve
    t1=1,
    shift_u=1,  # moves its curve into the cell
    shift_v=1,
    middle=1,  # of its span
    bound_1=1,  # on |C'|
    bound_2=1,  # on |C''|
    bound_3=1,  # on |C'''|
    start=2,  # (u, v) at t0
    end=2,  # (u, v) at t1
)
piece_bounds_at = record_view(PIECE_BOUNDS)
PIECE_DOUBLES = size_of(PIECE_BOUNDS)
# Accepted relative error of the squared distance to the nearest point: it bounds the work where the distance hardly
# changes, as from the center of a circle.
LET_GO = 1e-10
_ROUNDING = 4e-15
# Intervals that a query may look at on one piece before it takes the nearest point found so far.
_BUDGET = 100_000


# A piece, or a part of one. at: where in the pool its coefficients are; middle: of its span; t0, t1: its interval.
Piece = namedtuple("Piece", "at degree middle t0 t1")


@kernel(inline=True)
def piece_of(store, trim, k):
    """Piece k of a trim, a record."""
    links = piece_links_at(store.table, trim.piece_table + PIECE_INTS * k)
    bounds = piece_bounds_at(store.pool, trim.piece_pool + PIECE_DOUBLES * k)
    return Piece(links.coefficients, links.degree, bounds.middle, bounds.t0, bounds.t1)


@kernel(inline=True)
def links_of(store, trim, k):
    """The integers of piece k of a trim, a record."""
    return piece_links_at(store.table, trim.piece_table + PIECE_INTS * k)


@kernel(inline=True)
def bounds_of(store, trim, k):
    """The doubles of piece k of a trim, a record."""
    return piece_bounds_at(store.pool, trim.piece_pool + PIECE_DOUBLES * k)


@kernel(inline=True)
def piece_line(pool, piece, t):
    """u, v, u', v' of a rational piece."""
    s = t - piece.middle
    p = load_lanes(pool, piece.at + 4 * piece.degree)
    d = 0.0 * p
    for k in range(piece.degree - 1, -1, -1):
        d = p + s * d
        p = load_lanes(pool, piece.at + 4 * k) + s * p
    i = 1.0 / lane(p, 3)
    a = i * p
    b = i * (d - lane(d, 3) * a)
    return lane(a, 0), lane(a, 1), lane(b, 0), lane(b, 1)


@kernel(inline=True)
def piece_bend(pool, piece, t):
    """(u, v), (u', v'), (u'', v'') of a rational piece."""
    s = t - piece.middle
    p = load_lanes(pool, piece.at + 4 * piece.degree)
    d = 0.0 * p
    h = 0.0 * p
    for k in range(piece.degree - 1, -1, -1):
        h = d + s * h
        d = p + s * d
        p = load_lanes(pool, piece.at + 4 * k) + s * p
    i = 1.0 / lane(p, 3)
    a = i * p
    b = i * (d - lane(d, 3) * a)
    c = i * (2.0 * h - (2.0 * lane(d, 3)) * b - (2.0 * lane(h, 3)) * a)
    return (lane(a, 0), lane(a, 1)), (lane(b, 0), lane(b, 1)), (lane(c, 0), lane(c, 1))


# A query: where a monotone piece has the coordinate `target` on `axis`. sense: -1 if that falls along the piece.
PieceCut = namedtuple("PieceCut", "pool piece axis target sense")
# A point of the piece. slope: how far it is beyond the target, times sense; it rises along the piece, as the slope of
# a convex function does. curvature: the rate of the slope.
CutPoint = namedtuple("CutPoint", "slope curvature point direction")


@kernel(inline=True)
def _cut_point(cut, t):
    x, y, dx, dy = piece_line(cut.pool, cut.piece, t)
    beyond, rate = (x - cut.target, dx) if cut.axis == 0 else (y - cut.target, dy)
    return CutPoint(cut.sense * beyond, cut.sense * rate, (x, y), (dx, dy))


_cut = kernel(inline=True)(bracketed_newton(_cut_point, inside=True, resolution=3e-16))


@kernel(inner=True)
def piece_at(pool, piece, axis, target, start, end):
    """The parameter at which a monotone piece has a coordinate, and its point and direction there."""
    low, high = piece.t0, piece.t1
    t = low + (high - low) * (target - start) / (end - start)
    t, found = _cut(PieceCut(pool, piece, axis, target, 1.0 if end > start else -1.0), low, high, t)
    return t, found.point, found.direction


# A piece and a point of the plane.
PieceQuery = namedtuple("PieceQuery", "pool piece q interval")


@kernel(inline=True)
def _seen(query, t):
    """The `Sight` of the query point from the curve point at t."""
    (x, y), (dx, dy), (ddx, ddy) = piece_bend(query.pool, query.piece, t)
    ex = x - query.q[0]
    ey = y - query.q[1]
    speed = dx * dx + dy * dy
    return Sight(0.5 * (ex * ex + ey * ey), ex * dx + ey * dy, speed + ex * ddx + ey * ddy, speed)


_nearest_in = kernel(inline=True)(bracketed_newton(_seen, inside=False))
_nearest_from = kernel(inline=True)(damped_newton(_seen, step_along, move_along, steps=20))


@kernel(inline=True)
def next_part(level, index, h):
    """The next part, in the order of a binary subdivision, after one that is done: its level, index and width."""
    index += 1
    while level > 0 and index % 2 == 0:
        index //= 2
        level -= 1
        h *= 2.0
    return level, index, h


@kernel(inner=True)
def nearest_on_piece(pool, piece, bounds, q, best):
    """Half the squared distance to q and the parameter of the nearest point of a piece, where it beats `best`.

    The `bounds` are those on |C'|, |C''| and |C'''|. The parameter is `t0 - 1` where no point beats `best`.
    """
    t0, t1 = piece.t0, piece.t1
    m1, m2, m3 = bounds
    query = PieceQuery(pool, piece, q, Interval(t0, t1, False))
    found = t0 - 1.0
    level = 0
    index = 0
    h = t1 - t0
    for _ in range(_BUDGET):
        half = 0.5 * h
        m = t0 + (index + 0.5) * h
        (x, y), (dx, dy), (ddx, ddy) = piece_bend(pool, piece, m)
        ex = x - q[0]
        ey = y - q[1]
        f = 0.5 * (ex * ex + ey * ey)
        if f < best:
            best = f
            found = m
        g = ex * dx + ey * dy
        speed = dx * dx + dy * dy
        curvature = speed + ex * ddx + ey * ddy
        third = 3.0 * m1 * m2 + (np.sqrt(2.0 * f) + m1 * half) * m3
        bent = curvature - third * half / 3.0
        reach = half
        if bent > 0.0:
            reach = min(half, abs(g) / bent)
        # What rounding may have added comes off: for a point near the curve the bound is a small difference.
        low = f - abs(g) * reach + 0.5 * bent * reach * reach - _ROUNDING * (f + abs(g) * half)
        if low < best:
            # A tangent and how far the piece may be from it.
            along = min(max(-g / speed, -half), half) if speed > 0.0 else 0.0
            apart = np.sqrt((ex + along * dx) ** 2 + (ey + along * dy) ** 2) - 0.5 * m2 * half * half
            apart -= _ROUNDING * (np.sqrt(2.0 * f) + m1 * half)
            if apart > 0.0:
                low = max(low, 0.5 * apart * apart)
        if low < best:
            if curvature > third * half:
                begin = t0 + index * h
                t, near = _nearest_in(query, begin, min(begin + h, t1), m)
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


@kernel(inner=True)
def polished(pool, piece, t, q):
    """The parameter of a nearest point, from one near it, by Newton's method as long as the distance decreases."""
    return _nearest_from(PieceQuery(pool, piece, q, Interval(piece.t0, piece.t1, False)), t)[2]


@kernel(signatures="(f8[::1], i8[::1], i8[::1], f8[::1], f8[::1], f8[:, ::1])")
def ends_of_pieces(pool, coefficients, degrees, middles, t, out):
    """Points of pieces at parameters."""
    for k in range(t.size):
        piece = Piece(coefficients[k], degrees[k], middles[k], t[k], t[k])
        out[k, 0], out[k, 1], _du, _dv = piece_line(pool, piece, t[k])


@kernel(signatures="(f8[::1], i8, i8, f8, UniTuple(f8, 2), i8, f8, UniTuple(f8, 2))")
def cut_of_piece(pool, coefficients, degree, middle, interval, axis, target, ends):
    """The parameter at which a piece has a coordinate, whose values at its ends are `ends`, and its point there."""
    piece = Piece(coefficients, degree, middle, interval[0], interval[1])
    t, point, _direction = piece_at(pool, piece, axis, target, ends[0], ends[1])
    return t, point[0], point[1]
