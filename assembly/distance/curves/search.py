"""Certified distance of two spline curves: branch and bound over pairs of Bezier pieces.

The search is that of `_best_first.py`: U is the distance of the nearest points known, and a pair is let go once its
bound is within the tolerance of U. Where the distance is proven convex on a pair, its minimum is found by Newton's
method and

    F(x) >= F(x*) + sum_i min over the box of (g_i d_i + lambda_i d_i^2 / 2)

is the final bound of the pair. Of other pairs the longer piece is halved. `docs/proximity.md` explains the argument.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._best_first import NO_PAIRS, Pairs, best_first
from assembly._heap import PAIR
from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.distance.curves.bounds import box_bound, convexity, difference, hull_bound, least_change, model_bound
from assembly.distance.curves.newton import nearest_points, node_derivatives, node_point
from assembly.distance.curves.nodes import (
    NODE_INTS,
    curve_node_at,
    is_piece,
    length,
    links_of,
    node_of,
    node_stride,
    piece_of,
    split_node,
    start_nodes,
)
from assembly.distance.piece_search import (
    CROWDED,
    MEETING,
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
from assembly.geometry.splines.bezier_pieces import (
    UNIT,
    bezier_curve_at,
    bezier_head_at,
)
from assembly.geometry.vec import dot

# What a search writes.
CURVE_ANSWER = record_dtype(
    "f8",
    lower=1,  # proven bounds of the distance [length]
    upper=1,
    parameter_a=1,  # of the points
    parameter_b=1,
    point_a=3,  # [length]
    point_b=3,  # [length]
    count=1,  # pairs bounded
)
curve_answer_at = record_view(CURVE_ANSWER)
ANSWER = size_of(CURVE_ANSWER)
# a, b: trees; heap: pairs of nodes; state, out: blocks of PIECE_SEARCH_STATE and CURVE_ANSWER; plane: whether a meeting
# may be proven; shift: from the center of a to that of b; slack: rounding error of a difference of two points; error:
# that of two evaluated points; step: bounds that differ by no more than this count as equal.
CurveSearch = namedtuple("CurveSearch", "a b heap state out question plane shift slack error step")
_DEEPEST = 48
_ROOM = 64
# Before this many pairs, Newton's method is left out where bounds alone may answer a question about a clearance.
_EARLY = 24


@kernel(inline=True)
def extent(tree, k):
    """Length of a piece, or the diagonal of the box of several."""
    node = node_of(tree, k)
    return node.speed if is_piece(tree, k) else 2.0 * length(node.box_half)


@kernel(inline=True)
def evaluation_error(record, pool):
    """How far an evaluated point may be from the packed curve (see `proven_minimum`)."""
    curve = bezier_curve_at(record, 0)
    return (1.0 + curve.rational) * (8.0 * curve.degree + 16.0) * UNIT * bezier_head_at(pool, 0).reach


@kernel(inline=True)
def speed_and_error(piece):
    """The largest |C'| of a piece, and how far an evaluated one may be off (see `proven_minimum`)."""
    curve = bezier_curve_at(piece.record, 0)
    head = bezier_head_at(piece.pool, 0)
    speed = curve_node_at(piece.nodes, piece.at).speed
    size = speed + 2.0 * curve.rational * curve.degree * head.reach * head.weight_ratio
    return speed, (16.0 * curve.degree + 40.0) * UNIT * size


@kernel(inner=True, exact=True)
def proven_minimum(a, b, shift, error, curvatures, x, y):
    """Lower bound of the distance on a box where the Hessian is at least diag(curvatures), from a point of it.

    Horner's rule multiplies the term i by at most 6 n + 10 rounded factors, all terms are positive multiples of control
    points: a point has an error below (6 n + 10) u REACH, a derivative the same part of n times the largest difference.
    """
    away_a, away_b = curve_node_at(a.nodes, a.at).away, curve_node_at(b.nodes, b.at).away
    u, du, _hu = node_derivatives(a, x)
    v, dv, _hv = node_derivatives(b, y)
    d = difference(u, v, shift)
    far = length(d)
    size = 16.0 * UNIT * far
    gx = dot(d, du)
    speed, off = speed_and_error(a)
    change = least_change(gx, (error + size) * (speed + off) + far * off, curvatures[0], x, 1.0 - x)
    if bezier_curve_at(b.record, 0).degree > 0:
        speed, off = speed_and_error(b)
        change += least_change(-dot(d, dv), (error + size) * (speed + off) + far * off, curvatures[1], y, 1.0 - y)
    near = max(far - size - error, 0.0)
    square = near * near + 2.0 * change * (1.0 + 1e-12)
    lower = math.sqrt(square) * (1.0 - 8.0 * UNIT) if square > 0.0 else 0.0
    return lower - away_a - away_b, far + size + error + away_a + away_b


@kernel(inner=True)
def keep(a, ka, b, kb, x, y, answer):
    """Write the points at (x, y) of two pieces as the nearest known."""
    answer.parameter_a = parameter(a, ka, x)
    answer.parameter_b = parameter(b, kb, y)
    u = node_point(piece_of(a, ka), x)
    v = node_point(piece_of(b, kb), y)
    for j in range(3):
        answer.point_a[j] = u[j] + bezier_head_at(a.pool, 0).center[j]
        answer.point_b[j] = v[j] + bezier_head_at(b.pool, 0).center[j]


@kernel(inline=True, exact=True)
def first_point(record, pool):
    """The first point of a packed curve."""
    o = bezier_curve_at(record, 0).pieces
    w = 1.0 / pool[o + 3]
    return (w * pool[o], w * pool[o + 1], w * pool[o + 2])


@kernel(inner=True)
def keep_starts(a, b, shift, answer):
    """Write the first points of both curves as the nearest that are known; their distance, rounded up."""
    u = first_point(a.record, a.pool)
    v = first_point(b.record, b.pool)
    answer.parameter_a = a.pool[bezier_curve_at(a.record, 0).breaks]
    answer.parameter_b = b.pool[bezier_curve_at(b.record, 0).breaks]
    for j in range(3):
        answer.point_a[j] = u[j] + bezier_head_at(a.pool, 0).center[j]
        answer.point_b[j] = v[j] + bezier_head_at(b.pool, 0).center[j]
    return length(difference(u, v, shift)) * (1.0 + 16.0 * UNIT)


@kernel(inline=True)
def parameter(tree, k, x):
    """The curve's parameter of a place on a piece."""
    node = node_of(tree, k)
    at = bezier_curve_at(tree.record, 0).breaks + links_of(tree, k).first
    return in_span(tree.pool, at, node.begin + x * (node.end - node.begin))


@kernel(inner=True, exact=True)
def meeting_proven(a, b, shift, error, x, y):
    """Whether two plane pieces are proven to cross near (x, y) of their unit square.

    z - J^-1 D(z), J = (a', -b') at (x, y), maps a square of half width r into itself, so that it has a fixed point
    (Brouwer), a zero of D, if |J^-1| (|D| + (sup |a''| + sup |b''|) r^2 + rounding) <= r. D may be any continuous
    function within the error, the given curves' among them.
    """
    node_a, node_b = curve_node_at(a.nodes, a.at), curve_node_at(b.nodes, b.at)
    if bezier_curve_at(b.record, 0).degree == 0:
        return False
    u, du, _hu = node_derivatives(a, x)
    v, dv, _hv = node_derivatives(b, y)
    d = difference(u, v, shift)
    det = abs(du[1] * dv[0] - du[0] * dv[1])
    if not det > 1e-6 * length(du) * length(dv):
        return False
    # The rows of the inverse are at most this long.
    inverse = max(length(du), length(dv)) / det
    far = length(d) * (1.0 + 16.0 * UNIT) + error + node_a.away + node_b.away
    bend = length(node_a.a2) + node_a.e2 + length(node_b.a2) + node_b.e2
    r = min(min(x, 1.0 - x), min(y, 1.0 - y))
    if bend * inverse * r > 0.25:
        r = 0.25 / (bend * inverse)
    # 1e-8 r stands for the rounding of J, its inverse and the products, at most 1e6 times the last place.
    return inverse * (far + bend * r * r) * (1.0 + 1e-8) + 1e-8 * r < r


@kernel(inline=True)
def pair_bound(search, i, j):
    """Lower bound of the distance of two nodes."""
    a, b = node_of(search.a, i), node_of(search.b, j)
    limit = search_state_at(search.state, 0).limit
    curve_answer_at(search.out, 0).count += 1.0
    bound = box_bound(a, b, search.shift, search.slack)
    if bound < limit and is_piece(search.a, i) and is_piece(search.b, j):
        low, x, y = model_bound(a, b, search.shift, search.slack)
        bound = max(bound, low)
        if bound < limit:
            first, second = piece_of(search.a, i), piece_of(search.b, j)
            bound = max(bound, hull_bound(first, second, search.shift, search.slack, x, y))
    return bound, 0.0


@kernel(inline=True)
def search_ended(search, top, left):
    """What the search ends with; -1: not yet."""
    answer = curve_answer_at(search.out, 0)
    if search_state_at(search.state, 0).met > 0.0:
        answer.lower = 0.0
        return MEETING
    answer.lower = max(min(top, answer.upper), 0.0)
    status = ended(search.question, answer.upper, search.step, top, left, answer.count)
    return CROWDED if status < 0 and crowded(search, left, NODE_INTS) else status


@kernel(inner=True)
def keep_nearer(search, i, j, x, y, far):
    """Keep points that are nearer than all known, at (x, y) of two pieces; in the plane they may prove a meeting."""
    state = search_state_at(search.state, 0)
    clearance = search.question.clearance
    answer = curve_answer_at(search.out, 0)
    answer.upper = far
    state.limit = bound_to_beat(search.question, far, search.step)
    keep(search.a, i, search.b, j, x, y, answer)
    # Points that prove a distance of at most a clearance are as near to each other as doubles tell.
    away = node_of(search.a, i).away + node_of(search.b, j).away
    if search.plane and (clearance == 0.0 or (clearance > 0.0 and far <= 16.0 * (search.error + away))):
        if meeting_proven(piece_of(search.a, i), piece_of(search.b, j), search.shift, search.error, x, y):
            state.met = 1.0


@kernel(inline=True)
def examine(search, key, i, j):
    """Nearest points of two pieces by their models and Newton's method: their bound, and whether that is final."""
    a, b = piece_of(search.a, i), piece_of(search.b, j)
    node_a, node_b = node_of(search.a, i), node_of(search.b, j)
    shift, error, clearance = search.shift, search.error, search.question.clearance
    answer = curve_answer_at(search.out, 0)
    away = node_a.away + node_b.away
    low, x, y = model_bound(node_a, node_b, shift, search.slack)
    x += 0.5
    y += 0.5
    d = difference(node_point(a, x), node_point(b, y), shift)
    far = length(d) * (1.0 + 16.0 * UNIT) + error + away
    early = clearance >= 0.0 and answer.count < _EARLY and far > 8.0 * clearance
    proven = False
    if search.question.polish and not early:
        curvatures = convexity(node_a, node_b, bezier_curve_at(b.record, 0).degree == 0, shift)
        proven = curvatures[0] > 0.0
        if proven or far < answer.upper:
            x, y = nearest_points(a, b, shift, x, y)
            low, far = proven_minimum(a, b, shift, error, curvatures, x, y)
    if far < answer.upper:
        keep_nearer(search, i, j, x, y, far)
    if proven:
        key = max(key, low)
        if far - low <= max(search.step, 16.0 * (error + away)):
            return key, True
    return key, is_answered(search.question, answer.upper, search.step, key)


@kernel(inline=True)
def first_half(tree, k, used):
    """The first half of node k, made as node `used` if need be; how many nodes there are then."""
    left = links_of(tree, k).left
    if left >= 0:
        return left, used
    split_node(tree, k, used)
    return used, used + 2


@kernel(inline=True)
def branch(search, key, i, j):
    """A bound of a pair, and the halves of its longer node with the other one; none where it is let go."""
    a, b = search.a, search.b
    state = search_state_at(search.state, 0)
    piece_a, piece_b = is_piece(a, i), is_piece(b, j)
    if piece_a and piece_b:
        key, final = examine(search, key, i, j)
        if final:
            return key, NO_PAIRS
    long_a = extent(a, i)
    long_b = extent(b, j) if bezier_curve_at(b.record, 0).degree > 0 else -1.0
    if max(long_a, long_b) <= search.step or max(links_of(a, i).depth, links_of(b, j).depth) >= _DEEPEST:
        return key, NO_PAIRS
    if piece_b if piece_a != piece_b else long_a >= long_b:
        half, used = first_half(a, i, int(state.used_a))
        state.used_a = used
        return key, Pairs(half, half + 2, j, j + 1)
    half, used = first_half(b, j, int(state.used_b))
    state.used_b = used
    return key, Pairs(i, i + 1, half, half + 2)


@kernel(inline=True, allocates=True)
def new_tree(record, pool):
    """A packed curve with its root."""
    tree = PieceTree(record, pool, np.empty(_ROOM * NODE_INTS, np.int64), np.empty(_ROOM * node_stride(record)))
    start_nodes(tree)
    return tree


advance = kernel(inner=True)(best_first(search_state_at, pair_bound, search_ended, branch))


@kernel(signatures="(i8[::1], f8[::1], i8[::1], f8[::1], Tuple((f8, f8, i8, b1)), b1, f8[::1])", allocates=True)
def curve_distance(ra, qa, rb, qb, asked, plane, out):
    """Bounds of the distance of two packed curves; a clearance below zero asks for the distance itself."""
    question = Question(*asked)
    a, b = new_tree(ra, qa), new_tree(rb, qb)
    head, other = bezier_head_at(qa, 0), bezier_head_at(qb, 0)
    shift = difference(other.center, head.center, (0.0, 0.0, 0.0))
    # Rounding of the sums in a difference of two points; the last number covers underflow.
    slack = 8.0 * UNIT * (head.reach + other.reach + length(shift)) + 1e-150
    error = slack + evaluation_error(ra, qa) + evaluation_error(rb, qb)
    # Bounds closer than this cannot be told apart.
    step = max(0.999 * question.tolerance, 8.0 * (error + head.error + other.error))
    heap, block = np.empty(_ROOM * PAIR), np.empty(STATE)
    answer = curve_answer_at(out, 0)
    answer.count = 0.0
    answer.upper = keep_starts(a, b, shift, answer) + error + head.error + other.error
    state = search_state_at(block, 0)
    state.limit = bound_to_beat(question, answer.upper, step)
    state.let_go = math.inf
    state.used_a, state.used_b, state.met = 1.0, 1.0, 0.0
    search = CurveSearch(a, b, heap, block, out, question, plane, shift, slack, error, step)
    status, left = advance(search, 0, Pairs(0, 1, 0, 1))
    while status == CROWDED:
        a, b, heap = roomier(search, left, NODE_INTS)
        search = CurveSearch(a, b, heap, block, out, question, plane, shift, slack, error, step)
        status, left = advance(search, left, NO_PAIRS)
    return status
