"""What a review found: each was wrong once."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError


def pulled(function_of):
    """A body whose pose is to satisfy a CasADi expression."""
    pose = ca.SX.sym("pose", 7)
    body = asm.Body("body", position=(0.0, 0.3, 0.1))
    scene = asm.Assembly([body])
    scene.constrain(asm.Expression(ca.Function("f", [pose], [function_of(pose)]), [body]))
    return scene


@pytest.mark.parametrize("f", [lambda x: ca.sqrt(-1 - x[0] ** 2), lambda x: ca.log(-1 - x[0] ** 2)])
def test_no_value_or_slope_anywhere_is_a_stall(f):
    scene = pulled(f)
    solution = scene.solve()
    assert solution.status is asm.Status.STALLED
    assert "STALLED" in str(solution)
    with pytest.raises(InputError, match="no finite value or slope"):
        scene.mobility(solution)


@pytest.mark.parametrize(
    ("f", "x"), [(lambda x: ca.sqrt(x[0]) - 1, 1.0), (lambda x: ca.log(x[0]), 1.0), (lambda x: 1 / x[0] - 2, 0.5)]
)
def test_where_there_is_no_value_or_slope_other_starts_are_tried(f, x):
    # The square root has a value at zero, and an infinite slope: the loop once never ended.
    solution = pulled(f).solve()
    assert solution.success and solution.restarted
    assert abs(solution.pose("body").position[0] - x) < 1e-11
    assert "found from another start" in solution.message


def test_a_solution_is_no_door_to_the_next_start():
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm")
    hinge = asm.Revolute(ground, arm, angle=0.3)
    scene = asm.Assembly([ground, arm])
    scene.constrain(hinge)
    first = scene.solve()
    with pytest.raises(ValueError, match="read-only"):
        first.q[:] += 9.0
    hinge.angle = 0.4
    second = scene.solve(first)
    assert second.success
    np.testing.assert_array_equal(second.q[0], ground.q)


def test_another_scene_may_change_its_structure():
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm")
    hinge, other = asm.Revolute(ground, arm, angle=0.3), asm.Revolute(ground, arm, "other", angle=0.3)
    scene = asm.Assembly([ground, arm])
    scene.constrain(hinge)
    first, packed = scene.solve(), scene.packed()
    other.angle = None
    assert scene.solve(first).success and scene.packed() is packed
    hinge.angle = None
    assert scene.packed() is not packed


@pytest.mark.parametrize(("pitch", "slide"), [(1.0, 60.0), (0.5, 200.0), (0.01, 0.5), (-2.0, 120.0)])
def test_a_screw_driven_far_along_is_on_its_turn_at_once(pitch, slide):
    ground, nut = asm.Body("ground", fixed=True), asm.Body("nut")
    screw = asm.Screw(ground, nut, pitch, slide=slide)
    scene = asm.Assembly([ground, nut])
    scene.constrain(screw)
    solution = scene.solve()
    assert solution.success and solution.iterations < 30
    angle = solution.values[f"{screw.name}.angle"]
    assert angle == pytest.approx(2.0 * np.pi * slide / pitch, rel=1e-9)


@pytest.mark.parametrize(("ratio", "step"), [(20.0, 20.0), (100.0, 7.0), (-1000.0, 0.5)])
def test_a_gear_follows_a_long_warm_step(ratio, step):
    ground, a, b = asm.Body("ground", fixed=True), asm.Body("a"), asm.Body("b", position=(2, 0, 0))
    driver, driven = asm.Revolute(ground, a, "driver", angle=0.0), asm.Revolute(ground.frame((2, 0, 0)), b, "driven")
    scene = asm.Assembly([ground, a, b])
    scene.constrain(driver, driven, asm.Gear(driver, driven, ratio))
    solution = scene.solve()
    for k in range(1, 4):
        driver.angle = k * step
        solution = scene.solve(solution)
        assert solution.success
        assert solution.values["driven.angle"] == pytest.approx(ratio * k * step, rel=1e-9)
