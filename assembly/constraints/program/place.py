"""Places on faces that contacts are drawn to, or kept at: in lengths, by the contact's own coordinates.

Let d be the contact's coordinates on a face less those of the target, the shorter way around in closed directions. Then

    e = J d,    J^T J = the first fundamental form at the target,

are the two rows of a point. A line of constant coordinate has one row, the difference of that coordinate times the
surface's mean stretch across the line. An objective is w |e|^2. The derivatives follow from those of the coordinates
u: these are unknowns where the contact's pair is lifted; else, by the contact velocity formulation,

    e_q = J u_q,

and the second derivative of g.u is that of g.u + y.F. Here F are the four rows of tangency (`lifted_pair.py`), which
are zero at u, and y is such that F_u^T y = -g:

    (g.u)_qq = [I u_q^T] (y.F)_(q,u)(q,u) [I; u_q],     F_u u_q = -F_q.

The loop calls `place_terms` by its address; rows of trims and their second derivatives call the other kernels.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store, record_dtype, record_view
from assembly.constraints.program.contact import contact_of
from assembly.constraints.program.objective_terms import PLACE, TERM, term_at
from assembly.constraints.program.records import FREE_COLUMN, Iterate, LiftedPairs, header_at, jacobian_row_at
from assembly.constraints.program.row_terms import add_gram, column_of, width
from assembly.geometry.splines.evaluate import surface_point
from assembly.geometry.vec import dot
from assembly.proximity.extrema.lifted_pair import VARIABLES, LiftedPair, free_hessian, free_rows
from assembly.proximity.extrema.rates import derivatives_at

# A place in the pool.
PLACE_FIELDS = record_dtype(
    "f8",
    weight=1,  # of the square, in an objective
    target=2,  # coordinates; for a line only one of them counts
    period=2,  # of the coordinates; 0: not closed
    stretch=4,  # J by rows [over the size of the scene]; for a line only the first row counts
)
place_at = record_view(PLACE_FIELDS)
# The place at `at` in the pool, the contact that it belongs to, and the contact's side on which it is, 0 or 1.
OwnPlace = namedtuple("OwnPlace", "at contact side")
# Pivots below this part of the largest entry count as zero: the pair is degenerate or at a pole, and u has no second
# derivative.
REGULAR = 1e-11


@kernel(inline=True)
def away(place, i, value):
    """Coordinate i less the target's, the shorter way around if it is closed."""
    d = value - place.target[i]
    period = place.period[i]
    return d - period * math.floor(d / period + 0.5) if period > 0.0 else d


@kernel(inline=True)
def place_error(store, at, i, u, v):
    """Row i of a place: a length over the size of the scene."""
    place = place_at(store.pool, at)
    value = 0.0
    # A line has no difference along itself.
    if place.stretch[2 * i] != 0.0:
        value += place.stretch[2 * i] * away(place, 0, u)
    if place.stretch[2 * i + 1] != 0.0:
        value += place.stretch[2 * i + 1] * away(place, 1, v)
    return value


@kernel(inner=True)
def add_place_rates(store, own, i, lifted, point, jacobian, r):
    """Row r += the derivative of row i of a place, an `OwnPlace`."""
    k, side = own.contact, own.side
    place = place_at(store.pool, own.at)
    for j in range(2):
        factor = place.stretch[2 * i + j]
        if factor == 0.0:
            continue
        if lifted.free[k] >= 0:
            jacobian_row_at(jacobian, r).lifted[2 * side + j] += factor / lifted.lengths[k, 2 * side + j]
            continue
        derivatives = derivatives_at(point.records, k)
        for l in range(4):
            rate = factor * derivatives.rates[2 * side + j, l]
            for c in range(FREE_COLUMN):
                jacobian[r, c] += rate * derivatives.zed[l, c]


@kernel(inner=True)
def solve_four(m, b):
    """Solve m x = b for all columns of b in place, with row pivoting; False where m is singular. m is overwritten."""
    largest = 0.0
    for value in m.flat:
        if not math.isfinite(value):
            return False
        largest = max(largest, abs(value))
    for k in range(4):
        best = k
        for i in range(k + 1, 4):
            if abs(m[i, k]) > abs(m[best, k]):
                best = i
        if not abs(m[best, k]) > REGULAR * largest:
            return False
        for j in range(4):
            m[k, j], m[best, j] = m[best, j], m[k, j]
        for j in range(b.shape[1]):
            b[k, j], b[best, j] = b[best, j], b[k, j]
        for i in range(4):
            if i == k:
                continue
            factor = m[i, k] / m[k, k]
            for j in range(4):
                m[i, j] -= factor * m[k, j]
            for j in range(b.shape[1]):
                b[i, j] -= factor * b[k, j]
    for i in range(4):
        for j in range(b.shape[1]):
            b[i, j] /= m[i, i]
    return True


@kernel(inner=True)
def pair_of(store, k, tracked):
    """Contact k as a lifted pair, its coordinates scaled by the lengths of the tangents at the pair."""
    contact = contact_of(store.table, k)
    x = (tracked[k, 0], tracked[k, 1], tracked[k, 2], tracked[k, 3])
    f = surface_point(store.table, store.pool, contact.surface_f, x[0], x[1])
    g = surface_point(store.table, store.pool, contact.surface_g, x[2], x[3])
    lengths = (
        math.sqrt(dot(f.u, f.u)),
        math.sqrt(dot(f.v, f.v)),
        math.sqrt(dot(g.u, g.u)),
        math.sqrt(dot(g.v, g.v)),
    )
    return LiftedPair(
        surfaces=(contact.surface_f, contact.surface_g),
        bodies=(contact.body_f, contact.body_g),
        x=x,
        lengths=lengths,
    )


@kernel(inner=True, allocates=True)
def add_coordinate_curvature(store, own, slopes, lifted, bases, point, hessian):
    """Upper triangle of hessian += second derivative of slopes . coordinates in the poses, of an `OwnPlace`.

    Nothing is added where the coordinates are unknowns, nor at degenerate pairs and poles, where it does not exist.
    """
    k, side = own.contact, own.side
    slope_u, slope_v = slopes
    if lifted.free[k] >= 0 or (slope_u == 0.0 and slope_v == 0.0):
        return
    pair = pair_of(store, k, point.tracked)
    s = pair.lengths
    if not min(min(s[0], s[1]), min(s[2], s[3])) > 0.0:
        return
    rows = np.empty((5, VARIABLES))
    free_rows(store, pair, point.q, lifted.vectors, np.empty(5), rows, 0, 1)
    matrix, transposed = np.empty((4, 4)), np.empty((4, 4))
    rates, forces = np.empty((4, 12)), np.zeros((4, 1))
    for i in range(4):
        for j in range(4):
            matrix[i, j] = rows[1 + i, 12 + j]
            transposed[j, i] = matrix[i, j]
        for j in range(12):
            rates[i, j] = -rows[1 + i, j]
    o = 2 * side
    forces[o, 0] = -slope_u / s[o]
    forces[o + 1, 0] = -slope_v / s[o + 1]
    if not (solve_four(matrix, rates) and solve_four(transposed, forces)):
        return
    block = lifted.variables
    y = (0.0, forces[0, 0], forces[1, 0], forces[2, 0], forces[3, 0])
    free_hessian(store, pair, point.q, y, lifted.vectors, block)
    # [I u_q^T] block [I; u_q], the product with the right factor first.
    for i in range(VARIABLES):
        for j in range(12):
            value = block[i, j]
            for l in range(4):
                value += block[i, 12 + l] * rates[l, j]
            block[i, j] = value
    f, g = bases[k, 0], bases[k, 1]
    for i in range(12):
        at = f + i if i < 6 else g + i - 6
        for j in range(12):
            other = f + j if j < 6 else g + j - 6
            if (f if i < 6 else g) < 0 or (f if j < 6 else g) < 0 or other < at:
                continue
            value = block[i, j]
            for l in range(4):
                value += rates[l, i] * block[12 + l, j]
            hessian[at, other] += value


@kernel(inner=True, allocates=True)
def place_term(store, term, bases, lifted, point, order, gradient, hessian):
    """w |e|^2 of one term; from order 1 on its derivatives are added."""
    k, side, at = term.contact, term.side, term.parameters
    own, weight = OwnPlace(at, k, side), place_at(store.pool, at).weight
    u, v = point.tracked[k, 2 * side], point.tracked[k, 2 * side + 1]
    places = np.empty((1, bases.shape[1]), np.int64)
    for b in range(bases.shape[1]):
        places[0, b] = bases[k, b]
    value, slope_u, slope_v = 0.0, 0.0, 0.0
    for i in range(term.rows):
        e = place_error(store, at, i, u, v)
        value += weight * e * e
        if order == 0:
            continue
        slope_u += 2.0 * weight * e * place_at(store.pool, at).stretch[2 * i]
        slope_v += 2.0 * weight * e * place_at(store.pool, at).stretch[2 * i + 1]
        rates = np.zeros((1, point.jacobian.shape[1]))
        add_place_rates(store, own, i, lifted, point, rates, 0)
        for b in range(3):
            first, column = bases[k, b], column_of(b)
            for j in range(width(b) if first >= 0 else 0):
                gradient[first + j] += 2.0 * weight * e * rates[0, column + j]
        add_gram(places, rates, 0, 2.0 * weight, hessian)
    if order > 0:
        add_coordinate_curvature(store, own, (slope_u, slope_v), lifted, bases, point, hessian)
    return value


@kernel(
    signatures=(
        "(Tuple((i8[::1], f8[::1])), "
        "Tuple((i8[::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1], f8[::1])), "
        "i8[:, ::1], Tuple((f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[::1], f8[:, ::1])), i8, f8[::1], f8[:, ::1])"
    ),
    allocates=True,
)
def place_terms(scene, pairs, bases, at, order, gradient, hessian):
    """The terms of an objective that are places; their sum is written to the first number of `pairs.variables`.

    From order 1 on, gradients and the upper triangles of Hessians are added. `pairs` and `at` have the parts of
    `LiftedPairs` and of an `Iterate`.
    """
    table, pool = scene
    free, lengths, vectors, variables, guess, memory = pairs
    q, tracked, records, residual, jacobian = at
    store, point = Store(table, pool), Iterate(q, tracked, records, residual, jacobian)
    lifted = LiftedPairs(free, lengths, vectors, variables, guess, memory)
    header = header_at(table, 0)
    value = 0.0
    for t in range(header.terms):
        term = term_at(table, header.term_table + TERM * t)
        if term.kind == PLACE:
            value += place_term(store, term, bases, lifted, point, order, gradient, hessian)
    variables[0, 0] = value
    return 0
