"""Proof that two cells cross: an edge of one stabs a triangle of the other."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.vec import blend, cross, dot, sub
from assembly.kinematics.motion import IDENTITY
from assembly.proximity.clearance.records import node_at
from assembly.proximity.clearance.separation import is_wire, write_corners


@kernel(inner=True)
def segments_apart(p, q, a, b):
    """The distance of two segments."""
    d1, d2, r = sub(q, p), sub(b, a), sub(p, a)
    e1, e2, f = dot(d1, d1), dot(d2, d2), dot(d2, r)
    s = 0.0
    t = 0.0
    if e1 > 0.0 and e2 > 0.0:
        c, m = dot(d1, r), dot(d1, d2)
        determinant = e1 * e2 - m * m
        if determinant > 0.0:
            s = min(max((m * f - c * e2) / determinant, 0.0), 1.0)
        t = (m * s + f) / e2
        if t < 0.0:
            t, s = 0.0, min(max(-c / e1, 0.0), 1.0)
        elif t > 1.0:
            t, s = 1.0, min(max((m - c) / e1, 0.0), 1.0)
    elif e2 > 0.0:
        t = min(max(f / e2, 0.0), 1.0)
    elif e1 > 0.0:
        s = min(max(-dot(d1, r) / e1, 0.0), 1.0)
    x = sub(blend(1.0, r, s, d1), blend(t, d2, 0.0, d2))
    return math.sqrt(dot(x, x))


@kernel(inline=True)
def is_above(x, a, b, c, n):
    """Whether the projection of x in the plane of a triangle, whose normal is n, is within its sides."""
    return (
        dot(cross(sub(b, a), sub(x, a)), n) > 0.0
        and dot(cross(sub(c, b), sub(x, b)), n) > 0.0
        and dot(cross(sub(a, c), sub(x, c)), n) > 0.0
    )


@kernel(inner=True)
def stabbed(segment, thick, triangle, rho):
    """By how much a segment stabs a triangle, beyond the margins of both, and at which fraction of the segment.

    The first is not positive if the segment does not stab it. The true curve is within `thick` of the segment and has
    its ends; the true patch is within rho of the triangle. Deform segment and triangle to curve and patch along
    straight lines: the ends never meet the patch, since they are farther than rho from the plane of the triangle, and
    the curve never meets the border of the patch, from which the segment is farther than rho + thick. So the curve
    pierces the patch as often as the segment does the triangle: once, and no move of one of them by less than the
    smaller of both margins undoes it.
    """
    p, q = segment
    a, b, c = triangle
    n = cross(sub(b, a), sub(c, a))
    length = math.sqrt(dot(n, n))
    if length == 0.0:
        return 0.0, 0.0
    hp, hq = dot(n, sub(p, a)) / length, dot(n, sub(q, a)) / length
    depth = min(abs(hp), abs(hq)) - rho
    if hp * hq >= 0.0 or depth <= 0.0:
        return 0.0, 0.0
    f = hp / (hp - hq)
    if not is_above(blend(1.0 - f, p, f, q), a, b, c, n):
        return 0.0, 0.0
    beside = min(segments_apart(p, q, a, b), segments_apart(p, q, b, c), segments_apart(p, q, c, a)) - rho - thick
    return min(depth, beside), f


@kernel(inline=True)
def point(x, i):
    """Point i of several one after another."""
    return x[3 * i], x[3 * i + 1], x[3 * i + 2]


@kernel(inner=True)
def triangle_distance(p, a, b, c):
    """The distance of a point from a triangle."""
    n = cross(sub(b, a), sub(c, a))
    if dot(n, n) > 0.0 and is_above(p, a, b, c, n):
        return abs(dot(n, sub(p, a))) / math.sqrt(dot(n, n))
    return min(segments_apart(p, p, a, b), segments_apart(p, p, b, c), segments_apart(p, p, c, a))


@kernel(inner=True)
def overlap_with_wire(forest, wire, other, spine, corners):
    """By how much a piece of a wire is in another cell, proven: two points are nearer than the radius, or both radii.

    No shorter translation separates them.
    """
    node, second = node_at(forest.nodes, wire), node_at(forest.nodes, other)
    p, q = point(spine, 0), point(spine, 1)
    a, b, c, d = point(corners, 0), point(corners, 1), point(corners, 2), point(corners, 3)
    near = segments_apart(p, q, a, b)
    reach = node.first[1] - node.reach - second.reach
    if is_wire(forest, other):
        return reach + second.first[1] - near
    near = min(near, segments_apart(p, q, b, c), segments_apart(p, q, c, d), segments_apart(p, q, d, a))
    for i in range(2):
        x = point(spine, i)
        near = min(near, triangle_distance(x, a, b, c), triangle_distance(x, a, c, d))
    return reach - near


@kernel(inner=True)
def crossing_of(forest, a, b, pose, work):
    """Of two cells: by how much they cross, not positive where that is not proven, and where, seen from a."""
    write_corners(forest, a, IDENTITY, work[0], 0)
    write_corners(forest, b, pose, work[1], 0)
    if is_wire(forest, a):
        return overlap_with_wire(forest, a, b, work[0], work[1]), point(work[0], 0)
    if is_wire(forest, b):
        return overlap_with_wire(forest, b, a, work[1], work[0]), point(work[1], 0)
    best = 0.0
    place = (0.0, 0.0, 0.0)
    for side in range(2):
        one, other = work[side], work[1 - side]
        first, second = (a, b) if side == 0 else (b, a)
        thick, rho = node_at(forest.nodes, first).reach, node_at(forest.nodes, second).reach
        for i in range(4):
            p, q = point(one, i), point(one, (i + 1) % 4)
            for k in range(2):
                triangle = point(other, 0), point(other, k + 1), point(other, k + 2)
                depth, f = stabbed((p, q), thick, triangle, rho)
                if depth > best:
                    best = depth
                    place = blend(1.0 - f, p, f, q)
    return best, place
