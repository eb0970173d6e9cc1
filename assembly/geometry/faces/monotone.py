"""Cutting plane curves into pieces that run one way in u, in v, in u + v and in u - v.

A span of a rational curve is C = N / w with Bezier points of N and w; the sign of a component of C' is that of

    N' w - N w',

whose Bernstein coefficients follow from products of Bernstein polynomials (Farouki & Rajan, "Algorithms for
polynomials in Bernstein form", 1988). Its roots are where the curve is cut: each piece then stays in one octant of
directions, its box is spanned by its two ends, and one of u and v changes along it at least as fast as the other.
Where weights differ much along a piece, so does its speed, and bounds on its derivatives are loose: it is halved until
its weights are similar.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.splines.evaluate import spline_curve_at

# A row of pieces: curve, span, ends in the parameter, bounds on |C'|, |C''|, |C'''|.
ROW = 7
# Cuts closer than this part of a span to one another or to an end of the span are merged.
NEAREST_CUTS = 1e-9
# The largest quotient of two Bezier weights of a piece; shorter pieces than this part of a span are not halved.
MOST_WEIGHTS, SHORTEST = 8.0, 1e-13


@kernel(inner=True, allocates=True)
def _bernstein_value(f, n, x, work):
    for k in range(n + 1):
        work[k] = f[k]
    for r in range(n, 0, -1):
        for k in range(r):
            work[k] = (1.0 - x) * work[k] + x * work[k + 1]
    return work[0]


@kernel(inner=True, allocates=True)
def _simple_root(f, n, work):
    """The root of a polynomial with one change of sign between 0 and 1: regula falsi, Illinois variant."""
    a = 0.0
    b = 1.0
    fa = f[0]
    fb = f[n]
    side = 0
    x = 0.5
    for _ in range(100):
        x = b - fb * (b - a) / (fb - fa)
        if not a < x < b:
            x = 0.5 * (a + b)
        fx = _bernstein_value(f, n, x, work)
        if fx == 0.0 or b - a < 1e-16:
            break
        if (fx > 0.0) == (fb > 0.0):
            b = x
            fb = fx
            if side == 1:
                fa *= 0.5
            side = 1
        else:
            a = x
            fa = fx
            if side == -1:
                fb *= 0.5
            side = -1
    return x


@kernel(inner=True, allocates=True)
def _roots(f, n, roots, count, stack, places, work):
    """Append the places between 0 and 1 where a Bernstein polynomial changes its sign; the new count."""
    stack[0, : n + 1] = f[: n + 1]
    places[0, 0] = 0.0
    places[0, 1] = 1.0
    top = 1
    while top > 0:
        top -= 1
        g = stack[top]
        low = places[top, 0]
        width = places[top, 1]
        changes = 0
        last = 0.0
        for k in range(n + 1):
            if g[k] != 0.0:
                if last * g[k] < 0.0:
                    changes += 1
                last = 1.0 if g[k] > 0.0 else -1.0
        if changes == 0 or count == roots.size:
            continue
        if changes == 1 and g[0] != 0.0 and g[n] != 0.0:
            roots[count] = low + width * _simple_root(g, n, work)
            count += 1
            continue
        if width < NEAREST_CUTS or top + 2 > stack.shape[0]:
            roots[count] = low + 0.5 * width
            count += 1
            continue
        # Halve: the left half replaces the last entry, the right half is put above it.
        right = stack[top + 1]
        for k in range(n + 1):
            work[k] = g[k]
        right[n] = work[n]
        for r in range(n, 0, -1):
            for k in range(r):
                work[k] = 0.5 * (work[k] + work[k + 1])
            g[n - r + 1] = work[0]
            right[r - 1] = work[r - 1]
        if g[n] == 0.0:
            roots[count] = low + 0.5 * width
            count += 1
        places[top, 1] = 0.5 * width
        places[top + 1, 0] = low + 0.5 * width
        places[top + 1, 1] = 0.5 * width
        top += 2
    return count


@kernel(inner=True, allocates=True)
def _slopes(b, p, binomials, slopes):
    """Bernstein coefficients of the numerators of u', v', u' + v', u' - v'; their degree."""
    rational = False
    for k in range(1, p + 1):
        if b[k, 2] != b[0, 2]:
            rational = True
    if rational:
        n = 2 * p - 1
        # Relative to the middle of the control polygon: the numerator is the same, with less cancellation.
        cu = 0.0
        cv = 0.0
        for k in range(p + 1):
            cu += b[k, 0] / b[k, 2] / (p + 1)
            cv += b[k, 1] / b[k, 2] / (p + 1)
        slopes[:, : n + 1] = 0.0
        for i in range(p):
            for j in range(p + 1):
                c = p * binomials[p - 1, i] * binomials[p, j] / binomials[n, i + j]
                dw = b[i + 1, 2] - b[i, 2]
                du = b[i + 1, 0] - b[i, 0] - cu * dw
                dv = b[i + 1, 1] - b[i, 1] - cv * dw
                slopes[0, i + j] += c * (du * b[j, 2] - (b[j, 0] - cu * b[j, 2]) * dw)
                slopes[1, i + j] += c * (dv * b[j, 2] - (b[j, 1] - cv * b[j, 2]) * dw)
    else:
        n = p - 1
        for i in range(p):
            slopes[0, i] = b[i + 1, 0] - b[i, 0]
            slopes[1, i] = b[i + 1, 1] - b[i, 1]
    scale = 0.0
    for k in range(n + 1):
        scale = max(scale, abs(slopes[0, k]), abs(slopes[1, k]))
        slopes[2, k] = slopes[0, k] + slopes[1, k]
        slopes[3, k] = slopes[0, k] - slopes[1, k]
    return n, scale


@kernel(inner=True, allocates=True)
def _restrict(b, p, x0, x1, out, work):
    """Bezier points of the part [x0, x1] of a piece."""
    for axis in range(3):
        for k in range(p + 1):
            # Blossom with p - k times x0 and k times x1.
            for i in range(p + 1):
                work[i] = b[i, axis]
            for r in range(p, 0, -1):
                x = x0 if r > k else x1
                for i in range(r):
                    work[i] = (1.0 - x) * work[i] + x * work[i + 1]
            out[k, axis] = work[0]


@kernel(inner=True, allocates=True)
def _derivative_bounds(c, p):
    """Bounds on |C'|, |C''| and |C'''| of a piece over [0, 1]: those of N and w, order by order."""
    middle = p // 2
    cu = c[middle, 0] / c[middle, 2]
    cv = c[middle, 1] / c[middle, 2]
    least = c[0, 2]
    radius = 0.0
    for k in range(p + 1):
        least = min(least, c[k, 2])
        c[k, 0] -= cu * c[k, 2]
        c[k, 1] -= cv * c[k, 2]
        radius = max(radius, np.sqrt(c[k, 0] ** 2 + c[k, 1] ** 2) / c[k, 2])
    n1 = 0.0
    n2 = 0.0
    n3 = 0.0
    w1 = 0.0
    w2 = 0.0
    w3 = 0.0
    factor = 1.0
    for order in range(1, 4):
        count = p + 1 - order
        factor *= max(count, 0)
        largest = 0.0
        weight = 0.0
        for k in range(max(count, 0)):
            for axis in range(3):
                c[k, axis] = c[k + 1, axis] - c[k, axis]
            largest = max(largest, np.sqrt(c[k, 0] ** 2 + c[k, 1] ** 2))
            weight = max(weight, abs(c[k, 2]))
        if order == 1:
            n1 = factor * largest
            w1 = factor * weight
        elif order == 2:
            n2 = factor * largest
            w2 = factor * weight
        else:
            n3 = factor * largest
            w3 = factor * weight
    m1 = (n1 + w1 * radius) / least
    m2 = (n2 + 2.0 * w1 * m1 + w2 * radius) / least
    m3 = (n3 + 3.0 * w1 * m2 + 3.0 * w2 * m1 + w3 * radius) / least
    return m1, m2, m3


@kernel(inner=True)
def _weights_differ(c, p):
    """Whether the ratio of the largest to the least weight of a piece is above MOST_WEIGHTS."""
    least = c[0, 2]
    most = c[0, 2]
    for k in range(1, p + 1):
        least = min(least, c[k, 2])
        most = max(most, c[k, 2])
    return most > MOST_WEIGHTS * least


@kernel(inner=True, allocates=True)
def cut_all(pieces, pool, records, binomials, rows):
    """Cut curves into pieces.

    `pieces` holds the homogeneous Bezier points (u w, v w, w) of all spans of all curves in order, `pool` and `records`
    are those of the curves. Returns how many pieces there are; `rows` gets as many of them as fit.
    """
    limit = 32
    b = np.empty((limit, 3))
    c = np.empty((limit, 3))
    slopes = np.empty((4, limit))
    stack = np.empty((80, limit))
    places = np.empty((80, 2))
    work = np.empty(limit)
    roots = np.empty(256)
    at = 0
    count = 0
    for curve in range(records.shape[0]):
        arc = spline_curve_at(records, curve)
        p, breaks = arc.degree, arc.breaks
        for span in range(arc.spans):
            for k in range(p + 1):
                for axis in range(3):
                    b[k, axis] = pieces[at]
                    at += 1
            n, scale = _slopes(b, p, binomials, slopes)
            found = 0
            for line in range(4):
                largest = 0.0
                for k in range(n + 1):
                    largest = max(largest, abs(slopes[line, k]))
                # A smaller slope is rounding of a coordinate that is constant.
                if largest > 1e-14 * scale:
                    found = _roots(slopes[line], n, roots, found, stack, places, work)
            cuts = np.sort(roots[:found])
            t0 = pool[breaks + span]
            width = pool[breaks + span + 1] - t0
            low = 0.0
            for k in range(found + 1):
                high = 1.0
                if k < found:
                    high = cuts[k]
                    if high < low + NEAREST_CUTS or high > 1.0 - NEAREST_CUTS:
                        continue
                while low < high:
                    end = high
                    _restrict(b, p, low, end, c, work)
                    while _weights_differ(c, p) and end - low > SHORTEST:
                        end = 0.5 * (low + end)
                        _restrict(b, p, low, end, c, work)
                    m1, m2, m3 = _derivative_bounds(c, p)
                    scale_t = 1.0 / (width * (end - low))
                    if count < rows.shape[0]:
                        row = rows[count]
                        row[0] = curve
                        row[1] = span
                        row[2] = t0 + width * low
                        row[3] = pool[breaks + span + 1] if end == 1.0 else t0 + width * end
                        row[4] = m1 * scale_t
                        row[5] = m2 * scale_t**2
                        row[6] = m3 * scale_t**3
                    count += 1
                    low = end
    return count


@kernel(signatures="(f8[::1], f8[::1], i8[:, ::1], f8[:, ::1], f8[:, ::1])", allocates=True)
def cut_curves(pieces, pool, records, binomials, rows):
    """`cut_all` for Python."""
    return cut_all(pieces, pool, records, binomials, rows)
