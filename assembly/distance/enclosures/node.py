"""The lower bound of the distance of one pair of pieces, and points on them that may be the nearest known.

The bound is that of a direction that separates the pieces (`distance/enclosures/enclosure.py`) or, with `polish` and
where it is larger, that of second derivatives (`taylor.py`) about the points that Newton's method found: a pair that
holds an isolated minimum need not be halved then.
"""

from __future__ import annotations

import math
from collections import namedtuple

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
from assembly.distance.enclosures.gjk import INSIDE, ConvexSet, gjk, numbers_of, on_b, put_numbers
from assembly.distance.enclosures.newton import hull_point, newton
from assembly.distance.enclosures.taylor import (
    BoxHessian,
    ValuesAt,
    across_feature,
    box_hessian,
    feature_rows,
    taylor_bound,
    turn_values,
)
from assembly.geometry.expression.formula import formula_head_at
from assembly.geometry.interval import EPSILON, middle_of, off_of, up
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
    lower=1,  # proven lower bound of the distance [length]
    lowest=1,  # the same, before `slack` is subtracted
    limit=1,  # pairs whose bound is at least this are let go (pruned)
    let_go=1,  # the least bound of the pairs that were let go
    off_a=1,  # how far points of the best known piece of a curve may be off
    off_b=1,
    used_a=1,  # pieces of the curves
    used_b=1,
)
search_state_at = record_view(SEARCH_STATE)
UPPER = place_of(SEARCH_STATE, "upper")
AT_S = place_of(SEARCH_STATE, "at_s")
SPAN_A = place_of(SEARCH_STATE, "span_a")
AT_T = place_of(SEARCH_STATE, "at_t")
SPAN_B = place_of(SEARCH_STATE, "span_b")
POINT_A = place_of(SEARCH_STATE, "point_a")
MET = place_of(SEARCH_STATE, "met")
COUNT = place_of(SEARCH_STATE, "count")
STATE = size_of(SEARCH_STATE)
LOWER = place_of(SEARCH_STATE, "lower")
# The workspace of a search; it begins with the state.
SEARCH_ROOM = record_dtype(
    "f8",
    state=STATE,  # a `SEARCH_STATE`
    values=18,  # of the first curve at a parameter: pairs of C, C', C''
    other_values=18,  # of the second
    across=PIECE,  # a piece projected on the orthogonal complement of a hull's feature
    rows=9,  # three, orthonormal or zero, that span this complement
)
search_room_at = record_view(SEARCH_ROOM)
VALUES = place_of(SEARCH_ROOM, "values")
OTHER_VALUES = place_of(SEARCH_ROOM, "other_values")
SCRATCH = size_of(SEARCH_ROOM)
# A shape as a search reads it: its kind, table and pool (of a hull: its vertices), the workspace of its evaluation, the
# first half of each piece (-1: none yet), the records of its pieces, and the number of vertices (of a curve: 0).
EnclosedShape = namedtuple("EnclosedShape", "kind table pool workspace halves pieces count")
# full: the dimension plus one; a, b: shapes, of which a is a curve; bound: kind of enclosure; state: a block of
# SEARCH_ROOM; spare: two records of pieces, of which the first is a constant curve if b is a hull; g: a simplex.
EnclosureSearch = namedtuple("EnclosureSearch", "full a b question bound heap state spare g")
# Parameters on the smooth parts of two curves.
PairPlace = namedtuple("PairPlace", "s span_a t span_b")
# Corners of a triangle and of a tetrahedron around zero, turned so that edges of modeled shapes are hardly ever
# parallel to theirs, and the sizes of their copies about a point, as parts of the hull's size.
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
        least = 2.0 * off * (a + b + c) + 16.0 * EPSILON * (a * b + b * c + c * a)
        return min(u, v, w) > least or max(u, v, w) < -least
    s = sub(on_b(g, 3), x)
    d = math.sqrt(dot(s, s))
    u = dot(q, cross(r, s))
    v = -dot(p, cross(r, s))
    w = dot(p, cross(q, s))
    z = -dot(p, cross(q, r))
    farthest = max(max(a, b), max(c, d))
    least = (8.0 * off + 64.0 * EPSILON * farthest) * farthest * farthest
    return min(min(u, v), min(w, z)) > least or max(max(u, v), max(w, z)) < -least


@kernel(inline=True)
def corner_around(full, k, size):
    """The k-th of `full` places around zero, about `size` from it: zero is inside of their simplex."""
    if full == 3:
        return scale(size, _TRIANGLE[k])
    return scale(size, _TETRAHEDRON[k])


@kernel(inner=True, exact=True)
def surrounded(full, points, count, x, off, g):
    """Whether a point, known up to `off`, is proven inside a hull, as points around it are. Overwrites g.

    A point on a diagonal of the hull, as the middle of a cube, is on the boundary of every simplex that GJK ends with.
    Points around it are not, and a convex set that contains them contains it.
    """
    farthest = 0.0
    for i in range(count):
        d = sub((points[3 * i], points[3 * i + 1], points[3 * i + 2]), x)
        farthest = max(farthest, dot(d, d))
    farthest = math.sqrt(farthest)
    # Rounding of the sums below.
    off += 4.0 * EPSILON * (abs(x[0]) + abs(x[1]) + abs(x[2]) + farthest)
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
def meet_points(search, a, off_a, b, off_b):
    """Distance, rounded up, of two points, or of a point and a hull; the point of b, and how many vertices carry it.

    Sets `met` where the point is proven inside the hull.
    """
    full, points, count, g = search.full, search.b.pool, search.b.count, search.g
    best = search_state_at(search.state, 0)
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
        # `surrounded` overwrote g: find the vertices that carry the point again.
        b, kept, _inside, off_b = hull_point(full, points, count, a, g)
    return up(distance * (1.0 + 8.0 * EPSILON) + off_a + off_b), b, kept


@kernel(inner=True, exact=True)
def note(state, distance, place, a, b):
    """Keep points that are nearer than the best."""
    best = search_state_at(state, 0)
    if distance < best.upper:
        best.upper = distance
        best.at_s, best.span_a, best.at_t, best.span_b = place.s, place.span_a, place.t, place.span_b
        for k in range(3):
            best.point_a[k] = a[k]
            best.point_b[k] = b[k]
        return True
    return False


@kernel(inline=True)
def middles(state, at):
    """The point in the middle of three pairs."""
    return middle_of(state, at, 0), middle_of(state, at, 1), middle_of(state, at, 2)


@kernel(inner=True, exact=True)
def note_parameters(search, place):
    """Write values at two parameters to the state, and keep their points if they are nearer than the best."""
    a, b, state = search.a, search.b, search.state
    point_values(a.kind, a.table, a.pool, place.span_a, place.s, a.workspace, state, VALUES)
    if b.kind == HULL:
        if b.count == 1:
            copy_values(b.pieces, MID, state, OTHER_VALUES)
        point = (b.pool[0], b.pool[1], b.pool[2])
        off = 0.0
    else:
        point_values(b.kind, b.table, b.pool, place.span_b, place.t, b.workspace, state, OTHER_VALUES)
        point = middles(state, OTHER_VALUES)
        off = off_of(state, OTHER_VALUES)
    on_a = middles(state, VALUES)
    distance, on_b, kept = meet_points(search, on_a, off_of(state, VALUES), point, off)
    note(state, distance, place, on_a, on_b)
    return kept


@kernel(inner=True, exact=True)
def domain_of(kind, pool):
    """Parameters of a smooth part of a curve."""
    head = formula_head_at(pool, 0)
    if kind == FORMULA:
        return head.domain[0], head.domain[1]
    return 0.0, (0.0 if kind == HULL else 1.0)


@kernel(inner=True, exact=True)
def hull_taylor(search, oa, kept, new, s):
    """Bound by second derivatives across the feature in g, whether that is convex, and whether no minimum is inside.

    The expansion is about the middle of the piece or, if `new`, about the values at s that the state holds.
    """
    full, xa, points, state = search.full, search.a.pieces, search.b.pool, search.state
    numbers = numbers_of(search.g)
    feature = (int(numbers[0]), int(numbers[1]) if kept > 1 else -1, int(numbers[2]) if kept > 2 else -1)
    rows = search_room_at(state, 0).rows
    if not feature_rows(full, points, feature, rows):
        return 0.0, False, False
    y = search_room_at(state, 0).across
    worst = across_feature(xa, oa, points, search.b.count, feature, rows, y)
    f = 3 * feature[0]
    v = (points[f], points[f + 1], points[f + 2])
    if new:
        for row in range(3):
            turn_values(state, VALUES, rows, row, v, y, MID)
    zero = search.spare
    hessian = box_hessian(y, 0, zero, 0)
    piece, still = enclosed_piece_at(y, 0), enclosed_piece_at(zero, 0)
    lower, convex = taylor_bound(piece, still, hessian, ValuesAt(y, MID, s), ValuesAt(zero, MID, 0.0))
    lower = lower * (1.0 - 32.0 * EPSILON) - worst
    # Across a vertex, F is of the distance itself; across others, of a lower bound of it, whose slope proves nothing.
    return max(lower, 0.0), convex, hessian.empty and worst == 0.0 and kept == 1


@kernel(inline=True)
def middle_place(piece_a, piece_b, hull):
    """The middles of two pieces; a hull has none."""
    s = 0.5 * (piece_a.t0 + piece_a.t1)
    if hull:
        return PairPlace(s, int(piece_a.span), 0.0, 0)
    return PairPlace(s, int(piece_a.span), 0.5 * (piece_b.t0 + piece_b.t1), int(piece_b.span))


@kernel(inner=True, exact=True)
def parting_bound(search, oa, ob, first):
    """Lower bound of the distance of two pieces along a direction that separates them, found by GJK."""
    full, a, b, bound, g = search.full, search.a, search.b, search.bound, search.g
    piece_a, piece_b = enclosed_piece_at(a.pieces, oa), enclosed_piece_at(b.pieces, ob)
    best = search_state_at(search.state, 0)
    hull = b.count > 1
    # A hull has its vertices, a piece its ends and its middle.
    points = b.pool if hull else b.pieces
    place = 0 if hull else ob + P0
    count = b.count if hull else 3
    if bound == ELLIPSOID and piece_a.wide < math.inf and (hull or piece_b.wide < math.inf):
        set_b = ConvexSet(points, place, count, -1.0 if hull else piece_b.wide)
        how, v, _k = gjk(full, ConvexSet(a.pieces, oa + P0, 2, piece_a.wide), set_b, first, best.upper, 1e-6, g)
    else:
        set_b = ConvexSet(points, place, count, -1.0)
        how, v, _k = gjk(full, ConvexSet(a.pieces, oa + P0, 3, -1.0), set_b, first, math.inf, 1e-9, g)
    if how == INSIDE:
        return 0.0
    count_b = b.count if hull else 0
    return separation_along(a.pieces, oa, points, 0 if hull else ob, count_b, (-v[0], -v[1], -v[2]), bound)


@kernel(inner=True, exact=True)
def bound_node(search, oa, ob):
    """Lower bound of the distance of two pieces; better points go to the state. Infinite where no minimum is inside."""
    a, b, question = search.a, search.b, search.question
    piece_a, piece_b = enclosed_piece_at(a.pieces, oa), enclosed_piece_at(b.pieces, ob)
    best = search_state_at(search.state, 0)
    best.count += 1.0
    hull = b.count > 1
    on_a = (piece_a.pm[0], piece_a.pm[1], piece_a.pm[2])
    on_b = (piece_b.pm[0], piece_b.pm[1], piece_b.pm[2]) if not hull else (0.0, 0.0, 0.0)
    place = middle_place(piece_a, piece_b, hull)
    upper, on_b, kept = meet_points(search, on_a, piece_a.off_mid, on_b, piece_b.off_mid if not hull else 0.0)
    feature = numbers_of(search.g)
    better = note(search.state, upper, place, on_a, on_b)
    if best.met > 0.0:
        return 0.0, upper
    # Most searches about a clearance end before Newton's method would pay for itself.
    if question.polish and better and (not question.clearance >= 0.0 or best.count > 8.0):
        s, t = newton(search, place, domain_of(a.kind, a.pool), domain_of(b.kind, b.pool))
        note_parameters(search, PairPlace(s, place.span_a, t, place.span_b))
        if best.met > 0.0:
            return 0.0, upper
    lower = parting_bound(search, oa, ob, sub(on_a, on_b))
    if not question.polish or lower >= best.upper - 0.5 * question.tolerance:
        return lower, upper
    return max(lower, polished_bound(search, oa, ob, kept, feature)), upper


@kernel(inner=True, exact=True)
def polished_bound(search, oa, ob, kept, feature):
    """Bound by second derivatives about the middle, and about the minimum inside if there is but one."""
    xa, xb, state = search.a.pieces, search.b.pieces, search.state
    piece_a, piece_b = enclosed_piece_at(xa, oa), enclosed_piece_at(xb, ob)
    best = search_state_at(state, 0)
    hull = search.b.count > 1
    place = middle_place(piece_a, piece_b, hull)
    t0, t1 = (0.0, 0.0) if hull else (piece_b.t0, piece_b.t1)
    hessian = BoxHessian(0.0, 0.0, 0.0, False)
    if hull:
        put_numbers(search.g, feature)
        lower, convex, empty = hull_taylor(search, oa, kept, False, place.s)
        if empty:
            return math.inf
    else:
        hessian = box_hessian(xa, oa, xb, ob)
        if hessian.empty:
            return math.inf
        values_a, values_b = ValuesAt(xa, oa + MID, place.s), ValuesAt(xb, ob + MID, place.t)
        lower, convex = taylor_bound(piece_a, piece_b, hessian, values_a, values_b)
    here = best.span_a == place.span_a and piece_a.t0 <= best.at_s <= piece_a.t1
    here = here and (hull or (best.span_b == place.span_b and t0 <= best.at_t <= t1))
    if lower >= best.upper - 0.5 * search.question.tolerance or not (convex or here):
        return lower
    if here:
        s, t = best.at_s, best.at_t
    else:
        s, t = newton(search, place, (piece_a.t0, piece_a.t1), (t0, t1))
    kept = note_parameters(search, PairPlace(s, place.span_a, t, place.span_b))
    if best.met > 0.0:
        return 0.0
    if hull:
        if kept >= search.full:
            return lower
        other, _c, _e = hull_taylor(search, oa, kept, True, s)
    else:
        values_a, values_b = ValuesAt(state, VALUES, s), ValuesAt(state, OTHER_VALUES, t)
        other, _c = taylor_bound(piece_a, piece_b, hessian, values_a, values_b)
    return max(lower, other)
