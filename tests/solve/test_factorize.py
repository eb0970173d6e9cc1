"""The factor of a step: that of NumPy in any envelope, refused where the matrix is not positive definite."""

from __future__ import annotations

import numpy as np
import pytest

from assembly.solve.linear_algebra.factorize import factorize, forward, substitute


def random_matrix(rng, last):
    """A positive definite matrix whose row i has entries up to column last[i]."""
    n = len(last)
    matrix = rng.normal(size=(n, n))
    matrix = np.triu(np.where(np.arange(n) <= last[:, None], matrix, 0.0))
    matrix += np.triu(matrix, 1).T
    return matrix + np.diag(1.0 + np.abs(matrix).sum(axis=1))


def random_envelope(rng, n):
    """Rows that end alike in runs of any length, also of one and two, and the last ones at the last column."""
    ends = np.sort(rng.integers(0, n, n))
    return np.maximum.accumulate(np.maximum(ends // rng.integers(1, 8) * 3 + 2, np.arange(n))).clip(max=n - 1)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 7, 12, 17])
def test_it_is_the_factor_in_any_envelope(n):
    rng = np.random.default_rng(n)
    for _ in range(20):
        last = random_envelope(rng, n)
        matrix = random_matrix(rng, last)
        factor, b = np.triu(matrix), rng.normal(size=n)
        assert factorize(factor, n, last)
        upper = np.linalg.cholesky(matrix).T
        whole = factor.copy()
        np.fill_diagonal(whole, 1.0 / np.diag(factor))
        # Both are within some roundings of the exact one, as the matrix is dominated by its diagonal.
        np.testing.assert_allclose(whole, upper, rtol=0.0, atol=1e-14 * np.abs(matrix).max())
        x, half = b.copy(), b.copy()
        substitute(factor, n, last, x)
        forward(factor, n, last, half)
        np.testing.assert_allclose(x, np.linalg.solve(matrix, b), rtol=0.0, atol=1e-14)
        np.testing.assert_allclose(half, np.linalg.solve(upper.T, b), rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("at", range(7))
def test_a_matrix_that_is_not_positive_definite_is_refused_at_any_pivot(at):
    last = np.full(7, 6)
    matrix = random_matrix(np.random.default_rng(at), last)
    # What is left of the diagonal there is the pivot: less of it is refused, by the matrix that ends there as by all.
    pivot = np.linalg.cholesky(matrix)[at, at] ** 2
    for part, positive in ((0.999, True), (1.001, False), (np.nan, False)):
        tried = matrix.copy()
        tried[at, at] -= part * pivot
        upper = np.triu(tried)[: at + 1, : at + 1].copy()
        assert factorize(upper, at + 1, np.full(at + 1, at)) is positive
        assert positive or not factorize(np.triu(tried), 7, last)
