"""A pair whose coordinates are unknowns of their own.

As a function of the poses alone an extremal pair has an end: a fold, where it merges with another one and H is
singular. With (u_f, v_f, u_g, v_g) as unknowns beside the twists, five rows stay smooth through it:

    beta = n.d,   d.f_u / s_1,   d.f_v / s_2,   n.g_u / s_3,   n.g_v / s_4,

d = g - f, n = N / |N|, N = f_u x f_v.

The s_i are lengths fixed for a solve (|f_u| ... where it began), and the unknowns are s_i u_i, lengths too. Local
variables, in this order: twist of f (6), twist of g (6), the four coordinates. Second derivatives of the rows
take third derivatives of the surfaces; terms that vanish with the residuals are left out.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.splines.evaluate import surface_at, surface_point, third_derivatives
from assembly.geometry.vec import add, blend, cross, dot, matvec, scale, sub
from assembly.kinematics.motion import position, relative_pose, rotation
from assembly.proximity.extrema.face_face import pair_frame

VARIABLES = 16
# Rates (3, 16) of the vectors that the rows are made of, a column a local variable.
Variations = namedtuple(
    "Variations",
    [
        "d",  # from the point of f to that of g
        "f_u",
        "f_v",
        "g_u",
        "g_v",
        "normal",  # N = f_u x f_v
        "unit",  # n = N / |N|
    ],
)
VECTORS = len(Variations._fields)
# The vectors themselves, in world axes; points from their bodies' origins.
PairVectors = namedtuple("PairVectors", ["d", "n", "length", "point_f", "f_u", "f_v", "point_g", "g_u", "g_v"])


@kernel(inline=True)
def place(turn, p, u, v, uu, uv, vv):
    return (
        matvec(turn, p),
        matvec(turn, u),
        matvec(turn, v),
        matvec(turn, uu),
        matvec(turn, uv),
        matvec(turn, vv),
    )


@kernel(inline=True)
def put_column(out, k, a):
    out[0, k] = a[0]
    out[1, k] = a[1]
    out[2, k] = a[2]


@kernel(inner=True)
def put_turn(out, k, a):
    """Columns k to k+2: the rates e_j x a under a unit rotation about each axis."""
    put_column(out, k, (0.0, -a[2], a[1]))
    put_column(out, k + 1, (a[2], 0.0, -a[0]))
    put_column(out, k + 2, (-a[1], a[0], 0.0))


@kernel(inline=True)
def column(a, k):
    return (a[0, k], a[1, k], a[2, k])


@kernel(signatures="(i8[::1], f8[::1], i8, i8, UniTuple(f8, 4), f8[:, ::1], i8)")
def coordinate_lengths(table, pool, f, g, x, lengths, k):
    """The lengths s_i into lengths[k]: |f_u|, |f_v|, |g_u|, |g_v|."""
    a = surface_point(table, pool, f, x[0], x[1])
    b = surface_point(table, pool, g, x[2], x[3])
    lengths[k, 0] = math.sqrt(dot(a[1], a[1]))
    lengths[k, 1] = math.sqrt(dot(a[2], a[2]))
    lengths[k, 2] = math.sqrt(dot(b[1], b[1]))
    lengths[k, 3] = math.sqrt(dot(b[2], b[2]))
    return 0


@kernel(signatures="(i8[::1], f8[::1], i8, i8, i8, i8, f8[:, ::1], f8[:, ::1], i8, f8)")
def is_extremal(table, pool, f, g, i, j, q, tracked, r, tolerance):
    """Whether the coordinates in tracked[r] are those of an extremal pair, by the frame of tracked pairs."""
    pose = relative_pose(q, i, rotation(q, i), j, rotation(q, j))
    x = (tracked[r, 0], tracked[r, 1], tracked[r, 2], tracked[r, 3])
    frame = pair_frame(Store(table, pool), f, g, pose, x)
    residual = frame.residual
    tilt = max(abs(residual[2]), abs(residual[3]))
    holds = frame.regular and tilt <= 1e-9 and max(abs(residual[0]), abs(residual[1])) <= tolerance
    return 1 if holds else 0


@kernel(inner=True)
def moved_along(store, surface, tracked, was, r, i):
    """How far the point on a surface is from where it was; its parameters are in columns i and i + 1 of row r."""
    p = surface_point(store.table, store.pool, surface, tracked[r, i], tracked[r, i + 1])[0]
    d = sub(p, surface_point(store.table, store.pool, surface, was[r, i], was[r, i + 1])[0])
    return math.sqrt(dot(d, d))


@kernel(signatures="(i8[::1], f8[::1], i8, i8, f8[:, ::1], f8[:, ::1], i8, f8)")
def has_stayed(table, pool, f, g, tracked, was, r, most):
    """Whether neither point of pair r went farther along its surface than so much."""
    store = Store(table, pool)
    stayed = moved_along(store, f, tracked, was, r, 0) <= most
    return 1 if stayed and moved_along(store, g, tracked, was, r, 2) <= most else 0


@kernel(inner=True)
def variations(store, f, g, i, j, q, x, s, rates):
    """Fill the `Variations`; returns the `PairVectors`."""
    patch = surface_at(store.table, f)
    turn_f = rotation(q, i)
    turn_g = rotation(q, j)
    a, b, c, d_, e, h = surface_point(store.table, store.pool, f, x[0], x[1])
    pf, fu, fv, fuu, fuv, fvv = place(turn_f, a, b, c, d_, e, h)
    a, b, c, d_, e, h = surface_point(store.table, store.pool, g, x[2], x[3])
    pg, gu, gv, guu, guv, gvv = place(turn_g, a, b, c, d_, e, h)
    d = add(sub(position(q, j), position(q, i)), sub(pg, pf))
    normal = scale(float(patch.sign), cross(fu, fv))
    length = math.sqrt(dot(normal, normal))
    n = scale(1.0 / length, normal)
    for k in range(3):
        for l in range(VARIABLES):
            rates.d[k, l] = 0.0
            rates.f_u[k, l] = 0.0
            rates.f_v[k, l] = 0.0
            rates.g_u[k, l] = 0.0
            rates.g_v[k, l] = 0.0
            rates.normal[k, l] = 0.0
            rates.unit[k, l] = 0.0
    for k in range(3):
        rates.d[k, k] = -1.0
        rates.d[k, 6 + k] = 1.0
    put_turn(rates.d, 3, scale(-1.0, pf))
    put_turn(rates.d, 9, pg)
    put_column(rates.d, 12, scale(-1.0 / s[0], fu))
    put_column(rates.d, 13, scale(-1.0 / s[1], fv))
    put_column(rates.d, 14, scale(1.0 / s[2], gu))
    put_column(rates.d, 15, scale(1.0 / s[3], gv))
    put_turn(rates.f_u, 3, fu)
    put_column(rates.f_u, 12, scale(1.0 / s[0], fuu))
    put_column(rates.f_u, 13, scale(1.0 / s[1], fuv))
    put_turn(rates.f_v, 3, fv)
    put_column(rates.f_v, 12, scale(1.0 / s[0], fuv))
    put_column(rates.f_v, 13, scale(1.0 / s[1], fvv))
    put_turn(rates.g_u, 9, gu)
    put_column(rates.g_u, 14, scale(1.0 / s[2], guu))
    put_column(rates.g_u, 15, scale(1.0 / s[3], guv))
    put_turn(rates.g_v, 9, gv)
    put_column(rates.g_v, 14, scale(1.0 / s[2], guv))
    put_column(rates.g_v, 15, scale(1.0 / s[3], gvv))
    sign = float(patch.sign)
    for k in range(VARIABLES):
        change = scale(sign, add(cross(column(rates.f_u, k), fv), cross(fu, column(rates.f_v, k))))
        put_column(rates.normal, k, change)
        put_column(rates.unit, k, scale(1.0 / length, sub(change, scale(dot(n, change), n))))
    return PairVectors(d, n, length, pf, fu, fv, pg, gu, gv)


@kernel(inner=True)
def free_rows(store, f, g, i, j, q, x, s, work, residual, jacobian, r, e):
    """The gap into row r, the rows of tangency into rows e to e + 3, with their gradients."""
    rates = Variations(work[0], work[1], work[2], work[3], work[4], work[5], work[6])
    vectors = variations(store, f, g, i, j, q, x, s, rates)
    d, n = vectors.d, vectors.n
    fu, fv, gu, gv = vectors.f_u, vectors.f_v, vectors.g_u, vectors.g_v
    beta = dot(n, d)
    residual[r] = beta
    residual[e] = dot(d, fu) / s[0]
    residual[e + 1] = dot(d, fv) / s[1]
    residual[e + 2] = dot(n, gu) / s[2]
    residual[e + 3] = dot(n, gv) / s[3]
    for k in range(VARIABLES):
        dd = column(rates.d, k)
        dn = column(rates.unit, k)
        jacobian[r, k] = dot(n, dd) + dot(d, dn)
        jacobian[e, k] = (dot(dd, fu) + dot(d, column(rates.f_u, k))) / s[0]
        jacobian[e + 1, k] = (dot(dd, fv) + dot(d, column(rates.f_v, k))) / s[1]
        jacobian[e + 2, k] = (dot(dn, gu) + dot(n, column(rates.g_u, k))) / s[2]
        jacobian[e + 3, k] = (dot(dn, gv) + dot(n, column(rates.g_v, k))) / s[3]


@kernel(inner=True)
def add_second(y, a, a1, a2, a11, a12, a22, w, u, s1, s2, out):
    """out += y . (second variation of a), a vector of a body whose rotation stands at w and coordinates at u."""
    ya = dot(y, a)
    for k in range(3):
        for l in range(3):
            out[w + k, w + l] += 0.5 * (y[k] * a[l] + a[k] * y[l])
        out[w + k, w + k] -= ya
    c1 = cross(a1, y)
    c2 = cross(a2, y)
    for k in range(3):
        out[w + k, u] += c1[k] / s1
        out[u, w + k] += c1[k] / s1
        out[w + k, u + 1] += c2[k] / s2
        out[u + 1, w + k] += c2[k] / s2
    out[u, u] += dot(y, a11) / (s1 * s1)
    out[u, u + 1] += dot(y, a12) / (s1 * s2)
    out[u + 1, u] += dot(y, a12) / (s1 * s2)
    out[u + 1, u + 1] += dot(y, a22) / (s2 * s2)


@kernel(inner=True)
def free_hessian(store, f, g, i, j, q, x, s, y, work, out):
    """Second derivative (16, 16) of y . rows, overwriting out."""
    rates = Variations(work[0], work[1], work[2], work[3], work[4], work[5], work[6])
    vectors = variations(store, f, g, i, j, q, x, s, rates)
    d, n, length = vectors.d, vectors.n, vectors.length
    fu, fv, gu, gv = vectors.f_u, vectors.f_v, vectors.g_u, vectors.g_v
    sign = float(surface_at(store.table, f).sign)
    turn_f = rotation(q, i)
    turn_g = rotation(q, j)
    beta = dot(n, d)
    l1 = y[1] / s[0]
    l2 = y[2] / s[1]
    l3 = y[3] / s[2]
    l4 = y[4] / s[3]
    # w . (second variation of n) for w = l3 gu + l4 gv, orthogonal to n at a pair.
    w = blend(l3, gu, l4, gv)
    across = scale(sign / length, sub(w, scale(dot(w, n), n)))
    for k in range(VARIABLES):
        dk = column(rates.d, k)
        fuk = column(rates.f_u, k)
        fvk = column(rates.f_v, k)
        guk = column(rates.g_u, k)
        gvk = column(rates.g_v, k)
        nk = column(rates.unit, k)
        stretch = dot(n, column(rates.normal, k)) / length
        # Everything that multiplies a variation l once: gathered, so that the inner loop is short.
        with_d = add(scale(y[0], nk), blend(l1, fuk, l2, fvk))
        with_n = add(blend(y[0], dk, -y[0] * beta, nk), add(blend(l3, guk, l4, gvk), scale(-stretch, w)))
        with_fu = add(scale(l1, dk), cross(fvk, across))
        with_fv = add(scale(l2, dk), cross(across, fuk))
        with_g = scale(l3, nk)
        with_h = scale(l4, nk)
        turned = dot(w, nk) / length
        for l in range(VARIABLES):
            out[k, l] = (
                dot(with_d, column(rates.d, l))
                + dot(with_n, column(rates.unit, l))
                + dot(with_fu, column(rates.f_u, l))
                + dot(with_fv, column(rates.f_v, l))
                + dot(with_g, column(rates.g_u, l))
                + dot(with_h, column(rates.g_v, l))
                - turned * dot(n, column(rates.normal, l))
            )
    # Second variations of the vectors themselves, each with its coefficient.
    a = surface_point(store.table, store.pool, f, x[0], x[1])
    b = surface_point(store.table, store.pool, g, x[2], x[3])
    fuu = matvec(turn_f, a[3])
    fuv = matvec(turn_f, a[4])
    fvv = matvec(turn_f, a[5])
    guu = matvec(turn_g, b[3])
    guv = matvec(turn_g, b[4])
    gvv = matvec(turn_g, b[5])
    a30, a21, a12, a03 = third_derivatives(store.table, store.pool, f, x[0], x[1])
    b30, b21, b12, b03 = third_derivatives(store.table, store.pool, g, x[2], x[3])
    fuuu = matvec(turn_f, a30)
    fuuv = matvec(turn_f, a21)
    fuvv = matvec(turn_f, a12)
    fvvv = matvec(turn_f, a03)
    guuu = matvec(turn_g, b30)
    guuv = matvec(turn_g, b21)
    guvv = matvec(turn_g, b12)
    gvvv = matvec(turn_g, b03)
    of_d = add(scale(y[0], n), blend(l1, fu, l2, fv))
    add_second(scale(-1.0, of_d), vectors.point_f, fu, fv, fuu, fuv, fvv, 3, 12, s[0], s[1], out)
    add_second(of_d, vectors.point_g, gu, gv, guu, guv, gvv, 9, 14, s[2], s[3], out)
    of_fu = add(scale(l1, d), cross(fv, across))
    of_fv = add(scale(l2, d), cross(across, fu))
    add_second(of_fu, fu, fuu, fuv, fuuu, fuuv, fuvv, 3, 12, s[0], s[1], out)
    add_second(of_fv, fv, fuv, fvv, fuuv, fuvv, fvvv, 3, 12, s[0], s[1], out)
    add_second(scale(l3, n), gu, guu, guv, guuu, guuv, guvv, 9, 14, s[2], s[3], out)
    add_second(scale(l4, n), gv, guv, gvv, guuv, guvv, gvvv, 9, 14, s[2], s[3], out)
