"""Whether two bodies are in each other, whatever extrema there are, and which roots are of far sides: by facets.

A patch whose middle is inside the other body says so by its foot there. A segment between two points is inside, or
outside, by how many facets it cuts.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.spline import surface_point
from assembly.geometry.trim import trim_side
from assembly.geometry.vec import add, cross, dot, matvec, matvec_t, sub
from assembly.proximity.bounding_tree import (
    CENTER,
    CHILD,
    ELEMENT,
    ELEMENT_FEATURE,
    ELEMENT_POOL,
    ELEMENTS,
    FEATURE,
    HALF,
    NODE,
    NODE_INTS,
    NODE_POOL,
    NODE_TABLE,
    RADIUS,
    overlapping,
)
from assembly.proximity.folds import BESIDE
from assembly.proximity.roots import GAP, POINT_F, POINT_G, foot_of, is_within
from assembly.proximity.shell import FACE_RECORD, FACE_TABLE, FACE_TRIM, FACES
from assembly.proximity.switching import feature_at

# Room for the descent of a segment.
DEPTH = 256


@kernel(inline=True)
def meets_box(pool, o, a, d):
    """Whether the segment from a to a + d meets the box of the node at o."""
    lo = 0.0
    hi = 1.0
    for i in range(3):
        low = pool[o + CENTER + i] - pool[o + HALF + i] - a[i]
        high = pool[o + CENTER + i] + pool[o + HALF + i] - a[i]
        if abs(d[i]) < 1e-300:
            if low > 0.0 or high < 0.0:
                return False
        else:
            s = low / d[i]
            t = high / d[i]
            lo = max(lo, min(s, t))
            hi = min(hi, max(s, t))
    return lo <= hi


@kernel(inline=True)
def cuts(a, d, p, q, r, end):
    """Whether a segment from a along d cuts the triangle p q r (Möller and Trumbore), but for that part at its ends."""
    e = sub(q, p)
    f = sub(r, p)
    h = cross(d, f)
    det = dot(e, h)
    if abs(det) < 1e-300:
        return False
    s = sub(a, p)
    u = dot(s, h) / det
    w = cross(s, e)
    v = dot(d, w) / det
    t = dot(f, w) / det
    return u >= 0.0 and v >= 0.0 and u + v <= 1.0 and end < t < 1.0 - end


@kernel(inner=True)
def surface_of(table, shell, surface, code):
    """The surface record of an element's feature, or -1 where it is no face."""
    if surface >= 0:
        return surface
    return feature_at(table, shell, code) if code < table[shell + FACES] else -1


@kernel(inner=True)
def in_trim(table, pool, shell, code, u, v):
    """Whether parameters are within the boundary of a face; of a surface without one they always are."""
    if shell < 0:
        return True
    trim = table[table[shell + FACE_TABLE] + FACE_RECORD * code + FACE_TRIM]
    return trim < 0 or trim_side(table, pool, trim, u, v) > 0


@kernel(inner=True)
def is_deep(table, pool, scene, e, d, margin):
    """Whether the middle of a patch of f is farther than a margin inside g at a patch, or the other way round."""
    turn, shift = scene[0], scene[1]
    o = table[scene[3][0] + ELEMENT_POOL] + ELEMENT * e
    p = table[scene[3][1] + ELEMENT_POOL] + ELEMENT * d
    f = surface_of(table, scene[2][2], scene[2][0], np.int64(pool[o + ELEMENT_FEATURE]))
    g = surface_of(table, scene[2][3], scene[2][1], np.int64(pool[p + ELEMENT_FEATURE]))
    if f < 0 or g < 0:
        return False
    shell_f, shell_g = scene[2][2], scene[2][3]
    code_f = np.int64(pool[o + ELEMENT_FEATURE])
    code_g = np.int64(pool[p + ELEMENT_FEATURE])
    if in_trim(table, pool, shell_f, code_f, pool[o], pool[o + 1]):
        y = matvec_t(turn, sub(surface_point(table, pool, f, pool[o], pool[o + 1])[0], shift))
        s, t, distance, _n = foot_of(table, pool, g, y, pool[p], pool[p + 1])
        beside = is_within(table, pool, g, s, t, pool[p], pool[p + 1], BESIDE * pool[p + 2], BESIDE * pool[p + 3])
        # A foot farther off may be on the far side.
        if distance < -margin and beside and in_trim(table, pool, shell_g, code_g, s, t):
            return True
    if in_trim(table, pool, shell_g, code_g, pool[p], pool[p + 1]):
        y = add(matvec(turn, surface_point(table, pool, g, pool[p], pool[p + 1])[0]), shift)
        s, t, distance, _n = foot_of(table, pool, f, y, pool[o], pool[o + 1])
        beside = is_within(table, pool, f, s, t, pool[o], pool[o + 1], BESIDE * pool[o + 2], BESIDE * pool[o + 3])
        return distance < -margin and beside and in_trim(table, pool, shell_f, code_f, s, t)
    return False


@kernel(inner=True, allocates=True)
def facets_cut(table, pool, tree, surface, shell, a, d, end):
    """How many facets of a body's faces cut the segment from a to a + d, but for that part at its ends; body axes."""
    stack = np.empty(DEPTH, np.int64)
    stack[0] = 0
    used = 1
    count = 0
    while used > 0:
        used -= 1
        i = stack[used]
        if not meets_box(pool, table[tree + NODE_POOL] + NODE * i, a, d):
            continue
        at = table[tree + NODE_TABLE] + NODE_INTS * i
        child = table[at + CHILD]
        if child >= 0:
            if used + 2 <= DEPTH:
                stack[used] = child
                stack[used + 1] = child + 1
                used += 2
            continue
        r = surface_of(table, shell, surface, table[at + FEATURE])
        if r < 0:
            continue
        e = table[tree + ELEMENT_POOL] + ELEMENT * (-1 - child)
        p = surface_point(table, pool, r, pool[e] - pool[e + 2], pool[e + 1] - pool[e + 3])[0]
        q = surface_point(table, pool, r, pool[e] + pool[e + 2], pool[e + 1] - pool[e + 3])[0]
        s = surface_point(table, pool, r, pool[e] + pool[e + 2], pool[e + 1] + pool[e + 3])[0]
        t = surface_point(table, pool, r, pool[e] - pool[e + 2], pool[e + 1] + pool[e + 3])[0]
        count += int(cuts(a, d, p, q, s, end)) + int(cuts(a, d, p, s, t, end))
    return count


@kernel(inner=True)
def first_point(table, pool, tree, surface, shell):
    """A point of a body's faces, in its axes, and whether there is one."""
    for e in range(table[tree + ELEMENTS]):
        o = table[tree + ELEMENT_POOL] + ELEMENT * e
        r = surface_of(table, shell, surface, np.int64(pool[o + ELEMENT_FEATURE]))
        if r >= 0:
            return surface_point(table, pool, r, pool[o], pool[o + 1])[0], True
    return (0.0, 0.0, 0.0), False


@kernel(inner=True)
def crosses(table, pool, scene, stack, candidates, margin):
    """Whether two bodies are in each other, whatever extrema there are; of smooth ones also whether one is wholly."""
    turn, shift = scene[0], scene[1]
    count = overlapping(table, pool, scene[3][0], scene[3][1], turn, shift, stack, candidates)
    for c in range(count):
        if is_deep(table, pool, scene, candidates[c, 0], candidates[c, 1], margin):
            return True
    if scene[2][0] < 0:
        # Facets of trimmed faces say nothing of what is inside.
        return False
    # Some direction that no face is likely to lie along, and far enough.
    far = 10.0 * (pool[table[scene[3][0] + NODE_POOL] + RADIUS] + pool[table[scene[3][1] + NODE_POOL] + RADIUS])
    ray = (0.6012 * far, 0.3517 * far, 0.7174 * far)
    a, some = first_point(table, pool, scene[3][0], scene[2][0], scene[2][2])
    if (
        some
        and facets_cut(table, pool, scene[3][1], scene[2][1], scene[2][3], matvec_t(turn, sub(a, shift)), ray, 0.0) % 2
        == 1
    ):
        return True
    b, some = first_point(table, pool, scene[3][1], scene[2][1], scene[2][3])
    b = add(matvec(turn, b), shift)
    return some and facets_cut(table, pool, scene[3][0], scene[2][0], scene[2][2], b, ray, 0.0) % 2 == 1


@kernel(inner=True)
def is_outside(table, pool, scene, roots, k, margin):
    """Whether root k, of a negative gap, is one of far sides: then a surface is between its points.

    Facets are up to a `margin` beside their surfaces; gaps of no more are taken for true.
    """
    if -roots[k, GAP] <= 2.0 * margin:
        return False
    end = margin / -roots[k, GAP]
    turn, shift = scene[0], scene[1]
    a = (roots[k, POINT_F], roots[k, POINT_F + 1], roots[k, POINT_F + 2])
    b = (roots[k, POINT_G], roots[k, POINT_G + 1], roots[k, POINT_G + 2])
    if facets_cut(table, pool, scene[3][0], scene[2][0], scene[2][2], a, sub(b, a), end) > 0:
        return True
    a = matvec_t(turn, sub(a, shift))
    b = matvec_t(turn, sub(b, shift))
    return facets_cut(table, pool, scene[3][1], scene[2][1], scene[2][3], a, sub(b, a), end) > 0
