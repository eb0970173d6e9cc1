"""The pieces of a trim while its table is made: records of all of them filled, moved and joined at once.

Rows of `links` and `bounds` are the records `PIECE_LINKS` and `PIECE_BOUNDS`, as they stand in the finished table.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.faces.trim_pieces import Piece, piece_bounds_at, piece_line, piece_links_at
from assembly.geometry.splines.evaluate import spline_curve_at

# The part of a piece's interval beside which w is sampled: not its middle, beside which loops of one part often touch.
_MIDDLE = 0.47


@kernel(inner=True)
def _place_on_curve(pool, link, bound, t):
    """The point of a piece's curve at a parameter, where the file has it."""
    u, v, _du, _dv = piece_line(pool, Piece(link.coefficients, link.degree, bound.middle, t, t), t)
    return u, v


@kernel(inner=True, exact=True)
def lay_pieces(rows, records, pool, chains, links, bounds):
    """Fill the pieces that `cut_curves` found, in the order of their curves.

    `chains` (n, 3) holds the first curve, the one after the last, and whether the chain closes; curves without a chain
    are pole edges, and come last. Returns the extents in u and v of all ends.
    """
    count = rows.shape[0]
    low_u = low_v = np.inf
    high_u = high_v = -np.inf
    for k in range(count):
        row = rows[k]
        link, bound = piece_links_at(links, k), piece_bounds_at(bounds, k)
        link.curve = int(row[0])
        span = int(row[1])
        arc = spline_curve_at(records, link.curve)
        link.degree = arc.degree
        link.coefficients = arc.coefficients + 4 * (arc.degree + 1) * span
        link.before = -1
        link.after = -1
        bound.middle = 0.5 * (pool[arc.breaks + span] + pool[arc.breaks + span + 1])
        bound.t0 = row[2]
        bound.t1 = row[3]
        bound.bound_1 = row[4]
        bound.bound_2 = row[5]
        bound.bound_3 = row[6]
        bound.shift_u = 0.0
        bound.shift_v = 0.0
        bound.start[0], bound.start[1] = _place_on_curve(pool, link, bound, bound.t0)
        bound.end[0], bound.end[1] = _place_on_curve(pool, link, bound, bound.t1)
        low_u = min(low_u, bound.start[0], bound.end[0])
        high_u = max(high_u, bound.start[0], bound.end[0])
        low_v = min(low_v, bound.start[1], bound.end[1])
        high_v = max(high_v, bound.start[1], bound.end[1])
    k = 0
    for c in range(chains.shape[0]):
        while k < count and piece_links_at(links, k).curve < chains[c, 0]:
            k += 1
        begin = k
        while k < count and piece_links_at(links, k).curve < chains[c, 1]:
            piece_links_at(links, k).before = k - 1
            piece_links_at(links, k).after = k + 1
            k += 1
        if k > begin:
            piece_links_at(links, begin).before = k - 1 if chains[c, 2] else -1
            piece_links_at(links, k - 1).after = begin if chains[c, 2] else -1
    return high_u - low_u, high_v - low_v


@kernel(
    signatures="(f8[:, ::1], i8[:, ::1], f8[::1], i8[:, ::1], i8[:, ::1], f8[:, ::1])",
    exact=True,
)
def fill_pieces(rows, records, pool, chains, links, bounds):
    """`lay_pieces` for Python."""
    return lay_pieces(rows, records, pool, chains, links, bounds)


@kernel(signatures="(f8[:, ::1], i8, f8, f8)", exact=True)
def move_pieces(bounds, axis, low, period):
    """Move pieces that do not cross from one cell into the next into the cell that begins at `low`."""
    for k in range(bounds.shape[0]):
        bound = piece_bounds_at(bounds, k)
        cell = np.floor((0.5 * (bound.start[axis] + bound.end[axis]) - low) / period)
        move = -cell * period
        if axis == 0:
            bound.shift_u += move
        else:
            bound.shift_v += move
        bound.start[axis] = min(max(bound.start[axis] + move, low), low + period)
        bound.end[axis] = min(max(bound.end[axis] + move, low), low + period)


@kernel(inner=True, exact=True)
def has_empty(bounds, noise):
    """Whether a piece is no longer than rounding: `noise` times the largest coordinate."""
    largest = 0.0
    for k in range(bounds.shape[0]):
        bound = piece_bounds_at(bounds, k)
        for axis in range(2):
            largest = max(largest, abs(bound.start[axis]), abs(bound.end[axis]))
    for k in range(bounds.shape[0]):
        bound = piece_bounds_at(bounds, k)
        least = noise * largest
        if abs(bound.start[0] - bound.end[0]) <= least and abs(bound.start[1] - bound.end[1]) <= least:
            return True
    return False


@kernel(signatures="(f8[:, ::1], f8)", exact=True)
def any_empty(bounds, noise):
    """`has_empty` for Python."""
    return has_empty(bounds, noise)


@kernel(inner=True, exact=True)
def link_ends(links, bounds, period_u, period_v):
    """Let every piece begin exactly where the one before it ends, up to whole periods."""
    for k in range(bounds.shape[0]):
        before = piece_links_at(links, k).before
        if before < 0:
            continue
        start, end = piece_bounds_at(bounds, k).start, piece_bounds_at(bounds, before).end
        for axis in range(2):
            period = period_u if axis == 0 else period_v
            # At the border of the cell both have its exact value already.
            if period == 0.0 or abs(start[axis] - end[axis]) <= 0.5 * period:
                start[axis] = end[axis]


@kernel(signatures="(i8[:, ::1], f8[:, ::1], f8, f8)", exact=True)
def join_pieces(links, bounds, period_u, period_v):
    """`link_ends` for Python."""
    return link_ends(links, bounds, period_u, period_v)


@kernel(inner=True, exact=True)
def _length(bounds, k):
    bound = piece_bounds_at(bounds, k)
    return abs(bound.end[0] - bound.start[0]) + abs(bound.end[1] - bound.start[1])


@kernel(inner=True, exact=True)
def close_pieces(pool, links, bounds, chains, first, distances, u, v):
    """Fill what the ends of pieces imply: boxes, signs of directions, first pieces of curves, points beside chains.

    Points are to the left (the first half of `u` and `v`) and to the right of the longest piece of every chain, near
    its middle, at the distance distances[0], or at the part distances[1] of the largest coordinate if that is more.
    Returns the largest coordinate of a piece of the boundary, and the sum over all pieces of their change in u.
    """
    total = links.shape[0]
    largest = 0.0
    of_boundary = 0.0
    way = 0.0
    at = 0
    last = first.size - 1
    for k in range(total):
        link, bound = piece_links_at(links, k), piece_bounds_at(bounds, k)
        while at <= last and at <= link.curve:
            first[at] = k
            at += 1
        along_u = bound.end[0] - bound.start[0]
        along_v = bound.end[1] - bound.start[1]
        way += along_u
        link.sign_u = int(np.sign(along_u))
        link.sign_v = int(np.sign(along_v))
        link.major = 1 if abs(along_v) > abs(along_u) else 0
        for axis in range(2):
            bound.box[2 * axis] = min(bound.start[axis], bound.end[axis])
            bound.box[2 * axis + 1] = max(bound.start[axis], bound.end[axis])
            largest = max(largest, abs(bound.start[axis]), abs(bound.end[axis]))
        if link.curve < last:
            of_boundary = largest
    while at <= last:
        first[at] = total
        at += 1
    beside = max(distances[0], distances[1] * largest)
    for c in range(chains.shape[0]):
        longest = first[chains[c, 0]]
        for k in range(longest + 1, first[chains[c, 1]]):
            if _length(bounds, k) > _length(bounds, longest):
                longest = k
        link, bound = piece_links_at(links, longest), piece_bounds_at(bounds, longest)
        x, y = _place_on_curve(pool, link, bound, bound.t0 + _MIDDLE * (bound.t1 - bound.t0))
        x += bound.shift_u
        y += bound.shift_v
        across_u = -(bound.end[1] - bound.start[1])
        across_v = bound.end[0] - bound.start[0]
        part = beside / np.sqrt(across_u * across_u + across_v * across_v)
        across_u *= part
        across_v *= part
        u[c], v[c] = x + across_u, y + across_v
        u[chains.shape[0] + c], v[chains.shape[0] + c] = x - across_u, y - across_v
    return of_boundary, way


@kernel(
    signatures="(f8[::1], i8[:, ::1], f8[:, ::1], i8[:, ::1], i8[::1], Tuple((f8, f8)), f8[::1], f8[::1])",
    exact=True,
)
def finish_pieces(pool, links, bounds, chains, first, distances, u, v):
    """`close_pieces` for Python."""
    return close_pieces(pool, links, bounds, chains, first, distances, u, v)
