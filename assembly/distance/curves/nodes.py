"""Pieces of a curve that a certified search halves: their boxes, and a quadratic model with a proven remainder.

With d = x - 1/2 in [-1/2, 1/2] on a piece,

    |C(x) - (A0 + A1 d + A2 d^2 / 2)| <= E0,    |C' - (A1 + A2 d)| <= E1,    |C'' - A2| <= E2,

where E0 = s / 48, E1 = s / 8, E2 = s / 2 with s >= sup |C'''|, and what rounding adds. For a polynomial s follows from
third differences of the control points; for C = X / w about the center of its box, of radius r, from

    |C'| <= (|X'| + |w'| r) / w,  |C''| <= (|X''| + 2 |w'| |C'| + |w''| r) / w,
    |C'''| <= (|X'''| + 3 |w'| |C''| + 3 |w''| |C'| + |w'''| r) / w,

each by the largest control point of the derivative and the smallest weight.

Rounding. Halving is (a + b) / 2, one rounding a step, and n steps lead to the last point: a node at depth k is within
k n u REACH of the piece it stands for (u = 2^-53; twice that for quotients), for all steps are convex combinations.
A sum of m products with weights c_i has an error below (m + 2) u sum |c_i| max |term|; in the model's sums the terms
are control points about the center of the box, at most r, and sum |c_i| is 1, 2 n and 4 n (n - 1). The constants below
are twice these bounds or more.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of
from assembly.geometry.splines.bezier_pieces import (
    BOX,
    UNIT,
    bezier_curve_at,
    bezier_head_at,
)

# The doubles of a piece of a curve. Rows of (w x, w y, w z, w) follow, then positions where weights differ.
CURVE_NODE = record_dtype(
    "f8",
    box_center=3,  # [length]
    box_half=3,  # half extents of the box [length]
    a0=3,  # A0, A1 and A2 of the model above
    a1=3,
    a2=3,
    e0=1,  # E0, E1 and E2, its errors
    e1=1,
    e2=1,
    speed=1,  # the largest |C'| [length]
    away=1,  # how far the piece may be from the given curve's [length]
    begin=1,  # its interval on the span
    end=1,
)
curve_node_at = record_view(CURVE_NODE)
A1 = place_of(CURVE_NODE, "a1")
AWAY = place_of(CURVE_NODE, "away")
ROWS = size_of(CURVE_NODE)
# The integers of the same piece.
CURVE_NODE_LINKS = record_dtype(
    "i8",
    left=1,  # its halves; -1: not made yet
    right=1,
    first=1,  # the spans [first, last)
    last=1,
    depth=1,  # halvings
    tree_node=1,  # box in the tree over the spans
)
curve_node_links_at = record_view(CURVE_NODE_LINKS)
NODE_INTS = size_of(CURVE_NODE_LINKS)
# A Bezier piece of a packed curve: its node is at nodes[at].
CurvePiece = namedtuple("CurvePiece", "record pool nodes at")


@kernel(inline=True)
def three(array, o):
    return (array[o], array[o + 1], array[o + 2])


@kernel(inline=True)
def length(a):
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@kernel(inline=True)
def node_stride(record):
    """Doubles of a node."""
    curve = bezier_curve_at(record, 0)
    return ROWS + 4 * (curve.degree + 1) * (1 + curve.rational)


@kernel(inline=True)
def piece_of(tree, k):
    """Node k of a tree, which is a piece."""
    return CurvePiece(tree.record, tree.pool, tree.nodes, node_stride(tree.record) * k)


@kernel(inline=True)
def node_of(tree, k):
    """The doubles of node k."""
    return curve_node_at(tree.nodes, node_stride(tree.record) * k)


@kernel(inline=True)
def links_of(tree, k):
    """The integers of node k."""
    return curve_node_links_at(tree.ints, NODE_INTS * k)


@kernel(inline=True)
def is_piece(tree, k):
    """Whether a node is a Bezier piece, and not several spans."""
    links = links_of(tree, k)
    return links.last - links.first == 1


@kernel(inner=True, exact=True)
def start_nodes(tree):
    """The root of a curve's tree as node 0."""
    curve = bezier_curve_at(tree.record, 0)
    fill_spans(tree, 0, 0, curve.spans, 0)
    if curve.spans == 1:
        describe(piece_of(tree, 0))


@kernel(inner=True, exact=True)
def fill_spans(tree, k, first, last, tree_node):
    """Fill node k for the spans [first, last); for a single span, `describe` has to follow."""
    curve = bezier_curve_at(tree.record, 0)
    nodes, pool = tree.nodes, tree.pool
    i = links_of(tree, k)
    node = node_of(tree, k)
    i.left = -1
    i.right = -1
    i.first = first
    i.last = last
    i.depth = 0
    i.tree_node = tree_node
    node.away = bezier_head_at(pool, 0).error
    if last - first == 1:
        n = curve.degree
        source = curve.pieces + 4 * (n + 1) * first
        rows = node_stride(tree.record) * k + ROWS
        for j in range(4 * (n + 1)):
            nodes[rows + j] = pool[source + j]
        node.begin = 0.0
        node.end = 1.0
        return
    b = curve.tree + BOX * tree_node
    for j in range(3):
        node.box_center[j] = pool[b + j]
        node.box_half[j] = pool[b + 3 + j]


@kernel(inner=True, exact=True)
def split_node(tree, k, left):
    """Make the halves of node k as nodes left and left + 1."""
    i = links_of(tree, k)
    i.left = left
    i.right = left + 1
    first = i.first
    last = i.last
    if last - first > 1:
        middle = (first + last) // 2
        tree_node = i.tree_node
        fill_spans(tree, left, first, middle, tree_node + 1)
        fill_spans(tree, left + 1, middle, last, tree_node + 2 * (middle - first))
    else:
        halve(tree, k, left)
    for j in range(left, left + 2):
        if is_piece(tree, j):
            describe(piece_of(tree, j))


@kernel(inline=True)
def halve(tree, k, left):
    """Rows of the halves of a piece."""
    curve = bezier_curve_at(tree.record, 0)
    nodes = tree.nodes
    n = curve.degree
    i = links_of(tree, k)
    node, node_a, node_b = node_of(tree, k), node_of(tree, left), node_of(tree, left + 1)
    for j in range(left, left + 2):
        c = links_of(tree, j)
        c.left = -1
        c.right = -1
        c.first = i.first
        c.last = i.last
        c.depth = i.depth + 1
        c.tree_node = i.tree_node
    # de Casteljau at 1/2: the rows of the copy become the right half, the first row of each step one of the left half.
    stride = node_stride(tree.record)
    rows, rows_a = stride * k + ROWS, stride * left + ROWS
    rows_b = rows_a + stride
    for j in range(4 * (n + 1)):
        nodes[rows_b + j] = nodes[rows + j]
    for r in range(n + 1):
        for j in range(4):
            nodes[rows_a + 4 * r + j] = nodes[rows_b + j]
        for j in range(4 * (n - r)):
            nodes[rows_b + j] = 0.5 * (nodes[rows_b + j] + nodes[rows_b + j + 4])
    middle = 0.5 * (node.begin + node.end)
    node_a.begin = node.begin
    node_a.end = middle
    node_b.begin = middle
    node_b.end = node.end
    away = node.away + (2.0 + 2.0 * curve.rational) * n * UNIT * bezier_head_at(tree.pool, 0).reach
    node_a.away = away
    node_b.away = away


@kernel(inner=True, exact=True)
def describe(piece):
    """Box and model of a piece from its rows."""
    nodes, o = piece.nodes, piece.at
    node = curve_node_at(nodes, o)
    curve = bezier_curve_at(piece.record, 0)
    n = curve.degree
    p = o + ROWS
    if curve.rational == 1:
        p += 4 * (n + 1)
        for i in range(n + 1):
            q = o + ROWS + 4 * i
            w = 1.0 / nodes[q + 3]
            nodes[p + 4 * i] = nodes[q] * w
            nodes[p + 4 * i + 1] = nodes[q + 1] * w
            nodes[p + 4 * i + 2] = nodes[q + 2] * w
            nodes[p + 4 * i + 3] = nodes[q + 3]
    slack = 8.0 * UNIT * bezier_head_at(piece.pool, 0).reach
    for j in range(3):
        low = high = nodes[p + j]
        for q in range(p + 4 + j, p + 4 * (n + 1), 4):
            low = min(low, nodes[q])
            high = max(high, nodes[q])
        node.box_center[j] = 0.5 * (low + high)
        node.box_half[j] = 0.5 * (high - low) + slack
    center = (node.box_center[0], node.box_center[1], node.box_center[2])
    if n == 0:
        node.a0[0], node.a0[1], node.a0[2] = center
        for j in range(A1, AWAY):
            nodes[o + j] = 0.0
        return
    r = length(node.box_half)
    if curve.rational == 1:
        rational_model(piece, p, center, r)
    else:
        polynomial_model(piece, p, center, r)


@kernel(inner=True, exact=True)
def polynomial_model(piece, p, center, r):
    pool, nodes = piece.pool, piece.nodes
    node = curve_node_at(nodes, piece.at)
    curve = bezier_curve_at(piece.record, 0)
    n = curve.degree
    m = curve.middle
    vx = vy = vz = 0.0
    dx = dy = dz = 0.0
    hx = hy = hz = 0.0
    first = 0.0
    third = 0.0
    for i in range(n + 1):
        q = p + 4 * i
        x = nodes[q] - center[0]
        y = nodes[q + 1] - center[1]
        z = nodes[q + 2] - center[2]
        a = pool[m + i]
        b = pool[m + n + 1 + i]
        c = pool[m + 2 * n + 2 + i]
        vx += a * x
        vy += a * y
        vz += a * z
        dx += b * x
        dy += b * y
        dz += b * z
        hx += c * x
        hy += c * y
        hz += c * z
    for i in range(n):
        q = p + 4 * i
        x = nodes[q + 4] - nodes[q]
        y = nodes[q + 5] - nodes[q + 1]
        z = nodes[q + 6] - nodes[q + 2]
        first = max(first, x * x + y * y + z * z)
    for i in range(n - 2):
        q = p + 4 * i
        x = (nodes[q + 12] - nodes[q]) - 3.0 * (nodes[q + 8] - nodes[q + 4])
        y = (nodes[q + 13] - nodes[q + 1]) - 3.0 * (nodes[q + 9] - nodes[q + 5])
        z = (nodes[q + 14] - nodes[q + 2]) - 3.0 * (nodes[q + 10] - nodes[q + 6])
        third = max(third, x * x + y * y + z * z)
    u = 4.0 * (n + 8.0) * UNIT * r
    s = n * (n - 1.0) * (n - 2.0) * (math.sqrt(third) + 64.0 * UNIT * r) * (1.0 + 1e-12)
    node.a0[0], node.a0[1], node.a0[2] = center[0] + vx, center[1] + vy, center[2] + vz
    node.a1[0], node.a1[1], node.a1[2] = dx, dy, dz
    node.a2[0], node.a2[1], node.a2[2] = hx, hy, hz
    # The sum with the center is rounded at the size of a coordinate.
    e0 = u + 4.0 * UNIT * bezier_head_at(pool, 0).reach
    e1 = 2.0 * n * u
    e2 = 4.0 * n * n * u
    node.e0 = s / 48.0 * (1.0 + 1e-12) + e0 + 0.5 * e1 + 0.125 * e2
    node.e1 = 0.125 * s + e1 + 0.5 * e2
    node.e2 = 0.5 * s + e2
    node.speed = n * (math.sqrt(first) + 8.0 * UNIT * r) * (1.0 + 1e-12)


@kernel(inline=True, exact=True)
def quotient_bounds(n, r, least, ratio, squares, weights):
    """Bounds of |C'| and |C'''| of the heading, from the largest differences of X, squared, and of w."""
    n1 = float(n)
    n2 = n1 * (n - 1.0)
    n3 = n2 * (n - 2.0)
    unit = 32.0 * UNIT * ratio * r
    weight = 32.0 * UNIT * ratio
    x1 = n1 * (math.sqrt(squares[0]) / least + unit)
    x2 = n2 * (math.sqrt(squares[1]) / least + unit)
    x3 = n3 * (math.sqrt(squares[2]) / least + unit)
    w1 = n1 * (weights[0] / least + weight)
    w2 = n2 * (weights[1] / least + weight)
    w3 = n3 * (weights[2] / least + weight)
    grow = 1.0 + 1e-12
    s1 = (x1 + w1 * r) * grow
    s2 = (x2 + 2.0 * w1 * s1 + w2 * r) * grow
    return s1, (x3 + 3.0 * w1 * s2 + 3.0 * w2 * s1 + w3 * r) * grow


@kernel(inner=True, exact=True)
def rational_model(piece, p, center, r):
    pool, nodes = piece.pool, piece.nodes
    node = curve_node_at(nodes, piece.at)
    curve = bezier_curve_at(piece.record, 0)
    n = curve.degree
    m = curve.middle
    v = (0.0, 0.0, 0.0)
    d = (0.0, 0.0, 0.0)
    h = (0.0, 0.0, 0.0)
    w = dw = hw = 0.0
    least = math.inf
    most = 0.0
    # Sizes of the differences of X and of w, squared.
    x1 = x2 = x3 = w1 = w2 = w3 = 0.0
    # Rows X_i, X_(i-1), ... about the center, and their differences.
    before = (0.0, 0.0, 0.0, 0.0)
    first = before
    second = before
    for i in range(n + 1):
        q = p + 4 * i
        k = nodes[q + 3]
        row = (k * (nodes[q] - center[0]), k * (nodes[q + 1] - center[1]), k * (nodes[q + 2] - center[2]), k)
        least = min(least, k)
        most = max(most, k)
        a = pool[m + i]
        b = pool[m + n + 1 + i]
        c = pool[m + 2 * n + 2 + i]
        v = (v[0] + a * row[0], v[1] + a * row[1], v[2] + a * row[2])
        d = (d[0] + b * row[0], d[1] + b * row[1], d[2] + b * row[2])
        h = (h[0] + c * row[0], h[1] + c * row[1], h[2] + c * row[2])
        w += a * k
        dw += b * k
        hw += c * k
        one = (row[0] - before[0], row[1] - before[1], row[2] - before[2], row[3] - before[3])
        two = (one[0] - first[0], one[1] - first[1], one[2] - first[2], one[3] - first[3])
        if i >= 1:
            x1 = max(x1, one[0] * one[0] + one[1] * one[1] + one[2] * one[2])
            w1 = max(w1, abs(one[3]))
        if i >= 2:
            x2 = max(x2, two[0] * two[0] + two[1] * two[1] + two[2] * two[2])
            w2 = max(w2, abs(two[3]))
        if i >= 3:
            tx = two[0] - second[0]
            ty = two[1] - second[1]
            tz = two[2] - second[2]
            x3 = max(x3, tx * tx + ty * ty + tz * tz)
            w3 = max(w3, abs(two[3] - second[3]))
        second = two
        first = one
        before = row
    i = 1.0 / w
    v = (i * v[0], i * v[1], i * v[2])
    d = (i * (d[0] - dw * v[0]), i * (d[1] - dw * v[1]), i * (d[2] - dw * v[2]))
    node.a0[0] = center[0] + v[0]
    node.a0[1] = center[1] + v[1]
    node.a0[2] = center[2] + v[2]
    node.a1[0], node.a1[1], node.a1[2] = d
    for j in range(3):
        node.a2[j] = i * (h[j] - 2.0 * dw * d[j] - hw * v[j])
    ratio = most / least
    grow = 1.0 + 1e-12
    s1, s3 = quotient_bounds(n, r, least, ratio, (x1, x2, x3), (w1, w2, w3))
    # As above with every term a quotient: |w'| / w <= 2 n ratio and |w''| / w <= 4 n^2 ratio multiply the errors of the
    # lower derivatives.
    u = 8.0 * (n + 8.0) * UNIT * r * ratio
    e0 = u + 4.0 * UNIT * bezier_head_at(pool, 0).reach
    e1 = 8.0 * n * u * ratio
    e2 = 64.0 * n * n * u * ratio * ratio
    node.e0 = s3 / 48.0 * grow + e0 + 0.5 * e1 + 0.125 * e2
    node.e1 = 0.125 * s3 + e1 + 0.5 * e2
    node.e2 = 0.5 * s3 + e2
    node.speed = s1
