"""OCCT, tests of package `Extrema`: extrema of circles, lines, planes and spheres.

`Extrema_ExtElC_Test` and `Extrema_ExtCC_Test` (circles), `Extrema_ExtCS_Test` (a line and a plane or a sphere),
`Extrema_ExtSS_Test` (planes, spheres), `Extrema_ExtPC_Test` (a point and a circle). Where a test there asks for an
inequality only, the closed form is asked for here, or both orders of the curves. Other analytic pairs of that package
(a plane or a sphere or a line with cylinder, cone and torus) follow with distances from their closed forms.
"""

from __future__ import annotations

from math import hypot, pi, sqrt

import numpy as np
import pytest

import assembly as asm
from assembly.proximity import PairStatus, closest_features, extremal_pair, minimum_distance

HERE = asm.Pose((0, 0, 0))
AXIS = asm.Pose.from_axis_angle
OVER = AXIS((1, 0, 0), pi / 2).quaternion  # z to -y
TOLERANCE = 1e-10


def circle(center, normal, radius):
    """A circle in space as one NURBS curve."""
    z = np.array(normal, dtype=float) / np.linalg.norm(normal)
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    corners = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)], dtype=float)
    weights = [1.0, sqrt(0.5)] * 4 + [1.0]
    points = np.asarray(center) + radius * corners @ np.array([x, y])
    return asm.NurbsCurve(points, [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], 2, weights)


def line(point, direction, reach=10.0):
    """A part of a line, as far as the adaptors of the tests go."""
    middle, along = np.array(point, dtype=float), np.array(direction, dtype=float)
    return asm.NurbsCurve.polyline([middle - reach * along, middle + reach * along])


X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
CIRCLES = {
    "CoplanarCircles_NotTouching": (((0, 0, 0), Z, 5), ((15, 0, 0), Z, 5), 5.0),
    "CoplanarCircles_Touching": (((0, 0, 0), Z, 5), ((10, 0, 0), Z, 5), 0.0),
    "CoplanarCircles_Intersecting": (((0, 0, 0), Z, 5), ((8, 0, 0), Z, 5), 0.0),
    "CoplanarCircles_OneInsideOther": (((0, 0, 0), Z, 10), ((2, 0, 0), Z, 3), 5.0),
    "PerpendicularCircles_Intersecting": (((0, 0, 0), Z, 5), ((0, 0, 0), Y, 5), 0.0),
    "PerpendicularCircles_NotIntersecting": (((0, 0, 0), Z, 5), ((0, 10, 0), Y, 5), None),
    "VerifyExtremaPoints": (((0, 0, 0), Z, 5), ((20, 0, 0), Z, 5), 10.0),
    "NonCoplanarCircles_Offset": (((0, 0, 0), Z, 5), ((10, 0, 0), Y, 5), 0.0),
    "LinkedCircles": (((0, 0, 0), Z, 5), ((0, 0, 0), Y, 3), 2.0),
    "ParallelCircles_OffsetCenters": (((0, 0, 0), Z, 5), ((3, 4, 12), Z, 5), 12.0),
    "NearlyCoplanar": (((0, 0, 0), Z, 5), ((15, 0, 0), (0, 1e-8, 1), 5), 5.0),
    "DifferentRadii_NonCoplanar": (((0, 0, 0), Z, 10), ((15, 0, 0), X, 2), None),
    "SkewCircles": (((0, 0, 0), Z, 5), ((10, 10, 5), (1, 1, 1), 5), None),
    "NonCoplanar_45Degrees": (((0, 0, 0), Z, 5), ((0, 10, 0), (0, -1, 1), 5), None),
    "SymmetryNonCoplanar": (((0, 0, 0), Z, 5), ((8, 3, 4), (1, 1, 2), 4), None),
    "PointsOnCircles": (((1, 2, 3), Z, 7), ((10, 5, 0), (1, 0, 1), 4), None),
}


def sampled(first, second):
    """The distance of two circles from samples of the second: of a point to a circle it is a closed form."""

    def farness(angles):
        z = np.array(second[1], dtype=float) / np.linalg.norm(second[1])
        x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
        x /= np.linalg.norm(x)
        around = np.multiply.outer(np.cos(angles), x) + np.multiply.outer(np.sin(angles), np.cross(z, x))
        d = second[0] + second[2] * around - first[0]
        axis = np.array(first[1], dtype=float)
        height = d @ axis
        return np.hypot(np.linalg.norm(d - np.multiply.outer(height, axis), axis=-1) - first[2], height)

    angles = np.linspace(0.0, 2.0 * pi, 20001)
    for _ in range(3):  # ever finer about the least
        best = angles[np.argmin(farness(angles))]
        step = angles[1] - angles[0]
        angles = np.linspace(best - step, best + step, 20001)
    return float(farness(angles).min())


@pytest.mark.parametrize("swapped", [False, True], ids=["one two", "two one"])
@pytest.mark.parametrize("name", CIRCLES)
def test_circles(name, swapped):
    first, second, distance = CIRCLES[name]
    pair = (second, first) if swapped else (first, second)
    answer = minimum_distance(*(circle(*one) for one in pair), TOLERANCE)
    expected = sampled(first, second) if distance is None else distance
    slack = 1e-11 + (1e-7 if name == "NearlyCoplanar" else 0.0)  # tilted by 1e-8
    assert answer.lower - slack <= expected <= answer.upper + slack
    assert answer.upper - answer.lower <= TOLERANCE


def test_points_of_circles():
    # VerifyExtremaPoints
    answer = minimum_distance(circle((0, 0, 0), Z, 5), circle((20, 0, 0), Z, 5), TOLERANCE)
    assert np.abs(answer.points - [(5, 0, 0), (15, 0, 0)]).max() < 1e-5


@pytest.mark.parametrize(
    ("second", "distance"),
    [
        (((0, 0, 0), Z, 5), 5.0),  # ConcentricCircles, radii 10 and 5
        (((0, 0, 10), Z, 10), 10.0),  # ParallelCircles_DifferentPlanes
    ],
    ids=["ConcentricCircles", "ParallelCircles_DifferentPlanes"],
)
def test_circles_that_are_equally_far_everywhere(second, distance):
    # OCCT calls them parallel. A tie along a whole curve takes many halvings: bounds are asked for to 1e-5.
    answer = minimum_distance(circle((0, 0, 0), Z, 10), circle(*second), 1e-5)
    assert answer.lower <= distance + 1e-12 and distance - 1e-12 <= answer.upper
    assert answer.upper - answer.lower <= 1e-5


def test_point_and_circle():
    # Bug24945_CylinderParameterNormalization: a point that is 8.6e-4 inside of a large circle.
    at = np.array((-1725.97, 843.257, -4.22741e-013))
    answer = minimum_distance(at, circle((0, 843.257, 0), Y, 1725.9708621929999), 1e-9)
    assert answer.lower - 1e-9 <= 8.621929999e-4 <= answer.upper + 1e-9
    assert np.abs(answer.points[1] - (-1725.97, 843.257, 0)).max() < 1e-2


PLANE = asm.shapes.plane(20.0, 20.0)
SPHERE = asm.shapes.sphere(3.0)


@pytest.mark.parametrize(
    ("curve", "surface", "distance"),
    [
        (line((0, 0, 5), X), PLANE, 5.0),  # LineParallelToPlaneHasADistanceButNoPoints
        (line((0, 0, 40), X), SPHERE, 37.0),  # LineAboveSphereStillReportsItsPoints
        (line((0, 5, 0), X), asm.shapes.cylinder(2.0, 8.0), 3.0),  # Extrema_ExtElCS: across a cylinder
        (line((6, 0, 0), Z), asm.shapes.cylinder(2.0, 30.0), 4.0),  # along it
        (line((0, 0, 7), Y), asm.shapes.torus(4.0, 1.0), 6.0),  # over a torus
        (line((9, 0, 0), Z), asm.shapes.torus(4.0, 1.0), 4.0),  # beside it
        (circle((0, 0, 9), Z, 2.0), SPHERE, sqrt(85) - 3),  # a circle over a sphere, equally far everywhere
        (circle((12, 0, 0), Y, 2.0), SPHERE, 7.0),
        (circle((0, 0, 6), X, 2.0), PLANE, 4.0),
    ],
    ids=["line-plane", "line-sphere", "line-cylinder", "parallel", "line-torus", "beside", "circle", "ring", "disc"],
)
def test_curve_and_surface(curve, surface, distance):
    # Where a line is parallel to a surface the nearest points are a line: a wider tolerance then.
    answer = minimum_distance(curve, surface, 1e-6)
    assert answer.lower <= distance + 1e-12 and distance - 1e-12 <= answer.upper
    assert answer.upper - answer.lower <= 1e-6


@pytest.mark.parametrize(
    ("first", "second", "pose", "gap"),
    [
        (PLANE, PLANE, asm.Pose((0, 0, 5), AXIS((1, 0, 0), pi).quaternion).q, 5.0),  # ParallelPlanes...
        (SPHERE, asm.shapes.sphere(5.0), (20, 0, 0, 1, 0, 0, 0), 12.0),  # SeparatedSpheres...
        (PLANE, SPHERE, (1, 2, 9, 1, 0, 0, 0), 6.0),
        (PLANE, asm.shapes.cylinder(2.0, 8.0), (0, 0, 7, *OVER), 5.0),  # a lying cylinder
        (PLANE, asm.shapes.torus(4.0, 1.0), (0, 0, 7, *OVER), 2.0),  # a standing torus
        (PLANE, asm.shapes.torus(4.0, 1.0), (0, 0, 7, 1, 0, 0, 0), 6.0),  # a lying one touches in a circle
        (SPHERE, asm.shapes.cylinder(2.0, 20.0), (9, 0, 0, 1, 0, 0, 0), 4.0),
        (SPHERE, asm.shapes.torus(4.0, 1.0), (0, 0, 10, *OVER), 10.0 - 5 - 3),
        (asm.shapes.cylinder(2.0, 20.0), asm.shapes.cylinder(1.0, 20.0), (0, 5, 0, *OVER[:1], 0, OVER[1], 0), 2.0),
        (asm.shapes.torus(4.0, 1.0), asm.shapes.torus(4.0, 1.0), (13, 0, 0, 1, 0, 0, 0), 3.0),
        (asm.shapes.torus(4.0, 1.0), asm.shapes.torus(4.0, 1.0), (4, 0, 0, *OVER), 2.0),  # links of a chain
        (SPHERE, asm.shapes.cone(3.0, 4.0), (0, 0, 9, 0, 1, 0, 0), 9.0 - 2 - 3),  # apex down
    ],
)
def test_surfaces(first, second, pose, gap):
    """The nearest pair over all features, and the same by both orders."""
    there = np.array(pose, dtype=float)
    forward, back = closest_features(first, second, q_b=there), closest_features(second, first, q_a=there)
    assert abs(forward.gap - gap) < 1e-12 and abs(back.gap - gap) < 1e-12


@pytest.mark.parametrize(
    ("first", "second", "pose", "gap"),
    [
        (PLANE, SPHERE, (1, 2, 2, 1, 0, 0, 0), -1.0),
        (SPHERE, asm.shapes.cylinder(2.0, 20.0), (4, 0, 0, 1, 0, 0, 0), -1.0),
        (asm.shapes.cylinder(2.0, 20.0), asm.shapes.cylinder(1.0, 20.0), (0, 2, 0, *OVER[:1], 0, OVER[1], 0), -1.0),
        (asm.shapes.torus(4.0, 1.0), SPHERE, (7, 0, 0, 1, 0, 0, 0), -1.0),
        (PLANE, asm.shapes.torus(4.0, 1.0), (0, 0, 4, *OVER), -1.0),
    ],
)
def test_extremum_of_surfaces_that_cross(first, second, pose, gap):
    # The extremum goes on through touching: minus the depth.
    pair = extremal_pair(first, HERE.q, second, np.array(pose, dtype=float))
    assert pair.status is PairStatus.CONVERGED or pair.status is PairStatus.SINGULAR
    assert abs(pair.gap - gap) < 1e-12


@pytest.mark.parametrize(("height", "radius"), [(3.0, 1.0), (0.5, 4.0), (7.0, 9.0), (2.0, 5.0)])
def test_point_and_torus(height, radius):
    # Extrema_ExtPElS: of a point at a radius and a height, | |(r - R, z)| - tube |.
    answer = minimum_distance(np.array((0.6 * radius, 0.8 * radius, height)), asm.shapes.torus(4.0, 1.0), 1e-11)
    expected = abs(hypot(radius - 4, height) - 1)
    assert answer.lower - 1e-12 <= expected <= answer.upper + 1e-12 and answer.upper - answer.lower <= 1e-11
