"""Edges of a loop in (u, v), a record each: which run along a coordinate line, and where neighbors meet."""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of

__all__ = [
    "EDGE",
    "EDGE_SIZE",
    "FOLLOWED",
    "FREE",
    "LEVEL",
    "LOOSE",
    "POINT",
    "TIGHT",
    "UNKNOWN",
    "U_LEVEL",
    "V_LEVEL",
    "edge_at",
    "join_ends",
    "level_lines",
]

# Of a line: not known; of any curve: runs freely, at one u, at one v; of a line: has to be followed around an axis.
UNKNOWN, FREE, U_LEVEL, V_LEVEL, FOLLOWED = range(5)
# Curves that leave a coordinate line by less, over the side of the domain, run along it.
LEVEL = 1e-9
# How certain ends of an edge are: most, less as it has a tolerance of its own, not at all as it is one point in space.
TIGHT, LOOSE, POINT = range(3)
# An edge on a face, run with the material on its left.
EDGE = record_dtype(
    "f8",
    start=2,  # (u, v)
    end=2,
    low=1,  # the interval of a line
    high=1,
    tolerance=1,  # how far its ends may be from those of its neighbors, in space [mm]
    level=1,  # one of the numbers above
    line=1,  # 1: a straight line; 0: a curve that is kept elsewhere
    reverse=1,  # 1: a line that is to be turned; 0: it runs as it should
    loose=1,  # one of the numbers below
    seam=1,  # 1: the face has it on both sides
)
EDGE_SIZE = size_of(EDGE)
edge_at = record_view(EDGE)


@kernel(signatures="(f8[:, ::1], f8[::1], f8[::1], b1)")
def level_lines(rows, scales, sides, is_straight):
    """Find which lines run along a coordinate line, put them there, and turn those that are to be turned.

    Parameters
    ----------
    rows
        Edges in OCCT's (u, v).
    scales, sides : (2,)
        Our lengths in one of OCCT's, and the sides of the domain.
    is_straight : bool
        Whether OCCT's parameters are ours. Otherwise lines that run freely have to be followed, and are not turned.

    Returns
    -------
    How many have to be followed.
    """
    count = 0
    for k in range(rows.shape[0]):
        edge = edge_at(rows, k)
        if edge.line == 0.0:
            continue
        if edge.level == UNKNOWN:
            u, v = edge.start[0], edge.start[1]
            x, y = edge.end[0], edge.end[1]
            extent_u = (max(u, x) - min(u, x)) * scales[0] / sides[0]
            extent_v = (max(v, y) - min(v, y)) * scales[1] / sides[1]
            along_v = extent_v > extent_u
            edge.level = FREE
            if (extent_u if along_v else extent_v) <= LEVEL:
                if along_v:
                    edge.level = U_LEVEL
                    edge.start[0] = edge.end[0] = 0.5 * (min(u, x) + max(u, x))
                else:
                    edge.level = V_LEVEL
                    edge.start[1] = edge.end[1] = 0.5 * (min(v, y) + max(v, y))
                edge.low, edge.high = 0.0, 1.0
            elif not is_straight:
                edge.level = FOLLOWED
                count += 1
                continue
        if edge.reverse != 0.0:
            for axis in range(2):
                edge.start[axis], edge.end[axis] = edge.end[axis], edge.start[axis]
            both = edge.low + edge.high
            edge.low, edge.high = both - edge.high, both - edge.low
    return count


@kernel(inline=True)
def _whole(to, at, period):
    """The whole periods by which a coordinate has to be moved to be next to another one."""
    return np.rint((to - at) / period) * period if period != 0.0 else 0.0


@kernel(inline=True)
def _keeps(edge, axis):
    """Whether a coordinate is constant along an edge."""
    return edge.level == (U_LEVEL if axis == 0 else V_LEVEL)


@kernel(signatures="(f8[:, ::1], f8[::1], f8[::1], f8[:, ::1], f8[:, ::1], f8[:, ::1])")
def join_ends(rows, periods, noise, shifts, before, joints):
    """Move edges by periods next to the one before, and find where each meets that.

    If one of the two is less certain, they meet at the end of the other one; a line along a pole keeps that it is
    there. Else in the middle between both ends,
    except that an edge along a coordinate line keeps its coordinate.

    Parameters
    ----------
    rows
        Edges in order; their ends are moved.
    periods : (2,)
        0 where the surface is not closed.
    noise : (2,)
        Ends that are nearer to each other are apart by rounding alone.
    shifts : (n + 1, 2)
        Filled with the moves; the last row with the periods between where the loop ends and where it begins.
    before : (n, 2)
        Filled with where the edge before ends.
    joints : (n, 2)
        Filled with where edge k begins.

    Returns
    -------
    How many ends are apart by more than rounding.
    """
    n = rows.shape[0]
    for k in range(n):
        edge = edge_at(rows, k)
        for axis in range(2):
            by = 0.0
            if k > 0:
                by = _whole(edge_at(rows, k - 1).end[axis], edge.start[axis], periods[axis])
            shifts[k, axis] = by
            if by != 0.0:
                edge.start[axis] += by
                edge.end[axis] += by
    first, last = edge_at(rows, 0), edge_at(rows, n - 1)
    apart = 0
    for axis in range(2):
        shifts[n, axis] = _whole(first.start[axis], last.end[axis], periods[axis])
    for k in range(n):
        edge, other = edge_at(rows, k), edge_at(rows, k - 1 if k > 0 else n - 1)
        is_near = True
        for axis in range(2):
            a = edge.start[axis]
            b = other.end[axis] + (shifts[n, axis] if k == 0 else 0.0)
            before[k, axis] = b
            is_near = is_near and abs(b - a) <= noise[axis]
            if other.loose == POINT and _keeps(other, axis) or edge.loose == POINT and _keeps(edge, axis):
                joints[k, axis] = b if other.loose == POINT else a
            elif other.loose != edge.loose:
                joints[k, axis] = b if edge.loose > other.loose else a
            elif _keeps(other, axis) == _keeps(edge, axis):
                joints[k, axis] = 0.5 * (b + a)
            else:
                joints[k, axis] = b if _keeps(other, axis) else a
        if not is_near:
            apart += 1
    return apart
