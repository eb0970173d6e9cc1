"""Groups of cells are halved at medians, parts of faces first, down to single cells."""

from __future__ import annotations

import numpy as np
import pytest

from assembly._record import rows_of
from assembly.proximity.clearance.halved_groups import GROUP, GROUP_SIZE, halve_groups


def halved(centers, part, many):
    count = len(part)
    order, table = np.empty(count, dtype=np.int64), np.empty((2 * count - 1, GROUP_SIZE), dtype=np.int64)
    halve_groups(centers, part, many, order, table)
    return order, rows_of(GROUP, table)


def cells(rng):
    count, many = int(rng.integers(1, 60)), int(rng.integers(1, 8))
    part = np.sort(rng.integers(0, many, count))
    scale = rng.uniform(0.0, 3.0, 3) * (rng.random(3) < 0.8)
    return rng.normal(size=(count, 3)) * scale, part.astype(np.int64), many


def test_groups_are_halves_of_groups(cases):
    rng = np.random.default_rng(0)
    for _ in range(cases(200, 5000)):
        centers, part, many = cells(rng)
        order, groups = halved(centers, part, many)
        assert sorted(order.tolist()) == list(range(len(part)))
        assert (groups.begin[0], groups.end[0]) == (0, len(part))
        for group in groups:
            own = part[order[group.begin : group.end]]
            if group.child < 0:
                assert len(own) == 1
                continue
            one, other = groups[group.child], groups[group.child + 1]
            assert (one.begin, one.end, other.end) == (group.begin, other.begin, group.end)
            distinct = np.unique(own)
            if len(distinct) > 1:
                # Parts stay whole, half of them on either side.
                left = np.unique(part[order[one.begin : one.end]])
                assert len(left) == len(distinct) // 2
                assert not set(left) & set(part[order[other.begin : other.end]])
            else:
                assert one.end - one.begin == len(own) // 2
            is_whole = len(distinct) == 1 and len(own) == np.count_nonzero(part == distinct[0])
            assert group.whole == (distinct[0] if is_whole else -1)


def test_cells_of_a_part_are_parted_where_they_spread_most(cases):
    """By the longest principal direction, as numpy's singular values have it."""
    rng = np.random.default_rng(1)
    for _ in range(cases(200, 5000)):
        centers = rng.normal(size=(int(rng.integers(3, 50)), 3)) * rng.uniform(0.1, 3.0, 3) @ rng.normal(size=(3, 3))
        order, groups = halved(np.ascontiguousarray(centers), np.zeros(len(centers), dtype=np.int64), 1)
        sizes, ways = np.linalg.svd(centers - centers.mean(axis=0), full_matrices=False)[1:]
        if sizes[0] < 1.001 * sizes[1]:
            continue
        heights = centers[order] @ ways[0]
        middle = groups.end[groups.child[0]]
        low, high = sorted((heights[:middle], heights[middle:]), key=np.mean)
        assert low.max() <= high.min() + 1e-9 * np.ptp(heights)


def test_equal_centers_are_halved_in_their_order():
    order, groups = halved(np.ones((7, 3)), np.zeros(7, dtype=np.int64), 1)
    assert order.tolist() == list(range(7))
    assert groups.child[0] == 1


@pytest.mark.parametrize("scale", [1e-150, 1e100])
def test_sizes_do_not_matter(scale):
    centers = np.random.default_rng(2).normal(size=(20, 3))
    part = np.repeat(np.arange(4), 5)
    order, groups = halved(centers, part, 4)
    other, again = halved(scale * centers, part, 4)
    assert order.tolist() == other.tolist()
    assert groups.child.tolist() == again.child.tolist()
