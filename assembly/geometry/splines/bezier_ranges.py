"""A curve of Bezier pieces, as kernels read it: points, and bounds over a part of a piece.

Homogeneous points (w x, w y, w z, w) of a piece on s in [0, 1], and those of its first three derivatives, are
restricted to [s0, s1] by de Casteljau's algorithm, used twice. Each coordinate of a polynomial there is between the
least and the greatest of its Bezier coefficients; for the quotient C = X / w,

    C' = (X' - C w') / w,    C'' = (X'' - 2 C' w' - C w'') / w,    C''' = (X''' - 3 C'' w' - 3 C' w'' - C w''') / w.

Weights are positive, so C on a part is between the least and the greatest of its Bezier points X_i / w_i.

Rounding: a step of de Casteljau is a mean of two numbers and errs by 3 units of 2^-53 of the larger; n steps, twice,
and the means that made the piece from knots, by less than (16 n + 32) 2^-52 M with M the largest of the points.
Sums of positive terms, as w, have relative errors of so many units, and X, each of whose points is at most w_i R, one
of so many units of w R: X / w is off by parts of R, whatever the weights. The ends of a part are rounded, too; where
weights differ much C moves far between two doubles, so the part is taken a few units longer.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of
from assembly.geometry.interval import EPSILON, idifference, iproduct, iquotient, up, widened

# A curve of pieces in the table.
RANGED_CURVE = record_dtype(
    "i8",
    dimension=1,  # 2 or 3
    degree=1,
    pieces=1,  # how many
    rational=1,  # 1: weights differ
    points=4,  # where in the pool those of C, C', C'', C''' begin: four numbers each, (degree + 1 - order) a piece
    largest=1,  # where in the pool the largest number of each order begins, four of them, and R behind them
    gram=1,  # where in the pool the Gram matrix begins
    breaks=1,  # where in the pool the knots begin
)
ranged_curve_at = record_view(RANGED_CURVE)
DIMENSION = place_of(RANGED_CURVE, "dimension")
DEGREE = place_of(RANGED_CURVE, "degree")
PIECES = place_of(RANGED_CURVE, "pieces")
RATIONAL = place_of(RANGED_CURVE, "rational")
POINTS = place_of(RANGED_CURVE, "points")
LARGEST = place_of(RANGED_CURVE, "largest")
GRAM = place_of(RANGED_CURVE, "gram")
BREAKS = place_of(RANGED_CURVE, "breaks")
BEZIER_RECORD = size_of(RANGED_CURVE)
# Workspace of bounds; Bezier points follow it.
RANGE_ROOM = record_dtype(
    "f8",
    ranges=24,  # of C, C', C'', C''' over a part: pairs
    middle=18,  # of C, C', C'' in its middle: pairs
    first=3,  # point at its begin [length]
    last=3,  # point at its end [length]
    width=1,  # of the part's ellipsoid [length squared]
    spare=3,
)
range_workspace_at = record_view(RANGE_ROOM)
RANGES = place_of(RANGE_ROOM, "ranges")
BEZIER_AT = size_of(RANGE_ROOM)
# A point with its weight.
WEIGHTED_POINT = record_dtype(
    "f8",
    position=3,  # times the weight
    weight=1,
)
weighted_point_at = record_view(WEIGHTED_POINT)
WEIGHTED = size_of(WEIGHTED_POINT)
# The largest numbers of a curve.
LARGEST_RECORD = record_dtype(
    "f8",
    orders=4,  # of the points of C, C', C'', C'''
    position=1,  # R, of the points without their weights [length]
)
largest_at = record_view(LARGEST_RECORD)


@kernel(inner=True, exact=True)
def restrict(pool, o, n, s0, s1, workspace, at):
    """Bezier points over [s0, s1] of a polynomial of degree n, whose points begin at pool[o], to workspace[at:]."""
    for k in range(4 * (n + 1)):
        workspace[at + k] = pool[o + k]
    if s1 < 1.0:
        c = 1.0 - s1
        for r in range(1, n + 1):
            for i in range(n, r - 1, -1):
                p = at + 4 * i
                for k in range(4):
                    workspace[p + k] = c * workspace[p - 4 + k] + s1 * workspace[p + k]
    if s0 > 0.0:
        s = s0 / s1
        c = 1.0 - s
        for r in range(1, n + 1):
            for i in range(n - r + 1):
                p = at + 4 * i
                for k in range(4):
                    workspace[p + k] = c * workspace[p + k] + s * workspace[p + 4 + k]


@kernel(inner=True, exact=True)
def value(pool, o, n, s, workspace, at):
    """The four values of a polynomial at s to workspace[at:], which has room for its n + 1 points."""
    for k in range(4 * (n + 1)):
        workspace[at + k] = pool[o + k]
    c = 1.0 - s
    for r in range(1, n + 1):
        for i in range(n - r + 1):
            p = at + 4 * i
            for k in range(4):
                workspace[p + k] = c * workspace[p + k] + s * workspace[p + 4 + k]


@kernel(inline=True)
def piece_points(table, span, order):
    """Where the points of a derivative of a piece begin, and their degree; a degree below zero is none."""
    curve = ranged_curve_at(table, 0)
    n = curve.degree - order
    return curve.points[order] + 4 * (n + 1) * span, n


@kernel(inline=True)
def error_of(store, order):
    """Error bound of the values and Bezier points of a derivative."""
    return units(store.table) * largest_at(store.pool, ranged_curve_at(store.table, 0).largest).orders[order]


@kernel(inline=True)
def units(table):
    """Bound of the rounding of a value, as a part of the largest value."""
    return (16.0 * ranged_curve_at(table, 0).degree + 32.0) * EPSILON


@kernel(inner=True, exact=True)
def project(store, free, count, workspace, at):
    """Pairs of C and of w from homogeneous points at workspace[free:], to workspace[at:], eight numbers."""
    part = units(store.table)
    off = 4.0 * part * largest_at(store.pool, ranged_curve_at(store.table, 0).largest).position
    for k in range(4):
        lo = math.inf
        hi = -math.inf
        for i in range(count):
            o = free + 4 * i
            x = workspace[o + k] / workspace[o + 3] if k < 3 else workspace[o + 3]
            lo = min(lo, x)
            hi = max(hi, x)
        if k < 3:
            workspace[at + 2 * k], workspace[at + 2 * k + 1] = widened(lo - off, hi + off, 2.0 * EPSILON)
        else:
            workspace[at + 6], workspace[at + 7] = lo * (1.0 - 2.0 * part), hi * (1.0 + 2.0 * part)


@kernel(inner=True, exact=True)
def quotients(workspace, at, orders):
    """Derivatives of C from pairs (lo, hi) of C, w and of X, w by order, eight numbers each at workspace[at:].

    They are written in place, six numbers per order, to workspace[at + 6 order:], where nothing is left to be read.
    """
    w = (workspace[at + 6], workspace[at + 7])
    w1 = (workspace[at + 14], workspace[at + 15])
    w2 = (workspace[at + 22], workspace[at + 23])
    w3 = (workspace[at + 30], workspace[at + 31]) if orders > 3 else (0.0, 0.0)
    for k in range(3):
        c = (workspace[at + 2 * k], workspace[at + 2 * k + 1])
        x1 = (workspace[at + 8 + 2 * k], workspace[at + 9 + 2 * k])
        c1 = iquotient(idifference(x1, iproduct(c, w1)), w)
        x2 = (workspace[at + 16 + 2 * k], workspace[at + 17 + 2 * k])
        twice = iproduct(c1, (2.0 * w1[0], 2.0 * w1[1]))
        c2 = iquotient(idifference(idifference(x2, twice), iproduct(c, w2)), w)
        workspace[at + 8 + 2 * k], workspace[at + 9 + 2 * k] = c1
        workspace[at + 16 + 2 * k], workspace[at + 17 + 2 * k] = c2
        if orders > 3:
            x3 = (workspace[at + 24 + 2 * k], workspace[at + 25 + 2 * k])
            thrice = iproduct(c2, (3.0 * w1[0], 3.0 * w1[1]))
            c3 = idifference(idifference(x3, thrice), iproduct(c1, (3.0 * w2[0], 3.0 * w2[1])))
            c3 = iquotient(idifference(c3, iproduct(c, w3)), w)
            workspace[at + 24 + 2 * k], workspace[at + 25 + 2 * k] = c3
    for order in range(1, orders):
        for k in range(6):
            workspace[at + 6 * order + k] = workspace[at + 8 * order + k]


@kernel(inner=True, exact=True)
def bezier_point_bounds(store, span, s, workspace, at):
    """Intervals of C, C', C'' (by s) at s of a piece to workspace[at:], nine pairs; what follows them is scratch."""
    curve = ranged_curve_at(store.table, 0)
    free = at + 32
    for order in range(3):
        o, n = piece_points(store.table, span, order)
        error = error_of(store, order)
        for k in range(4):
            workspace[free + k] = 0.0
        if n >= 0:
            value(store.pool, o, n, s, workspace, free)
        if order == 0 and curve.rational != 0:
            project(store, free, 1, workspace, at)
            continue
        for k in range(4):
            lo, hi = workspace[free + k] - error, workspace[free + k] + error
            workspace[at + 8 * order + 2 * k], workspace[at + 8 * order + 2 * k + 1] = widened(lo, hi, EPSILON)
    if curve.rational == 0:
        for order in range(1, 3):
            for k in range(6):
                workspace[at + 6 * order + k] = workspace[at + 8 * order + k]
    else:
        quotients(workspace, at, 3)


@kernel(inner=True, exact=True)
def bezier_range_bounds(store, span, s0, s1, workspace):
    """Intervals of C, C', C'', C''' (by s) over [s0, s1] of a piece to a workspace, and the width of the arc.

    The width of a polynomial piece is (s1 - s0) int |C' - chi / (s1 - s0)|^2 ds by the closed form of its Bezier
    points, a quadratic form in differences and so free of cancellation; of a rational piece it is infinite here.
    """
    work = range_workspace_at(workspace, 0)
    polynomial = ranged_curve_at(store.table, 0).rational == 0
    work.width = math.inf
    free = BEZIER_AT
    if not polynomial:
        s0 *= 1.0 - 4.0 * EPSILON
        s1 = min(s1 * (1.0 + 4.0 * EPSILON), 1.0)
    for order in range(4):
        o, n = piece_points(store.table, span, order)
        error = error_of(store, order)
        if n < 0:
            for k in range(8):
                workspace[8 * order + k] = 0.0
            continue
        restrict(store.pool, o, n, s0, s1, workspace, free)
        if order == 0 and not polynomial:
            project(store, free, n + 1, workspace, RANGES)
            continue
        for k in range(4):
            lo = workspace[free + k]
            hi = lo
            for i in range(1, n + 1):
                x = workspace[free + 4 * i + k]
                lo = min(lo, x)
                hi = max(hi, x)
            place = RANGES + 8 * order + 2 * k
            workspace[place], workspace[place + 1] = widened(lo - error, hi + error, EPSILON)
        if polynomial and order == 1:
            work.width = gram_width(store, n, s1 - s0, workspace, free, error)
    if polynomial:
        for order in range(1, 4):
            for k in range(6):
                workspace[6 * order + k] = workspace[8 * order + k]
    else:
        quotients(workspace, RANGES, 4)


@kernel(inner=True, exact=True)
def gram_width(store, n, step, workspace, at, error):
    """The variance of C' times step^2, from its Bezier points at workspace[at:], of degree n; rounded up."""
    curve = ranged_curve_at(store.table, 0)
    total = 0.0
    off = 0.0
    for k in range(3):
        mean = 0.0
        for i in range(n + 1):
            mean += workspace[at + 4 * i + k]
        mean /= n + 1
        for i in range(n + 1):
            workspace[at + 4 * i + k] -= mean
    g = curve.gram
    for i in range(n + 1):
        for j in range(n + 1):
            p = at + 4 * i
            q = at + 4 * j
            scalar = (
                workspace[p] * workspace[q] + workspace[p + 1] * workspace[q + 1] + workspace[p + 2] * workspace[q + 2]
            )
            total += store.pool[g + (n + 1) * i + j] * scalar
            off += store.pool[g + (n + 1) * i + j] * abs(scalar)
    # Points are off by `error` each, and a mean by as much: in the norm of the variance, which is at most the largest
    # of them. Sums of (n + 1)^2 positive and negative terms are off by that many units of their absolute sum.
    root = math.sqrt(max(total, 0.0) + EPSILON * (n + 2.0) * (n + 2.0) * off) * (1.0 + 8.0 * EPSILON)
    root += 2.0 * math.sqrt(3.0) * (error + EPSILON * (n + 2.0) * largest_at(store.pool, curve.largest).orders[1])
    return up(up(step * root) * up(step * root))
