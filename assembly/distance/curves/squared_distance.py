"""The square of the distance of a point and a span of a curve in Bernstein form: its coefficients, cuts and bounds.

In the notation of `distance/curves/point_curve.py`: an interval of a span holds the coefficients of q and v and bounds
of their errors, and can be cut in two.

Rounding. |(|X|^2)_k| <= REACH^2 v_k, as every X_i is at most w_i REACH: with M = REACH + |p| a coefficient has an error
below (2 n + 16) u M^2 v_k, and one cut, 2 n convex combinations of three roundings each for q and for v, adds
16 n u M^2 v_k. That is too much where the distance is small against M; so the two coefficients at a cut, which decide
there, are computed anew from Y(x*) and Y'(x*): q_0 = |Y|^2, q_1 = q_0 + Y.Y' h / n, with errors of the order u M |Y|.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.distance.curves.bounds import least_change
from assembly.distance.curves.nodes import length
from assembly.geometry.splines.bezier_pieces import UNIT, bezier_curve_at
from assembly.geometry.vec import dot

# One interval; the coefficients of q stand behind it, and those of v where weights differ.
INTERVAL_RECORD = record_dtype(
    "f8",
    error_all=1,  # of the coefficients [squared length]
    error_low=1,  # of the two at its low end
    error_high=1,  # of the two at its high end
    low=1,  # its ends on the span, in [0, 1]
    high=1,
    cuts=1,  # how often it was cut
)
interval_at = record_view(INTERVAL_RECORD)
SQUARE = size_of(INTERVAL_RECORD)
# A point of a span: x, w, C (about the curve's center, or about p), C', C'' and w'.
SpanPoint = namedtuple("SpanPoint", "x weight place first second weight_rate")


@kernel(inline=True)
def put_error(interval, end, error):
    """Write the error of the two coefficients at the low end (0) or at the high one (1)."""
    if end == 0:
        interval.error_low = error
    else:
        interval.error_high = error


@kernel(inner=True, exact=True)
def form_square(record, pool, span, p, reach, work):
    """q and v on a span as the interval 0."""
    interval = interval_at(work, 0)
    curve = bezier_curve_at(record, 0)
    n = curve.degree
    m = 2 * n + 1
    s = curve.squares + 5 * m * span
    o = SQUARE
    pp = dot(p, p)
    px = 2.0 * p[0]
    py = 2.0 * p[1]
    pz = 2.0 * p[2]
    for k in range(m):
        v = pool[s + 4 * m + k]
        q = pool[s + k] - (px * pool[s + m + k] + py * pool[s + 2 * m + k] + pz * pool[s + 3 * m + k]) + pp * v
        work[o + k] = q
    if curve.rational == 1:
        for k in range(m):
            work[o + m + k] = pool[s + 4 * m + k]
    error = (4.0 * n + 32.0) * UNIT * reach * reach
    interval.error_all = error
    interval.low = 0.0
    interval.high = 1.0
    interval.cuts = 0.0
    # The two coefficients at each end are computed again, with smaller errors: they are Y_0.Y_0 and Y_0.Y_1.
    rows = curve.pieces + 4 * (n + 1) * span
    for end in range(2):
        i = rows + 4 * n * end
        j = i + 4 - 8 * end
        w = pool[i + 3]
        x = (pool[i] - w * p[0], pool[i + 1] - w * p[1], pool[i + 2] - w * p[2])
        a = pool[j + 3]
        y = (pool[j] - a * p[0], pool[j + 1] - a * p[1], pool[j + 2] - a * p[2])
        first = 2 * n * end
        work[o + first] = dot(x, x)
        work[o + first + 1 - 2 * end] = dot(x, y)
        # Y has three roundings of at most w M.
        put_error(interval, end, 16.0 * UNIT * reach * (length(x) / w + 4.0 * UNIT * reach))


@kernel(inner=True, exact=True)
def least_quotient(record, work, o):
    """min (q_k / v_k - error), and its k."""
    interval = interval_at(work, o)
    curve = bezier_curve_at(record, 0)
    n = curve.degree
    m = 2 * n + 1
    s = o + SQUARE
    rational = curve.rational == 1
    at = 0
    e = interval.error_low
    least = (work[s] / work[s + m] if rational else work[s]) - e
    k = 1
    value = (work[s + k] / work[s + m + k] if rational else work[s + k]) - e
    if value < least:
        least = value
        at = k
    e = interval.error_high
    for k in range(m - 2, m):
        value = (work[s + k] / work[s + m + k] if rational else work[s + k]) - e
        if value < least:
            least = value
            at = k
    inner = math.inf
    for k in range(2, m - 2):
        value = work[s + k] / work[s + m + k] if rational else work[s + k]
        if value < inner:
            inner = value
            if value - interval.error_all < least:
                at = k
    return min(least, inner - interval.error_all), at


@kernel(inner=True, exact=True)
def cut(record, work, o, x, reach):
    """Cut the interval at o in two at its own x in (0, 1): the high part stays there, the low part comes behind it."""
    interval = interval_at(work, o)
    curve = bezier_curve_at(record, 0)
    n = curve.degree
    m = 2 * n + 1
    rational = curve.rational
    low = o + SQUARE + m * (1 + rational)
    behind = interval_at(work, low)
    s = o + SQUARE
    # A cut combines the two coefficients at an end with each other only.
    v = min(work[s + m], work[s + m + 1]) if rational == 1 else 1.0
    behind.error_low = interval.error_low + 4.0 * UNIT * (abs(work[s]) + abs(work[s + 1])) / v
    v = min(work[s + 2 * m - 1], work[s + 2 * m - 2]) if rational == 1 else 1.0
    interval.error_high += 4.0 * UNIT * (abs(work[s + m - 1]) + abs(work[s + m - 2])) / v
    interval.error_all += 16.0 * n * UNIT * reach * reach
    behind.error_all = interval.error_all
    rest = 1.0 - x
    for part in range(1 + rational):
        s = o + SQUARE + m * part
        t = low + SQUARE + m * part
        for r in range(m):
            work[t + r] = work[s]
            for k in range(m - 1 - r):
                work[s + k] = rest * work[s + k] + x * work[s + k + 1]
    middle = interval.low + x * (interval.high - interval.low)
    behind.low = interval.low
    behind.high = middle
    interval.low = middle
    interval.cuts += 1.0
    behind.cuts = interval.cuts
    return low


@kernel(inner=True, exact=True)
def mend(record, work, o, low, point, error, reach):
    """Compute the coefficients beside a cut again, from the point there."""
    w, dw = point.weight, point.weight_rate
    e, d = point.place, point.first
    curve = bezier_curve_at(record, 0)
    n = curve.degree
    m = 2 * n + 1
    far = length(e)
    # Y = w D, Y' = w C' + w' D.
    y = (w * d[0] + dw * e[0], w * d[1] + dw * e[1], w * d[2] + dw * e[2])
    square = w * w * dot(e, e)
    slope = w * dot(e, y)
    speed = length(y)
    # Y' is n times a sum of differences, each at most 2 M: packed weights are at most one.
    rough = (16.0 * n + 40.0) * UNIT * 2.0 * n * reach
    for side in range(2):
        a = o if side == 0 else low
        interval = interval_at(work, a)
        width = (interval.high - interval.low) * (1.0 - 2.0 * side) / n
        k = 0 if side == 0 else m - 1
        j = 1 if side == 0 else m - 2
        s = a + SQUARE
        v = work[s + m + j] if curve.rational == 1 else 1.0
        work[s + k] = square
        work[s + j] = square + slope * width
        wrong = w * w * (2.0 * far + error) * error + abs(width) * w * (far * rough + error * (speed + rough))
        wrong += 16.0 * UNIT * (square + abs(slope * width))
        put_error(interval, side, wrong / min(v, w * w) * (1.0 + 1e-12))


@kernel(inner=True, exact=True)
def convex_least(record, work, o, point, error, reach):
    """A lower bound of the square on an interval where q - |D|^2 v is convex, from a point of it; else -1.

    With h = q - |D(x)|^2 v, h(x) = 0 and h'' >= lambda there: |C - p|^2 >= |D|^2 + (h' d + lambda d^2 / 2) / v.
    """
    interval = interval_at(work, o)
    curve = bezier_curve_at(record, 0)
    n = curve.degree
    m = 2 * n + 1
    s = o + SQUARE
    w, dw = point.weight, point.weight_rate
    e, d = point.place, point.first
    rational = curve.rational == 1
    square = dot(e, e)
    bend = math.inf
    least_v = 1.0
    if rational:
        least_v = min(work[s + m], work[s + m + 1])
        first = work[s] - square * work[s + m]
        second = work[s + 1] - square * work[s + m + 1]
        for k in range(2, m):
            v = work[s + m + k]
            least_v = min(least_v, v)
            third = work[s + k] - square * v
            bend = min(bend, (third - second) - (second - first))
            first = second
            second = third
    else:
        for k in range(2, m):
            bend = min(bend, (work[s + k] - work[s + k - 1]) - (work[s + k - 1] - work[s + k - 2]))
    wrong = max(interval.error_all, interval.error_low, interval.error_high)
    curvature = 2.0 * n * (2.0 * n - 1.0) * (bend - 4.0 * wrong - 64.0 * UNIT * reach * reach)
    if not curvature > 0.0:
        return -1.0
    width = interval.high - interval.low
    far = length(e)
    # w C' = X' - w' C with X' and w' off by parts of n times the largest differences; twice that for what follows.
    rough = (32.0 * n + 80.0) * UNIT * 2.0 * n
    slope = 2.0 * width * w * w * dot(e, d)
    doubt = far * (rough * (reach + far) + abs(dw) * error) + error * (w * length(d) + rough * reach)
    doubt += (4.0 * far * error + 32.0 * UNIT * square) * (abs(dw) + rough)
    doubt = 4.0 * width * w * doubt + 64.0 * UNIT * abs(slope)
    part = (point.x - interval.low) / width
    change = least_change(slope, doubt, curvature, part, 1.0 - part)
    near = max(far * (1.0 - 16.0 * UNIT) - error, 0.0)
    return near * near * (1.0 - 8.0 * UNIT) + change / least_v * (1.0 + 1e-12)
