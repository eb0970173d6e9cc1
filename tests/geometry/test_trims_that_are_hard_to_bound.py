"""Boundaries whose speed vanishes or runs far apart: what is nearest, and how large the face is."""

from __future__ import annotations

import numpy as np
import pytest

from assembly.distance.queries import minimum_distances
from assembly.errors import InputError
from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.curve import NurbsCurve

PLANE = shapes.plane(10.0, 10.0)


def polygon_of(corners, weights):
    """A loop of degree 1: straight between its corners, whatever the weights are."""
    count = len(corners)
    return NurbsCurve(corners, np.r_[0.0, 0.0, np.linspace(0.0, 1.0, count)[1:-1], 1.0, 1.0], 1, weights)


def from_segments(corners, points):
    """Distances of points from a polygon."""
    a, d = corners[:-1], np.diff(corners, axis=0)
    s = np.clip(((points[:, None] - a) * d).sum(2) / (d**2).sum(1), 0.0, 1.0)
    return np.linalg.norm(a + s[..., None] * d - points[:, None], axis=2).min(axis=1)


@pytest.mark.parametrize("weight", [1.0, 30.0, 300.0, 1e4, 1e6])
def test_a_square_is_one_whatever_its_weights(weight):
    # Speeds differ by the square of the weight along every side. A point's rounding grows by the weight's ratio.
    corners = np.array([[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0], [-2.0, -2.0]])
    face = Face(PLANE, polygon_of(corners, [1.0, weight, 1.0, weight, 1.0]))
    u, v = np.random.default_rng(0).uniform(-1.99, 1.99, (2, 1000))
    wanted = 2.0 - np.maximum(np.abs(u), np.abs(v))
    rounding = 1e-14 + 1e-15 * weight
    np.testing.assert_allclose(face.trim_distance(u, v), wanted, rtol=0, atol=rounding)
    near = face.nearest_on_boundary(u, v)
    np.testing.assert_allclose(np.hypot(*(near.point.T - [u, v])), wanted, rtol=0, atol=rounding)
    # The search in space lets go of 1e-10 of the square of the distance.
    np.testing.assert_allclose(face.space_distance(u, v), wanted, rtol=1e-10, atol=rounding)
    assert face.area() == pytest.approx(16.0, rel=1e-13 + 1e-16 * weight)


@pytest.mark.parametrize("spread", [0.3, 1.0, 2.0])
@pytest.mark.parametrize("degree", [1, 2, 3])
def test_random_weights(degree, spread):
    rng = np.random.default_rng([degree, int(10 * spread)])
    tried = 0
    while tried < 12:
        angle = np.linspace(0.0, 2.0 * np.pi, 8)
        radius = 3.0 * (1.0 + 0.25 * rng.uniform(-1.0, 1.0, 8))
        points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
        weights = 10.0 ** rng.uniform(-spread, spread, 8)
        points[-1], weights[-1] = points[0], weights[0]
        knots = np.r_[np.zeros(degree + 1), np.linspace(0.0, 1.0, 9 - degree)[1:-1], np.ones(degree + 1)]
        curve = NurbsCurve(points, knots, degree, weights)
        try:
            face = Face(PLANE, curve)
        except InputError:  # it crosses itself
            continue
        tried += 1
        at = rng.uniform(-4.5, 4.5, (60, 2))
        near = face.nearest_on_boundary(*at.T)
        lower, upper, _ = minimum_distances(at, curve, 1e-12)
        # Bounds are 1e-12 apart; rounding grows with the spread of the weights.
        slack = 1e-12 * 10.0**spread
        assert (np.abs(near.distance) > lower - slack).all() and (np.abs(near.distance) < upper + slack).all()
        if degree == 1:
            np.testing.assert_allclose(np.abs(near.distance), from_segments(points, at), rtol=0, atol=slack)


def test_corners_at_which_the_speed_vanishes():
    # Control points that are repeated at the loop's ends: the parameter of the corner is known to a part of its root.
    rng = np.random.default_rng(11)
    tried = at_corner = 0
    while tried < 40:
        degree = int(rng.choice([3, 5, 8]))
        count = degree + int(rng.integers(2, 5))
        angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, count))
        radius = 3.0 * (1.0 + 0.3 * rng.uniform(-1.0, 1.0, count))
        points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
        points = np.concatenate([points, points[:1]])
        points[1:4] = points[0]
        inner = np.sort(rng.random(count - degree))
        curve = NurbsCurve(points, np.r_[np.zeros(degree + 1), inner, np.ones(degree + 1)], degree)
        try:
            face = Face(PLANE, curve)
        except InputError:
            continue
        tried += 1
        at = rng.uniform(-4.5, 4.5, (60, 2))
        near = face.nearest_on_boundary(*at.T)
        lower, upper, _ = minimum_distances(at, curve, 1e-12)
        assert (np.abs(near.distance) > lower - 1e-11).all() and (np.abs(near.distance) < upper + 1e-11).all()
        corner = np.linalg.norm(near.point - points[0], axis=1) < 1e-9
        at_corner += int(corner.sum())
        # Where the corner is nearest, distances are those from it, not those from a tangent.
        away = np.linalg.norm(at[corner] - points[0], axis=1)
        np.testing.assert_allclose(np.abs(near.distance[corner]), away, rtol=0, atol=1e-9)
    assert at_corner > 150


def test_a_foot_that_is_rounded_to_beside_its_corner():
    # The foot's parameter is one rounding short of the knot at the corner.
    corners = np.array(
        [
            [2.596631462213455, 0.0],
            [1.5661615383176226, 1.9639044514231054],
            [-0.7476400468785134, 3.2756250704479233],
            [-3.1125138664258043, 1.4989076787571545],
            [-2.1458962305807026, -1.033409159242414],
            [-0.7123732541467642, -3.12111115575231],
            [2.1731795391558375, -2.7250809487215344],
            [2.596631462213455, 0.0],
        ]
    )
    weights = [1.256041260397361, 0.8467465643074287, 0.9297846020370925, 0.728361480081727]
    weights += [1.2622291820406484, 0.7508125075417987, 1.0329575065173873, 1.256041260397361]
    face = Face(PLANE, polygon_of(corners, weights))
    at = np.array([-3.5961668828257713, 1.8461417471836743])
    assert face.trim_distance(*at) == pytest.approx(-np.linalg.norm(at - corners[3]), abs=1e-15)
