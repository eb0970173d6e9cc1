"""The lifted pair: an extremal pair whose coordinates are unknowns of the solve.

As a function of the poses alone an extremal pair vanishes at a fold, where it merges with another one and H is
singular. With (u_f, v_f, u_g, v_g) as unknowns beside the twists, five rows stay smooth through it:

    beta = n.d,   d.f_u / s_1,   d.f_v / s_2,   n.g_u / s_3,   n.g_v / s_4,

d = g - f, n = N / |N|, N = f_u x f_v.

The s_i are lengths fixed for a solve (|f_u| ... where it began), and the unknowns are s_i u_i, lengths too. Local
variables, in this order: twist of f (6), twist of g (6), the four coordinates. Second derivatives of the rows
need third derivatives of the surfaces; terms that vanish with the residuals are left out.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.splines.evaluate import surface_at, surface_point, third_derivatives
from assembly.geometry.vec import add, blend, cross, dot, matvec, scale, sub
from assembly.kinematics.motion import position, relative_pose, rotation
from assembly.proximity.extrema.face_frames import pair_frame
from assembly.proximity.extrema.pair_matrix import VANISHING

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
# d, n and |N| themselves, in world axes, and the `VectorJet` of either point, seen from its body's origin.
PairVectors = namedtuple("PairVectors", "d n length f g")
# A vector that depends on the coordinates of a surface, with its derivatives by them, in world axes.
VectorJet = namedtuple("VectorJet", "value u v uu uv vv")
# A pair whose coordinates are unknowns. surfaces: their records; bodies: their rows in a configuration; x: the
# coordinates; lengths: the s_i.
LiftedPair = namedtuple("LiftedPair", "surfaces bodies x lengths")


@kernel(inline=True)
def point_jet(store, surface, turn, u, v):
    """The `VectorJet` of a point of a surface, from the origin of its body, which `turn` turns."""
    p, su, sv, suu, suv, svv = surface_point(store.table, store.pool, surface, u, v)
    return VectorJet(
        matvec(turn, p), matvec(turn, su), matvec(turn, sv), matvec(turn, suu), matvec(turn, suv), matvec(turn, svv)
    )


@kernel(inline=True)
def tangent_jets(store, surface, turn, point, u, v):
    """The `VectorJet` of S_u and that of S_v, at a point whose own `VectorJet` is given."""
    uuu, uuv, uvv, vvv = third_derivatives(store.table, store.pool, surface, u, v)
    uuv = matvec(turn, uuv)
    uvv = matvec(turn, uvv)
    along_u = VectorJet(point.u, point.uu, point.uv, matvec(turn, uuu), uuv, uvv)
    return along_u, VectorJet(point.v, point.uv, point.vv, uuv, uvv, matvec(turn, vvv))


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
    lengths[k, 0] = math.sqrt(dot(a.u, a.u))
    lengths[k, 1] = math.sqrt(dot(a.v, a.v))
    lengths[k, 2] = math.sqrt(dot(b.u, b.u))
    lengths[k, 3] = math.sqrt(dot(b.v, b.v))
    return 0


@kernel(
    signatures=("(Tuple((i8[::1], f8[::1])), UniTuple(i8, 2), UniTuple(i8, 2), f8[:, ::1], f8[:, ::1], i8, f8)"),
)
def is_extremal(store, surfaces, bodies, q, tracked, r, tolerance):
    """Whether the coordinates in tracked[r] are those of an extremal pair, by the frame of tracked pairs."""
    table, pool = store
    i, j = bodies
    pose = relative_pose(q, i, rotation(q, i), j, rotation(q, j))
    x = (tracked[r, 0], tracked[r, 1], tracked[r, 2], tracked[r, 3])
    frame = pair_frame(Store(table, pool), surfaces[0], surfaces[1], pose, x)
    residual = frame.residual
    tilt = max(abs(residual[2]), abs(residual[3]))
    holds = frame.regular and tilt <= VANISHING and max(abs(residual[0]), abs(residual[1])) <= tolerance
    return 1 if holds else 0


@kernel(inner=True)
def moved_along(store, surface, tracked, was, r, i):
    """How far the point on a surface is from where it was; its parameters are in columns i and i + 1 of row r."""
    p = surface_point(store.table, store.pool, surface, tracked[r, i], tracked[r, i + 1]).point
    d = sub(p, surface_point(store.table, store.pool, surface, was[r, i], was[r, i + 1]).point)
    return math.sqrt(dot(d, d))


@kernel(signatures="(i8[::1], f8[::1], i8, i8, f8[:, ::1], f8[:, ::1], i8, f8)")
def has_stayed(table, pool, f, g, tracked, was, r, most):
    """Whether neither point of pair r moved by more than `most` on its surface."""
    store = Store(table, pool)
    stayed = moved_along(store, f, tracked, was, r, 0) <= most
    return 1 if stayed and moved_along(store, g, tracked, was, r, 2) <= most else 0


@kernel(inner=True)
def variations(store, pair, q, rates):
    """Fill the `Variations`; returns the `PairVectors`."""
    (i, j), x, s = pair.bodies, pair.x, pair.lengths
    f = point_jet(store, pair.surfaces[0], rotation(q, i), x[0], x[1])
    g = point_jet(store, pair.surfaces[1], rotation(q, j), x[2], x[3])
    d = add(sub(position(q, j), position(q, i)), sub(g.value, f.value))
    sign = float(surface_at(store.table, pair.surfaces[0]).sign)
    normal = scale(sign, cross(f.u, f.v))
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
    put_turn(rates.d, 3, scale(-1.0, f.value))
    put_turn(rates.d, 9, g.value)
    put_column(rates.d, 12, scale(-1.0 / s[0], f.u))
    put_column(rates.d, 13, scale(-1.0 / s[1], f.v))
    put_column(rates.d, 14, scale(1.0 / s[2], g.u))
    put_column(rates.d, 15, scale(1.0 / s[3], g.v))
    put_turn(rates.f_u, 3, f.u)
    put_column(rates.f_u, 12, scale(1.0 / s[0], f.uu))
    put_column(rates.f_u, 13, scale(1.0 / s[1], f.uv))
    put_turn(rates.f_v, 3, f.v)
    put_column(rates.f_v, 12, scale(1.0 / s[0], f.uv))
    put_column(rates.f_v, 13, scale(1.0 / s[1], f.vv))
    put_turn(rates.g_u, 9, g.u)
    put_column(rates.g_u, 14, scale(1.0 / s[2], g.uu))
    put_column(rates.g_u, 15, scale(1.0 / s[3], g.uv))
    put_turn(rates.g_v, 9, g.v)
    put_column(rates.g_v, 14, scale(1.0 / s[2], g.uv))
    put_column(rates.g_v, 15, scale(1.0 / s[3], g.vv))
    for k in range(VARIABLES):
        change = scale(sign, add(cross(column(rates.f_u, k), f.v), cross(f.u, column(rates.f_v, k))))
        put_column(rates.normal, k, change)
        put_column(rates.unit, k, scale(1.0 / length, sub(change, scale(dot(n, change), n))))
    return PairVectors(d, n, length, f, g)


@kernel(inner=True)
def free_rows(store, pair, q, work, residual, jacobian, r, e):
    """The gap into row r, the rows of tangency into rows e to e + 3, with their gradients."""
    rates = Variations(work[0], work[1], work[2], work[3], work[4], work[5], work[6])
    vectors = variations(store, pair, q, rates)
    d, n, s = vectors.d, vectors.n, pair.lengths
    fu, fv, gu, gv = vectors.f.u, vectors.f.v, vectors.g.u, vectors.g.v
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
def add_second(y, jet, side, lengths, out):
    """out += y . (second variation of a vector) of body f (side 0) or g (side 1), from its `VectorJet`."""
    w = 3 + 6 * side
    u = 12 + 2 * side
    s1, s2 = lengths[2 * side], lengths[2 * side + 1]
    a = jet.value
    ya = dot(y, a)
    for k in range(3):
        for l in range(3):
            out[w + k, w + l] += 0.5 * (y[k] * a[l] + a[k] * y[l])
        out[w + k, w + k] -= ya
    c1 = cross(jet.u, y)
    c2 = cross(jet.v, y)
    for k in range(3):
        out[w + k, u] += c1[k] / s1
        out[u, w + k] += c1[k] / s1
        out[w + k, u + 1] += c2[k] / s2
        out[u + 1, w + k] += c2[k] / s2
    out[u, u] += dot(y, jet.uu) / (s1 * s1)
    out[u, u + 1] += dot(y, jet.uv) / (s1 * s2)
    out[u + 1, u] += dot(y, jet.uv) / (s1 * s2)
    out[u + 1, u + 1] += dot(y, jet.vv) / (s2 * s2)


@kernel(inner=True)
def free_hessian(store, pair, q, y, work, out):
    """Second derivative (16, 16) of y . rows, overwriting out."""
    rates = Variations(work[0], work[1], work[2], work[3], work[4], work[5], work[6])
    vectors = variations(store, pair, q, rates)
    d, n, length, s = vectors.d, vectors.n, vectors.length, pair.lengths
    fu, fv, gu, gv = vectors.f.u, vectors.f.v, vectors.g.u, vectors.g.v
    sign = float(surface_at(store.table, pair.surfaces[0]).sign)
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
        # The factors of each variation l are summed here, so that the inner loop is short.
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
    x = pair.x
    jet_fu, jet_fv = tangent_jets(store, pair.surfaces[0], rotation(q, pair.bodies[0]), vectors.f, x[0], x[1])
    jet_gu, jet_gv = tangent_jets(store, pair.surfaces[1], rotation(q, pair.bodies[1]), vectors.g, x[2], x[3])
    of_d = add(scale(y[0], n), blend(l1, fu, l2, fv))
    add_second(scale(-1.0, of_d), vectors.f, 0, s, out)
    add_second(of_d, vectors.g, 1, s, out)
    add_second(add(scale(l1, d), cross(fv, across)), jet_fu, 0, s, out)
    add_second(add(scale(l2, d), cross(across, fu)), jet_fv, 0, s, out)
    add_second(scale(l3, n), jet_gu, 1, s, out)
    add_second(scale(l4, n), jet_gv, 1, s, out)
