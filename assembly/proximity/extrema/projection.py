"""Projections of points on a surface by Newton's method, and descent along the slope of a gap."""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._newton import damped_newton
from assembly.geometry.splines.domain import into_domain, is_within
from assembly.geometry.splines.evaluate import surface_at, surface_point
from assembly.geometry.vec import cross, dot, matvec, matvec_t, scale, sub
from assembly.proximity.extrema.singular import BESIDE

# Steps down the slope of a gap.
SLIDES = 24
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


@kernel(inner=True)
def slide_down(store, f, g, pose, start, stride, half):
    """Descend along the slope of the gap on f, with the projection on g following, to a smaller gap.

    Returns the parameters, and whether they are within BESIDE half widths of the start on f: beyond, the descent ends.
    Newton's method goes to saddles of the gap as well; this does not. The first step is `stride` times the sine of the
    angle between the normals; then steps are those of Barzilai and Borwein, quartered where the gap grows.
    """
    u, v, s, t = start
    p, su, sv, _uu, _uv, _vv = surface_point(store.table, store.pool, f, u, v)
    on_g = projection_of(store, g, matvec_t(pose.rotation, sub(p, pose.shift)), s, t)
    slope = matvec(pose.rotation, on_g.normal)
    normal = cross(su, sv)
    across = scale(1.0 / max(math.sqrt(dot(normal, normal)), 1e-300), normal)
    slope = sub(slope, scale(dot(slope, across), across))
    length = stride
    for _ in range(SLIDES):
        if dot(slope, slope) < 1e-12:
            break
        a = dot(su, su)
        b = dot(su, sv)
        c = dot(sv, sv)
        det = a * c - b * b
        if not det > 0.0:
            break
        first = -length * dot(slope, su)
        second = -length * dot(slope, sv)
        u_new, v_new, _held = into_domain(
            store, f, u + (c * first - b * second) / det, v + (a * second - b * first) / det
        )
        q, ru, rv, _uu, _uv, _vv = surface_point(store.table, store.pool, f, u_new, v_new)
        s, t = on_g.parameters
        there_g = projection_of(store, g, matvec_t(pose.rotation, sub(q, pose.shift)), s, t)
        if there_g.distance > on_g.distance:
            length *= 0.25
            continue
        normal = cross(ru, rv)
        across = scale(1.0 / max(math.sqrt(dot(normal, normal)), 1e-300), normal)
        there = matvec(pose.rotation, there_g.normal)
        there = sub(there, scale(dot(there, across), across))
        moved = sub(q, p)
        bent = dot(moved, sub(there, slope))
        length = min(dot(moved, moved) / bent, 4.0 * length) if bent > 0.0 else 2.0 * length
        u, v, on_g, p, su, sv, slope = u_new, v_new, there_g, q, ru, rv, there
        if not is_within(store, f, u, v, start[0], start[1], BESIDE * half[0], BESIDE * half[1]):
            return (u, v, *on_g.parameters), False
    return (u, v, *on_g.parameters), True
