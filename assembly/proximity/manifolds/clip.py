"""The intersection of two regions of a plane: points of one that are in the other, and where boundaries cross."""

from __future__ import annotations

from math import sqrt

from assembly._kernel import kernel
from assembly.proximity.manifolds.records import segment_at


@kernel(inline=True)
def length_of(x, y):
    """The length of a vector; coordinates whose squares are numbers are expected, which `hypot` takes long to spare."""
    return sqrt(x * x + y * y)


@kernel(inline=True)
def write_box(s):
    """Write the box around a segment. A point of an arc is no farther from its chord than its middle is."""
    dx, dy = s.end[0] - s.begin[0], s.end[1] - s.begin[1]
    out = 0.0
    if s.radius > 0.0:
        # Rounding is 1e-16 of the radius, as the chord of a quarter is far from a diameter.
        out = s.radius * (1.0 + 1e-14) - sqrt(max(s.radius * s.radius - 0.25 * (dx * dx + dy * dy), 0.0))
    for d in range(2):
        s.low[d] = min(s.begin[d], s.end[d]) - out
        s.high[d] = max(s.begin[d], s.end[d]) + out


@kernel(signatures="(f8[:, ::1],)")
def write_boxes(segments):
    """Write the boxes of segments (n, SEGMENT_SIZE) of which all else is known."""
    for k in range(len(segments)):
        write_box(segment_at(segments, k))


@kernel(inline=True)
def side_of(s, x, y):
    """Positive for a point on the left of a segment's chord: its distance times the length of the chord."""
    return (s.end[0] - s.begin[0]) * (y - s.begin[1]) - (s.end[1] - s.begin[1]) * (x - s.begin[0])


@kernel(inline=True)
def beside_chord(s, x, y):
    """How far a point is on the left of a segment's chord."""
    return side_of(s, x, y) / length_of(s.end[0] - s.begin[0], s.end[1] - s.begin[1])


@kernel(inner=True)
def is_on_arc(s, x, y, tolerance):
    """Whether a point of an arc's circle is on the arc, which turns by a quarter at most: on one side of its chord."""
    beside = beside_chord(s, x, y)
    return beside <= tolerance if s.sweep > 0.0 else beside >= -tolerance


@kernel(inner=True)
def is_on_segment(s, x, y, tolerance):
    """Whether a point is no farther than a tolerance from a segment."""
    if s.radius > 0.0:
        far = length_of(x - s.center[0], y - s.center[1])
        return abs(far - s.radius) <= tolerance and is_on_arc(s, x, y, tolerance)
    dx, dy = s.end[0] - s.begin[0], s.end[1] - s.begin[1]
    length = length_of(dx, dy)
    along = (dx * (x - s.begin[0]) + dy * (y - s.begin[1])) / length
    return abs(beside_chord(s, x, y)) <= tolerance and -tolerance <= along <= length + tolerance


@kernel(inner=True)
def is_within(segments, x, y, tolerance):
    """Whether a point is in a region, or no farther than a tolerance from its borders.

    By how often a ray along x crosses the chords; between an arc and its chord the answer is reversed. Boxes tell of
    most segments that the point is not on them, and on which side of their chords it is.
    """
    inside = False
    for k in range(len(segments)):
        s = segment_at(segments, k)
        if y < s.low[1] - tolerance or y > s.high[1] + tolerance or x > s.high[0] + tolerance:
            continue
        is_between = (s.begin[1] > y) != (s.end[1] > y)
        if x < s.low[0] - tolerance:
            inside = inside != is_between
            continue
        if is_on_segment(s, x, y, tolerance):
            return True
        left = side_of(s, x, y)
        if is_between and (left >= 0.0) == (s.end[1] > s.begin[1]):
            inside = not inside
        if s.radius > 0.0 and length_of(x - s.center[0], y - s.center[1]) < s.radius:
            if (left < 0.0) if s.sweep > 0.0 else (left >= 0.0):
                inside = not inside
    return inside


@kernel(inline=True)
def put_if(points, count, x, y, is_one):
    """Append a point to others if `is_one`; returns how many there are."""
    if is_one:
        points[count, 0] = x
        points[count, 1] = y
        return count + 1
    return count


@kernel(inner=True)
def cross_lines(s, t, tolerance, points):
    """The point where two straight segments that are not parallel cross, and how many there are: 0 or 1."""
    ax, ay = s.end[0] - s.begin[0], s.end[1] - s.begin[1]
    bx, by = t.end[0] - t.begin[0], t.end[1] - t.begin[1]
    det = ax * by - ay * bx
    if abs(det) <= 1e-12 * length_of(ax, ay) * length_of(bx, by):
        return 0
    part = ((t.begin[0] - s.begin[0]) * by - (t.begin[1] - s.begin[1]) * bx) / det
    x, y = s.begin[0] + part * ax, s.begin[1] + part * ay
    return put_if(points, 0, x, y, is_on_segment(s, x, y, tolerance) and is_on_segment(t, x, y, tolerance))


@kernel(inner=True)
def cross_line_arc(line, arc, tolerance, points):
    """Where a straight segment crosses an arc, or comes as near to it as a tolerance."""
    dx, dy = line.end[0] - line.begin[0], line.end[1] - line.begin[1]
    length = length_of(dx, dy)
    dx /= length
    dy /= length
    ex, ey = arc.center[0] - line.begin[0], arc.center[1] - line.begin[1]
    along, beside = ex * dx + ey * dy, ex * dy - ey * dx
    if abs(beside) > arc.radius + tolerance:
        return 0
    half = sqrt(max(arc.radius * arc.radius - beside * beside, 0.0))
    count = 0
    for i in range(2):
        t = along - half if i == 0 else along + half
        x, y = line.begin[0] + t * dx, line.begin[1] + t * dy
        is_one = -tolerance <= t <= length + tolerance and is_on_arc(arc, x, y, tolerance)
        count = put_if(points, count, x, y, is_one)
    return count


@kernel(inner=True)
def cross_arcs(s, t, tolerance, points):
    """Where two arcs cross, or come as near to each other as a tolerance, not those of one circle."""
    dx, dy = t.center[0] - s.center[0], t.center[1] - s.center[1]
    apart = length_of(dx, dy)
    if apart <= tolerance or apart > s.radius + t.radius + tolerance:
        return 0
    if apart < abs(s.radius - t.radius) - tolerance:
        return 0
    along = 0.5 * (apart + (s.radius - t.radius) * (s.radius + t.radius) / apart)
    half = sqrt(max(s.radius * s.radius - along * along, 0.0))
    count = 0
    for i in range(2):
        beside = -half if i == 0 else half
        x = s.center[0] + (along * dx - beside * dy) / apart
        y = s.center[1] + (along * dy + beside * dx) / apart
        is_one = is_on_arc(s, x, y, tolerance) and is_on_arc(t, x, y, tolerance)
        count = put_if(points, count, x, y, is_one)
    return count


@kernel(inner=True)
def cross_segments(s, t, tolerance, points):
    """Where two segments cross: at most two points, and how many."""
    if s.radius > 0.0 and t.radius > 0.0:
        return cross_arcs(s, t, tolerance, points)
    if s.radius > 0.0:
        return cross_line_arc(t, s, tolerance, points)
    if t.radius > 0.0:
        return cross_line_arc(s, t, tolerance, points)
    return cross_lines(s, t, tolerance, points)


@kernel(inline=True)
def are_beside(s, t, tolerance):
    """Whether the bounding boxes of two segments are apart."""
    for d in range(2):
        if s.low[d] > t.high[d] + tolerance or t.low[d] > s.high[d] + tolerance:
            return True
    return False


@kernel(inner=True)
def convex_corners(points, count, order, tolerance):
    """Write the corners of the convex hull of points, counterclockwise, into `order`; returns how many.

    `order` has room for 3 count + 2 entries. Points on a side of the hull, within a tolerance, are no corners.
    """
    for i in range(count):
        k = i
        while k > 0 and (
            points[order[k - 1], 0] > points[i, 0]
            or (points[order[k - 1], 0] == points[i, 0] and points[order[k - 1], 1] > points[i, 1])
        ):
            order[k] = order[k - 1]
            k -= 1
        order[k] = i
    for i in range(count):
        order[2 * count + 2 + i] = order[i]
    found = 0
    # Andrew's monotone chain: the lower side, then the upper one backward; corners before `first` are final.
    for side in range(2):
        first = found
        for i in range(count):
            new = order[2 * count + 2 + i] if side == 0 else order[3 * count + 1 - i]
            while found - first >= 2 and not is_left_turn(points, order[found - 2], order[found - 1], new, tolerance):
                found -= 1
            order[found] = new
            found += 1
        found -= 1
    return max(found, min(count, 1))


@kernel(inline=True)
def is_left_turn(points, a, b, c, tolerance):
    """Whether a, b, c turn left: b is on the right of the line from a to c by more than a tolerance."""
    dx, dy = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1]
    ex, ey = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    return dx * ey - dy * ex < -tolerance * length_of(dx, dy)
