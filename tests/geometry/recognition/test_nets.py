"""Scalar products of vectors of polynomials by their Bezier points, against values."""

from __future__ import annotations

import numpy as np
import pytest

from assembly.geometry.recognition.nets import bezier_dot
from assembly.geometry.splines.bezier import bernstein


def values(net, x, y):
    return np.einsum("ai,...ij,bj->...ab", bernstein(net.shape[-2] - 1, x), net, bernstein(net.shape[-1] - 1, y))


@pytest.mark.parametrize("degrees", [(2, 1, 2, 1), (0, 3, 2, 0), (4, 4, 4, 4), (1, 7, 3, 2), (15, 15, 15, 15)])
def test_products_have_the_values_of_their_factors(degrees):
    m, n, i, j = degrees
    rng = np.random.default_rng(0)
    a, b = rng.standard_normal((5, 3, m + 1, n + 1)), rng.standard_normal((5, 3, i + 1, j + 1))
    x, y = np.linspace(0.0, 1.0, 7), np.linspace(0.0, 1.0, 6)
    product = bezier_dot(a, b)
    assert product.shape == (5, m + i + 1, n + j + 1)
    expected = (values(a, x, y) * values(b, x, y)).sum(axis=1)
    np.testing.assert_allclose(values(product, x, y), expected, atol=1e-13)
