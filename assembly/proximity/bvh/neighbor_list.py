"""Pairs of patches that may face each other, or of parts of spines, kept from update to update (a Verlet list).

A descent of two trees (`proximity/bvh/tree.py`, `proximity/manager/centerlines/parts.py`) finds pairs for one pose. A
descent that allows for a skin finds the pairs of all poses within the skin, and not many more; those of one of these
poses are then selected from the list. A list depends only on the shapes and on the pose that it was made for. There are
a few lists in the table, and pairs of bodies take turns.

Lists are in the table, with lengths as integer multiples of GRAIN: the pool is shared by all solvers of a scene, but
each has a table of its own.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.geometry.vec import add, dot, matvec, sub
from assembly.proximity.bvh.tree import pairs_about, still_within, three_of, tree_node

# A list in the table. Lengths are multiples of GRAIN; pairs of elements (k, 2) follow.
NEIGHBOR_LIST = record_dtype(
    "i8",
    owner=1,  # the pair of bodies it is for; -1: none
    count=1,  # number of entries; -1: more than there is room for
    turn=4,  # the pose it is for: quaternion of the body that moves
    place=3,  # and the middle of its tree
    skin=1,  # how far that body may move from there
    margin=1,  # query margin
)
neighbor_list_at = record_view(NEIGHBOR_LIST)
ENTRIES = size_of(NEIGHBOR_LIST)
# An entry: elements of the two bodies that may be near.
NEIGHBORS = record_dtype("i8", f=1, g=1)
neighbors_at = record_view(NEIGHBORS)
ENTRY = size_of(NEIGHBORS)
# Room for entries, and integers of a list.
ROOM = 512
LIST_INTS = ENTRIES + ENTRY * ROOM
# The unit of the lengths that a list stores as integers; and the distance beyond which no list is made.
GRAIN, FAR = 2.0**-48, 1000.0


# Which list it is, and who asks for it. at: where it is in the table; owner: the number of a pair of bodies; moving:
# the one whose motion is measured (`manager/motion_bounds.Mover`).
ListKey = namedtuple("ListKey", "at owner moving")


@kernel(inner=True)
def moved_since(store, key):
    """A bound of how far the body has moved since its list was made; infinite if the list is another pair's."""
    neighbors = neighbor_list_at(store.table, key.at)
    moving = key.moving
    if neighbors.owner != key.owner:
        return math.inf
    root = tree_node(store, moving.tree, 0)
    middle = add(matvec(moving.turn, three_of(root.center)), moving.shift)
    e = moving.quaternion
    square = 0.0
    other = 0.0
    for k in range(4):
        was = GRAIN * neighbors.turn[k]
        square += (e[k] - was) * (e[k] - was)
        other += (e[k] + was) * (e[k] + was)
    way = sub(middle, (GRAIN * neighbors.place[0], GRAIN * neighbors.place[1], GRAIN * neighbors.place[2]))
    return math.sqrt(dot(way, way)) + 2.0 * root.radius * math.sqrt(min(square, other))


@kernel(inner=True)
def reaches(table, at, moved, margin):
    """1 if the list at `at` has all pairs within a margin after a motion by `moved`; 0 if not; -1 if it had no room."""
    neighbors = neighbor_list_at(table, at)
    if moved > GRAIN * neighbors.skin:
        return 0
    if neighbors.count < 0:
        return -1
    return 1 if margin + moved <= GRAIN * (neighbors.margin + neighbors.skin) else 0


@kernel(inner=True)
def can_be_listed(store, moving, margin):
    """Whether lengths of a list are in its range."""
    root = tree_node(store, moving.tree, 0)
    middle = add(matvec(moving.turn, three_of(root.center)), moving.shift)
    return dot(middle, middle) < FAR * FAR and margin < FAR and root.radius < FAR


@kernel(inner=True)
def write_list(store, key, margin, skin, found, count):
    """Store `count` pairs (k, 2), found for motions up to `skin`; none if they do not fit. Whether they did."""
    moving = key.moving
    neighbors = neighbor_list_at(store.table, key.at)
    root = tree_node(store, moving.tree, 0)
    middle = add(matvec(moving.turn, three_of(root.center)), moving.shift)
    neighbors.owner = key.owner
    for k in range(4):
        neighbors.turn[k] = np.int64(moving.quaternion[k] / GRAIN)
    for k in range(3):
        neighbors.place[k] = np.int64(middle[k] / GRAIN)
    # Reduced by more than the rounding of the pose moves a point at a radius of FAR.
    neighbors.skin = np.int64((skin - 1e-10) / GRAIN)
    neighbors.margin = np.int64(margin / GRAIN)
    if count < 0 or count > ROOM or count > found.shape[0]:
        neighbors.count = -1
        return False
    neighbors.count = count
    for k in range(count):
        entry = neighbors_at(store.table, key.at + ENTRIES + ENTRY * k)
        entry.f = found[k, 0]
        entry.g = found[k, 1]
    return True


@kernel(inner=True)
def listed_pairs(store, key, trees, pose, margin, skin, stack, candidates):
    """What `pairs_within` finds, from the list of a `ListKey`, which is made anew if it lacks some.

    The pose is that of g seen from f; a new list is for motions up to `skin`. -1 where there is no room for a list.
    """
    fits = reaches(store.table, key.at, moved_since(store, key), margin)
    if fits < 0 or (fits == 0 and not can_be_listed(store, key.moving, skin + margin)):
        return -1
    if fits == 0:
        tilt = skin / tree_node(store, key.moving.tree, 0).radius
        count = pairs_about(store, trees, pose, margin, skin, tilt, stack, candidates)
        if not write_list(store, key, margin, skin, candidates, count):
            return -1
    count = neighbor_list_at(store.table, key.at).count
    return still_within(store, trees, pose, margin, key.at + ENTRIES, count, candidates)
