"""Closed surfaces opened where a face does not go round them.

A face that lies on a cylinder without going round it needs no seam, wherever it lies and however often it winds: it
is a face of a strip of the unrolled cylinder that reaches a little beyond it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.seams.region_pieces import Piece, Uncut, shifted
from assembly.geometry.splines import bezier
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["opened", "strip"]

Array = NDArray[np.float64]
# How far a strip reaches beyond a region, as a part of its extent.
_SLACK = 1.0 / 32.0
# Parts of a span within which a strip ends at the span's end.
_NEAR = 1e-6


def strip(surface: NurbsSurface, axis: int, low: float, high: float) -> NurbsSurface:
    """The part between two parameters of a surface that is closed in u (axis 0) or v (1), unrolled.

    The parameters may lie beyond the domain, and more than a period apart.
    """
    weights = surface.weights[..., None]
    net = np.moveaxis(np.concatenate([surface.control_points * weights, weights], axis=2), axis, 0)
    degree, knots = surface.degree[axis], surface.knots[axis]
    spans, at = bezier.pieces(net, knots, degree), bezier.breaks(knots, degree)
    period = at[-1] - at[0]
    pieces: list[Array] = []
    ends: list[float] = []
    for turn in range(int(np.floor((low - at[0]) / period)), int(np.ceil((high - at[0]) / period))):
        for piece, a, b in zip(spans, at[:-1] + turn * period, at[1:] + turn * period, strict=True):
            near = _NEAR * (b - a)
            if b <= low + near or a >= high - near:
                continue
            first, last = (low if low > a + near else a), (high if high < b - near else b)
            if last < b:
                piece = bezier.divided(piece, (last - a) / (b - a))[0]
            if first > a:
                piece = bezier.divided(piece, (first - a) / (last - a))[1]
            ends = [*ends, last] if ends else [first, last]
            pieces.append(piece)
    points = np.moveaxis(bezier.joined(np.array(pieces)), 0, axis)
    both, degrees = [*surface.knots], surface.degree
    both[axis] = bezier.full_knots(np.array(ends), degree)
    return NurbsSurface(points[..., :3] / points[..., 3:], both, degrees, points[..., 3])


def _continuous(row: list[Piece], around: tuple[float, float]) -> Array:
    """Move pieces by whole periods to where the ones before them end; the way from the start to the end."""
    for before, piece in zip(row, row[1:], strict=False):
        gap = before.ends[1] - piece.ends[0]
        shift = np.array([round(g / t) * t if t else 0.0 for g, t in zip(gap, around, strict=True)])
        if shift.any():
            shifted(piece, shift)
    way: Array = row[-1].ends[1] - row[0].ends[0]
    return way


def corners_of(row: list[Piece]) -> Array:
    """Points along a chain (n, 2)."""
    return np.concatenate([piece.curve.evaluate(np.linspace(*piece.curve.domain, 17)[:-1]) for piece in row])


def area_of(corners: Array) -> float:
    x, y = corners.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def winds(corners: Array, point: Array) -> bool:
    """Whether a polygon goes round a point."""
    x, y = (corners - point).T
    turn = np.diff(np.unwrap(np.arctan2(np.append(y, y[0]), np.append(x, x[0])))).sum()
    return bool(abs(turn) > np.pi)


def opened(chains: list[list[Piece]], surface: NurbsSurface, axis: int) -> NurbsSurface:
    """The surface opened in a direction in which the region does not go round it, and the chains moved onto it."""
    low, high = surface.domain[axis]
    around = surface._periods
    period = around[axis]
    turns = [_continuous(row, around) for row in chains]
    corners = [corners_of(row) for row in chains]
    # Which way chains go round in the other direction, seen so that the material is above where it is positive.
    way = 1.0 if axis == 1 else -1.0
    rings = [way * turn[1 - axis] for turn in turns]
    if any(abs(turn[axis]) > 0.5 * period for turn in turns):
        return surface
    if around[1 - axis] and any(abs(ring) > 0.5 * around[1 - axis] for ring in rings):
        bottom = next(k for k, ring in enumerate(rings) if ring > 0.5 * around[1 - axis])
        top = next(k for k, ring in enumerate(rings) if ring < -0.5 * around[1 - axis])
        start = corners[bottom][:, axis].min()
        # The next time round above the bottom.
        rise = (corners[top][:, axis].mean() - corners[bottom][:, axis].mean()) % period
        shift = corners[bottom][:, axis].mean() + rise - corners[top][:, axis].mean()
        frame = [bottom, top]
        _shift_all(chains[top], axis, shift)
        bounds = start, corners[top][:, axis].max() + shift
    else:
        outer = [k for k, each in enumerate(corners) if area_of(each) > 0.0]
        if not outer:
            return surface
        frame = outer[:1]
        bounds = corners[outer[0]][:, axis].min(), corners[outer[0]][:, axis].max()
    for k, row in enumerate(chains):
        if k in frame:
            continue
        middle = corners[k][0].copy()
        turns_of = np.arange(
            np.ceil((bounds[0] - middle[axis]) / period), np.floor((bounds[1] - middle[axis]) / period) + 1
        )
        for turn in turns_of:
            there = middle.copy()
            there[axis] += turn * period
            if len(frame) == 2 or winds(corners[frame[0]], there):
                _shift_all(row, axis, turn * period)
                break
        else:
            raise Uncut("a hole of it lies outside of its outer loop")
    slack = _SLACK * (bounds[1] - bounds[0])
    return strip(surface, axis, bounds[0] - slack, bounds[1] + slack)


def _shift_all(row: list[Piece], axis: int, by: float) -> None:
    step = np.zeros(2)
    step[axis] = by
    for piece in row:
        shifted(piece, step)
