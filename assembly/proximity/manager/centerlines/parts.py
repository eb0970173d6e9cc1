"""Parts of two centerlines that are near each other: by a descent of their trees, or from a list of an earlier one."""

from __future__ import annotations

import math

import numpy as np

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
    """A lower bound of the distance of two parts: that of their middle tangents, less how far the parts bend."""
    part = centerline_part_at(pool, o)
    part_record = centerline_part_at(pool, p)
    h = part.half
    k = part_record.half
    d = sub(add(matvec(pose.rotation, three_of(part_record.point)), pose.shift), three_of(part.point))
    least = segment_distance(d, three_of(part.tangent), matvec(pose.rotation, three_of(part_record.tangent)), h, k)
    return least - 0.5 * (part.bend * h * h + part_record.bend * k * k) - BOX_ROUNDING


@kernel(inline=True)
def whole_box(store, centerlines, i, j, boxes, b):
    """Write box b: all of part i of f and all of part j of g, from end to end."""
    box = centerline_box_at(boxes, b)
    half_f = centerline_part_at(store.pool, centerline_at(store.table, centerlines[0]).part_pool + PART * i).half
    half_g = centerline_part_at(store.pool, centerline_at(store.table, centerlines[1]).part_pool + PART * j).half
    box.part_f, box.from_f, box.to_f = float(i), -half_f, half_f
    box.part_g, box.from_g, box.to_g = float(j), -half_g, half_g


@kernel(inner=True)
def descend(posed, reach, stack, out):
    """Parts (k, 2) of two centerlines that may be within a reach of each other.

    Returns how many, or -1 if an array is full; and a lower bound of the distance of all other parts.
    """
    store, pose = posed.store, posed.pose
    line = centerline_at(store.table, posed.centerlines[0])
    centerline = centerline_at(store.table, posed.centerlines[1])
    nodes_f = line.node_pool
    nodes_g = centerline.node_pool
    stack[0, 0] = 0
    stack[0, 1] = 0
    used = 1
    count = 0
    beyond = math.inf
    while used > 0:
        used -= 1
        i = stack[used, 0]
        j = stack[used, 1]
        o = nodes_f + BALL * i
        p = nodes_g + BALL * j
        apart = balls_apart(store.pool, o, p, pose)
        if apart > reach:
            beyond = min(beyond, apart)
            continue
        child_f = store.table[line.node_table + i]
        child_g = store.table[centerline.node_table + j]
        if child_f < 0 and child_g < 0:
            part_f = np.int64(-1 - child_f)
            part_g = np.int64(-1 - child_g)
            apart = parts_apart(store.pool, line.part_pool + PART * part_f, centerline.part_pool + PART * part_g, pose)
            if apart > reach:
                beyond = min(beyond, apart)
                continue
            if count == out.shape[0]:
                return -1, 0.0
            out[count, 0] = part_f
            out[count, 1] = part_g
            count += 1
            continue
        if used + 2 > stack.shape[0]:
            return -1, 0.0
        down_f = child_g < 0 or (child_f >= 0 and ball_at(store.pool, o).radius >= ball_at(store.pool, p).radius)
        for k in range(2):
            stack[used, 0] = child_f + k if down_f else i
            stack[used, 1] = j if down_f else child_g + k
            used += 1
    return count, beyond


@kernel(inner=True)
def parts_beyond(posed, reach, stack, out):
    """A lower bound of the distance of two centerlines of which no parts are within a reach of each other."""
    return descend(posed, reach, stack, out)[1]


@kernel(inner=True)
def near_parts(posed, at, p, moving, reach, skin, workspace):
    """Boxes of parts of two centerlines that are within a reach of each other; how many, or -1 if an array is full.

    They are taken from the neighbor list at `at` while it is valid, as patches are in `neighbor_list.listed_pairs`.
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
