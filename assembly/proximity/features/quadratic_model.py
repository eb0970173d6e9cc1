"""Quadratic models of features over boxes, with bounds of their errors, and bounds of distances from them.

Over a box of parameters, u = u0 + a s and v = v0 + b t with |s|, |t| <= 1, a surface is

    S = S0 + p s + q t + l s^2 + m s t + k t^2 + r,   |r| <= e.

With S = A / w (A and w are one polynomial piece; coordinates from S0) and P the quadratic, A - w P has no terms of
order two or less, and the sum of its other coefficients over the least w bounds r. The support of the quadratic in a
direction n takes a few products, and

    n.(g0 - f0) - support_f(n) - support_g(-n) - e_f - e_g  <=  distance of the two boxes

for every unit n. As boxes shrink the bound comes close quadratically; cubically if they are convex to each other.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.geometry.splines.evaluate import find_span, surface_at, surface_point
from assembly.geometry.vec import add, cross, dot, matvec, neg, scale, sub
from assembly.proximity.bvh.tree import three_of

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
    rest_n=1,  # the part of e along that normal
    curved=1,  # length of all terms but the linear ones
    bend=1,  # how much the normal turns over the box [rad]
    change=1,  # how much curvatures change over it
)
model_at = record_view(QUADRATIC_MODEL)
NODE = size_of(QUADRATIC_MODEL)
# A box whose least weight is below this part of the middle one has no model: e is infinite, its sphere bounds it.
LEAST_WEIGHT = 0.1
# Roundings of coordinates in points and coefficients.
COEFFICIENT_ROUNDING = 1e-15


# The quadratic S0 + p s + q t + l s^2 + m s t + k t^2.
Quadratic = namedtuple("Quadratic", "point linear_u linear_v square_u mixed square_v")
# A box of parameters: its middle, half its widths.
Box = namedtuple("Box", "u v half_u half_v")


@kernel(inline=True)
def put(field, v):
    """Write three numbers of a record's field."""
    field[0], field[1], field[2] = v


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
def load_piece(store, r, span, origin, work):
    """Load the coefficients of a surface's piece, seen from an origin, and its weights into work; returns degrees."""
    patch = surface_at(store.table, r)
    nu = patch.degree_u
    nv = patch.degree_v
    o = patch.coefficients + 4 * (nu + 1) * (nv + 1) * (span[0] * patch.spans_v + span[1])
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
            for c in range(3):
                work[c, i, j] = store.pool[at + c] - w * origin[c]
            work[3, i, j] = w
    return nu, nv


@kernel(inner=True)
def expand(work, degrees, box):
    """Expand the piece in work about the middle of a box, in units of its half widths.

    Returns its least weight over the box; 0 where weights vary by more than `LEAST_WEIGHT` allows.
    """
    nu, nv = degrees
    # By Horner's rule repeated.
    for c in range(4):
        for first in range(nu):
            for i in range(nu - 1, first - 1, -1):
                for j in range(nv + 1):
                    work[c, i, j] += box.u * work[c, i + 1, j]
        for first in range(nv):
            for j in range(nv - 1, first - 1, -1):
                for i in range(nu + 1):
                    work[c, i, j] += box.v * work[c, i, j + 1]
    factor = 1.0
    for i in range(nu + 1):
        f = factor
        for j in range(nv + 1):
            for c in range(4):
                work[c, i, j] *= f
            f *= box.half_v
        factor *= box.half_u
    least = 2.0 * work[3, 0, 0]
    for i in range(nu + 1):
        for j in range(nv + 1):
            least -= abs(work[3, i, j])
    return least if least > LEAST_WEIGHT * work[3, 0, 0] else 0.0


@kernel(inline=True)
def less(x, w, a):
    return (x[0] - w * a[0], x[1] - w * a[1], x[2] - w * a[2])


@kernel(inner=True)
def term_off(work, degrees, quadratic, i, j):
    """The coefficient of s^i t^j in A - w P, A and w in work."""
    nu, nv = degrees
    x = (0.0, 0.0, 0.0)
    if i <= nu and j <= nv:
        x = (work[0, i, j], work[1, i, j], work[2, i, j])
    if j <= nv and 1 <= i <= nu + 1:
        x = less(x, work[3, i - 1, j], quadratic.linear_u)
    if i <= nu and 1 <= j <= nv + 1:
        x = less(x, work[3, i, j - 1], quadratic.linear_v)
    if j <= nv and i >= 2:
        x = less(x, work[3, i - 2, j], quadratic.square_u)
    if 1 <= i <= nu + 1 and 1 <= j <= nv + 1:
        x = less(x, work[3, i - 1, j - 1], quadratic.mixed)
    if i <= nu and j >= 2:
        x = less(x, work[3, i, j - 2], quadratic.square_v)
    return x


@kernel(inline=True)
def quadratic_over(box, s0, su, sv, suu, suv, svv):
    """The `Quadratic` of a surface over a box, from its derivatives in the middle."""
    a, b = box.half_u, box.half_v
    return Quadratic(
        s0, scale(a, su), scale(b, sv), scale(0.5 * a * a, suu), scale(a * b, suv), scale(0.5 * b * b, svv)
    )


@kernel(inner=True)
def remainder(store, r, span, box, quadratic, n, work):
    """How far a piece of the surface may be off the quadratic over a box; `work` holds 4 by 16 by 16 numbers.

    The piece may be one beside the middle of the box: then terms of low order remain too.
    """
    patch = surface_at(store.table, r)
    ou = patch.breaks_u + span[0]
    ov = patch.breaks_v + span[1]
    s = box.u - 0.5 * (store.pool[ou] + store.pool[ou + 1])
    t = box.v - 0.5 * (store.pool[ov] + store.pool[ov + 1])
    degrees = load_piece(store, r, span, quadratic.point, work)
    least = expand(work, degrees, Box(s, t, box.half_u, box.half_v))
    if not least > 0.0:
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
    for i in range(degrees[0] + 3):
        for j in range(degrees[1] + 3):
            x, y, z = term_off(work, degrees, quadratic, i, j)
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
def face_model(store, r, pose, model, work):
    """Fill in the model of a surface, moved by a pose; the model has its box already."""
    patch = surface_at(store.table, r)
    box = Box(model.u0, model.v0, model.half_u, model.half_v)
    s0, su, sv, suu, suv, svv = surface_point(store.table, store.pool, r, box.u, box.v)
    quadratic = quadratic_over(box, s0, su, sv, suu, suv, svv)
    p, q = quadratic.linear_u, quadratic.linear_v
    span = (
        find_span(store.pool, patch.breaks_u, patch.spans_u, box.u),
        find_span(store.pool, patch.breaks_v, patch.spans_v, box.v),
    )
    n = cross(p, q)
    nn = dot(n, n)
    n = scale(1.0 / math.sqrt(nn), n) if nn > 1e-20 * dot(p, p) * dot(q, q) and nn > 0.0 else (0.0, 0.0, 0.0)
    left = remainder(store, r, span, box, quadratic, n, work)
    noise = COEFFICIENT_ROUNDING * (
        abs(s0[0]) + abs(s0[1]) + abs(s0[2]) + abs(pose.shift[0]) + abs(pose.shift[1]) + abs(pose.shift[2])
    )
    place_model(pose, quadratic, left.rest + noise, model)
    if nn > 0.0 and model.bend < math.inf:
        model.rest_n = left.rest_n + noise
        change = curvature_change(quadratic, n, left)
        across = nn / max(dot(p, p), dot(q, q))
        model.change = (change + 12.0 * left.beyond) / across


@kernel(inner=True)
def curvature_change(quadratic, n, left):
    """How much the second fundamental form changes over a box, in its half widths, whatever the parameters do.

    The covariant derivative h_ij;k = n.S_ijk - G^l_ij h_kl - G^l_ki h_lj - G^l_kj h_il, with G the tangential parts of
    the second derivatives in the basis S_u, S_v.
    """
    _s0, p, q, l, m, k = quadratic
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
def place_model(pose, quadratic, e, model):
    """Write a model, moved by a pose, with what follows from it."""
    point = add(matvec(pose.rotation, quadratic.point), pose.shift)
    p = matvec(pose.rotation, quadratic.linear_u)
    q = matvec(pose.rotation, quadratic.linear_v)
    l, m, k = quadratic.square_u, quadratic.mixed, quadratic.square_v
    put(model.point, point)
    put(model.linear_u, p)
    put(model.linear_v, q)
    put(model.square_u, matvec(pose.rotation, l))
    put(model.mixed, matvec(pose.rotation, m))
    put(model.square_v, matvec(pose.rotation, k))
    model.rest = e
    model.rest_n = e
    uu = dot(p, p)
    vv = dot(q, q)
    uv = dot(p, q)
    curved = math.sqrt(dot(l, l)) + math.sqrt(dot(m, m)) + math.sqrt(dot(k, k))
    model.curved = curved + e
    # The linear part reaches as far as its parallelogram's longer diagonal; the ball known may be smaller.
    radius = math.sqrt(max(uu + vv + 2.0 * abs(uv), 0.0)) + curved + e
    d = sub(three_of(model.center), point)
    model.radius = min(radius, model.radius + math.sqrt(dot(d, d)))
    put(model.center, point)
    normal = cross(p, q)
    nn = dot(normal, normal)
    if nn > 1e-20 * uu * vv and nn > 0.0:
        nn = math.sqrt(nn)
        put(model.normal, scale(1.0 / nn, normal))
        # The height of the parallelogram over its longer side: the shortest way across the box.
        across = nn / math.sqrt(max(uu, vv))
        model.bend = (2.0 * curved + 3.0 * e) / across
        model.change = 6.0 * e / (across * across)
    else:
        put(model.normal, (0.0, 0.0, 0.0))
        length = math.sqrt(max(uu, vv))
        is_curve = min(uu, vv) == 0.0 and length > 0.0
        model.bend = (2.0 * curved + 3.0 * e) / length if is_curve else math.inf
        model.change = 6.0 * e / (length * length) if is_curve else math.inf


@kernel(inline=True)
def crest(l, k):
    """The maximum of l s + k s^2 over |s| <= 1."""
    l = abs(l)
    if l < -2.0 * k:
        return -0.25 * l * l / k
    return l + k


@kernel(inline=True)
def support(model, n):
    """An upper bound of n.(S - S0) over a node; n is a unit vector."""
    lu = dot(n, model.linear_u)
    lv = dot(n, model.linear_v)
    ku = dot(n, model.square_u)
    kv = dot(n, model.square_v)
    m = dot(n, model.mixed)
    c = dot(n, model.normal)
    rest = abs(c) * model.rest_n + math.sqrt(max(1.0 - c * c, 0.0)) * model.rest
    return crest(lu, ku) + crest(lv, kv) + abs(m) + rest


@kernel(inner=True)
def bound_along(f, g, n):
    """A lower bound of the distance of two modeled boxes, along the unit direction n."""
    apart = dot(n, sub(g.point, f.point))
    return apart - support(f, n) - support(g, neg(n))


@kernel(inline=True)
def between_centers(f, g):
    """From the middle of one model's sphere to that of another one's."""
    return sub(three_of(g.center), three_of(f.center))


@kernel(inline=True)
def ball_bound(f, g):
    """A lower bound of the distance of two modeled boxes, from their spheres."""
    d = between_centers(f, g)
    return math.sqrt(dot(d, d)) - f.radius - g.radius


@kernel(inner=True)
def pair_bound(f, g, n, enough):
    """The best bound found for two models and its direction, beginning with n (zero: none); it stops at `enough`."""
    best = ball_bound(f, g)
    if best >= enough or not f.rest + g.rest < math.inf:
        return best, n
    d = between_centers(f, g)
    length = math.sqrt(dot(d, d))
    known = n
    for way in range(4):
        if way == 0:
            m = known
        elif way == 1:
            m = scale(1.0 / length, d) if length > 0.0 else (0.0, 0.0, 0.0)
        else:
            m = three_of(f.normal if way == 2 else g.normal)
            m = neg(m) if dot(m, d) < 0.0 else m
        if not dot(m, m) > 0.5:
            continue
        value = bound_along(f, g, m)
        if value > best:
            best = value
            n = m
            if best >= enough:
                break
    return best, n


@kernel(inner=True)
def vertex_model(pool, at, pose, model):
    """Fill in the model of a vertex."""
    zero = (0.0, 0.0, 0.0)
    model.u0 = model.v0 = model.half_u = model.half_v = 0.0
    put(model.center, zero)
    model.radius = math.inf
    place_model(pose, Quadratic((pool[at], pool[at + 1], pool[at + 2]), zero, zero, zero, zero, zero), 0.0, model)
    model.radius = 0.0
    model.bend = 0.0
    model.change = 0.0
