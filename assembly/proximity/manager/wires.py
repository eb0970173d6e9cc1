"""Centerlines of round wires as kernels read them: points, and the surface parameters that belong to a point.

A centerline (`geometry/shapes/centerline.py`) is a record in the table. Its pieces, lines and arcs, are cut into parts
that hardly turn; a point of a part is given by its length from the part's middle. Over the parts is a tree of balls:
its root is node 0, and the two children of a node are next to each other.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.geometry.splines.evaluate import find_span, surface_at
from assembly.geometry.vec import add, blend, cross, dot, scale, sub
from assembly.proximity.bvh.tree import three_of

# A centerline in the table.
CENTERLINE = record_dtype(
    "i8",
    pieces=1,  # number of pieces
    parts=1,  # number of parts
    piece_pool=1,  # where the pieces begin in the pool
    part_pool=1,  # where the parts begin
    node_table=1,  # where the nodes' children begin in the table: the first child, or -1 - part
    node_pool=1,  # where their balls begin in the pool
    closed=1,  # 1: it is closed; 0: half balls are its ends
    along=1,  # which parameter of the surface runs along it: 0 u, 1 v
    numbers=1,  # where its WIRE is in the pool
)
centerline_at = record_view(CENTERLINE)
SPINE = size_of(CENTERLINE)
# Numbers of a wire.
WIRE = record_dtype(
    "f8",
    radius=1,  # [length over the size of the scene]
    sharpest=1,  # the largest curvature of the centerline
    sense=1,  # which way the other parameter turns: 1 or -1
)
wire_at = record_view(WIRE)
# A piece, a line or an arc.
CENTERLINE_PIECE = record_dtype(
    "f8",
    bend=1,  # curvature
    length=1,
    turn=1,  # angle from the normal to where the other parameter starts [rad]
    first_part=1,  # its parts: the first one
    part_count=1,  # and how many
)
centerline_piece_at = record_view(CENTERLINE_PIECE)
PIECE = size_of(CENTERLINE_PIECE)
# A part of a piece: what it is in its middle, and at its joints.
CENTERLINE_PART = record_dtype(
    "f8",
    point=3,
    tangent=3,
    normal=3,
    bend=1,  # curvature
    half=1,  # half its length
    owner=1,  # its piece
    place=1,  # how far along the piece its middle is
    jumps=2,  # 1: the curvature jumps where the part starts, or ends
    beyond=(2, 3),  # the curvature vectors beyond these joints
)
centerline_part_at = record_view(CENTERLINE_PART)
PART = size_of(CENTERLINE_PART)
# A node in the pool: a ball around its parts.
CENTERLINE_NODE = record_dtype("f8", center=3, radius=1)
ball_at = record_view(CENTERLINE_NODE)
BALL = size_of(CENTERLINE_NODE)
QUARTER = 0.5 * math.pi


@kernel(inline=True)
def sine_and_versine(x):
    """sin x and 1 - cos x of an angle up to 0.7: to the last bits, in half the time of the library's."""
    # Taylor's series; literal quotients are constants.
    y = x * x
    z = 1.0 - y * (1.0 / 72.0) * (1.0 - y * (1.0 / 110.0) * (1.0 - y * (1.0 / 156.0)))
    sine = x * (1.0 - y * (1.0 / 6.0) * (1.0 - y * (1.0 / 20.0) * (1.0 - y * (1.0 / 42.0) * z)))
    z = 1.0 - y * (1.0 / 90.0) * (1.0 - y * (1.0 / 132.0) * (1.0 - y * (1.0 / 182.0)))
    versine = 0.5 * y * (1.0 - y * (1.0 / 12.0) * (1.0 - y * (1.0 / 30.0) * (1.0 - y * (1.0 / 56.0) * z)))
    return sine, versine


@kernel(inline=True)
def centerline_point(pool, o, s):
    """Point, unit tangent and curvature vector of the part at o, a length s from its middle."""
    part = centerline_part_at(pool, o)
    p, t = three_of(part.point), three_of(part.tangent)
    bend = part.bend
    if bend == 0.0:
        return add(p, scale(s, t)), t, (0.0, 0.0, 0.0)
    n = three_of(part.normal)
    a, b = sine_and_versine(bend * s)
    radius = 1.0 / bend
    point = add(p, blend(radius * a, t, radius * b, n))
    return point, blend(1.0 - b, t, a, n), blend(bend * (1.0 - b), n, -bend * a, t)


@kernel(inline=True)
def arc_place(angle, whole):
    """The parameter, from -1 to 1, at an angle from the start of a rational quadratic arc that turns by `whole`."""
    return math.tan(0.5 * (angle - 0.5 * whole)) / math.tan(0.25 * whole)


@kernel(inline=True)
def at_part_of_span(pool, breaks, k, x):
    """The parameter at x, from -1 to 1 over span k."""
    low, high = pool[breaks + k], pool[breaks + k + 1]
    return min(max(0.5 * (low + high) + 0.5 * x * (high - low), low), high)


@kernel(inline=True)
def both_radii(store, centerlines):
    """The sum of the radii of two wires."""
    return (
        wire_at(store.pool, centerline_at(store.table, centerlines[0]).numbers).radius
        + wire_at(store.pool, centerline_at(store.table, centerlines[1]).numbers).radius
    )


@kernel(inner=True)
def wire_parameters(store, centerline, surface, part, s, way):
    """Parameters (u, v) of a wire's surface, in the unit direction `way` from a point of the centerline.

    The point is at a length s from the middle of a part. At a free end the direction may lead beyond it: a half ball is
    there.
    """
    line = centerline_at(store.table, centerline)
    o = line.part_pool + PART * part
    part_record = centerline_part_at(store.pool, o)
    k = np.int64(part_record.owner)
    piece = centerline_piece_at(store.pool, line.piece_pool + PIECE * k)
    bend, length = piece.bend, piece.length
    _point, t, curvature = centerline_point(store.pool, o, s)
    n = scale(1.0 / bend, curvature) if bend > 0.0 else three_of(part_record.normal)
    turn = piece.turn
    begin = blend(math.cos(turn), n, math.sin(turn), cross(t, n))
    ahead = dot(way, t)
    across = sub(way, scale(ahead, t))
    phi = math.atan2(wire_at(store.pool, line.numbers).sense * dot(across, cross(t, begin)), dot(across, begin))
    if phi < 0.0:
        phi += 4.0 * QUARTER
    along = line.along
    wire = surface_at(store.table, surface)
    breaks_u = wire.breaks_v if along == 1 else wire.breaks_u
    breaks_v = wire.breaks_u if along == 1 else wire.breaks_v
    spans_v = wire.spans_u if along == 1 else wire.spans_v
    share = 4.0 * QUARTER / spans_v
    j = min(int(phi / share), spans_v - 1)
    v = at_part_of_span(store.pool, breaks_v, j, arc_place(phi - j * share, share))
    first = 0 if line.closed == 1 else 1
    lean = math.atan2(ahead, math.sqrt(dot(across, across)))
    if first == 1 and part == 0 and s <= -part_record.half and lean < 0.0:
        u = at_part_of_span(store.pool, breaks_u, 0, arc_place(QUARTER + lean, QUARTER))
    elif first == 1 and part == line.parts - 1 and s >= part_record.half and lean > 0.0:
        u = at_part_of_span(store.pool, breaks_u, k + 2, arc_place(lean, QUARTER))
    else:
        at = part_record.place + s
        x = arc_place(bend * at, bend * length) if bend > 0.0 else 2.0 * at / length - 1.0
        u = at_part_of_span(store.pool, breaks_u, first + k, x)
    if along == 1:
        return v, u
    return u, v


@kernel(inner=True)
def centerline_place(store, centerline, surface, u, v):
    """The part of a wire's centerline, and how far from its middle, where parameters of the surface are."""
    line = centerline_at(store.table, centerline)
    along = line.along
    wire = surface_at(store.table, surface)
    breaks = wire.breaks_v if along == 1 else wire.breaks_u
    spans = wire.spans_v if along == 1 else wire.spans_u
    at = v if along == 1 else u
    span = find_span(store.pool, breaks, spans, at)
    k = min(max(span - (1 - line.closed), 0), line.pieces - 1)
    piece = centerline_piece_at(store.pool, line.piece_pool + PIECE * k)
    span = k + 1 - line.closed
    low, high = store.pool[breaks + span], store.pool[breaks + span + 1]
    x = min(max(2.0 * (at - low) / (high - low) - 1.0, -1.0), 1.0)
    length = piece.length
    whole = piece.bend * length
    reach = 0.5 * (1.0 + x)
    if whole > 0.0:
        reach = 0.5 + 2.0 * math.atan(x * math.tan(0.25 * whole)) / whole
    count = np.int64(piece.part_count)
    part = np.int64(piece.first_part) + min(np.int64(reach * count), count - 1)
    o = centerline_part_at(store.pool, line.part_pool + PART * part)
    if abs(x) == 1.0:
        # Ends of a piece, and half balls: exactly.
        return part, x * o.half
    return part, reach * length - o.place
