"""Cones of directions (a unit axis and a half angle) around vectors and around other cones, rounded outward.

A circular cone with a half angle of less than 90 degrees is convex: one that holds the Bezier vectors of a normal holds
the normal.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel

# All directions.
FULL = math.pi
# Above this half angle [rad] a cone is not safely convex: it may not hold positive combinations of its vectors.
CONVEX = 1.5
# Rounding of a unit vector, of an angle and of a box, in parts of its extent.
MARGIN = 1e-14
# Steps of the axis towards the direction that is farthest off; the k-th goes 1 / (k + 2) of the way.
_STEPS = 8


@kernel(inline=True, exact=True)
def exact_length(x, y, z):
    """The length of a vector, the same on all processors."""
    return math.sqrt(x * x + y * y + z * z)


@kernel(inline=True, exact=True)
def angle_between(a, b):
    """The angle between unit vectors, accurate for small ones too."""
    return 2.0 * math.asin(min(0.5 * exact_length(a[0] - b[0], a[1] - b[1], a[2] - b[2]), 1.0))


@kernel(inline=True, exact=True)
def _unit(x, y, z):
    """A unit vector; (0, 0, 1) for what is nearly zero."""
    length = exact_length(x, y, z)
    return (x / length, y / length, z / length) if length > 1e-3 else (0.0, 0.0, 1.0)


@kernel(inline=True)
def _three(block, at):
    """A vector of a block."""
    return block[at], block[at + 1], block[at + 2]


@kernel(inline=True)
def _axis_of(cones, i):
    """The axis of a cone."""
    return cones[i, 0], cones[i, 1], cones[i, 2]


@kernel(inner=True, exact=True)
def cone_of_vectors(vectors, first, count, slack, vanish):
    """The cone around vectors (count, 3) of a block and so their positive combinations, see `cones.around_vectors`."""
    low, high = (1.0, 1.0, 1.0), (-1.0, -1.0, -1.0)
    smallest = math.inf
    for k in range(count):
        a = _three(vectors, first + 3 * k)
        length = exact_length(a[0], a[1], a[2])
        if length == 0.0:
            if vanish:
                continue
            return (0.0, 0.0, 1.0), FULL
        a = (a[0] / length, a[1] / length, a[2] / length)
        smallest = min(smallest, length)
        low = (min(low[0], a[0]), min(low[1], a[1]), min(low[2], a[2]))
        high = (max(high[0], a[0]), max(high[1], a[1]), max(high[2], a[2]))
    axis = _unit(0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2]))
    if smallest == math.inf:
        return axis, FULL
    half = 0.0
    for k in range(count):
        a = _three(vectors, first + 3 * k)
        length = exact_length(a[0], a[1], a[2])
        if length > 0.0:
            # The angle from the axis to the vector, and a bound of the error of the vector's direction.
            off = angle_between((a[0] / length, a[1] / length, a[2] / length), axis)
            half = max(half, off + math.asin(min(slack, length) / length))
    half += 2.0 * MARGIN
    return axis, half if half < CONVEX else FULL


@kernel(inner=True, exact=True)
def cone_of_cones(cones, order, first, stop):
    """The cone around those cones (n, 4), axis and half angle, that stand in the order from first to stop."""
    low, high = (math.inf, math.inf, math.inf), (-math.inf, -math.inf, -math.inf)
    for k in range(first, stop):
        a = _axis_of(cones, order[k])
        low = (min(low[0], a[0]), min(low[1], a[1]), min(low[2], a[2]))
        high = (max(high[0], a[0]), max(high[1], a[1]), max(high[2], a[2]))
    middle = _unit(0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2]))
    best, least = middle, math.inf
    for step in range(_STEPS):
        wide, far = -math.inf, order[first]
        for k in range(first, stop):
            i = order[k]
            reach = angle_between(_axis_of(cones, i), middle) + cones[i, 3]
            if reach > wide:
                wide, far = reach, i
        if wide < least:
            best, least = middle, wide
        x, y, z = _axis_of(cones, far)
        parts = step + 3.0
        middle = _unit(
            middle[0] + (x - middle[0]) / parts,
            middle[1] + (y - middle[1]) / parts,
            middle[2] + (z - middle[2]) / parts,
        )
    return best, min(least + 2.0 * MARGIN, FULL)


@kernel(signatures="(f8[::1], f8[::1], b1[::1], f8[:, ::1])")
def write_cones_of_vectors(vectors, slack, vanish, out):
    """Cones (n, 4), axis and half angle, of vectors (n, k, 3), flat."""
    count = vectors.size // (3 * max(len(out), 1))
    for i in range(len(out)):
        axis, half = cone_of_vectors(vectors, 3 * count * i, count, slack[i], vanish[i])
        out[i, 0], out[i, 1], out[i, 2] = axis
        out[i, 3] = half


@kernel(signatures="(f8[:, ::1], i8[::1], i8[::1], f8[:, ::1])")
def write_cones_of_cones(cones, order, begins, out):
    """Cones (n, 4) around those from each begin to the next one."""
    for i in range(len(out)):
        stop = begins[i + 1] if i + 1 < begins.size else order.size
        axis, half = cone_of_cones(cones, order, begins[i], stop)
        out[i, 0], out[i, 1], out[i, 2] = axis
        out[i, 3] = half
