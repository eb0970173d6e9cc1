"""A shaft or plug that is longer than its bore and leans in it: only what is within the bore's height is in the bore.

The surface in the node that has the bore lies outside of the bore, a cylinder or a cone, and between two planes across
its axis. So a cylinder or cone of the other body is apart from it if its part between these planes is within the bore.
The level of the bore's wall (the distance from the axis, of a cylinder) is convex: along every ruling it is largest
where the ruling crosses one of both planes, or ends. A plane at height z cuts the cone whose axis leans by the vector s
(the tangent of its angle, seen along the bore), meets the plane at e, where the radius across it is r, and which gets
wider by S for each unit of its axis, in an ellipse. Its support along a unit v across the bore's axis is

    v.e + r (S v.s sqrt(1 + |s|^2) + sqrt(D + (1 + S^2) (v.s)^2)) / D,      D = 1 - S^2 |s|^2,

and `farthest_of_section` is how far that is from the bore's axis. The bore's level less the largest level of the part,
times the cosine of the largest angle of a ruling to the bore's axis, is a lower bound of the distance of the bodies
(`docs/certified.md`).

Either end may be taken instead of the section beyond it: a disc that leans.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.vec import add, dot, matvec, neg, scale, sub
from assembly.kinematics.motion import inverse_pose
from assembly.proximity.clearance.halve import vector
from assembly.proximity.clearance.records import BY_BORE_A, BY_BORE_B, BY_PLANE, BY_PLANE_OF_B, BY_SLEEVE, node_at
from assembly.proximity.clearance.separation import (
    farthest_of_section,
    highest,
    is_round,
    most_in_bore,
    placed,
    room_in_bore,
    separation,
)

__all__ = ["LEAST_COSINE", "best_bore", "cosine_of_rulings", "gap_of", "sleeve_room", "slope_of"]

# The least cosine of the angle of a ruling to the bore's axis. Next to a right angle a section has no end, and digits
# are lost by the square of the inverse.
LEAST_COSINE = 0.1
# A section near the apex of a cone is not asked: where its radius is below this part of the widest one.
NARROWEST = 0.05


@kernel(inline=True)
def slope_of(node):
    """By how much a cylinder or cone gets wider for each unit along its first axis."""
    return 0.5 * (node.less[1] - node.less[0]) / node.half[0]


@kernel(inline=True)
def cosine_of_rulings(cosine, steep):
    """The cosine of the largest angle of a ruling to the bore's axis, of a cone with a slope whose axis has another."""
    sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))
    return (abs(cosine) - steep * sine) / math.sqrt(1.0 + steep * steep)


@kernel(inner=True)
def level_of_section(bore, section, slope, height):
    """The level of a bore over the section of what leans in it by a plane at a height, at most.

    section: where the axis meets the plane, from the bore's axis, the lean, and the radius across the axis there.
    """
    e, lean, radius = section
    far = farthest_of_section(e, lean, radius, slope)
    return math.sqrt(1.0 - bore.slant * bore.slant) * far - bore.slant * height


@kernel(inner=True)
def sleeve_room(forest, wall, k, pose, how):
    """A lower bound of the distance of a cylinder or cone, node k, from the node of a bore around it; else negative.

    `how` - BY_SLEEVE: 0 if both its ends are beyond the bore, 1 or 2 if the end along its axis, or the other, is asked.
    The pose is seen from the node with the bore.
    """
    bore, node = node_at(forest.nodes, wall), node_at(forest.nodes, k)
    u, spine = vector(bore.ruling), vector(bore.spine)
    a = matvec(pose.rotation, vector(node.axes[0]))
    cosine = dot(a, u)
    slope = slope_of(node)
    upright = cosine_of_rulings(cosine, abs(slope))
    if not upright >= LEAST_COSINE:
        return -math.inf
    center = sub(placed(pose, vector(node.center)), spine)
    height = dot(center, u)
    lean = scale(1.0 / cosine, sub(a, scale(cosine, u)))
    c = sub(center, scale(height, u))
    top, bottom = highest(forest, wall, u) - dot(spine, u), -highest(forest, wall, neg(u)) - dot(spine, u)
    # Where the end along the axis is, and where the other one.
    ahead, behind = (top, bottom) if cosine > 0.0 else (bottom, top)
    middle = node.disc - 0.5 * (node.less[0] + node.less[1])
    upwards = slope if cosine > 0.0 else -slope
    if how - BY_SLEEVE != 1:
        radius = middle + slope * (ahead - height) / cosine
        if radius < NARROWEST * node.disc:
            return -math.inf
        section = add(c, scale(ahead - height, lean)), lean, radius
        most = level_of_section(bore, section, upwards, ahead)
    else:
        most = most_in_bore(bore, add(center, scale(node.half[0], a)), a, node.disc - node.less[0])
    if how - BY_SLEEVE != 2:
        radius = middle + slope * (behind - height) / cosine
        if radius < NARROWEST * node.disc:
            return -math.inf
        section = add(c, scale(behind - height, lean)), lean, radius
        other = level_of_section(bore, section, upwards, behind)
    else:
        other = most_in_bore(bore, sub(center, scale(node.half[0], a)), a, node.disc - node.less[1])
    return upright * (bore.bore - max(most, other))


@kernel(inner=True)
def best_sleeve(forest, a, b, pose):
    """Which sleeve of node a leaves node b, a cylinder or cone, the most room, and that room; BY_PLANE for none."""
    one, other = node_at(forest.nodes, a), node_at(forest.nodes, b)
    axis = vector(one.ruling)
    if not one.bore > 0.0 or dot(axis, axis) == 0.0 or not is_round(forest, b):
        return BY_PLANE, -math.inf
    if other.rho > 0.0 or not other.half[0] > 0.0:
        return BY_PLANE, -math.inf
    how, best = BY_PLANE, -math.inf
    for i in range(3):
        room = sleeve_room(forest, a, b, pose, BY_SLEEVE + i)
        if room > best:
            how, best = BY_SLEEVE + i, room
    return how, best


@kernel(inner=True)
def gap_of(forest, nodes, pose, n):
    """The gap of two nodes, kept apart by a plane of direction n, or by a bore; of spines see `spines.py`."""
    if nodes.how == BY_PLANE:
        return separation(forest, nodes.a, nodes.b, pose, n)
    if nodes.how == BY_PLANE_OF_B:
        return separation(forest, nodes.a, nodes.b, pose, matvec(pose.rotation, n))
    if nodes.how == BY_BORE_A:
        return room_in_bore(forest, nodes.a, nodes.b, pose, False)
    if nodes.how >= BY_SLEEVE:
        return sleeve_room(forest, nodes.a, nodes.b, pose, nodes.how)
    return room_in_bore(forest, nodes.b, nodes.a, inverse_pose(pose), False)


@kernel(inner=True)
def best_bore(forest, a, b, pose):
    """Which of two nodes is the wall of a bore that the other one is in, and by how much it is clear of that."""
    how, best = BY_PLANE, -math.inf
    if node_at(forest.nodes, a).bore > 0.0:
        how, best = BY_BORE_A, room_in_bore(forest, a, b, pose, False)
    if node_at(forest.nodes, b).bore > 0.0:
        gap = room_in_bore(forest, b, a, inverse_pose(pose), False)
        if gap > best:
            how, best = BY_BORE_B, gap
    if not best > 0.0:
        sleeve, gap = best_sleeve(forest, a, b, pose)
        if gap > best:
            how, best = sleeve, gap
    return how, best
