"""Bezier points of the normals of a body's faces, and boxes around their boundaries (`bezier_nets.py`).

With S = A / w, one polynomial piece, w^3 Su x Sv = w Au x Av - w_v Au x A - w_u A x Av is a polynomial, too: its Bezier
points over a box span a cone that holds the normals there. Products are sums over Bezier points times binomials.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.proximity.brep.bezier_nets import CURVE_NET, FACE_NETS, curve_box, curve_net_at, face_nets_at

UNIT_ROUNDING = 2.3e-16


@kernel(inner=True, exact=True)
def times_binomials(work, net, components, inverse):
    """Multiply Bezier points (place, rows, columns) by the binomials of both degrees, or divide them."""
    at, rows, columns = net
    c = 1.0
    for i in range(rows):
        d = c
        for j in range(columns):
            for m in range(components):
                x = work[at + (i * columns + j) * components + m]
                work[at + (i * columns + j) * components + m] = x / d if inverse else x * d
            d = d * (columns - 1 - j) / (j + 1)
        c = c * (rows - 1 - i) / (i + 1)


@kernel(inner=True)
def _three(work, at):
    """A vector of the workspace."""
    return work[at], work[at + 1], work[at + 2]


@kernel(inner=True, exact=True)
def _write_rates(work, net, components, out):
    """Write the derivatives in u and in v over the unit square to two places; the length of the longest of each."""
    at, rows, columns = net
    most_u, most_v = 0.0, 0.0
    for i in range(rows):
        for j in range(columns):
            here = at + (i * columns + j) * components
            square_u, square_v = 0.0, 0.0
            for m in range(components):
                if i < rows - 1:
                    d = (rows - 1) * (work[here + columns * components + m] - work[here + m])
                    work[out[0] + (i * columns + j) * components + m] = d
                    square_u += d * d
                if j < columns - 1:
                    d = (columns - 1) * (work[here + components + m] - work[here + m])
                    work[out[1] + (i * (columns - 1) + j) * components + m] = d
                    square_v += d * d
            most_u, most_v = max(most_u, square_u), max(most_v, square_v)
    return math.sqrt(most_u), math.sqrt(most_v)


@kernel(inner=True, exact=True)
def _write_cross(work, one, other, at):
    """Write the cross product of two nets of vectors (place, rows, columns); all three are multiplied by binomials."""
    a, m, n = one
    b, r, s = other
    rows, columns = m + r - 1, n + s - 1
    for k in range(3 * rows * columns):
        work[at + k] = 0.0
    for i in range(m):
        for j in range(n):
            left = _three(work, a + 3 * (i * n + j))
            for k in range(r):
                for l in range(s):
                    x, y, z = _three(work, b + 3 * (k * s + l))
                    target = at + 3 * ((i + k) * columns + j + l)
                    work[target] += left[1] * z - left[2] * y
                    work[target + 1] += left[2] * x - left[0] * z
                    work[target + 2] += left[0] * y - left[1] * x
    return at, rows, columns


@kernel(inner=True, exact=True)
def _add_product(work, one, other, sign, total):
    """Add sign times the product of a net of numbers and a net of vectors, both already multiplied by binomials.

    The workspace behind the total needs room for as many numbers again.
    """
    a, m, n = one
    b, r, s = other
    rows, columns = m + r - 1, n + s - 1
    product = total + 3 * rows * columns
    for k in range(3 * rows * columns):
        work[product + k] = 0.0
    for i in range(m):
        for j in range(n):
            left = work[a + i * n + j]
            for k in range(r):
                for l in range(s):
                    target = product + 3 * ((i + k) * columns + j + l)
                    for e in range(3):
                        work[target + e] += left * work[b + 3 * (k * s + l) + e]
    times_binomials(work, (product, rows, columns), 3, True)
    for k in range(3 * rows * columns):
        work[total + k] += sign * work[product + k]


@kernel(inner=True, exact=True)
def _cross_of(work, one, other, at):
    """`_write_cross`, rounded as the product is."""
    net = _write_cross(work, one, other, at)
    times_binomials(work, net, 3, True)
    times_binomials(work, net, 3, False)
    return net


@kernel(inner=True, exact=True)
def _write_centered(pool, face, piece, work, at):
    """Write A about the middle of a piece, where products are smaller, then w; max |A|, max |w|, largest coordinate."""
    points = face.rows * face.columns
    first = face.points + 4 * points * piece
    most_a, most_w, extent = 0.0, 0.0, 0.0
    for k in range(points):
        work[at + 3 * k], work[at + 3 * k + 1], work[at + 3 * k + 2] = 0.0, 0.0, 0.0
    for m in range(3):
        low, high = math.inf, -math.inf
        for k in range(points):
            x = pool[first + 4 * k + m] / pool[first + 4 * k + 3]
            low, high = min(low, x), max(high, x)
        extent = max(extent, abs(low), abs(high))
        for k in range(points):
            w = pool[first + 4 * k + 3]
            work[at + 3 * k + m] = pool[first + 4 * k + m] - 0.5 * (low + high) * w
    for k in range(points):
        work[at + 3 * points + k] = pool[first + 4 * k + 3]
        most_w = max(most_w, abs(pool[first + 4 * k + 3]))
        x, y, z = _three(work, at + 3 * k)
        most_a = max(most_a, x * x + y * y + z * z)
    return math.sqrt(most_a), most_w, extent


@kernel(inner=True, exact=True)
def _write_piece(pool, face, piece, extent, work):
    """The normals of one piece, and their slack."""
    rows, columns = face.rows, face.columns
    p, q = rows - 1, columns - 1
    points = rows * columns
    normals = face.normal_rows * face.normal_columns
    a, w = 0, 3 * points
    au, av = 4 * points, 7 * points
    wu, wv = 10 * points, 11 * points
    product = 12 * points
    total = product + 3 * normals
    size_a, size_w, _extent = _write_centered(pool, face, piece, work, a)
    size_u, size_v = _write_rates(work, (a, rows, columns), 3, (au, av))
    rate_u, rate_v = _write_rates(work, (w, rows, columns), 1, (wu, wv))
    net_u, net_v = (au, p, columns), (av, rows, q)
    times_binomials(work, net_u, 3, False)
    times_binomials(work, net_v, 3, False)
    if face.is_rational == 0:
        times_binomials(work, _write_cross(work, net_u, net_v, total), 3, True)
        rate_u, rate_v, weight = 0.0, 0.0, 1.0
        size = size_u * size_v
    else:
        net_a = (a, rows, columns)
        times_binomials(work, net_a, 3, False)
        times_binomials(work, (w, rows, columns), 1, False)
        times_binomials(work, (wu, p, columns), 1, False)
        times_binomials(work, (wv, rows, q), 1, False)
        for k in range(3 * normals):
            work[total + k] = 0.0
        _add_product(work, (w, rows, columns), _cross_of(work, net_u, net_v, product), 1.0, total)
        _add_product(work, (wv, rows, q), _cross_of(work, net_u, net_a, product), -1.0, total)
        _add_product(work, (wu, p, columns), _cross_of(work, net_a, net_v, product), -1.0, total)
        weight = size_w
        size = weight * size_u * size_v + size_a * (rate_v * size_u + rate_u * size_v)
    sign = -1.0 if face.reversed == 1 else 1.0
    for k in range(3 * normals):
        pool[face.normals + 3 * normals * piece + k] = sign * work[total + k]
    # The products' own rounding, and that of the coordinates, which derivatives magnify.
    off = 16.0 * UNIT_ROUNDING * extent * size_w
    slack = weight * off * 2.0 * (p * size_v + q * size_u)
    slack += off * (rate_v * (size_u + 2.0 * p * size_a) + rate_u * (size_v + 2.0 * q * size_a))
    pool[face.slack + piece] = slack + 32.0 * (p + q) * UNIT_ROUNDING * size


@kernel(inner=True)
def _clear_pole(pool, face, piece, edge):
    """Set to zero the normals of a piece along an edge that is one point to the tolerance of poles."""
    rows, columns = face.normal_rows, face.normal_columns
    first = face.normals + 3 * rows * columns * piece
    pool[face.poles + piece] = 1.0
    for i in range(rows):
        for j in range(columns):
            if (i, i - rows + 1, j, j - columns + 1)[edge] == 0:
                for m in range(3):
                    pool[first + 3 * (i * columns + j) + m] = 0.0


@kernel(inner=True)
def _write_boundary(table, pool, face, curves, parts, work):
    """Write boxes around parts of the boundary curves of a face: every span is divided into equally many."""
    at = face.boundary
    for k in range(curves[0], curves[1]):
        curve = curve_net_at(table, curves[2] + CURVE_NET * k)
        count = -(-parts // curve.spans)
        for span in range(curve.spans):
            for i in range(count):
                box = curve_box(pool, curve, (span, i / count, (i + 1) / count), work, 0)
                for m in range(4):
                    pool[at + m] = box[m]
                at += 4


@kernel(signatures="(i8[::1], f8[::1], i8[:, ::1], i8, i8, f8[::1])")
def complete_nets(table, pool, curves, first_curve, parts, work):
    """Write normals, their slack, poles, extents and boxes around boundaries of all faces.

    Row k of `curves` (n, 2) has the first boundary curve of face k and the one after its last. Every boundary curve is
    divided into `parts` parts at least.
    """
    for number in range(len(curves)):
        face = face_nets_at(table, FACE_NETS * number)
        pieces = face.spans_u * face.spans_v
        extent = 0.0
        for piece in range(pieces):
            _a, _w, most = _write_centered(pool, face, piece, work, 0)
            extent = max(extent, most)
        pool[face.extent] = extent
        for piece in range(pieces):
            _write_piece(pool, face, piece, extent, work)
            span_u, span_v = piece // face.spans_v, piece % face.spans_v
            ends = (span_u == 0, span_u == face.spans_u - 1, span_v == 0, span_v == face.spans_v - 1)
            for edge in range(4):
                if (face.pole_bits >> edge) & 1 and ends[edge]:
                    _clear_pole(pool, face, piece, edge)
        if face.trim >= 0:
            _write_boundary(table, pool, face, (curves[number, 0], curves[number, 1], first_curve), parts, work)
