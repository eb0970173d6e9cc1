"""Valleys of the gap between two faces: curves along which they almost touch, as a ring and the plate under it.

Across a valley the gap grows as the curvatures say, along it hardly: the place of the least gap runs all around the
ring as the ring tilts by next to nothing. A point at the bottom of the valley, found by Newton's method across the
valley alone, stays near its place for all small rotations, wherever the least gap is.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.geometry.splines.evaluate import surface_at
from assembly.geometry.vec import blend
from assembly.proximity.extrema.face_face import bent_at_most, move_pair
from assembly.proximity.extrema.face_frames import pair_frame
from assembly.proximity.extrema.pair_matrix import FLAT, curvature_bound, pair_matrix
from assembly.proximity.manager.newton_regions import is_beside

# Across a valley the curvature of the gap is at least the first part of the surfaces' own; along it at most the second
# part of that across.
STEEP, LEVEL = 0.05, 0.1
# Steps into a valley, and radians below which one counts as arrived.
STEPS, ARRIVED = 8, 1e-6
# More turn than any step.
FAR = 1e300


@kernel(inline=True)
def toward_end(store, r, du, dv):
    """1 where rates (du, dv) of the parameters of a surface lead toward its end in the faster one, else -1."""
    patch = surface_at(store.table, r)
    du /= store.pool[patch.breaks_u + patch.spans_u] - store.pool[patch.breaks_u]
    dv /= store.pool[patch.breaks_v + patch.spans_v] - store.pool[patch.breaks_v]
    return math.copysign(1.0, du if abs(du) >= abs(dv) else dv)


# A step across a valley. found: whether there is one; there: where it leads; bend: by how much it turns a normal [rad];
# on_f: whether f is the surface that is bent more across; along: the valley's direction in the axes of f, so that the
# faster parameter of that surface grows.
ValleyStep = namedtuple("ValleyStep", "found there bend on_f along")


@kernel(inner=True)
def across_near_singular(store, f, g, pose, x):
    """A step from parameters x across the valley there, if there is one."""
    none = (0.0, 0.0, 0.0)
    frame = pair_frame(store, f, g, pose, x)
    if not frame.regular:
        return ValleyStep(False, x, FAR, False, none)
    a, c, r = frame.shape_f, frame.shape_g, frame.residual
    matrix = pair_matrix(a, c, frame.gap, FLAT)
    k, h = matrix.k, matrix.h
    e, t = frame.rates_f, frame.rates_g
    # -H is how the surfaces part, symmetric at beta = 0.
    middle = -0.5 * (h[0] + h[3])
    half = -0.5 * (h[0] - h[3])
    mixed = -0.5 * (h[1] + h[2])
    radius = math.sqrt(half * half + mixed * mixed)
    most = middle + radius
    if (
        not most > max(STEEP * (curvature_bound(a) + curvature_bound(c)), FLAT)
        or not abs(middle - radius) <= LEVEL * most
    ):
        return ValleyStep(False, x, FAR, False, none)
    across = (half + radius, mixed) if half >= 0.0 else (mixed, radius - half)
    length = math.sqrt(across[0] * across[0] + across[1] * across[1])
    across = (across[0] / length, across[1] / length)
    # Newton's step of `pair_step`, with the part of H across the valley alone.
    pull = across[0] * (c[0] * r[0] + c[1] * r[1] - r[2]) + across[1] * (c[1] * r[0] + c[2] * r[1] - r[3])
    size = -pull / most
    bent_f = abs(across[0] * (a[0] * across[0] + 2.0 * a[1] * across[1]) + a[2] * across[1] * across[1])
    bent_g = abs(across[0] * (c[0] * across[0] + 2.0 * c[1] * across[1]) + c[2] * across[1] * across[1])
    w = (-across[1], across[0])
    # Along the valley the point of the surface stays that is bent more; the other one comes to it.
    slide = 0.0 if bent_f >= bent_g else r[0] * w[0] + r[1] * w[1]
    step_f = (size * across[0] + slide * w[0], size * across[1] + slide * w[1])
    step_g = (k[0] * step_f[0] + k[1] * step_f[1] - r[0], k[1] * step_f[0] + k[2] * step_f[1] - r[1])
    bend_f = (abs(step_f[0]) + abs(step_f[1])) * max(curvature_bound(a), 2.0)
    bend_g = (abs(step_g[0]) + abs(step_g[1])) * max(curvature_bound(c), 2.0)
    factor_f = bent_at_most(bend_f)
    factor_g = bent_at_most(bend_g)
    step_f = (factor_f * step_f[0], factor_f * step_f[1])
    step_g = (factor_g * step_g[0], factor_g * step_g[1])
    there, _clamped, _way = move_pair(store, f, g, pose.rotation, x, frame, step_f, step_g)
    if bent_f >= bent_g:
        sense = toward_end(store, f, e[0] * w[0] + e[1] * w[1], e[2] * w[1])
    else:
        sense = toward_end(store, g, t[0] * w[0] + t[1] * w[1], t[2] * w[0] + t[3] * w[1])
    along = blend(sense * w[0], frame.tangent_x, sense * w[1], frame.tangent_y)
    return ValleyStep(True, there, max(bend_f, bend_g), bent_f >= bent_g, along)


@kernel(inner=True)
def into_near_singular(store, f, g, pose, x, half):
    """The bottom of the valley that crosses a pair of patches, from their middles x: `half` are half their widths.

    Returns whether there is one, its parameters, whether f is the surface that is bent more across it, and its
    direction in the axes of f.
    """
    start = x
    along = (0.0, 0.0, 0.0)
    on_f = False
    for _ in range(STEPS):
        step = across_near_singular(store, f, g, pose, x)
        on_f, along = step.on_f, step.along
        if not step.found or not is_beside(store, (f, g), step.there, start, half, 1.0):
            return False, x, on_f, along
        x = step.there
        if step.bend <= ARRIVED:
            return True, x, on_f, along
    return False, x, on_f, along
