"""Bezier points of all patches of a surface, compiled: the blossom of every span (`geometry/splines/bezier.py`)."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._lanes import load_lanes, store_lanes


@kernel(signatures="(UniTuple(f8[::1], 2), UniTuple(f8, 3), f8[::1])")
def write_points(given, center, points):
    """Homogeneous control points about a center, weights at most one; the largest coordinate and the least weight.

    `given`: control points and weights of a surface, one after the other.
    """
    places, weights = given
    least, heaviest = math.inf, 0.0
    for i in range(weights.size):
        least, heaviest = min(least, weights[i]), max(heaviest, weights[i])
    largest = 0.0
    for i in range(weights.size):
        w = 1.0 if least == heaviest else weights[i] / heaviest
        for c in range(3):
            x = places[3 * i + c] - center[c]
            largest = max(largest, abs(x))
            points[4 * i + c] = w * x
        points[4 * i + 3] = w
    return largest, least / heaviest


@kernel(inline=True)
def span_after(knots, count, span):
    """The next span of the domain that is not empty, or `count` if there is none."""
    span += 1
    while span < count and not knots[span + 1] > knots[span]:
        span += 1
    return span


@kernel(inner=True)
def write_line(source, target, knots, degree, span):
    """Bezier points of a line of control points on one span.

    `source` and `target`: an array, where the line begins in it, and the stride of its points. The end of the array of
    `target` is scratch.
    """
    points, first, step = source
    out, begin, stride = target
    low, high = knots[span], knots[span + 1]
    work = out.size - 4 * (degree + 1)
    for k in range(degree + 1):
        for i in range(degree + 1):
            store_lanes(load_lanes(points, first + step * (span - degree + i)), out, work + 4 * i)
        for r in range(1, degree + 1):
            t = low if r <= degree - k else high
            for i in range(degree, r - 1, -1):
                left, right = knots[span - degree + i], knots[span + 1 + i - r]
                part = (t - left) / (right - left)
                d = (1.0 - part) * load_lanes(out, work + 4 * (i - 1)) + part * load_lanes(out, work + 4 * i)
                store_lanes(d, out, work + 4 * i)
        store_lanes(load_lanes(out, work + 4 * degree), out, begin + stride * k)


@kernel(signatures="(f8[::1], UniTuple(f8[::1], 2), UniTuple(i8, 4), f8[::1], f8[::1])")
def write_nets(points, knots, shape, rows, nets):
    """Bezier points of the patches of a surface, spans of u before those of v, rows of u within.

    `points`: (n_u, n_v, 4) homogeneous; `shape`: n_u, n_v and the degrees; `rows`: workspace for the Bezier points of
    all spans of u by n_v. `rows` and `nets` have scratch for one line at their ends.
    """
    count_u, count_v, p, q = shape
    span, at = span_after(knots[0], count_u, p - 1), 0
    while span < count_u:
        for j in range(count_v):
            write_line((points, 4 * j, 4 * count_v), (rows, at + 4 * j, 4 * count_v), knots[0], p, span)
        at += 4 * (p + 1) * count_v
        span = span_after(knots[0], count_u, span)
    spans, at = at // (4 * (p + 1) * count_v), 0
    for s in range(spans):
        span = span_after(knots[1], count_v, q - 1)
        while span < count_v:
            for i in range(p + 1):
                line = 4 * count_v * ((p + 1) * s + i)
                write_line((rows, line, 4), (nets, at, 4), knots[1], q, span)
                at += 4 * (q + 1)
            span = span_after(knots[1], count_v, span)
