"""Descent of two trees of boxes and normal cones: which of their elements may hold an extremal pair.

An extremal pair has g - f = gap n, where n lies in the normal cone of f and -n in that of g (Johnson and Cohen,
Spatialized normal cone hierarchies, 2001). Two nodes, with a difference d of their centers and a reach for |gap|, hold
no pair where

    the boxes are farther apart than the reach, by the planes along the axes of either,
    no n of the cone of f is within the cone of g turned around: angle(a_f, -a_g) > alpha_f + alpha_g,
    or d is farther than r_f + r_g, the radii of balls, from the double cone of the n of f, or of g.

A tree is a header and the links of its nodes in the table; bounds of nodes, and elements, stand in the pool. Nodes are
numbered from the root, 0; the two children of a node follow each other. Everything is in the axes of f; the rotation
and the shift are those of g relative to f.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store, record_dtype, record_view, size_of
from assembly.geometry.vec import add, dot, matvec, matvec_t, scale, sub
from assembly.kinematics.motion import RelativePose, inverse_pose

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
ELEMENT = size_of(ELEMENT_DTYPE)
# Rounding of unit vectors and of coordinates, relative: what is in doubt is kept.
TREE_ROUNDING = 1e-13


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
def off_axis(d, dd, axis, c, s, r):
    """Whether the point d is farther than r from the double cone along an axis, c and s of its half angle."""
    p = dot(d, axis)
    beside = r + s * abs(p)
    return c > 0.0 and c * c * (dd - p * p) > beside * beside + 1e-15 * dd


@kernel(inner=True)
def beside_cone(d, axis, c, s, ho, hp, rotation, slack):
    """Whether two boxes, centers d apart, are beside a double cone: no difference of their points is in it.

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


# How one tree sees another one. rotation, shift: the pose of the other; bulk: the magnitudes of the rotation.
View = namedtuple("View", "rotation shift bulk")
# The limits for a pair of nodes. reach: of |gap|; slack: of the error of points [length]; tilt: of the error of unit
# vectors.
Margin = namedtuple("Margin", "reach slack tilt")


@kernel(inline=True)
def view_of(pose):
    """The `View` of a pose."""
    return View(pose.rotation, pose.shift, magnitudes(pose.rotation))


@kernel(inline=True)
def seen_from(view, node):
    """A node as another tree sees it: center, half widths of a box around its own, axis."""
    center = add(matvec(view.rotation, three_of(node.center)), view.shift)
    return center, matvec(view.bulk, three_of(node.half)), matvec(view.rotation, three_of(node.axis))


@kernel(inline=True)
def admits(node, other, seen, view, margin):
    """Whether a node of one tree and one of another, as the one sees it, may hold a pair.

    Cheap tests that exclude many pairs come first.
    """
    reach, slack, tilt = margin
    center, around, axis_p = seen
    axis_o = three_of(node.axis)
    co = node.cosine
    so = node.sine
    cp = other.cosine
    sp = other.sine
    if so * cp + co * sp > TREE_ROUNDING and -dot(axis_o, axis_p) < co * cp - so * sp - tilt:
        return False
    d = sub(center, three_of(node.center))
    dd = dot(d, d)
    r = node.radius + other.radius + slack
    if dd > (r + reach) * (r + reach):
        return False
    square = reach * reach
    ho = three_of(node.half)
    if excess(d, ho, around) > square:
        return False
    r += tilt * (r + reach)
    if off_axis(d, dd, axis_o, co, so, r) or off_axis(d, dd, axis_p, cp, sp, r):
        return False
    return excess(matvec_t(view.rotation, d), matvec_t(view.bulk, ho), three_of(other.half)) <= square


@kernel(inner=True)
def facing(node, other, pose, slack):
    """Whether leaves of f and of g that `admits` let pass may hold a pair, by closer tests of their boxes."""
    d = sub(add(matvec(pose.rotation, three_of(other.center)), pose.shift), three_of(node.center))
    ho = three_of(node.half)
    hp = three_of(other.half)
    if beside_cone(d, three_of(node.axis), node.cosine, node.sine, ho, hp, pose.rotation, slack):
        return False
    axis = matvec(pose.rotation, three_of(other.axis))
    return not beside_cone(d, axis, other.cosine, other.sine, ho, hp, pose.rotation, slack)


@kernel(inline=True)
def tree_node(store, tree, k):
    """The NODE_BOUNDS of node k."""
    return node_at(store.pool, tree_at(store.table, tree).node_pool + NODE * k)


@kernel(inline=True)
def child_of(store, tree, k):
    """The first child of node k, or -1 - element."""
    return node_links_at(store.table, tree_at(store.table, tree).node_table + NODE_INTS * k).child


@kernel(inline=True)
def node_of(store, tree, e):
    """The NODE_BOUNDS of the node of element e."""
    element = element_at(store.pool, tree_at(store.table, tree).element_pool + ELEMENT * e)
    return tree_node(store, tree, np.int64(element.node))


@kernel(inline=True)
def rounding(store, trees, shift):
    """A bound of the rounding error of coordinates."""
    f, g = tree_node(store, trees[0], 0), tree_node(store, trees[1], 0)
    size = f.radius + g.radius
    c = three_of(f.center)
    e = three_of(g.center)
    size += math.sqrt(dot(c, c)) + math.sqrt(dot(e, e)) + math.sqrt(dot(shift, shift))
    return TREE_ROUNDING * size


@kernel(inner=True)
def pairs_about(store, trees, pose, reach, ring, tilt, stack, out):
    """Elements (k, 2) that may hold an extremal pair with |gap| <= reach at this pose, or at one near it; their number.

    Near are poses at which no point of either body is farther than `ring` from where it is now, seen from the other,
    and no unit vector farther than `tilt`: then the difference g - f of a pair's points is off by as much, and once
    more by what a cone, or the axes it is seen in, turned.

    Returns -1 if the stack (n, 2) is too short, and a number above the length of `out` if that is: it has the first.
    """
    tree_f, tree_g = trees
    slack = ring + rounding(store, trees, pose.shift)
    margin = Margin(reach + slack, slack, tilt + TREE_ROUNDING)
    view = view_of(pose)
    back = view_of(inverse_pose(pose))
    workspace = stack.shape[0]
    count = 0
    if workspace < 1:
        return -1
    g = tree_node(store, tree_g, 0)
    if not admits(tree_node(store, tree_f, 0), g, seen_from(view, g), view, margin):
        return 0
    stack[0, 0] = 0
    stack[0, 1] = 0
    used = 1
    while used > 0:
        used -= 1
        i = stack[used, 0]
        j = stack[used, 1]
        f = tree_node(store, tree_f, i)
        g = tree_node(store, tree_g, j)
        child_f = child_of(store, tree_f, i)
        child_g = child_of(store, tree_g, j)
        if child_f < 0 and child_g < 0:
            if facing(f, g, pose, slack + margin.tilt * margin.reach):
                if count < out.shape[0]:
                    out[count, 0] = -1 - child_f
                    out[count, 1] = -1 - child_g
                count += 1
            continue
        if used + 2 > workspace:
            return -1
        if child_g < 0 or (child_f >= 0 and f.radius >= g.radius):
            seen = seen_from(view, g)
            for k in range(child_f, child_f + 2):
                if admits(tree_node(store, tree_f, k), g, seen, view, margin):
                    stack[used, 0] = k
                    stack[used, 1] = j
                    used += 1
        else:
            seen = seen_from(back, f)
            for k in range(child_g, child_g + 2):
                if admits(tree_node(store, tree_g, k), f, seen, back, margin):
                    stack[used, 0] = i
                    stack[used, 1] = k
                    used += 1
    return count


@kernel(inner=True)
def pairs_within(store, trees, pose, reach, stack, out):
    """Elements (k, 2) of two trees that may hold an extremal pair with |gap| <= reach; see `pairs_about`."""
    return pairs_about(store, trees, pose, reach, 0.0, 0.0, stack, out)


@kernel(inner=True)
def still_within(store, trees, pose, reach, listed, count, out):
    """Those of `count` pairs of elements, listed in the table from `listed` on, that `pairs_within` would find.

    They are written to `out` as far as they fit; returns how many there are.
    """
    slack = rounding(store, trees, pose.shift)
    margin = Margin(reach + slack, slack, TREE_ROUNDING)
    view = view_of(pose)
    found = 0
    for k in range(count):
        e = store.table[listed + 2 * k]
        d = store.table[listed + 2 * k + 1]
        f = node_of(store, trees[0], e)
        g = node_of(store, trees[1], d)
        if admits(f, g, seen_from(view, g), view, margin) and facing(f, g, pose, slack):
            if found < out.shape[0]:
                out[found, 0] = e
                out[found, 1] = d
            found += 1
    return found


@kernel(signatures="(i8[::1], f8[::1], UniTuple(i8, 2), UniTuple(f8, 9), UniTuple(f8, 3), f8, i8[:, ::1], i8[:, ::1])")
def facing_pairs(table, pool, trees, rotation, shift, reach, stack, out):
    """`pairs_within` for Python."""
    return pairs_within(Store(table, pool), trees, RelativePose(rotation, shift), reach, stack, out)
