"""On which turn an angle with limits starts: one that lies within them, wherever the body stands."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm


@pytest.mark.parametrize(
    "limits",
    [(4.0, None), (None, -4.0), (4.0, 20.0), (4.0, 10.3), (-1.0, 20.0), (-20.0, 1.0), (-3.2, 3.2), (50.0, 60.0)],
    ids=str,
)
@pytest.mark.parametrize("turn", [0.0, 0.9, 2.0, 3.1, -3.1, -2.0, -0.9])
def test_a_body_within_limits_of_a_turn_or_more_need_not_move(limits, turn):
    ground = asm.Body("ground", fixed=True)
    wheel = asm.Body("wheel", quaternion=(np.cos(0.5 * turn), 0.0, 0.0, np.sin(0.5 * turn)))
    scene = asm.Assembly([ground, wheel])
    scene.constrain(asm.Revolute(ground, wheel, "hinge", limits=limits))
    solution = scene.solve()
    assert solution.success and solution.iterations == 0
    low, high = (bound if bound is not None else sign * np.inf for bound, sign in zip(limits, (-1, 1), strict=True))
    angle = solution.values["hinge.angle"]
    # Rounding of angles up to 60.
    assert low <= angle <= high and abs(np.exp(1j * angle) - np.exp(1j * turn)) < 1e-13
