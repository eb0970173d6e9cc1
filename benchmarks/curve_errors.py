"""Run time against error of the least distance of two spline curves."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from assembly import NurbsCurve
from assembly.proximity import Separation, minimum_distance
from benchmarks.curves import KINDS, sampled_minimum
from benchmarks.figures import figure
from benchmarks.peers import occt_curves
from benchmarks.pictures import curve
from benchmarks.timing import measure

ABOUT = """\
Pairs of random curves of each kind, as in `curves`, called from Python; a line's point is the median error and time of
a pair over all of them at one tolerance, from 1e-3 to 1e-14. The known distance is that of a direct search from 200 x
200 samples, each that is nearer than those beside it, until parameters move by less than 1e-9. Of certified answers an
error is that of the worse bound, lower or upper, and 1e-17 where it is zero; of OCCT (BRepExtrema_DistShapeShape, its
deflection at the tolerance), which has no bounds, that of its distance. "Plain" is the method of Lakshmanan et al.:
bounds by ellipsoids and halving alone (`bound="ellipsoid"`, `polish=False`), of fewer pairs, with 200,000 bounds at
most a query; right is an error within the tolerance or 1e-12, whichever is larger."""

TOLERANCES = [10.0**-k for k in range(3, 15)]
OURS, PLAIN, OCCT = "ours", "plain", "OCCT"
# What logarithms can show of an error of zero.
LEAST = 1e-17
Line = list[tuple[float, float]]
Query = Callable[[], Any]


def _error(known: float, answer: Separation) -> float:
    return max(known - answer.lower, answer.upper - known, abs(answer.upper - known), LEAST)


def _value_error(known: float, value: float) -> float:
    return max(abs(value - known), LEAST)


def _point(
    cases: list[tuple[Query, Callable[[Any], float]]], tolerance: float, repeats: int
) -> tuple[float, float, int]:
    """Median error and time over cases of (call, error of what it returns), and how many are right."""
    errors = [error(call()) for call, error in cases]
    # A call that takes long is timed once more, and that is enough.
    seconds = [measure(call, repeats=repeats, duration=1e-5).seconds for call, _error in cases]
    right = sum(error <= max(tolerance, 1e-12) for error in errors)
    return statistics.median(errors), statistics.median(seconds), right


def _kind(name: str, count: int, few: int, tolerances: list[float], repeats: int) -> tuple[list[Any], dict[str, Any]]:
    make, _reach = KINDS[name]
    rng = np.random.default_rng(1)
    pairs: list[tuple[NurbsCurve, NurbsCurve]] = [(make(rng), make(rng)) for _ in range(count)]
    known = [sampled_minimum(a, b) for a, b in pairs]
    lines: dict[str, Line | None] = {OURS: [], PLAIN: [], OCCT: []}
    right: dict[str, float | None] = {OCCT: None}
    for tolerance in tolerances:
        cases: dict[str, list[tuple[Query, Callable[[Any], float]]]] = {OURS: [], PLAIN: [], OCCT: []}
        for k, (a, b) in enumerate(pairs):
            judge = partial(_error, known[k])
            cases[OURS].append((partial(minimum_distance, a, b, tolerance), judge))
            if k < few:
                plain = partial(minimum_distance, a, b, tolerance, bound="ellipsoid", polish=False)
                cases[PLAIN].append((plain, judge))
            peer = occt_curves(a, b, tolerance)
            if peer is not None:
                cases[OCCT].append((peer, partial(_value_error, known[k])))
        for who, listed in cases.items():
            line = lines[who]
            if not listed or line is None:
                lines[who] = None
                continue
            error, seconds, good = _point(listed, tolerance, 2 if who == PLAIN else repeats)
            line.append((error, seconds))
            right[who] = good * (count / len(listed))
    last = {who: None if not line else line[-1] for who, line in lines.items()}
    ours = last.pop(OURS)
    assert ours is not None
    share = f" (plain: of {few}, times {count / few:g})"
    figures = [
        figure(
            f"two {name} at {tolerances[-1]:.0e}: right{share}", "count", right.pop(OURS) or 0.0, of=count, reach=count,
            peers=right,
        ),
        figure("the same: median error", "error", ours[0], reach=1e-12,
               peers={who: None if row is None else row[0] for who, row in last.items()}),
        figure("the same: a call", "seconds", ours[1],
               peers={who: None if row is None else row[1] for who, row in last.items()}),
    ]  # fmt: skip
    return figures, curve(f"Least distance of two {name}", "median error", "seconds a pair", lines)


def run(quick: bool) -> dict[str, Any]:
    """A diagram a kind of curves, and figures at the tightest tolerance."""
    tolerances = [1e-3, 1e-8] if quick else TOLERANCES
    count, few, repeats = (4, 2, 2) if quick else (40, 8, 5)
    figures, curves = [], []
    for name in KINDS:
        found, diagram = _kind(name, count, few, tolerances, repeats)
        figures += found
        curves.append(diagram)
    return {"about": ABOUT, "figures": figures, "curves": curves}
