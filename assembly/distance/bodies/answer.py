"""The nearest points of two bodies as a query returns them: in the world, and how they face each other."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.distance.bodies.descent import (
    body_search_at,
    load_places,
)
from assembly.distance.bodies.nodes import patch_of
from assembly.distance.bodies.records import NONE, body_head_at
from assembly.distance.bodies.spines import norm
from assembly.distance.patches.pair import D, patch_work_at, vector_dot
from assembly.geometry.vec import add, cross, dot, matvec, matvec_t, neg, sub
from assembly.kinematics.motion import position, rotation


@kernel(inline=True)
def cosine_to_normal(patch, way, j, at):
    """Cosine between a unit vector and the outward normal of a patch whose tangents are rows `at` and `at` + 1 of J."""
    if patch.curve != NONE:
        return 0.0
    o = 3 * at
    normal = cross((j[o], j[o + 1], j[o + 2]), (j[o + 3], j[o + 4], j[o + 5]))
    size = norm(normal)
    return patch.sign * dot(way, normal) / size if size > 0.0 else 0.0


@kernel(inner=True)
def write_facing(search):
    """Write the cosines between the outward normals at the nearest known points and the way to the other point."""
    state, work = body_search_at(search.state, 0), patch_work_at(search.w, 0)
    patch_a, patch_b = patch_of(search.a, int(state.patches[0])), patch_of(search.b, int(state.patches[1]))
    for i in range(4):
        work.place[i] = state.places[i]
    load_places(search, patch_a.node, patch_b.node)
    state.facing[0] = state.facing[1] = 0.0
    far = math.sqrt(vector_dot(search.w, D, D))
    if far > 0.0:
        way = (work.d[0] / far, work.d[1] / far, work.d[2] / far)
        state.facing[0] = cosine_to_normal(patch_a, neg(way), work.j, 0)
        state.facing[1] = cosine_to_normal(patch_b, way, work.j, 2)


@kernel(inline=True)
def is_in_box(head, point):
    """1.0 if a point, relative to the center of a body, is in its box, else 0.0."""
    half = head.half
    return 1.0 if abs(point[0]) <= half[0] and abs(point[1]) <= half[1] and abs(point[2]) <= half[2] else 0.0


@kernel(inline=True)
def write_points(search, q):
    """Write the nearest known points in world coordinates, and which of them are in the box of the other body."""
    state, center = body_search_at(search.state, 0), body_head_at(search.a.pool, 0).center
    for i in range(0, 6, 3):
        own = (state.points[i] + center[0], state.points[i + 1] + center[1], state.points[i + 2] + center[2])
        world = add(matvec(rotation(q, 0), own), position(q, 0))
        state.world[i], state.world[i + 1], state.world[i + 2] = world
    on_a = (state.points[0], state.points[1], state.points[2])
    on_b = (state.points[3], state.points[4], state.points[5])
    state.boxed[0] = is_in_box(body_head_at(search.a.pool, 0), on_b)
    seen = matvec_t(search.pose.turn, sub(on_a, search.pose.shift))
    state.boxed[1] = is_in_box(body_head_at(search.b.pool, 0), seen)
