"""Deep pairs of points that are none through which bodies are in each other: dovetails, shoulders, heads over holes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from tests.proximity.manager.test_contact_place import prism
from tests.studies.machined import turned_part

WIDE, DEEP = 10.0, 8.0


def dovetail(angle, slid, play=0.0):
    """A slider in the groove of a rail, whose lips lean over it by an angle; flush on floor and flanks."""
    t = DEEP / np.tan(angle)
    rail = [(-30, -20), (30, -20), (30, 0), (WIDE, 0), (WIDE + t, -DEEP), (-WIDE - t, -DEEP), (-WIDE, 0), (-30, 0)]
    slider = [(-WIDE - t, -DEEP), (WIDE + t, -DEEP), (WIDE, 0), (WIDE, 6), (-WIDE, 6), (-WIDE, 0)]
    a = asm.Body("rail", prism(rail, 120.0), fixed=True)
    b = asm.Body("slider", prism(slider, 40.0), (0.0, play, slid))
    return a, b


def scene_of(*bodies):
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())
    return scene


@pytest.mark.parametrize("angle", [50.0, 70.0])
@pytest.mark.parametrize("slid", [0.0, 40.0])
@pytest.mark.parametrize("order", [1, -1])
def test_a_dovetail_stays_in_its_groove(angle, slid, order):
    scene = scene_of(*dovetail(np.radians(angle), slid)[::order])
    q = np.array(scene.q)
    solution = scene.solve()
    assert solution.success, solution.message
    assert np.array_equal(solution.q, q)
    # No pair behind a lip is told to be a contact.
    assert min(c.gap for c in solution.contacts.values()) > -1e-9


def test_a_dovetail_that_is_in_its_flanks_is_pushed_off_them():
    """It is too high by 0.01, in both flanks by less: the way out is down onto the floor or along the groove's end."""
    rail, slider = dovetail(np.radians(60.0), 0.0, 0.01)
    solution = scene_of(rail, slider).solve()
    assert solution.success
    assert np.linalg.norm(solution.q[1, :3] - [0.0, 0.01, 0.0]) < 0.02
    assert solution.q[1, 1] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("into", [0.0, 1e-6, 1e-3, 0.05])
def test_a_shoulder_in_the_face_of_its_bearing_is_pushed_off_it(into):
    """The rim of the shoulder is behind the wall of the bore by much, and in the face by little."""
    block = asm.shapes.plate(50, 50, 20, [(0, 0, 10.02)])
    shaft = turned_part([(0, -40), (10, -40), (10, 10), (14, 10), (14, 40), (0, 40)])
    bearing = asm.Body("bearing", block, fixed=True)
    scene = scene_of(bearing, asm.Body("shaft", shaft, (0.0, 0.0, -into)))
    q = np.array(scene.q)
    solution = scene.solve()
    assert solution.success, solution.message
    if into == 0.0:
        assert np.array_equal(solution.q, q)
    height, moved = solution.q[1, 2], np.linalg.norm(solution.q[1, :3] - q[1, :3])
    up = Rotation.from_quat(solution.q[1, 3:], scalar_first=True).apply([0.0, 0.0, 1.0])
    # The lowest point of its rim, and nothing that went sideways out of the bore.
    assert height + 10.0 * up[2] - 14.0 * np.hypot(up[0], up[1]) > 10.0 - 1e-7
    assert moved <= 1.5 * into + 1e-7


def test_bodies_that_are_in_each_other_through_both_are_not_left():
    """The middle of their pairs is in both, and near no two faces: they are pushed apart, by what they overlap."""
    box = asm.shapes.box(10.0, 10.0, 10.0)
    scene = scene_of(asm.Body("a", box, fixed=True), asm.Body("b", box, (9.0, 1.0, 0.5)))
    solution = scene.solve()
    assert solution.success
    assert solution.q[1, 0] == pytest.approx(10.0, abs=1e-8)


@pytest.mark.parametrize("thick", [1e-1, 1e-2, 1e-4])
@pytest.mark.parametrize("order", [1, -1])
def test_the_corner_of_a_thin_plate_is_not_drawn_into_a_block(thick, order):
    """It points down onto the block, and on the way out of it leaves the plate at once."""
    block = asm.Body("block", asm.shapes.box(4.0, 3.0, 1.0), fixed=True)
    turn = Rotation.from_euler("zyx", [45.0, 10.0, 20.0], degrees=True) * Rotation.from_euler("x", 90.0, degrees=True)
    corners = np.array([[x, y, z] for x in (-0.8, 0.8) for y in (-0.6, 0.6) for z in (-0.5 * thick, 0.5 * thick)])
    low = turn.apply(corners)[:, 2].min()
    plate = asm.Body(
        "plate", asm.shapes.box(1.6, 1.2, thick), (0.1, 0.2, 0.5 - low + 1e-3), turn.as_quat(scalar_first=True)
    )
    scene = scene_of(*(block, plate)[::order])
    scene.minimize(asm.PointDistance(plate.point(0, 0, 0), (0.1, 0.2, 0.3)))
    solution = scene.solve()
    assert solution.success, solution.message
    row = solution.q[0 if order < 0 else 1]
    lowest = Rotation.from_quat(row[3:], scalar_first=True).apply(corners)[:, 2].min() + row[2]
    assert lowest > 0.5 - 1e-9
