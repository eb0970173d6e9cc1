"""Parts of curves: a curve over an interval of its domain, and where a curve has corners."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.splines import bezier
from assembly.geometry.splines.curve import NurbsCurve

__all__ = ["CORNER", "between", "crease_knots", "sampled", "smooth_parts"]

Array = NDArray[np.float64]
# A jump of the tangent by more than this makes a corner [rad].
CORNER = 1e-6
# Parameters closer than this part of the domain are one: a piece between them would be too short for doubles.
_SNAP = 1e-10


def sampled(breaks: Array, count: int) -> Array:
    """Parameters between breaks, with the breaks."""
    return np.unique(np.linspace(breaks[:-1], breaks[1:], count))


def between(curve: NurbsCurve, low: float, high: float) -> NurbsCurve:
    """The part of a curve over [low, high] of its domain, in the same parameter.

    Ends that all but meet a knot are moved to it. Interior knots get full multiplicity.
    """
    at = curve.breaks()
    ends = []
    for t in (low, high):
        near = at[np.argmin(np.abs(at - t))]
        ends.append(float(near) if abs(near - t) <= _SNAP * (at[-1] - at[0]) else t)
    low, high = ends
    first = int(np.searchsorted(at, low, side="right")) - 1
    last = int(np.searchsorted(at, high, side="left"))
    pieces = curve.bezier_pieces()[first:last].copy()
    breaks = at[first : last + 1].copy()
    if high < breaks[-1]:
        pieces[-1] = bezier.divided(pieces[-1], (high - breaks[-2]) / (breaks[-1] - breaks[-2]))[0]
        breaks[-1] = high
    if low > breaks[0]:
        # The first piece may be the last one too, and has a new end then.
        pieces[0] = bezier.divided(pieces[0], (low - breaks[0]) / (breaks[1] - breaks[0]))[1]
        breaks[0] = low
    points = bezier.joined(pieces)
    knots = bezier.full_knots(breaks, curve.degree)
    return NurbsCurve(points[:, :-1] / points[:, -1:], knots, curve.degree, points[:, -1], name=curve.name)


def crease_knots(curve: NurbsCurve) -> Array:
    """Knots inside the domain where a curve need not be smooth: those as often there as the degree."""
    low, high = curve.domain
    inner = curve.knots[(curve.knots > low) & (curve.knots < high)]
    if inner.size < curve.degree:
        return np.empty(0)
    last = inner[curve.degree - 1 :]
    return np.unique(last[last == inner[: last.size]])


def smooth_parts(curve: NurbsCurve) -> list[NurbsCurve]:
    """A plane curve cut at its corners."""
    at = crease_knots(curve)
    if not at.size:
        return [curve]
    pieces = curve.bezier_pieces()
    points = pieces[..., :2] / pieces[..., 2:]
    behind = np.searchsorted(curve.breaks(), at) - 1
    before, after = points[behind, -1] - points[behind, -2], points[behind + 1, 1] - points[behind + 1, 0]
    turn = np.arctan2(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0], (before * after).sum(axis=1))
    at = at[np.abs(turn) > CORNER]
    if not at.size:
        return [curve]
    ends = [curve.domain[0], *at.tolist(), curve.domain[1]]
    return [between(curve, low, high) for low, high in zip(ends[:-1], ends[1:], strict=True)]
