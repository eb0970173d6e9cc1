"""The nearest points of two shells over all their faces, edges and vertices, by branch and bound.

Nearest points are an extremum of some pair of features inside both. Two trees of balls
(`proximity/features/ball_tree.py`) are descended
together, the pair of nodes with the least bound of its distance first. A pair of cells is given up when

- its bound (`proximity/features/quadratic_model.py`) is not below the least distance known,
- no normal of one is parallel to one of the other, or the distance changes monotonically over one of them: then
  no extremum of these two features is in it,
- it is small, and an extremum found is its own: relative curvature cannot change its sign as far as from there,

else Newton's method looks for an extremum from its middle, and the larger cell is cut. What is known to be feasible,
an extremum or a sample inside the trims, lowers the least distance. Shells that cross are at distance zero; their
crossing points are found by Newton's method for d = 0, and the search ends.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.geometry.vec import dot, sub
from assembly.kinematics.motion import IDENTITY
from assembly.proximity.brep.records import FACE, VERTEX, Feature, face_at
from assembly.proximity.bvh.tree import three_of
from assembly.proximity.extrema.crossing import crossing_point
from assembly.proximity.extrema.face_face import CONVERGED, SINGULAR, solve_pair
from assembly.proximity.extrema.feature_pair import solve_features
from assembly.proximity.features.ball_tree import (
    CELL,
    OUTSIDE,
    cell_in,
    give_model,
    grow,
    is_full,
    model_in,
    plant,
)
from assembly.proximity.features.quadratic_model import ball_bound, pair_bound
from assembly.proximity.features.region_tests import (
    FAR,
    KNOWN,
    excluded,
    is_feasible,
    is_known,
    known_extremum_at,
    relative_curvature,
    side_of,
)

# What became of a search: apart, all other pairs excluded; shells cross; out of room, the best pair known.
APART, CROSSING, UNPROVEN = 0, 1, 2
# Pairs of nodes that may wait at a time, and pairs that may be cut.
WAITING = 65536
# Extrema kept.
EXTREMA = 256
# Pairs of cells that are smaller, in parts of the size, are not cut: what they bound is the proof's end.
TINY = 2.5e-10
# Newton's method is tried where normals turn by less.
SMOOTH = 1.2


@kernel(inner=True)
def push(keys, slots, count, key, slot):
    """Put into the heap."""
    i = count
    while i > 0:
        parent = (i - 1) >> 1
        if keys[parent] <= key:
            break
        keys[i] = keys[parent]
        slots[i] = slots[parent]
        i = parent
    keys[i] = key
    slots[i] = slot


@kernel(inner=True)
def drop_first(keys, slots, count):
    """Take the least out of the heap of `count`, which has one less then."""
    last = count - 1
    key = keys[last]
    slot = slots[last]
    i = 0
    while True:
        child = 2 * i + 1
        if child >= last:
            break
        if child + 1 < last and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= key:
            break
        keys[i] = keys[child]
        slots[i] = slots[child]
        i = child
    keys[i] = key
    slots[i] = slot


# Pairs of nodes that wait to be looked at, a slot each. keys, slots: their least distances and their slots, a heap;
# pairs: the two nodes, and what is known (NEW, BOUNDED or GUESS); normals: near that of the pair, or zero where it is
# not known; free: slots that were left; counts: how many pairs wait, slots were in use, slots are free.
PairQueue = namedtuple("PairQueue", "keys slots pairs normals free counts")
QUEUE_COUNTS = record_dtype("i8", waiting=1, used=1, free=1)
counts_at = record_view(QUEUE_COUNTS)
COUNTS = size_of(QUEUE_COUNTS)
# A pair whose bound is that of balls, or that of models; one that is only tried as a start.
NEW, BOUNDED, GUESS = 0, 1, 2


@kernel(inner=True, allocates=True)
def new_queue():
    """An empty `PairQueue`."""
    return PairQueue(
        keys=np.empty(WAITING),
        slots=np.empty(WAITING, np.int64),
        pairs=np.empty((WAITING, 3), np.int64),
        normals=np.empty((WAITING, 3)),
        free=np.empty(WAITING, np.int64),
        counts=np.zeros(COUNTS, np.int64),
    )


@kernel(inner=True)
def add_pair(queue, key, i, j, known, n):
    """Let a pair wait; it is left out where there is no room."""
    counts = counts_at(queue.counts, 0)
    if counts.free > 0:
        counts.free -= 1
        slot = queue.free[counts.free]
    elif counts.used < WAITING:
        slot = counts.used
        counts.used += 1
    else:
        return
    queue.pairs[slot, 0], queue.pairs[slot, 1], queue.pairs[slot, 2] = i, j, known
    queue.normals[slot, 0], queue.normals[slot, 1], queue.normals[slot, 2] = n
    push(queue.keys, queue.slots, counts.waiting, key, slot)
    counts.waiting += 1


@kernel(inner=True)
def take_first(queue):
    """The slot of the pair with the least distance, which does not wait any more: it is there until one is added."""
    counts = counts_at(queue.counts, 0)
    slot = queue.slots[0]
    drop_first(queue.keys, queue.slots, counts.waiting)
    counts.waiting -= 1
    queue.free[counts.free] = slot
    counts.free += 1
    return slot


# Where Newton's method leads. curvature: the least of g relative to f; stretch: 1 over the least of f's metric K.
NearExtremum = namedtuple("NearExtremum", "status x gap curvature stretch")


@kernel(inline=True)
def feature_in(table, tree, i):
    """The `Feature` of a node."""
    cell = cell_in(tree, i)
    return Feature(cell.kind, face_at(table, cell.record).surface if cell.kind == FACE else cell.record)


@kernel(inner=True)
def extremum_near(store, f, g, pose, x, n, size):
    """Newton's method from x; its status says whether it led to an extremum."""
    if f.kind == FACE and g.kind == FACE:
        found = solve_pair(store, (f.record, g.record), pose, x, size, 1.5, 0.0, False)
        gap = found.frame.gap
        least, stretch = relative_curvature(found.matrix.k, found.matrix.h, gap)
        return NearExtremum(found.status, found.parameters, gap, least, stretch)
    status, y, frame = solve_features(store, f, g, pose, x, n, size, 1.5)
    return NearExtremum(status, y, frame.gap, 0.0, 1.0)


@kernel(inner=True)
def larger_first(trees, i, j):
    """Whether to go down on the side of f: what is not a cell first, then what is larger."""
    cell_f, cell_g = cell_in(trees[0], i), cell_in(trees[1], j)
    f, g = model_in(trees[0], i), model_in(trees[1], j)
    if (cell_f.level == CELL) != (cell_g.level == CELL):
        return cell_g.level == CELL
    if cell_f.kind == VERTEX or cell_g.kind == VERTEX:
        return cell_g.kind == VERTEX
    if cell_f.level == CELL:
        # What keeps the bound from the distance, or else the extent.
        return f.rest + 0.02 * f.radius >= g.rest + 0.02 * g.radius
    return f.radius >= g.radius


@kernel(inline=True)
def are_cells(trees, i, j):
    """Whether both nodes are cells."""
    return cell_in(trees[0], i).level == CELL and cell_in(trees[1], j).level == CELL


# What a search for the nearest points of two shells finds. status: APART, CROSSING (at the point) or UNPROVEN; codes:
# numbers of the features; x: their coordinates, (u, v) of f, then of g; gap: n.(g - f), n the outward normal of a face
# of f, else of g, else from f to g; lower: no points are nearer than this; effort: pairs looked at.
ShellSearch = namedtuple("ShellSearch", "status codes x gap lower effort")
# A pair of features, or none. normal: near that of the pair, or zero where it is not known.
FoundPair = namedtuple("FoundPair", "found codes x normal gap")


@kernel(inline=True)
def pair_at(trees, i, j, x, gap):
    """The `FoundPair` at x of the features of two nodes."""
    codes = (cell_in(trees[0], i).feature, cell_in(trees[1], j).feature)
    return FoundPair(True, codes, x, (0.0, 0.0, 0.0), gap)


@kernel(inline=True)
def middles(trees, i, j):
    """The coordinates in the middles of two cells."""
    f, g = model_in(trees[0], i), model_in(trees[1], j)
    return (f.u0, f.v0, g.u0, g.v0)


@kernel(inner=True)
def are_feasible(store, trees, i, j, x):
    """Whether coordinates on the features of two nodes are points of the shells."""
    f, g = cell_in(trees[0], i), cell_in(trees[1], j)
    if not is_feasible(store, f.kind, f.record, x[0], x[1]):
        return False
    return is_feasible(store, g.kind, g.record, x[2], x[3])


@kernel(inner=True)
def nearest_cells(store, trees):
    """Two cells, by going down where balls are nearest."""
    i = 0
    j = 0
    while True:
        if are_cells(trees, i, j):
            return i, j
        down_f = larger_first(trees, i, j)
        tree = trees[0] if down_f else trees[1]
        cell = grow(store, tree, i if down_f else j)
        center = three_of(model_in(trees[1], j).center) if down_f else three_of(model_in(trees[0], i).center)
        nearest = math.inf
        for k in range(cell.child, cell.child + cell.children):
            d = sub(model_in(tree, k).center, center)
            if dot(d, d) < nearest:
                nearest = dot(d, d)
                i = k if down_f else i
                j = j if down_f else k


@kernel(inner=True)
def split_pair(store, trees, i, j, n, best, most, queue):
    """Let the pairs of the parts of one node and the other one wait, but for those `most` or more apart."""
    cells = are_cells(trees, i, j)
    down_f = larger_first(trees, i, j)
    tree = trees[0] if down_f else trees[1]
    cell = grow(store, tree, i if down_f else j)
    for k in range(cell.child, cell.child + cell.children):
        p, q = (k, j) if down_f else (i, k)
        a, b = model_in(trees[0], p), model_in(trees[1], q)
        if cells:
            give_model(store, tree, k)
            key, m = pair_bound(a, b, n, abs(best.gap))
        else:
            key, m = ball_bound(a, b), n
        if key < most:
            add_pair(queue, key, p, q, BOUNDED if cells else NEW, m)


@kernel(inner=True)
def note_extremum(extremum, trees, i, j, near):
    """Write an extremum of the features of two nodes."""
    for l in range(4):
        extremum.parameters[l] = near.x[l]
    extremum.curvature = near.curvature
    extremum.stretch = near.stretch
    extremum.feature_f = cell_in(trees[0], i).feature
    extremum.feature_g = cell_in(trees[1], j).feature


@kernel(inline=True)
def within(best, size, rough):
    """The distance from which on a pair may be left out."""
    return (1.0 - rough) * abs(best.gap) - 1e-13 * size


@kernel(inner=True, allocates=True)
def search(store, shells, pose, size, rough):
    """The nearest points of two shells, g seen from f, or any that are farther by a part of that, `rough`, at most."""
    trees = (plant(store, shells[0], IDENTITY), plant(store, shells[1], pose))
    queue = new_queue()
    counts = counts_at(queue.counts, 0)
    extrema = np.empty((EXTREMA, KNOWN))
    known = 0
    # The least bound of a pair that was too small to be cut.
    uncut = math.inf
    status = APART
    nowhere = (0.0, 0.0, 0.0)
    best = FoundPair(False, (-1, -1), (0.0, 0.0, 0.0, 0.0), nowhere, math.inf)
    lower = math.inf
    effort = 0
    first_f, first_g = nearest_cells(store, trees)
    add_pair(queue, -math.inf, first_f, first_g, GUESS, nowhere)
    add_pair(queue, ball_bound(model_in(trees[0], 0), model_in(trees[1], 0)), 0, 0, NEW, nowhere)
    while counts.waiting > 0:
        key = queue.keys[0]
        if key >= within(best, size, rough):
            break
        slot = take_first(queue)
        i, j, ready = queue.pairs[slot, 0], queue.pairs[slot, 1], queue.pairs[slot, 2]
        n = (queue.normals[slot, 0], queue.normals[slot, 1], queue.normals[slot, 2])
        effort += 1
        lower = max(key, 0.0)
        if is_full(trees[0]) or is_full(trees[1]) or counts.waiting + 160 > WAITING:
            status = UNPROVEN
            break
        f, g = model_in(trees[0], i), model_in(trees[1], j)
        if are_cells(trees, i, j):
            give_model(store, trees[0], i)
            give_model(store, trees[1], j)
            if ready == NEW:
                key, n = pair_bound(f, g, n, abs(best.gap))
                if key >= within(best, size, rough):
                    continue
                if counts.waiting > 0 and key > queue.keys[0]:
                    add_pair(queue, key, i, j, BOUNDED, n)
                    continue
            d = sub(g.point, f.point)
            start = middles(trees, i, j)
            if math.sqrt(dot(d, d)) < abs(best.gap) and are_feasible(store, trees, i, j, start):
                best = pair_at(trees, i, j, start, math.sqrt(dot(d, d)))
            if ready != GUESS and excluded(trees, i, j, key > 0.0):
                continue
            settled, beside = is_known(store, trees, i, j, extrema[:known])
            if settled:
                continue
            one, other = feature_in(store.table, trees[0], i), feature_in(store.table, trees[1], j)
            # Beside an extremum Newton's method would find that one again.
            if ready == GUESS or (max(f.bend, g.bend) < SMOOTH and beside > FAR):
                near = extremum_near(store, one, other, pose, start, n, size)
                if near.status == CONVERGED or near.status == SINGULAR:
                    if abs(near.gap) < abs(best.gap) and are_feasible(store, trees, i, j, near.x):
                        best = pair_at(trees, i, j, near.x, near.gap)
                    if known < EXTREMA:
                        note_extremum(known_extremum_at(extrema, known), trees, i, j, near)
                        known += 1
                        if is_known(store, trees, i, j, extrema[known - 1 : known])[0]:
                            continue
            if key <= 0.0 and f.bend + g.bend < SMOOTH:
                x, crosses = crossing_point(store, one, other, pose, start, size)
                if crosses and are_feasible(store, trees, i, j, x):
                    return ShellSearch(CROSSING, pair_at(trees, i, j, x, 0.0).codes, x, 0.0, 0.0, effort)
            if ready == GUESS or side_of(store, trees[0], i) == OUTSIDE or side_of(store, trees[1], j) == OUTSIDE:
                continue
            if max(f.radius, g.radius) < TINY * size:
                uncut = min(uncut, key)
                continue
        split_pair(store, trees, i, j, n, best, within(best, size, rough), queue)
    if status == APART:
        lower = within(best, size, rough)
    elif not best.found:
        # Out of room before any point inside the trims: where the search began.
        best = pair_at(trees, first_f, first_g, middles(trees, first_f, first_g), math.inf)
    return ShellSearch(status, best.codes, best.x, best.gap, max(min(lower, uncut), 0.0), effort)
