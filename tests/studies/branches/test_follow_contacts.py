"""Branches along which contacts hold: bodies that are squeezed, slots that are empty, where numbers end, forces."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.derivatives.probed import ProbedScene

ALONG_X = {"z": (1, 0, 0), "x": (0, 1, 0)}


def ball_in_a_vise():
    """A ball of radius 0.4 that is drawn to 0, a jaw's face at -1, and a press with its face at `slide`."""
    base = asm.Body("base", fixed=True)
    jaw = asm.Body("jaw", asm.shapes.box(1, 4, 4), position=(-1.5, 0, 0), fixed=True)
    press = asm.Body("press", asm.shapes.box(1, 4, 4), position=(2.5, 0, 0))
    ball = asm.Body("ball", asm.shapes.sphere(0.4), position=(0.2, 0, 0))
    drive = asm.Prismatic(base.frame(**ALONG_X), press.frame(at=(-0.5, 0, 0), **ALONG_X), "drive", slide=2.0)
    scene = asm.Assembly([base, jaw, press, ball])
    scene.constrain(drive, asm.Clearance(exclude=[(jaw, press)]))
    scene.minimize(asm.FrameDistance(ball.frame(), asm.Pose((0, 0, 0))))
    return scene, drive, ball


@pytest.mark.parametrize("swept", [False, True])
def test_a_ball_that_is_squeezed_blocks_the_branch(swept):
    """From 0.4 on the press takes the ball along, and at -0.2 the jaw is behind it: forces alone could grow."""
    scene, drive, ball = ball_in_a_vise()
    branch = asm.follow(scene, asm.Parameter(drive, "slide"), -2.0, 2.5, of=asm.Measure(ball, "x"), swept=swept)
    assert branch.ends == ("blocked", "end of range") and branch.proved.all()
    assert [event.kind for event in branch.events] == ["contact closed", "contact closed", "end of range"]
    assert [event.bodies for event in branch.events] == [("ball", "jaw"), ("ball", "press"), ()]
    np.testing.assert_allclose([event.value for event in branch.events], [-0.2, 0.4, 2.5], rtol=0, atol=1e-12)
    np.testing.assert_allclose(branch.measures[:, 0], np.minimum(branch.values - 0.4, 0.0), rtol=0, atol=1e-13)


def test_slots_without_contacts_take_no_room_and_change_nothing():
    scene, drive, _ = ball_in_a_vise()
    slide = asm.Parameter(drive, "slide")
    few = asm.follow(scene, slide, 0.0, 2.5)
    slots = scene.packed().clearance_rows
    scene._pack_with_more_places()
    assert scene.packed().clearance_rows > 2 * slots
    many = asm.follow(scene, slide, 0.0, 2.5)
    assert many.poses.tobytes() == few.poses.tobytes() and many.values.tobytes() == few.values.tobytes()
    solution = scene.solve()
    packed, state = scene.packed(), solution._state
    listed = sum(pair >= 0 for pair, _ in packed.listed(state))
    assert listed < slots
    probed = ProbedScene(packed, state, scene.bodies)
    assert probed._most == (packed.rows + 4 * listed, 6 * len(scene.bodies) + 4 * listed)


@pytest.mark.parametrize("least", [0.1, 0.0])
def test_a_range_may_end_where_numbers_do(least):
    """No gap is below zero, so there is no point beyond that end; the ball is 2.3 - cos(0.3) from the wall."""
    base, wall = asm.Body("base", fixed=True), asm.Body("wall", asm.shapes.box(1, 2, 2), position=(3, 0, 0), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(0.2), position=(1, 0, 0))
    drive = asm.Revolute(base, ball.frame(at=(-1, 0, 0)), "drive", angle=0.3)
    clearance = asm.Clearance(minimum=least)
    scene = asm.Assembly([base, wall, ball])
    scene.constrain(drive, clearance)
    branch = asm.follow(scene, asm.Parameter(clearance, "minimum"), 0.0, 4.0)
    assert branch.ends == ("end of range", "blocked") and branch.proved.all()
    assert branch.values[0] == 0.0 and branch.values[-1] == pytest.approx(2.3 - np.cos(0.3), abs=1e-12)
    assert (np.diff(branch.values) > 0.0).all()
