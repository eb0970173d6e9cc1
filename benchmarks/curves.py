"""Certified queries on spline curves: how long they take and whether every answer is the global minimum."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly import NurbsCurve
from assembly.distance.curves.capsules import capsule_tree
from assembly.distance.curves.search import ANSWER
from assembly.distance.spline_queries import nearest_address
from assembly.proximity import collides, is_separated, minimum_distance, minimum_distances
from benchmarks.figures import figure
from benchmarks.query_kernels import point_question_often, question_often, subdivide, subdivide_often
from benchmarks.timing import measure

ABOUT = """\
Distances of random shapes in the unit cube to 1e-10, one call from Python each unless said otherwise, curves packed
and their capsules made before (both are apart). Right is an answer with a certificate that no sample of 200 x 200 nor
a direct search from its dips undercuts, and whose bounds are within 1e-10. "In a kernel" are calls from
compiled code, or a batch of points. Parts of a distance's time are one median over another: from Python both have the
cost of a call, in a kernel neither. A clearance is asked at half the distance. Subdivision is that of
benchmarks/query_kernels.py, in a kernel as well, without a certificate that holds in floating point."""

Array = NDArray[np.float64]
TOLERANCE = 1e-10
DEGREES = (5, 10, 20, 30, 45)


def squared_distance(points: Array, point: Array, products: Array) -> Array:
    """Bernstein coefficients (2 n + 1,) of |C - p|^2 from control points and the weights C(n,i) C(n,j) / C(2n,i+j)."""
    d = points - point
    terms = (d @ d.T) * products
    return np.array([np.trace(terms[:, ::-1], offset=len(d) - 1 - k) for k in range(2 * len(d) - 1)])


def random_bezier(rng: np.random.Generator, degree: int) -> NurbsCurve:
    """A Bezier curve in the unit cube."""
    return NurbsCurve.bezier(rng.random((degree + 1, 3)))


def random_cubic(rng: np.random.Generator) -> NurbsCurve:
    """A rational cubic of eight poles."""
    knots = [0, 0, 0, 0, 0.2, 0.4, 0.6, 0.8, 1, 1, 1, 1]
    return NurbsCurve(rng.random((8, 3)), knots, 3, rng.uniform(0.5, 2.0, 8))


KINDS: dict[str, tuple[Callable[[np.random.Generator], NurbsCurve], float]] = {
    "Bezier curves of degree 5": (partial(random_bezier, degree=5), 50e-6),
    "Bezier curves of degree 10": (partial(random_bezier, degree=10), 250e-6),
    "rational cubics of five spans": (random_cubic, 150e-6),
}


def sampled_minimum(a: NurbsCurve, b: NurbsCurve, count: int = 200) -> float:
    """The least distance that samples and a search around each that is nearer than those beside it find."""
    s, t = np.linspace(0.0, 1.0, count), np.linspace(0.0, 1.0, count)
    d = np.linalg.norm(a.evaluate(s)[:, None] - b.evaluate(t)[None], axis=2)
    least = float(d.min())
    beside = np.lib.stride_tricks.sliding_window_view(np.pad(d, 1, constant_values=np.inf), (3, 3))
    for i, j in np.argwhere(d <= beside.min(axis=(2, 3))):
        x, y = s[i], t[j]
        width = 1.0 / count
        while width > 1e-9:
            u = np.clip(x + width * np.linspace(-1.0, 1.0, 9), 0.0, 1.0)
            v = np.clip(y + width * np.linspace(-1.0, 1.0, 9), 0.0, 1.0)
            near = np.linalg.norm(a.evaluate(u)[:, None] - b.evaluate(v)[None], axis=2)
            i, j = np.unravel_index(near.argmin(), near.shape)
            x, y = u[i], v[j]
            least = min(least, float(near.min()))
            width *= 0.8
    return least


def _seconds(call: Callable[[], Any], repeats: int) -> float:
    return measure(call, repeats=repeats, duration=2e-4).seconds


def _pairs(name: str, count: int, repeats: int) -> list[dict[str, Any]]:
    make, reach = KINDS[name]
    rng = np.random.default_rng(1)
    right, spent, separate, collide, pack, trees = 0, [], [], [], [], []
    inner: list[list[float]] = [[], [], []]
    out = np.empty(ANSWER)
    for _ in range(count):
        a, b = make(rng), make(rng)
        answer = minimum_distance(a, b, TOLERANCE)
        known = sampled_minimum(a, b)
        right += answer.converged and answer.lower <= known + 1e-15 and answer.upper <= known + TOLERANCE
        spent.append(_seconds(partial(minimum_distance, a, b, TOLERANCE), repeats))
        half = 0.5 * answer.lower
        if answer.lower > TOLERANCE:
            assert is_separated(a, b, half) and not collides(a, b)
            separate.append(_seconds(partial(is_separated, a, b, half), repeats))
            collide.append(_seconds(partial(collides, a, b), repeats))
            (ra, qa), (rb, qb) = a._packed_pieces, b._packed_pieces
            u, v = capsule_tree(ra, qa), capsule_tree(rb, qb)
            for series, clearance in zip(inner, (-1.0, half, 0.0), strict=True):
                call = partial(question_often, ra, qa, u, rb, qb, v, clearance, False, 8, out)
                series.append(_seconds(call, repeats) / 8)
        fresh = NurbsCurve(a.control_points, a.knots, a.degree, a.weights)
        pack.append(_packing(fresh))
        trees.append(_seconds(partial(capsule_tree, *a._packed_pieces), repeats))
    median = float(np.median(spent))
    parts = [float(np.median(series)) / median for series in (separate, collide)]
    whole, half_way, meeting = (float(np.median(series)) for series in inner)
    return [
        figure(f"two {name}: global minima certified", "count", int(right), of=count, reach=count),
        figure(f"two {name}, median", "seconds", median, reach=reach),
        figure(f"two {name}, 99th percentile", "seconds", float(np.percentile(spent, 99.0))),
        figure(f"two {name}: separated by half the distance, part of its time", "ratio", parts[0], reach=0.2),
        figure(f"two {name}: collision, part of the distance's time", "ratio", parts[1], reach=0.2),
        figure(f"two {name}, in a kernel", "seconds", whole),
        figure(f"two {name}: separated by half the distance, in a kernel", "ratio", half_way / whole, reach=0.2),
        figure(f"two {name}: collision, in a kernel", "ratio", meeting / whole, reach=0.2),
        figure(f"packing one of {name}", "seconds", float(np.median(pack))),
        figure(f"the capsules of one of {name}", "seconds", float(np.median(trees))),
    ]


def _packing(curve: NurbsCurve) -> float:
    from time import perf_counter

    start = perf_counter()
    _ = curve._packed_pieces
    return perf_counter() - start


def _points(degree: int, curves: int, repeats: int) -> list[dict[str, Any]]:
    rng = np.random.default_rng(2)
    count = 20
    n = degree
    products = np.array([[comb(n, i) * comb(n, j) / comb(2 * n, i + j) for j in range(n + 1)] for i in range(n + 1)])
    stack, out = np.empty((200, 2 * n + 1)), np.empty(11)
    right = 0
    distance: list[float] = []
    clear: list[float] = []
    collide: list[float] = []
    plain, python, batch = [], [], []
    for _ in range(curves):
        curve = random_bezier(rng, degree)
        points = rng.random((count, 3))
        record, pool = curve._packed_pieces
        squares = np.stack([squared_distance(curve.control_points, p, products) for p in points])
        lower, upper, _parameters = minimum_distances(points, curve)
        for i, point in enumerate(points):
            known = subdivide(squares[i], 1e-10, stack)[0]
            right += (
                lower[i] <= known + 1e-12 and upper[i] - lower[i] <= TOLERANCE and upper[i] <= known + 2 * TOLERANCE
            )
            python.append(_seconds(partial(minimum_distance, curve, point), repeats))
        none, half, zero = np.full(count, -1.0), 0.5 * lower, np.zeros(count)
        tree = capsule_tree(record, pool)
        for series, clearance in ((distance, none), (clear, half), (collide, zero)):
            call = partial(point_question_often, record, pool, tree, points, clearance, nearest_address(), out)
            series.append(_seconds(call, repeats) / count)
        plain.append(_seconds(partial(subdivide_often, squares, 1, stack), repeats) / count)
        batch.append(_seconds(partial(minimum_distances, points, curve), repeats) / count)
    reach = {5: 5e-6, 10: 12e-6}.get(degree)
    own = float(np.median(distance))
    other = float(np.median(plain))
    parts = [float(np.median(series)) / own for series in (clear, collide)]
    name = f"point and Bezier curve of degree {degree}"
    return [
        figure(f"{name}: global minima certified", "count", int(right), of=curves * count, reach=curves * count),
        figure(f"{name}, from Python", "seconds", float(np.median(python)), reach=reach),
        figure(f"{name}, in a kernel", "seconds", own, reach=other, peers={"subdivision": other}),
        figure(f"{name}, batch of {count}, each", "seconds", float(np.median(batch))),
        figure(f"{name}: separated by half the distance, in a kernel", "ratio", parts[0], reach=0.2),
        figure(f"{name}: collision, in a kernel", "ratio", parts[1], reach=0.2),
    ]


def run(quick: bool) -> dict[str, Any]:
    """Pairs of curves of three kinds, and points against Bezier curves of rising degree."""
    count, curves, repeats = (4, 2, 2) if quick else (200, 10, 9)
    figures = []
    for name in KINDS:
        figures += _pairs(name, count, repeats)
    for degree in DEGREES[:2] if quick else DEGREES:
        figures += _points(degree, curves, repeats)
    return {"about": ABOUT, "figures": figures}
