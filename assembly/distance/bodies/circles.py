"""A lower bound of the distance of two circles in space that is the distance itself up to rounding, at any pose.

Let A have center, axis and radius c, m, R, and B o, n, S. Of the point p(t) of A, t from 0 to 2 pi, let d = p - o and
w = d - (d.n) n. The squared distance of p(t) from B is

    f = P + S^2 - 2 S |w|,    P = |d|^2,    |w|^2 = P - (d.n)^2,

where P is a trigonometric polynomial of degree 1 and |w|^2 one of degree 2. With Q = P + S^2 - L,

    T = Q^2 - 4 S^2 |w|^2 = (f - L) (Q + 2 S |w|)

is one of degree 2: of two circles about which f is L all along A, as of two equal ones that are linked through each
other's centers at a right angle, T is zero, to the last coefficient. Where f is below L by x > 0,
x (4 S |w| - x) = -T, so a lower bound of T is one of f, except where A meets the axis of B. There

    |w| <= e.w + |w - (e.w) e|^2 / (2 e.w)

for a unit vector e, or |w| <= |e.w| + |w - (e.w) e|, bounds f by its second-order expansion. L is the least f found.
The interval of t is gone through once, in steps as long as one of these bounds tells that f >= L - CLOSE there.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.geometry.splines.bezier_pieces import UNIT
from assembly.geometry.vec import add, cross, dot, scale, sub

# In units in which both radii and the distance of both centers add up to one: by how much f may be below L, so that the
# distance is within 1e-12 of it where circles are farther apart than 0.2; and what rounding may take from T.
CLOSE, ROUNDING = 4e-13, 16.0 * UNIT
# Places at which f is asked first, steps of a descent from the lowest ones, and what their length is divided by where f
# does not fall.
PLACES, STEPS, CUT = 24, 40, 4.0
# The longest and the shortest half step, and how many steps there may be: two that all but meet each other's axis along
# a continuum of nearest points take some thousands, others some tens.
LONGEST, SHORTEST, MOST = 0.4, 1e-7, 20_000
# Two circles: A is p = d + e cos t + g sin t, seen from the center of B and in the units of above; n the axis of B;
# `radius`, `other`: R and S; `center`, `cos`, `sin`: w = center + cos cos t + sin sin t.
Circles = namedtuple("Circles", "d e g n radius other center cos sin")
# Of t: P, its first two derivatives; |w|, w, its first derivative, and half its second one.
Place = namedtuple("Place", "p dp ddp length w dw bend")
# T = a0 + a1 cos t + b1 sin t + a2 cos 2t + b2 sin 2t.
Harmonics = namedtuple("Harmonics", "a0 a1 b1 a2 b2")


@kernel(inline=True)
def length_of(x):
    """Length of a vector."""
    return math.sqrt(dot(x, x))


@kernel(inline=True)
def across(x, n):
    """The part of a vector across a unit vector."""
    return sub(x, scale(dot(x, n), n))


@kernel(inline=True)
def any_across(n):
    """A unit vector across a unit vector."""
    x = (1.0, 0.0, 0.0) if abs(n[0]) < 0.6 else (0.0, 1.0, 0.0)
    y = cross(n, x)
    return scale(1.0 / length_of(y), y)


@kernel(inline=True)
def circles_of(s, t, size):
    """Two circles given as spines, in units of a size."""
    e = any_across(s.axis)
    g = cross(s.axis, e)
    radius, other = s.major / size, t.major / size
    d = scale(1.0 / size, sub(s.center, t.center))
    e, g = scale(radius, e), scale(radius, g)
    n = t.axis
    return Circles(d, e, g, n, radius, other, across(d, n), across(e, n), across(g, n))


@kernel(inline=True)
def at_place(c, t):
    """P and w of a place of A, and their derivatives."""
    u, v = math.cos(t), math.sin(t)
    d = add(c.d, add(scale(u, c.e), scale(v, c.g)))
    # P = |c - o|^2 + R^2 + k1 cos t + k2 sin t.
    k1, k2 = 2.0 * dot(c.d, c.e), 2.0 * dot(c.d, c.g)
    w = add(c.center, add(scale(u, c.cos), scale(v, c.sin)))
    dw = sub(scale(u, c.sin), scale(v, c.cos))
    bend = scale(-0.5, add(scale(u, c.cos), scale(v, c.sin)))
    return Place(dot(d, d), u * k2 - v * k1, -u * k1 - v * k2, length_of(w), w, dw, bend)


@kernel(inline=True)
def square_from(c, place):
    """f: the squared distance of a place of A from B."""
    return place.p + c.other * c.other - 2.0 * c.other * place.length


@kernel(inline=True)
def slope_at(c, place):
    """The derivative of f; on the axis of B that of P."""
    if place.length == 0.0:
        return place.dp
    return place.dp - 2.0 * c.other * dot(place.w, place.dw) / place.length


@kernel(inline=True)
def lowest_from(c, t, step):
    """The least f found downhill from a place of A, and where."""
    best = square_from(c, at_place(c, t))
    for _ in range(STEPS):
        slope = slope_at(c, at_place(c, t))
        # A secant of the slope, confined to the step.
        ahead = slope_at(c, at_place(c, t + 1e-3 * step))
        bend = (ahead - slope) / (1e-3 * step)
        go = -slope / bend if bend > 0.0 else -math.copysign(step, slope)
        go = max(-step, min(step, go))
        f = square_from(c, at_place(c, t + go))
        if f < best:
            t, best = t + go, f
        else:
            step /= CUT
            if step < 1e-9:
                break
    return best, t


@kernel(inline=True)
def least_square(c):
    """The least f found, and where: from each of some places that is no higher than those beside it."""
    width = 2.0 * math.pi / PLACES
    before, here = square_from(c, at_place(c, -width)), square_from(c, at_place(c, 0.0))
    best, place = here, 0.0
    for k in range(PLACES):
        after = square_from(c, at_place(c, (k + 1) * width))
        if here <= before and here <= after:
            f, t = lowest_from(c, k * width, width)
            if f < best:
                best, place = f, t
        before, here = here, after
    return best, place


@kernel(inline=True)
def harmonics_of(c, least):
    """T, with L the least f found."""
    s = c.other * c.other
    k0, k1, k2 = dot(c.d, c.d) + c.radius * c.radius, 2.0 * dot(c.d, c.e), 2.0 * dot(c.d, c.g)
    # (d.n) = a + u cos t + v sin t.
    a, u, v = dot(c.d, c.n), dot(c.e, c.n), dot(c.g, c.n)
    q = k0 + s - least
    return Harmonics(
        q * q + 0.5 * (k1 * k1 + k2 * k2) + 4.0 * s * (a * a + 0.5 * (u * u + v * v) - k0),
        2.0 * q * k1 + 4.0 * s * (2.0 * a * u - k1),
        2.0 * q * k2 + 4.0 * s * (2.0 * a * v - k2),
        0.5 * (k1 * k1 - k2 * k2) + 2.0 * s * (u * u - v * v),
        k1 * k2 + 4.0 * s * u * v,
    )


@kernel(inline=True)
def lowest_of(c0, c1, c2, h):
    """The least c0 + c1 x + c2 x^2 where |x| <= h."""
    if c2 > 0.0 and abs(c1) <= 2.0 * c2 * h:
        return c0 - c1 * c1 / (4.0 * c2)
    return c0 - abs(c1) * h + c2 * h * h


@kernel(inline=True)
def lowest_harmonics(x, t, h):
    """A lower bound of T within h of t."""
    u, v, uu, vv = math.cos(t), math.sin(t), math.cos(2.0 * t), math.sin(2.0 * t)
    c0 = x.a0 + x.a1 * u + x.b1 * v + x.a2 * uu + x.b2 * vv
    c1 = x.b1 * u - x.a1 * v + 2.0 * (x.b2 * uu - x.a2 * vv)
    c2 = -0.5 * (x.a1 * u + x.b1 * v) - 2.0 * (x.a2 * uu + x.b2 * vv)
    third = math.hypot(x.a1, x.b1) + 8.0 * math.hypot(x.a2, x.b2)
    return lowest_of(c0, c1, c2, h) - third * h**3 / 6.0


@kernel(inline=True)
def lowest_beside(c, place, h):
    """A lower bound of f within h of a place where A is not near the axis of B, as e = w / |w|; -inf near it."""
    r = place.length
    if r == 0.0:
        return -math.inf
    e = scale(1.0 / r, place.w)
    a1, a2 = dot(e, place.dw), dot(e, place.bend)
    off = length_of(across(place.dw, e)) + length_of(across(place.bend, e)) * h
    third = 2.0 * c.radius * h**3 / 6.0
    least = r - abs(a1) * h - abs(a2) * h * h - third
    if least < 0.25 * r:
        return -math.inf
    c0, c1 = square_from(c, place), place.dp - 2.0 * c.other * a1
    c2 = 0.5 * place.ddp - 2.0 * c.other * a2 - c.other * off * off / least
    # Third derivatives: of P no more than 2 R |center|, of w no more than 2 R; what is across e, squared, has more.
    more = 2.0 * c.radius * length_of(c.d) * h**3 / 6.0 + 2.0 * c.other * (third + third * (off * h + third) / least)
    return lowest_of(c0, c1, c2, h) - more


@kernel(inline=True)
def lowest_at_axis(c, place, h):
    """A lower bound of f within h of a place where A is near the axis of B, as e is the direction of w's bend."""
    size = length_of(place.bend)
    if size == 0.0:
        return -math.inf
    e = scale(1.0 / size, place.bend)
    a0, a1 = dot(e, place.w), dot(e, place.dw)
    off = length_of(across(place.w, e)) + length_of(across(place.dw, e)) * h + 2.0 * c.radius * h**3 / 6.0
    twice = 2.0 * c.other
    base = place.p + c.other * c.other
    one = lowest_of(base - twice * a0, place.dp - twice * a1, 0.5 * place.ddp - twice * size, h)
    other = lowest_of(base + twice * a0, place.dp + twice * a1, 0.5 * place.ddp + twice * size, h)
    more = 2.0 * c.radius * length_of(c.d) * h**3 / 6.0 + twice * (off + 2.0 * c.radius * h**3 / 6.0)
    return min(one, other) - more


@kernel(inline=True)
def below(c, x, least, t, h):
    """By how much f may be below the least one found within h of t."""
    place = at_place(c, t)
    near = max(0.0, math.sqrt(max(square_from(c, place), 0.0)) - c.radius * h)
    lacking = least - near * near
    if lacking <= CLOSE:
        return max(lacking, 0.0)
    room = 4.0 * c.other * (place.length - c.radius * h) - lacking
    if room > 0.0:
        lacking = min(lacking, (max(-lowest_harmonics(x, t, h), 0.0) + ROUNDING) / room)
    if lacking > CLOSE:
        lacking = min(lacking, max(0.0, least - lowest_beside(c, place, h) + ROUNDING))
    if lacking > CLOSE:
        lacking = min(lacking, max(0.0, least - lowest_at_axis(c, place, h) + ROUNDING))
    return lacking


@kernel(inner=True)
def circles_apart(s, t):
    """A lower bound of the distance of the circles of two tori, given as spines; zero where none is found.

    And about where the first one is nearest to the second one: the angle of a place of it.
    """
    size = length_of(sub(s.center, t.center)) + s.major + t.major
    if not (size > 0.0 and s.major > 0.0 and t.major > 0.0):
        return 0.0, 0.0
    c = circles_of(s, t, size)
    least, place = least_square(c)
    x = harmonics_of(c, least)
    at, h, worst = 0.0, LONGEST, 0.0
    for _ in range(MOST):
        found = below(c, x, least, at + h, h)
        if found <= CLOSE:
            worst = max(worst, found)
            at += 2.0 * h
            if at >= 2.0 * math.pi:
                return size * math.sqrt(max(least - worst - ROUNDING, 0.0)), place
            h = min(2.0 * h, LONGEST)
        elif square_from(c, at_place(c, at + h)) < least - CLOSE:
            # Between the first places two valleys may lie, of which one was gone down. What is behind is no lower.
            least, place = lowest_from(c, at + h, h)
            x = harmonics_of(c, least)
        else:
            h *= 0.5
            if h < SHORTEST:
                break
    return 0.0, place


@kernel(inline=True)
def nearest_on_circles(s, t, place):
    """The point of the first of two tori's circles at an angle, and the nearest one of the second's."""
    e = any_across(s.axis)
    g = cross(s.axis, e)
    p = add(s.center, add(scale(s.major * math.cos(place), e), scale(s.major * math.sin(place), g)))
    off = across(sub(p, t.center), t.axis)
    size = length_of(off)
    way = scale(1.0 / size, off) if size > 0.0 else any_across(t.axis)
    return p, add(t.center, scale(t.major, way))
