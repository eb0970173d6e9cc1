"""Figures 6, 7, 8, 10, 12 and tables I and II of Lakshmanan et al.: certified distances of curves.

Table I: bounds of the length of arc. Figures 6 and 7: how algorithm 1 narrows the distance of a Bezier curve and a
polygon down. Figure 8: the nearest points of letters. Figure 10: a point and Bezier curves, by degree. Table II (figure
11): heart, epicycloid, Euler spiral, Bezier curves, involutes, fish and Lissajous curve. Figure 12: which of 500 paths
around obstacles are free.

The paper gives neither its control points nor its polygons; these are ours. Prints what the figures show; with
matplotlib (the extra `plot`) it also writes lakshmanan.png into the working directory.
"""

from __future__ import annotations

from importlib.util import find_spec
from math import comb
from time import perf_counter
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np

import assembly as asm
from assembly.distance.enclosures.queries import enclosed_distance

T = ca.SX.sym("t")
# The paper's algorithms: no Newton's method, ellipsoids alone.
PLAIN: dict[str, Any] = {"bound": "ellipsoid", "polish": False}
DELTA = 0.03  # of figure 12
DEGREES = tuple(range(5, 50, 5))  # of figure 10


def table_1() -> dict[str, asm.FormulaCurve]:
    """The paper's three curves with lemma 1 in closed form."""

    def lemma(antiderivative):  # of |C'|^2
        return lambda t0, t1: ca.sqrt((t1 - t0) * (antiderivative(t1) - antiderivative(t0)))

    formulas = {
        "(2 cos t, sin t)": (ca.vertcat(2 * ca.cos(T), ca.sin(T)), lambda t: 2.5 * t - 0.75 * ca.sin(2 * t)),
        "(t^3 + t, t)": (ca.vertcat(T**3 + T, T), lambda t: t * (2 + t**2 * (2 + 1.8 * t**2))),
        "(1 / (t + 1), t)": (ca.vertcat(1 / (T + 1), T), lambda t: t - 1 / (3 * (t + 1) ** 3)),
    }
    return {name: asm.FormulaCurve(c, T, (0.0, 1.0), lemma(a), name=name) for name, (c, a) in formulas.items()}


def polygon(sides: int, radius: float, center: tuple[float, float], turn: float = 0.2) -> np.ndarray:
    angle = turn + 2 * np.pi * np.arange(sides) / sides
    return np.array(center) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def table_2() -> dict[str, tuple[Any, Any]]:
    """The pairs of figure 11."""
    rng = np.random.default_rng(11)
    bezier = [asm.NurbsCurve.bezier(rng.uniform(0, 1, (11, 2)) + (shift, 0.0)) for shift in (0.0, 1.0)]
    return {
        "heart, hexagon": (asm.curves.heart(0.02), polygon(6, 0.25, (0.9, 0.5))),
        "epicycloid, pentagon": (asm.curves.ranunculoid(0.05), polygon(5, 0.2, (0.6, 0.4))),
        "Euler spiral, quadrilateral": (asm.curves.euler_spiral(0.5), polygon(4, 0.2, (0.1, 0.8), 0.5)),
        "two Bezier curves": (bezier[0], bezier[1]),
        "two involutes": (asm.curves.involute(0.05), asm.curves.involute(0.05, angle=180.0, center=(1.15, 0.1))),
        "fish, Lissajous curve": (
            asm.curves.fish(0.3),
            asm.curves.lissajous((0.3, 0.3), (3, 2), center=(0.8, -0.2)),
        ),
    }


def figure_6() -> tuple[asm.NurbsCurve, np.ndarray]:
    """A Bezier curve of degree 13 and a convex polygon."""
    rng = np.random.default_rng(62)
    return asm.NurbsCurve.bezier(rng.uniform(0, 1, (14, 2))), polygon(20, 0.25, (-0.3, 0.4))


def stages(curve: asm.NurbsCurve, obstacle: np.ndarray, counts: tuple[int, ...]) -> list[list[Any]]:
    """Algorithm 1 by hand: the ellipses of its intervals after some splits."""
    directions = polygon(720, 1.0, (0.0, 0.0))
    outer = (-directions @ obstacle.T).max(axis=1)

    def lower(piece: Any) -> float:
        # The best of many directions, of which each is a certificate.
        return float((-piece.support(directions, "ellipsoid") - outer).max())

    piece = asm.proximity.enclosure(curve, 0.0, 1.0)
    pieces, shown = [(lower(piece), 0.0, 1.0, piece)], []
    for split in range(max(counts) + 1):
        if split in counts:
            shown.append([p[3] for p in pieces])
        _, t0, t1, _ = pieces.pop(min(range(len(pieces)), key=lambda k: pieces[k][0]))
        middle = 0.5 * (t0 + t1)
        for a, b in ((t0, middle), (middle, t1)):
            piece = asm.proximity.enclosure(curve, a, b)
            pieces.append((lower(piece), a, b, piece))
    return shown


def figure_7() -> np.ndarray:
    """Upper less lower bound after every split, to 1e-10."""
    curve, obstacle = figure_6()
    gaps = []
    while not gaps or gaps[-1] > 1e-10:
        answer = enclosed_distance(curve, obstacle, **PLAIN, max_evaluations=1 + 2 * len(gaps))
        gaps.append(answer.upper - answer.lower)
    return np.array(gaps)


def figure_8() -> tuple[list[asm.NurbsCurve], list[Any]]:
    """Letters R, S, S, 1, 9 as Bezier curves, and the nearest points of neighbors."""
    r = [(0, 0), (0, 1.6), (-0.1, 1.3), (1.6, 1.2), (0.6, 0.3), (-0.4, 0.7), (0.5, 0.5), (0.8, 0)]
    s = [(0.7, 0.9), (0.2, 1.3), (-0.6, 0.7), (0.6, 0.5), (1.4, 0.2), (0.3, -0.3), (0, 0.1)]
    one = [(0, 0.7), (0.2, 0.8), (0.4, 1.2), (0.3, 0.5), (0.3, 0)]
    nine = [(0.7, 0.8), (0.6, 1.3), (-0.5, 1.2), (0, 0.3), (0.9, 0.4), (0.9, 1.6), (0.9, 0.2), (0.4, 0)]
    letters = []
    for k, points in enumerate((r, s, s, one, nine)):
        letters.append(asm.NurbsCurve.bezier(np.array(points, dtype=float) + (1.1 * k, 0.0)))
    return letters, [enclosed_distance(a, b) for a, b in zip(letters[:-1], letters[1:], strict=True)]


def figure_10(degrees: tuple[int, ...] = DEGREES, count: int = 3) -> dict[int, np.ndarray]:
    """Median pairs bounded and microseconds for a distance, a tolerance and a collision query of a point, by degree."""
    rng = np.random.default_rng(10)
    rows = {}
    for degree in degrees:
        cost = []
        for _ in range(count):
            points, point = rng.uniform(0, 1, (degree + 1, 2)), rng.uniform(0, 1, 2)
            curve = asm.NurbsCurve.bezier(points)
            distance = enclosed_distance(curve, point)
            one = []
            for clearance in (None, 0.5 * distance.lower, 0.0):
                start = perf_counter()
                answer = enclosed_distance(curve, point, clearance=clearance)
                one += [answer.evaluations, 1e6 * (perf_counter() - start)]
            cost.append(one)
        rows[degree] = np.median(cost, axis=0).reshape(3, 2)
    return rows


def paths(count: int = 500) -> np.ndarray:
    """Candidate paths of figure 12, degree 5: both ends given, two control points drawn between."""
    rng = np.random.default_rng(12)
    points = np.empty((count, 6, 2))
    points[:, :2], points[:, 4:] = [(-0.2, 0.5), (0.0, 0.5)], [(1.0, 0.5), (1.2, 0.5)]
    points[:, 2:4] = rng.uniform(0, 1, (count, 2, 2))
    return points


def obstacles() -> list[np.ndarray]:
    rng = np.random.default_rng(13)
    shapes = []
    for center in ((0.35, 0.6), (0.65, 0.4)):
        angle = np.sort(rng.uniform(0, 2 * np.pi, 20))
        shapes.append(np.array(center) + 0.1 * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    return shapes


def figure_12() -> SimpleNamespace:
    """Paths that keep away from the obstacles, that come too near, and that collide."""
    curves, shapes = paths(), obstacles()
    near = asm.proximity.collisions(curves, shapes, DELTA).any(axis=1)
    hit = asm.proximity.collisions(curves, shapes).any(axis=1)
    return SimpleNamespace(curves=curves, free=~near, near=near & ~hit, hit=hit)


def sampled(curves: np.ndarray, shapes: list[np.ndarray], count: int = 40) -> np.ndarray:
    """What testing of states along a path finds: whether one of `count` points is inside an obstacle."""
    t = np.linspace(0.0, 1.0, count)[:, None]
    weights = np.hstack([comb(5, k) * t**k * (1 - t) ** (5 - k) for k in range(6)])
    points = weights @ curves
    found = np.zeros(len(curves), dtype=bool)
    for shape in shapes:
        edges = np.roll(shape, -1, axis=0) - shape
        offset = points[:, :, None] - shape
        found |= (edges[:, 0] * offset[..., 1] - edges[:, 1] * offset[..., 0] >= 0).all(axis=2).any(axis=1)
    return found


def picture(result: SimpleNamespace) -> None:
    """All figures in one."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.patches import Ellipse

    def draw(axis: Any, curve: Any, **style: Any) -> None:
        axis.plot(*curve.evaluate(np.linspace(*curve.domain, 600)).T, **{"color": "k", "lw": 1.2, **style})

    figure, axes = pyplot.subplots(3, 5, figsize=(20, 12), layout="constrained")
    curve, obstacle = figure_6()
    for axis, count, pieces in zip(axes[0, :3], (0, 3, 7), result.stages, strict=True):
        axis.fill(*obstacle.T, color="0.7")
        for piece in pieces:
            chord = np.diff(piece.ends, axis=0)[0]
            angle = float(np.degrees(np.arctan2(chord[1], chord[0])))
            center = piece.ends.mean(axis=0)
            axis.add_patch(Ellipse(center, piece.length, np.sqrt(piece.width), angle=angle, alpha=0.3))
        draw(axis, curve)
        axis.set(title=f"6: {count} splits", aspect="equal")
    axes[0, 3].semilogy(result.convergence, ".-")
    axes[0, 3].set(title="7: upper less lower bound", xlabel="splits")
    letters, answers = result.letters
    for letter in letters:
        draw(axes[0, 4], letter)
    for answer in answers:
        axes[0, 4].plot(*answer.points.T, "r.--")
    axes[0, 4].set(title="8: nearest points of letters", aspect="equal")
    for axis, (name, (a, b)) in zip([*axes[1], axes[2, 0]], table_2().items(), strict=True):
        draw(axis, a)
        if isinstance(b, np.ndarray):
            axis.fill(*b.T, color="0.7")
        else:
            draw(axis, b, color="tab:blue")
        axis.plot(*result.pairs[name][0].points.T, "r.--")
        axis.set(title=f"11: {name}", aspect="equal")
    for k, name in enumerate(("distance", "tolerance", "collision")):
        cost = [row[k] for row in result.degrees.values()]
        axes[2, 1].plot(list(result.degrees), [c[0] for c in cost], ".-", label=name)
        axes[2, 2].semilogy(list(result.degrees), [c[1] for c in cost], ".-", label=name)
    axes[2, 1].set(title="10: pairs bounded", xlabel="degree")
    axes[2, 2].set(title="10: microseconds", xlabel="degree")
    axes[2, 1].legend()
    figure_ = result.replanning
    for axis, kinds in ((axes[2, 3], ("free", "near")), (axes[2, 4], ("hit",))):
        for kind, color in zip(kinds, ("tab:blue", "tab:orange"), strict=False):
            for points in figure_.curves[getattr(figure_, kind)]:
                draw(axis, asm.NurbsCurve.bezier(points), color=color if kind != "hit" else "0.6", lw=0.6)
        for shape in obstacles():
            axis.fill(*shape.T, color="0.3")
        axis.set(title=f"12: {', '.join(kinds)}", aspect="equal")
    figure.savefig("lakshmanan.png", dpi=70)
    pyplot.close(figure)


def main() -> SimpleNamespace:
    arcs = {name: curve.arc_length_bound(0.0, 1.0) for name, curve in table_1().items()}
    convergence, letters, degrees, replanning = figure_7(), figure_8(), figure_10(), figure_12()
    pairs = {}
    for name, (a, b) in table_2().items():
        plain = enclosed_distance(a, b, **PLAIN)
        best = enclosed_distance(a, b)
        apart = enclosed_distance(a, b, clearance=0.5 * best.lower), enclosed_distance(a, b, clearance=0.0)
        pairs[name] = best, plain, *apart
    print("table I: length of arc over [0, 1], at most")
    for name, bound in arcs.items():
        print(f"  {name:<18}{bound:.6f}")
    print(f"figure 7: {len(convergence) - 1} splits to {convergence[-1]:.1e}")
    print("figure 8: distances", ", ".join(f"{answer.upper:.6f}" for answer in letters[1]))
    print("figure 10: degree, then pairs bounded for distance, tolerance, collision")
    for degree, row in degrees.items():
        print(f"  {degree:2d}  {row[0, 0]:5.0f} {row[1, 0]:5.0f} {row[2, 0]:5.0f}")
    print("table II: distance; splits plain and polished; pairs bounded for tolerance and collision")
    for name, (best, plain, *apart) in pairs.items():
        counts = [plain.evaluations // 2, best.evaluations // 2, *(answer.evaluations for answer in apart)]
        print(f"  {name:<29}{best.upper:.10f} " + " ".join(f"{n:4d}" for n in counts))
    missed = replanning.hit & ~sampled(replanning.curves, obstacles())
    free, near, hit = replanning.free.sum(), replanning.near.sum(), replanning.hit.sum()
    print(f"figure 12: {free} paths free, {near} too near, {hit} collide; tests of 40 states miss {missed.sum()}")
    result = SimpleNamespace(
        arcs=arcs,
        stages=stages(*figure_6(), (0, 3, 7)),
        convergence=convergence,
        letters=letters,
        degrees=degrees,
        pairs=pairs,
        replanning=replanning,
        missed=missed,
    )
    if find_spec("matplotlib"):
        picture(result)
    return result


if __name__ == "__main__":
    main()
