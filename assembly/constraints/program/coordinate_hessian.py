"""Second derivatives of the coordinates of joints, times a multiplier, added to a Hessian in twists.

An angular coordinate with the gradient (-h, h) in the angular velocities of f and g has the second derivative K in
(f, f) and (g, g) and [h]x / 2 - K in (f, g), with a symmetric K that for u.v (u fixed to f, v to g) is
sym(u v^T) - u.v I. Curvatures are limited to those a little away from where a direction is undefined.
"""

from __future__ import annotations

from collections import namedtuple

from assembly._kernel import kernel
from assembly.constraints.program.primitives import (
    APART,
    ARM_A,
    ARM_B,
    AXES_A,
    AXES_B,
    AZIMUTH,
    COINCIDENT,
    DISTANCE,
    DOT,
    LEAST_DIVISOR,
    POLE,
    RADIUS,
    SLIDE,
    SWING,
    TURN,
    ZERO,
    distance_direction,
    radial_direction,
    swing,
    tilt,
    world_axis,
)
from assembly.geometry.vec import add, blend, cross, dot, scale
from assembly.proximity.extrema.rates import load_row

# h, and K = sym(a b^T) + sym(c d^T) - t I, of an angular coordinate.
TurningForm = namedtuple("TurningForm", "h a b c d t")


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
