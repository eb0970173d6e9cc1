"""Certified distance of a surface and a point, a curve or a surface: the search of `distance/curves/search.py` over
patches.

The curve may be given by a formula: its pieces are `distance/patches/formula_nodes.py`'s.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._best_first import NO_PAIRS, Pairs, best_first
from assembly._heap import PAIR, push
from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.distance.curves.bounds import difference
from assembly.distance.curves.nodes import length
from assembly.distance.patches.formula_nodes import (
    describe_formula,
    formula_parameter,
    is_dot,
    split_formula,
    start_formula,
)
from assembly.distance.patches.newton import load_points, nearest_in_patches, proven_in_patches
from assembly.distance.patches.nodes import (
    DEEPEST,
    NODE_INTS,
    Patch,
    bezier_surface_at,
    describe_patch,
    fill_patch,
    patch_links_of,
    patch_node_of,
    patch_stride,
    split_patch,
)
from assembly.distance.patches.pair import (
    BASIS,
    D,
    free_count,
    load_hessian,
    load_models,
    node_of,
    patch_box_bound,
    patch_convexity,
    patch_hull_bound,
    patch_model_bound,
    patch_work_at,
    size_at,
)
from assembly.distance.piece_search import (
    CROWDED,
    STATE,
    PieceTree,
    Question,
    bound_to_beat,
    crowded,
    ended,
    in_span,
    is_answered,
    roomier,
    search_state_at,
)
from assembly.geometry.splines.bezier_pieces import UNIT, bezier_head_at

# What a search writes.
PATCH_ANSWER_RECORD = record_dtype(
    "f8",
    lower=1,  # proven bounds of the distance [length]
    upper=1,
    parameters=4,  # (u, v) of a, then of b
    points=6,  # of a, then of b [length]
    count=1,  # pairs bounded
)
patch_answer_at = record_view(PATCH_ANSWER_RECORD)
PATCH_ANSWER = size_of(PATCH_ANSWER_RECORD)
# a, b: trees; curve: the one given by a formula that b stands for, or None; heap: pairs of nodes; state, out: blocks of
# PIECE_SEARCH_STATE and PATCH_ANSWER_RECORD; shift: from the center of a to that of b; slack: of a difference of two
# points; errors: of evaluated points and derivatives; step: bounds this close count as equal; w, m: scratch arrays.
PatchSearch = namedtuple("PatchSearch", "a b curve heap state out question shift slack errors step w m")
_ROOM = 512


@kernel(inline=True)
def patch_size(tree, k):
    """The longer side of a patch."""
    node = patch_node_of(tree, k)
    return max(node.speed_u, node.speed_v)


@kernel(inline=True)
def point_error(record, pool):
    """How far an evaluated point may be from the packed patch: sums of positive terms in triangles of 3 n roundings."""
    patch = bezier_surface_at(record, 0)
    n = patch.degree_u + patch.degree_v
    return (1.0 + patch.rational) * (8.0 * n + 24.0) * UNIT * bezier_head_at(pool, 0).reach


@kernel(inline=True)
def derivative_error(record, pool):
    """The same of a derivative: n differences of such sums, in a quotient also of the weights."""
    head = bezier_head_at(pool, 0)
    patch = bezier_surface_at(record, 0)
    n = patch.degree_u + patch.degree_v + 1.0
    return 8.0 * n * (4.0 * n + 16.0) * UNIT * head.reach * head.weight_ratio ** (2 * patch.rational)


@kernel(inline=True)
def between(pool, at, low, high, x):
    """The parameter, in one direction, of the place x from 0 to 1 across a node."""
    return in_span(pool, at, low + x * (high - low))


@kernel(inline=True)
def parameters_at(curve, tree, k, x, y):
    """The parameters of a shape at a place of a node."""
    if curve is not None:
        return formula_parameter(tree.nodes, patch_stride(tree.record) * k, x), 0.0
    node = patch_node_of(tree, k)
    surface = bezier_surface_at(tree.record, 0)
    patch = patch_links_of(tree, k).patch
    u = between(tree.pool, surface.breaks_u + patch // surface.patches_v, node.low_u, node.high_u, x)
    return u, between(tree.pool, surface.breaks_v + patch % surface.patches_v, node.low_v, node.high_v, y)


@kernel(inline=True)
def freedom(curve, tree, k):
    """How many parameters a node has: none if it counts as a point."""
    if curve is not None:
        return 0 if is_dot(tree.nodes, patch_stride(tree.record) * k) else 1
    return free_count(tree.record)


@kernel(inline=True)
def remainder(curve, patch):
    """How far a piece may be from what its rows describe: the rows of a formula describe a model, not the curve."""
    return 0.0 if curve is None else node_of(patch).e0


@kernel(inner=True)
def first_half(curve, tree, k, used, short, m):
    """The first half of node k, and how many nodes there are; halves not yet made become nodes `used`, `used + 1`.

    A piece of a formula whose radius is below `short` counts as a point.
    """
    half = patch_links_of(tree, k).halves
    if half >= 0:
        return half, used
    stride = patch_stride(tree.record)
    if curve is None:
        split_patch(tree, k, used)
    else:
        split_formula(tree, k, used)
    for j in range(used, used + 2):
        if curve is None:
            describe_patch(tree.record, tree.pool, tree.nodes, stride * j, m)
        else:
            describe_formula(curve, short, tree.nodes, stride * j, m)
    return used, used + 2


@kernel(inline=True)
def compared(search, i, j):
    """A node of each shape."""
    a, b = search.a, search.b
    first = Patch(a.record, a.nodes, patch_stride(a.record) * i, free_count(a.record))
    return first, Patch(b.record, b.nodes, patch_stride(b.record) * j, freedom(search.curve, b, j))


@kernel(inner=True)
def keep_nearer(search, i, j, found):
    """Keep the points `found` as the nearest ones so far, with their parameters from `place` in nodes i and j."""
    place = patch_work_at(search.w, 0).place
    answer = patch_answer_at(search.out, 0)
    answer.upper = found.upper
    search_state_at(search.state, 0).limit = bound_to_beat(search.question, found.upper, search.step)
    a, b = compared(search, i, j)
    y = place[1] if a.free > 1 else 0.0
    answer.parameters[0], answer.parameters[1] = parameters_at(None, search.a, i, place[0], y)
    x = place[a.free] if b.free > 0 else 0.0
    y = place[a.free + 1] if b.free > 1 else 0.0
    answer.parameters[2], answer.parameters[3] = parameters_at(search.curve, search.b, j, x, y)
    for k in range(3):
        answer.points[k] = found.on_a[k] + bezier_head_at(search.a.pool, 0).center[k]
        answer.points[3 + k] = found.on_b[k] + bezier_head_at(search.b.pool, 0).center[k]


@kernel(inline=True)
def pair_bound(search, i, j):
    """Lower bound of the distance of two nodes."""
    a, b = compared(search, i, j)
    w, shift, slack = search.w, search.shift, search.slack
    limit = search_state_at(search.state, 0).limit
    patch_answer_at(search.out, 0).count += 1.0
    bound = patch_box_bound(a, b, shift, slack)
    if bound < limit:
        load_models(a, b, shift, w)
        load_hessian(w, a.free + b.free)
        bound = max(bound, patch_model_bound(a, b, slack, w))
        if bound < limit:
            bound = max(bound, patch_hull_bound(a, b, shift, slack, w) - remainder(search.curve, b))
    return bound, 0.0


@kernel(inline=True)
def search_ended(search, top, left):
    """The status with which the search ends; -1: it goes on."""
    answer = patch_answer_at(search.out, 0)
    answer.lower = max(min(top, answer.upper), 0.0)
    status = ended(search.question, answer.upper, search.step, top, left, answer.count)
    return CROWDED if status < 0 and crowded(search, left, NODE_INTS) else status


@kernel(inline=True)
def examine(search, key, i, j):
    """Bound two nodes by their models and Newton's method, keep nearer points; the bound, and whether it is final."""
    a, b = compared(search, i, j)
    n = a.free + b.free
    w, curve, shift, error = search.w, search.curve, search.shift, search.errors[0]
    work = patch_work_at(w, 0)
    answer = patch_answer_at(search.out, 0)
    away = node_of(a).away + node_of(b).away
    load_models(a, b, shift, w)
    load_hessian(w, n)
    key = max(key, patch_model_bound(a, b, search.slack, w))
    for k in range(n):
        work.place[k] = work.z[k] + 0.5
    proven = search.question.polish and patch_convexity(a, b, w)
    for k in range(n):
        work.z[k] = work.h[5 * k]
    descend = proven
    if search.question.polish and not proven:
        load_points(a, b, curve, shift, w)
        descend = size_at(w, D) + error + away < answer.upper
    if descend:
        nearest_in_patches(a, b, curve, shift, w)
    found = proven_in_patches(a, b, curve, shift, search.errors, proven, w)
    if found.upper < answer.upper:
        keep_nearer(search, i, j, found)
    if proven:
        # The point of a dot stands for its whole piece: halving the patch brings the bounds no closer than this.
        doubt = 2.0 * remainder(curve, b) if b.free == 0 else 0.0
        key = max(key, found.lower - doubt)
        if found.upper - found.lower <= max(search.step, 16.0 * (error + away)) + doubt:
            return key, True
    return key, is_answered(search.question, answer.upper, search.step, key)


@kernel(inline=True)
def branch(search, key, i, j):
    """The bound of a pair, and the pairs from halving its longer node; none where the pair is pruned."""
    a, b = search.a, search.b
    state = search_state_at(search.state, 0)
    key, final = examine(search, key, i, j)
    if final:
        return key, NO_PAIRS
    long_a, long_b = patch_size(a, i), patch_size(b, j)
    ends_a = patch_links_of(a, i).depth >= DEEPEST
    ends_b = patch_links_of(b, j).depth >= DEEPEST
    if max(long_a, long_b) <= search.step or (ends_a and ends_b):
        return key, NO_PAIRS
    short = 0.125 * search.step
    if ends_b or (long_a >= long_b and not ends_a):
        half, used = first_half(None, a, i, int(state.used_a), short, search.m)
        state.used_a = used
        return key, Pairs(half, half + 2, j, j + 1)
    half, used = first_half(search.curve, b, j, int(state.used_b), short, search.m)
    state.used_b = used
    return key, Pairs(i, i + 1, half, half + 2)


advance = kernel(inner=True)(best_first(search_state_at, pair_bound, search_ended, branch))


@kernel(inline=True, allocates=True)
def new_tree(curve, record, pool, short, m):
    """A packed shape with its patches as nodes."""
    surface = bezier_surface_at(record, 0)
    count = surface.patches_u * surface.patches_v
    ints, nodes = np.empty((count + _ROOM) * NODE_INTS, np.int64), np.empty((count + _ROOM) * patch_stride(record))
    tree = PieceTree(record, pool, ints, nodes)
    for k in range(count):
        if curve is None:
            fill_patch(tree, k)
            describe_patch(record, pool, nodes, patch_stride(record) * k, m)
        else:
            start_formula(curve, tree)
            describe_formula(curve, short, nodes, 0, m)
    return tree, count


@kernel(inner=True)
def start_pairs(search):
    """Push all pairs of patches, bounded by their boxes alone since there may be many; how many are in the heap."""
    state = search_state_at(search.state, 0)
    # The first corner of each shape is on it: their distance is an upper bound.
    a, b = compared(search, 0, 0)
    found = proven_in_patches(a, b, search.curve, search.shift, search.errors, False, search.w)
    keep_nearer(search, 0, 0, found)
    left = 0
    for i in range(int(state.used_a)):
        for j in range(int(state.used_b)):
            a, b = compared(search, i, j)
            bound = max(patch_box_bound(a, b, search.shift, search.slack), 0.0)
            if bound < state.limit:
                push(search.heap, left, bound, 0.0, i, j)
                left += 1
            else:
                state.let_go = min(state.let_go, bound)
    patch_answer_at(search.out, 0).count = state.used_a * state.used_b
    return left


@kernel(
    signatures=(
        "(i8[::1], f8[::1], i8[::1], f8[::1], Tuple((i8[::1], f8[::1], f8[::1])), Tuple((f8, f8, i8, b1)), f8[::1])",
        "(i8[::1], f8[::1], i8[::1], f8[::1], none, Tuple((f8, f8, i8, b1)), f8[::1])",
    ),
    allocates=True,
)
def patch_distance(ra, qa, rb, qb, curve, asked, out):
    """Bounds of the distance of two packed shapes, the first of which is not a point, to `out`; returns the status.

    A clearance below zero asks for the distance itself. The second shape may stand for a curve given by a formula,
    `curve`, which is None otherwise.
    """
    question = Question(*asked)
    head, other = bezier_head_at(qa, 0), bezier_head_at(qb, 0)
    shift = difference(other.center, head.center, (0.0, 0.0, 0.0))
    slack = 8.0 * UNIT * (head.reach + other.reach + length(shift)) + 1e-150
    error = slack + point_error(ra, qa) + point_error(rb, qb)
    errors = (error, max(derivative_error(ra, qa), derivative_error(rb, qb)))
    step = max(0.999 * question.tolerance, 8.0 * (error + head.error + other.error))
    m = np.empty(42)
    a, used_a = new_tree(None, ra, qa, 0.125 * step, m)
    b, used_b = new_tree(curve, rb, qb, 0.125 * step, m)
    first, second = bezier_surface_at(ra, 0), bezier_surface_at(rb, 0)
    degree = max(max(first.degree_u, first.degree_v), max(second.degree_u, second.degree_v))
    # Entries of K for parameters of different shapes stay zero.
    w = np.zeros(BASIS + 6 * (degree + 1))
    heap, block = np.empty((used_a * used_b + _ROOM) * PAIR), np.empty(STATE)
    state = search_state_at(block, 0)
    state.let_go, state.used_a, state.used_b = math.inf, used_a, used_b
    search = PatchSearch(a, b, curve, heap, block, out, question, shift, slack, errors, step, w, m)
    left = start_pairs(search)
    status, left = advance(search, left, NO_PAIRS)
    while status == CROWDED:
        a, b, heap = roomier(search, left, NODE_INTS)
        search = PatchSearch(a, b, curve, heap, block, out, question, shift, slack, errors, step, w, m)
        status, left = advance(search, left, NO_PAIRS)
    return status
