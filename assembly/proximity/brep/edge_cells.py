"""Balls around parts of an edge S(c(t)), and the cells of a surface that a trim leaves out; both are proven.

Over [t_low, t_high] the Bezier points of the plane curve span a box in (u, v) that holds it; cut to this box, the
Bezier points of the surface span a hull that holds the surface over the box (positive weights; Piegl & Tiller, The
NURBS Book, P1.10 and P4.9), and so the edge.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import read_only
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface

__all__ = [
    "CLEAR",
    "ENTERED",
    "OUTSIDE",
    "BoxParts",
    "box_hulls",
    "box_parts",
    "box_sides",
    "curve_boxes",
    "edge_cells",
    "first_cells",
    "interval_parts",
    "outside_cells",
]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
# At least so many cells an edge, of balls no larger than this part of the edge's length while there are not too many.
_LEAST, _MOST, _PART = 16, 256, 0.0625
# Rounding of parameters and of points, relative: boxes and balls must contain, not nearly contain.
_ROUNDING = 1e-14
# Of a box: whether all of it is inside the trim, all of it outside, or a boundary curve may enter it.
CLEAR, OUTSIDE, ENTERED = 0, 1, 2
# Boxes looked at together.
_ROWS = 2048


def _restricted(points: Array, axis: int, low: Array, high: Array) -> Array:
    """Bezier points of pieces (n, ...) over [low, high] of [0, 1] along an axis, by their blossoms.

    The intervals may be single points, and may reach beyond [0, 1].
    """
    row = np.moveaxis(points, axis, 1)
    degree = row.shape[1] - 1
    shape = (-1,) + (1,) * (row.ndim - 1)
    ends = low.reshape(shape), high.reshape(shape)
    result = np.empty_like(row)
    for k in range(degree + 1):
        values = row
        for r in range(degree):
            x = ends[r >= degree - k]
            values = (1.0 - x) * values[:, :-1] + x * values[:, 1:]
        result[:, k] = values[:, 0]
    return np.moveaxis(result, 1, axis)


def first_cells(curve: NurbsCurve) -> Array:
    """Cells (n, 2), t_low and t_high: the spans of a curve in equal parts, 16 or more together."""
    at = curve.breaks()
    parts = -(-_LEAST // (at.size - 1))
    low = (at[:-1, None] + np.diff(at)[:, None] * (np.arange(parts) / parts)).ravel()
    return np.column_stack([low, np.append(low[1:], at[-1])])


def curve_boxes(curve: NurbsCurve, cells: Array) -> Array:
    """Boxes (n, 4) around a plane curve over cells (n, 2) that each lie in one span: u_low, u_high, v_low, v_high."""
    at = curve.breaks()
    span = np.clip(np.searchsorted(at, 0.5 * cells.sum(axis=1), side="right") - 1, 0, at.size - 2)
    x = (cells - at[span, None]) / np.diff(at)[span, None]
    points = _restricted(curve.bezier_pieces()[span], 1, x[:, 0], x[:, 1])
    plane = points[..., :2] / points[..., 2:]
    low, high = plane.min(axis=1), plane.max(axis=1)
    slack = _ROUNDING * np.abs(curve.control_points).max(axis=0)
    low, high = low - slack, high + slack
    return np.column_stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]])


def interval_parts(low: Array, high: Array, at: Array, closed: bool) -> tuple[Indices, Indices, Array, Array]:
    """Intervals of one parameter as parts of spans: interval, span, and from where to where in [0, 1] of the span.

    Sorted by interval. In a closed direction they are wrapped; in an open one, reaching out, they include the end.
    """
    owner = np.arange(low.size)
    if closed:
        period = at[-1] - at[0]
        turns = np.floor((low - at[0]) / period)
        low, high = np.maximum(low - turns * period, at[0]), high - turns * period
        whole = high - low >= period
        low, high = np.where(whole, at[0], low), np.where(whole, at[-1], high)
        over = high > at[-1]
        owner = np.concatenate([owner, owner[over]])
        wrapped = high[over] - period
        low, high = np.concatenate([low, np.full(wrapped.size, at[0])]), np.concatenate([high, wrapped])
        # What is left below the seam; above it begins the other part.
        high[: over.size] = np.minimum(high[: over.size], at[-1])
    else:
        low, high = np.minimum(low, at[-1]), np.maximum(high, at[0])
    spans = at.size - 1
    first = np.clip(np.searchsorted(at, low, side="right") - 1, 0, spans - 1)
    last = np.maximum(np.clip(np.searchsorted(at, high, side="left") - 1, 0, spans - 1), first)
    count = last - first + 1
    entry = np.repeat(np.arange(owner.size), count)
    span = first[entry] + np.arange(entry.size) - np.repeat(np.cumsum(count) - count, count)
    # Beyond the ends of the domain the end spans go on.
    start = np.where(span == first[entry], low[entry], at[span])
    stop = np.where(span == last[entry], high[entry], at[span + 1])
    width = np.diff(at)[span]
    order = np.argsort(owner[entry], kind="stable")
    x0, x1 = (start - at[span]) / width, (stop - at[span]) / width
    return owner[entry][order], span[order], x0[order], x1[order]


class BoxParts(NamedTuple):
    """Boxes cut at the knots: of every part its box, its spans, and from where to where in their unit squares."""

    owner: Indices
    span_u: Indices
    span_v: Indices
    box: Array


def box_parts(surface: NurbsSurface, boxes: Array) -> BoxParts:
    """The parts of boxes (n, 4) in (u, v), in the order of the boxes; every box has one at least."""
    at_u, at_v = surface.breaks()
    closed_u, closed_v = surface.closed
    owner_u, span_u, u0, u1 = interval_parts(boxes[:, 0], boxes[:, 1], at_u, closed_u)
    owner_v, span_v, v0, v1 = interval_parts(boxes[:, 2], boxes[:, 3], at_v, closed_v)
    # Every part in u with every part in v of the same box.
    count = np.bincount(owner_v, minlength=len(boxes))
    start = np.cumsum(count) - count
    i = np.repeat(np.arange(owner_u.size), count[owner_u])
    first = np.cumsum(count[owner_u]) - count[owner_u]
    j = start[owner_u[i]] + np.arange(i.size) - first[i]
    return BoxParts(owner_u[i], span_u[i], span_v[j], np.column_stack([u0[i], u1[i], v0[j], v1[j]]))


def box_hulls(surface: NurbsSurface, boxes: Array) -> tuple[Array, Indices]:
    """Bezier points (m, k, 3) of a surface over the parts of boxes (n, 4), and the box of each part."""
    parts = box_parts(surface, boxes)
    points = surface.bezier_pieces()[parts.span_u, parts.span_v]
    points = _restricted(_restricted(points, 1, *parts.box.T[:2]), 2, *parts.box.T[2:])
    return (points[..., :3] / points[..., 3:]).reshape(len(points), -1, 3), parts.owner


def _balls(surface: NurbsSurface, boxes: Array) -> tuple[Array, Array]:
    """Centers (n, 3) and radii (n,) of balls around a surface over boxes (n, 4)."""
    xyz, owner = box_hulls(surface, boxes)
    begins = np.flatnonzero(np.diff(owner, prepend=-1))
    low = np.minimum.reduceat(xyz.min(axis=1), begins)
    high = np.maximum.reduceat(xyz.max(axis=1), begins)
    center = 0.5 * (low + high)
    reach = np.sqrt(((xyz - center[owner][:, None]) ** 2).sum(axis=2).max(axis=1))
    radius = np.maximum.reduceat(reach, begins)
    extent = float(np.abs(surface.control_points).max())
    return center, radius + 4.0 * _ROUNDING * (radius + extent)


def edge_cells(surface: NurbsSurface, curves: Sequence[NurbsCurve], lengths: Sequence[float]) -> list[Array]:
    """Cells of edges S(c(t)) on one surface.

    Parameters
    ----------
    surface
    curves
        Plane curves in its parameters.
    lengths
        Of the edges: balls are halved until they are small against them, or there are many.

    Returns
    -------
    list of (n, 6)
        For every curve rows of t_low, t_high, center (3) and radius, in the order of t.
    """
    cells = [first_cells(curve) for curve in curves]
    done: list[list[Array]] = [[] for _ in curves]
    counts = [len(cell) for cell in cells]
    while any(len(cell) for cell in cells):
        boxes = [curve_boxes(curve, cell) for curve, cell in zip(curves, cells, strict=True)]
        center, radius = _balls(surface, np.concatenate(boxes))
        at = 0
        for k, cell in enumerate(cells):
            rows = np.column_stack([cell, center[at : at + len(cell)], radius[at : at + len(cell)]])
            at += len(cell)
            workspace = max(_MOST - counts[k], 0)
            large = np.flatnonzero(rows[:, 5] > _PART * lengths[k])
            large = large[np.argsort(-rows[large, 5], kind="stable")][:workspace]
            kept = np.ones(len(rows), dtype=bool)
            kept[large] = False
            done[k].append(rows[kept])
            counts[k] += large.size
            middle = cell[large].mean(axis=1)
            cells[k] = np.concatenate(
                [np.column_stack([cell[large, 0], middle]), np.column_stack([middle, cell[large, 1]])]
            )
    joined = [np.concatenate(rows) for rows in done]
    return [rows[np.argsort(rows[:, 0])] for rows in joined]


def _touching(low: Array, high: Array, other_low: Array, other_high: Array, period: float | None) -> NDArray[np.bool_]:
    """(n, m): which intervals of the first kind meet which of the second, whole periods apart where there is one."""
    if period is None:
        return np.asarray((low[:, None] <= other_high) & (other_low <= high[:, None]))
    # The second one is moved up by as few periods as take its end to the first one's beginning.
    lift = np.ceil((low[:, None] - other_high) / period) * period
    return np.asarray(other_low + lift <= high[:, None])


@lru_cache(maxsize=64)
def _boundary_boxes(face: Face) -> Array:
    """Boxes (n, 4) in (u, v) around the parts of a face's boundary; they are asked for whenever patches are halved."""
    curves = [curve_boxes(curve, first_cells(curve)) for curve in face.boundary]
    return read_only(np.concatenate([np.empty((0, 4)), *curves]))


def box_sides(face: Face, boxes: Array) -> Indices:
    """Where boxes (n, 4) of u from and to, v from and to, are: all inside a face's trim, all outside, or neither.

    A box that no boundary curve enters is on one side: that of its middle.
    """
    surface = face.surface
    edges = _boundary_boxes(face)
    if not len(edges):
        return np.full(len(boxes), CLEAR)
    sides = np.full(len(boxes), ENTERED)
    for start in range(0, len(boxes), _ROWS):
        rows = boxes[start : start + _ROWS]
        meets = np.ones((len(rows), len(edges)), dtype=bool)
        for k in range(2):
            low, high = surface.domain[k]
            period = high - low if surface.closed[k] else None
            slack = _ROUNDING * max(abs(low), abs(high))
            first, last = rows[:, 2 * k] - slack, rows[:, 2 * k + 1] + slack
            meets &= _touching(first, last, edges[:, 2 * k], edges[:, 2 * k + 1], period)
        clear = np.flatnonzero(~meets.any(axis=1))
        middle_u, middle_v = 0.5 * (rows[clear, 0] + rows[clear, 1]), 0.5 * (rows[clear, 2] + rows[clear, 3])
        sides[start + clear] = np.where(face.locate(middle_u, middle_v) < 0, OUTSIDE, CLEAR)
    return sides


def outside_cells(face: Face, rows: Array) -> NDArray[np.bool_]:
    """Which cells (n, CELL_SIZE) of a face's surface (`geometry/splines/cells.py`) lie wholly outside its trim."""
    u, v, half_u, half_v = rows[:, 0], rows[:, 1], rows[:, 9], rows[:, 10]
    return np.asarray(box_sides(face, np.column_stack([u - half_u, u + half_u, v - half_v, v + half_v])) == OUTSIDE)
