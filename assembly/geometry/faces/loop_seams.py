"""Loops without the seams of closed surfaces and without edges that are one point, in chains."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.loop import Loop, all_ends, curve_ends
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["SLACK", "segment", "without_seams"]

Array = NDArray[np.float64]
# How far beyond the domain, or off a pole edge or a seam, a curve may be, as a part of the domain.
SLACK = 1e-9


def segment(start: Array, end: Array) -> NurbsCurve:
    """A line in the plane with speed one."""
    length = float(np.linalg.norm(np.subtract(end, start)))
    return NurbsCurve(np.array([start, end]), [0.0, 0.0, length, length], 1)


def _pole_edges(surface: NurbsSurface) -> list[tuple[int, float]]:
    """Axis and value of the edges of the domain that are one point."""
    ends = [(axis, surface.domain[axis][side]) for axis in range(2) for side in range(2)]
    return [end for k, end in enumerate(ends) if surface._pole_bits >> k & 1]


def _on_line(curve: NurbsCurve, axis: int, value: float, slack: float) -> bool:
    return bool(np.abs(curve.control_points[:, axis] - value).max() <= slack)


def _are_seam(a: NurbsCurve, b: NurbsCurve, period: Array, slack: Array) -> bool:
    """Whether b runs back along a, one period away."""
    ends_a, ends_b = curve_ends(a), curve_ends(b)[::-1]
    jump = ends_b - ends_a
    whole = np.where(period > 0.0, np.round(jump / np.where(period > 0.0, period, 1.0)) * period, 0.0)
    if not whole.any() or (np.abs(jump - whole) > slack).any():
        return False
    # Straight lines along the edge of the domain, or the same curve point by point.
    axis = int(np.argmax(np.abs(whole[0])))
    if _on_line(a, axis, ends_a[0, axis], slack[axis]) and _on_line(b, axis, ends_b[0, axis], slack[axis]):
        return True
    part = np.linspace(0.0, 1.0, 9)
    points = a.evaluate(a.domain[0] + part * (a.domain[1] - a.domain[0]))
    others = b.evaluate(b.domain[1] - part * (b.domain[1] - b.domain[0]))
    return bool((np.abs(others - points - whole[0]) <= slack).all())


def _straight_chains(loop: Loop, surface: NurbsSurface) -> list[tuple[list[NurbsCurve], Array]] | None:
    """Chains of a loop of lines that runs along seams to and fro, each with the way from its start to its end.

    As most full cylinders have it. None where what is left of the loop between its seams does not close exactly, or
    a curve is no line.
    """
    curves, count = loop.curves, len(loop.curves)
    if not all(curve.degree == 1 and len(curve.control_points) == 2 and curve._is_clamped for curve in curves):
        return None
    ends = [curve.control_points.ravel().tolist() for curve in curves]
    periods, slack = surface._periods, [SLACK * (high - low) for low, high in surface.domain]
    keep = [True] * count

    def whole(jump: float, axis: int) -> float:
        return round(jump / periods[axis]) * periods[axis] if periods[axis] else 0.0

    for k, (a, b, c, d) in enumerate(ends):
        for other in range(k + 1, count):
            x, y, z, w = ends[other]
            # From one to the other, run back: both ends one and the same number of periods away.
            way = whole(z - a, 0), whole(w - b, 1)
            is_same = way == (whole(x - c, 0), whole(y - d, 1))
            off = max(abs(z - a - way[0]), abs(x - c - way[0])), max(abs(w - b - way[1]), abs(y - d - way[1]))
            if keep[k] and keep[other] and any(way) and is_same and off[0] <= slack[0] and off[1] <= slack[1]:
                keep[k] = keep[other] = False
    if all(keep):
        return [(list(curves), loop.turn)]
    # Runs of what is left, the last one before the first.
    rows: list[list[int]] = []
    for k in range(count):
        if keep[k]:
            if rows and k > 0 and keep[k - 1]:
                rows[-1].append(k)
            else:
                rows.append([k])
    if len(rows) > 1 and keep[0] and keep[-1]:
        rows[0] = rows.pop() + rows[0]
    chains = []
    for row in rows:
        if any(ends[k][2:] != ends[m][:2] for k, m in zip(row[:-1], row[1:], strict=True)):
            return None
        (u, v), (x, y) = ends[row[0]][:2], ends[row[-1]][2:]
        turn = (whole(x - u, 0), whole(y - v, 1))
        turns = [abs(way / period) for way, period in zip(turn, periods, strict=True) if period]
        if (x - u, y - v) != turn or sum(turns) > 1.0:
            return None
        chains.append(([curves[k] for k in row], np.array(turn)))
    return chains


def without_seams(loop: Loop, surface: NurbsSurface) -> tuple[list[tuple[list[NurbsCurve], Array]], list[NurbsCurve]]:
    """Chains of a loop (with the way from their start to their end if that is whole periods), and pole edges."""
    curves = list(loop.curves)
    if not surface._pole_bits and not any(surface._periods):
        return [(curves, loop.turn)], []
    if not surface._pole_bits and (chains := _straight_chains(loop, surface)) is not None:
        return chains, []
    slack = SLACK * np.ptp(np.array(surface.domain), axis=1)
    period = np.array(surface._periods)
    silent: list[NurbsCurve] = []
    keep = np.ones(len(curves), dtype=bool)
    for axis, value in _pole_edges(surface):
        for k, curve in enumerate(curves):
            if keep[k] and _on_line(curve, axis, value, slack[axis]):
                keep[k] = False
                ends = curve_ends(curve)
                ends[:, axis] = value
                silent.append(segment(*ends))
    if period.any():
        ends = all_ends(curves)
        jump = ends[None, :, ::-1] - ends[:, None]
        whole = np.where(period > 0.0, np.round(jump / np.where(period > 0.0, period, 1.0)) * period, 0.0)
        for k, other in np.argwhere((np.abs(jump - whole) <= slack).all(axis=(2, 3))).tolist():
            if k < other and keep[k] and keep[other] and _are_seam(curves[k], curves[other], period, slack):
                keep[k] = keep[other] = False
    if keep.all():
        return [(curves, loop.turn)], silent
    # Runs of what is left, then linked where one ends at the start of another.
    count = len(curves)
    runs: list[list[NurbsCurve]] = []
    for k in range(count):
        if keep[k]:
            if runs and keep[k - 1] and k > 0:
                runs[-1].append(curves[k])
            else:
                runs.append([curves[k]])
    if len(runs) > 1 and keep[0] and keep[-1]:
        runs[0] = runs.pop() + runs[0]
    whole = np.where(period > 0.0, period, 1.0)
    reach = max(loop.tolerance, SLACK) * loop.size

    def apart(a: list[NurbsCurve], b: list[NurbsCurve]) -> Array:
        jump = curve_ends(a[-1])[1] - curve_ends(b[0])[0]
        return np.asarray(jump - np.where(period > 0.0, np.round(jump / whole) * period, 0.0))

    chains = []
    while runs:
        chain = runs.pop(0)
        while np.abs(apart(chain, chain)).max() > reach:
            follows = [k for k, run in enumerate(runs) if np.abs(apart(chain, run)).max() <= reach]
            if not follows:
                break
            chain = chain + runs.pop(follows[0])
        # Joined once more: by whole periods, and exactly at the new corners.
        if np.abs(apart(chain, chain)).max() <= reach:
            joined = Loop.unchecked(chain, 2.0 * reach / loop.size, surface._periods, "loop")
            chains.append((list(joined.curves), joined.turn))
        else:
            chains.append((chain, np.full(2, np.nan)))
    return chains, silent
