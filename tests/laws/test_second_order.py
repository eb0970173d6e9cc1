"""What ends are judged by: second derivatives against differences, ways down against the objective along them."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from assembly.constraints.program import records as layout
from assembly.kinematics.pose import retract
from assembly.solve.second_order.dense import LocalModel, null_space
from tests.solve.lower_poses import random_scene

SEEDS = range(30)
# Of so many random scenes one is of the kind that is asked for.
DRAWS = 20


def drawn(seed, kind, exact, **options):
    """Models at the ends of random scenes that have unknowns of bodies alone, and their solutions."""
    for k in range(DRAWS):
        scene, _ = random_scene(np.random.default_rng([seed, kind, k]), exact)
        solution = scene.solve(**options)
        model = LocalModel.at(solution._packed, solution._state)
        if model is not None and len(model.gradient) == 6 * model.table[layout.MOVING]:
            yield model, solution


@cache
def solved(seed):
    """A model at a solution of a random scene, every third of which starts at a maximum or a saddle by symmetry."""
    return next(model for model, solution in drawn(seed, 11, seed % 3 == 0) if solution.success)


@cache
def saddle(seed):
    """A model at a start that is a saddle."""
    ends = drawn(seed, 12, True, max_iterations=0)
    return next(model for model, solution in ends if solution.second_order == "saddle")


def moved(model, step):
    """The model where a step in the unknowns leads, with the same multipliers."""
    packed, state = model.packed, model.state.copy()
    q = state[: packed.contacts_at].reshape(-1, 7)
    blocks = model.table[model.table[layout.UNKNOWN_BLOCKS] :][: packed.count]
    bodies = np.flatnonzero(blocks >= 0)
    q[bodies] = retract(q[bodies], step.reshape(-1, 6)[blocks[bodies]] * np.repeat([packed.scale, 1.0], 3))
    return LocalModel._with(packed, model.table, state, model.forces)


@pytest.mark.parametrize("seed", SEEDS)
def test_derivatives_are_those_of_values(seed):
    model = solved(seed)
    rng = np.random.default_rng(seed)
    for _ in range(3):
        d = rng.normal(size=len(model.gradient))
        d /= np.linalg.norm(d)
        h = 1e-5
        ahead, behind = moved(model, h * d), moved(model, -h * d)
        # Rounding over the step, and its square times third derivatives: of order one, those of gaps are larger.
        assert (ahead.value - behind.value) / (2 * h) == pytest.approx(model.gradient @ d, abs=1e-8)
        # Of clearances that come up from nothing residuals are steps.
        near = np.abs(model.residual) < 0.5
        slopes = (ahead.residual - behind.residual)[near] / (2 * h)
        np.testing.assert_allclose(slopes, (model.jacobian @ d)[near], atol=1e-7)
        # The Lagrangian is stationary here: turns that do not commute make no difference.
        assert np.abs(model.gradient + model.jacobian.T @ model.forces).max() < 1e-9
        slopes = [there.gradient + there.jacobian.T @ model.forces for there in (ahead, behind)]
        np.testing.assert_allclose((slopes[0] - slopes[1]) / (2 * h), model.hessian @ d, atol=1e-6)


@pytest.mark.parametrize("seed", SEEDS)
def test_neighbors_hold_and_rise_by_curvature(seed):
    model = solved(seed)
    basis = null_space(model.jacobian[model.touching], len(model.gradient))
    found = 0
    for d in basis.T:
        there = model.neighbor(d, 1e-3)
        if there is None:
            continue
        found += 1
        again = LocalModel._with(model.packed, model.table, there.state, model.forces)
        off = np.where(model.one_sided, np.minimum(again.residual, 0.0), again.residual)
        assert np.abs(off).max() < 1e-11
        # To third order; where rows depend on each other the motion need not exist.
        rise = 0.5 * d @ model.hessian @ d * 1e-6
        if model.touching.sum() + basis.shape[1] == len(d):
            assert abs(there.rise - rise) < 1e-7
    assert found > 0 or not basis.shape[1]


@pytest.mark.parametrize("seed", SEEDS)
def test_the_least_curvature_is_that_of_the_reduced_form(seed):
    # Inverse iteration with the penalty's matrix finds what dense decompositions do where it is negative, and no other.
    model = solved(seed)
    curvature, direction = model.least_curvature()
    basis = null_space(model.jacobian[model.pushing], len(model.gradient))
    if basis.shape[1]:
        least = np.linalg.eigvalsh(basis.T @ model.hessian @ basis)[0]
        # It is a bound from above, off by what the penalty bends.
        assert curvature >= least - 1e-4
        assert np.linalg.norm(direction) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_least_curvature_of_a_saddle_is_negative(seed):
    model = saddle(seed)
    curvature, direction = model.least_curvature()
    basis = null_space(model.jacobian[model.pushing], len(model.gradient))
    least = np.linalg.eigvalsh(basis.T @ model.hessian @ basis)[0]
    # Iterations end near it, from above; the penalty lets rows be broken by as much as its inverse.
    assert least - 1e-4 <= curvature <= 0.5 * least
    assert np.abs(model.jacobian[model.pushing] @ direction).max() < 1e-4
