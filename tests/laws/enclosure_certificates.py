"""Certificates of enclosures against samples: ``python -m tests.laws.enclosure_certificates [COUNT]`` of each sort.

Formula and spline curves against points, hulls and each other, by every bound, with and without a clearance, and
formula curves in space against surfaces. What is known without the code under test: dense samples, then samples closer
and closer about the nearest of them.
"""

from __future__ import annotations

import sys
from collections import Counter

import casadi as ca
import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.distance import cdist

import assembly as asm
from assembly.distance.enclosures.queries import enclosed_distance
from assembly.proximity import SeparationStatus, minimum_distance
from tests.laws.certificates import bounds_fault
from tests.laws.curve_queries import random_curve

TOLERANCE = 1e-10
# Rounding of the oracle's own sums, of shapes of the size of one.
ROUNDING = 2e-14
# Bound, polish and budget: bounds have to be true whether or not a search ends within it.
WAYS = (
    ("auto", True, 20_000),
    ("auto", True, 20_000),
    ("ellipsoid", False, 300),
    ("ellipsoid", True, 300),
    ("capsule", True, 300),
    ("taylor", True, 300),
)
SPLINES = ("polyline", "arc", "cubic", "rational cubic of five spans", "quintic", "degree 10")
SORTS = ("point", "hull", "curve")
# Polish and budget of queries with a surface.
SURFACE_WAYS = ((True, 50_000), (False, 300), (True, 30))
T = ca.SX.sym("t")


def formula_curve(rng, dimension):
    """A random curve given by a formula, about as large as the unit square or cube."""
    if dimension == 3:
        waves = [rng.uniform(0.2, 0.5) * ca.sin(rng.uniform(0.5, 3.0) * T + rng.uniform(0, 6)) for _ in range(2)]
        if rng.random() < 0.3:
            return asm.curves.helix(0.4, rng.uniform(0.1, 0.4), 3.0, center=rng.random(3))
        return asm.FormulaCurve(ca.vertcat(*waves, rng.random() * ca.tanh(T - 2) + 0.05 * T * T), T, (0.0, 4.0))
    placed = {"angle": rng.uniform(0, 360), "center": rng.random(2)}
    makers = (
        lambda: asm.curves.heart(0.03, **placed),
        lambda: asm.curves.ranunculoid(0.06, **placed),
        lambda: asm.curves.ellipse(rng.uniform(0.1, 0.6, 2), **placed),
        lambda: asm.curves.involute(0.05, rng.uniform(3, 10), **placed),
        lambda: asm.curves.fish(0.4, **placed),
        lambda: asm.curves.lissajous(rng.uniform(0.3, 0.6, 2), (3, 2), rng.uniform(0, 1), **placed),
        lambda: asm.curves.euler_spiral(0.6, rng.uniform(2, 6), **placed),
    )
    return makers[rng.integers(len(makers))]()


def some_curve(rng, dimension):
    if rng.random() < 0.5:
        return formula_curve(rng, dimension)
    return random_curve(rng, SPLINES[rng.integers(len(SPLINES))], dimension)


def other_shape(rng, sort, curve, dimension):
    """A point or a hull near a curve, at every order of distance from it, or another curve."""
    if sort == "curve":
        return some_curve(rng, dimension)
    at = curve.evaluate(rng.uniform(*curve.domain)) + 10.0 ** rng.uniform(-12.0, 0.0) * rng.normal(size=dimension)
    if sort == "point":
        return at
    count = int(rng.integers(dimension + 1, 12))
    return at + rng.uniform(0.05, 0.4) * (rng.random((count, dimension)) - rng.random(dimension))


def some_surface(rng):
    """A surface of the size of one near the unit cube: bicubic with or without weights, a torus, a plane."""
    kind = rng.integers(4)
    if kind == 0:
        return asm.shapes.torus(rng.uniform(0.3, 0.7), rng.uniform(0.05, 0.25))
    if kind == 1:
        return asm.shapes.plane(*rng.uniform(0.3, 1.5, 2))
    knots = ([0, 0, 0, 0, 0.4, 1, 1, 1, 1], [0, 0, 0, 0, 1, 1, 1, 1])
    weights = rng.uniform(0.3, 3.0, (5, 4)) if kind == 2 else None
    net = rng.random((5, 4, 3)) + rng.uniform(-0.5, 1.5, 3)
    return asm.NurbsSurface(net, knots, (3, 3), weights)


def formula_near(rng, surface):
    """A formula in space, smooth, with a kink, or that starts with a vertical; half of them at a surface.

    Those have a point at every order of distance from one of the surface.
    """
    a, b, c = rng.uniform(0.2, 0.8, 3)
    tail = (ca.fabs(T - 1.1), ca.sqrt(T), ca.sin(2 * T + 50.0), ca.tanh(T) / (1.0 + T * T))[rng.integers(4)]
    column = ca.vertcat(a * T - 0.5, b * ca.cos(rng.uniform(1, 4) * T), c * tail)
    domain = (0.0, 2.0 + rng.random())
    if rng.random() < 0.5:
        return asm.FormulaCurve(column + ca.SX(rng.uniform(-0.5, 1.5, 3)), T, domain)
    curve = asm.FormulaCurve(column, T, domain)
    place = surface.evaluate(*(rng.uniform(*side) for side in surface.domain))
    off = 10.0 ** rng.uniform(-12.0, -1.0) * rng.normal(size=3)
    return asm.FormulaCurve(column + ca.SX(place - curve.evaluate(rng.uniform(*domain)) + off), T, domain)


def segment_distances(x, p, q):
    """Of points x (n, d) and a segment."""
    d = q - p
    t = np.clip((x - p) @ d / (d @ d), 0.0, 1.0)
    return np.linalg.norm(x - p - t[:, None] * d, axis=1)


def hull_distances(x, vertices):
    """Of points (n, d) and the convex hull of vertices."""
    if len(vertices) == 1:
        return np.linalg.norm(x - vertices, axis=1)
    hull = ConvexHull(vertices)
    outside = x @ hull.equations[:, :-1].T + hull.equations[:, -1]
    best = np.full(len(x), np.inf)
    for simplex, plane, above in zip(hull.simplices, hull.equations, outside.T, strict=True):
        corners = vertices[simplex]
        for k in range(len(corners)):
            best = np.minimum(best, segment_distances(x, corners[k], corners[k - 1]))
        if len(corners) == 3:
            foot = x - above[:, None] * plane[:-1]
            sides = [
                np.cross(corners[k] - corners[k - 1], foot - corners[k - 1]) @ plane[:-1] for k in range(len(corners))
            ]
            within = (np.min(sides, axis=0) >= 0.0) | (np.max(sides, axis=0) <= 0.0)
            best = np.where(within, np.minimum(best, np.abs(above)), best)
    return np.where((outside <= 0.0).all(axis=1), 0.0, best)


def known_distance(a, b, count=400, rounds=14, part=41):
    """A distance that two points of the shapes have, nearly the least one."""
    curves = [a, b] if not isinstance(b, np.ndarray) else [a]
    ranges = [np.linspace(*curve.domain, count) for curve in curves]
    best = np.inf
    for _ in range(rounds + 1):
        points = [curve.evaluate(t) for curve, t in zip(curves, ranges, strict=True)]
        d = cdist(*points) if len(points) == 2 else hull_distances(points[0], np.atleast_2d(b))
        at = np.unravel_index(np.argmin(d), d.shape)
        best = min(best, float(d[at]))
        ranges = [
            np.linspace(t[max(k - 2, 0)], t[min(k + 2, len(t) - 1)], part) for t, k in zip(ranges, at, strict=True)
        ]
    return best


def known_surface_distance(curve, surface, count=120, grid=40, rounds=20, part=13):
    """A distance that two points of a curve and a surface have, nearly the least one."""
    ranges = [
        np.linspace(*side, n) for side, n in zip((curve.domain, *surface.domain), (count, grid, grid), strict=True)
    ]
    best = np.inf
    for _ in range(rounds + 1):
        t, u, v = ranges
        d = cdist(curve.evaluate(t), surface.evaluate(u[:, None], v[None]).reshape(-1, 3))
        i, at = np.unravel_index(np.argmin(d), d.shape)
        best = min(best, float(d[i, at]))
        ranges = [
            np.linspace(row[max(k - 2, 0)], row[min(k + 2, len(row) - 1)], part)
            for row, k in zip(ranges, (i, at // len(v), at % len(v)), strict=True)
        ]
    return best


def fault(answer, a, b, known, clearance):
    """What is wrong with an answer where a distance is known; None if it is right."""
    if wrong := bounds_fault(answer, known, ROUNDING):
        return wrong
    shapes = [a] if isinstance(b, np.ndarray) else [a, b]
    parameters = answer.parameters
    for shape, point in zip(shapes, answer.points, strict=False):
        count = 2 if isinstance(shape, asm.NurbsSurface) else 1
        at, parameters = parameters[:count], parameters[count:]
        # A parameter is rounded, which moves the point by its rates; at a vertical nothing moves it.
        place, rates = shape.evaluate(*at), np.zeros(3)
        if not isinstance(shape, asm.FormulaCurve) or shape.speed(*at, *at)[1] < np.inf:
            rates = shape.evaluate(*at, 1)[1:]
        if np.abs(place - point).max() > 4e-14 * (1.0 + np.abs(at).max() * np.linalg.norm(rates)):
            return f"the point {point!r} is not at the parameters {at!r}"
    if isinstance(b, np.ndarray) and hull_distances(answer.points[1][None], np.atleast_2d(b))[0] > ROUNDING:
        return f"the point {answer.points[1]!r} is not in the hull"
    status = answer.status
    if status is SeparationStatus.CONVERGED and answer.upper > known + TOLERANCE + ROUNDING:
        return f"converged to {answer.upper!r} with {known!r} known"
    if status is SeparationStatus.SEPARATED and not clearance < known + ROUNDING:
        return f"separated by {clearance!r} with {known!r} known"
    if status is SeparationStatus.DISJOINT and known == 0.0:
        return "disjoint, with a common point known"
    return None


def faults(rng, sort, dimension, count):
    """(what is wrong, bound, clearance, a, b) of random queries, every way on every pair; statuses that came."""
    found, done, statuses = [], 0, Counter()
    while done < count:
        curve = some_curve(rng, dimension)
        for _ in range(8):
            other = other_shape(rng, sort, curve, dimension)
            known = known_distance(curve, other)
            for bound, polish, budget in WAYS:
                clearance = [None, 0.0, known * rng.uniform(0.5, 1.5), known][rng.integers(4)]
                # Either order of the two.
                pair = (curve, other) if rng.random() < 0.7 or sort == "curve" else (other, curve)
                answer = enclosed_distance(*pair, TOLERANCE, clearance, bound, polish, budget)
                if pair[0] is not curve:
                    answer = swapped(answer)
                wrong = fault(answer, curve, other, known, clearance)
                statuses[answer.status.name] += 1
                if wrong:
                    found.append((wrong, bound, clearance, curve, other))
                done += 1
    return found, done, statuses


def swapped(answer, first=0):
    """The answer for the shapes in the other order; the first of them has so many parameters."""
    return type(answer)(
        answer.lower,
        answer.upper,
        np.roll(answer.parameters, -first),
        answer.points[::-1],
        answer.status,
        answer.evaluations,
    )


def surface_faults(rng, count):
    """The same as `faults` of formula curves and surfaces."""
    found, done, statuses = [], 0, Counter()
    while done < count:
        surface = some_surface(rng)
        for _ in range(4):
            curve = formula_near(rng, surface)
            known = known_surface_distance(curve, surface)
            for polish, budget in SURFACE_WAYS:
                clearance = [None, 0.0, known * rng.uniform(0.5, 1.5), known][rng.integers(4)]
                options = {"clearance": clearance, "polish": polish, "max_evaluations": budget}
                if rng.random() < 0.7:
                    answer = minimum_distance(curve, surface, TOLERANCE, **options)
                else:
                    answer = swapped(minimum_distance(surface, curve, TOLERANCE, **options), 2)
                wrong = fault(answer, curve, surface, known, clearance)
                statuses[answer.status.name] += 1
                if wrong:
                    found.append((wrong, polish, clearance, curve, surface))
                done += 1
    return found, done, statuses


def main(count):
    """Print what is found, at every batch the sums so far; the number of faults."""
    total = {}
    batch = max(min(count, 2000), 1)
    for start in range(0, count, batch):
        for dimension in (2, 3):
            for k, sort in enumerate((*SORTS, "surface") if dimension == 3 else SORTS):
                rng = np.random.default_rng([start, dimension, k])
                if sort == "surface":
                    found, done, statuses = surface_faults(rng, batch)
                else:
                    found, done, statuses = faults(rng, sort, dimension, batch)
                sums = total.setdefault((dimension, sort), [0, 0, Counter()])
                sums[0] += len(found)
                sums[1] += done
                sums[2].update(statuses)
                print(
                    f"{dimension}-D, {sort}: {sums[0]} faults in {sums[1]} queries",
                    dict(sums[2]),
                    found[:2],
                    flush=True,
                )
    return sum(sums[0] for sums in total.values())


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000) > 0)
