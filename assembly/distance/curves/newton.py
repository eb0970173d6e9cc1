"""Newton's method for the nearest points of two Bezier pieces, with the parameters kept in the unit square.

    F(x, y) = |a(x) - b(y)|^2 / 2,  F_x = D.a', F_y = -D.b', F_xx = |a'|^2 + D.a'', F_yy = |b'|^2 - D.b'', F_xy = -a'.b'

Where the Hessian is not positive definite its diagonal is raised until it is; steps that do not make F smaller are
shortened. Nothing here is part of a proof: the points found are bounded afterwards.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._lanes import lane
from assembly._newton import damped_newton
from assembly.distance.curves.bounds import difference
from assembly.distance.curves.nodes import ROWS
from assembly.geometry.splines.bezier_pieces import bezier_curve_at, bezier_derivatives, bezier_value
from assembly.geometry.splines.evaluate import xyz
from assembly.geometry.vec import dot

_STEPS = 40
PieceQuery = namedtuple("PieceQuery", "a b shift")
# |D|^2, D, and the derivatives of both pieces.
PiecePoints = namedtuple("PiecePoints", "merit d du hu dv hv")


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
        p += 1e-3 * most - least
        r += 1e-3 * most - least
    det = p * r - q * q
    if not det > 0.0:
        return 0.0, 0.0
    dx = (q * gy - r * gx) / det
    dy = (q * gx - p * gy) / det
    return min(max(dx, -x), 1.0 - x), min(max(dy, -y), 1.0 - y)


@kernel(inline=True)
def _look(query, place):
    u, du, hu = node_derivatives(query.a, place[0])
    v, dv, hv = node_derivatives(query.b, place[1])
    d = difference(u, v, query.shift)
    return PiecePoints(dot(d, d), d, du, hu, dv, hv)


@kernel(inline=True)
def _step_from(query, place, at):
    d, du, dv = at.d, at.du, at.dv
    xx = dot(du, du) + dot(d, at.hu)
    yy = 1.0 if bezier_curve_at(query.b.record, 0).degree == 0 else dot(dv, dv) - dot(d, at.hv)
    gx = dot(d, du)
    gy = -dot(d, dv)
    sx, sy = newton_step(gx, gy, xx, -dot(du, dv), yy, place[0], place[1])
    # Below this no step changes F in its last place.
    return (sx, sy), gx * sx + gy * sy > -1e-17 * at.merit or abs(sx) + abs(sy) < 1e-16


@kernel(inline=True)
def _move(query, place, part, step):
    return min(max(place[0] + part * step[0], 0.0), 1.0), min(max(place[1] + part * step[1], 0.0), 1.0)


_descend = kernel(inner=True)(damped_newton(_look, _step_from, _move, steps=_STEPS))


@kernel(inner=True)
def nearest_points(a, b, shift, x, y):
    """Parameters of a local minimum reached from (x, y)."""
    return _descend(PieceQuery(a, b, shift), (x, y))[0]
