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


@pytest.mark.parametrize("limits", [(1.0, 2.0), (-2.0, -1.0), (1.5, None), (None, -1.5), (-1.0, 1.0)], ids=str)
@pytest.mark.parametrize("pitch", [0.2, -0.05, 0.01])
def test_the_limits_of_a_slide_say_how_often_a_screw_has_turned(limits, pitch):
    # One that starts on the turn of no slide at all has a hundred turns to go, a radian a step.
    ground, nut = asm.Body("ground", fixed=True), asm.Body("nut", quaternion=(np.cos(0.3), 0.0, 0.0, np.sin(0.3)))
    scene = asm.Assembly([ground, nut])
    scene.constrain(asm.Screw(ground, nut, pitch, name="screw", slide_limits=limits))
    solution = scene.solve()
    assert solution.success and solution.iterations < 10
    low, high = (bound if bound is not None else sign * np.inf for bound, sign in zip(limits, (-1, 1), strict=True))
    slide, angle = solution.q[1, 2], solution.values["screw.angle"]
    # The tolerance of a solve, in parts of a scene's size of about two; of turns, over the pitch.
    assert low - 1e-11 <= slide <= high + 1e-11 and abs(angle * pitch / (2.0 * np.pi) - slide) < 1e-11
