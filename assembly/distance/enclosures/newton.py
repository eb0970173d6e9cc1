"""Newton's method on |a(s) - b(t)|^2 / 2 within bounds of s and t: it finds good upper bounds and proves nothing."""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._newton import damped_newton
from assembly._record import Store
from assembly.distance.enclosures.enclosure import FORMULA, HULL
from assembly.distance.enclosures.gjk import INSIDE, POINT, ConvexSet, gjk, inside_weights, on_b, simplex_at
from assembly.geometry.expression.formula import formula_point, formula_workspace_at
from assembly.geometry.interval import EPSILON
from assembly.geometry.splines.bezier_ranges import BEZIER_AT, piece_points, ranged_curve_at, value, weighted_point_at
from assembly.geometry.vec import blend, dot, sub

_ROUNDS = 24
PlaceQuery = namedtuple("PlaceQuery", "search place bounds_s bounds_t")
# |r|^2, r = a - b, the derivatives of both, and the part of a' orthogonal to the feature of a hull that carries b.
PlacePoints = namedtuple("PlacePoints", "merit r a1 a2 b1 b2 c1")


@kernel(inner=True)
def local_point(kind, table, pool, span, t, workspace):
    """C, C', C'' at t."""
    if kind == FORMULA:
        formula_point(Store(table, pool), t, workspace)
        c = formula_workspace_at(workspace, 0).results
        return (c[0], c[1], c[2]), (c[3], c[4], c[5]), (c[6], c[7], c[8])
    found = weighted_point_at(workspace, BEZIER_AT)
    o, n = piece_points(table, span, 0)
    value(pool, o, n, t, workspace, BEZIER_AT)
    w = found.weight
    p = (found.position[0], found.position[1], found.position[2])
    o, n = piece_points(table, span, 1)
    value(pool, o, n, t, workspace, BEZIER_AT)
    w1 = found.weight
    d = (found.position[0], found.position[1], found.position[2])
    o, n = piece_points(table, span, 2)
    dd = (0.0, 0.0, 0.0)
    w2 = 0.0
    if n >= 0:
        value(pool, o, n, t, workspace, BEZIER_AT)
        w2 = found.weight
        dd = (found.position[0], found.position[1], found.position[2])
    if ranged_curve_at(table, 0).rational == 0:
        return p, d, dd
    f = 1.0 / w
    p = (f * p[0], f * p[1], f * p[2])
    d = blend(f, d, -f * w1, p)
    dd = blend(f, dd, -2.0 * f * w1, d)
    return p, d, blend(1.0, dd, -f * w2, p)


@kernel(inner=True)
def hull_point(full, points, count, x, g):
    """Nearest point of a hull, how many vertices carry it, whether x is inside, and how far the point may be off it.

    The point is a vertex plus parts of the differences to the others: its error is half a unit in the last place of
    itself plus some units of those parts.
    """
    v = (x[0] - points[0], x[1] - points[1], x[2] - points[2])
    simplex = simplex_at(g, 0)
    for c in range(3):
        simplex.point[c] = x[c]
    hull = ConvexSet(points, 0, count, -1.0)
    how, _v, kept = gjk(full, ConvexSet(g, POINT, 1, -1.0), hull, v, math.inf, 1e-15, g)
    if how == INSIDE:
        inside_weights(full, g)
    last = on_b(g, kept - 1)
    b = last
    off = 0.0
    for k in range(kept - 1):
        d = sub(on_b(g, k), last)
        b = blend(1.0, b, simplex.weights[k], d)
        off += 8.0 * (abs(d[0]) + abs(d[1]) + abs(d[2]))
    return b, kept, how == INSIDE, EPSILON * (off + abs(b[0]) + abs(b[1]) + abs(b[2]))


@kernel(inline=True)
def across(v, kept, full, g):
    """The part of v orthogonal to the feature (vertex, edge or face) that carries a nearest point."""
    if kept == 1:
        return v
    e = sub(on_b(g, 1), on_b(g, 0))
    size = dot(e, e)
    if size > 0.0:
        v = blend(1.0, v, -dot(v, e) / size, e)
    if kept == 3:
        f = sub(on_b(g, 2), on_b(g, 0))
        if size > 0.0:
            f = blend(1.0, f, -dot(f, e) / size, e)
        size = dot(f, f)
        if size > 0.0:
            v = blend(1.0, v, -dot(v, f) / size, f)
    return v


@kernel(inline=True)
def held(x, step, bounds):
    return min(max(x + step, bounds[0]), bounds[1])


@kernel(inline=True)
def is_free(x, slope, bounds):
    """Whether a parameter may move: its bounds differ, and the slope does not push it out of them."""
    return bounds[1] > bounds[0] and not ((x <= bounds[0] and slope > 0.0) or (x >= bounds[1] and slope < 0.0))


@kernel(inline=True)
def step_length(slope, curvature, square):
    """Newton's step in one parameter; a Gauss-Newton step where the curvature is too small or negative."""
    return -slope / (curvature if curvature > 1e-8 * square else square + 1e-300)


@kernel(inline=True)
def _look(query, x):
    a_shape, b_shape, place, g = query.search.a, query.search.b, query.place, query.search.g
    a, a1, a2 = local_point(a_shape.kind, a_shape.table, a_shape.pool, place.span_a, x[0], a_shape.workspace)
    if b_shape.kind == HULL:
        zero = (0.0, 0.0, 0.0)
        b, kept, inside, _off = hull_point(query.search.full, b_shape.pool, b_shape.count, a, g)
        r = zero if inside else sub(a, b)
        return PlacePoints(dot(r, r), r, a1, a2, zero, zero, a1 if inside else across(a1, kept, query.search.full, g))
    b, b1, b2 = local_point(b_shape.kind, b_shape.table, b_shape.pool, place.span_b, x[1], b_shape.workspace)
    r = sub(a, b)
    return PlacePoints(dot(r, r), r, a1, a2, b1, b2, a1)


@kernel(inline=True)
def _step_from(query, x, at):
    r, bounds_s, bounds_t = at.r, query.bounds_s, query.bounds_t
    gs = dot(r, at.a1)
    gt = -dot(r, at.b1)
    ss = dot(at.c1, at.c1)
    tt = dot(at.b1, at.b1)
    st = -dot(at.a1, at.b1)
    p = ss + dot(r, at.a2)
    q = tt - dot(r, at.b2)
    free_s, free_t = is_free(x[0], gs, bounds_s), is_free(x[1], gt, bounds_t)
    step = (0.0, 0.0)
    if free_s and free_t:
        det = p * q - st * st
        if not (p > 0.0 and det > 1e-14 * p * abs(q)):
            p, q = 1.0001 * ss + 1e-300, 1.0001 * tt + 1e-300
            det = p * q - st * st
        step = (-(q * gs - st * gt) / det, -(p * gt - st * gs) / det)
    elif free_s:
        step = (step_length(gs, p, ss), 0.0)
    elif free_t:
        step = (0.0, step_length(gt, q, tt))
    goes = abs(step[0]) > 1e-15 * (bounds_s[1] - bounds_s[0]) or abs(step[1]) > 1e-15 * (bounds_t[1] - bounds_t[0])
    return step, not (goes and abs(step[0]) < math.inf and abs(step[1]) < math.inf and at.merit > 0.0)


@kernel(inline=True)
def _move(query, x, part, step):
    return held(x[0], part * step[0], query.bounds_s), held(x[1], part * step[1], query.bounds_t)


_descend = kernel(inner=True)(damped_newton(_look, _step_from, _move, steps=_ROUNDS))


@kernel(inner=True)
def newton(search, place, bounds_s, bounds_t):
    """Parameters of a local minimum within bounds from a place on both shapes. b is a curve or a hull."""
    return _descend(PlaceQuery(search, place, bounds_s, bounds_t), (place.s, place.t))[0]
