"""The distance of two convex hulls, or a proof that they meet, from their nearest points and one direction."""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.distance.enclosures.enclosure import hull_support
from assembly.distance.enclosures.gjk import (
    INSIDE,
    ROOM,
    VERTEX,
    ConvexSet,
    gjk,
    inside_weights,
    simplex_vertex_at,
    vertex,
    witnesses,
)
from assembly.distance.enclosures.node import (
    NEAR_BY,
    corner_around,
    inside_proven,
    search_state_at,
)
from assembly.distance.enclosures.search import about_center
from assembly.geometry.interval import EPSILON, down, up
from assembly.geometry.vec import dot, sub


@kernel(inner=True)
def differences(g, count):
    """Copy the differences in a simplex to `on_b`, where `inside_proven` reads the vertices of a hull."""
    for k in range(count):
        v = simplex_vertex_at(g, VERTEX * k)
        for c in range(3):
            v.on_b[c] = v.difference[c]


@kernel(inner=True, allocates=True, exact=True)
def overlap_proven(full, a, count_a, b, count_b, slack, g):
    """Whether two hulls about a center are proven to meet: points around zero are inside their Minkowski difference.

    See `surrounded` in `distance/enclosures/node.py`. Overwrites g.
    """
    farthest = 0.0
    for i in range(3 * count_a):
        farthest = max(farthest, abs(a[i]))
    for i in range(3 * count_b):
        farthest = max(farthest, abs(b[i]))
    origin = (0.0, 0.0, 0.0)
    for part in NEAR_BY:
        proven = 0
        for k in range(full):
            moved, off = about_center(a, count_a, corner_around(full, k, part * farthest))
            first = (moved[0] - b[0], moved[1] - b[1], moved[2] - b[2])
            set_a = ConvexSet(moved, 0, count_a, -1.0)
            how, _v, kept = gjk(full, set_a, ConvexSet(b, 0, count_b, -1.0), first, math.inf, 1e-15, g)
            if how != INSIDE:
                break
            differences(g, kept)
            # Differences are rounded once more, by their size at most.
            if not inside_proven(full, g, origin, off + slack + 16.0 * EPSILON * farthest):
                break
            proven += 1
        if proven == full:
            return True
    return False


@kernel(signatures="(i8, f8[::1], i8, f8[::1], i8, f8[::1])", allocates=True)
def hull_distance(full, a, count_a, b, count_b, state):
    """The answer of `search` in `distance/enclosures/search.py`, for two hulls."""
    best = search_state_at(state, 0)
    g = np.zeros(ROOM)
    center = np.empty(3)
    for c in range(3):
        center[c] = a[c]
    a, off_a = about_center(a, count_a, center)
    b, off_b = about_center(b, count_b, center)
    slack = off_a + off_b
    first = (a[0] - b[0], a[1] - b[1], a[2] - b[2])
    set_a, set_b = ConvexSet(a, 0, count_a, -1.0), ConvexSet(b, 0, count_b, -1.0)
    how, v, kept = gjk(full, set_a, set_b, first, math.inf, 1e-15, g)
    lower = 0.0
    if how == INSIDE:
        # The origin is inside a simplex of differences: proven like a point inside a simplex.
        inside_weights(full, g)
        x, y = witnesses(g, kept)
        differences(g, kept)
        first = vertex(g, 0)
        off = 4.0 * EPSILON * (abs(first[0]) + abs(first[1]) + abs(first[2])) + slack
        if inside_proven(full, g, (0.0, 0.0, 0.0), off):
            best.met = 1.0
    else:
        x, y = witnesses(g, kept)
        size = math.sqrt(dot(v, v))
        if size > 0.0:
            n = (-v[0] / size, -v[1] / size, -v[2] / size)
            high = hull_support(a, 0, count_a, n, x) + hull_support(b, 0, count_b, (-n[0], -n[1], -n[2]), x)
            lower = max(0.0, down(-high) * (1.0 - 8.0 * EPSILON) - slack)
    d = sub(x, y)
    off = slack
    for c in range(3):
        best.point_a[c] = x[c] + center[c]
        best.point_b[c] = y[c] + center[c]
        off += 16.0 * EPSILON * (abs(x[c]) + abs(y[c]))
    if best.met == 0.0 and lower == 0.0:
        if overlap_proven(full, a, count_a, b, count_b, slack, g):
            best.met = 1.0
    best.upper = up(math.sqrt(dot(d, d)) * (1.0 + 8.0 * EPSILON) + off)
    best.lower = min(lower, best.upper)
    best.count = 1.0
    return how == INSIDE
