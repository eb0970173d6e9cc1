"""Pairs of points through which bodies with flush faces seem to be in each other: a head on a plate, beside its hole.

Where a face lies on another one, the pair of an edge of one and of a wall beside it may have normals that oppose each
other and a negative gap: the rim of a head is behind the wall of the hole that it covers. The segment between its
points runs between the two faces. The way apart there is off the faces, which is next to nothing, and they have rows of
their own; that of the pair would lead along them.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.vec import add, dot, matvec, matvec_t, scale, sub
from assembly.proximity.bvh.tree import (
    NODE,
    NODE_INTS,
    node_at,
    node_links_at,
    three_of,
    tree_at,
)
from assembly.proximity.manager.extrema import LISTED, NEW, USELESS, extremum_at
from assembly.proximity.manager.overlap import DEPTH, projection_at, with_children
from assembly.proximity.manager.state import (
    HANDED_OFF,
    LOST,
    PLACE_MEMORY,
    memory_places,
    note,
    place_at,
    release,
)

# Faces are flush at a pair where they are nearer to its middle than this part of how deep it is,
SHORT = 1e-3
# and their normals oppose each other but for this cosine.
OPPOSED = 1e-6
# Depths that are rounding, and room for faces about a point.
ROUNDING, FACES_ABOUT = 1e-9, 16


@kernel(inner=True)
def faces_about(store, tree, shell, y, reach, stack, normals):
    """Write the normals of a body's faces that are within reach of a point; how many there are. In its axes."""
    tree_record = tree_at(store.table, tree)
    stack[0] = 0
    used = 1
    count = 0
    while used > 0 and count < normals.shape[0]:
        used -= 1
        i = stack[used]
        o = node_at(store.pool, tree_record.node_pool + NODE * i)
        square = 0.0
        for k in range(3):
            off = max(abs(y[k] - o.center[k]) - o.half[k], 0.0)
            square += off * off
        if square > reach * reach:
            continue
        child = node_links_at(store.table, tree_record.node_table + NODE_INTS * i).child
        if child >= 0:
            used = with_children(stack, used, child)
            continue
        distance, n, some = projection_at(store, tree, -1, shell, -1 - child, y)
        if some and abs(distance) <= reach:
            normals[count, 0], normals[count, 1], normals[count, 2] = n
            count += 1
    return count


@kernel(inner=True)
def is_between_flush_faces(store, posed, extrema, k, stack, normals):
    """Whether the middle of root k, with a negative gap, is between two faces that all but touch there."""
    extremum = extremum_at(extrema, k)
    turn, shift = posed.pose.rotation, posed.pose.shift
    a, b = three_of(extremum.point_f), three_of(extremum.point_g)
    c = scale(0.5, add(a, b))
    reach = -SHORT * extremum.gap
    many = faces_about(store, posed.trees[0], posed.shells[0], c, reach, stack, normals[0])
    if many == 0:
        return False
    others = faces_about(
        store, posed.trees[1], posed.shells[1], matvec_t(turn, sub(c, shift)), reach, stack, normals[1]
    )
    for i in range(others):
        n = matvec(turn, (normals[1, i, 0], normals[1, i, 1], normals[1, i, 2]))
        for l in range(many):
            if dot(n, (normals[0, l, 0], normals[0, l, 1], normals[0, l, 2])) < OPPOSED - 1.0:
                return True
    return False


@kernel(inner=True, allocates=True)
def drop_flush(store, watch, memory, p, posed, extrema, count, tracked):
    """Make those roots of pair p useless that run between flush faces; listed ones give up their places."""
    stack = np.empty(DEPTH, np.int64)
    normals = np.empty((2, FACES_ABOUT, 3))
    places = memory_places(store.table, watch)[1]
    for k in range(count):
        extremum = extremum_at(extrema, k)
        origin = np.int64(extremum.origin)
        if not extremum.gap < -ROUNDING or not (extremum.origin == NEW or origin >= LISTED):
            continue
        if not is_between_flush_faces(store, posed, extrema, k, stack, normals):
            continue
        if origin >= LISTED:
            number = place_at(memory, places + PLACE_MEMORY * (origin - LISTED)).number
            note(store.table, watch, memory, HANDED_OFF, LOST, p, number, extremum.gap)
            release(store.table, watch, memory, origin - LISTED, tracked)
        extremum.origin = USELESS


@kernel(inner=True)
def any_deep(extrema, count):
    """Whether any root is deeper than rounding."""
    for k in range(count):
        extremum = extremum_at(extrema, k)
        if extremum.gap < -ROUNDING and extremum.origin != USELESS:
            return True
    return False
