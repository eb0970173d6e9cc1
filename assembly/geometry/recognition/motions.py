"""Whether a rigid motion maps a surface into itself: planes, cylinders and so on have one, other surfaces none.

A rotation, translation or screw motion that does so moves the surface's points p at right angles to the normals n:

    n.(a x p + d) = (p x n).a + n.d = 0        for all points, with one a and one d, not both zero.

So the rows (p x n, n) of samples of a plane, a cylinder, a cone, a sphere, a torus, an extrusion or a revolution have a
rank of five or less. Where their sixth singular value is not small the surface is none of these. The test uses the
squares of singular values, in which rounding hides singular values below 1e-7 of the largest.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.vec import cross, scale, sub

# Doubles of a matrix of normals and moments.
GRAM = 36


@kernel(inline=True)
def homogeneous_at(pieces, begin, shape, along_u, along_v):
    """The sum of the rows (w x, w y, w z, w) of the net at pieces[begin:], times factors along u and along v."""
    x = y = z = w = 0.0
    at = begin
    for i in range(shape[0]):
        for j in range(shape[1]):
            factor = along_u[i] * along_v[j]
            x += factor * pieces[at]
            y += factor * pieces[at + 1]
            z += factor * pieces[at + 2]
            w += factor * pieces[at + 3]
            at += 4
    return (x, y, z), w


@kernel(inner=True)
def add_sample(pieces, begin, shape, factors, frame, gram):
    """Add the products of one sample's row to a Gram matrix.

    `factors`: values and slopes of the Bernstein polynomials along u, and along v; `frame`: middle, and one over the
    size.
    """
    b, db, c, dc = factors
    s, w = homogeneous_at(pieces, begin, shape, b, c)
    su, wu = homogeneous_at(pieces, begin, shape, db, c)
    sv, wv = homogeneous_at(pieces, begin, shape, b, dc)
    point = scale(1.0 / w, s)
    normal = scale(frame[1] * frame[1] / (w * w), cross(sub(su, scale(wu, point)), sub(sv, scale(wv, point))))
    moment = cross(scale(frame[1], sub(point, frame[0])), normal)
    row = (moment[0], moment[1], moment[2], normal[0], normal[1], normal[2])
    for i in range(6):
        for j in range(6):
            gram[6 * i + j] += row[i] * row[j]


@kernel(inner=True)
def has_rank_six(gram, least):
    """Whether all eigenvalues of a Gram matrix (6, 6) are above a part of their sum: Cholesky. It is overwritten."""
    trace = 0.0
    for i in range(6):
        trace += gram[7 * i]
    for i in range(6):
        gram[7 * i] -= least * trace
    for j in range(6):
        for i in range(j, 6):
            value = gram[6 * i + j]
            for k in range(j):
                value -= gram[6 * i + k] * gram[6 * j + k]
            if i == j:
                if not value > 0.0:
                    return False
                gram[7 * j] = math.sqrt(value)
            else:
                gram[6 * i + j] = value / gram[7 * j]
    return True


_SAMPLES = "UniTuple(i8[::1], 2), UniTuple(f8[:, ::1], 4)"


@kernel(signatures=f"(f8[::1], UniTuple(i8, 4), {_SAMPLES}, Tuple((UniTuple(f8, 3), f8)), f8, f8[::1])")
def moves_nowhere(pieces, shape, chosen, basis, frame, loose, gram):
    """Whether samples show that no rigid motion maps a surface into itself.

    Parameters
    ----------
    pieces : (4 spans_u spans_v m n,)
        Its Bezier points, homogeneous.
    shape : (int, int, int, int)
        spans_u, spans_v, and how many points a piece has along u and v.
    chosen : (array, array)
        The pieces that are sampled, along u and v.
    basis : (array, array, array, array)
        Values and slopes of the Bernstein polynomials at the places of samples: of u (places, m), and of v (places, n).
    frame : ((float, float, float), float)
        The middle of the surface, and one over its size.
    loose : float
        The part of the largest singular value below which the sixth one counts as zero; 1e-6 or more.
    gram : (GRAM,)
        For work.
    """
    gram[:] = 0.0
    net = shape[2], shape[3]
    values_u, slopes_u, values_v, slopes_v = basis
    for i in chosen[0]:
        for j in chosen[1]:
            begin = 4 * net[0] * net[1] * (i * shape[1] + j)
            for k in range(len(values_u)):
                for l in range(len(values_v)):
                    factors = values_u[k], slopes_u[k], values_v[l], slopes_v[l]
                    add_sample(pieces, begin, net, factors, frame, gram)
    return has_rank_six(gram, loose * loose)
