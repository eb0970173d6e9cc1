"""Numbers of a scene that are set anew, against scenes that are built anew; and derivatives of solutions by them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

import assembly as asm
from assembly.constraints.model.joint import Joint
from benchmarks import linkages
from benchmarks.figures import figure
from benchmarks.mechanisms import clips
from benchmarks.timing import compare

ABOUT = """\
A sample of a tolerance stack, or a step of an optimizer: a number is set and the scene solved from the solution before,
against the scene built, packed and solved with the number. The four-bar has no shapes, so that its longest link is its
size, by which all is divided: then all numbers are written. Derivatives are those of three measures by all parameters
of one solution, over the number of parameters; a warm solve is one after a step, of a degree or of a thousandth of the
scene's size. Three clips are drawn by a frame each, with least gaps of their contacts."""
# A scene, its numbers as `Parameter` takes them, and what is measured as `Measure` takes it.
Scene = tuple[asm.Assembly, list[tuple[Any, ...]], list[tuple[Any, ...]]]
# Of the four-bar's numbers the crank's angle, a place on the crank, and the length of the ground, which is its size.
ANGLE, PLACE, SIZE = 0, 15, 37
# Of the clips' numbers the first coordinate of a target, and a least gap.
TARGET, GAP = 0, 18


def four_bar() -> Scene:
    """The spatial four-bar; its crank's angle, and places and turns of all its frames."""
    scene, hinge = linkages.four_bar()
    joints = [joint for joint in scene.constraints if isinstance(joint, Joint)]
    frames = [frame for joint in joints for frame in (joint.frame_a, joint.frame_b)]
    numbers: list[tuple[Any, ...]] = [(hinge, "angle")]
    numbers += [(frame, field, axis) for frame in frames for field in ("origin", "turn") for axis in "xyz"]
    place = scene.body("coupler").point(1.5, 0.4, 0.2)
    return scene, numbers, [(place, axis) for axis in "xyz"]


def three_clips() -> Scene:
    """Three paper clips, two of which are drawn by a frame; places of targets, numbers of frames, least gaps."""
    scene = clips()
    drawn = asm.Assembly(scene.bodies)
    drawn.constrain(*scene.constraints)
    _, green, blue = scene.bodies
    goals = [
        asm.FrameDistance(blue.frame((0, 0, -15)), asm.Pose(np.array([12.0, 4.0, -40.0]), blue.pose.quaternion)),
        asm.FrameDistance(green, green.pose, weight=0.1),
    ]
    drawn.minimize(*goals)
    numbers: list[tuple[Any, ...]] = [(goal, "target", axis) for goal in goals for axis in "xyz"]
    numbers += [(goal.frame, field, axis) for field in ("origin", "turn") for goal in goals for axis in "xyz"]
    numbers += [(contact, "minimum") for contact in scene.constraints]
    return drawn, numbers, [(blue, axis) for axis in "xyz"]


def set_and_solve(made: Callable[[], Scene], number: int, step: float) -> tuple[Callable[[], Any], Callable[[], Any]]:
    """A number set to and fro and the scene solved from its solution; and the scene made and solved with the number."""
    scene, numbers, _ = made()
    parameter = asm.Parameter(*numbers[number])
    solution, value, calls = scene.solve(), parameter.value, [0]

    def in_place() -> asm.Solution:
        calls[0] += 1
        parameter.value = value + step * (calls[0] % 2)
        return scene.solve(solution)

    def built() -> asm.Solution:
        other, others, _ = made()
        asm.Parameter(*others[number]).value = value + step
        return other.solve()

    assert in_place().success and built().success
    return in_place, built


def changes(what: str, made: Callable[[], Scene], number: int, step: float, repeats: int) -> list[dict[str, Any]]:
    """Seconds of both, and their ratio."""
    in_place, built = set_and_solve(made, number, step)
    rows = compare({"in place": in_place, "built": built}, repeats=repeats)
    seconds = [row["seconds"] for row in rows]
    return [
        figure(f"{what}: set and solved", "seconds", seconds[0], peers={"built and solved": seconds[1]}),
        figure(f"{what}: over built and solved", "ratio", seconds[0] / seconds[1], reach=0.02),
    ]


def slopes(
    what: str, made: Callable[[], Scene], number: int, step: float, counts: tuple[int, ...], repeats: int
) -> list[dict[str, Any]]:
    """Seconds of derivatives a parameter, and over those of a warm solve after a step of a parameter."""
    scene, numbers, of = made()
    parameters, measures = [asm.Parameter(*each) for each in numbers], [asm.Measure(*each) for each in of]
    value, calls = parameters[number].value, [0]
    solution = scene.solve()
    found = []

    def warm() -> asm.Solution:
        calls[0] += 1
        parameters[number].value = value + step * (calls[0] % 2)
        return scene.solve(solution)

    for count in counts:
        parameters[number].value = value
        here = scene.solve(solution)
        own = parameters[:count]
        (derived,) = compare({"d": lambda: asm.sensitivity(scene, here, measures, own)}, repeats=repeats)  # noqa: B023
        (solved,) = compare({"s": warm}, repeats=repeats)
        each = derived["seconds"] / count
        found += [
            figure(f"{what}: derivatives by {count} parameters, each", "seconds", each),
            figure(
                f"{what}: derivatives by {count} parameters, each over a warm solve",
                "ratio",
                each / solved["seconds"],
                reach=0.1,
            ),
        ]
    return [*found, figure(f"{what}: a warm solve after a step", "seconds", solved["seconds"])]


def slider_crank() -> float:
    """How far derivatives of the slider-crank are off its closed form: crank 2, rod 5, angle 0.7."""
    ground, crank, rod = asm.Body("ground", fixed=True), asm.Body("crank"), asm.Body("rod", position=(1.5, 1.3, 0))
    piston = asm.Body("piston", position=(6, 0, 0))
    hinge = asm.Revolute(ground, crank, "hinge", angle=0.7)
    pin = asm.Revolute(crank.frame(at=(2, 0, 0)), rod, "pin")
    wrist = asm.Revolute(rod.frame(at=(5, 0, 0)), piston, "wrist")
    guide = asm.Prismatic(ground.frame(z=(1, 0, 0)), piston.frame(z=(1, 0, 0)), "guide")
    scene = asm.Assembly([ground, crank, rod, piston])
    scene.constrain(hinge, pin, wrist, guide)
    parameters = [asm.Parameter(hinge, "angle"), *(asm.Parameter(j.frame_a, "origin", "x") for j in (pin, wrist))]
    derived = asm.sensitivity(scene, scene.solve(stationarity=1e-13), asm.Measure(guide), parameters)
    rod_cosine = math.sqrt(25.0 - (2.0 * math.sin(0.7)) ** 2) / 5.0
    sine, cosine = math.sin(0.7), math.cos(0.7)
    lean = 2.0 * sine / (5.0 * rod_cosine)
    exact = [-2.0 * sine - 2.0 * cosine * lean, cosine - sine * lean, 1.0 / rod_cosine]
    return float(np.abs(derived.matrix[0] - exact).max())


def run(quick: bool) -> dict[str, Any]:
    """Times, ratios, and one deviation."""
    repeats = 5 if quick else 25
    return {
        "about": ABOUT,
        "figures": [
            *changes("four-bar, the crank's angle", four_bar, ANGLE, 1e-3, repeats),
            *changes("four-bar, a place of a frame", four_bar, PLACE, 1e-3, repeats),
            *changes("four-bar, its longest link", four_bar, SIZE, 1e-3, repeats),
            *changes("three clips, a target", three_clips, TARGET, 1e-2, repeats),
            *changes("three clips, a least gap", three_clips, GAP, 1e-2, repeats),
            *slopes("four-bar", four_bar, ANGLE, math.radians(1.0), (13, 49), repeats),
            *slopes("three clips", three_clips, TARGET, 5e-2, (12, 21), repeats),
            figure("slider-crank: derivatives against the closed form", "error", slider_crank(), reach=1e-12),
        ],
    }
