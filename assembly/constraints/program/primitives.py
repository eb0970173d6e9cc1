"""The coordinates of which all joints are made: frame b, on body g, relative to frame a, on body f.

    COINCIDENT k      world axis k of d = p_b - p_a
    SLIDE k           (axis k of a) . d
    DISTANCE          |d|
    DOT 3 k + l       (axis k of a) . (axis l of b)
    SWING k           theta (axis k of a . z_b) / sin(theta), theta the angle between z_a and z_b; k in (0, 1)
    TURN              atan2(y_a.x_b - x_a.y_b, x_a.x_b + y_a.y_b), the turn of b about z_a
    AZIMUTH l         atan2(y_a.v, x_a.v), v the axis l of b
    ANGLE             theta
    RADIUS            |d - (z_a.d) z_a|, how far the origin of b is from the z axis of a

For u fixed to f and v fixed to g, the rate of u.v is (w_g - w_f).(v x u). So an angular coordinate has the gradient
(-h, h) in the angular velocities, and its second derivative is K in (f, f) and (g, g) and [h]x / 2 - K in (f, g), with
a symmetric K that for u.v is sym(u v^T) - u.v I. Where a direction is undefined, one is chosen, and curvatures are
limited to those a little away from there: values and derivatives are finite everywhere.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of
from assembly.geometry.vec import add, blend, cross, dot, matvec, scale, sub
from assembly.kinematics.motion import rotation
from assembly.proximity.extrema.rates import load_row, put_row

COINCIDENT, SLIDE, DISTANCE, DOT, SWING, TURN, AZIMUTH, ANGLE, RADIUS = 0, 1, 2, 3, 4, 5, 6, 7, 8
# A coordinate's value, and n, arm_f, arm_g, h of its gradient -(n, arm_f x n + h), (n, arm_g x n + h).
Coordinate = namedtuple("Coordinate", "value n arm_f arm_g h")
# What `swing` returns; the names are those of the formulas there, `rate` is phi', `second` is phi'' u.z_b.
Swing = namedtuple("Swing", "value u hu p phi j m rate second")
# h, and K = sym(a b^T) + sym(c d^T) - t I, of an angular coordinate.
TurningForm = namedtuple("TurningForm", "h a b c d t")
# A joint's frames in the pool: p_a, x_a, y_a, z_a, p_b, x_b, y_b, z_b, each in the axes of its body.
FRAMES = 24
# A joint at poses, in world axes; lengths over the scene's size.
JOINT_FRAMES = record_dtype(
    "f8",
    arm_a=3,  # R_f p_a
    axes_a=(3, 3),  # x, y, z of frame a
    arm_b=3,  # R_g p_b
    axes_b=(3, 3),  # of frame b
    apart=3,  # d, from the origin of a to that of b
)
joint_frames_at = record_view(JOINT_FRAMES)
ARM_A = place_of(JOINT_FRAMES, "arm_a")
AXES_A = place_of(JOINT_FRAMES, "axes_a")
ARM_B = place_of(JOINT_FRAMES, "arm_b")
AXES_B = place_of(JOINT_FRAMES, "axes_b")
APART = place_of(JOINT_FRAMES, "apart")
RECORD = size_of(JOINT_FRAMES)

# A vector shorter than this [over the size of the scene, if a length] is rounding error, and so is its direction.
UNDEFINED = 1e-12
# The same for the distance from an axis. It is below a solve's tolerance, so that a ball that is drawn onto the axis of
# a funnel, where it touches all around, gets there. Roundings of coordinates of size one are a hundredth of it.
ON_AXIS = 1e-14
# The least distance, and sine of an angle, by which the curvatures of DISTANCE, RADIUS and ANGLE are divided.
LEAST_DIVISOR = 1e-6
# The same for SWING where the axes are opposed: its gradient grows there, too.
OPPOSED = 1e-3
# The slope of TURN is limited to that where |z_a + z_b| is this, the slope of AZIMUTH to that where the sine between v
# and z_a is. Nearer to its pole neither has curvature. At the pole, to rounding, each is undefined and keeps its value.
POLE = 1e-6
# SWING is a series in 1 - cos(theta) below this.
SERIES = 1e-3
ZERO = (0.0, 0.0, 0.0)


@kernel(inner=True)
def place_frames(pool, o, q, i, j, records, k):
    """The frames at pool[o] on bodies i and j into records[k]."""
    frames = joint_frames_at(records, k)
    turn = rotation(q, i)
    for l in range(4):
        put_row(records, k, ARM_A + 3 * l, matvec(turn, (pool[o + 3 * l], pool[o + 3 * l + 1], pool[o + 3 * l + 2])))
    turn = rotation(q, j)
    o += 12
    for l in range(4):
        put_row(records, k, ARM_B + 3 * l, matvec(turn, (pool[o + 3 * l], pool[o + 3 * l + 1], pool[o + 3 * l + 2])))
    for l in range(3):
        # The positions are subtracted first: a common offset cancels.
        frames.apart[l] = (q[j, l] - q[i, l]) + (frames.arm_b[l] - frames.arm_a[l])


@kernel(inline=True)
def world_axis(component, length):
    x = length if component == 0 else 0.0
    y = length if component == 1 else 0.0
    return (x, y, length if component == 2 else 0.0)


@kernel(inline=True)
def distance_direction(records, k):
    d = load_row(records, k, APART)
    length = math.sqrt(dot(d, d))
    n = load_row(records, k, AXES_A + 6)
    if length > UNDEFINED:
        n = scale(1.0 / length, d)
    return length, n


@kernel(inline=True)
def radial_direction(records, k):
    """How far the origin of b is from the z axis of a, and the unit vector that points there from the axis."""
    d = load_row(records, k, APART)
    axis = load_row(records, k, AXES_A)
    side = load_row(records, k, AXES_A + 3)
    # From the two components across the axis: the component of d along it may be longer by far.
    x = dot(axis, d)
    y = dot(side, d)
    length = math.sqrt(x * x + y * y)
    n = axis
    if length > ON_AXIS:
        n = blend(x / length, axis, y / length, side)
    return length, n


@kernel(inline=True)
def tilt(records, k):
    """cos(theta), sin(theta) and the unit vector along z_a x z_b."""
    z = load_row(records, k, AXES_A + 6)
    v = load_row(records, k, AXES_B + 6)
    across = cross(z, v)
    c = dot(z, v)
    s = math.sqrt(dot(across, across))
    n = load_row(records, k, AXES_A + 3)  # z_a x x_a: as if z_b had left the axis toward x_a
    if s > UNDEFINED:
        n = scale(1.0 / s, across)
    return c, s, n


@kernel(inline=True)
def swing(component, records, k):
    """The value phi(c) u.z_b of a swing, phi = theta / sin(theta) as a function of c = cos(theta), and its parts.

    Its gradient is phi hu + j p, with hu = z_b x u and p along z_b x z_a; its second derivative takes
    sym((phi u + m z_a) z_b^T) and 2 e sym(hu p^T) + w p p^T. In the series p = z_b x z_a, m = j = phi' u.z_b,
    e = phi', w = phi'' u.z_b; elsewhere p has unit length, because z_b x z_a / sin(theta) is finite.
    """
    u = load_row(records, k, AXES_A + 3 * component)
    v = load_row(records, k, AXES_B + 6)
    z = load_row(records, k, AXES_A + 6)
    a = dot(u, v)
    hu = cross(v, u)
    x = 1.0 - dot(z, v)
    if x < SERIES:
        # phi = sum_n x^n prod_{i <= n} i / (2 i + 1): arcsin(y) / (y sqrt(1 - y^2)) with y^2 = x / 2.
        phi = 1.0 + x * (1 / 3 + x * (2 / 15 + x * (2 / 35 + x * (8 / 315))))
        e = -(1 / 3 + x * (4 / 15 + x * (6 / 35 + x * (32 / 315 + x * (40 / 693)))))
        second = 4 / 15 + x * (12 / 35 + x * (96 / 315 + x * (160 / 693)))
        return Swing(phi * a, u, hu, cross(v, z), phi, e * a, e * a, e, second * a)
    c, s, n = tilt(records, k)
    theta = math.atan2(s, c)
    along = 1.0 if component == 0 else 0.0
    if s > UNDEFINED:
        along = a / s
    steep = 1.0 / max(s, OPPOSED)
    phi = theta * steep
    # sin^2 phi' = c phi - 1 and sin^2 phi'' = phi + 3 c phi', with the sines shared among the factors.
    j = along * (c * phi - 1.0)
    e = steep * (c * phi - 1.0)
    w = along * (s * phi + 3.0 * c * e)
    return Swing(theta * along, u, hu, scale(-1.0, n), phi, j, steep * j, e, w)


@kernel(inline=True)
def unwrap(angle, near):
    return angle + 2.0 * math.pi * math.floor((near - angle) / (2.0 * math.pi) + 0.5)


@kernel(inner=True)
def coordinate(kind, component, records, k, near):
    """A coordinate and its gradient. Of the values of a TURN or an AZIMUTH it is the one within pi of `near`."""
    value = near
    n = ZERO
    d = ZERO
    h = ZERO
    if kind == COINCIDENT:
        value = joint_frames_at(records, k).apart[component]
        n = world_axis(component, 1.0)
    elif kind == SLIDE:
        n = load_row(records, k, AXES_A + 3 * component)
        d = load_row(records, k, APART)
        value = dot(n, d)
    elif kind == SWING:
        part = swing(component, records, k)
        value = part.value
        h = blend(part.phi, part.hu, part.j, part.p)
    elif kind == TURN:
        x = load_row(records, k, AXES_A)
        y = load_row(records, k, AXES_A + 3)
        xb = load_row(records, k, AXES_B)
        yb = load_row(records, k, AXES_B + 3)
        # h = (z_a + z_b) / (1 + z_a.z_b), and 1 + z_a.z_b = |z_a + z_b|^2 / 2.
        m = add(load_row(records, k, AXES_A + 6), load_row(records, k, AXES_B + 6))
        length = math.sqrt(dot(m, m))
        if length > UNDEFINED:
            value = unwrap(math.atan2(dot(y, xb) - dot(x, yb), dot(x, xb) + dot(y, yb)), near)
            h = scale(2.0 / (length * max(length, POLE)), m)
    elif kind == DOT:
        u = load_row(records, k, AXES_A + 3 * (component // 3))
        v = load_row(records, k, AXES_B + 3 * (component % 3))
        value = dot(u, v)
        h = cross(v, u)
    elif kind == AZIMUTH:
        v = load_row(records, k, AXES_B + 3 * component)
        across = cross(load_row(records, k, AXES_A + 6), v)
        sine = math.sqrt(dot(across, across))
        if sine > UNDEFINED:
            value = unwrap(
                math.atan2(dot(load_row(records, k, AXES_A + 3), v), dot(load_row(records, k, AXES_A), v)), near
            )
            h = scale(1.0 / (sine * max(sine, POLE)), cross(v, across))
    elif kind == ANGLE:
        c, s, h = tilt(records, k)
        value = math.atan2(s, c)
    elif kind == RADIUS:
        # As SLIDE, along the radial direction, which turns with f.
        value, n = radial_direction(records, k)
        d = load_row(records, k, APART)
    else:
        value, n = distance_direction(records, k)
    # `records` is used last where the branches meet: else Numba counts references to it, which costs half a row.
    arm_f = add(load_row(records, k, ARM_A), d)
    arm_g = load_row(records, k, ARM_B)
    return Coordinate(value, n, arm_f, arm_g, h)


@kernel(inline=True)
def write_gradient(n, arm_f, arm_g, h, factor, jacobian, r, column):
    """jacobian[r, column : column + 12] = factor (-(n, arm_f x n + h), (n, arm_g x n + h))."""
    n = scale(factor, n)
    h = scale(factor, h)
    put_row(jacobian, r, column, scale(-1.0, n))
    put_row(jacobian, r, column + 3, sub(cross(n, arm_f), h))
    put_row(jacobian, r, column + 6, n)
    put_row(jacobian, r, column + 9, add(cross(arm_g, n), h))


@kernel(inline=True)
def add_block(hessian, r, c, m):
    """hessian[r : r + 3, c : c + 3] += m, nine numbers."""
    hessian[r, c] += m[0]
    hessian[r, c + 1] += m[1]
    hessian[r, c + 2] += m[2]
    hessian[r + 1, c] += m[3]
    hessian[r + 1, c + 1] += m[4]
    hessian[r + 1, c + 2] += m[5]
    hessian[r + 2, c] += m[6]
    hessian[r + 2, c + 1] += m[7]
    hessian[r + 2, c + 2] += m[8]


@kernel(inline=True)
def symmetric(a, b, c, d, t):
    """sym(a b^T) + sym(c d^T) - t I."""
    xy = 0.5 * (a[0] * b[1] + a[1] * b[0] + c[0] * d[1] + c[1] * d[0])
    xz = 0.5 * (a[0] * b[2] + a[2] * b[0] + c[0] * d[2] + c[2] * d[0])
    yz = 0.5 * (a[1] * b[2] + a[2] * b[1] + c[1] * d[2] + c[2] * d[1])
    xx = a[0] * b[0] + c[0] * d[0] - t
    yy = a[1] * b[1] + c[1] * d[1] - t
    return (xx, xy, xz, xy, yy, yz, xz, yz, a[2] * b[2] + c[2] * d[2] - t)


@kernel(inline=True)
def general(a, b, c, d, h, t):
    """a b^T + c d^T + [h]x + t I."""
    return (
        a[0] * b[0] + c[0] * d[0] + t,
        a[0] * b[1] + c[0] * d[1] - h[2],
        a[0] * b[2] + c[0] * d[2] + h[1],
        a[1] * b[0] + c[1] * d[0] + h[2],
        a[1] * b[1] + c[1] * d[1] + t,
        a[1] * b[2] + c[1] * d[2] - h[0],
        a[2] * b[0] + c[2] * d[0] - h[1],
        a[2] * b[1] + c[2] * d[1] + h[0],
        a[2] * b[2] + c[2] * d[2] + t,
    )


@kernel(inner=True)
def add_stretch(hessian, a, b, r, t, n, w):
    """w (dp . dp' - (n.dp) (n.dp')) for the rates dp, dp' of points at arms r, t of the twists at a, b (a <= b)."""
    rn = cross(r, n)
    tn = cross(t, n)
    wn = scale(w, n)
    add_block(hessian, a, b, general(scale(-1.0, wn), n, ZERO, ZERO, ZERO, w))
    add_block(hessian, a, b + 3, general(scale(-1.0, wn), tn, ZERO, ZERO, scale(-w, t), 0.0))
    if a < b:
        add_block(hessian, a + 3, b, general(scale(-w, rn), n, ZERO, ZERO, scale(w, r), 0.0))
    add_block(hessian, a + 3, b + 3, general(scale(-w, t), r, scale(-w, rn), tn, ZERO, w * dot(r, t)))


@kernel(inner=True)
def add_slope(hessian, a, b, r, t, n, w):
    """w (n.dp) (n.dp') for the rates dp, dp' of points at arms r, t of the twists at a, b (a <= b)."""
    rn = scale(w, cross(r, n))
    tn = cross(t, n)
    wn = scale(w, n)
    add_block(hessian, a, b, general(wn, n, ZERO, ZERO, ZERO, 0.0))
    add_block(hessian, a, b + 3, general(wn, tn, ZERO, ZERO, ZERO, 0.0))
    if a < b:
        add_block(hessian, a + 3, b, general(rn, n, ZERO, ZERO, ZERO, 0.0))
    add_block(hessian, a + 3, b + 3, general(rn, tn, ZERO, ZERO, ZERO, 0.0))


@kernel(inner=True)
def add_around(records, k, y, hessian, f, g):
    """The part of RADIUS's second derivative from its changing direction: the square of the rate around the axis."""
    length, n = radial_direction(records, k)
    around = cross(load_row(records, k, AXES_A + 6), n)
    arm_f = add(load_row(records, k, ARM_A), load_row(records, k, APART))
    arm_g = load_row(records, k, ARM_B)
    w = y / max(length, LEAST_DIVISOR)
    if f >= 0:
        add_slope(hessian, f, f, arm_f, arm_f, around, w)
    if g >= 0:
        add_slope(hessian, g, g, arm_g, arm_g, around, w)
    if f >= 0 and g >= 0:
        if f < g:
            add_slope(hessian, f, g, arm_f, arm_g, around, -w)
        else:
            add_slope(hessian, g, f, arm_g, arm_f, around, -w)


@kernel(inline=True)
def add_point_terms(kind, component, records, k, y, hessian, f, g):
    """`add_coordinate_hessian` of COINCIDENT, SLIDE, RADIUS and DISTANCE."""
    arm_f = load_row(records, k, ARM_A)
    arm_g = load_row(records, k, ARM_B)
    if kind == SLIDE or kind == RADIUS:
        n = load_row(records, k, AXES_A + 3 * component)
        if kind == RADIUS:
            _length, n = radial_direction(records, k)
            add_around(records, k, y, hessian, f, g)
        n = scale(y, n)
        arm_f = add(arm_f, load_row(records, k, APART))
        if f >= 0:
            # The axis turns with f: n.(x_g + arm_g - x_f), the rest of d being fixed to it.
            add_block(hessian, f, f + 3, general(ZERO, ZERO, ZERO, ZERO, n, 0.0))
            add_block(hessian, f + 3, f + 3, symmetric(n, arm_f, ZERO, ZERO, dot(n, arm_f)))
            if f < g:
                add_block(hessian, f + 3, g, general(ZERO, ZERO, ZERO, ZERO, n, 0.0))
                add_block(hessian, f + 3, g + 3, general(scale(-1.0, arm_g), n, ZERO, ZERO, ZERO, dot(n, arm_g)))
            elif g >= 0:
                add_block(hessian, g, f + 3, general(ZERO, ZERO, ZERO, ZERO, scale(-1.0, n), 0.0))
                add_block(hessian, g + 3, f + 3, general(scale(-1.0, n), arm_g, ZERO, ZERO, ZERO, dot(n, arm_g)))
    else:
        if kind == COINCIDENT:
            n = world_axis(component, y)
        else:
            length, direction = distance_direction(records, k)
            w = y / max(length, LEAST_DIVISOR)
            n = scale(y, direction)
            if f >= 0:
                add_stretch(hessian, f, f, arm_f, arm_f, direction, w)
            if g >= 0:
                add_stretch(hessian, g, g, arm_g, arm_g, direction, w)
            if f >= 0 and g >= 0:
                if f < g:
                    add_stretch(hessian, f, g, arm_f, arm_g, direction, -w)
                else:
                    add_stretch(hessian, g, f, arm_g, arm_f, direction, -w)
        if f >= 0:
            add_block(hessian, f + 3, f + 3, symmetric(scale(-1.0, n), arm_f, ZERO, ZERO, -dot(n, arm_f)))
    if g >= 0:
        add_block(hessian, g + 3, g + 3, symmetric(n, arm_g, ZERO, ZERO, dot(n, arm_g)))


@kernel(inline=True)
def turning_form(kind, component, records, k):
    """The second derivative of an angular coordinate."""
    z = load_row(records, k, AXES_A + 6)
    a = ZERO
    b = ZERO
    c = ZERO
    d = ZERO
    h = ZERO
    t = 0.0
    if kind == SWING:
        part = swing(component, records, k)
        c = part.p
        a = blend(part.phi, part.u, part.m, z)
        b = load_row(records, k, AXES_B + 6)
        t = dot(a, b)
        d = blend(2.0 * part.rate, part.hu, part.second, c)
        h = blend(part.phi, part.hu, part.j, c)
    elif kind == TURN:
        # h = 2 m / |m|^2, and |m|^2 / 2 = 1 + z_a.z_b changes along m x z_a.
        m = add(z, load_row(records, k, AXES_B + 6))
        square = dot(m, m)
        if square >= POLE * POLE:
            h = scale(2.0 / square, m)
            a = scale(-2.0 / square, h)
            b = cross(m, z)
    elif kind == DOT:
        a = load_row(records, k, AXES_A + 3 * (component // 3))
        b = load_row(records, k, AXES_B + 3 * (component % 3))
        t = dot(a, b)
        h = cross(b, a)
    elif kind == AZIMUTH:
        v = load_row(records, k, AXES_B + 3 * component)
        across = cross(z, v)
        square = dot(across, across)
        if square >= POLE * POLE:
            h = scale(1.0 / square, cross(v, across))
            a = across
            b = blend(1.0 / square, v, -2.0 * dot(z, v) / square, h)
    else:
        # K = (c (I - h h^T) - sym(z_a z_b^T)) / s.
        cosine, s, h = tilt(records, k)
        steep = 1.0 / max(s, LEAST_DIVISOR)
        a = scale(-steep, z)
        b = load_row(records, k, AXES_B + 6)
        t = -steep * cosine
        c = h
        d = scale(t, h)
    return TurningForm(h, a, b, c, d, t)


@kernel(inner=True)
def add_coordinate_hessian(kind, component, records, k, y, hessian, f, g):
    """Upper triangle of hessian += y (second derivative of a coordinate), twists at f.. and g.., negative: fixed."""
    if kind == COINCIDENT or kind == SLIDE or kind == DISTANCE or kind == RADIUS:
        add_point_terms(kind, component, records, k, y, hessian, f, g)
    elif f >= 0 or g >= 0:
        form = turning_form(kind, component, records, k)
        block = symmetric(scale(y, form.a), form.b, scale(y, form.c), form.d, y * form.t)
        if f >= 0:
            add_block(hessian, f + 3, f + 3, block)
        if g >= 0:
            add_block(hessian, g + 3, g + 3, block)
        if f >= 0 and g >= 0:
            x, y, z = scale(0.5 * y if f < g else -0.5 * y, form.h)
            xx, xy, xz, _yx, yy, yz, _zx, _zy, zz = block
            other = (-xx, -xy - z, -xz + y, -xy + z, -yy, -yz - x, -xz - y, -yz + x, -zz)
            add_block(hessian, min(f, g) + 3, max(f, g) + 3, other)
