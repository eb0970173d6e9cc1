"""Bounds of all patches of two bodies along one direction: where a plane parts the bodies, one look ends the search.

The support of a node is a lower bound of n.P of its points, for one unit vector n: of a patch the least of its control
points, or that of the elementary surface on which it lies, of a trimmed plane that of its boundary, within whose hull
it is; of a group the least of its patches. Supports of two nodes
bound their distance as control points do, for groups as well. So they bound the distance of two convex bodies by itself
if n is along their nearest points; and the patches with the least supports are where a search for these goes on.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.distance.bodies.descent import body_search_at, descend_from_nodes
from assembly.distance.bodies.nodes import is_group, links_of, node_of, patch_of
from assembly.distance.bodies.pair import least_of
from assembly.distance.bodies.records import NONE, body_head_at, spine_at
from assembly.distance.bodies.spines import PLANE
from assembly.distance.patches.pair import patch_work_at
from assembly.geometry.splines.bezier_pieces import UNIT
from assembly.geometry.vec import dot, matvec_t, neg

# Supports of so many patches take about the time of one pair's bound.
_PATCHES = 16.0
# How often a search goes on from the patches with the least supports.
_TURNS = 8


@kernel(inline=True)
def is_planted(tree, k):
    """Whether a node is a group or a whole patch: only these have supports."""
    return k < 2 * int(body_head_at(tree.pool, 0).patches) - 1


@kernel(inline=True)
def least_of_border(tree, k, side):
    """The least support of the boundary of the trimmed plane that patch k is of."""
    face, m, least = patch_of(tree, k).face, patch_of(tree, k).border, math.inf
    off = spine_at(tree.pool, patch_of(tree, k).spine).off
    count = int(body_head_at(tree.pool, 0).patches)
    while m < count and patch_of(tree, m).face == face:
        least = min(least, node_of(tree, patch_of(tree, m).node).support[side])
        m += 1
    return least - 2.0 * off


@kernel(inner=True)
def write_supports(tree, side, n):
    """Write the supports of all groups and patches of a body that is on a side of a search; the node of the least."""
    least, best = math.inf, 0
    count = int(body_head_at(tree.pool, 0).patches)
    # Curves of boundaries are behind the patches of faces.
    for m in range(count - 1, -1, -1):
        patch = patch_of(tree, m)
        support = least_of(tree, patch.node, n)
        if patch.border != NONE and patch.spine != NONE and spine_at(tree.pool, patch.spine).kind == PLANE:
            support = max(support, least_of_border(tree, m, side))
        node_of(tree, patch.node).support[side] = support
        if support < least:
            least, best = support, patch.node
    for k in range(2 * count - 2, -1, -1):
        if is_group(tree, k):
            half = links_of(tree, k).halves
            node_of(tree, k).support[side] = min(
                node_of(tree, half).support[side], node_of(tree, half + 1).support[side]
            )
    return best


@kernel(inline=True)
def parted_bound(search, i, j):
    """Lower bound of the distance of two nodes by their supports; -inf where they have none."""
    state, a, b = body_search_at(search.state, 0), search.a, search.b
    if state.parted < math.inf and is_planted(a, i) and is_planted(b, j):
        low = node_of(a, i).support[0] + node_of(b, j).support[1]
        error = body_head_at(a.pool, 0).error + body_head_at(b.pool, 0).error
        return (low - state.parted_shift) * (1.0 - 16.0 * UNIT) - search.errors.slack - error
    return -math.inf


@kernel(inline=True)
def is_worth_parting(search):
    """Whether supports along the way between the nearest known points cost less than what was spent since the last."""
    state = body_search_at(search.state, 0)
    patches = body_head_at(search.a.pool, 0).patches + body_head_at(search.b.pool, 0).patches
    return state.upper < state.parted and patches > 2.0 and _PATCHES * (state.pairs - state.parted_pairs) >= patches


@kernel(inner=True)
def part_bodies(search):
    """Write supports along the way between the nearest known points, and look for nearer ones where they are least."""
    state, pose, x = body_search_at(search.state, 0), search.pose, patch_work_at(search.w, 0).place
    for _ in range(_TURNS):
        upper, n = state.upper, (state.way[0], state.way[1], state.way[2])
        i = write_supports(search.a, 0, n)
        j = write_supports(search.b, 1, neg(matvec_t(pose.turn, n)))
        state.parted, state.parted_shift = upper, dot(n, pose.shift)
        if parted_bound(search, 0, 0) >= state.limit:
            break
        x[0] = x[1] = x[2] = x[3] = 0.5
        descend_from_nodes(search, i, j)
        if not state.upper < upper:
            break
    state.parted_pairs = state.pairs
