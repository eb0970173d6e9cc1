"""HIT and DISJOINT against exact fractions: points of hulls on their diagonals, and points a little outside of them."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import assembly as asm
from assembly.proximity import SeparationStatus as Status

BOX = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


def exact(points):
    return [[Fraction(float(c)) for c in row] for row in np.atleast_2d(points)]


def in_polygon(x, corners):
    """Whether a point is in a convex polygon whose corners go round counterclockwise."""
    (p,), around = exact(x), exact(corners)
    return all(
        (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) >= 0
        for a, b in zip(around, around[1:] + around[:1], strict=True)
    )


def det(a, b, c):
    return a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])


def in_octahedron(x, axes):
    """Whether a point is in the hull of three vectors and their opposites: its three parts add to one at most."""
    (p,), (a, b, c) = exact(x), exact(axes)
    return abs(det(p, b, c)) + abs(det(a, p, c)) + abs(det(a, b, p)) <= abs(det(a, b, c))


def status(a, b):
    return asm.proximity.minimum_distance(a, b, 1e-10 * np.abs(b).max(), clearance=0.0).status


def parts(rng, count):
    """Where on the way from the center to the border: inside, on it, and a little to both sides of it."""
    little = 10.0 ** rng.uniform(-16, -3, count) * rng.choice([-1.0, 1.0], count)
    return np.where(rng.random(count) < 0.2, rng.random(count), 1.0 + little * (rng.random(count) < 0.95))


def checked(said, inside, part):
    assert (said is not Status.HIT) or inside
    assert (said is not Status.DISJOINT) or not inside
    # At a corner simplexes are small: a depth of 1e-6 of the size is enough on any diagonal.
    assert part > 1.0 - 1e-6 or said is Status.HIT
    assert part < 1.0 + 1e-6 or said is Status.DISJOINT


@pytest.mark.parametrize("n", [3, 4, 5, 6, 8, 12])
def test_points_of_polygons(n):
    rng = np.random.default_rng(n)
    for part in parts(rng, 250):
        scale = 10.0 ** rng.choice([-9.0, 0.0, 0.0, 6.0])
        angles = rng.uniform(0, 6) + 2 * np.pi / n * np.arange(n)
        corners = scale * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        k, j = rng.integers(n, size=2)
        # Along a diagonal, or from the center to anywhere on an edge.
        end = corners[k] if rng.random() < 0.5 else rng.random() * (corners[k - 1] - corners[k]) + corners[k]
        x = part * end
        if n % 2 == 0 and rng.random() < 0.2:
            x, part = rng.uniform(-0.2, 0.2) * corners[j], 0.2
        checked(status(x, rng.permutation(corners)), in_polygon(x, corners), part)


def test_points_of_octahedra():
    rng = np.random.default_rng(1)
    for part in parts(rng, 600):
        axes = 10.0 ** rng.choice([-9.0, 0.0, 6.0]) * np.linalg.qr(rng.normal(size=(3, 3)))[0]
        weights = rng.dirichlet(np.ones(3)) * rng.choice([-1.0, 1.0], 3)
        if rng.random() < 0.7:  # in a plane of two diagonals, or on one
            weights[rng.integers(3)] = 0.0
            weights[rng.integers(3)] = 0.0
        size = np.abs(weights).sum()
        weights = part * weights / size if size > 0.0 else weights
        x = weights @ axes
        hull = rng.permutation(np.concatenate([axes, -axes]))
        checked(status(x, hull), in_octahedron(x, axes), part if size > 0.0 else 0.0)


def test_boxes_and_boxes():
    """One beside the other, or in it, by a part of its width: exact by coordinates."""
    rng = np.random.default_rng(2)
    for part in parts(rng, 400):
        shift = (1.0 + rng.integers(2)) * np.eye(3)[rng.integers(3)]
        other = BOX * (0.5 * shift.sum() if shift.sum() < 2.0 else 1.0)
        reach = 1.0 + other.max()
        other = other + part * reach * np.sign(shift)
        low = np.maximum(BOX.min(axis=0), other.min(axis=0))
        high = np.minimum(BOX.max(axis=0), other.max(axis=0))
        checked(status(rng.permutation(other), rng.permutation(BOX)), bool((low <= high).all()), part)


@pytest.mark.parametrize("scale", [3.0, 5.0, 50.0, 1e4])
def test_curves_within_hulls(scale):
    angles = np.pi / 3 * np.arange(6)
    hexagon = scale * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    circle = asm.curves.ellipse((1.0, 1.0))
    diagonal = asm.NurbsCurve.bezier([hexagon[0] / 2, [0.0, 0.0], hexagon[3] / 2])
    for curve in (circle, diagonal):
        for a, b in ((curve, hexagon), (hexagon, curve)):
            answer = asm.proximity.minimum_distance(a, b, clearance=0.0)
            assert answer.status is Status.HIT and answer.lower == answer.upper == 0.0
            assert in_polygon(answer.points[0], hexagon)


def test_points_of_hulls_that_meet_are_points_of_both():
    for shift in ((0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (1.3, -0.2, 0.7)):
        answer = asm.proximity.minimum_distance(0.5 * BOX + shift, BOX)
        assert answer.status is Status.HIT
        assert (np.abs(answer.points) <= 1.0 + 1e-15).all() and np.ptp(answer.points, axis=0).max() < 1e-14
        assert (np.abs(answer.points - np.array(shift)) <= 0.5 + 1e-15).all()
