"""The boundary of a face laid out on one sheet of (u, v), where a closed surface is cut open."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.meshing.border import Border, pole_sides
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["Sheet", "crossed", "unrolled"]

Array = NDArray[np.float64]
# In parts of a period or of the sheet: places that are one, and the nearest that a boundary comes to a cut beside it.
_SAME = 1e-9
_BESIDE = 1e-6
_CANDIDATES = 40
_BISECTIONS = 60


@dataclass(frozen=True, eq=False)
class Sheet:
    """A part of the plane that a face fills once.

    Attributes
    ----------
    border : Border
        Its ends are in the sheet; no segment crosses a cut, which is at both ends of the box.
    box : (2, 2)
        Low and high corner.
    cut : (bool, bool)
        Whether the low and high side are one line in space, for u and v.
    poles : tuple of (direction, end)
        Low and high sides (end 0 and 1) of the box that are one point in space, while the other direction is cut.
    """

    border: Border
    box: Array
    cut: tuple[bool, bool]
    poles: tuple[tuple[int, int], ...]


def _bisected(border: Border, rows: NDArray[np.int64], direction: int, value: float) -> Array:
    """Parameters at which segments, whose ends are on both sides of a value, meet it."""
    low, high = border.t[rows].T
    rising = border.ends[rows, 1, direction] > border.ends[rows, 0, direction]
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        below = (border.at(rows, middle)[:, direction] < value) == rising
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    result: Array = 0.5 * (low + high)
    return result


def crossed(border: Border, direction: int, value: float) -> Border:
    """The border with corners where it crosses a line u or v = value."""
    reach = _SAME * np.ptp(border.ends[..., direction])
    while True:
        ends = border.ends.copy()
        at = ends[..., direction]
        at[np.abs(at - value) <= reach] = value
        border = replace(border, ends=ends)
        rows = np.flatnonzero((at.min(axis=1) < value) & (value < at.max(axis=1)))
        if not len(rows):
            return border
        border = border.split(rows, _bisected(border, rows, direction, value))


def _place_of_cut(at: Array, low: float, period: float) -> float:
    """Where to cut a closed direction: at its seam, unless the boundary runs along it or crosses it too often.

    Parameters
    ----------
    at : (k, 2)
        Ends of segments in that direction.
    """
    part = (at - low) / period
    within = np.sort((part % 1.0).ravel())
    gaps = np.diff(within, append=within[0] + 1.0)
    largest = np.argsort(-gaps, kind="stable")[:_CANDIDATES]
    candidates = np.concatenate([[0.0], (within[largest] + 0.5 * gaps[largest]) % 1.0])
    # Sides on which the ends are, in turns; an end at the cut is on none.
    away = part[None] - candidates[:, None, None]
    on = np.abs(away - np.round(away)) < _BESIDE
    crossings = ((np.floor(away[..., 0]) != np.floor(away[..., 1])) & ~on.any(axis=2)).sum(axis=1)
    along = on.all(axis=2).any(axis=1)
    best = int(np.argmin(crossings + len(at) * along))
    return low + period * float(candidates[best])


def _winding(polygon: Array, point: Array) -> int:
    """How often a polygon (n, 2, 2) of segments goes round a point."""
    a, b = polygon[:, 0] - point, polygon[:, 1] - point
    side = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    up, down = (a[:, 1] <= 0.0) & (b[:, 1] > 0.0) & (side > 0.0), (a[:, 1] > 0.0) & (b[:, 1] <= 0.0) & (side < 0.0)
    return int(up.sum()) - int(down.sum())


def _outer(border: Border) -> int:
    """The chain around a face that fits on a sheet without a cut; -1 where there is none."""
    for number in np.unique(border.chain):
        ends = border.ends[border.chain == number]
        step = ends[:, 1] - ends[:, 0]
        if np.abs(step.sum(axis=0)).max() > _BESIDE * np.abs(step).sum(axis=0).max():
            continue
        a, b = ends[:, 0] - ends[0, 0], ends[:, 1] - ends[0, 0]
        if (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum() > 0.0:
            return int(number)
    return -1


def _beside(border: Border, outer: int, periods: Array) -> Border:
    """Holes moved by whole periods to where they are holes of the outer chain."""
    if not periods.any():
        return border
    ends = border.ends.copy()
    polygon = ends[border.chain == outer]
    ways_in_turns = sorted(product(range(-3, 4), repeat=2), key=lambda way: abs(way[0]) + abs(way[1]))
    order = [np.array(way) for way in ways_in_turns]
    for number in np.unique(border.chain):
        own = border.chain == number
        ways = (way * periods for way in order if (periods[way != 0] > 0.0).all())
        if number != outer:
            ends[own] += next((way for way in ways if _winding(polygon, ends[own][0, 0] + way)), np.zeros(2))
    return replace(border, ends=ends)


def _linked(border: Border, box: Array) -> Border:
    """Ends that follow each other, or stand on a side of the box, equal to the last bit."""
    ends = border.ends.copy()
    reach = _SAME * (box[1] - box[0])
    for side in box:
        ends = np.where(np.abs(ends - side) <= reach, side, ends)
    after = ends[border.following, 0]
    near = (np.abs(ends[:, 1] - after) <= reach).all(axis=1)
    ends[near, 1] = after[near]
    return replace(border, ends=ends)


def unrolled(border: Border) -> Sheet:
    """Lay out a boundary that has one segment at least.

    A face within one outer loop keeps its coordinates, which may run beyond the domain. Any other is cut along
    lines u = constant and v = constant in the directions in which the surface is closed.
    """
    surface: NurbsSurface = border.face.surface
    domain = np.array(surface.domain).T
    periods = np.where(surface.closed, domain[1] - domain[0], 0.0)
    outer = _outer(border)
    if outer >= 0:
        border = _beside(border, outer, periods)
        box = np.stack([border.ends.min(axis=(0, 1)), border.ends.max(axis=(0, 1))])
        return Sheet(_linked(border, box), box, (False, False), ())
    box = np.stack([border.ends.min(axis=(0, 1)), border.ends.max(axis=(0, 1))])
    poles: list[tuple[int, int]] = []
    for d in (0, 1):
        if periods[d] > 0.0:
            value = _place_of_cut(border.ends[..., d], domain[0, d], periods[d])
            first, last = np.floor((box[:, d] - value) / periods[d])
            for turn in np.arange(first, last + 2.0):
                border = crossed(border, d, value + turn * periods[d])
            ends = border.ends.copy()
            turns = np.floor((ends[..., d].mean(axis=1) - value) / periods[d])
            ends[..., d] -= (turns * periods[d])[:, None]
            border = replace(border, ends=ends)
            box[:, d] = value, value + periods[d]
    for side in pole_sides(surface):
        d, end = divmod(side, 2)
        if surface.closed[1 - d] and _reaches(border.ends, d, end):
            box[end, d] = domain[end, d]
            poles.append((d, end))
    return Sheet(_linked(border, box), box, surface.closed, tuple(poles))


def _reaches(ends: Array, direction: int, end: int) -> bool:
    """Whether a face goes on, beyond all segments, to the low or high end of a direction; the other one is cut."""
    along, across = ends[..., 1 - direction], ends[..., direction]
    longest = np.abs(along[:, 1] - along[:, 0]).argmax()
    at = along[longest].mean()
    met = (along.min(axis=1) <= at) & (at < along.max(axis=1))
    part = (at - along[met, 0]) / (along[met, 1] - along[met, 0])
    place = (1.0 - part) * across[met, 0] + part * across[met, 1]
    last = place.argmax() if end else place.argmin()
    forward = along[met, 1][last] > along[met, 0][last]
    # To the left of a step along u is high v, of one along v low u.
    return bool(forward == ((direction == 1) == (end == 1)))
