"""Run time against error of assemblies in contact: three linked wires, the least move that makes them touch."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from functools import partial
from time import perf_counter
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

import assembly as asm
from assembly.kinematics.pose import retract
from assembly.solve.oracle.reference import ReferenceSolver
from assembly.solve.scene import Status
from benchmarks.figures import figure
from benchmarks.first_order import lines_without_curvature
from benchmarks.laws import deviation
from benchmarks.pictures import curve
from benchmarks.scenes import Wires, linked_wires

ABOUT = """\
Three linked wires from poses that are clear of one another, contacts given; the objective is the least move. An error
is the largest difference of a component of q from our solution at a tolerance of 1e-14, polished until nothing moves,
where the two ended in one minimum; a line's point is the median error and time over all starts at one tolerance, from
1e-3 to 1e-14. "First order" is our loop compiled without second derivatives of rows (`benchmarks/first_order.py`), in
a process of its own, held against its own solution at 1e-14. IPOPT and FATROP solve the full space (`asm.reference`),
their times those in them; to FATROP, which is made for stages in time, it is one dense stage. SLSQP solves in the
twists alone, its slopes by differences of pairs that are solved again."""

Array = NDArray[np.float64]
TOLERANCES = [10.0**-k for k in range(3, 15)]
# Objectives that differ by more belong to different minima.
SAME = 1e-2
Line = list[tuple[float, float]]
FIRST = "ours, first order"


def _slsqp(wires: Wires, k: int, tolerance: float) -> tuple[Array, bool]:
    """Poses from start k by SLSQP over the twists of the two moving wires."""
    q0 = wires.q[k]
    bodies = wires.scene.bodies
    face = bodies[0].face()
    contacts = list(wires.starts[k].values())

    def poses(x: Array) -> Array:
        return np.array([q0[0], retract(q0[1], x[:6]), retract(q0[2], x[6:])])

    def gaps(x: Array) -> Array:
        q = poses(x)
        return np.array(
            [
                asm.proximity.extremal_pair(face, q[i], face, q[j], start).gap
                for (i, j), start in zip(((0, 1), (1, 2), (0, 2)), contacts, strict=True)
            ]
        )

    lever = 0.5 * bodies[1].size

    def move(x: Array) -> float:
        turns = np.linalg.norm(x.reshape(2, 6)[:, 3:], axis=1)
        return float((x.reshape(2, 6)[:, :3] ** 2).sum() + lever**2 * (4.0 * np.sin(0.5 * turns) ** 2).sum())

    result = minimize(
        move, np.zeros(12), method="SLSQP", constraints={"type": "eq", "fun": gaps},
        options={"ftol": tolerance**2, "maxiter": 200},
    )  # fmt: skip
    return poses(result.x), bool(result.success)


class Case:
    """A start, and the solution all are held against."""

    def __init__(self, wires: Wires, k: int) -> None:
        self.wires, self.k = wires, k
        self.exact = wires.scene.solve(wires.q[k], starts=wires.starts[k], tolerance=1e-14, stationarity=1e-13)

    def error(self, q: Array, done: bool) -> float:
        """Of a pose; not a number where it is no solution, or that of another minimum."""
        off = deviation(q, self.exact.q)
        return off if done and off < SAME else float("nan")


def ours(case: Case, tolerance: float) -> tuple[float, float]:
    solve = partial(
        case.wires.scene.solve,
        case.wires.q[case.k],
        starts=case.wires.starts[case.k],
        tolerance=min(1e-2, tolerance),
        stationarity=min(1e-2, tolerance),
    )
    spent = []
    for _ in range(7):
        begin = perf_counter()
        solution = solve()
        spent.append(perf_counter() - begin)
    return case.error(solution.q, solution.success), statistics.median(spent)


class FatropSolver(ReferenceSolver):
    """The program of the reference solver given to FATROP instead of IPOPT."""

    def __init__(self, scene: asm.Assembly, tolerance: float) -> None:
        super().__init__(scene)
        equal = (self._bounds["ubg"] == 0.0).tolist()
        self._other = ca.nlpsol(
            "reference", "fatrop", self._solver.oracle(),
            {
                "print_time": False, "structure_detection": "none", "equality": equal,
                "fatrop": {"print_level": 0, "tol": tolerance, "max_iter": 500},
            },
        )  # fmt: skip

    def _run(self, x0: Array, bounds: dict[str, Array], p: Array) -> tuple[Array, Array, Status, dict[str, Any]]:
        begin = perf_counter()
        result = self._other(x0=x0, p=p, **bounds)
        seconds = perf_counter() - begin
        stats = self._other.stats()
        status = Status.SOLVED if stats["success"] else Status.STALLED
        x, forces = (np.array(result[name]).ravel() for name in ("x", "lam_g"))
        return x, forces, status, {"seconds": seconds, "iterations": int(stats["iter_count"])}


def _ipopt(solver: ReferenceSolver, case: Case, _tolerance: float) -> tuple[float, float]:
    solution = solver.solve(case.wires.q[case.k], starts=case.wires.starts[case.k])
    # By its own word: the check of `asm.reference` is tighter than most of these tolerances.
    return case.error(solution.q, True), solution.seconds


def _by_differences(case: Case, tolerance: float) -> tuple[float, float]:
    begin = perf_counter()
    q, done = _slsqp(case.wires, case.k, tolerance)
    return case.error(q, done), perf_counter() - begin


def run(quick: bool) -> dict[str, Any]:
    """Lines, and figures at the tightest tolerance."""
    count = 2 if quick else 20
    tolerances = [1e-4, 1e-10] if quick else TOLERANCES
    wires = linked_wires(count, grasped=False)
    cases = [Case(wires, k) for k in range(count)]
    lines: dict[str, Line] = {}
    found: dict[str, tuple[int, float, float]] = {}

    def take(name: str, tolerance: float, solve: Callable[[Case, float], tuple[float, float]], some: int) -> None:
        enter(name, np.array([solve(case, tolerance) for case in cases[:some]]))

    def enter(name: str, rows: Array) -> None:
        good = np.isfinite(rows[:, 0])
        point = (float(np.median(rows[good, 0])) if good.any() else float("nan"), float(np.median(rows[:, 1])))
        lines.setdefault(name, []).append(point)
        found[name] = (int(good.sum()), *point)

    few = 1 if quick else min(count, 4)
    for tolerance in tolerances:
        take("ours", tolerance, ours, count)
        for name, kind in (("IPOPT, exact", "exact"), ("IPOPT, L-BFGS", "limited-memory")):
            solver = ReferenceSolver(wires.scene, {"tol": tolerance, "hessian_approximation": kind, "max_iter": 500})
            take(name, tolerance, partial(_ipopt, solver), count)
        if ca.has_nlpsol("fatrop"):
            take("FATROP", tolerance, partial(_ipopt, FatropSolver(wires.scene, tolerance)), count)
        take("SLSQP, differences", tolerance, _by_differences, few)
    if not quick:
        for starts in lines_without_curvature(count, tolerances):
            enter(FIRST, np.array(starts))
    peers = [name for name in found if name != "ours"]
    solved = {name: found[name][0] * (count // few if "SLSQP" in name else 1) for name in peers}
    return {
        "about": ABOUT,
        "figures": [
            figure(
                f"{count} starts at {tolerances[-1]:.0e}: in our minimum (SLSQP: of {few}, times {count // few})",
                "count", found["ours"][0], of=count, reach=count, peers=dict(solved),
            ),
            figure("the same: median error of q", "error", found["ours"][1], reach=1e-12 if not quick else 1e-9,
                   peers={name: found[name][1] for name in peers}),
            figure("the same: a call", "seconds", found["ours"][2], peers={name: found[name][2] for name in peers}),
        ],
        "curves": [curve("Three wires touch: the least move", "median error of q", "seconds a solve", lines)],
    }  # fmt: skip
