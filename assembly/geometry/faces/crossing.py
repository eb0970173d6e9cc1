"""Whether pieces of plane curves cross or touch: they are halved until parts are apart, or too small to be told apart.

A part of a piece over an interval of width h is within r = max |C''| h^2 / 8 of its chord and, being monotone in u
and in v, inside the box of its two ends. Two parts are apart where their boxes are, or where their chords are
farther apart than the sum of their r.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.faces.trim_pieces import bounds_of, links_of, piece_line, piece_of, trim_at, trim_frame_at

# Within this distance of a corner that two pieces share they are not compared (a part of the size).
_CORNER = 1e-5
# In a cusp, where both leave the corner along one tangent up to a sine of the second, the first is that distance:
# there curves from files overlap by rounding, and at this distance they are apart by some 1e-8 of the size at most.
_CUSP, _TANGENT = 1e-4, 1e-4
# Near a corner two pieces may come as close as this times the squared distance from the corner, over the size.
_OPENING = 1e-3
_BUDGET = 2_000_000


@kernel(inline=True)
def _between(x, low, high):
    return min(max(x, low), high)


@kernel(inner=True)
def _to_segment(p, a, b):
    """Squared distance from a point to a segment."""
    dx = b[0] - a[0]
    dy = b[1] - a[1]
    square = dx * dx + dy * dy
    t = 0.0
    if square > 0.0:
        t = _between(((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / square, 0.0, 1.0)
    ex = p[0] - a[0] - t * dx
    ey = p[1] - a[1] - t * dy
    return ex * ex + ey * ey


@kernel(inline=True)
def _left(a, u, p):
    """How far a point is to the left of a line from a along u, times |u|."""
    return u[0] * (p[1] - a[1]) - u[1] * (p[0] - a[0])


@kernel(inner=True)
def _segments(a, b, c, d):
    """Distance between two segments; 0 where they cross."""
    u = (b[0] - a[0], b[1] - a[1])
    v = (d[0] - c[0], d[1] - c[1])
    if _left(a, u, c) * _left(a, u, d) < 0.0 and _left(c, v, a) * _left(c, v, b) < 0.0:
        return 0.0
    square = min(_to_segment(a, c, d), _to_segment(b, c, d))
    return np.sqrt(min(square, _to_segment(c, a, b), _to_segment(d, a, b)))


# A piece that is compared. start, end: its ends; shift: moves its curve into the cell; move: moves it by whole periods;
# bound: on its second derivative.
MovedPiece = namedtuple("MovedPiece", "piece start end shift move bound")
# Corners that two pieces share. count: how many; first, second: where, both the same if there is one; around_first,
# around_second: within which distances of them the two pieces are not compared.
Corners = namedtuple("Corners", "count first second around_first around_second")


@kernel(inline=True)
def _moved(store, trim, k, move):
    """Piece k of a trim, a record, moved."""
    bounds = bounds_of(store, trim, k)
    return MovedPiece(
        piece=piece_of(store, trim, k),
        start=(bounds.start[0], bounds.start[1]),
        end=(bounds.end[0], bounds.end[1]),
        shift=(bounds.shift_u, bounds.shift_v),
        move=move,
        bound=bounds.bound_2,
    )


@kernel(inner=True)
def _place(pool, moved, t):
    """The point of a piece at a parameter; at its ends, the points that the table has."""
    move = moved.move
    if t <= moved.piece.t0:
        return moved.start[0] + move[0], moved.start[1] + move[1]
    if t >= moved.piece.t1:
        return moved.end[0] + move[0], moved.end[1] + move[1]
    x, y, _dx, _dy = piece_line(pool, moved.piece, t)
    return x + moved.shift[0] + move[0], y + moved.shift[1] + move[1]


@kernel(inner=True)
def _follows(store, trim, a, b, most):
    """Whether piece b follows piece a, with pieces of a length of at most `most` between them."""
    length = 0.0
    k = links_of(store, trim, a).after
    while k >= 0:
        if k == b:
            return True
        i = bounds_of(store, trim, k)
        length += abs(i.end[0] - i.start[0]) + abs(i.end[1] - i.start[1])
        if length > most or k == a:
            return False
        k = links_of(store, trim, k).after
    return False


@kernel(inline=True)
def _is_near(p, q, move, near):
    """Whether a point is near to another one that is moved."""
    return abs(p[0] - q[0] - move[0]) + abs(p[1] - q[1] - move[1]) <= near


@kernel(inline=True)
def _leaving(pool, moved, at_end):
    """The direction in which a piece leaves one of its ends."""
    _x, _y, du, dv = piece_line(pool, moved.piece, moved.piece.t1 if at_end else moved.piece.t0)
    return (-du, -dv) if at_end else (du, dv)


@kernel(inner=True)
def _is_cusp(pool, pair, ends):
    """Whether two pieces leave their ends, the last ones or the first ones, the same way."""
    u, v = _leaving(pool, pair[0], ends[0]), _leaving(pool, pair[1], ends[1])
    along = u[0] * v[0] + u[1] * v[1]
    return along > 0.0 and abs(u[0] * v[1] - u[1] * v[0]) <= _TANGENT * along


@kernel(inner=True)
def _common(pool, pair, ends, tolerance, size):
    """The radius around a common end of two pieces within which they are not compared; 0 if these ends differ.

    `ends` says of each piece whether its last end is meant. The second value is the length that pieces between the
    two may have: in a cusp there may be a tiny piece that is due to rounding.
    """
    a, b = pair
    p, q = a.end if ends[0] else a.start, b.end if ends[1] else b.start
    # One of the pieces is moved.
    move = b.move[0] - a.move[0], b.move[1] - a.move[1]
    if not _is_near(p, q, move, _CUSP * size):
        return 0.0, 0.0
    if _is_cusp(pool, pair, ends):
        return max(_CUSP * size, 16.0 * tolerance), _CUSP * size
    if not _is_near(p, q, move, 8.0 * tolerance):
        return 0.0, 0.0
    return max(_CORNER * size, 16.0 * tolerance), 4.0 * tolerance


@kernel(inner=True)
def _comes_after(store, trim, numbers, pair, tolerance, size):
    """The radius around the end of the first of two pieces without comparison, if the second begins there; else 0."""
    around, between = _common(store.pool, pair, (True, False), tolerance, size)
    return around if around > 0.0 and _follows(store, trim, numbers[0], numbers[1], between) else 0.0


@kernel(inner=True)
def _corners(store, trim, numbers, pair, tolerance, size):
    """The Corners of a pair of pieces with these numbers: where one follows the other."""
    a, b = pair
    after = _comes_after(store, trim, numbers, pair, tolerance, size)
    before = _comes_after(store, trim, (numbers[1], numbers[0]), (b, a), tolerance, size)
    # Places are those of the first piece, which is not moved.
    at_end, at_start = after > 0.0, before > 0.0
    first, second = a.end if at_end else a.start, a.start if at_start else a.end
    return Corners(
        int(at_end) + int(at_start), first, second, after if at_end else before, before if at_start else after
    )


@kernel(inner=True)
def _common_ends(pool, pair, tolerance, size):
    """The Corners of a pair of pieces that may share any of their ends."""
    a, _b = pair
    start, end = 0.0, 0.0
    for k in range(2):
        start = max(start, _common(pool, pair, (False, k == 1), tolerance, size)[0])
        end = max(end, _common(pool, pair, (True, k == 1), tolerance, size)[0])
    at_start, at_end = start > 0.0, end > 0.0
    return Corners(
        int(at_start) + int(at_end),
        a.end if at_end else a.start,
        a.start if at_start else a.end,
        end if at_end else start,
        start if at_start else end,
    )


@kernel(inline=True)
def _square_from(corner, p, q):
    """The square of the distance of a corner from the box of two points."""
    u = _between(corner[0], min(p[0], q[0]), max(p[0], q[0])) - corner[0]
    v = _between(corner[1], min(p[1], q[1]), max(p[1], q[1])) - corner[1]
    return u * u + v * v


@kernel(inline=True)
def _farthest(corner, p, q):
    """How far two points are from a corner at most, in u or in v."""
    return max(abs(p[0] - corner[0]), abs(q[0] - corner[0]), abs(p[1] - corner[1]), abs(q[1] - corner[1]))


@kernel(inline=True)
def _gap(p, q, r, s):
    """The distance of the boxes of two pairs of points."""
    u = max(min(p[0], q[0]) - max(r[0], s[0]), min(r[0], s[0]) - max(p[0], q[0]), 0.0)
    v = max(min(p[1], q[1]) - max(r[1], s[1]), min(r[1], s[1]) - max(p[1], q[1]), 0.0)
    return np.sqrt(u * u + v * v)


@kernel(inner=True)
def _meet(pool, a, b, corners, tolerance, size, stack, budget):
    """Whether two pieces meet elsewhere than at a common corner, where, and what is left of the budget."""
    stack[0, 0], stack[0, 1] = a.piece.t0, a.piece.t1
    stack[0, 2], stack[0, 3] = b.piece.t0, b.piece.t1
    top = 1
    while top > 0:
        top -= 1
        budget -= 1
        a0, a1, b0, b1 = stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3]
        p, q = _place(pool, a, a0), _place(pool, a, a1)
        r, s = _place(pool, b, b0), _place(pool, b, b1)
        needed = tolerance
        if corners.count > 0:
            # How far the first part is from the corner: the box of its ends holds it.
            square = min(_square_from(corners.first, p, q), _square_from(corners.second, p, q))
            needed = min(tolerance, _OPENING * square / size)
        if _gap(p, q, r, s) > needed:
            continue
        bent_a = 0.125 * a.bound * (a1 - a0) ** 2
        bent_b = 0.125 * b.bound * (b1 - b0) ** 2
        if _segments(p, q, r, s) - bent_a - bent_b > needed:
            continue
        if corners.count > 0:
            first = max(_farthest(corners.first, p, q), _farthest(corners.first, r, s))
            second = max(_farthest(corners.second, p, q), _farthest(corners.second, r, s))
            if first <= corners.around_first or second <= corners.around_second:
                continue
        extent_a = abs(q[0] - p[0]) + abs(q[1] - p[1])
        extent_b = abs(s[0] - r[0]) + abs(s[1] - r[1])
        if (extent_a <= 0.5 * tolerance and extent_b <= 0.5 * tolerance) or budget <= 0 or top + 2 > stack.shape[0]:
            return True, 0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1]), budget
        for k in range(4):
            stack[top + 1, k] = stack[top, k]
        if extent_a >= extent_b:
            stack[top, 1] = stack[top + 1, 0] = 0.5 * (a0 + a1)
        else:
            stack[top, 3] = stack[top + 1, 2] = 0.5 * (b0 + b1)
        top += 2
    return False, 0.0, 0.0, budget


@kernel(inner=True, allocates=True)
def find_crossing(table, pool, pieces, moves, tolerance, joined, where):
    """The first two pieces that cross, touch or overlap: their numbers, and the point in `where`; (-1, -1): none.

    `pieces` are numbers of pieces of the trim at the start of the table, in the order of their least u after each is
    moved by its row of `moves` (whole periods). Two pieces may meet where one follows the other; if `joined`, wherever
    two of their ends coincide.
    """
    store = Store(table, pool)
    record = trim_at(table, 0)
    size = trim_frame_at(pool, record.frame).extent
    stack = np.empty((256, 4))
    budget = _BUDGET
    for j in range(pieces.size):
        a = pieces[j]
        box = bounds_of(store, record, a).box
        move_u = moves[j, 0]
        move_v = moves[j, 1]
        right = box[1] + move_u + tolerance
        for k in range(j + 1, pieces.size):
            b = pieces[k]
            other = bounds_of(store, record, b).box
            shift_u = moves[k, 0]
            shift_v = moves[k, 1]
            if other[0] + shift_u > right:
                break
            if other[2] + shift_v > box[3] + move_v + tolerance:
                continue
            if other[3] + shift_v < box[2] + move_v - tolerance:
                continue
            if (move_u != 0.0 or move_v != 0.0) and (shift_u != 0.0 or shift_v != 0.0):
                continue
            first = _moved(store, record, a, (0.0, 0.0))
            second = _moved(store, record, b, (shift_u - move_u, shift_v - move_v))
            corners = _corners(store, record, (a, b), (first, second), tolerance, size)
            if joined:
                corners = _common_ends(pool, (first, second), tolerance, size)
            found, u, v, budget = _meet(pool, first, second, corners, tolerance, size, stack, budget)
            if found:
                where[0] = u + move_u
                where[1] = v + move_v
                return a, b
    return -1, -1


@kernel(signatures="(i8[::1], f8[::1], i8[::1], f8[:, ::1], f8, b1, f8[::1])", allocates=True)
def first_crossing(table, pool, pieces, moves, tolerance, joined, where):
    """`find_crossing` for Python."""
    return find_crossing(table, pool, pieces, moves, tolerance, joined, where)
