"""A shaft that is longer than its bore and leans in it: only what is within the bore's height is in the bore.

The surface in the node that has the bore lies farther from the bore's axis than its radius, and between two planes
across the axis. So a cylinder of the other body is apart from it if the cylinder's part between these planes is within
the bore. Along every ruling the distance from the axis is convex: it is largest where the ruling crosses one of both
planes, or ends. A plane at height z cuts the cylinder of radius r, whose axis leans by the vector s (the tangent of its
angle, seen along the bore) and meets the plane at e, in an ellipse. Its support along a unit v across the axis is

    v.e + r sqrt(1 + (v.s)^2)

and `farthest_of_section` is how far that is from the bore's axis, D. The room R - D times the cosine of the angle is a
lower bound of the distance of the bodies.

Either end of the cylinder may be taken instead of the section beyond it: a disc that leans, seen along the bore an
ellipse as well.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.vec import add, dot, matvec, neg, scale, sub
from assembly.kinematics.motion import inverse_pose
from assembly.proximity.clearance.halve import vector
from assembly.proximity.clearance.records import BY_BORE_A, BY_BORE_B, BY_PLANE, BY_SLEEVE, node_at
from assembly.proximity.clearance.separation import (
    farthest_of_disc,
    farthest_of_section,
    highest,
    is_round,
    placed,
    room_in_bore,
    separation,
)

__all__ = ["best_bore", "gap_of"]

# The least cosine of the angle by which a shaft leans at a pose, and on a way from there (`sleeve_sag` in `way.py`).
UPRIGHT, LEAST_COSINE = 0.98, 0.96


@kernel(inner=True)
def sleeve_room(forest, wall, k, pose, how):
    """A lower bound of the distance of a cylinder, node k, from the node of a bore that it is in; else negative.

    `how` - BY_SLEEVE: 0 if both its ends are beyond the bore, 1 or 2 if the end along its axis, or the other, is asked.
    The pose is seen from the node with the bore.
    """
    bore, node = node_at(forest.nodes, wall), node_at(forest.nodes, k)
    u, spine = vector(bore.ruling), vector(bore.spine)
    a = matvec(pose.rotation, vector(node.axes[0]))
    cosine = dot(a, u)
    if not abs(cosine) >= UPRIGHT:
        return -math.inf
    c = sub(placed(pose, vector(node.center)), spine)
    height = dot(c, u)
    lean = scale(1.0 / cosine, sub(a, scale(cosine, u)))
    c = sub(c, scale(height, u))
    top, bottom = highest(forest, wall, u) - dot(spine, u), -highest(forest, wall, neg(u)) - dot(spine, u)
    # Where the end along the axis is, and where the other one.
    ahead, behind = (top, bottom) if cosine > 0.0 else (bottom, top)
    most = 0.0
    if how - BY_SLEEVE != 1:
        most = farthest_of_section(add(c, scale(ahead - height, lean)), lean, node.disc)
    else:
        most = farthest_of_disc(add(c, scale(node.half[0], a)), u, a, node.disc)
    if how - BY_SLEEVE != 2:
        most = max(most, farthest_of_section(add(c, scale(behind - height, lean)), lean, node.disc))
    else:
        most = max(most, farthest_of_disc(sub(c, scale(node.half[0], a)), u, a, node.disc))
    return LEAST_COSINE * (bore.bore - most)


@kernel(inner=True)
def best_sleeve(forest, a, b, pose):
    """Which sleeve of node a leaves node b, a cylinder, the most room, and that room; BY_PLANE if there is none."""
    one, other = node_at(forest.nodes, a), node_at(forest.nodes, b)
    axis = vector(one.ruling)
    if not one.bore > 0.0 or one.slant > 0.0 or dot(axis, axis) == 0.0 or not is_round(forest, b):
        return BY_PLANE, -math.inf
    if other.rho > 0.0 or not other.half[0] > 0.0 or other.less[0] + other.less[1] > 0.0:
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
