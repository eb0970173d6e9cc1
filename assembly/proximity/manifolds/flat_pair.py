"""The manifold of two trimmed plane faces that face each other: corners of their intersection.

Seen along the normal n of the first plane, the second one is h above it, an affine function of the point x:

    h = m.(o - x),      m = n_b / (n_b.n),      m.n = 1,

with o a point of the second plane. So h is least at a corner of the convex hull of what both faces cover, or at the
lowest point of an arc: over a circle of radius R about c that is h(c) - R |grad h|.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.vec import add, cross, dot, matvec, scale, sub
from assembly.proximity.manifolds.clip import (
    are_beside,
    convex_corners,
    cross_segments,
    is_on_arc,
    is_within,
    length_of,
    write_box,
)
from assembly.proximity.manifolds.records import (
    CORNER_A,
    CROSSING,
    FRAME_SIZE,
    LOWEST_A,
    ROW_SIZE,
    SEGMENT_SIZE,
    frame_at,
    row_at,
    segment_at,
)

# Planes that lean more than this cosine do not face each other.
FACING = 0.5
# Returned instead of a number of rows where there is no room for all of them.
FULL = -1


@kernel(inline=True)
def triple(a):
    """Three numbers of a record as a tuple."""
    return (a[0], a[1], a[2])


@kernel(inline=True)
def above(frame, x, y):
    """A point of a plane."""
    return add(triple(frame.origin), add(scale(x, triple(frame.right)), scale(y, triple(frame.up))))


@kernel(inline=True)
def flat(frame, p):
    """Coordinates of a point seen along a plane's normal."""
    d = sub(p, triple(frame.origin))
    return dot(d, triple(frame.right)), dot(d, triple(frame.up))


@kernel(inner=True)
def write_seen(frame, other, segments, seen):
    """Segments of another plane seen along the normal of one; an arc is taken for one of the same radius."""
    a, b = frame_at(frame, 0), frame_at(other, 0)
    mirrored = dot(triple(a.normal), triple(b.normal)) < 0.0
    for k in range(len(segments)):
        s, t = segment_at(segments, k), segment_at(seen, k)
        t.begin[0], t.begin[1] = flat(a, above(b, s.begin[0], s.begin[1]))
        t.end[0], t.end[1] = flat(a, above(b, s.end[0], s.end[1]))
        t.center[0], t.center[1] = flat(a, above(b, s.center[0], s.center[1]))
        t.radius = s.radius
        t.sweep = -s.sweep if mirrored else s.sweep
        write_box(t)


@kernel(inline=True)
def tangent(s, x, y):
    """The direction of a segment at one of its points."""
    if s.radius > 0.0:
        return s.center[1] - y, x - s.center[0]
    return s.end[0] - s.begin[0], s.end[1] - s.begin[1]


@kernel(inner=True)
def put_row(rows, points, count, frame, lift, at, normal):
    """Write a row at a place of the first plane, h above it: a candidate behind others, `normal` its direction."""
    x, y = at
    a, row = frame_at(frame, 0), row_at(rows, count)
    m, point = lift
    p = above(a, x, y)
    gap = dot(m, sub(point, p))
    points[count, 0], points[count, 1] = x, y
    row.gap = gap
    y_place = add(p, scale(gap, triple(a.normal)))
    for i in range(3):
        row.normal[i] = normal[i]
        row.place[i] = y_place[i]
    return gap


@kernel(inline=True)
def name_row(rows, count, kind, first, second):
    """Write what a row is of: see `records.py`."""
    row = row_at(rows, count)
    row.kind, row.first, row.second = kind, first, second


@kernel(inner=True)
def crossing_normal(frame, lift, s, t, at):
    """The direction of the gap where two boundary curves cross: perpendicular to both; its product with n is 1."""
    a = frame_at(frame, 0)
    m, _ = lift
    u, v = tangent(s, at[0], at[1])
    p, q = tangent(t, at[0], at[1])
    along = add(scale(u, triple(a.right)), scale(v, triple(a.up)))
    other = add(scale(p, triple(a.right)), scale(q, triple(a.up)))
    # On the second plane, which is h above the first one.
    other = sub(other, scale(dot(m, other), triple(a.normal)))
    way = cross(along, other)
    size = dot(way, triple(a.normal))
    if abs(size) <= 1e-9 * sqrt(dot(along, along) * dot(other, other)):
        return m
    return scale(1.0 / size, way)


@kernel(inner=True)
def put_corners(regions, frame, lift, tolerance, found, points):
    """Write a row at the start of each segment, and the middle of each arc, that the other region has; how many.

    regions: (first, second as it is seen).
    """
    count = 0
    n = triple(frame_at(frame, 0).normal)
    for turn in range(2):
        own, other = regions[turn], regions[1 - turn]
        normal = lift[0] if turn == 0 else n
        for k in range(len(own)):
            s = segment_at(own, k)
            for half in range(2 if s.radius > 0.0 else 1):
                x, y = s.begin[0], s.begin[1]
                if half == 1:
                    x, y = 0.5 * (s.begin[0] + s.end[0]) - s.center[0], 0.5 * (s.begin[1] + s.end[1]) - s.center[1]
                    out = s.radius / length_of(x, y)
                    x, y = s.center[0] + out * x, s.center[1] + out * y
                if is_within(other, x, y, tolerance):
                    if count == len(found):
                        return FULL
                    put_row(found, points, count, frame, lift, (x, y), normal)
                    at = k + 0.5 * half
                    name_row(found, count, CORNER_A + turn, at, at)
                    count += 1
    return count


@kernel(inner=True)
def put_crossings(regions, frame, lift, tolerance, found, points, count):
    """Write a row wherever the boundaries of the regions cross, behind `count` others; how many there are then."""
    first, second = regions
    crossed = points[len(found) :]
    for i in range(len(first)):
        s = segment_at(first, i)
        for j in range(len(second)):
            t = segment_at(second, j)
            if are_beside(s, t, tolerance):
                continue
            for k in range(cross_segments(s, t, tolerance, crossed)):
                if count == len(found):
                    return FULL
                at = (crossed[k, 0], crossed[k, 1])
                put_row(found, points, count, frame, lift, at, crossing_normal(frame, lift, s, t, at))
                name_row(found, count, CROSSING, i, j)
                count += 1
    return count


@kernel(inner=True)
def put_lowest(regions, frame, lift, tolerance, found, points, count):
    """Write a row at the lowest point of each arc that the other region has, behind others; how many there are then."""
    a = frame_at(frame, 0)
    n = triple(a.normal)
    u, v = -dot(lift[0], triple(a.right)), -dot(lift[0], triple(a.up))
    steep = length_of(u, v)
    if steep == 0.0:
        return count
    for turn in range(2):
        own, other = regions[turn], regions[1 - turn]
        normal = lift[0] if turn == 0 else n
        for k in range(len(own)):
            s = segment_at(own, k)
            if s.radius == 0.0:
                continue
            x, y = s.center[0] - s.radius * u / steep, s.center[1] - s.radius * v / steep
            if is_on_arc(s, x, y, tolerance) and is_within(other, x, y, tolerance):
                if count == len(found):
                    return FULL
                put_row(found, points, count, frame, lift, (x, y), normal)
                name_row(found, count, LOWEST_A + turn, k, k)
                count += 1
    return count


@kernel(inner=True)
def write_posed(frame, turn, shift, posed):
    """A frame after x -> turn x + shift."""
    b, c = frame_at(frame, 0), frame_at(posed, 0)
    m = (turn[0], turn[1], turn[2], turn[3], turn[4], turn[5], turn[6], turn[7], turn[8])
    origin = add(matvec(m, triple(b.origin)), (shift[0], shift[1], shift[2]))
    right, up, normal = matvec(m, triple(b.right)), matvec(m, triple(b.up)), matvec(m, triple(b.normal))
    for i in range(3):
        c.origin[i], c.right[i], c.up[i], c.normal[i] = origin[i], right[i], up[i], normal[i]


@kernel(inner=True)
def write_hull(found, points, count, tolerance, order, rows):
    """Copy the rows at corners of the convex hull of all; how many there are, none where that has no area."""
    corners = convex_corners(points, count, order, tolerance)
    if corners < 3:
        return 0
    for i in range(corners):
        for k in range(ROW_SIZE):
            rows[i, k] = found[order[i], k]
    return corners


@kernel(inner=True)
def largest_radius(segments):
    """The largest radius of the arcs of a region, or 0."""
    most = 0.0
    for k in range(len(segments)):
        most = max(most, segment_at(segments, k).radius)
    return most


@kernel(
    signatures="(f8[::1], f8[:, ::1], f8[::1], f8[:, ::1], f8[::1], f8[::1], f8, f8[:, ::1])",
    allocates=True,
)
def flat_rows(frame_a, segments_a, frame_b, segments_b, turn, shift, tolerance, rows):
    """Rows of a trimmed plane face over another one, which is at x -> turn x + shift.

    Parameters
    ----------
    frame_a, frame_b : (FRAME_SIZE,)
        Each in the axes of its body.
    segments_a, segments_b : (n, SEGMENT_SIZE)
    turn, shift : (9,), (3,)
        A rotation by rows, and a translation: the second body, seen from the first.
    tolerance : float
        Points no farther than this from the boundary of a region are in it.
    rows : (m, ROW_SIZE)
        Where rows are written.

    Returns
    -------
    count : int
        How many rows there are: none where the faces have no area in common; -1 where they need more places.
    bound : float
        A lower bound of the gap along the first normal, over all points that both cover; infinite without rows.
    """
    posed = np.empty(FRAME_SIZE)
    write_posed(frame_b, turn, shift, posed)
    a, b = frame_at(frame_a, 0), frame_at(posed, 0)
    n, other = triple(a.normal), triple(b.normal)
    facing = -dot(n, other)
    if facing < FACING:
        return 0, np.inf
    # Read before the last use of the array that it is in, which is freed then.
    lift = (scale(-1.0 / facing, other), triple(b.origin))
    seen = np.empty((len(segments_b), SEGMENT_SIZE))
    write_seen(frame_a, posed, segments_b, seen)
    regions = (segments_a, seen)
    found, points = np.empty((len(rows), ROW_SIZE)), np.empty((len(rows) + 2, 2))
    count = put_corners(regions, frame_a, lift, tolerance, found, points)
    if count != FULL:
        count = put_crossings(regions, frame_a, lift, tolerance, found, points, count)
    if count != FULL:
        count = put_lowest(regions, frame_a, lift, tolerance, found, points, count)
    if count == FULL:
        return FULL, -np.inf
    order = np.empty(3 * count + 2, dtype=np.int64)
    corners = write_hull(found, points, count, tolerance, order, rows)
    if corners == 0:
        return 0, np.inf
    bound = np.inf
    for i in range(count):
        bound = min(bound, row_at(found, i).gap)
    # A tilted circle is seen as an ellipse, narrower by this than the circle that it is taken for.
    narrower = max(largest_radius(segments_a), largest_radius(segments_b)) * (1.0 - facing)
    slope = sub(lift[0], n)
    return corners, bound - sqrt(dot(slope, slope)) * (4.0 * tolerance + narrower)
