"""Rational spline points and derivatives inside kernels.

A surface is packed as one power table per span: with s = u - (middle of the span) and t likewise,

    (w x, w y, w z, w)(u, v) = sum_kl  c[k, l] s^k t^l,

four lanes a coefficient, evaluated by Horner's rule with both derivatives at once. Degrees up to
three share one unrolled bicubic path (missing powers are zero); higher degrees run in loops.

Records of surfaces and curves stand in the table of integers; what they point to is in the pool of doubles.
"""

from __future__ import annotations

from collections import namedtuple

from assembly._kernel import kernel
from assembly._lanes import lane, load_lanes, store_xyz
from assembly._record import Store, place_of, record_dtype, record_view, size_of

# A surface in the table.
SURFACE = record_dtype(
    "i8",
    degree_u=1,
    degree_v=1,
    spans_u=1,
    spans_v=1,
    breaks_u=1,  # where in the pool the ends of its spans in u begin
    breaks_v=1,
    coefficients=1,  # where in the pool its power tables begin
    closed_u=1,  # 1: periodic in u
    closed_v=1,
    sign=1,  # of the outward normal, times S_u x S_v
    cells=1,  # where in the pool its cells begin
    cell_count=1,
    poles=1,  # edges of the domain that are one point: 1, 2, 4, 8 for the low and high end of u, then of v
)
surface_at = record_view(SURFACE)
SURFACE_RECORD = size_of(SURFACE)
SPANS_U = place_of(SURFACE, "spans_u")
SPANS_V = place_of(SURFACE, "spans_v")
BREAKS_U = place_of(SURFACE, "breaks_u")
BREAKS_V = place_of(SURFACE, "breaks_v")
COEFFICIENTS = place_of(SURFACE, "coefficients")
SIGN = place_of(SURFACE, "sign")
CELLS = place_of(SURFACE, "cells")
CELL_COUNT = place_of(SURFACE, "cell_count")
# A curve in the table.
CURVE = record_dtype(
    "i8",
    degree=1,
    spans=1,
    breaks=1,  # where in the pool the ends of its spans begin
    coefficients=1,  # where in the pool its power tables begin
    closed=1,  # 1: periodic
)
spline_curve_at = record_view(CURVE)
CURVE_RECORD = size_of(CURVE)
CURVE_DEGREE = place_of(CURVE, "degree")
CURVE_SPANS = place_of(CURVE, "spans")
CURVE_BREAKS = place_of(CURVE, "breaks")
CURVE_COEFFICIENTS = place_of(CURVE, "coefficients")


# Up to this many spans are searched without a first guess.
FEW_SPANS = 8


@kernel(inline=True)
def find_span(pool, breaks, count, u):
    """Index of the span that holds u; the first or last one beyond the ends."""
    lo = 0
    hi = count
    if count > FEW_SPANS and pool[breaks] <= u < pool[breaks + count]:
        # Where knots are evenly spaced no search is needed.
        lo = int(count * ((u - pool[breaks]) / (pool[breaks + count] - pool[breaks])))
        lo = min(lo, count - 1)
        if u < pool[breaks + lo]:
            hi = lo
            lo = 0
        elif u < pool[breaks + lo + 1]:
            return lo
    while hi - lo > 1:
        mid = (lo + hi) >> 1
        if u >= pool[breaks + mid]:
            lo = mid
        else:
            hi = mid
    return lo


@kernel(inline=True)
def _row3(pool, o, t):
    """Cubic in t: value, first and second derivative, four lanes each."""
    a = load_lanes(pool, o)
    b = load_lanes(pool, o + 4)
    c = load_lanes(pool, o + 8)
    d = load_lanes(pool, o + 12)
    return a + t * (b + t * (c + t * d)), b + t * (2.0 * c + t * (3.0 * d)), 2.0 * c + (6.0 * t) * d


# A value at parameters (u, v) and its derivatives: lanes, or points (x, y, z).
SurfaceJet = namedtuple("SurfaceJet", "point u v uu uv vv")


@kernel(inline=True)
def _bicubic(pool, o, s, t):
    """The homogeneous SurfaceJet of a bicubic piece."""
    a, av, avv = _row3(pool, o, t)
    b, bv, bvv = _row3(pool, o + 16, t)
    c, cv, cvv = _row3(pool, o + 32, t)
    d, dv, dvv = _row3(pool, o + 48, t)
    return SurfaceJet(
        a + s * (b + s * (c + s * d)),
        b + s * (2.0 * c + s * (3.0 * d)),
        av + s * (bv + s * (cv + s * dv)),
        2.0 * c + (6.0 * s) * d,
        bv + s * (2.0 * cv + s * (3.0 * dv)),
        avv + s * (bvv + s * (cvv + s * dvv)),
    )


@kernel(inline=True)
def _row(pool, o, degree, t):
    """The same as `_row3` for any degree; the second derivative comes halved."""
    p = load_lanes(pool, o + 4 * degree)
    d = 0.0 * p
    h = 0.0 * p
    for k in range(degree - 1, -1, -1):
        h = d + t * h
        d = p + t * d
        p = load_lanes(pool, o + 4 * k) + t * p
    return p, d, h


@kernel(inline=True)
def _any_degree(pool, o, degree_u, degree_v, s, t):
    """The homogeneous SurfaceJet of a piece of any degree: Horner's rule in u over Horner's rule in v."""
    stride = 4 * (degree_v + 1)
    p, pv, pvv = _row(pool, o + stride * degree_u, degree_v, t)
    d = 0.0 * p
    dv = 0.0 * p
    h = 0.0 * p
    for k in range(degree_u - 1, -1, -1):
        h = d + s * h
        d = p + s * d
        dv = pv + s * dv
        a, av, avv = _row(pool, o + stride * k, degree_v, t)
        p = a + s * p
        pv = av + s * pv
        pvv = avv + s * pvv
    return SurfaceJet(p, d, pv, 2.0 * h, dv, 2.0 * pvv)


@kernel(inline=True)
def _quotient(a):
    """Divide a homogeneous SurfaceJet by the weight."""
    i = 1.0 / lane(a.point, 3)
    wu = lane(a.u, 3)
    wv = lane(a.v, 3)
    p = i * a.point
    pu = i * (a.u - wu * p)
    pv = i * (a.v - wv * p)
    return SurfaceJet(
        p,
        pu,
        pv,
        i * (a.uu - (2.0 * wu) * pu - lane(a.uu, 3) * p),
        i * (a.uv - wu * pv - wv * pu - lane(a.uv, 3) * p),
        i * (a.vv - (2.0 * wv) * pv - lane(a.vv, 3) * p),
    )


@kernel(inline=True)
def surface_lanes(store, r, u, v):
    """The SurfaceJet of the surface whose record starts at r, as four-lane values."""
    patch = surface_at(store.table, r)
    iu = find_span(store.pool, patch.breaks_u, patch.spans_u, u)
    iv = find_span(store.pool, patch.breaks_v, patch.spans_v, v)
    ou = patch.breaks_u + iu
    ov = patch.breaks_v + iv
    s = u - 0.5 * (store.pool[ou] + store.pool[ou + 1])
    t = v - 0.5 * (store.pool[ov] + store.pool[ov + 1])
    p = patch.degree_u
    q = patch.degree_v
    o = patch.coefficients + 4 * (p + 1) * (q + 1) * (iu * patch.spans_v + iv)
    if p == 3 and q == 3:
        return _quotient(_bicubic(store.pool, o, s, t))
    return _quotient(_any_degree(store.pool, o, p, q, s, t))


@kernel(inline=True)
def xyz(a):
    return (lane(a, 0), lane(a, 1), lane(a, 2))


@kernel(signatures="(i8[::1], f8[::1], i8, f8, f8)")
def surface_point(table, pool, r, u, v):
    """The SurfaceJet of the surface whose record starts at r, as points."""
    a = surface_lanes(Store(table, pool), r, u, v)
    return SurfaceJet(xyz(a.point), xyz(a.u), xyz(a.v), xyz(a.uu), xyz(a.uv), xyz(a.vv))


@kernel(inline=True)
def into_domain(pool, breaks, count, closed, u):
    """The parameter u, wrapped if the direction is closed; clamped if it is beyond an end by rounding alone.

    The second value is False where u is outside or not finite.
    """
    low = pool[breaks]
    high = pool[breaks + count]
    if low <= u <= high:
        return u, True
    if not -1e300 < u < 1e300:
        return low, False
    if closed != 0:
        # The remainder of a tiny negative number rounds to the whole period.
        return min(max(low + (u - low) % (high - low), low), high), True
    slack = 1e-14 * (high - low)
    return min(max(u, low), high), low - slack <= u <= high + slack


@kernel(signatures="(i8[::1], f8[::1], f8[::1], f8[::1], i8, f8[::1])")
def evaluate_surface(table, pool, u, v, order, out):
    """Points and derivatives to `order` at flat parameters into flat `out`, quantity by quantity.

    Returns -1, or 2 i for a parameter u[i] that is not in the domain, or 2 i + 1 for v[i].
    """
    patch = surface_at(table, 0)
    count = u.size
    block = 3 * count
    for i in range(count):
        x, fits = into_domain(pool, patch.breaks_u, patch.spans_u, patch.closed_u, u[i])
        if not fits:
            return 2 * i
        y, fits = into_domain(pool, patch.breaks_v, patch.spans_v, patch.closed_v, v[i])
        if not fits:
            return 2 * i + 1
        a = surface_lanes(Store(table, pool), 0, x, y)
        o = 3 * i
        store_xyz(a.point, out, o)
        if order >= 1:
            store_xyz(a.u, out, o + block)
            store_xyz(a.v, out, o + 2 * block)
        if order >= 2:
            store_xyz(a.uu, out, o + 3 * block)
            store_xyz(a.uv, out, o + 4 * block)
            store_xyz(a.vv, out, o + 5 * block)
    return -1


@kernel(inline=True)
def curve_lanes(store, r, t):
    """C, Ct, Ctt of the curve whose record starts at r, as four-lane values."""
    arc = spline_curve_at(store.table, r)
    span = find_span(store.pool, arc.breaks, arc.spans, t)
    at = arc.breaks + span
    s = t - 0.5 * (store.pool[at] + store.pool[at + 1])
    degree = arc.degree
    a, d, h = _row(store.pool, arc.coefficients + 4 * (degree + 1) * span, degree, s)
    i = 1.0 / lane(a, 3)
    p = i * a
    pt = i * (d - lane(d, 3) * p)
    return p, pt, i * (2.0 * h - (2.0 * lane(d, 3)) * pt - (2.0 * lane(h, 3)) * p)


@kernel(signatures="(i8[::1], f8[::1], i8, f8)")
def curve_point(table, pool, r, t):
    """C, Ct, Ctt as 3-tuples (z is zero for plane curves)."""
    a, d, h = curve_lanes(Store(table, pool), r, t)
    return xyz(a), xyz(d), xyz(h)


@kernel(signatures="(i8[::1], f8[::1], f8[::1], i8, f8[::1])")
def evaluate_curve(table, pool, t, order, out):
    """Points and derivatives to `order` at flat parameters into flat `out`; -1, or the index of a bad parameter."""
    arc = spline_curve_at(table, 0)
    count = t.size
    block = 3 * count
    for i in range(count):
        x, fits = into_domain(pool, arc.breaks, arc.spans, arc.closed, t[i])
        if not fits:
            return i
        a, d, h = curve_lanes(Store(table, pool), 0, x)
        o = 3 * i
        store_xyz(a, out, o)
        if order >= 1:
            store_xyz(d, out, o + block)
        if order >= 2:
            store_xyz(h, out, o + 2 * block)
    return -1


@kernel(inline=True)
def _row_third(pool, o, degree, t):
    """As `_row` with one derivative more: value, first, half the second, a sixth of the third derivative."""
    p = load_lanes(pool, o + 4 * degree)
    d = 0.0 * p
    h = 0.0 * p
    w = 0.0 * p
    for k in range(degree - 1, -1, -1):
        w = h + t * w
        h = d + t * h
        d = p + t * d
        p = load_lanes(pool, o + 4 * k) + t * p
    return p, d, h, w


@kernel(signatures="(i8[::1], f8[::1], i8, f8, f8)")
def third_derivatives(table, pool, r, u, v):
    """Suuu, Suuv, Suvv, Svvv as 3-tuples: only a degenerate (singular) pair needs them."""
    patch = surface_at(table, r)
    iu = find_span(pool, patch.breaks_u, patch.spans_u, u)
    iv = find_span(pool, patch.breaks_v, patch.spans_v, v)
    ou = patch.breaks_u + iu
    ov = patch.breaks_v + iv
    s = u - 0.5 * (pool[ou] + pool[ou + 1])
    t = v - 0.5 * (pool[ov] + pool[ov + 1])
    p = patch.degree_u
    q = patch.degree_v
    stride = 4 * (q + 1)
    o = patch.coefficients + stride * (p + 1) * (iu * patch.spans_v + iv)
    a, b, c, d = _row_third(pool, o + stride * p, q, t)
    # Names: derivatives in u by letter, in v by number; Taylor coefficients (halves and sixths) until the end.
    a1 = 0.0 * a
    a2 = 0.0 * a
    a3 = 0.0 * a
    b1 = 0.0 * a
    b2 = 0.0 * a
    c1 = 0.0 * a
    for k in range(p - 1, -1, -1):
        a3 = a2 + s * a3
        a2 = a1 + s * a2
        a1 = a + s * a1
        b2 = b1 + s * b2
        b1 = b + s * b1
        c1 = c + s * c1
        e, f, g, h = _row_third(pool, o + stride * k, q, t)
        a = e + s * a
        b = f + s * b
        c = g + s * c
        d = h + s * d
    i = 1.0 / lane(a, 3)
    wu = lane(a1, 3)
    wv = lane(b, 3)
    wuu = lane(a2, 3)
    wuv = lane(b1, 3)
    wvv = lane(c, 3)
    # Taylor coefficients of the quotient, order by order.
    x = i * a
    xu = i * (a1 - wu * x)
    xv = i * (b - wv * x)
    xuu = i * (a2 - wu * xu - wuu * x)
    xuv = i * (b1 - wu * xv - wv * xu - wuv * x)
    xvv = i * (c - wv * xv - wvv * x)
    xuuu = i * (a3 - wu * xuu - wuu * xu - lane(a3, 3) * x)
    xuuv = i * (b2 - wu * xuv - wv * xuu - wuu * xv - wuv * xu - lane(b2, 3) * x)
    xuvv = i * (c1 - wv * xuv - wu * xvv - wvv * xu - wuv * xv - lane(c1, 3) * x)
    xvvv = i * (d - wv * xvv - wvv * xv - lane(d, 3) * x)
    return xyz(6.0 * xuuu), xyz(2.0 * xuuv), xyz(2.0 * xuvv), xyz(6.0 * xvvv)


# A cell of a surface: a small piece of it.
CELL = record_dtype(
    "f8",
    parameters=2,  # (u, v) of a point of it
    point=3,  # [length]
    center=3,  # of a sphere that holds the piece [length]
    radius=1,  # of the sphere [length]
    half_widths=2,  # in u and v
)
cell_at = record_view(CELL)
CELL_SIZE = size_of(CELL)

# Fields of a surface record that are offsets into the pool.
OFFSETS = (BREAKS_U, BREAKS_V, COEFFICIENTS, CELLS)
