"""Mechanisms: one warm step, boxes on one another, freedoms, dexterity, contradictions, and what idle parts cost."""

from __future__ import annotations

import json
import math
import os
import statistics
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.constraints.model.dexterity import MEASURES
from assembly.kinematics.frame import Point
from benchmarks import linkages
from benchmarks.figures import figure
from benchmarks.laws import OFFSETS, SLOPE, deviation
from benchmarks.pictures import exponent
from benchmarks.running import example

ABOUT = """\
Four-bar: hinge, ball, universal joint, hinge; the crank is moved on by 1 degree and the solve continues from the
solution before, over whole turns. A call is what Python waits for `scene.solve`, a kernel the compiled loop in it.
Boxes: unit cubes from scattered poses, each to stand on the one before; CadQuery solves the same with "Plane"
constraints, in an interpreter of its own; largest violations are over the size, its distances of centers of faces in
edges. Without loops, gathering the scattered boxes solves the scene, and the loop has no step to make. Exponents are
those of a power of N fitted to the medians.
Freedoms: the linkage at the scales 1e-6, 1 and 1e6, parallelograms of 1 to N cells folded flat; right are degrees of
freedom, redundant sets and singular poses, all three. Dexterity: a drive's multiplier is the slope of the objective in
its value, through closed loops as well, here against central differences of sixth order of `dexterity_value` over poses
that are solved again, relative to the largest slope. Contradictions: polygons of rods of which one is too
long, drives, stops and gears that do not fit, goals out of reach, rings of three hinges; of each the only set that
conflicts is known. Reference: the largest difference of a component of q, over the scene's size where that is above
one; of paper clips drawn to nothing, by least moves (`Posture`), as a target in reach leaves them free to slide."""

Array = NDArray[np.float64]
CADQUERY = "CadQuery"
# The interpreter that has CadQuery, where it is not this one: it does not go with other versions of OCCT.
CADQUERY_PYTHON = "CADQUERY_PYTHON"
# Of drives [rad]: at arms near singular poses differences over longer steps are off, and rounding is at shorter ones.
STEP = 1e-3


def four_bar(turns: int) -> list[dict[str, Any]]:
    """Warm steps of a degree."""
    scene, crank = linkages.four_bar()
    assert crank.angle is not None
    first = previous = scene.solve()
    calls, path = [], []
    for _ in range(360 * turns):
        crank.angle += math.radians(1.0)
        begin = perf_counter()
        previous = scene.solve(previous)
        calls.append(perf_counter() - begin)
        path.append(previous)
    # Read afterwards, so that reading does not empty the caches.
    solved = [one for one in path if one.success]
    worst = max((one.feasibility for one in solved), default=math.nan)
    back = deviation(first.q, path[-1].q)
    what = "four-bar, a warm step of 1 degree"
    return [
        figure(f"{what}: solved", "count", len(solved), of=len(path), reach=len(path)),
        figure(f"{what}: largest violation of the solved", "error", worst, reach=1e-12),
        figure(f"{what}: pose after {turns} turns against the first one", "error", back, reach=1e-10),
        figure(f"{what}: a call", "seconds", statistics.median(calls), reach=10e-6),
        figure(f"{what}: in the kernel", "seconds", statistics.median(one.seconds for one in path)),
        figure(f"{what}: iterations, mean", "ratio", statistics.mean(one.iterations for one in path)),
    ]


def cadquery_boxes(chains: list[asm.Assembly]) -> list[list[float]] | None:
    """Seconds and distances left by CadQuery, a pair a chain; None where it is not installed."""
    starts = []
    for scene in chains:
        vectors = Rotation.from_quat(scene.q[:, 3:], scalar_first=True).as_rotvec()
        turns = np.linalg.norm(vectors, axis=1)
        axes = np.where(turns[:, None] > 0.0, vectors, (0, 0, 1)) / np.where(turns > 0.0, turns, 1.0)[:, None]
        rows = zip(scene.q[:, :3].tolist(), axes.tolist(), np.degrees(turns).tolist(), strict=True)
        starts.append([list(row) for row in rows])
    python = os.environ.get(CADQUERY_PYTHON)
    environment = {key: value for key, value in os.environ.items() if python is None or key != "PYTHONPATH"}
    script = Path(__file__).with_name("cadquery_boxes.py")
    done = subprocess.run(
        [python or sys.executable, str(script)],
        input=json.dumps(starts),
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    found = json.loads(done.stdout.splitlines()[-1])
    return None if found is None else found["chains"]


def boxes(quick: bool) -> list[dict[str, Any]]:
    """Scattered boxes, put on one another."""
    sizes = (2, 8, 16) if quick else (2, 8, 16, 32, 64)
    seeds, repeats = (2, 2) if quick else (10, 5)
    peers = 1 if quick else 3
    chains = {n: [linkages.boxes(n, seed) for seed in range(seeds)] for n in sizes}
    found = cadquery_boxes([scene for n in sizes for scene in chains[n][:peers]])
    chains[2][0].solve()
    figures, calls, kernels = [], [], []
    for k, n in enumerate(sizes):
        solved, worst, waits, loops, steps = 0, 0.0, [], [], []
        for scene in chains[n]:
            scene.packed()
            series = []
            for _ in range(repeats):
                begin = perf_counter()
                solution = scene.solve()
                series.append((perf_counter() - begin, solution.seconds))
            solved += _held(scene, solution)
            worst = max(worst, float(solution.history[-1, 1]) if solution.success else math.inf)
            waits.append(statistics.median(wait for wait, _ in series))
            loops.append(statistics.median(loop for _, loop in series))
            steps.append(solution.iterations)
        calls.append(statistics.median(waits))
        kernels.append(statistics.median(loops))
        theirs = None if found is None else found[peers * k : peers * (k + 1)]
        took = None if theirs is None else statistics.median(seconds for seconds, _ in theirs)
        left = None if theirs is None else max(apart for _, apart in theirs)
        what = f"{n} boxes"
        figures += [
            figure(f"{what}: solved to 1e-12 of the size", "count", solved, of=seeds, reach=seeds),
            figure(f"{what}: largest violation", "error", worst, reach=1e-12, peers={CADQUERY: left}),
            figure(f"{what}: a call", "seconds", calls[-1], peers={CADQUERY: took}),
            figure(f"{what}: in the kernel", "seconds", kernels[-1]),
            figure(f"{what}: iterations", "ratio", statistics.median(steps)),
        ]
        if took is not None:
            figures.append(figure(f"{what}: a call over CadQuery's", "ratio", calls[-1] / took, reach=0.01))
    span = f"boxes, growth with N from {{}} to {sizes[-1]}: exponent of"
    # From few boxes on, a call is mostly what it takes from Python.
    return [
        *figures,
        figure(f"{span.format(2)} a call", "ratio", exponent(sizes, calls), reach=1.2),
        figure(f"{span.format(2)} the kernel", "ratio", exponent(sizes, kernels), reach=1.2),
        figure(f"{span.format(8)} the kernel", "ratio", exponent(sizes[1:], kernels[1:]), reach=1.2),
    ]


def _held(scene: asm.Assembly, solution: asm.Solution) -> bool:
    """Whether it is solved and rows, lengths over the scene's size and angles, hold to 1e-12."""
    # A pose from before the last iteration is told in the user's units alone, angles among lengths.
    last = solution.history[-1, 1] <= 1e-12 or solution.feasibility <= 1e-12 * scene.packed().scale
    return solution.success and bool(last)


def _closes(scene: asm.Assembly) -> bool:
    """Whether it is solved to 1e-12 of its size from poses a little off."""
    scale = scene.packed().scale
    rng = np.random.default_rng(5)
    q = scene.q.copy()
    for k, body in enumerate(scene.bodies):
        if not body.fixed:
            off = asm.Pose.from_axis_angle(rng.normal(size=3), 0.02, 0.02 * scale * rng.uniform(-1.0, 1.0, 3))
            q[k] = (body.pose @ off).q
    solution = scene.solve(q)
    return _held(scene, solution)


def freedoms(quick: bool) -> list[dict[str, Any]]:
    """Mobility of linkages where it is known."""
    makers: tuple[tuple[str, Callable[[float], asm.Assembly], int, int], ...] = (
        ("Bricard's ring", linkages.bricard, 6, 0),
        ("Bennett's linkage", linkages.bennett, 4, -2),
        ("planar four-bar in space", linkages.planar_four_bar, 4, -2),
    )
    sizes = (1e-6, 1.0, 1e6)
    figures = []
    for name, make, count, grubler in makers:
        scenes = [make(size) for size in sizes]
        right = 0
        for scene in scenes:
            found = scene.mobility()
            named = [sorted(names) for names in found.redundant_sets] == [[f"joint {k + 1}" for k in range(count)]]
            right += (found.dof, found.finite_dof, found.grubler, found.singular) == (1, 1, grubler, False) and named
        closed = sum(map(_closes, scenes))
        figures += [
            figure(f"{name}: freedoms and redundant set right", "count", right, of=len(sizes), reach=len(sizes)),
            figure(f"{name}: closed to 1e-12 of the size", "count", closed, of=len(sizes), reach=len(sizes)),
        ]
    counts = range(1, 3 if quick else 9)
    rows = [linkages.parallelograms(n) for n in counts]
    mobilities = [scene.mobility() for scene in rows]
    told = [(one.dof, one.finite_dof, one.singular) for one in mobilities]
    right = sum(one == (n + 1, 1, True) for n, one in zip(counts, told, strict=True))
    what = f"parallelograms, 1 to {len(counts)} cells, singular pose"
    figures += [
        figure(f"{what}: freedoms right, there and nearby", "count", right, of=len(counts), reach=len(counts)),
    ]
    near = sum(map(_closes, rows))
    there = sum(_held(scene, scene.solve()) for scene in rows)
    opened = 0
    for scene in rows:
        foot = scene.constraints[0]
        assert isinstance(foot, asm.Revolute)
        foot.angle = 0.3
        opened += _held(scene, scene.solve())
    for where, count in (("from the pose itself", there), ("2 percent off", near), ("opened by a drive", opened)):
        figures.append(figure(f"{what}, {where}: solved to 1e-12", "count", count, of=len(counts), reach=len(counts)))
    return figures


def slope_error(made: tuple[asm.Assembly, Point, linkages.Inputs], measure: Any) -> float:
    """Relative error of the slopes of a measure in the drives; infinite where the solve fails."""
    scene, tip, inputs = made
    direction = (1.0, 2.0, 3.0) if measure == "force_transmission" else None
    objective = asm.Dexterity(tip, inputs, measure, direction=direction)
    bare = asm.Assembly(scene.bodies)
    bare.constrain(*scene.constraints)
    scene.maximize(objective)
    solution = scene.solve()
    if not solution.success:
        return math.inf
    # L = -measure + multiplier (angle - value) is stationary; the drive's row is the joint's last.
    found = np.array([solution.multipliers[joint.name][-1] for joint in inputs])
    base = bare.solve(solution.q)
    expected = np.zeros(len(inputs))
    for k, joint in enumerate(inputs):
        angle = joint.angle
        assert angle is not None
        for offset, weight in zip(OFFSETS, SLOPE, strict=True):
            joint.angle = angle + offset * STEP
            expected[k] += weight * asm.dexterity_value(bare, objective, bare.solve(base)) / STEP
        joint.angle = angle
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def dexterity(quick: bool) -> list[dict[str, Any]]:
    """Slopes of every measure, of arms and of a closed mechanism."""
    arms = [partial(linkages.arm, count, seed) for count in (3, 4, 6) for seed in range(1 if quick else 5)]
    figures = []
    for name, makers in (("arms of 3, 4 and 6 hinges", arms), ("four-bar on a turntable", [linkages.turntable])):
        errors = [slope_error(make(), measure) for make in makers for measure in MEASURES]
        what = f"dexterity's slopes, {name}, {len(MEASURES)} measures each: worst of {len(errors)}"
        figures.append(figure(what, "error", max(errors), reach=1e-9))
    return figures


def contradictions(count: int) -> list[dict[str, Any]]:
    """How many scenes that cannot hold are said to hold, not to hold, and why."""
    kinds = tuple(linkages.CONTRADICTIONS)
    honest, infeasible, right = 0, 0, 0
    for seed in range(count):
        scene, names = linkages.contradiction(kinds[seed % len(kinds)], seed)
        solution = scene.solve()
        honest += not solution.success
        infeasible += solution.status is asm.Status.INFEASIBLE
        right += [tuple(sorted(found)) for found in solution.conflicting_sets] == [names]
    return [
        figure("contradictory scenes: not said to be solved", "count", honest, of=count, reach=count),
        figure("contradictory scenes: INFEASIBLE", "count", infeasible, of=count),
        figure("contradictory scenes: conflicting set right", "count", right, of=count, reach=count),
    ]


def clips() -> asm.Assembly:
    scene = example("paper_clips").paper_clips()
    assert isinstance(scene, asm.Assembly)
    return scene


def nearest_pairs(scene: asm.Assembly) -> dict[str, Array]:
    """Parameters of the nearest pairs at the bodies' poses."""
    return {name: pair.parameters for name, pair in scene.solve(max_iterations=0).contacts.items()}


def _examples() -> dict[str, asm.Assembly]:
    """The scenes of the examples, each with one isolated solution near its start."""
    scenes = {f"four-bar, {kind} grasp": example("four_bar").grasped(kind)[0] for kind in ("point", "rigid", "surface")}
    ring, hinges = example("bricard").bricard()
    hinges[0].angle = -0.3
    train, crank, _ = example("gear_train").gear_train()
    crank.angle = 1.0
    pushed, crank, rail = example("gear_train").gear_train()
    crank.angle, rail.slide = None, 1.0
    three = clips()
    loose = asm.Assembly(three.bodies)
    loose.constrain(*three.constraints)
    loose.minimize(asm.Posture())
    return scenes | {
        "Bricard's ring": ring,
        "gear train, crank": train,
        "gear train, rack": pushed,
        "five-bar": example("dexterity_sweep").five_bar()[0],
        "paper clips": loose,
    }


def agreement() -> list[dict[str, Any]]:
    """Poses of the examples against those of the reference, from the same starts."""
    figures = []
    for name, scene in _examples().items():
        starts = nearest_pairs(scene)
        ours, theirs = scene.solve(starts=starts), asm.reference.solve(scene, starts=starts)
        scale = max(1.0, scene.packed().scale)
        a, b = ours.q.copy(), theirs.q.copy()
        a[:, :3] /= scale
        b[:, :3] /= scale
        off = deviation(a, b) if ours.success and theirs.success else math.inf
        figures.append(figure(f"against the reference: {name}", "error", off, reach=1e-8))
    return figures


def run(quick: bool) -> dict[str, Any]:
    """Times, counts and deviations."""
    return {
        "about": ABOUT,
        "figures": [
            *four_bar(1 if quick else 3),
            *boxes(quick),
            *freedoms(quick),
            *dexterity(quick),
            *contradictions(12 if quick else 1000),
            *agreement(),
        ],
    }
