"""Cells that are halved on demand, and the box, the ball and the radii of a cell from its corners and bounds."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.splines.evaluate import curve_lanes, into_domain, surface_at, surface_lanes, xyz
from assembly.geometry.vec import add, cross, dot, scale, sub
from assembly.proximity.clearance.records import (
    FLAT,
    LINKS_SIZE,
    NODE_SIZE,
    NONE,
    ROUNDED,
    WIRE,
    Forest,
    cell_face_at,
    links_at,
    node_at,
)


@kernel(inline=True)
def corner_of(node, i):
    """Corner i of a cell."""
    return node.corner[i, 0], node.corner[i, 1], node.corner[i, 2]


@kernel(inline=True)
def put(row, x):
    """Write a vector into three places."""
    row[0], row[1], row[2] = x


@kernel(inline=True)
def vector(row):
    """The vector in three places."""
    return row[0], row[1], row[2]


@kernel(inline=True)
def is_triangle(node):
    """Whether the last two corners of a cell are the same."""
    return node.uv[2, 0] == node.uv[3, 0] and node.uv[2, 1] == node.uv[3, 1]


@kernel(inline=True)
def arc_height(node):
    """How far the arc of a piece of a wire's spine is from its chord: R - sqrt(R^2 - h^2), h half the chord."""
    bend = node.first[0]
    if bend == 0.0:
        return 0.0
    d = sub(corner_of(node, 1), corner_of(node, 0))
    h = 0.5 * bend * math.sqrt(dot(d, d))
    return h * h / (bend * (1.0 + math.sqrt(max(1.0 - h * h, 0.0))))


@kernel(inline=True)
def sag_of_rim(node, e):
    """How far a boundary curve is from the edge that is its chord, at most."""
    dt = node.rim_t[e, 1] - node.rim_t[e, 0]
    return 0.125 * dt * dt * (node.rim_second[e, 0] * node.first[0] + node.rim_second[e, 1] * node.first[1])


@kernel(inner=True)
def write_radii(links, node):
    """Write a cell's radii, from how far the surface may leave its corners' hull and boundary curves their chords."""
    node.disc = 0.0
    if links.form == WIRE:
        node.reach = arc_height(node) + node.pad
        node.rho = node.first[1] + node.reach
        return
    uv = node.uv
    lu = max(uv[0, 0], uv[1, 0], uv[2, 0], uv[3, 0]) - min(uv[0, 0], uv[1, 0], uv[2, 0], uv[3, 0])
    lv = max(uv[0, 1], uv[1, 1], uv[2, 1], uv[3, 1]) - min(uv[0, 1], uv[1, 1], uv[2, 1], uv[3, 1])
    bent = 0.125 * (node.second[0] * lu * lu + 2.0 * node.second[1] * lu * lv + node.second[2] * lv * lv)
    border = 0.0
    beyond = 0.0
    for e in range(3):
        if links.rim[e] != NONE:
            d = sag_of_rim(node, e)
            border = max(border, d)
            if links.hollow[e] != 1:
                beyond = max(beyond, d)
    node.reach = bent + border + node.pad
    node.rho = node.pad
    if links.form == FLAT:
        # All that a flat face is off its corners, and what it has beyond a chord, lies in its plane.
        node.disc = bent + beyond
    elif links.form == ROUNDED:
        node.rho += bent + beyond
    else:
        node.disc = bent
        node.rho += beyond


@kernel(inner=True)
def write_axes(node):
    """The longest side or diagonal of a cell is its first axis, its normal the last."""
    first = (1.0, 0.0, 0.0)
    best = 0.0
    for i in range(4):
        for j in range(i):
            d = sub(corner_of(node, i), corner_of(node, j))
            if dot(d, d) > best:
                best, first = dot(d, d), d
    first = scale(1.0 / math.sqrt(dot(first, first)), first)
    normal = cross(sub(corner_of(node, 2), corner_of(node, 0)), sub(corner_of(node, 3), corner_of(node, 1)))
    normal = sub(normal, scale(dot(normal, first), first))
    length = math.sqrt(dot(normal, normal))
    if length > 0.0:
        normal = scale(1.0 / length, normal)
    else:
        other = (1.0, 0.0, 0.0) if abs(first[0]) < 0.7 else (0.0, 1.0, 0.0)
        normal = cross(first, other)
        normal = scale(1.0 / math.sqrt(dot(normal, normal)), normal)
    put(node.axes[0], first)
    put(node.axes[1], cross(normal, first))
    put(node.axes[2], normal)


@kernel(inner=True)
def measure(links, node):
    """Radii, box and ball of a cell from its parameters, bounds and corners."""
    write_radii(links, node)
    write_axes(node)
    thick = node.disc + node.rho
    center = (0.0, 0.0, 0.0)
    for e in range(3):
        axis = vector(node.axes[e])
        low, high = math.inf, -math.inf
        for i in range(4):
            h = dot(axis, corner_of(node, i))
            low, high = min(low, h), max(high, h)
        node.half[e] = 0.5 * (high - low) + thick
        center = add(center, scale(0.5 * (low + high), axis))
    put(node.center, center)
    most = 0.0
    for i in range(4):
        d = sub(corner_of(node, i), center)
        most = max(most, dot(d, d))
    node.radius = math.sqrt(most) + thick


@kernel(inner=True)
def point_on(store, surface, u, v):
    """The point of a surface at parameters that may be beyond the ends of a closed direction."""
    patch = surface_at(store.table, surface)
    s, _ = into_domain(store.pool, patch.breaks_u, patch.spans_u, patch.closed_u, u)
    t, _ = into_domain(store.pool, patch.breaks_v, patch.spans_v, patch.closed_v, v)
    return xyz(surface_lanes(store, surface, s, t).point)


@kernel(inline=True)
def into_period(store, surface, near, at):
    """The parameters `at`, moved by whole periods to where they are nearest to the parameters `near`."""
    patch = surface_at(store.table, surface)
    u, v = at
    if patch.closed_u != 0:
        period = store.pool[patch.breaks_u + patch.spans_u] - store.pool[patch.breaks_u]
        u += period * math.floor((near[0] - u) / period + 0.5)
    if patch.closed_v != 0:
        period = store.pool[patch.breaks_v + patch.spans_v] - store.pool[patch.breaks_v]
        v += period * math.floor((near[1] - v) / period + 0.5)
    return u, v


@kernel(inner=True)
def side_cost(links, node, i, j, by_length):
    """What halving the side between two corners would remove: squared length in space, or eight times chord error."""
    if by_length:
        d = sub(corner_of(node, i), corner_of(node, j))
        return dot(d, d)
    du, dv = abs(node.uv[i, 0] - node.uv[j, 0]), abs(node.uv[i, 1] - node.uv[j, 1])
    cost = node.second[0] * du * du + 2.0 * node.second[1] * du * dv + node.second[2] * dv * dv
    if i < 3 and j == (i + 1) % 3 and links.rim[i] != NONE:
        cost += 8.0 * sag_of_rim(node, i)
    return cost


@kernel(inline=True)
def put_corner(node, i, uv, x):
    """Write a corner."""
    node.uv[i, 0], node.uv[i, 1] = uv
    put(node.corner[i], x)


@kernel(inner=True)
def middle_of(forest, links, node, i):
    """The parameters at which side i of a triangle is halved: a chord of the boundary at its curve."""
    j = (i + 1) % 3
    uv = 0.5 * (node.uv[i, 0] + node.uv[j, 0]), 0.5 * (node.uv[i, 1] + node.uv[j, 1])
    if links.rim[i] == NONE:
        return uv
    at, _rate, _bend = curve_lanes(forest.store, links.rim[i], 0.5 * (node.rim_t[i, 0] + node.rim_t[i, 1]))
    x = xyz(at)
    return into_period(forest.store, cell_face_at(forest.faces, links.face).surface, uv, (x[0], x[1]))


@kernel(inline=True)
def uv_of(node, i):
    """Parameters of a corner."""
    return node.uv[i, 0], node.uv[i, 1]


@kernel(inner=True)
def held(links, node, e, part, p, q, r):
    """A ratio: if it is above 1, a part of edge e's curve with ends p and q is in the triangle p q r; see `rims.py`."""
    dt = part * (node.rim_t[e, 1] - node.rim_t[e, 0])
    if links.rim[e] == NONE or links.hollow[e] == -1 or dt == 0.0:
        return math.inf
    bend_u, bend_v = node.rim_second[e, 0], node.rim_second[e, 1]
    area = abs((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))
    one = abs(r[1] - p[1]) * bend_u + abs(r[0] - p[0]) * bend_v
    other = abs(r[1] - q[1]) * bend_u + abs(r[0] - q[0]) * bend_v
    asked = 0.5 * dt * dt * max(one, other)
    return area / asked if asked > 0.0 else math.inf


@kernel(inner=True)
def held_after(links, node, i, m):
    """The least ratio `held` of the curves of a triangle whose side i is halved at m."""
    j, k = (i + 1) % 3, (i + 2) % 3
    p, q, r = uv_of(node, i), uv_of(node, j), uv_of(node, k)
    halves = min(held(links, node, i, 0.5, p, m, r), held(links, node, i, 0.5, m, q, r))
    return min(halves, held(links, node, j, 1.0, q, r, m), held(links, node, k, 1.0, r, p, m))


@kernel(inner=True)
def best_side(forest, links, node, by_length):
    """The side of a triangle to halve, its middle, and how far boundary curves may then leave their triangles.

    It is the costliest side after which all curves stay in their triangles, or the one that comes nearest to that.
    """
    best, i = -1.0, 0
    most, j = -1.0, 0
    for e in range(3):
        hold = held_after(links, node, e, middle_of(forest, links, node, e))
        cost = side_cost(links, node, e, (e + 1) % 3, by_length)
        if hold >= 1.0 and cost > best:
            best, i = cost, e
        if hold > most:
            most, j = hold, e
    if best >= 0.0:
        return i, middle_of(forest, links, node, i), 0.0
    cut = 0.0
    for e in range(3):
        if links.rim[e] != NONE and links.hollow[e] != -1:
            cut = max(cut, sag_of_rim(node, e))
    return j, middle_of(forest, links, node, j), cut


@kernel(inner=True)
def halve_triangle(forest, k, n, by_length):
    """A side is halved, a chord of the boundary at its curve."""
    links, node = links_at(forest.links, k), node_at(forest.nodes, k)
    one, other = node_at(forest.nodes, n), node_at(forest.nodes, n + 1)
    i, uv, cut = best_side(forest, links, node, by_length)
    j = (i + 1) % 3
    if links.rim[i] != NONE:
        t = 0.5 * (node.rim_t[i, 0] + node.rim_t[i, 1])
        one.rim_t[i, 1] = t
        other.rim_t[i, 0] = t
    one.pad += cut
    other.pad += cut
    x = point_on(forest.store, cell_face_at(forest.faces, links.face).surface, uv[0], uv[1])
    put_corner(one, j, uv, x)
    put_corner(other, i, uv, x)
    if j == 2:
        put_corner(one, 3, uv, x)
    if i == 2:
        put_corner(other, 3, uv, x)
    # The new side, from the middle to the corner opposite, is no chord of the boundary.
    links_at(forest.links, n).rim[j] = NONE
    links_at(forest.links, n + 1).rim[(i + 2) % 3] = NONE


@kernel(inner=True)
def halve_rectangle(forest, k, n, by_length):
    """Sides 01 and 32 are halved, or 12 and 03."""
    links, node = links_at(forest.links, k), node_at(forest.nodes, k)
    surface = cell_face_at(forest.faces, links.face).surface
    across = max(side_cost(links, node, 1, 2, by_length), side_cost(links, node, 0, 3, by_length)) > max(
        side_cost(links, node, 0, 1, by_length), side_cost(links, node, 3, 2, by_length)
    )
    for side in range(2):
        if across:
            p, q = (1, 2) if side == 0 else (0, 3)
        else:
            p, q = (0, 1) if side == 0 else (3, 2)
        uv = 0.5 * (node.uv[p, 0] + node.uv[q, 0]), 0.5 * (node.uv[p, 1] + node.uv[q, 1])
        x = point_on(forest.store, surface, uv[0], uv[1])
        put_corner(node_at(forest.nodes, n), q, uv, x)
        put_corner(node_at(forest.nodes, n + 1), p, uv, x)


@kernel(inner=True)
def halve_wire(forest, k, n):
    """A piece of a wire's spine is halved at the middle of its line or arc."""
    node = node_at(forest.nodes, k)
    x = scale(0.5, add(corner_of(node, 0), corner_of(node, 1)))
    if node.first[0] > 0.0:
        out = sub(x, vector(node.spine))
        x = add(vector(node.spine), scale(1.0 / (node.first[0] * math.sqrt(dot(out, out))), out))
    for i in range(1, 3):
        put(node_at(forest.nodes, n).corner[i], x)
    for i in range(0, 4, 3):
        put(node_at(forest.nodes, n + 1).corner[i], x)


@kernel(inner=True)
def halve(forest, k, by_length):
    """Give cell k two children; False if the tables are full."""
    n = forest.used[0]
    if n + 2 > len(forest.links):
        return False
    for child in range(n, n + 2):
        for c in range(LINKS_SIZE):
            forest.links[child, c] = forest.links[k, c]
        for c in range(NODE_SIZE):
            forest.nodes[child, c] = forest.nodes[k, c]
        links_at(forest.links, child).child = NONE
    if links_at(forest.links, k).form == WIRE:
        halve_wire(forest, k, n)
    elif is_triangle(node_at(forest.nodes, k)):
        halve_triangle(forest, k, n, by_length)
    else:
        halve_rectangle(forest, k, n, by_length)
    forest.used[0] = n + 2
    measure(links_at(forest.links, n), node_at(forest.nodes, n))
    measure(links_at(forest.links, n + 1), node_at(forest.nodes, n + 1))
    links_at(forest.links, k).child = n
    return True


@kernel(signatures="(i8[::1], f8[::1], i8[:, ::1], i8[:, ::1], f8[:, ::1])")
def place_cells(table, pool, faces, links, nodes):
    """Corners, radii, boxes and balls of cells from their parameters and bounds."""
    forest = Forest(Store(table, pool), faces, links, nodes, None)
    for k in range(len(links)):
        node = node_at(nodes, k)
        surface = cell_face_at(faces, links_at(links, k).face).surface
        for i in range(4 if links_at(links, k).form != WIRE else 0):
            put(node.corner[i], point_on(forest.store, surface, node.uv[i, 0], node.uv[i, 1]))
        measure(links_at(links, k), node)


@kernel(signatures="(i8[::1], f8[::1], i8[:, ::1], i8[:, ::1], f8[:, ::1], i8[::1], i8, b1)")
def halve_cell(table, pool, faces, links, nodes, used, k, by_length):
    """`halve`, from Python."""
    return halve(Forest(Store(table, pool), faces, links, nodes, used), k, by_length)
