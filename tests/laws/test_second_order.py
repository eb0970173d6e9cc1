"""What ends are judged by: second derivatives against differences, ways down against the objective along them."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from assembly.constraints.program import records as layout
from assembly.kinematics.pose import retract
from assembly.solve.second_order.dense import Look, null_space
from tests.solve.lower_poses import random_scene

SEEDS = range(30)
# Of so many random scenes one is of the kind that is asked for.
DRAWS = 20


def drawn(seed, kind, exact, **options):
    """Looks at the ends of random scenes that have unknowns of bodies alone, and their solutions."""
    for k in range(DRAWS):
        scene, _ = random_scene(np.random.default_rng([seed, kind, k]), exact)
        solution = scene.solve(**options)
        look = Look.at(solution._packed, solution._state)
        if look is not None and len(look.gradient) == 6 * look.table[layout.MOVING]:
            yield look, solution


@cache
def solved(seed):
    """A look at a solution of a random scene, every third of which starts at a maximum or a saddle by symmetry."""
    return next(look for look, solution in drawn(seed, 11, seed % 3 == 0) if solution.success)


@cache
def saddle(seed):
    """A look at a start that is a saddle."""
    ends = drawn(seed, 12, True, max_iterations=0)
    return next(look for look, solution in ends if solution.second_order == "saddle")


def moved(look, step):
    """A look where a step in the unknowns leads, with the same multipliers."""
    packed, state = look.packed, look.state.copy()
    q = state[: packed.contacts_at].reshape(-1, 7)
    blocks = look.table[look.table[layout.UNKNOWN_BLOCKS] :][: packed.count]
    bodies = np.flatnonzero(blocks >= 0)
    q[bodies] = retract(q[bodies], step.reshape(-1, 6)[blocks[bodies]] * np.repeat([packed.scale, 1.0], 3))
    return Look._with(packed, look.table, state, look.forces)


@pytest.mark.parametrize("seed", SEEDS)
def test_derivatives_are_those_of_values(seed):
    look = solved(seed)
    rng = np.random.default_rng(seed)
    for _ in range(3):
        d = rng.normal(size=len(look.gradient))
        d /= np.linalg.norm(d)
        h = 1e-5
        ahead, behind = moved(look, h * d), moved(look, -h * d)
        # Rounding over the step, and its square times third derivatives: of order one, those of gaps are larger.
        assert (ahead.value - behind.value) / (2 * h) == pytest.approx(look.gradient @ d, abs=1e-8)
        # Of clearances that come up from nothing residuals are steps.
        near = np.abs(look.residual) < 0.5
        slopes = (ahead.residual - behind.residual)[near] / (2 * h)
        np.testing.assert_allclose(slopes, (look.jacobian @ d)[near], atol=1e-7)
        # The Lagrangian is stationary here: turns that do not commute make no difference.
        assert np.abs(look.gradient + look.jacobian.T @ look.forces).max() < 1e-9
        slopes = [there.gradient + there.jacobian.T @ look.forces for there in (ahead, behind)]
        np.testing.assert_allclose((slopes[0] - slopes[1]) / (2 * h), look.hessian @ d, atol=1e-6)


@pytest.mark.parametrize("seed", SEEDS)
def test_neighbors_hold_and_rise_by_curvature(seed):
    look = solved(seed)
    basis = null_space(look.jacobian[look.touching], len(look.gradient))
    found = 0
    for d in basis.T:
        there = look.neighbor(d, 1e-3)
        if there is None:
            continue
        found += 1
        again = Look._with(look.packed, look.table, there.state, look.forces)
        off = np.where(look.one_sided, np.minimum(again.residual, 0.0), again.residual)
        assert np.abs(off).max() < 1e-11
        # To third order; where rows depend on each other the motion need not exist.
        rise = 0.5 * d @ look.hessian @ d * 1e-6
        if look.touching.sum() + basis.shape[1] == len(d):
            assert abs(there.rise - rise) < 1e-7
    assert found > 0 or not basis.shape[1]


@pytest.mark.parametrize("seed", SEEDS)
def test_the_least_curvature_is_that_of_the_reduced_form(seed):
    # Inverse iteration with the penalty's matrix finds what dense decompositions do where it is negative, and no other.
    look = solved(seed)
    curvature, direction = look.least_curvature()
    basis = null_space(look.jacobian[look.pushing], len(look.gradient))
    if basis.shape[1]:
        least = np.linalg.eigvalsh(basis.T @ look.hessian @ basis)[0]
        # It is a bound from above, off by what the penalty bends.
        assert curvature >= least - 1e-4
        assert np.linalg.norm(direction) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_least_curvature_of_a_saddle_is_negative(seed):
    look = saddle(seed)
    curvature, direction = look.least_curvature()
    basis = null_space(look.jacobian[look.pushing], len(look.gradient))
    least = np.linalg.eigvalsh(basis.T @ look.hessian @ basis)[0]
    # Iterations end near it, from above; the penalty lets rows be broken by as much as its inverse.
    assert least - 1e-4 <= curvature <= 0.5 * least
    assert np.abs(look.jacobian[look.pushing] @ direction).max() < 1e-4
