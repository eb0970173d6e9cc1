"""Where the boundary of a face is nearest to a point, and which side of it the point is on there.

The boundary is cut into monotone pieces (`geometry/faces/trim.py`). Nearest points are found by branch and bound over
them
(`geometry/faces/trim_pieces.py`): ends first, then what is between them, then copies one period away. At a corner the
two directions tell the side, or the winding number where they do not.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.faces.trim import into_cell, winding
from assembly.geometry.faces.trim_pieces import (
    BOUND_1,
    BOUND_2,
    BOUND_3,
    END,
    HIGH_U,
    HIGH_V,
    LOW_U,
    LOW_V,
    MIDDLE,
    PERIOD_U,
    PERIOD_V,
    PIECE_AFTER,
    PIECE_BEFORE,
    PIECE_COEFFICIENTS,
    PIECE_CURVE,
    PIECE_DEGREE,
    PIECE_DOUBLES,
    PIECE_INTS,
    PIECE_T0,
    PIECE_T1,
    SHIFT_U,
    SHIFT_V,
    SIZE,
    START,
    TRIM_CURVE_PIECES,
    TRIM_FRAME,
    TRIM_PIECE_POOL,
    TRIM_PIECE_TABLE,
    nearest_on_piece,
    piece_line,
    polished,
)

# Neighbors whose directions differ by less [rad] are one smooth curve.
_SMOOTH = 1e-6
# A foot this near to the end of a piece is at the end if the point is beyond it by more than the second, both parts of
# the boundary's size.
_AT_END, _BEYOND = 1e-9, 1e-13
# Where the speed of a piece is less than this part of its largest, its direction is rounding.
_SLOW = 1e-9


@kernel(inline=True)
def _gap(x, low, high):
    """How far a coordinate is from an interval."""
    return max(low - x, x - high, 0.0)


@kernel(inner=True)
def _end_direction(table, pool, o, i, at_end):
    """Unit direction of a piece at one of its ends, from the chord where its speed vanishes there."""
    t = pool[i + PIECE_T1] if at_end else pool[i + PIECE_T0]
    x, y, dx, dy = piece_line(pool, table[o + PIECE_COEFFICIENTS], table[o + PIECE_DEGREE], t - pool[i + MIDDLE])
    length = np.sqrt(dx * dx + dy * dy)
    if length <= _SLOW * pool[i + BOUND_1]:
        near = t + 1e-4 * (pool[i + PIECE_T0] - pool[i + PIECE_T1]) * (1.0 if at_end else -1.0)
        a, b, dx, dy = piece_line(pool, table[o + PIECE_COEFFICIENTS], table[o + PIECE_DEGREE], near - pool[i + MIDDLE])
        dx = x - a if at_end else a - x
        dy = y - b if at_end else b - y
        length = np.sqrt(dx * dx + dy * dy)
    return dx / length, dy / length


@kernel(inner=True)
def _nearest_end(pool, doubles, begin, stop, x, y, best):
    """Half the squared distance to the nearest end of pieces, the piece and the parameter, if it beats `best`."""
    piece = begin
    t = 0.0
    for k in range(begin, stop):
        i = doubles + PIECE_DOUBLES * k
        f = 0.5 * ((x - pool[i + START]) ** 2 + (y - pool[i + START + 1]) ** 2)
        if f < best:
            best = f
            piece = k
            t = pool[i + PIECE_T0]
        f = 0.5 * ((x - pool[i + END]) ** 2 + (y - pool[i + END + 1]) ** 2)
        if f < best:
            best = f
            piece = k
            t = pool[i + PIECE_T1]
    return best, piece, t


@kernel(inner=True)
def _nearest_inside(table, pool, ints, doubles, begin, stop, x, y, best):
    """The same for all points of pieces, those aside whose box is too far."""
    piece = begin
    t = 0.0
    for k in range(begin, stop):
        o = ints + PIECE_INTS * k
        i = doubles + PIECE_DOUBLES * k
        gap_u = _gap(x, pool[i], pool[i + 1])
        gap_v = _gap(y, pool[i + 2], pool[i + 3])
        if 0.5 * (gap_u * gap_u + gap_v * gap_v) < best:
            best, at = nearest_on_piece(
                pool,
                table[o + PIECE_COEFFICIENTS],
                table[o + PIECE_DEGREE],
                pool[i + MIDDLE],
                pool[i + PIECE_T0],
                pool[i + PIECE_T1],
                pool[i + BOUND_1],
                pool[i + BOUND_2],
                pool[i + BOUND_3],
                x - pool[i + SHIFT_U],
                y - pool[i + SHIFT_V],
                best,
            )
            if at >= pool[i + PIECE_T0]:
                piece = k
                t = at
    return best, piece, t


@kernel(inner=True)
def trim_nearest(table, pool, trim, first, count, u, v):
    """Signed distance to boundary curves, index and parameter of the foot, the foot, and its normal to material.

    The distance is positive on the material side of the curves `first` to `first + count - 1`.
    """
    frame = table[trim + TRIM_FRAME]
    period_u = pool[frame + PERIOD_U]
    period_v = pool[frame + PERIOD_V]
    qx = into_cell(u, pool[frame + LOW_U], pool[frame + HIGH_U], period_u)
    qy = into_cell(v, pool[frame + LOW_V], pool[frame + HIGH_V], period_v)
    begin = table[table[trim + TRIM_CURVE_PIECES] + first]
    stop = table[table[trim + TRIM_CURVE_PIECES] + first + count]
    ints = table[trim + TRIM_PIECE_TABLE]
    doubles = table[trim + TRIM_PIECE_POOL]
    copies_u = 1 if period_u != 0.0 else 0
    copies_v = 1 if period_v != 0.0 else 0
    if begin == stop:
        return np.inf, -1, 0.0, u, v, 0.0, 0.0
    best = np.inf
    piece = begin
    t = pool[doubles + PIECE_DOUBLES * begin + PIECE_T0]
    move_u = 0.0
    move_v = 0.0
    # Ends of pieces first: near ones spare the search of most others. Then the pieces; copies one period away last.
    for search in range(2):
        for copy_u in range(1 + 2 * copies_u):
            move_a = (copy_u + 1) // 2 * (period_u if copy_u % 2 else -period_u)
            x = qx - move_a
            cell_u = _gap(x, pool[frame + LOW_U], pool[frame + HIGH_U]) if copy_u else 0.0
            for copy_v in range(1 + 2 * copies_v):
                move_b = (copy_v + 1) // 2 * (period_v if copy_v % 2 else -period_v)
                y = qy - move_b
                cell_v = _gap(y, pool[frame + LOW_V], pool[frame + HIGH_V]) if copy_v else 0.0
                if 0.5 * (cell_u * cell_u + cell_v * cell_v) >= best:
                    continue
                if search == 0:
                    f, k, at = _nearest_end(pool, doubles, begin, stop, x, y, best)
                else:
                    f, k, at = _nearest_inside(table, pool, ints, doubles, begin, stop, x, y, best)
                if f < best:
                    best = f
                    piece = k
                    t = at
                    move_u = move_a
                    move_v = move_b
    o = ints + PIECE_INTS * piece
    i = doubles + PIECE_DOUBLES * piece
    t = polished(
        pool,
        table[o + PIECE_COEFFICIENTS],
        table[o + PIECE_DEGREE],
        pool[i + MIDDLE],
        pool[i + PIECE_T0],
        pool[i + PIECE_T1],
        t,
        qx - move_u - pool[i + SHIFT_U],
        qy - move_v - pool[i + SHIFT_V],
    )
    return _foot(table, pool, trim, begin, stop, piece, t, u, v, qx - move_u, qy - move_v)


@kernel(inner=True)
def _foot(table, pool, trim, begin, stop, piece, t, u, v, qx, qy):
    """What `trim_nearest` returns, from the piece and the parameter of the foot; (qx, qy) is (u, v) in the cell."""
    o = table[trim + TRIM_PIECE_TABLE] + PIECE_INTS * piece
    i = table[trim + TRIM_PIECE_POOL] + PIECE_DOUBLES * piece
    size = pool[table[trim + TRIM_FRAME] + SIZE]
    x, y, dx, dy = piece_line(pool, table[o + PIECE_COEFFICIENTS], table[o + PIECE_DEGREE], t - pool[i + MIDDLE])
    ox = qx - x - pool[i + SHIFT_U]
    oy = qy - y - pool[i + SHIFT_V]
    distance = np.sqrt(ox * ox + oy * oy)
    at_start = t <= pool[i + PIECE_T0]
    at_end = t >= pool[i + PIECE_T1]
    beyond = dx * ox + dy * oy
    speed = np.sqrt(dx * dx + dy * dy)
    unsure = speed <= _SLOW * pool[i + BOUND_1]
    far = max(_BEYOND * size, 4e-15 * (abs(qx) + abs(qy)))
    if not (at_start or at_end) and (unsure or abs(beyond) > far * speed):
        # The way to the foot is not across the curve: is it an end, that rounding or a vanishing speed has left?
        first = t - pool[i + PIECE_T0] < pool[i + PIECE_T1] - t if unsure else beyond < 0.0
        end = START if first else END
        ax = pool[i + end] - pool[i + SHIFT_U] - x
        ay = pool[i + end + 1] - pool[i + SHIFT_V] - y
        if ax * ax + ay * ay <= (_AT_END * size) ** 2:
            at_start = first
            at_end = not first
            t = pool[i + PIECE_T0] if at_start else pool[i + PIECE_T1]
            ox -= ax
            oy -= ay
            distance = np.sqrt(ox * ox + oy * oy)
    other = -1
    if at_start or at_end:
        dx, dy = _end_direction(table, pool, o, i, at_end)
        other = table[o + PIECE_AFTER] if at_end else table[o + PIECE_BEFORE]
    else:
        length = np.sqrt(dx * dx + dy * dy)
        if length > 0.0:
            dx /= length
            dy /= length
    sign = 1.0 if dx * oy - dy * ox >= 0.0 else -1.0
    smooth = not (at_start or at_end)
    if begin <= other < stop:
        ax, ay = _end_direction(
            table,
            pool,
            table[trim + TRIM_PIECE_TABLE] + PIECE_INTS * other,
            table[trim + TRIM_PIECE_POOL] + PIECE_DOUBLES * other,
            not at_end,
        )
        # Positive for a corner that is convex: only points outside have it nearest.
        turn = dx * ay - dy * ax if at_end else ax * dy - ay * dx
        same_way = dx * ax + dy * ay > 0.0
        if same_way and abs(turn) <= _SMOOTH:
            smooth = True
        elif same_way or abs(turn) > 1e-9:
            sign = -1.0 if turn > 0.0 else 1.0
        else:
            w, _on = winding(table, pool, trim, u, v)
            sign = 1.0 if w == 1.0 else -1.0
        dx += ax
        dy += ay
        length = np.sqrt(dx * dx + dy * dy)
        if length > 1e-9:
            dx /= length
            dy /= length
    curve = table[o + PIECE_CURVE]
    if smooth:
        # Across the curve, not along the tiny and noisy way to the foot.
        return dx * oy - dy * ox, curve, t, u - ox, v - oy, -dy, dx
    if distance > 1e-13 * size:
        s = sign * distance
        return s, curve, t, u - ox, v - oy, ox / s, oy / s
    return sign * distance, curve, t, u - ox, v - oy, -dy, dx


@kernel(signatures="(i8[::1], f8[::1], i8, i8, i8, f8[::1], f8[::1], f8[:, ::1])")
def nearest_points(table, pool, trim, first, count, u, v, out):
    """`trim_nearest` at flat points, a row of seven each."""
    for k in range(u.size):
        s, curve, t, cu, cv, nu, nv = trim_nearest(table, pool, trim, first, count, u[k], v[k])
        out[k, 0] = s
        out[k, 1] = curve
        out[k, 2] = t
        out[k, 3] = cu
        out[k, 4] = cv
        out[k, 5] = nu
        out[k, 6] = nv
