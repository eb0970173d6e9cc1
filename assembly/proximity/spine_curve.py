"""Spines of round wires as kernels read them: points, and which parameters of the surface stand for a point.

A spine (`geometry/spine.py`) is a record of `SPINE` integers in the table. Its pieces, `PIECE` doubles each, are lines
and arcs, run through by their lengths; over parts of them is a tree of balls, whose root is node 0 and where the two
children of a node follow each other.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.spline import BREAKS_U, BREAKS_V, SPANS_U, SPANS_V, find_span
from assembly.geometry.vec import add, blend, cross, dot, scale, sub

# Record: how many pieces; where they, the integers and the doubles of nodes are; whether it is closed, or else half
# balls are its ends; whether u (0) or v (1) runs along it; where its numbers are, and parts.
PIECES, PIECE_POOL, NODE_TABLE, NODE_POOL, CLOSED, ALONG, NUMBERS, PART_POOL, SPINE = 0, 1, 2, 3, 4, 5, 6, 7, 8
# Its numbers: the wire's radius, the largest curvature, which way the other parameter turns.
RADIUS, SHARPEST, SENSE, NUMBER_COUNT = 0, 1, 2, 3
# A piece where it starts: point, tangent, normal; curvature, length, and the angle from the normal to where the other
# parameter starts.
POINT, TANGENT, NORMAL, BEND, LENGTH, TURN, PIECE = 0, 3, 6, 9, 10, 11, 12
# A part: its piece, from and to.
PART = 3
# A node: its first child, or -1 - part; middle and radius of a ball.
BALL_RADIUS, BALL = 3, 4
QUARTER = 0.5 * math.pi


@kernel(inline=True)
def three(pool, o):
    """Three numbers of the pool."""
    return (pool[o], pool[o + 1], pool[o + 2])


@kernel(inline=True)
def spine_point(pool, o, s):
    """Point, unit tangent and curvature vector of the piece at o, a length s along it."""
    p = three(pool, o + POINT)
    t = three(pool, o + TANGENT)
    bend = pool[o + BEND]
    if bend == 0.0:
        return add(p, scale(s, t)), t, (0.0, 0.0, 0.0)
    n = three(pool, o + NORMAL)
    half = 0.5 * bend * s
    sine, cosine = math.sin(half), math.cos(half)
    a, b = 2.0 * sine * cosine, 2.0 * sine * sine
    point = add(p, blend(a / bend, t, b / bend, n))
    return point, blend(1.0 - b, t, a, n), blend(bend * (1.0 - b), n, -bend * a, t)


@kernel(inline=True)
def arc_place(angle, whole):
    """From -1 to 1, where a quadratic arc through `whole` is at an angle from its start."""
    if whole < 1e-9:
        return 2.0 * angle / whole - 1.0
    return math.tan(0.5 * (angle - 0.5 * whole)) / math.tan(0.25 * whole)


@kernel(inline=True)
def in_span(pool, breaks, k, x):
    """The parameter at x, from -1 to 1 over span k."""
    low, high = pool[breaks + k], pool[breaks + k + 1]
    return min(max(0.5 * (low + high) + 0.5 * x * (high - low), low), high)


@kernel(inline=True)
def both_radii(table, pool, spines):
    """The radii of two wires, together."""
    return pool[table[spines[0] + NUMBERS] + RADIUS] + pool[table[spines[1] + NUMBERS] + RADIUS]


@kernel(inner=True)
def wire_parameters(table, pool, spine, surface, k, s, way):
    """Parameters (u, v) of the wire's surface in a unit direction from a point of its spine, s along piece k.

    At a free end the direction may lead on: there is a half ball.
    """
    o = table[spine + PIECE_POOL] + PIECE * k
    bend, length = pool[o + BEND], pool[o + LENGTH]
    _point, t, curvature = spine_point(pool, o, s)
    n = scale(1.0 / bend, curvature) if bend > 0.0 else three(pool, o + NORMAL)
    b = cross(t, n)
    turn = pool[o + TURN]
    begin = blend(math.cos(turn), n, math.sin(turn), b)
    ahead = dot(way, t)
    across = sub(way, scale(ahead, t))
    phi = math.atan2(pool[table[spine + NUMBERS] + SENSE] * dot(across, cross(t, begin)), dot(across, begin))
    if phi < 0.0:
        phi += 4.0 * QUARTER
    along = table[spine + ALONG]
    breaks_u = table[surface + (BREAKS_V if along == 1 else BREAKS_U)]
    breaks_v = table[surface + (BREAKS_U if along == 1 else BREAKS_V)]
    spans_v = table[surface + (SPANS_U if along == 1 else SPANS_V)]
    part = 4.0 * QUARTER / spans_v
    j = min(int(phi / part), spans_v - 1)
    v = in_span(pool, breaks_v, j, arc_place(phi - j * part, part))
    first = 0 if table[spine + CLOSED] == 1 else 1
    lean = math.atan2(ahead, math.sqrt(dot(across, across)))
    if first == 1 and k == 0 and s <= 0.0 and lean < 0.0:
        u = in_span(pool, breaks_u, 0, arc_place(QUARTER + lean, QUARTER))
    elif first == 1 and k == table[spine + PIECES] - 1 and s >= length and lean > 0.0:
        u = in_span(pool, breaks_u, k + 2, arc_place(lean, QUARTER))
    else:
        x = arc_place(bend * s, bend * length) if bend > 0.0 else 2.0 * s / length - 1.0
        u = in_span(pool, breaks_u, first + k, x)
    if along == 1:
        return v, u
    return u, v


@kernel(inner=True)
def spine_place(table, pool, spine, surface, u, v):
    """The piece of a wire's spine, and how far along it, where parameters of its surface are."""
    along = table[spine + ALONG]
    breaks = table[surface + (BREAKS_V if along == 1 else BREAKS_U)]
    spans = table[surface + (SPANS_V if along == 1 else SPANS_U)]
    at = v if along == 1 else u
    k = find_span(pool, breaks, spans, at)
    last = table[spine + PIECES] - 1
    if table[spine + CLOSED] == 0:
        if k == 0:
            return 0, 0.0
        if k > last + 1:
            return last, pool[table[spine + PIECE_POOL] + PIECE * last + LENGTH]
        low, high = pool[breaks + k], pool[breaks + k + 1]
        k -= 1
    else:
        low, high = pool[breaks + k], pool[breaks + k + 1]
    o = table[spine + PIECE_POOL] + PIECE * k
    x = 2.0 * (at - low) / (high - low) - 1.0
    length = pool[o + LENGTH]
    whole = pool[o + BEND] * length
    if whole < 1e-9:
        return k, 0.5 * (1.0 + x) * length
    return k, length * (0.5 + 2.0 * math.atan(x * math.tan(0.25 * whole)) / whole)


@kernel
def point_of(table, pool, spine, k, s, out):
    """`spine_point` for Python: point, tangent and curvature into out (9,)."""
    p, t, c = spine_point(pool, table[spine + PIECE_POOL] + PIECE * k, s)
    for i in range(3):
        out[i] = p[i]
        out[3 + i] = t[i]
        out[6 + i] = c[i]


@kernel
def parameters_of(table, pool, spine, surface, k, s, x, y, z):
    """`wire_parameters` for Python."""
    return wire_parameters(table, pool, spine, surface, k, s, (x, y, z))


@kernel
def place_of(table, pool, spine, surface, u, v):
    """`spine_place` for Python."""
    return spine_place(table, pool, spine, surface, u, v)
