"""A curve's tree of capsules, which answers questions about a clearance that are not close calls.

A node encloses a part of the curve in a capsule: a segment, and all within r of it. r is the largest distance of a
control point from the segment; as this distance is convex, no point of the part is farther. A leaf is a Bezier piece
that begins and ends where its segment does, so that the projections of its points cover the segment: each point of the
segment has a point of the curve within r. For two leaves with segments |m| apart,

    |m| - r_a - r_b <= distance <= |m| + r_a + r_b.

The tree is a heap: the halves of node k are 2 k and 2 k + 1, node 1 is the whole curve, node 0 the head.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of
from assembly.distance.curves.bounds import difference, square_minimum
from assembly.distance.curves.nodes import length, three
from assembly.geometry.splines.bezier_pieces import (
    UNIT,
    bezier_curve_at,
    bezier_head_at,
)
from assembly.geometry.vec import dot

# A node of a tree of capsules.
CAPSULE = record_dtype(
    "f8",
    position=3,  # the segment's middle [length]
    extent=3,  # from its first end to its last [length]
    radius=1,  # below zero: an empty node [length]
    spare=1,
)
capsule_at = record_view(CAPSULE)
EXTENT = place_of(CAPSULE, "extent")
RADIUS = place_of(CAPSULE, "radius")
STRIDE = size_of(CAPSULE)
# The head of such a tree.
CAPSULE_HEAD = record_dtype(
    "f8",
    leaves=1,  # number of the first leaf
    origin=3,  # center of the curve [length]
    extent=1,  # size of the curve [length]
)
capsule_head_at = record_view(CAPSULE_HEAD)
LEAVES = place_of(CAPSULE_HEAD, "leaves")
ORIGIN = place_of(CAPSULE_HEAD, "origin")
# What a comparison says.
FARTHER, NEARER, OPEN = 1, -1, 0
# Pieces that a tree has at least.
_LEAVES = 32
_STACK = 128


@kernel(signatures="(i8[::1], f8[::1])", allocates=True, exact=True)
def capsule_tree(record, pool):
    """The tree of a packed curve."""
    packed = bezier_head_at(pool, 0)
    curve = bezier_curve_at(record, 0)
    n = curve.degree
    spans = curve.spans
    parts = 1
    halvings = 0
    while parts * spans < _LEAVES:
        parts *= 2
        halvings += 1
    pieces = parts * spans
    slots = 1
    while slots < pieces:
        slots *= 2
    size = 4 * (n + 1)
    rows = np.empty(pieces * size)
    for span in range(spans):
        base = span * parts * size
        source = curve.pieces + size * span
        for j in range(size):
            rows[base + j] = pool[source + j]
        count = 1
        while count < parts:
            # From the last piece to the first, so that none is overwritten before it is halved.
            for k in range(count - 1, -1, -1):
                _halve(rows, base + k * size, base + 2 * k * size, n)
            count *= 2
    for i in range(pieces * (n + 1)):
        w = 1.0 / rows[4 * i + 3]
        for j in range(3):
            rows[4 * i + j] *= w
    tree = np.empty(2 * slots * STRIDE)
    head = capsule_head_at(tree, 0)
    head.leaves = slots
    head.extent = packed.reach
    for j in range(3):
        head.origin[j] = packed.center[j]
    # Rounding of the halvings (see `distance/curves/nodes.py`), of the division by the weight, and of the radius.
    away = packed.error + (4.0 * n * halvings + 128.0) * UNIT * packed.reach
    low = slots
    width = 1
    while low > 0:
        for k in range(low):
            first = k * width
            last = min(first + width, pieces)
            _enclose(rows, first * (n + 1), last * (n + 1), tree, (low + k) * STRIDE, away)
        low //= 2
        width *= 2
    return tree


@kernel(inner=True, exact=True)
def _halve(rows, o, a, n):
    """Halve the piece at o by de Casteljau's algorithm: the left half to a, the right half behind it."""
    size = 4 * (n + 1)
    b = a + size
    if b != o:
        for j in range(size - 1, -1, -1):
            rows[b + j] = rows[o + j]
    for r in range(n + 1):
        for j in range(4):
            rows[a + 4 * r + j] = rows[b + j]
        for j in range(4 * (n - r)):
            rows[b + j] = 0.5 * (rows[b + j] + rows[b + j + 4])


@kernel(inner=True, exact=True)
def _enclose(rows, first, last, tree, o, away):
    """The capsule of the points [first, last) around their first and last one."""
    capsule = capsule_at(tree, o)
    if first >= last:
        capsule.radius = -1.0
        return
    a = three(rows, 4 * first)
    b = three(rows, 4 * (last - 1))
    d = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
    square = dot(d, d)
    inverse = 1.0 / square if square > 1e-280 else 0.0
    most = 0.0
    for i in range(first + 1, last - 1):
        p = three(rows, 4 * i)
        e = (p[0] - a[0], p[1] - a[1], p[2] - a[2])
        t = min(max(dot(e, d) * inverse, 0.0), 1.0)
        e = (e[0] - t * d[0], e[1] - t * d[1], e[2] - t * d[2])
        most = max(most, dot(e, e))
    for j in range(3):
        capsule.position[j] = 0.5 * (a[j] + b[j])
        capsule.extent[j] = d[j]
    capsule.radius = math.sqrt(most) * (1.0 + 16.0 * UNIT) + away


@kernel(inline=True, exact=True)
def _segments(a, o, b, p, shift):
    """Bounds of the distance of two segments; the upper one is the distance of two of their points.

    The square of the lower one is the least square found, minus a multiple of u of the magnitudes that were summed (see
    `distance/curves/bounds.py`).
    """
    capsule = capsule_at(a, o)
    capsule_record = capsule_at(b, p)
    d = (
        (capsule.position[0] - capsule_record.position[0]) - shift[0],
        (capsule.position[1] - capsule_record.position[1]) - shift[1],
        (capsule.position[2] - capsule_record.position[2]) - shift[2],
    )
    u = three(a, o + EXTENT)
    v = three(b, p + EXTENT)
    c = dot(d, d)
    uu = dot(u, u)
    vv = dot(v, v)
    least, x, y = square_minimum(c, dot(d, u), -dot(d, v), uu, -dot(u, v), vv)
    least -= 128.0 * UNIT * (c + uu + vv)
    lower = math.sqrt(least) * (1.0 - 8.0 * UNIT) if least > 0.0 else 0.0
    e = (d[0] + x * u[0] - y * v[0], d[1] + x * u[1] - y * v[1], d[2] + x * u[2] - y * v[2])
    return lower, length(e) * (1.0 + 16.0 * UNIT)


@kernel(inline=True)
def _extent(tree, o):
    """How large a capsule is."""
    return length(three(tree, o + EXTENT)) + 2.0 * capsule_at(tree, o).radius


@kernel(signatures="(f8[::1], f8[::1], f8)", allocates=True, exact=True)
def compare_curves(a, b, clearance):
    """FARTHER if two curves are proven farther apart than a clearance, NEARER if proven not to be, else OPEN."""
    head_a, head_b = capsule_head_at(a, 0), capsule_head_at(b, 0)
    shift = difference(head_b.origin, head_a.origin, (0.0, 0.0, 0.0))
    slack = 16.0 * UNIT * (head_a.extent + head_b.extent + length(shift)) + 1e-150
    leaf_a = int(head_a.leaves)
    leaf_b = int(head_b.leaves)
    stack = np.empty(2 * _STACK, np.int64)
    stack[0] = 1
    stack[1] = 1
    top = 2
    while top > 0:
        top -= 2
        i = stack[top]
        j = stack[top + 1]
        o = STRIDE * i
        p = STRIDE * j
        lower, upper = _segments(a, o, b, p, shift)
        radius = (capsule_at(a, o).radius + capsule_at(b, p).radius + slack) * (1.0 + 8.0 * UNIT)
        if lower * (1.0 - 4.0 * UNIT) - radius > clearance:
            continue
        if i >= leaf_a and j >= leaf_b:
            return NEARER if (upper + radius) * (1.0 + 4.0 * UNIT) <= clearance else OPEN
        split_a = j >= leaf_b or (i < leaf_a and _extent(a, o) >= _extent(b, p))
        for half in range(1, -1, -1):
            k = 2 * i + half if split_a else i
            m = j if split_a else 2 * j + half
            if capsule_at(a, STRIDE * k).radius >= 0.0 and capsule_at(b, STRIDE * m).radius >= 0.0:
                stack[top] = k
                stack[top + 1] = m
                top += 2
    return FARTHER


@kernel(signatures="(f8[::1], f8, f8, f8, f8)", allocates=True, exact=True)
def compare_point(tree, x, y, z, clearance):
    """As `compare_curves`, for a curve and a point."""
    head = capsule_head_at(tree, 0)
    p = (x - head.origin[0], y - head.origin[1], z - head.origin[2])
    slack = 16.0 * UNIT * (head.extent + length(p)) + 1e-150
    leaf = int(head.leaves)
    stack = np.empty(_STACK, np.int64)
    stack[0] = 1
    top = 1
    while top > 0:
        top -= 1
        k = stack[top]
        o = STRIDE * k
        capsule = capsule_at(tree, o)
        d = (p[0] - capsule.position[0], p[1] - capsule.position[1], p[2] - capsule.position[2])
        u = three(tree, o + EXTENT)
        square = dot(u, u)
        t = dot(d, u)
        # The rounding of t changes the distance to second order only; each other term has four roundings.
        t = min(max(t / square, -0.5), 0.5) if square > 1e-280 else 0.0
        e = (d[0] - t * u[0], d[1] - t * u[1], d[2] - t * u[2])
        far = length(e)
        radius = (capsule.radius + slack) * (1.0 + 8.0 * UNIT)
        wrong = 16.0 * UNIT * (far + length(u))
        if (far - wrong) - radius > clearance * (1.0 + 8.0 * UNIT):
            continue
        if k >= leaf:
            return NEARER if (far + wrong + radius) * (1.0 + 8.0 * UNIT) <= clearance else OPEN
        for half in range(1, -1, -1):
            if capsule_at(tree, STRIDE * (2 * k + half)).radius >= 0.0:
                stack[top] = 2 * k + half
                top += 1
    return FARTHER
