"""Where boundary curves of a face meet or touch, other than at their common corners."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.touch_gaps import MOST, find_meetings
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

        self.traced = (*curve.packed(), self.t, np.ascontiguousarray(self.points), self.low, self.high)


def _meetings(a: _Sampled, b: _Sampled, move: Array, tolerance: float, own: bool) -> list[tuple[float, float]]:
    """Parameters on two curves, the second moved, at which they are nearer than a tolerance."""
    out = np.empty((MOST + 17 * b.t.size, 2))
    count = find_meetings(a.traced, b.traced, (float(move[0]), float(move[1])), tolerance, own, out)
    return [(s, t) for s, t in out[:count].tolist()]


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
    boxes = np.array([part.box for part in parts]).reshape(-1, 2, 2)
    found: list[Touch] = []
    for i, a in enumerate(parts):
        for j in (i + np.flatnonzero(_may_meet(boxes[i], boxes[i:], periods, tolerance))).tolist():
            b = parts[j]
            for move in _moves(a, b, periods, tolerance):
                own = i == j and not move.any()
                if i == j and (move[0], move[1]) < (0.0, 0.0):
                    continue
                for s, t in _apart(_meetings(a, b, move, tolerance, own), a, b, _ONE_CUT * extent):
                    shared = (s == a.t[-1] and t == b.t[0] and (i, j) in follows) or (
                        s == a.t[0] and t == b.t[-1] and (j, i) in follows
                    )
                    if not shared:
                        found.append(Touch(i, j, s, t, (float(move[0]), float(move[1]))))
    return found


def _may_meet(box: Array, others: Array, periods: Array, tolerance: float) -> NDArray[np.bool_]:
    """Which of other boxes (n, 2, 2) are as near to a box as what touches, some moved by whole periods."""
    low, high = box[0] - others[:, 1] - tolerance, box[1] - others[:, 0] + tolerance
    whole = np.where(periods > 0.0, periods, 1.0)
    once = (low <= 0.0) & (high >= 0.0)
    meets: NDArray[np.bool_] = np.where(periods > 0.0, np.ceil(low / whole) <= np.floor(high / whole), once).all(axis=1)
    return meets


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
