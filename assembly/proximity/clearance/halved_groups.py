"""A kernel that halves groups of a body's cells recursively: first by parts of faces, then within each part.

Parts are split at the median of their middles along the coordinate axis in which these extend most; cells of a part at
the median of their centers along the principal axis of these.
"""

from __future__ import annotations

from math import copysign, hypot, sqrt

import numpy as np

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of

# A group of cells, the root first. Halves of a group are child and child + 1.
GROUP = record_dtype(
    "i8",
    begin=1,  # where its cells begin in the order of all cells
    end=1,
    first_part=1,  # where its parts begin in the order of all parts
    last_part=1,
    child=1,  # -1 where it is one cell
    whole=1,  # the part that it is, all of it; -1: it is several, or not all of one
)
group_at = record_view(GROUP)
GROUP_SIZE = size_of(GROUP)
# Sweeps of Jacobi's method, of three rotations each: six leave a symmetric matrix (3, 3) diagonal to rounding.
SWEEPS = 6


@kernel(inner=True, allocates=True, exact=True)
def _write_longest(scatter, turn, way):
    """Write the unit eigenvector of the largest eigenvalue of a symmetric matrix (3, 3), which is made diagonal.

    Its component of largest magnitude is made positive.
    """
    for i in range(3):
        for j in range(3):
            turn[i, j] = 1.0 if i == j else 0.0
    for _ in range(SWEEPS):
        for p in range(2):
            for q in range(p + 1, 3):
                if scatter[p, q] == 0.0:
                    continue
                apart, twice = scatter[q, q] - scatter[p, p], 2.0 * scatter[p, q]
                t = twice / (apart + copysign(hypot(apart, twice), apart))
                c = 1.0 / sqrt(1.0 + t * t)
                s = t * c
                for k in range(3):
                    x, y = scatter[k, p], scatter[k, q]
                    scatter[k, p], scatter[k, q] = c * x - s * y, s * x + c * y
                for k in range(3):
                    x, y = scatter[p, k], scatter[q, k]
                    scatter[p, k], scatter[q, k] = c * x - s * y, s * x + c * y
                    x, y = turn[k, p], turn[k, q]
                    turn[k, p], turn[k, q] = c * x - s * y, s * x + c * y
                scatter[p, q] = scatter[q, p] = 0.0
    best = 0
    for k in range(1, 3):
        if scatter[k, k] > scatter[best, best]:
            best = k
    largest = turn[0, best]
    for k in range(1, 3):
        if abs(turn[k, best]) > abs(largest):
            largest = turn[k, best]
    for k in range(3):
        way[k] = turn[k, best] if largest > 0.0 else -turn[k, best]


@kernel(inner=True, allocates=True, exact=True)
def _write_spread(centers, order, work):
    """Write the direction in which centers of cells spread most, into the last row of work (7, 3)."""
    scatter, turn, way = work[:3], work[3:6], work[6]
    for c in range(3):
        way[c] = 0.0
        for k in range(order.size):
            way[c] += centers[order[k], c]
        way[c] /= order.size
    for i in range(3):
        for j in range(3):
            scatter[i, j] = 0.0
            for k in range(order.size):
                scatter[i, j] += (centers[order[k], i] - way[i]) * (centers[order[k], j] - way[j])
    _write_longest(scatter, turn, way)


@kernel(inner=True, allocates=True, exact=True)
def _sort(order, along):
    """Sort an order by values, which are sorted as well; equals stay in order."""
    for k in range(1, order.size):
        item, x = order[k], along[k]
        place = k
        while place > 0 and along[place - 1] > x:
            along[place], order[place] = along[place - 1], order[place - 1]
            place -= 1
        along[place], order[place] = x, item


@kernel(inner=True, allocates=True, exact=True)
def _halve_parts(middles, parts, along):
    """Sort parts along the axis in which their middles spread most."""
    axis, most = 0, -1.0
    for c in range(3):
        low = high = middles[parts[0], c]
        for k in range(1, parts.size):
            low, high = min(low, middles[parts[k], c]), max(high, middles[parts[k], c])
        if high - low > most:
            axis, most = c, high - low
    for k in range(parts.size):
        along[k] = middles[parts[k], axis]
    _sort(parts, along[: parts.size])


@kernel(inner=True, allocates=True, exact=True)
def _halve_cells(centers, order, along, work):
    """Sort the cells of a part along the direction in which their centers spread most."""
    _write_spread(centers, order, work)
    way = work[6]
    for k in range(order.size):
        x = order[k]
        along[k] = centers[x, 0] * way[0] + centers[x, 1] * way[1] + centers[x, 2] * way[2]
    _sort(order, along[: order.size])


@kernel(inner=True, allocates=True, exact=True)
def _write_middles(centers, part, sizes, middles):
    """How many cells every part has, and the middles of their centers."""
    sizes[:] = 0
    middles[:] = 0.0
    for k in range(part.size):
        sizes[part[k]] += 1
        for c in range(3):
            middles[part[k], c] += centers[k, c]
    for p in range(sizes.size):
        for c in range(3):
            middles[p, c] /= max(sizes[p], 1)


@kernel(signatures="(f8[:,::1], i8[::1], i8, i8[::1], i8[:,::1])", allocates=True, exact=True)
def halve_groups(centers, part, many, order, groups):
    """Write all groups of cells down to single ones.

    Parameters
    ----------
    centers, part : (n, 3), (n,)
        Of every cell its center, and the part that it is of.
    many : int
        The number of parts.
    order : (n,)
        Output: the cells, in an order in which those of every group are contiguous.
    groups : (2 n - 1, GROUP_SIZE)
    """
    count = part.size
    sizes, middles, parts = np.empty(many, np.int64), np.empty((many, 3)), np.empty(many, np.int64)
    _write_middles(centers, part, sizes, middles)
    along, work, waiting = np.empty(max(count, many)), np.empty((7, 3)), np.empty(count + 1, np.int64)
    present = 0
    for p in range(many):
        if sizes[p] > 0:
            parts[present] = p
            present += 1
    root = group_at(groups, 0)
    root.begin, root.end, root.first_part, root.last_part, root.whole = 0, count, 0, present, -1
    waiting[0], used, left = 0, 1, 1
    if present == 1:
        root.whole = parts[0]
        for k in range(count):
            order[k] = k
    while left > 0:
        left -= 1
        group = group_at(groups, waiting[left])
        group.child = -1
        if group.end - group.begin == 1:
            continue
        group.child = used
        one, other = group_at(groups, used), group_at(groups, used + 1)
        one.begin, other.end = group.begin, group.end
        one.first_part, other.last_part = group.first_part, group.last_part
        one.whole = other.whole = -1
        if group.last_part - group.first_part > 1:
            _halve_parts(middles, parts[group.first_part : group.last_part], along)
            half = group.first_part + (group.last_part - group.first_part) // 2
            one.last_part = other.first_part = half
            middle = group.begin
            for k in range(group.first_part, half):
                middle += sizes[parts[k]]
            one.end = other.begin = middle
            _lay_out(one, part, parts, order)
            _lay_out(other, part, parts, order)
        else:
            _halve_cells(centers, order[group.begin : group.end], along, work)
            one.end = other.begin = group.begin + (group.end - group.begin) // 2
            one.last_part, other.first_part = group.last_part, group.first_part
        waiting[left], waiting[left + 1] = used + 1, used
        left += 2
        used += 2


@kernel(inner=True, allocates=True, exact=True)
def _lay_out(group, part, parts, order):
    """Write the cells of a group that is one part into their places in the order."""
    if group.last_part - group.first_part != 1:
        return
    group.whole = parts[group.first_part]
    place = group.begin
    for k in range(part.size):
        if part[k] == group.whole:
            order[place] = k
            place += 1
