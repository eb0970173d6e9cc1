"""Minima of the distance of two centerlines: of a box where F is convex, and of a thin one
(`proximity/manager/centerlines/box.py`).

Where F may have two minima beside each other, one centerline is followed by feet on the other one: at t(s) with F_t = 0
and F_tt > 0,

    phi(s) = F(s, t(s)),   phi' = F_s,   phi'' = F_ss - F_st^2 / F_tt,

and minima are where phi' goes from below zero to above. However level the valley is, that is a sign.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.geometry.vec import dot
from assembly.proximity.manager.centerlines.box import FreeEnds, Lengths, difference_at

# Steps of Newton's method, of feet, and until an interval cannot be halved any more.
STEPS, PROJECTIONS, HALVINGS = 30, 12, 60
# Slopes of the distance below this count as zero at the borders of a box: the next box has the same point. Those of F
# below the second are rounding.
LEVEL, STILL = 1e-10, 1e-16
# A valley with no more slope than this at both ends is level: rounding tells where it has minima.
NOISE = 1e-14
# A foot is one where the last step toward it is shorter than this.
SHORT = 1e-12
# Two PosedParts of which one is followed: side 0 if that is f, 1 g.
Course = namedtuple("Course", "parts side")
# Slopes of F on both centerlines and its second derivatives: x along the followed one, y along the other one.
Slopes = namedtuple("Slopes", "x y xx yy xy")
# Room for the minima of a thin box: both ends, and three in each of the pieces between these and two kinks.
MINIMA = 11


@kernel(inline=True)
def is_least(slope, far, at_ends):
    """Whether a slope of F is that of a minimum: zero, or upward from a free end where it starts, or is reached.

    F is the square of the distance, which is `far`: its own slope is as many times less.
    """
    return abs(slope) <= max(LEVEL * far, STILL) or (at_ends[0] and slope > 0.0) or (at_ends[1] and slope < 0.0)


@kernel(inline=True)
def is_held(slope, x, low, high, far):
    """Whether a slope of F leads nowhere: it is zero, or leads out of an interval."""
    return abs(slope) <= max(LEVEL * far, STILL) or (x <= low and slope > 0.0) or (x >= high and slope < 0.0)


@kernel(inner=True)
def convex_minimum(parts, box, open_ends, s, t):
    """The minimum of F over a box where it is convex, from (s, t): whether it is one of the curves; s, t; whether it is
    the minimum over the box.

    It is none of the curves where the box alone ends it. Along a valley that is all but level steps may end before its
    bottom.
    """
    last = math.inf
    for _ in range(STEPS):
        at = difference_at(parts, s, t)
        d, f, g = at.d, at.tangent_f, at.tangent_g
        a = -dot(d, f)
        b = dot(d, g)
        ss = 1.0 - dot(d, at.curvature_f)
        tt = 1.0 + dot(d, at.curvature_g)
        st = -dot(f, g)
        hold_s = (s <= box.from_f and a > 0.0) or (s >= box.to_f and a < 0.0)
        hold_t = (t <= box.from_g and b > 0.0) or (t >= box.to_g and b < 0.0)
        if (hold_s or abs(a) <= STILL) and (hold_t or abs(b) <= STILL):
            # Along a valley that is all but level steps do not end.
            break
        if hold_s or hold_t:
            x = 0.0 if hold_s else -a / ss
            y = 0.0 if hold_t else -b / tt
        else:
            det = ss * tt - st * st
            # Lines that are parallel as far as rounding tells: across the valley only.
            i = 1.0 / det if det > 1e-14 else 0.0
            x = i * (st * b - tt * a) if i > 0.0 else 0.5 * (-a)
            y = i * (st * a - ss * b) if i > 0.0 else 0.5 * (-b)
        s_new = min(max(s + x, box.from_f), box.to_f)
        t_new = min(max(t + y, box.from_g), box.to_g)
        size = abs(s_new - s) + abs(t_new - t)
        s = s_new
        t = t_new
        if size <= 1e-15 or (size < 1e-9 and size >= 0.5 * last):
            break
        last = size
    at = difference_at(parts, s, t)
    d = at.d
    far = math.sqrt(dot(d, d))
    ends_f = (open_ends.start_f and s <= box.from_f, open_ends.end_f and s >= box.to_f)
    ends_g = (open_ends.start_g and t <= box.from_g, open_ends.end_g and t >= box.to_g)
    a, b = -dot(d, at.tangent_f), dot(d, at.tangent_g)
    ends = is_held(a, s, box.from_f, box.to_f, far) and is_held(b, t, box.from_g, box.to_g, far)
    return is_least(a, far, ends_f) and is_least(b, far, ends_g), s, t, ends


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
    return Slopes(x=along[0], y=across[0], xx=along[1], yy=across[1], xy=-dot(f, g))


@kernel(inner=True)
def projection_on_centerline(course, held, x, y):
    """The foot of x on the other centerline, from y, or y itself if it is `held`: phi', phi'', the foot, whether it is
    one.

    There is none where F is not convex along the other centerline.
    """
    at = slopes_of(course, x, y)
    if held:
        return at.x, at.xx, y, True
    step = math.inf
    for _ in range(PROJECTIONS):
        if not at.yy > 0.0:
            return at.x, at.xx, y, False
        step = -at.y / at.yy
        y += step
        at = slopes_of(course, x, y)
        if abs(step) <= 1e-15:
            break
    found = at.yy > 0.0 and abs(step) <= SHORT
    return at.x, at.xx - at.xy * at.xy / at.yy if found else at.xx, y, found


@kernel(inner=True)
def held_at(course, own, x):
    """Which end of the other centerline's piece is nearest to x: -1 or 1; 0 if it is a point between."""
    if slopes_of(course, x, own[0]).y >= 0.0:
        return -1
    return 1 if slopes_of(course, x, own[1]).y <= 0.0 else 0


@kernel(inline=True)
def or_middle(left, right, x):
    """x where it is inside of an interval, else the interval's middle."""
    return x if left < x < right else 0.5 * (left + right)


@kernel(inner=True)
def kink_at(course, end, left, right):
    """Where between two places the foot comes to an end of the other centerline's piece: F_y = 0 there."""
    rises = slopes_of(course, right, end).y > 0.0
    x = 0.5 * (left + right)
    for _ in range(HALVINGS):
        at = slopes_of(course, x, end)
        b, xy = at.y, at.xy
        if abs(b) <= 1e-15 * abs(xy):
            break
        if (b > 0.0) == rises:
            right = x
        else:
            left = x
        x = or_middle(left, right, x - b / xy if xy != 0.0 else left)
        if right - left <= 1e-15:
            break
    return x


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
def rise_of(course, held, left, right, y):
    """Where phi' rises through zero between two places, the foot there and whether it is one."""
    x = 0.5 * (left + right)
    for _ in range(HALVINGS):
        slope, bend, y, _found = projection_on_centerline(course, held, x, y)
        if abs(slope) <= 1e-15 * bend:
            break
        if slope <= 0.0:
            left = x
        else:
            right = x
        x = or_middle(left, right, x - slope / bend if bend > 0.0 else left)
        if right - left <= 1e-15:
            break
    _slope, _bend, y, found = projection_on_centerline(course, held, x, y)
    return x, y, found


@kernel(inner=True)
def piece_minima(course, held, left, right, y, ends, places, count):
    """Minima of phi between two places all of whose feet are `held` at y, or are none of them, found from y on.

    `ends`: whether the followed centerline has a free end at either place. Returns how many `places` there are, the
    larger slope at both ends, and whether there are feet.
    """
    side = course.side
    a, bend_a, y_a, found_a = projection_on_centerline(course, held, left, y)
    b, bend_b, y_b, found_b = projection_on_centerline(course, held, right, y)
    certain = found_a and found_b
    width = right - left
    low, high = turns_of(width, a, b, bend_a, bend_b)
    if ends[0] and a > 0.0 and found_a:
        places[count, side], places[count, 1 - side] = left, y_a
        count += 1
    x, slope = left, a
    for step in range(3):
        part = low if step == 0 else (high if step == 1 else 1.0)
        new, rises = right, b
        if part < 1.0:
            new = left + part * width
            rises = projection_on_centerline(course, held, new, y)[0]
        if new > x and slope <= 0.0 <= rises:
            there, projection, found = rise_of(course, held, x, new, y)
            certain = certain and found
            if found:
                places[count, side], places[count, 1 - side] = there, projection
                count += 1
        x, slope = new, rises
    if ends[1] and b < 0.0 and found_b:
        places[count, side], places[count, 1 - side] = right, y_b
        count += 1
    return count, max(abs(a), abs(b)), certain


@kernel(inner=True)
def near_singular_minima(parts, box, open_ends, places):
    """Minima of phi over a thin box: s and t of each into `places`, (MINIMA, 2).

    That centerline is followed across which F is curved the most. Where feet come to a free end phi' has a kink.
    Between kinks it may go through zero and back where it turns: over a thin box that is where the cubic does that has
    its values and slopes at both ends.

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
    # Feet may go on beyond the box along the same piece, but not beyond a free end.
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
    # What is beyond the box another one has.
    slack = 1e-6 * k
    kept = 0
    for m in range(count):
        if other_left - slack <= places[m, 1 - side] <= other_right + slack:
            places[kept, 0], places[kept, 1] = places[m, 0], places[m, 1]
            kept += 1
    return kept, steepest <= NOISE, certain
