"""What patches of faces are measured by: corners, boxes, normal cones, chord errors, lengths, turns and bulges.

Over a patch with Bezier points A_ij, weights w_ij and the bilinear interpolant B of its corners, S - B = (A - w B) / w
is no longer than the longest of the Bezier points of A - w B, each over its weight. B is off its two triangles by at
most a quarter of |P00 - P10 - P01 + P11|. The Bezier points of S lie in the box around the patch, those of the normal
in the cone. Every bound is rounded outward.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.geometry.vec import add, blend, dot, scale, sub
from assembly.proximity.brep.bezier_nets import FACE_NETS, face_nets_at, restrict_net
from assembly.proximity.bvh.normal_cones import MARGIN, cone_of_vectors

# What is known of a patch, see `facet_patches.Patches`.
PATCH_DTYPE = record_dtype(
    "f8", corners=(4, 3), chord_error=1, low=3, high=3, axis=3, half_angle=1, lengths=2, turns=2, bulges=2
)
patch_at = record_view(PATCH_DTYPE)
PATCH = size_of(PATCH_DTYPE)


@kernel(inline=True)
def _three(block, at):
    """A vector of a block."""
    return block[at], block[at + 1], block[at + 2]


@kernel(inline=True)
def _distance(a, b):
    """How far two points are from each other."""
    d = sub(a, b)
    return math.sqrt(dot(d, d))


@kernel(inner=True)
def _length(points, at, count, step):
    """Of the polygon through points of a block so far apart in it."""
    total = 0.0
    for k in range(1, count):
        total += _distance(_three(points, at + step * k), _three(points, at + step * (k - 1)))
    return total


@kernel(inner=True)
def _turn(units, at, count, step):
    """How far directions of a block turn; those that are zero count for nothing."""
    total = 0.0
    for k in range(1, count):
        a, b = _three(units, at + step * k), _three(units, at + step * (k - 1))
        if dot(a, a) > 0.0 and dot(b, b) > 0.0:
            total += _distance(a, b)
    return total


@kernel(inner=True)
def _bulge(points, at, count, step):
    """How far points are off the straight line between the first and the last, at most."""
    most = 0.0
    first, last = _three(points, at), _three(points, at + step * (count - 1))
    for k in range(1, count - 1):
        x = k / (count - 1)
        most = max(most, _distance(_three(points, at + step * k), blend(1.0 - x, first, x, last)))
    return most


@kernel(inner=True)
def _chord_error(points, at, rows, columns, corners):
    """How far the patch is off the bilinear interpolant of its corners: Bezier points of both, one degree higher."""
    origin = corners[0]
    edge_u, edge_v, across = sub(corners[1], origin), sub(corners[3], origin), sub(corners[2], origin)
    none = (0.0, 0.0, 0.0)
    most = 0.0
    for i in range(rows + 1):
        for j in range(columns + 1):
            off, weight = none, 0.0
            for k in range(2):
                # A point of the higher degree is between those of the lower one before and behind.
                part_u = i / rows if k == 1 else 1.0 - i / rows
                row = i - k
                if row < 0 or row >= rows:
                    continue
                for l in range(2):
                    part = part_u * (j / columns if l == 1 else 1.0 - j / columns)
                    column = j - l
                    if column < 0 or column >= columns:
                        continue
                    here = at + 4 * (row * columns + column)
                    w = points[here + 3]
                    end = (across if l == 1 else edge_u) if k == 1 else (edge_v if l == 1 else none)
                    shifted = sub(_three(points, here), scale(w, origin))
                    off = add(off, scale(part, sub(shifted, scale(w, end))))
                    weight += part * w
            most = max(most, math.sqrt(dot(off, off)) / weight)
    return most


@kernel(inner=True)
def _measure_points(face, work, pad, patch):
    """What is told by the Bezier points of a patch, which begin the workspace."""
    rows, columns = face.rows, face.columns
    count = rows * columns
    xyz = 4 * count
    low, high = (math.inf, math.inf, math.inf), (-math.inf, -math.inf, -math.inf)
    for k in range(count):
        w = work[4 * k + 3]
        p = (work[4 * k] / w, work[4 * k + 1] / w, work[4 * k + 2] / w)
        work[xyz + 3 * k], work[xyz + 3 * k + 1], work[xyz + 3 * k + 2] = p
        low = (min(low[0], p[0]), min(low[1], p[1]), min(low[2], p[2]))
        high = (max(high[0], p[0]), max(high[1], p[1]), max(high[2], p[2]))
    last = xyz + 3 * (count - 1)
    line = 3 * columns
    corners = (
        _three(work, xyz),
        _three(work, xyz + line * (rows - 1)),
        _three(work, last),
        _three(work, xyz + line - 3),
    )
    for m in range(3):
        patch.low[m], patch.high[m] = low[m] - pad, high[m] + pad
        for k in range(4):
            patch.corners[k, m] = corners[k][m]
    twist = sub(add(corners[0], corners[2]), add(corners[1], corners[3]))
    error = _chord_error(work, 0, rows, columns, corners)
    patch.chord_error = error + 0.25 * math.sqrt(dot(twist, twist)) + pad
    length_u, length_v, bulge_u, bulge_v = 0.0, 0.0, 0.0, 0.0
    for j in range(columns):
        length_u = max(length_u, _length(work, xyz + 3 * j, rows, line))
        bulge_u = max(bulge_u, _bulge(work, xyz + 3 * j, rows, line))
    for i in range(rows):
        length_v = max(length_v, _length(work, xyz + line * i, columns, 3))
        bulge_v = max(bulge_v, _bulge(work, xyz + line * i, columns, 3))
    patch.lengths[0], patch.lengths[1] = length_u, length_v
    patch.bulges[0], patch.bulges[1] = bulge_u, bulge_v


@kernel(inner=True)
def _measure_normals(face, work, slack, vanish, patch):
    """What is told by the Bezier points of a patch's normals, which begin the workspace; they become unit vectors."""
    rows, columns = face.normal_rows, face.normal_columns
    axis, half = cone_of_vectors(work, 0, rows * columns, slack, vanish)
    patch.axis[0], patch.axis[1], patch.axis[2] = axis
    patch.half_angle = half
    for k in range(rows * columns):
        a = _three(work, 3 * k)
        length = math.sqrt(dot(a, a))
        if length > 0.0:
            work[3 * k], work[3 * k + 1], work[3 * k + 2] = a[0] / length, a[1] / length, a[2] / length
    turn_u, turn_v = 0.0, 0.0
    for j in range(columns):
        turn_u = max(turn_u, _turn(work, 3 * j, rows, 3 * columns))
    for i in range(rows):
        turn_v = max(turn_v, _turn(work, 3 * columns * i, columns, 3))
    patch.turns[0], patch.turns[1] = turn_u, turn_v


@kernel(signatures="(i8[::1], f8[::1], i8[::1], i8[:, ::1], f8[:, ::1], f8[::1], f8[:, ::1])")
def measure_patches(table, pool, faces, pieces, boxes, work, out):
    """Patches of faces over boxes (n, 4) of the unit squares of pieces (n, 2), as rows PATCH."""
    for i in range(faces.size):
        face = face_nets_at(table, FACE_NETS * faces[i])
        piece = pieces[i, 0] * face.spans_v + pieces[i, 1]
        box = boxes[i, 0], boxes[i, 1], boxes[i, 2], boxes[i, 3]
        patch = patch_at(out, i)
        points = face.points + 4 * face.rows * face.columns * piece
        restrict_net(pool, points, (face.rows, face.columns, 4), box, work, 0)
        _measure_points(face, work, MARGIN * pool[face.extent], patch)
        normals = face.normals + 3 * face.normal_rows * face.normal_columns * piece
        restrict_net(pool, normals, (face.normal_rows, face.normal_columns, 3), box, work, 0)
        _measure_normals(face, work, pool[face.slack + piece], pool[face.poles + piece] == 1.0, patch)
