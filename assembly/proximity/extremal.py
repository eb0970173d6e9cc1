"""The extremal pair of two surfaces: where they are closest, or deepest in each other.

With n the outward unit normal of f, d = g - f and m the normal of g scaled so that m.n = 1, the pair solves

    P^T d = 0   (d is normal to f)      and      r2 = P^T (m - n) = 0   (the normals are parallel),

P = [x y] an orthonormal tangent frame of f. Unlike "d orthogonal to all four tangents" this stays
regular through touching and interpenetration. Newton's step is taken in tangent lengths
a = E u_f', b = T u_g' with E = P^T [f_u f_v], T = P^T [g_u g_v]; A and C are the shape operators of f and g
with respect to n (dn = P A a), and

    H a = C r1 - r2,   b = (I + beta A) a - r1,   H = C (I + beta A) - A,   beta = n.d

(the two 2x2 solves of paper 001, appendix A, in one common frame, so that no angle between the
parameterizations and no sign of the second normal appears).
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.spline import (
    BREAKS_U,
    BREAKS_V,
    CLOSED_U,
    CLOSED_V,
    SIGN,
    SPANS_U,
    SPANS_V,
    surface_point,
)
from assembly.geometry.vec import add, blend, cross, dot, matvec, matvec_t, scale, sub

# What became of a pair.
CONVERGED, SINGULAR, LEFT_PATCH, NOT_CONVERGED = 0, 1, 2, 3
# A pole is where |Su x Sv| falls below this times |Su| |Sv| (or one of them vanishes).
POLE = 1e-9
# H counts as singular below this ratio of its smallest singular value to its scale.
RANK = 1e-7


@kernel(inline=True)
def tangent_frame(fu, fv, fuu, fuv, fvv, sign):
    """Unit normal n, tangents x, y with [fu fv] = [x y] E (E upper triangular), and whether regular.

    At a pole the normal is the limit along the other parameter, by second derivatives.
    """
    normal = cross(fu, fv)
    uu = dot(fu, fu)
    vv = dot(fv, fv)
    size = math.sqrt(dot(normal, normal))
    regular = size > POLE * math.sqrt(uu * vv) and size > 1e-290
    if not regular:
        along = cross(fuv, fv) if uu <= vv else cross(fu, fuv)
        length = math.sqrt(dot(along, along))
        if length > 0.0:
            normal = along
            size = length
    n = scale(sign / size if size > 0.0 else 0.0, normal)
    if uu >= vv or uu > 1e-16 * vv:
        x = scale(1.0 / math.sqrt(uu) if uu > 0.0 else 0.0, fu)
    else:
        x = scale(1.0 / math.sqrt(vv), cross(fv, n))
    return n, x, cross(n, x), regular


@kernel(inline=True)
def shape_operator(t11, t12, t21, t22, luu, luv, lvv):
    """-T^-T L T^-1 for tangent coordinates T and L_ij = S_ij.n: symmetric, +1/r on a ball."""
    i = 1.0 / (t11 * t22 - t12 * t21)
    p = i * t22
    q = -i * t12
    r = -i * t21
    s = i * t11
    a = luu * p + luv * r
    b = luv * p + lvv * r
    return (
        -(p * a + r * b),
        -(q * a + s * b),
        -(q * (luu * q + luv * s) + s * (luv * q + lvv * s)),
    )


@kernel
def pair_frame(table, pool, f, g, rotation, shift, x):
    """Everything about a pair at parameters x = (u_f, v_f, u_g, v_g), in the axes of body f.

    Returns
    -------
    n, tx, ty : normal of f and its tangent frame
    pf, pg : the two points
    e : (e11, e12, e22), tangent coordinates of f
    t : (t11, t12, t21, t22), tangent coordinates of g
    a, c : shape operators (11, 12, 22) of f and g with respect to n
    r : (r1x, r1y, r2x, r2y), residual
    beta : n.(pg - pf)
    regular : whether both parameterizations are regular here
    """
    pf, fu, fv, fuu, fuv, fvv = surface_point(table, pool, f, x[0], x[1])
    qg, gu, gv, guu, guv, gvv = surface_point(table, pool, g, x[2], x[3])
    n, tx, ty, regular = tangent_frame(fu, fv, fuu, fuv, fvv, float(table[f + SIGN]))
    pg = add(matvec(rotation, qg), shift)
    d = sub(pg, pf)
    e11 = dot(tx, fu)
    e12 = dot(tx, fv)
    e22 = dot(ty, fv)
    # The normal and the frame go to the axes of g, rather than six derivatives to those of f.
    ng = matvec_t(rotation, n)
    xg = matvec_t(rotation, tx)
    yg = matvec_t(rotation, ty)
    t11 = dot(xg, gu)
    t12 = dot(xg, gv)
    t21 = dot(yg, gu)
    t22 = dot(yg, gv)
    det = t11 * t22 - t12 * t21
    regular = regular and abs(det) > POLE * math.sqrt(dot(gu, gu) * dot(gv, gv))
    if not regular or e11 * e22 == 0.0 or det == 0.0:
        zero = (0.0, 0.0, 0.0)
        return n, tx, ty, pf, pg, (e11, e12, e22), (t11, t12, t21, t22), zero, zero, (dot(tx, d), dot(ty, d), 0.0, 0.0), dot(n, d), False
    a = shape_operator(e11, e12, 0.0, e22, dot(fuu, n), dot(fuv, n), dot(fvv, n))
    c = shape_operator(t11, t12, t21, t22, dot(guu, ng), dot(guv, ng), dot(gvv, ng))
    # m = n + P r2 is orthogonal to gu and gv: T^T r2 = -(n.gu, n.gv).
    nu = dot(ng, gu)
    nv = dot(ng, gv)
    i = 1.0 / det
    r = (dot(tx, d), dot(ty, d), i * (t21 * nv - t22 * nu), i * (t12 * nu - t11 * nv))
    return n, tx, ty, pf, pg, (e11, e12, e22), (t11, t12, t21, t22), a, c, r, dot(n, d), True


@kernel(inline=True)
def pair_matrix(a, c, beta):
    """I + beta A (symmetric), H = C (I + beta A) - A, and the scale of H's terms."""
    k11 = 1.0 + beta * a[0]
    k12 = beta * a[1]
    k22 = 1.0 + beta * a[2]
    h11 = c[0] * k11 + c[1] * k12 - a[0]
    h12 = c[0] * k12 + c[1] * k22 - a[1]
    h21 = c[1] * k11 + c[2] * k12 - a[1]
    h22 = c[1] * k12 + c[2] * k22 - a[2]
    fa = math.sqrt(a[0] * a[0] + 2.0 * a[1] * a[1] + a[2] * a[2])
    fc = math.sqrt(c[0] * c[0] + 2.0 * c[1] * c[1] + c[2] * c[2])
    fk = math.sqrt(k11 * k11 + 2.0 * k12 * k12 + k22 * k22)
    return (k11, k12, k22), (h11, h12, h21, h22), fc * fk + fa


@kernel(inline=True)
def pair_inverse(h, size, flat):
    """Inverse of H, or its damped least-norm inverse where H is (nearly) singular.

    `flat` is the curvature below which a scene counts as flat. Returns the inverse and whether regular.
    """
    det = h[0] * h[3] - h[1] * h[2]
    norm2 = h[0] * h[0] + h[1] * h[1] + h[2] * h[2] + h[3] * h[3]
    # The smallest singular value is at least |det| / |H|_F.
    if abs(det) > 100.0 * RANK * size * math.sqrt(norm2) and size > flat:
        i = 1.0 / det
        return (i * h[3], -i * h[1], -i * h[2], i * h[0]), True
    damping = max(RANK * size, flat)
    damping *= damping
    # (H^T H + damping I)^-1 H^T
    m11 = h[0] * h[0] + h[2] * h[2] + damping
    m12 = h[0] * h[1] + h[2] * h[3]
    m22 = h[1] * h[1] + h[3] * h[3] + damping
    i = 1.0 / (m11 * m22 - m12 * m12)
    inverse = (
        i * (m22 * h[0] - m12 * h[1]),
        i * (m22 * h[2] - m12 * h[3]),
        i * (m11 * h[1] - m12 * h[0]),
        i * (m11 * h[3] - m12 * h[2]),
    )
    return inverse, abs(det) > RANK * size * math.sqrt(norm2) and size > flat


@kernel(inline=True)
def pair_step(a, c, r, beta, flat):
    """Newton's step in tangent lengths: (ax, ay, bx, by) and whether H is regular."""
    k, h, size = pair_matrix(a, c, beta)
    i, regular = pair_inverse(h, size, flat)
    s = c[0] * r[0] + c[1] * r[1] - r[2]
    t = c[1] * r[0] + c[2] * r[1] - r[3]
    ax = i[0] * s + i[1] * t
    ay = i[2] * s + i[3] * t
    return ax, ay, k[0] * ax + k[1] * ay - r[0], k[1] * ax + k[2] * ay - r[1], regular


@kernel(inline=True)
def into_domain(table, pool, r, u, v):
    """Parameters wrapped where the surface is closed, clamped where it ends; whether it was clamped."""
    clamped = False
    ou = table[r + BREAKS_U]
    lo = pool[ou]
    hi = pool[ou + table[r + SPANS_U]]
    if u < lo or u > hi:
        if table[r + CLOSED_U] == 1:
            u -= (hi - lo) * math.floor((u - lo) / (hi - lo))
            u = min(max(u, lo), hi)
        else:
            u = lo if u < lo else hi
            clamped = True
    ov = table[r + BREAKS_V]
    lo = pool[ov]
    hi = pool[ov + table[r + SPANS_V]]
    if v < lo or v > hi:
        if table[r + CLOSED_V] == 1:
            v -= (hi - lo) * math.floor((v - lo) / (hi - lo))
            v = min(max(v, lo), hi)
        else:
            v = lo if v < lo else hi
            clamped = True
    return u, v, clamped


@kernel(inline=True)
def largest_curvature(a):
    """A bound of the largest principal curvature."""
    return math.sqrt(a[0] * a[0] + 2.0 * a[1] * a[1] + a[2] * a[2])


@kernel
def solve_pair(table, pool, f, g, rotation, shift, x, size, limit):
    """Newton from x to the extremal pair; returns status, parameters, iterations and the frame there.

    `size` is the length against which steps are measured. A step turns neither normal by more than about half a
    radian, so that the iteration follows the surface instead of jumping to another root.
    """
    tolerance = 4e-14 * size
    flat = 1e-9 / size
    previous = 1e300
    status = NOT_CONVERGED
    iteration = 0
    frame = pair_frame(table, pool, f, g, rotation, shift, x)
    while iteration < limit:
        n, tx, ty, pf, pg, e, t, a, c, r, beta, regular = frame
        if not regular:
            # A pole: nothing better than the point itself when d is already normal there.
            done = r[0] * r[0] + r[1] * r[1] <= tolerance * tolerance
            return (SINGULAR if done else NOT_CONVERGED), x, iteration, frame
        ax, ay, bx, by, isolated = pair_step(a, c, r, beta, flat)
        step_f = math.sqrt(ax * ax + ay * ay)
        step_g = math.sqrt(bx * bx + by * by)
        step = max(step_f, step_g)
        if step <= tolerance or (step < 1e-9 * size and step > 0.25 * previous):
            # In a singular system a vanishing step is a solution only if the residual vanishes too.
            turned = r[2] * r[2] + r[3] * r[3]
            if isolated:
                return CONVERGED, x, iteration, frame
            done = turned < 1e-18 and r[0] * r[0] + r[1] * r[1] < 1e-18 * size * size
            return (SINGULAR if done else NOT_CONVERGED), x, iteration, frame
        if not step < 1e300:
            return NOT_CONVERGED, x, iteration, frame
        previous = step
        bend = max(step_f * largest_curvature(a), step_g * largest_curvature(c), 2.0 * step / size)
        factor = 1.0 if bend <= 0.5 else 0.5 / bend
        du = factor * (ax * e[2] - ay * e[1]) / (e[0] * e[2])
        dv = factor * ay / e[2]
        det = t[0] * t[3] - t[1] * t[2]
        ds = factor * (bx * t[3] - by * t[1]) / det
        dt = factor * (by * t[0] - bx * t[2]) / det
        uf, vf, clamped_f = into_domain(table, pool, f, x[0] + du, x[1] + dv)
        ug, vg, clamped_g = into_domain(table, pool, g, x[2] + ds, x[3] + dt)
        status = NOT_CONVERGED
        if clamped_f or clamped_g:
            status = LEFT_PATCH
            # Held at the end of the patch and nothing else moves: the pair has left.
            still = abs(uf - x[0]) + abs(vf - x[1]) + abs(ug - x[2]) + abs(vg - x[3])
            if still <= 1e-12 * (abs(du) + abs(dv) + abs(ds) + abs(dt)):
                return LEFT_PATCH, x, iteration, frame
        x = (uf, vf, ug, vg)
        frame = pair_frame(table, pool, f, g, rotation, shift, x)
        iteration += 1
    return status, x, iteration, frame
