"""The boundary of a face as a polygon in space within a tolerance.

Corners stand where the density max(sqrt(k / (8 tolerance)), k / angle) of the boundary's length, k its curvature in
space, has grown by equal parts: a chord of length h is k h^2 / 8 from its arc and turns by k h. The density does not
depend on how the curve is parametrized, so that two faces which share an edge have the same corners on it, to within
the tolerance. Chords are then measured, and halved where that is not enough.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["Border", "border", "cross", "on_surface", "pole_sides"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
# Parts of a curve, and the fewest of a span, at whose middles the curvature is taken.
_PARTS, _LEAST = 64, 4
# Chords are planned for this part of the tolerance, since their measured distances differ a little from the plan.
_AIM = 0.85
# A number of chords is rounded down if it exceeds a whole number by less than this; the measurement decides later.
SPARE = 0.02
# Tangents that differ by more [rad] on the two sides of a knot make a corner.
_KINK = 1e-3
# Ends of curves nearer than this part of the boundary's extent are one corner.
_JOINED = 1e-6
# Beginnings of curves of different loops that are nearer, as loops that touch have them, are one corner: two corners a
# rounding apart make triangles whose sides no arithmetic tells.
_TOUCH = 1e-9
_HALVINGS = 40


def on_surface(surface: NurbsSurface, parameters: Array, order: int = 0) -> list[Array]:
    """Points (n, 3) and derivatives at parameters (n, 2), which rounding may have put beyond an open end."""
    at = [
        column if closed else np.clip(column, *ends)
        for column, closed, ends in zip(parameters.T, surface.closed, surface.domain, strict=True)
    ]
    found = surface.evaluate(at[0], at[1], order)
    return [found] if order == 0 else list(found)


def cross(a: Array, b: Array) -> Array:
    """Cross products of rows (n, 3); numpy's own takes several times as long for few."""
    return np.stack(
        [
            a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1],
            a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2],
            a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0],
        ],
        axis=1,
    )


def pole_sides(surface: NurbsSurface) -> list[int]:
    """Sides of the domain that are one point in space: 0 and 1 for the low and high end of u, 2 and 3 for v."""
    return [side for side in range(4) if surface._pole_bits >> side & 1]


@dataclass(frozen=True, eq=False)
class Border:
    """Directed segments, k of them, with the face on their left.

    Attributes
    ----------
    face : Face
    curve : (k,)
        Number of the boundary curve that a segment is a chord of; -1 for a step along a pole of the surface.
    chain : (k,)
        Number of the closed chain that it belongs to; segments of a chain stand in order.
    t : (k, 2)
        Parameters of the ends.
    ends : (k, 2, 2)
        The ends in (u, v), in the universal cover of a closed surface.
    """

    face: Face
    curve: Indices
    chain: Indices
    t: Array
    ends: Array

    @cached_property
    def points(self) -> Array:
        """The ends in space, (k, 2, 3)."""
        return on_surface(self.face.surface, self.ends.reshape(-1, 2))[0].reshape(-1, 2, 3)

    @cached_property
    def following(self) -> Indices:
        """The next segment of each in its chain, (k,)."""
        following = np.arange(1, len(self.chain) + 1)
        last = np.flatnonzero(np.diff(self.chain, append=-1))
        following[last] = np.concatenate([[0], last[:-1] + 1])
        return following

    def at(self, rows: Indices, t: Array) -> Array:
        """Points (n, 2) in (u, v) of the true boundary at parameters of segments."""
        part = ((t - self.t[rows, 0]) / (self.t[rows, 1] - self.t[rows, 0]))[:, None]
        points: Array = (1.0 - part) * self.ends[rows, 0] + part * self.ends[rows, 1]
        curves = self.curve[rows]
        for k, curve in enumerate(self.face.boundary):
            own = np.flatnonzero(curves == k)
            if len(own):
                points[own] = curve.evaluate(t[own]) + self._turned(rows[own], curve)
        return points

    def _turned(self, rows: Indices, curve: NurbsCurve) -> Array:
        """By how many whole periods segments (n) of a curve stand beside it, as lengths (n, 2) in (u, v)."""
        surface, turned = self.face.surface, np.zeros((len(rows), 2))
        if any(surface.closed):
            off = self.ends[rows, 0] - curve.evaluate(self.t[rows, 0])
            for d in np.flatnonzero(surface.closed):
                period = np.ptp(surface.domain[d])
                turned[:, d] = period * np.round(off[:, d] / period)
        return turned

    def split(self, rows: Indices, t: Array | None = None) -> Border:
        """The border with segments cut in two, in the middle or at given parameters; each at most once."""
        if not len(rows):
            return self
        order = np.argsort(rows)
        rows = rows[order]
        middle = self.t[rows].mean(axis=1) if t is None else t[order]
        new = self.at(rows, middle)
        count = np.ones(len(self.curve), dtype=np.int64)
        count[rows] = 2
        source = np.repeat(np.arange(len(self.curve)), count)
        second = np.cumsum(count)[rows] - 1
        t_ends, ends = self.t[source], self.ends[source]
        t_ends[second - 1, 1] = t_ends[second, 0] = middle
        ends[second - 1, 1] = ends[second, 0] = new
        return replace(self, curve=self.curve[source], chain=self.chain[source], t=t_ends, ends=ends)

    def sagging(self, tolerance: float) -> Indices:
        """Segments whose middle on the true boundary is farther than a tolerance from the chord."""
        rows = np.arange(len(self.curve))
        middle = on_surface(self.face.surface, self.at(rows, self.t.mean(axis=1)))[0]
        start, end = self.points[:, 0], self.points[:, 1]
        way = end - start
        length = np.maximum((way**2).sum(axis=1), np.finfo(float).tiny)
        part = np.clip(((middle - start) * way).sum(axis=1) / length, 0.0, 1.0)
        sag = np.linalg.norm(start + part[:, None] * way - middle, axis=1)
        return np.flatnonzero((sag > tolerance) & (self.curve >= 0))


def _parts(curve: NurbsCurve) -> tuple[Array, list[int]]:
    """Ends of short parts of a curve, and which of them begin a smooth stretch, or end the last."""
    breaks = curve.breaks()
    parts = max(_PARTS // (len(breaks) - 1), _LEAST)
    t = breaks[:-1, None] + np.arange(parts) * ((breaks[1:] - breaks[:-1]) / parts)[:, None]
    inner = breaks[1:-1]
    times = np.searchsorted(curve.knots, inner, "right") - np.searchsorted(curve.knots, inner, "left")
    full = np.flatnonzero(times >= curve.degree) + 1
    corners: list[int] = []
    if len(full):
        before = breaks[full] - 1e-9 * (breaks[full] - breaks[full - 1])
        way = curve.evaluate(np.stack([before, breaks[full]]), 1)[1]
        cross = way[0, :, 0] * way[1, :, 1] - way[0, :, 1] * way[1, :, 0]
        turned = np.abs(np.arctan2(cross, (way[0] * way[1]).sum(axis=1))) > _KINK
        corners = (parts * full[turned]).tolist()
    return np.append(t.ravel(), curve.domain[1]), [0, *corners, parts * (len(breaks) - 1)]


def _curvature(surface: NurbsSurface, curves: list[NurbsCurve], places: list[Array]) -> tuple[Array, Array]:
    """Speed and curvature in space of boundary curves, each at its parameters."""
    rows = [curve.evaluate(t, 2) for curve, t in zip(curves, places, strict=True)]
    at, first, second = (np.concatenate(parts) for parts in zip(*rows, strict=True))
    _, su, sv, suu, suv, svv = on_surface(surface, at, 2)
    (a, b), (c, d) = first.T[..., None], second.T[..., None]
    velocity = su * a + sv * b
    change = suu * a * a + 2.0 * suv * a * b + svv * b * b + su * c + sv * d
    speed = np.linalg.norm(velocity, axis=1)
    bend = np.linalg.norm(cross(velocity, change), axis=1)
    return speed, np.divide(bend, speed**3, out=np.zeros_like(speed), where=speed > 0.0)


def _steps(face: Face, tolerance: float, angle: float) -> list[Array]:
    """Parameters of the corners on each boundary curve."""
    is_flat = face.surface.is_parallelogram
    # A line of a parallelogram is one step, which nothing need be measured of.
    bent = [curve for curve in face.boundary if not (is_flat and _is_segment(curve))]
    if not bent:
        return [np.array(curve.domain) for curve in face.boundary]
    parts = [_parts(curve) for curve in bent]
    speed, curvature = _curvature(face.surface, bent, [0.5 * (t[:-1] + t[1:]) for t, _ in parts])
    density = speed * np.maximum(np.sqrt(curvature / (8.0 * _AIM * tolerance)), curvature / angle)
    found, begin = [], 0
    for t, stretches in parts:
        width = np.diff(t)
        own = density[begin : begin + len(width)] * width
        begin += len(width)
        at = [t[:1]]
        for low, high in pairwise(stretches):
            # The last term makes it increase where the boundary is straight.
            grown = np.concatenate([[0.0], np.cumsum(own[low:high])]) + 1e-9 * np.arange(high - low + 1)
            count = max(int(np.ceil(grown[-1] - SPARE)), 1)
            reached = np.interp(np.linspace(0.0, grown[-1], count + 1), grown, t[low : high + 1])
            at.append(np.append(reached[1:-1], t[high]))
        found.append(np.concatenate(at))
    steps = iter(found)
    return [np.array(curve.domain) if is_flat and _is_segment(curve) else next(steps) for curve in face.boundary]


def _is_segment(curve: NurbsCurve) -> bool:
    return len(curve.control_points) == 2


def border(face: Face, tolerance: float, angle: float) -> Border:
    """The boundary of a face as a polygon.

    Parameters
    ----------
    face : Face
    tolerance : float
        Distance of any chord from its arc.
    angle : float
        About the most that the boundary turns from chord to chord [rad].
    """
    if not face.boundary:
        none = np.empty(0, dtype=np.int64)
        return Border(face, none, none, np.empty((0, 2)), np.empty((0, 2, 2)))
    steps = _steps(face, tolerance, angle)
    places = [curve.evaluate(t) for curve, t in zip(face.boundary, steps, strict=True)]
    size = float(np.ptp(np.concatenate(places), axis=0).max())
    reach = _JOINED * size
    _meet_where_loops_touch(places, _TOUCH * size)
    curves, chains, spans, ends = [], [], [], []
    for number, members in enumerate(_linked_at_poles(face, places, reach)):
        for k, after in zip(members, [*members[1:], members[0]], strict=True):
            t, points = steps[k], places[k]
            segments = np.stack([points[:-1], points[1:]], axis=1)
            gap = places[after][0] - points[-1]
            curve, span = np.full(len(t) - 1, k), np.column_stack([t[:-1], t[1:]])
            if np.abs(gap).max() <= reach:
                segments[-1, 1] = places[after][0]
            elif not _whole_periods(face.surface, gap):
                # Between the ends lies a pole, which is one point in space and an edge of the domain here.
                segments = np.concatenate([segments, [[points[-1], points[-1] + _along_pole(face, points[-1], gap)]]])
                curve, span = np.append(curve, -1), np.concatenate([span, [[0.0, 1.0]]])
            curves.append(curve)
            chains.append(np.full(len(curve), number))
            spans.append(span)
            ends.append(segments)
    found = Border(face, np.concatenate(curves), np.concatenate(chains), np.concatenate(spans), np.concatenate(ends))
    if all(face.surface.is_parallelogram and _is_segment(curve) for curve in face.boundary):
        return found
    for _ in range(_HALVINGS):
        rows = found.sagging(tolerance)
        if not len(rows):
            break
        found = found.split(rows)
    return found


def _meet_where_loops_touch(places: list[Array], reach: float) -> None:
    """Move the first corner of a curve, which ends the curve before it as well, to that of another one there."""
    if len(places) < 2:
        return
    starts = np.array([row[0] for row in places])
    order = np.lexsort(starts.T[::-1])
    # Few are near: only neighbors along u are compared.
    for n, k in enumerate(order[1:].tolist(), 1):
        for m in order[n - 1 :: -1].tolist():
            if starts[k, 0] - starts[m, 0] > reach:
                break
            if abs(starts[k, 1] - starts[m, 1]) <= reach:
                starts[k] = places[k][0] = starts[m]
                break


def _linked_at_poles(face: Face, places: list[Array], reach: float) -> list[list[int]]:
    """Curves of chains that close; one that ends at a pole goes on with the next one there, material to the left."""
    closed: list[list[int]] = []
    broken: list[list[int]] = []
    for members in map(list, face.chains):
        gap = places[members[0]][0] - places[members[-1]][-1]
        closes = np.abs(gap).max() <= reach or _whole_periods(face.surface, gap)
        (closed if closes else broken).append(members)
    while broken:
        chain = broken.pop(0)
        while True:
            end = places[chain[-1]][-1]
            rows = [chain, *broken]
            ways = [_way_along_pole(face, end, places[row[0]][0]) for row in rows]
            best = int(np.argmin(ways))
            if best == 0 or not np.isfinite(ways[best]):
                break
            chain += broken.pop(best - 1)
        closed.append(chain)
    return closed


def _pole_of(face: Face, place: Array) -> tuple[int, float] | None:
    """The parameter that runs along the pole at a place, and the way it goes with the material to its left."""
    for side in pole_sides(face.surface):
        axis, end = divmod(side, 2)
        low, high = face.surface.domain[axis]
        if abs(place[axis] - (low, high)[end]) <= _JOINED * (high - low):
            return 1 - axis, 1.0 if side in (1, 2) else -1.0
    return None


def _way_along_pole(face: Face, end: Array, start: Array) -> float:
    """How far it is along a pole from the end of a chain to the start of one, infinite where they share none."""
    pole = _pole_of(face, end)
    if pole is None or pole != _pole_of(face, start):
        return np.inf
    along, sign = pole
    way = sign * float(start[along] - end[along])
    if face.surface.closed[along]:
        low, high = face.surface.domain[along]
        way %= high - low
    return way if way >= -_JOINED else np.inf


def _along_pole(face: Face, end: Array, gap: Array) -> Array:
    """The step along a pole across a gap, without whole periods."""
    pole = _pole_of(face, end)
    if pole is None:
        return gap
    along, sign = pole
    step = gap.copy()
    if face.surface.closed[along]:
        low, high = face.surface.domain[along]
        step[along] = sign * ((sign * gap[along]) % (high - low))
    return step


def _whole_periods(surface: NurbsSurface, gap: Array) -> bool:
    """Whether a step in (u, v) goes round a closed surface and ends where it began."""
    for step, closed, (low, high) in zip(gap, surface.closed, surface.domain, strict=True):
        turns = step / (high - low)
        if abs(turns - (round(turns) if closed else 0)) > _JOINED:
            return False
    return True
