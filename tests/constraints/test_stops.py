"""Joints that stand at a stop and are drawn through it stay there, on whichever side of it rounding puts them."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, inf, pi, remainder, sin

import numpy as np
import pytest

import assembly as asm

KINDS = ("revolute", "cylindrical", "screw", "planar", "universal", "gear", "rack")
PITCH, RATIO, RADIUS = 1.5, 2.0, 0.7
# How far it is drawn beyond a stop.
BEYOND = 0.5
# A stop that is this near takes a force: a start there is returned as it is.
AT_STOP = 1e-9


@dataclass(frozen=True)
class Case:
    """A joint with a stop, below or above, and an angle it starts at."""

    kind: str
    limits: tuple[float | None, float | None]
    stop: float
    start: float

    @property
    def drawn_to(self) -> float:
        """An angle beyond the stop."""
        return self.stop + (-BEYOND if self.stop == self.limits[0] else BEYOND)

    def admits(self, angle: float) -> bool:
        """Whether an angle is within the limits, or beyond a stop by little."""
        low, high = (
            -inf if self.limits[0] is None else self.limits[0],
            inf if self.limits[1] is None else self.limits[1],
        )
        return low - 1e-2 <= angle <= high + 1e-2


def about_z(angle):
    return cos(0.5 * angle), 0.0, 0.0, sin(0.5 * angle)


def hinged(case):
    """A scene with the joint, one that follows it, if it is coupled, and the name of its angle; no objective yet."""
    ground, door = asm.Body("ground", fixed=True), asm.Body("door", quaternion=about_z(case.start))
    scene = asm.Assembly([ground, door])
    if case.kind == "cylindrical":
        scene.constrain(asm.Cylindrical(ground, door, "joint", angle_limits=case.limits))
    elif case.kind == "planar":
        scene.constrain(asm.Planar(ground, door, "joint", x=0.0, y=0.0, angle_limits=case.limits))
    elif case.kind == "screw":
        door.pose = asm.Pose((0, 0, PITCH * case.start / (2.0 * pi)), about_z(case.start))
        scene.constrain(asm.Screw(ground, door, PITCH, "joint", angle_limits=case.limits))
    elif case.kind == "universal":
        arm = door.frame(z=(1, 0, 0), x=(0, 0, 1))
        scene.constrain(asm.Universal(ground, arm, "joint", angle_a_limits=case.limits))
    else:
        hinge = asm.Revolute(ground, door, "joint", limits=case.limits)
        scene.constrain(hinge)
        if case.kind == "gear":
            wheel = scene.add(asm.Body("wheel", quaternion=about_z(RATIO * case.start)))
            axle = asm.Revolute(ground, wheel, "axle")
            scene.constrain(axle, asm.Gear(hinge, axle, RATIO))
        elif case.kind == "rack":
            rack = scene.add(asm.Body("rack", position=(0, 0, RADIUS * case.start)))
            guide = asm.Prismatic(ground, rack, "guide")
            scene.constrain(guide, asm.RackPinion(hinge, guide, RADIUS))
    return scene, door, "joint.angle_a" if case.kind == "universal" else "joint.angle"


def draw(scene, door, case):
    """Draw a point of the door to where it is beyond the stop."""
    height = PITCH * case.drawn_to / (2.0 * pi) if case.kind == "screw" else 0.0
    scene.minimize(asm.PointDistance(door.point(1, 0, 0), target=(cos(case.drawn_to), sin(case.drawn_to), height)))


def held_at(case):
    """The angle where the joint ends, or None where its pose is that of a turn which is nearer to zero."""
    scene, door, name = hinged(case)
    draw(scene, door, case)
    solution = scene.solve()
    assert solution.success, (case, solution.message)
    turns = [remainder(case.start, 2.0 * pi) + 2.0 * pi * k for k in range(-6, 7)]
    # A screw and a rack tell the turn by where they slide.
    told = case.kind in ("screw", "rack")
    nearest = case.start if told else min((turn for turn in turns if case.admits(turn)), key=abs)
    return solution.values[name] if abs(nearest - case.start) < 1e-6 else None


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("off", [0.0, *(sign * 10.0**-k for sign in (1, -1) for k in (17, 15, 12, 9, 6, 3))], ids=str)
@pytest.mark.parametrize("limits", [(0.0, None), (None, 0.0), (1.0, 9.0), (-9.0, -1.0), (-2.0, 2.0)], ids=str)
def test_a_stop_holds(kind, off, limits):
    stop = limits[0] if limits[0] is not None and limits[0] > -9.0 else limits[1]
    angle = held_at(Case(kind, limits, stop, stop + off))
    assert abs(angle - stop) < AT_STOP


def test_random_stops_hold(cases):
    count = cases(140, 2000)
    held = 0
    for seed in range(count):
        rng = np.random.default_rng(seed)
        stop = float(rng.choice([0.0, rng.uniform(-pi, pi), rng.uniform(-9.0, 9.0)]))
        width = float(rng.choice([rng.uniform(0.2, 3.0), rng.uniform(7.0, 15.0)]))
        far = rng.choice([-1.0, 1.0]) * width
        limits = sorted((stop, stop + far), key=float)
        if rng.random() < 0.4:
            limits[limits.index(stop) - 1] = None
        off = float(rng.choice([0.0, *(sign * 10.0**-k for sign in (1, -1) for k in (17, 15, 13, 10, 8, 5, 3))]))
        angle = held_at(Case(KINDS[seed % len(KINDS)], tuple(limits), stop, stop + off))
        if angle is not None:
            assert abs(angle - stop) < AT_STOP, (seed, angle, stop)
            held += 1
    assert held > 0.85 * count


@pytest.mark.parametrize("beyond", [1e-12, 1e-3, 0.0099])
def test_a_joint_a_little_beyond_its_stop_is_brought_back(beyond):
    scene, _, name = hinged(Case("revolute", (0.0, None), 0.0, -beyond))
    solution = scene.solve()
    assert solution.success and abs(solution.values[name]) < 1e-12


def test_a_joint_far_beyond_its_stop_is_on_another_turn():
    scene, _, name = hinged(Case("revolute", (0.0, None), 0.0, -0.02))
    solution = scene.solve()
    assert solution.success and solution.iterations == 0
    assert solution.values[name] == pytest.approx(2.0 * pi - 0.02, abs=1e-14)


def test_of_turns_that_are_beyond_limits_the_least_one_counts():
    # 2.5 is 0.5 beyond the upper limit, a turn less by 4.8 beyond the lower one.
    scene, _, name = hinged(Case("revolute", (1.0, 2.0), 2.0, 2.5))
    solution = scene.solve()
    assert solution.success and abs(solution.values[name] - 2.0) < 1e-12
    # -2.5 is nearer to the lower limit, whichever turn the middle of the limits is on.
    scene, _, name = hinged(Case("revolute", (-2.0, 2.2), -2.0, -2.5))
    solution = scene.solve()
    assert solution.success and abs(solution.values[name] + 2.0) < 1e-12


@pytest.mark.parametrize("limits", [(-pi, 5.0), (-5.0, pi)], ids=str)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_half_a_turn_is_at_the_stop(limits, sign):
    # Rounding says of half a turn which way it goes.
    stop = -pi if limits[0] == -pi else pi
    angle = held_at(Case("revolute", limits, stop, sign * pi))
    assert angle is None or abs(angle - stop) < 1e-12


def test_limits_of_a_geared_wheel_say_on_which_turn_both_are():
    # The wheel is at 10 where the hinge is at 5: poses tell 5 - 2 pi and 10 - 4 pi.
    ground, door, wheel = asm.Body("ground", fixed=True), asm.Body("door"), asm.Body("wheel")
    door.pose, wheel.pose = asm.Pose((0, 0, 0), about_z(5.0)), asm.Pose((0, 0, 0), about_z(10.0))
    hinge, axle = asm.Revolute(ground, door, "hinge"), asm.Revolute(ground, wheel, "axle", limits=(9.0, 14.0))
    scene = asm.Assembly([ground, door, wheel])
    scene.constrain(hinge, axle, asm.Gear(hinge, axle, 2.0))
    solution = scene.solve()
    assert solution.success and solution.iterations == 0
    assert solution.values["hinge.angle"] == pytest.approx(5.0, abs=1e-14)
    assert solution.values["axle.angle"] == pytest.approx(10.0, abs=1e-14)


def test_a_joint_that_was_driven_to_its_stop_stays_when_it_is_freed():
    case = Case("revolute", (0.0, None), 0.0, 0.8)
    scene, door, name = hinged(Case("revolute", (0.0, None), 0.0, 0.8))
    hinge = scene.constraints[0]
    hinge.angle, hinge.limits = 0.0, None
    driven = scene.solve()
    hinge.angle, hinge.limits = None, (0.0, None)
    draw(scene, door, case)
    freed = scene.solve(driven.q)
    assert freed.success and abs(freed.values[name]) < 1e-12
    again = scene.solve(freed)
    assert again.success and abs(again.values[name]) < 1e-12


@pytest.mark.parametrize("off", [0.0, -1e-17, 1e-9, -1e-9, -1e-3])
def test_a_stop_holds_what_is_tracked(off):
    case = Case("revolute", (0.0, None), 0.0, off)
    scene, door, _ = hinged(case)
    tracker = scene.tracker(door.point(1, 0, 0))
    for _ in range(20):
        tracker.step((cos(case.drawn_to), sin(case.drawn_to), 0.0))
    assert abs(2.0 * np.arctan2(tracker.q[1, 6], tracker.q[1, 3])) < 1e-9
