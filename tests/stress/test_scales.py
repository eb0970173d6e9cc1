"""Units, offsets and weights: the same scene in any of them has the same answer, as far as doubles can say."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from benchmarks.scenes import linked_wires
from tests.stress.honest import check

WIRES = linked_wires(3)


def wires(k, unit, offset, weight=1.0):
    """Three linked wires near the solution of start k, a target near the grasp."""
    rows = WIRES.q[k].copy()
    rows[:, :3] = rows[:, :3] * unit + offset
    wire = asm.shapes.torus(1.0 * unit, 0.12 * unit)
    bodies = [asm.Body(f"{i}", wire, row[:3], row[3:], fixed=i == 0) for i, row in enumerate(rows)]
    scene = asm.Assembly(bodies)
    scene.constrain(*(asm.Contact(bodies[i], bodies[j]) for i, j in ((0, 1), (1, 2), (0, 2))))
    target = WIRES.targets(0.3)[k] * unit + offset
    # Alone, a target in reach leaves the wires free to slide; the least move makes the answer one point.
    scene.minimize(asm.PointDistance(bodies[2].point(unit, 0.0, 0.0), target, weight), asm.Posture(weight=weight))
    return scene


@pytest.mark.parametrize("unit", [1e-9, 1e-6, 1e-3, 25.4, 1e3, 1e6, 1e9])
@pytest.mark.parametrize("k", range(3))
def test_units(k, unit):
    plain, scene = wires(k, 1.0, 0.0).solve(), wires(k, unit, 0.0)
    solution = scene.solve()
    assert check(scene, solution) is plain.status is asm.Status.SOLVED
    # Lengths are divided by the scene's size first: the two differ by roundings, which the path may magnify.
    np.testing.assert_allclose(solution.q[:, :3] / unit, plain.q[:, :3], rtol=0, atol=1e-9)
    np.testing.assert_allclose(solution.q[:, 3:], plain.q[:, 3:], rtol=0, atol=1e-9)


@pytest.mark.parametrize("offset", [1e2, 1e5, 1e8, -1e8])
@pytest.mark.parametrize("k", range(3))
def test_offsets(k, offset):
    plain, scene = wires(k, 1.0, 0.0).solve(), wires(k, 1.0, offset)
    solution = scene.solve()
    assert check(scene, solution) is asm.Status.SOLVED
    # What the coordinates of the start and of the target lost by the offset, some times over; and as above.
    lost = 100.0 * np.finfo(float).eps * abs(offset)
    np.testing.assert_allclose(solution.q[:, :3] - offset, plain.q[:, :3], rtol=0, atol=1e-9 + lost)
    np.testing.assert_allclose(solution.q[:, 3:], plain.q[:, 3:], rtol=0, atol=1e-9 + lost)


@pytest.mark.parametrize("weight", [1e-6, 1e-3, 1e3, 1e6])
@pytest.mark.parametrize("k", range(3))
def test_a_single_weight_changes_nothing(k, weight):
    plain, scene = wires(k, 1.0, 0.0).solve(), wires(k, 1.0, 0.0, weight)
    solution = scene.solve()
    assert check(scene, solution) is asm.Status.SOLVED
    np.testing.assert_allclose(solution.q, plain.q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(solution.objective, weight * plain.objective, rtol=1e-6, atol=1e-12 * weight)


@pytest.mark.parametrize("ratio", [1e-6, 1e-3, 1e3, 1e6])
@pytest.mark.parametrize("k", range(3))
def test_weights_against_each_other(k, ratio):
    scene = wires(k, 1.0, 0.0)
    other = scene.bodies[1].point(0.0, 1.0, 0.0)
    scene.minimize(asm.PointDistance(other, (0.5, 0.5, 0.5), ratio))
    solution = scene.solve(max_iterations=2_000)
    status = check(scene, solution)
    # Contacts hold whatever the weights are; a valley a million times as long as wide may end the steps first.
    assert status in (asm.Status.SOLVED, asm.Status.STALLED, asm.Status.ITERATION_LIMIT)
    assert solution.feasibility <= 1e-11 or not solution.success
