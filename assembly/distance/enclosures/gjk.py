"""The nearest points of two convex sets by Gilbert, Johnson and Keerthi (1988), in the plane or in space.

A set is given by its support: the point farthest along a direction n. Sets are the hull of points, or the ellipsoid
of two foci p0, p1 and the width w = u^2 - |p1 - p0|^2,

    { x : |p0 - x| + |x - p1| <= u },     support  m + E n / (2 sqrt(n' E n)),   E = chi chi' + w I,  chi = p1 - p0,

which needs no division by |chi| (w = 0: the segment; chi = 0: the ball). Nothing here is part of a proof: bounds of the
distance are proven from supports along the direction found (`distance/enclosures/enclosure.py`).
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of
from assembly.geometry.vec import blend, cross, dot, scale, sub

# How it ended: at the nearest points; sets that touch or overlap; the origin inside a full simplex of differences.
APART, OVERLAP, INSIDE = 0, 1, 2
# A vertex of the simplex.
SIMPLEX_VERTEX = record_dtype(
    "f8",
    difference=3,  # on_a - on_b
    on_a=3,  # point of a
    on_b=3,  # point of b
    number=1,  # of the point of b, if b is the hull of points
)
simplex_vertex_at = record_view(SIMPLEX_VERTEX)
VERTEX = size_of(SIMPLEX_VERTEX)
# The simplex.
SIMPLEX = record_dtype(
    "f8",
    vertices=(4, VERTEX),  # a `SIMPLEX_VERTEX` each
    weights=4,  # of the vertices, in the point nearest to the origin
    point=4,  # as set a: the point that is projected on a hull
)
simplex_at = record_view(SIMPLEX)
POINT = place_of(SIMPLEX, "point")
ROOM = size_of(SIMPLEX)
# A convex set: for width < 0 the hull of `count` points from points[at], else the ellipsoid of this width with the two
# points there as its foci.
ConvexSet = namedtuple("ConvexSet", "points at count width")
_ROUNDS = 40
# Nearer than this part of the farthest vertex counts as an overlap.
_NEAR = 1e-14


@kernel(inner=True)
def support_point(shape, n):
    """Farthest point along n, and its number."""
    x, o, width = shape.points, shape.at, shape.width
    if width >= 0.0:
        chi = (x[o + 3] - x[o], x[o + 4] - x[o + 1], x[o + 5] - x[o + 2])
        along = dot(n, chi)
        norm = math.sqrt(width * dot(n, n) + along * along)
        f = 0.5 / norm if norm > 0.0 else 0.0
        s = blend(f * along, chi, f * width, n)
        return (
            0.5 * (x[o] + x[o + 3]) + s[0],
            0.5 * (x[o + 1] + x[o + 4]) + s[1],
            0.5 * (x[o + 2] + x[o + 5]) + s[2],
        ), 0
    best = -math.inf
    found = 0
    for k in range(shape.count):
        p = o + 3 * k
        value = n[0] * x[p] + n[1] * x[p + 1] + n[2] * x[p + 2]
        if value > best:
            best = value
            found = k
    p = o + 3 * found
    return (x[p], x[p + 1], x[p + 2]), found


@kernel(inline=True)
def vertex(g, k):
    """The difference that is vertex k of the simplex."""
    y = simplex_vertex_at(g, VERTEX * k).difference
    return (y[0], y[1], y[2])


@kernel(inline=True)
def on_b(g, k):
    """The point of b at vertex k of the simplex."""
    p = simplex_vertex_at(g, VERTEX * k).on_b
    return (p[0], p[1], p[2])


@kernel(inline=True)
def numbers_of(g):
    """Numbers of the points of a hull at the first three vertices of the simplex, used or not."""
    first, second, third = simplex_vertex_at(g, 0), simplex_vertex_at(g, VERTEX), simplex_vertex_at(g, 2 * VERTEX)
    return first.number, second.number, third.number


@kernel(inline=True)
def put_numbers(g, numbers):
    """Write what `numbers_of` reads."""
    for k in range(3):
        simplex_vertex_at(g, VERTEX * k).number = numbers[k]


@kernel(inline=True)
def put_vertex(g, k, difference, a, b, number):
    v = simplex_vertex_at(g, VERTEX * k)
    for c in range(3):
        v.difference[c] = difference[c]
        v.on_a[c] = a[c]
        v.on_b[c] = b[c]
    v.number = number


@kernel(inline=True)
def move_vertex(g, source, target):
    v = simplex_vertex_at(g, VERTEX * source)
    put_vertex(g, target, v.difference, v.on_a, v.on_b, v.number)


@kernel(inner=True)
def nearest_on_simplex(g, count, full):
    """Reduce the simplex to its smallest face that holds the newest vertex and the point nearest to the origin.

    Returns the number of vertices kept, and the point. Every face with the newest vertex is tried whose own nearest
    point is inside it, so that there is an answer whatever the rounding.
    """
    weight = simplex_at(g, 0).weights
    new = count - 1
    p = vertex(g, new)
    best = dot(p, p)
    if count == 2:
        a = vertex(g, 0)
        d = sub(a, p)
        length = dot(d, d)
        t = -dot(p, d) / length if length > 0.0 else 0.0
        if 0.0 < t < 1.0:
            weight[0] = t
            weight[1] = 1.0 - t
            return 2, blend(1.0 - t, p, t, a)
        move_vertex(g, 1, 0)
        weight[0] = 1.0
        return 1, p
    if count == 1:
        weight[0] = 1.0
        return 1, p
    found = p
    keep = (-1, -1)
    weights = (1.0, 0.0, 0.0)
    for i in range(new):
        a = vertex(g, i)
        d = sub(a, p)
        length = dot(d, d)
        t = -dot(p, d) / length if length > 0.0 else 0.0
        if 0.0 < t < 1.0:
            v = blend(1.0 - t, p, t, a)
            size = dot(v, v)
            if size < best:
                best, found, keep, weights = size, v, (i, -1), (1.0 - t, t, 0.0)
        for j in range(i):
            e = sub(vertex(g, j), p)
            if full == 3:
                # In the plane a triangle counts only if the origin is inside: all barycentric coordinates are positive.
                turn = d[0] * e[1] - d[1] * e[0]
                left = d[1] * p[0] - d[0] * p[1]
                right = e[0] * p[1] - e[1] * p[0]
                if turn < 0.0:
                    turn, left, right = -turn, -left, -right
                if left > 0.0 and right > 0.0 and left + right < turn:
                    return 3, (0.0, 0.0, 0.0)
                continue
            m = cross(d, e)
            area = dot(m, m)
            if area <= 0.0:
                continue
            # Barycentric coordinates of the origin's projection.
            s = -dot(cross(p, e), m) / area
            r = -dot(cross(d, p), m) / area
            if s > 0.0 and r > 0.0 and s + r < 1.0:
                v = scale(dot(p, m) / area, m)
                size = dot(v, v)
                if size < best:
                    best, found, keep, weights = size, v, (i, j), (1.0 - s - r, s, r)
    if count == full and full == 4 and inside_tetrahedron(g):
        return 4, (0.0, 0.0, 0.0)
    # Move the vertices that are kept to the front, in their order.
    kept = 0
    order = (min(keep[0], keep[1]), max(keep[0], keep[1]))
    for k in range(2):
        if order[k] >= 0:
            move_vertex(g, order[k], kept)
            weight[kept] = weights[1] if order[k] == keep[0] else weights[2]
            kept += 1
    move_vertex(g, new, kept)
    weight[kept] = weights[0]
    return kept + 1, found


@kernel(inner=True)
def inside_tetrahedron(g):
    """Whether the origin is inside the tetrahedron of the simplex."""
    p = vertex(g, 3)
    a = sub(vertex(g, 0), p)
    b = sub(vertex(g, 1), p)
    c = sub(vertex(g, 2), p)
    volume = dot(a, cross(b, c))
    if volume == 0.0:
        return False
    s = -dot(p, cross(b, c)) / volume
    t = -dot(a, cross(p, c)) / volume
    r = -dot(a, cross(b, p)) / volume
    return s > 0.0 and t > 0.0 and r > 0.0 and s + t + r < 1.0


@kernel(inner=True)
def inside_weights(full, g):
    """Weights of the vertices of a full simplex that has the origin inside."""
    weight = simplex_at(g, 0).weights
    total = 0.0
    for k in range(full):
        a = vertex(g, (k + 1) % full)
        b = vertex(g, (k + 2) % full)
        if full == 3:
            part = abs(a[0] * b[1] - a[1] * b[0])
        else:
            part = abs(dot(a, cross(b, vertex(g, (k + 3) % full))))
        weight[k] = part
        total += part
    for k in range(full):
        weight[k] /= total


@kernel(inner=True)
def gjk(full, first, second, v, limit, part, g):
    """Nearest points of two sets a and b in `full` - 1 dimensions, from a first direction v.

    Stops when sets are proven farther apart than `limit`, or the distance is known to its `part`. Returns how it
    ended, the vector from b to a between the nearest points, and the vertices of the simplex left in g.
    """
    count = 0
    size = dot(v, v)
    if size == 0.0:
        v = (1.0, 0.0, 0.0)
        size = 1.0
    known = False
    farthest = 0.0
    for _ in range(_ROUNDS):
        a, _i = support_point(first, (-v[0], -v[1], -v[2]))
        b, number = support_point(second, v)
        y = sub(a, b)
        # The least v.(a - b) over both sets.
        below = dot(v, y)
        if known and size - below <= part * size:
            break
        if below > 0.0 and below * below > limit * limit * size and known:
            break
        again = False
        for k in range(count):
            z = vertex(g, k)
            again = again or (z[0] == y[0] and z[1] == y[1] and z[2] == y[2])
        if again:
            break
        put_vertex(g, count, y, a, b, number)
        count += 1
        farthest = max(farthest, dot(y, y))
        count, w = nearest_on_simplex(g, count, full)
        if count == full:
            return INSIDE, w, count
        least = dot(w, w)
        if known and least >= size:
            # Rounding: no progress. The simplex is one of the better direction, up to rounding.
            break
        v = w
        size = least
        known = True
        if size <= _NEAR * _NEAR * farthest:
            return OVERLAP, v, count
    return APART, v, count


@kernel(inline=True)
def witnesses(g, count):
    """The nearest points of a and b from the simplex and its weights."""
    a = (0.0, 0.0, 0.0)
    b = (0.0, 0.0, 0.0)
    for k in range(count):
        w = simplex_at(g, 0).weights[k]
        p = simplex_vertex_at(g, VERTEX * k).on_a
        a = blend(1.0, a, w, (p[0], p[1], p[2]))
        b = blend(1.0, b, w, on_b(g, k))
    return a, b
