"""The step: Cholesky factorization in an envelope, which says whether the matrix is positive definite.

Row i of the upper triangle has entries up to column last[i], and last never falls: so fill-in stays in the envelope.
Bodies are numbered (`constraints/packing/scene.py`) so that the envelope of a chain or a tree is narrow; that of a
small scene is the whole triangle. Unknowns of lifted pairs have other positions in the factor than in the step
(`constraints/program/envelope.py`); `order` says which. Large scenes are factorized by blocks instead
(`block_factor.py`).
"""

from __future__ import annotations

import math

from assembly._address import call_address
from assembly._kernel import kernel
from assembly.constraints.program.block_factor import greatest_diagonal
from assembly.constraints.program.envelope import listed_folds, place_upper
from assembly.constraints.program.hessian_blocks import blocks_at, is_blocked


@kernel(inline=True)
def pivot_row(m, k, end):
    """Scale row k by the root of its pivot, kept inverted; False where that is not positive."""
    pivot = m[k, k]
    if not pivot > 0.0:
        return False
    inverse = 1.0 / math.sqrt(pivot)
    m[k, k] = inverse
    for j in range(k + 1, end):
        m[k, j] *= inverse
    return True


@kernel(inner=True)
def factorize(m, n, last):
    """Cholesky in the upper triangle of m, m = U^T U, diagonal stored inverted; False where not positive definite.

    Right-looking, two rows at a time: rows are updated along memory, and each is loaded half as often.
    """
    k = 0
    while k < n:
        end = last[k] + 1
        if not pivot_row(m, k, end):
            return False
        if end < k + 2:
            k += 1
            continue
        f = m[k, k + 1]
        for j in range(k + 1, end):
            m[k + 1, j] -= f * m[k, j]
        end_next = last[k + 1] + 1
        if not pivot_row(m, k + 1, end_next):
            return False
        for i in range(k + 2, end):
            f = m[k, i]
            g = m[k + 1, i]
            for j in range(i, end):
                m[i, j] -= f * m[k, j] + g * m[k + 1, j]
        if end_next > end:
            for i in range(k + 2, end_next):
                g = m[k + 1, i]
                for j in range(max(i, end), end_next):
                    m[i, j] -= g * m[k + 1, j]
        k += 2
    return True


@kernel(inner=True)
def forward(m, n, last, b):
    """Solve U^T x = b in place, for the factor that `factorize` left."""
    for k in range(n):
        s = b[k] * m[k, k]
        b[k] = s
        for i in range(k + 1, last[k] + 1):
            b[i] -= m[k, i] * s


@kernel(inner=True)
def substitute(m, n, last, b):
    """Solve U^T U x = b in place."""
    forward(m, n, last, b)
    for k in range(n - 1, -1, -1):
        # Two sums that do not wait for each other's additions.
        s = b[k]
        t = 0.0
        i = k + 1
        while i < last[k]:
            s -= m[k, i] * b[i]
            t -= m[k, i + 1] * b[i + 1]
            i += 2
        if i == last[k]:
            s -= m[k, i] * b[i]
        b[k] = (s + t) * m[k, k]


@kernel(inner=True)
def forward_step(matrix, n, order, b):
    """Solve U^T x = b in place, for the factor that `factorize_shifted` left; x in the order of the factor."""
    places, vector, blocks = order.places, order.scratch[0], order.blocks
    place, ends = places[1], places[2]
    if is_blocked(order):
        call_address(blocks_at(blocks, 0).solve_address, (blocks, matrix[0], b, vector, 1))
        return
    if listed_folds(order) == 0:
        forward(matrix, n, ends, b)
        return
    for i in range(n):
        vector[place[i]] = b[i]
    forward(matrix, n, ends, vector)
    for i in range(n):
        b[i] = vector[i]


@kernel(inner=True)
def solve_step(matrix, n, order, b):
    """Solve (lagrangian + d I) x = b in place, for the factor that `factorize_shifted` left."""
    places, vector, blocks = order.places, order.scratch[0], order.blocks
    place, ends = places[1], places[2]
    if is_blocked(order):
        call_address(blocks_at(blocks, 0).solve_address, (blocks, matrix[0], b, vector, 0))
        return
    if listed_folds(order) == 0:
        substitute(matrix, n, ends, b)
        return
    for i in range(n):
        vector[place[i]] = b[i]
    substitute(matrix, n, ends, vector)
    for i in range(n):
        b[i] = vector[place[i]]


@kernel(inner=True)
def greatest_on_diagonal(lagrangian, n, order):
    """The largest entry on the diagonal, without its sign, but at least one; not finite if one is not."""
    if is_blocked(order):
        return greatest_diagonal(lagrangian, order.blocks)
    greatest = 1.0
    for i in range(n):
        greatest = max(greatest, abs(lagrangian[i, i]))
    return greatest


@kernel(inner=True)
def factorize_shifted(lagrangian, n, order, shift, matrix):
    """Factorize lagrangian + d I with the first d from `shift` up that makes it positive definite; -1: none."""
    blocked = is_blocked(order)
    scale = greatest_on_diagonal(lagrangian, n, order)
    if not math.isfinite(scale):
        return -1.0
    while shift <= 1e8 * scale:
        if blocked:
            # What says where unknowns of pairs stand, and the vector, are free here.
            parts = (lagrangian, order.blocks, shift, matrix[0], order.places[1], order.scratch[0])
            if call_address(blocks_at(order.blocks, 0).factorize_address, parts) == 1:
                return shift
            shift = max(8.0 * shift, 1e-6)
            continue
        place_upper(lagrangian, n, order, shift, matrix)
        if factorize(matrix, n, order.places[2]):
            return shift
        shift = max(8.0 * shift, 1e-6)
    return -1.0
