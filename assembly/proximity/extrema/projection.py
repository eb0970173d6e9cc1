"""Projections of points on a surface by Newton's method."""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._newton import damped_newton
from assembly.geometry.splines.domain import into_domain
from assembly.geometry.splines.evaluate import surface_at, surface_point
from assembly.geometry.vec import cross, dot, scale, sub

# Parameters within so many half widths of the middle of a patch are beside it.
BESIDE = 3.0
# The projection of a point on a surface. parameters: (u, v); distance: signed, positive outside; normal: outward unit
# normal; settled: whether the steps converged to a minimum of the distance.
Projection = namedtuple("Projection", "parameters distance normal settled")
ProjectionQuery = namedtuple("ProjectionQuery", "store surface y")
# A point of the surface. merit: its squared distance; distance: that along the outward normal; step: Newton's, or that
# to the projection on the tangent plane where the distance is not convex; still, settled: stationary, and a minimum.
ProjectionPoint = namedtuple("ProjectionPoint", "merit distance normal step still settled")


@kernel(inline=True)
def _look(query, x):
    store, g = query.store, query.surface
    p, su, sv, suu, suv, svv = surface_point(store.table, store.pool, g, x[0], x[1])
    d = sub(query.y, p)
    n = cross(su, sv)
    length = math.sqrt(dot(n, n))
    if not length > 0.0:
        return ProjectionPoint(dot(d, d), 0.0, n, (0.0, 0.0), True, False)
    n = scale(float(surface_at(store.table, g).sign) / length, n)
    distance = dot(n, d)
    a = dot(su, su)
    b = dot(su, sv)
    c = dot(sv, sv)
    first = dot(d, su)
    second = dot(d, sv)
    h11 = a - distance * dot(n, suu)
    h12 = b - distance * dot(n, suv)
    h22 = c - distance * dot(n, svv)
    det = h11 * h22 - h12 * h12
    bent = det > 0.1 * (a * c - b * b) and h11 > 0.0
    if not bent:
        h11, h12, h22 = a, b, c
        det = a * c - b * b
    step = ((h22 * first - h12 * second) / det, (h11 * second - h12 * first) / det)
    still = first * first / a + second * second / c < 1e-16
    return ProjectionPoint(dot(d, d), distance, n, step, still, still and bent)


@kernel(inline=True)
def _step_from(query, x, at):
    return at.step, at.still


@kernel(inline=True)
def _move(query, x, part, step):
    s, t, _held = into_domain(query.store, query.surface, x[0] + part * step[0], x[1] + part * step[1])
    return s, t


_descend = kernel(inner=True)(damped_newton(_look, _step_from, _move, steps=20))


@kernel(inner=True)
def projection_of(store, g, y, s, t):
    """The `Projection` on surface g of a point y, by Newton's method from (s, t)."""
    _place, at, last = _descend(ProjectionQuery(store, g, y), (s, t))
    return Projection(last, at.distance, at.normal, at.settled)
