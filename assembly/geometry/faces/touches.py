"""Where boundary curves of a face meet or touch, other than at their common corners.

Along a stretch of one curve, the signed distance g(s) from the other one is asked for: curves cross where g changes its
sign and touch where |g| has a minimum next to zero. Newton's method on both parameters at once would fail there, as
tangents are parallel where curves touch. Ends are looked at by themselves, because g is not smooth beyond them.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.touch_gaps import gap_between, nearest_place
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.curve_parts import sampled

__all__ = ["Touch", "touches"]

Array = NDArray[np.float64]
# Chords of a span.
_CHORDS = 32
# Cuts nearer than this part of the extent are one: that near to a corner, curves are not compared with one another.
_ONE_CUT = 1e-5
# Parameters that differ by less, over the domain, are one.
_SAME = 1e-8
# Curves that meet more often lie on each other; whether loops still touch after that is looked at again.
_MOST = 32
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


class Touch(NamedTuple):
    """Two curves that meet: their numbers, where on each, and by which periods the second one is moved."""

    a: int
    b: int
    s: float
    t: float
    move: tuple[float, float]


class _Sampled:
    """A curve, and a polygon on it."""

    def __init__(self, curve: NurbsCurve) -> None:
        self.curve = curve
        self.t = sampled(curve.breaks(), _CHORDS + 1)
        self.points = curve.evaluate(self.t)
        middles = curve.evaluate(0.5 * (self.t[:-1] + self.t[1:]))
        sag = np.linalg.norm(middles - 0.5 * (self.points[:-1] + self.points[1:]), axis=1)
        self.sag = 4.0 * float(sag.max(initial=0.0))
        self.low = np.minimum(self.points[:-1], self.points[1:]) - self.sag
        self.high = np.maximum(self.points[:-1], self.points[1:]) + self.sag
        self.box = np.array([self.low.min(axis=0), self.high.max(axis=0)])

        self.traced = (*curve.packed(), self.t, np.ascontiguousarray(self.points))

    def nearest(self, point: Array, within: tuple[float, float] | None = None) -> tuple[float, float]:
        """Parameter and distance of the nearest point, in a part of the curve."""
        x, y = point.tolist()
        t, distance = nearest_place(self.traced, x, y, self.curve.domain if within is None else within)
        return t, distance


class _Pair:
    """Two curves, the second moved, that may meet within a tolerance."""

    def __init__(self, a: _Sampled, b: _Sampled, move: Array, tolerance: float, own: bool) -> None:
        self.a, self.b, self.move, self.tolerance, self.own = a, b, move, tolerance, own
        self._shift = (float(move[0]), float(move[1]))

    def found(self) -> list[tuple[float, float]]:
        """Parameters on both at which they meet."""
        return self._at_ends() + self._between_ends()

    def _at_ends(self) -> list[tuple[float, float]]:
        rows = []
        for here, there, sign in ((self.a, self.b, -1.0), (self.b, self.a, 1.0)):
            for k in (0, -1):
                end, point = float(here.t[k]), here.points[k] + sign * self.move
                if self.own:
                    # Of one curve, beside the end itself.
                    near = 0.02 * (here.t[-1] - here.t[0])
                    within = (end + near, float(here.t[-1])) if k == 0 else (float(here.t[0]), end - near)
                    t, distance = there.nearest(point, within)
                else:
                    t, distance = there.nearest(point)
                if distance <= self.tolerance:
                    rows.append((end, t) if here is self.a and sign < 0.0 else (t, end))
        return rows

    def _between_ends(self) -> list[tuple[float, float]]:
        a, b = self.a, self.b
        low, high = b.low + self.move, b.high + self.move
        near = self.tolerance
        over: Any = (a.low[:, None] <= high[None] + near).all(axis=2) & (low[None] <= a.high[:, None] + near).all(
            axis=2
        )
        if self.own:
            first, second = np.indices(over.shape)
            over &= second > first + 1
        rows: list[tuple[float, float]] = []
        for k in np.flatnonzero(over.any(axis=1)).tolist():
            if len(rows) > _MOST:
                break
            others = np.flatnonzero(over[k])
            for run in np.split(others, np.flatnonzero(np.diff(others) > 1) + 1):
                part = (float(b.t[run[0]]), float(b.t[run[-1] + 1]))
                rows += self._along(float(a.t[k]), float(a.t[k + 1]), part)
        return rows

    def _gap(self, s: float, part: tuple[float, float]) -> tuple[float, float, bool, float]:
        """Of the first curve's point, see `gap_between`."""
        gap, t, inside, turn = gap_between(self.a.traced, self.b.traced, s, self._shift, part)
        return gap, t, inside, turn

    def _along(self, low: float, high: float, part: tuple[float, float]) -> list[tuple[float, float]]:
        """Meetings of a chord's arc with a part of the other curve."""
        span = part[1] - part[0]
        part = (max(part[0] - 0.1 * span, self.b.t[0]), min(part[1] + 0.1 * span, self.b.t[-1]))
        s = np.linspace(low, high, 9)
        rows = [self._gap(x, part) for x in s.tolist()]
        found = []
        for k in range(8):
            (g, _, inside, _), (h, _, beside, _) = rows[k], rows[k + 1]
            if inside and beside and g * h < 0.0:
                found.append(self._crossed(float(s[k]), float(s[k + 1]), g, part))
        for k in range(9):
            size = abs(rows[k][0])
            before, after = max(k - 1, 0), min(k + 1, 8)
            if size <= abs(rows[before][0]) and size <= abs(rows[after][0]):
                found.append(self._least(float(s[before]), float(s[after]), part))
        return [(x, t) for x, t, distance in found if distance <= self.tolerance]

    def _crossed(self, low: float, high: float, at_low: float, part: tuple[float, float]) -> tuple[float, float, float]:
        for _ in range(60):
            middle = 0.5 * (low + high)
            if self._gap(middle, part)[0] * at_low > 0.0:
                low = middle
            else:
                high = middle
        s = 0.5 * (low + high)
        g, t, _, _ = self._gap(s, part)
        return s, t, abs(g)

    def _least(self, low: float, high: float, part: tuple[float, float]) -> tuple[float, float, float]:
        """The least distance, by golden sections."""
        a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
        at_a, at_b = abs(self._gap(a, part)[0]), abs(self._gap(b, part)[0])
        for _ in range(60):
            if at_a <= at_b:
                high, b, at_b = b, a, at_a
                a = high - _GOLDEN * (high - low)
                at_a = abs(self._gap(a, part)[0])
            else:
                low, a, at_a = a, b, at_b
                b = low + _GOLDEN * (high - low)
                at_b = abs(self._gap(b, part)[0])
            if min(at_a, at_b) > 100.0 * self.tolerance and high - low < 1e-3 * (self.a.t[-1] - self.a.t[0]):
                break
        s = self._parallel(0.5 * (low + high), 0.02 * (self.a.t[-1] - self.a.t[0]), part)
        g, t, _, _ = self._gap(s, part)
        return s, t, abs(g)

    def _parallel(self, s: float, reach: float, part: tuple[float, float]) -> float:
        """The place near one at which tangents are parallel, by secants: a least distance tells half of the digits."""

        def turn(at: float) -> float:
            return self._gap(at, part)[3]

        ends = float(self.a.t[0]), float(self.a.t[-1])
        last, at = min(max(s - 1e-4 * reach, ends[0]), ends[1]), s
        before, here = turn(last), turn(at)
        for _ in range(12):
            if here == before or abs(here) < 1e-15:
                break
            new = min(max(at - here * (at - last) / (here - before), ends[0]), ends[1])
            last, before = at, here
            at, here = new, turn(new)
        return at if abs(at - s) <= reach and abs(here) <= abs(turn(s)) else s


def _at_knot(t: float, sampled_curve: _Sampled) -> float:
    """A parameter, moved to a knot that is next to it."""
    knots = sampled_curve.curve.breaks()
    near = float(knots[np.argmin(np.abs(knots - t))])
    return near if abs(near - t) <= _SAME * (knots[-1] - knots[0]) else t


def _apart(rows: list[tuple[float, float]], a: _Sampled, b: _Sampled, radius: float) -> list[tuple[float, float]]:
    """Of meetings that are next to one another the middle one, if possible one at an end."""
    left = sorted(set(rows))
    if not left:
        return []
    on_a, on_b = (
        curve.evaluate(np.array(at)).tolist()
        for curve, at in zip((a.curve, b.curve), zip(*left, strict=True), strict=True)
    )
    places = {row: (*p, *q) for row, p, q in zip(left, on_a, on_b, strict=True)}
    chosen = []
    while left:
        place = places[left[0]]
        close = [row for row in left if max(abs(x - y) for x, y in zip(places[row], place, strict=True)) <= radius]
        left = [row for row in left if row not in close]
        ends = [row for row in close if row[0] in (a.t[0], a.t[-1]) or row[1] in (b.t[0], b.t[-1])]
        both = [row for row in ends if row[0] in (a.t[0], a.t[-1]) and row[1] in (b.t[0], b.t[-1])]
        best = both or ends or close
        s, t = best[len(best) // 2]
        chosen.append((_at_knot(s, a), _at_knot(t, b)))
    return chosen


def touches(
    curves: Sequence[NurbsCurve], follows: set[tuple[int, int]], periods: Array, extent: float, tolerance: float
) -> list[Touch]:
    """All places where curves meet or touch, but for the ends at which one follows another.

    Parameters
    ----------
    curves : plane curves
    follows : pairs of numbers
        (a, b) where b begins at the end of a.
    periods : (2,)
        Of u and v, 0 where there are none.
    extent : float
        Of all of them.
    tolerance : float
        What is nearer than that touches.
    """
    parts = [_Sampled(curve) for curve in curves]
    found: list[Touch] = []
    for i, a in enumerate(parts):
        for j in range(i, len(parts)):
            for move in _moves(a, parts[j], periods, tolerance):
                own = i == j and not move.any()
                if i == j and (move[0], move[1]) < (0.0, 0.0):
                    continue
                pair = _Pair(a, parts[j], move, tolerance, own)
                for s, t in _apart(pair.found(), a, parts[j], _ONE_CUT * extent):
                    shared = (s == a.t[-1] and t == parts[j].t[0] and (i, j) in follows) or (
                        s == a.t[0] and t == parts[j].t[-1] and (j, i) in follows
                    )
                    if not shared:
                        found.append(Touch(i, j, s, t, (float(move[0]), float(move[1]))))
    return found


def _moves(a: _Sampled, b: _Sampled, periods: Array, tolerance: float) -> list[Array]:
    """Whole periods by which the second box may be moved onto the first."""
    rows = []
    for axis, period in enumerate(periods.tolist()):
        low, high = a.box[0, axis] - b.box[1, axis] - tolerance, a.box[1, axis] - b.box[0, axis] + tolerance
        if period == 0.0:
            rows.append([0.0] if low <= 0.0 <= high else [])
        else:
            rows.append([k * period for k in range(int(np.ceil(low / period)), int(np.floor(high / period)) + 1)])
    return [np.array(move) for move in product(*rows)]
