"""Models of nodes: a quadratic at the middle of a patch, and a proven bound of its error.

The residual w (S - model) is a polynomial of degree (p + 2, q + 2). A quotient of two Bernstein forms is at most the
largest quotient of their coefficients. So the residual's coefficients over the least weight bound |S - model|, and
those of its derivatives give, by the quotient rule, the error bounds ("doubts") of the first and second derivatives.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._lanes import lane, load_lanes, store_lanes, store_xyz
from assembly.distance.bodies.nodes import links_of, node_of, patch_of
from assembly.distance.bodies.records import ALL, BENDS, MIDDLE, MODEL, NODE, SLOPES, body_head_at
from assembly.geometry.splines.bezier_pieces import UNIT

# Where the coefficients of the residual begin in the workspace, behind those of the quadratic.
RESIDUAL = 36
_GROW = 1.0 + 1e-12


@kernel(inline=True)
def length_at(nodes, at):
    """Length of the vector at nodes[at]."""
    return math.sqrt(nodes[at] * nodes[at] + nodes[at + 1] * nodes[at + 1] + nodes[at + 2] * nodes[at + 2])


@kernel(inner=True)
def write_model(tree, k):
    """Write the middle, slopes and bends (first and second derivatives) of the patch at node k."""
    links, pool = links_of(tree, k), tree.pool
    patch = patch_of(tree, links.patch)
    m, n = patch.degree_u + 1, patch.degree_v + 1
    at = links.net
    s = 0.0 * load_lanes(tree.nets, at)
    su = sv = suu = suv = svv = s
    for i in range(m):
        t = tv = tvv = 0.0 * s
        for j in range(n):
            row = load_lanes(tree.nets, at)
            v = patch.tables_v + j
            t = t + pool[v] * row
            tv = tv + pool[v + n] * row
            tvv = tvv + pool[v + 2 * n] * row
            at += 4
        u = patch.tables_u + i
        s = s + pool[u] * t
        su = su + pool[u + m] * t
        suu = suu + pool[u + 2 * m] * t
        sv = sv + pool[u] * tv
        suv = suv + pool[u + m] * tv
        svv = svv + pool[u] * tvv
    w = 1.0 / lane(s, 3)
    wu, wv = lane(su, 3), lane(sv, 3)
    s = w * s
    xu = w * (su - wu * s)
    xv = w * (sv - wv * s)
    at = NODE * k
    store_xyz(s, tree.nodes, at + MIDDLE)
    store_xyz(xu, tree.nodes, at + SLOPES)
    store_xyz(xv, tree.nodes, at + SLOPES + 3)
    store_xyz(w * (suu - (2.0 * wu) * xu - lane(suu, 3) * s), tree.nodes, at + BENDS)
    store_xyz(w * (suv - wu * xv - wv * xu - lane(suv, 3) * s), tree.nodes, at + BENDS + 3)
    store_xyz(w * (svv - (2.0 * wv) * xv - lane(svv, 3) * s), tree.nodes, at + BENDS + 6)


@kernel(inner=True)
def load_residual(tree, k, room):
    """Write the Bernstein coefficients of w (S - model), of degree (p + 2, q + 2), and those of w beside them."""
    node, links = node_of(tree, k), links_of(tree, k)
    patch = patch_of(tree, links.patch)
    p, q = patch.degree_u, patch.degree_v
    for s in range(3):
        x, xx = 0.5 * (s - 1.0), 0.25 if s != 1 else -0.25
        for t in range(3):
            y, yy = 0.5 * (t - 1.0), 0.25 if t != 1 else -0.25
            for c in range(3):
                room[4 * (3 * s + t) + c] = (
                    node.middle[c]
                    + (x * node.slopes[c] + y * node.slopes[3 + c])
                    + (0.5 * xx * node.bends[c] + x * y * node.bends[3 + c] + 0.5 * yy * node.bends[6 + c])
                )
            room[4 * (3 * s + t) + 3] = 0.0
    # Factors of products with a quadratic stand behind the three rows of the middle.
    times_u, times_v = patch.tables_u + 3 * (p + 1), patch.tables_v + 3 * (q + 1)
    at = RESIDUAL
    for i in range(p + 3):
        for j in range(q + 3):
            total = 0.0 * load_lanes(room, 0)
            for s in range(max(0, i - p), min(2, i) + 1):
                for t in range(max(0, j - q), min(2, j) + 1):
                    factor = tree.pool[times_u + 3 * i + s] * tree.pool[times_v + 3 * j + t]
                    row = load_lanes(tree.nets, links.net + 4 * ((i - s) * (q + 1) + j - t))
                    total = total + factor * (row - lane(row, 3) * load_lanes(room, 4 * (3 * s + t)))
            store_lanes(total, room, at)
            at += 4


@kernel(inner=True)
def largest_differences(room, shape, k, l):
    """The largest difference of order (k, l), k + l <= 2, of the residual's coefficients, and that of its weights."""
    rows, columns = shape
    most = 0.0
    heaviest = 0.0
    # Strides to the neighbors with which the first and the second difference are taken.
    first = 4 * columns if k > 0 else 4
    second = 4 if l > 0 else 4 * columns
    for i in range(rows - k):
        at = RESIDUAL + 4 * columns * i
        for _ in range(columns - l):
            d = load_lanes(room, at)
            if k + l > 0:
                d = load_lanes(room, at + first) - d
            if k + l == 2:
                d = (load_lanes(room, at + first + second) - load_lanes(room, at + second)) - d
            x, y, z = lane(d, 0), lane(d, 1), lane(d, 2)
            most = max(most, x * x + y * y + z * z)
            heaviest = max(heaviest, abs(lane(d, 3)))
            at += 4
    return math.sqrt(most), heaviest


@kernel(inline=True)
def weights_of(tree, k, patch):
    """The least weight of a node's control points, below all its weights; the largest weight over the least."""
    least, heaviest = math.inf, 0.0
    at = links_of(tree, k).net + 3
    for i in range((patch.degree_u + 1) * (patch.degree_v + 1)):
        w = tree.nets[at + 4 * i]
        least, heaviest = min(least, w), max(heaviest, w)
    return least, heaviest / least


@kernel(inline=True)
def rounding_of(tree, k, ratio):
    """Rounding error bound of a residual coefficient over the least weight; of a difference of order m, 2^m times this.

    A coefficient is a sum of nine terms, whose factors are positive and add up to one, whatever the degrees.
    """
    return 64.0 * UNIT * ratio * (node_of(tree, k).extent + body_head_at(tree.pool, 0).reach)


@kernel(inner=True)
def describe_model(tree, k, room):
    """Compute the model of a node and its error bound, `point_doubt`."""
    write_model(tree, k)
    node, links = node_of(tree, k), links_of(tree, k)
    patch = patch_of(tree, links.patch)
    size = node.radius
    for i in range(5):
        size += length_at(tree.nodes, NODE * k + SLOPES + 3 * i)
    node.extent = size
    load_residual(tree, k, room)
    most, _w = largest_differences(room, (patch.degree_u + 3, patch.degree_v + 3), 0, 0)
    least, ratio = weights_of(tree, k, patch)
    node.point_doubt = (most / least + rounding_of(tree, k, ratio)) * _GROW
    links.known = MODEL


@kernel(inner=True)
def describe_changes(tree, k, room):
    """Compute the error bounds of the first and second derivatives of a node whose model is known."""
    load_residual(tree, k, room)
    node, links, head = node_of(tree, k), links_of(tree, k), body_head_at(tree.pool, 0)
    patch = patch_of(tree, links.patch)
    shape = (patch.degree_u + 3, patch.degree_v + 3)
    m, n = patch.degree_u + 2.0, patch.degree_v + 2.0
    least, ratio = weights_of(tree, k, patch)
    v = 1.0 / least
    rough = rounding_of(tree, k, ratio)
    e0 = node.point_doubt
    along_u, weight_u = largest_differences(room, shape, 1, 0)
    along_v, weight_v = largest_differences(room, shape, 0, 1)
    uu, weight_uu = largest_differences(room, shape, 2, 0)
    vv, weight_vv = largest_differences(room, shape, 0, 2)
    uv, weight_uv = largest_differences(room, shape, 1, 1)
    du, dv, duu, dvv, duv = m * v, n * v, m * (m - 1.0) * v, n * (n - 1.0) * v, m * n * v
    e1u = du * along_u + 2.0 * m * rough
    e1v = dv * along_v + 2.0 * n * rough
    e2uu = duu * uu + 4.0 * m * m * rough
    e2vv = dvv * vv + 4.0 * n * n * rough
    e2uv = duv * uv + 4.0 * m * n * rough
    if head.rational > 0.0:
        # The quotient rule, (X / w)_u = (X_u - w_u (X / w)) / w, and the same again for second derivatives.
        tiny = 64.0 * UNIT * ratio
        wu = du * weight_u + m * tiny
        wv = dv * weight_v + n * tiny
        e1u += wu * e0
        e1v += wv * e0
        e2uu += 2.0 * wu * e1u + (duu * weight_uu + 4.0 * m * m * tiny) * e0
        e2vv += 2.0 * wv * e1v + (dvv * weight_vv + 4.0 * n * n * tiny) * e0
        e2uv += wu * e1v + wv * e1u + (duv * weight_uv + 4.0 * m * n * tiny) * e0
    node.slope_doubt = max(e1u, e1v) * _GROW
    node.bend_doubt = max(max(e2uu, e2vv), e2uv) * _GROW
    links.known = ALL


@kernel(inline=True)
def describe_node(tree, k, much, room):
    """Compute what a node lacks of MODEL or ALL, if `much` asks for it; node k must not be a group."""
    links = links_of(tree, k)
    if links.known < MODEL <= much:
        describe_model(tree, k, room)
    if links.known < ALL <= much:
        describe_changes(tree, k, room)
