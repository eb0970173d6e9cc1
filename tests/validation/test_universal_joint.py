"""Universal joints: one alone turns its output unevenly, a second one can make up for it.

Two shafts meet at the angle s. Turns are those of the yokes' pins from the normal of the plane of both shafts: the
pin of the next shaft is a quarter turn on from b with

    tan b = tan a cos s        (with both turns from the plane itself, as it is often printed, tan b = tan a / cos s).
"""

from __future__ import annotations

from itertools import pairwise
from math import cos, pi, radians, sin

import numpy as np
import pytest

import assembly as asm
from assembly.kinematics.pose import axes_quaternion
from tests.validation.mechanisms import CLOSE, Counter, angles, assert_came_back, degrees, drive, shake

START, LENGTH = 0.2, 2.0


def uneven(turns, factor):
    """b with tan b = factor tan a, in the same quarter turn as a; continuous."""
    return np.unwrap(np.arctan2(factor * np.sin(turns), np.cos(turns)))


def in_plane(*bends):
    """Directions of shafts in the x-y plane, from the angles between them in degrees."""
    turned = np.radians(np.cumsum([0, *bends]))
    return [np.array([cos(a), sin(a), 0.0]) for a in turned]


def about(axis, v, angle):
    return asm.Pose.from_axis_angle(axis, angle).apply(v)


class Shafts:
    """Shafts end to end at their turns now, the first and the last in bearings.

    A shaft's body has z along it, its origin at its rear end, and x along its rear pin; the first one's x is along its
    front pin. The front pin of a middle shaft is turned from its rear one by `phase`.
    """

    def __init__(self, directions, turns, phase=0.0):
        ground = asm.Body("ground", fixed=True)
        normals = [np.cross(*pair) / np.linalg.norm(np.cross(*pair)) for pair in pairwise(directions)]
        at, front, self.bodies, self.turns, joints = np.zeros(3), None, [], [], []
        for k, (z, turn) in enumerate(zip(directions, turns, strict=True)):
            normal = normals[max(k - 1, 0)]
            x = about(z, normal, turn)
            shaft = asm.Body(
                f"shaft {k}", position=at, quaternion=axes_quaternion(np.column_stack([x, np.cross(z, x), z]))
            )
            bearing = asm.Revolute(ground.frame(at, z, normal), shaft.frame(), f"bearing {k}")
            if front is not None:
                joints.append(asm.Universal(front, shaft.frame(z=(1, 0, 0)), f"cross {k}"))
            pin = phase if 0 < k < len(directions) - 1 else 0.0
            front = shaft.frame((0, 0, LENGTH), (cos(pin), sin(pin), 0.0))
            at = at + LENGTH * z
            self.bodies.append(shaft)
            self.turns.append(bearing)
        # In the middle the bearing only tells the turn.
        self.input, self.output = self.turns[0], self.turns[-1]
        self.counter = Counter(ground, self.output, LENGTH, turns[-1])
        self.scene = asm.Assembly([ground, *self.bodies, self.counter.rack])
        self.scene.constrain(self.input, *joints, self.output, *self.counter.constraints)
        shake(self.bodies, 0.02)


def check(made, expected):
    """Drive two turns, compare turns of all shafts, and come back."""
    solutions = drive(made.scene, made.input.freedom(), degrees(turns=2, start=START))
    for bearing, turn in zip(made.turns, expected, strict=True):
        off = angles(solutions, bearing) - turn
        # Shafts that turn alike by the poses, which do not tell whole turns.
        assert np.abs(off - 2 * pi * np.round(off / (2 * pi))).max() < 3 * CLOSE
    assert np.abs(made.counter.read(solutions) - expected[-1]).max() < 3 * CLOSE
    assert abs(expected[-1][-1] - expected[-1][0] - 4 * pi) < 1e-9
    # All but the counter, which went on.
    assert_came_back(solutions[0], solutions[-1], 2 * LENGTH, bodies=-1)


@pytest.mark.parametrize("bend", [10, 45, 70])
def test_one_alone(bend):
    a, s = degrees(turns=2, start=START), radians(bend)
    b = uneven(a, cos(s))
    # The same as it is found printed, with turns from the plane of the shafts.
    printed = np.abs(np.sin(b - pi / 2) * cos(s) * np.cos(a - pi / 2) - np.sin(a - pi / 2) * np.cos(b - pi / 2))
    assert printed.max() < 1e-14
    out = b + pi / 2
    made = Shafts(in_plane(bend), (START, out[0]))
    check(made, (a, out))


def double(bends, phase, plane=0.0):
    """Turns of three shafts by the formula, twice, and the shafts; the second bend's plane turned about the middle."""
    a, (s, r) = degrees(turns=2, start=START), np.radians(np.abs(bends))
    directions = in_plane(*bends)
    directions[2] = about(directions[1], directions[2], plane)
    # The second normal is the first one turned by the plane's angle; the other way for a bend back.
    between = plane if bends[0] * bends[1] > 0 else plane + pi
    middle = uneven(a, cos(s)) + pi / 2
    out = uneven(middle + phase - between, cos(r)) + pi / 2
    return (a, middle, out), Shafts(directions, (START, middle[0], out[0]), phase)


@pytest.mark.parametrize(
    ("bends", "plane"), [((30, -30), 0.0), ((30, 30), 0.0), ((50, 50), 0.0), ((40, 40), 1.0), ((40, -40), 2.5)]
)
def test_two_alike_keep_the_speed(bends, plane):
    # Pins of the middle shaft each in the plane of its bend at the same time.
    turns, made = double(bends, plane if bends[0] * bends[1] > 0 else plane + pi, plane)
    constant = turns[2] - turns[0]
    assert np.ptp(constant) < 3e-14  # roundings of angles up to 14
    check(made, turns)


@pytest.mark.parametrize(
    ("bends", "phase", "factor"),
    [
        ((30, -45), 0.0, cos(radians(30)) / cos(radians(45))),
        ((30, 30), pi / 2, cos(radians(30)) ** 2),
        ((20, -50), pi / 2, cos(radians(20)) * cos(radians(50))),
    ],
)
def test_two_that_differ_do_not(bends, phase, factor):
    turns, made = double(bends, phase)
    # Unequal bends divide one factor by the other; a middle shaft mounted a quarter turn wrong multiplies them.
    even = uneven(turns[0], factor)
    off = turns[2] - even
    assert np.ptp(off) < 3e-14 and np.ptp(turns[2] - turns[0]) > 0.1
    check(made, turns)
