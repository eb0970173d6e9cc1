"""Expressions that have no value everywhere: there, they are violated."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest

import assembly as asm
from tests.constraints.model.test_expression import scalar


@pytest.mark.parametrize(
    ("bound", "farthest"),
    [
        # Each is defined below x = 1.5 only, and holds up to `farthest`.
        (lambda q: ca.sqrt(1.5 - q[0]) - 0.1, 1.49),
        (lambda q: ca.log(1.5 - q[0]) + 3.0, 1.5 - math.exp(-3.0)),
    ],
)
def test_a_one_sided_row_keeps_a_solve_where_it_is_defined(bound, farthest):
    body = asm.Body("body", position=(1.0, 0.0, 0.0))
    scene = asm.Assembly([body])
    scene.constrain(asm.Expression(scalar(bound), [body], unilateral=True))
    scene.minimize(asm.PointDistance(body.point(0, 0, 0), (5.0, 0.0, 0.0)))
    solution = scene.solve()
    assert solution.success
    np.testing.assert_allclose(solution.q[0, 0], farthest, rtol=0, atol=1e-10)  # the tolerance over the row's slope


@pytest.mark.parametrize("unilateral", [False, True])
def test_a_start_without_a_value_is_not_solved(unilateral):
    body = asm.Body("body", position=(1.0, 0.0, 0.0))
    scene = asm.Assembly([body])
    scene.constrain(asm.Expression(scalar(lambda q: ca.log(-q[0])), [body], unilateral=unilateral))
    solution = scene.solve()
    assert not solution.success
    assert solution.feasibility == math.inf
