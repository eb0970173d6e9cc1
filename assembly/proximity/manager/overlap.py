"""Whether two bodies are in each other, whatever extrema there are, and which roots are of far sides: by facets.

A patch whose middle is inside the other body says so by its foot there, where nothing is between the two; a part of an
edge that goes through a face does (`proximity/manager/edge_piercing.py`). A segment is inside a body or outside by how
many facets it cuts. Of
a body that is wholly inside another one every ray cuts an odd number; so do some rays from outside a tube with open
ends, but not three of three points.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.faces.trim import trim_side
from assembly.geometry.splines.domain import is_within
from assembly.geometry.splines.evaluate import surface_at, surface_point
from assembly.geometry.vec import add, cross, matvec, matvec_t, scale, sub
from assembly.proximity.brep.apexes import unit
from assembly.proximity.brep.borders import feature_at
from assembly.proximity.brep.records import FACE_RECORD, face_at, shell_at
from assembly.proximity.bvh.tree import (
    ELEMENT,
    NODE,
    NODE_INTS,
    element_at,
    node_at,
    node_links_at,
    overlapping,
    tree_at,
)
from assembly.proximity.extrema.projection import projection_of
from assembly.proximity.extrema.singular import BESIDE
from assembly.proximity.manager.edge_piercing import cut_at, patch_vertex_contacts, pierces
from assembly.proximity.manager.extrema import extremum_at

# Room for the descent of a segment.
DEPTH = 256
# How often Newton's steps to a foot begin again where they end.
PROJECTIONS = 4
# A segment that passes a facet by less than this part of its sides cuts it, where being cut by two is no harm: one
# through a common side may miss both.
BETWEEN = 1e-9
# What is wholly inside is asked of points this far below a surface, and twice as far as the other's facets are off:
# bodies at one place are in each other.
BELOW = 1e-6


@kernel(inline=True)
def meets_box(pool, o, a, d):
    """Whether the segment from a to a + d meets the box of the node at o."""
    node = node_at(pool, o)
    lo = 0.0
    hi = 1.0
    for i in range(3):
        low = node.center[i] - node.half[i] - a[i]
        high = node.center[i] + node.half[i] - a[i]
        if abs(d[i]) < 1e-300:
            if low > 0.0 or high < 0.0:
                return False
        else:
            s = low / d[i]
            t = high / d[i]
            lo = max(lo, min(s, t))
            hi = min(hi, max(s, t))
    return lo <= hi


@kernel(inner=True)
def surface_of(table, shell, surface, code):
    """The surface record of an element's feature, or -1 where it is no face."""
    if surface >= 0:
        return surface
    return feature_at(table, shell, code) if code < shell_at(table, shell).faces else -1


@kernel(inner=True)
def in_trim(store, shell, code, u, v):
    """Whether parameters are within the boundary of a face or on it; of a surface without one they always are."""
    if shell < 0:
        return True
    trim = face_at(store.table, shell_at(store.table, shell).face_table + FACE_RECORD * code).trim
    return trim < 0 or trim_side(store, trim, u, v) >= 0


@kernel(inline=True)
def with_children(stack, used, child):
    """How many nodes are on a stack, after a node's children were put there, for which there is room."""
    if used + 2 > DEPTH:
        return used
    stack[used] = child
    stack[used + 1] = child + 1
    return used + 2


@kernel(inner=True, allocates=True)
def facets_cut(store, tree, surface, shell, a, d, end, beside):
    """How many facets of a body's faces cut the segment from a to a + d, but for that part at its ends; body axes.

    Or are beside it, by that part of their sides. And whether the first of them leads out of the body.
    """
    tree_record = tree_at(store.table, tree)
    stack = np.empty(DEPTH, np.int64)
    stack[0] = 0
    used = 1
    count = 0
    first = 2.0
    leaves = False
    while used > 0:
        used -= 1
        i = stack[used]
        if not meets_box(store.pool, tree_record.node_pool + NODE * i, a, d):
            continue
        at = node_links_at(store.table, tree_record.node_table + NODE_INTS * i)
        child = at.child
        if child >= 0:
            used = with_children(stack, used, child)
            continue
        code = at.feature
        r = surface_of(store.table, shell, surface, code)
        if r < 0:
            continue
        e = tree_record.element_pool + ELEMENT * (-1 - child)
        (u, v, wide, high), (p, q, s, t) = patch_vertex_contacts(store, r, element_at(store.pool, e))
        for k in range(2):
            cut = cut_at(a, d, p, q if k == 0 else s, s if k == 0 else t, end, beside)
            hit, way, x, y, along = cut.hit, cut.part, cut.q, cut.r, cut.turns
            here = (u + (x + y if k == 0 else x) * wide, v + (y if k == 0 else x + y) * high)
            if hit and in_trim(store, shell, code, here[0], here[1]):
                count += 1
                if way < first:
                    first = way
                    leaves = along == (surface_at(store.table, r).sign > 0)
    return count, leaves


@kernel(inner=True)
def projection_at(store, tree, surface, shell, e, y):
    """The signed distance of a point from its foot at a body's element e, the normal there, and whether there is one.

    A foot that Newton's method did not reach is none: off the foot of a point outside, the tangent plane of a bulge has
    it inside. One farther off than BESIDE may be on the far side.
    """
    patch = element_at(store.pool, tree_at(store.table, tree).element_pool + ELEMENT * e)
    code = np.int64(patch.feature)
    f = surface_of(store.table, shell, surface, code)
    if f < 0:
        return 0.0, y, False
    u, v = patch.middle[0], patch.middle[1]
    s, t, distance, n, settled = projection_of(store, f, y, u, v)
    for _ in range(PROJECTIONS):
        if settled:
            break
        s, t, distance, n, settled = projection_of(store, f, y, s, t)
    beside = is_within(store, f, s, t, u, v, BESIDE * patch.half[0], BESIDE * patch.half[1])
    return distance, n, settled and beside and in_trim(store, shell, code, s, t)


@kernel(inner=True, allocates=True)
def nearest_projection(store, tree, surface, shell, y, reach):
    """The signed distance of a point from its nearest foot on a body; minus the reach if none is nearer than that."""
    tree_record = tree_at(store.table, tree)
    stack = np.empty(DEPTH, np.int64)
    stack[0] = 0
    used = 1
    nearest = -reach
    while used > 0:
        used -= 1
        i = stack[used]
        o = node_at(store.pool, tree_record.node_pool + NODE * i)
        square = 0.0
        for k in range(3):
            off = max(abs(y[k] - o.center[k]) - o.half[k], 0.0)
            square += off * off
        if square > nearest * nearest:
            continue
        child = node_links_at(store.table, tree_record.node_table + NODE_INTS * i).child
        if child >= 0:
            used = with_children(stack, used, child)
            continue
        distance, _n, some = projection_at(store, tree, surface, shell, -1 - child, y)
        if some and abs(distance) < abs(nearest):
            nearest = distance
    return nearest


@kernel(inner=True)
def is_inside_at(store, tree, surface, shell, e, y, margin, offset):
    """Whether a point is farther than a margin inside a body, by its foot at element e.

    Of a thin wall the foot may be on the far side. Then one on the near side is nearer, or, where that is past an edge,
    a facet is between; these are up to an `offset` beside their surfaces.
    """
    distance, n, some = projection_at(store, tree, surface, shell, e, y)
    if not (some and distance < -margin):
        return False
    if nearest_projection(store, tree, surface, shell, y, -distance) >= -margin:
        return False
    if -distance <= 2.0 * offset:
        return True
    return facets_cut(store, tree, surface, shell, y, scale(-distance, n), offset / -distance, 0.0)[0] == 0


@kernel(inner=True)
def is_deep(store, posed, e, d, margin, offsets):
    """Whether the middle of a patch of f is farther than a margin inside g at a patch, or the other way round."""
    turn, shift = posed.pose.rotation, posed.pose.shift
    tree_f, tree_g = posed.trees
    f, g = posed.surfaces
    shell_f, shell_g = posed.shells
    a, some = middle(store, tree_f, f, shell_f, e)
    a = matvec_t(turn, sub(a, shift))
    if some and is_inside_at(store, tree_g, g, shell_g, d, a, margin, offsets[1]):
        return True
    b, some = middle(store, tree_g, g, shell_g, d)
    b = add(matvec(turn, b), shift)
    return some and is_inside_at(store, tree_f, f, shell_f, e, b, margin, offsets[0])


@kernel(inner=True)
def middle(store, tree, surface, shell, e):
    """The middle of a patch, in the axes of its body, and whether it is one of a face and within its boundary."""
    patch = element_at(store.pool, tree_at(store.table, tree).element_pool + ELEMENT * e)
    code = np.int64(patch.feature)
    f = surface_of(store.table, shell, surface, code)
    if f < 0 or not in_trim(store, shell, code, patch.middle[0], patch.middle[1]):
        return (0.0, 0.0, 0.0), False
    return surface_point(store.table, store.pool, f, patch.middle[0], patch.middle[1])[0], True


@kernel(inner=True)
def below_part(store, tree, surface, shell, k, below):
    """A point `below` the middle of a patch in the k-th of three parts of a body's patches, and whether there is one.

    The parts are of different faces, if there are some: a point of a face that touches may be taken for inside.
    """
    tree_record = tree_at(store.table, tree)
    solid = shell_at(store.table, shell)
    first = tree_record.element_pool
    elements = tree_record.elements
    patches = 0
    for e in range(elements):
        patches += int(shell < 0 or element_at(store.pool, first + ELEMENT * e).feature < solid.faces)
    passed = 0
    for e in range(elements):
        if shell < 0 or element_at(store.pool, first + ELEMENT * e).feature < solid.faces:
            if passed >= patches * k // 3:
                a, some = middle(store, tree, surface, shell, e)
                if some:
                    patch = element_at(store.pool, first + ELEMENT * e)
                    f = surface_of(store.table, shell, surface, np.int64(patch.feature))
                    _p, su, sv, _uu, _uv, _vv = surface_point(
                        store.table, store.pool, f, patch.middle[0], patch.middle[1]
                    )
                    return sub(a, scale(float(surface_at(store.table, f).sign) * below, unit(cross(su, sv)))), True
            passed += 1
    return (0.0, 0.0, 0.0), False


@kernel(inner=True)
def is_wholly_inside(store, posed, side, below):
    """Whether f (side 0) is wholly inside g, or g in f: by rays, each another way, from three points `below` it."""
    turn, shift = posed.pose.rotation, posed.pose.shift
    tree, other = posed.trees[side], posed.trees[1 - side]
    surface, shell = posed.surfaces[side], posed.shells[side]
    # Some direction that no face is likely to lie along, and far enough.
    far = 10.0 * (
        node_at(store.pool, tree_at(store.table, tree).node_pool).radius
        + node_at(store.pool, tree_at(store.table, other).node_pool).radius
    )
    for k in range(3):
        a, some = below_part(store, tree, surface, shell, k, below)
        if not some:
            return False
        ray = (0.6012 * far, 0.3517 * far, 0.7174 * far)
        if k == 1:
            ray = scale(-1.0, ray)
        elif k == 2:
            ray = (0.5218 * far, -0.8125 * far, -0.2601 * far)
        a = matvec_t(turn, sub(a, shift)) if side == 0 else add(matvec(turn, a), shift)
        cut, leaves = facets_cut(store, other, posed.surfaces[1 - side], posed.shells[1 - side], a, ray, 0.0, 0.0)
        # In a bore that is open at its ends a ray goes into the material.
        if cut % 2 == 0 or not leaves:
            return False
    return True


@kernel(inner=True)
def crosses(store, posed, stack, candidates, margin, offsets):
    """Whether two bodies are in each other by more than a margin, or wholly, whatever extrema there are.

    Facets of f and of g are up to `offsets` beside their surfaces.
    """
    count = overlapping(store, posed.trees[0], posed.trees[1], posed.pose, stack, candidates)
    for c in range(count):
        if is_deep(store, posed, candidates[c, 0], candidates[c, 1], margin, offsets):
            return True
        if posed.surfaces[0] < 0 and pierces(store, posed, (candidates[c, 0], candidates[c, 1]), margin, offsets):
            return True
    return is_wholly_inside(store, posed, 0, BELOW + 2.0 * offsets[1]) or is_wholly_inside(
        store, posed, 1, BELOW + 2.0 * offsets[0]
    )


@kernel(inner=True)
def is_outside(store, posed, extrema, k, offsets):
    """Whether root k, of a negative gap, is one of far sides: then a surface is between its points.

    Facets of f and of g are up to `offsets` beside their surfaces; gaps of no more are taken for true.
    """
    extremum = extremum_at(extrema, k)
    depth = -extremum.gap
    turn, shift = posed.pose.rotation, posed.pose.shift
    a = (extremum.point_f[0], extremum.point_f[1], extremum.point_f[2])
    b = (extremum.point_g[0], extremum.point_g[1], extremum.point_g[2])
    end = offsets[0] / depth
    if (
        end < 0.5
        and facets_cut(store, posed.trees[0], posed.surfaces[0], posed.shells[0], a, sub(b, a), end, BETWEEN)[0] > 0
    ):
        return True
    a = matvec_t(turn, sub(a, shift))
    b = matvec_t(turn, sub(b, shift))
    end = offsets[1] / depth
    return (
        end < 0.5
        and facets_cut(store, posed.trees[1], posed.surfaces[1], posed.shells[1], a, sub(b, a), end, BETWEEN)[0] > 0
    )
