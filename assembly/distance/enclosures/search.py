"""Branch and bound for the distance of two curves, or of a curve and a hull (paper 003, algorithms 1 to 4).

A node is a pair of pieces with a lower bound of its distance. The heap gives the node with the least one, L; U is
the distance of the best points known. Then L <= distance <= U always, and a search ends when the question is answered:

    distance    U - L <= tolerance
    clearance   L > clearance (apart), or U <= clearance (not apart), or U - L <= tolerance (undecided)
    collision   L > 0 (disjoint), or a meeting is proven (hit), or U <= tolerance (undecided)

or when doubles tell no more: U - L is within some rounding errors of a point. Shapes are taken about a center; the
rounding of a hull's vertices by this is added to U and subtracted from L.

Otherwise the longer piece of the node is halved. With `polish` a node is also bounded by second derivatives
(`distance/enclosures/taylor.py`) about the points that Newton's method found: a node that holds an isolated minimum
need not be halved then.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._best_first import NO_PAIRS, Pairs, best_first
from assembly._heap import PAIR, longer, waiting_pair_at
from assembly._kernel import kernel
from assembly.distance.enclosures.enclosure import (
    BEZIER,
    HULL,
    PIECE,
    enclosed_piece_at,
    fill_piece,
    first_pieces,
    split_piece,
)
from assembly.distance.enclosures.gjk import ROOM
from assembly.distance.enclosures.node import EnclosedShape, EnclosureSearch, bound_node, domain_of, search_state_at
from assembly.distance.enclosures.taylor import crossing_proven, point_piece
from assembly.distance.piece_search import Question
from assembly.geometry.interval import EPSILON
from assembly.geometry.splines.bezier_ranges import ranged_curve_at

# Why a search ended.
CONVERGED, SEPARATED, NOT_SEPARATED, HIT, DISJOINT, UNDECIDED, BUDGET_SPENT, ROUNDED = range(8)
# The arrays are too small to go on.
CROWDED = 8
# Pairs that are bounded before the errors of points may end a search as ROUNDED.
LOOKS = 8
# Pieces of a curve, and pairs of them, that there is room for at first, beside the smooth parts.
_ROOM = 64


@kernel(inner=True, exact=True)
def proven_hit(search):
    """Whether two plane curves are proven to meet near the best parameters."""
    a, b, x = search.a, search.b, search.spare
    piece_a, piece_b = enclosed_piece_at(x, 0), enclosed_piece_at(x, PIECE)
    best = search_state_at(search.state, 0)
    lo_a, hi_a = domain_of(a.kind, a.pool)
    lo_b, hi_b = domain_of(b.kind, b.pool)
    s, t = best.at_s, best.at_t
    part = 1e-9
    for _ in range(3):
        h = part * (hi_a - lo_a)
        k = part * (hi_b - lo_b)
        part *= 100.0
        if not (lo_a <= s - h and s + h <= hi_a and lo_b <= t - k and t + k <= hi_b):
            return False
        piece_a.t0, piece_a.t1, piece_a.span = s - h, s + h, best.span_a
        piece_b.t0, piece_b.t1, piece_b.span = t - k, t + k, best.span_b
        fill_piece(a.kind, a.table, a.pool, a.workspace, x, 0)
        fill_piece(b.kind, b.table, b.pool, b.workspace, x, PIECE)
        if crossing_proven(x, 0, x, PIECE):
            return True
    return False


@kernel(inner=True, exact=True)
def verdict(lower, upper, met, tolerance, noise, clearance):
    """How a search ends with these bounds; -1: not yet."""
    if met:
        return HIT if not clearance > 0.0 else NOT_SEPARATED
    if clearance > 0.0:
        if lower > clearance:
            return SEPARATED
        if upper <= clearance:
            return NOT_SEPARATED
    if clearance == 0.0 and lower > 0.0:
        return DISJOINT
    if upper - lower <= tolerance:
        return CONVERGED if not clearance >= 0.0 else UNDECIDED
    return ROUNDED if upper - lower <= noise else -1


@kernel(inner=True, allocates=True, exact=True)
def about_center(points, count, center):
    """Vertices about a center, and how far they may be off."""
    moved = np.empty(3 * count)
    most = 0.0
    for k in range(3 * count):
        moved[k] = points[k] - center[k % 3]
        most = max(most, abs(moved[k]))
    # Half a unit of each coordinate, of which there are three.
    return moved, EPSILON * most


@kernel(inline=True)
def halves_a(piece_a, piece_b):
    """Whether to halve a: the longer piece or, if neither length is bounded, the longer parameter interval."""
    a, b = piece_a.length, piece_b.length
    if a == math.inf and b == math.inf:
        return piece_a.t1 - piece_a.t0 >= piece_b.t1 - piece_b.t0
    return a >= b


@kernel(inline=True)
def pair_bound(search, i, j):
    """Lower bound of the distance of two pieces, and the distance of their middles, which orders equal bounds."""
    best = search_state_at(search.state, 0)
    lower, upper = bound_node(search, PIECE * i, PIECE * j)
    # The least error over all pieces: that of a single point may be large, at a joint of the formula.
    best.off_a = min(best.off_a, enclosed_piece_at(search.a.pieces, PIECE * i).off)
    if search.b.kind != HULL:
        best.off_b = min(best.off_b, enclosed_piece_at(search.b.pieces, PIECE * j).off)
    best.limit = best.upper
    return lower, upper


@kernel(inline=True)
def is_full(shape, used):
    """Whether there is no room for two more pieces of a curve."""
    return shape.kind != HULL and used + 2 > shape.halves.size


@kernel(inner=True, exact=True)
def search_ended(search, top, left):
    """Why the search ends; -1: not yet."""
    question, best = search.question, search_state_at(search.state, 0)
    first = waiting_pair_at(search.heap, 0).bound
    best.lowest = min(max(best.lowest, min(best.upper, top)), best.upper)
    both = search.b.kind != HULL
    if search.full == 3 and both and best.met == 0.0 and best.upper <= question.tolerance:
        if not question.clearance > 0.0 and proven_hit(search):
            best.met = 1.0
    if best.met > 0.0:
        best.lowest = 0.0
    best.lower = max(best.lowest - best.slack, 0.0)
    noise = 0.0
    if best.count >= LOOKS and best.off_a + best.off_b < math.inf:
        noise = 8.0 * (best.off_a + best.off_b + best.slack)
    why = verdict(best.lower, best.upper, best.met > 0.0, question.tolerance, noise, question.clearance)
    if why >= 0:
        return why
    if best.count >= question.budget:
        return BUDGET_SPENT
    if left == 0 or first >= best.upper or first > best.let_go:
        return ROUNDED
    crowded = is_full(search.a, best.used_a) or is_full(search.b, best.used_b) or (left + 1) * PAIR > search.heap.size
    return CROWDED if crowded else -1


@kernel(inline=True)
def first_half(shape, k, used):
    """The first half of piece k, made as piece `used` if need be; how many pieces there are then.

    -1: it has none, because it is a hull or no double lies inside its interval.
    """
    if shape.kind == HULL:
        return -1, used
    x, halves = shape.pieces, shape.halves
    if halves[k] < 0 and split_piece(shape.kind, shape.table, shape.pool, shape.workspace, x, PIECE * k, PIECE * used):
        halves[k], halves[used], halves[used + 1] = used, -1, -1
        used += 2
    return halves[k], used


@kernel(inner=True)
def branch(search, lower, i, j):
    """The bound of a pair, and the halves of its longer piece with the other one; of the other if that has none."""
    a, b = search.a, search.b
    best = search_state_at(search.state, 0)
    on_a = halves_a(enclosed_piece_at(a.pieces, PIECE * i), enclosed_piece_at(b.pieces, PIECE * j))
    for _attempt in range(2):
        if on_a:
            half, used = first_half(a, i, int(best.used_a))
            best.used_a = used
            if half >= 0:
                return lower, Pairs(half, half + 2, j, j + 1)
        else:
            half, used = first_half(b, j, int(best.used_b))
            best.used_b = used
            if half >= 0:
                return lower, Pairs(i, i + 1, half, half + 2)
        on_a = not on_a
    return lower, NO_PAIRS


advance = kernel(inner=True)(best_first(search_state_at, pair_bound, search_ended, branch))


@kernel(inline=True, allocates=True)
def new_shape(operand, center):
    """A curve with its smooth parts as pieces, or a hull about the center; how many pieces, and how far it is off."""
    kind, table, pool, workspace = operand
    parts = ranged_curve_at(table, 0).pieces if kind == BEZIER else 1
    x = np.empty((parts + _ROOM) * PIECE)
    halves = np.full(parts + _ROOM, -1)
    shape = EnclosedShape(kind, table, pool, np.empty(workspace), halves, x, 0)
    if kind != HULL:
        first_pieces(kind, table, pool, shape.workspace, x)
        return shape, parts, 0.0
    count = table[1]
    vertices, off = about_center(pool, count, center)
    if count == 1:
        point_piece(vertices, 0, x)
    else:
        enclosed_piece_at(x, 0).length = -1.0
    return EnclosedShape(kind, table, vertices, shape.workspace, halves, x, count), parts, off


@kernel(inner=True, allocates=True)
def roomier(shape, used):
    """A shape, with four times the room where two more pieces have none."""
    if not is_full(shape, used):
        return shape
    halves, pieces = longer(shape.halves, 4 * shape.halves.size), longer(shape.pieces, 4 * shape.pieces.size)
    return EnclosedShape(shape.kind, shape.table, shape.pool, shape.workspace, halves, pieces, shape.count)


@kernel(
    signatures=(
        "(i8, Tuple((i8, i8[::1], f8[::1], i8)), Tuple((i8, i8[::1], f8[::1], i8)), f8[::1], "
        "Tuple((f8, f8, i8, b1)), i8, f8[::1])"
    ),
    allocates=True,
)
def search(full, operand_a, operand_b, center, asked, bound, state):
    """The search of the heading, for Python. `full` is the dimension plus one; a is a curve, b may be a hull.

    Operands are (kind, table, pool, length of the workspace). Curves are given about the center; a hull, and the points
    of the answer, are not. A clearance below zero asks for the distance. Returns why the search ended.
    """
    question = Question(*asked)
    a, used_a, _off = new_shape(operand_a, center)
    b, used_b, slack = new_shape(operand_b, center)
    spare, g = np.zeros(2 * PIECE), np.zeros(ROOM)
    still = enclosed_piece_at(spare, 0)
    still.first_end, still.last_end = 1.0, 1.0
    best = search_state_at(state, 0)
    best.upper, best.lowest, best.met, best.count, best.slack = math.inf, 0.0, 0.0, 0.0, slack
    best.let_go, best.off_a, best.off_b = math.inf, math.inf, 0.0 if b.kind == HULL else math.inf
    best.used_a, best.used_b = used_a, used_b
    heap = np.empty((used_a * used_b + _ROOM) * PAIR)
    lasting = EnclosureSearch(full, a, b, question, bound, heap, state, spare, g)
    why, left = advance(lasting, 0, Pairs(0, used_a, 0, used_b))
    while why == CROWDED:
        a, b = roomier(a, best.used_a), roomier(b, best.used_b)
        if (left + 1) * PAIR > heap.size:
            heap = longer(heap, 4 * heap.size)
        lasting = EnclosureSearch(full, a, b, question, bound, heap, state, spare, g)
        why, left = advance(lasting, left, NO_PAIRS)
    for k in range(3):
        best.point_a[k] += center[k]
        best.point_b[k] += center[k]
    return why
