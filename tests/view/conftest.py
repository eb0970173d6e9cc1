"""Scenes to look at, and a browser to look with."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import assembly as asm
from tests.view.chromium import BROWSER, decoded, photograph


@pytest.fixture
def photo(tmp_path):
    """Pixels (height, width, 3) of a page in Chromium."""
    if BROWSER is None:
        pytest.skip("no Chromium in the path")

    def take(page: Path, width: int = 420, height: int = 300) -> np.ndarray:
        photograph(page, tmp_path / "photo.png", width, height)
        return decoded(tmp_path / "photo.png")

    return take


@pytest.fixture
def balls():
    """Three balls side by side, the first two touching, and a wish for the third."""
    red = asm.Body("red", asm.shapes.sphere(1.0), fixed=True)
    green = asm.Body("green", asm.shapes.sphere(1.0), position=(2.3, 0.0, 0.0))
    blue = asm.Body("blue", asm.shapes.sphere(1.0), position=(4.8, 0.5, 0.0))
    scene = asm.Assembly([red, green, blue])
    scene.constrain(asm.Contact(red, green))
    scene.minimize(asm.PointDistance(blue.point(0.0, 0.0, 1.0), target=(5.0, 0.0, 2.0)), asm.Posture())
    return scene
