"""Certified distance of two posed bodies: best-first branch and bound over pairs of nodes of their trees.

U is the distance of the nearest points known; a pair is let go (pruned) once its bound is within the tolerance of U, or
once its only minimum is known. The least bound of all pairs, waiting or let go, is a lower bound of the distance at any
time, so the caller may stop a search at any time. The halves of nodes that a search makes are kept with the bodies.
"""

from __future__ import annotations

import math

from assembly._best_first import NO_PAIRS, Pairs, best_first
from assembly._heap import PAIR, waiting_pair_at
from assembly._kernel import kernel
from assembly.distance.bodies.answer import write_facing, write_points
from assembly.distance.bodies.bounding import bound_patches
from assembly.distance.bodies.circles import circles_apart, nearest_on_circles
from assembly.distance.bodies.descent import (
    BodyErrors,
    BodyQuestion,
    BodySearch,
    body_search_at,
    descend_from_nodes,
    descend_on_patches,
)
from assembly.distance.bodies.directions import packed_way, unpacked_way
from assembly.distance.bodies.nodes import halves_of, has_room, is_group, links_of, node_of, node_size, patch_of
from assembly.distance.bodies.pair import (
    BodyPose,
    ball_bound,
)
from assembly.distance.bodies.records import NONE, BodyTree, body_head_at, spine_at
from assembly.distance.bodies.spines import TORUS, norm, seen_spine, spine_bound, spine_of
from assembly.distance.bodies.supports import is_worth_parting, part_bodies, parted_bound
from assembly.distance.bodies.trims import flat_is_elsewhere, is_outside
from assembly.distance.patches.pair import patch_work_at
from assembly.distance.piece_search import CROWDED, ended
from assembly.geometry.splines.bezier_pieces import UNIT
from assembly.geometry.vec import add, matvec, matvec_t, scale, sub
from assembly.kinematics.motion import relative_pose, rotation

# A node of this many halvings is not halved again.
DEEPEST = 50
_START_DEPTH = 3
# Pairs taken from the heap before the first descent from one; the intervals between later descents grow.
_FIRST_DESCENT = 16.0
# A group is halved before a part of a patch that is less than this many times as long.
_GROUP_WEIGHT = 2.0
# Halvings of two nodes after which the distance of their circles is asked, where one is of a circle itself: it takes
# 15 us, 0.4 ms where nearest points are a continuum, and bodies have many circles. Of two tori it is asked at once.
_HALVINGS = 6
# Halvings of nodes from which the descent to two tori's nearest points begins.
_NEAR_DEPTH = 8


@kernel(inline=True)
def errors_of(a, b, pose, question):
    """Rounding errors of coordinate sums, evaluated points and derivatives, from the bodies' sizes and degrees."""
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
    # Rounding of halving and of the models: the bounds of a pair come no closer to each other than this.
    rough = 120.0 * (head_a.degree + 2.0) * UNIT * head_a.reach + 120.0 * (head_b.degree + 2.0) * UNIT * head_b.reach
    step = max(0.999 * question.tolerance, 4.0 * (point + head_a.error + head_b.error) + rough)
    return BodyErrors(slack, point, 8.0 * UNIT * slope, step)


@kernel(inner=True)
def node_near(tree, point):
    """The small node whose middle is nearest to a point in the body's axes, from its center, as halves tell it."""
    k = 0
    while (is_group(tree, k) or links_of(tree, k).depth < _NEAR_DEPTH) and has_room(tree, k):
        k = halves_of(tree, k)
        one, other = node_of(tree, k).middle, node_of(tree, k + 1).middle
        if norm(sub((other[0], other[1], other[2]), point)) < norm(sub((one[0], one[1], one[2]), point)):
            k += 1
    return k


@kernel(inner=True)
def descend_between(search, on_a, on_b):
    """Descend from the nodes nearest to a point of each body, seen from a."""
    i, j = node_near(search.a, on_a), node_near(search.b, matvec_t(search.pose.turn, sub(on_b, search.pose.shift)))
    if not (is_group(search.a, i) or is_group(search.b, j)):
        x = patch_work_at(search.w, 0).place
        x[0] = x[1] = x[2] = x[3] = 0.5
        descend_from_nodes(search, i, j)


@kernel(inner=True)
def rings_bound(search, at_a, at_b):
    """Lower bound of the distance of two tori, or circles, by the distance of their circles; of one pair it is kept.

    Halving would never end where their nearest points are a continuum, as those of some that are linked are.
    """
    a, b, state = search.a, search.b, body_search_at(search.state, 0)
    if state.rings[0] != at_a or state.rings[1] != at_b:
        s, t = spine_of(a.pool, at_a), seen_spine(b.pool, at_b, search.pose)
        off = spine_at(a.pool, at_a).off + spine_at(b.pool, at_b).off
        size = norm(s.center) + norm(t.center) + s.radius + t.radius + s.major + t.major
        gap, place = circles_apart(s, t)
        state.rings[0], state.rings[1] = at_a, at_b
        state.rings_apart = gap - s.radius - t.radius - off - 64.0 * UNIT * size - search.pose.rounding
        if 0.0 < state.rings_apart < state.limit:
            # In a valley that is all but level the nearest of the points known may be far from the nearest ones.
            p, r = nearest_on_circles(s, t, place)
            way = scale(1.0 / gap, sub(r, p))
            descend_between(search, add(p, scale(s.radius, way)), sub(r, scale(t.radius, way)))
    return state.rings_apart


@kernel(inline=True)
def are_rings(search, i, j):
    """Whether two nodes are of tori, or small parts of circles."""
    one, other = links_of(search.a, i), links_of(search.b, j)
    s, t = spine_at(search.a.pool, one.spine), spine_at(search.b.pool, other.spine)
    if s.kind != TORUS or t.kind != TORUS:
        return False
    return min(s.radius, t.radius) > 0.0 or one.depth + other.depth >= _HALVINGS


@kernel(inline=True)
def pair_bound(search, i, j):
    """Lower bound of the distance of two nodes, and its direction."""
    a, b, state = search.a, search.b, body_search_at(search.state, 0)
    state.pairs += 1.0
    way = (state.key_way[0], state.key_way[1], state.key_way[2])
    key = state.key
    bound = max(key, ball_bound(a, i, b, j, search.pose, search.errors.slack))
    if bound < state.limit:
        bound = max(bound, parted_bound(search, i, j))
    if bound < state.limit and (is_outside(a, i) or is_outside(b, j)):
        bound = math.inf
    if bound < state.limit and links_of(a, i).spine != NONE and links_of(b, j).spine != NONE:
        bound = max(bound, spine_bound(a, links_of(a, i).spine, b, links_of(b, j).spine, search.pose))
        if bound < state.limit and are_rings(search, i, j):
            bound = max(bound, rings_bound(search, links_of(a, i).spine, links_of(b, j).spine))
    if bound < state.limit and not (is_group(a, i) or is_group(b, j)):
        if flat_is_elsewhere(a, i, b, j, search.pose, search.errors.slack):
            bound = math.inf
        else:
            bound = bound_patches(search, i, j, bound)
    tie = packed_way((state.key_way[0], state.key_way[1], state.key_way[2]))
    # The next halves of the same pair start from the same bound and direction as these.
    state.key = key
    state.key_way[0], state.key_way[1], state.key_way[2] = way
    return bound, tie


@kernel(inline=True)
def search_ended(search, top, left):
    """The status with which the search ends; -1: it goes on, and the next pair's direction is unpacked from its tie."""
    state = body_search_at(search.state, 0)
    state.lower = max(min(top, state.upper), 0.0)
    status = ended(search.question, state.upper, search.errors.step, max(top, 0.0), left, state.pairs)
    if status >= 0:
        return status
    first = waiting_pair_at(search.heap, 0)
    i, j = int(first.a), int(first.b)
    if (left + 1) * PAIR > search.heap.size or not (has_room(search.a, i) and has_room(search.b, j)):
        return CROWDED
    state.key = first.bound
    state.key_way[0], state.key_way[1], state.key_way[2] = unpacked_way(first.tie)
    return -1


@kernel(inline=True)
def size_to_split(tree, k):
    """Size by which the node to halve is chosen: a group, bounded by its ball alone, counts more than a patch."""
    return node_size(tree, k) * (_GROUP_WEIGHT if is_group(tree, k) else 1.0)


@kernel(inline=True)
def branch(search, key, i, j):
    """The halves of the longer of two nodes with the other one; none where the pair is let go."""
    a, b, state = search.a, search.b, body_search_at(search.state, 0)
    state.popped += 1.0
    if is_worth_parting(search):
        part_bodies(search)
    apart = parted_bound(search, i, j)
    if apart >= state.limit:
        return max(key, apart), NO_PAIRS
    if state.popped >= state.next_descent and not (is_group(a, i) or is_group(b, j)):
        # A smaller U prunes more pairs: descend from the pair of the least bound.
        state.next_descent += _FIRST_DESCENT + state.popped / 16.0
        x = patch_work_at(search.w, 0).place
        x[0] = x[1] = x[2] = x[3] = 0.5
        descend_from_nodes(search, i, j)
    ends_a, ends_b = links_of(a, i).depth >= DEEPEST, links_of(b, j).depth >= DEEPEST
    size_a, size_b = size_to_split(a, i), size_to_split(b, j)
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
    """Descend both trees to the halves whose middles are nearest, then minimize the distance from these."""
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
    """Descend from corners of untrimmed patches; there are some, as boundary curves of trimmed faces are patches."""
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
    """The pose of b relative to a, each about its own center, from the poses of both."""
    turn_a = rotation(q, 0)
    relative = relative_pose(q, 0, turn_a, 1, rotation(q, 1))
    center_a, center_b = body_head_at(a.pool, 0).center, body_head_at(b.pool, 0).center
    shift = sub(add(relative.shift, matvec(relative.rotation, center_b)), center_a)
    size = norm(relative.shift) + norm(center_a) + norm(center_b)
    return BodyPose(relative.rotation, shift, 16.0 * UNIT * size)


@kernel(inner=True)
def start(search):
    """Reset the state of the search, and find first points of both bodies."""
    state = body_search_at(search.state, 0)
    state.upper = state.limit = state.let_go = state.parted = math.inf
    state.parted_pairs = 0.0
    state.lower = state.pairs = state.popped = state.descents = state.key = 0.0
    state.next_descent = _FIRST_DESCENT
    state.rings[0] = state.rings[1] = NONE
    state.way[0] = state.way[1] = 0.0
    state.way[2] = 1.0
    start_from_nearest_middles(search)
    if state.upper == math.inf:
        start_from_corners(search)
    state.key_way[0], state.key_way[1], state.key_way[2] = state.way[0], state.way[1], state.way[2]


_TREE = "Tuple((i8[::1], f8[::1], i8[::1], f8[::1], f8[::1]))"


@kernel(signatures=f"({_TREE}, {_TREE}, f8[:, ::1], UniTuple(f8, 3), f8[::1], UniTuple(f8[::1], 4), i8)")
def search_bodies(a, b, q, asked, heap, work, left):
    """Bounds of the distance of two bodies at poses q (2, 7) into BODY_SEARCH; a status, and how many pairs wait.

    `asked`: a BodyQuestion; `work`: the arrays state, pair, w and room of a BodySearch; `left`: how many pairs wait
    when an earlier search is continued, below zero for a new one.
    """
    tree_a, tree_b = BodyTree(*a), BodyTree(*b)
    pose = relative_pose_of(tree_a, tree_b, q)
    question = BodyQuestion(*asked)
    errors = errors_of(tree_a, tree_b, pose, question)
    search = BodySearch(tree_a, tree_b, pose, heap, work[0], work[1], work[2], work[3], errors, question)
    pairs = NO_PAIRS
    if left < 0:
        start(search)
        left, pairs = 0, Pairs(0, 1, 0, 1)
    status, left = advance(search, left, pairs)
    write_points(search, q)
    write_facing(search)
    return status, left
