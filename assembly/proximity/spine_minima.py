"""Minima of the distance of two spines: of a box where F is convex, and of a thin one (`spine_box.py`).

Where F may have two minima beside each other, one spine is followed by feet on the other one: at t(s) with F_t = 0,

    phi(s) = F(s, t(s)),   phi' = F_s,   phi'' = F_ss - F_st^2 / F_tt,

and minima are where phi' goes from below zero to above. However level the valley is, that is a sign.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.vec import dot
from assembly.proximity.spine_box import apart

# Steps of Newton's method, of feet, and until an interval cannot be halved any more.
STEPS, FEET, HALVINGS = 30, 12, 60
# Slopes of the distance below this count as zero at the borders of a box: the next box has the same point. Those of F
# below the second are rounding.
LEVEL, STILL = 1e-10, 1e-16
# A valley with no more slope than this at both ends is level: rounding tells where it has minima.
NOISE = 1e-14


@kernel(inline=True)
def is_least(slope, far, at_ends):
    """Whether a slope of F is that of a minimum: zero, or upward from a free end where it starts, or is reached.

    F is the square of the distance, which is `far`: its own slope is as many times less.
    """
    return (
        abs(slope) <= max(LEVEL * far, STILL) or (at_ends[0] and slope > 0.0) or (at_ends[1] and slope < 0.0)
    )


@kernel(inner=True)
def convex_minimum(pool, o, p, turn, shift, box, open_ends, s, t):
    """The minimum of F over a box where it is convex, from (s, t): whether it is one of the curves; s, t.

    It is none where the box alone ends it.
    """
    last = math.inf
    for _ in range(STEPS):
        d, f, bend_f, g, bend_g = apart(pool, o, p, turn, shift, s, t)
        a = -dot(d, f)
        b = dot(d, g)
        ss = 1.0 - dot(d, bend_f)
        tt = 1.0 + dot(d, bend_g)
        st = -dot(f, g)
        hold_s = (s <= box[0] and a > 0.0) or (s >= box[1] and a < 0.0)
        hold_t = (t <= box[2] and b > 0.0) or (t >= box[3] and b < 0.0)
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
        s_new = min(max(s + x, box[0]), box[1])
        t_new = min(max(t + y, box[2]), box[3])
        size = abs(s_new - s) + abs(t_new - t)
        s = s_new
        t = t_new
        if size <= 1e-15 or (size < 1e-9 and size >= 0.5 * last):
            break
        last = size
    d, f, _bend_f, g, _bend_g = apart(pool, o, p, turn, shift, s, t)
    far = math.sqrt(dot(d, d))
    ends_f = (open_ends[0] and s <= box[0], open_ends[1] and s >= box[1])
    ends_g = (open_ends[2] and t <= box[2], open_ends[3] and t >= box[3])
    return is_least(-dot(d, f), far, ends_f) and is_least(dot(d, g), far, ends_g), s, t


@kernel(inner=True)
def slope_at(pool, o, p, turn, shift, low, high, s, t):
    """phi' and phi'' at s, and the foot, from t, within low and high."""
    d, f, bend_f, g, bend_g = apart(pool, o, p, turn, shift, s, t)
    tt = 1.0 + dot(d, bend_g)
    for _ in range(FEET):
        b = dot(d, g)
        if not tt > 0.0:
            break
        t_new = min(max(t - b / tt, low), high)
        step = abs(t_new - t)
        t = t_new
        d, f, bend_f, g, bend_g = apart(pool, o, p, turn, shift, s, t)
        tt = 1.0 + dot(d, bend_g)
        if step <= 1e-15:
            break
    st = dot(f, g)
    bend = 1.0 - dot(d, bend_f)
    free = low < t < high
    return -dot(d, f), bend - st * st / tt if free and tt > 0.0 else bend, t


@kernel(inner=True)
def valley_minima(pool, o, p, turn, shift, box, open_ends):
    """Minima of phi over a box: how many (two at most), s and t of each; whether the valley is level."""
    k = 0.5 * (box[3] - box[2])
    # Feet may go on beyond the box along the same piece, but not beyond a free end.
    low = box[2] if open_ends[2] else box[2] - k
    high = box[3] if open_ends[3] else box[3] + k
    middle = box[2] + k
    a, bend_a, t_a = slope_at(pool, o, p, turn, shift, low, high, box[0], middle)
    b, bend_b, t_b = slope_at(pool, o, p, turn, shift, low, high, box[1], middle)
    count = 0
    first = (0.0, 0.0)
    other = (0.0, 0.0)
    if open_ends[0] and a > 0.0:
        first = (box[0], t_a)
        count = 1
    if open_ends[1] and b < 0.0:
        if count == 1:
            other = (box[1], t_b)
        else:
            first = (box[1], t_b)
        count += 1
    left, right = box[0], box[1]
    crosses = a <= 0.0 <= b
    if not crosses and (a > 0.0) == (b > 0.0) and bend_a * bend_b < 0.0 and (bend_a < 0.0) == (a > 0.0):
        # phi' turns around in between: there it may be beyond zero.
        lo, hi = left, right
        for _ in range(HALVINGS):
            s = 0.5 * (lo + hi)
            x, bend, _t = slope_at(pool, o, p, turn, shift, low, high, s, middle)
            if (x <= 0.0) if a > 0.0 else (x >= 0.0):
                crosses = True
                if a > 0.0:
                    left = s
                else:
                    right = s
                break
            if (bend < 0.0) == (bend_a < 0.0):
                lo = s
            else:
                hi = s
            if hi - lo <= 1e-12:
                break
    if crosses and count < 2:
        s = 0.5 * (left + right)
        t = middle
        for _ in range(HALVINGS):
            x, bend, t = slope_at(pool, o, p, turn, shift, low, high, s, t)
            if x <= 0.0:
                left = s
            else:
                right = s
            new = s - x / bend if bend > 0.0 else 0.5 * (left + right)
            if not left < new < right:
                new = 0.5 * (left + right)
            step = abs(new - s)
            s = new
            if step <= 1e-15 or x == 0.0:
                break
        _x, _bend, t = slope_at(pool, o, p, turn, shift, low, high, s, t)
        if count == 1:
            other = (s, t)
        else:
            first = (s, t)
        count += 1
    slack = 1e-6 * k
    if count > 1 and not box[2] - slack <= other[1] <= box[3] + slack:
        count = 1
    if count > 0 and not box[2] - slack <= first[1] <= box[3] + slack:
        first = other
        count -= 1
    return count, first, other, max(abs(a), abs(b)) <= NOISE
