"""The 2 x 2 matrix H of Newton's method and of the contact velocities (paper 001, equation 14), and its inverse.

With A and C the shape operators of two surfaces and beta their gap, H = C (I + beta A) - A
(`proximity/extrema/face_face.py`). At contact, beta = 0, the gap changes by -a.H a / 2 with a tangential move a. Where
H is singular or nearly so, the pair is one of a continuum (a near-singular minimum) whose least gap may be far away.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel

# H counts as singular below the first ratio of its smallest singular value to its scale; below the second its inverse
# is damped.
RANK, WEAK = 1e-7, 1e-5
# Added to |H| along a valley, over the scale of H: the first times the angle by which the pair is off [rad], at least
# the second. An error across the valley says nothing about where along it the gap is least; below the second
# curvatures are rounding.
UNSURE, LEVEL = 0.1, 1e-10
# Farther off than this, in radians, it is not known whether there is a valley.
NEAR = 0.1
# [1 / length, times the size] Curvatures below this are rounding: what is left of a plane's. Doubled: spheres twice as
# large count as planes. Chosen.
FLAT = 1e-9
# [rad, length over the size] Where a pair is not isolated, a residual below this is zero. Doubled: points of a
# continuum are twice as far off. Chosen.
VANISHING = 1e-9
# [det H over |H|^2] A pair this far on the wrong side of its fold may still be a minimum. Doubled: so may a saddle
# twice as far. Chosen, above what rounding makes of H where its terms cancel.
FOLDED = 1e-9
# [det H over |H|^2] A pair this near to a fold is one of a continuum as far as Newton's method can tell. Doubled:
# narrow minima count as any point of a valley. Chosen.
CONTINUUM = 1e-6
# [det H over |H|^2] A pair this far from a fold is the only one in its patches and those beside them, which turn by
# half a radian at most. Doubled: more of them are searched. Chosen.
ALONE = 0.05
# A pair of greatest gap along a valley is kept where H along the valley is more than so many times the damping.
PLAIN = 10.0

# How the normals of a pair part as it moves, with A and C the shape operators of its surfaces and beta the gap.
PairMatrix = namedtuple(
    "PairMatrix",
    [
        "k",  # I + beta A (11, 12, 22)
        "h",  # H = C (I + beta A) - A (11, 12, 21, 22)
        "inverse",  # of H (11, 12, 21, 22), damped where it is nearly singular
        "isolated",  # whether H is regular: else the pair is one of a continuum
    ],
)


@kernel(inline=True)
def fold_of(h, size):
    """det H / |H|^2: how far a pair is from a fold, where it ceases to be isolated; zero where H is nothing."""
    norm2 = h[0] * h[0] + h[1] * h[1] + h[2] * h[2] + h[3] * h[3]
    return (h[0] * h[3] - h[1] * h[2]) / norm2 if norm2 > 1e-18 * size * size else 0.0


@kernel(inline=True)
def is_no_saddle(fold):
    """Whether surfaces do not cross beside a pair, by how far it is from a fold; True at the fold itself."""
    return fold > -FOLDED


@kernel(inline=True)
def is_the_only_one(fold):
    """Whether a pair is a minimum with no other one beside it, by how far it is from a fold."""
    return fold > ALONE


@kernel(inline=True)
def curvature_bound(a):
    """A bound of the largest principal curvature."""
    return abs(a[0]) + 2.0 * abs(a[1]) + abs(a[2])


@kernel(inline=True)
def scale_of(a, c, k):
    """What H = C K - A is measured against, K = I + beta A."""
    return curvature_bound(c) * (abs(k[0]) + 2.0 * abs(k[1]) + abs(k[2])) + curvature_bound(a)


@kernel(inline=True)
def damped_inverse(h, damping):
    """(H^T H + damping^2 I)^-1 H^T, in products that do not cancel where H is singular."""
    square = damping * damping
    det = h[0] * h[3] - h[1] * h[2]
    i = 1.0 / (det * det + square * (h[0] * h[0] + h[1] * h[1] + h[2] * h[2] + h[3] * h[3] + square))
    return (
        i * (det * h[3] + square * h[0]),
        i * (square * h[2] - det * h[1]),
        i * (square * h[1] - det * h[2]),
        i * (det * h[0] + square * h[3]),
    )


@kernel(inline=True)
def pair_matrix(a, c, beta, flat):
    """The `PairMatrix` of shape operators A and C and the gap beta.

    Where H is (nearly) singular the inverse is damped: the least step, so that the current pair of a continuum is kept.
    `flat` is the curvature below which a scene counts as flat.
    """
    k11 = 1.0 + beta * a[0]
    k12 = beta * a[1]
    k22 = 1.0 + beta * a[2]
    h11 = c[0] * k11 + c[1] * k12 - a[0]
    h12 = c[0] * k12 + c[1] * k22 - a[1]
    h21 = c[1] * k11 + c[2] * k12 - a[1]
    h22 = c[1] * k12 + c[2] * k22 - a[2]
    size = scale_of(a, c, (k11, k12, k22))
    det = h11 * h22 - h12 * h21
    norm = abs(h11) + abs(h12) + abs(h21) + abs(h22)
    # The smallest singular value is at least |det| / norm.
    regular = abs(det) > RANK * size * norm and size > flat
    if abs(det) > WEAK * size * norm and size > flat:
        i = 1.0 / det
        inverse = (i * h22, -i * h12, -i * h21, i * h11)
    else:
        inverse = damped_inverse((h11, h12, h21, h22), max(RANK * size, flat))
    return PairMatrix((k11, k12, k22), (h11, h12, h21, h22), inverse, regular)


@kernel(inline=True)
def right_side(c, r):
    """C r1 - r2, the right side of H a: how far the normals are from parallel at points above each other [rad]."""
    return c[0] * r[0] + c[1] * r[1] - r[2], c[1] * r[0] + c[2] * r[1] - r[3]


@kernel(inline=True)
def null_ways(h):
    """Unit null vectors w and v of H and H^T: H w and v^T H are zero where H is singular; v.w >= 0."""
    by_row = h[0] * h[0] + h[1] * h[1] >= h[2] * h[2] + h[3] * h[3]
    w = (-h[1], h[0]) if by_row else (-h[3], h[2])
    by_column = h[0] * h[0] + h[2] * h[2] >= h[1] * h[1] + h[3] * h[3]
    v = (-h[2], h[0]) if by_column else (-h[3], h[1])
    i = 1.0 / max(math.sqrt(w[0] * w[0] + w[1] * w[1]), 1e-300)
    j = math.copysign(1.0, v[0] * w[0] + v[1] * w[1]) / max(math.sqrt(v[0] * v[0] + v[1] * v[1]), 1e-300)
    return (j * v[0], j * v[1]), (i * w[0], i * w[1])


@kernel(inline=True)
def across_first(a, c, r, k, h, inverse, flat):
    """The inverse of H for a step from here, and whether it goes along a valley that is all but level.

    There Newton's step is the quotient of two small numbers: until the pair is at the bottom, both are mostly due to
    its error across the valley, and beyond an inflection the step leads up. So -H along the valley is replaced by |H|
    plus a part of that error: steps go across first, and then down. Near the solution they are Newton's.
    """
    size = scale_of(a, c, k)
    norm = abs(h[0]) + abs(h[1]) + abs(h[2]) + abs(h[3])
    if abs(h[0] * h[3] - h[1] * h[2]) > WEAK * size * norm:
        return inverse, False
    s0, s1 = right_side(c, r)
    off = abs(s0) + abs(s1)
    if off > NEAR:
        return inverse, False
    damping = max(max(UNSURE * off, LEVEL) * size, flat)
    v, w = null_ways(h)
    bend = v[0] * (h[0] * w[0] + h[1] * w[1]) + v[1] * (h[2] * w[0] + h[3] * w[1])
    if not h[0] + h[3] < -damping or bend > PLAIN * damping:
        # A ridge, or near the highest pair along a valley, which is one as well.
        return damped_inverse(h, damping), True
    more = -(abs(bend) + damping) - bend
    b = (h[0] + more * v[0] * w[0], h[1] + more * v[0] * w[1], h[2] + more * v[1] * w[0], h[3] + more * v[1] * w[1])
    det = b[0] * b[3] - b[1] * b[2]
    if not det > 0.25 * damping * max(abs(b[0]), abs(b[3])):
        # Too far from singular for v and w to be its null vectors.
        return damped_inverse(h, damping), True
    i = 1.0 / det
    return (i * b[3], -i * b[1], -i * b[2], i * b[0]), True
