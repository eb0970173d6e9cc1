"""A six-bar's dexterity over 10,000 designs: which lengths move the tip fast, and which do not press sideways.

A four-bar's rocker drives a second loop, whose floating link has the tip. The lengths of crank and coupler vary over a
grid. For each design two measures are computed: the manipulability of the tip (its speed for a crank that turns at a
rate of one) and the transmission (the sine of the angle between coupler and rocker). The study is first run in another
process, which is killed; what that has finished is in the folder "dexterity_study", and the study continues from there.
Prints the results and writes dexterity_study.html, one of the best designs, and, if matplotlib is installed,
dexterity_study.png: maps of both measures, and the designs on their Pareto front.
"""

from __future__ import annotations

import subprocess
import sys
import time
from functools import partial
from importlib.util import find_spec
from math import cos
from pathlib import Path

import numpy as np

import assembly as asm

FOLDER = "dexterity_study"


def six_bar() -> tuple[asm.Assembly, asm.Parameter, asm.Parameter, asm.Dexterity]:
    """The linkage, the lengths of its crank and its coupler [mm], and what is measured at the tip."""
    ground, crank, coupler = (
        asm.Body("ground", fixed=True),
        asm.Body("crank"),
        asm.Body("coupler", position=(10, 25, 0)),
    )
    rocker, arm = asm.Body("rocker", position=(80, 0, 0)), asm.Body("arm", position=(70, 80, 0))
    link = asm.Body("link", position=(150, 0, 0))
    drive = asm.Revolute(ground, crank, "drive", angle=1.1)
    pin = asm.Revolute(crank.frame(at=(30, 0, 0)), coupler, "pin")
    top = asm.Revolute(coupler.frame(at=(80, 0, 0)), rocker.frame(at=(0, 60, 0)), "top")
    post = asm.Revolute(ground.frame(at=(80, 0, 0)), rocker, "post")
    knee = asm.Revolute(rocker.frame(at=(-20, 90, 0)), arm, "knee")
    wrist = asm.Revolute(arm.frame(at=(90, 0, 0)), link.frame(at=(0, 70, 0)), "wrist")
    foot = asm.Revolute(ground.frame(at=(150, 0, 0)), link, "foot")
    scene = asm.Assembly([ground, crank, coupler, rocker, arm, link])
    scene.constrain(drive, pin, top, post, knee, wrist, foot)
    lengths = (pin.frame_a, "crank"), (top.frame_a, "coupler")
    radius, length = (asm.Parameter(frame, "origin", "x", name=name) for frame, name in lengths)
    return scene, radius, length, asm.Dexterity(arm.point(45, 40, 0), [drive], "manipulability", task="position")


def speed(scene: asm.Assembly, dexterity: asm.Dexterity, solution: asm.Solution) -> float:
    """Of the tip, for a crank that turns at a rate of one [mm]."""
    return asm.dexterity_value(scene, dexterity, solution.q)


def transmission(solution: asm.Solution) -> float:
    """How well the coupler drives the rocker: 1 across, 0 along it."""
    # The arm of the rocker is its y axis, from which the coupler is turned by a right angle less.
    return abs(cos(solution.values["top.angle"]))


def computed(designs: int, progress: bool = False) -> tuple[asm.Study, asm.Assembly]:
    """The study, from where an earlier one ended."""
    scene, radius, length, dexterity = six_bar()
    side = round(designs**0.5)
    plan = asm.grid({radius: np.linspace(15.0, 45.0, side), length: np.linspace(50.0, 120.0, side)})
    of = {"speed": partial(speed, scene, dexterity), "transmission": transmission}
    return asm.study(scene, plan, of, folder=FOLDER, progress=progress, chunk_seconds=0.2), scene


def killed(designs: int) -> int:
    """Begin in another process, and kill it: how many rows it has finished."""
    process = subprocess.Popen([sys.executable, str(Path(__file__).resolve()), str(designs)])
    while process.poll() is None and len(list(Path(FOLDER).glob("part-*"))) < 2:
        time.sleep(0.01)
    process.kill()
    process.wait()
    return sum(len(part.read_text().splitlines()) - 2 for part in Path(FOLDER).glob("part-*"))


def main(designs: int = 10_000) -> tuple[asm.Study, int]:
    finished = killed(designs)
    print(f"killed with {finished} designs finished")
    found, scene = computed(designs, progress=sys.stderr.isatty())
    print(found)
    front = found.pareto(maximize=["speed", "transmission"])
    for row in front[:: max(1, len(front) // 5)]:
        print(
            f"crank {row['crank']:8.4f}   coupler {row['coupler']:8.4f}   "
            f"speed {row['speed']:8.4f} mm   transmission {row['transmission']:.4f}"
        )
    chosen = front[np.argmin(np.abs(front["transmission"] - 0.9))]
    solution = found.solution(int(chosen["row"]))
    asm.view.save_html("dexterity_study.html", scene, solution)
    if find_spec("matplotlib"):
        from matplotlib import pyplot

        figure, axes = pyplot.subplots(1, 3, figsize=(15.0, 4.2), layout="constrained")
        for each, name in zip(axes, found.measures, strict=False):
            found.plot(name, axes=each)
        found.plot("-speed", "-transmission", axes=axes[2])
        figure.savefig("dexterity_study.png", dpi=64)
    return found, finished


if __name__ == "__main__":
    if len(sys.argv) > 1:
        computed(int(sys.argv[1]))
    else:
        main()
