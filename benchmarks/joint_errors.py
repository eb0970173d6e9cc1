"""Run time against error of joints: scattered cubes, each to stand on the one before."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import assembly as asm
from benchmarks import linkages
from benchmarks.drake_boxes import Drake
from benchmarks.figures import figure
from benchmarks.mechanisms import CADQUERY, cadquery_boxes
from benchmarks.pictures import curve

ABOUT = """\
Eight unit cubes from scattered poses, face on face. An error is the largest distance of two centers of faces that
should meet, measured from the poses alone; a line's point is the median of it and of a call over all starts at one
tolerance, from 1e-3 to 1e-14. Gathering the cubes solves this scene to rounding before the loop has a step to make,
whatever the tolerance; "pulled" starts from cubes that are nearly in place, where nothing is gathered. CadQuery
(constraints as summed squares) has no tolerance to set: a point. Drake's inverse kinematics is solved by SNOPT, whose
feasibility tolerances are set; its times are those of `Solve` alone. It is counted as solved where SNOPT says so and
faces are within 1e-6."""

Array = NDArray[np.float64]
TOLERANCES = [10.0**-k for k in range(3, 15)]
COUNT = 8
DRAKE = "Drake SNOPT"


def apart(q: Array) -> float:
    """The largest distance of the center of a top to that of the bottom on it."""
    up = 0.5 * Rotation.from_quat(q[:, 3:], scalar_first=True).as_matrix()[:, :, 2]
    return float(np.linalg.norm((q[:-1, :3] + up[:-1]) - (q[1:, :3] - up[1:]), axis=1).max())


def pulled(scene: asm.Assembly, seed: int) -> Array:
    """Poses a little off a solution."""
    q = scene.solve().q.copy()
    rng = np.random.default_rng(seed)
    q[1:, :3] += 0.02 * rng.normal(size=(len(q) - 1, 3))
    return q


def drake(starts: Sequence[Array], tolerances: Sequence[float]) -> list[tuple[int, float, float]] | None:
    """At each tolerance: how many Drake solves, the median error and the median time; None without Drake."""
    stack = Drake.of(COUNT)
    if stack is None:
        return None
    stack.solve(starts[0], tolerances[0])
    rows = []
    for tolerance in tolerances:
        ends = [stack.solve(start, tolerance) for start in starts]
        errors = [apart(q) for _, _, q in ends]
        solved = sum(said and error <= 1e-6 for (said, _, _), error in zip(ends, errors, strict=True))
        rows.append((solved, statistics.median(errors), statistics.median(seconds for _, seconds, _ in ends)))
    return rows


def run(quick: bool) -> dict[str, Any]:
    """Lines, and figures at the tightest tolerance."""
    seeds = 2 if quick else 10
    tolerances = [1e-4, 1e-14] if quick else TOLERANCES
    scenes = [linkages.boxes(COUNT, seed) for seed in range(seeds)]
    starts: dict[str, list[Array | None]] = {
        "ours, scattered": [None] * seeds,
        "ours, pulled": [pulled(scene, k) for k, scene in enumerate(scenes)],
    }
    lines: dict[str, list[tuple[float, float]] | None] = {}
    solved, scattered = 0, 0
    for name, rows in starts.items():
        line = []
        for tolerance in tolerances:
            errors, seconds = [], []
            for scene, q0 in zip(scenes, rows, strict=True):
                waits = []
                for _ in range(5):
                    begin = perf_counter()
                    solution = scene.solve(q0, tolerance=min(tolerance, 1e-2), stationarity=min(tolerance, 1e-2))
                    waits.append(perf_counter() - begin)
                solved += solution.success
                scattered += solution.success and q0 is None and tolerance == tolerances[-1]
                errors.append(apart(solution.q))
                seconds.append(statistics.median(waits))
            line.append((statistics.median(errors), statistics.median(seconds)))
        lines[name] = line
    theirs = cadquery_boxes(scenes[: 1 if quick else 3])
    lines[CADQUERY] = None
    if theirs is not None:
        lines[CADQUERY] = [(statistics.median(d for _, d in theirs), statistics.median(s for s, _ in theirs))]
    peer = lines[CADQUERY]
    far = drake([scene.q for scene in scenes], tolerances[-1:])
    near = drake([q for q in starts["ours, pulled"] if q is not None], tolerances)
    lines[DRAKE + ", pulled"] = None if near is None else [(error, time) for _, error, time in near]
    of = len(starts) * len(tolerances) * seeds
    worst, last = (line[-1] for name, line in lines.items() if line is not None and name in starts)
    return {
        "about": ABOUT,
        "figures": [
            figure("eight cubes at all tolerances: solved", "count", solved, of=of, reach=of),
            figure(
                "eight cubes at 1e-14: error",
                "error",
                max(worst[0], last[0]),
                reach=1e-12,
                peers={CADQUERY: None if peer is None else peer[0][0]},
            ),
            figure(
                "eight cubes, scattered, at 1e-14: a call",
                "seconds",
                worst[1],
                peers={CADQUERY: None if peer is None else peer[0][1]},
            ),
            figure(
                "eight cubes, scattered, at 1e-14: solved",
                "count",
                scattered,
                of=seeds,
                reach=seeds,
                peers={DRAKE: None if far is None else far[0][0]},
            ),
            figure(
                "eight cubes, pulled, at 1e-14: error",
                "error",
                last[0],
                reach=1e-12,
                peers={DRAKE: None if near is None else near[-1][1]},
            ),
            figure(
                "eight cubes, pulled, at 1e-14: a call",
                "seconds",
                last[1],
                peers={DRAKE: None if near is None else near[-1][2]},
            ),
        ],
        "curves": [curve("Eight cubes on one another", "median distance of faces that meet", "seconds a call", lines)],
    }
