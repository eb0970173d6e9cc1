"""Solves and ticks that are cut off anywhere: what they return is what they say it is."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from benchmarks.scenes import linked_wires
from tests.stress.honest import check

WIRES = linked_wires(4)


@pytest.mark.parametrize("k", range(4))
@pytest.mark.parametrize("distance", [0.3, 3.0])
def test_solves_of_any_number_of_iterations(k, distance):
    scene, objective = WIRES.scene, WIRES.objective
    objective.target = WIRES.targets(distance)[k]
    whole = scene.solve(WIRES.q[k], starts=WIRES.starts[k])
    for limit in range(whole.iterations + 2):
        solution = scene.solve(WIRES.q[k], starts=WIRES.starts[k], max_iterations=limit)
        status = check(scene, solution)
        assert solution.iterations <= limit
        if limit < whole.iterations:
            assert status is not asm.Status.SOLVED
        else:
            # The same input, the same output, to the last bit.
            assert status is whole.status
            np.testing.assert_array_equal(solution.q, whole.q)


@pytest.mark.parametrize("seconds", [1e-9, 5e-6, 2e-5, 1e-4, 1e-3])
def test_ticks_of_any_budget(seconds, times):
    scene, objective = WIRES.scene, WIRES.objective
    objective.target = WIRES.grasp[1]
    home = scene.solve(WIRES.q[1], starts=WIRES.starts[1])
    assert home.success
    point = objective.point
    tracker = scene.tracker(point, budget=seconds)
    rng = np.random.default_rng(3)
    size = scene.packed().scale
    target = np.array(WIRES.grasp[1])
    for _ in range(200 * times):
        target = target + 0.02 * rng.normal(size=3)
        step = tracker.step(target)
        assert np.isfinite(step.q).all()
        assert np.abs(np.linalg.norm(step.q[:, 3:], axis=1) - 1.0).max() < 1e-15
        if step.status is not asm.TrackStatus.VIOLATED:
            assert step.feasibility <= 1e-12 * size


def test_targets_that_are_none():
    scene, objective = WIRES.scene, WIRES.objective
    objective.target = WIRES.grasp[2]
    assert scene.solve(WIRES.q[2], starts=WIRES.starts[2]).success
    tracker = scene.tracker(objective.point)
    before = tracker.step(WIRES.grasp[2]).q.copy()
    for bad in ([np.nan] * 3, [np.inf, 0, 0], [1.0, 2.0], "here", None, [[1, 2, 3]], object()):
        step = tracker.step(bad)
        assert step.status is asm.TrackStatus.BAD_TARGET
        np.testing.assert_array_equal(step.q, before)
