"""Which of many Bezier pieces come nearer than a clearance to which of many convex hulls, in one call.

A piece lies in the convex hull of its Bezier points, so that every unit vector n gives a lower bound,

    distance >= min over the obstacle of n.b - max over the Bezier points of n.p.

In the plane, a few points of the curve are first tested against a polygon inside the obstacle: x is inside where it is
left of every edge of a closed polygon of the obstacle's vertices, whatever their order. Then boxes and fixed directions
separate most of the other pairs, then a direction found by GJK. A piece that no direction separates is halved by de
Casteljau's algorithm. The ends of halves are points of the curve: one within the clearance proves the pair near. A
piece shorter than the tolerance, or than its rounding error, stays undecided, which counts as near.

One halving is n sums, each with an error of half a unit 2^-52 of the largest number. After 50 halvings no piece of a
polynomial is longer than its rounding error: their error is 25 n units, for both X and w where there are weights. The
error bound of (64 n + 64) units suffices for 128 halvings.

"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly.distance.enclosures.enclosure import hull_support
from assembly.distance.enclosures.gjk import INSIDE, OVERLAP, POINT, ROOM, ConvexSet, gjk, simplex_at, support_point
from assembly.geometry.interval import EPSILON, down, up
from assembly.geometry.vec import dot

# Of a pair: proven apart, a point within the clearance, open at the tolerance.
APART, NEAR, OPEN = 0, 1, 2
# The most pieces that wait on the stack.
DEPTH = 40
# Convex hulls. places: where the vertices of each begin, and how many; boxes: their corners; supports: support values
# along `directions`, the same for all hulls; polygons: polygons inside the hulls, in the plane.
Obstacles = namedtuple("Obstacles", "places vertices boxes directions supports polygons")
# stack: waiting Bezier pieces, homogeneous; points: Bezier points in space of the current piece; off: error bound.
WaitingPieces = namedtuple("WaitingPieces", "stack degree rational points off")
# Points of a curve that are tested first, and pieces of a pair that are tested before GJK is used.
_LOOKS, _PIECES = 15, 4


@kernel(inner=True, exact=True)
def boxes_apart(points, o, count, boxes, j, reach):
    """Whether the box of points is farther from a box than the reach."""
    gap = 0.0
    for k in range(3):
        lo = points[o + k]
        hi = lo
        for i in range(1, count):
            x = points[o + 3 * i + k]
            lo = min(lo, x)
            hi = max(hi, x)
        d = max(boxes[j, k] - hi, lo - boxes[j, 3 + k])
        if d > 0.0:
            gap += d * d
    return math.sqrt(gap) * (1.0 - 8.0 * EPSILON) > reach


@kernel(inline=True)
def from_center(points, o, boxes, j):
    """From the middle of a box to a point: a first direction."""
    return (
        points[o] - 0.5 * (boxes[j, 0] + boxes[j, 3]),
        points[o + 1] - 0.5 * (boxes[j, 1] + boxes[j, 4]),
        points[o + 2] - 0.5 * (boxes[j, 2] + boxes[j, 5]),
    )


@kernel(inner=True, exact=True)
def in_polygon(x, y, obstacles, polygons, j, off):
    """Whether a point of the plane, with errors up to `off`, is left of every edge of the polygon of an obstacle."""
    edges = polygons[j, 0]
    if edges < 3:
        return False
    p = polygons[j, edges]
    a = obstacles[p] - x
    b = obstacles[p + 1] - y
    for k in range(1, edges + 1):
        p = polygons[j, k]
        c = obstacles[p] - x
        d = obstacles[p + 1] - y
        m = abs(a) + abs(b)
        n = abs(c) + abs(d)
        if not (a * d - b * c > 2.0 * off * (m + n) + 16.0 * EPSILON * m * n):
            return False
        a = c
        b = d
    return True


@kernel(inner=True, allocates=True)
def inner_polygons(full, hulls, obstacles, directions):
    """For every obstacle in the plane: the number, then the places, of its farthest vertices along the directions."""
    polygons = np.zeros((hulls.shape[0], directions.shape[0] + 1), dtype=np.int64)
    if full == 3:
        for j in range(hulls.shape[0]):
            count = 0
            for k in range(directions.shape[0]):
                n = (directions[k, 0], directions[k, 1], directions[k, 2])
                _x, found = support_point(ConvexSet(obstacles, hulls[j, 0], hulls[j, 1], -1.0), n)
                place = hulls[j, 0] + 3 * found
                if count == 0 or (place != polygons[j, count] and place != polygons[j, 1]):
                    count += 1
                    polygons[j, count] = place
            polygons[j, 0] = count
    return polygons


@kernel(inner=True)
def fill_basis(degree, basis):
    """Bernstein polynomials at the parameters that are tested first, one row each."""
    for m in range(_LOOKS):
        t = (m + 1) / (_LOOKS + 1)
        binomial = 1.0
        for k in range(degree + 1):
            basis[m, k] = binomial * t**k * (1.0 - t) ** (degree - k)
            binomial = binomial * (degree - k) / (k + 1)


@kernel(inner=True, exact=True)
def look(points, degree, basis, looks):
    """Write points of a piece that is not rational to the rows of `looks`."""
    for m in range(_LOOKS):
        x = 0.0
        y = 0.0
        z = 0.0
        for k in range(degree + 1):
            f = basis[m, k]
            x += f * points[3 * k]
            y += f * points[3 * k + 1]
            z += f * points[3 * k + 2]
        looks[3 * m] = x
        looks[3 * m + 1] = y
        looks[3 * m + 2] = z


@kernel(inner=True, exact=True)
def look_is_near(looks, hulls, j, off):
    """Whether one of the tested points is proven inside an obstacle of the plane."""
    boxes = hulls.boxes
    for m in range(_LOOKS):
        x = looks[3 * m]
        y = looks[3 * m + 1]
        if boxes[j, 0] < x < boxes[j, 3] and boxes[j, 1] < y < boxes[j, 4]:
            if in_polygon(x, y, hulls.vertices, hulls.polygons, j, off):
                return True
    return False


@kernel(inline=True)
def hull_of(hulls, j):
    """An obstacle as a convex set."""
    return ConvexSet(hulls.vertices, hulls.places[j, 0], hulls.places[j, 1], -1.0)


@kernel(inline=True)
def is_beyond(points, o, count, hulls, j, reach):
    """Whether boxes or a fixed direction prove points farther than the reach from an obstacle."""
    return boxes_apart(points, o, count, hulls.boxes, j, reach) or parted(
        points, o, count, hulls.directions, hulls.supports, j, reach
    )


@kernel(inner=True, exact=True)
def end_is_near(full, points, o, hulls, j, clearance, off, g):
    """Whether a point of the curve is proven within the clearance of a hull, with all rounding errors counted."""
    reach = up(clearance + off)
    if is_beyond(points, o, 1, hulls, j, reach):
        return False
    if in_polygon(points[o], points[o + 1], hulls.vertices, hulls.polygons, j, off):
        return True
    first = from_center(points, o, hulls.boxes, j)
    simplex = simplex_at(g, 0)
    for k in range(3):
        simplex.point[k] = points[o + k]
    how, v, _kept = gjk(full, ConvexSet(g, POINT, 1, -1.0), hull_of(hulls, j), first, clearance, 1e-12, g)
    if how == INSIDE:
        return True
    return up(math.sqrt(dot(v, v)) * (1.0 + 8.0 * EPSILON)) + off <= clearance


@kernel(inner=True, exact=True)
def project(stack, o, degree, rational, points):
    """Bezier points in space of a piece at stack[o:], to points."""
    for i in range(degree + 1):
        p = o + 4 * i
        f = 1.0 / stack[p + 3] if rational else 1.0
        for k in range(3):
            points[3 * i + k] = f * stack[p + k]


@kernel(inner=True, exact=True)
def is_apart(full, curve, hulls, j, clearance, g):
    """Whether a direction by GJK proves the points of a piece farther than the clearance from an obstacle."""
    points, degree, off = curve.points, curve.degree, curve.off
    hull = hull_of(hulls, j)
    first = from_center(points, 3 * (degree // 2), hulls.boxes, j)
    how, v, _k = gjk(full, ConvexSet(points, 0, degree + 1, -1.0), hull, first, clearance + off, 1e-3, g)
    if how == INSIDE or how == OVERLAP:
        return False
    length = math.sqrt(dot(v, v))
    n = (-v[0] / length, -v[1] / length, -v[2] / length)
    c = (points[0], points[1], points[2])
    high = hull_support(points, 0, degree + 1, n, c)
    high += hull_support(hull.points, hull.at, hull.count, (-n[0], -n[1], -n[2]), c)
    return down(-high - off) * (1.0 - 8.0 * EPSILON) > clearance


@kernel(inline=True, exact=True)
def halve_piece(stack, o, degree):
    """The piece at stack[o:] in halves: the first one there, the second one behind it."""
    size = 4 * (degree + 1)
    p = o + size
    for k in range(size):
        stack[p + k] = stack[o + k]
    for r in range(1, degree + 1):
        for i in range(degree - r + 1):
            q = p + 4 * i
            for k in range(4):
                stack[q + k] = 0.5 * (stack[q + k] + stack[q + 4 + k])
        for k in range(4):
            stack[o + 4 * r + k] = stack[p + k]


@kernel(inner=True, exact=True)
def piece_is_near(full, curve, hulls, j, clearance, tolerance, g):
    """Whether a piece, at the front of the stack, is apart from, near or open to an obstacle."""
    stack, degree, rational, points, off = curve.stack, curve.degree, curve.rational, curve.points, curve.off
    size = 4 * (degree + 1)
    top = 0
    project(stack, 0, degree, rational, points)
    if end_is_near(full, points, 0, hulls, j, clearance, off, g):
        return NEAR
    if end_is_near(full, points, 3 * degree, hulls, j, clearance, off, g):
        return NEAR
    pieces = 0
    while top >= 0:
        o = size * top
        pieces += 1
        project(stack, o, degree, rational, points)
        if is_beyond(points, 0, degree + 1, hulls, j, up(clearance + off)):
            top -= 1
            continue
        if pieces > _PIECES and is_apart(full, curve, hulls, j, clearance, g):
            top -= 1
            continue
        extent = 0.0
        for i in range(1, degree + 1):
            d = (points[3 * i] - points[0], points[3 * i + 1] - points[1], points[3 * i + 2] - points[2])
            extent = max(extent, dot(d, d))
        shortest = max(tolerance, off)
        if extent <= shortest * shortest or top + 1 >= DEPTH:
            return OPEN
        halve_piece(stack, o, degree)
        project(stack, o + size, 0, rational, points)
        if end_is_near(full, points, 0, hulls, j, clearance, off, g):
            return NEAR
        top += 1
    return APART


@kernel(inner=True, allocates=True)
def fixed_directions(full):
    """Unit vectors all around: 24 in the plane, 26 in space, rounded."""
    if full == 3:
        n = np.zeros((24, 3))
        for k in range(24):
            n[k, 0] = math.cos(k * math.pi / 12.0)
            n[k, 1] = math.sin(k * math.pi / 12.0)
        return n
    n = np.zeros((26, 3))
    k = 0
    for x in range(-1, 2):
        for y in range(-1, 2):
            for z in range(-1, 2):
                if x != 0 or y != 0 or z != 0:
                    f = 1.0 / math.sqrt(float(x * x + y * y + z * z))
                    n[k, 0], n[k, 1], n[k, 2] = f * x, f * y, f * z
                    k += 1
    return n


@kernel(inner=True, exact=True)
def parted(points, o, count, directions, supports, j, reach):
    """Whether one of the directions proves points farther than the reach from a hull."""
    most = 0.0
    for i in range(o, o + 3 * count):
        most = max(most, abs(points[i]))
    # Three products, two sums and a difference of numbers below the first, and the rounding of the support.
    least = up(reach + 16.0 * EPSILON * most) * (1.0 + 8.0 * EPSILON)
    for k in range(directions.shape[0]):
        x, y, z = directions[k, 0], directions[k, 1], directions[k, 2]
        edge = supports[j, k] + least
        p = o
        for _ in range(count):
            if x * points[p] + y * points[p + 1] + z * points[p + 2] <= edge:
                break
            p += 3
        if p == o + 3 * count:
            return True
    return False


@kernel(inner=True, allocates=True)
def obstacles_of(full, places, vertices, boxes):
    """Hulls with their supports along fixed directions and polygons inside."""
    directions = fixed_directions(full)
    supports = np.empty((places.shape[0], directions.shape[0]))
    for j in range(places.shape[0]):
        for k in range(directions.shape[0]):
            n = (directions[k, 0], directions[k, 1], directions[k, 2])
            supports[j, k] = hull_support(vertices, places[j, 0], places[j, 1], n, (0.0, 0.0, 0.0))
    return Obstacles(places, vertices, boxes, directions, supports, inner_polygons(full, places, vertices, directions))


@kernel(
    signatures=("(i8, Tuple((i8[:, ::1], f8[::1])), Tuple((i8[:, ::1], f8[::1], f8[:, ::1])), f8, f8, i8[:, ::1])"),
    allocates=True,
)
def near_pairs(full, pieces, obstacles, clearance, tolerance, out):
    """Whether curve i comes near obstacle j, to out (curves, obstacles).

    pieces: a table of rows (curve, degree, rational, place), and a pool where their homogeneous points stand;
    obstacles: rows (place, count), vertices, and boxes: lower and upper corner of each, six numbers.
    """
    table, pool = pieces
    places, vertices, boxes = obstacles
    hulls = obstacles_of(full, places, vertices, boxes)
    degree = 0
    for i in range(table.shape[0]):
        degree = max(degree, table[i, 1])
    stack = np.empty(4 * (degree + 1) * (DEPTH + 1))
    points = np.empty(3 * (degree + 1))
    g = np.zeros(ROOM)
    basis = np.empty((_LOOKS, degree + 1))
    looks = np.empty(3 * _LOOKS)
    filled = -1
    for i in range(table.shape[0]):
        number, degree, rational, place = table[i, 0], table[i, 1], table[i, 2] != 0, table[i, 3]
        most = 0.0
        for m in range(degree + 1):
            f = 1.0 / pool[place + 4 * m + 3] if rational else 1.0
            for k in range(3):
                points[3 * m + k] = f * pool[place + 4 * m + k]
                most = max(most, abs(points[3 * m + k]))
        off = (64.0 * degree + 64.0) * EPSILON * most
        looked = full == 3 and not rational
        if looked:
            if filled != degree:
                fill_basis(degree, basis)
                filled = degree
            look(points, degree, basis, looks)
        curve = WaitingPieces(stack, degree, rational, points, off)
        for j in range(places.shape[0]):
            if out[number, j] == NEAR:
                continue
            if looked and look_is_near(looks, hulls, j, off):
                out[number, j] = NEAR
                continue
            for k in range(4 * (degree + 1)):
                stack[k] = pool[place + k]
            told = piece_is_near(full, curve, hulls, j, clearance, tolerance, g)
            if told != APART and out[number, j] != NEAR:
                out[number, j] = told
