"""Directions in which a pair of nodes is bounded (`pair.py`).

The quality of a bound depends on its direction. Near contact the direction between two points of a long pair may be any
at all, and its halves, which begin with the direction of their parent, would not get better bounds.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.distance.bodies.pair import flat_size

# Where the models of a pair are nearest. size: their distance; turned: how much the direction there differs from the
# frame's; way: this direction; against: whether the opposite direction may be as good.
Nearby = namedtuple("Nearby", "size turned way against")
# A direction is packed as a point on an octahedron: two coordinates of this many steps each in one double.
_STEPS = 2.0**25


@kernel(inline=True)
def packed_way(n):
    """A unit vector as one number, to about 1e-7: its point on the unfolded octahedron |x| + |y| + |z| = 1."""
    s = 1.0 / (abs(n[0]) + abs(n[1]) + abs(n[2]))
    x, y = n[0] * s, n[1] * s
    if n[2] < 0.0:
        x, y = math.copysign(1.0 - abs(y), x), math.copysign(1.0 - abs(x), y)
    return 2.0 * _STEPS * math.floor((1.0 + x) * 0.5 * _STEPS) + math.floor((1.0 + y) * 0.5 * _STEPS)


@kernel(inline=True)
def unpacked_way(number):
    """The unit vector that `packed_way` packed."""
    first = math.floor(number / (2.0 * _STEPS))
    x = (first + 0.5) * 2.0 / _STEPS - 1.0
    y = (number - 2.0 * _STEPS * first + 0.5) * 2.0 / _STEPS - 1.0
    z = 1.0 - abs(x) - abs(y)
    if z < 0.0:
        x, y = math.copysign(1.0 - abs(y), x), math.copysign(1.0 - abs(x), y)
    s = 1.0 / math.sqrt(x * x + y * y + z * z)
    return (s * x, s * y, s * z)


@kernel(inline=True)
def unit_normal(pair, i):
    """The unit normal of a surface at its middle, in the frame, on the side of its direction; zero for a curve."""
    j = pair.j
    o = 3 * i
    x = j[o + 1] * j[o + 5] - j[o + 2] * j[o + 4]
    y = j[o + 2] * j[o + 3] - j[o] * j[o + 5]
    z = j[o] * j[o + 4] - j[o + 1] * j[o + 3]
    size = math.copysign(math.sqrt(x * x + y * y + z * z) + 1e-300, z)
    return (x / size, y / size, z / size)


@kernel(inline=True)
def along_normals(pair, way):
    """Where the models are nearest. If the pair is longer than its distance, the way is taken along its normals."""
    z, d, j, k, f = pair.z, pair.d, pair.j, pair.k, pair.frame
    v0, v1, v2 = d[0], d[1], d[2]
    for i in range(4):
        v0 += z[i] * j[3 * i]
        v1 += z[i] * j[3 * i + 1]
        v2 += z[i] * j[3 * i + 2]
    for side in range(2):
        x, y = z[2 * side], z[2 * side + 1]
        for i in range(3):
            factor = 0.5 * x * x if i == 0 else (x * y if i == 1 else 0.5 * y * y)
            o = 9 * side + 3 * i
            v0 += factor * k[o]
            v1 += factor * k[o + 1]
            v2 += factor * k[o + 2]
    size = math.sqrt(v0 * v0 + v1 * v1 + v2 * v2)
    long = max(max(flat_size(j, 0), flat_size(j, 1)), max(flat_size(j, 2), flat_size(j, 3)))
    against = False
    if size < long:
        p, q = unit_normal(pair, 0), unit_normal(pair, 2)
        if min(p[2], q[2]) > 0.3:
            # Normals are on the frame's side; where the nearest points are the other way, that side may be right.
            against = v2 < -0.5 * size
            v0, v1, v2 = p[0] + q[0], p[1] + q[1], p[2] + q[2]
    length = math.sqrt(v0 * v0 + v1 * v1 + v2 * v2)
    if not length > 0.0:
        return Nearby(size, 0.0, way, against)
    v0, v1, v2 = v0 / length, v1 / length, v2 / length
    own = (
        v0 * f[0] + v1 * f[3] + v2 * f[6],
        v0 * f[1] + v1 * f[4] + v2 * f[7],
        v0 * f[2] + v1 * f[5] + v2 * f[8],
    )
    return Nearby(size, abs(v0) + abs(v1) + max(0.0, -v2), own, against)
