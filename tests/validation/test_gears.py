"""Gears: trains, and epicyclic ones by Willis' equation.

Seen from the carrier c a train keeps its ratio: (w_b - w_c) / (w_a - w_c) = e, with e the product of -teeth/teeth over
its meshes outside and +teeth/teeth over those inside a ring.
"""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest

import assembly as asm
from tests.validation.mechanisms import CLOSE, Counter, angles, assert_came_back, drive, planar, positions, shake


def turning(turns, step=9):
    """Values of a drive over whole turns, negative ones backward; no wheel may turn by more than a half in a step."""
    return np.sign(turns) * np.radians(np.arange(0, 360 * abs(turns) + step, step))


def check_turns(solutions, joint, counter, expected, amplified=3):
    """The turn by the poses, up to whole ones, and as the solver counts it."""
    off = angles(solutions, joint, unwrap=False) - expected
    assert np.abs(off - 2 * pi * np.round(off / (2 * pi))).max() < amplified * CLOSE
    assert np.abs(counter.read(solutions) - expected).max() < amplified * CLOSE


class Train:
    """Wheels side by side in outside mesh, modules of 2: radius = teeth."""

    def __init__(self, teeth):
        ground = planar("ground", fixed=True)
        at = np.concatenate([[0], np.cumsum(np.add(teeth[:-1], teeth[1:]))])
        wheels = [planar(f"wheel {k}", (x, 0.0)) for k, x in enumerate(at)]
        self.shafts = [
            asm.Revolute(ground.frame((x, 0, 0)), wheel, f"shaft {wheel.name}")
            for x, wheel in zip(at, wheels, strict=True)
        ]
        pairs = list(zip(self.shafts, self.shafts[1:], teeth, teeth[1:], strict=False))
        self.counters = [Counter(ground, shaft, float(at[-1])) for shaft in self.shafts]
        self.scene = asm.Assembly([ground, *wheels, *(counter.rack for counter in self.counters)])
        self.scene.constrain(*self.shafts, *(asm.Gear(a, b, -m / n) for a, b, m, n in pairs))
        self.scene.constrain(*(row for counter in self.counters for row in counter.constraints))
        shake(wheels, 0.01)


@pytest.mark.parametrize("teeth", [(17, 40), (20, 31, 45), (60, 25, 33, 18, 50)])
def test_train(teeth):
    made = Train(teeth)
    solutions = drive(made.scene, made.shafts[0].freedom(), turning(4))
    for k, (shaft, counter) in enumerate(zip(made.shafts, made.counters, strict=True)):
        # Idlers change the sense, not the ratio.
        check_turns(solutions, shaft, counter, turning(4) * (-1) ** k * teeth[0] / teeth[k])


def test_turning_back_and_whole_periods():
    # 12 : 36 : 18 teeth are all back, quaternions too, after six turns of the first.
    made = Train((12, 36, 18))
    forth = drive(made.scene, made.shafts[0].freedom(), turning(6, 18))
    wheels = slice(0, 4)  # the counters went on
    assert np.abs(forth[-1].q[wheels] - forth[0].q[wheels]).max() < 30 * CLOSE
    back = drive(made.scene, made.shafts[0].freedom(), turning(6, 18)[::-1], forth[-1])
    assert_came_back(forth[0], back[-1], 100.0)


def test_any_wheel_drives():
    made = Train((20, 31, 45))
    solutions = drive(made.scene, made.shafts[2].freedom(), turning(-3))
    for shaft, counter, ratio in zip(made.shafts, made.counters, (45 / 20, -45 / 31, 1), strict=True):
        check_turns(solutions, shaft, counter, turning(-3) * ratio)


def test_offset_of_the_teeth():
    ground, a, b = planar("ground", fixed=True), planar("a"), planar("b", (7.0, 0.0))
    first, second = asm.Revolute(ground, a), asm.Revolute(ground.frame((7, 0, 0)), b)
    scene = asm.Assembly([ground, a, b])
    gear = asm.Gear(first, second, -2.0, offset=0.25)
    scene.constrain(first, second, gear)
    solutions = drive(scene, first.freedom(), turning(1))
    gear.offset = 0.5
    solutions += drive(scene, first.freedom(), turning(1)[::-1], solutions[-1])
    values = np.concatenate([turning(1), turning(1)[::-1]])
    offsets = np.repeat([0.25, 0.5], len(turning(1)))
    assert np.abs(angles(solutions, second) - (offsets - 2.0 * values)).max() < 3 * CLOSE


class Planetary:
    """Sun, ring and arm on one axis, a planet on the arm; the sun and the ring mesh with it as seen from the arm."""

    def __init__(self, sun=30, planet=18, rings=(66,)):
        ground = planar("ground", fixed=True)
        reach = float(sun + planet)
        arm, wheel = planar("arm"), planar("planet", (reach, 0.0))
        self.planet = wheel
        central = [planar("sun"), *(planar(f"ring {teeth}") for teeth in rings)]
        self.arm, self.sun, *self.rings = (asm.Revolute(ground, body, f"on {body.name}") for body in (arm, *central))
        self.pin = asm.Revolute(arm.frame((reach, 0, 0)), wheel, "pin")
        # Turns against the arm: joints that the scene need not hold.
        seen = [asm.Revolute(arm, body, f"{body.name} from the arm") for body in central]
        signs = [-1, *(1 if teeth > sun else -1 for teeth in rings)]
        meshes = [
            asm.Gear(joint, self.pin, sign * teeth / planet)
            for joint, sign, teeth in zip(seen, signs, (sun, *rings), strict=True)
        ]
        self.joints = [self.arm, self.sun, *self.rings]
        self.counters = [Counter(ground, joint, reach) for joint in self.joints]
        self.scene = asm.Assembly([ground, arm, wheel, *central, *(counter.rack for counter in self.counters)])
        self.scene.constrain(*self.joints, self.pin, *meshes)
        self.scene.constrain(*(row for counter in self.counters for row in counter.constraints))
        shake(self.scene.bodies, 0.01)
        self.teeth, self.reach = (sun, planet, *rings), reach

    def follow(self, rates, turns):
        """Two of arm, sun and ring are driven at rates; the third and the planet as Willis says."""
        t = turning(turns)
        e = -self.teeth[0] / self.teeth[2]
        known = dict(zip(("arm", "sun", "ring"), rates, strict=True))
        if known["arm"] is None:
            known["arm"] = (known["ring"] - e * known["sun"]) / (1 - e)
        elif known["sun"] is None:
            known["sun"] = known["arm"] + (known["ring"] - known["arm"]) / e
        else:
            known["ring"] = known["arm"] + e * (known["sun"] - known["arm"])
        driven = [joint for joint, rate in zip(self.joints, rates, strict=True) if rate is not None]
        speeds = [rate for rate in rates if rate is not None]
        solution, solutions = None, []
        for value in t:
            driven[1].angle = float(speeds[1] * value)
            (solution,) = drive(self.scene, driven[0].freedom(), [speeds[0] * value], solution)
            solutions.append(solution)
        for joint, counter, rate in zip(self.joints, self.counters, known.values(), strict=True):
            check_turns(solutions, joint, counter, rate * t)
        arm = known["arm"] * t
        place = positions(solutions, self.planet) / self.reach
        assert np.abs(place - np.column_stack([np.cos(arm), np.sin(arm), 0 * arm])).max() < 3 * CLOSE
        spin = -self.teeth[0] / self.teeth[1] * (known["sun"] - known["arm"])
        off = angles(solutions, self.pin, unwrap=False) - spin * t
        assert np.abs(off - 2 * pi * np.round(off / (2 * pi))).max() < 10 * CLOSE
        return known


@pytest.mark.parametrize(
    ("rates", "expected"),
    [
        ((None, 1.0, 0.0), ("arm", 30 / 96)),  # ring held: the usual reduction, 1 + 66/30
        ((0.0, 1.0, None), ("ring", -30 / 66)),  # arm held: a train with an idler
        ((None, 0.0, 1.0), ("arm", 66 / 96)),  # sun held
        ((1.0, None, 0.0), ("sun", 96 / 30)),  # speeding up
        ((None, 1.0, -30 / 66), ("arm", 0.0)),  # two inputs that leave the arm where it is
        ((0.7, -1.0, None), ("ring", 0.7 + 1.7 * 30 / 66)),  # two inputs
    ],
)
def test_planetary(rates, expected):
    known = Planetary().follow(rates, turns=3)
    assert known[expected[0]] == pytest.approx(expected[1], abs=1e-15)


def test_fergusons_paradox():
    # On one axis three wheels of 99, 100 and 101 teeth that mesh with one planet; the one of 100 is held.
    made = Planetary(sun=100, planet=20, rings=(99, 101))
    for joint in made.rings:
        joint.angle = None
    # Outside meshes all: seen from the arm, the wheel of n turns by 100/n of the held one.
    t = turning(10, 15)
    scene, solutions, solution = made.scene, [], None
    made.sun.angle = 0.0
    signs = (-99, 101)  # as `Planetary` took them: fewer teeth than the sun outside, more as a ring
    for value in t:
        (solution,) = drive(scene, made.arm.freedom(), [value], solution)
        solutions.append(solution)
    for joint, counter, teeth in zip(made.rings, made.counters[2:], signs, strict=True):
        check_turns(solutions, joint, counter, t * (1 + 100 / teeth), amplified=10)


def test_bevel_differential():
    """Two side wheels and a pinion across on the case: twice the case's turn is the sum of the sides'."""
    ground, case, left, right = (asm.Body(name, fixed=name == "ground") for name in ("ground", "case", "left", "right"))
    pinion = asm.Body("pinion", position=(3, 0, 0))
    axle = [asm.Revolute(ground, body, body.name) for body in (case, left, right)]
    pin = asm.Revolute(case.frame((3, 0, 0), (1, 0, 0), (0, 0, 1)), pinion.frame(z=(1, 0, 0), x=(0, 0, 1)), "pin")
    sides = [asm.Revolute(case, body, f"{body.name} from the case") for body in (left, right)]
    scene = asm.Assembly([ground, case, left, right, pinion])
    scene.constrain(*axle, pin, asm.Gear(sides[0], pin, 16 / 10), asm.Gear(sides[1], pin, -16 / 10))
    shake(scene.bodies, 0.01)
    t, solution, solutions = turning(3), None, []
    for value in t:
        axle[1].angle = float(value)
        (solution,) = drive(scene, axle[2].freedom(), [sin(value)], solution)
        solutions.append(solution)
    assert np.abs(angles(solutions, axle[0]) - 0.5 * (t + np.sin(t))).max() < 3 * CLOSE
    assert np.abs(angles(solutions, pin) - 1.6 * 0.5 * (t - np.sin(t))).max() < 3 * CLOSE
    middle = 0.5 * (t[-1] + sin(t[-1]))
    assert np.abs(positions(solutions, pinion)[-1] - [3 * cos(middle), 3 * sin(middle), 0]).max() < 3 * CLOSE
