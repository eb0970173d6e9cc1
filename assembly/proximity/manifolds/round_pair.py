"""The manifold of a shaft in a bore, or a cone in its seat: two rings, at the ends of what they have in common.

About the axis of a hollow wall, a, with the apex or a point of the axis o,

    f(x) = cos(alpha) |x across a| - sin(alpha) a.x,      x from o,

is convex, and no steeper than 1; the wall is where f = R (0 of a cone). So the full body, shaft or cone, is clear of
the wall by R less the maximum of f on it, which is on one of its end circles. f(x) is the maximum of N(u).x over unit
vectors u across a, N(u) = cos(alpha) u - sin(alpha) a: a row for a direction u is the gap between a circle and the
wall's tangent plane there, R - N.(c - o) - rho |N x b|, smooth at any pose. Where the wall ends before the full body,
the wall's end circle has rows instead: how far its points are from the full body.
"""

from __future__ import annotations

from math import asin, cos, pi, sin, sqrt, tan

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.vec import add, cross, dot, matvec, neg, scale, sub
from assembly.proximity.manifolds.flat_pair import FACING, triple
from assembly.proximity.manifolds.records import NEAREST_RIM, NEAREST_RING, RIM, RING, round_at, row_at

# Rows of a ring: in so many directions fixed on the wall, and in the direction in which the ring is nearest.
HELD = 4
ROWS_OF_RING = HELD + 1
# Directions about an axis, (cosine, sine), from which the nearest one is sought: every other one is held. Steps of
# Newton's method from there.
TRIED, STEPS = 8, 8
HALF = sqrt(0.5)
WAYS = np.array([[1, 0], [HALF, HALF], [0, 1], [-HALF, HALF], [-1, 0], [-HALF, -HALF], [0, -1], [HALF, -HALF]])


@kernel(inline=True)
def across_axis(axis):
    """A unit vector across an axis."""
    x, y, z = abs(axis[0]), abs(axis[1]), abs(axis[2])
    if x <= y and x <= z:
        way = cross(axis, (1.0, 0.0, 0.0))
    elif y <= z:
        way = cross(axis, (0.0, 1.0, 0.0))
    else:
        way = cross(axis, (0.0, 0.0, 1.0))
    return scale(1.0 / sqrt(dot(way, way)), way)


@kernel(inline=True)
def leaning(a, b):
    """The sine of the angle between two unit vectors; the cosine would lose half of the digits."""
    c = cross(a, b)
    return sqrt(dot(c, c))


@kernel(inline=True)
def radius_at(one, height):
    """The radius of a cylinder or a cone at a height."""
    return one.radius + height * tan(one.half_angle)


@kernel(inline=True)
def direction(sides, way):
    """The unit vector about an axis whose angle has a cosine and a sine, of two directions across it."""
    return add(scale(way[0], sides[0]), scale(way[1], sides[1]))


@kernel(inline=True)
def ahead(way):
    """The cosine and sine of an angle that is a quarter of a turn greater."""
    return -way[1], way[0]


@kernel(inline=True)
def lean_of(one):
    """The cosine and sine of a cone's half angle."""
    return (cos(one.half_angle), sin(one.half_angle)) if one.half_angle > 0.0 else (1.0, 0.0)


@kernel(inner=True)
def plane_reach(wall, sides, ring, way):
    """How far a ring (center from o, axis, radius) goes beyond the plane through o with the normal N(u), u at an angle.

    And its first and second derivatives by the angle. wall: the axis of what is hollow, and `lean_of` it.
    """
    c, b, rho = ring
    a, (ca, sa) = wall
    u, du = direction(sides, way), direction(sides, ahead(way))
    s, ds, dds = ca * dot(b, u) - sa * dot(b, a), ca * dot(b, du), -ca * dot(b, u)
    q = sqrt(max(1.0 - s * s, 1e-300))
    value = ca * dot(c, u) - sa * dot(c, a) + rho * q
    first = ca * dot(c, du) - rho * s * ds / q
    second = -ca * dot(c, u) - rho * ((ds * ds + s * dds) / q + s * s * ds * ds / (q * q * q))
    return value, first, second


@kernel(inner=True)
def rim_reach(lean, sides, ring, way):
    """How far a point of a rim (center from the full one's origin, ., radius) is beyond what is full; derivatives.

    By the angle of its way. lean: `lean_of` what is full, whose axis is the ring's.
    """
    (c, b, rho), (ca, sa) = ring, lean
    u, du = direction(sides, way), direction(sides, ahead(way))
    x = add(c, scale(rho, u))
    flat, d = sub(x, scale(dot(x, b), b)), scale(rho, sub(du, scale(dot(du, b), b)))
    r = sqrt(dot(flat, flat))
    if r == 0.0:
        return -sa * dot(x, b), 0.0, 0.0
    dr = dot(flat, d) / r
    ddr = (dot(d, d) - rho * dot(flat, u) - dr * dr) / r
    value = ca * r - sa * dot(x, b)
    return value, ca * dr - sa * rho * dot(du, b), ca * ddr + sa * rho * dot(u, b)


@kernel(inner=True)
def nearest_way(wall, sides, ring, of_full):
    """The cosine and sine of the angle at which a ring goes farthest out, or a rim is nearest."""
    sign = 1.0 if of_full else -1.0
    best, k = -np.inf, 0
    for i in range(TRIED):
        tried = (WAYS[i, 0], WAYS[i, 1])
        value = (plane_reach(wall, sides, ring, tried) if of_full else rim_reach(wall[1], sides, ring, tried))[0]
        if sign * value > best:
            best, k = sign * value, i
    way, at = (WAYS[k, 0], WAYS[k, 1]), 2.0 * pi * k / TRIED
    for _ in range(STEPS):
        _, first, second = plane_reach(wall, sides, ring, way) if of_full else rim_reach(wall[1], sides, ring, way)
        if sign * second >= 0.0:
            break
        step = first / second
        if abs(step) > pi / TRIED:
            break
        at -= step
        way = (cos(at), sin(at))
        if abs(step) < 1e-12:
            break
    return way


@kernel(inner=True)
def put_ring_row(hollow, sides, ring, way, rows, count):
    """Write the row of a ring of what is full and the tangent plane of the wall at an angle."""
    c, b, rho = ring
    row = row_at(rows, count)
    axis, lean = triple(hollow.axis), lean_of(hollow)
    value, _, _ = plane_reach((axis, lean), sides, ring, way)
    n = sub(scale(lean[0], direction(sides, way)), scale(lean[1], axis))
    # The ring's point that is farthest along n.
    out = sub(n, scale(dot(n, b), b))
    x = add(triple(hollow.origin), add(c, scale(rho / sqrt(dot(out, out)), out)))
    row.gap = hollow.radius - value
    for i in range(3):
        row.normal[i], row.place[i] = -n[i], x[i]


@kernel(inner=True)
def put_rim_row(full, origin, sides, ring, way, rows, count):
    """Write the row of a point of the wall's end and what is full, whose axis goes through an origin."""
    c, b, rho = ring
    row = row_at(rows, count)
    lean = lean_of(full)
    value, _, _ = rim_reach(lean, sides, ring, way)
    x = add(c, scale(rho, direction(sides, way)))
    flat = sub(x, scale(dot(x, b), b))
    n = sub(scale(lean[0] / sqrt(dot(flat, flat)), flat), scale(lean[1], b))
    row.gap = value - full.radius
    for i in range(3):
        row.normal[i], row.place[i] = -n[i], origin[i] + x[i]


@kernel(inner=True)
def wall_bound(hollow, full, placed, ends):
    """A lower bound of the gap between a bore and a shaft at heights of the bore between two ends.

    Seen along the shaft a circle of the bore is an ellipse of half axes R and R cos(lean). How far it is from the
    shaft's axis is a concave function of where its middle is, and so of the height: least at an end. Where that is
    negative, a point of the shaft is deeper in the wall, across the bore's axis. Along the ray to it from there the
    distance from the shaft's axis is convex, off at first, and r at last, at most (off + r) / cos(lean) away.
    """
    origin, b = placed
    lean = dot(triple(hollow.axis), b)
    least, most = np.inf, 0.0
    for k in range(2):
        c = sub(add(triple(hollow.origin), scale(ends[k], triple(hollow.axis))), origin)
        flat = sub(c, scale(dot(c, b), b))
        off = sqrt(dot(flat, flat))
        least, most = min(least, hollow.radius * lean - off - full.radius), max(most, off)
    if least >= 0.0:
        return least
    if most >= full.radius:
        return -np.inf
    return least * (most + full.radius) / (lean * (full.radius - most))


@kernel(inner=True)
def most_level(hollow, ring):
    """An upper bound of f over a circle: |c across a| and |N x b| each at its maximum over all directions."""
    c, b, rho = ring
    axis, alpha = triple(hollow.axis), hollow.half_angle
    off = sub(c, scale(dot(c, axis), axis))
    lean = asin(min(leaning(axis, b), 1.0))
    return cos(alpha) * sqrt(dot(off, off)) - sin(alpha) * dot(c, axis) + rho * cos(max(alpha - lean, 0.0))


@kernel(signatures="(f8[::1], f8[::1], f8[::1], f8[::1], f8[:, ::1])")
def round_rows(hollow_wall, full_wall, turn, shift, rows):
    """Rows of a shaft in a bore, or of a cone in a hollow one.

    Parameters
    ----------
    hollow_wall, full_wall : (ROUND_SIZE,)
        Each in the axes of its body.
    turn, shift : (9,), (3,)
        A rotation by rows, and a translation: what is full, seen from the wall.
    rows : (2 * ROWS_OF_RING or more, ROW_SIZE)
        Where rows are written: from the wall to what is full, in the axes of the wall's body.

    Returns
    -------
    count : int
        How many rows there are: none where one is no more along than beside the other, or wholly before or behind it.
    bound : float
        A lower bound of the gap between a shaft and its bore; of cones, of that between the full cone and the whole
        cone that the wall is a part of.
    """
    hollow, full = round_at(hollow_wall, 0), round_at(full_wall, 0)
    m = (turn[0], turn[1], turn[2], turn[3], turn[4], turn[5], turn[6], turn[7], turn[8])
    a, o = triple(hollow.axis), triple(hollow.origin)
    b, origin = matvec(m, triple(full.axis)), add(matvec(m, triple(full.origin)), (shift[0], shift[1], shift[2]))
    low, high = full.low, full.high
    is_cone = hollow.half_angle > 0.0
    if dot(a, b) < 0.0 and not is_cone:
        b, low, high = neg(b), -full.high, -full.low
    lean = dot(a, b)
    if lean < FACING:
        return 0, np.inf
    first, last = add(origin, scale(low, b)), add(origin, scale(high, b))
    begin, end = dot(sub(first, o), a), dot(sub(last, o), a)
    if max(begin, hollow.low) >= min(end, hollow.high):
        return 0, np.inf
    side = across_axis(a)
    sides, count = (side, cross(a, side)), 0
    for k in range(2):
        of_full = begin > hollow.low if k == 0 else end < hollow.high
        height = hollow.low if k == 0 else hollow.high
        p, own = (first, low) if k == 0 else (last, high)
        if of_full:
            ring = (sub(p, o), b, radius_at(full, own))
        else:
            ring = (sub(add(o, scale(height, a)), origin), b, radius_at(hollow, height))
        near = nearest_way((a, lean_of(hollow if of_full else full)), sides, ring, of_full)
        for i in range(ROWS_OF_RING):
            way = near if i == HELD else (WAYS[2 * i, 0], WAYS[2 * i, 1])
            if of_full:
                put_ring_row(hollow, sides, ring, way, rows, count)
            else:
                put_rim_row(full, origin, sides, ring, way, rows, count)
            row, is_near = row_at(rows, count), i == HELD
            if of_full:
                row.kind = NEAREST_RING if is_near else RING
            else:
                row.kind = NEAREST_RIM if is_near else RIM
            row.first, row.second = k, k
            count += 1
    if is_cone:
        top = most_level(hollow, (sub(first, o), b, radius_at(full, low)))
        return count, -max(top, most_level(hollow, (sub(last, o), b, radius_at(full, high))))
    lower = full.radius * leaning(a, b)
    ends = (max(begin - lower, hollow.low), min(end + lower, hollow.high))
    return count, wall_bound(hollow, full, (origin, b), ends)
