"""Where a contact is on its faces, as a measure: against differences of scenes that are solved again."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from tests.derivatives.sensitivity_scenes import cam, differences

COMPONENTS = ("u", "v", "x", "y", "z")


def touching(side, film):
    """The roller on the hump, with what is measured of it, and its numbers that make no faces."""
    case = cam()
    touch = case.scene.constraint("touch")
    touch.minimum = film
    place = asm.ContactPlace(touch, side, (None, 0.3))
    case.of = [asm.Measure(place, component) for component in COMPONENTS]
    case.wrt = [case.wrt[0], case.wrt[-1], asm.Parameter(touch, "minimum")]
    return case


@pytest.mark.parametrize("film", [0.1, 0.4])
@pytest.mark.parametrize("side", ["a", "b"])
def test_slopes_are_differences_of_solved_scenes(side, film):
    """The hump has a knot 3e-3 from the contact, which steps of 2e-4 do not reach; solves leave 1e-13 over the step."""
    case = touching(side, film)
    solution = case.solved()
    d = asm.sensitivity(case.scene, solution, case.of, case.wrt)
    for k, parameter in enumerate(case.wrt):
        found = differences(case, solution, parameter, 2e-4)
        assert np.abs(found - d.matrix[:, k]).max() < 1e-8
    assert np.abs(d.matrix).max() > 0.5


def test_both_points_are_one_where_bodies_touch():
    solutions = []
    for side in "ab":
        case = touching(side, 0.0)
        solution = case.solved()
        solutions.append([item.value(solution) for item in case.of])
    np.testing.assert_allclose(solutions[0][2:], solutions[1][2:], rtol=0, atol=1e-12)
    pair = solution.contacts["touch"]
    assert solutions[0][:2] + solutions[1][:2] == pair.parameters.tolist()
    assert [case.of[0].name, case.of[0].unit, case.of[2].unit] == ["touch.u", "parameter", "length"]


def test_what_has_no_slopes_is_told():
    case = touching("a", 0.0)
    place, solution = case.of[0].thing, case.solved()
    with pytest.raises(InputError, match="component is 'w'; expected one of 'u', 'v'"):
        asm.Measure(place, "w")
    net = asm.Parameter(place.contact.a.face(), "control_points", (2, 2, "z"))
    with pytest.raises(InputError, match="makes faces, on which 'touch.u' is measured"):
        asm.sensitivity(case.scene, solution, case.of[0], net)
    other = touching("a", 0.0)
    with pytest.raises(InputError, match="expected a place of a contact of the solution's scene"):
        other.of[0].value(solution)
    ground, ball = asm.Body("ground", asm.shapes.torus(3.0, 1.0), fixed=True), asm.Body("ball", asm.shapes.sphere(0.5))
    ball.pose = asm.Pose((3.0, 0.0, 1.5))
    scene = asm.Assembly([ground, ball])
    touch, stem = asm.Contact(ground, ball, "touch"), asm.Prismatic(ground, ball, "stem")
    stem.frame_a.place(at=(3.0, 0.0, 0.0))
    scene.constrain(touch, stem)
    lowest = asm.Measure(asm.ContactPlace(touch, "b", (None, 0.3)), "x")
    with pytest.raises(InputError, match="at a pole of a face or a fold"):
        asm.sensitivity(scene, scene.solve(), lowest, asm.Parameter(stem.frame_a, "origin", "x"))
