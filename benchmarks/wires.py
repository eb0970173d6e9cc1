"""Three torus wires, linked and touching, and three paper clips: cold and warm solves, and IPOPT on the same scenes."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

import assembly as asm
from assembly.constraints.model.objectives import PointDistance
from assembly.proximity.extrema.pairs import PairStatus
from assembly.solve.oracle.reference import ReferenceSolver
from benchmarks.figures import figure
from benchmarks.running import example
from benchmarks.scenes import Wires, crossing, linked_wires

ABOUT = """\
Wires of radii 1 and 0.12, each linked with both others, the first one fixed, a point of the last one drawn to a
target: random starts, linked and clear of one another. Near targets are 0.3 from where the point starts, those out of
reach 3, away from the first wire. "Given" are the parameters of the nearest pairs at the start; without them each
solve looks for them itself. Solved is what ends SOLVED with every gap, found again by `extremal_pair`, within the
bound; IPOPT (by `asm.reference`, exact Hessian) is counted by its own end and the check of `asm.reference`. A warm
update continues from the solution before, its target 1 percent of the first distance away, to and fro; the change of
the target is not timed. A call is what Python waits for `scene.solve`, a kernel the compiled loop in it; IPOPT's
times are those in IPOPT alone, one run a case, without the multipliers of the solution before. It is here as the
second opinion it is for users, with settings chosen to be safe: not the fastest there is."""

Array = NDArray[np.float64]
IPOPT = "IPOPT"
# What a solve promises by default; the goal of 1e-12 in the units of the scene is stricter where its size is above one.
CONTRACT = "the tolerance, 1e-12 of the scene's size"
# Updates it makes of each case; ours are many more, to have a median of microseconds.
IPOPT_TICKS = 4


class Tally:
    """What became of a series of cases: their medians, and the worst of them."""

    def __init__(self) -> None:
        self.calls: list[float] = []
        self.kernels: list[float] = []
        self.solved: list[bool] = []
        self.violations: list[float] = []
        self.iterations: list[int] = []
        self.poses: list[Array] = []

    def add(self, solve: Callable[[], asm.Solution], repeats: int) -> asm.Solution:
        """One case, timed `repeats` times over."""
        calls, kernels = [], []
        for _ in range(repeats):
            begin = perf_counter()
            solution = solve()
            calls.append(perf_counter() - begin)
            kernels.append(solution.seconds)
        self.calls.append(statistics.median(calls))
        self.kernels.append(statistics.median(kernels))
        self.look(solution)
        return solution

    def look(self, solution: asm.Solution) -> None:
        """Note how a case ended."""
        pairs = solution.contacts.values()
        extremal = all(pair.status in (PairStatus.CONVERGED, PairStatus.SINGULAR) for pair in pairs)
        self.violations.append(max(abs(pair.gap) for pair in pairs) if extremal else float("inf"))
        self.solved.append(solution.success)
        self.iterations.append(solution.iterations)
        self.poses.append(solution.q)

    def count(self, bound: float = float("inf")) -> int:
        """How many cases are solved, their violations within a bound."""
        return sum(done and violation <= bound for done, violation in zip(self.solved, self.violations, strict=True))

    @property
    def worst(self) -> float:
        """The largest violation among the solved cases."""
        violations = [v for v, done in zip(self.violations, self.solved, strict=True) if done]
        return max(violations, default=float("nan"))

    @property
    def call(self) -> float:
        return statistics.median(self.calls)

    @property
    def kernel(self) -> float:
        return statistics.median(self.kernels)

    @property
    def clear(self) -> int:
        """How many cases have no wire in another one."""
        return sum(done and not crossing(q) for done, q in zip(self.solved, self.poses, strict=True))


def _cold(
    what: str, wires: Wires, targets: Array, reach: dict[str, float], quick: bool
) -> tuple[list[dict[str, Any]], list[asm.Solution]]:
    """Solves from every start, with given contacts and without, and IPOPT's from the given ones; our solutions."""
    scene, objective = wires.scene, wires.objective
    assert objective is not None
    solver = ReferenceSolver(scene)
    given, found, peer = Tally(), Tally(), Tally()
    solutions = []
    repeats = 5 if quick else 15
    for q, target, starts in zip(wires.q, targets, wires.starts, strict=True):
        objective.target = target
        solutions.append(given.add(partial(scene.solve, q, starts=starts), repeats))
        found.add(partial(scene.solve, q), repeats)
        peer.add(partial(solver.solve, q, starts=starts), 1)
    count = len(targets)
    tolerance = 1e-12 * scene.packed().scale
    figures = []
    for tally, name, theirs in ((given, "contacts given", peer), (found, "global start", None)):
        where = f"{what}, {name}"
        solved, times, worst, clear = (
            ({}, {}, {}, {})
            if theirs is None
            else (
                {IPOPT: float(theirs.count())},
                {IPOPT: theirs.kernel},
                {IPOPT: theirs.worst},
                {IPOPT: float(theirs.clear)},
            )
        )
        figures += [
            figure(f"{where}: solved to 1e-12", "count", tally.count(1e-12), of=count, reach=count, peers=solved),
            figure(f"{where}: solved to {CONTRACT}", "count", tally.count(tolerance), of=count, reach=count),
            figure(f"{where}: largest violation of the solved", "error", tally.worst, reach=1e-12, peers=worst),
            figure(f"{where}: a call", "seconds", tally.call, reach=reach.get(name), peers=times),
            figure(f"{where}: in the kernel", "seconds", tally.kernel, peers=times),
            figure(f"{where}: iterations", "ratio", statistics.median(tally.iterations)),
            figure(f"{where}: solved and no wire in another", "count", tally.clear, of=count, peers=clear),
        ]
    return figures, solutions


def _warm(
    what: str,
    scene: asm.Assembly,
    objective: PointDistance,
    cases: list[tuple[asm.Solution, Array, Array]],
    ticks: int,
) -> list[dict[str, Any]]:
    """Updates from (solution, its target, the other target), to and fro."""
    solver = ReferenceSolver(scene)
    ours, peer = Tally(), Tally()
    for solution, here, there in cases:
        # Timed without a break, and looked at afterwards, so that what looks does not empty the caches.
        previous, path = solution, []
        calls = []
        for tick in range(ticks):
            objective.target = there if tick % 2 == 0 else here
            begin = perf_counter()
            previous = scene.solve(previous)
            calls.append(perf_counter() - begin)
            path.append(previous)
        ours.calls.append(statistics.median(calls))
        ours.kernels.append(statistics.median(one.seconds for one in path))
        for one in path:
            ours.look(one)
        previous = solution
        for tick in range(min(ticks, IPOPT_TICKS)):
            objective.target = there if tick % 2 == 0 else here
            previous = peer.add(partial(solver.solve, previous), 1)
    count = len(ours.solved)
    times = {IPOPT: peer.kernel}
    return [
        figure(f"{what}: solved to 1e-10", "count", ours.count(1e-10), of=count, reach=count),
        # A row of its own: it makes fewer updates.
        figure(f"{what}: solved by IPOPT", "count", peer.count(), of=len(peer.solved)),
        figure(f"{what}: largest violation of the solved", "error", ours.worst, reach=1e-10, peers={IPOPT: peer.worst}),
        figure(f"{what}: a call", "seconds", ours.call, reach=15e-6, peers=times),
        figure(f"{what}: in the kernel", "seconds", ours.kernel, peers=times),
        figure(f"{what}: iterations", "ratio", statistics.median(ours.iterations)),
    ]


def _turned(step: float, count: int) -> Array:
    """Steps of one length, every way."""
    way = np.random.default_rng(11).normal(size=(count, 3))
    return np.asarray(step * way / np.linalg.norm(way, axis=1, keepdims=True))


def _clips(quick: bool) -> list[dict[str, Any]]:
    scene: asm.Assembly = example("paper_clips").paper_clips()
    ((_, objective),) = scene.objectives
    assert isinstance(objective, PointDistance)
    first = scene.solve()
    given = {name: pair.parameters for name, pair in scene.solve(max_iterations=0).contacts.items()}
    solver = ReferenceSolver(scene)
    cold, peer = Tally(), Tally()
    cold.add(partial(scene.solve, starts=given), 5 if quick else 25)
    peer.add(partial(solver.solve, starts=given), 1 if quick else 3)
    begin = objective.point.body.pose.apply(objective.point.coordinates)
    step = 0.01 * float(np.linalg.norm(objective.target - begin))
    here = objective.target
    ways = _turned(step, 2 if quick else 10)
    cases = [(first, here, here + way) for way in ways]
    figures = [
        figure(
            "paper clips, contacts given: solved", "count", cold.count(), of=1, reach=1, peers={IPOPT: peer.count()}
        ),
        figure("paper clips, contacts given: violation [mm]", "error", cold.worst, peers={IPOPT: peer.worst}),
        figure("paper clips, contacts given: a call", "seconds", cold.call, peers={IPOPT: peer.kernel}),
    ]
    return figures + _warm("paper clips, warm update", scene, objective, cases, 20 if quick else 100)


def run(quick: bool) -> dict[str, Any]:
    """Times, counts and violations."""
    wires = linked_wires(3 if quick else 50)
    scene, objective = wires.scene, wires.objective
    assert objective is not None
    near = wires.targets(0.3)
    far = wires.targets(3.0)
    # Kernels are loaded here, not in the first case.
    scene.solve(wires.q[0])
    figures, solutions = _cold("wires, near", wires, near, {"contacts given": 80e-6, "global start": 400e-6}, quick)
    more, taut = _cold("wires, out of reach", wires, far, {}, quick)
    figures += more
    ticks = 8 if quick else 20
    for what, targets, found in (("near", near, solutions), ("out of reach", far, taut)):
        moved = targets + _turned(0.003, len(targets))
        cases = [case for case in zip(found, targets, moved, strict=True) if case[0].success]
        figures += _warm(f"wires, {what}, warm update", scene, objective, cases, ticks)
    return {"about": ABOUT, "figures": figures + _clips(quick)}
