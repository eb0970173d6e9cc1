"""Candidate pairs: patches of two bodies that face each other within the query margin, and how near they are.

They are found by a descent of both trees (`proximity/bvh/tree.py`), or sifted from a list of an earlier one
(`neighbor_list.py`). Where many are near, only the nearest are searched; a bound on the others limits the motion bound.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.vec import add, dot, scale, sub
from assembly.proximity.bvh.box_descent import box_distance
from assembly.proximity.bvh.neighbor_list import LIST_INTS, ListKey, listed_pairs
from assembly.proximity.bvh.tree import node_of, pairs_within, seen_from, three_of, view_of
from assembly.proximity.manager.parameters import CROWDED_PART, FEW, LEAST_MOTION_BOUND, SKIN, TAKE
from assembly.proximity.manager.records import header_of, lengths_of, pair_lengths_of, record_of


@kernel(inline=True)
def element_ball(store, tree, e):
    """Center and radius of a ball around an element, in the axes of its body."""
    node = node_of(store, tree, e)
    return three_of(node.center), node.radius


@kernel(inline=True)
def along_normal(f, g, axis_g, apart, n):
    """How far apart two patches are along a unit normal n from f to g: their middles' distance, and their thickness.

    A patch leaves its plane by no more than its radius times the sine of the angle by which its normals turn.
    """
    off_f = sub(n, three_of(f.axis))
    off_g = add(n, axis_g)
    thick = f.radius * (f.sine + math.sqrt(dot(off_f, off_f)))
    thick += g.radius * (g.sine + math.sqrt(dot(off_g, off_g)))
    return dot(n, apart), thick


@kernel(inner=True)
def element_distance(posed, view, e, d):
    """About the least distance of two elements: that of their boxes, or along a normal of theirs.

    It is -inf where g is behind f along one of them by more than their thickness: then the bodies cross, or these are
    far sides. The normals are those of their middles, and the mean: a large flat patch is thin along its own.
    """
    f, g = node_of(posed.store, posed.trees[0], e), node_of(posed.store, posed.trees[1], d)
    seen = seen_from(view, g)
    distance = math.sqrt(box_distance(f, g, seen, view))
    if f.cosine <= 0.0 or g.cosine <= 0.0:
        return distance
    apart = sub(seen[0], three_of(f.center))
    axis = three_of(f.axis)
    mean = sub(axis, seen[2])
    length = math.sqrt(dot(mean, mean))
    if length < 1.0:
        return distance
    for n in (scale(1.0 / length, mean), axis, scale(-1.0, seen[2])):
        along, thick = along_normal(f, g, seen[2], apart, n)
        if along < -thick:
            return -math.inf
        distance = max(distance, along - thick)
    return distance


# Pairs of patches that face each other. pairs: the first `found` rows, (k, 2); distances: about how far they are apart,
# less the least gap, (k,).
Candidates = namedtuple("Candidates", "pairs distances found")


@kernel(inner=True)
def candidate_pairs(manager, p, posed, moving, margin, stack, pairs):
    """The patches of the two bodies of pair p that face each other within its query margin, into `pairs`.

    Returns how many there are, and the margin: it is less where there is no room for all.
    """
    store, pose, trees = manager.store, posed.pose, posed.trees
    record = record_of(manager)
    least = pair_lengths_of(manager, p).least
    found = np.int64(-1)
    skin = SKIN * lengths_of(manager).least_margin
    if record.lists > 0 and margin <= skin:
        key = ListKey(record.list_table + LIST_INTS * (p % record.lists), p, moving)
        found = listed_pairs(store, key, trees, pose, margin + least, skin, stack, pairs)
    while not 0 <= found <= pairs.shape[0]:
        found = pairs_within(store, trees, pose, margin + least, stack, pairs)
        if 0 <= found <= pairs.shape[0]:
            break
        if margin < LEAST_MOTION_BOUND:
            # There is no memory for a contact that violates its least gap.
            found = pairs.shape[0] if found > 0 else 0
            header_of(manager).crowded = 1.0
            break
        # Out of memory: the motion bound is shorter, and the pair is updated more often.
        margin *= 0.5
    return found, margin


@kernel(inner=True)
def near_enough(posed, least, margin, curved_bound, candidates):
    """A distance within which few enough pairs of patches are that each can be searched; fills their distances.

    Pairs within a part of the curvature-limited motion bound, or in the wrong order, are searched in any case.
    """
    pairs, distances = candidates.pairs, candidates.distances
    view = view_of(posed.pose)
    enough = max(TAKE * margin, curved_bound)
    lowest = CROWDED_PART * curved_bound
    for c in range(candidates.found):
        distances[c] = element_distance(posed, view, pairs[c, 0], pairs[c, 1]) - least
    for _ in range(6):
        count = 0
        for c in range(candidates.found):
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
