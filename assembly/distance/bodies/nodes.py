"""Nodes of the tree of a body: balls, control points, halves; and the groups that packing puts above its patches."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._lanes import lane, load_lanes, store_lanes
from assembly.distance.bodies.records import (
    BALL,
    CUT,
    GROUP,
    LINKS,
    NODE,
    NONE,
    PATCH_SIZE,
    SPAN,
    UNPLACED,
    USED,
    BodyTree,
    body_head_at,
    node_links_at,
    patch_at,
    tree_node_at,
    tree_state_at,
)
from assembly.geometry.splines.bezier_pieces import UNIT


@kernel(inline=True)
def node_of(tree, k):
    """The doubles of node k."""
    return tree_node_at(tree.nodes, NODE * k)


@kernel(inline=True)
def links_of(tree, k):
    """The integers of node k."""
    return node_links_at(tree.links, USED + LINKS * k)


@kernel(inline=True)
def patch_of(tree, k):
    """Whole patch k."""
    return patch_at(tree.table, PATCH_SIZE * k)


@kernel(inline=True)
def is_group(tree, k):
    """Whether node k is a group of patches."""
    return links_of(tree, k).patch == GROUP


@kernel(inline=True)
def node_size(tree, k):
    """The longer side of a node."""
    node = node_of(tree, k)
    return max(node.length_u, node.length_v)


@kernel(inline=True)
def net_size(patch):
    """Number of doubles of a node's control points: rows (w x, w y, w z, w), then their points in space."""
    return 7 * (patch.degree_u + 1) * (patch.degree_v + 1)


@kernel(inner=True)
def longest_row(nets, hull, count, steps, rows):
    """The length of the longest row of control points; no curve of a row is longer than its control polygon.

    `steps`, `rows`: the number of steps in a row and of rows, each with its stride.
    """
    longest = 0.0
    for r in range(rows[0]):
        total = 0.0
        at = hull + r * rows[1]
        for _ in range(steps[0]):
            x = nets[at + steps[1]] - nets[at]
            y = nets[at + count + steps[1]] - nets[at + count]
            z = nets[at + 2 * count + steps[1]] - nets[at + 2 * count]
            total += math.sqrt(x * x + y * y + z * z)
            at += steps[1]
        longest = max(longest, total)
    return longest


@kernel(inner=True)
def describe_ball(tree, k):
    """Write the middle, points of the hull, ball and side lengths of the patch at node k, from its control net."""
    links, node, nets = links_of(tree, k), node_of(tree, k), tree.nets
    patch = patch_of(tree, links.patch)
    rows, columns = patch.degree_u + 1, patch.degree_v + 1
    count = rows * columns
    at = links.net
    total = 0.0 * load_lanes(nets, at)
    for i in range(rows):
        for j in range(columns):
            factor = tree.pool[patch.tables_u + i] * tree.pool[patch.tables_v + j]
            total = total + factor * load_lanes(nets, at)
            at += 4
    w = 1.0 / lane(total, 3)
    x, y, z = w * lane(total, 0), w * lane(total, 1), w * lane(total, 2)
    node.middle[0], node.middle[1], node.middle[2] = x, y, z
    far = 0.0
    hull = links.net + 4 * count
    for i in range(count):
        row = load_lanes(nets, links.net + 4 * i)
        w = 1.0 / lane(row, 3)
        px, py, pz = w * lane(row, 0), w * lane(row, 1), w * lane(row, 2)
        nets[hull + i], nets[hull + count + i], nets[hull + 2 * count + i] = px, py, pz
        far = max(far, (px - x) * (px - x) + (py - y) * (py - y) + (pz - z) * (pz - z))
    node.radius = math.sqrt(far) + 16.0 * UNIT * body_head_at(tree.pool, 0).reach
    # These lengths only decide what is halved next; no bound depends on them.
    node.length_u = longest_row(nets, hull, count, (rows - 1, columns), (columns, 1))
    node.length_v = longest_row(nets, hull, count, (columns - 1, 1), (rows, columns))
    links.known = BALL


@kernel(inner=True)
def halve_net(nets, source, halves, counts, along_u):
    """De Casteljau's halves of a net at `source`, counts (rows, columns), at two places."""
    rows, columns = counts
    low, high = halves
    for i in range(rows * columns):
        store_lanes(load_lanes(nets, source + 4 * i), nets, high + 4 * i)
    steps, lines = (rows, columns) if along_u else (columns, rows)
    step, across = (4 * columns, 4) if along_u else (4, 4 * columns)
    for line in range(lines):
        a, b = low + across * line, high + across * line
        for r in range(steps):
            store_lanes(load_lanes(nets, b), nets, a + step * r)
            for i in range(steps - 1 - r):
                both = load_lanes(nets, b + step * i) + load_lanes(nets, b + step * (i + 1))
                store_lanes(0.5 * both, nets, b + step * i)


@kernel(inner=True)
def has_room(tree, k):
    """Whether the arrays have room for the halves of node k."""
    state = tree_state_at(tree.links, 0)
    if (state.nodes + 2) * NODE > tree.nodes.size:
        return False
    return is_group(tree, k) or state.nets + 2 * net_size(patch_of(tree, links_of(tree, k).patch)) <= tree.nets.size


@kernel(inner=True)
def halves_of(tree, k):
    """The first of the two halves of node k; if they do not exist yet, its longer side is halved."""
    links, node = links_of(tree, k), node_of(tree, k)
    if links.halves != NONE:
        return links.halves
    state, head = tree_state_at(tree.links, 0), body_head_at(tree.pool, 0)
    patch = patch_of(tree, links.patch)
    size = net_size(patch)
    low = state.nodes
    along_u = node.length_u >= node.length_v
    rows, columns = patch.degree_u + 1, patch.degree_v + 1
    halve_net(tree.nets, links.net, (state.nets, state.nets + size), (rows, columns), along_u)
    degree = patch.degree_u if along_u else patch.degree_v
    away = node.away + (2.0 + 2.0 * head.rational) * degree * UNIT * head.reach
    for part in range(2):
        half, own = node_of(tree, low + part), links_of(tree, low + part)
        own.halves, own.patch, own.depth = NONE, links.patch, links.depth + 1
        own.place = UNPLACED if links.place == CUT else links.place
        own.net, own.spine = state.nets + part * size, links.spine
        half.low_u, half.high_u, half.low_v, half.high_v = node.low_u, node.high_u, node.low_v, node.high_v
        half.away = away
    first, second = node_of(tree, low), node_of(tree, low + 1)
    if along_u:
        first.high_u = second.low_u = 0.5 * (node.low_u + node.high_u)
    else:
        first.high_v = second.low_v = 0.5 * (node.low_v + node.high_v)
    state.nodes = low + 2
    state.nets += 2 * size
    describe_ball(tree, low)
    describe_ball(tree, low + 1)
    links.halves = low
    return low


@kernel(inner=True)
def move_node(tree, source, k):
    """Copy a node to another place."""
    here, there = NODE * k, NODE * source
    for i in range(NODE):
        tree.nodes[here + i] = tree.nodes[there + i]
    here, there = USED + LINKS * k, USED + LINKS * source
    for i in range(LINKS):
        tree.links[here + i] = tree.links[there + i]


@kernel(inner=True)
def sort_along(tree, spare, order, ends, axis):
    """Sort patches order[begin:end] by a coordinate of their middles: Shell's method."""
    begin, end = ends
    gap = (end - begin) // 2
    while gap > 0:
        for i in range(begin + gap, end):
            m = order[i]
            x = node_of(tree, spare + m).middle[axis]
            j = i
            while j >= begin + gap and node_of(tree, spare + order[j - gap]).middle[axis] > x:
                order[j] = order[j - gap]
                j -= gap
            order[j] = m
        gap //= 2


@kernel(inner=True)
def describe_group(tree, k, spare, order, ends):
    """Write the ball of patches order[begin:end] to node k; sort the patches along the longest side of their box."""
    begin, end = ends
    node, links = node_of(tree, k), links_of(tree, k)
    longest, axis = -1.0, 0
    for c in range(3):
        low, high = math.inf, -math.inf
        for i in range(begin, end):
            x = node_of(tree, spare + order[i]).middle[c]
            low, high = min(low, x), max(high, x)
        node.middle[c] = 0.5 * (low + high)
        if high - low > longest:
            longest, axis = high - low, c
    radius = 0.0
    for i in range(begin, end):
        part = node_of(tree, spare + order[i])
        square = 0.0
        for c in range(3):
            square += (part.middle[c] - node.middle[c]) ** 2
        radius = max(radius, math.sqrt(square) + part.radius)
    node.radius = radius * (1.0 + 16.0 * UNIT) + 16.0 * UNIT * body_head_at(tree.pool, 0).reach
    node.extent, node.length_u, node.length_v = radius, 2.0 * radius, 0.0
    links.patch, links.spine = GROUP, links_of(tree, spare + order[begin]).spine
    for i in range(begin, end):
        if links_of(tree, spare + order[i]).spine != links.spine:
            links.spine = NONE
    sort_along(tree, spare, order, ends, axis)


@kernel(inner=True)
def place_patches(tree, given, count):
    """Copy the rows (w x, w y, w z, w) of all patches, one after the other, to their places, and write these places.

    Of the places of spans that of the first patch is known.
    """
    source = at = 0
    span = patch_of(tree, 0).span
    for i in range(count):
        patch = patch_of(tree, i)
        patch.net, patch.span = at, span + SPAN * i
        size = 4 * (patch.degree_u + 1) * (patch.degree_v + 1)
        for k in range(size):
            tree.nets[at + k] = given[source + k]
        source += size
        at += net_size(patch)
    tree_state_at(tree.links, 0).nets = at


@kernel(signatures="(UniTuple(i8[::1], 2), UniTuple(f8[::1], 4), i8[::1])")
def plant_tree(ints, doubles, order):
    """Make nodes of all patches, whose control nets are given, under a tree of groups with root 0.

    `ints`: table and links; `doubles`: pool, nodes, nets, and the given rows of nets; `order` (5 n) is scratch.
    A group is split at the median of its patches, sorted along the longest side of the box of their middles.
    """
    tree = BodyTree(ints[0], doubles[0], ints[1], doubles[1], doubles[2])
    count = order.size // 5
    place_patches(tree, doubles[3], count)
    begin, end = count, 3 * count
    error = body_head_at(tree.pool, 0).error
    # Nodes of patches are first made at the end of the array, and then moved to their places in the tree.
    spare = tree.nodes.size // NODE - count
    for i in range(count):
        links, node = links_of(tree, spare + i), node_of(tree, spare + i)
        links.patch, links.net, links.depth, links.halves, links.place = i, patch_of(tree, i).net, 0, NONE, UNPLACED
        links.spine = patch_of(tree, i).spine
        node.low_u, node.high_u, node.low_v, node.high_v = 0.0, 1.0, 0.0, 1.0
        describe_ball(tree, spare + i)
        order[i] = i
    order[begin], order[end] = 0, count
    used, k = 1, 0
    while k < used:
        low, high = order[begin + k], order[end + k]
        if high - low == 1:
            i = order[low]
            move_node(tree, spare + i, k)
            patch_of(tree, i).node = k
        else:
            describe_group(tree, k, spare, order, (low, high))
            middle = (low + high) // 2
            links_of(tree, k).halves = used
            links_of(tree, k).depth = 0
            order[begin + used], order[end + used] = low, middle
            order[begin + used + 1], order[end + used + 1] = middle, high
            used += 2
        node_of(tree, k).away = error
        k += 1
    tree_state_at(tree.links, 0).nodes = used
