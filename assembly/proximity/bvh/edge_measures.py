"""Measures of parts of edges: boxes in space, and cones around the normals of both faces along them."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.geometry.vec import cross, dot
from assembly.proximity.brep.bezier_nets import (
    CUT,
    FACE_NETS,
    curve_box,
    curve_net_at,
    cut_at,
    face_nets_at,
    piece_of_cuts,
    restrict_net,
    write_box_cuts,
    write_cuts,
    write_hull,
)
from assembly.proximity.bvh.normal_cones import CONVEX, FULL, MARGIN, angle_between, cone_of_cones, cone_of_vectors

# A part of an edge: where it is.
EDGE_SIDES_DTYPE = record_dtype(
    "i8",
    face_a=1,
    curve_a=1,  # the plane curve's record in the table
    span=1,  # of the first face's curve
    face_b=1,  # -1: a free edge
    curve_b=1,
    closed=1,  # whether the edge is closed smoothly: parameters beyond its ends are those beyond the other end
)
edge_sides_at = record_view(EDGE_SIDES_DTYPE)
EDGE_SIDES = size_of(EDGE_SIDES_DTYPE)
EDGE_PLACE_DTYPE = record_dtype(
    "f8",
    low=1,  # from where to where in the unit interval of the span
    high=1,
    low_b=1,  # and in the parameter of the second face's curve
    high_b=1,
    along=3,  # the edge's direction at the middle
)
edge_place_at = record_view(EDGE_PLACE_DTYPE)
EDGE_PLACE = size_of(EDGE_PLACE_DTYPE)
# Its measures.
EDGE_PART_DTYPE = record_dtype(
    "f8",
    low=3,  # box in space
    high=3,
    axis=3,  # of a cone around the normals between those of both faces
    half_angle=1,
    turn=1,  # by how much the normals of one face turn [rad], the larger one
    concave=1,  # 1.0 where material surely bends toward the outside
)
edge_part_at = record_view(EDGE_PART_DTYPE)
EDGE_PART = size_of(EDGE_PART_DTYPE)


@kernel(inner=True)
def _add_cones(pool, face, box, count, cones, work):
    """Append cones around the normals over a box in (u, v) to `count` others; those without room are only counted."""
    count_u, count_v, at = write_box_cuts(pool, face, box, work)
    normals = face.normal_rows * face.normal_columns
    shape = face.normal_rows, face.normal_columns, 3
    for i in range(count_u):
        for j in range(count_v):
            if count < len(cones):
                piece, inside = piece_of_cuts(face, work, i, j, count_u)
                restrict_net(pool, face.normals + 3 * normals * piece, shape, inside, work, at)
                vanish = pool[face.poles + piece] == 1.0
                axis, half = cone_of_vectors(work, at, normals, pool[face.slack + piece], vanish)
                cones[count, 0], cones[count, 1], cones[count, 2] = axis
                cones[count, 3] = half
            count += 1
    return count


@kernel(inner=True)
def _second_cones(store, sides, place, cones, work):
    """Write cones around the normals of the second face; how many there are."""
    table, pool = store
    face, curve = face_nets_at(table, FACE_NETS * sides.face_b), curve_net_at(table, sides.curve_b)
    # The parts of the curve stand at the workspace's end.
    parts = work.size - CUT * (curve.spans + 2)
    breaks = curve.breaks, curve.spans
    many = write_cuts(pool, breaks, sides.closed == 1, (place.low_b, place.high_b), work, parts)
    count = 0
    for k in range(many):
        cut = cut_at(work, parts + CUT * k)
        box = curve_box(pool, curve, (int(cut.span), cut.low, cut.high), work, 0)
        count = _add_cones(pool, face, box, count, cones, work)
    return count


@kernel(inner=True)
def _is_concave(axis_a, half_a, axis_b, half_b, along):
    """Whether normals are never parallel, and material bends toward the outside along a direction."""
    angle = angle_between(axis_a, axis_b)
    if not half_a + half_b < angle < math.pi - half_a - half_b:
        return False
    return dot(cross(axis_a, axis_b), along) < 0.0


@kernel(inner=True)
def _measure_part(store, sides, place, part, cones, order, work):
    """Measure a part of an edge; returns the most cones that it needs at a time."""
    table, pool = store
    face, curve = face_nets_at(table, FACE_NETS * sides.face_a), curve_net_at(table, sides.curve_a)
    box = curve_box(pool, curve, (sides.span, place.low, place.high), work, 0)
    low, high = write_hull(pool, face, box, work)
    pad = MARGIN * pool[face.extent]
    for m in range(3):
        part.low[m], part.high[m] = low[m] - pad, high[m] + pad
    count = _add_cones(pool, face, box, 0, cones, work)
    axis, half = cone_of_cones(cones, order, 0, min(count, len(cones)))
    part.turn = half
    part.half_angle = FULL
    part.concave = 0.0
    if sides.face_b >= 0:
        second = _second_cones(store, sides, place, cones, work)
        count = max(count, second)
        axis_b, half_b = cone_of_cones(cones, order, 0, min(second, len(cones)))
        part.turn = max(half, half_b)
        sign = -1.0 if face.reversed == 1 else 1.0
        along = sign * place.along[0], sign * place.along[1], sign * place.along[2]
        part.concave = 1.0 if _is_concave(axis, half, axis_b, half_b, along) else 0.0
        cones[0, 0], cones[0, 1], cones[0, 2] = axis
        cones[0, 3] = half
        cones[1, 0], cones[1, 1], cones[1, 2] = axis_b
        cones[1, 3] = half_b
        axis, half = cone_of_cones(cones, order, 0, 2)
        part.half_angle = half if half < CONVEX else FULL
    part.axis[0], part.axis[1], part.axis[2] = axis
    return count


@kernel(signatures="(Tuple((i8[::1], f8[::1])), i8[:, ::1], f8[:, ::1], f8[:, ::1], i8[::1], f8[::1], f8[:, ::1])")
def measure_edge_parts(store, sides, places, cones, order, work, out):
    """Measure parts of edges, rows EDGE_SIDES and EDGE_PLACE, into rows EDGE_PART.

    `cones` (n, 4) has room for two cones or more; `order` is 0 to n - 1. Returns how many cones are needed: if that is
    more than n, the measures are incomplete and have to be made again with more room.
    """
    most = 0
    for i in range(len(sides)):
        part = edge_part_at(out, i)
        count = _measure_part(store, edge_sides_at(sides, i), edge_place_at(places, i), part, cones, order, work)
        most = max(most, count)
    return most
