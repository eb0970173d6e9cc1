"""The contact velocity formulation: how an extremal pair moves with its bodies.

With v the velocity of body g less that of body f, both taken at the point g, and omega = w_g - w_f,

    z = (x.v, y.v, x.(omega x n), y.(omega x n))

holds all that matters. Then H a = C z_12 - z_34, b = (I + beta A) a - z_12 are the tangent velocities of the
two contact points over their own surfaces, and u_f' = E^-1 a, u_g' = T^-1 b (paper 001, eqs. 10 to 21, with
the signs that finite differences confirm). The gap's rate is n.v; differentiating it once more needs
only these rates:

    beta'' = a.(A z_12 - (I + beta A) z_34) + z_12.z_34
             + 2 w_f.(n x v) + n.(w_g x (w_g x (g - x_g))) - n.(w_f x (w_f x (g - x_f))).
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.vec import cross, dot, matvec, sub
from assembly.kinematics.motion import quaternion_columns, relative_pose, rotation
from assembly.proximity.extremal import pair_frame, pair_inverse, pair_matrix


@kernel(inline=True)
def tangent_rates(a, c, beta, flat):
    """The (2, 4) map from z to the tangent velocity a, I + beta A, and whether H is regular."""
    k, h, size = pair_matrix(a, c, beta)
    i, regular = pair_inverse(h, size, flat)
    m = (
        i[0] * c[0] + i[1] * c[1],
        i[0] * c[1] + i[1] * c[2],
        -i[0],
        -i[1],
        i[2] * c[0] + i[3] * c[1],
        i[2] * c[1] + i[3] * c[2],
        -i[2],
        -i[3],
    )
    return m, k, regular


@kernel(inline=True)
def store_rates(m, k, a, e, t, rates, form):
    """Write the (4, 4) map from z to parameter rates, and the symmetric (4, 4) form of beta''."""
    ie = 1.0 / (e[0] * e[2])
    it = 1.0 / (t[0] * t[3] - t[1] * t[2])
    for j in range(4):
        ax = m[j]
        ay = m[4 + j]
        bx = k[0] * ax + k[1] * ay - (1.0 if j == 0 else 0.0)
        by = k[1] * ax + k[2] * ay - (1.0 if j == 1 else 0.0)
        rates[j] = ie * (e[2] * ax - e[1] * ay)
        rates[4 + j] = ay / e[2]
        rates[8 + j] = it * (t[3] * bx - t[1] * by)
        rates[12 + j] = it * (t[0] * by - t[2] * bx)
    w = (a[0], a[1], -k[0], -k[1], a[1], a[2], -k[1], -k[2])
    for i in range(4):
        for j in range(i, 4):
            value = 0.5 * (m[i] * w[j] + m[4 + i] * w[4 + j] + m[j] * w[i] + m[4 + j] * w[4 + i])
            if j == i + 2:
                value += 0.5
            form[4 * i + j] = value
            form[4 * j + i] = value


@kernel(inline=True)
def put(row, o, a):
    row[o] = a[0]
    row[o + 1] = a[1]
    row[o + 2] = a[2]


@kernel(inline=True)
def gradient_row(n, arm_f, arm_g, row):
    """The gap's gradient in twists of f, then g: the contact wrench. Arms reach from the bodies' origins to g."""
    put(row, 0, (-n[0], -n[1], -n[2]))
    put(row, 3, cross(n, arm_f))
    put(row, 6, n)
    put(row, 9, cross(arm_g, n))


@kernel(inline=True)
def z_rows(x, y, arm_f, arm_g, z):
    """z as (4, 12) over the twists of f, then g. x, y: tangents in world axes, with n = x cross y."""
    put(z[0], 0, (-x[0], -x[1], -x[2]))
    put(z[0], 3, cross(x, arm_f))
    put(z[0], 6, x)
    put(z[0], 9, cross(arm_g, x))
    put(z[1], 0, (-y[0], -y[1], -y[2]))
    put(z[1], 3, cross(y, arm_f))
    put(z[1], 6, y)
    put(z[1], 9, cross(arm_g, y))
    for j in range(3):
        z[2, j] = 0.0
        z[2, 3 + j] = -y[j]
        z[2, 6 + j] = 0.0
        z[2, 9 + j] = y[j]
        z[3, j] = 0.0
        z[3, 3 + j] = x[j]
        z[3, 6 + j] = 0.0
        z[3, 9 + j] = -x[j]


@kernel(inline=True)
def add_spin(n, arm, factor, out, o, p):
    """out[o.., p..] += factor (sym(n arm^T) - n.arm I): a body's own rotation seen by the gap."""
    s = dot(n, arm)
    for i in range(3):
        for j in range(3):
            out[o + i, p + j] += factor * 0.5 * (n[i] * arm[j] + n[j] * arm[i])
        out[o + i, p + i] -= factor * s


@kernel(inline=True)
def add_cross(n, factor, out, o, p):
    """out[o.., p..] += factor [n]x and the transpose at [p.., o..]."""
    for i in range(3):
        j = (i + 1) % 3
        k = (i + 2) % 3
        # [n]x has -n_k at (i, j) and +n_j at (i, k)
        out[o + i, p + j] -= factor * n[k]
        out[o + i, p + k] += factor * n[j]
        out[p + j, o + i] -= factor * n[k]
        out[p + k, o + i] += factor * n[j]


@kernel
def add_gap_hessian(n, arm_f, arm_g, form, z, factor, out, f, g):
    """Add factor times the gap's Hessian in twists at rows f.. (body f) and g.. (body g) of out.

    A negative f or g is a body that does not move: its block is left out.
    """
    for i in range(12):
        row = f + i if i < 6 else g + i - 6
        if (f if i < 6 else g) < 0:
            continue
        p0 = 0.0
        p1 = 0.0
        p2 = 0.0
        p3 = 0.0
        for k in range(4):
            s = factor * z[k, i]
            p0 += s * form[4 * k]
            p1 += s * form[4 * k + 1]
            p2 += s * form[4 * k + 2]
            p3 += s * form[4 * k + 3]
        if f >= 0:
            for j in range(6):
                out[row, f + j] += p0 * z[0, j] + p1 * z[1, j] + p2 * z[2, j] + p3 * z[3, j]
        if g >= 0:
            for j in range(6):
                out[row, g + j] += p0 * z[0, 6 + j] + p1 * z[1, 6 + j] + p2 * z[2, 6 + j] + p3 * z[3, 6 + j]
    if f >= 0:
        add_spin(n, arm_f, factor, out, f + 3, f + 3)
        add_cross(n, -factor, out, f + 3, f)
    if g >= 0:
        add_spin(n, arm_g, factor, out, g + 3, g + 3)
    if f >= 0 and g >= 0:
        add_cross(n, factor, out, f + 3, g)
        s = dot(n, arm_g)
        for i in range(3):
            for j in range(3):
                value = -factor * arm_g[i] * n[j]
                if i == j:
                    value += factor * s
                out[f + 3 + i, g + 3 + j] += value
                out[g + 3 + j, f + 3 + i] += value


@kernel
def pair_derivatives(table, pool, f, g, q, x, size, jacobian, gradient, hessian):
    """The public derivatives of one pair, all at once: (4, 14), (14,) and (12, 12), world axes.

    Returns the pair's residual (lengths over `size`, and the tilt) and whether everything is regular.
    """
    turn_f = rotation(q, 0)
    turn, shift = relative_pose(q, 0, turn_f, 1, rotation(q, 1))
    n, tx, ty, _pf, pg, e, t, a, c, r, beta, regular = pair_frame(table, pool, f, g, turn, shift, x)
    error = max(abs(r[0]), abs(r[1])) / size + max(abs(r[2]), abs(r[3]))
    if not regular:
        return error, False
    m, k, isolated = tangent_rates(a, c, beta, 1e-9 / size)
    rates = np.empty(16)
    form = np.empty(16)
    z = np.empty((4, 12))
    row = np.empty(12)
    store_rates(m, k, a, e, t, rates, form)
    normal = matvec(turn_f, n)
    arm_f = matvec(turn_f, pg)
    arm_g = matvec(turn_f, sub(pg, shift))
    z_rows(matvec(turn_f, tx), matvec(turn_f, ty), arm_f, arm_g, z)
    gradient_row(normal, arm_f, arm_g, row)
    into_quaternions(row, q, gradient)
    for i in range(4):
        for j in range(12):
            row[j] = 0.0
            for l in range(4):
                row[j] += rates[4 * i + l] * z[l, j]
        into_quaternions(row, q, jacobian[i])
    hessian[:, :] = 0.0
    add_gap_hessian(normal, arm_f, arm_g, form, z, 1.0, hessian, 0, 6)
    return error, isolated


@kernel(inline=True)
def into_quaternions(row, q, out):
    """A row over the twists of two bodies as a row over (q_f, q_g), (14,)."""
    for b in range(2):
        for k in range(3):
            out[7 * b + k] = row[6 * b + k]
        w = (row[6 * b + 3], row[6 * b + 4], row[6 * b + 5])
        out[7 * b + 3], out[7 * b + 4], out[7 * b + 5], out[7 * b + 6] = quaternion_columns(
            w, q[b, 3], q[b, 4], q[b, 5], q[b, 6]
        )
