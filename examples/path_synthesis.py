"""A four-bar whose coupler passes through given places, one at each of eight angles of the crank.

The places are those of a known mechanism, so that the result can be checked: the synthesis starts with lengths that are
off by a tenth, and changes them, with exact derivatives of solutions, until the pen is at the places. Prints the
lengths found beside the known ones, and how often the eight stations were solved. Writes path_synthesis.html: the
mechanism found.
"""

from __future__ import annotations

import numpy as np

import assembly as asm

GROUND, CRANK, COUPLER, ROCKER, PEN = 4.0, 1.0, 3.5, 3.0, (1.8, 1.2)
ANGLES = np.linspace(0.3, 5.5, 8)


def four_bar() -> tuple[asm.Assembly, asm.Revolute, asm.Body, dict[asm.Parameter, float]]:
    """The scene, its driven hinge, the pen, and its dimensions with their known values."""
    ground, crank = asm.Body("ground", fixed=True), asm.Body("crank")
    coupler, rocker = asm.Body("coupler", position=(1, 0.3, 0)), asm.Body("rocker", position=(4, 0, 0))
    coupler.pose = asm.Pose((1, 0.3, 0), (np.cos(0.4), 0, 0, np.sin(0.4)))
    rocker.pose = asm.Pose((4, 0, 0), (np.cos(0.9), 0, 0, np.sin(0.9)))
    pen = asm.Body("pen", asm.shapes.sphere(0.1), position=(2, 1.5, 0))
    drive = asm.Revolute(ground, crank, "drive", angle=ANGLES[0])
    pin = asm.Revolute(crank.frame(at=(CRANK, 0, 0)), coupler, "pin")
    joint = asm.Revolute(coupler.frame(at=(COUPLER, 0, 0)), rocker.frame(at=(ROCKER, 0, 0)), "joint")
    pivot = asm.Revolute(ground.frame(at=(GROUND, 0, 0)), rocker, "pivot")
    grip = asm.Fixed(coupler.frame(at=(*PEN, 0)), pen, "grip")
    scene = asm.Assembly([ground, crank, coupler, rocker, pen])
    scene.constrain(drive, pin, joint, pivot, grip)
    frames = [(pivot.frame_a, "x"), (pin.frame_a, "x"), (joint.frame_a, "x"), (joint.frame_b, "x")]
    frames += [(grip.frame_a, "x"), (grip.frame_a, "y")]
    names = ("ground", "crank", "coupler", "rocker", "pen x", "pen y")
    dimensions = [asm.Parameter(frame, "origin", axis, name=n) for (frame, axis), n in zip(frames, names, strict=True)]
    return scene, drive, pen, {dimension: dimension.value for dimension in dimensions}


def main() -> tuple[asm.Synthesis, list[float]]:
    scene, drive, pen, known = four_bar()
    angle, x, y = asm.Parameter(drive, "angle"), asm.Measure(pen, "x"), asm.Measure(pen, "y")
    stations, solution = [], None
    for value in ANGLES:
        drive.angle = value
        solution = scene.solve(solution)
        stations.append(asm.Station({angle: value}, {x: x.value(solution), y: y.value(solution)}))
    drive.angle = ANGLES[0]
    for dimension, off in zip(known, (1.1, 0.9, 1.1, 0.9, 1.1, 0.9), strict=True):
        dimension.value *= off
    found = asm.synthesize(scene, stations, {r: (0.5 * value, 2.0 * value) for r, value in known.items()}, apply=True)
    print(found)
    print(f"farthest from what is known: {max(abs(found.found[r] - value) for r, value in known.items()):.1e}")
    asm.view.save_html("path_synthesis.html", scene, scene.solve())
    return found, list(known.values())


if __name__ == "__main__":
    main()
