"""Descents of two trees by their boxes alone: a lower bound of their distance, and elements whose boxes meet."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.vec import matvec_t, sub
from assembly.kinematics.motion import RelativePose, inverse_pose
from assembly.proximity.bvh.tree import child_of, excess, rounding, seen_from, three_of, tree_node, view_of


@kernel(inline=True)
def box_distance(node, other, seen, view):
    """The square of a lower bound of the distance of the boxes of two nodes; see `admits`."""
    ho = three_of(node.half)
    d = sub(seen[0], three_of(node.center))
    along = excess(d, ho, seen[1])
    return max(along, excess(matvec_t(view.rotation, d), matvec_t(view.bulk, ho), three_of(other.half)))


@kernel(inner=True)
def overlapping(store, trees, pose, stack, out):
    """Elements (k, 2) of two trees whose boxes meet; how many `out` holds of them."""
    tree_f, tree_g = trees
    view = view_of(pose)
    count = 0
    stack[0, 0] = 0
    stack[0, 1] = 0
    used = 1
    while used > 0 and count < out.shape[0]:
        used -= 1
        i = stack[used, 0]
        j = stack[used, 1]
        f = tree_node(store, tree_f, i)
        g = tree_node(store, tree_g, j)
        if box_distance(f, g, seen_from(view, g), view) > 0.0:
            continue
        child_f = child_of(store, tree_f, i)
        child_g = child_of(store, tree_g, j)
        if child_f < 0 and child_g < 0:
            out[count, 0] = -1 - child_f
            out[count, 1] = -1 - child_g
            count += 1
        elif used + 2 <= stack.shape[0]:
            down_f = child_g < 0 or (child_f >= 0 and f.radius >= g.radius)
            for k in range(2):
                stack[used, 0] = child_f + k if down_f else i
                stack[used, 1] = j if down_f else child_g + k
                used += 1
    return count


@kernel(inner=True)
def least_distance(store, trees, pose, upper, stack):
    """A lower bound of the distance of two trees' elements, at most `upper`: that of their boxes.

    A stack (n, 2) that is too short makes the bound lower, not wrong.
    """
    tree_f, tree_g = trees
    slack = rounding(store, trees, pose.shift)
    view = view_of(pose)
    back = view_of(inverse_pose(pose))
    workspace = stack.shape[0]
    best = (upper + slack) * (upper + slack)
    if workspace < 1:
        return 0.0
    stack[0, 0] = 0
    stack[0, 1] = 0
    used = 1
    while used > 0:
        used -= 1
        i = stack[used, 0]
        j = stack[used, 1]
        f = tree_node(store, tree_f, i)
        g = tree_node(store, tree_g, j)
        seen = seen_from(view, g)
        bound = box_distance(f, g, seen, view)
        # A distance found since the pair was pushed may exclude it.
        if bound >= best:
            continue
        child_f = child_of(store, tree_f, i)
        child_g = child_of(store, tree_g, j)
        if (child_f < 0 and child_g < 0) or used + 2 > workspace:
            best = bound
            continue
        descend_f = child_g < 0 or (child_f >= 0 and f.radius >= g.radius)
        if descend_f:
            one = box_distance(tree_node(store, tree_f, child_f), g, seen, view)
            other = box_distance(tree_node(store, tree_f, child_f + 1), g, seen, view)
        else:
            seen = seen_from(back, f)
            one = box_distance(tree_node(store, tree_g, child_g), f, seen, back)
            other = box_distance(tree_node(store, tree_g, child_g + 1), f, seen, back)
        # The nearer child is pushed last, and so visited first.
        near = 0 if one <= other else 1
        for k in range(2):
            side = near if k == 1 else 1 - near
            if (one if side == 0 else other) < best:
                stack[used, 0] = child_f + side if descend_f else i
                stack[used, 1] = j if descend_f else child_g + side
                used += 1
    return max(math.sqrt(best) - slack, 0.0)


@kernel(signatures="(i8[::1], f8[::1], UniTuple(i8, 2), UniTuple(f8, 9), UniTuple(f8, 3), f8, i8[:, ::1])")
def tree_distance(table, pool, trees, rotation, shift, upper, stack):
    """`least_distance` for Python."""
    return least_distance(Store(table, pool), trees, RelativePose(rotation, shift), upper, stack)
