"""The table of a trim of a surface that is open both ways, made by one kernel: what `trim_table` does in steps."""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store, record_dtype, record_view, size_of
from assembly.geometry.faces.crossing import find_crossing
from assembly.geometry.faces.monotone import ROW, cut_all
from assembly.geometry.faces.trim import winding
from assembly.geometry.faces.trim_layout import close_pieces, has_empty, lay_pieces, link_ends
from assembly.geometry.faces.trim_pieces import (
    FRAME,
    PIECE_DOUBLES,
    PIECE_INTS,
    TRIM_RECORD,
    piece_bounds_at,
    piece_links_at,
    trim_at,
    trim_frame_at,
)
from assembly.geometry.splines.curve_tables import lay_bezier_tables
from assembly.geometry.splines.evaluate import CURVE_RECORD

# Pieces no longer than this part of the largest coordinate are rounding.
_EMPTY = 1e-15
# Room for pieces per Bezier point: eight per degree and span are enough where weights do not differ much.
PIECES_OF_POINT = 8
# What is reported of a trim; w beside its chains follows: on the left of every one, then on the right.
REPORT = record_dtype(
    "f8",
    done=1,  # 1: there is a table; 0: this kernel makes none; -1: numbers are not finite
    pieces=1,
    extent=1,
    largest=1,  # coordinate
    curves=2,  # two that cross, -1: none
    where=2,  # (u, v) where they do
)
report_at = record_view(REPORT)
BESIDE = size_of(REPORT)


@kernel(inner=True)
def _sort_pieces(bounds, order):
    """Fill the numbers of the first pieces, in the order of their least u: Shell's sort by thirds."""
    for k in range(order.size):
        order[k] = k
    gap = 1
    while 3 * gap < order.size:
        gap = 3 * gap + 1
    while gap > 0:
        for k in range(gap, order.size):
            piece = order[k]
            u = piece_bounds_at(bounds, piece).box[0]
            at = k
            while at >= gap and piece_bounds_at(bounds, order[at - gap]).box[0] > u:
                order[at] = order[at - gap]
                at -= gap
            order[at] = piece
        gap //= 3


@kernel(inner=True, allocates=True)
def _fill_table(table, pool, ints, doubles, limits, size):
    """Fill table and pool from the parts of either; returns where they end."""
    records, links, first = ints
    values, bounds = doubles
    trim = trim_at(table, 0)
    trim.curves = records.shape[0]
    trim.first = TRIM_RECORD
    trim.all_pieces = links.shape[0]
    trim.pieces = first[first.size - 1]
    trim.piece_table = TRIM_RECORD + records.size
    trim.piece_pool = values.size
    trim.curve_pieces = TRIM_RECORD + records.size + links.size
    trim.frame = values.size + bounds.size
    trim.steps = 0
    trim.step_pool = values.size + bounds.size + FRAME
    table[trim.first : trim.piece_table] = records.ravel()
    table[trim.piece_table : trim.curve_pieces] = links.ravel()
    stop = trim.curve_pieces + first.size
    table[trim.curve_pieces : stop] = first
    pool[: values.size] = values
    pool[values.size : values.size + bounds.size] = bounds.ravel()
    frame = trim_frame_at(pool, trim.frame)
    frame.low_u, frame.high_u, frame.low_v, frame.high_v = limits[0], limits[1], limits[2], limits[3]
    frame.period_u, frame.period_v = 0.0, 0.0
    frame.on = limits[5] * size
    frame.bottom = 0.0
    frame.extent = size
    return stop, values.size + bounds.size + FRAME


@kernel(
    signatures="(Tuple((f8[:, ::1], f8[::1], f8[::1])), i8[:, ::1], i8[:, ::1], Tuple((f8[:, :, ::1], f8[:, ::1])),"
    " f8[::1], i8[::1], f8[::1], f8[::1])",
    allocates=True,
)
def lay_trim(curves, shape, chains, matrices, limits, table, pool, report):
    """Fill table and pool from the curves of a boundary, and a report, which says whether this kernel could.

    Parameters
    ----------
    curves, shape
        As `curve_tables.bezier_tables` takes them.
    chains : (n, 3)
        First curve, the one after the last, whether the chain closes.
    matrices
        The powers that `curve_tables.bezier_tables` takes, and the binomials that `monotone.cut_curves` takes.
    limits
        The domain, low u, high u, low v, high v; then as parts: of a curve's size, what coincides; of the boundary's
        size, what is on it; of a coordinate, its noise; of the boundary's size, below which distance curves cross.
    table, pool
        Room for `PIECES_OF_POINT` pieces a Bezier point.
    report
        Filled: a `REPORT`, and w beside chains.

    Returns
    -------
    How much of the table and of the pool is filled.
    """
    powers, binomials = matrices
    breaks, coefficients = 0, 0
    for c in range(shape.shape[0]):
        spans = shape[c, 1] - shape[c, 0]
        breaks += spans + 1
        coefficients += spans * (shape[c, 0] + 1)
    bezier, values = np.empty(3 * coefficients), np.empty(4 * coefficients + breaks)
    records = np.empty((shape.shape[0], CURVE_RECORD), dtype=np.int64)
    filled, used, finite = lay_bezier_tables(curves, shape, powers, limits[4], bezier, values, records)
    if not finite:
        report_at(report, 0).done = -1.0
        return 0, 0
    rows = np.empty((PIECES_OF_POINT * (filled // 3), ROW))
    count = cut_all(bezier[:filled], values[:used], records, binomials, rows)
    report_at(report, 0).done = 0.0
    if count > rows.shape[0]:
        return 0, 0
    links, bounds = np.empty((count, PIECE_INTS), dtype=np.int64), np.empty((count, PIECE_DOUBLES))
    extent_u, extent_v = lay_pieces(rows[:count], records, values[:used], chains, links, bounds)
    size = np.sqrt(extent_u * extent_u + extent_v * extent_v)
    if count == 0 or has_empty(bounds, _EMPTY):
        return 0, 0
    link_ends(links, bounds, 0.0, 0.0)
    if has_empty(bounds, 0.0):
        return 0, 0
    sides = 2 * chains.shape[0]
    u, v = np.empty(sides), np.empty(sides)
    first = np.empty(shape.shape[0] + 1, dtype=np.int64)
    largest, _way = close_pieces(values[:used], links, bounds, chains, first, (1e-10 * size, limits[6]), u, v)
    stop, end = _fill_table(table, pool, (records, links, first), (values[:used], bounds), limits, size)
    trim, told = trim_at(table, 0), report_at(report, 0)
    begin = BESIDE
    beside = report[begin : begin + sides]
    for k in range(sides):
        beside[k], _on = winding(Store(table, pool), 0, u[k], v[k])
    # w is to be 1 where there is material.
    bottom = 1.0 - beside[0]
    beside += bottom
    trim_frame_at(pool, trim.frame).bottom = bottom
    told.pieces, told.extent, told.largest = count, size, largest
    order = np.empty(trim.pieces, dtype=np.int64)
    _sort_pieces(bounds, order)
    nearest = max(limits[7] * size, limits[6] * largest)
    where = np.zeros(2)
    a, b = find_crossing(table, pool, order, np.zeros((order.size, 2)), nearest, False, where)
    told.curves[0], told.curves[1] = -1.0, -1.0
    told.where[0], told.where[1] = where[0], where[1]
    if a >= 0:
        told.curves[0], told.curves[1] = piece_links_at(links, a).curve, piece_links_at(links, b).curve
    told.done = 1.0
    return stop, end


@kernel(inner=True)
def _measure_loop(curves, shape, places, box):
    """Fill the box (u, v) and size of a loop; whether its curves are clamped, long enough and meet head to tail."""
    points, _weights, knots = curves
    begin, stop, point, knot, short = places
    box[0], box[1], box[2], box[3] = np.inf, -np.inf, np.inf, -np.inf
    first = point
    for c in range(begin, stop):
        for k in range(point, point + shape[c, 1]):
            box[0], box[1] = min(box[0], points[k, 0]), max(box[1], points[k, 0])
            box[2], box[3] = min(box[2], points[k, 1]), max(box[3], points[k, 1])
        point += shape[c, 1]
    box[4] = np.sqrt((box[1] - box[0]) ** 2 + (box[3] - box[2]) ** 2)
    end = point - 1
    point = first
    for c in range(begin, stop):
        p, n = shape[c, 0], shape[c, 1]
        if knots[knot] != knots[knot + p] or knots[knot + n] != knots[knot + n + p]:
            return False
        if points[point, 0] != points[end, 0] or points[point, 1] != points[end, 1]:
            return False
        side = 0.0
        for axis in range(2):
            low, high = points[point, axis], points[point, axis]
            for k in range(point + 1, point + n):
                low, high = min(low, points[k, axis]), max(high, points[k, axis])
            side = max(side, high - low)
        if not side > short * box[4]:
            return False
        end = point + n - 1
        point += n
        knot += n + p + 1
    return True


@kernel(signatures="(Tuple((f8[:, ::1], f8[::1], f8[::1])), i8[:, ::1], i8[:, ::1], f8, f8[:, ::1])")
def measure_loops(curves, shape, loops, short, boxes):
    """Whether curves of loops are clamped, meet exactly head to tail, and none is shorter than a part of its loop.

    `loops` (n, 3) are as the `chains` of `lay_trim`. A row of `boxes` is filled with least and greatest u, least and
    greatest v, and the size, of the control points.
    """
    point, knot = 0, 0
    for loop in range(loops.shape[0]):
        begin, stop = loops[loop, 0], loops[loop, 1]
        if not _measure_loop(curves, shape, (begin, stop, point, knot, short), boxes[loop]):
            return False
        for c in range(begin, stop):
            point += shape[c, 1]
            knot += shape[c, 1] + shape[c, 0] + 1
    return True
