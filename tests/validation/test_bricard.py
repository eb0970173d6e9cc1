"""Bricard's linkage with threefold symmetry: six hinges that move, where Gruebler counts none.

Six links of one length with twists alpha, -alpha in turn; every second hinge turns by t, the others by p. The chain
closes where two neighboring turns make a third of a turn,

    cos(t/2) cos(p/2) - cos(alpha) sin(t/2) sin(p/2) = 1/2,

or, as it is printed (Chen, You and Tarnai 2005),

    cos^2(alpha) + sin^2(alpha) (cos t + cos p) + (1 + cos^2(alpha)) cos t cos p - 2 cos(alpha) sin t sin p = 0.
"""

from __future__ import annotations

from math import cos, pi, radians, sin

import numpy as np
import pytest

import assembly as asm
from tests.validation.mechanisms import CLOSE, angles, assert_came_back, degrees, drive, loop_of_revolutes, shake


def other_angle(t, alpha, side):
    """The neighbor's angle, of the two that there are."""
    c, s = np.cos(t / 2), -cos(alpha) * np.sin(t / 2)
    return 2 * (np.arctan2(s, c) + side * np.arccos(0.5 / np.hypot(c, s)))


def printed(t, p, alpha):
    c, s = cos(alpha), sin(alpha)
    return c**2 + s**2 * (np.cos(t) + np.cos(p)) + (1 + c**2) * np.cos(t) * np.cos(p) - 2 * c * np.sin(t) * np.sin(p)


class Bricard:
    def __init__(self, alpha, t, side, size=1.0):
        p = float(other_angle(np.array(t), alpha, side))
        self.links, self.hinges = loop_of_revolutes((size,) * 6, (alpha, -alpha) * 3, (p, t, p, t, p))
        shake(self.links, 0.01 * size)
        self.scene = asm.Assembly(self.links)
        self.scene.constrain(*self.hinges)


def check(made, solutions, t, p, alpha, amplified=3):
    for k, hinge in enumerate(made.hinges):
        expected = p if k % 2 else t
        off = angles(solutions, hinge) - expected
        assert np.abs(off - 2 * pi * np.round(off / (2 * pi))).max() < amplified * CLOSE
    found = [angles(solutions, hinge) for hinge in made.hinges[:2]]
    assert np.abs(printed(*found, alpha)).max() < amplified * CLOSE


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(("twist", "size"), [(50, 1.0), (35, 1.0), (50, 1e-3)])
def test_two_turns(twist, size, side):
    # With a twist below 60 degrees the hinges turn all around.
    alpha = radians(twist)
    made = Bricard(alpha, 0.3, side, size)
    t = degrees(turns=2, start=0.3)
    solutions = drive(made.scene, made.hinges[0].freedom(), t)
    p = np.unwrap(other_angle(t, alpha, side))
    check(made, solutions, t, p, alpha)
    found = angles(solutions, made.hinges[1])
    assert abs(found[-1] - found[0] - (p[-1] - p[0])) < 3 * CLOSE and abs(p[-1] - p[0]) > 12.0
    assert_came_back(solutions[0], solutions[-1], size)


def test_the_orthogonal_one_turns_inside_out():
    """Twists of a right angle: (1 + cos t) (1 + cos p) = 1, a closed curve around (0, 0).

    Neither angle goes all around; each drives where the other is near its extreme of 120 degrees.
    """
    made = Bricard(pi / 2, 1.0, 1)
    first, second = (hinge.freedom() for hinge in made.hinges[:2])
    # They change places where both are a right angle.
    sweep = np.linspace(pi / 2, -pi / 2, 40)
    solution = drive(made.scene, first, np.linspace(1.0, pi / 2, 8))[-1]
    start = solution
    for _ in range(2):
        for driven, free, side, values in (
            (first, second, 1, sweep),
            (second, first, -1, sweep),
            (first, second, -1, -sweep),
            (second, first, 1, -sweep),
        ):
            free.value = None
            driven.value = float(values[0])
            solution = made.scene.solve(solution.q)
            assert solution.success
            solutions = drive(made.scene, driven, values, solution)
            follows = side * 2 * np.arccos(0.5 / np.cos(values / 2))
            t, p = (values, follows) if driven is first else (follows, values)
            check(made, solutions, t, p, pi / 2)
            solution = solutions[-1]
    # Twice around: inside out and back, and every quaternion with its sign.
    assert_came_back(start, solution)
