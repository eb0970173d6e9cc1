"""Edges of one body that go through flat faces of the other: plates may cross with no patch's middle in the other.

A part of an edge is replaced by its chord, within a margin by which it bends. The edge goes through the plane of a
patch if the ends of the chord are on opposite sides of it, farther away than the margin; it goes through the face if
all points of the plane within the margin of the chord are inside the face's boundary: bodies that touch along edges do
not cross. Facets of a curved face stand out of it where it is hollow, so that a peg in a bore may cut them: curved
faces are left out.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.faces.trim import trim_side
from assembly.geometry.splines.evaluate import surface_point
from assembly.geometry.vec import add, cross, dot, matvec, matvec_t, scale, sub
from assembly.proximity.brep.borders import feature_at, feature_kind
from assembly.proximity.brep.records import EDGE, FACE, FACE_RECORD, face_at, shell_at
from assembly.proximity.bvh.tree import ELEMENT, element_at, node_of, tree_at
from assembly.proximity.extrema.feature_jets import edge_jet, edge_limits

# A part of an edge is widened to this many of its half widths, so that the joint of two parts is covered.
WIDER = 1.5
# Sine of the angle by which normals of a flat patch turn, at most.
FLAT = 1e-9


# Where a segment cuts a triangle p, q, r. hit: whether it does; part: where along the segment, 0 to 1; q, r: the
# barycentric coordinates of these corners there; turns: whether the segment goes along the normal (q - p) x (r - p).
TriangleCut = namedtuple("TriangleCut", "hit part q r turns")


@kernel(inline=True)
def cut_at(a, d, p, q, r, end, beside):
    """Where a segment from a along d cuts a triangle (Möller and Trumbore).

    A cut within the part `end` of the segment from one of its ends does not count; one that misses the triangle by no
    more than the part `beside` of its sides does.
    """
    e = sub(q, p)
    f = sub(r, p)
    h = cross(d, f)
    det = dot(e, h)
    if abs(det) < 1e-300:
        return TriangleCut(False, 0.0, 0.0, 0.0, False)
    s = sub(a, p)
    u = dot(s, h) / det
    w = cross(s, e)
    v = dot(d, w) / det
    t = dot(f, w) / det
    hit = min(u, v, 1.0 - u - v) >= -beside and end < t < 1.0 - end
    return TriangleCut(hit=hit, part=t, q=u, r=v, turns=det < 0.0)


@kernel(inner=True)
def chord_of(store, edge, t, half):
    """The ends of a part of an edge, and how far its middle is from the middle of its chord."""
    lo, hi, endless = edge_limits(store, edge)
    first = t - WIDER * half
    last = t + WIDER * half
    if not endless:
        first = max(first, lo)
        last = min(last, hi)
    a = edge_jet(store, edge, max(first, lo))[0]
    b = edge_jet(store, edge, min(last, hi))[0]
    off = sub(edge_jet(store, edge, 0.5 * (max(first, lo) + min(last, hi)))[0], scale(0.5, add(a, b)))
    return a, b, math.sqrt(dot(off, off))


@kernel(inner=True)
def is_well_inside(store, trim, u, v, du, dv):
    """Whether the four parameters beside (u, v), at du and dv from it, are all inside a boundary."""
    return (
        trim_side(store, trim, u - du, v) > 0
        and trim_side(store, trim, u + du, v) > 0
        and trim_side(store, trim, u, v - dv) > 0
        and trim_side(store, trim, u, v + dv) > 0
    )


@kernel(inline=True)
def patch_vertex_contacts(store, surface, patch):
    """The lowest (u, v) of a patch, its widths, and its four corners from there, counterclockwise in (u, v)."""
    u = patch.middle[0] - patch.half[0]
    v = patch.middle[1] - patch.half[1]
    wide = 2.0 * patch.half[0]
    high = 2.0 * patch.half[1]
    p = surface_point(store.table, store.pool, surface, u, v).point
    q = surface_point(store.table, store.pool, surface, u + wide, v).point
    s = surface_point(store.table, store.pool, surface, u + wide, v + high).point
    t = surface_point(store.table, store.pool, surface, u, v + high).point
    return (u, v, wide, high), (p, q, s, t)


@kernel(inner=True)
def goes_through(store, tree, shell, e, a, b, margin):
    """Whether what is within a margin of a chord goes through the face of a body at a flat patch; body axes."""
    node = node_of(store, tree, e)
    if node.cosine <= 0.0 or node.sine > FLAT:
        return False
    patch = element_at(store.pool, tree_at(store.table, tree).element_pool + ELEMENT * e)
    code = np.int64(patch.feature)
    face = face_at(store.table, shell_at(store.table, shell).face_table + FACE_RECORD * code)
    r = feature_at(store.table, shell, code)
    (u, v, wide, high), (p, q, s, t) = patch_vertex_contacts(store, r, patch)
    for k in range(2):
        second, third = (q, s) if k == 0 else (s, t)
        cut = cut_at(a, sub(b, a), p, second, third, 0.0, 0.0)
        hit, x, y = cut.hit, cut.q, cut.r
        n = cross(sub(second, p), sub(third, p))
        away = margin * math.sqrt(dot(n, n))
        if not hit or min(abs(dot(n, sub(a, p))), abs(dot(n, sub(b, p)))) <= away:
            continue
        if face.trim < 0:
            return True
        # The more the chord is inclined to the normal, the more of the plane is within the margin.
        beside = margin * math.sqrt(dot(n, n) * dot(sub(b, a), sub(b, a))) / abs(dot(n, sub(b, a)))
        du = beside * wide / max(math.sqrt(dot(sub(s, t), sub(s, t))), 1e-300)
        dv = beside * high / max(math.sqrt(dot(sub(s, q), sub(s, q))), 1e-300)
        here_u = u + (x + y if k == 0 else x) * wide
        here_v = v + (y if k == 0 else x + y) * high
        if is_well_inside(store, face.trim, here_u, here_v, du, dv):
            return True
    return False


@kernel(inner=True)
def pierces(posed, pair, margin):
    """Whether one of two elements, of f and of g, is a part of an edge that goes through the other one, a patch."""
    store = posed.store
    for side in range(2):
        tree, shell = posed.trees[side], posed.shells[side]
        other, other_shell = posed.trees[1 - side], posed.shells[1 - side]
        o = tree_at(store.table, tree).element_pool + ELEMENT * pair[side]
        p = tree_at(store.table, other).element_pool + ELEMENT * pair[1 - side]
        part = element_at(store.pool, o)
        code = np.int64(part.feature)
        patch = np.int64(element_at(store.pool, p).feature)
        if feature_kind(store.table, shell, code) != EDGE or feature_kind(store.table, other_shell, patch) != FACE:
            continue
        a, b, bent = chord_of(store, feature_at(store.table, shell, code), part.middle[0], part.half[0])
        if side == 0:
            a = matvec_t(posed.pose.rotation, sub(a, posed.pose.shift))
            b = matvec_t(posed.pose.rotation, sub(b, posed.pose.shift))
        else:
            a = add(matvec(posed.pose.rotation, a), posed.pose.shift)
            b = add(matvec(posed.pose.rotation, b), posed.pose.shift)
        if goes_through(store, other, other_shell, pair[1 - side], a, b, margin + 2.0 * bent + posed.offsets[1 - side]):
            return True
    return False
