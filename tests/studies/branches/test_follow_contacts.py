"""Branches along which contacts hold: bodies that are squeezed, slots that are empty, where numbers end, forces."""

from __future__ import annotations

from math import acos, asin, pi

import numpy as np
import pytest

import assembly as asm
from assembly.derivatives.probed import ProbedScene
from tests.studies.scenes import lifted_block

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


@pytest.mark.parametrize("height", [0.600001, 1.39999])
def test_contacts_that_come_and_go_within_a_step_are_seen(height):
    """An eccentric lifts a block to 1 - 0.4 sin(angle), and a spring holds it where that is less.

    At 0.600001 they part for 0.0045 rad, much less than a step, and at 1.39999 they meet for 0.014 rad.
    """
    scene, shaft, lift = lifted_block(height)
    branch = asm.follow(scene, asm.Parameter(shaft, "angle"), -2.2, 2.2, of=asm.Measure(lift))
    first = asin((1.0 - height) / 0.4) if height < 1.0 else -pi - asin((1.0 - height) / 0.4)
    last = pi - first if height < 1.0 else -pi - first
    found = branch.events[1:-1]
    # Kinds are as seen from the start, at 0.3.
    assert [event.kind for event in found] == ["contact opened", "contact closed"]
    np.testing.assert_allclose([event.value for event in found], [first, last], rtol=0, atol=1e-9)
    lifted = np.maximum(1.0 - 0.4 * np.sin(branch.values), height)
    np.testing.assert_allclose(branch.measures[:, 0], lifted, rtol=0, atol=1e-13)
    assert branch.ends == ("end of range", "end of range") and branch.proved.all()


@pytest.mark.parametrize("below", [1e-6, 1e-7])
def test_a_limit_just_below_what_is_reached_blocks(below):
    """A slider goes to 4 at a crank's angle of 0; with its limit a little below that the crank does not get there."""
    ground, crank, rod, slider = asm.Body("ground", fixed=True), asm.Body("crank"), asm.Body("rod"), asm.Body("slider")
    rod.pose, slider.pose = asm.Pose((np.cos(1.0), -np.sin(1.0), 0.0)), asm.Pose((3.5, 0.0, 0.0))
    drive = asm.Revolute(ground, crank, "drive", angle=-1.0)
    pin = asm.Revolute(crank.frame(at=(1, 0, 0)), rod, "pin")
    guide = asm.Prismatic(ground.frame(**ALONG_X), slider.frame(**ALONG_X), "guide", limits=(0.0, 4.0 - below))
    scene = asm.Assembly([ground, crank, rod, slider])
    scene.constrain(drive, pin, asm.Revolute(rod.frame(at=(3, 0, 0)), slider, "wrist"), guide)
    branch = asm.follow(scene, asm.Parameter(drive, "angle"), -1.5, 1.0, of=asm.Measure(guide))
    assert branch.ends == ("end of range", "blocked") and branch.events[-1].kind == "limit reached"
    reach = 4.0 - below
    assert branch.values[-1] == pytest.approx(-acos((reach**2 - 8.0) / (2.0 * reach)), abs=1e-9)
    assert branch.measures.max() <= reach + 1e-12


@pytest.mark.parametrize("swept", [False, True])
def test_a_ball_that_passes_close_by_is_not_drawn_through(swept):
    """A ball of radius 0.5 is drawn past another one, through it by 1e-4: much less than the square of a step."""
    post = asm.Body("post", asm.shapes.sphere(0.5), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(0.5), position=(-1, 0.9999, 0))
    scene, goal = asm.Assembly([post, ball]), asm.FrameDistance(ball.frame(), asm.Pose((-1, 0.9999, 0)))
    scene.constrain(asm.Clearance())
    scene.minimize(goal)
    branch = asm.follow(scene, asm.Parameter(goal, "target", "x"), -1.0, 1.0, swept=swept)
    meets = (1.0 - 0.9999**2) ** 0.5
    assert [event.kind for event in branch.events] == [
        "end of range",
        "contact closed",
        "contact opened",
        "end of range",
    ]
    # Along x the gap grows by 0.014 of the way, and by no more.
    np.testing.assert_allclose([e.value for e in branch.events], [-1, -meets, meets, 1], rtol=0, atol=1e-12)
    assert branch.proved.all()
