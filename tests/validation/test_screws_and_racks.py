"""Screws and racks: a turn and a travel in proportion, over many turns, from either side."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

import assembly as asm
from tests.validation.mechanisms import CLOSE, angles, assert_came_back, drive, planar, positions, shake

TURNS = 2 * pi * np.arange(0, 5.01, 0.05)


@pytest.mark.parametrize("pitch", [0.5, -2.0, 40.0])
def test_screw(pitch):
    ground, nut = asm.Body("ground", fixed=True), asm.Body("nut", position=(0, 0, 0.02))
    screw = asm.Screw(ground.frame((1, 2, 3), (1, 1, 0)), nut.frame(z=(0, 1, 0)), pitch)
    scene = asm.Assembly([ground, nut])
    scene.constrain(screw)
    along = np.array([1, 1, 0]) / np.sqrt(2)
    place = [1, 2, 3] + np.outer(pitch * TURNS / (2 * pi), along)
    size = max(1.0, 5 * abs(pitch))
    # The screw is turned, then pushed back; the pose after n turns tells that n of them were counted.
    forth = drive(scene, screw.freedom("angle"), TURNS)
    assert np.abs(positions(forth, nut) - place).max() < CLOSE * size
    assert np.abs(angles(forth, screw) - TURNS).max() < CLOSE
    screw.angle = None
    screw.slide = pitch * TURNS[-1] / (2 * pi)
    # Free or driven are other rows: this starts from the pose, which does not know the turn; the slide tells it.
    start = scene.solve(forth[-1].q)
    assert start.success
    back = drive(scene, screw.freedom("slide"), pitch * TURNS[::-1] / (2 * pi), start)
    assert np.abs(positions(back, nut) - place[::-1]).max() < CLOSE * size
    assert np.abs(angles(back, screw) - angles(back, screw)[0] - (TURNS[::-1] - TURNS[-1])).max() < 3 * CLOSE * size
    assert_came_back(forth[0], back[-1], size)


@pytest.mark.parametrize(("first", "second"), [(2.0, 1.75), (1.0, -1.0), (0.5, 0.5)])
def test_differential_screw(first, second):
    # A spindle with two threads: the slider, which cannot turn, goes by the difference of the pitches.
    ground, spindle, slider = (
        asm.Body("ground", fixed=True),
        asm.Body("spindle"),
        asm.Body("slider", position=(4, 0, 5)),
    )
    thread = asm.Screw(ground, spindle, first, "thread")
    scene = asm.Assembly([ground, spindle, slider])
    scene.constrain(
        thread,
        asm.Screw(spindle.frame((0, 0, 5)), slider.frame((-4, 0, 0)), second, "fine thread"),
        asm.Prismatic(ground.frame((4, 0, 5)), slider, "guide"),
    )
    shake(scene.bodies, 0.01)
    solutions = drive(scene, thread.freedom("angle"), TURNS)
    turns = TURNS / (2 * pi)
    assert np.abs(positions(solutions, spindle)[:, 2] - first * turns).max() < 10 * CLOSE
    # The spindle screws itself in by the first pitch, and the slider off it by the second one, backward.
    assert (
        np.abs(
            positions(solutions, slider) - np.column_stack([4 + 0 * turns, 0 * turns, 5 + (first - second) * turns])
        ).max()
        < 30 * CLOSE
    )


@pytest.mark.parametrize("radius", [1.0, -2.5])
def test_rack_and_pinion(radius):
    ground, wheel = planar("ground", fixed=True), planar("wheel")
    rack, second = planar("rack", (0.0, -abs(radius))), planar("second rack", (0.0, abs(radius)))
    shaft = asm.Revolute(ground, wheel, "shaft")
    along = {"z": (1, 0, 0), "x": (0, 0, 1)}
    guides = [
        asm.Prismatic(ground.frame((0, y, 0), **along), body.frame(**along), f"guide {body.name}")
        for body, y in ((rack, -abs(radius)), (second, abs(radius)))
    ]
    meshes = [asm.RackPinion(shaft, guide, r) for guide, r in zip(guides, (radius, -radius), strict=True)]
    scene = asm.Assembly([ground, wheel, rack, second])
    scene.constrain(shaft, *guides, *meshes)
    shake(scene.bodies, 0.01)
    forth = drive(scene, shaft.freedom(), TURNS)
    travel = radius * TURNS
    size = max(1.0, np.abs(travel).max())
    for body, sign in ((rack, 1), (second, -1)):
        assert np.abs(positions(forth, body)[:, 0] - sign * travel).max() < CLOSE * size
    # No slip: the wheel's point at the pitch line has the rack's speed, so that both go the same way in a small turn.
    assert np.abs(angles(forth, shaft) - TURNS).max() < CLOSE
    # Back, driven by the second rack: the wheel counts its turns from where it is.
    shaft.angle = None
    guides[1].slide = float(-travel[-1])
    start = scene.solve(forth[-1].q)
    assert start.success
    back = drive(scene, guides[1].freedom(), -travel[::-1], start)
    assert np.abs(positions(back, rack)[:, 0] - travel[::-1]).max() < CLOSE * size
    assert np.abs(angles(back, shaft) - angles(back, shaft)[0] - (TURNS[::-1] - TURNS[-1])).max() < 3 * CLOSE
    assert_came_back(forth[0], back[-1], size)
