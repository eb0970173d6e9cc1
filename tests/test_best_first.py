"""The heap of pairs, and the search by it, on integers."""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np
import pytest

from assembly._best_first import NO_PAIRS, Pairs, best_first
from assembly._heap import PAIR, drop_first, push, waiting_pair_at
from assembly._record import record_dtype, record_view


def test_pairs_leave_a_heap_in_order():
    rng = np.random.default_rng(1)
    heap = np.empty(60 * PAIR)
    rows = []
    for count in range(60):
        # Few values, so that many are equal.
        rows.append((float(rng.integers(5)), float(rng.integers(3)), count, 2 * count))
        push(heap, count, *rows[-1])
    taken = []
    for count in range(60, 0, -1):
        taken.append(waiting_pair_at(heap, 0).copy().item())
        drop_first(heap, count)
    assert sorted(taken) == sorted(rows)
    assert [row[:2] for row in taken] == sorted(row[:2] for row in rows)


def test_of_equal_pairs_the_newest_goes_first():
    heap = np.empty(4 * PAIR)
    for count in range(3):
        push(heap, count, 1.0, 0.0, count, 0)
    assert waiting_pair_at(heap, 0).a == 2


# The first integers of halves of two sorted lists of numbers: a piece is [begin, begin + 2^level) of a list.
STATE = record_dtype("f8", limit=1, let_go=1, upper=1, bounded=1)
state_at = record_view(STATE)
Lists = namedtuple("Lists", "a b heap state")


def bound(search, i, j):
    """Pieces are numbered as a tree: 1 is all of a list, 2 k and 2 k + 1 the halves of k."""
    state_at(search.state, 0).bounded += 1
    (low_a, high_a), (low_b, high_b) = ((rows.min(), rows.max()) for rows in (part(search.a, i), part(search.b, j)))
    return max(low_b - high_a, low_a - high_b, 0.0), 0.0


def part(rows, k):
    level = int(k).bit_length() - 1
    width = len(rows) >> level
    begin = (k - (1 << level)) * width
    return rows[begin : begin + width]


def ended(search, top, left):
    state = state_at(search.state, 0)
    return 0 if left == 0 or top >= state.upper else -1


def branch(search, key, i, j):
    a, b = part(search.a, i), part(search.b, j)
    state = state_at(search.state, 0)
    state.upper = state.limit = min(state.upper, abs(a[0] - b[0]))
    if len(a) > 1:
        return key, Pairs(2 * i, 2 * i + 2, j, j + 1)
    return (key, Pairs(i, i + 1, 2 * j, 2 * j + 2)) if len(b) > 1 else (key, NO_PAIRS)


@pytest.mark.parametrize("seed", range(5))
def test_a_search_finds_the_least_distance(seed):
    rng = np.random.default_rng(seed)
    search = Lists(*(np.sort(rng.uniform(0, 1e3, 64)) for _ in range(2)), np.empty(9000 * PAIR), np.zeros(4))
    state = state_at(search.state, 0)
    state.limit = state.let_go = state.upper = math.inf
    status, left = best_first(state_at, bound, ended, branch)(search, 0, Pairs(1, 2, 1, 2))
    assert status == 0
    assert state.upper == np.abs(search.a[:, None] - search.b).min()
    assert state.bounded < 64 * 64 / 4
    # What was let go, or still waits, is no nearer.
    assert state.let_go >= state.upper and (left == 0 or waiting_pair_at(search.heap, 0).bound >= state.upper)


def test_bounds_below_zero_count_where_they_are_to():
    search = Lists(np.zeros(4), np.zeros(4), np.empty(9 * PAIR), np.zeros(4))
    depths = (-1.0, -4.0, -2.0, -3.0)
    for floor, wanted in ((-math.inf, [1, 3, 2, 0]), (0.0, [3])):
        state = state_at(search.state, 0)
        state.limit = state.let_go = math.inf
        taken = []

        def note(_search, key, i, _j, taken=taken):
            taken.append(int(i))
            return key, NO_PAIRS

        driver = best_first(
            state_at, lambda _search, i, _j: (depths[i], 0.0), lambda _s, _t, left: -(left > 0), note, floor
        )
        driver(search, 0, Pairs(0, 4, 0, 1))
        assert sorted(taken) == [0, 1, 2, 3] and taken[: len(wanted)] == wanted
        assert state.let_go == max(floor, -4.0)
