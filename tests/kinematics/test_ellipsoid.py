"""Ellipsoids: what they keep, and what they refuse."""

from __future__ import annotations

import numpy as np
import pytest

from assembly.errors import InputError
from assembly.kinematics.ellipsoid import Ellipsoid

AXES = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]


def test_an_ellipsoid_keeps_copies_that_nobody_can_write_to():
    center, lengths = np.array([1.0, 2.0, 3.0]), np.array([3.0, 0.0, 1.0])
    shape = Ellipsoid(center, AXES, lengths, [1, 0.5, 0])
    center[0] = lengths[0] = 9.0
    assert shape.center.tolist() == [1.0, 2.0, 3.0] and shape.lengths.tolist() == [3.0, 0.0, 1.0]
    assert (shape.axes == AXES).all()
    assert shape.color == (1.0, 0.5, 0.0)
    for array in (shape.center, shape.axes, shape.lengths):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0
    assert repr(shape) == "Ellipsoid(center=(1, 2, 3), lengths=(3, 0, 1))"
    assert shape != Ellipsoid(shape.center, AXES, shape.lengths)
    assert Ellipsoid((0, 0, 0), np.eye(3), (0, 0, 0)).color is None


def test_scaled():
    shape = Ellipsoid((1, 2, 3), AXES, (3, 0, 1), (1, 0, 0))
    half = shape.scaled(0.5)
    # Halves are exact.
    assert half.lengths.tolist() == [1.5, 0.0, 0.5]
    assert (half.center == shape.center).all() and (half.axes == AXES).all() and half.color == shape.color
    with pytest.raises(InputError, match="factor is 0; expected a positive number"):
        shape.scaled(0.0)


def test_axes_of_either_hand_and_of_five_digits():
    mirrored = AXES * [1.0, 1.0, -1.0]
    assert np.linalg.det(mirrored) * np.linalg.det(AXES) < 0.0
    assert (Ellipsoid((0, 0, 0), mirrored, (1, 2, 3)).axes == mirrored).all()
    rounded = [[0.70711, -0.70711, 0], [0.70711, 0.70711, 0], [0, 0, 1]]
    assert (Ellipsoid((0, 0, 0), rounded, (1, 2, 3)).axes == rounded).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"center": (0, 0)}, r"center has shape \(2,\); expected \(3,\)"),
        ({"center": (0, np.nan, 0)}, r"center\[1\] is nan"),
        ({"axes": np.eye(2)}, r"axes has shape \(2, 2\); expected \(3, 3\)"),
        ({"axes": 1.1 * np.eye(3)}, "axes is .*; expected columns of length one, orthogonal to each other"),
        ({"axes": [[1, 0.01, 0], [0, 1, 0], [0, 0, 1]]}, "expected columns of length one"),
        ({"lengths": (1, -1e-3, 1)}, r"lengths is \[1.0, -0.001, 1.0\]; expected numbers that are not below zero"),
        ({"lengths": (1, np.inf, 1)}, r"lengths\[1\] is inf"),
        ({"lengths": 2.0}, r"lengths has shape \(\)"),
        ({"color": "red"}, "color is 'red'; expected real numbers"),
        ({"color": (0, 0, 1.5)}, r"color is \(0.0, 0.0, 1.5\); expected red, green, blue from 0 to 1"),
    ],
)
def test_bad_input(change, message):
    arguments = {"center": (0, 0, 0), "axes": np.eye(3), "lengths": (1, 2, 3), **change}
    with pytest.raises(InputError, match=message):
        Ellipsoid(**arguments)
