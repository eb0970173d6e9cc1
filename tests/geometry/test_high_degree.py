"""Curves of degree 16 to 50: Bernstein form keeps the digits that power tables would lose."""

from __future__ import annotations

from fractions import Fraction
from math import comb

import numpy as np
import pytest

from assembly.errors import InputError
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.curve_packing import packed_curves


def exact_derivative(points, order, t):
    """A derivative of a Bezier curve in exact arithmetic."""
    rows = [[Fraction(v) for v in row] for row in points.tolist()]
    n = len(rows) - 1
    for k in range(order):
        pairs = zip(rows[:-1], rows[1:], strict=True)
        rows = [[(n - k) * (b - a) for a, b in zip(p, q, strict=True)] for p, q in pairs]
    m = n - order
    basis = [comb(m, i) * t**i * (1 - t) ** (m - i) for i in range(m + 1)]
    return [float(sum(b * row[c] for b, row in zip(basis, rows, strict=True))) for c in range(points.shape[1])]


@pytest.mark.parametrize("degree", [16, 25, 45, 50])
def test_against_exact_arithmetic(degree):
    rng = np.random.default_rng(degree)
    points = rng.normal(size=(degree + 1, 3))
    curve = NurbsCurve.bezier(points)
    for k in (0, 1, 77, 511, 512, 513, 900, 1024):
        values = curve.evaluate(k / 1024, 2)
        for order, value in enumerate(values):
            # Sums of positive weights: some units of the last place of the control points of the derivative.
            size = float(degree) ** order * 2.0**order * np.abs(points).max()
            assert np.abs(value - exact_derivative(points, order, Fraction(k, 1024))).max() <= 2e-15 * size


def test_spans_weights_and_both_ways_of_evaluation():
    rng = np.random.default_rng(1)
    knots = np.concatenate([np.zeros(16), [0.3, 0.7], np.ones(16)])
    low = NurbsCurve(rng.normal(size=(18, 2)), knots, 15, rng.uniform(0.5, 2.0, 18))
    high = low.elevate(20)
    t = np.linspace(0.0, 1.0, 101)
    for a, b, tolerance in zip(low.evaluate(t, 2), high.evaluate(t, 2), (1e-12, 1e-10, 1e-8), strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=tolerance)
    with pytest.raises(InputError, match="t is 1.5; expected a parameter in the domain"):
        high.evaluate([0.1, 1.5])


def test_trims_and_contacts_refuse_them():
    curve = NurbsCurve.bezier(np.random.default_rng(1).random((17, 2)))
    for use in (curve.packed, lambda: packed_curves([curve])):
        with pytest.raises(InputError, match="is of degree 16; expected at most 15 for trims and contacts"):
            use()
