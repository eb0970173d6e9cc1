"""How far a plane curve is from a point, or from a point of another curve, near a part of it: for `touches`."""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.splines.evaluate import curve_lanes, xyz

_NEWTON = 30

# A curve and a polygon on it. table, pool: as `NurbsCurve.packed` has them; t, points: of its corners.
Traced = namedtuple("Traced", "table pool t points")


@kernel(inline=True)
def _at(curve, t):
    """The point of a curve at a parameter, and its first two derivatives."""
    a, d, h = curve_lanes(Store(curve.table, curve.pool), 0, t)
    x, y, _z = xyz(a)
    dx, dy, _z = xyz(d)
    ddx, ddy, _z = xyz(h)
    return (x, y), (dx, dy), (ddx, ddy)


@kernel(inner=True)
def _nearest(curve, x, y, interval):
    """Parameter and distance of the nearest point in a part of a curve: Newton's method from the polygon."""
    low, high = interval
    t = 0.5 * (low + high)
    least = np.inf
    for k in range(curve.t.size):
        if low <= curve.t[k] <= high:
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


@kernel(signatures="(Tuple((i8[::1], f8[::1], f8[::1], f8[:, ::1])), f8, f8, UniTuple(f8, 2))")
def nearest_place(curve, x, y, interval):
    """Parameter and distance of the point of a `Traced` curve, in an interval of it, that is nearest to (x, y)."""
    return _nearest(Traced(curve[0], curve[1], curve[2], curve[3]), x, y, interval)


@kernel(
    signatures="(Tuple((i8[::1], f8[::1], f8[::1], f8[:, ::1])), Tuple((i8[::1], f8[::1], f8[::1], f8[:, ::1])), f8,"
    " UniTuple(f8, 2), UniTuple(f8, 2))"
)
def gap_between(one, other, s, move, interval):
    """The gap from the point at s of one curve to an interval of another curve, which is moved by `move`.

    Returns the signed distance, positive to the left of the other curve, the parameter of the nearest point on that
    curve, whether it is inside the interval, and the sine of the angle between both tangents.
    """
    first, second = Traced(one[0], one[1], one[2], one[3]), Traced(other[0], other[1], other[2], other[3])
    point, along, _bend = _at(first, s)
    x, y = point[0] - move[0], point[1] - move[1]
    t, distance = _nearest(second, x, y, interval)
    place, way, _bend = _at(second, t)
    side = way[0] * (y - place[1]) - way[1] * (x - place[0])
    width = 1e-12 * (interval[1] - interval[0])
    lengths = np.sqrt(along[0] ** 2 + along[1] ** 2) * np.sqrt(way[0] ** 2 + way[1] ** 2)
    turn = (along[0] * way[1] - along[1] * way[0]) / max(lengths, 1e-300)
    return distance if side >= 0.0 else -distance, t, interval[0] + width < t < interval[1] - width, turn
