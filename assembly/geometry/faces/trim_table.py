"""The table of a trim: boundary curves cut into pieces, moved into one cell of the periods, as kernels read them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from assembly._record import place_of, rows_of
from assembly.errors import InputError
from assembly.geometry.faces import trim_making
from assembly.geometry.faces.crossing import first_crossing
from assembly.geometry.faces.monotone import ROW, cut_curves
from assembly.geometry.faces.trim import windings
from assembly.geometry.faces.trim_layout import any_empty, fill_pieces, finish_pieces, join_pieces, move_pieces
from assembly.geometry.faces.trim_pieces import (
    FRAME,
    PIECE_BOUNDS,
    PIECE_DOUBLES,
    PIECE_INTS,
    PIECE_LINKS,
    TRIM,
    TRIM_FRAME_RECORD,
    TRIM_RECORD,
    cut_of_piece,
    piece_bounds_at,
    piece_links_at,
)
from assembly.geometry.splines.curve import COINCIDENT, NurbsCurve
from assembly.geometry.splines.curve_packing import NOT_FINITE, joined_curves, packed_curves, power_matrices
from assembly.geometry.splines.evaluate import CURVE_BREAKS, CURVE_COEFFICIENTS, CURVE_RECORD

__all__ = ["TrimTable", "build", "made_at_once"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
# A point this part of the boundary's size from it is on it.
ON_BOUNDARY = 1e-12
# Some roundings of a coordinate, as a part of it.
NOISE = 1e-14
# Boundary curves nearer to each other than this part of the boundary's size cross or touch.
CROSSES = 1e-9
# What is the place of something else, of a trim in the table and in the pool, and of a piece in the pool.
_IN_TABLE = [place_of(TRIM, field) for field in ("first", "piece_table", "curve_pieces")]
_IN_POOL = [place_of(TRIM, field) for field in ("piece_pool", "frame", "step_pool")]
_BOUNDARY, _PIECE_TABLE = place_of(TRIM, "pieces"), place_of(TRIM, "piece_table")
_PIECE_POOL, _FRAME = place_of(TRIM, "piece_pool"), place_of(TRIM, "frame")
_LOW, _PERIOD = place_of(TRIM_FRAME_RECORD, "low_u"), place_of(TRIM_FRAME_RECORD, "period_u")
_BOTTOM = place_of(TRIM_FRAME_RECORD, "bottom")
_CURVE, _COEFFICIENTS = place_of(PIECE_LINKS, "curve"), place_of(PIECE_LINKS, "coefficients")
_BEFORE, _AFTER = place_of(PIECE_LINKS, "before"), place_of(PIECE_LINKS, "after")
_BOX, _T0, _START = (place_of(PIECE_BOUNDS, field) for field in ("box", "t0", "start"))
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
    extent, largest : float
        Size of the boundary in (u, v), and its largest coordinate.
    crossed
        What `crossing` finds at the tolerance `CROSSES`; False where that is not known yet.
    """

    table: Ints
    pool: Array
    curves: int
    pieces: int
    left: Array
    right: Array
    beyond: tuple[tuple[float, float], tuple[float, float]]
    extent: float
    largest: float
    crossed: tuple[int, int, Array] | Literal[False] | None = False

    def at(self, table_at: int, pool_at: int) -> tuple[Ints, Array]:
        """The same for being appended to a table and a pool of these lengths."""
        if table_at == 0 and pool_at == 0:
            return self.table, self.pool
        table = self.table.copy()
        pieces = int(table[_PIECE_TABLE]) + _COEFFICIENTS
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

    def nearness(self, tolerance: float) -> float:
        """At which distance curves touch: this part of the size, or what is rounding."""
        return max(tolerance * self.extent, NOISE * self.largest)

    def crossing(self, tolerance: float, joined: bool = False) -> tuple[int, int, Array] | None:
        """Two boundary curves that cross, or come nearer than this part of the size, and where; None if none do.

        Curves may meet where one follows the other; if they are joined, at all of their ends.
        """
        if self.crossed is not False and tolerance == CROSSES and not joined:
            return self.crossed
        links, doubles = _blocks(self.table, self.pool, self.pieces)
        count = int(self.table[_BOUNDARY])
        low = doubles[:count, _BOX : _BOX + 4 : 2]
        nearest = self.nearness(tolerance)
        frame = int(self.table[_FRAME])
        begins, periods = self.pool[frame + _LOW :][:2].tolist(), self.pool[frame + _PERIOD :][:2].tolist()
        if any(periods):
            pieces, moves = np.arange(count), np.zeros((count, 2))
            for axis, (begin, period) in enumerate(zip(begins, periods, strict=True)):
                if period:
                    # What touches the lower border of the cell meets what touches the upper one.
                    touches = low[pieces, axis] <= begin + nearest
                    pieces = np.concatenate([pieces, pieces[touches]])
                    copies = moves[touches]
                    copies[:, axis] += period
                    moves = np.concatenate([moves, copies])
            order = np.argsort(low[pieces, 0] + moves[:, 0])
            pieces, moves = pieces[order], np.ascontiguousarray(moves[order])
        else:
            pieces, moves = np.argsort(low[:, 0]), np.zeros((count, 2))
        where = np.empty(2)
        a, b = first_crossing(self.table, self.pool, pieces, moves, nearest, joined, where)
        return None if a < 0 else (int(links[a, _CURVE]), int(links[b, _CURVE]), where)


def _blocks(table: Ints, pool: Array, count: int) -> tuple[Ints, Array]:
    """Integers and doubles of the pieces of a trim at the start of a table, a row each."""
    ints, doubles = int(table[_PIECE_TABLE]), int(table[_PIECE_POOL])
    return (
        table[ints : ints + PIECE_INTS * count].reshape(-1, PIECE_INTS),
        pool[doubles : doubles + PIECE_DOUBLES * count].reshape(-1, PIECE_DOUBLES),
    )


def _pieces(table: Ints, pool: Array, count: int) -> tuple[Any, Any]:
    """The same, a record each."""
    ints, doubles = _blocks(table, pool, count)
    return rows_of(PIECE_LINKS, ints), rows_of(PIECE_BOUNDS, doubles)


def _record(dtype: np.dtype[Any], **fields: float) -> list[float]:
    """The items of a record, in its order."""
    return [fields[name] for name in dtype.names or ()]


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
    """Pieces while they are made: a record of integers and one of doubles each, in the order of the curves."""

    def __init__(self, curves: Sequence[NurbsCurve], chains: Ints) -> None:
        bezier, self.pool, self.records = packed_curves(curves)
        # Room for eight pieces a degree and span, whose points have three coordinates.
        rows = np.empty((8 * (len(bezier) // 3), ROW))
        count = cut_curves(bezier, self.pool, self.records, _BINOMIALS, rows)
        if count > len(rows):
            # Weights far apart.
            rows = np.empty((count, ROW))
            cut_curves(bezier, self.pool, self.records, _BINOMIALS, rows)
        self.links, self.bounds = np.empty((count, PIECE_INTS), dtype=np.int64), np.empty((count, PIECE_DOUBLES))
        extent = fill_pieces(rows[:count], self.records, self.pool, chains, self.links, self.bounds)
        self.size = float(np.linalg.norm(extent)) if count else 1.0

    @property
    def ends(self) -> Array:
        """First and last point of every piece, (pieces, 2, 2)."""
        return self.bounds[:, _START : _START + 4].reshape(-1, 2, 2)

    def cut(self, axis: int, low: float, period: float) -> None:
        """Cut where a coordinate passes `low` plus a whole period, and move the pieces into the cell."""
        values = self.ends[:, :, axis]
        # A piece that ends on the border of a cell is in the cell it comes from.
        least, most = values.min(axis=1), values.max(axis=1)
        for piece in np.flatnonzero(np.floor((least - low) / period) < np.ceil((most - low) / period) - 1.0)[::-1]:
            self._cut_piece(int(piece), axis, low, period)
        move_pieces(self.bounds, axis, low, period)

    def _cut_piece(self, piece: int, axis: int, low: float, period: float) -> None:
        link, bound = piece_links_at(self.links, piece), piece_bounds_at(self.bounds, piece)
        (a, b), (t0, t1) = self.ends[piece].copy(), (float(bound.t0), float(bound.t1))
        shift = np.array([bound.shift_u, bound.shift_v])
        sign = 1 if b[axis] > a[axis] else -1
        lowest, highest = sorted((a[axis], b[axis]))
        crossed = np.arange(np.floor((lowest - low) / period) + 1.0, np.ceil((highest - low) / period)) * period + low
        times, points = [t0], [a]
        for level in crossed[::sign]:
            t, x, y = cut_of_piece(
                self.pool, int(link.coefficients), int(link.degree), float(bound.middle),
                (t0, t1), axis, float(level), (float(a[axis]), float(b[axis])),
            )  # fmt: skip
            # Cuts along u come first: nothing has been moved along the axis itself.
            point = np.array([x, y]) + shift
            point[axis] = level
            times.append(t)
            points.append(point)
        times.append(t1)
        points.append(b)
        extra = len(times) - 2
        neighbors = self.links[:, _BEFORE : _AFTER + 1]
        neighbors[neighbors > piece] += extra
        # What came before the piece ends in its first part.
        self.links = np.insert(self.links, [piece] * extra, self.links[piece], axis=0)
        self.bounds = np.insert(self.bounds, [piece] * extra, self.bounds[piece], axis=0)
        part = slice(piece, piece + extra + 1)
        self.bounds[part, _T0 : _T0 + 2] = np.column_stack([times[:-1], times[1:]])
        self.ends[part] = np.stack([points[:-1], points[1:]], axis=1)
        # The piece and its parts follow one another; what comes after it comes after its last part.
        before, after = self.links[:, _BEFORE], self.links[:, _AFTER]
        last = after[piece + extra]
        before[piece + 1 : piece + extra + 1] = np.arange(piece, piece + extra)
        after[piece : piece + extra] = np.arange(piece + 1, piece + extra + 1)
        if last >= 0:
            before[last] = piece + extra

    def drop_empty(self, noise: float) -> None:
        """Leave out pieces without length but rounding, of repeated control points: they have no direction."""
        if not any_empty(self.bounds, noise):
            return
        ends = self.ends
        keep = (np.abs(ends[:, 0] - ends[:, 1]) > noise * float(np.abs(ends).max(initial=0.0))).any(axis=1)
        befores, afters = self.links[:, _BEFORE], self.links[:, _AFTER]
        for k in np.flatnonzero(~keep).tolist():
            before, after = befores[k], afters[k]
            if before >= 0:
                afters[before] = after
            if after >= 0:
                befores[after] = before
        place = np.append(np.cumsum(keep) - 1, -1)
        self.links, self.bounds = self.links[keep], self.bounds[keep]
        for column in (_BEFORE, _AFTER):
            self.links[:, column] = place[self.links[:, column]]


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
    rows = [(chain.start, chain.stop, closes) for chain, closes in zip(chains, closing, strict=True)]
    linked = np.array(rows, dtype=np.int64).reshape(-1, 3)
    if rows and not (silent or periods[0] or periods[1]):
        made = made_at_once(joined_curves(curves), linked, domain)
        if made is not None:
            return made
    pieces = _Pieces([*curves, *silent], linked)
    low, high = [domain[0][0], domain[1][0]], [domain[0][1], domain[1][1]]
    steps: list[tuple[float, float]] = []
    for axis, period in enumerate(periods):
        if period:
            values = pieces.ends[:, :, axis]
            if values.size:
                low[axis] = _largest_gap(values.min(axis=1), values.max(axis=1), period)
            high[axis] = low[axis] + period
            pieces.cut(axis, float(low[axis]), period)
    pieces.drop_empty(1e-15)
    join_pieces(pieces.links, pieces.bounds, *periods)
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
        walk += [u, w]
    return _table(pieces, len(curves), linked, (low, high), periods, walk)


def made_at_once(
    curves: tuple[tuple[Array, Array, Array], Ints],
    chains: Ints,
    domain: tuple[tuple[float, float], tuple[float, float]],
) -> TrimTable | None:
    """The table of curves on a surface that is open both ways; None where pieces of theirs have to be left out.

    The curves are as `joined_curves` has them, `chains` (n, 3) as `trim_making.lay_trim` takes them.
    """
    given, shape = curves
    limits = np.array([*domain[0], *domain[1], COINCIDENT, ON_BOUNDARY, NOISE, CROSSES])
    report = np.empty(trim_making.BESIDE + 2 * len(chains))
    # Of all spans that there may be.
    sizes = shape.tolist()
    spans = sum(count - degree for degree, count in sizes)
    points = sum((count - degree) * (degree + 1) for degree, count in sizes)
    most = trim_making.PIECES_OF_POINT * points
    ints = np.empty(TRIM_RECORD + (CURVE_RECORD + 1) * len(shape) + 1 + PIECE_INTS * most, dtype=np.int64)
    doubles = np.empty(4 * points + spans + len(shape) + PIECE_DOUBLES * most + FRAME)
    matrices = (power_matrices(), _BINOMIALS)
    stop, end = trim_making.lay_trim(given, shape, chains, matrices, limits, ints, doubles, report)
    table, pool = ints[:stop].copy(), doubles[:end].copy()
    done, pieces, extent, largest, a, b, u, v, *beside = report.tolist()
    if done < 0.0:
        raise InputError(NOT_FINITE)
    if done == 0.0:
        return None
    left, right = beside[: len(chains)], beside[len(chains) :]
    bottom = float(pool[table[_FRAME] + _BOTTOM])
    crossed = None if a < 0.0 else (int(a), int(b), np.array([u, v]))
    beyond = ((bottom, bottom), (bottom, bottom))
    return TrimTable(
        table, pool, len(shape), int(pieces), np.array(left), np.array(right), beyond, extent, largest, crossed
    )


def _table(
    pieces: _Pieces,
    count: int,
    chains: Ints,
    cell: tuple[list[float], list[float]],
    periods: tuple[float, float],
    walk: list[float],
) -> TrimTable:
    total, size = len(pieces.links), pieces.size
    sides, beside = 2 * len(chains), np.empty((3, 2 * len(chains)))
    first = np.empty(count + 1, dtype=np.int64)
    distances = (1e-10 * size, NOISE)
    largest, way = finish_pieces(
        pieces.pool, pieces.links, pieces.bounds, chains, first, distances, beside[0], beside[1]
    )
    records = pieces.records[:count].ravel()
    piece_table, piece_pool = TRIM_RECORD + records.size, pieces.pool.size
    frame_at = piece_pool + PIECE_DOUBLES * total
    head = _record(
        TRIM, curves=count, first=TRIM_RECORD, all_pieces=total, pieces=int(first[-1]), piece_table=piece_table,
        piece_pool=piece_pool, curve_pieces=piece_table + PIECE_INTS * total, frame=frame_at, steps=len(walk) // 2,
        step_pool=frame_at + FRAME,
    )  # fmt: skip
    table = np.concatenate([head, records, pieces.links.ravel(), first])
    (low_u, low_v), (high_u, high_v) = cell
    frame = _record(
        TRIM_FRAME_RECORD, low_u=low_u, low_v=low_v, high_u=high_u, high_v=high_v, period_u=periods[0],
        period_v=periods[1], on=ON_BOUNDARY * size, bottom=0.0, extent=size,
    )  # fmt: skip
    pool = np.concatenate([pieces.pool, pieces.bounds.ravel(), frame, walk])
    left, right = beside[2, : len(chains)], beside[2, len(chains) :]
    bottom = 1.0
    if sides:
        windings(table, pool, 0, *beside)
        # w is to be 1 where there is material.
        bottom = 1.0 - float(left[0])
        pool[frame_at + FRAME + 1 :: 2] += bottom
        left, right = left + bottom, right + bottom
    pool[frame_at + _BOTTOM] = bottom
    across_u = float(pool[-1]) if walk else bottom
    # Once around, every u is passed by as many rings, net, as the whole way in u has periods.
    rings = float(np.round(way / periods[0])) if periods[0] else 0.0
    beyond = ((bottom, across_u), (bottom, bottom + rings))
    return TrimTable(table, pool, count, total, left, right, beyond, size, largest)
