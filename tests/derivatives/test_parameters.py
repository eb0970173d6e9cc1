"""Numbers that are set anew: the scene has the bits of one that is built with them, and bad values raise."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.program.records import VERSION
from tests.derivatives.sensitivity_scenes import CASES

EACH = [(name, k) for name, case in CASES.items() for k in range(len(case().wrt))]


@pytest.mark.parametrize(("name", "k"), EACH)
def test_bits_are_those_of_a_scene_that_is_built_with_the_number(name, k):
    case, fresh = CASES[name](), CASES[name]()
    q0 = case.scene.q
    assert case.scene.solve(q0).success
    for factor in (1.01, 1.013):
        value = case.wrt[k].value * factor or 0.01 * factor
        case.wrt[k].value = value
        again = case.scene.solve(q0)
    fresh.wrt[k].value = value
    built = fresh.scene.solve(q0)
    pools = [np.delete(solution._packed.pool, VERSION) for solution in (again, built)]
    assert np.array_equal(*pools)
    assert again.status is built.status and np.array_equal(again.q, built.q)
    assert case.wrt[k].value == value


def test_a_warm_solve_after_the_first_has_the_number_of_now():
    """Solves that go on from a solution by the loop alone notice a number that was set since."""
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm", position=(3, 0, 0))
    hinge = asm.Revolute(ground.frame(at=(3, 0, 0)), arm, "hinge", angle=0.3)
    scene = asm.Assembly([ground, arm])
    scene.constrain(hinge)
    place, solution = asm.Parameter(hinge.frame_a, "origin", "x"), scene.solve()
    for value in (3.1, 3.2, 2.9):
        place.value = value
        solution = scene.solve(solution)
        assert solution.pose(arm).position[0] == pytest.approx(value, abs=1e-12)
