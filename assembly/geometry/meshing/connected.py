"""A kernel that finds the triangles on one side of a border.

Triangles that share an edge outside the border are joined into parts; the border edges of each part decide on which
side it is.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel


@kernel(inline=True)
def _place_of(key, keys):
    """Where a key is among sorted ones, or -1."""
    low, high = 0, keys.size
    while low < high:
        middle = (low + high) // 2
        if keys[middle] < key:
            low = middle + 1
        else:
            high = middle
    return low if low < keys.size and keys[low] == key else -1


@kernel(inline=True)
def _edge_at(a, b, count, keys, order):
    """The number of the directed edge from a to b, or -1."""
    place = _place_of(a * count + b, keys)
    return order[place] if place >= 0 else -1


@kernel(inner=True, allocates=True)
def _root_of(parent, k):
    """The triangle that stands for all that k is joined with."""
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@kernel(
    signatures="(i8[:,::1], i8, i8[:,::1], i8[:,::1], i8[::1], i8[::1], b1[::1])",
    allocates=True,
)
def mark_inside(triangles, count, border, hull, keys, order, result):
    """Mark the triangles on the left of a border.

    Parameters
    ----------
    triangles : (m, 3)
        Edge 3 t + k leads from corner k of triangle t to the next.
    count : int
        More than the largest number of a vertex.
    border, hull : (k, 2), (h, 2)
        Directed edges: of the border, with the inside on their left; of the hull, with the outside on their right.
    keys, order : (3 m,)
        The sorted values of a count + b for the edges from a to b, and the numbers of those edges.
    result : (m,)
    """
    many = triangles.shape[0]
    parent, votes, joined = np.empty(many, np.int64), np.zeros(many, np.int64), np.ones(3 * many, np.int64)
    for t in range(many):
        parent[t] = t
    for row in range(border.shape[0]):
        for way in range(2):
            edge = _edge_at(border[row, way], border[row, 1 - way], count, keys, order)
            if edge >= 0:
                joined[edge] = 0
    for row in range(hull.shape[0]):
        # No triangles are joined across an edge of the hull.
        for way in range(2):
            edge = _edge_at(hull[row, way], hull[row, 1 - way], count, keys, order)
            if edge >= 0:
                joined[edge] = 0
    for t in range(many):
        for k in range(3):
            other = _edge_at(triangles[t, (k + 1) % 3], triangles[t, k], count, keys, order)
            if joined[3 * t + k] != 0 and other >= 0:
                a, b = _root_of(parent, t), _root_of(parent, other // 3)
                if a != b:
                    parent[max(a, b)] = min(a, b)
    for row in range(border.shape[0]):
        for way in range(2):
            edge = _edge_at(border[row, way], border[row, 1 - way], count, keys, order)
            if edge >= 0:
                votes[_root_of(parent, edge // 3)] += 1 - 2 * way
    for row in range(hull.shape[0]):
        # Right of the hull everything is outside, even where a border along it says otherwise.
        edge = _edge_at(hull[row, 1], hull[row, 0], count, keys, order)
        if edge >= 0:
            votes[_root_of(parent, edge // 3)] -= 3 * many
    for t in range(many):
        result[t] = votes[_root_of(parent, t)] > 0
