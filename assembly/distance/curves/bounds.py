"""Lower bounds of the distance of two pieces of curves, and a proof that it has one minimum on them.

With D = a - b and the quadratic models of `distance/curves/nodes.py`, d and e in [-1/2, 1/2],

    |D| >= sqrt(min Q(d, e) - R) - E0_a - E0_b,
    Q = |D0|^2 + 2 D0.(A1 d - B1 e) + (|A1|^2 + D0.A2) d^2 - 2 A1.B1 d e + (|B1|^2 - D0.B2) e^2,
    R = (|A1.A2| + |A1.B2| + |B1.A2| + |B1.B2|) / 8:

|D0 + A1 d - B1 e + (A2 d^2 - B2 e^2) / 2|^2 is the sum of Q, cubic terms of size at most R, and a square. The minimizer
of Q on the square of (d, e) is its stationary point or lies on an edge; the tangent plane there gives the bound. For
any unit n, control points give |D| >= min n.P_a - max n.P_b.

F = |D|^2 / 2 has F_ss = |a'|^2 + D.a'', F_tt = |b'|^2 - D.b'', F_st = -a'.b'. Where their bounds over the box give
F_ss F_tt > F_st^2, the Hessian is at least diag(lambda_a, lambda_b) with lambda = F_ii (1 - |F_st| / sqrt(F_ss F_tt)).

Rounding. Every bound ends with the subtraction of a multiple of u = 2^-53 of the magnitudes that were summed, at least
twice the number of roundings on the longest path, and of how far the two pieces may be from what they stand for.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.distance.curves.nodes import (
    ROWS,
    curve_node_at,
    length,
    three,
)
from assembly.geometry.splines.bezier_pieces import UNIT, bezier_curve_at
from assembly.geometry.vec import dot


@kernel(inline=True)
def difference(a, b, shift):
    """a - b, the second moved by the shift."""
    return ((a[0] - b[0]) - shift[0], (a[1] - b[1]) - shift[1], (a[2] - b[2]) - shift[2])


@kernel(inner=True, exact=True)
def box_bound(a, b, shift, slack):
    """Distance of the boxes of two nodes, the second moved by the shift."""
    total = 0.0
    for j in range(3):
        gap = abs((a.box_center[j] - b.box_center[j]) - shift[j]) - a.box_half[j] - b.box_half[j]
        gap -= slack
        if gap > 0.0:
            total += gap * gap
    return math.sqrt(total) * (1.0 - 8.0 * UNIT) - a.away - b.away


@kernel(inline=True)
def edge_minimum(c, g, h):
    """Least c + 2 g x + h x^2 on [-1/2, 1/2], and where."""
    if h > 0.0 and abs(g) < 0.5 * h:
        x = -g / h
        return c + g * x, x
    x = -0.5 if g > 0.0 else 0.5
    return c + x * (2.0 * g + h * x), x


@kernel(inline=True)
def boundary_minimum(c, g, h, p, q, r):
    """Least c + 2 g x + 2 h y + p x^2 + 2 q x y + r y^2 on the border of [-1/2, 1/2]^2, and where."""
    best, y = edge_minimum(c - g + 0.25 * p, h - 0.5 * q, r)
    x = -0.5
    value, s = edge_minimum(c + g + 0.25 * p, h + 0.5 * q, r)
    if value < best:
        best = value
        x = 0.5
        y = s
    value, s = edge_minimum(c - h + 0.25 * r, g - 0.5 * q, p)
    if value < best:
        best = value
        x = s
        y = -0.5
    value, s = edge_minimum(c + h + 0.25 * r, g + 0.5 * q, p)
    if value < best:
        best = value
        x = s
        y = 0.5
    return best, x, y


@kernel(inline=True)
def square_minimum(c, g, h, p, q, r):
    """As `boundary_minimum`, on all of the square: a value that exceeds the least one by rounding at most, and a place.

    For parallel lines the determinant is nothing but rounding, and the minimizer computed with it may be anywhere. A
    convex form is nowhere below a tangent plane, so the tangent plane at the point found gives the bound.
    """
    if not (p > 0.0 and r > 0.0):
        return boundary_minimum(c, g, h, p, q, r)
    # Without scaling, products of the coefficients may overflow or underflow.
    scale = 1.0 / max(p, r)
    sp = scale * p
    sq = scale * q
    sr = scale * r
    det = sp * sr - sq * sq
    if not det >= -8.0 * UNIT * sp * sr:
        return boundary_minimum(c, g, h, p, q, r)
    inside = False
    x = 0.0
    y = 0.0
    if det > 1e-12 * sp * sr:
        i = scale / det
        x = (sq * h - sr * g) * i
        y = (sq * g - sp * h) * i
        inside = abs(x) <= 0.5 and abs(y) <= 0.5
        if inside and det < 1e-2 * sp * sr:
            gx = g + p * x + q * y
            gy = h + q * x + r * y
            x = min(max(x + (sq * gy - sr * gx) * i, -0.5), 0.5)
            y = min(max(y + (sq * gx - sp * gy) * i, -0.5), 0.5)
    if not inside:
        _best, x, y = boundary_minimum(c, g, h, p, q, r)
    gx = g + p * x + q * y
    gy = h + q * x + r * y
    return c + x * (g - gx) + y * (h - gy) - abs(gx) - abs(gy), x, y


@kernel(inner=True, exact=True)
def model_bound(a, b, shift, slack):
    """The bound of the quadratic models of two nodes, and where they are closest, as (d, e)."""
    d0 = difference(a.a0, b.a0, shift)
    a1, a2 = three(a.a1, 0), three(a.a2, 0)
    b1, b2 = three(b.a1, 0), three(b.a2, 0)
    c = dot(d0, d0)
    aa = dot(a1, a1)
    bb = dot(b1, b1)
    da = dot(d0, a2)
    db = dot(d0, b2)
    least, x, y = square_minimum(c, dot(d0, a1), -dot(d0, b1), aa + da, -dot(a1, b1), bb - db)
    cubic = 0.125 * (abs(dot(a1, a2)) + abs(dot(a1, b2)) + abs(dot(b1, a2)) + abs(dot(b1, b2)))
    # Every term of Q on the square is below c + aa + bb + |da| + |db|, of R below aa + |a2|^2 and so on.
    size = c + aa + bb + abs(da) + abs(db) + dot(a2, a2) + dot(b2, b2)
    least -= cubic * (1.0 + 1e-12) + 128.0 * UNIT * size
    root = math.sqrt(least) * (1.0 - 8.0 * UNIT) if least > 0.0 else 0.0
    away = a.away + b.away + a.e0 + b.e0 + slack
    return root - away * (1.0 + 16.0 * UNIT), x, y


@kernel(inline=True, exact=True)
def farthest(piece, x, y, z):
    """The control point of a piece that is farthest along a direction: how far it is."""
    curve = bezier_curve_at(piece.record, 0)
    nodes = piece.nodes
    # Where the positions begin.
    i = piece.at + ROWS + 4 * (curve.degree + 1) * curve.rational
    most = x * nodes[i] + y * nodes[i + 1] + z * nodes[i + 2]
    for _ in range(curve.degree):
        i += 4
        most = max(most, x * nodes[i] + y * nodes[i + 1] + z * nodes[i + 2])
    return most


@kernel(inner=True, exact=True)
def hull_bound(a, b, shift, slack, x, y):
    """The bound of the control points of two pieces in the direction between the points of their models at (x, y)."""
    node_a = curve_node_at(a.nodes, a.at)
    node_b = curve_node_at(b.nodes, b.at)
    n0 = (node_a.a0[0] - node_b.a0[0]) - shift[0]
    n1 = (node_a.a0[1] - node_b.a0[1]) - shift[1]
    n2 = (node_a.a0[2] - node_b.a0[2]) - shift[2]
    n0 += x * node_a.a1[0] - y * node_b.a1[0]
    n1 += x * node_a.a1[1] - y * node_b.a1[1]
    n2 += x * node_a.a1[2] - y * node_b.a1[2]
    size = math.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    if not size > 0.0:
        return 0.0
    size = 1.0 / size
    n0 *= size
    n1 *= size
    n2 *= size
    low = -farthest(a, -n0, -n1, -n2)
    high = farthest(b, n0, n1, n2)
    gap = (low - high) - (n0 * shift[0] + n1 * shift[1] + n2 * shift[2])
    return gap * (1.0 - 16.0 * UNIT) - 4.0 * slack - node_a.away - node_b.away


@kernel(inner=True, exact=True)
def convexity(a, b, flat, shift):
    """Least curvatures (lambda_a, lambda_b) of F over the box of two nodes; zeros where it is not proven convex.

    `flat`: the second node is a point.
    """
    d0 = difference(a.a0, b.a0, shift)
    a1, a2 = three(a.a1, 0), three(a.a2, 0)
    b1, b2 = three(b.a1, 0), three(b.a2, 0)
    la = length(a1)
    lb = length(b1)
    ka = length(a2)
    kb = length(b2)
    ea0, ea1, ea2 = a.e0, a.e1, a.e2
    eb0, eb1, eb2 = b.e0, b.e1, b.e2
    away = a.away + b.away
    far = length(d0) + 0.5 * (la + lb) + 0.125 * (ka + kb) + ea0 + eb0
    bent = 0.125 * abs(dot(a2, b2))
    mixed_a = 0.5 * abs(dot(a2, b1))
    mixed_b = 0.5 * abs(dot(a1, b2))
    slack = 1e-13 * (la + lb + ka + kb) * (la + lb + ka + kb + far)
    error = ea0 + eb0 + away
    if flat:
        ss = (
            la * la
            + dot(d0, a2)
            - 1.5 * abs(dot(a1, a2))
            - error * ka
            - far * ea2
            - 2.0 * (la + 0.5 * ka) * ea1
            - slack
        )
        return (ss, 1.0) if ss > 0.0 else (0.0, 0.0)
    ss = la * la + dot(d0, a2) - 1.5 * abs(dot(a1, a2)) - mixed_a - bent
    ss -= error * ka + far * ea2 + 2.0 * (la + 0.5 * ka) * ea1 + slack
    tt = lb * lb - dot(d0, b2) - 1.5 * abs(dot(b1, b2)) - mixed_b - bent
    tt -= error * kb + far * eb2 + 2.0 * (lb + 0.5 * kb) * eb1 + slack
    if not (ss > 0.0 and tt > 0.0):
        return 0.0, 0.0
    st = abs(dot(a1, b1)) + mixed_a + mixed_b + 2.0 * bent
    st += ea1 * (lb + 0.5 * kb + eb1) + eb1 * (la + 0.5 * ka) + slack
    rest = 1.0 - st / (math.sqrt(ss) * math.sqrt(tt)) - 1e-13
    if not rest > 0.0:
        return 0.0, 0.0
    return ss * rest, tt * rest


@kernel(inline=True)
def least_change(slope, error, curvature, back, ahead):
    """Least g d + curvature d^2 / 2 for -back <= d <= ahead and any g within `error` of `slope`."""
    least = 0.0
    g = slope - error
    if g < 0.0:
        d = min(ahead, -g / curvature) if curvature > 0.0 else ahead
        least = d * (g + 0.5 * curvature * d)
    g = slope + error
    if g > 0.0:
        d = min(back, g / curvature) if curvature > 0.0 else back
        least = min(least, d * (0.5 * curvature * d - g))
    return least
