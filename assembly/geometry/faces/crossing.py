"""Whether pieces of plane curves cross or touch: pairs of pieces are halved until they are apart, or too small to be.

A part of a piece over an interval of width h is within r = max |C''| h^2 / 8 of its chord, and, as it runs one way in
u and in v, inside the box of its two ends. Two parts are apart where their boxes are, or where their chords are
farther apart than both r together.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.faces.trim_pieces import (
    PIECE_DOUBLES,
    PIECE_INTS,
    piece_bounds_at,
    piece_line,
    piece_links_at,
)

# Around a corner that two pieces share, as a part of the size, they are not compared.
_CORNER = 1e-5
# Near it they may be as near to one another as this part of the square of their distance from it.
_OPENING = 1e-3
_BUDGET = 2_000_000


@kernel(inline=True)
def _between(x, low, high):
    return min(max(x, low), high)


@kernel(inner=True)
def _to_segment(px, py, ax, ay, bx, by):
    """Squared distance from a point to a segment."""
    dx = bx - ax
    dy = by - ay
    square = dx * dx + dy * dy
    t = 0.0
    if square > 0.0:
        t = _between(((px - ax) * dx + (py - ay) * dy) / square, 0.0, 1.0)
    ex = px - ax - t * dx
    ey = py - ay - t * dy
    return ex * ex + ey * ey


@kernel(inner=True)
def _segments(ax, ay, bx, by, cx, cy, dx, dy):
    """Distance between two segments; 0 where they cross."""
    ux = bx - ax
    uy = by - ay
    vx = dx - cx
    vy = dy - cy
    c = ux * (cy - ay) - uy * (cx - ax)
    d = ux * (dy - ay) - uy * (dx - ax)
    a = vx * (ay - cy) - vy * (ax - cx)
    b = vx * (by - cy) - vy * (bx - cx)
    if c * d < 0.0 and a * b < 0.0:
        return 0.0
    square = min(_to_segment(ax, ay, cx, cy, dx, dy), _to_segment(bx, by, cx, cy, dx, dy))
    square = min(square, _to_segment(cx, cy, ax, ay, bx, by), _to_segment(dx, dy, ax, ay, bx, by))
    return np.sqrt(square)


@kernel(inner=True)
def _place(store, ints, doubles, piece, t, move_u, move_v):
    """The point of a piece at a parameter; its ends are as the table has them."""
    o = piece_links_at(store.table, ints + PIECE_INTS * piece)
    i = piece_bounds_at(store.pool, doubles + PIECE_DOUBLES * piece)
    if t <= i.t0:
        return i.start[0] + move_u, i.start[1] + move_v
    if t >= i.t1:
        return i.end[0] + move_u, i.end[1] + move_v
    x, y, _dx, _dy = piece_line(store.pool, o.coefficients, o.degree, t - i.middle)
    return x + i.shift_u + move_u, y + i.shift_v + move_v


@kernel(inner=True)
def _follows(store, ints, doubles, a, b, tolerance):
    """Whether b comes after a, at once or after a stretch of next to nothing."""
    length = 0.0
    k = piece_links_at(store.table, ints + PIECE_INTS * a).after
    while k >= 0:
        if k == b:
            return True
        i = piece_bounds_at(store.pool, doubles + PIECE_DOUBLES * k)
        length += abs(i.end[0] - i.start[0]) + abs(i.end[1] - i.start[1])
        if length > 4.0 * tolerance or k == a:
            return False
        k = piece_links_at(store.table, ints + PIECE_INTS * k).after
    return False


@kernel(inner=True)
def _meet(store, ints, doubles, a, b, move_u, move_v, tolerance, size, stack, budget):
    """Whether two pieces meet beside a common corner, where, and what is left of the budget."""
    ia = piece_bounds_at(store.pool, doubles + PIECE_DOUBLES * a)
    ib = piece_bounds_at(store.pool, doubles + PIECE_DOUBLES * b)
    corners = 0
    corner_u = 0.0
    corner_v = 0.0
    other_u = 0.0
    other_v = 0.0
    near = 8.0 * tolerance
    if _follows(store, ints, doubles, a, b, tolerance):
        corner_u = ia.end[0]
        corner_v = ia.end[1]
        if abs(corner_u - ib.start[0] - move_u) + abs(corner_v - ib.start[1] - move_v) <= near:
            corners = 1
    if _follows(store, ints, doubles, b, a, tolerance):
        other_u = ia.start[0]
        other_v = ia.start[1]
        if abs(other_u - ib.end[0] - move_u) + abs(other_v - ib.end[1] - move_v) <= near:
            if corners == 0:
                corner_u = other_u
                corner_v = other_v
            corners += 1
    if corners == 1:
        other_u = corner_u
        other_v = corner_v
    radius = max(_CORNER * size, 2.0 * near) if corners > 0 else 0.0
    stack[0, 0] = ia.t0
    stack[0, 1] = ia.t1
    stack[0, 2] = ib.t0
    stack[0, 3] = ib.t1
    top = 1
    while top > 0:
        top -= 1
        budget -= 1
        a0 = stack[top, 0]
        a1 = stack[top, 1]
        b0 = stack[top, 2]
        b1 = stack[top, 3]
        px, py = _place(store, ints, doubles, a, a0, 0.0, 0.0)
        qx, qy = _place(store, ints, doubles, a, a1, 0.0, 0.0)
        rx, ry = _place(store, ints, doubles, b, b0, move_u, move_v)
        sx, sy = _place(store, ints, doubles, b, b1, move_u, move_v)
        gap_u = max(min(px, qx) - max(rx, sx), min(rx, sx) - max(px, qx), 0.0)
        gap_v = max(min(py, qy) - max(ry, sy), min(ry, sy) - max(py, qy), 0.0)
        apart = np.sqrt(gap_u * gap_u + gap_v * gap_v)
        needed = tolerance
        if corners > 0:
            # How far the first part is from the corner: the box of its ends holds it.
            cu = _between(corner_u, min(px, qx), max(px, qx)) - corner_u
            cv = _between(corner_v, min(py, qy), max(py, qy)) - corner_v
            ou = _between(other_u, min(px, qx), max(px, qx)) - other_u
            ov = _between(other_v, min(py, qy), max(py, qy)) - other_v
            square = min(cu * cu + cv * cv, ou * ou + ov * ov)
            needed = min(tolerance, _OPENING * square / size)
        if apart > needed:
            continue
        bent_a = 0.125 * ia.bound_2 * (a1 - a0) ** 2
        bent_b = 0.125 * ib.bound_2 * (b1 - b0) ** 2
        if _segments(px, py, qx, qy, rx, ry, sx, sy) - bent_a - bent_b > needed:
            continue
        if corners > 0:
            inside = True
            for k in range(2):
                cu = corner_u if k == 0 else other_u
                cv = corner_v if k == 0 else other_v
                far = max(abs(px - cu), abs(qx - cu), abs(py - cv), abs(qy - cv))
                far = max(far, abs(rx - cu), abs(sx - cu), abs(ry - cv), abs(sy - cv))
                inside = far <= radius
                if inside:
                    break
            if inside:
                continue
        extent_a = abs(qx - px) + abs(qy - py)
        extent_b = abs(sx - rx) + abs(sy - ry)
        if (extent_a <= 0.5 * tolerance and extent_b <= 0.5 * tolerance) or budget <= 0 or top + 2 > stack.shape[0]:
            return True, 0.5 * (px + qx), 0.5 * (py + qy), budget
        for k in range(4):
            stack[top + 1, k] = stack[top, k]
        if extent_a >= extent_b:
            m = 0.5 * (a0 + a1)
            stack[top, 1] = m
            stack[top + 1, 0] = m
        else:
            m = 0.5 * (b0 + b1)
            stack[top, 3] = m
            stack[top + 1, 2] = m
        top += 2
    return False, 0.0, 0.0, budget


@kernel(signatures="(i8[::1], f8[::1], i8, i8, i8[::1], f8[:, ::1], i8[::1], f8, f8, f8[::1])")
def first_crossing(table, pool, ints, doubles, pieces, moves, order, tolerance, size, where):
    """The first two pieces that cross, touch or overlap: their numbers, and the point in `where`; (-1, -1): none.

    `pieces` are numbers of pieces, each to be moved by the row of `moves` (whole periods), and `order` is what sorts
    them by their least u.
    """
    stack = np.empty((256, 4))
    budget = _BUDGET
    for j in range(order.size):
        a = pieces[order[j]]
        i = doubles + PIECE_DOUBLES * a
        move_u = moves[order[j], 0]
        move_v = moves[order[j], 1]
        right = pool[i + 1] + move_u + tolerance
        for k in range(j + 1, order.size):
            b = pieces[order[k]]
            n = doubles + PIECE_DOUBLES * b
            shift_u = moves[order[k], 0]
            shift_v = moves[order[k], 1]
            if pool[n] + shift_u > right:
                break
            if pool[n + 2] + shift_v > pool[i + 3] + move_v + tolerance:
                continue
            if pool[n + 3] + shift_v < pool[i + 2] + move_v - tolerance:
                continue
            if (move_u != 0.0 or move_v != 0.0) and (shift_u != 0.0 or shift_v != 0.0):
                continue
            found, u, v, budget = _meet(
                Store(table, pool),
                ints,
                doubles,
                a,
                b,
                shift_u - move_u,
                shift_v - move_v,
                tolerance,
                size,
                stack,
                budget,
            )
            if found:
                where[0] = u + move_u
                where[1] = v + move_v
                return a, b
    return -1, -1
