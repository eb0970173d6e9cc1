"""Lower bounds of a distance over a box of two parameters by its second derivatives, and what they prove.

    F(s, t) = |a(s) - b(t)|^2 / 2,   r = a - b
    F_s = r.a',  F_t = -r.b',  F_ss = |a'|^2 + r.a'',  F_st = -a'.b',  F_tt = |b'|^2 - r.b''

With m the largest |F_st| over the box and any sigma > 0, F_ss >= p, F_tt >= q there and

    F(s, t) >= F(x) + F_s(x) ds + F_t(x) dt + ((p - m sigma) ds^2 + (q - m / sigma) dt^2) / 2

about any x of the box, which is minimized a coordinate at a time. Where both coefficients are positive F is convex and
its minimum over the box is the only one. Where F_s or F_t keeps its sign over a box, the box holds no minimum except at
an end of the curve. All of this is interval arithmetic, rounded outward.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.distance.enclosures.enclosure import (
    BEND,
    BOX,
    MID,
    PIECE,
    SPEED,
    enclosed_piece_at,
)
from assembly.geometry.interval import EPSILON, down, idifference, iproduct, isquare, isum, magnitude, up
from assembly.geometry.vec import cross, dot, sub

# What second derivatives tell of a box: nothing, that F is convex, that no minimum is inside.
OPEN, CONVEX, EMPTY = 0, 1, 2
# Over a box: least F_ss and F_tt, largest |F_st|, and whether the slopes leave no minimum inside.
BoxHessian = namedtuple("BoxHessian", "ss tt st empty")
# Values (nine pairs) of C, C' and C'' at block[at:], at a parameter.
ValuesAt = namedtuple("ValuesAt", "block at parameter")


@kernel(inline=True)
def pair(x, o, k):
    """The k-th pair at x[o:]."""
    return x[o + 2 * k], x[o + 2 * k + 1]


@kernel(inner=True, exact=True)
def slope_minimum(g, h, reach):
    """Lower bound of g d + h d^2 / 2 over 0 <= d <= reach."""
    if reach <= 0.0:
        return 0.0
    linear = g * reach
    square = 0.5 * h * reach * reach
    best = min(0.0, linear + square - 4.0 * EPSILON * (abs(linear) + abs(square)) - 1e-300)
    if h > 0.0 and g < 0.0 and -g < h * reach * (1.0 + 4.0 * EPSILON):
        best = min(best, -0.5 * g * g / h * (1.0 + 8.0 * EPSILON))
    return best


@kernel(inner=True, exact=True)
def box_hessian(xa, oa, xb, ob):
    """(p, q, m) of the heading over a box of two pieces."""
    piece_a = enclosed_piece_at(xa, oa)
    piece_b = enclosed_piece_at(xb, ob)
    ss = (0.0, 0.0)
    tt = (0.0, 0.0)
    st = (0.0, 0.0)
    gs = (0.0, 0.0)
    gt = (0.0, 0.0)
    for k in range(3):
        r = idifference(pair(xa, oa + BOX, k), pair(xb, ob + BOX, k))
        a1 = pair(xa, oa + SPEED, k)
        b1 = pair(xb, ob + SPEED, k)
        ss = isum(ss, isum(isquare(a1), iproduct(r, pair(xa, oa + BEND, k))))
        tt = isum(tt, idifference(isquare(b1), iproduct(r, pair(xb, ob + BEND, k))))
        st = isum(st, iproduct(a1, b1))
        gs = isum(gs, iproduct(r, a1))
        gt = idifference(gt, iproduct(r, b1))
    empty = (gs[0] > 0.0 and piece_a.first_end == 0.0) or (gs[1] < 0.0 and piece_a.last_end == 0.0)
    empty = empty or (gt[0] > 0.0 and piece_b.first_end == 0.0) or (gt[1] < 0.0 and piece_b.last_end == 0.0)
    return BoxHessian(ss[0], tt[0], magnitude(st), empty)


@kernel(inner=True, exact=True)
def taylor_bound(piece_a, piece_b, hessian, a, b):
    """Lower bound of the distance over a box of two pieces from values there, and whether F is convex there."""
    p, q, m = hessian.ss, hessian.tt, hessian.st
    s, t = a.parameter, b.parameter
    reach_s = piece_a.t1 - piece_a.t0
    reach_t = piece_b.t1 - piece_b.t0
    if not (p > -math.inf and q > -math.inf and m < math.inf):
        return 0.0, False
    if m > 0.0:
        if p > 0.0 and q > 0.0:
            sigma = math.sqrt(p / q)
        elif reach_s > 0.0 and reach_t > 0.0:
            sigma = reach_t / reach_s
        else:
            sigma = 1.0
        p = down(p - up(m * sigma))
        q = down(q - up(m / sigma))
    total = 0.0
    gs = (0.0, 0.0)
    gt = (0.0, 0.0)
    for k in range(3):
        r = idifference(pair(a.block, a.at, k), pair(b.block, b.at, k))
        total += isquare(r)[0]
        gs = isum(gs, iproduct(r, pair(a.block, a.at + 6, k)))
        gt = idifference(gt, iproduct(r, pair(b.block, b.at + 6, k)))
    if not (gs[1] - gs[0] < math.inf and gt[1] - gt[0] < math.inf):
        return 0.0, False
    low = 0.5 * total * (1.0 - 4.0 * EPSILON)
    low += min(slope_minimum(gs[0], p, up(piece_a.t1 - s)), slope_minimum(-gs[1], p, up(s - piece_a.t0)))
    low += min(slope_minimum(gt[0], q, up(piece_b.t1 - t)), slope_minimum(-gt[1], q, up(t - piece_b.t0)))
    low -= 4.0 * EPSILON * total
    convex = (p > 0.0 or reach_s == 0.0) and (q > 0.0 or reach_t == 0.0)
    if not (low > 0.0):
        return 0.0, convex
    return down(math.sqrt(2.0 * low)) * (1.0 - 4.0 * EPSILON), convex


@kernel(inner=True, exact=True)
def unit_across(e, n):
    """Rows at n[0:9], orthonormal up to rounding, that span the plane orthogonal to the unit vector e in space."""
    if abs(e[0]) < 0.6:
        u = cross(e, (1.0, 0.0, 0.0))
    else:
        u = cross(e, (0.0, 1.0, 0.0))
    size = math.sqrt(dot(u, u))
    u = (u[0] / size, u[1] / size, u[2] / size)
    w = cross(e, u)
    size = math.sqrt(dot(w, w))
    n[0], n[1], n[2] = u
    n[3], n[4], n[5] = w[0] / size, w[1] / size, w[2] / size
    n[6], n[7], n[8] = 0.0, 0.0, 0.0


@kernel(inner=True, exact=True)
def feature_rows(full, points, feature, n):
    """Rows n (nine numbers) that span the orthogonal complement of a feature: a vertex, an edge or a face of the hull.

    `feature`: numbers of its vertices, -1 behind them. False where it is degenerate.
    """
    for k in range(9):
        n[k] = 0.0
    if feature[1] < 0:
        n[0], n[4], n[8] = 1.0, 1.0, 1.0
        return True
    a = 3 * feature[0]
    b = 3 * feature[1]
    e = (points[b] - points[a], points[b + 1] - points[a + 1], points[b + 2] - points[a + 2])
    if feature[2] >= 0:
        c = 3 * feature[2]
        f = (points[c] - points[a], points[c + 1] - points[a + 1], points[c + 2] - points[a + 2])
        m = cross(e, f)
        size = math.sqrt(dot(m, m))
        if not (size > 1e-12 * math.sqrt(dot(e, e) * dot(f, f))):
            return False
        n[0], n[1], n[2] = m[0] / size, m[1] / size, m[2] / size
        return True
    size = math.sqrt(dot(e, e))
    if not (size > 0.0):
        return False
    if full == 3:
        n[0], n[1] = -e[1] / size, e[0] / size
    else:
        unit_across((e[0] / size, e[1] / size, e[2] / size), n)
    return True


@kernel(inline=True)
def turned(x, o, n, row, v):
    """Interval of row.(X - v), with a row of n and the three pairs X at x[o:]."""
    total = (0.0, 0.0)
    for k in range(3):
        c = n[3 * row + k]
        if c != 0.0:
            total = isum(total, iproduct((c, c), idifference(pair(x, o, k), (v[k], v[k]))))
    return total


@kernel(inner=True, exact=True)
def across_feature(xa, oa, points, count, feature, n, y):
    """Write the piece, projected on the complement of a hull's feature, to the record y; returns a certificate.

    For any x let r = N'N (x - v), v of the feature. With r / |r| as the direction the distance of x to the hull is at
    least |N (x - v)| less the largest (r / |r|).(z - v) over its vertices z: this largest, over the piece, is what is
    returned; it is zero up to rounding where the feature is the nearest one to all of the piece.
    """
    seen = enclosed_piece_at(y, 0)
    piece = enclosed_piece_at(xa, oa)
    f = 3 * feature[0]
    v = (points[f], points[f + 1], points[f + 2])
    none = (0.0, 0.0, 0.0)
    seen.t0, seen.t1 = piece.t0, piece.t1
    seen.first_end, seen.last_end = piece.first_end, piece.last_end
    near = 0.0
    for row in range(3):
        r = turned(xa, oa + BOX, n, row, v)
        seen.box[2 * row], seen.box[2 * row + 1] = r
        near += isquare(r)[0]
        seen.speed[2 * row], seen.speed[2 * row + 1] = turned(xa, oa + SPEED, n, row, none)
        seen.bend[2 * row], seen.bend[2 * row + 1] = turned(xa, oa + BEND, n, row, none)
        turn_values(xa, oa + MID, n, row, v, y, MID)
    near = math.sqrt(near) * (1.0 - 8.0 * EPSILON)
    worst = 0.0
    for z in range(count):
        d = sub((points[3 * z], points[3 * z + 1], points[3 * z + 2]), v)
        size = abs(d[0]) + abs(d[1]) + abs(d[2])
        inner = (0.0, 0.0)
        small = 0.0
        for row in range(3):
            o = 3 * row
            c = n[o] * d[0] + n[o + 1] * d[1] + n[o + 2] * d[2]
            slack = 8.0 * EPSILON * size if n[o] != 0.0 or n[o + 1] != 0.0 or n[o + 2] != 0.0 else 0.0
            inner = isum(inner, iproduct((c - slack, c + slack), (seen.box[2 * row], seen.box[2 * row + 1])))
            small += (abs(c) + slack) * (abs(c) + slack)
        # By the angle to the direction, or by the length across alone, which is a rounding for the feature's own.
        if inner[1] > 0.0:
            excess = math.sqrt(small) * (1.0 + 8.0 * EPSILON)
            if near > 0.0:
                excess = min(excess, inner[1] / near * (1.0 + 8.0 * EPSILON))
            worst = max(worst, excess)
    return worst


@kernel(inner=True, exact=True)
def turn_values(x, o, n, row, v, y, p):
    """Project values (nine pairs) at x[o:] on a row of n, C relative to v, and write them to y[p:]."""
    none = (0.0, 0.0, 0.0)
    y[p + 2 * row], y[p + 2 * row + 1] = turned(x, o, n, row, v)
    y[p + 6 + 2 * row], y[p + 7 + 2 * row] = turned(x, o + 6, n, row, none)
    y[p + 12 + 2 * row], y[p + 13 + 2 * row] = turned(x, o + 12, n, row, none)


@kernel(inner=True, exact=True)
def point_piece(points, o, x):
    """Write the record of a point as a constant curve."""
    piece = enclosed_piece_at(x, 0)
    for k in range(PIECE):
        x[k] = 0.0
    for k in range(3):
        p = points[o + k]
        for place in (BOX, MID):
            x[place + 2 * k] = p
            x[place + 2 * k + 1] = p
        x[2 + k] = p
        x[5 + k] = p
        x[8 + k] = p
    piece.first_end = 1.0
    piece.last_end = 1.0


@kernel(inner=True, exact=True)
def crossing_proven(xa, oa, xb, ob):
    """Whether two plane curves meet in a box of two pieces, by Krawczyk's operator about its middle.

    With r = a - b, J = [a', -b'] over the box and Y about the inverse of its middle: if -Y r + (I - Y J) X is inside
    X, the box about the point, then r has a zero there.
    """
    piece_a = enclosed_piece_at(xa, oa)
    piece_b = enclosed_piece_at(xb, ob)
    h = 0.5 * (piece_a.t1 - piece_a.t0)
    k = 0.5 * (piece_b.t1 - piece_b.t0)
    a0, a1 = pair(xa, oa + SPEED, 0), pair(xa, oa + SPEED, 1)
    b0, b1 = pair(xb, ob + SPEED, 0), pair(xb, ob + SPEED, 1)
    ax, ay = 0.5 * (a0[0] + a0[1]), 0.5 * (a1[0] + a1[1])
    bx, by = -0.5 * (b0[0] + b0[1]), -0.5 * (b1[0] + b1[1])
    det = ax * by - ay * bx
    if not (abs(det) > 0.0 and abs(det) < math.inf):
        return False
    y00, y01, y10, y11 = by / det, -bx / det, -ay / det, ax / det
    r0 = idifference(pair(xa, oa + MID, 0), pair(xb, ob + MID, 0))
    r1 = idifference(pair(xa, oa + MID, 1), pair(xb, ob + MID, 1))
    b0 = (-b0[1], -b0[0])
    b1 = (-b1[1], -b1[0])
    # X is taken a little smaller than the box, which covers the rounding of its half widths.
    h *= 0.999
    k *= 0.999
    inside = True
    for row in range(2):
        c0 = (y00, y00) if row == 0 else (y10, y10)
        c1 = (y01, y01) if row == 0 else (y11, y11)
        newton = isum(iproduct(c0, r0), iproduct(c1, r1))
        one = (1.0, 1.0) if row == 0 else (0.0, 0.0)
        two = (0.0, 0.0) if row == 0 else (1.0, 1.0)
        left = idifference(one, isum(iproduct(c0, a0), iproduct(c1, a1)))
        right = idifference(two, isum(iproduct(c0, b0), iproduct(c1, b1)))
        total = up(magnitude(newton) + up(magnitude(left) * h) + up(magnitude(right) * k))
        inside = inside and total * (1.0 + 8.0 * EPSILON) < (h if row == 0 else k)
    return inside
