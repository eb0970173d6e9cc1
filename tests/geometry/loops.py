"""Curves, loops and faces that tests of trims share."""

from __future__ import annotations

import numpy as np

from assembly.geometry.faces.face import Face
from assembly.geometry.splines.curve import NurbsCurve

HALF = np.sqrt(0.5)
_CIRCLE = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float)


def segment(start, end):
    return NurbsCurve([start, end], [0.0, 0.0, 1.0, 1.0], 1)


def polygon(*points):
    """Segments from point to point and back to the first."""
    return [segment(a, b) for a, b in zip(points, (*points[1:], points[0]), strict=True)]


def polyline(*points):
    """One curve of degree one through points, closed."""
    points = np.array([*points, points[0]], dtype=float)
    return NurbsCurve(points, [0, *range(len(points)), len(points) - 1], 1)


def circle(center, radius):
    """Counterclockwise from the rightmost point, exact."""
    weights = [1.0, HALF, 1.0, HALF, 1.0, HALF, 1.0, HALF, 1.0]
    return NurbsCurve(radius * _CIRCLE + center, [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], 2, weights)


def blob(rng, center, radius, wiggle=0.3):
    """A closed rational curve of random degree around a center; its polygon is star-shaped, so it has no crossings."""
    degree = int(rng.integers(1, 6))
    n = int(rng.integers(max(degree + 1, 5), 12))
    angle = (np.arange(n) + rng.uniform(-0.3, 0.3, n)) * 2.0 * np.pi / n
    points = radius * (1.0 + wiggle * rng.uniform(-1, 1, (n, 1))) * np.column_stack([np.cos(angle), np.sin(angle)])
    weights = rng.uniform(0.5, 2.0, n)
    points, weights = np.vstack([points, points[:1]]) + center, np.append(weights, weights[0])
    knots = np.concatenate([np.zeros(degree), np.linspace(0.0, 1.0, n + 2 - degree), np.ones(degree)])
    return NurbsCurve(points, knots, degree, weights)


def random_face(rng, surface):
    """A face on a plane around the origin, of extent 10, with three holes."""
    holes = [blob(rng, center, 0.25) for center in ((0.7, 0.0), (-0.7, 0.1), (0.0, 0.8))]
    return Face(surface, blob(rng, (0.0, 0.0), 3.0), holes)


def dense(curve, count=2000):
    """Points along a curve, its breaks among them."""
    low, high = curve.domain
    return curve.evaluate(np.unique(np.concatenate([np.linspace(low, high, count), curve.breaks()])))


def polygon_winding(points, u, v):
    """Winding number of a closed polygon around points, by crossings of the ray downward."""
    total = np.zeros(u.shape, dtype=int)
    for (a, b), (c, d) in zip(points[:-1], points[1:], strict=True):
        if a == c:
            continue
        passes = (u >= min(a, c)) & (u < max(a, c))
        above = v[passes] > b + (d - b) * (u[passes] - a) / (c - a)
        total[passes] += above * (1 if c > a else -1)
    return total
