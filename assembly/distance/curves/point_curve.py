"""Certified distance of a point and a spline curve, by the Bernstein form of its square.

On a span, with Y(x) = X(x) - w(x) p in Bernstein form of degree n,

    |C(x) - p|^2 = q(x) / v(x),    q = |Y|^2,  v = w^2,    both in Bernstein form of degree 2 n,

so that min q_k / v_k <= |C - p|^2 <= the value at any x. |X|^2, w X and w^2 are tables of the curve: a point costs
q_k = (|X|^2)_k - 2 p.(w X)_k + |p|^2 v_k. Newton's method finds a local minimum x*; where q - |D|^2 v, D = C(x*) - p,
is proven convex, it is the only one. Elsewhere the interval is cut at x*: q - |D|^2 v has a double root there, so that
on both sides the two q_k / v_k next to x* are |D|^2, and after a few more cuts no other one is less. The form and its
rounding errors are in `distance/curves/squared_distance.py`.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._address import call_address
from assembly._kernel import kernel
from assembly._lanes import lane
from assembly._newton import damped_newton
from assembly.distance.curves.nodes import length
from assembly.distance.curves.search import curve_answer_at, first_point
from assembly.distance.curves.squared_distance import (
    SQUARE,
    SpanPoint,
    convex_least,
    cut,
    form_square,
    interval_at,
    least_quotient,
    mend,
)
from assembly.distance.piece_search import APART, Question, ended, in_span
from assembly.geometry.nearest_place import Interval, move_along, sight_of, step_along
from assembly.geometry.splines.bezier_pieces import (
    BOX,
    UNIT,
    bezier_curve_at,
    bezier_derivatives,
    bezier_head_at,
)
from assembly.geometry.splines.evaluate import xyz
from assembly.geometry.vec import sub

_DEEPEST = 40
# Length of the list of nodes that are still to be looked at.
_STACK = 200
# Intervals of a span that are tried before the query is left to `curve_distance`: near a parameter at which the curve
# hardly moves, squares lose too many digits.
_PATIENCE = 64
_EARLY = 6
# Status of such a query, beside those of `distance/piece_search.py`.
UNFINISHED = 6
_NEAR_END = 1e-3
# A query of a point and a curve. p: the point about the curve's center; reach: no point of the curve is farther from p;
# error, away: how far an evaluated point, and the packed curve, may be off; step: bounds that differ by no more than
# this count as equal; work: intervals of a span.
PointQuery = namedtuple("PointQuery", "record pool p reach error away step clearance budget work")
# The same on an interval of a span.
SpanQuery = namedtuple("SpanQuery", "query span interval")
_QUESTION = "Tuple((f8, f8, i8, b1))"
_GIVEN = f"i8[::1], f8[::1], UniTuple(f8, 3), {_QUESTION}"


@kernel(inner=True)
def curve_at(record, pool, span, x):
    """A point of a span with its derivatives."""
    curve = bezier_curve_at(record, 0)
    n = curve.degree
    rows = curve.pieces + 4 * (n + 1) * span
    v, d, h = bezier_derivatives(pool, rows, pool, curve.binomials, n, x)
    w, dw = lane(v, 3), lane(d, 3)
    i = 1.0 / w
    p = i * v
    q = i * (d - dw * p)
    return SpanPoint(x, w, xyz(p), xyz(q), xyz(i * (h - (2.0 * dw) * q - lane(h, 3) * p)), dw)


@kernel(inline=True, exact=True)
def seen_at(query, span, x):
    """A point of a span relative to the query's point."""
    c = curve_at(query.record, query.pool, span, x)
    return SpanPoint(x, c.weight, sub(c.place, query.p), c.first, c.second, c.weight_rate)


@kernel(inline=True)
def _seen(asked, x):
    point = seen_at(asked.query, asked.span, x)
    return sight_of(point.place, point.first, point.second)


_nearest_from = kernel(inner=True)(damped_newton(_seen, step_along, move_along, steps=16))


@kernel(inner=True)
def minimize(query, span, low, high, x):
    """A local minimum of the distance on [low, high] by Newton's method from x."""
    return seen_at(query, span, _nearest_from(SpanQuery(query, span, Interval(low, high, False)), x)[2])


@kernel(inline=True)
def limit_of(query, upper):
    """Parts of the curve whose bound is at least this are let go (pruned)."""
    limit = upper - query.step
    return min(limit, query.clearance + 2.0 * query.away) if query.clearance >= 0.0 else limit


@kernel(inline=True)
def is_beyond(square, limit):
    """Whether a bound of a squared distance is not below a limit."""
    return limit <= 0.0 or square >= limit * limit


@kernel(inner=True, exact=True)
def span_distance(query, span, upper, let_go, bounded):
    """Take one span into account: (upper, let_go, pairs bounded, parameter on the span or -1)."""
    record, work = query.record, query.work
    curve = bezier_curve_at(record, 0)
    m = 2 * curve.degree + 1
    stride = SQUARE + m * (1 + curve.rational)
    form_square(record, query.pool, span, query.p, query.reach, work)
    found = -1.0
    looks = 0
    o = 0
    while o >= 0:
        bounded += 1
        least, k = least_quotient(record, work, o)
        low, high = interval_at(work, o).low, interval_at(work, o).high
        if is_beyond(least, limit_of(query, upper)):
            let_go = min(let_go, least)
            o -= stride
            continue
        looks += 1
        if bounded >= query.budget or looks > _PATIENCE or interval_at(work, o).cuts >= _DEEPEST:
            let_go = min(let_go, least)
            o -= stride
            continue
        # Newton's method starts where the least coefficient is; if it ends near an end, the cut is in the middle.
        point = seen_at(query, span, low + (high - low) * k / (m - 1.0))
        # Bounds alone may answer a question about a clearance.
        early = query.clearance >= 0.0 and looks < _EARLY and length(point.place) > 8.0 * query.clearance
        if not early:
            point = minimize(query, span, low, high, point.x)
        far = length(point.place) * (1.0 + 16.0 * UNIT) + query.error + query.away
        if far < upper:
            upper = far
            found = point.x
            if upper <= query.clearance:
                break
        if not early:
            least = max(least, convex_least(record, work, o, point, query.error, query.reach))
        if is_beyond(least, limit_of(query, upper)):
            let_go = min(let_go, least)
            o -= stride
            continue
        part = (point.x - low) / (high - low)
        if not _NEAR_END < part < 1.0 - _NEAR_END:
            part = 0.5
            point = seen_at(query, span, low + 0.5 * (high - low))
        behind = cut(record, work, o, part, query.reach)
        mend(record, work, o, behind, point, query.error, query.reach)
        o = behind
    return upper, let_go, bounded, found


@kernel(inline=True)
def box_square(record, pool, node, p):
    """Square of the distance of a point and a box of the tree."""
    b = bezier_curve_at(record, 0).tree + BOX * node
    total = 0.0
    for j in range(3):
        gap = abs(p[j] - pool[b + j]) * (1.0 - 4.0 * UNIT) - pool[b + 3 + j]
        if gap > 0.0:
            total += gap * gap
    return total * (1.0 - 8.0 * UNIT)


@kernel(inline=True)
def about_center(head, point):
    """A point about the center of a curve."""
    return (point[0] - head.center[0], point[1] - head.center[1], point[2] - head.center[2])


@kernel(inline=True)
def write_answer(pool, lower, upper, parameter, place, point, out):
    """Write the bounds, and the nearest point of a curve (about its center) to a point."""
    answer = curve_answer_at(out, 0)
    answer.lower = lower
    answer.upper = upper
    answer.parameter_a = parameter
    answer.parameter_b = 0.0
    for j in range(3):
        answer.point_a[j] = place[j] + bezier_head_at(pool, 0).center[j]
        answer.point_b[j] = point[j]


@kernel(inline=True, exact=True)
def point_query(record, pool, point, question, work):
    """A question about a packed curve and a point."""
    head = bezier_head_at(pool, 0)
    curve = bezier_curve_at(record, 0)
    p = about_center(head, point)
    reach = (head.reach + length(p)) * (1.0 + 16.0 * UNIT)
    away = head.error + 4.0 * UNIT * length(p) + 1e-150
    error = (1.0 + curve.rational) * (8.0 * curve.degree + 16.0) * UNIT * head.reach + 2.0 * UNIT * reach
    step = max(0.999 * question.tolerance, 8.0 * (away + error))
    return PointQuery(record, pool, p, reach, error, away, step, question.clearance, question.budget, work)


@kernel(signatures=f"({_GIVEN}, f8[::1], i8[::1], f8[::1])", exact=True)
def nearest_on_curve(record, pool, point, asked, work, stack, out):
    """Bounds of the distance of a point and a curve of degree 1 or more.

    An entry that one point and many are given to by its address: compiled into both, they differed in their last bits.
    """
    question = Question(*asked)
    query = point_query(record, pool, point, question, work)
    p = query.p
    curve = bezier_curve_at(record, 0)
    far = length(sub(first_point(record, pool), p))
    upper = far * (1.0 + 16.0 * UNIT) + query.error + query.away
    let_go = math.inf
    bounded = 0
    best_span = 0
    best = 0.0
    # Nodes of the tree that are still to be looked at: node, first and last span.
    stack[0] = 0
    stack[1] = 0
    stack[2] = curve.spans
    # The first point of the curve may be near enough.
    top = 3 if upper > query.clearance else 0
    while top > 0:
        top -= 3
        node = stack[top]
        first = stack[top + 1]
        last = stack[top + 2]
        if curve.spans > 1:
            square = box_square(record, pool, node, p)
            bounded += 1
            if is_beyond(square, limit_of(query, upper)) or bounded >= query.budget:
                let_go = min(let_go, square)
                continue
        if last - first == 1:
            upper, let_go, bounded, found = span_distance(query, first, upper, let_go, bounded)
            if found >= 0.0:
                best_span = first
                best = found
            if upper <= query.clearance:
                break
            continue
        middle = (first + last) // 2
        left = node + 1
        right = node + 2 * (middle - first)
        # The nearer one comes off first.
        swap = box_square(record, pool, left, p) > box_square(record, pool, right, p)
        for half in range(2):
            is_left = (half == 0) != swap
            stack[top] = right if is_left else left
            stack[top + 1] = middle if is_left else first
            stack[top + 2] = last if is_left else middle
            top += 3
    lower = 0.0
    if let_go > 0.0 and upper > query.clearance:
        lower = max(min(math.sqrt(let_go) * (1.0 - 8.0 * UNIT) - query.away, upper), 0.0)
    c = curve_at(record, pool, best_span, best).place
    write_answer(pool, lower, upper, in_span(pool, curve.breaks + best_span, best), c, point, out)
    curve_answer_at(out, 0).count = bounded
    status = ended(query, upper, query.step, lower, 1, bounded)
    return status if status >= 0 else UNFINISHED


@kernel(inline=True, allocates=True)
def work_for(record):
    """Memory for the intervals of a span."""
    curve = bezier_curve_at(record, 0)
    return np.empty((_DEEPEST + 2) * (SQUARE + (2 * curve.degree + 1) * (1 + curve.rational)))


@kernel(signatures=f"({_GIVEN}, i8, f8[::1])", allocates=True)
def point_distance(record, pool, point, asked, nearest, out):
    """Bounds of the distance of a point and a packed curve; a clearance below zero asks for the distance itself.

    `nearest` is the address of `nearest_on_curve`.
    """
    question = Question(*asked)
    if question.clearance >= 0.0:
        # The box around the whole curve may already prove it apart.
        head = bezier_head_at(pool, 0)
        p = about_center(head, point)
        far = math.sqrt(box_square(record, pool, 0, p)) * (1.0 - 8.0 * UNIT)
        far -= head.error + 4.0 * UNIT * length(p) + 1e-150
        if far > question.clearance:
            e = first_point(record, pool)
            upper = length(sub(e, p)) * (1.0 + 16.0 * UNIT) + 2.0 * head.error + 16.0 * UNIT * (head.reach + length(p))
            write_answer(pool, far, upper, pool[bezier_curve_at(record, 0).breaks], e, point, out)
            curve_answer_at(out, 0).count = 1
            return APART
    return call_address(nearest, (record, pool, point, asked, work_for(record), np.empty(_STACK, np.int64), out))


@kernel(signatures=f"(i8[::1], f8[::1], f8[:, ::1], {_QUESTION}, i8, i8[::1], f8[:, ::1])", allocates=True)
def point_distances(record, pool, points, asked, nearest, codes, out):
    """`point_distance` for the rows of an array (n, 3) into rows of `out` and `codes`, without a clearance."""
    work, stack = work_for(record), np.empty(_STACK, np.int64)
    for i in range(points.shape[0]):
        point = (points[i, 0], points[i, 1], points[i, 2])
        codes[i] = call_address(nearest, (record, pool, point, asked, work, stack, out[i]))
