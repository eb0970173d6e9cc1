"""A pair of surface points as seen in the tangent frame of the first: rates, shape operators and the residual."""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.geometry.splines.evaluate import (
    surface_at,
    surface_point,
)
from assembly.geometry.splines.pole import CHART, SurfaceFrame, nearest_pole, pole_frame
from assembly.geometry.vec import add, cross, dot, matvec, matvec_t, scale, sub

# A parameterization counts as regular where |Su x Sv| is above this times |Su| |Sv|.
POLE = 1e-9


# A surface seen in the tangent frame of another one: [S_u S_v] = [x y] T along it.
SeenFrame = namedtuple(
    "SeenFrame",
    [
        "point",
        "rates",  # T^-1 (11, 12, 21, 22); zero at a pole
        "shape",  # shape operator (11, 12, 22) with respect to the other's normal
        "tilt",  # its normal, scaled to component one along the other's normal, minus the latter: two numbers
        "regular",  # whether there is a tangent plane, not orthogonal to the other's
    ],
)


# Everything about a pair of faces at some parameters, extremal or not, in the axes of body f.
PairFrame = namedtuple(
    "PairFrame",
    [
        "normal",  # outward unit normal of f
        "tangent_x",
        "tangent_y",  # with the normal a frame of f: [f_u f_v] = [tangent_x tangent_y] E
        "point_f",
        "point_g",
        "rates_f",  # E^-1 (11, 12, 22), upper triangular: parameters by tangential moves; zero at a pole
        "rates_g",  # T^-1 (11, 12, 21, 22); zero at a pole
        "shape_f",  # shape operator (11, 12, 22) with respect to the normal
        "shape_g",
        "residual",  # (r1x, r1y, r2x, r2y): lengths, then tilts
        "gap",  # beta = normal.(point_g - point_f)
        "regular",  # whether both have a tangent plane here, and those are not orthogonal
    ],
)


@kernel(inline=True)
def shape_operator(p, q, r, s, luu, luv, lvv):
    """-J^T L J, J = [[p, q], [r, s]] the inverse of tangent coordinates, L_ij = S_ij.n; symmetric, +1/r on a ball."""
    a = luu * p + luv * r
    b = luv * p + lvv * r
    return (
        -(p * a + r * b),
        -(q * a + s * b),
        -(q * (luu * q + luv * s) + s * (luv * q + lvv * s)),
    )


@kernel(inline=True)
def own_frame(store, r, u, v):
    """A `SurfaceFrame` at parameters (u, v).

    At a pole E^-1 is zero: the point moves, its polar coordinates have no rates.
    """
    patch = surface_at(store.table, r)
    zero = (0.0, 0.0, 0.0)
    if patch.poles != 0:
        edge, distance = nearest_pole(store, r, u, v)
        if distance < CHART:
            return pole_frame(store, r, edge, u, v)
    p, su, sv, suu, suv, svv = surface_point(store.table, store.pool, r, u, v)
    sign = float(patch.sign)
    normal = cross(su, sv)
    uu = dot(su, su)
    nn = dot(normal, normal)
    if not (nn > POLE * POLE * uu * dot(sv, sv) and nn > 1e-290):
        return SurfaceFrame(p, zero, zero, zero, zero, zero, False)
    length = math.sqrt(nn)
    n = scale(sign / length, normal)
    i11 = 1.0 / math.sqrt(uu)
    x = scale(i11, su)
    # |Su x Sv| = e11 e22.
    i22 = sign * uu * i11 / length
    i12 = -dot(x, sv) * i11 * i22
    a = shape_operator(i11, i12, 0.0, i22, dot(suu, n), dot(suv, n), dot(svv, n))
    return SurfaceFrame(p, n, x, cross(n, x), (i11, i12, i22), a, True)


@kernel(inline=True)
def other_frame(store, r, u, v, n, x, y):
    """A `SeenFrame` at parameters (u, v), with another surface's n, x, y.

    m = n + [x y] r2 is orthogonal to S_u and S_v: T^T r2 = -(n.S_u, n.S_v), with T = [x y]^T [S_u S_v].
    """
    zero = (0.0, 0.0, 0.0)
    none = (0.0, 0.0, 0.0, 0.0)
    if surface_at(store.table, r).poles != 0:
        edge, distance = nearest_pole(store, r, u, v)
        if distance < CHART:
            own = pole_frame(store, r, edge, u, v)
            p, m, gx, gy, b = own.point, own.normal, own.tangent_x, own.tangent_y, own.shape
            s = dot(m, n)
            if not own.regular or abs(s) < 1e-3:
                return SeenFrame(p, none, zero, (0.0, 0.0), False)
            side = 1.0 if s > 0.0 else -1.0
            xx = dot(x, gx)
            xy = dot(x, gy)
            yx = dot(y, gx)
            yy = dot(y, gy)
            c = (
                side * (xx * (b[0] * xx + b[1] * xy) + xy * (b[1] * xx + b[2] * xy)),
                side * (xx * (b[0] * yx + b[1] * yy) + xy * (b[1] * yx + b[2] * yy)),
                side * (yx * (b[0] * yx + b[1] * yy) + yy * (b[1] * yx + b[2] * yy)),
            )
            return SeenFrame(p, none, c, (dot(x, m) / s, dot(y, m) / s), True)
    p, su, sv, suu, suv, svv = surface_point(store.table, store.pool, r, u, v)
    t11 = dot(x, su)
    t12 = dot(x, sv)
    t21 = dot(y, su)
    t22 = dot(y, sv)
    det = t11 * t22 - t12 * t21
    if not (det * det > POLE * POLE * dot(su, su) * dot(sv, sv) and abs(det) > 1e-145):
        return SeenFrame(p, none, zero, (0.0, 0.0), False)
    i = 1.0 / det
    t = (i * t22, -i * t12, -i * t21, i * t11)
    c = shape_operator(t[0], t[1], t[2], t[3], dot(suu, n), dot(suv, n), dot(svv, n))
    nu = dot(n, su)
    nv = dot(n, sv)
    return SeenFrame(p, t, c, (-(t[0] * nu + t[2] * nv), -(t[1] * nu + t[3] * nv)), True)


@kernel(inline=True)
def pair_frame(store, f, g, pose, x):
    """The `PairFrame` at parameters x = (u_f, v_f, u_g, v_g), in the axes of body f."""
    own = own_frame(store, f, x[0], x[1])
    n, tx, ty = own.normal, own.tangent_x, own.tangent_y
    # The normal and the frame go to the axes of g, rather than six derivatives to those of f.
    ng = matvec_t(pose.rotation, n)
    xg = matvec_t(pose.rotation, tx)
    yg = matvec_t(pose.rotation, ty)
    seen = other_frame(store, g, x[2], x[3], ng, xg, yg)
    pg = add(matvec(pose.rotation, seen.point), pose.shift)
    d = sub(pg, own.point)
    return PairFrame(
        normal=n,
        tangent_x=tx,
        tangent_y=ty,
        point_f=own.point,
        point_g=pg,
        rates_f=own.rates,
        rates_g=seen.rates,
        shape_f=own.shape,
        shape_g=seen.shape,
        residual=(dot(tx, d), dot(ty, d), seen.tilt[0], seen.tilt[1]),
        gap=dot(n, d),
        regular=own.regular and seen.regular,
    )
