"""Certified distance of two posed bodies: best-first branch and bound over pairs of nodes of their trees.

U is the distance of the nearest points known; a pair is let go once its bound is within the tolerance of U, or its only
minimum is known. The least bound of all pairs that wait and that were let go is a lower bound at any time, so that a
search may end whenever its caller likes. Halves that it makes stay with the bodies.
"""

from __future__ import annotations

import math

from assembly._best_first import NO_PAIRS, Pairs, best_first
from assembly._heap import PAIR, waiting_pair_at
from assembly._kernel import kernel
from assembly.distance.bodies.descent import (
    BodyErrors,
    BodySearch,
    body_search_at,
    descend,
    descend_from_nodes,
    descend_on_patches,
    load_places,
    place_at_models,
    place_on_patches,
    take_points,
)
from assembly.distance.bodies.directions import along_normals, packed_way, unpacked_way
from assembly.distance.bodies.models import describe_node
from assembly.distance.bodies.nodes import halves_of, has_room, is_group, links_of, node_of, node_size, patch_of
from assembly.distance.bodies.one_minimum import may_have_one_minimum, proven_bound
from assembly.distance.bodies.pair import (
    BodyPose,
    ball_bound,
    hull_bound,
    load_frame,
    load_models,
    model_bound,
    pair_work_at,
)
from assembly.distance.bodies.records import ALL, MODEL, NONE, BodyTree, body_head_at, spine_at
from assembly.distance.bodies.spines import PLANE, norm, spine_bound, spine_of
from assembly.distance.bodies.trims import nearest_is_elsewhere
from assembly.distance.patches.pair import D, patch_work_at, vector_dot
from assembly.geometry.splines.bezier_pieces import UNIT
from assembly.geometry.vec import add, cross, dot, matvec, matvec_t, neg, sub
from assembly.kinematics.motion import position, relative_pose, rotation

# What a search ended with. CROWDED: the arrays are too small to go on.
CONVERGED, SPENT, CROWDED = 0, 1, 2
# Halvings after which a node is let go.
DEEPEST = 50
_START_DEPTH = 3
# Pairs taken from the heap before the first descent from one; the next ones are at every doubling.
_FIRST_DESCENT = 16.0
# A proof of one minimum is tried where the halvings of both nodes are a multiple: it costs more than a bound.
_PROOF_EVERY = 3


@kernel(inline=True)
def errors_of(a, b, pose, tolerance):
    """Sums of coordinates, evaluated points and derivatives: parts of the sizes, by the degrees."""
    head_a, head_b = body_head_at(a.pool, 0), body_head_at(b.pool, 0)
    slack = 64.0 * UNIT * (head_a.reach + head_b.reach + norm(pose.shift)) + pose.rounding + 1e-150
    point = slack
    point += (1.0 + head_a.rational) * (8.0 * head_a.degree + 24.0) * UNIT * head_a.reach
    point += (1.0 + head_b.rational) * (8.0 * head_b.degree + 24.0) * UNIT * head_b.reach
    m, n = head_a.degree + 1.0, head_b.degree + 1.0
    slope = max(
        m * (4.0 * m + 12.0) * head_a.reach * head_a.weight_ratio**2,
        n * (4.0 * n + 12.0) * head_b.reach * head_b.weight_ratio**2,
    )
    step = max(0.999 * tolerance, 8.0 * (point + head_a.error + head_b.error))
    return BodyErrors(slack, point, 8.0 * UNIT * slope, step)


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
    """Remember a direction if no better one is known of the pair in hand."""
    state = body_search_at(search.state, 0)
    if bound > state.key:
        state.key = bound
        state.key_way[0], state.key_way[1], state.key_way[2] = n


@kernel(inner=True)
def bound_by_ways(search, i, j, way):
    """Lower bound of a pair of parts of patches, by up to three directions: that of the nearest points known, that of
    the pair that it is a part of, and that of the models' nearest places. The best one is KEY_WAY then.
    """
    pair, state = pair_work_at(search.pair, 0), body_search_at(search.state, 0)
    common = (state.way[0], state.way[1], state.way[2])
    if abs(way[0] - common[0]) + abs(way[1] - common[1]) + abs(way[2] - common[2]) > 1e-7:
        bound = bound_along(search, i, j, common)
        keep_way(search, bound, common)
        if bound >= state.limit:
            return
    bound = bound_along(search, i, j, way)
    keep_way(search, bound, way)
    if bound >= state.limit:
        return
    size, turned, own = along_normals(pair, way)
    if size < 0.9 * state.upper and 16.0 * state.descents <= 64.0 + state.popped:
        # Points nearer than any that are known may be here.
        place_at_models(search)
        descend_from_nodes(search, i, j)
    if turned > 1e-3:
        keep_way(search, bound_along(search, i, j, own), own)


@kernel(inline=True)
def bound_along_normal(search, i, j, n):
    """The bound of the control points along the normal of a plane, on the side on which the middles are."""
    pair, state = pair_work_at(search.pair, 0), body_search_at(search.state, 0)
    a, b, pose = search.a, search.b, search.pose
    between = sub(sub(node_of(a, i).middle, pose.shift), matvec(pose.turn, node_of(b, j).middle))
    if dot(n, between) < 0.0:
        n = neg(n)
    load_frame(pair, pose.turn, n)
    keep_way(search, hull_bound(pair, a, i, b, j, pose, search.errors.slack), n)


@kernel(inner=True)
def bound_by_planes(search, i, j):
    """Lower bound of a pair of which one is plane: no way that leads from one point of it to another one need tell."""
    a, b = search.a, search.b
    at_a, at_b = links_of(a, i).spine, links_of(b, j).spine
    if at_a != NONE and spine_at(a.pool, at_a).kind == PLANE:
        bound_along_normal(search, i, j, spine_of(a.pool, at_a).axis)
    if at_b != NONE and spine_at(b.pool, at_b).kind == PLANE:
        bound_along_normal(search, i, j, matvec(search.pose.turn, spine_of(b.pool, at_b).axis))


@kernel(inner=True)
def prove_pair(search, i, j):
    """A bound by the only minimum of a pair, where it is proven to be that; -inf elsewhere. Its models are loaded.

    First in the direction in which the pair was bounded; then, if that gives one minimum which is not high enough, in
    the direction of the nearest points on the pair themselves.
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
        place_on_patches(search, i, j)
        patch_a, patch_b = links_of(a, i).patch, links_of(b, j).patch
        load_places(search, patch_of(a, patch_a).node, patch_of(b, patch_b).node)
        take_points(search, patch_a, patch_b, math.sqrt(vector_dot(search.w, D, D)))
    pair.z[0], pair.z[1], pair.z[2], pair.z[3] = z
    return max(bound, proven_bound(search, i, j))


@kernel(inline=True)
def is_trimmed(tree, k):
    return patch_of(tree, links_of(tree, k).patch).trim != NONE


@kernel(inner=True)
def bound_patches(search, i, j, bound):
    """Lower bound of two parts of patches whose spines and balls say `bound`."""
    a, b, room, errors = search.a, search.b, search.room, search.errors
    pair, state = pair_work_at(search.pair, 0), body_search_at(search.state, 0)
    describe_node(a, i, MODEL, room)
    describe_node(b, j, MODEL, room)
    way = (state.key_way[0], state.key_way[1], state.key_way[2])
    state.key = bound
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
            # The question is in line: most pairs fail it, and a call costs more.
            state.key = max(state.key, prove_pair(search, i, j))
    return state.key


@kernel(inline=True)
def pair_bound(search, i, j):
    """Lower bound of the distance of two nodes, and its direction."""
    a, b, state = search.a, search.b, body_search_at(search.state, 0)
    state.pairs += 1.0
    way = (state.key_way[0], state.key_way[1], state.key_way[2])
    key = state.key
    bound = max(key, ball_bound(a, i, b, j, search.pose, search.errors.slack))
    if bound < state.limit and links_of(a, i).spine != NONE and links_of(b, j).spine != NONE:
        bound = max(bound, spine_bound(a, links_of(a, i).spine, b, links_of(b, j).spine, search.pose))
    if bound < state.limit and not (is_group(a, i) or is_group(b, j)):
        bound = bound_patches(search, i, j, bound)
    tie = packed_way((state.key_way[0], state.key_way[1], state.key_way[2]))
    # The other pairs of the same two nodes begin as this one did.
    state.key = key
    state.key_way[0], state.key_way[1], state.key_way[2] = way
    return bound, tie


@kernel(inline=True)
def search_ended(search, top, left):
    """What the search ends with; -1: not yet. The direction of the pair that is next is taken from its tie."""
    state = body_search_at(search.state, 0)
    state.lower = max(min(top, state.upper), 0.0)
    if left == 0 or top >= state.limit or state.upper <= search.errors.step:
        return CONVERGED
    if state.pairs >= search.budget:
        return SPENT
    first = waiting_pair_at(search.heap, 0)
    i, j = int(first.a), int(first.b)
    if (left + 1) * PAIR > search.heap.size or not (has_room(search.a, i) and has_room(search.b, j)):
        return CROWDED
    state.key = first.bound
    state.key_way[0], state.key_way[1], state.key_way[2] = unpacked_way(first.tie)
    return -1


@kernel(inline=True)
def branch(search, key, i, j):
    """The halves of the longer of two nodes with the other one; none where the pair is let go."""
    a, b, state = search.a, search.b, body_search_at(search.state, 0)
    state.popped += 1.0
    if state.popped >= state.next_descent and not (is_group(a, i) or is_group(b, j)):
        # Bounds wait for a nearer pair of points: look where they are least.
        state.next_descent *= 2.0
        x = patch_work_at(search.w, 0).place
        x[0] = x[1] = x[2] = x[3] = 0.5
        descend_from_nodes(search, i, j)
    ends_a, ends_b = links_of(a, i).depth >= DEEPEST, links_of(b, j).depth >= DEEPEST
    size_a, size_b = node_size(a, i), node_size(b, j)
    if (ends_a and ends_b) or max(size_a, size_b) <= 0.25 * search.errors.step:
        return key, NO_PAIRS
    if ends_b or (size_a >= size_b and not ends_a):
        half = halves_of(a, i)
        return key, Pairs(half, half + 2, j, j + 1)
    half = halves_of(b, j)
    return key, Pairs(i, i + 1, half, half + 2)


advance = kernel(inner=True)(best_first(body_search_at, pair_bound, search_ended, branch))


@kernel(inline=True)
def middles_apart(search, i, j):
    """Square of the distance of the middles of two nodes."""
    node_a, node_b, pose = node_of(search.a, i), node_of(search.b, j), search.pose
    square = 0.0
    for r in range(3):
        x = node_a.middle[r] - pose.shift[r]
        for c in range(3):
            x -= pose.turn[3 * r + c] * node_b.middle[c]
        square += x * x
    return square


@kernel(inner=True)
def start_from_nearest_middles(search):
    """Down both trees to the halves whose middles are nearest, then down the slope."""
    a, b = search.a, search.b
    i = j = 0
    while True:
        more_a = (is_group(a, i) or links_of(a, i).depth < _START_DEPTH) and has_room(a, i)
        more_b = (is_group(b, j) or links_of(b, j).depth < _START_DEPTH) and has_room(b, j)
        if not (more_a or more_b):
            break
        if more_a and (not more_b or node_size(a, i) >= node_size(b, j)):
            i = halves_of(a, i)
            if middles_apart(search, i + 1, j) < middles_apart(search, i, j):
                i += 1
        else:
            j = halves_of(b, j)
            if middles_apart(search, i, j + 1) < middles_apart(search, i, j):
                j += 1
    if not (is_group(a, i) or is_group(b, j)):
        x = patch_work_at(search.w, 0).place
        x[0] = x[1] = x[2] = x[3] = 0.5
        descend_from_nodes(search, i, j)


@kernel(inner=True)
def start_from_corners(search):
    """Points of patches all of which are of the faces: there are some, for the boundary of a trimmed face is."""
    state, x = body_search_at(search.state, 0), patch_work_at(search.w, 0).place
    for i in range(int(body_head_at(search.a.pool, 0).patches)):
        for j in range(int(body_head_at(search.b.pool, 0).patches)):
            if patch_of(search.a, i).trim == NONE and patch_of(search.b, j).trim == NONE:
                x[0] = x[1] = x[2] = x[3] = 0.0
                descend_on_patches(search, i, j)
            if state.upper < math.inf:
                return


@kernel(inline=True)
def relative_pose_of(a, b, q):
    """b seen from a, both about their centers, from two poses."""
    turn_a = rotation(q, 0)
    relative = relative_pose(q, 0, turn_a, 1, rotation(q, 1))
    center_a, center_b = body_head_at(a.pool, 0).center, body_head_at(b.pool, 0).center
    shift = sub(add(relative.shift, matvec(relative.rotation, center_b)), center_a)
    size = norm(relative.shift) + norm(center_a) + norm(center_b)
    return BodyPose(relative.rotation, shift, 16.0 * UNIT * size)


@kernel(inline=True)
def is_in_box(head, point):
    """Whether a point, from the center of a body, is in its box."""
    half = head.half
    return 1.0 if abs(point[0]) <= half[0] and abs(point[1]) <= half[1] and abs(point[2]) <= half[2] else 0.0


@kernel(inline=True)
def cosine_to_normal(patch, way, j, at):
    """Cosine of a unit vector and the outward normal of a patch, whose derivatives are rows `at` and `at` + 1 of J."""
    if patch.curve != NONE:
        return 0.0
    o = 3 * at
    normal = cross((j[o], j[o + 1], j[o + 2]), (j[o + 3], j[o + 4], j[o + 5]))
    size = norm(normal)
    return patch.sign * dot(way, normal) / size if size > 0.0 else 0.0


@kernel(inner=True)
def write_facing(search):
    """How the nearest points known face each other."""
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
def write_points(search, q):
    """The nearest points known in world axes, and which of them are in the box of the other body."""
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


@kernel(inner=True)
def start(search):
    """First points of both bodies, and all that is kept of a search."""
    state = body_search_at(search.state, 0)
    state.upper = state.limit = state.let_go = math.inf
    state.lower = state.pairs = state.popped = state.descents = state.key = 0.0
    state.next_descent = _FIRST_DESCENT
    state.way[0] = state.way[1] = 0.0
    state.way[2] = 1.0
    start_from_nearest_middles(search)
    if state.upper == math.inf:
        start_from_corners(search)
    state.key_way[0], state.key_way[1], state.key_way[2] = state.way[0], state.way[1], state.way[2]


_TREE = "Tuple((i8[::1], f8[::1], i8[::1], f8[::1], f8[::1]))"


@kernel(signatures=f"({_TREE}, {_TREE}, f8[:, ::1], UniTuple(f8, 2), f8[::1], UniTuple(f8[::1], 4), i8)")
def search_bodies(a, b, q, asked, heap, work, left):
    """Bounds of the distance of two bodies at poses q (2, 7) into BODY_SEARCH; a status, and how many pairs wait.

    `asked`: tolerance and budget; `work`: state, pair, w and room; `left`: how many pairs wait, where a search goes on;
    below zero where it starts.
    """
    tree_a, tree_b = BodyTree(*a), BodyTree(*b)
    pose = relative_pose_of(tree_a, tree_b, q)
    errors = errors_of(tree_a, tree_b, pose, asked[0])
    search = BodySearch(tree_a, tree_b, pose, heap, work[0], work[1], work[2], work[3], errors, asked[1])
    pairs = NO_PAIRS
    if left < 0:
        start(search)
        left, pairs = 0, Pairs(0, 1, 0, 1)
    status, left = advance(search, left, pairs)
    write_points(search, q)
    write_facing(search)
    return status, left
