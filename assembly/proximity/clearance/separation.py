"""What separates two nodes: a plane between them, or the bore of a wall of one that contains the other.

Everything is seen from body a: a point y of body b is at R y + t. A unit direction n points from a to b, and

    gap(n) = min over b of n.y - max over a of n.x

is a lower bound of the distance of the surfaces in both nodes, whatever n is. A point within a distance d of the axis
of a bore is at least (bore - d) from its wall. So the search for directions needs no proof: only gaps have to be right.

Planes and bores separate nodes along a way as well, since half spaces and solid cylinders are convex.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.vec import add, cross, dot, matvec, matvec_t, neg, scale, sub
from assembly.proximity.clearance.halve import corner_of, vector
from assembly.proximity.clearance.records import (
    FLAT,
    NONE,
    WIRE,
    links_at,
    node_at,
)

# Steps of Newton's method toward the best bound of a disc in a bore; each bound on the way holds.
NEWTON = 6
# Tangents that are tried of a disc in a cone; each bound holds. A root that is less is replaced by this.
TANGENTS, LEAST_ROOT = 6, 1e-3


@kernel(inline=True)
def placed(pose, x):
    """A point of b, seen from a."""
    return add(matvec(pose.rotation, x), pose.shift)


@kernel(inline=True)
def across(n, axis):
    """The length of the part of n across a unit axis, by components: sqrt(1 - x^2) would lose half of the digits."""
    p = sub(n, scale(dot(n, axis), axis))
    return math.sqrt(dot(p, p))


@kernel(inline=True)
def highest(forest, k, n):
    """The most that n.x is over node k."""
    node = node_at(forest.nodes, k)
    if links_at(forest.links, k).face != NONE:
        top = dot(corner_of(node, 0), n)
        for i in range(1, 4):
            top = max(top, dot(corner_of(node, i), n))
    else:
        top = dot(vector(node.center), n)
        for i in range(3):
            top += node.half[i] * abs(dot(vector(node.axes[i]), n))
    if node.disc > 0.0:
        flat = across(n, vector(node.ruling))
        if node.less[0] + node.less[1] > 0.0:
            h = node.half[0] * dot(vector(node.axes[0]), n)
            top -= abs(h)
            top += max(h - node.less[0] * flat, -h - node.less[1] * flat)
        top += node.disc * flat
    return top + node.rho


@kernel(inline=True)
def separation(forest, a, b, pose, n):
    """gap(n)."""
    return dot(n, pose.shift) - highest(forest, b, neg(matvec_t(pose.rotation, n))) - highest(forest, a, n)


@kernel(inner=True)
def farthest_of_ellipse(square, wide, narrow, p, q):
    """How far points of an ellipse are from the origin, at most.

    With its middle at c, and half axes along two unit vectors across each other, it is c + E y for |y| <= 1. For any m
    that is not less than the square of the longer half axis

        |c + E y|^2 <= |c|^2 + m + c.E (m - E^2)^-1 E c,

    with equality for one m, to which Newton's method on the derivative by m converges (as for trust regions).

    Parameters
    ----------
    square : float
        |c|^2.
    wide, narrow : float
        The square of the longer half axis, and by how much that of the shorter one is less.
    p, q : float
        The lengths of c along the longer and the shorter half axis, each times this half axis; not negative.
    """
    # x = m - wide: the slope is 1 - (p / x)^2 - (q / (x + narrow))^2, and rises.
    x = max(p, q - narrow)
    for _ in range(NEWTON):
        if x <= 0.0:
            break
        u, v = p / x, q / (x + narrow)
        length = u * u + v * v
        if length <= 1.0:
            break
        x += length * (math.sqrt(length) - 1.0) / (u * u / x + v * v / (x + narrow))
    more = p * p / x if p > 0.0 else 0.0
    less = q * q / (x + narrow) if q > 0.0 else 0.0
    return math.sqrt(square + wide + x + more + less)


@kernel(inner=True)
def farthest_of_disc(d, axis, ruling, radius):
    """A bound of how far a disc about d, across a unit vector, is from the line along an axis through the origin.

    Or from the origin, where the axis is zero. Seen along the line the disc is an ellipse with half axes r and r
    cos(lean).
    """
    if dot(axis, axis) == 0.0:
        height, beside = dot(d, ruling), across(d, ruling)
        return math.hypot(beside + radius, height)
    off, side = sub(d, scale(dot(d, axis), axis)), cross(ruling, axis)
    sine = math.sqrt(dot(side, side))
    square = dot(off, off)
    if radius == 0.0 or square == 0.0 or sine == 0.0:
        return math.sqrt(square) + radius
    wide = min(abs(dot(off, side)) / sine, math.sqrt(square))
    # What is not along one half axis is along the other one, even where a side next to nothing is lost in rounding.
    narrow = math.sqrt(max(square - wide * wide, 0.0)) * math.sqrt(max(1.0 - sine * sine, 0.0))
    return farthest_of_ellipse(square, radius * radius, (radius * sine) ** 2, radius * wide, radius * narrow)


@kernel(inner=True)
def farthest_of_section(e, lean, radius, slope):
    """A bound of how far the section of a cylinder or cone, across a line through the origin, is from that line.

    With s the lean, S the slope and D = 1 - S^2 |s|^2, its support along a unit vector v across the line is

        v.e + r (S v.s sqrt(1 + |s|^2) + sqrt(D + (1 + S^2) (v.s)^2)) / D,

    that of an ellipse about e + (r S sqrt(1 + |s|^2) / D) s with the half axes r sqrt(1 + |s|^2) / D along the lean and
    r / sqrt(D) across.

    Parameters
    ----------
    e : vector
        Where its axis meets the plane of the section, from the line.
    lean : vector
        By how much its axis goes sideways for each unit of height.
    radius : float
        Across the axis, where that meets the plane.
    slope : float
        By how much it gets wider for each unit along the axis, upwards; with the lean, less than 1.
    """
    tilt = dot(lean, lean)
    rest = 1.0 - slope * slope * tilt
    longer = radius * math.sqrt(1.0 + tilt) / rest
    center = add(e, scale(longer * slope, lean))
    square = dot(center, center)
    if radius == 0.0 or square == 0.0 or tilt == 0.0:
        return math.sqrt(square) + longer
    along = min(abs(dot(center, lean)) / math.sqrt(tilt), math.sqrt(square))
    beside = math.sqrt(max(square - along * along, 0.0))
    less = radius * radius * tilt * (1.0 + slope * slope) / (rest * rest)
    shorter = radius / math.sqrt(rest)
    return farthest_of_ellipse(square, longer * longer, less, longer * along, shorter * beside)


@kernel(inner=True)
def level_of_disc(slant, d, axis, ruling, radius):
    """What the level of a cone is over a disc about d, seen from a point of the cone's axis, at most.

    With the angle s of the cone to its axis a, and N(u) = cos(s) u - sin(s) a, the level f(x) = cos(s) |x across a| -
    sin(s) a.x is the largest N(u).x over unit vectors u across a: it is convex, and no two points differ by more than
    they are apart. Over a disc of radius r across b it is the largest

        N(u).d + r sqrt(1 - t^2),   t = N(u).b.

    The root is concave in t, and so nowhere above its tangent at any t0. That leaves a linear function of u, whose
    maximum is a length: a bound for every t0, and the maximum itself where t0 is the t of the u that attains it.
    """
    cosine = math.sqrt(1.0 - slant * slant)
    height, upright = dot(d, axis), dot(ruling, axis)
    off, lean = sub(d, scale(height, axis)), sub(ruling, scale(upright, axis))
    t, best = -slant * upright, math.inf
    for _ in range(TANGENTS):
        root = math.sqrt(max(1.0 - t * t, LEAST_ROOT * LEAST_ROOT))
        t = max(min(t, 1.0), -1.0)
        steep = radius * t / root
        v = scale(cosine, sub(off, scale(steep, lean)))
        length = math.sqrt(dot(v, v))
        tangent = radius * root + steep * t
        best = min(best, tangent + steep * slant * upright - slant * height + length)
        if length == 0.0:
            break
        t = cosine * dot(v, lean) / length - slant * upright
    return best


@kernel(inner=True)
def most_in_bore(bore, d, ruling, radius):
    """How far a disc about d, from a point of a bore's axis, is from the axis at most; of a conical bore, its level."""
    axis = vector(bore.ruling)
    if bore.slant == 0.0:
        return farthest_of_disc(d, axis, ruling, radius)
    return level_of_disc(bore.slant, d, axis, ruling, radius)


@kernel(inner=True)
def room_in_bore(forest, wall, k, pose, as_ball):
    """How far node k, at a pose seen from the wall's body, is from the wall of a bore in which it is; else negative.

    With `as_ball` its disc is replaced by a ball of the same radius: a lower bound, however its axis turns.
    """
    bore, node = node_at(forest.nodes, wall), node_at(forest.nodes, k)
    spine, ruling = vector(bore.spine), matvec(pose.rotation, vector(node.ruling))
    disc, most = 0.0 if as_ball else node.disc, -math.inf
    if links_at(forest.links, k).face != NONE:
        for i in range(4):
            d = sub(placed(pose, corner_of(node, i)), spine)
            most = max(most, most_in_bore(bore, d, ruling, disc))
    else:
        center = sub(placed(pose, vector(node.center)), spine)
        u = scale(node.half[0], matvec(pose.rotation, vector(node.axes[0])))
        v = scale(node.half[1], matvec(pose.rotation, vector(node.axes[1])))
        w = scale(node.half[2], matvec(pose.rotation, vector(node.axes[2])))
        for i in range(2 if is_round(forest, k) else 8):
            d = sub(center, u) if i & 1 else add(center, u)
            d = add(d, v) if i & 2 else sub(d, v)
            d = add(d, w) if i & 4 else sub(d, w)
            most = max(most, most_in_bore(bore, d, ruling, max(disc - node.less[i & 1], 0.0)))
    return bore.bore - most - node.rho - (node.disc - disc)


@kernel(inline=True)
def put_point(out, i, x):
    """Write point i of several one after another."""
    out[3 * i], out[3 * i + 1], out[3 * i + 2] = x


@kernel(inner=True)
def write_corners(forest, k, pose, out, first):
    """Write the corners of a cell or box, or the ends of a round node's axis, seen from a, at `first`; how many."""
    node = node_at(forest.nodes, k)
    if links_at(forest.links, k).face != NONE:
        for i in range(4):
            put_point(out, first + i, placed(pose, corner_of(node, i)))
        return 4
    center = placed(pose, vector(node.center))
    u = scale(node.half[0], matvec(pose.rotation, vector(node.axes[0])))
    if is_round(forest, k):
        put_point(out, first, add(center, u))
        put_point(out, first + 1, sub(center, u))
        return 2
    v = scale(node.half[1], matvec(pose.rotation, vector(node.axes[1])))
    w = scale(node.half[2], matvec(pose.rotation, vector(node.axes[2])))
    for i in range(8):
        d = add(center, u) if i & 1 else sub(center, u)
        d = add(d, v) if i & 2 else sub(d, v)
        d = add(d, w) if i & 4 else sub(d, w)
        put_point(out, first + i, d)
    return 8


@kernel(inline=True)
def is_round(forest, k):
    """Whether node k is the exact hull of a round shape."""
    node = node_at(forest.nodes, k)
    return links_at(forest.links, k).face == NONE and (node.disc > 0.0 or node.rho > 0.0)


@kernel(inline=True)
def is_wire(forest, k):
    """Whether node k is a piece of a wire."""
    return links_at(forest.links, k).form == WIRE and links_at(forest.links, k).face != NONE


@kernel(inline=True)
def is_cell(forest, k):
    """Whether node k is a cell."""
    return links_at(forest.links, k).face != NONE


@kernel(inline=True)
def normal_of(forest, k):
    """A unit normal of a cell; in a flat face the face's, as a small cell's corners determine it less accurately."""
    node = node_at(forest.nodes, k)
    return vector(node.ruling) if links_at(forest.links, k).form == FLAT else vector(node.axes[2])
