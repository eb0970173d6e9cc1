"""Certified distances of curves: table II of paper 003, its bounds of the length of arc, and replanning (figure 12)."""

from __future__ import annotations

from functools import partial
from math import comb
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from assembly.distance.batch.queries import collisions
from assembly.distance.enclosures.queries import enclosed_distance
from assembly.distance.separation import SeparationStatus
from assembly.geometry.shapes import curves
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.formula_curve import FormulaCurve
from benchmarks.figures import figure
from benchmarks.timing import measure

ABOUT = """\
Table II: pairs like those of the paper, whose control points and polygons are not given; tolerance 1e-10, one call from
Python each; the paper's times are of its Julia program on a 2.3 GHz i5, not of this machine. Plain is the ellipsoid
alone, without Newton's method; splits of a prototype of it in numpy stand beside ours. Tolerance queries ask for half
the distance. A bound of a length of arc is one expression in doubles with all that rounding can do to it added; the
time is that of one of 10,000 in a call, 64 at a time. Replanning: 500 paths of degree 5 around two polygons of 20
vertices, all in one call."""

Array = NDArray[np.float64]
# Of the paper, in seconds: distance, tolerance, collision; then splits of the prototype, plain.
PAPER = {
    "heart, hexagon": (208.22e-6, 10.52e-6, 10.38e-6, 28),
    "epicycloid, pentagon": (234.52e-6, 80.90e-6, 59.19e-6, 27),
    "Euler spiral, quadrilateral": (150.03e-3, 29.70e-3, 17.08e-3, 34),
    "two Bezier curves of degree 10": (425.66e-6, 49.20e-6, 37.66e-6, 134),
    "two involutes": (1.21e-3, 204.68e-6, 116.22e-6, 111),
    "fish, Lissajous curve": (3.74e-3, 471.99e-6, 229.25e-6, 132),
}
PAPER_ARCS = (58.02e-9, 44.69e-9, 38.43e-9)
_DELTA = 0.03


def polygon(sides: int, radius: float, center: tuple[float, float], turn: float = 0.2) -> Array:
    """A regular polygon."""
    angle = turn + 2 * np.pi * np.arange(sides) / sides
    return np.asarray(np.array(center) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))


def pairs() -> dict[str, tuple[Any, Any]]:
    """The pairs of figure 11, in the order of table II."""
    rng = np.random.default_rng(11)
    bezier = [NurbsCurve.bezier(rng.uniform(0, 1, (11, 2)) + (shift, 0.0)) for shift in (0.0, 1.0)]
    lissajous = curves.lissajous((0.3, 0.3), (3, 2), center=(0.8, -0.2))
    shapes = (
        (curves.heart(0.02), polygon(6, 0.25, (0.9, 0.5))),
        (curves.ranunculoid(0.05), polygon(5, 0.2, (0.6, 0.4))),
        (curves.euler_spiral(0.5), polygon(4, 0.2, (0.1, 0.8), 0.5)),
        (bezier[0], bezier[1]),
        (curves.involute(0.05), curves.involute(0.05, angle=180.0, center=(1.15, 0.1))),
        (curves.fish(0.3), lissajous),
    )
    return dict(zip(PAPER, shapes, strict=True))


def arcs() -> list[FormulaCurve]:
    """The curves of table I, with the paper's bound in closed form."""
    t = ca.SX.sym("t")

    def lemma(antiderivative: Any) -> Any:
        return lambda t0, t1: ca.sqrt((t1 - t0) * (antiderivative(t1) - antiderivative(t0)))

    formulas = (
        (ca.vertcat(2 * ca.cos(t), ca.sin(t)), lambda s: 2.5 * s - 0.75 * ca.sin(2 * s)),
        (ca.vertcat(t**3 + t, t), lambda s: s * (2 + s**2 * (2 + 1.8 * s**2))),
        (ca.vertcat(1 / (t + 1), t), lambda s: s - 1 / (3 * (s + 1) ** 3)),
    )
    return [FormulaCurve(c, t, (0.0, 1.0), lemma(a)) for c, a in formulas]


def _table_two(repeats: int) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    rows: list[dict[str, Any]] = []
    figures: list[dict[str, Any]] = []
    right = 0
    for name, (a, b) in pairs().items():
        distance, tolerance, collision, splits = PAPER[name]
        best = enclosed_distance(a, b)
        plain = enclosed_distance(a, b, bound="ellipsoid", polish=False)
        right += best.status is SeparationStatus.CONVERGED and best.lower <= plain.upper and plain.lower <= best.upper
        half = 0.5 * best.lower
        times = {
            "distance": (partial(enclosed_distance, a, b), distance),
            "plain": (partial(enclosed_distance, a, b, bound="ellipsoid", polish=False), distance),
            "tolerance": (partial(enclosed_distance, a, b, clearance=half), tolerance),
            "collision": (partial(enclosed_distance, a, b, clearance=0.0), collision),
        }
        row: dict[str, Any] = {"pair": name, "distance": best.upper, "gap": best.upper - best.lower}
        row |= {"splits": best.evaluations // 2, "splits, plain": plain.evaluations // 2, "prototype, plain": splits}
        for what, (call, paper) in times.items():
            seconds = measure(call, repeats=repeats, duration=1e-3).seconds
            row[f"{what}_seconds"] = seconds
            figures.append(figure(f"{name}: {what}", "seconds", seconds, reach=paper, peers={"paper": paper}))
        rows.append(row)
        figures.append(
            figure(f"{name}: splits of the plain method", "ratio", plain.evaluations // 2, peers={"prototype": splits})
        )
    figures.append(
        figure("table II: distances that two methods agree on", "count", right, of=len(rows), reach=len(rows))
    )
    return rows, figures


def _arc_lengths(repeats: int) -> list[dict[str, Any]]:
    rng = np.random.default_rng(1)
    ends = np.sort(rng.uniform(0, 1, (2, 10_000)), axis=0)
    figures: list[dict[str, Any]] = []
    short = 0
    for curve, paper in zip(arcs(), PAPER_ARCS, strict=True):
        t0, t1 = ends
        bound = curve.arc_lengths(t0, t1)
        short += int((bound >= np.linalg.norm(curve.evaluate(t1) - curve.evaluate(t0), axis=1)).sum())
        seconds = measure(partial(curve.arc_lengths, t0, t1), repeats=repeats, duration=1e-3).seconds / len(t0)
        name = f"bound of a length of arc, curve {len(figures) + 1} of table I"
        figures.append(figure(name, "seconds", seconds, reach=40e-9, peers={"paper": paper}))
    total = 3 * ends.shape[1]
    figures.append(figure("bounds of a length of arc not below the chord", "count", short, of=total, reach=total))
    return figures


def _paths(rng: np.random.Generator, count: int) -> tuple[Array, list[Array]]:
    points = np.empty((count, 6, 2))
    points[:, :2], points[:, 4:] = [(-0.2, 0.5), (0.0, 0.5)], [(1.0, 0.5), (1.2, 0.5)]
    points[:, 2:4] = rng.uniform(0, 1, (count, 2, 2))
    obstacles = []
    for center in ((0.35, 0.6), (0.65, 0.4)):
        angle = np.sort(rng.uniform(0, 2 * np.pi, 20))
        obstacles.append(np.array(center) + 0.1 * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    return points, obstacles


def _inside(points: Array, obstacle: Array) -> NDArray[np.bool_]:
    """Whether any of the points (n, k, 2) of a path is inside a polygon, whose vertices stand in order."""
    edge = np.roll(obstacle, -1, axis=0) - obstacle
    offset = points[:, :, None] - obstacle
    turns = edge[:, 0] * offset[..., 1] - edge[:, 1] * offset[..., 0]
    inside = np.asarray((turns >= 0.0).all(axis=2))
    return np.asarray(inside.any(axis=1))


def _replanning(repeats: int, samples: int) -> list[dict[str, Any]]:
    rng = np.random.default_rng(12)
    points, obstacles = _paths(rng, 500)
    t = np.linspace(0.0, 1.0, samples)[:, None]
    weights = np.hstack([comb(5, k) * t**k * (1 - t) ** (5 - k) for k in range(6)])
    dense = np.zeros(500, dtype=bool)
    for obstacle in obstacles:
        dense |= _inside(weights @ points, obstacle)
    found = collisions(points, obstacles).any(axis=1)
    near = collisions(points, obstacles, _DELTA).any(axis=1)
    paper = {"paper": 4.58e-3, "paper, subdivision": 53.43e-3, "paper, states": 202.67e-3}
    hits = int(dense.sum())
    clearance = measure(partial(collisions, points, obstacles, _DELTA), repeats=repeats, duration=2e-3).seconds
    collide = measure(partial(collisions, points, obstacles), repeats=repeats, duration=2e-3).seconds
    return [
        figure("500 paths, which keep a clearance", "seconds", clearance, reach=1e-3, peers=paper),
        figure("500 paths, which collide", "seconds", collide, reach=1e-3),
        figure("colliding paths found", "count", int((dense & found & near).sum()), of=hits, reach=hits),
    ]


def run(quick: bool) -> dict[str, Any]:
    """Table II, bounds of lengths of arc, replanning."""
    repeats = 2 if quick else 15
    rows, figures = _table_two(repeats)
    figures += _arc_lengths(repeats)
    figures += _replanning(repeats, 200 if quick else 4000)
    return {"about": ABOUT, "rows": rows, "figures": figures}
