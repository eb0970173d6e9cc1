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
# Newton's steps: four or five near a solution, more while steps are cut.
LIMIT = 40
# The most, in radians, that a step may turn a normal.
BEND = 0.5
# A step that turns the normals by less leaves an error below rounding when a solve carries the frame along it.
CLOSE = 1e-6


@kernel(inline=True)
def pole_normal(fu, fv, fuv):
    """The limit of fu x fv where one of them vanishes, along the other parameter."""
    return cross(fuv, fv) if dot(fu, fu) <= dot(fv, fv) else cross(fu, fuv)


@kernel(inline=True)
def shape_operator(p, q, r, s, luu, luv, lvv):
    """-J^T L J for J = [[p, q], [r, s]], the inverse of tangent coordinates, and L_ij = S_ij.n: symmetric, +1/r on a ball."""
    a = luu * p + luv * r
    b = luv * p + lvv * r
    return (
        -(p * a + r * b),
        -(q * a + s * b),
        -(q * (luu * q + luv * s) + s * (luv * q + lvv * s)),
    )


@kernel(inline=True)
def pair_frame(table, pool, f, g, rotation, shift, x):
    """Everything about a pair at parameters x = (u_f, v_f, u_g, v_g), in the axes of body f.

    Returns
    -------
    n, tx, ty : normal of f and its tangent frame, [f_u f_v] = [tx ty] E
    pf, pg : the two points
    e : (11, 12, 22) of E^-1, which is upper triangular
    t : (11, 12, 21, 22) of T^-1
    a, c : shape operators (11, 12, 22) of f and g with respect to n
    r : (r1x, r1y, r2x, r2y), residual
    beta : n.(pg - pf)
    regular : whether both parameterizations are regular here; where not, e, t, a, c and r2 are zero
    """
    pf, fu, fv, fuu, fuv, fvv = surface_point(table, pool, f, x[0], x[1])
    qg, gu, gv, guu, guv, gvv = surface_point(table, pool, g, x[2], x[3])
    sign = float(table[f + SIGN])
    pg = add(matvec(rotation, qg), shift)
    d = sub(pg, pf)
    normal = cross(fu, fv)
    uu = dot(fu, fu)
    nn = dot(normal, normal)
    regular = nn > POLE * POLE * uu * dot(fv, fv) and nn > 1e-290
    if not regular:
        normal = pole_normal(fu, fv, fuv)
        nn = dot(normal, normal)
        if not nn > 0.0:
            nn = 1.0
    length = math.sqrt(nn)
    n = scale(sign / length, normal)
    if uu > 1e-290:
        i11 = 1.0 / math.sqrt(uu)
        tx = scale(i11, fu)
    else:
        i11 = 0.0
        tx = scale(1.0 / math.sqrt(dot(fv, fv)), cross(fv, n))
    ty = cross(n, tx)
    # |fu x fv| = e11 e22.
    i22 = sign * uu * i11 / length
    i12 = -dot(tx, fv) * i11 * i22
    # The normal and the frame go to the axes of g, rather than six derivatives to those of f.
    ng = matvec_t(rotation, n)
    xg = matvec_t(rotation, tx)
    yg = matvec_t(rotation, ty)
    t11 = dot(xg, gu)
    t12 = dot(xg, gv)
    t21 = dot(yg, gu)
    t22 = dot(yg, gv)
    det = t11 * t22 - t12 * t21
    regular = regular and det * det > POLE * POLE * dot(gu, gu) * dot(gv, gv) and abs(det) > 1e-145
    i = 1.0 / det if regular else 0.0
    if not regular:
        i11 = 0.0
        i12 = 0.0
        i22 = 0.0
    e = (i11, i12, i22)
    t = (i * t22, -i * t12, -i * t21, i * t11)
    a = shape_operator(i11, i12, 0.0, i22, dot(fuu, n), dot(fuv, n), dot(fvv, n))
    c = shape_operator(t[0], t[1], t[2], t[3], dot(guu, ng), dot(guv, ng), dot(gvv, ng))
    # m = n + P r2 is orthogonal to gu and gv: T^T r2 = -(n.gu, n.gv).
    nu = dot(ng, gu)
    nv = dot(ng, gv)
    r = (dot(tx, d), dot(ty, d), -(t[0] * nu + t[2] * nv), -(t[1] * nu + t[3] * nv))
    return n, tx, ty, pf, pg, e, t, a, c, r, dot(n, d), regular


@kernel(inline=True)
def curvature_bound(a):
    """A bound of the largest principal curvature."""
    return abs(a[0]) + 2.0 * abs(a[1]) + abs(a[2])


@kernel(inline=True)
def pair_matrix(a, c, beta, flat):
    """I + beta A, H = C (I + beta A) - A, the inverse of H, and whether H is regular.

    Where H is (nearly) singular the inverse is damped: the least step, so that the current pair of a continuum is kept.
    `flat` is the curvature below which a scene counts as flat.
    """
    k11 = 1.0 + beta * a[0]
    k12 = beta * a[1]
    k22 = 1.0 + beta * a[2]
    h11 = c[0] * k11 + c[1] * k12 - a[0]
    h12 = c[0] * k12 + c[1] * k22 - a[1]
    h21 = c[1] * k11 + c[2] * k12 - a[1]
    h22 = c[1] * k12 + c[2] * k22 - a[2]
    size = curvature_bound(c) * (abs(k11) + 2.0 * abs(k12) + abs(k22)) + curvature_bound(a)
    det = h11 * h22 - h12 * h21
    norm = abs(h11) + abs(h12) + abs(h21) + abs(h22)
    # The smallest singular value is at least |det| / norm.
    regular = abs(det) > RANK * size * norm and size > flat
    if abs(det) > 100.0 * RANK * size * norm and size > flat:
        i = 1.0 / det
        inverse = (i * h22, -i * h12, -i * h21, i * h11)
    else:
        damping = max(RANK * size, flat)
        damping *= damping
        # (H^T H + damping I)^-1 H^T
        m11 = h11 * h11 + h21 * h21 + damping
        m12 = h11 * h12 + h21 * h22
        m22 = h12 * h12 + h22 * h22 + damping
        i = 1.0 / (m11 * m22 - m12 * m12)
        inverse = (
            i * (m22 * h11 - m12 * h12),
            i * (m22 * h21 - m12 * h22),
            i * (m11 * h12 - m12 * h11),
            i * (m11 * h22 - m12 * h21),
        )
    return (k11, k12, k22), (h11, h12, h21, h22), inverse, regular


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


@kernel(inner=True)
def solve_pair(table, pool, f, g, rotation, shift, x, size, turn, close):
    """Newton from x to the extremal pair; returns status, parameters, iterations, frame, and H as `pair_matrix` gives it.

    `size` is the length against which steps are measured. A step that would turn a normal by more than `BEND` is
    shortened, so that the iteration follows the surface; one that would turn it by more than `turn` says that x was not
    near a pair at all. After a step that turns it by less than `close` the frame is carried along, not evaluated again:
    what is left is of the order of close^2, and of close^3 in the gap.
    """
    tolerance = 4e-14 * size
    flat = 1e-9 / size
    previous = 1e300
    status = NOT_CONVERGED
    iteration = 0
    while True:
        n, tx, ty, pf, pg, e, t, a, c, r, beta, regular = pair_frame(table, pool, f, g, rotation, shift, x)
        k, h, inverse, isolated = pair_matrix(a, c, beta, flat)
        if not regular:
            # A pole: nothing better than the point itself when d is already normal there.
            status = SINGULAR if r[0] * r[0] + r[1] * r[1] <= tolerance * tolerance else NOT_CONVERGED
            break
        s0 = c[0] * r[0] + c[1] * r[1] - r[2]
        s1 = c[1] * r[0] + c[2] * r[1] - r[3]
        ax = inverse[0] * s0 + inverse[1] * s1
        ay = inverse[2] * s0 + inverse[3] * s1
        bx = k[0] * ax + k[1] * ay - r[0]
        by = k[1] * ax + k[2] * ay - r[1]
        step_f = abs(ax) + abs(ay)
        step_g = abs(bx) + abs(by)
        step = max(step_f, step_g)
        bend = max(max(step_f * curvature_bound(a), step_g * curvature_bound(c)), 2.0 * step / size)
        small = bend < close and isolated
        if step <= tolerance or (step < 1e-9 * size and step > 0.25 * previous):
            # In a singular system a vanishing step is a solution only if the residual vanishes too.
            done = abs(r[2]) + abs(r[3]) < 1e-9 and abs(r[0]) + abs(r[1]) < 1e-9 * size
            status = CONVERGED if isolated else (SINGULAR if done else NOT_CONVERGED)
            break
        if iteration == LIMIT or not step < 1e300 or bend > turn:
            break
        previous = step
        factor = 1.0 if bend <= BEND else BEND / bend
        du = factor * (e[0] * ax + e[1] * ay)
        dv = factor * e[2] * ay
        ds = factor * (t[0] * bx + t[1] * by)
        dt = factor * (t[2] * bx + t[3] * by)
        uf, vf, clamped_f = into_domain(table, pool, f, x[0] + du, x[1] + dv)
        ug, vg, clamped_g = into_domain(table, pool, g, x[2] + ds, x[3] + dt)
        status = NOT_CONVERGED
        if clamped_f or clamped_g:
            status = LEFT_PATCH
            # Held at the end of the patch and nothing else moves: the pair has left.
            still = abs(uf - x[0]) + abs(vf - x[1]) + abs(ug - x[2]) + abs(vg - x[3])
            if still <= 1e-12 * (abs(du) + abs(dv) + abs(ds) + abs(dt)):
                break
        elif small:
            wx = a[0] * ax + a[1] * ay
            wy = a[1] * ax + a[2] * ay
            beta += 0.5 * (r[0] * wx + r[1] * wy - r[2] * bx - r[3] * by)
            pf = add(pf, blend(ax, tx, ay, ty))
            pg = add(pg, blend(bx, tx, by, ty))
            lean = blend(wx, tx, wy, ty)
            tx = sub(tx, scale(wx, n))
            ty = sub(ty, scale(wy, n))
            n = add(n, lean)
            x = (uf, vf, ug, vg)
            status = CONVERGED
            iteration += 1
            break
        x = (uf, vf, ug, vg)
        iteration += 1
    return status, x, iteration, (n, tx, ty, pf, pg, e, t, a, c, r, beta, regular), (k, h, inverse, isolated)
