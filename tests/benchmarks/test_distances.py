"""Shapes of the distance benchmark."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from benchmarks.distances import rounded_box


def test_a_rounded_box_is_closed_and_has_its_volume():
    """A box, plates of the radius on its six sides, quarters of cylinders along its edges, and one ball in all."""
    half, radius = np.array([1.0, 0.7, 0.5]), 0.15
    a, b, c = 2.0 * (half - radius)
    faces = rounded_box(tuple(half), radius)
    body = asm.Body("box", faces)
    plates = 2.0 * radius * (a * b + b * c + c * a)
    edges = np.pi * radius**2 * (a + b + c)
    assert len(faces) == 26
    assert body.volume == pytest.approx(a * b * c + plates + edges + 4.0 / 3.0 * np.pi * radius**3, rel=1e-12)
