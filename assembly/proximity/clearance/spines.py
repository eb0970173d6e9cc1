"""Pieces of two wires that are kept apart by the distance of their spines.

Wires that touch may have no plane between them: planes separate only ever smaller pieces. The gap of two tubes is
exactly the distance of their spines (center curves) less both radii. Spines are lines and arcs here, parameterized by
arc length from the middle: c(s) and e(t). Half of their squared distance,

    f(s, t) = |d|^2 / 2,   d = c(s) - e(t),

has the derivatives

    f_s = d.c',   f_t = -d.e',   f_ss = 1 + d.c'',   f_tt = 1 - d.e'',   f_st = -c'.e'.

Where the second ones, bounded over all of both pieces, are those of a convex function, f lies above its tangent plane
at any point x, so that

    f >= f(x) + min over both pieces of grad f(x).(y - x),

whatever x is. Newton's method seeks the x with the largest bound; the proof does not depend on it. Where wires lie
along each other, and their curvatures fit, no pieces are short enough for f to be convex. With the least eigenvalue
that the second derivatives may have anywhere, -e, f lies above its tangent plane less e |y - x|^2 / 2. As e goes to
zero with the lengths of pieces there, this loss is of third order in them. Pieces whose f_ss or f_tt may be negative
are halved.

Along a way every point of b moves along a chord, up to its sag. A point that is at least D from another one at both
ends of a chord of length s is sqrt(D^2 - s^2 / 4) from it at least in between. So wires that touch at both ends of a
way overlap in between by no more than a term that is quadratic in its length.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.geometry.vec import add, blend, dot, matvec, scale, sub
from assembly.kinematics.motion import IDENTITY
from assembly.proximity.clearance.halve import arc_height, corner_of, vector
from assembly.proximity.clearance.records import node_at
from assembly.proximity.clearance.separation import placed

# A piece of a spine, seen from a: its middle, the tangent there, the unit vector from there to the center of its arc
# (zero for a line), its curvature, half of its length.
Piece = namedtuple("Piece", "middle ahead inward bend half")
# At s of one piece and t of the other: f, its first and its second derivatives.
Squared = namedtuple("Squared", "f s t ss tt st")
# The steps that Newton's method needs at most, from a start at the end of a piece.
STEPS = 12
# Newton's method ends where the bound is below f by no more than this part of f.
CLOSE = 1e-14


@kernel(inner=True)
def piece_of(forest, k, pose):
    """The spine of cell k, a piece of a wire, at a pose."""
    node = node_at(forest.nodes, k)
    p, q, bend = corner_of(node, 0), corner_of(node, 1), node.first[0]
    chord = sub(q, p)
    length = math.sqrt(dot(chord, chord))
    middle, inward, half = scale(0.5, add(p, q)), (0.0, 0.0, 0.0), 0.5 * length
    if bend > 0.0:
        inward = sub(vector(node.spine), middle)
        inward = scale(1.0 / math.sqrt(dot(inward, inward)), inward)
        middle = sub(middle, scale(arc_height(node), inward))
        half = math.asin(min(bend * half, 1.0)) / bend
    ahead = scale(1.0 / length, chord) if length > 0.0 else (0.0, 0.0, 0.0)
    rotation = pose.rotation
    return Piece(placed(pose, middle), matvec(rotation, ahead), matvec(rotation, inward), bend, half)


@kernel(inline=True)
def point_at(piece, s):
    """A point of a piece, its tangent, and its second derivative by length."""
    angle = piece.bend * s
    if angle == 0.0:
        x = add(piece.middle, scale(s, piece.ahead))
        return x, piece.ahead, scale(piece.bend, piece.inward)
    sine, cosine, half = math.sin(angle), math.cos(angle), math.sin(0.5 * angle)
    x = add(piece.middle, blend(sine / piece.bend, piece.ahead, 2.0 * half * half / piece.bend, piece.inward))
    tangent = blend(cosine, piece.ahead, sine, piece.inward)
    bent = blend(-piece.bend * sine, piece.ahead, piece.bend * cosine, piece.inward)
    return x, tangent, bent


@kernel(inner=True)
def squared_at(one, other, s, t):
    """Half of the squared distance of points of two pieces, and its derivatives."""
    x, along, bent = point_at(one, s)
    y, beside, curved = point_at(other, t)
    d = sub(x, y)
    first, second = dot(d, along), -dot(d, beside)
    return Squared(0.5 * dot(d, d), first, second, 1.0 + dot(d, bent), 1.0 - dot(d, curved), -dot(along, beside))


@kernel(inline=True)
def least_curvature(one, other):
    """A lower bound of all second derivatives of half of the squared distance of points of two pieces, or 0 if convex.

    Unless 0, it bounds the least eigenvalue; it is minus infinity where f_ss or f_tt may be negative.
    Each second derivative differs from its value at the middles by at most its own derivatives times half lengths:
    those of d.c'' are d.c''' along c, of length |d| times the squared curvature, and -e'.c'' along e. Tangents turn by
    the angle of half a piece, so that the angle between two is less than in the middles by both of these at most.
    """
    if one.bend == 0.0 and other.bend == 0.0:
        return 0.0
    f = squared_at(one, other, 0.0, 0.0)
    farthest = math.sqrt(2.0 * f.f) + one.half + other.half
    turn, twist = one.bend * one.half, other.bend * other.half
    ss = f.ss - one.bend * (farthest * turn + other.half)
    tt = f.tt - other.bend * (farthest * twist + one.half)
    cosine, turned = abs(f.st), turn + twist
    st = 1.0
    if cosine < math.cos(turned):
        st = cosine * math.cos(turned) + math.sqrt(max(1.0 - cosine * cosine, 0.0)) * math.sin(turned)
    if not (ss > 0.0 and tt > 0.0):
        return -math.inf
    if st * st <= ss * tt:
        return 0.0
    # That of the matrix of the least f_ss and f_tt and the largest f_st: no other one has a lesser eigenvalue.
    return 0.5 * (ss + tt) - math.sqrt(0.25 * (ss - tt) ** 2 + st * st)


@kernel(inline=True)
def lowest_change(slope, at, half):
    """The least change of a linear function of this slope from `at` to any place within half a length of the middle."""
    return min(slope * (half - at), -slope * (half + at))


@kernel(inline=True)
def clamped(x, half):
    """The place of a piece that is nearest."""
    return min(max(x, -half), half)


@kernel(inline=True)
def is_held(slope, at, half):
    """Whether a place is at an end beyond which f is less."""
    return (at >= half and slope < 0.0) or (at <= -half and slope > 0.0)


@kernel(inner=True)
def next_places(f, one, other, s, t):
    """Where Newton's method goes on, along the ends of pieces beyond which f is less."""
    held_s, held_t = is_held(f.s, s, one.half), is_held(f.t, t, other.half)
    determinant = f.ss * f.tt - f.st * f.st
    if held_s or (not held_t and not determinant > 1e-12 * f.ss * f.tt):
        # Parallel lines: any place of one of them will do.
        t_next = t if held_t else clamped(t - f.t / f.tt, other.half)
        return s, t_next
    if held_t:
        return clamped(s - f.s / f.ss, one.half), t
    s_next = s - (f.tt * f.s - f.st * f.t) / determinant
    t_next = t - (f.ss * f.t - f.st * f.s) / determinant
    if abs(s_next) > one.half:
        # The minimum along the end that it leaves by first.
        s_next = clamped(s_next, one.half)
        t_next = t - (f.t + f.st * (s_next - s)) / f.tt
    elif abs(t_next) > other.half:
        t_next = clamped(t_next, other.half)
        s_next = s - (f.s + f.st * (t_next - t)) / f.ss
    return clamped(s_next, one.half), clamped(t_next, other.half)


@kernel(inner=True)
def spine_distance(forest, a, b, pose, s, t):
    """A lower bound of the distance of the spines of two pieces of wires, and the places that it is from.

    Minus infinity where half of its square is too far from being convex. s, t: where it may be least.
    """
    one, other = piece_of(forest, a, IDENTITY), piece_of(forest, b, pose)
    concave = -0.5 * least_curvature(one, other)
    s, t = clamped(s, one.half), clamped(t, other.half)
    # From the middles, what is lost on the way to the ends is least.
    if not squared_at(one, other, s, t).f > concave * (one.half**2 + other.half**2):
        return -math.inf, s, t
    best, at_s, at_t = -math.inf, s, t
    for _ in range(STEPS):
        f = squared_at(one, other, s, t)
        bound = f.f + lowest_change(f.s, s, one.half) + lowest_change(f.t, t, other.half)
        bound -= concave * ((one.half + abs(s)) ** 2 + (other.half + abs(t)) ** 2)
        if bound > best:
            best, at_s, at_t = bound, s, t
        before_s, before_t = s, t
        s, t = next_places(f, one, other, s, t)
        if best >= f.f * (1.0 - CLOSE) or (s == before_s and t == before_t):
            break
    return math.sqrt(2.0 * best) if best > 0.0 else -math.inf, at_s, at_t


@kernel(inner=True)
def spine_gap(forest, nodes, pose, at):
    """A lower bound of the gap of two pieces of wires at a pose, and the places of their spines that it is from.

    at: where these may be nearest, s and t in the first two places.
    """
    distance, s, t = spine_distance(forest, nodes.a, nodes.b, pose, at[0], at[1])
    return distance - both_radii(forest, nodes.a, nodes.b), (s, t, 0.0)


@kernel(inline=True)
def both_radii(forest, a, b):
    """The radii of two pieces of wires together, and what these may be more."""
    one, other = node_at(forest.nodes, a), node_at(forest.nodes, b)
    return one.first[1] + one.pad + other.first[1] + other.pad


@kernel(inline=True)
def chord_of(forest, b, way):
    """How far points of the spine of cell b go along a way, at most."""
    node = node_at(forest.nodes, b)
    p, q = corner_of(node, 0), corner_of(node, 1)
    d = sub(placed(way.after, p), placed(way.before, p))
    e = sub(placed(way.after, q), placed(way.before, q))
    # No point of the chord moves farther than one of its ends; the arc is off the chord, and turns by the way's angle.
    turned = 2.0 * math.sqrt(2.0 * way.factor) * node.reach
    return math.sqrt(max(dot(d, d), dot(e, e))) + turned


@kernel(inner=True)
def loss_on_way(forest, nodes, way, gap, sag):
    """How much less the gap of two pieces of wires may be along a way than at both ends, where it is at least `gap`.

    Infinite where that is more than the square of the way's length over the lesser radius, or than that radius: what
    passes through the other wire is in it by both.
    """
    distance = gap + both_radii(forest, nodes.a, nodes.b)
    s = chord_of(forest, nodes.b, way)
    left = distance * distance - 0.25 * s * s
    if not left > 0.0:
        return math.inf
    loss = 0.25 * s * s / (distance + math.sqrt(left)) + sag
    least = min(node_at(forest.nodes, nodes.a).first[1], node_at(forest.nodes, nodes.b).first[1])
    return loss if loss * least <= way.moved * way.moved and loss <= least else math.inf
