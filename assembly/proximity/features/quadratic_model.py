"""Boxes of features with a quadratic model that is off by no more than it says, and bounds of distances from them.

Over a box of parameters, u = u0 + a s and v = v0 + b t with |s|, |t| <= 1, a surface is

    S = S0 + p s + q t + l s^2 + m s t + k t^2 + r,   |r| <= e.

With S = A / w (A and w are one polynomial piece; coordinates from S0) and P the quadratic, A - w P has no terms of
order two or less, and the sum of its other coefficients over the least w bounds r. The support of the quadratic in a
direction n takes a few products, and

    n.(g0 - f0) - support_f(n) - support_g(-n) - e_f - e_g  <=  distance of the two boxes

for every unit n: quadratically, towards each other convex ones cubically, close to it as boxes shrink.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of
from assembly.geometry.splines.evaluate import (
    find_span,
    surface_at,
    surface_point,
)
from assembly.geometry.vec import add, cross, dot, matvec, scale, sub

# A node: box, model and sphere. Lengths are over the size of the scene.
QUADRATIC_MODEL = record_dtype(
    "f8",
    u0=1,  # middle of the box
    v0=1,
    half_u=1,  # half its widths: a, b
    half_v=1,
    point=3,  # S0
    linear_u=3,  # p
    linear_v=3,  # q
    square_u=3,  # l
    mixed=3,  # m
    square_v=3,  # k
    rest=1,  # e
    center=3,  # of the sphere
    radius=1,
    normal=3,  # unit normal of the linear part
    rest_n=1,  # what of e is along that normal
    curved=1,  # length of all terms but the linear ones
    bend=1,  # how much the normal turns over the box [rad]
    change=1,  # how much curvatures change over it
)
model_at = record_view(QUADRATIC_MODEL)
U0 = place_of(QUADRATIC_MODEL, "u0")
V0 = place_of(QUADRATIC_MODEL, "v0")
HALF_U = place_of(QUADRATIC_MODEL, "half_u")
HALF_V = place_of(QUADRATIC_MODEL, "half_v")
POINT = place_of(QUADRATIC_MODEL, "point")
LINEAR_U = place_of(QUADRATIC_MODEL, "linear_u")
LINEAR_V = place_of(QUADRATIC_MODEL, "linear_v")
SQUARE_U = place_of(QUADRATIC_MODEL, "square_u")
MIXED = place_of(QUADRATIC_MODEL, "mixed")
SQUARE_V = place_of(QUADRATIC_MODEL, "square_v")
REST = place_of(QUADRATIC_MODEL, "rest")
CENTER = place_of(QUADRATIC_MODEL, "center")
RADIUS = place_of(QUADRATIC_MODEL, "radius")
NORMAL = place_of(QUADRATIC_MODEL, "normal")
REST_N = place_of(QUADRATIC_MODEL, "rest_n")
NODE = size_of(QUADRATIC_MODEL)
# Where weights vary by more than this over a box it has no model: e is infinite and its sphere is what bounds it.
LEAST_WEIGHT = 0.1
# Roundings of coordinates in points and coefficients.
ROUNDING = 1e-15


@kernel(inline=True)
def put(a, i, k, v):
    a[i, k] = v[0]
    a[i, k + 1] = v[1]
    a[i, k + 2] = v[2]


@kernel(inline=True)
def get(a, i, k):
    return (a[i, k], a[i, k + 1], a[i, k + 2])


@kernel(inner=True)
def vanish(pool, o, stride, count):
    """Whether all coefficients of one power are zero."""
    for i in range(count):
        for c in range(4):
            if pool[o + stride * i + c] != 0.0:
                return False
    return True


# How far a surface is off a quadratic. rest: bound of the length; rest_n: of the part along n; sss, sst, stt, ttt: the
# terms of third order along n; beyond: bound of the others along n.
Remainder = namedtuple("Remainder", "rest rest_n sss sst stt ttt beyond")


@kernel(inner=True)
def remainder(store, r, iu, iv, u0, v0, a, b, origin, p, q, l, m, k, n, work):
    """How far a piece of the surface may be off the quadratic over a box; `work` holds 4 by 16 by 16 numbers.

    The piece may be one beside the middle of the box: then terms of low order remain too.
    """
    patch = surface_at(store.table, r)
    ou = patch.breaks_u + iu
    ov = patch.breaks_v + iv
    s = u0 - 0.5 * (store.pool[ou] + store.pool[ou + 1])
    t = v0 - 0.5 * (store.pool[ov] + store.pool[ov + 1])
    nu = patch.degree_u
    nv = patch.degree_v
    o = patch.coefficients + 4 * (nu + 1) * (nv + 1) * (iu * patch.spans_v + iv)
    # Missing powers of low degrees cost nothing.
    top = nv
    while nu > 0 and vanish(store.pool, o + 4 * nu * (top + 1), 4, top + 1):
        nu -= 1
    while nv > 0 and vanish(store.pool, o + 4 * nv, 4 * (top + 1), nu + 1):
        nv -= 1
    for i in range(nu + 1):
        for j in range(nv + 1):
            at = o + 4 * (i * (top + 1) + j)
            w = store.pool[at + 3]
            work[0, i, j] = store.pool[at] - w * origin[0]
            work[1, i, j] = store.pool[at + 1] - w * origin[1]
            work[2, i, j] = store.pool[at + 2] - w * origin[2]
            work[3, i, j] = w
    # Powers about the middle of the box, by Horner's rule repeated, then scaled by its half widths.
    for c in range(4):
        for first in range(nu):
            for i in range(nu - 1, first - 1, -1):
                for j in range(nv + 1):
                    work[c, i, j] += s * work[c, i + 1, j]
        for first in range(nv):
            for j in range(nv - 1, first - 1, -1):
                for i in range(nu + 1):
                    work[c, i, j] += t * work[c, i, j + 1]
    factor = 1.0
    for i in range(nu + 1):
        f = factor
        for j in range(nv + 1):
            for c in range(4):
                work[c, i, j] *= f
            f *= b
        factor *= a
    least = 2.0 * work[3, 0, 0]
    for i in range(nu + 1):
        for j in range(nv + 1):
            least -= abs(work[3, i, j])
    if not least > LEAST_WEIGHT * work[3, 0, 0]:
        return Remainder(math.inf, math.inf, 0.0, 0.0, 0.0, 0.0, math.inf)
    ex = 0.0
    ey = 0.0
    ez = 0.0
    along = 0.0
    beyond = 0.0
    c30 = 0.0
    c21 = 0.0
    c12 = 0.0
    c03 = 0.0
    for i in range(nu + 3):
        for j in range(nv + 3):
            x = 0.0
            y = 0.0
            z = 0.0
            if i <= nu and j <= nv:
                x = work[0, i, j]
                y = work[1, i, j]
                z = work[2, i, j]
            if j <= nv and 1 <= i <= nu + 1:
                w = work[3, i - 1, j]
                x -= w * p[0]
                y -= w * p[1]
                z -= w * p[2]
            if i <= nu and 1 <= j <= nv + 1:
                w = work[3, i, j - 1]
                x -= w * q[0]
                y -= w * q[1]
                z -= w * q[2]
            if j <= nv and i >= 2:
                w = work[3, i - 2, j]
                x -= w * l[0]
                y -= w * l[1]
                z -= w * l[2]
            if 1 <= i <= nu + 1 and 1 <= j <= nv + 1:
                w = work[3, i - 1, j - 1]
                x -= w * m[0]
                y -= w * m[1]
                z -= w * m[2]
            if i <= nu and j >= 2:
                w = work[3, i, j - 2]
                x -= w * k[0]
                y -= w * k[1]
                z -= w * k[2]
            ex += abs(x)
            ey += abs(y)
            ez += abs(z)
            height = n[0] * x + n[1] * y + n[2] * z
            along += abs(height)
            if i + j > 3:
                beyond += abs(height)
            elif i == 3:
                c30 = height
            elif i == 2 and j == 1:
                c21 = height
            elif i == 1 and j == 2:
                c12 = height
            elif j == 3:
                c03 = height
    w = 1.0 / work[3, 0, 0]
    e = math.sqrt(ex * ex + ey * ey + ez * ez) / least
    return Remainder(e, along / least, c30 * w, c21 * w, c12 * w, c03 * w, beyond / least)


@kernel(inner=True)
def face_model(store, r, pose, nodes, i, work):
    """Fill in a node of a surface, whose box stands in it already, moved by a pose."""
    model = model_at(nodes, i)
    patch = surface_at(store.table, r)
    u0 = model.u0
    v0 = model.v0
    a = model.half_u
    b = model.half_v
    s0, su, sv, suu, suv, svv = surface_point(store.table, store.pool, r, u0, v0)
    p = scale(a, su)
    q = scale(b, sv)
    l = scale(0.5 * a * a, suu)
    m = scale(a * b, suv)
    k = scale(0.5 * b * b, svv)
    iu = find_span(store.pool, patch.breaks_u, patch.spans_u, u0)
    iv = find_span(store.pool, patch.breaks_v, patch.spans_v, v0)
    n = cross(p, q)
    nn = dot(n, n)
    n = scale(1.0 / math.sqrt(nn), n) if nn > 1e-20 * dot(p, p) * dot(q, q) and nn > 0.0 else (0.0, 0.0, 0.0)
    left = remainder(store, r, iu, iv, u0, v0, a, b, s0, p, q, l, m, k, n, work)
    noise = ROUNDING * (
        abs(s0[0]) + abs(s0[1]) + abs(s0[2]) + abs(pose.shift[0]) + abs(pose.shift[1]) + abs(pose.shift[2])
    )
    place_model(pose, s0, p, q, l, m, k, left.rest + noise, nodes, i)
    if nn > 0.0 and model.bend < math.inf:
        model.rest_n = left.rest_n + noise
        change = curvature_change(p, q, l, m, k, n, left)
        across = nn / max(dot(p, p), dot(q, q))
        model.change = (change + 12.0 * left.beyond) / across


@kernel(inner=True)
def curvature_change(p, q, l, m, k, n, left):
    """How much the second fundamental form changes over a box, in its half widths, whatever the parameters do.

    The covariant derivative h_ij;k = n.S_ijk - G^l_ij h_kl - G^l_ki h_lj - G^l_kj h_il, with G the tangential parts of
    the second derivatives in the basis S_u, S_v.
    """
    uu = dot(p, p)
    uv = dot(p, q)
    vv = dot(q, q)
    det = 1.0 / (uu * vv - uv * uv)
    # Tangential parts (G^u, G^v) of S_uu = 2 l, S_uv = m, S_vv = 2 k, and their heights.
    x = 2.0 * dot(l, p)
    y = 2.0 * dot(l, q)
    a1 = det * (vv * x - uv * y)
    a2 = det * (uu * y - uv * x)
    x = dot(m, p)
    y = dot(m, q)
    b1 = det * (vv * x - uv * y)
    b2 = det * (uu * y - uv * x)
    x = 2.0 * dot(k, p)
    y = 2.0 * dot(k, q)
    d1 = det * (vv * x - uv * y)
    d2 = det * (uu * y - uv * x)
    h = 2.0 * dot(l, n)
    i = dot(m, n)
    j = 2.0 * dot(k, n)
    uuu = abs(6.0 * left.sss - 3.0 * (a1 * h + a2 * i))
    uuv = abs(2.0 * left.sst - (a1 * i + a2 * j) - 2.0 * (b1 * h + b2 * i))
    uvv = abs(2.0 * left.stt - (d1 * h + d2 * i) - 2.0 * (b1 * i + b2 * j))
    vvv = abs(6.0 * left.ttt - 3.0 * (d1 * i + d2 * j))
    return max(max(uuu + uuv, uuv + uvv), uvv + vvv)


@kernel(inner=True)
def place_model(pose, s0, p, q, l, m, k, e, nodes, i):
    """Write a model, moved by a pose, with what follows from it."""
    model = model_at(nodes, i)
    put(nodes, i, POINT, add(matvec(pose.rotation, s0), pose.shift))
    p = matvec(pose.rotation, p)
    q = matvec(pose.rotation, q)
    put(nodes, i, LINEAR_U, p)
    put(nodes, i, LINEAR_V, q)
    put(nodes, i, SQUARE_U, matvec(pose.rotation, l))
    put(nodes, i, MIXED, matvec(pose.rotation, m))
    put(nodes, i, SQUARE_V, matvec(pose.rotation, k))
    model.rest = e
    model.rest_n = e
    uu = dot(p, p)
    vv = dot(q, q)
    uv = dot(p, q)
    curved = math.sqrt(dot(l, l)) + math.sqrt(dot(m, m)) + math.sqrt(dot(k, k))
    model.curved = curved + e
    # The parallelogram of the linear part reaches as far as its longer diagonal; or as the ball known.
    radius = math.sqrt(max(uu + vv + 2.0 * abs(uv), 0.0)) + curved + e
    d = sub(get(nodes, i, CENTER), get(nodes, i, POINT))
    model.radius = min(radius, model.radius + math.sqrt(dot(d, d)))
    put(nodes, i, CENTER, get(nodes, i, POINT))
    normal = cross(p, q)
    nn = dot(normal, normal)
    if nn > 1e-20 * uu * vv and nn > 0.0:
        nn = math.sqrt(nn)
        put(nodes, i, NORMAL, scale(1.0 / nn, normal))
        # The height of the parallelogram over its longer side: the shortest way across the box.
        across = nn / math.sqrt(max(uu, vv))
        model.bend = (2.0 * curved + 3.0 * e) / across
        model.change = 6.0 * e / (across * across)
    else:
        put(nodes, i, NORMAL, (0.0, 0.0, 0.0))
        length = math.sqrt(max(uu, vv))
        is_curve = min(uu, vv) == 0.0 and length > 0.0
        model.bend = (2.0 * curved + 3.0 * e) / length if is_curve else math.inf
        model.change = 6.0 * e / (length * length) if is_curve else math.inf


@kernel(inline=True)
def crest(l, k):
    """The most of l s + k s^2 over |s| <= 1."""
    l = abs(l)
    if l < -2.0 * k:
        return -0.25 * l * l / k
    return l + k


@kernel(inline=True)
def support(nodes, i, x, y, z):
    """The most of n.(S - S0) over a node; n = (x, y, z) is a unit vector."""
    model = model_at(nodes, i)
    lu = x * model.linear_u[0] + y * model.linear_u[1] + z * model.linear_u[2]
    lv = x * model.linear_v[0] + y * model.linear_v[1] + z * model.linear_v[2]
    ku = x * model.square_u[0] + y * model.square_u[1] + z * model.square_u[2]
    kv = x * model.square_v[0] + y * model.square_v[1] + z * model.square_v[2]
    m = x * model.mixed[0] + y * model.mixed[1] + z * model.mixed[2]
    c = x * model.normal[0] + y * model.normal[1] + z * model.normal[2]
    rest = abs(c) * model.rest_n + math.sqrt(max(1.0 - c * c, 0.0)) * model.rest
    return crest(lu, ku) + crest(lv, kv) + abs(m) + rest


@kernel(inner=True)
def bound_along(a, i, b, j, n):
    """A lower bound of the distance of two nodes from the unit direction n."""
    model = model_at(b, j)
    model_record = model_at(a, i)
    x, y, z = n
    apart = (
        x * (model.point[0] - model_record.point[0])
        + y * (model.point[1] - model_record.point[1])
        + z * (model.point[2] - model_record.point[2])
    )
    return apart - support(a, i, x, y, z) - support(b, j, -x, -y, -z)


@kernel(inner=True)
def pair_bound(a, i, b, j, n, enough):
    """The best bound found for two nodes and its direction, beginning with n (zero: none); done at `enough`."""
    model = model_at(a, i)
    model_record = model_at(b, j)
    d = sub(get(b, j, CENTER), get(a, i, CENTER))
    length = math.sqrt(dot(d, d))
    best = length - model.radius - model_record.radius
    if best >= enough or not model.rest + model_record.rest < math.inf:
        return best, n
    if dot(n, n) > 0.5:
        value = bound_along(a, i, b, j, n)
        if value > best:
            best = value
            if best >= enough:
                return best, n
    if length > 0.0:
        c = scale(1.0 / length, d)
        value = bound_along(a, i, b, j, c)
        if value > best:
            best = value
            n = c
            if best >= enough:
                return best, n
    for side in range(2):
        m = get(a, i, NORMAL) if side == 0 else get(b, j, NORMAL)
        if dot(m, m) > 0.5:
            if dot(m, d) < 0.0:
                m = scale(-1.0, m)
            value = bound_along(a, i, b, j, m)
            if value > best:
                best = value
                n = m
                if best >= enough:
                    return best, n
    return best, n


@kernel(inner=True)
def vertex_model(pool, at, pose, nodes, i):
    """Fill in a node of a vertex."""
    model = model_at(nodes, i)
    zero = (0.0, 0.0, 0.0)
    point = (pool[at], pool[at + 1], pool[at + 2])
    for k in range(4):
        nodes[i, k] = 0.0
    put(nodes, i, CENTER, (0.0, 0.0, 0.0))
    model.radius = math.inf
    place_model(pose, point, zero, zero, zero, zero, zero, 0.0, nodes, i)
    model.radius = 0.0
    model.bend = 0.0
    model.change = 0.0
