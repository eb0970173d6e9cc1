"""What crosses where constraints hold it is told at once, with its name; what has a way out is solved."""

import numpy as np
import pytest

import assembly as asm
from assembly.solve.interruption import CTRL_C
from assembly.studies.held_crossing import crosses_where_held


def driven(thicker, slide=0.0, is_drawn=False):
    """A shaft that is thicker than the bore it is in, on the axis of that; driven along it unless `slide` is None."""
    plate = asm.Body("plate", asm.shapes.plate(40, 40, 10, [(0, 0, 5.0)]), fixed=True)
    pin = asm.Body("pin", asm.shapes.solid_cylinder(5.0 + thicker, 20), position=(0, 0, 0.3))
    scene = asm.Assembly([plate, pin])
    scene.constrain(asm.Cylindrical(plate.frame(), pin.frame(), "axis", slide=slide), asm.Clearance())
    if is_drawn:
        scene.minimize(asm.PointDistance(pin.point(1, 0, 0), (2, 0, 0)))
    return scene


def is_held(scene, q=None):
    settings = scene._settings({}, CTRL_C, warm=False)
    return crosses_where_held(scene, scene.q if q is None else q, settings, CTRL_C)


@pytest.mark.parametrize("thicker", [1e-3, 1e-6])
@pytest.mark.parametrize("is_drawn", [False, True], ids=["driven", "with an objective"])
def test_a_shaft_that_is_too_thick_is_told_before_any_step_for_contacts(thicker, is_drawn):
    solution = driven(thicker, is_drawn=is_drawn).solve()
    assert solution.status.name == "STALLED" and solution.iterations == 0
    assert "plate and pin" in solution.message
    # Joints hold where it is told, and the objective is that of this pose.
    assert np.abs(solution.q[1] - (0, 0, 0, *solution.q[1, 3:])).max() < 1e-9
    assert solution.violations["clearance"] == pytest.approx(thicker, rel=1e-6)
    if is_drawn:
        assert solution.objective == pytest.approx(1.0, abs=1e-9)


def test_a_shaft_that_may_slide_is_not_held():
    scene = driven(1e-3, slide=None)
    assert not is_held(scene)
    assert is_held(driven(1e-3), driven(1e-3).q * 1.0 + np.array([[0.0] * 7, [0, 0, -0.3, 0, 0, 0, 0]]))


def test_a_shaft_that_fits_is_not_held():
    scene = driven(-0.02)
    assert not is_held(scene, scene.q + np.array([[0.0] * 7, [0, 0, -0.3, 0, 0, 0, 0]]))
    assert scene.solve().success


def test_two_bodies_that_are_fixed_to_each_other_across():
    one = asm.Body("one", asm.shapes.box(4, 4, 4), fixed=True)
    other = asm.Body("other", asm.shapes.box(4, 4, 4), position=(1, 0.5, 0.2))
    scene = asm.Assembly([one, other])
    scene.constrain(asm.Fixed(one.frame((1.0, 0.5, 0.2)), other.frame()), asm.Clearance())
    solution = scene.solve()
    assert solution.status.name == "STALLED" and "one and other" in solution.message
    # With a way out they part.
    scene = asm.Assembly([one, other])
    scene.constrain(asm.Prismatic(one.frame((1.0, 0.5, 0.2)), other.frame()), asm.Clearance())
    assert scene.solve().success
