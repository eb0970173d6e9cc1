"""The way between two poses of body b, seen from a: a straight line and a rotation about one axis.

The middle of b's root goes along a straight line, and b turns about it, with constant rates. A point then leaves the
straight line between its two places by no more than its distance from the axis of rotation times 1 - cos(angle / 2):
the height of the arc over its chord, here called its sag. What is convex and holds two points holds their chord: nodes
that one plane, or one bore, keeps apart at both poses by more than the sag are apart all the way.

The arc lies in a plane across the axis of rotation, and so does its sag. So the sag toward a plane across the axis,
such as that on which links of a planar mechanism slide, is zero; toward another plane it is the part of the sag that is
along the plane's normal.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.geometry.vec import add, blend, cross, dot, matmul_t, matvec, neg, scale, sub
from assembly.kinematics.motion import RelativePose
from assembly.proximity.clearance.halve import corner_of, vector
from assembly.proximity.clearance.records import BY_BORE_A, BY_BORE_B, BY_PLANE_OF_B, BY_SLEEVE, node_at
from assembly.proximity.clearance.separation import across, highest, is_round, is_wire, placed, room_in_bore
from assembly.proximity.clearance.sleeve_bends import axis_bends, disc_bend, section_bends
from assembly.proximity.clearance.sleeves import LEAST_COSINE, cosine_of_rulings, sleeve_room, slope_of

# swept: whether the way is looked at, or its end alone. moved: a bound of the travel of points of b. sag: of any point;
# factor: of a point at distance 1 from the axis of rotation. axis, middle: of that, in axes of b (zero: it is not
# known); lean: what the axis may be off. before, after: the poses.
Way = namedtuple("Way", "swept moved sag factor axis lean middle before after")
ROUNDED_UP = 1.0 + 1e-12
# The axis of rotation is lost in rounding if twice the sine of the angle is below, or the angle [rad] above, these.
LEAST_SINE, LARGEST_ANGLE = 1e-9, 3.0
# What the axis may be off, as a part of distances; the sag of so small angles is far below that.
AXIS_OFF = 1e-6
# A section of a cone in a sleeve is no narrower than this part of its widest disc (`sleeves.NARROWEST`).
NARROWED = 0.05
# The largest angle [rad] of what leans in a sleeve to the bore's axis, and of an end of it to the bore's wall.
MOST_LEAN = 1.5
# The largest sine of an angle between a wall's normal and a plane across a shaft (`sag_of_disc`).
STEEPEST = 0.99
# The rounding error of the rotation's skew part, whose direction is the axis: that of two matrices and their product.
SINE_OFF = 1e-14


@kernel(inner=True)
def way_of(before, after, center, radius, swept):
    """The way, from pose to pose, of a ball of b with a middle and a radius in axes of b."""
    square = 0.0
    for k in range(9):
        square += (after.rotation[k] - before.rotation[k]) ** 2
    angle = 2.0 * math.asin(min(math.sqrt(square / 8.0), 1.0))
    d = sub(placed(after, center), placed(before, center))
    moved = (math.sqrt(dot(d, d)) + angle * radius) * ROUNDED_UP
    # 1 - cos(angle / 2) = 2 sin^2(angle / 4)
    half = math.sin(0.25 * angle)
    factor = 2.0 * half * half * ROUNDED_UP
    # The rotation seen from b, and its axis by its skew part.
    m = matmul_t(before.rotation, after.rotation)
    axis = (m[7] - m[5], m[2] - m[6], m[3] - m[1])
    length = math.sqrt(dot(axis, axis))
    lean = 0.0
    if length > LEAST_SINE and angle < LARGEST_ANGLE:
        axis = scale(1.0 / length, axis)
        lean = SINE_OFF / length
    else:
        axis = (0.0, 0.0, 0.0)
    return Way(swept, moved, factor * radius if swept else 0.0, factor, axis, lean, center, before, after)


@kernel(inline=True)
def off_axis(way, x):
    """How far a point of b is from the axis of its rotation, at most."""
    d = sub(x, way.middle)
    along = dot(d, way.axis)
    return across(d, way.axis) + AXIS_OFF * (abs(along) + math.sqrt(dot(d, d)))


@kernel(inner=True)
def sag_of(way, forest, b):
    """The largest sag in node b; of what is round, of points of its axis, or of its spine."""
    node = node_at(forest.nodes, b)
    center = vector(node.center)
    if is_wire(forest, b):
        ends = max(off_axis(way, corner_of(node, 0)), off_axis(way, corner_of(node, 1)))
        return way.factor * (ends + node.reach)
    if is_round(forest, b):
        u = scale(node.half[0], vector(node.axes[0]))
        return way.factor * max(off_axis(way, add(center, u)), off_axis(way, sub(center, u)))
    return way.factor * (off_axis(way, center) + node.radius)


@kernel(inner=True)
def as_ball(forest, nodes, pose, n, gap):
    """The gap if the disc of a round node b is replaced by a ball: a lower bound, however its axis turns."""
    node = node_at(forest.nodes, nodes.b)
    if node.disc == 0.0 or not is_round(forest, nodes.b):
        return gap
    if nodes.how == BY_BORE_A:
        room = room_in_bore(forest, nodes.a, nodes.b, pose, False)
        return gap - (room - room_in_bore(forest, nodes.a, nodes.b, pose, True))
    flat = across(n, matvec(pose.rotation, vector(node.ruling)))
    return gap - node.disc * (1.0 - flat + 1e-15)


@kernel(inner=True)
def sag_of_disc(way, forest, a, b):
    """How far the disc of round node b reaches, on the way, beyond the chord of its reach at the ends, in a bore of a.

    Along a unit vector N that is fixed to the wall it reaches r sqrt(1 - t^2), t = N.u, from its middle, u its axis.
    With w the angle of the way and w1 the part of it by which u turns, |t'| <= w1 and |t''| <= w w1, so that

        |second derivative| <= r ((w1^2 + |t| w w1) / f + t^2 w1^2 / f^3),   f = sqrt(1 - t^2),

    and |t| is at most the sine of the wall's angle to its axis and that of the lean, added.
    """
    wall, node = node_at(forest.nodes, a), node_at(forest.nodes, b)
    bore, ruling = vector(wall.ruling), vector(node.ruling)
    if node.disc == 0.0:
        return 0.0
    if dot(bore, bore) == 0.0:
        return math.inf
    angle = 4.0 * math.asin(min(math.sqrt(0.5 * way.factor), 1.0))
    turned = angle
    if dot(way.axis, way.axis) > 0.0:
        turned *= min(across(way.axis, ruling) + way.lean, 1.0)
    lean = max(across(matvec(way.before.rotation, ruling), bore), across(matvec(way.after.rotation, ruling), bore))
    t = wall.slant + lean + turned
    if t > STEEPEST:
        return math.inf
    f = math.sqrt(1.0 - t * t)
    second = (turned * turned + t * angle * turned) / f + (t * turned) ** 2 / (f * f * f)
    return 0.125 * node.disc * second * ROUNDED_UP


@kernel(inner=True)
def sag_backward(way, forest, a):
    """The largest sag in node a, at rest, seen from b, whose middle c goes straight and about which it turns.

    Its points are at R' (x - c), whose second derivative over the way is no longer than w^2 |x - c| + 2 w |c'|, w the
    angle; a curve is off its chord by an eighth of that at most.
    """
    node = node_at(forest.nodes, a)
    start, end = placed(way.before, way.middle), placed(way.after, way.middle)
    d, e, f = sub(end, start), sub(vector(node.center), start), sub(vector(node.center), end)
    far = math.sqrt(max(dot(e, e), dot(f, f))) + node.radius
    angle = 4.0 * math.asin(min(math.sqrt(0.5 * way.factor), 1.0))
    return 0.125 * angle * (angle * far + 2.0 * math.sqrt(dot(d, d))) * ROUNDED_UP


@kernel(inner=True)
def sag_of_carried(way, forest, a, n):
    """How far points of node a, at rest, may be off their chords along a direction n that moves along with b.

    n is in axes of b. Seen from b, whose middle is c, a point x is at p.(x - c) along it, with p the direction as it
    turns. With w the angle, u the axis and q the length of n across that, the second derivative over the way is

        w^2 q |x - c across u| + 2 w |(u x p).c'|

    at most, and u x p is of length q and never turned by more than w / 2 from what it is at one of the ends.
    """
    node = node_at(forest.nodes, a)
    angle = 4.0 * math.asin(min(math.sqrt(0.5 * way.factor), 1.0))
    start, end = placed(way.before, way.middle), placed(way.after, way.middle)
    d, e, f = sub(end, start), sub(vector(node.center), start), sub(vector(node.center), end)
    axis, length = matvec(way.after.rotation, way.axis), math.sqrt(dot(d, d))
    far = max(across(e, axis), across(f, axis)) + AXIS_OFF * math.sqrt(max(dot(e, e), dot(f, f))) + node.radius
    part, beside = 1.0, length
    if dot(axis, axis) > 0.0:
        part = min(across(n, way.axis) + way.lean, 1.0)
        first, last = cross(axis, matvec(way.before.rotation, n)), cross(axis, matvec(way.after.rotation, n))
        most = max(abs(dot(first, d)), abs(dot(last, d))) + (0.5 * angle * part + way.lean + AXIS_OFF) * length
        beside = min(part * length, most)
    return 0.125 * angle * (angle * part * far + 2.0 * beside) * ROUNDED_UP


@kernel(inline=True)
def part_along(way, n):
    """Which part of a sag is along the normal n of a plane, at most: a sag is across the axis of rotation."""
    return min(across(n, matvec(way.after.rotation, way.axis)) + way.lean, 1.0)


@kernel(inner=True)
def sleeve_sag(way, forest, a, b, how):
    """What the way may take of the room of node b in a sleeve of node a, which is room across the bore times a cosine.

    Returns how far the room across the bore may fall below the chord of its values at the ends, and by what part the
    cosine at an end may be above the least one.

    With w the angle of the way, w1 the part of it by which b's axis turns, primes for derivatives along the way, and t
    and T the tangent and the secant of the largest lean, a plane at a height z from b's center c cuts b's axis at e,
    where it has the radius r + S z sec:

        |e''| <= T |c''| + 2 |c'| |s'| + z |s''|,
        |(z sec)'| <= T |c'| + z |sec'|,    |(z sec)''| <= T |c''| + 2 |c'| |sec'| + z |sec''|,

    with |s'|, |sec'| and the factor of the radius by `sleeve_bends.py`. An end of b, at half the length h along the
    axis u, has the support N.(c + h u) + r sqrt(1 - (N.u)^2).
    """
    wall, node = node_at(forest.nodes, a), node_at(forest.nodes, b)
    u, axis = vector(wall.ruling), vector(node.axes[0])
    angle = 4.0 * math.asin(min(math.sqrt(0.5 * way.factor), 1.0))
    turned = angle
    if dot(way.axis, way.axis) > 0.0:
        turned *= min(across(way.axis, axis) + way.lean, 1.0)
    before, after = matvec(way.before.rotation, axis), matvec(way.after.rotation, axis)
    # No axis of the way is farther from that at one of both ends.
    leans = math.atan2(across(before, u), abs(dot(before, u))), math.atan2(across(after, u), abs(dot(after, u)))
    lean = max(leans[0], leans[1]) + 0.5 * turned
    slope = abs(slope_of(node))
    upright = cosine_of_rulings(math.cos(lean), slope)
    if not (lean < MOST_LEAN and upright >= 0.5 * LEAST_COSINE):
        return math.inf, 0.0
    fall = cosine_of_rulings(math.cos(min(leans[0], leans[1])), slope) / upright * ROUNDED_UP - 1.0
    center = vector(node.center)
    start, end = placed(way.before, way.middle), placed(way.after, way.middle)
    d = sub(end, start)
    off = off_axis(way, center)
    bent, pace = angle * angle * off, math.sqrt(dot(d, d)) + angle * off
    top, bottom = highest(forest, a, u), -highest(forest, a, neg(u))
    low, high = dot(placed(way.before, center), u), dot(placed(way.after, center), u)
    far = max(max(top, bottom, low, high) - min(top, bottom, low, high), node.half[0]) + bent
    t = math.tan(lean)
    secant = math.sqrt(1.0 + t * t)
    s_first, s_second, secant_first, secant_second = axis_bends(t)
    factor, factor_first, factor_second = section_bends(t, slope)
    widest = node.disc + slope * far * secant
    radius_first = slope * (secant * pace + far * secant_first * turned)
    radius_second = slope * (secant * bent + (2.0 * pace * secant_first + far * secant_second * angle) * turned)
    second = secant * bent + (2.0 * pace * s_first + far * s_second * angle) * turned
    second += radius_second * factor + (2.0 * radius_first * factor_first + widest * factor_second * angle) * turned
    if how != BY_SLEEVE:
        tilted = math.asin(wall.slant) + lean
        if not tilted < MOST_LEAN:
            return math.inf, 0.0
        ends = bent + (node.half[0] + node.disc * disc_bend(math.sin(tilted))) * angle * turned
        second = max(second, ends)
    sag = 0.125 * second * ROUNDED_UP
    # What a section's radius may lose must not bring it to the apex.
    return (math.inf if slope > 0.0 and sag > NARROWED * node.disc else sag), fall


@kernel(inner=True)
def keeps_room(way, forest, nodes, gaps):
    """Whether a sleeve keeps two nodes apart all the way, by gaps before and after: the room less the least gap g.

    The room is c x, a cosine times the room across the bore. If c x - g > s + f g at both ends, with s how far x may
    fall and f by what part c may, then x > s + g / (the least c) there and x > g / (the least c) all the way.
    """
    before, after = gaps
    sag, fall = sleeve_sag(way, forest, nodes.a, nodes.b, nodes.how)
    if not (after > sag and before > sag):
        return False
    least_gap = max(sleeve_room(forest, nodes.a, nodes.b, way.after, nodes.how) - after, 0.0)
    sag += fall * least_gap
    return after > sag and before > sag


@kernel(inner=True)
def stays_apart(forest, nodes, way, n, gaps):
    """Whether what separates two nodes at both poses, by gaps before and after, separates them all the way.

    n is the direction of a plane, of one that moves along with b in axes of b.
    """
    before, after = gaps
    if not after > 0.0:
        return False
    if not way.swept:
        return True
    if nodes.how == BY_BORE_B or nodes.how == BY_PLANE_OF_B:
        sag = sag_backward(way, forest, nodes.a) if nodes.how == BY_BORE_B else sag_of_carried(way, forest, nodes.a, n)
        return after > sag and before > sag
    if nodes.how >= BY_SLEEVE:
        return keeps_room(way, forest, nodes, gaps)
    if nodes.how == BY_BORE_A and is_round(forest, nodes.b):
        sag = sag_of(way, forest, nodes.b) + sag_of_disc(way, forest, nodes.a, nodes.b)
        if after > sag and before > sag:
            return True
    part = 1.0 if nodes.how == BY_BORE_A else part_along(way, n)
    if after > part * way.sag and before > part * way.sag:
        return True
    sag = part * sag_of(way, forest, nodes.b)
    after, before = as_ball(forest, nodes, way.after, n, after), as_ball(forest, nodes, way.before, n, before)
    return after > sag and before > sag


@kernel(inner=True)
def pose_at(way, s):
    """The pose at part s of a way."""
    start, end = placed(way.before, way.middle), placed(way.after, way.middle)
    m = matmul_t(way.before.rotation, way.after.rotation)
    axis = (m[7] - m[5], m[2] - m[6], m[3] - m[1])
    sine = 0.5 * math.sqrt(dot(axis, axis))
    cosine = 0.5 * (m[0] + m[4] + m[8] - 1.0)
    turn = way.before.rotation
    if sine > 0.0:
        x, y, z = scale(0.5 / sine, axis)
        angle = s * math.atan2(sine, cosine)
        c, t = math.cos(angle), math.sin(angle)
        d = 1.0 - c
        u = matvec(turn, (c + d * x * x, d * x * y + t * z, d * x * z - t * y))
        v = matvec(turn, (d * x * y - t * z, c + d * y * y, d * y * z + t * x))
        w = matvec(turn, (d * x * z + t * y, d * y * z - t * x, c + d * z * z))
        turn = (u[0], v[0], w[0], u[1], v[1], w[1], u[2], v[2], w[2])
    center = blend(1.0 - s, start, s, end)
    return RelativePose(turn, sub(center, matvec(turn, way.middle)))
