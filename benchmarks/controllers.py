"""Closest points by feedback: from how many starts they are found, beside Newton's method, and what a descent costs."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.geometry import shapes
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity import PairStatus, closest_features, convergence_hypotheses, descend, extremal_pair
from assembly.proximity.controllers.bounds import Method, final_parameters
from benchmarks.features import random_pose
from benchmarks.figures import figure
from benchmarks.timing import measure

ABOUT = """\
Regions of attraction: starts on a grid, points over the patch; right is an end at the least distance that any start of
any method found, within 1e-9 of the size. The convex patch meets the hypotheses of `docs/controllers.md`, the patch of
table I (paper 000) does not. A point's closest point there is found from the nearest of 21 x 21 samples. Descents are
from random starts of pairs of ellipsoids and tori that are apart, one call from Python each, packed before."""

Array = NDArray[np.float64]
METHODS: tuple[Method, ...] = ("controller", "newton_saturated", "newton")
# Table I of paper 000, a row a y; degree 2 with thirds fits its five points and "order 3".
TABLE = np.array(
    [
        [(0, 0, 0), (3, 0, 2), (5, 0, 3), (8, 0, 3), (10, 0, 0)],
        [(1, 3, 3), (3, 3, 5), (5, 3, 6), (8, 3, 5), (9, 3, 3)],
        [(2, 5, 5), (3, 5, 7), (5, 5, 8), (8, 5, 7), (8, 5, 5)],
        [(1, 8, 3), (3, 8, 5), (5, 8, 6), (8, 8, 5), (9, 8, 3)],
        [(0, 10, 0), (3, 10, 2), (5, 10, 3), (8, 10, 2), (10, 10, 0)],
    ],
    dtype=float,
)
_SMALL = 1e-9


def table_one() -> NurbsSurface:
    """The patch of paper 000."""
    knots = [0, 0, 0, 1 / 3, 2 / 3, 1, 1, 1]
    return NurbsSurface(TABLE.transpose(1, 0, 2), (knots, knots), (2, 2))


def paraboloid(a: float, b: float, skew: float, half: float = 5.0) -> NurbsSurface:
    """z = 8 - a x^2 - b y^2 over a parallelogram; with 0.06, 0.05 and 0.3 normals span 84 degrees."""
    t = np.array([-half, 0.0, half])
    y = np.broadcast_to(t, (3, 3))
    x = t[:, None] + skew * y
    # From values at the ends and in the middle to Bezier points.
    bezier = np.array([[1.0, 0.0, 0.0], [-0.5, 2.0, -0.5], [0.0, 0.0, 1.0]])
    values = np.stack([x, y, 8.0 - a * x * x - b * y * y], axis=2)
    knots = [0, 0, 0, 1, 1, 1]
    return NurbsSurface(np.einsum("ik,jl,klm->ijm", bezier, bezier, values), (knots, knots), (2, 2))


def grid(count: int) -> Array:
    """Starts (count^2, 2) over the unit square."""
    u, v = np.meshgrid(np.linspace(0.0, 1.0, count), np.linspace(0.0, 1.0, count), indexing="ij")
    return np.stack([u.ravel(), v.ravel()], axis=1)


def points_over(surface: NurbsSurface, rng: np.random.Generator, count: int) -> Array:
    """Points up to 6 over a patch, on the side of larger z."""
    u, v = rng.uniform(0.0, 1.0, (2, count))
    p, su, sv = surface.evaluate(u, v, 1)
    n = np.cross(su, sv)
    n *= np.sign(n[:, 2:]) / np.linalg.norm(n, axis=1)[:, None]
    return np.asarray(p + rng.uniform(0.1, 6.0, (count, 1)) * n)


def distances(surface: NurbsSurface, ends: Array, point: Array) -> Array:
    """From points of the surface to a point."""
    return np.asarray(np.linalg.norm(surface.evaluate(ends[:, 0], ends[:, 1]) - point, axis=1))


def _regions(name: str, surface: NurbsSurface, count: int, starts: int) -> list[dict[str, Any]]:
    begin = grid(starts)
    right = dict.fromkeys(METHODS, 0)
    for point in points_over(surface, np.random.default_rng(5), count):
        found = {}
        for method in METHODS:
            ends, rested = final_parameters(surface, point, begin, method)
            found[method] = np.where(rested, distances(surface, ends, point), np.inf)
        least = min(d.min() for d in found.values()) + _SMALL * surface.size
        for method in METHODS:
            right[method] += int((found[method] <= least).sum())
    total = count * len(begin)
    reach = total if convergence_hypotheses(surface).hold else None
    what = f"starts that lead to the closest point, {name}"
    return [
        figure(
            what,
            "count",
            right["controller"],
            of=total,
            reach=reach,
            peers={"Newton with saturation": right["newton_saturated"], "Newton": right["newton"]},
        )
    ]


def _points(surface: NurbsSurface, count: int, repeats: int) -> list[dict[str, Any]]:
    """Closest points of table I's patch: from the nearest sample, against all starts."""
    samples = grid(21)
    places = surface.evaluate(samples[:, 0], samples[:, 1])
    right, spent = 0, []
    for point in points_over(surface, np.random.default_rng(6), count):

        def search(point: Array = point) -> Array:
            near = samples[((places - point) ** 2).sum(axis=1).argmin()]
            return final_parameters(surface, point, near[None], "controller", "contravariant")[0]

        ends, _rested = final_parameters(surface, point, samples)
        least = distances(surface, ends, point).min()
        right += bool(distances(surface, search(), point)[0] <= least + _SMALL * surface.size)
        spent.append(measure(search, repeats=repeats, duration=1e-4).seconds)
    return [
        figure("closest points of table I's patch, right", "count", right, of=count, reach=count),
        figure("closest point of table I's patch", "seconds", float(np.median(spent)), reach=50e-6),
    ]


def _random_body(rng: np.random.Generator) -> NurbsSurface:
    if rng.random() < 0.5:
        minor = rng.uniform(0.4, 1.0)
        return shapes.torus(minor * rng.uniform(1.8, 4.0), minor)
    return shapes.ellipsoid(*rng.uniform(0.6, 2.0, 3))


def _descents(count: int, repeats: int) -> list[dict[str, Any]]:
    rng = np.random.default_rng(7)
    ended = newton = done = 0
    spent = []
    while done < count:
        f, g = _random_body(rng), _random_body(rng)
        q_f, q_g = random_pose(rng, 0.0), random_pose(rng, rng.uniform(2.0, 8.0))
        nearest = closest_features(f, g, q_f, q_g)
        if nearest.lower < 1e-3:
            continue
        done += 1
        start = [rng.uniform(low, high) for surface in (f, g) for low, high in surface.domain]
        pair = descend(f, q_f, g, q_g, start)
        ended += pair.status is PairStatus.CONVERGED and pair.gap >= nearest.lower - _SMALL
        other = extremal_pair(f, q_f, g, q_g, start)
        # A pair that is no farther apart than the one the descent led to.
        newton += other.status is PairStatus.CONVERGED and abs(other.gap) <= pair.gap + _SMALL
        spent.append(measure(partial(descend, f, q_f, g, q_g, start), repeats=repeats, duration=1e-4).seconds)
    return [
        figure("descents that end at a minimum", "count", ended, of=count, reach=count, peers={"Newton": newton}),
        figure("descent, median", "seconds", float(np.median(spent))),
        figure("descent, 99th percentile", "seconds", float(np.percentile(spent, 99.0))),
    ]


def run(quick: bool) -> dict[str, Any]:
    """Regions of attraction on two patches, closest points on one, and descents of pairs."""
    points, starts = (4, 21) if quick else (50, 101)
    repeats = 2 if quick else 7
    figures = [
        *_regions("a convex patch", paraboloid(0.06, 0.05, 0.3), points, starts),
        *_regions("the patch of table I", table_one(), points, starts),
        *_points(table_one(), 20 if quick else 400, repeats),
        *_descents(20 if quick else 300, repeats),
    ]
    return {"about": ABOUT, "figures": figures}
