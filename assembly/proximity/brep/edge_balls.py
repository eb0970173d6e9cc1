"""Balls around parts of edges S(c(t)), and boxes around parts of their plane curves."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.proximity.brep.bezier_nets import (
    FACE_NETS,
    curve_box,
    curve_net_at,
    face_nets_at,
    piece_of_cuts,
    restrict_points,
    write_box_cuts,
    write_hull,
)

# Rounding of points, relative: balls must contain, not nearly contain.
_ROUNDING = 1e-14


@kernel(inner=True)
def _reach(pool, face, box, center, work):
    """How far the Bezier points of a surface over a box are from a point, at most."""
    count_u, count_v, at = write_box_cuts(pool, face, box, work)
    points = face.rows * face.columns
    most = 0.0
    for i in range(count_u):
        for j in range(count_v):
            piece, inside = piece_of_cuts(face, work, i, j, count_u)
            restrict_points(pool, face.points + 4 * points * piece, (face.rows, face.columns), inside, work, at)
            for k in range(points):
                w = work[at + 4 * k + 3]
                x = work[at + 4 * k] / w - center[0]
                y = work[at + 4 * k + 1] / w - center[1]
                z = work[at + 4 * k + 2] / w - center[2]
                most = max(most, x * x + y * y + z * z)
    return math.sqrt(most)


@kernel(inner=True)
def _cut_of(pool, curve, low, high):
    """A cell in t, which lies in one span, as (span, low, high)."""
    span = 0
    middle = 0.5 * (low + high)
    while span < curve.spans - 1 and pool[curve.breaks + span + 1] <= middle:
        span += 1
    begin, end = pool[curve.breaks + span], pool[curve.breaks + span + 1]
    return span, (low - begin) / (end - begin), (high - begin) / (end - begin)


@kernel(signatures="(i8[::1], f8[::1], i8[:, ::1], f8[:, ::1], f8[::1], f8[:, ::1])")
def write_balls(table, pool, sides, cells, work, out):
    """Balls (n, 4), center and radius, around cells (n, 2), t from and to, of curves on surfaces.

    `sides`: rows of the face and of the curve's record in the table.
    """
    for i in range(len(cells)):
        face = face_nets_at(table, FACE_NETS * sides[i, 0])
        curve = curve_net_at(table, sides[i, 1])
        box = curve_box(pool, curve, _cut_of(pool, curve, cells[i, 0], cells[i, 1]), work, 0)
        low, high = write_hull(pool, face, box, work)
        center = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])
        radius = _reach(pool, face, box, center, work)
        out[i, 0], out[i, 1], out[i, 2] = center
        out[i, 3] = radius + 4.0 * _ROUNDING * (radius + pool[face.extent])
