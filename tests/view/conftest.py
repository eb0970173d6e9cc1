"""Scenes to look at, and a browser to look with."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.model.joints import Revolute, Spherical, Universal
from tests.view.chromium import BROWSER, Chromium, decoded


@pytest.fixture(scope="session")
def browser(tmp_path_factory):
    """A Chromium for all pages; skip where there is none."""
    if BROWSER is None:
        pytest.skip("no Chromium in the path")
    chromium = Chromium(tmp_path_factory.mktemp("chromium"))
    yield chromium
    chromium.close()


@pytest.fixture
def photo(browser, tmp_path):
    """Pixels (height, width, 3) of a page in Chromium."""

    def take(page: Path, width: int = 420, height: int = 300, fragment: str = "") -> np.ndarray:
        browser.photograph(page, tmp_path / "photo.png", width, height, fragment=fragment)
        return decoded(tmp_path / "photo.png")

    return take


@pytest.fixture
def balls():
    """Three balls side by side, the first two touching, and a target for the third."""
    red = asm.Body("red", asm.shapes.sphere(1.0), fixed=True)
    green = asm.Body("green", asm.shapes.sphere(1.0), position=(2.3, 0.0, 0.0))
    blue = asm.Body("blue", asm.shapes.sphere(1.0), position=(4.8, 0.5, 0.0))
    scene = asm.Assembly([red, green, blue])
    scene.constrain(asm.Contact(red, green))
    scene.minimize(asm.PointDistance(blue.point(0.0, 0.0, 1.0), target=(5.0, 0.0, 2.0)), asm.Posture())
    return scene


@pytest.fixture
def rolling():
    """Poses (13, 3, 7) of the three balls: the blue one goes a quarter turn about the z axis through the green one."""
    angle = np.linspace(0.0, 0.5 * np.pi, 13)
    q = np.zeros((13, 3, 7))
    q[:, :, 3] = 1.0
    q[:, 1, 0] = 2.3
    q[:, 2, 0], q[:, 2, 1] = 2.3 + 2.5 * np.cos(angle), 2.5 * np.sin(angle)
    q[:, 2, 3], q[:, 2, 6] = np.cos(0.5 * angle), np.sin(0.5 * angle)
    return q


@pytest.fixture
def four_bar():
    """A spatial four-bar of bodies without shapes: two hinges, a universal and a spherical joint; and a grasp.

    The hinge axes are the world's z and y axis; the coupler is on the universal joint, 4 long.
    """
    ground = asm.Body("ground", fixed=True)
    blue = asm.Body("blue", position=(0, 0, 0))
    orange = asm.Body("orange", position=(1, 0, 0))
    green = asm.Body("green", position=(5, 0, 0))
    scene = asm.Assembly([ground, blue, orange, green])
    # The far end of the green rocker, 3 long, is straight above its hinge; the coupler reaches it at a slope.
    height = 3.0
    slope = np.arctan2(height, 4.0)
    orange.pose = asm.Pose.from_axis_angle((0, 1, 0), -slope, (1, 0, 0))
    scene.constrain(
        Revolute(ground.frame(), blue.frame(), "crank"),
        Universal(blue.frame(at=(1, 0, 0)), orange.frame(z=(0, 1, 0)), "cross"),
        Spherical(orange.point(5, 0, 0), green.point(0, 0, height), "ball"),
        Revolute(ground.frame(at=(5, 0, 0), z=(0, 1, 0)), green.frame(z=(0, 1, 0)), "rocker"),
    )
    scene.minimize(asm.PointDistance(orange.point(2.5, 0, 0), target=(3.0, 0.0, 3.5)))
    return scene
