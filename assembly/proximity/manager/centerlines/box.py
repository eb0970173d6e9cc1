"""What is known of the distance of two centerlines over a box: intervals of the lengths s and t along a part of either.

Two wires touch where the distance of their centerlines has a minimum: with d = g(t) - f(s) and F = |d|^2 / 2,

    F_s = -d.f',   F_t = d.g',   F_ss = 1 - d.f'',   F_st = -f'.g',   F_tt = 1 + d.g''

(f', g' unit tangents, f'', g'' the curvature vectors). Over a box of half widths h and k these differ from their
values in the middle by no more than parts of constant curvature allow. So a box can be proven to hold no stationary
point of F, one minimum at most (F convex), or none (F'' indefinite); and up to which motion that holds.

A motion by m moves no point of one centerline by more than m, seen from the other, and turns its tangents by no more
than m / rho.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.geometry.vec import add, blend, dot, matvec, matvec_t, sub
from assembly.proximity.manager.parameters import TURNS
from assembly.proximity.manager.wires import centerline_part_at, centerline_point

# A box: a part of either centerline, and the lengths from its middle where the box begins and ends.
CENTERLINE_BOX = record_dtype("f8", part_f=1, from_f=1, to_f=1, part_g=1, from_g=1, to_g=1)
centerline_box_at = record_view(CENTERLINE_BOX)
BOX = size_of(CENTERLINE_BOX)
# The lengths of a box; and at which free ends of the centerlines it is, yes or no.
Lengths = namedtuple("Lengths", "from_f to_f from_g to_g")
FreeEnds = namedtuple("FreeEnds", "start_f end_f start_g end_g")
# A part of either centerline, f and g, in space. pool: where they are, at these places; pose: of g seen from f.
PosedParts = namedtuple("PosedParts", "pool f g pose")
# d = g(t) - f(s), unit tangents and curvature vectors of both, in the axes of f.
Difference = namedtuple("Difference", "d tangent_f curvature_f tangent_g curvature_g")
# The least and the largest of F_ss, F_tt and |F_st| over a box.
Hessian = namedtuple("Hessian", "ss_low ss_high tt_low tt_high st_low st_high")
# What a box is: nothing known, no stationary point in it, F convex over it, F'' indefinite over it.
UNKNOWN, EMPTY, CONVEX, BARREN = 0, 1, 2, 3
# Rounding errors of slopes, lengths and F'' are below this; a value so near to zero may be zero.
BOX_ROUNDING = 1e-13
# Contacts of lines more parallel than this, in radians, stay where they are as the lines turn.
PARALLEL = 1e-5


@kernel(inline=True)
def segment_distance(d, f, g, h, k):
    """The least distance of two segments: middles d apart, unit directions f and g, half lengths h and k."""
    c = dot(f, g)
    a = dot(d, f)
    b = dot(d, g)
    det = 1.0 - c * c
    x = min(max((a - c * b) / det, -h), h) if det > 1e-15 else 0.0
    y = c * x - b
    if abs(y) > k:
        y = min(max(y, -k), k)
        x = min(max(a + c * y, -h), h)
    e = add(d, blend(y, g, -x, f))
    return math.sqrt(dot(e, e))


@kernel(inline=True)
def difference_at(parts, s, t):
    """The Difference at lengths s and t along two parts."""
    pose = parts.pose
    pf, f, bend_f = centerline_point(parts.pool, parts.f, s)
    q, g, bend_g = centerline_point(parts.pool, parts.g, t)
    return Difference(
        d=sub(add(matvec(pose.rotation, q), pose.shift), pf),
        tangent_f=f,
        curvature_f=bend_f,
        tangent_g=matvec(pose.rotation, g),
        curvature_g=matvec(pose.rotation, bend_g),
    )


@kernel(inline=True)
def shape_of(hessian, kf, kg, rho, straight, is_open):
    """Whether F is CONVEX or BARREN over a box, or UNKNOWN, by the ranges of F_ss, F_tt and |F_st|; up to which motion.

    A motion by m changes them by kf m, kg m and m / rho. A free end may have a minimum where F'' is indefinite.
    """
    ss_low, ss_high, tt_low, tt_high = hessian.ss_low, hessian.ss_high, hessian.tt_low, hessian.tt_high
    st_low, st_high = hessian.st_low, hessian.st_high
    if straight:
        # For two lines F is convex everywhere. Where they are all but parallel, a motion may take its minimum anywhere,
        # and a contact does not follow there.
        sine = math.sqrt(max(1.0 - st_high * st_high, 0.0))
        return CONVEX, max(sine - PARALLEL, 0.0) * rho
    longest = TURNS * rho
    if ss_low > 0.0 and tt_low > 0.0:
        det = ss_low * tt_low - st_high * st_high
        if det > BOX_ROUNDING:
            margin = det / (kf * tt_low + kg * ss_low + (2.0 * st_high + TURNS) / rho)
            return CONVEX, min(margin, min(min(ss_low / (kf + 1e-300), tt_low / (kg + 1e-300)), longest))
    if not is_open:
        if ss_high < 0.0 or tt_high < 0.0:
            return BARREN, min(max(-ss_high / (kf + 1e-300), -tt_high / (kg + 1e-300)), longest)
        det = st_low * st_low - ss_high * tt_high
        if det > BOX_ROUNDING:
            # With the largest change of each entry: (ss + kf m) (tt + kg m) < (st - m / rho)^2.
            return BARREN, min(det / (kf * tt_high + kg * ss_high + kf * kg * longest + 2.0 * st_low / rho), longest)
    return UNKNOWN, 0.0


@kernel(inline=True)
def beyond(slope, hessian, error, rate, h, k):
    """The motion up to which no stationary point is within h and k of the middle; not positive where one may be.

    By F'' at the middle: x = -F''^-1 (F' + e), where e is no longer than `error` in either component, and a motion by m
    adds m times `rate`.
    """
    ss, tt, st = hessian
    det = abs(ss * tt - st * st)
    ss, tt, off = abs(ss), abs(tt), abs(st)
    x = abs(hessian[1] * slope[0] - st * slope[1]) - tt * error[0] - off * error[1] - det * h - BOX_ROUNDING
    y = abs(hessian[0] * slope[1] - st * slope[0]) - off * error[0] - ss * error[1] - det * k - BOX_ROUNDING
    return max(x / (tt * rate[0] + off * rate[1] + 1e-300), y / (off * rate[0] + ss * rate[1] + 1e-300))


@kernel(inline=True)
def beyond_joints(part, low, high, d, sign, slack, least, bend):
    """The least of F_ss (sign -1) or F_tt (1) over a box and just beyond joints at its borders; the largest curvature.

    d, in the axes of the part, multiplies the curvature vectors. The largest curvature is -1 where none jumps.
    """
    sharpest = -1.0
    half = part.half
    for side in range(2):
        at_border = low <= -half if side == 0 else high >= half
        if part.jumps[side] == 1.0 and at_border:
            vector = (part.beyond[side, 0], part.beyond[side, 1], part.beyond[side, 2])
            length = math.sqrt(dot(vector, vector))
            least = min(least, 1.0 + sign * dot(d, vector) - length * slack)
            sharpest = max(max(sharpest, length), bend)
    return least, sharpest


@kernel(inline=True)
def box_of(parts, box, open_ends, reach, rho):
    """Classify a box (`Lengths`) of two parts.

    One whose centerlines are farther apart than `reach` is EMPTY. `open_ends`: whether the box is at the free start or
    end of f, or of g; there a minimum may have any slope >= 0 at a start, <= 0 at an end.

    Returns
    -------
    The least distance of the centerlines over it; what it is; a motion after which that may no longer be so.
    """
    h = 0.5 * (box.to_f - box.from_f)
    k = 0.5 * (box.to_g - box.from_g)
    middle = difference_at(parts, box.from_f + h, box.from_g + k)
    d, f, g = middle.d, middle.tangent_f, middle.tangent_g
    bend_f, bend_g = middle.curvature_f, middle.curvature_g
    part_f, part_g = centerline_part_at(parts.pool, parts.f), centerline_part_at(parts.pool, parts.g)
    kf, kg = part_f.bend, part_g.bend
    turn_f = kf * h
    turn_g = kg * k
    least = segment_distance(d, f, g, h, k) - 0.5 * (turn_f * h + turn_g * k) - BOX_ROUNDING
    if least > reach:
        return least, EMPTY, math.inf
    a = -dot(d, f)
    b = dot(d, g)
    far = math.sqrt(dot(d, d)) + h + k
    lean_f = abs(dot(g, bend_f))
    lean_g = abs(dot(f, bend_g))
    both = turn_f + turn_g
    ss = 1.0 - dot(d, bend_f)
    tt = 1.0 + dot(d, bend_g)
    st = -dot(f, g)
    vary_ss = kf * kf * min(far, abs(a) + (1.0 + kf * far) * h + k) * h + min(kf, lean_f + kf * both) * k
    vary_tt = kg * kg * min(far, abs(b) + h + (1.0 + kg * far) * k) * k + min(kg, lean_g + kg * both) * h
    vary_st = lean_f * h + lean_g * k + 0.5 * both * both
    ss_low, ss_high = ss - vary_ss, ss + vary_ss
    tt_low, tt_high = tt - vary_tt, tt + vary_tt
    st_low, st_high = max(abs(st) - vary_st, 0.0), min(abs(st) + vary_st, 1.0)
    hessian = Hessian(ss_low, ss_high, tt_low, tt_high, st_low, st_high)
    # Where a minimum at a free end may have any slope of one sign, only a slope of the other sign excludes one.
    slope = abs(a) - h * max(ss_high, -ss_low) - k * st_high - BOX_ROUNDING
    if (open_ends.start_f and a > 0.0) or (open_ends.end_f and a < 0.0):
        slope = -1.0
    other = abs(b) - k * max(tt_high, -tt_low) - h * st_high - BOX_ROUNDING
    if (open_ends.start_g and b > 0.0) or (open_ends.end_g and b < 0.0):
        other = -1.0
    slope = max(slope, other)
    sway = 1.0 + far / rho
    is_open = open_ends.start_f or open_ends.end_f or open_ends.start_g or open_ends.end_g
    what, margin = shape_of(hessian, sway * kf, sway * kg, rho, kf == 0.0 and kg == 0.0, is_open)
    if what == CONVEX:
        margin = min(margin, convex_beyond(parts, box, d, hessian, sway, rho))
    slope /= sway
    if not is_open:
        first = (sway + sway * kf * h + k / rho, sway + sway * kg * k + h / rho)
        error = (vary_ss * h + vary_st * k, vary_st * h + vary_tt * k)
        slope = max(slope, beyond((a, b), (ss, tt, st), error, first, h, k))
    if slope > 0.0:
        # A minimum that enters the box is known in the box it comes from; none appears while F keeps its shape.
        return least, EMPTY, max(slope, margin)
    return least, what, margin


@kernel(inline=True)
def convex_beyond(parts, box, d, hessian, sway, rho):
    """The motion up to which F is convex just beyond a box over which it is convex; infinite without joints.

    Where the curvature jumps at a border of the box, a minimum may appear there and enter it if F is not convex beyond.
    """
    part_f, part_g = centerline_part_at(parts.pool, parts.f), centerline_part_at(parts.pool, parts.g)
    slack = 0.5 * (box.to_f - box.from_f) + 0.5 * (box.to_g - box.from_g)
    ss_low, bend_f = beyond_joints(part_f, box.from_f, box.to_f, d, -1.0, slack, hessian.ss_low, part_f.bend)
    d_g = matvec_t(parts.pose.rotation, d)
    tt_low, bend_g = beyond_joints(part_g, box.from_g, box.to_g, d_g, 1.0, slack, hessian.tt_low, part_g.bend)
    if not (bend_f >= 0.0 or bend_g >= 0.0):
        return math.inf
    wider = Hessian(ss_low, hessian.ss_high, tt_low, hessian.tt_high, hessian.st_low, hessian.st_high)
    bend_f, bend_g = max(bend_f, part_f.bend), max(bend_g, part_g.bend)
    over, least_margin = shape_of(wider, sway * bend_f, sway * bend_g, rho, False, True)
    return least_margin if over == CONVEX else 0.0
