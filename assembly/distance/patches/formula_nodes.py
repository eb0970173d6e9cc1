"""Pieces of a curve given by a formula as patches of degrees 2 and 0, for the search of `distance/patches/search.py`.

A patch search uses the box of a patch and its quadratic model with a proven remainder (`distance/patches/nodes.py`).
For a formula both come from interval arithmetic: with the middle m of [t0, t1], h the width, t = m + h z and z in
[-1/2, 1/2],

    |C(t) - (A0 + J z + K z^2 / 2)| <= E0,    |h C' - (J + K z)| <= E1,    |h^2 C'' - K| <= E2

hold with A0, J and K the computed C(m), h C'(m) and h^2 C''(m). Beside the errors of these, each remainder is the least
of

    third derivatives     E0 = s / 48,  E1 = s / 8,  E2 = s / 2,    s = h^3 sup |C'''|
    second derivatives    E0 = v / 8,   E1 = v / 2,  E2 = v,        v = h^2 sup |C'' - C''(m)|
    a kink, K = 0         E0 = r / 2,   E1 = r,                     r = h sup |C' - C'(m)|
    a vertical, J = 0     E0 = sup |C - C(m)|

An unknown remainder is NONE, a number too large for any proof, whose products still do not overflow. The rows are the
model's Bezier points. A curve is (table, pool, workspace) of `geometry/expression/formula.py`, about its center.

At a kink or a vertical tangent bounds improve only in proportion to h, while about 1 / h patches remain candidates. So
a piece without second derivatives is halved before any patch is. One that is short against the tolerance, or has no
double inside its interval, is a dot: J = K = 0, its parameter is not one of the pair's, and what is proven for one of
its points holds for all of them up to 2 E0.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import Store, place_of, record_dtype, record_view
from assembly.distance.patches.nodes import (
    DEEPEST,
    ROWS,
    patch_links_of,
    patch_node_at,
    patch_node_of,
)
from assembly.distance.patches.pair import patch_work_at
from assembly.geometry.expression.formula import (
    RESULTS,
    formula_head_at,
    formula_workspace_at,
    point_bounds,
    range_bounds,
    refine,
)
from assembly.geometry.interval import EPSILON, idifference, magnitude, middle_of, most, off_of, up
from assembly.geometry.splines.bezier_ranges import WEIGHTED, weighted_point_at

NONE = 1e100
# What is known of an interval.
RANGES = record_dtype(
    "f8",
    over=24,  # pairs of C, C', C'', C''' over it
    middle=18,  # pairs of C, C', C'' in its middle
)
ranges_at = record_view(RANGES)
# Where the pairs of a derivative begin among them.
_SPEED, _BEND, _JERK, _MIDDLE = 6, 12, 18, place_of(RANGES, "middle")


@kernel(inline=True)
def half_width(t0, t1):
    """Half the width of an interval about its middle as a double, rounded up."""
    middle = 0.5 * (t0 + t1)
    return up(max(middle - t0, t1 - middle))


@kernel(inner=True)
def set_interval(tree, k, t0, t1):
    """Node k for [t0, t1], not described yet."""
    links = patch_links_of(tree, k)
    node = patch_node_of(tree, k)
    node.away = 0.0
    node.low_u, node.high_u = t0, t1
    node.low_v, node.high_v = 0.0, 1.0
    links.halves = -1
    links.patch = 0
    # An interval with no double inside cannot be halved.
    links.depth = 0 if t0 < 0.5 * (t0 + t1) < t1 else DEEPEST


@kernel(inner=True)
def start_formula(curve, tree):
    """All of the curve as node 0."""
    pool = curve[1]
    head = formula_head_at(pool, 0)
    set_interval(tree, 0, head.domain[0], head.domain[1])


@kernel(inner=True)
def split_formula(tree, k, low):
    """Make the halves of node k as nodes low and low + 1, not described yet."""
    node = patch_node_of(tree, k)
    t0, t1 = node.low_u, node.high_u
    middle = 0.5 * (t0 + t1)
    patch_links_of(tree, k).halves = low
    set_interval(tree, low, t0, middle)
    set_interval(tree, low + 1, middle, t1)


@kernel(inline=True)
def known_middle(x, o, k):
    """The middle of the k-th of the pairs at x[o:], zero where that is not known."""
    value = middle_of(x, o, k)
    return value if abs(value) < NONE else 0.0


@kernel(inner=True, exact=True)
def spread(x, o, m):
    """Largest distance of a vector in the three pairs at x[o:] from the middles of those at x[m:], rounded up."""
    total = 0.0
    for k in range(3):
        c = known_middle(x, m, k)
        d = magnitude(idifference((x[o + 2 * k], x[o + 2 * k + 1]), (c, c)))
        total += d * d
    return math.sqrt(total) * (1.0 + 8.0 * EPSILON)


@kernel(inline=True)
def bounded(x):
    """A bound, or NONE where it is at least as large or not a number."""
    return x if x < NONE else NONE


@kernel(inline=True)
def is_dot(nodes, o):
    """Whether a piece counts as a point."""
    return patch_node_at(nodes, o).speed_v < 0.0


@kernel(inner=True, exact=True)
def describe_formula(curve, short, nodes, o, x):
    """Box and model of a piece from its interval; x (42) is for work, `short` the radius of a dot."""
    node = patch_node_at(nodes, o)
    table, pool, workspace = curve
    t0 = node.low_u
    t1 = node.high_u
    half = half_width(t0, t1)
    h = 2.0 * half
    ranges = ranges_at(x, 0)
    results = formula_workspace_at(workspace, 0).results
    range_bounds(Store(table, pool), t0, t1, workspace)
    for k in range(24):
        ranges.over[k] = results[k]
    point_bounds(Store(table, pool), 0.5 * (t0 + t1), workspace)
    for k in range(18):
        ranges.middle[k] = results[k]
    refine(x, 0, half, _MIDDLE)
    for k in range(3):
        c = known_middle(x, 0, k)
        r = bounded(up(max(x[2 * k + 1] - c, c - x[2 * k])))
        node.box_center[k] = c
        node.box_half[k] = r
    speed = h * most(x, _SPEED)
    grow = 1.0 + 64.0 * EPSILON
    off = off_of(x, _MIDDLE)
    off_j = h * off_of(x, _MIDDLE + _SPEED)
    off_k = h * h * off_of(x, _MIDDLE + _BEND)
    third = h * h * h * most(x, _JERK)
    second = h * h * spread(x, _BEND, _MIDDLE + _BEND)
    first = h * spread(x, _SPEED, _MIDDLE + _SPEED)
    j = h
    k2 = h * h
    e0 = min(third / 48.0 + 0.125 * off_k, 0.125 * second) + off + 0.5 * off_j
    e1 = min(0.125 * third + 0.5 * off_k, 0.5 * second) + off_j
    e2 = min(0.5 * third + off_k, second)
    dot = 0.0
    if not (e0 < NONE and off_k < NONE):
        # Halved first, until it is a dot.
        speed = NONE
        k2 = 0.0
        e0 = 0.5 * first + off
        e1 = first
        e2 = NONE
        radius = spread(x, 0, _MIDDLE)
        if radius <= short or not t0 < 0.5 * (t0 + t1) < t1:
            dot = -1.0
            speed = 0.0
        if dot < 0.0 or not e0 < NONE:
            j = 0.0
            e0 = radius
            e1 = NONE
    node.speed_u = bounded(speed)
    node.speed_v = dot
    # Magnitudes whose parts bound the rounding of products with h and of the sums in the rows.
    size = 0.0
    begin = weighted_point_at(nodes, o + ROWS)
    inner = weighted_point_at(nodes, o + ROWS + WEIGHTED)
    end = weighted_point_at(nodes, o + ROWS + 2 * WEIGHTED)
    for k in range(3):
        a = known_middle(x, _MIDDLE, k)
        slope = j * known_middle(x, _MIDDLE + _SPEED, k)
        bend = k2 * known_middle(x, _MIDDLE + _BEND, k)
        node.a0[k] = a
        node.ju[k] = slope
        node.ju[3 + k] = 0.0
        node.kuu[k] = bend
        node.kuu[3 + k] = 0.0
        node.kuu[6 + k] = 0.0
        begin.position[k] = a - 0.5 * slope + 0.125 * bend
        inner.position[k] = a - 0.125 * bend
        end.position[k] = a + 0.5 * slope + 0.125 * bend
        size += abs(a) + abs(slope) + abs(bend)
    begin.weight = 1.0
    inner.weight = 1.0
    end.weight = 1.0
    node.e0 = bounded(e0 * grow + 8.0 * EPSILON * size)
    node.e1 = bounded(e1 * grow + 8.0 * EPSILON * size)
    node.e2 = bounded(e2 * grow + 8.0 * EPSILON * size)


@kernel(inner=True, exact=True)
def formula_derivatives(curve, nodes, o, x, w):
    """Point of a piece at m + h (x - 1/2); derivatives by z at PATCH_J and PATCH_K.

    Writes to OFF the errors of the point and of the first derivative, and how far z can go back and ahead within the
    piece.
    """
    work = patch_work_at(w, 0)
    node = patch_node_at(nodes, o)
    table, pool, workspace = curve
    t0 = node.low_u
    t1 = node.high_u
    h = 2.0 * half_width(t0, t1)
    t = formula_parameter(nodes, o, x)
    point_bounds(Store(table, pool), t, workspace)
    at = RESULTS
    size = 0.0
    for k in range(3):
        work.patch_j[k] = h * known_middle(workspace, at + _SPEED, k)
        work.patch_k[k] = h * h * known_middle(workspace, at + _BEND, k)
        size += abs(work.patch_j[k])
    work.off[0] = bounded(off_of(workspace, at))
    work.off[1] = bounded(h * off_of(workspace, at + _SPEED) + 2.0 * EPSILON * size)
    work.off[2] = up(up(t - t0) / h)
    work.off[3] = up(up(t1 - t) / h)
    return known_middle(workspace, at, 0), known_middle(workspace, at, 1), known_middle(workspace, at, 2)


@kernel(inline=True)
def formula_parameter(nodes, o, x):
    """The curve's parameter of a place on a piece, as `formula_derivatives` takes it."""
    node = patch_node_at(nodes, o)
    t0 = node.low_u
    t1 = node.high_u
    t = 0.5 * (t0 + t1) + 2.0 * half_width(t0, t1) * (x - 0.5)
    return min(max(t, t0), t1)
