"""Batches: designs of a four-bar in compiled calls, against solves one by one, on one thread and on two."""

from __future__ import annotations

import os
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

import assembly as asm
from benchmarks import linkages
from benchmarks.figures import figure

ABOUT = """\
Designs: the spatial four-bar with the length of its crank, the place of its cross and its drive drawn at random (seed
0), all from one solution; near: within 5 percent, the drive as it is. One by one: numbers set in place and the scene
solved. Threads: the same rows on two threads and two cores, where there are two, over one; least of several runs in
turn, and on a busy machine no better than what others leave."""

Array = NDArray[np.float64]


def designs(scene: asm.Assembly, drive: asm.Revolute, count: int, near: bool) -> dict[asm.Parameter, Array]:
    """Parameters, and a value of each for every row."""
    rng = np.random.default_rng(0)
    ball, cross = scene.constraints[1], scene.constraints[2]
    assert isinstance(ball, asm.Spherical) and isinstance(cross, asm.Universal)
    crank, rocker = (0.95, 1.05) if near else (0.8, 1.1), (1.9, 2.1) if near else (1.8, 2.3)
    columns = {
        asm.Parameter(ball.frame_a, "origin", "x"): rng.uniform(*crank, count),
        asm.Parameter(cross.frame_b, "origin", "y"): rng.uniform(*rocker, count),
    }
    if not near:
        columns[asm.Parameter(drive, "angle")] = rng.uniform(0.0, 6.0, count)
    return columns


def _least(scene: asm.Assembly, start: asm.Solution, columns: dict[asm.Parameter, Array], repeats: int) -> list[float]:
    """Seconds of the rows on one thread and on two, the least of some repeats in turn."""
    least = [np.inf, np.inf]
    for _ in range(repeats):
        for k in range(2):
            begin = perf_counter()
            scene.solve_many(start, parameters=columns, threads=k + 1)
            least[k] = min(least[k], perf_counter() - begin)
    return least


def run(quick: bool) -> dict[str, Any]:
    """Time rows of designs."""
    count, repeats = (1000, 2) if quick else (10_000, 7)
    figures = []
    for near in (True, False):
        scene, drive = linkages.four_bar()
        start = scene.solve()
        columns = designs(scene, drive, count, near)
        what = f"{count:,} four-bars {'nearby' if near else 'anywhere'}"
        batch = scene.solve_many(start, parameters=columns, threads=1)
        figures.append(figure(f"{what}: solved", "count", int(batch.success.sum()), of=count, reach=count))
        seconds = _least(scene, start, columns, repeats)[0] / count
        figures.append(figure(f"{what}: a design, one thread", "seconds", seconds, reach=60e-6))
        begin = perf_counter()
        worst = 0.0
        for k in range(100):
            for item, values in columns.items():
                item.value = float(values[k])
            worst = max(worst, float(np.abs(scene.solve(start).q - batch.q[k]).max()))
        figures.append(figure(f"{what}: a design one by one", "seconds", (perf_counter() - begin) / 100))
        figures.append(figure(f"{what}: poses of rows against one by one", "error", worst, reach=1e-12))
    if hasattr(os, "sched_setaffinity"):
        mine = os.sched_getaffinity(0)
        try:
            os.sched_setaffinity(0, range(os.cpu_count() or 1))
            if len(os.sched_getaffinity(0)) > 1:
                one, two = _least(scene, start, columns, repeats)
                figures.append(figure(f"{what}: two threads over one", "ratio", two / one, reach=1.0 / 1.8))
        finally:
            os.sched_setaffinity(0, mine)
    return {"about": ABOUT, "figures": figures}
