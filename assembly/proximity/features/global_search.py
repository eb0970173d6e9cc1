"""The nearest points of two B-rep bodies over all their faces, edges and vertices, by branch and bound.

Nearest points are an extremum of some pair of features, inside the trims of both. Two trees of balls
(`proximity/features/ball_tree.py`) are descended together, the pair of nodes with the least bound of its distance
first. A pair of cells is discarded when

- its bound (`proximity/features/quadratic_model.py`) is not below the least distance known,
- no normal of one is parallel to one of the other, or the distance changes monotonically over one of them: then
  no extremum of these two features is in it,
- it is small, and a known extremum is the only one in it: up to there relative curvature cannot change its sign,

else Newton's method looks for an extremum from its middle, and the larger cell is split. A feasible pair, an
extremum or a sample inside the trims, lowers the least distance known. Bodies that cross are at distance zero; their
crossing points are found by Newton's method for d = 0, and the search ends.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._best_first import NO_PAIRS, Pairs, best_first
from assembly._heap import PAIR, waiting_pair_at
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
    is_tree_full,
    model_in,
    plant,
)
from assembly.proximity.features.quadratic_model import ball_bound, pair_bound, put
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

# Outcome of a search: bodies apart, all other pairs excluded; bodies cross; out of memory, the best pair known.
APART, CROSSING, UNPROVEN = 0, 1, 2
# Pairs of nodes that may wait at a time.
WAITING = 65536
# Extrema kept.
EXTREMA = 256
# Pairs of cells smaller than this part of the size are not split further: their bounds are final.
TINY = 2.5e-10
# Newton's method is tried where normals turn by less.
SMOOTH = 1.2

# What a search keeps.
SEARCH_STATE = record_dtype(
    "f8",
    limit=1,  # pairs with at least this bound are discarded [length]
    let_go=1,  # the least bound of discarded pairs and of pairs too small to be split [length]
    lower=1,  # no points are nearer than this [length]
    gap=1,  # of the nearest pair known; infinite before there is one [length]
    parameters=4,  # its coordinates, (u, v) of f, then of g
    feature_f=1,  # numbers of its features; -1: none yet
    feature_g=1,
    crosses=1,  # 1: shells cross there
    effort=1,  # pairs looked at
    known=1,  # extrema found
    place=1,  # row of the normal of the next pair; 0: only its balls bound it
    by_models=1,  # 1: pairs are bounded by their models, else by their balls
    normal=3,  # the direction with which the search for a bound by models begins
    used=1,  # rows of normals that were ever used
    free=1,  # first row of the list of free rows, each of which begins with the next one; 0: none
)
search_state_at = record_view(SEARCH_STATE)
STATE = size_of(SEARCH_STATE)
# A search. trees: of the shells; pose: of g; heap: of `assembly/_heap.py`; normals: a row per waiting pair that
# models bound; extrema: a KNOWN_EXTREMUM a row; state: a SEARCH_STATE.
ShellTrees = namedtuple("ShellTrees", "store trees pose size rough heap normals extrema state")
# Where Newton's method leads. curvature: the least of g relative to f; stretch: 1 over the least eigenvalue of K of f.
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
    """Whether to split the node of f, not that of g: a node that is no cell first, then the larger one."""
    cell_f, cell_g = cell_in(trees[0], i), cell_in(trees[1], j)
    f, g = model_in(trees[0], i), model_in(trees[1], j)
    if (cell_f.level == CELL) != (cell_g.level == CELL):
        return cell_g.level == CELL
    if cell_f.kind == VERTEX or cell_g.kind == VERTEX:
        return cell_g.kind == VERTEX
    if cell_f.level == CELL:
        # By the remainder, which weakens the bound, and with less weight by the extent.
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
    """Two cells, by descending to the children whose centers are nearest."""
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
def note_extremum(extremum, trees, i, j, near):
    """Write an extremum of the features of two nodes."""
    for l in range(4):
        extremum.parameters[l] = near.x[l]
    extremum.curvature = near.curvature
    extremum.stretch = near.stretch
    extremum.feature_f = cell_in(trees[0], i).feature
    extremum.feature_g = cell_in(trees[1], j).feature


@kernel(inner=True)
def keep_pair(search, i, j, x, gap):
    """Note the nearest pair known, at x of the features of two nodes, and which bounds are let go for it."""
    state = search_state_at(search.state, 0)
    for l in range(4):
        state.parameters[l] = x[l]
    state.feature_f = cell_in(search.trees[0], i).feature
    state.feature_g = cell_in(search.trees[1], j).feature
    state.gap = gap
    state.limit = (1.0 - search.rough) * abs(gap) - 1e-13 * search.size


@kernel(inner=True)
def node_bound(search, i, j):
    """Lower bound of the distance of two nodes, and the row of its normal: of equal ones the first row is next."""
    state, trees = search_state_at(search.state, 0), search.trees
    f, g = model_in(trees[0], i), model_in(trees[1], j)
    if state.by_models == 0.0:
        return ball_bound(f, g), 0
    give_model(search.store, trees[0], i)
    give_model(search.store, trees[1], j)
    bound, n = pair_bound(f, g, three_of(state.normal), abs(state.gap))
    if not bound < state.limit:
        return bound, 0
    row = int(state.free)
    if row > 0:
        state.free = search.normals[row, 0]
    else:
        state.used += 1.0
        row = int(state.used)
    put(search.normals[row], n)
    return bound, row


@kernel(inner=True)
def search_ended(search, top, left):
    """Why the search ends; -1: not yet."""
    state, first = search_state_at(search.state, 0), waiting_pair_at(search.heap, 0)
    state.lower = max(min(top, state.limit), 0.0)
    if state.crosses == 1.0:
        return CROSSING
    if left == 0 or first.bound >= state.limit:
        return APART
    state.place = first.tie
    full = is_tree_full(search.trees[0]) or is_tree_full(search.trees[1]) or left > WAITING
    return UNPROVEN if full else -1


@kernel(inner=True)
def examine(search, bound, i, j, n, is_guess):
    """Look for an extremum or a crossing in two cells, for a guess in any case. Returns whether more may be in them."""
    store, trees, extrema = search.store, search.trees, search.extrema
    state = search_state_at(search.state, 0)
    f, g = model_in(trees[0], i), model_in(trees[1], j)
    d = sub(g.point, f.point)
    start = middles(trees, i, j)
    if math.sqrt(dot(d, d)) < abs(state.gap) and are_feasible(store, trees, i, j, start):
        keep_pair(search, i, j, start, math.sqrt(dot(d, d)))
    if not is_guess and excluded(trees, i, j, bound > 0.0):
        return False
    known = int(state.known)
    settled, beside = is_known(store, trees, i, j, extrema[:known])
    if settled:
        return False
    one, other = feature_in(store.table, trees[0], i), feature_in(store.table, trees[1], j)
    # Beside an extremum Newton's method would find that one again.
    if is_guess or (max(f.bend, g.bend) < SMOOTH and beside > FAR):
        near = extremum_near(store, one, other, search.pose, start, n, search.size)
        if near.status == CONVERGED or near.status == SINGULAR:
            if abs(near.gap) < abs(state.gap) and are_feasible(store, trees, i, j, near.x):
                keep_pair(search, i, j, near.x, near.gap)
            if known < EXTREMA:
                note_extremum(known_extremum_at(extrema, known), trees, i, j, near)
                state.known += 1.0
                if is_known(store, trees, i, j, extrema[known : known + 1])[0]:
                    return False
    if bound <= 0.0 and f.bend + g.bend < SMOOTH:
        x, crosses = crossing_point(store, one, other, search.pose, start, search.size)
        if crosses and are_feasible(store, trees, i, j, x):
            keep_pair(search, i, j, x, 0.0)
            state.crosses = 1.0
            return False
    return side_of(store, trees[0], i) != OUTSIDE and side_of(store, trees[1], j) != OUTSIDE


@kernel(inner=True)
def branch(search, bound, i, j):
    """The bound of a pair, and the pairs of the parts of one node with the other one; infinite if nothing is in it."""
    state, trees = search_state_at(search.state, 0), search.trees
    row = int(state.place)
    normal = (0.0, 0.0, 0.0)
    if row > 0:
        normal = three_of(search.normals[row])
        search.normals[row, 0], state.free = state.free, row
    put(state.normal, normal)
    cells = are_cells(trees, i, j)
    state.by_models = 1.0 if cells else 0.0
    if cells and row == 0:
        return bound, Pairs(i, i + 1, j, j + 1)
    state.effort += 1.0
    if cells:
        if not examine(search, bound, i, j, normal, False):
            return math.inf, NO_PAIRS
        tiny = max(model_in(trees[0], i).radius, model_in(trees[1], j).radius) < TINY * search.size
        if tiny or bound >= state.limit:
            return bound, NO_PAIRS
    down_f = larger_first(trees, i, j)
    cell = grow(search.store, trees[0] if down_f else trees[1], i if down_f else j)
    if cell.children == 0:
        return math.inf, NO_PAIRS
    parts = (cell.child, cell.child + cell.children)
    return bound, Pairs(parts[0], parts[1], j, j + 1) if down_f else Pairs(i, i + 1, parts[0], parts[1])


# Bounds may be negative: how deep balls overlap tells where shells may cross.
advance = kernel(inner=True)(best_first(search_state_at, node_bound, search_ended, branch, floor=-math.inf))


@kernel(inner=True)
def pair_known(search, status):
    """What a search with this status has found. Its state is read here, while the caller holds the array."""
    best = search_state_at(search.state, 0)
    codes = (int(best.feature_f), int(best.feature_g))
    x = (best.parameters[0], best.parameters[1], best.parameters[2], best.parameters[3])
    return ShellSearch(status, codes, x, best.gap, best.lower, int(best.effort))


@kernel(inner=True, allocates=True)
def nearest_of_shells(store, shells, pose, size, rough):
    """The nearest points of two B-rep bodies, g seen from f, or points farther by the part `rough` at most."""
    trees = (plant(store, shells[0], IDENTITY), plant(store, shells[1], pose))
    # A node has no more parts than there are nodes, a cell at most four.
    heap = np.empty((WAITING + trees[0].nodes.shape[0] + trees[1].nodes.shape[0]) * PAIR)
    normals = np.empty((WAITING + 8, 3))
    search = ShellTrees(store, trees, pose, size, rough, heap, normals, np.empty((EXTREMA, KNOWN)), np.zeros(STATE))
    best = search_state_at(search.state, 0)
    best.limit = best.let_go = best.gap = math.inf
    best.feature_f = best.feature_g = -1.0
    i, j = nearest_cells(store, trees)
    give_model(store, trees[0], i)
    give_model(store, trees[1], j)
    examine(search, -math.inf, i, j, (0.0, 0.0, 0.0), True)
    status, _left = advance(search, 0, Pairs(0, 1, 0, 1))
    if status == UNPROVEN and best.feature_f < 0.0:
        # Out of memory before a point inside the trims was found: the pair at which the search began.
        keep_pair(search, i, j, middles(trees, i, j), math.inf)
    return pair_known(search, status)
