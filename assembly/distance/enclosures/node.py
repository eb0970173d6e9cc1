"""What one pair of pieces tells: a lower bound of its distance, and points that may be the nearest known.

The bound is the best of a direction that parts the pieces (`distance/enclosures/enclosure.py`) and, with `polish`, of
second derivatives (`taylor.py`) about the points that Newton's method found, so that an isolated minimum ends at once.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of
from assembly.distance.enclosures.enclosure import (
    ELLIPSOID,
    FORMULA,
    HULL,
    MID,
    P0,
    PIECE,
    copy_values,
    enclosed_piece_at,
    point_values,
    separation_along,
)
from assembly.distance.enclosures.gjk import INSIDE, gjk, numbers_of, on_b, put_numbers
from assembly.distance.enclosures.newton import hull_point, newton
from assembly.distance.enclosures.taylor import (
    across_feature,
    box_hessian,
    feature_rows,
    taylor_bound,
    turn_values,
)
from assembly.geometry.expression.formula import formula_head_at
from assembly.geometry.interval import UNIT, middle_of, off_of, up
from assembly.geometry.vec import add, cross, dot, scale, sub

# What a search knows of the distance, and the best points.
SEARCH_STATE = record_dtype(
    "f8",
    upper=1,  # distance of the best points, rounded up [length]
    at_s=1,  # their parameters and the smooth parts of the curves on which these are
    span_a=1,
    at_t=1,
    span_b=1,
    point_a=3,  # [length]
    point_b=3,  # [length]
    met=1,  # 1: a meeting is proven
    count=1,  # of the pairs bounded
    slack=1,  # how far vertices of a hull may be off [length]
    spare=1,
    lower=1,  # proven lower bound of the distance [length]
)
search_state_at = record_view(SEARCH_STATE)
UPPER = place_of(SEARCH_STATE, "upper")
AT_S = place_of(SEARCH_STATE, "at_s")
SPAN_A = place_of(SEARCH_STATE, "span_a")
AT_T = place_of(SEARCH_STATE, "at_t")
SPAN_B = place_of(SEARCH_STATE, "span_b")
POINT_A = place_of(SEARCH_STATE, "point_a")
POINT_B = place_of(SEARCH_STATE, "point_b")
MET = place_of(SEARCH_STATE, "met")
COUNT = place_of(SEARCH_STATE, "count")
SLACK = place_of(SEARCH_STATE, "slack")
STATE = size_of(SEARCH_STATE)
LOWER = place_of(SEARCH_STATE, "lower")
# It is the beginning of the room of a search.
SEARCH_ROOM = record_dtype(
    "f8",
    state=STATE,  # a `SEARCH_STATE`
    values=18,  # of the first curve at a parameter: pairs of C, C', C''
    other_values=18,  # of the second
    across=PIECE,  # a piece as seen across a feature of a hull
    rows=9,  # three, orthonormal or zero, that span what is across the feature
)
VALUES = place_of(SEARCH_ROOM, "values")
OTHER_VALUES = place_of(SEARCH_ROOM, "other_values")
ACROSS = place_of(SEARCH_ROOM, "across")
ROWS = place_of(SEARCH_ROOM, "rows")
SCRATCH = size_of(SEARCH_ROOM)
# Corners of a triangle and of a tetrahedron around zero, turned so that nothing made by hand is parallel to them, and
# the sizes of their copies about a point, as parts of the hull's.
_TRIANGLE = ((0.765, 0.644, 0.0), (-0.94, 0.34, 0.0), (0.175, -0.984, 0.0))
_TETRAHEDRON = ((-0.787, -0.573, 0.229), (0.78, -0.582, -0.229), (0.232, 0.576, 0.784), (-0.226, 0.579, -0.784))
NEAR_BY = (1e-4, 1e-8, 1e-12)


@kernel(inner=True, exact=True)
def inside_proven(full, g, x, off):
    """Whether a point, known up to `off`, is inside the simplex of vertices of b that g holds."""
    p = sub(on_b(g, 0), x)
    q = sub(on_b(g, 1), x)
    r = sub(on_b(g, 2), x)
    a = math.sqrt(dot(p, p))
    b = math.sqrt(dot(q, q))
    c = math.sqrt(dot(r, r))
    if full == 3:
        u = cross(p, q)[2]
        v = cross(q, r)[2]
        w = cross(r, p)[2]
        least = 2.0 * off * (a + b + c) + 16.0 * UNIT * (a * b + b * c + c * a)
        return min(u, v, w) > least or max(u, v, w) < -least
    s = sub(on_b(g, 3), x)
    d = math.sqrt(dot(s, s))
    u = dot(q, cross(r, s))
    v = -dot(p, cross(r, s))
    w = dot(p, cross(q, s))
    z = -dot(p, cross(q, r))
    farthest = max(max(a, b), max(c, d))
    least = (8.0 * off + 64.0 * UNIT * farthest) * farthest * farthest
    return min(min(u, v), min(w, z)) > least or max(max(u, v), max(w, z)) < -least


@kernel(inline=True)
def corner_around(full, k, size):
    """The k-th of `full` places around zero, about `size` from it: zero is inside of their simplex."""
    if full == 3:
        return scale(size, _TRIANGLE[k])
    return scale(size, _TETRAHEDRON[k])


@kernel(inner=True, exact=True)
def surrounded(full, points, count, x, off, g):
    """Whether a point, known up to `off`, is proven inside a hull by places around it. Overwrites g.

    On a diagonal of the hull, as in the middle of a cube, a point is on the border of every simplex that the search for
    the nearest point ends with. Places about it are not, and a convex set that holds them holds it.
    """
    farthest = 0.0
    for i in range(count):
        d = sub((points[3 * i], points[3 * i + 1], points[3 * i + 2]), x)
        farthest = max(farthest, dot(d, d))
    farthest = math.sqrt(farthest)
    # What the sums below are rounded by.
    off += 4.0 * UNIT * (abs(x[0]) + abs(x[1]) + abs(x[2]) + farthest)
    for part in NEAR_BY:
        proven = 0
        for k in range(full):
            y = add(x, corner_around(full, k, part * farthest))
            inside = hull_point(full, points, count, y, g)[2]
            if not (inside and inside_proven(full, g, y, off)):
                break
            proven += 1
        if proven == full:
            return True
    return False


@kernel(inner=True, exact=True)
def meet_points(full, kb, points, count, a, off_a, b, off_b, state, g):
    """Distance of two points, rounded up, or of a point and a hull with its nearest point and what carries it.

    A point that is proven inside the hull is noted.
    """
    best = search_state_at(state, 0)
    kept = 0
    off_a += best.slack
    if count > 1:
        b, kept, inside, off_b = hull_point(full, points, count, a, g)
        if inside and inside_proven(full, g, a, off_a):
            best.met = 1.0
            return 0.0, a, full
    d = sub(a, b)
    distance = math.sqrt(dot(d, d))
    if count > full and distance <= off_a + off_b:
        if surrounded(full, points, count, a, off_a, g):
            best.met = 1.0
            return 0.0, a, full
        # For what carries the point.
        b, kept, _inside, off_b = hull_point(full, points, count, a, g)
    return up(distance * (1.0 + 8.0 * UNIT) + off_a + off_b), b, kept


@kernel(inner=True, exact=True)
def note(state, distance, s, span_a, t, span_b, a, b):
    """Keep points that are nearer than the best."""
    best = search_state_at(state, 0)
    if distance < best.upper:
        best.upper = distance
        best.at_s, best.span_a, best.at_t, best.span_b = s, span_a, t, span_b
        for k in range(3):
            best.point_a[k] = a[k]
            best.point_b[k] = b[k]
        return True
    return False


@kernel(inner=True, exact=True)
def note_parameters(full, ka, ta, pa, ra, kb, tb, pb, rb, count, s, span_a, t, span_b, xb, state, g):
    """Values at two parameters to the state, and their points if they are nearer than the best."""
    point_values(ka, ta, pa, span_a, s, ra, state, VALUES)
    a = (middle_of(state, VALUES, 0), middle_of(state, VALUES, 1), middle_of(state, VALUES, 2))
    off_a = off_of(state, VALUES)
    if kb == HULL:
        if count == 1:
            copy_values(xb, MID, state, OTHER_VALUES)
        b = (pb[0], pb[1], pb[2])
        off_b = 0.0
    else:
        point_values(kb, tb, pb, span_b, t, rb, state, OTHER_VALUES)
        b = (middle_of(state, OTHER_VALUES, 0), middle_of(state, OTHER_VALUES, 1), middle_of(state, OTHER_VALUES, 2))
        off_b = off_of(state, OTHER_VALUES)
    distance, b, kept = meet_points(full, kb, pb, count if kb == HULL else 0, a, off_a, b, off_b, state, g)
    note(state, distance, s, span_a, t, span_b, a, b)
    return kept


@kernel(inner=True, exact=True)
def domain_of(kind, pool):
    """Parameters of a smooth part of a curve."""
    head = formula_head_at(pool, 0)
    if kind == FORMULA:
        return head.domain[0], head.domain[1]
    return 0.0, (0.0 if kind == HULL else 1.0)


@kernel(inner=True, exact=True)
def hull_taylor(full, xa, oa, points, count, kept, values, at, new, s, state, zero, g):
    """Bound by second derivatives across the feature in g, from values at s, and whether that is convex."""
    numbers = numbers_of(g)
    feature = (int(numbers[0]), int(numbers[1]) if kept > 1 else -1, int(numbers[2]) if kept > 2 else -1)
    rows = state[ROWS : ROWS + 9]
    if not feature_rows(full, points, feature, rows):
        return 0.0, False, False
    y = state[ACROSS : ACROSS + PIECE]
    worst = across_feature(xa, oa, points, count, feature, rows, y)
    f = 3 * feature[0]
    v = (points[f], points[f + 1], points[f + 2])
    if new:
        for row in range(3):
            turn_values(values, at, rows, row, v, y, MID)
    hessian = box_hessian(y, 0, zero, 0)
    lower, convex = taylor_bound(y, 0, zero, 0, hessian, y, MID, s, zero, MID, 0.0)
    lower = lower * (1.0 - 32.0 * UNIT) - worst
    # Across a vertex the distance itself is seen; across others a lower bound of it, whose slope tells nothing.
    return max(lower, 0.0), convex, hessian[3] and worst == 0.0 and kept == 1


@kernel(inner=True, exact=True)
def bound_node(
    full, ka, ta, pa, ra, xa, oa, kb, tb, pb, rb, xb, ob, count, bound, polish, tolerance, clearance, state, zero, g
):
    """Lower bound of the distance of two pieces; better points go to the state. Infinite where no minimum is inside."""
    piece = enclosed_piece_at(xa, oa)
    piece_record = enclosed_piece_at(xb, ob)
    best = search_state_at(state, 0)
    best.count += 1.0
    hull = count > 1
    a = (piece.pm[0], piece.pm[1], piece.pm[2])
    b = (piece_record.pm[0], piece_record.pm[1], piece_record.pm[2]) if not hull else (0.0, 0.0, 0.0)
    off_b = piece_record.off_mid if not hull else 0.0
    s = 0.5 * (piece.t0 + piece.t1)
    t = 0.5 * (piece_record.t0 + piece_record.t1) if not hull else 0.0
    span_a = int(piece.span)
    span_b = int(piece_record.span) if not hull else 0
    upper, b, kept = meet_points(full, kb, pb, count, a, piece.off_mid, b, off_b, state, g)
    feature = numbers_of(g)
    better = note(state, upper, s, span_a, t, span_b, a, b)
    if best.met > 0.0:
        return 0.0, upper
    # Asked for a clearance, most searches end before a better point is worth its price.
    if polish and better and (not clearance >= 0.0 or best.count > 8.0):
        s0, s1 = domain_of(ka, pa)
        t0, t1 = domain_of(kb, pb)
        u, w = newton(full, ka, ta, pa, span_a, ra, kb, tb, pb, span_b, rb, count, s, t, s0, s1, t0, t1, g)
        note_parameters(full, ka, ta, pa, ra, kb, tb, pb, rb, count, u, span_a, w, span_b, xb, state, g)
        if best.met > 0.0:
            return 0.0, upper
    # A direction by which the pieces are far apart.
    points_b = count if hull else 3
    place_b = 0 if hull else ob + P0
    set_b = pb if hull else xb
    first = sub(a, b)
    if bound == ELLIPSOID and piece.wide < math.inf and (hull or piece_record.wide < math.inf):
        wide_b = -1.0 if hull else piece_record.wide
        how, v, _k = gjk(full, xa, oa + P0, 2, piece.wide, set_b, place_b, points_b, wide_b, first, best.upper, 1e-6, g)
    else:
        how, v, _k = gjk(full, xa, oa + P0, 3, -1.0, set_b, place_b, points_b, -1.0, first, math.inf, 1e-9, g)
    lower = 0.0
    if how != INSIDE:
        lower = separation_along(xa, oa, set_b, 0 if hull else ob, count if hull else 0, (-v[0], -v[1], -v[2]), bound)
    if not polish or lower >= best.upper - 0.5 * tolerance:
        return lower, upper
    return max(
        lower,
        polished_bound(
            full, ka, ta, pa, ra, xa, oa, kb, tb, pb, rb, xb, ob, count, kept, feature, tolerance, state, zero, g
        ),
    ), upper


@kernel(inner=True, exact=True)
def polished_bound(
    full, ka, ta, pa, ra, xa, oa, kb, tb, pb, rb, xb, ob, count, kept, feature, tolerance, state, zero, g
):
    """Bound by second derivatives about the middle, and about the minimum inside if there is but one."""
    piece = enclosed_piece_at(xa, oa)
    piece_record = enclosed_piece_at(xb, ob)
    best = search_state_at(state, 0)
    hull = count > 1
    s0, s1 = piece.t0, piece.t1
    s = 0.5 * (s0 + s1)
    span_a = int(piece.span)
    t0, t1, span_b = 0.0, 0.0, 0
    hessian = (0.0, 0.0, 0.0, False)
    if hull:
        put_numbers(g, feature)
        lower, convex, empty = hull_taylor(full, xa, oa, pb, count, kept, xa, oa + MID, False, s, state, zero, g)
        if empty:
            return math.inf
    else:
        t0, t1 = piece_record.t0, piece_record.t1
        span_b = int(piece_record.span)
        hessian = box_hessian(xa, oa, xb, ob)
        if hessian[3]:
            return math.inf
        t = 0.5 * (t0 + t1)
        lower, convex = taylor_bound(xa, oa, xb, ob, hessian, xa, oa + MID, s, xb, ob + MID, t)
    here = best.span_a == span_a and s0 <= best.at_s <= s1
    here = here and (hull or (best.span_b == span_b and t0 <= best.at_t <= t1))
    if lower >= best.upper - 0.5 * tolerance or not (convex or here):
        return lower
    t = 0.5 * (t0 + t1)
    if here:
        s, t = best.at_s, best.at_t
    else:
        s, t = newton(full, ka, ta, pa, span_a, ra, kb, tb, pb, span_b, rb, count, s, t, s0, s1, t0, t1, g)
    kept = note_parameters(full, ka, ta, pa, ra, kb, tb, pb, rb, count, s, span_a, t, span_b, xb, state, g)
    if best.met > 0.0:
        return 0.0
    if hull:
        if kept >= full:
            return lower
        other, _c, _e = hull_taylor(full, xa, oa, pb, count, kept, state, VALUES, True, s, state, zero, g)
    else:
        other, _c = taylor_bound(xa, oa, xb, ob, hessian, state, VALUES, s, state, OTHER_VALUES, t)
    return max(lower, other)
