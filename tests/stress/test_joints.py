"""Random joints of random redundancy: what fits is solved, what does not is never said to be."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from benchmarks.hidden import Hidden
from tests.stress.honest import check


def test_the_hidden_poses_hold():
    for seed in range(20):
        hidden = Hidden(seed, 4, 5)
        q = np.array([pose.q for pose in hidden.poses]) if hasattr(hidden.poses[0], "q") else None
        if q is None:
            q = np.array([[*pose.position, *pose.quaternion] for pose in hidden.poses])
        assert hidden.violation(q) < 1e-12
        assert hidden.violation(np.array([body.q for body in hidden.bodies])) > 1e-3


@pytest.mark.parametrize("seed", range(8))
def test_what_fits_is_solved_or_not_said_to_be(seed, times):
    solved = 0
    count = 25 * times
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        bodies = int(rng.integers(2, 7))
        hidden = Hidden([seed, k, 1], bodies, bodies - 1 + int(rng.integers(0, 4)))
        solution = hidden.scene.solve()
        status = check(hidden.scene, solution)
        solved += status is asm.Status.SOLVED
        # Whatever the status: the violation that is reported is that of the poses.
        found = hidden.violation(solution.q)
        if status is asm.Status.SOLVED:
            # Rows hold to 2e-13 of a size of one, products of axes; an angle is their root at worst where it is zero.
            assert found < 1e-11, (seed, k)
        else:
            assert solution.feasibility > 1e-12
    # Over-closed loops far from their poses may have other ends; most have not.
    assert solved >= int(0.9 * count)


@pytest.mark.parametrize("seed", range(4))
def test_what_cannot_fit_is_never_solved(seed, times):
    for k in range(15 * times if times > 1 else 6):
        rng = np.random.default_rng([seed, k])
        bodies = int(rng.integers(2, 5))
        hidden = Hidden([seed, k, 2], bodies, bodies + 5, spoil=0.3)
        solution = hidden.scene.solve()
        status = check(hidden.scene, solution)
        if status is asm.Status.SOLVED:
            # It may fit all the same, elsewhere: then it does.
            assert hidden.violation(solution.q) < 1e-11
        else:
            assert solution.feasibility > 1e-12


@pytest.mark.parametrize("seed", range(4))
def test_freedoms_are_counted_without_a_word_of_nan(seed, times):
    for k in range(10 * times if times > 1 else 5):
        rng = np.random.default_rng([seed, k])
        bodies = int(rng.integers(2, 5))
        hidden = Hidden([seed, k, 3], bodies, bodies - 1 + int(rng.integers(0, 3)), off=0.0)
        mobility = hidden.scene.mobility()
        assert 0 <= mobility.dof <= 6 * (bodies - 1)
        assert np.isfinite(mobility.free_motions).all()
        assert mobility.free_motions.shape == (mobility.dof, bodies, 6)
        # A free motion moves nothing that a row sees: to first order.
        for motion in mobility.free_motions:
            q = np.array([body.q for body in hidden.bodies])
            moved = q.copy()
            step = 1e-6
            for b in range(bodies):
                turn = Rotation.from_rotvec(step * motion[b, 3:]) * Rotation.from_quat(q[b, 3:], scalar_first=True)
                moved[b] = [*(q[b, :3] + step * motion[b, :3]), *turn.as_quat(scalar_first=True)]
            # Second order in the step, over sizes of up to some units.
            assert hidden.violation(moved) < 1e-9
