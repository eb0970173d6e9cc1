"""Parameters on a surface's domain: wrapped where it is closed, clamped where it ends."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.splines.evaluate import surface_at


@kernel(inline=True)
def into_domain(store, r, u, v):
    """Parameters wrapped where the surface is closed, clamped where it ends; whether it was clamped."""
    patch = surface_at(store.table, r)
    clamped = False
    ou = patch.breaks_u
    lo = store.pool[ou]
    hi = store.pool[ou + patch.spans_u]
    if u < lo or u > hi:
        if patch.closed_u == 1:
            u -= (hi - lo) * math.floor((u - lo) / (hi - lo))
            u = min(max(u, lo), hi)
        else:
            u = lo if u < lo else hi
            clamped = True
    ov = patch.breaks_v
    lo = store.pool[ov]
    hi = store.pool[ov + patch.spans_v]
    if v < lo or v > hi:
        if patch.closed_v == 1:
            v -= (hi - lo) * math.floor((v - lo) / (hi - lo))
            v = min(max(v, lo), hi)
        else:
            v = lo if v < lo else hi
            clamped = True
    return u, v, clamped


@kernel(inline=True)
def is_within(store, surface, x, y, u, v, half_u, half_v):
    """Whether parameters (x, y) are in a box around (u, v)."""
    patch = surface_at(store.table, surface)
    du = abs(x - u)
    dv = abs(y - v)
    if surface >= 0:
        if patch.closed_u == 1:
            period = store.pool[patch.breaks_u + patch.spans_u] - store.pool[patch.breaks_u]
            du = min(du, period - du)
        if patch.closed_v == 1:
            period = store.pool[patch.breaks_v + patch.spans_v] - store.pool[patch.breaks_v]
            dv = min(dv, period - dv)
    return du <= half_u and dv <= half_v
