"""Certified distance of two spline curves: branch and bound over pairs of Bezier pieces.

A heap holds pairs with their lower bounds. U is the distance of the nearest points known, L the least bound of all
pairs in the heap and of all that were let go; L <= distance <= U at any time. A pair is let go once its bound is within
the tolerance of U; where the distance is proven convex on a pair, its minimum is found by Newton's method and

    F(x) >= F(x*) + sum_i min over the box of (g_i d_i + lambda_i d_i^2 / 2)

bounds it for good. Anything else is halved, the longer piece first. `docs/proximity.md` has the argument in words.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of
from assembly.distance.curves.bounds import box_bound, convexity, hull_bound, least_change, model_bound
from assembly.distance.curves.newton import difference, nearest_points, node_derivatives, node_point
from assembly.distance.curves.nodes import (
    A2,
    BOX_HALF,
    NODE_INTS,
    curve_node_at,
    curve_node_links_at,
    length,
    node_stride,
    split_node,
    start_nodes,
    three,
)
from assembly.geometry.splines.bezier_pieces import (
    UNIT,
    bezier_curve_at,
    bezier_head_at,
)
from assembly.geometry.vec import dot

# What a search ended with.
CONVERGED, APART, NEAR, UNDECIDED, SPENT, MEETING = 0, 1, 2, 3, 4, 5
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
LOWER = place_of(CURVE_ANSWER, "lower")
UPPER = place_of(CURVE_ANSWER, "upper")
POINT_A = place_of(CURVE_ANSWER, "point_a")
POINT_B = place_of(CURVE_ANSWER, "point_b")
COUNT = place_of(CURVE_ANSWER, "count")
ANSWER = size_of(CURVE_ANSWER)
_DEEPEST = 48
_ROOM = 64
# Pairs for which a question that bounds alone may answer is not helped by Newton's method.
_EARLY = 24


@kernel(inner=True)
def push(keys, first, second, count, key, a, b):
    """Add a pair to a heap of `count`."""
    i = count
    while i > 0:
        parent = (i - 1) >> 1
        # Of equal bounds the newest goes first: down to pieces, whose points make U smaller.
        if keys[parent] < key:
            break
        keys[i] = keys[parent]
        first[i] = first[parent]
        second[i] = second[parent]
        i = parent
    keys[i] = key
    first[i] = a
    second[i] = b


@kernel(inner=True)
def pop(keys, first, second, count):
    """Take the least pair off a heap of `count`: the last one goes down from its place."""
    last = count - 1
    key = keys[last]
    a = first[last]
    b = second[last]
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
        first[i] = first[child]
        second[i] = second[child]
        i = child
    keys[i] = key
    first[i] = a
    second[i] = b


@kernel(inner=True, allocates=True)
def longer(array, size):
    """A longer copy."""
    result = np.empty(size, array.dtype)
    for i in range(array.size):
        result[i] = array[i]
    return result


@kernel(inline=True)
def bound_to_beat(upper, step, clearance):
    """Pairs of at least this bound are let go."""
    limit = upper - step
    if clearance >= 0.0:
        limit = min(limit, clearance * (1.0 + 4.0 * UNIT) + 1e-300)
    return limit


@kernel(inline=True)
def ended(top, upper, step, clearance, left, bounded, budget):
    """What a search with `left` pairs in its heap ends with; -1: not yet."""
    if clearance >= 0.0:
        if upper <= clearance:
            return NEAR
        if top > clearance:
            return APART
    if left == 0 or upper - top <= step:
        return UNDECIDED if clearance >= 0.0 else CONVERGED
    return SPENT if bounded >= budget else -1


@kernel(inline=True)
def is_piece(ints, k):
    """Whether a node is a Bezier piece, and not several spans."""
    links = curve_node_links_at(ints, NODE_INTS * k)
    return links.last - links.first == 1


@kernel(inline=True)
def size_of(ints, nodes, stride, k):
    """Length of a piece, or half the diagonal of the box of several."""
    o = stride * k
    if is_piece(ints, k):
        return curve_node_at(nodes, o).speed
    return 2.0 * length(three(nodes, o + BOX_HALF))


@kernel(inline=True)
def evaluation_error(record, pool):
    """How far an evaluated point may be from the packed curve (see `proven_minimum`)."""
    curve = bezier_curve_at(record, 0)
    return (1.0 + curve.rational) * (8.0 * curve.degree + 16.0) * UNIT * bezier_head_at(pool, 0).reach


@kernel(inner=True, exact=True)
def proven_minimum(ra, qa, a, o, rb, qb, b, p, shift, error, lambda_a, lambda_b, x, y):
    """Lower bound of the distance on a box where the Hessian is at least diag(lambda_a, lambda_b), from a point of it.

    Horner's rule multiplies the term i by at most 6 n + 10 rounded factors, all terms are positive multiples of control
    points: a point has an error below (6 n + 10) u REACH, a derivative the same part of n times the largest difference.
    """
    node = curve_node_at(a, o)
    node_record = curve_node_at(b, p)
    curve = bezier_curve_at(ra, 0)
    head = bezier_head_at(qa, 0)
    curve_record = bezier_curve_at(rb, 0)
    pool_head = bezier_head_at(qb, 0)
    u, du, _hu = node_derivatives(ra, qa, a, o, x)
    v, dv, _hv = node_derivatives(rb, qb, b, p, y)
    d = difference(u, v, shift)
    far = length(d)
    size = 16.0 * UNIT * far
    gx = dot(d, du)
    speed_a = node.speed
    speed_b = node_record.speed
    ea = (
        (16.0 * curve.degree + 40.0)
        * UNIT
        * (speed_a + 2.0 * curve.rational * curve.degree * head.reach * head.weight_ratio)
    )
    eb = (
        (16.0 * curve_record.degree + 40.0)
        * UNIT
        * (speed_b + 2.0 * curve_record.rational * curve_record.degree * pool_head.reach * pool_head.weight_ratio)
    )
    change = least_change(gx, (error + size) * (speed_a + ea) + far * ea, lambda_a, x, 1.0 - x)
    if curve_record.degree > 0:
        change += least_change(-dot(d, dv), (error + size) * (speed_b + eb) + far * eb, lambda_b, y, 1.0 - y)
    near = max(far - size - error, 0.0)
    square = near * near + 2.0 * change * (1.0 + 1e-12)
    lower = math.sqrt(square) * (1.0 - 8.0 * UNIT) if square > 0.0 else 0.0
    return lower - node.away - node_record.away, far + size + error + node.away + node_record.away


@kernel(inner=True)
def keep(ra, qa, ia, a, ka, rb, qb, ib, b, kb, x, y, upper, out):
    """Write nearest points that are known: the points at (x, y) of two nodes."""
    answer = curve_answer_at(out, 0)
    o = node_stride(ra) * ka
    p = node_stride(rb) * kb
    answer.upper = upper
    answer.parameter_a = parameter(ra, qa, ia, a, ka, o, x)
    answer.parameter_b = parameter(rb, qb, ib, b, kb, p, y)
    u = node_point(ra, qa, a, o, x)
    v = node_point(rb, qb, b, p, y)
    for j in range(3):
        answer.point_a[j] = u[j] + bezier_head_at(qa, 0).center[j]
        answer.point_b[j] = v[j] + bezier_head_at(qb, 0).center[j]


@kernel(inner=True)
def keep_starts(ra, qa, rb, qb, shift, out):
    """Write the first points of both curves as the nearest that are known; their distance, rounded up."""
    curve = bezier_curve_at(ra, 0)
    curve_record = bezier_curve_at(rb, 0)
    answer = curve_answer_at(out, 0)
    o = curve.pieces
    p = curve_record.pieces
    wa = 1.0 / qa[o + 3]
    wb = 1.0 / qb[p + 3]
    u = (wa * qa[o], wa * qa[o + 1], wa * qa[o + 2])
    v = (wb * qb[p], wb * qb[p + 1], wb * qb[p + 2])
    answer.parameter_a = qa[curve.breaks]
    answer.parameter_b = qb[curve_record.breaks]
    for j in range(3):
        answer.point_a[j] = u[j] + bezier_head_at(qa, 0).center[j]
        answer.point_b[j] = v[j] + bezier_head_at(qb, 0).center[j]
    return length(difference(u, v, shift)) * (1.0 + 16.0 * UNIT)


@kernel(inline=True)
def parameter(record, pool, ints, nodes, k, o, x):
    """The curve's parameter of a place on a node."""
    node = curve_node_at(nodes, o)
    at = bezier_curve_at(record, 0).breaks + curve_node_links_at(ints, NODE_INTS * k).first
    u = node.begin + x * (node.end - node.begin)
    return in_span(pool, at, u)


@kernel(inline=True)
def in_span(pool, at, u):
    """The parameter of a place from 0 to 1 on the span that begins at pool[at]; rounding does not lead out of it."""
    low = pool[at]
    high = pool[at + 1]
    return min(max(low * (1.0 - u) + high * u, low), high)


@kernel(inner=True, exact=True)
def meeting_proven(ra, qa, a, o, rb, qb, b, p, shift, error, x, y):
    """Whether two plane pieces are proven to cross near (x, y) of their unit square.

    z - J^-1 D(z), J = (a', -b') at (x, y), maps a square of half width r into itself, so that it has a fixed point
    (Brouwer), a zero of D, if |J^-1| (|D| + (sup |a''| + sup |b''|) r^2 + rounding) <= r. D may be any continuous
    function within the error, the given curves' among them.
    """
    node = curve_node_at(a, o)
    node_record = curve_node_at(b, p)
    if bezier_curve_at(rb, 0).degree == 0:
        return False
    u, du, _hu = node_derivatives(ra, qa, a, o, x)
    v, dv, _hv = node_derivatives(rb, qb, b, p, y)
    d = difference(u, v, shift)
    det = abs(du[1] * dv[0] - du[0] * dv[1])
    if not det > 1e-6 * length(du) * length(dv):
        return False
    # The rows of the inverse are at most this long.
    inverse = max(length(du), length(dv)) / det
    far = length(d) * (1.0 + 16.0 * UNIT) + error + node.away + node_record.away
    bend = length(three(a, o + A2)) + node.e2 + length(three(b, p + A2)) + node_record.e2
    r = min(min(x, 1.0 - x), min(y, 1.0 - y))
    if bend * inverse * r > 0.25:
        r = 0.25 / (bend * inverse)
    # 1e-8 r stands for the rounding of J, its inverse and the products, at most 1e6 times the last place.
    return inverse * (far + bend * r * r) * (1.0 + 1e-8) + 1e-8 * r < r


@kernel(signatures="(i8[::1], f8[::1], i8[::1], f8[::1], f8, f8, i8, b1, b1, f8[::1])", allocates=True)
def curve_distance(ra, qa, rb, qb, tolerance, clearance, budget, polish, plane, out):
    """Bounds of the distance of two packed curves; a clearance below zero asks for the distance itself."""
    head = bezier_head_at(qb, 0)
    pool_head = bezier_head_at(qa, 0)
    curve = bezier_curve_at(rb, 0)
    answer = curve_answer_at(out, 0)
    shift = (
        head.center[0] - pool_head.center[0],
        head.center[1] - pool_head.center[1],
        head.center[2] - pool_head.center[2],
    )
    # Of the sums that lead to a difference of two points; the last number is for what underflows.
    slack = 8.0 * UNIT * (pool_head.reach + head.reach + length(shift)) + 1e-150
    error = slack + evaluation_error(ra, qa) + evaluation_error(rb, qb)
    # Nothing closer than this can be told apart.
    step = max(0.999 * tolerance, 8.0 * (error + pool_head.error + head.error))
    sa = node_stride(ra)
    sb = node_stride(rb)
    room_a = _ROOM
    room_b = _ROOM if curve.degree > 0 else 2
    room = _ROOM
    a = np.empty(room_a * sa)
    b = np.empty(room_b * sb)
    ia = np.empty(room_a * NODE_INTS, np.int64)
    ib = np.empty(room_b * NODE_INTS, np.int64)
    keys = np.empty(room)
    first = np.empty(room, np.int64)
    second = np.empty(room, np.int64)
    start_nodes(ra, qa, ia, a)
    start_nodes(rb, qb, ib, b)
    used_a = 1
    used_b = 1
    count = 0
    upper = keep_starts(ra, qa, rb, qb, shift, out) + error + pool_head.error + head.error
    answer.upper = upper
    let_go = math.inf
    bounded = 0
    status = CONVERGED
    key = 0.0
    ka = 0
    kb = 0
    # The pairs that a halving made: one at the start.
    halves = 1
    split_a = False
    while True:
        limit = bound_to_beat(upper, step, clearance)
        for half in range(halves):
            ja = ka
            jb = kb
            if halves == 2:
                if split_a:
                    ja = curve_node_links_at(ia, NODE_INTS * ka).left + half
                else:
                    jb = curve_node_links_at(ib, NODE_INTS * kb).left + half
            oa = sa * ja
            ob = sb * jb
            bounded += 1
            bound = max(key, box_bound(a, oa, b, ob, shift, slack))
            if bound < limit and is_piece(ia, ja) and is_piece(ib, jb):
                low, x, y = model_bound(a, oa, b, ob, shift, slack)
                bound = max(bound, low)
                if bound < limit:
                    bound = max(bound, hull_bound(ra, a, oa, rb, b, ob, shift, slack, x, y))
            if bound < limit:
                push(keys, first, second, count, bound, ja, jb)
                count += 1
            else:
                let_go = min(let_go, bound)
        halves = 0
        top = min(keys[0], let_go) if count > 0 else let_go
        if status == MEETING:
            break
        status = ended(top, upper, step, clearance, count, bounded, budget)
        if status >= 0:
            break
        key = keys[0]
        ka = first[0]
        kb = second[0]
        pop(keys, first, second, count)
        count -= 1
        oa = sa * ka
        ob = sb * kb
        piece_a = is_piece(ia, ka)
        piece_b = is_piece(ib, kb)
        if piece_a and piece_b:
            away = curve_node_at(a, oa).away + curve_node_at(b, ob).away
            low, x, y = model_bound(a, oa, b, ob, shift, slack)
            x += 0.5
            y += 0.5
            d = difference(node_point(ra, qa, a, oa, x), node_point(rb, qb, b, ob, y), shift)
            far = length(d) * (1.0 + 16.0 * UNIT) + error + away
            early = clearance >= 0.0 and bounded < _EARLY and far > 8.0 * clearance
            proven = False
            if polish and not early:
                lambda_a, lambda_b = convexity(ra, a, oa, rb, b, ob, shift)
                proven = lambda_a > 0.0
                if proven or far < upper:
                    x, y = nearest_points(ra, qa, a, oa, rb, qb, b, ob, shift, x, y)
                    low, far = proven_minimum(ra, qa, a, oa, rb, qb, b, ob, shift, error, lambda_a, lambda_b, x, y)
            if far < upper:
                upper = far
                keep(ra, qa, ia, a, ka, rb, qb, ib, b, kb, x, y, upper, out)
                # Points that prove a distance of at most a clearance are as near to each other as doubles tell.
                if plane and (clearance == 0.0 or (clearance > 0.0 and far <= 16.0 * (error + away))):
                    if meeting_proven(ra, qa, a, oa, rb, qb, b, ob, shift, error, x, y):
                        status = MEETING
            if proven:
                key = max(key, low)
                if far - low <= max(step, 16.0 * (error + away)):
                    let_go = min(let_go, key)
                    continue
            if key >= upper - step or (key > clearance >= 0.0):
                let_go = min(let_go, key)
                continue
        # Halve the longer one.
        long_a = size_of(ia, a, sa, ka)
        long_b = size_of(ib, b, sb, kb) if curve.degree > 0 else -1.0
        split_a = long_a >= long_b
        if piece_a != piece_b:
            split_a = piece_b
        if (
            max(long_a, long_b) <= step
            or max(curve_node_links_at(ia, NODE_INTS * ka).depth, curve_node_links_at(ib, NODE_INTS * kb).depth)
            >= _DEEPEST
        ):
            let_go = min(let_go, key)
            continue
        if split_a:
            if curve_node_links_at(ia, NODE_INTS * ka).left < 0:
                if used_a + 2 > room_a:
                    room_a *= 4
                    a = longer(a, room_a * sa)
                    ia = longer(ia, room_a * NODE_INTS)
                split_node(ra, qa, ia, a, ka, used_a)
                used_a += 2
        elif curve_node_links_at(ib, NODE_INTS * kb).left < 0:
            if used_b + 2 > room_b:
                room_b *= 4
                b = longer(b, room_b * sb)
                ib = longer(ib, room_b * NODE_INTS)
            split_node(rb, qb, ib, b, kb, used_b)
            used_b += 2
        if count + 2 > room:
            room *= 4
            keys = longer(keys, room)
            first = longer(first, room)
            second = longer(second, room)
        halves = 2
    answer.lower = 0.0 if status == MEETING else max(min(top, upper), 0.0)
    answer.count = bounded
    return status
