"""Kernels that halve Bezier pieces of a surface into cells with bounding spheres, and put neighbors together.

Sums are rounded one after the other, without fused multiply-adds: the last bit decides which of two equal directions
is the longer one, and which of two equal cells the larger.
"""

from __future__ import annotations

from math import sqrt

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of

# What is measured of a cell.
BOUNDS = record_dtype(
    "f8",
    center=3,  # of a sphere around it
    radius=1,
    along_u=1,  # 1: u is its longer direction; 0: v is
)
bounds_at = record_view(BOUNDS)
BOUNDS_SIZE = size_of(BOUNDS)


@kernel(inner=True, exact=True)
def _measure(net, bounds):
    """A sphere around the control points (p + 1, q + 1, 4) of a cell, and its longer direction."""
    rows, columns = net.shape[0], net.shape[1]
    far = 0.0
    for c in range(3):
        low = net[0, 0, c] / net[0, 0, 3]
        high = low
        for i in range(rows):
            for j in range(columns):
                x = net[i, j, c] / net[i, j, 3]
                low = min(low, x)
                high = max(high, x)
        bounds.center[c] = 0.5 * (low + high)
        far = max(far, abs(bounds.center[c]))
    largest = long_u = long_v = 0.0
    middle_x, middle_y, middle_z = bounds.center[0], bounds.center[1], bounds.center[2]
    for j in range(columns):
        total = 0.0
        for i in range(rows):
            a, b, c = net[i, j, 0] / net[i, j, 3], net[i, j, 1] / net[i, j, 3], net[i, j, 2] / net[i, j, 3]
            x, y, z = a - middle_x, b - middle_y, c - middle_z
            largest = max(largest, x * x + y * y + z * z)
            if i + 1 < rows:
                w = net[i + 1, j, 3]
                x, y, z = net[i + 1, j, 0] / w - a, net[i + 1, j, 1] / w - b, net[i + 1, j, 2] / w - c
                total += sqrt(x * x + y * y + z * z)
        long_u += total
    for i in range(rows):
        total = 0.0
        for j in range(columns - 1):
            v, w = net[i, j, 3], net[i, j + 1, 3]
            x = net[i, j + 1, 0] / w - net[i, j, 0] / v
            y = net[i, j + 1, 1] / w - net[i, j, 1] / v
            z = net[i, j + 1, 2] / w - net[i, j, 2] / v
            total += sqrt(x * x + y * y + z * z)
        long_v += total
    radius = sqrt(largest)
    # The margin covers rounding of the coordinates and of the halving: the sphere must contain the cell.
    bounds.radius = radius + 1e-14 * (radius + far)
    bounds.along_u = 1.0 if long_u / columns >= long_v / rows else 0.0


@kernel(inline=True, exact=True)
def _copy(net, other):
    for i in range(net.shape[0]):
        for j in range(net.shape[1]):
            for c in range(net.shape[2]):
                other[i, j, c] = net[i, j, c]


@kernel(inner=True, exact=True)
def _halve(net, along_u, lower, upper):
    """De Casteljau's algorithm at the middle."""
    rows, columns = net.shape[0], net.shape[1]
    _copy(net, upper)
    many = rows if along_u else columns
    for k in range(many):
        if along_u:
            for j in range(columns):
                for c in range(4):
                    lower[k, j, c] = upper[0, j, c]
            for i in range(many - 1 - k):
                for j in range(columns):
                    for c in range(4):
                        upper[i, j, c] = 0.5 * (upper[i, j, c] + upper[i + 1, j, c])
        else:
            for i in range(rows):
                for c in range(4):
                    lower[i, k, c] = upper[i, 0, c]
                for j in range(many - 1 - k):
                    for c in range(4):
                        upper[i, j, c] = 0.5 * (upper[i, j, c] + upper[i, j + 1, c])


@kernel(inner=True, exact=True)
def _sorted_by_radius(measured, count, share, most, order):
    """Write to `order` the cells of a radius of at least `share` times the largest, largest first; how many."""
    largest = 0.0
    for k in range(count):
        largest = max(largest, bounds_at(measured, k).radius)
    found = 0
    for k in range(count):
        radius = bounds_at(measured, k).radius
        if radius < share * largest:
            continue
        place = found
        while place > 0 and bounds_at(measured, order[place - 1]).radius < radius:
            order[place] = order[place - 1]
            place -= 1
        order[place] = k
        found += 1
    return min(found, most)


@kernel(inner=True, exact=True)
def _write_halves(nets, boxes, measured, now, k, at, step):
    """Halve cell k of one side of the buffers into places at and at + step of the other side."""
    new = 1 - now
    along_u = bounds_at(measured[now], k).along_u > 0.0
    _halve(nets[now, k], along_u, nets[new, at], nets[new, at + step])
    first = 0 if along_u else 2
    for c in range(4):
        boxes[new, at, c] = boxes[new, at + step, c] = boxes[now, k, c]
    middle = 0.5 * (boxes[now, k, first] + boxes[now, k, first + 1])
    boxes[new, at, first + 1] = boxes[new, at + step, first] = middle
    _measure(nets[new, at], bounds_at(measured[new], at))
    _measure(nets[new, at + step], bounds_at(measured[new], at + step))


@kernel(signatures="(f8[:,:,:,:,::1], f8[:,:,::1], f8[:,:,::1], i8, f8, i8[::1])", exact=True)
def split_cells(nets, boxes, measured, count, share, order):
    """Halve the largest cells until there are as many as there is room for.

    Parameters
    ----------
    nets, boxes, measured : (2, n, p + 1, q + 1, 4), (2, n, 4), (2, n, BOUNDS_SIZE)
        Two buffers for n cells: control points, boxes in (u, v), and what is measured. The first `count` of the first
        buffer are given; what is measured is filled here.
    count : int
    share : float
        A round halves the cells whose spheres are larger than this part of the largest.
    order : (n,) of int
        Room for work.

    Returns
    -------
    int
        The buffer that the cells are in.
    """
    now, most = 0, boxes.shape[1]
    for k in range(count):
        _measure(nets[0, k], bounds_at(measured[0], k))
    while count < most:
        large = _sorted_by_radius(measured[now], count, share, most - count, order)
        of_u = 0
        for i in range(large):
            if bounds_at(measured[now], order[i]).along_u > 0.0:
                of_u += 1
        # First the cells that stay, then the lower and the upper halves in u, then those in v.
        at_u = count - large
        at_v = at_u + 2 * of_u
        for i in range(large):
            k = order[i]
            if bounds_at(measured[now], k).along_u > 0.0:
                _write_halves(nets, boxes, measured, now, k, at_u, of_u)
                at_u += 1
            else:
                _write_halves(nets, boxes, measured, now, k, at_v, large - of_u)
                at_v += 1
            boxes[now, k, 0] = float("nan")
        kept = 0
        for k in range(count):
            if boxes[now, k, 0] == boxes[now, k, 0]:
                _copy(nets[now, k], nets[1 - now, kept])
                for c in range(4):
                    boxes[1 - now, kept, c] = boxes[now, k, c]
                for c in range(measured.shape[2]):
                    measured[1 - now, kept, c] = measured[now, k, c]
                kept += 1
        count += large
        now = 1 - now
    return now


@kernel(signatures="(f8[:,::1], i8, i8[::1], f8[::1])", exact=True)
def put_neighbors_together(measured, group, order, along):
    """Fill an order in which consecutive cells lie close together.

    Ranges of cells are halved at the median along the axis in which their centers spread most, level by level, down
    to the size of a group.

    Parameters
    ----------
    measured : (n, BOUNDS_SIZE)
    group : int
        How many cells a group has.
    order : (group 2^levels,) of int
        At least n places; the first n get the order.
    along : (group 2^levels,)
        Room for work.
    """
    count, size = measured.shape[0], order.size
    # Copies of the last cell make the ranges equal; they are dropped in the end.
    for k in range(size):
        order[k] = min(k, count - 1)
    while size > group:
        for begin in range(0, order.size, size):
            _sort_range(measured, order[begin : begin + size], along)
        size //= 2
    kept, last = 0, False
    for k in range(order.size):
        if order[k] == count - 1:
            if last:
                continue
            last = True
        order[kept] = order[k]
        kept += 1


@kernel(inner=True, exact=True)
def _sort_range(measured, order, along):
    """Sort cells along the axis in which their centers spread most; equals stay in order."""
    axis, most = 0, -1.0
    for c in range(3):
        low = high = bounds_at(measured, order[0]).center[c]
        for k in range(order.size):
            x = bounds_at(measured, order[k]).center[c]
            low = min(low, x)
            high = max(high, x)
        if high - low > most:
            axis, most = c, high - low
    for k in range(order.size):
        cell = order[k]
        x = bounds_at(measured, cell).center[axis]
        place = k
        while place > 0 and along[place - 1] > x:
            along[place], order[place] = along[place - 1], order[place - 1]
            place -= 1
        along[place], order[place] = x, cell
