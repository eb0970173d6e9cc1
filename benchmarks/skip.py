"""What a scene does not need costs nothing: times with an idle part over those without it, imports, memory."""

from __future__ import annotations

import json
import math
import os
import statistics
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

import assembly as asm
from benchmarks.figures import figure
from benchmarks.laws import deviation
from benchmarks.mechanisms import clips, nearest_pairs
from benchmarks.running import EXAMPLES, example

ABOUT = """\
Solves: time of the paper clips' solve with contacts given, over that without the part, which changes neither poses nor
iterations. Groups: the clips twice over, far from each other and without anything that ties them, over twice the time
of one. Ticks: following a hand that goes around a circle of 0.3 mm, with a clearance among all, with a fourth wire far
away over without it. Evaluation: 10,000 points alone, over points with first and second derivatives. Imports and
examples: whole processes, their largest memory as the system counts it; examples that need what is not installed
are left out."""

Array = NDArray[np.float64]
# Modules that come into being at first use.
HEAVY = ("numba", "casadi", "meshcat", "scipy", "matplotlib", "OCP")
CODE = """\
import json, resource, sys, time
begin = time.perf_counter()
{code}
seconds = time.perf_counter() - begin
loaded = [name for name in {heavy} if name in sys.modules]
print()
print(json.dumps([seconds, 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, loaded]))
"""
RUN = "import runpy; sys.argv = [{path!r}]; runpy.run_path({path!r}, run_name='__main__')"
# What an example needs besides the core.
NEEDS = {"cluster_study.py": "distributed", "step_assembly.py": "OCP", "urdf_arm.py": "yourdfpy"}


def _idle_parts() -> dict[str, Callable[[asm.Assembly], object]]:
    """What may be in a scene and has nothing to say."""

    def limit(scene: asm.Assembly) -> None:
        scene.constrain(asm.Distance(scene.body("red"), scene.body("blue"), limits=(None, 1e3), name="leash"))

    def angle(scene: asm.Assembly) -> None:
        scene.constrain(asm.Angle(scene.body("red"), scene.body("blue"), limits=(None, 3.1), name="fan"))

    def walls(count: int, scene: asm.Assembly) -> None:
        for k in range(count):
            scene.add(asm.Body(f"wall {k}", asm.shapes.box(5, 5, 5), (40 + 10 * k, 0, 0), fixed=True))

    return {
        "nothing (what noise does)": lambda scene: None,
        "a far limit of a distance": limit,
        "a far limit of an angle": angle,
        "a fixed body": partial(walls, 1),
        "ten fixed bodies": partial(walls, 10),
    }


def _taken(scene: asm.Assembly, starts: dict[str, Array]) -> tuple[float, float]:
    """Seconds of a call, and of the loop in it."""
    begin = perf_counter()
    solution = scene.solve(starts=starts)
    return perf_counter() - begin, solution.seconds


def _solves(quick: bool) -> list[dict[str, Any]]:
    """Times of a solve with parts that do nothing, over those without, one call of each in turn."""
    figures = []
    for name, add in _idle_parts().items():
        ratios = []
        same = True
        # Several instances: where their arrays lie in memory costs more than what is looked for.
        for _ in range(1 if quick else 8):
            bare, other = clips(), clips()
            add(other)
            starts = nearest_pairs(bare)
            a, b = bare.solve(starts=starts), other.solve(starts=starts)
            same = same and a.success and b.success and a.iterations == b.iterations
            same = same and deviation(a.q, b.q[: len(a.q)]) < 1e-12 * bare.packed().scale
            for _ in range(20 if quick else 250):
                with_it, without = _taken(other, starts), _taken(bare, starts)
                ratios.append([with_it[0] / without[0], with_it[1] / without[1]])
        call, kernel = np.median(ratios, axis=0).tolist() if same else (math.inf, math.inf)
        figures += [
            figure(f"idle: {name}, a call", "ratio", call, reach=1.05),
            figure(f"idle: {name}, in the kernel", "ratio", kernel, reach=1.05),
        ]
    return figures


def _groups(quick: bool) -> list[dict[str, Any]]:
    """Two groups that nothing ties."""
    one, both = clips(), clips()
    copies = {}
    for body in clips().bodies:
        faces = [part.face for part in body.faces]
        copies[body.name] = both.add(
            asm.Body(f"other {body.name}", faces, body.q[:3] + (500.0, 0.0, 0.0), body.q[3:], fixed=body.fixed)
        )
    for contact in one.constraints:
        a, b = (copies[body.name] for body in contact.bodies)
        both.constrain(asm.Contact(a, b, f"other {contact.name}"))
    starts = nearest_pairs(one)
    doubled = nearest_pairs(both)
    ratios = []
    for _ in range(20 if quick else 500):
        ratios.append(_taken(both, doubled)[1] / (2.0 * _taken(one, starts)[1]))
    return [figure("groups: two of them over twice one, in the kernel", "ratio", float(np.median(ratios)), reach=1.05)]


def _ticks(quick: bool) -> list[dict[str, Any]]:
    """A tick with a body far away that has a clearance to all others."""
    module = example("follow_the_hand")
    trackers = []
    for far in (False, True):
        chain = module.paper_clips()
        if far:
            wire = asm.Body("far", asm.shapes.torus(5.0, 0.5), (500.0, 0.0, 0.0), fixed=True)
            chain.add(wire)
        trackers.append(chain.tracker(follow=chain.body("blue").point(*module.END)))
    begin = asm.Pose(trackers[0].q[2, :3], trackers[0].q[2, 3:]).apply(module.END)
    seconds = np.empty((50 if quick else 5_000, 2))
    for k in range(len(seconds)):
        angle = 4e-3 * np.pi * k
        target = begin + 0.3 * np.array([np.cos(angle) - 1.0, np.sin(angle), 0.0])
        for i, tracker in enumerate(trackers):
            start = perf_counter()
            tracker.step(target)
            seconds[k, i] = perf_counter() - start
    ratio = float(np.median(seconds[:, 1] / seconds[:, 0]))
    return [figure("ticks: a wire far away, a call", "ratio", ratio, reach=1.05)]


def _orders(quick: bool) -> list[dict[str, Any]]:
    """Points without derivatives."""
    surface = asm.shapes.torus(1.0, 0.3)
    (_, u), (_, v) = surface.domain
    at = np.random.default_rng(1).uniform(0.0, 1.0, (2, 10_000)) * np.array([[u], [v]])
    ratios = []
    for _ in range(5 if quick else 50):
        spent = []
        for order in (0, 2):
            begin = perf_counter()
            surface.evaluate(at[0], at[1], order)
            spent.append(perf_counter() - begin)
        ratios.append(spent[0] / spent[1])
    return [figure("evaluation: points alone, over order 2", "ratio", statistics.median(ratios))]


def process(code: str) -> tuple[float, float, list[str]]:
    """Seconds, bytes and heavy modules of a fresh interpreter that ran the code."""
    whole = CODE.format(code=code, heavy=HEAVY)
    root = str(EXAMPLES.parent)
    variables = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([root, *os.environ.get("PYTHONPATH", "").split(os.pathsep)]),
    }
    with TemporaryDirectory() as folder:  # where examples leave their pages
        done = subprocess.run(
            [sys.executable, "-c", whole], check=True, capture_output=True, text=True, env=variables, cwd=folder
        )
    seconds, memory, loaded = json.loads(done.stdout.splitlines()[-1])
    return seconds, memory, loaded


def _processes(quick: bool) -> list[dict[str, Any]]:
    bare = process("pass")
    alone = [process("import assembly") for _ in range(1 if quick else 9)]
    figures = [
        figure("`import assembly`", "seconds", statistics.median(row[0] for row in alone)),
        figure("`import assembly`: heavy modules it leaves alone", "count", len(HEAVY) - len(alone[0][2]),
               of=len(HEAVY), reach=len(HEAVY)),
        figure("`import assembly`: memory over a bare interpreter's", "ratio", alone[0][1] / bare[1]),
    ]  # fmt: skip
    for path in sorted(EXAMPLES.glob("*.py"))[: 1 if quick else None]:
        if path.name in NEEDS and find_spec(NEEDS[path.name]) is None:
            continue
        seconds, memory, _loaded = process(RUN.format(path=str(path)))
        figures.append(figure(f"examples/{path.name}, kernels compiled before", "seconds", seconds))
        figures.append(figure(f"examples/{path.name}: memory, MB", "ratio", memory / 1e6))
    return figures


def run(quick: bool) -> dict[str, Any]:
    """Ratios, seconds and bytes."""
    return {
        "about": ABOUT,
        "figures": [*_solves(quick), *_groups(quick), *_ticks(quick), *_orders(quick), *_processes(quick)],
    }
