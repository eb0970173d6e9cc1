"""Contacts of bores and pins, sockets and balls, of one radius: lower pairs where they overlap at the start."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm

RADIUS, AT = 4.0, np.array([8.0, 0.0, 0.0])
# Poses that rows hold to 1e-12 of the scene's size, some 100: lengths and, times a pin of 40, angles.
NEAR = 1e-9


def plate_and_pin(place=(8.3, 0.4, 4.0), lean=(0.03, 0.01, 0.0), radius=RADIUS):
    plate = asm.Body("plate", asm.shapes.plate(60, 40, 12, [(*AT[:2], RADIUS)]), fixed=True)
    turn = Rotation.from_rotvec(lean).as_quat(scalar_first=True)
    return plate, asm.Body("pin", asm.shapes.solid_cylinder(radius, 40.0), place, turn)


def scene_of(plate, pin, swapped=False, **options):
    sides = plate.face("hole 1"), pin.face("wall")
    scene = asm.Assembly([plate, pin])
    scene.constrain(asm.Contact(*(sides[::-1] if swapped else sides), "fit", **options))
    return scene


def off_axis(solution):
    """How far the axis of the pin is off that of its hole, at 20 from its middle on either side."""
    turn = Rotation.from_quat(solution.q[1, 3:], scalar_first=True)
    ends = solution.q[1, :3] + turn.apply([[0.0, 0.0, 20.0], [0.0, 0.0, -20.0]])
    return float(np.linalg.norm((ends - AT)[:, :2], axis=1).max())


@pytest.mark.parametrize("options", [{}, {"edges": False}])
@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("lean", [(0.03, 0.01, 0.0), (3.0, 0.05, 0.0), (0.3, 0.0, 0.0)])
def test_a_pin_in_its_hole_comes_onto_its_axis(options, swapped, lean):
    scene = scene_of(*plate_and_pin(lean=lean), swapped, **options)
    solution = scene.solve()
    assert solution.success and off_axis(solution) < NEAR
    assert scene.mobility(solution).dof == 2
    assert abs(solution.contacts["fit"].gap) < NEAR


def test_an_objective_moves_it_along_the_axis_alone():
    scene = scene_of(*plate_and_pin())
    scene.minimize(asm.PointDistance(scene.body("pin").point(0, 0, 0), (20.0, 3.0, 9.0)))
    solution = scene.solve()
    assert solution.success and off_axis(solution) < NEAR
    assert solution.q[1, 2] == pytest.approx(9.0, abs=1e-9)


def test_what_fits_as_it_stands_is_not_moved():
    scene = scene_of(*plate_and_pin(place=(8.0, 0.0, 4.0), lean=(0.0, 0.0, 0.0)))
    assert np.array_equal(scene.solve().q, scene.q)


def test_a_ball_comes_into_the_center_of_its_socket():
    socket = asm.Body("socket", asm.Face(asm.shapes.sphere(5.0), reversed=True), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(5.0), (0.4, 0.2, -0.3))
    scene = asm.Assembly([socket, ball])
    scene.constrain(asm.Contact(ball, socket, "seat"))
    solution = scene.solve()
    assert solution.success and np.linalg.norm(solution.q[1, :3]) < NEAR
    assert scene.mobility(solution).dof == 3


@pytest.mark.parametrize(
    "case",
    [
        lambda: scene_of(*plate_and_pin(place=(30.0, 0.0, 60.0))),
        lambda: scene_of(*plate_and_pin(place=(8.0, 0.0, 30.0))),
        lambda: scene_of(*plate_and_pin(radius=0.999 * RADIUS)),
        lambda: scene_of(*plate_and_pin(), unilateral=True),
        lambda: scene_of(*plate_and_pin(lean=(0.9, 0.0, 0.0))),
    ],
)
def test_others_stay_contacts_of_one_pair(case):
    scene = case()
    scene.solve()
    assert [item.name for item in scene.packed().contacts] == ["fit"]


def test_one_whose_pair_is_started_stays_one():
    scene = scene_of(*plate_and_pin(), edges=False)
    scene.solve(starts={"fit": (0.1, 0.1, 0.1, 0.1)})
    assert len(scene.packed().contacts) == 1


def test_beside_a_least_gap_it_stays_one():
    scene = scene_of(*plate_and_pin())
    scene.constrain(asm.Clearance(minimum=0.01))
    scene.solve(max_iterations=1)
    assert len(scene.packed().contacts) == 1


def test_solutions_of_either_kind_are_gone_on_from():
    scene = scene_of(*plate_and_pin())
    seated = scene.solve()
    beside = scene.solve([scene.q[0], [30.0, 0.0, 60.0, 1.0, 0.0, 0.0, 0.0]])
    assert beside.success and off_axis(beside) > 1.0
    for first in (seated, beside, seated):
        again = scene.solve(first)
        assert again.success and np.array_equal(again.q, first.q)
    assert np.array_equal(scene.solve().q, seated.q)
    other = asm.Assembly(scene.bodies)
    other.constrain(asm.Contact(scene.body("plate").face("hole 1"), scene.body("pin").face("wall")))
    with pytest.raises(asm.errors.InputError, match="of another assembly"):
        other.solve(seated)


def test_a_change_of_the_scene_forgets_what_was_packed():
    scene = scene_of(*plate_and_pin())
    seated = scene.solve()
    scene.minimize(asm.PointDistance(scene.body("pin").point(0, 0, 0), (8.0, 0.0, 0.0)))
    with pytest.raises(asm.errors.InputError, match="before a change"):
        scene.solve(seated)
    assert scene.solve().success
