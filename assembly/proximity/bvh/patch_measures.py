"""Measures of patches of faces: corners, boxes, normal cones, chord errors, lengths, turns and bulges.

Over a patch with Bezier points A_ij, weights w_ij and the bilinear interpolant B of its corners, S - B = (A - w B) / w
is no longer than the longest of the Bezier points of A - w B, each over its weight. B is off its two triangles by at
most a quarter of |P00 - P10 - P01 + P11|. The Bezier points of S lie in the box around the patch, those of the normal
in the cone. Every bound is rounded outward.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.proximity.brep.bezier_nets import FACE_NETS, face_nets_at, restrict_net
from assembly.proximity.brep.net_normals import times_binomials
from assembly.proximity.bvh.normal_cones import MARGIN, cone_of_vectors, exact_length

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
    return exact_length(a[0] - b[0], a[1] - b[1], a[2] - b[2])


@kernel(inline=True, exact=True)
def _between(x, a, b):
    """The point at fraction x of the way from a to b."""
    y = 1.0 - x
    return y * a[0] + x * b[0], y * a[1] + x * b[1], y * a[2] + x * b[2]


@kernel(inner=True, exact=True)
def _length(points, at, count, step):
    """The length of the polygon through points that stand `step` numbers apart in a block."""
    total = 0.0
    for k in range(1, count):
        total += _distance(_three(points, at + step * k), _three(points, at + step * (k - 1)))
    return total


@kernel(inner=True, exact=True)
def _turn(units, at, count, step):
    """The sum of the changes between successive unit vectors of a block, without changes from or to zero vectors."""
    total = 0.0
    for k in range(1, count):
        a, b = _three(units, at + step * k), _three(units, at + step * (k - 1))
        if exact_length(a[0], a[1], a[2]) > 0.0 and exact_length(b[0], b[1], b[2]) > 0.0:
            total += _distance(a, b)
    return total


@kernel(inner=True, exact=True)
def _bulge(points, at, count, step):
    """How far points are off the straight line between the first and the last, at most."""
    most = 0.0
    first, last = _three(points, at), _three(points, at + step * (count - 1))
    for k in range(1, count - 1):
        x = k / (count - 1)
        most = max(most, _distance(_three(points, at + step * k), _between(x, first, last)))
    return most


@kernel(inner=True)
def _raise_degree(work, rows, columns, source, target):
    """Write homogeneous Bezier points one degree higher in u and in v; as many numbers behind them are scratch."""
    line = 4 * columns
    middle = target + 4 * (rows + 1) * (columns + 1)
    for i in range(rows + 1):
        for j in range(line):
            total = 0.0
            # A point of the higher degree is a weighted mean of two adjacent ones of the lower degree.
            for k in range(max(i - 1, 0), min(i + 1, rows)):
                part = (rows - i) / rows if k == i else i / rows
                total += part * work[source + line * k + j]
            work[middle + line * i + j] = total
        for j in range(columns + 1):
            for m in range(4):
                total = 0.0
                for l in range(max(j - 1, 0), min(j + 1, columns)):
                    part = (columns - j) / columns if l == j else j / columns
                    total += part * work[middle + line * i + 4 * l + m]
                work[target + 4 * ((columns + 1) * i + j) + m] = total


@kernel(inner=True, exact=True)
def _times_square(work, weights, corners, at):
    """Write Bezier points of the product of weights (place, rows, columns), which are multiplied by
    binomials, and the bilinear interpolant of the corners relative to the first corner.
    """
    first, rows, columns = weights
    a, b, c, d = corners
    for i in range(rows + 1):
        for j in range(columns + 1):
            here = at + 3 * ((columns + 1) * i + j)
            for m in range(3):
                total = 0.0
                for row in range(max(i - 1, 0), min(i + 1, rows)):
                    for column in range(max(j - 1, 0), min(j + 1, columns)):
                        corner = (c if column < j else b) if row < i else (d if column < j else a)
                        total += work[first + columns * row + column] * (corner[m] - a[m])
                work[here + m] = total
    times_binomials(work, (at, rows + 1, columns + 1), 3, True)


@kernel(inner=True, exact=True)
def _chord_error(work, rows, columns, corners, at):
    """How far the patch is off the bilinear interpolant of its corners: Bezier points of both, one degree higher.

    The patch's points begin the workspace, `at` is free.
    """
    count, more = rows * columns, (rows + 1) * (columns + 1)
    weights, raised = at + 4 * count, at + 5 * count
    product = raised + 8 * more
    for k in range(count):
        w = work[4 * k + 3]
        for m in range(3):
            work[at + 4 * k + m] = work[4 * k + m] - corners[0][m] * w
        work[at + 4 * k + 3] = w
        work[weights + k] = w
    _raise_degree(work, rows, columns, at, raised)
    times_binomials(work, (weights, rows, columns), 1, False)
    _times_square(work, (weights, rows, columns), corners, product)
    most = 0.0
    for k in range(more):
        x = work[raised + 4 * k] - work[product + 3 * k]
        y = work[raised + 4 * k + 1] - work[product + 3 * k + 1]
        z = work[raised + 4 * k + 2] - work[product + 3 * k + 2]
        most = max(most, exact_length(x, y, z) / work[raised + 4 * k + 3])
    return most


@kernel(inner=True, exact=True)
def _measure_points(face, work, pad, patch):
    """Measure a patch by its Bezier points, which begin the workspace."""
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
    a, b, c, d = corners
    twist = exact_length(a[0] - b[0] + c[0] - d[0], a[1] - b[1] + c[1] - d[1], a[2] - b[2] + c[2] - d[2])
    patch.chord_error = _chord_error(work, rows, columns, corners, last + 3) + 0.25 * twist + pad
    length_u, length_v, bulge_u, bulge_v = 0.0, 0.0, 0.0, 0.0
    for j in range(columns):
        length_u = max(length_u, _length(work, xyz + 3 * j, rows, line))
        bulge_u = max(bulge_u, _bulge(work, xyz + 3 * j, rows, line))
    for i in range(rows):
        length_v = max(length_v, _length(work, xyz + line * i, columns, 3))
        bulge_v = max(bulge_v, _bulge(work, xyz + line * i, columns, 3))
    patch.lengths[0], patch.lengths[1] = length_u, length_v
    patch.bulges[0], patch.bulges[1] = bulge_u, bulge_v


@kernel(inner=True, exact=True)
def _measure_normals(face, work, slack, vanish, patch):
    """Measure a patch by the Bezier points of its normals, which begin the workspace and are made unit vectors."""
    rows, columns = face.normal_rows, face.normal_columns
    axis, half = cone_of_vectors(work, 0, rows * columns, slack, vanish)
    patch.axis[0], patch.axis[1], patch.axis[2] = axis
    patch.half_angle = half
    for k in range(rows * columns):
        a = _three(work, 3 * k)
        length = exact_length(a[0], a[1], a[2])
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
