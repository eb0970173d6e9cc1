"""Whether two bodies cross, whatever extrema there are, and which extrema are of far sides: by facets.

Bodies cross where the middle of a patch is inside the other body: its projection there tells, if no facet is between
the two; and where a part of an edge goes through a face (`proximity/manager/edge_piercing.py`). Whether a segment is
inside a body is told by how many facets it cuts. Every ray from a body that is wholly inside another one cuts an odd
number; so may a ray from outside a tube with open ends, but not three rays from three points.
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
from assembly.proximity.brep.records import EDGE_RECORD, FACE_RECORD, edge_at, face_at, shell_at
from assembly.proximity.bvh.box_descent import overlapping
from assembly.proximity.bvh.tree import ELEMENT, NODE, NODE_INTS, element_at, node_at, node_links_at, three_of, tree_at
from assembly.proximity.extrema.projection import BESIDE, projection_of
from assembly.proximity.manager.edge_piercing import cut_at, patch_vertex_contacts, pierces

# Room for the descent of a segment.
DEPTH = 256
# A segment that misses a facet by less than this part of its sides counts as cutting it, where counting two facets does
# no harm: by rounding, one through a common side may miss both.
BETWEEN = 1e-9
# Whether a body is wholly inside the other one is asked at points below its surface, by this plus twice how far the
# other's facets are off their surfaces: of two equal bodies at one place, each is inside the other.
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
def surface_of_code(posed, side, code):
    """The surface record of a feature of one body, or -1 where it is no face."""
    surface, shell = posed.surfaces[side], posed.shells[side]
    if surface >= 0:
        return surface
    table = posed.store.table
    return feature_at(table, shell, code) if code < shell_at(table, shell).faces else -1


@kernel(inner=True)
def in_trim(posed, side, code, u, v):
    """Whether parameters are within the boundary of a face or on it; of a surface without one they always are."""
    shell = posed.shells[side]
    if shell < 0:
        return True
    table = posed.store.table
    trim = face_at(table, shell_at(table, shell).face_table + FACE_RECORD * code).trim
    return trim < 0 or trim_side(posed.store, trim, u, v) >= 0


@kernel(inline=True)
def with_children(stack, used, child):
    """How many nodes are on a stack, after a node's children were put there, for which there is room."""
    if used + 2 > DEPTH:
        return used
    stack[used] = child
    stack[used + 1] = child + 1
    return used + 2


@kernel(inner=True)
def next_near(store, tree, y, distance, stack, used):
    """The next element of a tree whose box is within a distance of a point, in its axes, and how many nodes wait then.

    It is -1 where there is none any more. The walk begins with the root, node 0, alone on the stack.
    """
    record = tree_at(store.table, tree)
    while used > 0:
        used -= 1
        i = stack[used]
        o = node_at(store.pool, record.node_pool + NODE * i)
        square = 0.0
        for k in range(3):
            off = max(abs(y[k] - o.center[k]) - o.half[k], 0.0)
            square += off * off
        if square > distance * distance:
            continue
        child = node_links_at(store.table, record.node_table + NODE_INTS * i).child
        if child < 0:
            return -1 - child, used
        used = with_children(stack, used, child)
    return np.int64(-1), used


@kernel(inner=True, allocates=True)
def facets_cut(posed, side, a, d, end, beside):
    """How many facets of a body's faces a segment cuts, and whether the first of them leads out of the body.

    In body axes, the segment goes from a to a + d; cuts within the part `end` of it from one of its ends do not count.
    A facet that it misses by no more than the part `beside` of the facet's sides does.
    """
    store = posed.store
    tree = tree_at(store.table, posed.trees[side])
    stack = np.empty(DEPTH, np.int64)
    stack[0] = 0
    used = 1
    count = 0
    first = 2.0
    leaves = False
    while used > 0:
        used -= 1
        i = stack[used]
        if not meets_box(store.pool, tree.node_pool + NODE * i, a, d):
            continue
        at = node_links_at(store.table, tree.node_table + NODE_INTS * i)
        child = at.child
        if child >= 0:
            used = with_children(stack, used, child)
            continue
        code = at.feature
        r = surface_of_code(posed, side, code)
        if r < 0:
            continue
        e = tree.element_pool + ELEMENT * (-1 - child)
        (u, v, wide, high), (p, q, s, t) = patch_vertex_contacts(store, r, element_at(store.pool, e))
        for k in range(2):
            cut = cut_at(a, d, p, q if k == 0 else s, s if k == 0 else t, end, beside)
            x, y = cut.q, cut.r
            here = (u + (x + y if k == 0 else x) * wide, v + (y if k == 0 else x + y) * high)
            if cut.hit and in_trim(posed, side, code, here[0], here[1]):
                count += 1
                if cut.part < first:
                    first = cut.part
                    leaves = cut.turns == (surface_at(store.table, r).sign > 0)
    return count, leaves


@kernel(inline=True)
def patch_at(posed, side, e):
    """Element e of one body."""
    return element_at(posed.store.pool, tree_at(posed.store.table, posed.trees[side]).element_pool + ELEMENT * e)


@kernel(inner=True)
def projection_at(posed, side, e, y):
    """Signed distance of a point from its projection at one body's element e, the normal there; whether there is one.

    Where Newton's method has not converged there is none: the tangent plane elsewhere on a bulge may have a point
    inside that is outside. One farther from the middle than BESIDE half widths may be on the far side.
    """
    store = posed.store
    patch = patch_at(posed, side, e)
    code = np.int64(patch.feature)
    f = surface_of_code(posed, side, code)
    if f < 0:
        return 0.0, y, False
    u, v = patch.middle[0], patch.middle[1]
    foot = projection_of(store, f, y, u, v)
    s, t = foot.parameters
    beside = is_within(store, f, s, t, u, v, BESIDE * patch.half[0], BESIDE * patch.half[1])
    return foot.distance, foot.normal, foot.settled and beside and in_trim(posed, side, code, s, t)


@kernel(inner=True, allocates=True)
def nearest_projection(posed, side, y, most):
    """The signed distance of a point from its nearest projection on one body; minus `most` if none is nearer."""
    stack = np.empty(DEPTH, np.int64)
    stack[0] = 0
    used = 1
    nearest = -most
    while used > 0:
        e, used = next_near(posed.store, posed.trees[side], y, nearest, stack, used)
        if e < 0:
            break
        distance, _n, some = projection_at(posed, side, e, y)
        if some and abs(distance) < abs(nearest):
            nearest = distance
    return nearest


@kernel(inner=True)
def is_inside_at(posed, side, e, y, margin):
    """Whether a point is farther than a margin inside one body, by its projection at element e.

    At a thin wall the projection may be on the far side. Then the one on the near side is nearer, or, if that is past
    an edge, a facet is between the point and its projection; facets are up to an offset off their surfaces.
    """
    offset = posed.offsets[side]
    distance, n, some = projection_at(posed, side, e, y)
    if not (some and distance < -margin):
        return False
    if nearest_projection(posed, side, y, -distance) >= -margin:
        return False
    if -distance <= 2.0 * offset:
        return True
    return facets_cut(posed, side, y, scale(-distance, n), offset / -distance, 0.0)[0] == 0


@kernel(inline=True)
def seen_by_other(posed, side, a):
    """A point of one body in the axes of the other one."""
    turn, shift = posed.pose.rotation, posed.pose.shift
    return matvec_t(turn, sub(a, shift)) if side == 0 else add(matvec(turn, a), shift)


@kernel(inner=True)
def is_deep(posed, e, d, margin):
    """Whether the middle of a patch of f is farther than a margin inside g at a patch, or the other way round."""
    a, some = middle(posed, 0, e)
    if some and is_inside_at(posed, 1, d, seen_by_other(posed, 0, a), margin):
        return True
    b, some = middle(posed, 1, d)
    return some and is_inside_at(posed, 0, e, seen_by_other(posed, 1, b), margin)


@kernel(inner=True)
def middle(posed, side, e):
    """The middle of a patch, in the axes of its body, and whether it is one of a face and within its boundary."""
    store = posed.store
    patch = patch_at(posed, side, e)
    code = np.int64(patch.feature)
    f = surface_of_code(posed, side, code)
    if f < 0 or not in_trim(posed, side, code, patch.middle[0], patch.middle[1]):
        return (0.0, 0.0, 0.0), False
    return surface_point(store.table, store.pool, f, patch.middle[0], patch.middle[1]).point, True


@kernel(inline=True)
def is_patch(posed, side, e):
    """Whether an element of one body is of a face."""
    shell = posed.shells[side]
    return shell < 0 or patch_at(posed, side, e).feature < shell_at(posed.store.table, shell).faces


@kernel(inner=True)
def below_part(posed, side, k, below):
    """A point `below` the middle of a patch in the k-th of three parts of a body's patches, and whether there is one.

    The three parts belong to different faces if the body has several: below a face that touches, a point may be taken
    for inside.
    """
    store = posed.store
    elements = tree_at(store.table, posed.trees[side]).elements
    patches = 0
    for e in range(elements):
        patches += int(is_patch(posed, side, e))
    passed = 0
    for e in range(elements):
        if is_patch(posed, side, e):
            if passed >= patches * k // 3:
                a, some = middle(posed, side, e)
                if some:
                    patch = patch_at(posed, side, e)
                    f = surface_of_code(posed, side, np.int64(patch.feature))
                    _p, su, sv, _uu, _uv, _vv = surface_point(
                        store.table, store.pool, f, patch.middle[0], patch.middle[1]
                    )
                    return sub(a, scale(float(surface_at(store.table, f).sign) * below, unit(cross(su, sv)))), True
            passed += 1
    return (0.0, 0.0, 0.0), False


@kernel(inner=True)
def is_wholly_inside(posed, side, below):
    """Whether f (side 0) is wholly inside g, or g in f: by three rays, each from another point `below` its surface."""
    store = posed.store
    tree, other = posed.trees[side], posed.trees[1 - side]
    # Some direction that no face is likely to lie along, and far enough.
    far = 10.0 * (
        node_at(store.pool, tree_at(store.table, tree).node_pool).radius
        + node_at(store.pool, tree_at(store.table, other).node_pool).radius
    )
    for k in range(3):
        a, some = below_part(posed, side, k, below)
        if not some:
            return False
        ray = (0.6012 * far, 0.3517 * far, 0.7174 * far)
        if k == 1:
            ray = scale(-1.0, ray)
        elif k == 2:
            ray = (0.5218 * far, -0.8125 * far, -0.2601 * far)
        cut, leaves = facets_cut(posed, 1 - side, seen_by_other(posed, side, a), ray, 0.0, 0.0)
        # From inside a bore that is open at its ends, a ray's first cut leads into the material.
        if cut % 2 == 0 or not leaves:
            return False
    return True


@kernel(inner=True)
def crosses(posed, stack, candidates, margin):
    """Whether two bodies cross by more than a margin, or one is wholly inside the other, whatever extrema there are."""
    count = overlapping(posed.store, posed.trees, posed.pose, stack, candidates)
    for c in range(count):
        if is_deep(posed, candidates[c, 0], candidates[c, 1], margin):
            return True
        if posed.surfaces[0] < 0 and pierces(posed, (candidates[c, 0], candidates[c, 1]), margin):
            return True
    return is_wholly_inside(posed, 0, BELOW + 2.0 * posed.offsets[1]) or is_wholly_inside(
        posed, 1, BELOW + 2.0 * posed.offsets[0]
    )


@kernel(inner=True)
def is_sheet(store, shell):
    """Whether a body is a sheet: one of its edges has a face on one side only."""
    solid = shell_at(store.table, shell)
    for k in range(solid.edges):
        if edge_at(store.table, solid.edge_table + EDGE_RECORD * k).face_b < 0:
            return True
    return False


@kernel(inner=True)
def is_cut(posed, side, extremum):
    """Whether facets of one body cut the segment between the points of an extremum with a negative gap.

    A gap within twice the distance of facets from their surfaces counts as not cut.
    """
    a, b = three_of(extremum.point_f), three_of(extremum.point_g)
    if side == 1:
        a, b = seen_by_other(posed, 0, a), seen_by_other(posed, 0, b)
    end = posed.offsets[side] / -extremum.gap
    return end < 0.5 and facets_cut(posed, side, a, sub(b, a), end, BETWEEN)[0] > 0


@kernel(inner=True)
def is_outside(posed, extremum):
    """Whether an extremum with a negative gap is one of far sides: then a surface is between its points.

    A vertex or a point of an edge is inside the other body if no facet of that body is between the two points; facets
    of its own body may be, as of a thin plate.
    """
    store, shells = posed.store, posed.shells
    cut = (is_cut(posed, 0, extremum), is_cut(posed, 1, extremum))
    if cut[0] == cut[1] or shells[0] < 0:
        return cut[0]
    own = 0 if cut[0] else 1
    code = extremum.code_f if own == 0 else extremum.code_g
    return code < shell_at(store.table, shells[own]).faces or is_sheet(store, shells[1 - own])
