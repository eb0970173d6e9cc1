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

For u fixed to f and v fixed to g, the rate of u.v is (w_g - w_f).(v x u), so an angular coordinate has a gradient
(-h, h) in the angular velocities. Second derivatives are in `coordinate_hessian.py`. Where a direction is undefined,
one is chosen, and curvatures are limited to those a little away from there: values and derivatives are finite
everywhere.
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
