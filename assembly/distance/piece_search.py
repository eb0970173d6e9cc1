"""What searches over pieces of curves and over patches share: the question, the trees of pieces, and when it is over.

A tree of pieces grows as pieces are halved. Each shape is packed relative to a center of its own.
"""

from __future__ import annotations

from collections import namedtuple

from assembly._heap import PAIR, longer
from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.geometry.splines.bezier_pieces import UNIT

# What a search ended with.
CONVERGED, APART, NEAR, UNDECIDED, SPENT, MEETING = 0, 1, 2, 3, 4, 5
# The arrays are too small to go on.
CROWDED = 7
# tolerance: of the two bounds [length]; clearance: below zero the distance itself is asked for [length]; budget: pairs
# of pieces that may be bounded; polish: whether Newton's method and proofs of a single minimum help.
Question = namedtuple("Question", "tolerance clearance budget polish")
# A packed shape, and the nodes that a search made of it: their integers and their doubles.
PieceTree = namedtuple("PieceTree", "record pool ints nodes")
# What a search keeps.
PIECE_SEARCH_STATE = record_dtype(
    "f8",
    limit=1,  # pairs of at least this bound are pruned [length]
    let_go=1,  # the least bound of the pruned pairs [length]
    used_a=1,  # nodes of the trees
    used_b=1,
    met=1,  # 1: a meeting is proven
)
search_state_at = record_view(PIECE_SEARCH_STATE)
STATE = size_of(PIECE_SEARCH_STATE)


@kernel(inline=True)
def bound_to_beat(question, upper, step):
    """The limit: pairs whose lower bound is at least this are pruned."""
    limit = upper - step
    if question.clearance >= 0.0:
        limit = min(limit, question.clearance * (1.0 + 4.0 * UNIT) + 1e-300)
    return limit


@kernel(inline=True)
def ended(question, upper, step, top, left, bounded):
    """The status with which a search with `left` pairs in its heap ends; -1: it goes on."""
    if question.clearance >= 0.0:
        if upper <= question.clearance:
            return NEAR
        if top > question.clearance:
            return APART
    if left == 0 or upper - top <= step:
        return UNDECIDED if question.clearance >= 0.0 else CONVERGED
    return SPENT if bounded >= question.budget else -1


@kernel(inline=True)
def is_answered(question, upper, step, bound):
    """Whether pairs of at least this bound can no longer change the answer."""
    return bound >= upper - step or bound > question.clearance >= 0.0


@kernel(inline=True)
def is_full(tree, used, size):
    """Whether a tree has no room for two more nodes of `size` integers each."""
    return (used + 2) * size > tree.ints.size


@kernel(inline=True)
def crowded(search, left, size):
    """Whether the arrays of a search are too small for another halving."""
    state = search_state_at(search.state, 0)
    full = is_full(search.a, state.used_a, size) or is_full(search.b, state.used_b, size)
    return full or (left + 1) * PAIR > search.heap.size


@kernel(inner=True, allocates=True)
def roomier(search, left, size):
    """The trees and the heap of a search, copied to larger arrays where theirs are full."""
    state = search_state_at(search.state, 0)
    a, b, heap = search.a, search.b, search.heap
    if is_full(a, state.used_a, size):
        a = PieceTree(a.record, a.pool, longer(a.ints, 4 * a.ints.size), longer(a.nodes, 4 * a.nodes.size))
    if is_full(b, state.used_b, size):
        b = PieceTree(b.record, b.pool, longer(b.ints, 4 * b.ints.size), longer(b.nodes, 4 * b.nodes.size))
    if (left + 1) * PAIR > heap.size:
        heap = longer(heap, 4 * heap.size)
    return a, b, heap


@kernel(inline=True)
def in_span(pool, at, u):
    """The parameter at the place u, from 0 to 1, of the span that begins at pool[at]; clamped to it after rounding."""
    low = pool[at]
    high = pool[at + 1]
    return min(max(low * (1.0 - u) + high * u, low), high)
