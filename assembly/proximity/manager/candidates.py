"""Pairs of patches of two bodies that face each other: which are within a look's reach, and how near they are.

They are found by a descent of both trees (`proximity/bvh/tree.py`), or sifted from a list of an earlier one
(`neighbor_list.py`). Where many are near, only the nearest are looked into; a bound on the others tells how far bodies
may go.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.vec import add, dot, scale, sub
from assembly.kinematics.motion import RelativePose
from assembly.proximity.bvh.neighbor_list import LIST_INTS, listed_pairs
from assembly.proximity.bvh.tree import (
    ELEMENT,
    NODE,
    box_distance,
    element_at,
    magnitudes,
    node_at,
    pairs_within,
    seen_from,
    three_of,
    tree_at,
)
from assembly.proximity.manager.motion_bounds import LEAST_ALLOWANCE
from assembly.proximity.manager.state import (
    PAIR_RECORD,
    TAKE,
    lengths_at,
    manager_at,
    memory_header_at,
    pair_at,
    pair_lengths_at,
)

# Lists of patches that face each other are for motions up to so many first reaches.
RINGS = 2.0
# So many pairs of patches are looked into, if there are others that are farther apart; in a crowd, all that are nearer
# than this part of what a ball may go where contacts may be born. Less makes looks cheaper and steps shorter.
FEW, CROWDED_PART = 40, 0.5


@kernel(inline=True)
def element_ball(store, tree, e):
    """Center and radius of a ball around an element, in the axes of its body."""
    tree_record = tree_at(store.table, tree)
    o = tree_record.node_pool + NODE * np.int64(element_at(store.pool, tree_record.element_pool + ELEMENT * e).node)
    return three_of(node_at(store.pool, o).center), node_at(store.pool, o).radius


@kernel(inline=True)
def along_normal(pool, o, p, axis_g, apart, n):
    """How far a patch g is from a patch f along a unit normal n from f to g: their middles, and how thick they are.

    A patch leaves its plane by no more than its radius times the sine of the angle by which its normals turn.
    """
    node = node_at(pool, o)
    node_bounds = node_at(pool, p)
    off_f = sub(n, three_of(node_at(pool, o).axis))
    off_g = add(n, axis_g)
    thick = node.radius * (node.sine + math.sqrt(dot(off_f, off_f)))
    thick += node_bounds.radius * (node_bounds.sine + math.sqrt(dot(off_g, off_g)))
    return dot(n, apart), thick


@kernel(inner=True)
def element_distance(store, trees, pose, bulk, e, d):
    """About the least distance of two elements: that of their boxes, or along a normal of theirs.

    Where they are in the wrong order along one by more than they are thick, the bodies are in each other, or these are
    far sides: -inf. The normals are those of their middles, and the mean: a large flat patch is thin along its own.
    """
    tree = tree_at(store.table, trees[0])
    tree_record = tree_at(store.table, trees[1])
    o = tree.node_pool + NODE * np.int64(element_at(store.pool, tree.element_pool + ELEMENT * e).node)
    p = tree_record.node_pool + NODE * np.int64(element_at(store.pool, tree_record.element_pool + ELEMENT * d).node)
    seen = seen_from(store.pool, p, pose.rotation, bulk, pose.shift)
    distance = math.sqrt(box_distance(store.pool, o, p, seen, pose.rotation, bulk))
    if node_at(store.pool, o).cosine <= 0.0 or node_at(store.pool, p).cosine <= 0.0:
        return distance
    apart = sub(seen[0], three_of(node_at(store.pool, o).center))
    axis = three_of(node_at(store.pool, o).axis)
    mean = sub(axis, seen[2])
    length = math.sqrt(dot(mean, mean))
    if length < 1.0:
        return distance
    for n in (scale(1.0 / length, mean), axis, scale(-1.0, seen[2])):
        along, thick = along_normal(store.pool, o, p, seen[2], apart, n)
        if along < -thick:
            return -math.inf
        distance = max(distance, along - thick)
    return distance


@kernel(inner=True)
def candidate_pairs(store, watch, memory, p, posed, moving, reach, stack, candidates):
    """The patches of the two bodies of pair p that face each other within its reach, into `candidates`.

    Returns how many pairs there are, and the reach: it is less where there is no room for all.
    """
    manager = manager_at(store.table, watch)
    pair = manager.pair_table + PAIR_RECORD * p
    turn, shift, trees = posed.pose.rotation, posed.pose.shift, posed.trees
    least = pair_lengths_at(store.pool, pair_at(store.table, pair).minimum).least
    found = np.int64(-1)
    lists = manager.lists
    ring = RINGS * lengths_at(store.pool, manager.lengths).first_reach
    if lists > 0 and reach <= ring:
        at_list = manager.list_table + LIST_INTS * (p % lists)
        found = listed_pairs(
            store, at_list, p, trees, RelativePose(turn, shift), moving, reach + least, ring, stack, candidates
        )
    while not 0 <= found <= candidates.shape[0]:
        found = pairs_within(store, trees[0], trees[1], RelativePose(turn, shift), reach + least, stack, candidates)
        if 0 <= found <= candidates.shape[0]:
            break
        if reach < LEAST_ALLOWANCE:
            # There is no room for what is as near as it should not be.
            found = candidates.shape[0] if found > 0 else 0
            memory_header_at(memory, 0).crowded = 1.0
            break
        # Out of room: what is nearer is looked at more often.
        reach *= 0.5
    return found, reach


@kernel(inner=True)
def near_enough(store, posed, least, reach, flank, candidates, found, distances):
    """A distance within which so few of the pairs of patches are that each can be looked into; fills `distances`.

    What is within a part of the flank, or in the wrong order, is looked into in any case.
    """
    bulk = magnitudes(posed.pose.rotation)
    enough = max(TAKE * reach, flank)
    lowest = CROWDED_PART * flank
    for c in range(found):
        distances[c] = (
            element_distance(store, posed.trees, posed.pose, bulk, candidates[c, 0], candidates[c, 1]) - least
        )
    for _ in range(6):
        count = 0
        for c in range(found):
            if -math.inf < distances[c] <= enough:
                count += 1
        if count <= FEW or enough <= lowest:
            break
        enough = max(0.5 * enough, lowest)
    return enough


@kernel(inline=True)
def around(store, tree, e, lo, hi):
    """A box (lo, hi) made larger so that the ball around an element is in it."""
    center, radius = element_ball(store, tree, e)
    return (
        (min(lo[0], center[0] - radius), min(lo[1], center[1] - radius), min(lo[2], center[2] - radius)),
        (max(hi[0], center[0] + radius), max(hi[1], center[1] + radius), max(hi[2], center[2] + radius)),
    )
