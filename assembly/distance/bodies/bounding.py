"""The lower bound of two parts of patches: by planes, several directions, trims and a proven single minimum."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.distance.bodies.descent import (
    body_search_at,
    descend,
    descend_from_nodes,
    place_at_models,
    take_from_nodes,
)
from assembly.distance.bodies.directions import along_normals
from assembly.distance.bodies.models import describe_node
from assembly.distance.bodies.nodes import links_of, node_of, patch_of
from assembly.distance.bodies.one_minimum import may_have_one_minimum, proven_bound
from assembly.distance.bodies.pair import (
    hull_bound,
    load_frame,
    load_models,
    model_bound,
    pair_work_at,
)
from assembly.distance.bodies.records import ALL, MODEL, NONE, spine_at
from assembly.distance.bodies.spines import PLANE, spine_of
from assembly.distance.bodies.trims import nearest_is_elsewhere
from assembly.distance.patches.pair import patch_work_at
from assembly.geometry.vec import dot, matvec, neg, sub

# A proof of one minimum is tried where the halvings of both nodes add up to a multiple of this: it costs more than a
# bound.
_PROOF_EVERY = 3
# Directions that differ by less count as the same.
_SAME_WAY = 1e-6


@kernel(inline=True)
def bound_along(search, i, j, n):
    """Lower bound of a pair of parts of patches in one direction; leaves its frame, models and quadratic."""
    pair, state = pair_work_at(search.pair, 0), body_search_at(search.state, 0)
    a, b, pose, slack = search.a, search.b, search.pose, search.errors.slack
    load_frame(pair, pose.turn, n)
    bound = hull_bound(pair, a, i, b, j, pose, slack)
    if bound < state.limit:
        load_models(pair, a, i, b, j, pose)
        bound = max(bound, model_bound(pair, a, i, b, j, state.upper, slack))
    return bound


@kernel(inline=True)
def keep_way(search, bound, n):
    """Record a bound of the pair in hand, and its direction n if none has given a better one."""
    state = body_search_at(search.state, 0)
    state.key = max(state.key, bound)
    if bound > state.tried:
        state.tried = bound
        state.key_way[0], state.key_way[1], state.key_way[2] = n


@kernel(inner=True)
def bound_by_ways(search, i, j, way):
    """Lower bound of a pair of parts of patches, by up to three directions: that of the nearest known points, that of
    its parent pair, and that of the models' nearest points. The best one is kept as `key_way`.
    """
    pair, state = pair_work_at(search.pair, 0), body_search_at(search.state, 0)
    common = (state.way[0], state.way[1], state.way[2])
    if abs(way[0] - common[0]) + abs(way[1] - common[1]) + abs(way[2] - common[2]) > _SAME_WAY:
        bound = bound_along(search, i, j, common)
        keep_way(search, bound, common)
        if bound >= state.limit:
            return
    else:
        # Between straight parts the last digits of the direction count, which a packed direction has lost.
        way = common
    bound = bound_along(search, i, j, way)
    keep_way(search, bound, way)
    if bound >= state.limit:
        return
    near = along_normals(pair, way)
    if near.size < 0.9 * state.upper and 16.0 * state.descents <= 64.0 + state.popped:
        # Points nearer than all known ones may be here.
        place_at_models(search)
        descend_from_nodes(search, i, j)
    if near.turned > 1e-3:
        keep_way(search, bound_along(search, i, j, near.way), near.way)
    if near.against and state.key < state.limit:
        keep_way(search, bound_along(search, i, j, neg(near.way)), neg(near.way))


@kernel(inline=True)
def bound_along_normal(search, i, j, n):
    """The bound by the control points along the normal of a plane, oriented from b's middle to a's."""
    pair, a, b, pose = pair_work_at(search.pair, 0), search.a, search.b, search.pose
    between = sub(sub(node_of(a, i).middle, pose.shift), matvec(pose.turn, node_of(b, j).middle))
    if dot(n, between) < 0.0:
        n = neg(n)
    load_frame(pair, pose.turn, n)
    keep_way(search, hull_bound(pair, a, i, b, j, pose, search.errors.slack), n)


@kernel(inner=True)
def bound_by_planes(search, i, j):
    """Lower bound of a pair of which one part is plane, along its normal: directions between points may miss it."""
    a, b = search.a, search.b
    at_a, at_b = links_of(a, i).spine, links_of(b, j).spine
    if at_a != NONE and spine_at(a.pool, at_a).kind == PLANE:
        bound_along_normal(search, i, j, spine_of(a.pool, at_a).axis)
    if at_b != NONE and spine_at(b.pool, at_b).kind == PLANE:
        bound_along_normal(search, i, j, matvec(search.pose.turn, spine_of(b.pool, at_b).axis))


@kernel(inner=True)
def prove_pair(search, i, j):
    """A bound by the minimum of a pair that is proven to have only one; else -inf. The models of the pair are loaded.

    It is tried in the direction in which the pair was bounded; then, if that gives one minimum that is not high enough,
    in the direction between the nearest points of the pair.
    """
    pair, state, work = (
        pair_work_at(search.pair, 0),
        body_search_at(search.state, 0),
        patch_work_at(search.w, 0),
    )
    a, b = search.a, search.b
    bound = proven_bound(search, i, j)
    if bound == -math.inf or bound >= state.limit:
        return bound
    far = descend(search, i, j)
    if not far > 4.0 * search.errors.point:
        return bound
    x = work.place
    z = (x[0] - 0.5, x[1] - 0.5, x[2] - 0.5, x[3] - 0.5)
    d = work.d
    load_frame(pair, search.pose.turn, (d[0] / far, d[1] / far, d[2] / far))
    load_models(pair, a, i, b, j, search.pose)
    if far + search.errors.point + node_of(a, i).away + node_of(b, j).away < state.upper:
        take_from_nodes(search, i, j)
    pair.z[0], pair.z[1], pair.z[2], pair.z[3] = z
    return max(bound, proven_bound(search, i, j))


@kernel(inline=True)
def is_trimmed(tree, k):
    """Whether parts of a node's patch may be outside of its face."""
    return patch_of(tree, links_of(tree, k).patch).trim != NONE


@kernel(inner=True)
def bound_patches(search, i, j, bound):
    """Lower bound of two parts of patches whose spines and balls say `bound`."""
    a, b, room, errors = search.a, search.b, search.room, search.errors
    pair, state = pair_work_at(search.pair, 0), body_search_at(search.state, 0)
    describe_node(a, i, MODEL, room)
    describe_node(b, j, MODEL, room)
    way = (state.key_way[0], state.key_way[1], state.key_way[2])
    state.key, state.tried = bound, -math.inf
    bound_by_planes(search, i, j)
    if state.key < state.limit:
        bound_by_ways(search, i, j, way)
    trimmed = is_trimmed(a, i) or is_trimmed(b, j)
    proves = (links_of(a, i).depth + links_of(b, j).depth) % _PROOF_EVERY == 0
    if state.key < state.limit and (proves or trimmed):
        describe_node(a, i, ALL, room)
        describe_node(b, j, ALL, room)
        load_frame(pair, search.pose.turn, (state.key_way[0], state.key_way[1], state.key_way[2]))
        load_models(pair, a, i, b, j, search.pose)
        if trimmed and nearest_is_elsewhere(pair, a, i, b, j, errors.slack):
            state.key = math.inf
        elif proves and may_have_one_minimum(pair, a, i, b, j, state.upper, errors.slope) >= 0.0:
            # This test is inlined: most pairs fail it, and a call of `prove_pair` costs more.
            state.key = max(state.key, prove_pair(search, i, j))
    return state.key
