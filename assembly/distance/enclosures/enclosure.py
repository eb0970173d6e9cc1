"""Convex sets that enclose a piece of a curve, each given by its support function h, and the records of pieces.

    h(n) = max n.C(t),  t in [t0, t1],  |n| = 1        chi = C(t1) - C(t0),  L = t1 - t0,  f0, f1 = n.C at the ends

    ellipsoid   h <= (f0 + f1) / 2 + sqrt(w + (n.chi)^2) / 2      (Lakshmanan et al., theorem 1, of any dimension)
    capsule     h <= max(f0, f1) + L^2 max|C''| / 8
    taylor      h <= max over s of (1 - s) f0 + s f1 + q s (1 - s) / 2,   q = L^2 max(0, max -n.C'')
    box         h <= the support of the box of C

with the width w = L int |C' - chi / L|^2 dt, which is u^2 - |chi|^2 of lemma 1 without its cancellation. For a formula
w is bounded by the least of L^4 max|C''|^2 / 12, (L^2 (|C''(m)| / sqrt 12 + L max|C'''| / sqrt 320))^2 (C' is
C'(m) + C''(m) (t - m) and a rest, in the norm of the variance), (L max|C'|)^2 - |chi|^2, and the square of the user's
bound of the length minus |chi|^2. For sets A and B and any unit n

    distance >= -h_A(n) - h_B(-n)

which is the certificate: it holds for every n, and a good n makes it large. Supports are relative to a reference point
near A, so that they are as exact as differences; a sum of three products has an error of at most 4 units of 2^-52 of
the sum of their magnitudes, which is added.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import Store, place_of, record_dtype, record_view, size_of
from assembly.geometry.expression import formula
from assembly.geometry.expression.formula import (
    arc_bound,
    formula_at,
    formula_head_at,
    point_bounds,
    range_bounds,
    refine,
)
from assembly.geometry.interval import _GROW, EPSILON, down, middle_of, most, off_of, up
from assembly.geometry.splines import bezier_ranges
from assembly.geometry.splines.bezier_ranges import (
    bezier_point_bounds,
    bezier_range_bounds,
    range_workspace_at,
    ranged_curve_at,
)

# Kinds of operands.
HULL, FORMULA, BEZIER = 0, 1, 2
# Kinds of bounds; AUTO takes the least of all.
AUTO, ELLIPSOID, CAPSULE, TAYLOR = 0, 1, 2, 3
# A piece of a curve. Pairs are (low, high) of x, y and z.
PIECE_RECORD = record_dtype(
    "f8",
    t0=1,  # its interval
    t1=1,
    p0=3,  # first end, last end, middle point [length]
    p1=3,
    pm=3,
    off=1,  # how far these may be off, the largest of the three below [length]
    wide=1,  # the width w of its ellipsoid, squared length
    length=1,  # of the ellipsoid
    radius=1,  # of the capsule
    span=1,  # number of the smooth part of the curve
    box=6,  # range of C over the interval: pairs
    speed=6,  # of C'
    bend=6,  # of C''
    jerk=6,  # of C'''
    mid=6,  # C in the middle: pairs
    mid_speed=6,  # C'
    mid_bend=6,  # C''
    first_end=1,  # 1: its first end is one of the smooth part
    last_end=1,
    off_0=1,  # how far the first end may be off [length]
    off_1=1,
    off_mid=1,
)
enclosed_piece_at = record_view(PIECE_RECORD)
P0 = place_of(PIECE_RECORD, "p0")
P1 = place_of(PIECE_RECORD, "p1")
OFF = place_of(PIECE_RECORD, "off")
WIDE = place_of(PIECE_RECORD, "wide")
LENGTH = place_of(PIECE_RECORD, "length")
RADIUS = place_of(PIECE_RECORD, "radius")
BOX = place_of(PIECE_RECORD, "box")
SPEED = place_of(PIECE_RECORD, "speed")
BEND = place_of(PIECE_RECORD, "bend")
JERK = place_of(PIECE_RECORD, "jerk")
MID = place_of(PIECE_RECORD, "mid")
MID_BEND = place_of(PIECE_RECORD, "mid_bend")
FIRST_END = place_of(PIECE_RECORD, "first_end")
LAST_END = place_of(PIECE_RECORD, "last_end")
PIECE = size_of(PIECE_RECORD)


@kernel(inline=True)
def copy_values(source, at, target, to):
    """The nine pairs of C, C' and C'' at source[at:] to target[to:]."""
    for k in range(18):
        target[to + k] = source[at + k]


@kernel(inner=True, exact=True)
def point_values(kind, table, pool, span, t, workspace, out, o):
    """Intervals of C, C', C'' at t to out[o:], nine pairs."""
    if kind == FORMULA:
        point_bounds(Store(table, pool), t, workspace)
        copy_values(workspace, formula.RESULTS, out, o)
    else:
        at = bezier_ranges.BEZIER_AT
        bezier_point_bounds(Store(table, pool), span, t, workspace, at)
        copy_values(workspace, at, out, o)


@kernel(inline=True)
def set_ranges(piece, workspace, at):
    """Copy the ranges of C and of its three derivatives, six numbers each, from workspace[at:]."""
    for k in range(6):
        piece.box[k] = workspace[at + k]
        piece.speed[k] = workspace[at + 6 + k]
        piece.bend[k] = workspace[at + 12 + k]
        piece.jerk[k] = workspace[at + 18 + k]


@kernel(inner=True, exact=True)
def fill_piece(kind, table, pool, workspace, x, o):
    """Fill the record at x[o:], in which the interval, the ends with their errors and the smooth part are given."""
    piece = enclosed_piece_at(x, o)
    work = range_workspace_at(workspace, 0)
    t0 = piece.t0
    t1 = piece.t1
    middle = 0.5 * (t0 + t1)
    span = int(piece.span)
    point_values(kind, table, pool, span, middle, workspace, x, o + MID)
    for k in range(3):
        piece.pm[k] = middle_of(x, o + MID, k)
    piece.off_mid = off_of(x, o + MID)
    piece.off = max(piece.off_0, max(piece.off_1, piece.off_mid))
    width = math.inf
    arc = math.inf
    if kind == FORMULA:
        range_bounds(Store(table, pool), t0, t1, workspace)
        set_ranges(piece, workspace, formula.RESULTS)
        if formula_at(table, 0).arc_tape != 0:
            arc = arc_bound(Store(table, pool), t0, t1, workspace)
    else:
        bezier_range_bounds(Store(table, pool), span, t0, t1, workspace)
        set_ranges(piece, workspace, 0)
        width = work.width
    refine(x, o + BOX, up(max(middle - t0, t1 - middle)), o + MID)
    step = up(t1 - t0)
    bend = most(x, o + BEND)
    piece.radius = _GROW * 0.125 * step * step * bend
    a = piece.p1[0] - piece.p0[0]
    b = piece.p1[1] - piece.p0[1]
    c = piece.p1[2] - piece.p0[2]
    chord = math.sqrt(a * a + b * b + c * c)
    if width == math.inf:
        # 1 / sqrt 12 and 1 / sqrt 320, rounded up.
        root = 0.288675134594813 * bend
        root = min(root, 0.288675134594813 * most(x, o + MID_BEND) + 0.0559016994374948 * step * most(x, o + JERK))
        root = _GROW * step * step * root
        width = _GROW * root * root
        arc = min(arc, _GROW * step * most(x, o + SPEED))
        least = max(0.0, chord * (1.0 - 8.0 * EPSILON) - 2.0 * piece.off)
        across = arc - least if arc > least else 0.0
        # u^2 - |chi|^2 as a product: sums of squares would cancel once more.
        other = _GROW * across * (arc + least) if arc < math.inf else math.inf
        width = min(width, other)
    if not (width < math.inf):
        width = math.inf
    piece.wide = width
    piece.length = math.sqrt(width + chord * chord)


@kernel(inner=True, exact=True)
def split_piece(kind, table, pool, workspace, x, o, p):
    """Write both halves of the piece at x[o:] to x[p:] and behind; False if no double lies inside its interval."""
    piece = enclosed_piece_at(x, o)
    t0 = piece.t0
    t1 = piece.t1
    middle = 0.5 * (t0 + t1)
    if not (t0 < middle < t1):
        return False
    for side in range(2):
        q = p + PIECE * side
        half = enclosed_piece_at(x, q)
        half.t0 = t0 if side == 0 else middle
        half.t1 = middle if side == 0 else t1
        for k in range(3):
            half.p0[k] = piece.p0[k] if side == 0 else piece.pm[k]
            half.p1[k] = piece.pm[k] if side == 0 else piece.p1[k]
        half.off_0 = piece.off_0 if side == 0 else piece.off_mid
        half.off_1 = piece.off_mid if side == 0 else piece.off_1
        half.span = piece.span
        half.first_end = piece.first_end if side == 0 else 0.0
        half.last_end = 0.0 if side == 0 else piece.last_end
        fill_piece(kind, table, pool, workspace, x, q)
    return True


@kernel(inner=True, exact=True)
def fill_ends(kind, table, pool, workspace, span, x, o):
    """The ends of the piece at x[o:], and how far they may be off."""
    piece = enclosed_piece_at(x, o)
    point_values(kind, table, pool, span, piece.t0, workspace, x, o + MID)
    for k in range(3):
        piece.p0[k] = middle_of(x, o + MID, k)
    piece.off_0 = off_of(x, o + MID)
    point_values(kind, table, pool, span, piece.t1, workspace, x, o + MID)
    for k in range(3):
        piece.p1[k] = middle_of(x, o + MID, k)
    piece.off_1 = off_of(x, o + MID)


@kernel(inner=True, exact=True)
def first_pieces(kind, table, pool, workspace, x):
    """Records of the smooth parts of a curve to x. Returns how many."""
    head = formula_head_at(pool, 0)
    count = 1 if kind == FORMULA else ranged_curve_at(table, 0).pieces
    for i in range(count):
        o = PIECE * i
        piece = enclosed_piece_at(x, o)
        piece.t0 = head.domain[0] if kind == FORMULA else 0.0
        piece.t1 = head.domain[1] if kind == FORMULA else 1.0
        piece.span = i
        piece.first_end = 1.0
        piece.last_end = 1.0
        fill_ends(kind, table, pool, workspace, i, x, o)
        fill_piece(kind, table, pool, workspace, x, o)
    return count


@kernel(inline=True)
def along(x, o, n, c):
    """n.(p - c) of the point at x[o:], and what its rounding may be."""
    a = n[0] * (x[o] - c[0])
    b = n[1] * (x[o + 1] - c[1])
    d = n[2] * (x[o + 2] - c[2])
    return a + b + d, 4.0 * EPSILON * (abs(a) + abs(b) + abs(d))


@kernel(inner=True, exact=True)
def hull_support(x, o, count, n, c):
    """Upper bound of n.(p - c) over `count` points from x[o]."""
    best = -math.inf
    for k in range(count):
        f, slack = along(x, o + 3 * k, n, c)
        best = max(best, f + slack)
    return up(best)


@kernel(inner=True, exact=True)
def piece_support(x, o, n, c, bound):
    """Upper bound of n.(C - c) over a piece, |n| at most 1 up to 2 units, by a kind of enclosure."""
    piece = enclosed_piece_at(x, o)
    f0, e0 = along(x, o + P0, n, c)
    f1, e1 = along(x, o + P1, n, c)
    slack = piece.off * _GROW + e0 + e1
    d = f1 - f0
    best = math.inf
    # The support of the box, which needs no evaluated points.
    boxed = math.inf
    if bound == AUTO or bound == ELLIPSOID:
        # Ends that are off by OFF change both the center and the chord; each by less than OFF in the sum below.
        best = 0.5 * (f0 + f1) + _GROW * 0.5 * math.sqrt(piece.wide * _GROW + d * d) + slack
    if bound == CAPSULE:
        best = max(f0, f1) + piece.radius * _GROW
    if bound == AUTO or bound == TAYLOR:
        least = 0.0
        for k in range(3):
            if n[k] == 0.0:  # 0 times infinity is NaN
                continue
            p = n[k] * piece.bend[2 * k]
            q = n[k] * piece.bend[2 * k + 1]
            least += min(p, q) - EPSILON * 4.0 * max(abs(p), abs(q)) - 1e-300
        step = up(piece.t1 - piece.t0)
        # q / 2 of the heading.
        bulge = _GROW * 0.5 * step * step * max(0.0, -least)
        if not (bulge < math.inf):
            high = math.inf
        elif abs(d) >= bulge:
            high = max(f0, f1)
        else:
            high = 0.5 * (f0 + f1) + _GROW * (0.25 * bulge + d * d / (4.0 * bulge))
        best = min(best, high)
        high = 0.0
        for k in range(3):
            if n[k] == 0.0:
                continue
            p = n[k] * (piece.box[2 * k] - c[k])
            q = n[k] * (piece.box[2 * k + 1] - c[k])
            high += max(p, q) + EPSILON * 4.0 * max(abs(p), abs(q))
        if high == high:
            boxed = high
    best = min(best + slack, boxed)
    if not (best < math.inf):
        return math.inf
    return up(best + 4.0 * EPSILON * abs(best))


@kernel(inner=True, exact=True)
def separation_along(xa, oa, xb, ob, count_b, n, bound):
    """Lower bound of the distance of two pieces, or of a piece and `count_b` points, from a direction of a to b."""
    piece = enclosed_piece_at(xa, oa)
    size = math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    if not (0.0 < size < math.inf):
        return 0.0
    n = (n[0] / size, n[1] / size, n[2] / size)
    back = (-n[0], -n[1], -n[2])
    c = (piece.pm[0], piece.pm[1], piece.pm[2])
    high_a = piece_support(xa, oa, n, c, bound)
    if count_b > 0:
        high_b = hull_support(xb, ob, count_b, back, c)
    else:
        high_b = piece_support(xb, ob, back, c, bound)
    # n is of unit length up to two units in the last place.
    lower = down(-high_a - high_b) * (1.0 - 8.0 * EPSILON)
    return lower if lower > 0.0 else 0.0


@kernel(signatures="(i8, i8[::1], f8[::1], f8[::1], i8, f8, f8, f8[::1])")
def enclose(kind, table, pool, workspace, span, t0, t1, x):
    """The record of the piece over [t0, t1], to x; of a smooth part `span` of the curve."""
    piece = enclosed_piece_at(x, 0)
    piece.t0, piece.t1, piece.span = t0, t1, span
    piece.first_end, piece.last_end = 1.0, 1.0
    fill_ends(kind, table, pool, workspace, span, x, 0)
    fill_piece(kind, table, pool, workspace, x, 0)


@kernel(signatures="(f8[::1], f8[:, ::1], i8, f8[::1])")
def supports(x, directions, bound, out):
    """Upper bounds of n.C over the piece of a record for unit directions (k, 3)."""
    piece = enclosed_piece_at(x, 0)
    for i in range(directions.shape[0]):
        n = (directions[i, 0], directions[i, 1], directions[i, 2])
        c = (piece.pm[0], piece.pm[1], piece.pm[2])
        shift = n[0] * c[0] + n[1] * c[1] + n[2] * c[2]
        size = abs(n[0] * c[0]) + abs(n[1] * c[1]) + abs(n[2] * c[2])
        out[i] = up(piece_support(x, 0, n, c, bound) + shift + 8.0 * EPSILON * size)
