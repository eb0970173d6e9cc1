"""Pairs of patches that may face each other, kept from look to look of a pair of bodies.

A descent of two trees (`bounding_tree.py`) finds pairs of patches for one pose. One that allows for a ring of poses
finds all that any of them has, and not many more: what a look at one of these poses finds is sifted from the list. A
list is a function of shapes and of the pose that it was made for, whoever asks; there are a few of them in the table,
and pairs of bodies take turns.

In the table: the pair it is for (-1: none), how many (-1: more than there is room for), the pose it is for (the turn's
quaternion, the middle of the tree of the body that moves), how far that may go from there, the reach, elements (k, 2).
Lengths are multiples of GRAIN there: the pool is shared by all who solve a scene at the same time, and a table is one's
own.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.vec import add, dot, matvec, sub
from assembly.proximity.bounding_tree import CENTER, NODE_POOL, RADIUS, pairs_about, still_within, three

OWNER, COUNT, TURN, PLACE, RING, REACH, ENTRIES, ROOM = 0, 1, 2, 6, 9, 10, 11, 512
LIST_INTS = ENTRIES + 2 * ROOM
# Multiples of this are within it of what they stand for; a list is not made for what is farther away than FAR.
GRAIN, FAR = 2.0**-48, 1000.0


@kernel(inner=True)
def listed_pairs(table, pool, at, p, trees, turn, shift, moving, reach, ring, stack, candidates):
    """What `pairs_within` finds, from the list at `at`, which is made anew where it does not reach.

    The pose is that of g seen from f; `moving` is the body whose motion is measured (`allowances.mover`), and a new
    list is for motions of it up to `ring`. -1 where there is no room for a list.
    """
    _side, tree, e, rotation, place = moving
    root = table[tree + NODE_POOL]
    middle = add(matvec(rotation, three(pool, root + CENTER)), place)
    radius = pool[root + RADIUS]
    if table[at + OWNER] == p:
        square = 0.0
        other = 0.0
        for k in range(4):
            was = GRAIN * table[at + TURN + k]
            square += (e[k] - was) * (e[k] - was)
            other += (e[k] + was) * (e[k] + was)
        way = sub(middle, (GRAIN * table[at + PLACE], GRAIN * table[at + PLACE + 1], GRAIN * table[at + PLACE + 2]))
        moved = math.sqrt(dot(way, way)) + 2.0 * radius * math.sqrt(min(square, other))
        if moved <= GRAIN * table[at + RING]:
            if table[at + COUNT] < 0:
                return -1
            if reach + moved <= GRAIN * (table[at + REACH] + table[at + RING]):
                return still_within(
                    table, pool, trees[0], trees[1], turn, shift, reach, at + ENTRIES, table[at + COUNT], candidates
                )
    if not (dot(middle, middle) < FAR * FAR and ring + reach < FAR and radius < FAR):
        return -1
    count = pairs_about(table, pool, trees[0], trees[1], turn, shift, reach, ring, ring / radius, stack, candidates)
    table[at + OWNER] = p
    for k in range(4):
        table[at + TURN + k] = np.int64(e[k] / GRAIN)
    for k in range(3):
        table[at + PLACE + k] = np.int64(middle[k] / GRAIN)
    # Less by more than what the pose is rounded by, at a radius of FAR.
    table[at + RING] = np.int64((ring - 1e-10) / GRAIN)
    table[at + REACH] = np.int64(reach / GRAIN)
    if count < 0 or count > ROOM or count > candidates.shape[0]:
        table[at + COUNT] = -1
        return -1
    table[at + COUNT] = count
    for k in range(count):
        table[at + ENTRIES + 2 * k] = candidates[k, 0]
        table[at + ENTRIES + 2 * k + 1] = candidates[k, 1]
    return still_within(table, pool, trees[0], trees[1], turn, shift, reach, at + ENTRIES, count, candidates)
