"""Coordinates that are held at the end of their patch: the step of the others is that of the matrix without them."""

from __future__ import annotations

import numpy as np
import pytest

from assembly.constraints.program import records as layout
from assembly.solve.linear_algebra.factorize import factorize_shifted
from assembly.solve.loop.ends import hold_ends, solve_within
from assembly.solve.loop.line_search import bend_step
from assembly.solve.loop.residuals import Structure
from assembly.solve.loop.workspace import new_rows, new_system
from tests.laws.test_sparsity import random_system


def held_system(rng, bodies, pairs):
    """A system with some coordinates held, factorized; its order, the dense matrix, which unknowns are free."""
    order, dense = random_system(rng, bodies, pairs)
    n = len(dense)
    system = new_system(n, pairs, order)
    ends = system.directions.ends
    ends[:] = rng.integers(0, 2, ends.size)
    ends[0] = 1.0
    system.hessian[:] = np.triu(dense)
    hold_ends(system)
    assert factorize_shifted(system.hessian, n, order, 0.0, system.factor) == 0.0
    return order, dense, system, np.concatenate([np.full(n - ends.size, True), ends == 0.0])


@pytest.mark.parametrize("bodies, pairs", [(1, 1), (2, 1), (3, 5), (12, 4)])
def test_the_others_take_the_step_that_they_take_alone(bodies, pairs):
    rng = np.random.default_rng([bodies, pairs])
    order, dense, system, free = held_system(rng, bodies, pairs)
    right = rng.normal(size=len(dense))
    expected = np.zeros(len(dense))
    expected[free] = np.linalg.solve(dense[np.ix_(free, free)], right[free])
    solve_within(system, order, right)
    # A diagonally dominant matrix: some roundings. What is held stays where it is, to the bit.
    np.testing.assert_allclose(right, expected, rtol=0, atol=1e-13)
    assert (right[~free] == 0.0).all()


def test_a_step_is_bent_without_them():
    rng = np.random.default_rng(7)
    order, dense, system, free = held_system(rng, 1, 1)
    bases = np.array([[0, -1, 6]])
    jacobian = rng.normal(size=(1, layout.EXTRA_COLUMN))
    shape = Structure(bases, np.zeros(1, np.int64), order, (np.arange(1), np.zeros(1, np.int64)))
    rows = new_rows(1, 1.0)
    rows.active[0] = 1.0
    before = np.where(free, rng.normal(size=len(dense)), 0.0)
    system.directions.step[:] = before
    points = [layout.Iterate(None, None, None, np.array([c]), jacobian) for c in (0.5, 0.2)]
    bend_step(shape, *points, rows, system, 1.0, False)
    # To where the row holds: what is left of it there, 0.2, by the factor at hand.
    gradient = np.concatenate([jacobian[0, :6], jacobian[0, 12:16]])
    change = np.zeros(len(dense))
    change[free] = np.linalg.solve(dense[np.ix_(free, free)], -0.2 * gradient[free])
    np.testing.assert_allclose(system.directions.step, before + change, rtol=0, atol=1e-13)
    assert (system.directions.step[~free] == 0.0).all()
