"""Where two plane curves meet or touch: for `touches`.

Along a stretch of one curve, the signed distance g(s) from the other one is asked for: curves cross where g changes its
sign and touch where |g| has a minimum next to zero. Newton's method on both parameters at once would fail there, as
tangents are parallel where curves touch. Ends are looked at by themselves, because g is not smooth beyond them.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.splines.evaluate import curve_lanes, xyz

__all__ = ["MOST", "Couple", "Traced", "find_meetings", "gap_between", "nearest_place"]

_NEWTON = 30
# Curves that meet more often lie on each other; whether loops still touch after that is looked at again.
MOST = 32
# Places of a chord's arc at which the gap is first asked for.
_PLACES = 9
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
# Steps that halve a bracket to its last digit, or make it smaller by the golden ratio.
_HALVINGS = 60
# Most steps of the secant method.
_SECANTS = 12

# A curve, and a polygon on it. table, pool: as `NurbsCurve.packed` has them; t, points: of its corners; low, high: of
# boxes around the arcs of its chords.
Traced = namedtuple("Traced", "table pool t points low high")
# Two curves, the second one moved, what is nearer than `nearest` meets, and whether both are the same.
Couple = namedtuple("Couple", "first second move nearest own")
# A gap: the signed distance, positive to the left of the other curve, the parameter of the nearest point on that curve,
# whether it is inside the interval, and the sine of the angle between both tangents.
Gap = namedtuple("Gap", "distance t inside turn")


@kernel(inline=True)
def _at(curve, t):
    """The point of a curve at a parameter, and its first two derivatives."""
    a, d, h = curve_lanes(Store(curve.table, curve.pool), 0, t)
    x, y, _z = xyz(a)
    dx, dy, _z = xyz(d)
    ddx, ddy, _z = xyz(h)
    return (x, y), (dx, dy), (ddx, ddy)


@kernel(inline=True)
def _first_from(rising, least):
    """Number of the first of rising values that is not less than one."""
    low, high = 0, rising.size
    while low < high:
        middle = (low + high) // 2
        if rising[middle] < least:
            low = middle + 1
        else:
            high = middle
    return low


@kernel(inner=True)
def nearest_place(curve, x, y, interval):
    """Parameter and distance of the nearest point in a part of a curve: Newton's method from the polygon."""
    low, high = interval
    t = 0.5 * (low + high)
    least = np.inf
    for k in range(_first_from(curve.t, low), curve.t.size):
        if curve.t[k] > high:
            break
        square = (curve.points[k, 0] - x) ** 2 + (curve.points[k, 1] - y) ** 2
        if square < least:
            least = square
            t = curve.t[k]
    for _ in range(_NEWTON):
        place, first, second = _at(curve, t)
        off_x, off_y = place[0] - x, place[1] - y
        slope = off_x * first[0] + off_y * first[1]
        speed = first[0] * first[0] + first[1] * first[1]
        bend = speed + off_x * second[0] + off_y * second[1]
        if bend <= 0.0:
            bend = speed
        if bend <= 0.0:
            break
        new = min(max(t - slope / bend, low), high)
        small = abs(new - t) <= 1e-15 * (abs(t) + high - low)
        t = new
        if small:
            break
    place, _first, _second = _at(curve, t)
    return t, np.sqrt((place[0] - x) ** 2 + (place[1] - y) ** 2)


@kernel(inner=True)
def gap_between(couple, s, interval):
    """The Gap from the point at s of the first curve to an interval of the second one."""
    second = couple.second
    point, along, _bend = _at(couple.first, s)
    x, y = point[0] - couple.move[0], point[1] - couple.move[1]
    t, distance = nearest_place(second, x, y, interval)
    place, way, _bend = _at(second, t)
    side = way[0] * (y - place[1]) - way[1] * (x - place[0])
    width = 1e-12 * (interval[1] - interval[0])
    lengths = np.sqrt(along[0] ** 2 + along[1] ** 2) * np.sqrt(way[0] ** 2 + way[1] ** 2)
    turn = (along[0] * way[1] - along[1] * way[0]) / max(lengths, 1e-300)
    inside = interval[0] + width < t < interval[1] - width
    return Gap(distance if side >= 0.0 else -distance, t, inside, turn)


@kernel(inner=True, exact=True)
def _crossed(couple, low, high, interval):
    """Parameter of the first curve between two others at which the gap has different signs, by halving."""
    at_low = gap_between(couple, low, interval).distance
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if gap_between(couple, middle, interval).distance * at_low > 0.0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@kernel(inner=True, exact=True)
def _parallel(couple, s, reach, interval):
    """The place near one at which tangents are parallel, by secants: a least distance tells half of the digits."""
    t = couple.first.t
    begin, end = t[0], t[t.size - 1]
    last, at = min(max(s - 1e-4 * reach, begin), end), s
    before, here = gap_between(couple, last, interval).turn, gap_between(couple, at, interval).turn
    at_start = here
    for _ in range(_SECANTS):
        if here == before or abs(here) < 1e-15:
            break
        new = min(max(at - here * (at - last) / (here - before), begin), end)
        last, before = at, here
        at, here = new, gap_between(couple, new, interval).turn
    return at if abs(at - s) <= reach and abs(here) <= abs(at_start) else s


@kernel(inner=True, exact=True)
def _least(couple, low, high, interval):
    """Parameter of the first curve of the least distance, by golden sections."""
    t = couple.first.t
    extent = t[t.size - 1] - t[0]
    a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_a, at_b = abs(gap_between(couple, a, interval).distance), abs(gap_between(couple, b, interval).distance)
    for _ in range(_HALVINGS):
        if at_a <= at_b:
            high, b, at_b = b, a, at_a
            a = high - _GOLDEN * (high - low)
            at_a = abs(gap_between(couple, a, interval).distance)
        else:
            low, a, at_a = a, b, at_b
            b = low + _GOLDEN * (high - low)
            at_b = abs(gap_between(couple, b, interval).distance)
        if min(at_a, at_b) > 100.0 * couple.nearest and high - low < 1e-3 * extent:
            break
    return _parallel(couple, 0.5 * (low + high), 0.02 * extent, interval)


@kernel(inline=True)
def _put(couple, s, interval, out, count):
    """Note a place if the curves meet there; the number of places."""
    gap = gap_between(couple, s, interval)
    if abs(gap.distance) <= couple.nearest:
        out[count, 0], out[count, 1] = s, gap.t
        count += 1
    return count


@kernel(inner=True, exact=True)
def _along(couple, chord, run, out, count):
    """Note meetings of a chord's arc with a run of chords of the other curve; the number of places."""
    first, second = couple.first.t, couple.second.t
    low, high = first[chord], first[chord + 1]
    span = second[run[1] + 1] - second[run[0]]
    begin, end = second[0], second[second.size - 1]
    interval = (max(second[run[0]] - 0.1 * span, begin), min(second[run[1] + 1] + 0.1 * span, end))
    step = (high - low) / (_PLACES - 1)
    last = _PLACES - 1
    before = here = gap_between(couple, low, interval)
    for k in range(last + 1):
        at, behind = low + k * step, low + max(k - 1, 0) * step
        ahead = high if k + 1 >= last else low + (k + 1) * step
        beyond = gap_between(couple, ahead, interval) if k < last else here
        if k < last and here.inside and beyond.inside and here.distance * beyond.distance < 0.0:
            count = _put(couple, _crossed(couple, at, ahead, interval), interval, out, count)
        if abs(here.distance) <= min(abs(before.distance), abs(beyond.distance)):
            count = _put(couple, _least(couple, behind, ahead, interval), interval, out, count)
        before, here = here, beyond
    return count


@kernel(inner=True)
def _at_end(couple, k, turned, out, count):
    """Note where end k of the first curve, of the second one if turned, meets the other one; the number of places."""
    here, there, sign = couple.first, couple.second, -1.0
    if turned:
        here, there, sign = couple.second, couple.first, 1.0
    corner = k * (here.t.size - 1)
    end, low, high = here.t[corner], there.t[0], there.t[there.t.size - 1]
    if couple.own:
        # Of one curve, beside the end itself.
        away = 0.02 * (high - low)
        low, high = (low, end - away) if k else (end + away, high)
    x, y = here.points[corner, 0] + sign * couple.move[0], here.points[corner, 1] + sign * couple.move[1]
    t, distance = nearest_place(there, x, y, (low, high))
    if distance <= couple.nearest:
        out[count, 0], out[count, 1] = end, t
        if turned:
            out[count, 0], out[count, 1] = t, end
        count += 1
    return count


@kernel(inline=True)
def _overlap(couple, j, k):
    """Whether boxes of two chords are as near as what meets."""
    a, b, near = couple.first, couple.second, couple.nearest
    for axis in range(2):
        shift = couple.move[axis]
        if not a.low[j, axis] <= b.high[k, axis] + shift + near:
            return False
        if not b.low[k, axis] + shift <= a.high[j, axis] + near:
            return False
    return True


_CURVE = "Tuple((i8[::1], f8[::1], f8[::1], f8[:, ::1], f8[:, ::1], f8[:, ::1]))"


@kernel(signatures=f"({_CURVE}, {_CURVE}, UniTuple(f8, 2), f8, b1, f8[:, ::1])")
def find_meetings(one, other, move, nearest, own, out):
    """Parameters on two curves at which they meet, ends first; how many there are.

    Parameters
    ----------
    one, other
        Each as a `Traced`.
    move : (float, float)
        By which the other one is moved.
    nearest : float
        What is nearer than that meets.
    own : bool
        Whether both are the same curve, not moved.
    out : (n, 2)
        Filled; `MOST` places, and 17 for each two chords of the other curve, are enough.
    """
    couple = Couple(
        Traced(one[0], one[1], one[2], one[3], one[4], one[5]),
        Traced(other[0], other[1], other[2], other[3], other[4], other[5]),
        move,
        nearest,
        own,
    )
    count = 0
    for end in range(4):
        count = _at_end(couple, end % 2, end >= 2, out, count)
    ends = count
    chords, others = one[2].size - 1, other[2].size - 1
    for k in range(chords):
        if count - ends > MOST:
            break
        start = -1
        for j in range(k + 2 if own else 0, others + 1):
            if j < others and _overlap(couple, k, j):
                if start < 0:
                    start = j
            elif start >= 0:
                count = _along(couple, k, (start, j - 1), out, count)
                start = -1
    return count
