"""Kernels that bound derivatives of Bezier pieces over boxes of their parameters; see `derivative_nets.py`.

The product of two nets is b_kl = sum of C(m, i) C(n, j) .. / C(m + .., k) C(n + .., l). The sums are accumulated
first; the division follows once all terms are in.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from assembly._kernel import kernel

# Bounds are divided by the width of a part of a span: parts left by rounding only are widened to this fraction of it.
NARROWEST = 1e-6
# The overlap of an interval and a span, in parts of the span, and the turn of a control polygon, in parts of its
# longest leg squared, that count as rounding.
WITHIN, STRAIGHT = 1e-12, 1e-15


@kernel(inline=True, allocates=True)
def write_binomials(table):
    """Pascal's triangle."""
    for n in range(table.shape[0]):
        table[n, 0] = 1.0
        for k in range(1, n + 1):
            table[n, k] = table[n - 1, k - 1] + (table[n - 1, k] if k < n else 0.0)


@kernel(inner=True, allocates=True)
def write_restriction(degree, low, high, binomials, matrix):
    """The matrix from the Bezier points of a piece to those over [low, high] of it."""
    for k in range(degree + 1):
        for i in range(degree + 1):
            matrix[k, i] = 0.0
        for i in range(degree - k + 1):
            one = binomials[degree - k, i] * low**i * (1.0 - low) ** (degree - k - i)
            for j in range(k + 1):
                matrix[k, i + j] += one * binomials[k, j] * high**j * (1.0 - high) ** (k - j)


@kernel(inner=True, allocates=True)
def _restrict(piece, in_u, in_v, half, net):
    """Write the Bezier points of a piece (p + 1, q + 1, 4) over a box, by the matrices of both directions."""
    rows, columns = piece.shape[0], piece.shape[1]
    for c in range(4):
        for j in range(columns):
            for k in range(rows):
                total = 0.0
                for i in range(rows):
                    total += in_u[k, i] * piece[i, j, c]
                half[k, j, c] = total
        for k in range(rows):
            for l in range(columns):
                total = 0.0
                for j in range(columns):
                    total += in_v[l, j] * half[k, j, c]
                net[k, l, c] = total


@kernel(inner=True, allocates=True)
def _center(net):
    """Move the points of a net to about its middle, and return its least weight."""
    least = net[0, 0, 3]
    for i in range(net.shape[0]):
        for j in range(net.shape[1]):
            least = min(least, net[i, j, 3])
    for c in range(3):
        low = high = net[0, 0, c] / net[0, 0, 3]
        for i in range(net.shape[0]):
            for j in range(net.shape[1]):
                x = net[i, j, c] / net[i, j, 3]
                low, high = min(low, x), max(high, x)
        middle = 0.5 * (low + high)
        for i in range(net.shape[0]):
            for j in range(net.shape[1]):
                net[i, j, c] -= middle * net[i, j, 3]
    return least


@kernel(inner=True, allocates=True)
def _write_rate(net, direction, rate):
    """Write the net of a derivative over the unit square; of degree 0 it is zero."""
    in_u = direction == 0
    rows, columns = net.shape[0], net.shape[1]
    degree = (rows if in_u else columns) - 1
    for i in range(rate.shape[0]):
        for j in range(rate.shape[1]):
            for c in range(net.shape[2]):
                if degree == 0:
                    rate[i, j, c] = 0.0
                else:
                    following = net[i + 1, j, c] if in_u else net[i, j + 1, c]
                    rate[i, j, c] = degree * (following - net[i, j, c])


@kernel(inner=True, allocates=True)
def _add_product(scale, weights, vectors, binomials, total):
    """Add to the sums of a product that of weights (m + 1, n + 1, 4), in the last column, with vectors."""
    m, n, p, q = weights.shape[0] - 1, weights.shape[1] - 1, vectors.shape[0] - 1, vectors.shape[1] - 1
    for k in range(m + 1):
        for l in range(n + 1):
            w = scale * weights[k, l, 3] * binomials[m, k] * binomials[n, l]
            if w == 0.0:
                continue
            for i in range(p + 1):
                for j in range(q + 1):
                    by = w * (binomials[p, i] * binomials[q, j])
                    for c in range(3):
                        total[k + i, l + j, c] += by * vectors[i, j, c]


@kernel(inner=True, allocates=True)
def _divide(total, binomials):
    """Bezier points of a product from its sums; the length of the longest comes back."""
    p, q = total.shape[0] - 1, total.shape[1] - 1
    longest = 0.0
    for i in range(p + 1):
        for j in range(q + 1):
            by = binomials[p, i] * binomials[q, j]
            square = 0.0
            for c in range(3):
                total[i, j, c] /= by
                square += total[i, j, c] * total[i, j, c]
            longest = max(longest, square)
    return sqrt(longest)


@kernel(inner=True, allocates=True)
def _bound_second(net, rate, numerator, direction, binomials):
    """The length of the longest vector of w P_d - 2 w_d P, where w_d is the last column of `rate`."""
    p, q = numerator.shape[0] - 1, numerator.shape[1] - 1
    in_u = direction == 0
    derivative = np.empty((p if in_u else p + 1, q + 1 if in_u else q, 3))
    _write_rate(numerator, direction, derivative)
    total = np.zeros((derivative.shape[0] + net.shape[0] - 1, derivative.shape[1] + net.shape[1] - 1, 3))
    _add_product(1.0, net, derivative, binomials, total)
    _add_product(-2.0, rate, numerator, binomials, total)
    return _divide(total, binomials)


@kernel(inner=True, allocates=True)
def _bound_patch(net, binomials, bounds):
    """Bounds of |S_u|, |S_v|, |S_uu|, |S_uv|, |S_vv| over the unit square of one net, which is moved.

    Products with weights are formed even if all weights are equal: nets of higher degree give tighter bounds.
    """
    rows, columns = net.shape[0], net.shape[1]
    least = _center(net)
    in_u, in_v = np.empty((rows - 1, columns, 4)), np.empty((rows, columns - 1, 4))
    _write_rate(net, 0, in_u)
    _write_rate(net, 1, in_v)
    of_u, of_v = np.zeros((2 * rows - 2, 2 * columns - 1, 3)), np.zeros((2 * rows - 1, 2 * columns - 2, 3))
    _add_product(1.0, net, in_u, binomials, of_u)
    _add_product(-1.0, in_u, net, binomials, of_u)
    _add_product(1.0, net, in_v, binomials, of_v)
    _add_product(-1.0, in_v, net, binomials, of_v)
    bounds[0] = _divide(of_u, binomials) / least**2
    bounds[1] = _divide(of_v, binomials) / least**2
    bounds[2] = _bound_second(net, in_u, of_u, 0, binomials) / least**3
    bounds[3] = _bound_second(net, in_v, of_u, 1, binomials) / least**3
    bounds[4] = _bound_second(net, in_v, of_v, 1, binomials) / least**3


@kernel(inline=True)
def part_of(low, high, begin, width):
    """The overlap of a span and an interval, in parts of the span; empty unless the first is the smaller one."""
    return min(max((low - begin) / width, 0.0), 1.0), min(max((high - begin) / width, 0.0), 1.0)


@kernel(inline=True)
def not_narrow(low, high):
    """The ends of a part of a span, widened to NARROWEST at least."""
    low = min(low, max(high - NARROWEST, 0.0))
    return low, max(high, low + NARROWEST)


@kernel(signatures="(f8[:,:,:,:,::1], f8[::1], f8[::1], i8[::1], f8[:,::1], f8[:,::1])", allocates=True)
def bound_surface(pieces, at_u, at_v, closed, boxes, found):
    """Bounds of derivatives of a surface over boxes.

    Parameters
    ----------
    pieces, at_u, at_v : (spans_u, spans_v, p + 1, q + 1, 4), (spans_u + 1,), (spans_v + 1,)
    closed : (2,)
        1 where a direction is closed: boxes may go over its seam.
    boxes : (n, 4)
        Low and high u, low and high v.
    found : (n, 5)
        Zeros on entry; on return bounds of |S_u|, |S_v|, |S_uu|, |S_uv|, |S_vv|.
    """
    spans_u, spans_v, rows, columns, _ = pieces.shape
    binomials = np.empty((3 * max(rows, columns), 3 * max(rows, columns)))
    write_binomials(binomials)
    in_u, in_v = np.empty((rows, rows)), np.empty((columns, columns))
    half, net, bounds = np.empty((rows, columns, 4)), np.empty((rows, columns, 4)), np.empty(5)
    period_u, period_v = at_u[spans_u] - at_u[0], at_v[spans_v] - at_v[0]
    for i in range(spans_u):
        wide_u = at_u[i + 1] - at_u[i]
        for turn_u in range(-closed[0], closed[0] + 1):
            for k in range(boxes.shape[0]):
                low_u, high_u = part_of(boxes[k, 0], boxes[k, 1], at_u[i] + turn_u * period_u, wide_u)
                if not low_u < high_u:
                    continue
                low_u, high_u = not_narrow(low_u, high_u)
                write_restriction(rows - 1, low_u, high_u, binomials, in_u)
                for j in range(spans_v):
                    wide_v = at_v[j + 1] - at_v[j]
                    for turn_v in range(-closed[1], closed[1] + 1):
                        low_v, high_v = part_of(boxes[k, 2], boxes[k, 3], at_v[j] + turn_v * period_v, wide_v)
                        if not low_v < high_v:
                            continue
                        low_v, high_v = not_narrow(low_v, high_v)
                        write_restriction(columns - 1, low_v, high_v, binomials, in_v)
                        _restrict(pieces[i, j], in_u, in_v, half, net)
                        _bound_patch(net, binomials, bounds)
                        u, v = (high_u - low_u) * wide_u, (high_v - low_v) * wide_v
                        found[k, 0] = max(found[k, 0], bounds[0] / u)
                        found[k, 1] = max(found[k, 1], bounds[1] / v)
                        found[k, 2] = max(found[k, 2], bounds[2] / (u * u))
                        found[k, 3] = max(found[k, 3], bounds[3] / (u * v))
                        found[k, 4] = max(found[k, 4], bounds[4] / (v * v))
