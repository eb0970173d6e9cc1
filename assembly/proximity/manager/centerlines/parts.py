"""Parts of two centerlines that are near each other: by a descent of their trees, or from a list of an earlier one."""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._descent import NONE, STOP, descend_pairs
from assembly._kernel import kernel
from assembly.geometry.vec import add, dot, matvec, sub
from assembly.proximity.bvh.neighbor_list import (
    ENTRIES,
    ENTRY,
    ListKey,
    can_be_listed,
    moved_since,
    neighbor_list_at,
    neighbors_at,
    reaches,
    write_list,
)
from assembly.proximity.bvh.tree import three_of
from assembly.proximity.manager.centerlines.box import BOX_ROUNDING, centerline_box_at, segment_distance
from assembly.proximity.manager.wires import BALL, PART, ball_at, centerline_at, centerline_part_at


@kernel(inline=True)
def balls_apart(pool, o, p, pose):
    """How far the balls at o and at p are apart, negative where they meet."""
    f, g = ball_at(pool, o), ball_at(pool, p)
    d = sub(add(matvec(pose.rotation, three_of(g.center)), pose.shift), three_of(f.center))
    return math.sqrt(dot(d, d)) - f.radius - g.radius


@kernel(inline=True)
def parts_apart(pool, o, p, pose):
    """A lower bound of the distance of the parts at o of f and at p of g: that of their tangents in the middle."""
    part = centerline_part_at(pool, o)
    part_record = centerline_part_at(pool, p)
    h = part.half
    k = part_record.half
    d = sub(add(matvec(pose.rotation, three_of(part_record.point)), pose.shift), three_of(part.point))
    least = segment_distance(d, three_of(part.tangent), matvec(pose.rotation, three_of(part_record.tangent)), h, k)
    return least - 0.5 * (part.bend * h * h + part_record.bend * k * k) - BOX_ROUNDING


@kernel(inline=True)
def whole_box(store, centerlines, i, j, boxes, b):
    """Box b: the whole parts i of f and j of g, from and to their ends."""
    box = centerline_box_at(boxes, b)
    half_f = centerline_part_at(store.pool, centerline_at(store.table, centerlines[0]).part_pool + PART * i).half
    half_g = centerline_part_at(store.pool, centerline_at(store.table, centerlines[1]).part_pool + PART * j).half
    box.part_f, box.from_f, box.to_f = float(i), -half_f, half_f
    box.part_g, box.from_g, box.to_g = float(j), -half_g, half_g


# A walk down the trees of two centerlines. out: room for pairs of parts (n, 2).
CenterlineWalk = namedtuple("CenterlineWalk", "posed reach out")


@kernel(inline=True)
def near_below(walk, i, j, found):
    """A step down to parts within a reach; found: how many, -1 without room, and how far all others are beyond."""
    count, beyond = found
    store, pose = walk.posed.store, walk.posed.pose
    f, g = centerline_at(store.table, walk.posed.centerlines[0]), centerline_at(store.table, walk.posed.centerlines[1])
    o, p = f.node_pool + BALL * i, g.node_pool + BALL * j
    apart = balls_apart(store.pool, o, p, pose)
    child_f, child_g = store.table[f.node_table + i], store.table[g.node_table + j]
    leaves = child_f < 0 and child_g < 0
    if leaves and apart <= walk.reach:
        at_f, at_g = f.part_pool + PART * (-1 - child_f), g.part_pool + PART * (-1 - child_g)
        apart = parts_apart(store.pool, at_f, at_g, pose)
    if apart > walk.reach:
        return (count, min(beyond, apart)), True, NONE, NONE
    if leaves:
        if count == walk.out.shape[0]:
            return (-1, 0.0), True, NONE, STOP
        walk.out[count, 0] = -1 - child_f
        walk.out[count, 1] = -1 - child_g
        return (count + 1, beyond), True, NONE, NONE
    on_f = child_g < 0 or (child_f >= 0 and ball_at(store.pool, o).radius >= ball_at(store.pool, p).radius)
    child = child_f if on_f else child_g
    return found, on_f, child, child + 1


descend_near = kernel(inner=True)(descend_pairs(near_below))


@kernel(inner=True)
def descend(posed, reach, stack, out):
    """Parts (k, 2) of two centerlines that may be within a reach of each other.

    Returns how many, or -1 where there is no room; and how far all others are beyond.
    """
    found, fits = descend_near(CenterlineWalk(posed, reach, out), (0, math.inf), stack)
    return found if fits else (-1, 0.0)


@kernel(inner=True)
def parts_beyond(posed, reach, stack, out):
    """How far two centerlines are apart at least, where no parts of them are within a reach of each other."""
    return descend(posed, reach, stack, out)[1]


@kernel(inner=True)
def near_parts(posed, at, p, moving, reach, skin, workspace):
    """Boxes of parts of two centerlines that are within a reach of each other; how many, or -1 where there is no room.

    From the list at `at`, as `neighbor_list.listed_pairs` has patches.
    """
    store, pose, centerlines = posed.store, posed.pose, posed.centerlines
    stack, out, boxes = workspace.stack, workspace.pairs, workspace.boxes
    parts_f = centerline_at(store.table, centerlines[0]).part_pool
    parts_g = centerline_at(store.table, centerlines[1]).part_pool
    key = ListKey(at, p, moving)
    fits = reaches(store.table, at, moved_since(store, key), reach)
    if fits == 0 and can_be_listed(store, moving, skin + reach):
        count, _beyond = descend(posed, reach + skin, stack, out)
        fits = 1 if write_list(store, key, reach, skin, out, count) else -1
    if fits == 1:
        many = neighbor_list_at(store.table, at).count
        for k in range(many):
            entry = neighbors_at(store.table, at + ENTRIES + ENTRY * k)
            out[k, 0] = entry.f
            out[k, 1] = entry.g
    else:
        many, _beyond = descend(posed, reach, stack, out)
    count = 0
    for k in range(many):
        i, j = out[k, 0], out[k, 1]
        if parts_apart(store.pool, parts_f + PART * i, parts_g + PART * j, pose) > reach:
            continue
        if count == boxes.shape[0]:
            return -1
        whole_box(store, centerlines, i, j, boxes, count)
        count += 1
    return count if many >= 0 else -1
