"""The dense step: Cholesky factorization that says whether the matrix is positive definite."""

from __future__ import annotations

import math

from assembly._kernel import kernel


@kernel(inner=True)
def factorize(m, n):
    """Cholesky in the upper triangle of m, m = U^T U, diagonal stored inverted; False where not positive definite.

    Right-looking: rows are updated along memory, which vectorizes.
    """
    for k in range(n):
        pivot = m[k, k]
        if not pivot > 0.0:
            return False
        inverse = 1.0 / math.sqrt(pivot)
        m[k, k] = inverse
        for j in range(k + 1, n):
            m[k, j] *= inverse
        for i in range(k + 1, n):
            f = m[k, i]
            if f != 0.0:
                for j in range(i, n):
                    m[i, j] -= f * m[k, j]
    return True


@kernel(inner=True)
def substitute(m, n, b):
    """Solve U^T U x = b in place, for the factor that `factorize` left."""
    for k in range(n):
        s = b[k] * m[k, k]
        b[k] = s
        for i in range(k + 1, n):
            b[i] -= m[k, i] * s
    for k in range(n - 1, -1, -1):
        s = b[k]
        for i in range(k + 1, n):
            s -= m[k, i] * b[i]
        b[k] = s * m[k, k]


@kernel(inner=True)
def factorize_shifted(lagrangian, n, shift, matrix):
    """Factorize lagrangian + d I with the first d from `shift` up that makes it positive definite; -1: none."""
    scale = 1.0
    for i in range(n):
        scale = max(scale, abs(lagrangian[i, i]))
    while shift <= 1e8 * scale:
        for i in range(n):
            for j in range(i, n):
                matrix[i, j] = lagrangian[i, j]
            matrix[i, i] += shift
        if factorize(matrix, n):
            return shift
        shift = max(8.0 * shift, 1e-6)
    return -1.0
