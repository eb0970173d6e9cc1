"""Parameters on a surface's domain: wrapped where it is closed, clamped where it ends."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.splines.evaluate import BREAKS_U, BREAKS_V, CLOSED_U, CLOSED_V, SPANS_U, SPANS_V


@kernel(inline=True)
def into_domain(table, pool, r, u, v):
    """Parameters wrapped where the surface is closed, clamped where it ends; whether it was clamped."""
    clamped = False
    ou = table[r + BREAKS_U]
    lo = pool[ou]
    hi = pool[ou + table[r + SPANS_U]]
    if u < lo or u > hi:
        if table[r + CLOSED_U] == 1:
            u -= (hi - lo) * math.floor((u - lo) / (hi - lo))
            u = min(max(u, lo), hi)
        else:
            u = lo if u < lo else hi
            clamped = True
    ov = table[r + BREAKS_V]
    lo = pool[ov]
    hi = pool[ov + table[r + SPANS_V]]
    if v < lo or v > hi:
        if table[r + CLOSED_V] == 1:
            v -= (hi - lo) * math.floor((v - lo) / (hi - lo))
            v = min(max(v, lo), hi)
        else:
            v = lo if v < lo else hi
            clamped = True
    return u, v, clamped


@kernel(inline=True)
def is_within(table, pool, surface, x, y, u, v, half_u, half_v):
    """Whether parameters (x, y) are in a box around (u, v)."""
    du = abs(x - u)
    dv = abs(y - v)
    if surface >= 0:
        if table[surface + CLOSED_U] == 1:
            period = pool[table[surface + BREAKS_U] + table[surface + SPANS_U]] - pool[table[surface + BREAKS_U]]
            du = min(du, period - du)
        if table[surface + CLOSED_V] == 1:
            period = pool[table[surface + BREAKS_V] + table[surface + SPANS_V]] - pool[table[surface + BREAKS_V]]
            dv = min(dv, period - dv)
    return du <= half_u and dv <= half_v
