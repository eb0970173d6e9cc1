"""Where a solve has arrived: no farther off than asked for, or than poses and slopes can be told in doubles."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import assembly as asm

# Rounding of a slope, in parts of the greatest curvature of the objective.
ROUNDING = 4e-16


def drawn(term, position):
    """A body at a place, and a term of the coordinates x and y of its origin."""
    pose = ca.SX.sym("pose", 7)
    body = asm.Body("body", position=position)
    scene = asm.Assembly([body])
    scene.minimize(asm.Expression(ca.Function("f", [pose], [term(pose[0], pose[1])]), [body]))
    return scene, body


@pytest.mark.parametrize("weight", [1e2, 1e4, 1e5, 1e6, 1e7])
def test_a_slope_that_cancels_is_zero_to_its_rounding(weight):
    # Schittkowski 210: of terms of 4 w the slope is the difference, and poses themselves are rounded.
    scene, body = drawn(lambda x, y: weight * (y - x**2) ** 2 + (1.0 - x) ** 2, (-1.2, 1.0, 0.0))
    solution = scene.solve(max_iterations=3000)
    assert solution.success
    np.testing.assert_allclose(solution.pose(body).position, [1.0, 1.0, 0.0], rtol=0, atol=1e-9)
    # Of x the curvature is 8 w + 2 there.
    assert solution.stationarity <= max(1e-10, ROUNDING * (8.0 * weight + 2.0))


@pytest.mark.parametrize("weight", [1.0, 1e3, 1e6])
def test_a_slope_that_can_be_zero_is(weight):
    # Curvature loosens nothing where steps still gain: from here the first step leaves what rounding of it is.
    scene, body = drawn(lambda x, y: weight * (x - 0.3) ** 2 + 1e-3 * (y - 0.7) ** 4 + y**2, (0.3, 0.4, 0.0))
    solution = scene.solve()
    assert solution.success and solution.stationarity <= 1e-10
    x, y, _ = solution.pose(body).position
    assert x == pytest.approx(0.3, abs=1e-15)
    assert 4e-3 * (y - 0.7) ** 3 + 2.0 * y == pytest.approx(0.0, abs=1e-10)
