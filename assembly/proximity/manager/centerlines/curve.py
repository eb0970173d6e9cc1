"""Spines of round wires as kernels read them: points, and which parameters of the surface stand for a point.

A spine (`geometry/shapes/centerline.py`) is a record of `SPINE` integers in the table. Its pieces, lines and arcs, are
cut into
parts that hardly turn, `PART` doubles each, run through by lengths from their middles; over the parts is a tree of
balls, whose root is node 0 and where the two children of a node follow each other.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of
from assembly.geometry.splines.evaluate import BREAKS_U, BREAKS_V, SPANS_U, SPANS_V, find_span
from assembly.geometry.vec import add, blend, cross, dot, scale, sub

# Record: how many pieces and parts; where they, the integers and the doubles of nodes are; whether it is closed, or
# else half balls are its ends; whether u (0) or v (1) runs along it; where its numbers are.
CENTERLINE = record_dtype(
    "i8",
    pieces=1,
    parts=1,
    piece_pool=1,
    part_pool=1,
    node_table=1,
    node_pool=1,
    closed=1,
    along=1,
    numbers=1,
)
centerline_at = record_view(CENTERLINE)
PIECES = place_of(CENTERLINE, "pieces")
PARTS = place_of(CENTERLINE, "parts")
PIECE_POOL = place_of(CENTERLINE, "piece_pool")
PART_POOL = place_of(CENTERLINE, "part_pool")
NODE_TABLE = place_of(CENTERLINE, "node_table")
NODE_POOL = place_of(CENTERLINE, "node_pool")
CLOSED = place_of(CENTERLINE, "closed")
ALONG = place_of(CENTERLINE, "along")
NUMBERS = place_of(CENTERLINE, "numbers")
SPINE = 9
# Its numbers: the wire's radius, the largest curvature, which way the other parameter turns.
WIRE = record_dtype(
    "f8",
    radius=1,
    sharpest=1,
    sense=1,
)
wire_at = record_view(WIRE)
SHARPEST = place_of(WIRE, "sharpest")
# A piece: curvature, length, the angle from the normal to where the other parameter starts, its first part, how many.
CENTERLINE_PIECE = record_dtype(
    "f8",
    bend=1,
    length=1,
    turn=1,
    first_part=1,
    part_count=1,
)
centerline_piece_at = record_view(CENTERLINE_PIECE)
PIECE = size_of(CENTERLINE_PIECE)
# A part, in its middle: point, tangent, normal; curvature, half its length, its piece, how far along that it is;
# whether the curvature jumps where it starts, and where it ends; the curvature vectors beyond.
CENTERLINE_PART = record_dtype(
    "f8",
    point=3,
    tangent=3,
    normal=3,
    bend=1,
    half=1,
    owner=1,
    place=1,
    jumps=2,
    beyond=6,
)
centerline_part_at = record_view(CENTERLINE_PART)
POINT = place_of(CENTERLINE_PART, "point")
TANGENT = place_of(CENTERLINE_PART, "tangent")
NORMAL = place_of(CENTERLINE_PART, "normal")
PART_BEND = place_of(CENTERLINE_PART, "bend")
HALF = place_of(CENTERLINE_PART, "half")
JUMPS = place_of(CENTERLINE_PART, "jumps")
BEYOND = place_of(CENTERLINE_PART, "beyond")
PART = size_of(CENTERLINE_PART)
# A node: its first child, or -1 - part; middle and radius of a ball.
BALL_RADIUS, BALL = 3, 4
QUARTER = 0.5 * math.pi


@kernel(inline=True)
def three(pool, o):
    """Three numbers of the pool."""
    return (pool[o], pool[o + 1], pool[o + 2])


@kernel(inline=True)
def turned(x):
    """sin x and 1 - cos x of an angle up to 0.7: to the last bits, in half the time of the library's."""
    # Taylor's series; literal quotients are constants.
    y = x * x
    z = 1.0 - y * (1.0 / 72.0) * (1.0 - y * (1.0 / 110.0) * (1.0 - y * (1.0 / 156.0)))
    sine = x * (1.0 - y * (1.0 / 6.0) * (1.0 - y * (1.0 / 20.0) * (1.0 - y * (1.0 / 42.0) * z)))
    z = 1.0 - y * (1.0 / 90.0) * (1.0 - y * (1.0 / 132.0) * (1.0 - y * (1.0 / 182.0)))
    versine = 0.5 * y * (1.0 - y * (1.0 / 12.0) * (1.0 - y * (1.0 / 30.0) * (1.0 - y * (1.0 / 56.0) * z)))
    return sine, versine


@kernel(inline=True)
def spine_point(pool, o, s):
    """Point, unit tangent and curvature vector of the part at o, a length s from its middle."""
    p = three(pool, o + POINT)
    t = three(pool, o + TANGENT)
    bend = centerline_part_at(pool, o).bend
    if bend == 0.0:
        return add(p, scale(s, t)), t, (0.0, 0.0, 0.0)
    n = three(pool, o + NORMAL)
    a, b = turned(bend * s)
    radius = 1.0 / bend
    point = add(p, blend(radius * a, t, radius * b, n))
    return point, blend(1.0 - b, t, a, n), blend(bend * (1.0 - b), n, -bend * a, t)


@kernel(inline=True)
def arc_place(angle, whole):
    """From -1 to 1, where a quadratic arc through `whole` is at an angle from its start."""
    return math.tan(0.5 * (angle - 0.5 * whole)) / math.tan(0.25 * whole)


@kernel(inline=True)
def in_span(pool, breaks, k, x):
    """The parameter at x, from -1 to 1 over span k."""
    low, high = pool[breaks + k], pool[breaks + k + 1]
    return min(max(0.5 * (low + high) + 0.5 * x * (high - low), low), high)


@kernel(inline=True)
def both_radii(table, pool, spines):
    """The radii of two wires, together."""
    return (
        wire_at(pool, centerline_at(table, spines[0]).numbers).radius
        + wire_at(pool, centerline_at(table, spines[1]).numbers).radius
    )


@kernel(inner=True)
def wire_parameters(table, pool, spine, surface, part, s, way):
    """Parameters (u, v) of the wire's surface in a unit direction from a point of its spine, s from a part's middle.

    At a free end the direction may lead on: there is a half ball.
    """
    line = centerline_at(table, spine)
    o = line.part_pool + PART * part
    part_record = centerline_part_at(pool, o)
    k = np.int64(part_record.owner)
    piece = centerline_piece_at(pool, line.piece_pool + PIECE * k)
    bend, length = piece.bend, piece.length
    _point, t, curvature = spine_point(pool, o, s)
    n = scale(1.0 / bend, curvature) if bend > 0.0 else three(pool, o + NORMAL)
    turn = piece.turn
    begin = blend(math.cos(turn), n, math.sin(turn), cross(t, n))
    ahead = dot(way, t)
    across = sub(way, scale(ahead, t))
    phi = math.atan2(wire_at(pool, line.numbers).sense * dot(across, cross(t, begin)), dot(across, begin))
    if phi < 0.0:
        phi += 4.0 * QUARTER
    along = line.along
    breaks_u = table[surface + (BREAKS_V if along == 1 else BREAKS_U)]
    breaks_v = table[surface + (BREAKS_U if along == 1 else BREAKS_V)]
    spans_v = table[surface + (SPANS_U if along == 1 else SPANS_V)]
    share = 4.0 * QUARTER / spans_v
    j = min(int(phi / share), spans_v - 1)
    v = in_span(pool, breaks_v, j, arc_place(phi - j * share, share))
    first = 0 if line.closed == 1 else 1
    lean = math.atan2(ahead, math.sqrt(dot(across, across)))
    if first == 1 and part == 0 and s <= -part_record.half and lean < 0.0:
        u = in_span(pool, breaks_u, 0, arc_place(QUARTER + lean, QUARTER))
    elif first == 1 and part == line.parts - 1 and s >= part_record.half and lean > 0.0:
        u = in_span(pool, breaks_u, k + 2, arc_place(lean, QUARTER))
    else:
        at = part_record.place + s
        x = arc_place(bend * at, bend * length) if bend > 0.0 else 2.0 * at / length - 1.0
        u = in_span(pool, breaks_u, first + k, x)
    if along == 1:
        return v, u
    return u, v


@kernel(inner=True)
def spine_place(table, pool, spine, surface, u, v):
    """The part of a wire's spine, and how far from its middle, where parameters of the surface are."""
    line = centerline_at(table, spine)
    along = line.along
    breaks = table[surface + (BREAKS_V if along == 1 else BREAKS_U)]
    spans = table[surface + (SPANS_V if along == 1 else SPANS_U)]
    at = v if along == 1 else u
    span = find_span(pool, breaks, spans, at)
    k = min(max(span - (1 - line.closed), 0), line.pieces - 1)
    piece = centerline_piece_at(pool, line.piece_pool + PIECE * k)
    span = k + 1 - line.closed
    low, high = pool[breaks + span], pool[breaks + span + 1]
    x = min(max(2.0 * (at - low) / (high - low) - 1.0, -1.0), 1.0)
    length = piece.length
    whole = piece.bend * length
    reach = 0.5 * (1.0 + x)
    if whole > 0.0:
        reach = 0.5 + 2.0 * math.atan(x * math.tan(0.25 * whole)) / whole
    count = np.int64(piece.part_count)
    part = np.int64(piece.first_part) + min(np.int64(reach * count), count - 1)
    o = centerline_part_at(pool, line.part_pool + PART * part)
    if abs(x) == 1.0:
        # Ends of a piece, and half balls: exactly.
        return part, x * o.half
    return part, reach * length - o.place


@kernel(signatures="(i8[::1], f8[::1], i8, i8, f8, f8[::1])")
def point_of(table, pool, spine, part, s, out):
    """`spine_point` for Python: point, tangent and curvature into out (9,)."""
    p, t, c = spine_point(pool, centerline_at(table, spine).part_pool + PART * part, s)
    for i in range(3):
        out[i] = p[i]
        out[3 + i] = t[i]
        out[6 + i] = c[i]


@kernel(signatures="(i8[::1], f8[::1], i8, i8, i8, f8, f8, f8, f8)")
def parameters_of(table, pool, spine, surface, part, s, x, y, z):
    """`wire_parameters` for Python."""
    return wire_parameters(table, pool, spine, surface, part, s, (x, y, z))


@kernel(signatures="(i8[::1], f8[::1], i8, i8, f8, f8)")
def place_of(table, pool, spine, surface, u, v):
    """`spine_place` for Python."""
    return spine_place(table, pool, spine, surface, u, v)
