"""Where the boundary of a face is nearest to a point, and which side of it the point is on there.

The boundary is cut into monotone pieces (`geometry/faces/trim.py`). Nearest points are found by branch and bound over
them
(`geometry/faces/trim_pieces.py`): ends first, then what is between them, then copies one period away. At a corner the
two directions tell the side, or the winding number where they do not.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.faces.trim import into_cell, winding
from assembly.geometry.faces.trim_pieces import (
    END,
    PIECE_DOUBLES,
    PIECE_INTS,
    START,
    nearest_on_piece,
    piece_bounds_at,
    piece_line,
    piece_links_at,
    polished,
    trim_at,
    trim_frame_at,
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
def _end_direction(store, o, i, at_end):
    """Unit direction of a piece at one of its ends, from the chord where its speed vanishes there."""
    piece = piece_bounds_at(store.pool, i)
    links = piece_links_at(store.table, o)
    t = piece.t1 if at_end else piece.t0
    x, y, dx, dy = piece_line(store.pool, links.coefficients, links.degree, t - piece.middle)
    length = np.sqrt(dx * dx + dy * dy)
    if length <= _SLOW * piece.bound_1:
        near = t + 1e-4 * (piece.t0 - piece.t1) * (1.0 if at_end else -1.0)
        a, b, dx, dy = piece_line(store.pool, links.coefficients, links.degree, near - piece.middle)
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
        i = piece_bounds_at(pool, doubles + PIECE_DOUBLES * k)
        f = 0.5 * ((x - i.start[0]) ** 2 + (y - i.start[1]) ** 2)
        if f < best:
            best = f
            piece = k
            t = i.t0
        f = 0.5 * ((x - i.end[0]) ** 2 + (y - i.end[1]) ** 2)
        if f < best:
            best = f
            piece = k
            t = i.t1
    return best, piece, t


@kernel(inner=True)
def _nearest_inside(store, ints, doubles, begin, stop, x, y, best):
    """The same for all points of pieces, those aside whose box is too far."""
    piece = begin
    t = 0.0
    for k in range(begin, stop):
        o = piece_links_at(store.table, ints + PIECE_INTS * k)
        i = doubles + PIECE_DOUBLES * k
        piece_bounds = piece_bounds_at(store.pool, i)
        gap_u = _gap(x, store.pool[i], store.pool[i + 1])
        gap_v = _gap(y, store.pool[i + 2], store.pool[i + 3])
        if 0.5 * (gap_u * gap_u + gap_v * gap_v) < best:
            best, at = nearest_on_piece(
                store.pool,
                o.coefficients,
                o.degree,
                piece_bounds.middle,
                piece_bounds.t0,
                piece_bounds.t1,
                piece_bounds.bound_1,
                piece_bounds.bound_2,
                piece_bounds.bound_3,
                x - piece_bounds.shift_u,
                y - piece_bounds.shift_v,
                best,
            )
            if at >= piece_bounds.t0:
                piece = k
                t = at
    return best, piece, t


@kernel(inner=True)
def trim_nearest(store, trim, first, count, u, v):
    """Signed distance to boundary curves, index and parameter of the foot, the foot, and its normal to material.

    The distance is positive on the material side of the curves `first` to `first + count - 1`.
    """
    trim_record = trim_at(store.table, trim)
    frame = trim_frame_at(store.pool, trim_record.frame)
    period_u = frame.period_u
    period_v = frame.period_v
    qx = into_cell(u, frame.low_u, frame.high_u, period_u)
    qy = into_cell(v, frame.low_v, frame.high_v, period_v)
    begin = store.table[trim_record.curve_pieces + first]
    stop = store.table[trim_record.curve_pieces + first + count]
    ints = trim_record.piece_table
    doubles = trim_record.piece_pool
    copies_u = 1 if period_u != 0.0 else 0
    copies_v = 1 if period_v != 0.0 else 0
    if begin == stop:
        return np.inf, -1, 0.0, u, v, 0.0, 0.0
    best = np.inf
    piece = begin
    t = piece_bounds_at(store.pool, doubles + PIECE_DOUBLES * begin).t0
    move_u = 0.0
    move_v = 0.0
    # Ends of pieces first: near ones spare the search of most others. Then the pieces; copies one period away last.
    for search in range(2):
        for copy_u in range(1 + 2 * copies_u):
            move_a = (copy_u + 1) // 2 * (period_u if copy_u % 2 else -period_u)
            x = qx - move_a
            cell_u = _gap(x, frame.low_u, frame.high_u) if copy_u else 0.0
            for copy_v in range(1 + 2 * copies_v):
                move_b = (copy_v + 1) // 2 * (period_v if copy_v % 2 else -period_v)
                y = qy - move_b
                cell_v = _gap(y, frame.low_v, frame.high_v) if copy_v else 0.0
                if 0.5 * (cell_u * cell_u + cell_v * cell_v) >= best:
                    continue
                if search == 0:
                    f, k, at = _nearest_end(store.pool, doubles, begin, stop, x, y, best)
                else:
                    f, k, at = _nearest_inside(store, ints, doubles, begin, stop, x, y, best)
                if f < best:
                    best = f
                    piece = k
                    t = at
                    move_u = move_a
                    move_v = move_b
    o = piece_links_at(store.table, ints + PIECE_INTS * piece)
    i = piece_bounds_at(store.pool, doubles + PIECE_DOUBLES * piece)
    t = polished(
        store.pool,
        o.coefficients,
        o.degree,
        i.middle,
        i.t0,
        i.t1,
        t,
        qx - move_u - i.shift_u,
        qy - move_v - i.shift_v,
    )
    return _foot(store, trim, begin, stop, piece, t, u, v, qx - move_u, qy - move_v)


@kernel(inner=True)
def _foot(store, trim, begin, stop, piece, t, u, v, qx, qy):
    """What `trim_nearest` returns, from the piece and the parameter of the foot; (qx, qy) is (u, v) in the cell."""
    trim_record = trim_at(store.table, trim)
    o = trim_record.piece_table + PIECE_INTS * piece
    links = piece_links_at(store.table, o)
    i = trim_record.piece_pool + PIECE_DOUBLES * piece
    piece_bounds = piece_bounds_at(store.pool, i)
    size = trim_frame_at(store.pool, trim_record.frame).extent
    x, y, dx, dy = piece_line(store.pool, links.coefficients, links.degree, t - piece_bounds.middle)
    ox = qx - x - piece_bounds.shift_u
    oy = qy - y - piece_bounds.shift_v
    distance = np.sqrt(ox * ox + oy * oy)
    at_start = t <= piece_bounds.t0
    at_end = t >= piece_bounds.t1
    beyond = dx * ox + dy * oy
    speed = np.sqrt(dx * dx + dy * dy)
    unsure = speed <= _SLOW * piece_bounds.bound_1
    far = max(_BEYOND * size, 4e-15 * (abs(qx) + abs(qy)))
    if not (at_start or at_end) and (unsure or abs(beyond) > far * speed):
        # The way to the foot is not across the curve: is it an end, that rounding or a vanishing speed has left?
        first = t - piece_bounds.t0 < piece_bounds.t1 - t if unsure else beyond < 0.0
        end = START if first else END
        ax = store.pool[i + end] - piece_bounds.shift_u - x
        ay = store.pool[i + end + 1] - piece_bounds.shift_v - y
        if ax * ax + ay * ay <= (_AT_END * size) ** 2:
            at_start = first
            at_end = not first
            t = piece_bounds.t0 if at_start else piece_bounds.t1
            ox -= ax
            oy -= ay
            distance = np.sqrt(ox * ox + oy * oy)
    other = -1
    if at_start or at_end:
        dx, dy = _end_direction(store, o, i, at_end)
        other = links.after if at_end else links.before
    else:
        length = np.sqrt(dx * dx + dy * dy)
        if length > 0.0:
            dx /= length
            dy /= length
    sign = 1.0 if dx * oy - dy * ox >= 0.0 else -1.0
    smooth = not (at_start or at_end)
    if begin <= other < stop:
        ax, ay = _end_direction(
            store,
            trim_record.piece_table + PIECE_INTS * other,
            trim_record.piece_pool + PIECE_DOUBLES * other,
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
            w, _on = winding(store, trim, u, v)
            sign = 1.0 if w == 1.0 else -1.0
        dx += ax
        dy += ay
        length = np.sqrt(dx * dx + dy * dy)
        if length > 1e-9:
            dx /= length
            dy /= length
    curve = links.curve
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
        s, curve, t, cu, cv, nu, nv = trim_nearest(Store(table, pool), trim, first, count, u[k], v[k])
        out[k, 0] = s
        out[k, 1] = curve
        out[k, 2] = t
        out[k, 3] = cu
        out[k, 4] = cv
        out[k, 5] = nu
        out[k, 6] = nv
