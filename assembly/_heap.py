"""A heap of pairs in the order of their bounds, the least first, in one array of records."""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of

# An entry of the queue: a pair of pieces still to be examined.
WAITING_PAIR = record_dtype(
    "f8",
    bound=1,  # lower bound of its distance [length]
    tie=1,  # where bounds are equal, the lesser of these goes first
    a=1,  # numbers of the two pieces
    b=1,
)
waiting_pair_at = record_view(WAITING_PAIR)
PAIR = size_of(WAITING_PAIR)


@kernel(inline=True)
def put_pair(heap, k, bound, tie, a, b):
    """Write pair k of the heap."""
    pair = waiting_pair_at(heap, PAIR * k)
    pair.bound, pair.tie, pair.a, pair.b = bound, tie, a, b


@kernel(inline=True)
def move_waiting(heap, source, target):
    """Copy a pair to another place."""
    pair = waiting_pair_at(heap, PAIR * source)
    put_pair(heap, target, pair.bound, pair.tie, pair.a, pair.b)


@kernel(inline=True)
def goes_before(pair, bound, tie):
    """Whether a pair of the heap goes before another one."""
    return pair.bound < bound or (pair.bound == bound and pair.tie < tie)


@kernel(inner=True)
def push(heap, count, bound, tie, a, b):
    """Add a pair to a heap of `count` pairs. Of equal pairs the newest goes first, so that the search goes deeper."""
    k = count
    while k > 0:
        parent = (k - 1) >> 1
        if goes_before(waiting_pair_at(heap, PAIR * parent), bound, tie):
            break
        move_waiting(heap, parent, k)
        k = parent
    put_pair(heap, k, bound, tie, a, b)


@kernel(inner=True)
def drop_first(heap, count):
    """Remove the first pair of a heap of `count` pairs: the last one takes its place and sinks."""
    count -= 1
    last = waiting_pair_at(heap, PAIR * count)
    bound, tie, a, b = last.bound, last.tie, last.a, last.b
    k = 0
    while True:
        child = 2 * k + 1
        if child >= count:
            break
        below = waiting_pair_at(heap, PAIR * child)
        if child + 1 < count and goes_before(waiting_pair_at(heap, PAIR * (child + 1)), below.bound, below.tie):
            child += 1
        if not goes_before(waiting_pair_at(heap, PAIR * child), bound, tie):
            break
        move_waiting(heap, child, k)
        k = child
    put_pair(heap, k, bound, tie, a, b)


@kernel(inner=True, allocates=True)
def longer(array, size):
    """A longer copy of an array."""
    result = np.empty(size, array.dtype)
    for i in range(array.size):
        result[i] = array[i]
    return result
