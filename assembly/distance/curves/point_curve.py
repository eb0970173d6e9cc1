"""Certified distance of a point and a spline curve, by the Bernstein form of its square.

On a span, with Y(x) = X(x) - w(x) p in Bernstein form of degree n,

    |C(x) - p|^2 = q(x) / v(x),    q = |Y|^2,  v = w^2,    both in Bernstein form of degree 2 n,

so that min q_k / v_k <= |C - p|^2 <= the value at any x. |X|^2, w X and w^2 are tables of the curve: a point costs
q_k = (|X|^2)_k - 2 p.(w X)_k + |p|^2 v_k. Newton's method finds a local minimum x*; where q - |D|^2 v, D = C(x*) - p,
is proven convex, it is the only one. Elsewhere the interval is cut there: q - |D|^2 v has a double root at x*, so that
on both sides the coefficients near x* are as large as its value, and the others soon are. The form is in
`distance/curves/squared_distance.py`, with its rounding.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly._lanes import lane
from assembly.distance.curves.nodes import length
from assembly.distance.curves.search import (
    APART,
    CONVERGED,
    NEAR,
    SPENT,
    UNDECIDED,
    curve_answer_at,
    in_span,
)
from assembly.distance.curves.squared_distance import (
    SQUARE,
    convex_least,
    cut,
    form_square,
    interval_at,
    least_quotient,
    mend,
)
from assembly.geometry.splines.bezier_pieces import (
    BOX,
    UNIT,
    bezier_curve_at,
    bezier_derivatives,
    bezier_head_at,
)
from assembly.geometry.splines.evaluate import xyz
from assembly.geometry.vec import dot, sub

_DEEPEST = 40
# Intervals of a span before it is left to `curve_distance`: beside a point where the curve hardly moves, squares lose
# too many digits.
_PATIENCE = 64
_EARLY = 6
# Status of such a query, beside those of `distance/curves/search.py`.
UNFINISHED = 6
_NEWTON = 12
_NEAR_END = 1e-3


@kernel(inner=True)
def curve_at(record, pool, span, x):
    """w, C, C', C'', w' / w and X' of a span."""
    curve = bezier_curve_at(record, 0)
    n = curve.degree
    rows = curve.pieces + 4 * (n + 1) * span
    v, d, h = bezier_derivatives(pool, rows, pool, curve.binomials, n, x)
    w = lane(v, 3)
    i = 1.0 / w
    p = i * v
    q = i * (d - lane(d, 3) * p)
    return w, xyz(p), xyz(q), xyz(i * (h - (2.0 * lane(d, 3)) * q - lane(h, 3) * p)), lane(d, 3)


@kernel(inner=True)
def minimize(record, pool, span, p, low, high, x):
    """A local minimum of the distance on [low, high] by Newton's method from x: x, the distance, w, D and Y'."""
    best = math.inf
    at = x
    step = high - low
    weight, c, d, h, dw = curve_at(record, pool, span, x)
    e = sub(c, p)
    best = dot(e, e)
    for _ in range(_NEWTON):
        slope = dot(e, d)
        speed = dot(d, d)
        curvature = speed + dot(e, h)
        # Not convex there: as if the curve were straight.
        step = -slope / (curvature if curvature > 0.05 * speed else speed) if speed > 0.0 else 0.0
        if not abs(step) < high - low:
            step = math.copysign(high - low, step)
        shorter = 0
        while True:
            x = min(max(at + step, low), high)
            if abs(x - at) <= 1e-16 * (1.0 + abs(at)):
                return at, weight, e, d, dw
            w1, c, d1, h1, dw1 = curve_at(record, pool, span, x)
            e1 = sub(c, p)
            square = dot(e1, e1)
            if square < best:
                break
            shorter += 1
            if shorter > 8 or slope * step > -1e-16 * best:
                return at, weight, e, d, dw
            step *= 0.25
        at = x
        best = square
        weight, e, d, h, dw = w1, e1, d1, h1, dw1
    return at, weight, e, d, dw


@kernel(inner=True, exact=True)
def span_distance(
    record, pool, span, p, reach, error, away, step, clearance, budget, work, upper, let_go, bounded, out
):
    """Take one span into account: (upper, let_go, pairs bounded, parameter on the span or -1)."""
    curve = bezier_curve_at(record, 0)
    n = curve.degree
    m = 2 * n + 1
    stride = SQUARE + m * (1 + curve.rational)
    form_square(record, pool, span, p, reach, work)
    found = -1.0
    looks = 0
    o = 0
    while o >= 0:
        bounded += 1
        limit = upper - step
        if clearance >= 0.0:
            limit = min(limit, clearance + 2.0 * away)
        least, k = least_quotient(record, work, o)
        low = interval_at(work, o).low
        high = interval_at(work, o).high
        if limit <= 0.0 or least >= limit * limit:
            let_go = min(let_go, least)
            o -= stride
            continue
        looks += 1
        if bounded >= budget or looks > _PATIENCE or interval_at(work, o).cuts >= _DEEPEST:
            let_go = min(let_go, least)
            o -= stride
            continue
        # From the least coefficient; at an end the cut is in the middle, where its own minimum is not.
        x = low + (high - low) * k / (m - 1.0)
        w, c, d, _h, dw = curve_at(record, pool, span, x)
        e = sub(c, p)
        # Bounds alone may answer a question about a clearance.
        early = clearance >= 0.0 and looks < _EARLY and length(e) > 8.0 * clearance
        if not early:
            x, w, e, d, dw = minimize(record, pool, span, p, low, high, x)
        far = length(e) * (1.0 + 16.0 * UNIT) + error + away
        if far < upper:
            upper = far
            found = x
            if upper <= clearance:
                break
        if not early:
            least = max(least, convex_least(record, work, o, x, w, e, d, dw, error, reach))
        limit = min(limit, upper - step)
        if limit <= 0.0 or least >= limit * limit:
            let_go = min(let_go, least)
            o -= stride
            continue
        part = (x - low) / (high - low)
        if not _NEAR_END < part < 1.0 - _NEAR_END:
            part = 0.5
            w, c, d, _h, dw = curve_at(record, pool, span, low + 0.5 * (high - low))
            e = sub(c, p)
        behind = cut(record, work, o, part, reach)
        mend(record, work, o, behind, w, e, d, dw, error, reach)
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


@kernel(inner=True, exact=True)
def nearest_on_curve(record, pool, px, py, pz, tolerance, clearance, budget, work, stack, out):
    """Bounds of the distance of a point and a curve of degree 1 or more."""
    answer = curve_answer_at(out, 0)
    head = bezier_head_at(pool, 0)
    curve = bezier_curve_at(record, 0)
    p = (px - head.center[0], py - head.center[1], pz - head.center[2])
    n = curve.degree
    reach = (head.reach + length(p)) * (1.0 + 16.0 * UNIT)
    away = head.error + 4.0 * UNIT * length(p) + 1e-150
    error = (1.0 + curve.rational) * (8.0 * n + 16.0) * UNIT * head.reach + 2.0 * UNIT * reach
    step = max(0.999 * tolerance, 8.0 * (away + error))
    o = curve.pieces
    w = 1.0 / pool[o + 3]
    far = length((pool[o] * w - p[0], pool[o + 1] * w - p[1], pool[o + 2] * w - p[2]))
    upper = far * (1.0 + 16.0 * UNIT) + error + away
    let_go = math.inf
    bounded = 0
    best_span = 0
    best = 0.0
    # Nodes of the tree that are still to be looked at: node, first and last span.
    stack[0] = 0
    stack[1] = 0
    stack[2] = curve.spans
    # The first point of the curve may be near enough.
    top = 3 if upper > clearance else 0
    while top > 0:
        top -= 3
        node = stack[top]
        first = stack[top + 1]
        last = stack[top + 2]
        limit = upper - step
        if clearance >= 0.0:
            limit = min(limit, clearance + 2.0 * away)
        square = 0.0
        if curve.spans > 1:
            square = box_square(record, pool, node, p)
            bounded += 1
            if limit <= 0.0 or square >= limit * limit or bounded >= budget:
                let_go = min(let_go, square)
                continue
        if last - first == 1:
            upper, let_go, bounded, found = span_distance(
                record, pool, first, p, reach, error, away, step, clearance, budget, work, upper, let_go, bounded, out
            )
            if found >= 0.0:
                best_span = first
                best = found
            if upper <= clearance:
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
    if let_go > 0.0 and upper > clearance:
        lower = max(min(math.sqrt(let_go) * (1.0 - 8.0 * UNIT) - away, upper), 0.0)
    w, c, _d, _h, _dw = curve_at(record, pool, best_span, best)
    answer.lower = lower
    answer.upper = upper
    answer.parameter_b = 0.0
    answer.parameter_a = in_span(pool, curve.breaks + best_span, best)
    for j in range(3):
        answer.point_a[j] = c[j] + head.center[j]
    answer.point_b[0] = px
    answer.point_b[1] = py
    answer.point_b[2] = pz
    answer.count = bounded
    if clearance >= 0.0:
        if upper <= clearance:
            return NEAR
        if lower > clearance:
            return APART
        if upper - lower <= step:
            return UNDECIDED
    elif upper - lower <= step:
        return CONVERGED
    return SPENT if bounded >= budget else UNFINISHED


@kernel(signatures="(i8[::1], f8[::1], f8, f8, f8, f8, f8, i8, f8[::1])")
def point_distance(record, pool, px, py, pz, tolerance, clearance, budget, out):
    """Bounds of the distance of a point and a packed curve; a clearance below zero asks for the distance itself."""
    answer = curve_answer_at(out, 0)
    head = bezier_head_at(pool, 0)
    curve = bezier_curve_at(record, 0)
    if clearance >= 0.0:
        # Apart at once, by the box around all.
        p = (px - head.center[0], py - head.center[1], pz - head.center[2])
        far = math.sqrt(box_square(record, pool, 0, p)) * (1.0 - 8.0 * UNIT)
        far -= head.error + 4.0 * UNIT * length(p) + 1e-150
        if far > clearance:
            o = curve.pieces
            w = 1.0 / pool[o + 3]
            e = (pool[o] * w, pool[o + 1] * w, pool[o + 2] * w)
            for j in range(3):
                answer.point_a[j] = e[j] + head.center[j]
            answer.point_b[0] = px
            answer.point_b[1] = py
            answer.point_b[2] = pz
            answer.lower = far
            reach = head.reach + length(p)
            answer.upper = length(sub(e, p)) * (1.0 + 16.0 * UNIT) + 2.0 * head.error + 16.0 * UNIT * reach
            answer.parameter_a = pool[curve.breaks]
            answer.count = 1
            return APART
    work = np.empty((_DEEPEST + 2) * (SQUARE + (2 * curve.degree + 1) * (1 + curve.rational)))
    stack = np.empty(200, np.int64)
    return nearest_on_curve(record, pool, px, py, pz, tolerance, clearance, budget, work, stack, out)


@kernel(signatures="(i8[::1], f8[::1], f8[:, ::1], f8, i8, i8[::1], f8[:, ::1])")
def point_distances(record, pool, points, tolerance, budget, codes, out):
    """`point_distance` for the rows of an array (n, 3) into rows of `out` and `codes`."""
    curve = bezier_curve_at(record, 0)
    work = np.empty((_DEEPEST + 2) * (SQUARE + (2 * curve.degree + 1) * (1 + curve.rational)))
    stack = np.empty(200, np.int64)
    for i in range(points.shape[0]):
        codes[i] = nearest_on_curve(
            record, pool, points[i, 0], points[i, 1], points[i, 2], tolerance, -1.0, budget, work, stack, out[i]
        )
