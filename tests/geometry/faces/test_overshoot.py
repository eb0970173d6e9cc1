"""How far curves of a trim reach."""

from __future__ import annotations

import numpy as np
import pytest

from assembly.geometry.faces.overshoot import extent
from assembly.geometry.splines.curve import NurbsCurve


@pytest.mark.parametrize("seed", range(40))
def test_an_extent_is_reached_and_never_passed(seed):
    """Of curves with corners, rational ones and many control points, against ten thousand samples."""
    rng = np.random.default_rng(seed)
    degree = int(rng.integers(1, 8))
    inner = np.sort(rng.integers(1, 9, int(rng.integers(0, 9)))) / 9.0
    inner = np.array([knot for knot in np.unique(inner) for _ in range(min(degree, (inner == knot).sum()))])
    knots = np.concatenate([np.zeros(degree + 1), inner, np.ones(degree + 1)])
    points = rng.normal(size=(len(knots) - degree - 1, 2)) * 10.0 ** rng.uniform(-3.0, 3.0)
    curve = NurbsCurve(points, knots, degree, rng.uniform(0.2, 3.0, len(points)))
    sampled = curve.evaluate(np.union1d(np.linspace(0.0, 1.0, 10001), curve.breaks()))
    for axis in (0, 1):
        low, high = extent(curve, axis)
        size = np.ptp(sampled[:, axis])
        for found, given in ((low, sampled[:, axis].min()), (-high, -sampled[:, axis].max())):
            assert found <= given + 1e-12 * size
            # Between samples it goes a little farther.
            assert found >= given - 1e-5 * size


def test_the_extent_of_an_arc_is_exact():
    """An arc of 140 degrees about another center, whose extremes are between knots."""
    angles = np.radians([20.0, 90.0, 160.0])
    rows = np.column_stack([np.cos(angles), np.sin(angles)])
    half = np.radians(70.0)
    rows[1] /= np.cos(half)
    curve = NurbsCurve.bezier(5.0 * rows + [3.0, -2.0], [1.0, np.cos(half), 1.0])
    assert extent(curve, 1) == pytest.approx((5.0 * np.sin(angles[0]) - 2.0, 3.0), abs=1e-14)
