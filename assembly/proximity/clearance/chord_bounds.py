"""Kernels that bound second derivatives of plane curves over intervals, and tell to which side a curve bends.

See `derivative_nets.py`.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly.proximity.clearance.net_bounds import (
    STRAIGHT,
    WITHIN,
    not_narrow,
    part_of,
    write_binomials,
    write_restriction,
)


@kernel(inner=True, allocates=True)
def _restrict(piece, matrix, net):
    """Write the Bezier points of a piece (p + 1, 3) over an interval."""
    for c in range(3):
        for k in range(piece.shape[0]):
            total = 0.0
            for i in range(piece.shape[0]):
                total += matrix[k, i] * piece[i, c]
            net[k, c] = total


@kernel(inner=True, allocates=True)
def _bound_bend(net, component, least):
    """A bound of a coordinate's second derivative over the unit interval of one net."""
    degree = net.shape[0] - 1
    low = high = net[0, component] / net[0, 2]
    for k in range(degree + 1):
        x = net[k, component] / net[k, 2]
        low, high = min(low, x), max(high, x)
    middle = 0.5 * (low + high)
    off = max(high - middle, middle - low)
    first = first_w = second = second_w = last = last_w = 0.0
    for k in range(degree):
        step = degree * (net[k + 1, component] - middle * net[k + 1, 2] - (net[k, component] - middle * net[k, 2]))
        step_w = degree * (net[k + 1, 2] - net[k, 2])
        first, first_w = max(first, abs(step)), max(first_w, abs(step_w))
        if k > 0:
            second = max(second, (degree - 1) * abs(step - last))
            second_w = max(second_w, (degree - 1) * abs(step_w - last_w))
        last, last_w = step, step_w
    rate = (first + first_w * off) / least
    return (second + second_w * off + 2.0 * first_w * rate) / least


@kernel(inner=True, allocates=True)
def _side(net, points):
    """1 if a control polygon turns only right, -1 if only left, by less than half a turn in all; 0 otherwise."""
    most, left, right = 0.0, -np.inf, np.inf
    first_x = first_y = last_x = last_y = 0.0
    for k in range(points - 1):
        x = net[k + 1, 0] / net[k + 1, 2] - net[k, 0] / net[k, 2]
        y = net[k + 1, 1] / net[k + 1, 2] - net[k, 1] / net[k, 2]
        if k == 0:
            first_x, first_y = x, y
        else:
            turn = last_x * y - last_y * x
            left, right = max(left, turn), min(right, turn)
        if not first_x * x + first_y * y > 0.0:
            return 0
        most = max(most, x * x + y * y)
        last_x, last_y = x, y
    if left <= STRAIGHT * most:
        return 1
    return -1 if right >= -STRAIGHT * most else 0


@kernel(inner=True, allocates=True)
def _polygon(pieces, at, ends, room, polygon):
    """Write the control polygon of a curve over an interval, span after span; the number of its points."""
    binomials, matrix, net = room
    begin, end = ends
    rows = pieces.shape[1]
    points = 0
    for k in range(pieces.shape[0]):
        width = at[k + 1] - at[k]
        low, high = part_of(begin, end, at[k], width)
        # Skip spans that the interval overlaps by rounding only; the last one is used where all others are skipped.
        is_beyond = (end - at[k]) / width <= WITHIN and k > 0 or (begin - at[k]) / width >= 1.0 - WITHIN
        if is_beyond and not (points == 0 and k == pieces.shape[0] - 1):
            continue
        write_restriction(rows - 1, low, high, binomials, matrix)
        _restrict(pieces[k], matrix, net)
        # Spans share the point where they meet: it is written once.
        for i in range(0 if points == 0 else 1, rows):
            for c in range(3):
                polygon[points, c] = net[i, c]
            points += 1
    return points


@kernel(signatures="(f8[:,:,::1], f8[::1], f8[:,::1], f8[:,::1], i8[::1])", allocates=True)
def bound_chords(pieces, at, t, second, hollow):
    """Bounds over intervals of a plane curve.

    Parameters
    ----------
    pieces, at : (spans, p + 1, 3), (spans + 1,)
    t : (n, 2)
        The ends of the intervals, in any order.
    second, hollow : (n, 2), (n,)
        Zeros on entry; on return bounds of |c_u''| and |c_v''|, and the side to which the curve bends (`_side`).
    """
    spans, rows, _ = pieces.shape
    binomials, matrix, net = np.empty((rows, rows)), np.empty((rows, rows)), np.empty((rows, 3))
    polygon = np.empty((spans * (rows - 1) + 1, 3))
    write_binomials(binomials)
    for n in range(t.shape[0]):
        points = _polygon(pieces, at, (min(t[n, 0], t[n, 1]), max(t[n, 0], t[n, 1])), (binomials, matrix, net), polygon)
        hollow[n] = _side(polygon, points)
    for k in range(spans):
        width = at[k + 1] - at[k]
        for n in range(t.shape[0]):
            begin, end = min(t[n, 0], t[n, 1]), max(t[n, 0], t[n, 1])
            low, high = part_of(begin, end, at[k], width)
            if rows < 2 or not low < high:
                continue
            low, high = not_narrow(low, high)
            write_restriction(rows - 1, low, high, binomials, matrix)
            _restrict(pieces[k], matrix, net)
            least = net[0, 2]
            for i in range(rows):
                least = min(least, net[i, 2])
            wide = ((high - low) * width) ** 2
            for c in range(2):
                second[n, c] = max(second[n, c], _bound_bend(net, c, least) / wide)
