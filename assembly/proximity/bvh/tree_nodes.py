"""The nodes of a tree over elements: halved at the median along the longest extent of their middles."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.proximity.bvh.normal_cones import FULL, cone_of_cones, exact_length

# The elements below the nodes, one a row.
LEAF_DTYPE = record_dtype(
    "f8",
    cone=4,  # axis and half angle of its normals
    low=3,  # box
    high=3,
    points=(4, 3),  # corners: the element is within `beyond` of their hull
    beyond=1,  # that distance
    middle=3,  # of its box
)
leaf_at = record_view(LEAF_DTYPE)
LEAF = size_of(LEAF_DTYPE)
# A node, see `facet_tree.Nodes`.
NODE_ROW_DTYPE = record_dtype("f8", low=3, high=3, radius=1, axis=3, half_angle=1)
node_row_at = record_view(NODE_ROW_DTYPE)
NODE_ROW = size_of(NODE_ROW_DTYPE)


@kernel(inner=True, exact=True)
def _measure_node(leaves, items, first, stop, node):
    """Box, ball and cone around the items from first to stop; along which axis their middles extend most."""
    low, high = (math.inf, math.inf, math.inf), (-math.inf, -math.inf, -math.inf)
    least, most = low, high
    for k in range(first, stop):
        leaf = leaf_at(leaves, items[k])
        a, b, c = leaf.low, leaf.high, leaf.middle
        low = (min(low[0], a[0]), min(low[1], a[1]), min(low[2], a[2]))
        high = (max(high[0], b[0]), max(high[1], b[1]), max(high[2], b[2]))
        least = (min(least[0], c[0]), min(least[1], c[1]), min(least[2], c[2]))
        most = (max(most[0], c[0]), max(most[1], c[1]), max(most[2], c[2]))
    middle = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])
    reach = 0.0
    for k in range(first, stop):
        leaf = leaf_at(leaves, items[k])
        p = leaf.points
        farthest = 0.0
        for i in range(4):
            d = exact_length(p[i, 0] - middle[0], p[i, 1] - middle[1], p[i, 2] - middle[2])
            farthest = max(farthest, d)
        reach = max(reach, farthest + leaf.beyond)
    size = exact_length(high[0] - low[0], high[1] - low[1], high[2] - low[2])
    node.radius = min(reach, 0.5 * size) * (1.0 + 1e-14)
    if stop - first == 1:
        cone = leaf_at(leaves, items[first]).cone
        axis, half = (cone[0], cone[1], cone[2]), cone[3]
    else:
        axis, half = cone_of_cones(leaves, items, first, stop)
    for m in range(3):
        node.low[m], node.high[m], node.axis[m] = low[m], high[m], axis[m]
    node.half_angle = min(half, FULL)
    spread = most[0] - least[0], most[1] - least[1], most[2] - least[2]
    if spread[1] > spread[0]:
        return 2 if spread[2] > spread[1] else 1
    return 2 if spread[2] > spread[0] else 0


@kernel(inner=True)
def _merge(leaves, axis, items, first, middle, stop, spare):
    """Merge two sorted parts of the items, equal ones in their order."""
    for k in range(first, middle):
        spare[k] = items[k]
    i, j, k = first, middle, first
    while i < middle:
        if j < stop and leaf_at(leaves, items[j]).middle[axis] < leaf_at(leaves, spare[i]).middle[axis]:
            items[k] = items[j]
            j += 1
        else:
            items[k] = spare[i]
            i += 1
        k += 1


@kernel(inner=True)
def _sort(leaves, axis, items, first, stop, spare):
    """Sort items by the middles of their boxes along an axis, equal ones in their order."""
    width = 1
    while width < stop - first:
        for k in range(first, stop - width, 2 * width):
            _merge(leaves, axis, items, k, k + width, min(k + 2 * width, stop), spare)
        width *= 2


@kernel(signatures="(f8[:, ::1], i8[:, ::1], i8[:, ::1], i8[::1], f8[:, ::1])")
def write_nodes(leaves, items, ranges, child, out):
    """Nodes over leaves, rows LEAF, as rows NODE_ROW, level by level; `child` as in `facet_tree.Nodes`.

    `items` (2, n) and `ranges` (m, 2) are workspaces.
    """
    count = len(leaves)
    order, spare = items[0], items[1]
    for k in range(count):
        order[k] = k
    ranges[0, 0], ranges[0, 1] = 0, count
    used = 1
    for k in range(len(out)):
        first, stop = ranges[k, 0], ranges[k, 1]
        axis = _measure_node(leaves, order, first, stop, node_row_at(out, k))
        child[k] = -1 - order[first]
        if stop - first > 1:
            _sort(leaves, axis, order, first, stop, spare)
            child[k] = used
            middle = first + (stop - first) // 2
            ranges[used, 0], ranges[used, 1] = first, middle
            ranges[used + 1, 0], ranges[used + 1, 1] = middle, stop
            used += 2
