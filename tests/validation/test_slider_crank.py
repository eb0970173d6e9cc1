"""The slider-crank: crank r, rod l, the cylinder's axis at height e above the crank's.

With the crank at angle a the piston is at x = r cos a + sqrt(l^2 - (r sin a - e)^2), and the rod at the angle p with
l sin p = e - r sin a.
"""

from __future__ import annotations

from math import acos, atan2, hypot, sqrt

import numpy as np
import pytest

import assembly as asm
from tests.validation.mechanisms import (
    CLOSE,
    angles,
    assert_came_back,
    degrees,
    drive,
    planar,
    positions,
    shake,
)

R, L, E = 1.0, 2.7, 0.3


class SliderCrank:
    def __init__(self, size=1.0, gudgeon="revolute", pin="aligned", above=True):
        r, l, e = size * R, size * L, size * E
        ground, crank = planar("ground", fixed=True), planar("crank", angle=0.4 if above else -0.4)
        rod, self.piston = planar("rod", (r, 0.2 * r)), planar("piston", (r + l, e))
        shake([crank, rod, self.piston], 0.01 * min(size, 1.0))
        self.main = asm.Revolute(ground, crank, "main")
        sign = 1.0 if pin == "aligned" else -1.0
        big_end = asm.Revolute(crank.frame((r, 0, 0)), rod.frame(z=(0, 0, sign), x=(1, 0, 0)), "big end", axes=pin)
        small_end = (asm.Revolute if gudgeon == "revolute" else asm.Spherical)(rod.frame((l, 0, 0)), self.piston)
        along = {"z": (1, 0, 0), "x": (0, 1, 0)}
        self.cylinder = asm.Prismatic(ground.frame((0, e, 0), **along), self.piston.frame(**along), "cylinder")
        self.rod = asm.Parallel(ground, rod, "rod's direction")  # tells the rod's angle; not in the scene
        self.scene = asm.Assembly([ground, crank, rod, self.piston])
        self.scene.constrain(self.main, big_end, small_end, self.cylinder)


def piston(a):
    return R * np.cos(a) + np.sqrt(L**2 - (R * np.sin(a) - E) ** 2)


# All hinges parallel: three rows too many, which a ball at the gudgeon halves. Units from micrometers to kilometers.
@pytest.mark.parametrize(
    ("size", "gudgeon", "pin"),
    [
        (1.0, "revolute", "aligned"),
        (1.0, "spherical", "opposed"),
        (1e6, "revolute", "opposed"),
        (1e-3, "spherical", "aligned"),
    ],
)
def test_the_piston_over_two_turns(size, gudgeon, pin):
    made = SliderCrank(size, gudgeon, pin)
    a = degrees(turns=2)
    solutions = drive(made.scene, made.main.freedom(), a)
    expected = size * np.column_stack([piston(a), np.full_like(a, E), np.zeros_like(a)])
    assert np.abs(positions(solutions, made.piston) - expected).max() < CLOSE * size
    assert np.abs(angles(solutions, made.rod) - np.arcsin((E - R * np.sin(a)) / L)).max() < CLOSE
    assert_came_back(solutions[0], solutions[-1], size)
    # After one turn the crank's quaternion is the opposite of the first: nothing was flipped on the way.
    assert np.abs(solutions[72].q[1, 3:] + solutions[0].q[1, 3:]).max() < CLOSE


@pytest.mark.parametrize("above", [True, False])
def test_the_piston_drives_the_crank_on_either_side(above):
    # There and back over nearly the whole stroke: near its dead centers the crank stays on its side of them.
    top, bottom = sqrt((L + R) ** 2 - E**2), sqrt((L - R) ** 2 - E**2)
    middle, half = 0.5 * (top + bottom), 0.49 * (top - bottom)
    x = middle + half * np.cos(degrees(turns=1, start=0.2))
    made = SliderCrank(above=above)
    solutions = drive(made.scene, made.cylinder.freedom(), x)
    # The triangle of crank, rod and the line from the crank's center to the gudgeon.
    far = np.hypot(x, E)
    side = np.arccos((R**2 + far**2 - L**2) / (2 * R * far)) * (1 if above else -1)
    a = np.arctan2(E, x) + side
    # How much the crank turns for a move of the piston: without bound at the dead centers.
    amplified = np.abs((x - R * np.cos(a)) / (R * (x * np.sin(a) - E * np.cos(a))))
    assert (np.abs(angles(solutions, made.main) - a) < CLOSE * L * (1.0 + amplified)).all()
    assert amplified.max() > 5.0


@pytest.mark.parametrize("sign", [1, -1])
def test_dead_centers(sign):
    # The place of the piston that is nearest to one out of its reach: crank and rod in line.
    made = SliderCrank()
    made.scene.minimize(asm.PointDistance(made.piston.point(0, 0, 0), (10 * sign * L, E, 0)))
    solution = made.scene.solve()
    assert solution.success
    reach = L + sign * R
    x = sqrt(reach**2 - E**2)
    assert abs(solution.pose(made.piston).position[0] - x) < CLOSE
    line = atan2(E, x) if sign > 0 else atan2(-E, -x)
    (a,) = angles([solution], made.main)
    # The objective is flat there: the angle is as good as its slope, 1e-10 of the largest.
    assert abs(np.sin(a - line)) < 1e-9 and np.cos(a - line) > 0.0
    assert acos(x / hypot(x, E)) > 0.05  # not just the crank along the cylinder
