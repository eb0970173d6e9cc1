"""Numbers that are set anew: the scene has the bits of one that is built with them, and bad values raise."""

from __future__ import annotations

import numpy as np
import pytest

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
