"""Bounds of derivatives of what leans: differences along random turns of an axis never exceed them, and come near."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from assembly.proximity.clearance.sleeve_bends import axis_bends, disc_bend, section_bends
from tests.proximity.clearance.scenes import direction

STEP = 1e-4


def turning_axes(rng, most):
    """Five axes in equal steps of a turn, none with a lean beyond a tangent; the angles w and w1 of a unit of time."""
    while True:
        about, axis = direction(rng), direction(rng)
        axis = axis if axis[2] > 0.0 else -axis
        if rng.random() < 0.5:
            # The turn that bends the most leads straight to where it leans farther.
            about = np.cross(axis, (0.0, 0.0, 1.0)) / np.linalg.norm(axis[:2])
        if axis[2] > 0.0 and np.hypot(axis[0], axis[1]) < most * axis[2]:
            axes = np.array([Rotation.from_rotvec(STEP * k * about).apply(axis) for k in (-1, 0, 1)])
            return axes, float(np.linalg.norm(np.cross(about, axis)))


def derivatives(values):
    """The first and second one in the middle of three values."""
    return (values[2] - values[0]) / (2.0 * STEP), (values[2] - 2.0 * values[1] + values[0]) / STEP**2


def leans_of(axes):
    """By how much axes go sideways for each unit of height."""
    return axes[:, :2] / axes[:, 2:]


@pytest.mark.parametrize("most", [0.05, 0.3, 1.0, 5.0])
def test_the_axis_bends_no_more_than_told(most, cases):
    """The lean and the secant of a random turn; |w| = 1."""
    rng, closest = np.random.default_rng(0), np.zeros(4)
    for _ in range(cases(200, 4000)):
        axes, part = turning_axes(rng, most)
        t = np.linalg.norm(leans_of(axes), axis=1).max()
        s, secant = derivatives(leans_of(axes)), derivatives(1.0 / axes[:, 2])
        seen = np.array([np.linalg.norm(s[0]), np.linalg.norm(s[1]), abs(secant[0]), abs(secant[1])]) / part
        told = np.array(axis_bends(t))
        assert np.all(seen <= told * (1.0 + 1e-5) + 2e-6)
        closest = np.maximum(closest, seen / told)
    assert np.all(closest > 0.5)


@pytest.mark.parametrize(("most", "slope"), [(0.05, 0.0), (0.3, 1.0), (1.0, 0.0), (1.0, 0.6), (0.3, 2.0), (4.0, 0.1)])
def test_the_section_bends_no_more_than_told(most, slope, cases):
    """The factor of its radius along random directions across the bore, of what gets wider either way."""
    rng, closest = np.random.default_rng(1), np.zeros(3)
    for _ in range(cases(300, 6000)):
        axes, part = turning_axes(rng, most)
        s = leans_of(axes)
        v = direction(rng)[:2] if rng.random() < 0.5 else s[1]
        v = v / np.linalg.norm(v)
        square = np.sum(s * s, axis=1)
        x, rest = s @ v * np.sign(rng.normal()), 1.0 - slope**2 * square
        factor = (slope * x * np.sqrt(1.0 + square) + np.sqrt(rest + (1.0 + slope**2) * x * x)) / rest
        first, second = derivatives(factor)
        seen = np.array([factor[1], abs(first) / part, abs(second) / part])
        told = np.array(section_bends(np.sqrt(square.max()), slope))
        assert np.all(seen <= told * (1.0 + 1e-5) + 2e-6)
        closest = np.maximum(closest, seen / told)
    # Bounds of products of bounds are not attained.
    assert closest[0] > 0.5 and np.all(closest[1:] > 0.1)


def test_a_disc_bends_no_more_than_told(cases):
    """sqrt(1 - x^2), with x the cosine of a turning axis to any direction."""
    rng, closest = np.random.default_rng(2), 0.0
    for _ in range(cases(300, 4000)):
        axes, part = turning_axes(rng, 50.0)
        x = axes @ direction(rng)
        sine = np.abs(x).max()
        if sine > 0.99:
            continue
        seen = abs(derivatives(np.sqrt(1.0 - x * x))[1]) / part
        told = disc_bend(sine)
        assert seen <= told * (1.0 + 1e-4) + 2e-6
        closest = max(closest, seen / told)
    assert closest > 0.5
