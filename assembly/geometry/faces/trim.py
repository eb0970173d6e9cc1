"""Which side of its boundary a point of a face is on.

The boundary has been cut into pieces that run one way in u and in v (`geometry/faces/monotone.py`) and moved into one
cell of the periods. Material is to the left of every piece. Below a point (u, v) the signed number of pieces,

    w(u, v) = w(u, bottom) + sum of sign(u') over the pieces that pass between (u, bottom) and (u, v),

is 1 where there is material (the table is made so), 0 where there is none. A piece has to be solved for the point
only inside its box. Everywhere else two comparisons decide.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.faces.trim_pieces import (
    BOTTOM,
    END,
    HIGH_U,
    HIGH_V,
    LOW_U,
    LOW_V,
    MIDDLE,
    ON,
    PERIOD_U,
    PERIOD_V,
    PIECE_COEFFICIENTS,
    PIECE_DEGREE,
    PIECE_DOUBLES,
    PIECE_INTS,
    PIECE_MAJOR,
    PIECE_SIGN_U,
    PIECE_SIGN_V,
    PIECE_T0,
    PIECE_T1,
    SHIFT_U,
    SHIFT_V,
    START,
    TRIM_ALL,
    TRIM_FRAME,
    TRIM_PIECE_POOL,
    TRIM_PIECE_TABLE,
    TRIM_PIECES,
    TRIM_STEP_POOL,
    TRIM_STEPS,
    piece_at,
)


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
def _below(table, pool, o, i, u, v, tolerance):
    """What a piece adds to w at a point, and whether the point is on it."""
    if v > pool[i + 3] + tolerance:
        return table[o + PIECE_SIGN_U] if pool[i] <= u < pool[i + 1] else 0, False
    if v < pool[i + 2] - tolerance:
        return 0, False
    shift_u = pool[i + SHIFT_U]
    shift_v = pool[i + SHIFT_V]
    sign_u = table[o + PIECE_SIGN_U]
    sign_v = table[o + PIECE_SIGN_V]
    within = pool[i] <= u < pool[i + 1]
    major = table[o + PIECE_MAJOR]
    x = u
    # The ends first: beyond them the curve is not the piece's.
    near = (u - pool[i + START]) ** 2 + (v - pool[i + START + 1]) ** 2
    near = min(near, (u - pool[i + END]) ** 2 + (v - pool[i + END + 1]) ** 2)
    if near <= tolerance * tolerance:
        return 0, True
    if major == 0:
        x = u
        start = pool[i + START]
        end = pool[i + END]
        shift = shift_u
        inside = pool[i] <= u <= pool[i + 1]
    else:
        x = v
        start = pool[i + START + 1]
        end = pool[i + END + 1]
        shift = shift_v
        inside = pool[i + 2] <= v <= pool[i + 3]
    if not inside:
        return sign_u if within and v > pool[i + 3] else 0, False
    at, cu, cv, du, dv = piece_at(
        pool,
        table[o + PIECE_COEFFICIENTS],
        table[o + PIECE_DEGREE],
        pool[i + MIDDLE],
        pool[i + PIECE_T0],
        pool[i + PIECE_T1],
        major,
        x - shift,
        start - shift,
        end - shift,
    )
    off_u = u - shift_u - cu
    off_v = v - shift_v - cv
    speed = np.sqrt(du * du + dv * dv)
    if abs(du * off_v - dv * off_u) <= tolerance * speed:
        return 0, True
    if not within:
        return 0, False
    above = off_v > 0.0 if major == 0 else (off_u < 0.0) == (sign_u * sign_v > 0)
    return sign_u if above else 0, False


@kernel(inner=True)
def winding(table, pool, trim, u, v):
    """w at a point, and whether the point is on the boundary."""
    frame = table[trim + TRIM_FRAME]
    tolerance = pool[frame + ON]
    x = into_cell(u, pool[frame + LOW_U], pool[frame + HIGH_U], pool[frame + PERIOD_U])
    y = into_cell(v, pool[frame + LOW_V], pool[frame + HIGH_V], pool[frame + PERIOD_V])
    # A pole edge is no boundary: its points belong to the face, with those just inside.
    z = x
    extent = pool[frame + HIGH_U] - pool[frame + LOW_U]
    if pool[frame + PERIOD_U] == 0.0 and 0.0 <= x - pool[frame + HIGH_U] <= 1e-14 * extent:
        z = pool[frame + HIGH_U] - 1e-15 * extent
    w = _steps(pool, table[trim + TRIM_STEP_POOL], table[trim + TRIM_STEPS], pool[frame + BOTTOM], x)
    o = table[trim + TRIM_PIECE_TABLE]
    i = table[trim + TRIM_PIECE_POOL]
    for _ in range(table[trim + TRIM_PIECES]):
        if pool[i] - tolerance <= x <= pool[i + 1] + tolerance:
            part, on = _below(table, pool, o, i, x, y, tolerance)
            if on:
                return w, True
            w += part
        o += PIECE_INTS
        i += PIECE_DOUBLES
    for _ in range(table[trim + TRIM_PIECES], table[trim + TRIM_ALL]):
        sign = table[o + PIECE_SIGN_U]
        if pool[i] <= z < pool[i + 1] and (y > pool[i + 2] or (y == pool[i + 2] and sign > 0)):
            w += sign
        o += PIECE_INTS
        i += PIECE_DOUBLES
    return w, False


@kernel(inner=True)
def trim_side(table, pool, trim, u, v):
    """1 inside, 0 on the boundary (within 1e-12 of its size), -1 outside."""
    w, on = winding(table, pool, trim, u, v)
    if on:
        return 0
    frame = table[trim + TRIM_FRAME]
    slack = 1e-14 * (pool[frame + HIGH_U] - pool[frame + LOW_U])
    if pool[frame + PERIOD_U] == 0.0 and not pool[frame + LOW_U] - slack <= u <= pool[frame + HIGH_U] + slack:
        return -1
    slack = 1e-14 * (pool[frame + HIGH_V] - pool[frame + LOW_V])
    if pool[frame + PERIOD_V] == 0.0 and not pool[frame + LOW_V] - slack <= v <= pool[frame + HIGH_V] + slack:
        return -1
    return 1 if w == 1.0 else -1


@kernel(signatures="(i8[::1], f8[::1], i8, f8[::1], f8[::1], i8[::1])")
def locate_points(table, pool, trim, u, v, side):
    """`trim_side` at flat points."""
    for k in range(u.size):
        side[k] = trim_side(table, pool, trim, u[k], v[k])


@kernel(signatures="(i8[::1], f8[::1], i8, f8[::1], f8[::1], f8[::1])")
def windings(table, pool, trim, u, v, out):
    """w at flat points, before the table knows what w at the bottom is."""
    for k in range(u.size):
        out[k], _on = winding(table, pool, trim, u[k], v[k])
