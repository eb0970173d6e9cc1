"""Descent of two trees of boxes and normal cones: which of their elements may hold an extremal pair.

An extremal pair has g - f = gap n, where n lies in the normal cone of f and -n in that of g (Johnson and Cohen,
Spatialized normal cone hierarchies, 2001). Of two nodes with difference d of their centers and a reach for |gap| none
holds a pair where

    the boxes are farther apart than the reach, by the planes along the axes of either,
    no n of the cone of f is within the cone of g turned around: angle(a_f, -a_g) > alpha_f + alpha_g,
    or d is farther than r_f + r_g, the radii of balls, from the double cone of the n of f, or of g.

A tree is a header and the links of its nodes in the table; bounds of nodes, and elements, stand in the pool. Nodes are
numbered from the root, 0; the two children of a node follow each other. Everything is in the axes of f; the rotation
and the shift are those of g relative to f.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store, place_of, record_dtype, record_view, size_of
from assembly.geometry.vec import add, dot, matvec, matvec_t, neg, scale, sub
from assembly.kinematics.motion import RelativePose

# The header of a tree in the table.
TREE_DTYPE = record_dtype(
    "i8",
    nodes=1,  # number of nodes
    node_table=1,  # where their NODE_LINKS begin in the table
    node_pool=1,  # where their NODE_BOUNDS begin in the pool
    elements=1,  # number of elements
    element_pool=1,  # where these begin in the pool
)
tree_at = record_view(TREE_DTYPE)
NODES = place_of(TREE_DTYPE, "nodes")
NODE_TABLE = place_of(TREE_DTYPE, "node_table")
NODE_POOL = place_of(TREE_DTYPE, "node_pool")
ELEMENT_POOL = place_of(TREE_DTYPE, "element_pool")
TREE = size_of(TREE_DTYPE)
# A node in the table.
NODE_LINKS = record_dtype(
    "i8",
    child=1,  # its first child, or -1 - element
    feature=1,  # the feature of the element; -1: a node with children
)
node_links_at = record_view(NODE_LINKS)
NODE_INTS = size_of(NODE_LINKS)
# A node in the pool: box, cone of outward normals, ball around the center.
NODE_BOUNDS = record_dtype(
    "f8",
    center=3,  # [length over the size of the scene]
    half=3,  # half widths
    axis=3,  # of the cone, a unit vector
    cosine=1,  # of the cone's half angle; -1: all directions
    sine=1,
    radius=1,  # of the ball
)
node_at = record_view(NODE_BOUNDS)
CENTER = place_of(NODE_BOUNDS, "center")
COS = place_of(NODE_BOUNDS, "cosine")
SIN = place_of(NODE_BOUNDS, "sine")
RADIUS = place_of(NODE_BOUNDS, "radius")
NODE = size_of(NODE_BOUNDS)
# An element in the pool: a patch of a face, a part of an edge, or a vertex.
ELEMENT_DTYPE = record_dtype(
    "f8",
    middle=2,  # of its box of parameters: (u, v), or (t, 0)
    half=2,  # half widths of it
    feature=1,  # its feature
    node=1,  # its node
)
element_at = record_view(ELEMENT_DTYPE)
ELEMENT_FEATURE = place_of(ELEMENT_DTYPE, "feature")
ELEMENT = size_of(ELEMENT_DTYPE)
# Rounding of unit vectors and of coordinates, relative: what is in doubt is kept.
ROUNDING = 1e-13


@kernel(inline=True)
def three_of(field):
    """Three numbers of a record's field."""
    return (field[0], field[1], field[2])


@kernel(inline=True)
def excess(d, h, k):
    """The square of the distance of two boxes along common axes: centers d apart, half widths h and k."""
    x = max(abs(d[0]) - h[0] - k[0], 0.0)
    y = max(abs(d[1]) - h[1] - k[1], 0.0)
    z = max(abs(d[2]) - h[2] - k[2], 0.0)
    return x * x + y * y + z * z


@kernel(inline=True)
def magnitudes(m):
    """The absolute values of a rotation, rounded up."""
    e = 4e-16
    return (
        abs(m[0]) + e,
        abs(m[1]) + e,
        abs(m[2]) + e,
        abs(m[3]) + e,
        abs(m[4]) + e,
        abs(m[5]) + e,
        abs(m[6]) + e,
        abs(m[7]) + e,
        abs(m[8]) + e,
    )


@kernel(inline=True)
def transposed(m):
    return (m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8])


@kernel(inline=True)
def off_axis(d, dd, axis, c, s, r):
    """Whether the point d is farther than r from the double cone along an axis, c and s of its half angle."""
    p = dot(d, axis)
    beside = r + s * abs(p)
    return c > 0.0 and c * c * (dd - p * p) > beside * beside + 1e-15 * dd


@kernel(inner=True)
def beside_cone(d, axis, c, s, ho, hp, rotation, slack):
    """Whether two boxes, centers d apart, are so on one side of a double cone that no difference of theirs is in it.

    Of the planes that touch it, those towards d are tried. The boxes have half widths ho, and hp in turned axes.
    """
    p = dot(d, axis)
    w = sub(d, scale(p, axis))
    ww = dot(w, w)
    if not (c > 0.0 and ww > 1e-20 * dot(d, d)):
        return False
    w = scale(c / math.sqrt(ww), w)
    for sign in (-s, s):
        m = add(w, scale(sign, axis))
        n = matvec_t(rotation, m)
        size = abs(m[0]) * ho[0] + abs(m[1]) * ho[1] + abs(m[2]) * ho[2]
        size += abs(n[0]) * hp[0] + abs(n[1]) * hp[1] + abs(n[2]) * hp[2]
        if dot(m, d) <= size + slack:
            return False
    return True


@kernel(inline=True)
def seen_from(pool, p, rotation, bulk, shift):
    """The node at p as another tree sees it: center, half widths of a box around its own, axis."""
    center = add(matvec(rotation, three_of(node_at(pool, p).center)), shift)
    return center, matvec(bulk, three_of(node_at(pool, p).half)), matvec(rotation, three_of(node_at(pool, p).axis))


@kernel(inline=True)
def admits(pool, o, p, seen, rotation, bulk, reach, slack, tilt):
    """Whether the nodes at o of one tree and at p of the other, seen from the one, may hold a pair.

    `rotation` is that of the other tree, `bulk` its magnitudes; `slack` is how far points may be off, and `tilt` unit
    vectors. What excludes most pairs for little comes first.
    """
    node = node_at(pool, o)
    node_bounds = node_at(pool, p)
    center, around, axis_p = seen
    axis_o = three_of(node_at(pool, o).axis)
    co = node.cosine
    so = node.sine
    cp = node_bounds.cosine
    sp = node_bounds.sine
    if so * cp + co * sp > ROUNDING and -dot(axis_o, axis_p) < co * cp - so * sp - tilt:
        return False
    d = sub(center, three_of(node_at(pool, o).center))
    dd = dot(d, d)
    r = node.radius + node_bounds.radius + slack
    if dd > (r + reach) * (r + reach):
        return False
    square = reach * reach
    ho = three_of(node_at(pool, o).half)
    if excess(d, ho, around) > square:
        return False
    r += tilt * (r + reach)
    if off_axis(d, dd, axis_o, co, so, r) or off_axis(d, dd, axis_p, cp, sp, r):
        return False
    return excess(matvec_t(rotation, d), matvec_t(bulk, ho), three_of(node_at(pool, p).half)) <= square


@kernel(inner=True)
def facing(pool, o, p, pose, slack):
    """Whether leaves at o of f and at p of g, admitted, still may hold a pair when their boxes are looked at closer."""
    node = node_at(pool, o)
    node_bounds = node_at(pool, p)
    d = sub(
        add(matvec(pose.rotation, three_of(node_at(pool, p).center)), pose.shift), three_of(node_at(pool, o).center)
    )
    ho = three_of(node_at(pool, o).half)
    hp = three_of(node_at(pool, p).half)
    if beside_cone(d, three_of(node_at(pool, o).axis), node.cosine, node.sine, ho, hp, pose.rotation, slack):
        return False
    axis = matvec(pose.rotation, three_of(node_at(pool, p).axis))
    return not beside_cone(d, axis, node_bounds.cosine, node_bounds.sine, ho, hp, pose.rotation, slack)


@kernel(inline=True)
def node_of(store, tree, e):
    """Where the node of element e is in the pool."""
    tree_record = tree_at(store.table, tree)
    return tree_record.node_pool + NODE * np.int64(element_at(store.pool, tree_record.element_pool + ELEMENT * e).node)


@kernel(inline=True)
def rounding(pool, root_f, root_g, shift):
    """By how much coordinates may be off."""
    size = node_at(pool, root_f).radius + node_at(pool, root_g).radius
    c = three_of(node_at(pool, root_f).center)
    e = three_of(node_at(pool, root_g).center)
    size += math.sqrt(dot(c, c)) + math.sqrt(dot(e, e)) + math.sqrt(dot(shift, shift))
    return ROUNDING * size


@kernel(inner=True)
def pairs_about(store, tree_f, tree_g, pose, reach, ring, tilt, stack, out):
    """Elements (k, 2) that may hold an extremal pair with |gap| <= reach at this pose, or at one near it; their number.

    Near are poses at which no point of either body is farther than `ring` from where it is now, seen from the other,
    and no unit vector farther than `tilt`: then the difference g - f of a pair's points is off by as much, and once
    more by what a cone, or the axes it is seen in, turned.

    -1 where the stack (n, 2) is too short; more than `out` holds where `out` is: then what it holds are the first.
    """
    tree = tree_at(store.table, tree_f)
    tree_record = tree_at(store.table, tree_g)
    node_f = tree.node_pool
    node_g = tree_record.node_pool
    ints_f = tree.node_table
    ints_g = tree_record.node_table
    slack = ring + rounding(store.pool, node_f, node_g, pose.shift)
    reach += slack
    tilt += ROUNDING
    bulk = magnitudes(pose.rotation)
    back = transposed(pose.rotation)
    back_bulk = transposed(bulk)
    back_shift = neg(matvec(back, pose.shift))
    room = stack.shape[0]
    count = 0
    if room < 1:
        return -1
    seen = seen_from(store.pool, node_g, pose.rotation, bulk, pose.shift)
    if not admits(store.pool, node_f, node_g, seen, pose.rotation, bulk, reach, slack, tilt):
        return 0
    stack[0, 0] = 0
    stack[0, 1] = 0
    used = 1
    while used > 0:
        used -= 1
        i = stack[used, 0]
        j = stack[used, 1]
        o = node_f + NODE * i
        p = node_g + NODE * j
        child_f = node_links_at(store.table, ints_f + NODE_INTS * i).child
        child_g = node_links_at(store.table, ints_g + NODE_INTS * j).child
        if child_f < 0 and child_g < 0:
            if facing(store.pool, o, p, pose, slack + tilt * reach):
                if count < out.shape[0]:
                    out[count, 0] = -1 - child_f
                    out[count, 1] = -1 - child_g
                count += 1
            continue
        if used + 2 > room:
            return -1
        if child_g < 0 or (child_f >= 0 and node_at(store.pool, o).radius >= node_at(store.pool, p).radius):
            seen = seen_from(store.pool, p, pose.rotation, bulk, pose.shift)
            for k in range(2):
                if admits(store.pool, node_f + NODE * (child_f + k), p, seen, pose.rotation, bulk, reach, slack, tilt):
                    stack[used, 0] = child_f + k
                    stack[used, 1] = j
                    used += 1
        else:
            seen = seen_from(store.pool, o, back, back_bulk, back_shift)
            for k in range(2):
                if admits(store.pool, node_g + NODE * (child_g + k), o, seen, back, back_bulk, reach, slack, tilt):
                    stack[used, 0] = i
                    stack[used, 1] = child_g + k
                    used += 1
    return count


@kernel(inner=True)
def pairs_within(store, tree_f, tree_g, pose, reach, stack, out):
    """Elements (k, 2) of two trees that may hold an extremal pair with |gap| <= reach; see `pairs_about`."""
    return pairs_about(store, tree_f, tree_g, pose, reach, 0.0, 0.0, stack, out)


@kernel(inner=True)
def still_within(store, tree_f, tree_g, pose, reach, listed, count, out):
    """Which of the elements in a list, count of them from its place `listed` in the table, `pairs_within` would find.

    As long as `out` holds them; their number.
    """
    slack = rounding(
        store.pool, tree_at(store.table, tree_f).node_pool, tree_at(store.table, tree_g).node_pool, pose.shift
    )
    reach += slack
    bulk = magnitudes(pose.rotation)
    found = 0
    for k in range(count):
        e = store.table[listed + 2 * k]
        d = store.table[listed + 2 * k + 1]
        o = node_of(store, tree_f, e)
        p = node_of(store, tree_g, d)
        seen = seen_from(store.pool, p, pose.rotation, bulk, pose.shift)
        if admits(store.pool, o, p, seen, pose.rotation, bulk, reach, slack, ROUNDING) and facing(
            store.pool, o, p, pose, slack
        ):
            if found < out.shape[0]:
                out[found, 0] = e
                out[found, 1] = d
            found += 1
    return found


@kernel(signatures="(i8[::1], f8[::1], i8, i8, UniTuple(f8, 9), UniTuple(f8, 3), f8, i8[:, ::1], i8[:, ::1])")
def facing_pairs(table, pool, tree_f, tree_g, rotation, shift, reach, stack, out):
    """`pairs_within` for Python."""
    return pairs_within(Store(table, pool), tree_f, tree_g, RelativePose(rotation, shift), reach, stack, out)


@kernel(inline=True)
def box_distance(pool, o, p, seen, rotation, bulk):
    """The square of a lower bound of the distance of the boxes at o and at p; see `admits`."""
    ho = three_of(node_at(pool, o).half)
    d = sub(seen[0], three_of(node_at(pool, o).center))
    along = excess(d, ho, seen[1])
    return max(along, excess(matvec_t(rotation, d), matvec_t(bulk, ho), three_of(node_at(pool, p).half)))


@kernel(inner=True)
def overlapping(store, tree_f, tree_g, pose, stack, out):
    """Elements (k, 2) of two trees whose boxes meet; how many `out` holds of them."""
    tree = tree_at(store.table, tree_f)
    tree_record = tree_at(store.table, tree_g)
    node_f = tree.node_pool
    node_g = tree_record.node_pool
    ints_f = tree.node_table
    ints_g = tree_record.node_table
    bulk = magnitudes(pose.rotation)
    count = 0
    stack[0, 0] = 0
    stack[0, 1] = 0
    used = 1
    while used > 0 and count < out.shape[0]:
        used -= 1
        i = stack[used, 0]
        j = stack[used, 1]
        o = node_f + NODE * i
        p = node_g + NODE * j
        if (
            box_distance(
                store.pool, o, p, seen_from(store.pool, p, pose.rotation, bulk, pose.shift), pose.rotation, bulk
            )
            > 0.0
        ):
            continue
        child_f = node_links_at(store.table, ints_f + NODE_INTS * i).child
        child_g = node_links_at(store.table, ints_g + NODE_INTS * j).child
        if child_f < 0 and child_g < 0:
            out[count, 0] = -1 - child_f
            out[count, 1] = -1 - child_g
            count += 1
        elif used + 2 <= stack.shape[0]:
            down_f = child_g < 0 or (child_f >= 0 and node_at(store.pool, o).radius >= node_at(store.pool, p).radius)
            for k in range(2):
                stack[used, 0] = child_f + k if down_f else i
                stack[used, 1] = j if down_f else child_g + k
                used += 1
    return count


@kernel(inner=True)
def least_distance(store, tree_f, tree_g, pose, upper, stack):
    """A lower bound of the distance of two trees' elements, at most `upper`: that of their boxes.

    A stack (n, 2) that is too short makes what is found lower, not wrong.
    """
    tree = tree_at(store.table, tree_f)
    tree_record = tree_at(store.table, tree_g)
    node_f = tree.node_pool
    node_g = tree_record.node_pool
    ints_f = tree.node_table
    ints_g = tree_record.node_table
    slack = rounding(store.pool, node_f, node_g, pose.shift)
    bulk = magnitudes(pose.rotation)
    back = transposed(pose.rotation)
    back_bulk = transposed(bulk)
    back_shift = neg(matvec(back, pose.shift))
    room = stack.shape[0]
    best = (upper + slack) * (upper + slack)
    if room < 1:
        return 0.0
    stack[0, 0] = 0
    stack[0, 1] = 0
    used = 1
    while used > 0:
        used -= 1
        i = stack[used, 0]
        j = stack[used, 1]
        o = node_f + NODE * i
        p = node_g + NODE * j
        seen = seen_from(store.pool, p, pose.rotation, bulk, pose.shift)
        bound = box_distance(store.pool, o, p, seen, pose.rotation, bulk)
        # What was found since the pair was put here may exclude it.
        if bound >= best:
            continue
        child_f = node_links_at(store.table, ints_f + NODE_INTS * i).child
        child_g = node_links_at(store.table, ints_g + NODE_INTS * j).child
        if (child_f < 0 and child_g < 0) or used + 2 > room:
            best = bound
            continue
        descend_f = child_g < 0 or (child_f >= 0 and node_at(store.pool, o).radius >= node_at(store.pool, p).radius)
        if descend_f:
            one = box_distance(store.pool, node_f + NODE * child_f, p, seen, pose.rotation, bulk)
            other = box_distance(store.pool, node_f + NODE * (child_f + 1), p, seen, pose.rotation, bulk)
        else:
            seen = seen_from(store.pool, o, back, back_bulk, back_shift)
            one = box_distance(store.pool, node_g + NODE * child_g, o, seen, back, back_bulk)
            other = box_distance(store.pool, node_g + NODE * (child_g + 1), o, seen, back, back_bulk)
        # The nearer one comes last, and is looked at first.
        near = 0 if one <= other else 1
        for k in range(2):
            side = near if k == 1 else 1 - near
            if (one if side == 0 else other) < best:
                stack[used, 0] = child_f + side if descend_f else i
                stack[used, 1] = j if descend_f else child_g + side
                used += 1
    return max(math.sqrt(best) - slack, 0.0)


@kernel(signatures="(i8[::1], f8[::1], i8, i8, UniTuple(f8, 9), UniTuple(f8, 3), f8, i8[:, ::1])")
def tree_distance(table, pool, tree_f, tree_g, rotation, shift, upper, stack):
    """`least_distance` for Python."""
    return least_distance(Store(table, pool), tree_f, tree_g, RelativePose(rotation, shift), upper, stack)
