"""CurveProximityQueries.jl: its README and the curves of `test/runtests.jl` and of `examples`.

The README prints a cubic and a polygon of twenty corners to six digits, and the answers of its queries to sixteen: the
distance is asked for to the tolerance of its own tests, 1e-5, and is to be no larger than what it found. The curves of
its tests are random numbers of another language; what is left of these tests is what holds of any curve, tried on
curves that are written down here.
"""

from __future__ import annotations

from math import comb

import numpy as np
import pytest

import assembly as asm
from assembly.proximity import closest_points, collides, is_separated, minimum_distance

CUBIC = asm.NurbsCurve.bezier([(0.0, 0.0), (1.0, 2.0), (2.0, 0.0), (3.0, 0.0)])
POLYGON = np.array(
    [
        (0.642686, 2.36248),
        (0.622121, 2.34973),
        (0.42866, 2.06399),
        (0.412454, 2.0344),
        (0.454968, 1.98069),
        (0.499506, 1.92797),
        (0.599317, 1.82251),
        (0.62982, 1.79366),
        (0.659987, 1.76526),
        (0.733777, 1.71118),
        (0.87861, 1.63702),
        (1.07313, 1.54129),
        (1.46142, 1.68951),
        (1.46817, 1.72673),
        (1.48588, 1.85669),
        (1.46772, 2.06245),
        (1.3987, 2.23026),
        (1.30631, 2.4218),
        (1.20662, 2.61294),
        (0.88346, 2.47282),
    ]
)
DISTANCE = 0.6542938586889715
DIGITS = 1e-6  # of the corners


@pytest.mark.parametrize(("t", "point"), [(0.5, (1.5, 0.75)), (0.0, (0, 0)), (1.0, (3, 0))])
def test_a_point_of_the_cubic(t, point):
    # c(1.5) with limits from 0.5 to 2.5 is the middle.
    assert np.abs(CUBIC.evaluate(t) - point).max() < 1e-15


@pytest.mark.parametrize("bound", ["auto", "ellipsoid", "capsule", "taylor"])
def test_distance_of_the_cubic_and_the_polygon(bound):
    answer = minimum_distance(CUBIC, POLYGON, 1e-9, bound=bound)
    assert answer.converged
    assert DISTANCE - 1e-5 < answer.lower and answer.upper < DISTANCE + DIGITS


@pytest.mark.parametrize(("clearance", "separated"), [(0.5, True), (1.0, False)])
@pytest.mark.parametrize("swapped", [False, True], ids=["curve first", "polygon first"])
def test_tolerance_verification(clearance, separated, swapped):
    pair = (POLYGON, CUBIC) if swapped else (CUBIC, POLYGON)
    assert is_separated(*pair, clearance) is separated


def test_collision_detection():
    assert collides(CUBIC, POLYGON) is False


def test_closest_points():
    on_curve, on_polygon = closest_points(CUBIC, POLYGON)
    assert np.abs(on_polygon - (1.07313, 1.54129)).max() < DIGITS  # a corner
    assert np.abs(on_curve - (1.03968, 0.887853)).max() < 5e-3  # a distance off by 1e-5 is a foot off by its root


# The curve of examples/fig6.jl.
FIGURE_6 = np.array(
    [
        (0.944223, 0.177264),
        (0.46193, 0.105887),
        (0.791169, 0.172386),
        (0.256546, 0.463735),
        (0.70966, 0.3173),
        (0.664713, 0.830956),
        (0.952688, 0.736242),
        (0.00763912, 0.97189),
        (0.270595, 0.827442),
        (0.16636, 0.996615),
        (0.381073, 0.543077),
        (0.225381, 0.754049),
        (0.570043, 0.638543),
        (0.254696, 0.988563),
    ]
)


def bernstein(points, t):
    """A Bernstein polynomial by its sum."""
    n = len(points) - 1
    return sum(comb(n, k) * np.multiply.outer(t**k * (1 - t) ** (n - k), points[k]) for k in range(n + 1))


@pytest.mark.parametrize("point", [(0.0, 0.0), (1.0, 1.0), (0.2, 0.2), (0.9, 0.5), (-0.5, 0.4)])
def test_points_and_the_curve_of_figure_6(point):
    # As "Curve - Polygon" of the tests: the distance, a clearance below it and one above it, no collision; both orders.
    curve = asm.NurbsCurve.bezier(FIGURE_6)
    t = np.linspace(0.0, 1.0, 40001)
    apart = np.linalg.norm(bernstein(FIGURE_6, t) - point, axis=1)
    best = t[np.argmin(apart)]
    near = np.linspace(max(best - 1e-4, 0), min(best + 1e-4, 1), 20001)
    sampled = float(np.linalg.norm(bernstein(FIGURE_6, near) - point, axis=1).min())
    at = np.array(point)
    for pair in ((curve, at), (at, curve)):
        answer = minimum_distance(*pair, 1e-11)
        assert answer.lower <= sampled + 1e-13 and sampled - 1e-9 <= answer.upper <= sampled + 1e-11
        assert is_separated(*pair, 0.9 * sampled) and not is_separated(*pair, 1.1 * sampled)
        assert not collides(*pair)


def test_curves_that_cross():
    # "Curve - Curve" in the plane: distance zero, not separated, a collision.
    other = asm.NurbsCurve.bezier([(0.2, 0.1), (0.5, 0.9), (0.9, 0.4)])
    curve = asm.NurbsCurve.bezier(FIGURE_6)
    assert minimum_distance(curve, other, 1e-9).upper <= 1e-9
    assert not is_separated(curve, other, 0.3) and collides(curve, other)


@pytest.mark.parametrize("shift", [0.5, 1.0, 4.0])
def test_curves_in_space(shift):
    # "Curve - Curve" in space: a curve of the README and itself, moved along z: the shift, along the whole of it, is an
    # upper bound; by more than its own height it is apart.
    points = np.array(
        [
            (0.345747, 0.149338, 0.609345),
            (0.86539, 0.736102, 0.31424),
            (0.20149, 0.167441, 0.662126),
            (0.975667, 0.468056, 0.505278),
            (0.371533, 0.477992, 0.83668),
            (0.322821, 0.973494, 0.93129),
        ]
    )
    first, second = asm.NurbsCurve.bezier(points), asm.NurbsCurve.bezier(points + (0, 0, shift))
    answer = minimum_distance(first, second, 1e-6)
    assert answer.lower <= shift and answer.upper <= shift + 1e-6
    assert answer.lower > shift - (0.93129 - 0.31424)
    assert collides(first, second) is False


@pytest.mark.parametrize(
    ("obstacle", "distance"),
    [
        ((5.0, 0.0), 2.0),  # @point, ahead of the end (3, 0)
        (((0.0, -1.0), (2.0, -1.0)), 1.0),  # @line
        (((5.0, -1.0), (7.0, -1.0), (7.0, 1.0), (5.0, 1.0)), 2.0),  # @square
        (((-3.0, -0.5), (-1.0, -0.5), (-1.0, 0.5), (-3.0, 0.5)), 1.0),  # @rect
    ],
    ids=["point", "line", "square", "rect"],
)
def test_obstacle_types(obstacle, distance):
    answer = minimum_distance(CUBIC, np.array(obstacle), 1e-10)
    assert answer.lower <= distance + 1e-13 and distance - 1e-13 <= answer.upper and answer.converged
