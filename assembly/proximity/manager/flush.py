"""Pairs of points through which bodies with faces that all but touch seem to be in each other: a head on a plate,
beside its hole.

Where a face lies on another one, or is in it by a little, the pair of an edge of one and of a wall beside it may have
normals that oppose each other and a gap far below zero: the rim of a head is behind the wall of the hole that it
covers. The segment between its points runs between the two faces. The way apart there is off the faces, which is next
to nothing, and they have rows of their own; that of the pair would lead along them.

Of bodies that are in each other along a segment its middle is in both. A dovetail's bottom is behind the top of the
lip over it, and between the two is the lip alone.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.vec import add, dot, matvec, scale, sub
from assembly.proximity.brep.records import EDGE_RECORD, edge_at, shell_at
from assembly.proximity.bvh.tree import node_at, three_of, tree_at
from assembly.proximity.features.holding import TILT
from assembly.proximity.manager.extrema import LISTED, NEW, USELESS, extremum_at
from assembly.proximity.manager.overlap import DEPTH, facets_cut, next_near, projection_at, seen_by_other
from assembly.proximity.manager.records import HANDED_OFF, LOST
from assembly.proximity.manager.slots import give_up

# What bodies have in common is thin at a pair where faces of both are nearer to its middle than this part of its depth,
# and their normals are opposed, by the cosine between the one and what is opposed to the other.
SHORT, OPPOSED = 0.1, 0.5
# Depths that are rounding, and room for faces about a point.
DEPTH_ROUNDING, FACES_ABOUT = 1e-9, 16


@kernel(inner=True)
def faces_about(posed, side, y, distance, stack, normals):
    """Write the normals of one body's faces that are within a distance of a point; how many there are. In its axes."""
    stack[0] = 0
    used = 1
    count = 0
    while used > 0 and count < normals.shape[0]:
        e, used = next_near(posed.store, posed.trees[side], y, distance, stack, used)
        if e < 0:
            break
        off, n, some = projection_at(posed, side, e, y)
        if some and abs(off) <= distance:
            normals[count, 0], normals[count, 1], normals[count, 2] = n
            count += 1
    return count


@kernel(inner=True)
def is_between_faces(posed, extremum, stack, normals):
    """Whether the middle of an extremum, with a negative gap, is between two faces that are near each other there."""
    c = scale(0.5, add(three_of(extremum.point_f), three_of(extremum.point_g)))
    distance = -SHORT * extremum.gap
    many = faces_about(posed, 0, c, distance, stack, normals[0])
    if many == 0:
        return False
    others = faces_about(posed, 1, seen_by_other(posed, 0, c), distance, stack, normals[1])
    for i in range(others):
        n = matvec(posed.pose.rotation, (normals[1, i, 0], normals[1, i, 1], normals[1, i, 2]))
        for l in range(many):
            if dot(n, (normals[0, l, 0], normals[0, l, 1], normals[0, l, 2])) < -OPPOSED:
                return True
    return False


@kernel(inner=True)
def has_free_edge(store, shell):
    """Whether a body is a sheet: an edge of it has no other side."""
    solid = shell_at(store.table, shell)
    for k in range(solid.edges):
        if edge_at(store.table, solid.edge_table + EDGE_RECORD * k).face_b < 0:
            return True
    return False


@kernel(inner=True)
def is_outside_solid(posed, side, c, distance, stack, normals):
    """Whether a point, in the axes of one body, is outside of it, and its faces no nearer than a distance.

    By rays in three directions that no face is likely to lie along.
    """
    store = posed.store
    if has_free_edge(store, posed.shells[side]) or faces_about(posed, side, c, distance, stack, normals) > 0:
        return False
    root = node_at(store.pool, tree_at(store.table, posed.trees[side]).node_pool)
    away = sub(c, three_of(root.center))
    far = 3.0 * (root.radius + math.sqrt(dot(away, away)))
    for k in range(3):
        ray = (0.6012 * far, 0.3517 * far, 0.7174 * far)
        if k == 1:
            ray = (-0.6012 * far, -0.3517 * far, -0.7174 * far)
        elif k == 2:
            ray = (0.5218 * far, -0.8125 * far, -0.2601 * far)
        if facets_cut(posed, side, c, ray, 0.0, 0.0)[0] % 2 == 1:
            return False
    return True


@kernel(inner=True)
def is_in_one_alone(posed, extremum, stack, normals):
    """Whether the middle of an extremum, with a negative gap, is outside of one of the bodies.

    That of a corner whose normal leans by TILT may be beside its body by that.
    """
    if -0.5 * extremum.gap <= 2.0 * max(posed.offsets[0], posed.offsets[1]):
        return False
    c = scale(0.5, add(three_of(extremum.point_f), three_of(extremum.point_g)))
    beside = -0.5 * TILT * extremum.gap
    return is_outside_solid(posed, 0, c, max(posed.offsets[0], beside), stack, normals) or is_outside_solid(
        posed, 1, seen_by_other(posed, 0, c), max(posed.offsets[1], beside), stack, normals
    )


@kernel(inner=True, allocates=True)
def drop_flush(manager, p, posed, extrema, tracked):
    """Make extrema of pair p useless that run between flush faces or through one body alone; slots are given up."""
    stack = np.empty(DEPTH, np.int64)
    normals = np.empty((2, FACES_ABOUT, 3))
    for k in range(extrema.count[0]):
        extremum = extremum_at(extrema.rows, k)
        is_listed = np.int64(extremum.origin) >= LISTED
        if not extremum.gap < -DEPTH_ROUNDING or not (extremum.origin == NEW or is_listed):
            continue
        beside = is_between_faces(posed, extremum, stack, normals)
        if not (beside or is_in_one_alone(posed, extremum, stack, normals[0])):
            continue
        if is_listed:
            give_up(manager, p, extremum, HANDED_OFF, LOST, tracked)
        extremum.origin = USELESS


@kernel(inner=True)
def any_deep(extrema):
    """Whether any extremum is deeper than rounding."""
    for k in range(extrema.count[0]):
        extremum = extremum_at(extrema.rows, k)
        if extremum.gap < -DEPTH_ROUNDING and extremum.origin != USELESS:
            return True
    return False
