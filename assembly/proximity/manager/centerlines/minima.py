"""Minima of the distance of two centerlines: of a box where F is convex, and of a thin one
(`proximity/manager/centerlines/box.py`).

Where F may have two minima beside each other, one centerline is followed by projections on the other one: at t(s) with
F_t = 0 and F_tt > 0,

    phi(s) = F(s, t(s)),   phi' = F_s,   phi'' = F_ss - F_st^2 / F_tt,

and minima are where phi' goes from below zero to above. That is a change of sign, however level the valley is.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._newton import bracketed_newton, damped_newton
from assembly.geometry.vec import dot
from assembly.proximity.manager.centerlines.box import FreeEnds, Lengths, difference_at

# Steps of Newton's method over a box, and to a projection.
STEPS, PROJECTIONS = 30, 13
# Slopes of the distance below this count as zero at the borders of a box: the next box has the same point. Those of F
# below the second are rounding.
LEVEL, ROUNDED_SLOPE = 1e-10, 1e-16
# A valley with no more slope than this at both ends is level: there rounding decides where minima are.
NOISE = 1e-14
# A projection has converged where the next step is shorter than the first; a step that lowers F by less than the
# second, relative to F, is rounding.
SHORT, PROMISE = 1e-12, 1e-15
# Two PosedParts of which one is followed: side 0 if that is f, 1 g.
Course = namedtuple("Course", "parts side")
# F, its slopes on both centerlines and its second derivatives: x along the followed one, y along the other one.
Slopes = namedtuple("Slopes", "merit x y xx yy xy")
BoxQuery = namedtuple("BoxQuery", "course box")
# Queries: for the projection of x on the other centerline; for the projections of a course, found from y on or `held`
# at y; for where the projections of a course reach an `end` of the other centerline (sense: -1 where F_y falls there).
FootQuery = namedtuple("FootQuery", "course x")
CourseQuery = namedtuple("CourseQuery", "course held y")
KinkQuery = namedtuple("KinkQuery", "course end sense")
# phi' and phi'', the projection, and whether it is one. F_y at an end and its rate.
Projected = namedtuple("Projected", "slope curvature foot found")
SlopeAtEnd = namedtuple("SlopeAtEnd", "slope curvature")
# Memory for the minima of a thin box: both ends, and three in each of the pieces between these and two kinks.
MINIMA = 11


@kernel(inline=True)
def is_least(slope, far, at_ends):
    """Whether a slope of F is that of a minimum: zero, positive at a free start, or negative at a free end.

    `far` is the distance: the slope of F is that many times the slope of the distance.
    """
    return abs(slope) <= max(LEVEL * far, ROUNDED_SLOPE) or (at_ends[0] and slope > 0.0) or (at_ends[1] and slope < 0.0)


@kernel(inline=True)
def is_held(slope, x, low, high, far):
    """Whether a slope of F leads nowhere: it is zero, or leads out of an interval."""
    return abs(slope) <= max(LEVEL * far, ROUNDED_SLOPE) or (x <= low and slope > 0.0) or (x >= high and slope < 0.0)


@kernel(inline=True)
def slopes_of(course, x, y):
    """The Slopes at x along the followed centerline and y along the other one."""
    side = course.side
    s, t = (x, y) if side == 0 else (y, x)
    at = difference_at(course.parts, s, t)
    d, f, g = at.d, at.tangent_f, at.tangent_g
    along = (-dot(d, f), 1.0 - dot(d, at.curvature_f))
    across = (dot(d, g), 1.0 + dot(d, at.curvature_g))
    if side == 1:
        along, across = across, along
    return Slopes(merit=0.5 * dot(d, d), x=along[0], y=across[0], xx=along[1], yy=across[1], xy=-dot(f, g))


@kernel(inline=True)
def _slopes_in_box(query, place):
    return slopes_of(query.course, place[0], place[1])


@kernel(inline=True)
def _step_in_box(query, place, at):
    """Newton's step over a box where F is convex, lengths held at the ends that the slope leads out of."""
    box = query.box
    s, t = place
    a, b, ss, tt, st = at.x, at.y, at.xx, at.yy, at.xy
    hold_s = (s <= box.from_f and a > 0.0) or (s >= box.to_f and a < 0.0)
    hold_t = (t <= box.from_g and b > 0.0) or (t >= box.to_g and b < 0.0)
    if hold_s or hold_t:
        x = 0.0 if hold_s else -a / ss
        y = 0.0 if hold_t else -b / tt
    else:
        det = ss * tt - st * st
        # Lines that are parallel to rounding: the step goes across the valley only.
        i = 1.0 / det if det > 1e-14 else 0.0
        x = i * (st * b - tt * a) if i > 0.0 else 0.5 * (-a)
        y = i * (st * a - ss * b) if i > 0.0 else 0.5 * (-b)
    return (x, y), not a * x + b * y < -PROMISE * at.merit


@kernel(inline=True)
def _move_in_box(query, place, part, step):
    box = query.box
    s = min(max(place[0] + part * step[0], box.from_f), box.to_f)
    return s, min(max(place[1] + part * step[1], box.from_g), box.to_g)


_least_in_box = kernel(inner=True)(damped_newton(_slopes_in_box, _step_in_box, _move_in_box, steps=STEPS))


@kernel(inner=True)
def convex_minimum(parts, box, open_ends, s, t):
    """The minimum of F over a box where F is convex, by Newton's method from (s, t).

    Returns whether it is a minimum of the curves, not only of the box; s, t; and whether it is the minimum over the
    box: along a valley that is all but level, steps may end before its bottom.
    """
    query = BoxQuery(Course(parts, 0), box)
    s, t = _least_in_box(query, (s, t))[2]
    at = slopes_of(query.course, s, t)
    far = math.sqrt(2.0 * at.merit)
    ends_f = (open_ends.start_f and s <= box.from_f, open_ends.end_f and s >= box.to_f)
    ends_g = (open_ends.start_g and t <= box.from_g, open_ends.end_g and t >= box.to_g)
    ends = is_held(at.x, s, box.from_f, box.to_f, far) and is_held(at.y, t, box.from_g, box.to_g, far)
    return is_least(at.x, far, ends_f) and is_least(at.y, far, ends_g), s, t, ends


@kernel(inline=True)
def _slopes_across(query, y):
    return slopes_of(query.course, query.x, y)


@kernel(inline=True)
def _step_across(query, y, at):
    """Newton's step to a projection; there is none from where F is not convex along the other centerline."""
    step = -at.y / at.yy if at.yy > 0.0 else 0.0
    return step, not at.y * step < -PROMISE * at.merit


@kernel(inline=True)
def _move_across(query, y, part, step):
    return y + part * step


_foot = kernel(inner=True)(damped_newton(_slopes_across, _step_across, _move_across, steps=PROJECTIONS))


@kernel(inner=True)
def projection_at(query, x):
    """The `Projected` of x: its projection on the other centerline."""
    y = query.y
    if not query.held:
        y = _foot(FootQuery(query.course, x), y)[2]
    at = slopes_of(query.course, x, y)
    if query.held:
        return Projected(at.x, at.xx, y, True)
    found = at.yy > 0.0 and abs(at.y) <= SHORT * at.yy
    return Projected(at.x, at.xx - at.xy * at.xy / at.yy if found else at.xx, y, found)


@kernel(inline=True)
def _slope_at_end(query, x):
    at = slopes_of(query.course, x, query.end)
    return SlopeAtEnd(query.sense * at.y, query.sense * at.xy)


_rise = kernel(inner=True)(bracketed_newton(projection_at, inside=True, resolution=1e-15))
_kink = kernel(inner=True)(bracketed_newton(_slope_at_end, inside=True, resolution=1e-15))


@kernel(inner=True)
def held_at(course, own, x):
    """Which end of the other centerline's piece is nearest to x: -1 or 1; 0 if it is a point between."""
    if slopes_of(course, x, own[0]).y >= 0.0:
        return -1
    return 1 if slopes_of(course, x, own[1]).y <= 0.0 else 0


@kernel(inner=True)
def kink_at(course, end, left, right):
    """Where between two places the projection comes to an end of the other centerline's piece: F_y = 0 there."""
    sense = 1.0 if slopes_of(course, right, end).y > 0.0 else -1.0
    return _kink(KinkQuery(course, end, sense), left, right, 0.5 * (left + right))[0]


@kernel(inline=True)
def turns_of(width, a, b, bend_a, bend_b):
    """Where the cubic with these values and slopes at both ends turns, in parts of the width: two of 0 to 1, in order.

    One that does not turn, or only beyond the ends, has them at an end.
    """
    da, db = width * bend_a, width * bend_b
    # c(x) = a + da x + second x^2 + third x^3.
    second = 3.0 * (b - a) - 2.0 * da - db
    third = 2.0 * (a - b) + da + db
    square = second * second - 3.0 * third * da
    if not square > 0.0:
        return 0.0, 1.0
    # The roots of da + 2 second x + 3 third x^2, without cancellation.
    q = -(second + math.copysign(math.sqrt(square), second))
    one = min(max(q / (3.0 * third), 0.0), 1.0) if third != 0.0 else 1.0
    two = min(max(da / q, 0.0), 1.0) if q != 0.0 else 0.0
    return min(one, two), max(one, two)


@kernel(inner=True)
def piece_minima(course, held, left, right, y, ends, places, count):
    """Minima of phi between two places all of whose projections are `held` at y, or are none of them, found from y on.

    `ends`: whether the followed centerline has a free end at either place. Returns how many `places` there are, the
    larger slope at both ends, and whether there are projections.
    """
    side = course.side
    query = CourseQuery(course, held, y)
    a, b = projection_at(query, left), projection_at(query, right)
    certain = a.found and b.found
    width = right - left
    low, high = turns_of(width, a.slope, b.slope, a.curvature, b.curvature)
    if ends[0] and a.slope > 0.0 and a.found:
        places[count, side], places[count, 1 - side] = left, a.foot
        count += 1
    x, slope = left, a.slope
    for step in range(3):
        part = low if step == 0 else (high if step == 1 else 1.0)
        new, rises = right, b.slope
        if part < 1.0:
            new = left + part * width
            rises = projection_at(query, new).slope
        if new > x and slope <= 0.0 <= rises:
            # Where phi' rises through zero.
            there, at = _rise(query, x, new, 0.5 * (x + new))
            certain = certain and at.found
            if at.found:
                places[count, side], places[count, 1 - side] = there, at.foot
                count += 1
        x, slope = new, rises
    if ends[1] and b.slope < 0.0 and b.found:
        places[count, side], places[count, 1 - side] = right, b.foot
        count += 1
    return count, max(abs(a.slope), abs(b.slope)), certain


@kernel(inner=True)
def near_singular_minima(parts, box, open_ends, places):
    """Minima of phi over a thin box: s and t of each into `places`, (MINIMA, 2).

    The centerline is followed for which F is curved the most along the other one. Where projections reach a free end
    phi' has a kink. Between kinks phi' may go through zero and back where it turns: over a thin box, where the cubic
    with its values and slopes at both ends turns.

    Returns
    -------
    How many there are; whether the valley is level; whether these are all for certain.
    """
    middle = slopes_of(Course(parts, 0), 0.5 * (box.from_f + box.to_f), 0.5 * (box.from_g + box.to_g))
    side = 0 if middle.yy >= middle.xx else 1
    course = Course(parts, side)
    # The followed one first.
    own_box = box if side == 0 else Lengths(box.from_g, box.to_g, box.from_f, box.to_f)
    ends = open_ends
    if side == 1:
        ends = FreeEnds(open_ends.start_g, open_ends.end_g, open_ends.start_f, open_ends.end_f)
    left, right = own_box.from_f, own_box.to_f
    other_left, other_right = own_box.from_g, own_box.to_g
    k = 0.5 * (other_right - other_left)
    # Projections may go on beyond the box along the same piece, but not beyond a free end.
    own = (other_left if ends.start_g else other_left - k, other_right if ends.end_g else other_right + k)
    begin = held_at(course, own, left)
    end = held_at(course, own, right)
    count = 0
    steepest = 0.0
    certain = True
    x = left
    state = begin
    way = 1 if end > begin else -1
    while True:
        new = right
        if state != end:
            # From the one end of the piece inward, or outward to the other one.
            at = own[0] if min(state, state + way) < 0 else own[1]
            new = kink_at(course, at, x, right)
        free = (state == 0) or (ends.start_g if state < 0 else ends.end_g)
        if free:
            y = 0.5 * (own[0] + own[1]) if state == 0 else (own[0] if state < 0 else own[1])
            here = (ends.start_f and x == left, ends.end_f and state == end)
            count, slope, found = piece_minima(course, state != 0, x, new, y, here, places, count)
            steepest = max(steepest, slope)
            certain = certain and found
        if state == end:
            break
        x = new
        state += way
    # Minima beyond this box belong to another box.
    slack = 1e-6 * k
    kept = 0
    for m in range(count):
        if other_left - slack <= places[m, 1 - side] <= other_right + slack:
            places[kept, 0], places[kept, 1] = places[m, 0], places[m, 1]
            kept += 1
    return kept, steepest <= NOISE, certain
