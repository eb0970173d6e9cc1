"""Loops that touch, or go into each other by no more than a tolerance, cut where they meet and linked anew.

Curves are cut at their meetings. A part of one is boundary if there is material once on its left and none on its right;
what is left over lies between loops that go into each other, and has to be within the tolerance of what is kept.
Where more than one part ends and begins, parts are linked to loops that pass no place twice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import floor

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.loop import Loop, curve_ends, moved, with_ends
from assembly.geometry.faces.touches import touches
from assembly.geometry.faces.trim_table import build
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.curve_packing import signed_area
from assembly.geometry.splines.curve_parts import between, sampled
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["Chain", "Relinked", "relinked"]

Array = NDArray[np.float64]
# Ends nearer than this many times the distance at which curves touch are one corner.
_CORNER = 8.0
# Names of what is around a face.
_OUTSIDE = ("outer", "the edge of the domain")


@dataclass(frozen=True, eq=False)
class Chain:
    """Curves head to tail, the loop that most of it comes from, and whether it closes up to periods."""

    curves: list[NurbsCurve]
    name: str
    closes: bool


@dataclass(frozen=True, eq=False)
class Relinked:
    """Chains that pass no place twice; and walks, which are these with all that touch linked to one."""

    chains: list[Chain]
    walks: list[Chain]


class _Corners:
    """Places where parts begin and end, up to periods."""

    def __init__(self, periods: Array, reach: float) -> None:
        self.periods, self.reach = periods, reach
        self.points: list[Array] = []
        # Numbers of the places in each cell of a grid: what is within reach of a place lies in four cells at most.
        self._cells: dict[tuple[int, int], list[int]] = {}
        self._places: list[tuple[float, float]] = []
        self._lengths: tuple[float, float] = (float(periods[0]), float(periods[1]))
        self._counts = tuple(max(int(length / (4.0 * reach)), 1) for length in self._lengths)

    def _cell(self, u: float, v: float) -> tuple[int, int]:
        """The cell of a place: a whole part of a period, or four times the reach wide."""
        at = [
            floor(x / length * count) % count if length > 0.0 else floor(x / (4.0 * self.reach))
            for x, length, count in zip((u, v), self._lengths, self._counts, strict=True)
        ]
        return at[0], at[1]

    def number(self, point: Array) -> int:
        """Of a place, the first one that is within reach; a new one if there is none yet."""
        u, v = point.tolist()
        period_u, period_v = self._lengths
        near = 1.5 * self.reach
        cells = {self._cell(u + a, v + b) for a in (-near, near) for b in (-near, near)}
        for k in sorted(k for cell in cells for k in self._cells.get(cell, ())):
            x, y = self._places[k]
            off_u, off_v = u - x, v - y
            if period_u > 0.0:
                off_u -= round(off_u / period_u) * period_u
            if period_v > 0.0:
                off_v -= round(off_v / period_v) * period_v
            if abs(off_u) <= self.reach and abs(off_v) <= self.reach:
                return k
        self._cells.setdefault(self._cell(u, v), []).append(len(self.points))
        self.points.append(point)
        self._places.append((u, v))
        return len(self.points) - 1

    def move(self, k: int, point: Array) -> Array:
        """By which periods corner k is moved to be next to a point."""
        whole = np.where(self.periods > 0.0, self.periods, 1.0)
        jump = np.round((point - self.points[k]) / whole) * self.periods
        return np.asarray(jump)

    def at(self, k: int, point: Array) -> Array:
        """Corner k, next to a point."""
        return np.asarray(self.points[k] + self.move(k, point))


@dataclass(eq=False)
class _Part:
    curve: NurbsCurve
    name: str
    begin: int
    end: int


def _cut(
    curves: Sequence[NurbsCurve], names: Sequence[str], cuts: list[list[tuple[float, Array]]], corners: _Corners
) -> list[_Part]:
    """Parts of the curves between their cuts, each with its ends at the corners."""
    parts = []
    for curve, name, own in zip(curves, names, cuts, strict=True):
        first, last = curve_ends(curve)
        rows = [(curve.domain[0], first)]
        for t, point in sorted(own, key=lambda cut: cut[0]):
            beside = (point, rows[-1][1], last)
            if min(np.abs(beside[0] - beside[1]).max(), np.abs(beside[0] - beside[2]).max()) > corners.reach:
                rows.append((t, point))
        rows.append((curve.domain[1], last))
        for (low, start), (high, end) in zip(rows[:-1], rows[1:], strict=True):
            made = curve if len(rows) == 2 else between(curve, low, high)
            begin, stop = corners.number(start), corners.number(end)
            made = with_ends(made, corners.at(begin, start), corners.at(stop, end))
            parts.append(_Part(made, name, begin, stop))
    return parts


def _kept(parts: list[_Part], surface: NurbsSurface, tolerance: Array) -> list[_Part] | None:
    """The parts with material on their left alone; None where another one is farther than the tolerance from these."""
    lengths = [float(np.abs(np.diff(p.curve.evaluate(np.linspace(*p.curve.domain, 9)), axis=0)).sum()) for p in parts]
    first = int(np.argmax(lengths))
    order = [first, *(k for k in range(len(parts)) if k != first)]
    rows = [parts[k] for k in order]
    single = tuple(range(k, k + 1) for k in range(len(rows)))
    table = build([p.curve for p in rows], single, [False] * len(rows), (), surface.domain, surface._periods)
    keep = (table.left == 1.0) & (table.right == 0.0)
    kept = [parts[k] for k in sorted(k for k, good in zip(order, keep.tolist(), strict=True) if good)]
    if keep.all() or not kept:
        return kept or None
    short = np.array(lengths)[order] <= float(np.min(tolerance))
    for k in np.flatnonzero(short & ~keep).tolist():
        _bridge(rows[k], kept)
    polygon = np.concatenate([p.curve.evaluate(sampled(p.curve.breaks(), 129)) for p in kept]) / tolerance
    periods = np.array(surface._periods) / tolerance
    left = [part for part, good in zip(rows, keep.tolist(), strict=True) if not good]
    at = np.concatenate([part.curve.evaluate(sampled(part.curve.breaks(), 17)) for part in left]) / tolerance
    return kept if _are_near(at, polygon, periods) else None


def _bridge(part: _Part, kept: Sequence[_Part]) -> None:
    """Have one of the parts that are kept end where a short one does, if they are open without that.

    Of a part that is shorter than loops may go into each other it is not known what is left and right of it.
    """
    more_end, more_begin = (sum((one.end == at) - (one.begin == at) for one in kept) for at in (part.begin, part.end))
    if more_end > 0 > more_begin:
        before = next(one for one in kept if one.end == part.begin)
        (start, end), (begin, stop) = curve_ends(before.curve), curve_ends(part.curve)
        before.curve, before.end = with_ends(before.curve, start, end + (stop - begin)), part.end


def _are_near(at: Array, polygon: Array, periods: Array) -> bool:
    """Whether all points (n, 2) are within 1 of a polygon (m, 2), up to periods.

    Nearly all are so of the sides at the corner nearest to them; only the others are compared with every side.
    """
    from scipy.spatial import cKDTree  # a tenth of a second of import

    whole = np.where(periods > 0.0, periods, 1.0)

    def within(points: Array) -> Array:
        moved: Array = np.where(periods > 0.0, np.mod(points, whole), points)
        # Rounding may give the period itself.
        return np.where((periods > 0.0) & (moved >= periods), 0.0, moved)

    _, nearest = cKDTree(within(polygon), boxsize=periods).query(within(at))
    corners = np.clip(nearest[:, None] + np.arange(-1, 2), 0, len(polygon) - 1)

    def ways(points: Array, to: Array) -> Array:
        way: Array = points[:, None] - to
        return way - np.where(periods > 0.0, np.round(way / whole) * periods, 0.0)

    far = at[_distances(ways(at, polygon[corners])) > 1.0]
    # A few at a time: a file's curve may have thousands of corners.
    return all(
        _distances(ways(some, polygon[None])).max() <= 1.0
        for some in np.array_split(far, 1 + len(far) // 64)
        if len(some)
    )


def _distances(way: Array) -> Array:
    """How far points are from a polygon, by the ways (n, m, 2) to its corners, that run beside them."""
    a, b = way[:, :-1], way[:, 1:]
    side = b - a
    length = np.maximum((side**2).sum(axis=2), np.finfo(float).tiny)
    part = np.clip(-(a * side).sum(axis=2) / length, 0.0, 1.0)
    # The step from one curve to the next may be a chord of nothing: corners alone count there.
    far = np.linalg.norm(a + part[..., None] * side, axis=2)
    return np.asarray(far.min(axis=1))


def _walks(parts: list[_Part]) -> list[list[_Part]] | None:
    """All parts head to tail, those that are connected in one walk; None where more end than begin at a place."""
    out: dict[int, list[_Part]] = {}
    surplus: dict[int, int] = {}
    for part in parts:
        out.setdefault(part.begin, []).append(part)
        surplus[part.begin] = surplus.get(part.begin, 0) + 1
        surplus[part.end] = surplus.get(part.end, 0) - 1
    starts = [k for k, more in surplus.items() if more > 0]
    walks = []
    for start in [*starts, *(part.begin for part in parts)]:
        while out.get(start):
            stack: list[_Part] = []
            walk: list[_Part] = []
            at = start
            # Hierholzer: go on while there is a way; what is stuck is the end of the walk.
            while True:
                if out.get(at):
                    stack.append(out[at].pop(0))
                    at = stack[-1].end
                elif stack:
                    walk.append(stack.pop())
                    at = walk[-1].begin
                else:
                    break
            walks.append(walk[::-1])
    for walk in walks:
        if any(a.end != b.begin for a, b in zip(walk[:-1], walk[1:], strict=True)):
            return None
    return walks


def _simple(walk: list[_Part]) -> list[list[_Part]]:
    """A walk split into loops that pass no corner twice, and what is left of an open one."""
    loops: list[list[_Part]] = []
    row: list[_Part] = []
    for part in walk:
        row.append(part)
        for k, before in enumerate(row):
            if before.begin == part.end:
                loops.append(row[k:])
                row = row[:k]
                break
    return [*loops, row] if row else loops


def relinked(
    chains: Sequence[tuple[list[NurbsCurve], Array]],
    names: Sequence[str],
    surface: NurbsSurface,
    sizes: tuple[float, float, float],
) -> Relinked | None:
    """Chains of curves that meet, cut there and linked anew.

    Parameters
    ----------
    chains : of curves and the way from their start to their end, not a number where that is no whole period
    names : of their loops
    surface : whose domain and periods count
    sizes : (float, float, float)
        The extent of the boundary, the distance at which curves touch, and by how much loops may go into each other,
        as a part of the sides of the domain.

    Returns
    -------
    Relinked, or None where loops go into each other by more, or do not bound a face.
    """
    extent, nearest, tolerance = sizes
    curves = [curve for chain, _ in chains for curve in chain]
    of_loop = [name for (chain, _), name in zip(chains, names, strict=True) for _ in chain]
    follows = set()
    begin = 0
    for chain, turn in chains:
        stop = begin + len(chain)
        follows |= {(k, k + 1) for k in range(begin, stop - 1)}
        if np.isfinite(turn).all():
            follows.add((stop - 1, begin))
        begin = stop
    periods = np.array(surface._periods)
    corners = _Corners(periods, _CORNER * nearest)
    for curve in curves:
        for point in curve_ends(curve):
            corners.number(point)
    cuts: list[list[tuple[float, Array]]] = [[] for _ in curves]
    for touch in touches(curves, follows, periods, extent, 2.0 * nearest):
        first, second = curves[touch.a].evaluate(touch.s), curves[touch.b].evaluate(touch.t)
        place = corners.number(0.5 * (first + second + np.array(touch.move)))
        cuts[touch.a].append((touch.s, corners.at(place, first)))
        cuts[touch.b].append((touch.t, corners.at(place, second)))
    parts = _kept(_cut(curves, of_loop, cuts, corners), surface, tolerance * np.ptp(np.array(surface.domain), axis=1))
    walks = None if parts is None else _walks(parts)
    if walks is None:
        return None
    simple = [_chain(loop, surface) for walk in walks for loop in _simple(walk)]
    # The outer one first.
    simple.sort(key=lambda chain: (chain.name not in _OUTSIDE, -signed_area(chain.curves)))
    return Relinked(simple, [_chain(row, surface) for row in walks])


def _chain(row: list[_Part], surface: NurbsSurface) -> Chain:
    """Parts moved by whole periods to where the one before ends."""
    made = [part.curve for part in row]
    closes = row[0].begin == row[-1].end
    name = next((part.name for part in row if part.name in _OUTSIDE), row[0].name)
    if closes:
        return Chain(list(Loop.unchecked(made, 1e-6, surface._periods, name).curves), name, True)
    periods = np.array(surface._periods)
    whole = np.where(periods > 0.0, periods, 1.0)
    for k in range(1, len(made)):
        jump = curve_ends(made[k - 1])[1] - curve_ends(made[k])[0]
        made[k] = moved(made[k], np.round(jump / whole) * periods)
    return Chain(made, name, False)
