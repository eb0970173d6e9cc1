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
def are_alike(last, k, n):
    """Whether rows k to k + 2 have entries up to the same column, as the rows of a body have."""
    return k + 2 < n and last[k + 2] == last[k]


@kernel(inner=True)
def factorize(m, n, last):
    """Cholesky in the upper triangle of m, m = U^T U, diagonal stored inverted; False where not positive definite.

    Right-looking, three rows at a time where these end alike: rows are updated along memory, and each is loaded a third
    as often.
    """
    k = 0
    while k < n:
        end = last[k] + 1
        pivot = m[k, k]
        if not pivot > 0.0:
            return False
        first = 1.0 / math.sqrt(pivot)
        m[k, k] = first
        if not are_alike(last, k, n):
            for j in range(k + 1, end):
                m[k, j] *= first
            for i in range(k + 1, end):
                f = m[k, i]
                for j in range(i, end):
                    m[i, j] -= f * m[k, j]
            k += 1
            continue
        # The triangle of three: its entries u, v in the first row, w in the second.
        u, v = m[k, k + 1] * first, m[k, k + 2] * first
        pivot = m[k + 1, k + 1] - u * u
        if not pivot > 0.0:
            return False
        second = 1.0 / math.sqrt(pivot)
        w = (m[k + 1, k + 2] - u * v) * second
        pivot = m[k + 2, k + 2] - v * v - w * w
        if not pivot > 0.0:
            return False
        third = 1.0 / math.sqrt(pivot)
        m[k + 1, k + 1], m[k + 2, k + 2] = second, third
        m[k, k + 1], m[k, k + 2], m[k + 1, k + 2] = u, v, w
        for j in range(k + 3, end):
            x = m[k, j] * first
            y = (m[k + 1, j] - u * x) * second
            m[k, j] = x
            m[k + 1, j] = y
            m[k + 2, j] = (m[k + 2, j] - v * x - w * y) * third
        for i in range(k + 3, end):
            f = m[k, i]
            g = m[k + 1, i]
            h = m[k + 2, i]
            for j in range(i, end):
                m[i, j] -= f * m[k, j] + g * m[k + 1, j] + h * m[k + 2, j]
        k += 3
    return True


@kernel(inner=True)
def forward(m, n, last, b):
    """Solve U^T x = b in place, for the factor that `factorize` left; three rows at a time where these end alike."""
    k = 0
    while k < n:
        end = last[k] + 1
        x = b[k] * m[k, k]
        b[k] = x
        if not are_alike(last, k, n):
            for i in range(k + 1, end):
                b[i] -= m[k, i] * x
            k += 1
            continue
        y = (b[k + 1] - m[k, k + 1] * x) * m[k + 1, k + 1]
        z = (b[k + 2] - m[k, k + 2] * x - m[k + 1, k + 2] * y) * m[k + 2, k + 2]
        b[k + 1] = y
        b[k + 2] = z
        for i in range(k + 3, end):
            b[i] -= m[k, i] * x + m[k + 1, i] * y + m[k + 2, i] * z
        k += 3


@kernel(inner=True)
def substitute(m, n, last, b):
    """Solve U^T U x = b in place, as `forward` does, and then backward."""
    forward(m, n, last, b)
    left = n
    while left > 0:
        if left < 3 or not are_alike(last, left - 3, n):
            k = left - 1
            x = b[k]
            for i in range(left, last[k] + 1):
                x -= m[k, i] * b[i]
            b[k] = x * m[k, k]
            left -= 1
            continue
        # Three sums that do not wait for each other's additions.
        k = left - 3
        x, y, z = b[k], b[k + 1], b[k + 2]
        for i in range(left, last[k] + 1):
            s = b[i]
            x -= m[k, i] * s
            y -= m[k + 1, i] * s
            z -= m[k + 2, i] * s
        z *= m[k + 2, k + 2]
        y = (y - m[k + 1, k + 2] * z) * m[k + 1, k + 1]
        b[k] = (x - m[k, k + 1] * y - m[k, k + 2] * z) * m[k, k]
        b[k + 1] = y
        b[k + 2] = z
        left -= 3


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
