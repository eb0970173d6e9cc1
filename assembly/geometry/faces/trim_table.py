"""The table of a trim: boundary curves cut into pieces, moved into one cell of the periods, as kernels read them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly._record import place_of, rows_of
from assembly.geometry.faces.crossing import first_crossing
from assembly.geometry.faces.monotone import ROW, cut_curves
from assembly.geometry.faces.trim import windings
from assembly.geometry.faces.trim_pieces import (
    FRAME,
    PIECE_BOUNDS,
    PIECE_DOUBLES,
    PIECE_INTS,
    PIECE_LINKS,
    TRIM,
    TRIM_RECORD,
    cut_of_piece,
    ends_of_pieces,
    trim_at,
    trim_frame_at,
)
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.curve_packing import packed_curves
from assembly.geometry.splines.evaluate import CURVE_BREAKS, CURVE_COEFFICIENTS, CURVE_DEGREE, CURVE_RECORD, CURVE_SPANS

__all__ = ["TrimTable", "build"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
# A point this part of the boundary's size from it is on it.
ON_BOUNDARY = 1e-12
# Some roundings of a coordinate, as a part of it.
NOISE = 1e-14
# What is the place of something else, of a trim in the table and in the pool, and of a piece in the pool.
_IN_TABLE = [place_of(TRIM, field) for field in ("first", "piece_table", "curve_pieces")]
_IN_POOL = [place_of(TRIM, field) for field in ("piece_pool", "frame", "step_pool")]
_COEFFICIENTS = place_of(PIECE_LINKS, "coefficients")
_BINOMIALS = np.array([[comb(n, k) for k in range(32)] for n in range(32)], dtype=float)


@dataclass(frozen=True, eq=False)
class TrimTable:
    """A trim for a table and a pool that begin with it.

    Attributes
    ----------
    table, pool : arrays
    curves, pieces : int
    left, right : (chains,)
        w beside every chain: 1 and 0 if the chains bound one face.
    beyond : two pairs
        w beyond the low and the high end of u, and of v, each where the other direction is closed.
    """

    table: Ints
    pool: Array
    curves: int
    pieces: int
    left: Array
    right: Array
    beyond: tuple[tuple[float, float], tuple[float, float]]

    def at(self, table_at: int, pool_at: int) -> tuple[Ints, Array]:
        """The same for being appended to a table and a pool of these lengths."""
        if table_at == 0 and pool_at == 0:
            return self.table, self.pool
        table = self.table.copy()
        record = trim_at(table, 0)
        pieces = record.piece_table + _COEFFICIENTS
        table[pieces : pieces + PIECE_INTS * self.pieces : PIECE_INTS] += pool_at
        stop = TRIM_RECORD + CURVE_RECORD * self.curves
        for place in (CURVE_BREAKS, CURVE_COEFFICIENTS):
            table[TRIM_RECORD + place : stop : CURVE_RECORD] += pool_at
        table[_IN_TABLE] += table_at
        table[_IN_POOL] += pool_at
        return table, self.pool

    def rows(self) -> tuple[Any, Any]:
        """Integers and doubles of all pieces, a record each."""
        return _pieces(self.table, self.pool, self.pieces)

    @property
    def extent(self) -> float:
        """Size of the boundary in (u, v)."""
        return float(trim_frame_at(self.pool, trim_at(self.table, 0).frame).extent)

    def nearness(self, tolerance: float) -> float:
        """At which distance curves touch: this part of the size, or what is rounding."""
        boxes = self.rows()[1].box[: trim_at(self.table, 0).pieces]
        return max(tolerance * self.extent, NOISE * float(np.abs(boxes).max(initial=0.0)))

    def crossing(self, tolerance: float, joined: bool = False) -> tuple[int, int, Array] | None:
        """Two boundary curves that cross, or come nearer than this part of the size, and where; None if none do.

        Curves may meet where one follows the other; if they are joined, at all of their ends.
        """
        record = trim_at(self.table, 0)
        frame = trim_frame_at(self.pool, record.frame)
        links, bounds = self.rows()
        boxes = bounds.box[: record.pieces]
        low = boxes[:, [0, 2]]
        nearest = self.nearness(tolerance)
        pieces, moves = np.arange(record.pieces), np.zeros((record.pieces, 2))
        cell = (frame.low_u, frame.period_u), (frame.low_v, frame.period_v)
        for axis, (begin, period) in enumerate(cell):
            if period:
                # What touches the lower border of the cell meets what touches the upper one.
                touches = low[pieces, axis] <= begin + nearest
                pieces = np.concatenate([pieces, pieces[touches]])
                copies = moves[touches]
                copies[:, axis] += period
                moves = np.concatenate([moves, copies])
        order = np.argsort(low[pieces, 0] + moves[:, 0])
        pieces, moves = pieces[order], np.ascontiguousarray(moves[order])
        where = np.empty(2)
        a, b = first_crossing(self.table, self.pool, pieces, moves, nearest, joined, where)
        return None if a < 0 else (int(links.curve[a]), int(links.curve[b]), where)


def _pieces(table: Ints, pool: Array, count: int) -> tuple[Any, Any]:
    """Integers and doubles of the pieces of a trim at the start of a table, a record each."""
    record = trim_at(table, 0)
    ints = table[record.piece_table :][: PIECE_INTS * count].reshape(-1, PIECE_INTS)
    doubles = pool[record.piece_pool :][: PIECE_DOUBLES * count].reshape(-1, PIECE_DOUBLES)
    return rows_of(PIECE_LINKS, ints), rows_of(PIECE_BOUNDS, doubles)


def _largest_gap(low: Array, high: Array, period: float) -> float:
    """The middle of the widest stretch of a period without an end of an interval, uncovered if there is one."""
    ends = np.concatenate([low, high])
    marks = np.unique(np.mod(ends, period))
    middles = marks + 0.5 * np.diff(marks, append=marks[0] + period)
    widths = np.diff(marks, append=marks[0] + period)
    covered = ((middles[:, None] - low) % period < high - low).any(axis=1)
    free = widths * ~covered
    best = int(np.argmax(free)) if (free > 1e-6 * period).any() else int(np.argmax(widths))
    return float(middles[best])


class _Pieces:
    """Pieces while they are made: columns of equal length, in the order of the curves."""

    COLUMNS = ("curve", "degree", "coefficients", "middle", "bounds", "shift", "t", "ends", "before", "after")

    def __init__(self, curves: Sequence[NurbsCurve], chains: Sequence[range], closing: Sequence[bool]) -> None:
        bezier, self.pool, self.records = packed_curves(curves)
        shape = np.ascontiguousarray(self.records[:, [CURVE_DEGREE, CURVE_SPANS]])
        breaks = np.concatenate(
            [np.empty(0)] + [self.pool[r[CURVE_BREAKS] : r[CURVE_COEFFICIENTS]] for r in self.records.tolist()]
        )
        rows = np.empty((int((8 * shape[:, 0] * shape[:, 1]).sum()), ROW))
        count = cut_curves(bezier, breaks, shape, _BINOMIALS, rows)
        if count > len(rows):
            # Weights far apart.
            rows = np.empty((count, ROW))
            cut_curves(bezier, breaks, shape, _BINOMIALS, rows)
        rows = rows[:count].copy()
        self.curve = rows[:, 0].astype(np.int64)
        span = rows[:, 1].astype(np.int64)
        record = self.records[self.curve]
        self.degree = np.ascontiguousarray(record[:, CURVE_DEGREE])
        self.coefficients = record[:, CURVE_COEFFICIENTS] + 4 * (self.degree + 1) * span
        at = record[:, CURVE_BREAKS] + span
        self.middle = 0.5 * (self.pool[at] + self.pool[at + 1])
        self.t = rows[:, 2:4].copy()
        self.bounds = rows[:, 4:7]
        self.shift = np.zeros((len(rows), 2))
        self.ends = np.empty((len(rows), 2, 2))
        for side in range(2):
            out = np.empty((len(rows), 2))
            ends_of_pieces(self.pool, self.coefficients, self.degree, self.middle, self.t[:, side].copy(), out)
            self.ends[:, side] = out
        self._neighbors(chains, closing)

    def _neighbors(self, chains: Sequence[range], closing: Sequence[bool]) -> None:
        count = self.curve.size
        self.before = np.arange(count) - 1
        self.after = np.arange(count) + 1
        first = np.searchsorted(self.curve, np.arange(self.records.shape[0] + 1))
        for chain, closes in zip(chains, closing, strict=True):
            begin, stop = first[chain.start], first[chain.stop]
            self.before[begin] = stop - 1 if closes else -1
            self.after[stop - 1] = begin if closes else -1
        # Curves without a chain are pole edges.
        silent = self.curve >= (chains[-1].stop if chains else 0)
        self.before[silent] = self.after[silent] = -1

    def cut(self, axis: int, low: float, period: float) -> None:
        """Cut where a coordinate passes `low` plus a whole period, and move the pieces into the cell."""
        values = self.ends[:, :, axis]
        cell = np.floor((values - low) / period)
        # A piece that ends on the border of a cell is in the cell it comes from.
        least, most = values.min(axis=1), values.max(axis=1)
        for piece in np.flatnonzero(np.floor((least - low) / period) < np.ceil((most - low) / period) - 1.0)[::-1]:
            self._cut_piece(int(piece), axis, low, period)
        middle = self.ends[:, :, axis].mean(axis=1)
        cell = np.floor((middle - low) / period)
        move = -cell * period
        self.shift[:, axis] += move
        self.ends[:, :, axis] += move[:, None]
        np.clip(self.ends[:, :, axis], low, low + period, out=self.ends[:, :, axis])

    def _cut_piece(self, piece: int, axis: int, low: float, period: float) -> None:
        (a, b), (t0, t1) = self.ends[piece], self.t[piece]
        sign = 1 if b[axis] > a[axis] else -1
        lowest, highest = sorted((a[axis], b[axis]))
        crossed = np.arange(np.floor((lowest - low) / period) + 1.0, np.ceil((highest - low) / period)) * period + low
        times, points = [t0], [a]
        for level in crossed[::sign]:
            t, x, y = cut_of_piece(
                self.pool, int(self.coefficients[piece]), int(self.degree[piece]), float(self.middle[piece]),
                (float(t0), float(t1)), axis, float(level), (float(a[axis]), float(b[axis])),
            )  # fmt: skip
            # Cuts along u come first: nothing has been moved along the axis itself.
            point = np.array([x, y]) + self.shift[piece]
            point[axis] = level
            times.append(t)
            points.append(point)
        times.append(t1)
        points.append(b)
        extra = len(times) - 2
        for name in _Pieces.COLUMNS:
            column = getattr(self, name)
            setattr(self, name, np.insert(column, [piece] * extra, column[piece], axis=0))
        self.before = np.where(self.before > piece, self.before + extra, self.before)
        self.after = np.where(self.after > piece, self.after + extra, self.after)
        part = slice(piece, piece + extra + 1)
        self.t[part] = np.column_stack([times[:-1], times[1:]])
        self.ends[part] = np.stack([points[:-1], points[1:]], axis=1)
        # The piece and its parts follow one another; what came before the piece ends in its first part.
        last = self.after[piece]
        self.before[piece + 1 : piece + extra + 1] = np.arange(piece, piece + extra)
        self.after[piece : piece + extra] = np.arange(piece + 1, piece + extra + 1)
        self.after[piece + extra] = last
        if last >= 0:
            self.before[last] = piece + extra

    def drop_empty(self, noise: float) -> None:
        """Leave out pieces without length but rounding, of repeated control points: they have no direction."""
        keep = (np.abs(self.ends[:, 0] - self.ends[:, 1]) > noise).any(axis=1)
        if keep.all():
            return
        for k in np.flatnonzero(~keep).tolist():
            before, after = self.before[k], self.after[k]
            if before >= 0:
                self.after[before] = after
            if after >= 0:
                self.before[after] = before
        place = np.append(np.cumsum(keep) - 1, -1)
        for name in _Pieces.COLUMNS:
            setattr(self, name, getattr(self, name)[keep])
        self.before, self.after = place[self.before], place[self.after]

    def join(self, periods: tuple[float, float]) -> None:
        """Let every piece begin exactly where the one before it ends, but for whole periods."""
        has = np.flatnonzero(self.before >= 0)
        for axis, period in enumerate(periods):
            come, go = self.ends[self.before[has], 1, axis], self.ends[has, 0, axis]
            if period:
                jump = np.round((go - come) / period) * period
                # At the border of the cell both have its exact value already.
                come = np.where(jump == 0.0, come, go)
            self.ends[has, 0, axis] = come


def build(
    curves: Sequence[NurbsCurve],
    chains: Sequence[range],
    closing: Sequence[bool],
    silent: Sequence[NurbsCurve],
    domain: tuple[tuple[float, float], tuple[float, float]],
    periods: tuple[float, float],
) -> TrimTable:
    """The table of boundary curves.

    Parameters
    ----------
    curves : boundary curves in order
    chains, closing : which of them make one chain each, and whether it closes
    silent : pole edges
    domain, periods : of the surface; a period of 0 stands for a direction that is not closed
    """
    pieces = _Pieces([*curves, *silent], chains, closing)
    low = np.array([domain[0][0], domain[1][0]])
    high = np.array([domain[0][1], domain[1][1]])
    size = float(np.linalg.norm(np.ptp(pieces.ends.reshape(-1, 2), axis=0))) if pieces.curve.size else 1.0
    steps: list[tuple[float, float]] = []
    for axis, period in enumerate(periods):
        if period:
            values = pieces.ends[:, :, axis]
            if values.size:
                low[axis] = _largest_gap(values.min(axis=1), values.max(axis=1), period)
            high[axis] = low[axis] + period
            pieces.cut(axis, float(low[axis]), period)
    pieces.drop_empty(1e-15 * float(np.abs(pieces.ends).max(initial=0.0)))
    pieces.join(periods)
    pieces.drop_empty(0.0)
    if periods[1]:
        # Upward through the bottom of the cell: material is to the left, so w falls by one to the right.
        begins, stops = pieces.ends[:, 0], pieces.ends[:, 1]
        steps += [(float(u), -1.0) for u, v in begins if v == low[1]]
        steps += [(float(u), 1.0) for u, v in stops if v == low[1]]
    w = 0.0
    walk = []
    for u, step in sorted(steps):
        w += step
        walk.append((u, w))
    return _table(pieces, len(curves), chains, (low, high), periods, size, np.array(walk).reshape(-1, 2))


def _table(
    pieces: _Pieces,
    count: int,
    chains: Sequence[range],
    cell: tuple[Array, Array],
    periods: tuple[float, float],
    size: float,
    walk: Array,
) -> TrimTable:
    total = pieces.curve.size
    low, high = pieces.ends.min(axis=1), pieces.ends.max(axis=1)
    extent = pieces.ends[:, 1] - pieces.ends[:, 0]
    first = np.searchsorted(pieces.curve, np.arange(count + 1))
    records = pieces.records[:count]
    table = np.concatenate(
        [np.zeros(TRIM_RECORD, dtype=np.int64), records.ravel(), np.zeros(PIECE_INTS * total, dtype=np.int64), first]
    )
    pool = np.concatenate([pieces.pool, np.zeros(PIECE_DOUBLES * total + FRAME), walk.ravel()])
    record = trim_at(table, 0)
    record.curves, record.first, record.all_pieces, record.pieces = count, TRIM_RECORD, total, first[-1]
    record.piece_table, record.piece_pool = TRIM_RECORD + records.size, pieces.pool.size
    record.curve_pieces = record.piece_table + PIECE_INTS * total
    record.frame = pieces.pool.size + PIECE_DOUBLES * total
    record.steps, record.step_pool = len(walk), record.frame + FRAME
    links, bounds = _pieces(table, pool, total)
    links.curve, links.coefficients, links.degree = pieces.curve, pieces.coefficients, pieces.degree
    links.before, links.after = pieces.before, pieces.after
    links.sign_u, links.sign_v = np.sign(extent).T
    links.major = np.abs(extent[:, 1]) > np.abs(extent[:, 0])
    bounds.box = np.stack([low, high], 2).reshape(-1, 4)
    (bounds.t0, bounds.t1), (bounds.shift_u, bounds.shift_v) = pieces.t.T, pieces.shift.T
    bounds.middle = pieces.middle
    bounds.bound_1, bounds.bound_2, bounds.bound_3 = pieces.bounds.T
    bounds.start, bounds.end = pieces.ends[:, 0], pieces.ends[:, 1]
    frame = trim_frame_at(pool, record.frame)
    (frame.low_u, frame.low_v), (frame.high_u, frame.high_v) = cell
    frame.period_u, frame.period_v = periods
    frame.on, frame.extent = ON_BOUNDARY * size, size
    left, right = np.empty(len(chains)), np.empty(len(chains))
    if chains:
        # The longest piece of every chain, and points beside its middle.
        lengths = np.abs(extent).sum(axis=1)
        begins = first[[chain.start for chain in chains]]
        stops = first[[chain.stop for chain in chains]]
        longest = np.array([b + int(np.argmax(lengths[b:s])) for b, s in zip(begins, stops, strict=True)])
        t = pieces.t[longest].mean(axis=1)
        point = np.empty((len(chains), 2))
        ends_of_pieces(pool, pieces.coefficients[longest], pieces.degree[longest], pieces.middle[longest], t, point)
        point += pieces.shift[longest]
        across = np.column_stack([-extent[longest, 1], extent[longest, 0]])
        beside = max(1e-10 * size, NOISE * float(np.abs(pieces.ends).max()))
        across *= beside / np.linalg.norm(across, axis=1, keepdims=True)
        for probe, out in ((point + across, left), (point - across, right)):
            windings(table, pool, 0, probe[:, 0].copy(), probe[:, 1].copy(), out)
        # w is to be 1 where there is material.
        bottom = 1.0 - left[0]
        pool[record.step_pool + 1 :: 2] += bottom
        left, right = left + bottom, right + bottom
    else:
        bottom = 1.0
    frame.bottom = bottom = float(bottom)
    across_u = float(pool[-1]) if len(walk) else bottom
    # Once around, every u is passed by as many rings, net, as the whole way in u has periods.
    rings = float(np.round(extent[:, 0].sum() / periods[0])) if periods[0] else 0.0
    return TrimTable(table, pool, count, total, left, right, ((bottom, across_u), (bottom, bottom + rings)))
