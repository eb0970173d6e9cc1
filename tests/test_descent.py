"""The walk down two trees, on intervals of integers."""

from __future__ import annotations

import numpy as np
import pytest

from assembly._descent import NONE, STOP, descend_pairs

LEAVES = 8


def interval(rows, k):
    """Rows of node k: 0 is all of them, 2 k + 1 and 2 k + 2 are the halves of k."""
    level = int(k + 1).bit_length() - 1
    width = len(rows) >> level
    begin = (k + 1 - (1 << level)) * width
    return rows[begin : begin + width]


def nearer(walk, i, j, found):
    """A step to pairs of numbers that are nearer than a reach, or to as many of them as are asked for."""
    a, b, reach, most = walk
    f, g = interval(a, i), interval(b, j)
    if max(g.min() - f.max(), f.min() - g.max()) >= reach:
        return found, True, NONE, NONE
    if len(f) == len(g) == 1:
        return [*found, (i, j)], True, NONE, STOP if len(found) + 1 == most else NONE
    on_f = len(f) >= len(g)
    first = 2 * (i if on_f else j) + 1
    return found, on_f, first, first + 1


def rows_of(seed):
    rng = np.random.default_rng(seed)
    return np.sort(rng.integers(0, 60, LEAVES)), np.sort(rng.integers(0, 60, LEAVES))


@pytest.mark.parametrize("seed", range(5))
def test_all_pairs_are_found_the_last_ones_first(seed):
    a, b = rows_of(seed)
    found, fits = descend_pairs(nearer)((a, b, 9, -1), [], np.empty((12, 2), dtype=np.int64))
    leaf = LEAVES - 1
    wanted = [(leaf + i, leaf + j) for i in range(LEAVES) for j in range(LEAVES) if abs(a[i] - b[j]) < 9]
    assert fits and sorted(found) == wanted
    assert found[0] == max(found)


def test_a_step_may_end_the_walk():
    a, b = rows_of(1)
    stack = np.empty((12, 2), dtype=np.int64)
    all_of_them, _fits = descend_pairs(nearer)((a, b, 9, -1), [], stack)
    assert descend_pairs(nearer)((a, b, 9, 2), [], stack) == (all_of_them[:2], True)


def test_a_short_stack_is_told():
    a, b = rows_of(2)
    for size in (0, 1, 3):
        assert not descend_pairs(nearer)((a, b, 60, -1), [], np.empty((size, 2), dtype=np.int64))[1]
