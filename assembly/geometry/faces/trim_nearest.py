"""Where the boundary of a face is nearest to a point, and which side of it the point is on there.

The boundary is cut into monotone pieces (`geometry/faces/trim.py`). Nearest points are found by branch and bound
(`geometry/faces/trim_pieces.py`): first over the ends of pieces, then over whole pieces, both with copies one period
away. At a corner the directions of its two pieces decide the side, or the winding number where they do not.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.faces.trim import into_cell, winding
from assembly.geometry.faces.trim_pieces import (
    bounds_of,
    links_of,
    nearest_on_piece,
    piece_line,
    piece_of,
    polished,
    trim_at,
    trim_frame_at,
)

# Neighbors whose directions differ by less [rad] are one smooth curve.
SMOOTH = 1e-6
# A projection nearer than the first to an end of its piece is moved to that end if the point is off the curve's normal
# by more than the second; both are parts of the boundary's size.
_AT_END, _BEYOND = 1e-9, 1e-13
# Where the speed of a piece is less than this part of its largest, its direction is rounding.
_SLOW = 1e-9


@kernel(inline=True)
def _gap(x, low, high):
    """How far a coordinate is from an interval."""
    return max(low - x, x - high, 0.0)


@kernel(inner=True)
def _end_direction(store, trim, k, at_end):
    """Unit direction of piece k at one of its ends, from the chord where its speed vanishes there."""
    piece = piece_of(store, trim, k)
    t = piece.t1 if at_end else piece.t0
    x, y, dx, dy = piece_line(store.pool, piece, t)
    length = np.sqrt(dx * dx + dy * dy)
    if length <= _SLOW * bounds_of(store, trim, k).bound_1:
        near = t + 1e-4 * (piece.t0 - piece.t1) * (1.0 if at_end else -1.0)
        a, b, dx, dy = piece_line(store.pool, piece, near)
        dx = x - a if at_end else a - x
        dy = y - b if at_end else b - y
        length = np.sqrt(dx * dx + dy * dy)
    return dx / length, dy / length


@kernel(inner=True)
def _nearest_end(store, trim, span, q, best):
    """Half the squared distance to the nearest end of a span of pieces, piece and parameter, if it beats `best`."""
    piece = span[0]
    t = 0.0
    for k in range(span[0], span[1]):
        i = bounds_of(store, trim, k)
        f = 0.5 * ((q[0] - i.start[0]) ** 2 + (q[1] - i.start[1]) ** 2)
        if f < best:
            best = f
            piece = k
            t = i.t0
        f = 0.5 * ((q[0] - i.end[0]) ** 2 + (q[1] - i.end[1]) ** 2)
        if f < best:
            best = f
            piece = k
            t = i.t1
    return best, piece, t


@kernel(inner=True)
def _nearest_inside(store, trim, span, q, best):
    """The same over all points of the pieces, except pieces whose box is too far."""
    piece = span[0]
    t = 0.0
    for k in range(span[0], span[1]):
        i = bounds_of(store, trim, k)
        gap_u = _gap(q[0], i.box[0], i.box[1])
        gap_v = _gap(q[1], i.box[2], i.box[3])
        if 0.5 * (gap_u * gap_u + gap_v * gap_v) < best:
            bounds = (i.bound_1, i.bound_2, i.bound_3)
            seen = (q[0] - i.shift_u, q[1] - i.shift_v)
            best, at = nearest_on_piece(store.pool, piece_of(store, trim, k), bounds, seen, best)
            if at >= i.t0:
                piece = k
                t = at
    return best, piece, t


# Where a boundary is nearest to a point. distance: signed, positive on the side of the material; curve: which boundary
# curve, or -1; t: its parameter; u, v: the projection; normal_u, normal_v: unit normal there to the material.
TrimFoot = namedtuple("TrimFoot", "distance curve t u v normal_u normal_v")


@kernel(inner=True)
def trim_nearest(store, trim, first, count, u, v):
    """The TrimFoot of a point on the boundary curves `first` to `first + count - 1`."""
    record = trim_at(store.table, trim)
    frame = trim_frame_at(store.pool, record.frame)
    period_u = frame.period_u
    period_v = frame.period_v
    qx = into_cell(u, frame.low_u, frame.high_u, period_u)
    qy = into_cell(v, frame.low_v, frame.high_v, period_v)
    span = (store.table[record.curve_pieces + first], store.table[record.curve_pieces + first + count])
    copies_u = 1 if period_u != 0.0 else 0
    copies_v = 1 if period_v != 0.0 else 0
    if span[0] == span[1]:
        return TrimFoot(np.inf, -1, 0.0, u, v, 0.0, 0.0)
    best = np.inf
    piece = span[0]
    t = bounds_of(store, record, piece).t0
    q = (qx, qy)
    # Ends of pieces first: a near one prunes most pieces. In either pass copies one period away come last.
    for search in range(2):
        for copy_u in range(1 + 2 * copies_u):
            x = qx - (copy_u + 1) // 2 * (period_u if copy_u % 2 else -period_u)
            cell_u = _gap(x, frame.low_u, frame.high_u) if copy_u else 0.0
            for copy_v in range(1 + 2 * copies_v):
                y = qy - (copy_v + 1) // 2 * (period_v if copy_v % 2 else -period_v)
                cell_v = _gap(y, frame.low_v, frame.high_v) if copy_v else 0.0
                if 0.5 * (cell_u * cell_u + cell_v * cell_v) >= best:
                    continue
                if search == 0:
                    f, k, at = _nearest_end(store, record, span, (x, y), best)
                else:
                    f, k, at = _nearest_inside(store, record, span, (x, y), best)
                if f < best:
                    best = f
                    piece = k
                    t = at
                    q = (x, y)
    bounds = bounds_of(store, record, piece)
    t = polished(store.pool, piece_of(store, record, piece), t, (q[0] - bounds.shift_u, q[1] - bounds.shift_v))
    return _foot(store, trim, span, piece, t, (u, v), q)


@kernel(inner=True)
def _foot_on_piece(store, record, k, t, q):
    """Move a projection found at t on piece k to an end if it belongs there.

    Returns its parameter, the vector from it to the point, the direction of the curve, and the end: -1 at the start,
    1 at the end, 0 in between.
    """
    bounds = bounds_of(store, record, k)
    size = trim_frame_at(store.pool, record.frame).extent
    x, y, dx, dy = piece_line(store.pool, piece_of(store, record, k), t)
    ox = q[0] - x - bounds.shift_u
    oy = q[1] - y - bounds.shift_v
    end = 1 if t >= bounds.t1 else (-1 if t <= bounds.t0 else 0)
    beyond = dx * ox + dy * oy
    speed = np.sqrt(dx * dx + dy * dy)
    unsure = speed <= _SLOW * bounds.bound_1
    far = max(_BEYOND * size, 4e-15 * (abs(q[0]) + abs(q[1])))
    if end == 0 and (unsure or abs(beyond) > far * speed):
        # The vector is not normal to the curve: the projection may be an end, missed by rounding or vanishing speed.
        first = t - bounds.t0 < bounds.t1 - t if unsure else beyond < 0.0
        ax = (bounds.start[0] if first else bounds.end[0]) - bounds.shift_u - x
        ay = (bounds.start[1] if first else bounds.end[1]) - bounds.shift_v - y
        if ax * ax + ay * ay <= (_AT_END * size) ** 2:
            end = -1 if first else 1
            t = bounds.t0 if first else bounds.t1
            ox -= ax
            oy -= ay
    if end != 0:
        dx, dy = _end_direction(store, record, k, end > 0)
    elif speed > 0.0:
        dx /= speed
        dy /= speed
    return t, (ox, oy), (dx, dy), end


@kernel(inner=True)
def _foot(store, trim, span, piece, t, point, q):
    """The TrimFoot of a point, from the piece and the parameter of the projection; q is the point in the cell."""
    record = trim_at(store.table, trim)
    links = links_of(store, record, piece)
    t, (ox, oy), (dx, dy), end = _foot_on_piece(store, record, piece, t, q)
    distance = np.sqrt(ox * ox + oy * oy)
    other = -1 if end == 0 else (links.after if end > 0 else links.before)
    sign = 1.0 if dx * oy - dy * ox >= 0.0 else -1.0
    smooth = end == 0
    if span[0] <= other < span[1]:
        ax, ay = _end_direction(store, record, other, end < 0)
        # Positive for a corner that is convex: only points outside have it nearest.
        turn = dx * ay - dy * ax if end > 0 else ax * dy - ay * dx
        same_way = dx * ax + dy * ay > 0.0
        if same_way and abs(turn) <= SMOOTH:
            smooth = True
        elif same_way or abs(turn) > 1e-9:
            sign = -1.0 if turn > 0.0 else 1.0
        else:
            w, _on = winding(store, trim, point[0], point[1])
            sign = 1.0 if w == 1.0 else -1.0
        dx += ax
        dy += ay
        length = np.sqrt(dx * dx + dy * dy)
        if length > 1e-9:
            dx /= length
            dy /= length
    u, v = point[0] - ox, point[1] - oy
    if smooth:
        # The normal of the curve, not the vector to the projection, which may be tiny and noisy.
        return TrimFoot(dx * oy - dy * ox, links.curve, t, u, v, -dy, dx)
    s = sign * distance
    if distance > 1e-13 * trim_frame_at(store.pool, record.frame).extent:
        return TrimFoot(s, links.curve, t, u, v, ox / s, oy / s)
    return TrimFoot(s, links.curve, t, u, v, -dy, dx)


@kernel(signatures="(i8[::1], f8[::1], i8, i8, i8, f8[::1], f8[::1], f8[:, ::1])")
def nearest_points(table, pool, trim, first, count, u, v, out):
    """`trim_nearest` at flat points, a row of seven each."""
    for k in range(u.size):
        foot = trim_nearest(Store(table, pool), trim, first, count, u[k], v[k])
        out[k, 0], out[k, 1], out[k, 2] = foot.distance, foot.curve, foot.t
        out[k, 3], out[k, 4], out[k, 5], out[k, 6] = foot.u, foot.v, foot.normal_u, foot.normal_v
