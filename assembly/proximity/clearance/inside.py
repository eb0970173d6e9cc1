"""Whether a point is inside a closed body: how often a ray leaves it, with signs, proven.

Each cell's true patch is within `reach` of its facets, corner by corner on the straight way between both. If the ray's
origin is farther than that from the facets, and the ray farther from their border, the ray crosses the patch as often
as the facets, with signs. A cell that fails this test is halved. The sum over all cells is 1 inside and 0 outside. A
point is in a wire if it is nearer to the wire's spine than its radius.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.vec import add, cross, dot, scale, sub
from assembly.proximity.clearance.halve import corner_of, halve, vector
from assembly.proximity.clearance.records import NONE, WIRE, Forest, cell_face_at, links_at, node_at
from assembly.proximity.clearance.stab import segments_apart, triangle_distance

UNCLEAR = -99
# Cells whose radius is below this part of the ray's length are not halved.
SMALLEST = 1e-7
# How many rays are tried from a point, and the ray's length in radii of the body.
RAYS, LENGTH = 8, 2.1
# A ray from p along a unit direction, of a length.
Ray = namedtuple("Ray", "p direction length")


@kernel(inner=True)
def misses_box(node, ray):
    """Whether a ray misses the box of a node, by the planes of its axes."""
    low, high = 0.0, ray.length
    for i in range(3):
        axis = vector(node.axes[i])
        c = dot(axis, sub(vector(node.center), ray.p))
        rate, h = dot(axis, ray.direction), node.half[i] + node.disc + node.rho
        if abs(rate) < 1e-14:
            if abs(c) > h * (1.0 + 1e-12) + 1e-14 * ray.length:
                return True
        else:
            s, t = (c - h) / rate, (c + h) / rate
            low, high = max(low, min(s, t)), min(high, max(s, t))
    return low > high + 1e-12 * ray.length


@kernel(inline=True)
def crossings_of_triangle(signs, corners, direction):
    """Signed crossings of a triangle by a ray from the origin; signs: direction . (p x q) of each side from p to q."""
    x, y, z = signs
    up = x > 0.0 and y > 0.0 and z > 0.0
    down = x < 0.0 and y < 0.0 and z < 0.0
    if not up and not down:
        return 0
    a, b, c = corners
    n = cross(sub(b, a), sub(c, a))
    rate = dot(n, direction)
    if rate == 0.0 or dot(n, a) / rate <= 0.0:
        return 0
    return 1 if rate > 0.0 else -1


@kernel(inner=True)
def crossings_of_cell(node, ray, sign):
    """Signed crossings of a cell and a ray, or UNCLEAR."""
    rho, p, d = node.reach, ray.p, ray.direction
    c0, c1, c2, c3 = corner_of(node, 0), corner_of(node, 1), corner_of(node, 2), corner_of(node, 3)
    if triangle_distance(p, c0, c1, c2) <= rho or triangle_distance(p, c0, c2, c3) <= rho:
        return UNCLEAR
    end = add(p, scale(ray.length, d))
    for i in range(4):
        if segments_apart(p, end, corner_of(node, i), corner_of(node, (i + 1) % 4)) <= rho * (1.0 + 1e-9):
            return UNCLEAR
    # The diagonal is the same for both triangles.
    q0, q1, q2, q3 = sub(c0, p), sub(c1, p), sub(c2, p), sub(c3, p)
    diagonal = dot(d, cross(q0, q2))
    total = crossings_of_triangle((dot(d, cross(q0, q1)), dot(d, cross(q1, q2)), -diagonal), (q0, q1, q2), d)
    total += crossings_of_triangle((diagonal, dot(d, cross(q2, q3)), dot(d, cross(q3, q0))), (q0, q2, q3), d)
    return total if sign > 0 else -total


@kernel(inner=True)
def side_of_wire(node, p):
    """Whether a point is within a piece of a wire: 1, 0, or UNCLEAR."""
    distance = segments_apart(p, p, corner_of(node, 0), corner_of(node, 1))
    if distance + node.reach < node.first[1]:
        return 1
    return 0 if distance > node.rho else UNCLEAR


@kernel(inner=True)
def winding_along(forest, root, ray, stack):
    """How often a ray leaves the body of a root, or UNCLEAR."""
    total = 0
    stack[0] = root
    top = 1
    while top > 0:
        top -= 1
        k = stack[top]
        node = node_at(forest.nodes, k)
        if misses_box(node, ray):
            continue
        links = links_at(forest.links, k)
        if links.face != NONE:
            if links.form == WIRE:
                found = side_of_wire(node, ray.p)
                if found == 1:
                    return 1
            else:
                found = crossings_of_cell(node, ray, cell_face_at(forest.faces, links.face).sign)
            if found != UNCLEAR:
                total += found
                continue
            if links.child == NONE and (node.radius < SMALLEST * ray.length or not halve(forest, k, False)):
                return UNCLEAR
        if top + 2 > len(stack):
            return UNCLEAR
        child = links_at(forest.links, k).child
        stack[top], stack[top + 1] = child, child + 1
        top += 2
    return total


@kernel(inner=True)
def winding(forest, root, p, stack):
    """1 where a point is inside the body of a root, 0 where it is outside, UNCLEAR if none of several rays decides."""
    node = node_at(forest.nodes, root)
    out = sub(p, vector(node.center))
    length = math.sqrt(dot(out, out))
    if length > node.radius:
        return 0
    for k in range(RAYS):
        # Spread over the sphere, in no special direction; the first roughly outward.
        z = 1.0 - 2.0 * ((0.317 + 0.618034 * k) % 1.0)
        r = math.sqrt(1.0 - z * z)
        d = (r * math.cos(1.234 + 2.39996 * k), r * math.sin(1.234 + 2.39996 * k), z)
        if k == 0 and length > 0.1 * node.radius:
            d = add(scale(1.0 / length, out), scale(0.3, d))
            d = scale(1.0 / math.sqrt(dot(d, d)), d)
        found = winding_along(forest, root, Ray(p, d, LENGTH * node.radius), stack)
        if found != UNCLEAR:
            return found
    return UNCLEAR


FOREST = "Tuple((i8[::1], f8[::1], i8[:, ::1], i8[:, ::1], f8[:, ::1], i8[::1]))"


@kernel(signatures=f"({FOREST}, i8, f8[:, ::1], i8[::1], i8[::1])")
def winding_of(arrays, root, points, stack, out):
    """`winding` of points (n, 3), up to the first that is decided; returns how many were tested."""
    table, pool, faces, links, nodes, used = arrays
    forest = Forest(Store(table, pool), faces, links, nodes, used)
    for k in range(len(points)):
        out[k] = winding(forest, root, (points[k, 0], points[k, 1], points[k, 2]), stack)
        if out[k] != UNCLEAR:
            return k + 1
    return len(points)
