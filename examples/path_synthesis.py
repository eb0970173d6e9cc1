"""A four-bar whose coupler passes through given places, one at each of eight angles of the crank.

They are those of a known mechanism, which is found again, with exact derivatives, from lengths a tenth off. Writes
path_synthesis.html, and path_synthesis.png where matplotlib is installed: the pen's path before (dashed) and after.
"""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np

import assembly as asm

GROUND, CRANK, COUPLER, ROCKER, PEN = 4.0, 1.0, 3.5, 3.0, (1.8, 1.2)
ANGLES, OFF = np.linspace(0.3, 5.5, 8), (1.1, 0.9, 1.1, 0.9, 1.1, 0.9)


def four_bar() -> tuple[asm.Assembly, asm.Parameter, list[asm.Measure], dict[asm.Parameter, float]]:
    ground, crank, pen = asm.Body("ground", fixed=True), asm.Body("crank"), asm.Body("pen", asm.shapes.sphere(0.1))
    coupler = asm.Body("coupler", position=(1, 0.3, 0), quaternion=(np.cos(0.4), 0, 0, np.sin(0.4)))
    rocker = asm.Body("rocker", position=(4, 0, 0), quaternion=(np.cos(0.9), 0, 0, np.sin(0.9)))
    drive = asm.Revolute(ground, crank, "drive", angle=ANGLES[0])
    pin = asm.Revolute(crank.frame(at=(CRANK, 0, 0)), coupler, "pin")
    joint = asm.Revolute(coupler.frame(at=(COUPLER, 0, 0)), rocker.frame(at=(ROCKER, 0, 0)), "joint")
    pivot = asm.Revolute(ground.frame(at=(GROUND, 0, 0)), rocker, "pivot")
    grip = asm.Fixed(coupler.frame(at=(*PEN, 0)), pen, "grip")
    scene = asm.Assembly([ground, crank, coupler, rocker, pen])
    scene.constrain(drive, pin, joint, pivot, grip)
    frames = [pivot.frame_a, pin.frame_a, joint.frame_a, joint.frame_b, grip.frame_a, grip.frame_a]
    numbers = zip(frames, "xxxxxy", ("ground", "crank", "coupler", "rocker", "pen x", "pen y"), strict=True)
    dimensions = [asm.Parameter(frame, "origin", axis, name=name) for frame, axis, name in numbers]
    place = [asm.Measure(pen, axis, name=axis) for axis in "xy"]
    return scene, asm.Parameter(drive, "angle"), place, {each: each.value for each in dimensions}


def main() -> tuple[asm.Synthesis, list[float]]:
    scene, angle, place, known = four_bar()
    given = asm.study(scene, asm.grid({angle: ANGLES}), place)
    stations = [asm.Station({angle: ANGLES[k]}, {each: given[each.name][k] for each in place}) for k in range(8)]
    for dimension, off in zip(known, OFF, strict=True):
        dimension.value *= off
    around = asm.grid({angle: np.linspace(0.0, 2.0 * np.pi, 145)})
    before = asm.study(scene, around, place)
    found = asm.synthesize(scene, stations, {r: (0.5 * value, 2.0 * value) for r, value in known.items()}, apply=True)
    print(found, f"farthest from what is known: {np.abs(found.values - list(known.values())).max():.1e}", sep="\n")
    asm.view.save_html("path_synthesis.html", scene, scene.solve())
    if find_spec("matplotlib"):
        from matplotlib import pyplot

        for path, line in ((before, "--"), (asm.study(scene, around, place), "-"), (given, "o")):
            pyplot.plot(path["x"], path["y"], line)
        pyplot.axis("equal")
        pyplot.savefig("path_synthesis.png", dpi=80)
    return found, list(known.values())


if __name__ == "__main__":
    main()
