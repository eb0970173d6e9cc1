"""Which part of a straight line is in a region of its plane."""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly.proximity.manifolds.clip import cross_segments, is_within
from assembly.proximity.manifolds.records import SEGMENT_SIZE, segment_at


@kernel(inner=True)
def span_within(segments, line, tolerance, borders, room):
    """`line_span`, with its arrays as an argument `room`: so these outlive the records of them that are made here."""
    one, points = room
    s = segment_at(one, 0)
    s.begin[0], s.begin[1], s.end[0], s.end[1] = line[0], line[1], line[2], line[3]
    dx, dy = line[2] - line[0], line[3] - line[1]
    low, high = np.inf, -np.inf
    for i in range(2):
        borders[i] = -1
        if is_within(segments, line[2 * i], line[2 * i + 1], tolerance):
            low, high = min(low, float(i)), max(high, float(i))
    for k in range(len(segments)):
        t = segment_at(segments, k)
        for i in range(cross_segments(s, t, tolerance, points)):
            x, y = points[i, 0], points[i, 1]
            part = ((x - line[0]) * dx + (y - line[1]) * dy) / (dx * dx + dy * dy)
            if part < low:
                low = part
                borders[0] = k
            if part > high:
                high = part
                borders[1] = k
    return low, high


@kernel(signatures="(f8[:, ::1], f8[::1], f8, i8[::1])", allocates=True)
def line_span(segments, line, tolerance, borders):
    """The outermost points of a line that are in a region, as parts of the line's length.

    Parameters
    ----------
    segments : (n, SEGMENT_SIZE)
    line : (4,)
        Both ends, in the coordinates of the plane.
    tolerance : float
        Points no farther than this from the boundary of the region are in it.
    borders : (2,)
        The numbers of the segments at which the line leaves the region are written here; -1 where it ends inside.

    Returns
    -------
    low, high : float
        `low` is greater than `high` if no point of the line is in the region.
    """
    return span_within(segments, line, tolerance, borders, (np.zeros((1, SEGMENT_SIZE)), np.empty((2, 2))))
