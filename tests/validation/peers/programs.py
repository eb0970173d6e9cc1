"""Facts of other projects, retyped: what their suites say a pose, a distance or an optimum is, and where it stands.

Every test module here is one peer. Its tables hold the numbers of that peer's tests or publication, one row a fact,
with the name of the test or the problem; the code is ours. Where a suite prints few digits and a closed form is known,
the closed form stands in the table. What a suite calls a failure is expected as the status that says so.

| module | peer |
|---|---|
| `test_hock_schittkowski`, `..._four` | Hock and Schittkowski 1981, problems of two to four variables |
| `test_schittkowski` | Schittkowski 1987, the second collection |
| `test_cadquery` | constraints of assemblies, CadQuery `tests/test_assembly.py` |
| `test_ondsel` | a crank and slider that OndselSolver moved, couplings and cams as in its example files |
| `test_drake` | signed distances, Drake `geometry/proximity/test` |
| `test_coal` | distances of solids, FCL and coal |
| `test_occt` | extrema of curves and surfaces, OCCT `Extrema` |
| `test_curve_proximity_queries` | CurveProximityQueries.jl, its README and figures |

This file: nonlinear programs as scenes. Variables are coordinates of free points, three a body; constraints and the
objective are CasADi expressions of them. What is left of the poses, turns and unused coordinates, stays free.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

import assembly as asm

Rows = Callable[[Any], Sequence[Any]]


@dataclass(frozen=True)
class Program:
    """A nonlinear program with a published solution.

    Attributes
    ----------
    name : str
        Number in the collection; several where a problem stands there more than once.
    start : sequence of float
        The collection's standard start.
    objective : callable, optional
        Of the variables x[0], x[1] ...; None where only the constraints are asked for.
    optimum : float
        The published least value.
    x : sequence of float, optional
        The published solution, None where it is not unique.
    zero, positive : callable
        Values that are to be zero, and not negative.
    low, high : sequence
        Bounds of the variables; None is no bound.
    close, close_x : float
        What the optimum, relative to its size or one, and the variables, relative to the largest or one, may be off:
        by digits that were printed, or by an optimum that is flat.
    scale : float
        One unit of violation of the values that are to be zero.
    others : sequence of sequences of float
        Starts that the collections have for the same problem elsewhere.
    """

    name: str
    start: Sequence[float]
    objective: Callable[[Any], Any] | None
    optimum: float
    x: Sequence[float] | None
    zero: Rows | None = None
    positive: Rows | None = None
    low: Sequence[float | None] = ()
    high: Sequence[float | None] = ()
    close: float = 1e-8
    close_x: float = 1e-7
    scale: float = 1.0
    others: Sequence[Sequence[float]] = ()

    def __str__(self) -> str:
        return self.name

    def bounds(self, x: Any) -> list[Any]:
        """Bounds as values that are not negative."""
        rows = [x[k] - bound for k, bound in enumerate(self.low) if bound is not None]
        return rows + [bound - x[k] for k, bound in enumerate(self.high) if bound is not None]


def scene_of(program: Program) -> asm.Assembly:
    """The program as an assembly of free points."""
    n = len(program.start)
    start = np.zeros(3 * -(-n // 3))
    start[:n] = program.start
    bodies = [asm.Body(f"point {k}", position=at) for k, at in enumerate(start.reshape(-1, 3))]
    poses = [ca.SX.sym(f"q{k}", 7) for k in range(len(bodies))]
    x = ca.vertcat(*(pose[:3] for pose in poses))[:n]

    def expression(name: str, rows: Sequence[Any], **settings: Any) -> asm.Expression:
        used = [k for k, pose in enumerate(poses) if ca.depends_on(ca.vertcat(*rows), pose)]
        function = ca.Function(name, [poses[k] for k in used], [ca.vertcat(*rows)])
        return asm.Expression(function, [bodies[k] for k in used], **settings)

    scene = asm.Assembly(bodies)
    if program.zero:
        scene.constrain(expression("zero", program.zero(x), scale=program.scale))
    if program.positive:
        scene.constrain(expression("positive", program.positive(x), unilateral=True))
    if bounds := program.bounds(x):
        scene.constrain(expression("bounds", bounds, unilateral=True))
    if program.objective:
        scene.minimize(expression("objective", [program.objective(x)]))
    return scene


def variables(program: Program, solution: asm.Solution) -> np.ndarray:
    """The variables at a solution."""
    return np.asarray(solution.q)[:, :3].ravel()[: len(program.start)]


def check(program: Program) -> None:
    """Solve from every standard start: solved, at the published optimum, and the variables as published."""
    for start in (program.start, *program.others):
        solution = scene_of(replace(program, start=start)).solve()
        x = variables(program, solution)
        assert solution.status is asm.Status.SOLVED, f"{solution.message} at {x} from {start}"
        if program.objective:
            optimum = float(ca.DM(program.objective(ca.DM(x))))
            assert abs(optimum - program.optimum) <= program.close * max(1.0, abs(program.optimum)), (optimum, x)
        if program.x is not None:
            size = max(1.0, float(np.abs(program.x).max()))
            assert np.abs(x - program.x).max() <= program.close_x * size, x
