"""Best first: branch and bound over pairs of pieces of two shapes, the pair with the least bound next.

U is the distance of the nearest points known, L the least bound of all pairs that wait and of all that were let go:
L <= distance <= U at any time. A pair is let go once its bound is not below the limit, or when nothing can be made of
it; all others are examined, which may lower U, and halved.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable
from typing import Any

from assembly._heap import drop_first, push, waiting_pair_at

__all__ = ["NO_PAIRS", "Pairs", "best_first"]

# Pieces [begin_a, end_a) of one shape with pieces [begin_b, end_b) of the other.
Pairs = namedtuple("Pairs", "begin_a end_a begin_b end_b")
NO_PAIRS = Pairs(0, 0, 0, 0)


def best_first(
    state_at: Callable[..., Any],
    bound: Callable[..., Any],
    ended: Callable[..., Any],
    branch: Callable[..., Any],
    floor: float = 0.0,
) -> Callable[..., Any]:
    """The body of a kernel (search, left, pairs) -> (status, left): a search with `left` pairs in its heap goes on.

    It begins with the pairs that are given. A status may ask for larger arrays, after which the search is taken up with
    no pairs: no array is made here, for the references that are counted then cost as much as a bound.

    Parameters
    ----------
    state_at
        View of search.state, a record with two fields. `limit`: a pair with a bound of at least this is let go; the
        other kernels lower it. `let_go`: the least bound of such pairs, infinite at first; it is kept here.
    bound
        (search, i, j) -> lower bound of the distance of two pieces, and what decides between equal ones.
    ended
        (search, top, left) -> status, or below zero to go on: `top` is L, `left` how many pairs wait in search.heap.
    branch
        (search, bound, i, j) -> a bound of the pair, and the pairs that take its place: none where it is let go.
    floor
        No bound is less than this: 0, as distances are, if it means nothing else below zero.
    """

    def advance(search: Any, left: Any, pairs: Any) -> Any:
        state = state_at(search.state, 0)
        first = waiting_pair_at(search.heap, 0)
        least = floor
        while True:
            for i in range(pairs.begin_a, pairs.end_a):
                for j in range(pairs.begin_b, pairs.end_b):
                    low, tie = bound(search, i, j)
                    low = max(least, low)
                    if low < state.limit:
                        push(search.heap, left, low, tie, i, j)
                        left += 1
                    else:
                        state.let_go = min(state.let_go, low)
            top = min(state.let_go, first.bound) if left > 0 else state.let_go
            status = ended(search, top, left)
            if status >= 0:
                return status, left
            least, i, j = first.bound, int(first.a), int(first.b)
            drop_first(search.heap, left)
            left -= 1
            least, pairs = branch(search, least, i, j)
            if pairs.end_a == pairs.begin_a:
                state.let_go = min(state.let_go, least)

    return advance
