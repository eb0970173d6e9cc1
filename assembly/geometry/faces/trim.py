"""Which side of its boundary a point of a face is on.

The boundary has been cut into pieces that run one way in u and in v (`geometry/faces/monotone.py`) and moved into one
cell of the periods. Material is to the left of every piece. The winding number w counts signed pieces below (u, v),

    w(u, v) = w(u, bottom) + sum of sign(u') over the pieces that pass between (u, bottom) and (u, v),

and is 1 where there is material (the table is made so), 0 where there is none. An equation has to be solved only for
a point in the box of a piece; elsewhere two comparisons decide.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.faces.trim_pieces import bounds_of, links_of, piece_at, piece_of, trim_at, trim_frame_at


@kernel(inline=True)
def into_cell(x, low, high, period):
    """A coordinate moved by whole periods into its cell."""
    if period == 0.0 or low <= x < high:
        return x
    moved = x - period * np.floor((x - low) / period)
    if moved < low:
        return low
    return moved if moved < high else low


@kernel(inline=True)
def _steps(pool, first, count, start, u):
    """w along the bottom."""
    w = start
    for k in range(count):
        if u >= pool[first + 2 * k]:
            w = pool[first + 2 * k + 1]
    return w


@kernel(inner=True)
def _below(store, trim, k, u, v, tolerance):
    """What piece k of a trim adds to w at a point, and whether the point is on it."""
    bounds, links = bounds_of(store, trim, k), links_of(store, trim, k)
    low_u, high_u, low_v, high_v = bounds.box[0], bounds.box[1], bounds.box[2], bounds.box[3]
    within = low_u <= u < high_u
    sign_u = links.sign_u
    if v > high_v + tolerance:
        return sign_u if within else 0, False
    if v < low_v - tolerance:
        return 0, False
    # The ends first: the curve goes on beyond the ends of its piece.
    near = (u - bounds.start[0]) ** 2 + (v - bounds.start[1]) ** 2
    near = min(near, (u - bounds.end[0]) ** 2 + (v - bounds.end[1]) ** 2)
    if near <= tolerance * tolerance:
        return 0, True
    major = links.major
    if not (low_u <= u <= high_u if major == 0 else low_v <= v <= high_v):
        return sign_u if within and v > high_v else 0, False
    x, shift = (u, bounds.shift_u) if major == 0 else (v, bounds.shift_v)
    start, end = bounds.start[major], bounds.end[major]
    _t, point, (du, dv) = piece_at(store.pool, piece_of(store, trim, k), major, x - shift, start - shift, end - shift)
    off_u = u - bounds.shift_u - point[0]
    off_v = v - bounds.shift_v - point[1]
    speed = np.sqrt(du * du + dv * dv)
    if abs(du * off_v - dv * off_u) <= tolerance * speed:
        return 0, True
    if not within:
        return 0, False
    above = off_v > 0.0 if major == 0 else (off_u < 0.0) == (sign_u * links.sign_v > 0)
    return sign_u if above else 0, False


@kernel(inner=True)
def winding(store, trim, u, v):
    """w at a point, and whether the point is on the boundary."""
    trim_record = trim_at(store.table, trim)
    frame = trim_frame_at(store.pool, trim_record.frame)
    tolerance = frame.on
    x = into_cell(u, frame.low_u, frame.high_u, frame.period_u)
    y = into_cell(v, frame.low_v, frame.high_v, frame.period_v)
    # A pole edge is not a boundary: its points belong to the face, as those just inside do.
    z = x
    extent = frame.high_u - frame.low_u
    if frame.period_u == 0.0 and 0.0 <= x - frame.high_u <= 1e-14 * extent:
        z = frame.high_u - 1e-15 * extent
    w = _steps(store.pool, trim_record.step_pool, trim_record.steps, frame.bottom, x)
    for k in range(trim_record.all_pieces):
        box = bounds_of(store, trim_record, k).box
        if k >= trim_record.pieces:
            sign = links_of(store, trim_record, k).sign_u
            if box[0] <= z < box[1] and (y > box[2] or (y == box[2] and sign > 0)):
                w += sign
        elif box[0] - tolerance <= x <= box[1] + tolerance:
            part, on = _below(store, trim_record, k, x, y, tolerance)
            if on:
                return w, True
            w += part
    return w, False


@kernel(inner=True)
def trim_side(store, trim, u, v):
    """1 inside, 0 on the boundary (within 1e-12 of its size), -1 outside."""
    w, on = winding(store, trim, u, v)
    if on:
        return 0
    frame = trim_frame_at(store.pool, trim_at(store.table, trim).frame)
    slack = 1e-14 * (frame.high_u - frame.low_u)
    if frame.period_u == 0.0 and not frame.low_u - slack <= u <= frame.high_u + slack:
        return -1
    slack = 1e-14 * (frame.high_v - frame.low_v)
    if frame.period_v == 0.0 and not frame.low_v - slack <= v <= frame.high_v + slack:
        return -1
    return 1 if w == 1.0 else -1


@kernel(signatures="(i8[::1], f8[::1], i8, f8[::1], f8[::1], i8[::1])")
def locate_points(table, pool, trim, u, v, side):
    """`trim_side` at flat points."""
    for k in range(u.size):
        side[k] = trim_side(Store(table, pool), trim, u[k], v[k])


@kernel(signatures="(i8[::1], f8[::1], i8, f8[::1], f8[::1], f8[::1])")
def windings(table, pool, trim, u, v, out):
    """w at flat points, for making a table: before w at the bottom is known."""
    for k in range(u.size):
        out[k], _on = winding(Store(table, pool), trim, u[k], v[k])
