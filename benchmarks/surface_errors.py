"""Run time against error of the extremal distance of two surfaces."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from benchmarks.figures import figure
from benchmarks.pairs import Solver
from benchmarks.peers import occt_pairs, occt_points
from benchmarks.pictures import curve
from benchmarks.scenes import Pairs, torus_pairs
from benchmarks.timing import measure

ABOUT = """\
Pairs of different tori at strict minima of their distance, 0.1 apart, started 0.05 off in every parameter. An error is
that of the two points against where the tori were placed, a line's point the median error and time of a pair over all
of them at one tolerance, from 1e-3 to 1e-14. Ours ends after a step that turns normals by less than the root of the
tolerance, in a kernel; scipy minimizes the squared distance of parameterized tori with exact slopes, IPOPT the same
with exact second derivatives, OCCT works on the same NURBS; these are called from Python. Wrong is an error above
1e-3."""

Array = NDArray[np.float64]
TOLERANCES = [10.0**-k for k in range(3, 15)]
OFFSET = 0.05
Line = list[tuple[float, float]]


class _Torus:
    """The two tori of a pair as formulas of angles, in the axes of the first."""

    def __init__(self, pairs: Pairs, k: int, start: Array) -> None:
        self.radii = np.array([_radii(surface) for surface in pairs.surfaces[k]])
        turns = Rotation.from_quat(pairs.q[k, :, 3:], scalar_first=True)
        self.turns = turns.as_matrix()
        self.shifts = pairs.q[k, :, :3]
        self.start = start / self.radii.ravel()

    def points(self, x: Any, math: Any = np) -> list[Any]:
        """World points at angles (4,)."""
        out = []
        for (major, minor), turn, shift, u, v in zip(
            self.radii, self.turns, self.shifts, x[0::2], x[1::2], strict=True
        ):
            ring = major + minor * math.cos(v)
            rows = (ring * math.cos(u), ring * math.sin(u), minor * math.sin(v))
            out.append([sum(turn[i, j] * rows[j] for j in range(3)) + shift[i] for i in range(3)])
        return out


def _radii(surface: Any) -> tuple[float, float]:
    (_, u), (_, v) = surface.domain
    return u / (2.0 * np.pi), v / (2.0 * np.pi)


class _Formula:
    """Half the squared distance over the angles, by CasADi: for scipy with its slopes, for IPOPT whole."""

    def __init__(self, torus: _Torus) -> None:
        x = ca.SX.sym("x", 4)
        f, g = torus.points([x[k] for k in range(4)], ca)
        value = 0.5 * sum((a - b) ** 2 for a, b in zip(f, g, strict=True))
        self.program = {"x": x, "f": value}
        self.slopes = ca.Function("slopes", [x], [value, ca.gradient(value, x)])
        self.torus = torus

    def ipopt(self, tolerance: float) -> Callable[[], Array]:
        """IPOPT at a tolerance."""
        options: dict[str, Any] = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "tol": tolerance}}
        solver = ca.nlpsol("distance", "ipopt", dict(self.program), options)
        return lambda: np.array(solver(x0=self.torus.start)["x"]).ravel()

    def scipy(self, tolerance: float) -> Callable[[], Array]:
        """L-BFGS-B at a tolerance."""

        def both(x: Array) -> tuple[float, Array]:
            value, slope = self.slopes(x)
            return float(value), np.array(slope).ravel()

        options = {"ftol": tolerance**2, "gtol": tolerance, "maxiter": 500}
        return lambda: np.asarray(minimize(both, self.torus.start, jac=True, method="L-BFGS-B", options=options).x)


def _line(cases: list[tuple[Callable[[], Any], Callable[[Any], float]]], repeats: int) -> tuple[float, float, int]:
    """Median error and time of cases of (call, error of its result), and how many are wrong."""
    errors = np.array([error(call()) for call, error in cases])
    seconds = [measure(call, repeats=repeats, duration=2e-4).seconds for call, _error in cases]
    return float(np.median(errors)), statistics.median(seconds), int((~(errors < 1e-3)).sum())


def run(quick: bool) -> dict[str, Any]:
    """Lines, and figures at the tightest tolerance."""
    count = 2 if quick else 30
    repeats = 2 if quick else 5
    tolerances = [1e-3, 1e-14] if quick else TOLERANCES
    pairs = torus_pairs(count, 0.1)
    placed = pairs.points(pairs.parameters)
    first = Solver(pairs, OFFSET, 0.0)
    starts = first.starts
    formulas = [_Formula(_Torus(pairs, k, starts[k])) for k in range(count)]

    def error(k: int, found: Array | None) -> float:
        return np.inf if found is None else float(np.abs(found - placed[k]).max())

    def of_angles(k: int, x: Array) -> float:
        return error(k, np.array(formulas[k].torus.points(x)))

    lines: dict[str, Line | None] = {name: [] for name in ("ours", "scipy L-BFGS-B", "CasADi IPOPT", "OCCT")}
    wrong: dict[str, int | None] = {}
    for tolerance in tolerances:
        solver = Solver(pairs, OFFSET, float(np.sqrt(tolerance)))
        solver(1)
        off = np.abs(pairs.points(solver.parameters) - placed).max(axis=(1, 2))
        spent = measure(solver, repeats=max(repeats, 5)).seconds / solver.count
        found: dict[str, tuple[float, float, int] | None] = {
            "ours": (float(np.median(off)), spent, int((~(off < 1e-3)).sum())),
            "scipy L-BFGS-B": _line(
                [(formulas[k].scipy(tolerance), partial(of_angles, k)) for k in range(count)], repeats
            ),
            "CasADi IPOPT": _line(
                [(formulas[k].ipopt(tolerance), partial(of_angles, k)) for k in range(count)], repeats
            ),
        }
        searches = occt_pairs(pairs.surfaces, pairs.q, starts, tolerance)
        found["OCCT"] = (
            None
            if searches is None
            else _line([(call, lambda r, k=k: error(k, occt_points(r))) for k, call in enumerate(searches)], repeats)  # type: ignore[misc]  # defaults bind the loop's values
        )
        for name, row in found.items():
            wrong[name] = None if row is None else row[2]
            line = lines[name]
            if row is None:
                lines[name] = None
            elif line is not None:
                line.append((row[0], row[1]))
    figures = [
        figure(
            f"{count} pairs of tori at the tightest tolerance: right",
            "count",
            count - (wrong["ours"] or 0),
            of=count,
            reach=count,
            peers={name: None if bad is None else count - bad for name, bad in wrong.items() if name != "ours"},
        )
    ]
    for what, unit, place in (("median error", "error", 0), ("a pair", "seconds", 1)):
        last = {name: None if not line else line[-1][place] for name, line in lines.items()}
        ours = last.pop("ours")
        assert ours is not None
        figures.append(figure(f"the same: {what}", unit, ours, reach=1e-12 if place == 0 else None, peers=last))  # type: ignore[arg-type]  # one of two words
    return {
        "about": ABOUT,
        "figures": figures,
        "curves": [curve("Extremal distance of two tori", "median error of the points", "seconds a pair", lines)],
        "versions": {"casadi": import_module("casadi").__version__},
    }
