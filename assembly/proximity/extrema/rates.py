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

from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of
from assembly.geometry.vec import cross, dot, matvec, neg, scale, sub
from assembly.kinematics.motion import quaternion_columns

# What the derivatives of one gap need, in world axes.
GAP_DERIVATIVES = record_dtype(
    "f8",
    gap=1,  # signed [length]
    normal=3,  # unit normal from f towards g
    arm_f=3,  # from the origin of body f to the point of g [length]
    arm_g=3,  # from the origin of body g to the point of g [length]
    rates=(4, 4),  # map from z to rates of the parameters (u_f, v_f, u_g, v_g)
    form=(4, 4),  # beta'' is z.(form z), apart from terms of rotation
    zed=(4, 12),  # z over the twists of f, then g
)
derivatives_at = record_view(GAP_DERIVATIVES)
GAP = place_of(GAP_DERIVATIVES, "gap")
NORMAL = place_of(GAP_DERIVATIVES, "normal")
ARM_F = place_of(GAP_DERIVATIVES, "arm_f")
ARM_G = place_of(GAP_DERIVATIVES, "arm_g")
RATES = place_of(GAP_DERIVATIVES, "rates")
ZED = place_of(GAP_DERIVATIVES, "zed")
RECORD = size_of(GAP_DERIVATIVES)


@kernel(inline=True)
def load_row(array, row, o):
    return (array[row, o], array[row, o + 1], array[row, o + 2])


@kernel(inline=True)
def put_row(array, row, o, a):
    array[row, o] = a[0]
    array[row, o + 1] = a[1]
    array[row, o + 2] = a[2]


@kernel(inline=True)
def store_velocities(x, y, arm_f, arm_g, records, row):
    """z over the twists: x.v, y.v, and (x, y).(omega x n) = (y.omega, -x.omega)."""
    put_row(records, row, ZED, neg(x))
    put_row(records, row, ZED + 3, cross(x, arm_f))
    put_row(records, row, ZED + 6, x)
    put_row(records, row, ZED + 9, cross(arm_g, x))
    put_row(records, row, ZED + 12, neg(y))
    put_row(records, row, ZED + 15, cross(y, arm_f))
    put_row(records, row, ZED + 18, y)
    put_row(records, row, ZED + 21, cross(arm_g, y))
    zero = (0.0, 0.0, 0.0)
    put_row(records, row, ZED + 24, zero)
    put_row(records, row, ZED + 27, neg(y))
    put_row(records, row, ZED + 30, zero)
    put_row(records, row, ZED + 33, y)
    put_row(records, row, ZED + 36, zero)
    put_row(records, row, ZED + 39, x)
    put_row(records, row, ZED + 42, zero)
    put_row(records, row, ZED + 45, neg(x))


@kernel(inner=True)
def feature_record(turn, shift, frame, offset, records, row):
    """Fill a record from the frame of two features in the axes of body f, whose rotation is `turn`; g is at `shift`.

    The offset is X + beta Y of f (`feature_jets.offset_side`).
    """
    derivatives = derivatives_at(records, row)
    f, g, i = frame.side_f, frame.side_g, frame.response
    of_f, of_g = frame.rates_f, frame.rates_g
    x = matvec(turn, frame.tangent_x)
    y = matvec(turn, frame.tangent_y)
    arm_f = matvec(turn, frame.point_g)
    arm_g = matvec(turn, sub(frame.point_g, shift))
    derivatives.gap = frame.gap
    put_row(records, row, NORMAL, matvec(turn, frame.normal))
    put_row(records, row, ARM_F, arm_f)
    put_row(records, row, ARM_G, arm_g)
    store_velocities(x, y, arm_f, arm_g, records, row)
    # s = S z, S = H^-1 [Y_g^T, -X_g^T].
    m = (
        i[0] * g.y11 + i[1] * g.y12,
        i[0] * g.y21 + i[1] * g.y22,
        -i[0] * g.x11 - i[1] * g.x12,
        -i[0] * g.x21 - i[1] * g.x22,
        i[2] * g.y11 + i[3] * g.y12,
        i[2] * g.y21 + i[3] * g.y22,
        -i[2] * g.x11 - i[3] * g.x12,
        -i[2] * g.x21 - i[3] * g.x22,
    )
    v11, v12, v21, v22 = offset
    w = (f.y11, f.y21, -v11, -v21, f.y12, f.y22, -v12, -v22)
    for j in range(4):
        s0 = m[j]
        s1 = m[4 + j]
        ax = f.x11 * s0 + f.x12 * s1
        ay = f.x21 * s0 + f.x22 * s1
        bx = v11 * s0 + v12 * s1 - (1.0 if j == 0 else 0.0)
        by = v21 * s0 + v22 * s1 - (1.0 if j == 1 else 0.0)
        derivatives.rates[0, j] = of_f[0] * ax + of_f[1] * ay
        derivatives.rates[1, j] = of_f[2] * ax + of_f[3] * ay
        derivatives.rates[2, j] = of_g[0] * bx + of_g[1] * by
        derivatives.rates[3, j] = of_g[2] * bx + of_g[3] * by
        for l in range(4):
            # s.(Y_f^T z1 - (X_f + beta Y_f)^T z2), made symmetric; z1.z2 adds a half off the diagonal.
            value = 0.5 * (s0 * w[l] + s1 * w[4 + l] + m[l] * w[j] + m[4 + l] * w[4 + j])
            derivatives.form[j, l] = value + (0.5 if l == j + 2 or j == l + 2 else 0.0)


@kernel(inline=True)
def gradient_row(records, row, out, r):
    """The gap's gradient in the twists of f, then g, into out[r]: the contact wrench."""
    n = load_row(records, row, NORMAL)
    put_row(out, r, 0, scale(-1.0, n))
    put_row(out, r, 3, cross(n, load_row(records, row, ARM_F)))
    put_row(out, r, 6, n)
    put_row(out, r, 9, cross(load_row(records, row, ARM_G), n))


@kernel(inline=True)
def add_spin(n, arm, factor, out, o):
    """out[o.., o..] += factor (sym(n arm^T) - n.arm I): a body's own rotation seen by the gap."""
    s = factor * dot(n, arm)
    for i in range(3):
        for j in range(3):
            out[o + i, o + j] += factor * 0.5 * (n[i] * arm[j] + n[j] * arm[i])
        out[o + i, o + i] -= s


@kernel(inline=True)
def add_cross(n, factor, out, o, p):
    """out[o.., p..] += factor [n]x, and the transpose at [p.., o..]."""
    for i in range(3):
        j = (i + 1) % 3
        k = (i + 2) % 3
        # [n]x has -n_k at (i, j) and +n_j at (i, k).
        out[o + i, p + j] -= factor * n[k]
        out[p + j, o + i] -= factor * n[k]
        out[o + i, p + k] += factor * n[j]
        out[p + k, o + i] += factor * n[j]


@kernel(inner=True)
def add_gap_terms(records, jacobian, r, factor, weight, out, f, g):
    """Upper triangle of out += factor (Hessian of the gap) + weight (gradient gradient^T), twists at f.. and g...

    A negative f or g is a body that does not move: its block is left out.
    """
    derivatives = derivatives_at(records, r)
    for i in range(12):
        if (f if i < 6 else g) < 0:
            continue
        p0 = 0.0
        p1 = 0.0
        p2 = 0.0
        p3 = 0.0
        for k in range(4 if factor != 0.0 else 0):
            s = factor * derivatives.zed[k, i]
            p0 += s * derivatives.form[k, 0]
            p1 += s * derivatives.form[k, 1]
            p2 += s * derivatives.form[k, 2]
            p3 += s * derivatives.form[k, 3]
        w = weight * jacobian[r, i]
        for j in range(i, 12 if g >= 0 else 6):
            value = (
                p0 * derivatives.zed[0, j]
                + p1 * derivatives.zed[1, j]
                + p2 * derivatives.zed[2, j]
                + p3 * derivatives.zed[3, j]
                + w * jacobian[r, j]
            )
            if i >= 6:
                out[g + i - 6, g + j - 6] += value
            elif j < 6:
                out[f + i, f + j] += value
            elif f < g:
                out[f + i, g + j - 6] += value
            else:
                out[g + j - 6, f + i] += value
    if factor == 0.0:
        return
    n = load_row(records, r, NORMAL)
    arm_f = load_row(records, r, ARM_F)
    arm_g = load_row(records, r, ARM_G)
    if f >= 0:
        add_spin(n, arm_f, factor, out, f + 3)
        add_cross(n, -factor, out, f + 3, f)
    if g >= 0:
        add_spin(n, arm_g, factor, out, g + 3)
    if f >= 0 and g >= 0:
        add_cross(n, factor, out, f + 3, g)
        s = factor * dot(n, arm_g)
        for i in range(3):
            for j in range(3):
                value = (s if i == j else 0.0) - factor * arm_g[i] * n[j]
                out[f + 3 + i, g + 3 + j] += value
                out[g + 3 + j, f + 3 + i] += value


@kernel(inline=True)
def into_quaternions(row, q, out, r):
    """Convert a row over the twists of two bodies to one over (q_f, q_g), into row r of out."""
    for b in range(2):
        for k in range(3):
            out[r, 7 * b + k] = row[6 * b + k]
        w = (row[6 * b + 3], row[6 * b + 4], row[6 * b + 5])
        out[r, 7 * b + 3], out[r, 7 * b + 4], out[r, 7 * b + 5], out[r, 7 * b + 6] = quaternion_columns(
            w, q[b, 3], q[b, 4], q[b, 5], q[b, 6]
        )
