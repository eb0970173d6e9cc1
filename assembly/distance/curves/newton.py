"""Newton's method for the nearest points of two Bezier pieces, held in the unit square.

    F(x, y) = |a(x) - b(y)|^2 / 2,  F_x = D.a', F_y = -D.b', F_xx = |a'|^2 + D.a'', F_yy = |b'|^2 - D.b'', F_xy = -a'.b'

Where the Hessian is not positive definite its diagonal is raised until it is; steps that do not make F smaller are
shortened. Nothing here is part of a proof: what was found is bounded afterwards.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._lanes import lane
from assembly.distance.curves.bounds import difference
from assembly.distance.curves.nodes import ROWS
from assembly.geometry.splines.bezier_pieces import bezier_curve_at, bezier_derivatives, bezier_value
from assembly.geometry.splines.evaluate import xyz
from assembly.geometry.vec import dot

_STEPS = 40
_SHORTENINGS = 12


@kernel(inner=True)
def node_point(piece, x):
    """The point of a piece."""
    curve = bezier_curve_at(piece.record, 0)
    v = bezier_value(piece.nodes, piece.at + ROWS, piece.pool, curve.binomials, curve.degree, x)
    return xyz((1.0 / lane(v, 3)) * v)


@kernel(inner=True)
def node_derivatives(piece, x):
    """Point, first and second derivative of a piece."""
    curve = bezier_curve_at(piece.record, 0)
    if curve.degree == 0:
        zero = (0.0, 0.0, 0.0)
        return node_point(piece, x), zero, zero
    v, d, h = bezier_derivatives(piece.nodes, piece.at + ROWS, piece.pool, curve.binomials, curve.degree, x)
    i = 1.0 / lane(v, 3)
    p = i * v
    q = i * (d - lane(d, 3) * p)
    return xyz(p), xyz(q), xyz(i * (h - (2.0 * lane(d, 3)) * q - lane(h, 3) * p))


@kernel(inline=True)
def newton_step(gx, gy, p, q, r, x, y):
    """The step of a quadratic with gradient (gx, gy) and Hessian (p, q; q, r), held in the square."""
    # A variable at an end that the slope pushes out stays there.
    hold_x = (x <= 0.0 and gx >= 0.0) or (x >= 1.0 and gx <= 0.0)
    hold_y = (y <= 0.0 and gy >= 0.0) or (y >= 1.0 and gy <= 0.0)
    if hold_x:
        gx = 0.0
        q = 0.0
    if hold_y:
        gy = 0.0
        q = 0.0
    # The least eigenvalue is raised to a small part of the largest one.
    middle = 0.5 * (p + r)
    spread = math.sqrt(0.25 * (p - r) * (p - r) + q * q)
    most = abs(middle) + spread
    least = middle - spread
    if least < 1e-10 * most:
        # Downhill along the gradient's own curvature where that is known, else as if the curvature were the largest.
        p += 1e-3 * most - least
        r += 1e-3 * most - least
    det = p * r - q * q
    if not det > 0.0:
        return 0.0, 0.0
    dx = (q * gy - r * gx) / det
    dy = (q * gx - p * gy) / det
    return min(max(dx, -x), 1.0 - x), min(max(dy, -y), 1.0 - y)


@kernel(inner=True)
def nearest_points(a, b, shift, x, y):
    """Parameters of a local minimum reached from (x, y)."""
    best = math.inf
    at_x = x
    at_y = y
    sx = sy = 0.0
    part = 1.0
    shortenings = 0
    flat = bezier_curve_at(b.record, 0).degree == 0
    for _ in range(_STEPS):
        u, du, hu = node_derivatives(a, x)
        v, dv, hv = node_derivatives(b, y)
        d = difference(u, v, shift)
        f = dot(d, d)
        if f < best:
            slow = f > best * (1.0 - 1e-15)
            best = f
            at_x = x
            at_y = y
            xx = dot(du, du) + dot(d, hu)
            yy = 1.0 if flat else dot(dv, dv) - dot(d, hv)
            gx = dot(d, du)
            gy = -dot(d, dv)
            sx, sy = newton_step(gx, gy, xx, -dot(du, dv), yy, x, y)
            # Below this no step changes F in its last place.
            if slow or gx * sx + gy * sy > -1e-17 * f or abs(sx) + abs(sy) < 1e-16:
                part = 1.0
                break
            part = 1.0
            shortenings = 0
        else:
            part *= 0.25
            shortenings += 1
            if shortenings > _SHORTENINGS:
                return at_x, at_y
        x = min(max(at_x + part * sx, 0.0), 1.0)
        y = min(max(at_y + part * sy, 0.0), 1.0)
    return at_x, at_y
