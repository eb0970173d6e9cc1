"""Bezier patches that a certified search halves: their boxes, and a quadratic model with a proven remainder.

As `distance/curves/nodes.py`, in two parameters: with x, y in [-1/2, 1/2] on a patch,

    |S - (A0 + Ju x + Jv y + Kuu x^2 / 2 + Kuv x y + Kvv y^2 / 2)| <= E0 = (m30 + 3 m21 + 3 m12 + m03) / 48,

m_kl >= sup |S_kl|, and likewise E1 for the first and E2 for the second derivatives. The bounds m follow from
differences of the net about the center of its box; for S = X / w from Leibniz' rule solved for the highest derivative,

    m_kl w = |X_kl| + sum over (i, j) < (k, l) of C(k, i) C(l, j) |w_(k-i)(l-j)| m_ij.

A curve is a patch of degree 0 in v, a point one of degree 0 in both. The rounding analysis of that file holds here with
the sum of both degrees as n.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of
from assembly.distance.curves.nodes import length
from assembly.geometry.splines.bezier_pieces import UNIT, bezier_head_at

# A surface of Bezier patches in the table.
BEZIER_SURFACE = record_dtype(
    "i8",
    degree_u=1,
    degree_v=1,
    patches_u=1,  # how many along u
    patches_v=1,
    rational=1,  # 1: weights differ
    breaks_u=1,  # where in the pool the breaks in u begin
    breaks_v=1,
    middle_u=1,  # where in the pool the weights of derivatives at the middle of u begin
    middle_v=1,
    nets=1,  # where in the pool the control points of the patches begin
)
bezier_surface_at = record_view(BEZIER_SURFACE)
PATCHES_U = place_of(BEZIER_SURFACE, "patches_u")
PATCHES_V = place_of(BEZIER_SURFACE, "patches_v")
PATCH_RECORD = size_of(BEZIER_SURFACE)
# The doubles of a patch. Rows of (w x, w y, w z, w) follow, then positions where weights differ.
PATCH_NODE = record_dtype(
    "f8",
    box_center=3,  # [length]
    box_half=3,  # half extents of the box [length]
    a0=3,  # A0 of the model above
    ju=6,  # Ju, Jv
    kuu=9,  # Kuu, Kuv, Kvv
    e0=1,  # E0, E1 and E2, its errors
    e1=1,
    e2=1,
    speed_u=1,  # the largest |S_u|; below zero in v: the piece counts as a point [length]
    speed_v=1,
    away=1,  # how far the patch may be from the given surface's [length]
    low_u=1,  # its box of parameters within the surface's patch; of a formula, its interval
    high_u=1,
    low_v=1,
    high_v=1,
)
patch_node_at = record_view(PATCH_NODE)
A0 = place_of(PATCH_NODE, "a0")
JU = place_of(PATCH_NODE, "ju")
KUU = place_of(PATCH_NODE, "kuu")
E0 = place_of(PATCH_NODE, "e0")
E1 = place_of(PATCH_NODE, "e1")
E2 = place_of(PATCH_NODE, "e2")
SPEED_U = place_of(PATCH_NODE, "speed_u")
LOW_U = place_of(PATCH_NODE, "low_u")
HIGH_U = place_of(PATCH_NODE, "high_u")
LOW_V = place_of(PATCH_NODE, "low_v")
ROWS = size_of(PATCH_NODE)
# The integers of the same patch.
PATCH_NODE_LINKS = record_dtype(
    "i8",
    halves=1,  # the first of its two halves; -1: not made yet
    patch=1,  # number of the surface's patch that it is a part of
    depth=1,  # halvings
)
patch_node_links_at = record_view(PATCH_NODE_LINKS)
NODE_INTS = size_of(PATCH_NODE_LINKS)
# Halvings after which a node is let go.
DEEPEST = 60
# A patch, or a piece of a curve in the place of one, that is compared: its node is at nodes[at]; free: its parameters.
Patch = namedtuple("Patch", "record nodes at free")


@kernel(inline=True)
def patch_stride(record):
    """Doubles of a node."""
    patch = bezier_surface_at(record, 0)
    return ROWS + 4 * (patch.degree_u + 1) * (patch.degree_v + 1) * (1 + patch.rational)


@kernel(inline=True)
def patch_positions(record, o):
    """Where the positions of a node's control points begin."""
    patch = bezier_surface_at(record, 0)
    return o + ROWS + 4 * (patch.degree_u + 1) * (patch.degree_v + 1) * patch.rational


@kernel(inline=True)
def patch_node_of(tree, k):
    """The doubles of node k."""
    return patch_node_at(tree.nodes, patch_stride(tree.record) * k)


@kernel(inline=True)
def patch_links_of(tree, k):
    """The integers of node k."""
    return patch_node_links_at(tree.ints, NODE_INTS * k)


@kernel(inner=True, exact=True)
def fill_patch(tree, k):
    """Node k for the patch k."""
    patch = bezier_surface_at(tree.record, 0)
    links = patch_links_of(tree, k)
    count = 4 * (patch.degree_u + 1) * (patch.degree_v + 1)
    node = patch_node_of(tree, k)
    rows = patch_stride(tree.record) * k + ROWS
    for j in range(count):
        tree.nodes[rows + j] = tree.pool[patch.nets + count * k + j]
    node.away = bezier_head_at(tree.pool, 0).error
    node.low_u = 0.0
    node.high_u = 1.0
    node.low_v = 0.0
    node.high_v = 1.0
    links.halves = -1
    links.patch = k
    links.depth = 0


@kernel(inner=True, exact=True)
def split_patch(tree, k, low):
    """Make the halves of node k, across its longer direction, as nodes low and low + 1, not described yet."""
    nodes = tree.nodes
    patch = bezier_surface_at(tree.record, 0)
    links = patch_links_of(tree, k)
    p = patch.degree_u
    q = patch.degree_v
    stride = patch_stride(tree.record)
    o = stride * k
    node = patch_node_at(nodes, o)
    a = stride * low
    b = a + stride
    links.halves = low
    for j in range(low, low + 2):
        half = patch_links_of(tree, j)
        half.halves, half.patch, half.depth = -1, links.patch, links.depth + 1
    for j in range(A0, ROWS):
        nodes[a + j] = nodes[o + j]
        nodes[b + j] = nodes[o + j]
    rows, rows_b = o + ROWS, b + ROWS
    for j in range(4 * (p + 1) * (q + 1)):
        nodes[rows_b + j] = nodes[rows + j]
    along_u = node.speed_u >= node.speed_v
    n = p if along_u else q
    step = 4 * (q + 1) if along_u else 4
    lines = q + 1 if along_u else p + 1
    across = 4 if along_u else 4 * (q + 1)
    for line in range(lines):
        s = b + ROWS + across * line
        t = a + ROWS + across * line
        for r in range(n + 1):
            for j in range(4):
                nodes[t + step * r + j] = nodes[s + j]
            for i in range(n - r):
                for j in range(4):
                    nodes[s + step * i + j] = 0.5 * (nodes[s + step * i + j] + nodes[s + step * (i + 1) + j])
    side = LOW_U if along_u else LOW_V
    middle = 0.5 * (nodes[o + side] + nodes[o + side + 1])
    nodes[a + side + 1] = middle
    nodes[b + side] = middle
    away = node.away + (2.0 + 2.0 * patch.rational) * n * UNIT * bezier_head_at(tree.pool, 0).reach
    patch_node_at(nodes, a).away = away
    patch_node_at(nodes, b).away = away


@kernel(inner=True, exact=True)
def largest_difference(nodes, at, p, q, k, l, center):
    """Largest difference of orders k and l of the net, of X = w (P - center) and of w."""
    most = 0.0
    heaviest = 0.0
    for i in range(p + 1 - k):
        for j in range(q + 1 - l):
            x = y = z = w = 0.0
            sign_u = 1.0
            for a in range(k + 1):
                factor = sign_u
                for b in range(l + 1):
                    o = at + 4 * ((q + 1) * (i + a) + j + b)
                    v = factor * nodes[o + 3]
                    x += v * (nodes[o] - center[0])
                    y += v * (nodes[o + 1] - center[1])
                    z += v * (nodes[o + 2] - center[2])
                    w += v
                    factor *= -float(l - b) / (b + 1.0)
                sign_u *= -float(k - a) / (a + 1.0)
            most = max(most, x * x + y * y + z * z)
            heaviest = max(heaviest, abs(w))
    return math.sqrt(most), heaviest


@kernel(inline=True)
def falling(n, k):
    """n (n - 1) ... of k factors."""
    value = 1.0
    for i in range(k):
        value *= n - i
    return value


@kernel(inline=True, exact=True)
def project_net(record, nodes, o):
    """Write positions where weights differ. The least weight and the largest."""
    patch = bezier_surface_at(record, 0)
    at = patch_positions(record, o)
    least = math.inf
    heaviest = 0.0
    for i in range((patch.degree_u + 1) * (patch.degree_v + 1)):
        s = o + ROWS + 4 * i
        w = nodes[s + 3]
        least = min(least, w)
        heaviest = max(heaviest, w)
        if patch.rational == 1:
            for j in range(3):
                nodes[at + 4 * i + j] = nodes[s + j] / w
            nodes[at + 4 * i + 3] = w
    return least, heaviest


@kernel(inline=True, exact=True)
def box_net(record, nodes, o, slack):
    """Write the box of the positions."""
    patch = bezier_surface_at(record, 0)
    node = patch_node_at(nodes, o)
    at = patch_positions(record, o)
    for j in range(3):
        low = math.inf
        high = -math.inf
        for i in range((patch.degree_u + 1) * (patch.degree_v + 1)):
            low = min(low, nodes[at + 4 * i + j])
            high = max(high, nodes[at + 4 * i + j])
        node.box_center[j] = 0.5 * (low + high)
        node.box_half[j] = 0.5 * (high - low) + slack


@kernel(inline=True, exact=True)
def derivative_bounds(record, nodes, o, least, ratio, m):
    """Write bounds of the derivatives of a patch to m[4 k + l], and of those of w / min w to m[16 + 4 k + l]."""
    patch = bezier_surface_at(record, 0)
    node = patch_node_at(nodes, o)
    p = patch.degree_u
    q = patch.degree_v
    rational = patch.rational == 1
    center = (node.box_center[0], node.box_center[1], node.box_center[2])
    r = length(node.box_half)
    m[0] = r
    for k in range(4):
        for l in range(4 - k):
            if k + l == 0 or (not rational and k + l == 2):
                continue
            i = 4 * k + l
            m[i] = 0.0
            m[16 + i] = 0.0
            scale = falling(p, k) * falling(q, l)
            if k <= p and l <= q:
                x, w = largest_difference(nodes, patch_positions(record, o), p, q, k, l, center)
                m[i] = scale * (x / least + 64.0 * UNIT * ratio * r)
                m[16 + i] = scale * (w / least + 64.0 * UNIT * ratio) if rational else 0.0
            if rational:
                for a in range(k + 1):
                    for b in range(l + 1):
                        if a < k or b < l:
                            m[i] += binomial(k, a) * binomial(l, b) * m[16 + 4 * (k - a) + l - b] * m[4 * a + b]
            m[i] *= 1.0 + 1e-12


@kernel(inline=True, exact=True)
def write_middle(record, pool, nodes, o):
    """A0, J and K of a patch from value and derivatives of X and w in its middle."""
    patch = bezier_surface_at(record, 0)
    node = patch_node_at(nodes, o)
    p = patch.degree_u
    q = patch.degree_v
    center = node.box_center
    v = (0.0, 0.0, 0.0, 0.0)
    du = v
    dv = v
    uu = v
    uv = v
    vv = v
    mu = patch.middle_u
    mv = patch.middle_v
    s = patch_positions(record, o)
    for i in range(p + 1):
        for j in range(q + 1):
            w = nodes[s + 3]
            row = (w * (nodes[s] - center[0]), w * (nodes[s + 1] - center[1]), w * (nodes[s + 2] - center[2]), w)
            a0 = pool[mu + i]
            a1 = pool[mu + p + 1 + i]
            a2 = pool[mu + 2 * p + 2 + i]
            b0 = pool[mv + j]
            b1 = pool[mv + q + 1 + j]
            b2 = pool[mv + 2 * q + 2 + j]
            v = plus(v, a0 * b0, row)
            du = plus(du, a1 * b0, row)
            dv = plus(dv, a0 * b1, row)
            uu = plus(uu, a2 * b0, row)
            uv = plus(uv, a1 * b1, row)
            vv = plus(vv, a0 * b2, row)
            s += 4
    w = 1.0 / v[3]
    for j in range(3):
        c = w * v[j]
        cu = w * (du[j] - du[3] * c)
        cv = w * (dv[j] - dv[3] * c)
        node.a0[j] = center[j] + c
        node.ju[j] = cu
        node.ju[3 + j] = cv
        node.kuu[j] = w * (uu[j] - 2.0 * du[3] * cu - uu[3] * c)
        node.kuu[3 + j] = w * (uv[j] - du[3] * cv - dv[3] * cu - uv[3] * c)
        node.kuu[6 + j] = w * (vv[j] - 2.0 * dv[3] * cv - vv[3] * c)


@kernel(inner=True, exact=True)
def describe_patch(record, pool, nodes, o, m):
    """Box and model of a patch from its rows; m (32) is for work."""
    node = patch_node_at(nodes, o)
    patch = bezier_surface_at(record, 0)
    reach = bezier_head_at(pool, 0).reach
    least, heaviest = project_net(record, nodes, o)
    ratio = heaviest / least
    box_net(record, nodes, o, 8.0 * UNIT * reach)
    derivative_bounds(record, nodes, o, least, ratio, m)
    write_middle(record, pool, nodes, o)
    n = patch.degree_u + patch.degree_v + 1.0
    u = 8.0 * (n + 8.0) * UNIT * m[0] * ratio
    e0 = u + 4.0 * UNIT * reach
    e1 = 8.0 * n * u * ratio
    e2 = 64.0 * n * n * u * ratio * ratio
    grow = 1.0 + 1e-12
    m30, m21, m12, m03 = m[12], m[9], m[6], m[3]
    node.e0 = (m30 + 3.0 * m21 + 3.0 * m12 + m03) / 48.0 * grow + e0 + e1 + 0.5 * e2
    node.e1 = 0.125 * max(m30 + 2.0 * m21 + m12, m21 + 2.0 * m12 + m03) * grow + e1 + e2
    node.e2 = 0.5 * max(m30 + m21, m21 + m12, m12 + m03) * grow + e2
    node.speed_u = m[4]
    node.speed_v = m[1]


@kernel(inline=True)
def plus(a, s, b):
    return (a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2], a[3] + s * b[3])


@kernel(inline=True)
def binomial(n, k):
    """C(n, k) for n at most 3."""
    if k == 0 or k == n:
        return 1.0
    return float(n)
