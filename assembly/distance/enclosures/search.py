"""Branch and bound for the distance of two curves, or of a curve and a hull: what is certain after every step.

A node is a pair of pieces with a lower bound of its distance. The heap gives the node with the least one, L; U is
the distance of the best points known. Then L <= distance <= U always, and a search ends when the question is answered:

    distance    U - L <= tolerance
    clearance   L > clearance (apart), or U <= clearance (not apart), or U - L <= tolerance (undecided)
    collision   L > 0 (disjoint), or a meeting is proven (hit), or U <= tolerance (undecided)

or when doubles end: U - L is no more than some roundings of a point. Shapes are taken about a center; what this changes
the vertices of a hull by is added to U and taken from L.

Otherwise the longer piece of the node is halved. With `polish` a node is also bounded by second derivatives
(`distance/enclosures/taylor.py`) about the points that Newton's method found, so that an isolated minimum ends at once.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.distance.enclosures.enclosure import (
    HULL,
    MID,
    PIECE,
    enclosed_piece_at,
    fill_piece,
    first_pieces,
    split_piece,
)
from assembly.distance.enclosures.gjk import ROOM
from assembly.distance.enclosures.node import (
    bound_node,
    domain_of,
    search_state_at,
)
from assembly.distance.enclosures.taylor import crossing_proven, point_piece
from assembly.geometry.interval import UNIT

# Why a search ended.
CONVERGED, SEPARATED, NOT_SEPARATED, HIT, DISJOINT, UNDECIDED, BUDGET_SPENT, ROUNDED = range(8)
# Bounds of nodes before what points may be off is believed.
LOOKS = 8
# A pair of pieces in the heap.
PAIR_NODE = record_dtype(
    "f8",
    lower=1,  # bounds of its distance [length]
    upper=1,
    piece_a=1,  # numbers of the pieces' records
    piece_b=1,
)
node_at = record_view(PAIR_NODE)
NODE = size_of(PAIR_NODE)


@kernel(inline=True)
def put_node(heap, k, lower, upper, i, j):
    """Write node k of the heap."""
    node = node_at(heap, NODE * k)
    node.lower, node.upper, node.piece_a, node.piece_b = lower, upper, i, j


@kernel(inner=True)
def push(heap, size, lower, upper, i, j):
    """Add a node; the least (lower, upper) is at the top."""
    k = size
    while k > 0:
        parent = (k - 1) // 2
        above = node_at(heap, NODE * parent)
        if above.lower < lower or (above.lower == lower and above.upper <= upper):
            break
        put_node(heap, k, above.lower, above.upper, above.piece_a, above.piece_b)
        k = parent
    put_node(heap, k, lower, upper, i, j)
    return size + 1


@kernel(inner=True)
def drop_top(heap, size):
    """Remove the top."""
    size -= 1
    last = node_at(heap, NODE * size)
    lower, upper, i, j = last.lower, last.upper, last.piece_a, last.piece_b
    k = 0
    while True:
        child = 2 * k + 1
        if child >= size:
            break
        below = node_at(heap, NODE * child)
        if child + 1 < size:
            beside = node_at(heap, NODE * (child + 1))
            if (beside.lower, beside.upper) < (below.lower, below.upper):
                child += 1
                below = beside
        if (lower, upper) <= (below.lower, below.upper):
            break
        put_node(heap, k, below.lower, below.upper, below.piece_a, below.piece_b)
        k = child
    put_node(heap, k, lower, upper, i, j)
    return size


@kernel(inner=True, exact=True)
def proven_hit(ka, ta, pa, ra, xa, oa, kb, tb, pb, rb, xb, ob, state):
    """Whether two plane curves are proven to meet near the best parameters. Overwrites the records at oa and ob."""
    piece = enclosed_piece_at(xa, oa)
    piece_record = enclosed_piece_at(xb, ob)
    best = search_state_at(state, 0)
    lo_a, hi_a = domain_of(ka, pa)
    lo_b, hi_b = domain_of(kb, pb)
    s, t = best.at_s, best.at_t
    part = 1e-9
    for _ in range(3):
        h = part * (hi_a - lo_a)
        k = part * (hi_b - lo_b)
        part *= 100.0
        if not (lo_a <= s - h and s + h <= hi_a and lo_b <= t - k and t + k <= hi_b):
            return False
        piece.t0, piece.t1, piece.span = s - h, s + h, best.span_a
        piece_record.t0, piece_record.t1, piece_record.span = t - k, t + k, best.span_b
        fill_piece(ka, ta, pa, ra, xa, oa)
        fill_piece(kb, tb, pb, rb, xb, ob)
        if crossing_proven(xa, oa, xb, ob, xa, oa + MID, xb, ob + MID):
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
    return moved, UNIT * most


@kernel(inner=True)
def least_off(x, count):
    """How far points of the best known of the first pieces may be off."""
    least = math.inf
    for i in range(count):
        least = min(least, enclosed_piece_at(x, PIECE * i).off)
    return least


@kernel(inner=True)
def longer(xa, oa, xb, ob):
    """Whether a is the piece to halve; one that cannot be bounded goes first, then the one longer in its parameter."""
    piece = enclosed_piece_at(xa, oa)
    piece_record = enclosed_piece_at(xb, ob)
    a, b = piece.length, piece_record.length
    if a == math.inf and b == math.inf:
        return piece.t1 - piece.t0 >= piece_record.t1 - piece_record.t0
    return a >= b


@kernel(
    signatures=(
        "(i8, i8, i8[::1], f8[::1], f8[::1], i8, i8[::1], f8[::1], f8[::1], f8[::1], f8, f8, i8, b1, i8, "
        "f8[::1], f8[::1], i8[:, ::1], f8[::1], f8[::1])"
    ),
)
def search(
    full,
    ka,
    ta,
    pa,
    ra,
    kb,
    tb,
    pb,
    rb,
    center,
    tolerance,
    clearance,
    bound,
    polish,
    budget,
    xa,
    xb,
    child,
    heap,
    state,
):
    """The search of the heading, for Python. `full` is the dimension and one; b may be a hull, a is a curve.

    Curves are given about the center, a hull is not; the points of the answer are not, either.

    Records of pieces go to xa and xb, their children to child (2, pieces), nodes to the heap; the state is described
    above, the lower bound goes behind it. A clearance below zero asks for the distance. Returns why it ended.
    """
    best = search_state_at(state, 0)
    g = np.zeros(ROOM)
    zero = np.zeros(PIECE)
    piece = enclosed_piece_at(zero, 0)
    piece.first_end = 1.0
    piece.last_end = 1.0
    best.upper = math.inf
    best.met = 0.0
    best.count = 0.0
    best.slack = 0.0
    room_a, room_b = child.shape[1] - 2, child.shape[1] - 2
    used_a = first_pieces(ka, ta, pa, ra, xa)
    count = 0
    if kb == HULL:
        count = tb[1]
        used_b = 1
        pb, best.slack = about_center(pb, count, center)
        if count == 1:
            point_piece(pb, 0, xb)
        else:
            enclosed_piece_at(xb, 0).length = -1.0
    else:
        used_b = first_pieces(kb, tb, pb, rb, xb)
    child[:, : max(used_a, used_b)] = -1
    slack = best.slack
    noise = 0.0
    size = 0
    for i in range(used_a):
        for j in range(used_b):
            lower, upper = bound_node(
                full,
                ka,
                ta,
                pa,
                ra,
                xa,
                PIECE * i,
                kb,
                tb,
                pb,
                rb,
                xb,
                PIECE * j,
                count,
                bound,
                polish,
                tolerance,
                clearance,
                state,
                zero,
                g,
            )
            if lower < best.upper:
                size = push(heap, size, lower, upper, i, j)
    # Of the best known pieces: a single point may be unlucky, at a joint of the formula.
    off_a = least_off(xa, used_a)
    off_b = least_off(xb, used_b) if kb != HULL else 0.0
    why = -1
    lowest = 0.0
    stuck = math.inf
    crowded = False
    lower_bound = 0.0
    top = node_at(heap, 0)
    while True:
        while size > 0 and top.lower >= best.upper:
            size = 0
        lowest = max(lowest, min(min(best.upper, stuck), top.lower if size > 0 else math.inf))
        lowest = min(lowest, best.upper)
        if best.met > 0.0:
            lowest = 0.0
        if full == 3 and kb != HULL and best.met == 0.0 and best.upper <= tolerance and not clearance > 0.0:
            if proven_hit(ka, ta, pa, ra, xa, PIECE * room_a, kb, tb, pb, rb, xb, PIECE * room_b, state):
                best.met = 1.0
                lowest = 0.0
        lower_bound = max(lowest - slack, 0.0)
        if best.count >= LOOKS and off_a + off_b < math.inf:
            noise = 8.0 * (off_a + off_b + slack)
        why = verdict(lower_bound, best.upper, best.met > 0.0, tolerance, noise, clearance)
        if why >= 0:
            break
        if best.count >= budget:
            why = BUDGET_SPENT
            break
        if size == 0 or top.lower > stuck:
            why = BUDGET_SPENT if crowded else ROUNDED
            break
        i, j = int(top.piece_a), int(top.piece_b)
        parent = top.lower
        size = drop_top(heap, size)
        halve_a = longer(xa, PIECE * i, xb, PIECE * j)
        done = False
        for _attempt in range(2):
            if halve_a and child[0, i] < 0 and used_a + 2 <= room_a:
                if split_piece(ka, ta, pa, ra, xa, PIECE * i, PIECE * used_a):
                    child[0, i] = used_a
                    child[0, used_a : used_a + 2] = -1
                    used_a += 2
            if not halve_a and kb != HULL and child[1, j] < 0 and used_b + 2 <= room_b:
                if split_piece(kb, tb, pb, rb, xb, PIECE * j, PIECE * used_b):
                    child[1, j] = used_b
                    child[1, used_b : used_b + 2] = -1
                    used_b += 2
            done = child[0, i] >= 0 if halve_a else child[1, j] >= 0
            if done:
                break
            halve_a = not halve_a
        if not done:
            # Doubles end here, or the room: its bound is final.
            stuck = min(stuck, parent)
            crowded = crowded or used_a + 2 > room_a or used_b + 2 > room_b
            continue
        for side in range(2):
            p = child[0, i] + side if halve_a else i
            q = j if halve_a else child[1, j] + side
            lower, upper = bound_node(
                full,
                ka,
                ta,
                pa,
                ra,
                xa,
                PIECE * p,
                kb,
                tb,
                pb,
                rb,
                xb,
                PIECE * q,
                count,
                bound,
                polish,
                tolerance,
                clearance,
                state,
                zero,
                g,
            )
            lower = max(lower, parent)
            off_a = min(off_a, enclosed_piece_at(xa, PIECE * p).off)
            if kb != HULL:
                off_b = min(off_b, enclosed_piece_at(xb, PIECE * q).off)
            if lower < best.upper and best.met == 0.0:
                size = push(heap, size, lower, upper, p, q)
    best.lower = lower_bound
    for k in range(3):
        best.point_a[k] += center[k]
        best.point_b[k] += center[k]
    return why
