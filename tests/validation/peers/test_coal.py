"""FCL and coal (hpp-fcl): distances of boxes, spheres, capsules, cylinders and cones.

`shapeDistance_...` of FCL's `test_fcl_geometric_shapes.cpp` and `test_fcl_sphere_capsule.cpp`; coal's
`capsule_capsule.cpp`, `capsule_box_1.cpp`, `capsule_box_2.cpp` and `box_box_distance.cpp`. Their solvers are compared
to 0.001 and more there; the closed forms behind their numbers are asked for here. What they only call "not separated"
is a pair of bodies that cross.
"""

from __future__ import annotations

from functools import cache
from math import cos, pi, sin, sqrt

import numpy as np
import pytest

import assembly as asm
from assembly.proximity import FeatureStatus, closest_features

CLOSE = 1e-12  # of bodies up to 50 wide
TURN = asm.Pose.from_axis_angle((2, -1, 3), 2.2, (4, -7, 9))  # "a random transform" of the suites
HERE = asm.Pose((0, 0, 0))
both = pytest.mark.parametrize("frame", [HERE, TURN], ids=["identity", "turned"])


@cache
def shape(kind, *sizes):
    """Solids as the suites measure them: boxes and round bodies about their centers, cones with the apex up z."""
    if kind == "capsule":
        radius, length = sizes
        axis = asm.shapes.Path((0, 0, -0.5 * length), (0, 0, 1)).line(length)
        return (asm.Face(asm.shapes.pipe(axis, radius)),)
    if kind == "cone":
        return asm.Face(asm.shapes.cone(*sizes)), asm.shapes.solid_cylinder(*sizes)[-2]
    if kind == "sphere":
        return (asm.Face(asm.shapes.sphere(*sizes)),)
    return {"box": asm.shapes.box, "cylinder": asm.shapes.solid_cylinder}[kind](*sizes)


def nearest(first, second, at, frame):
    """The pair of two shapes, both moved by a frame; `at` is a place of the second one, or its pose."""
    pose = at if isinstance(at, asm.Pose) else asm.Pose(at)
    return closest_features(shape(*first), shape(*second), frame.q, (frame @ pose).q)


APART = [
    (("sphere", 20), ("sphere", 10), (0, 40, 0), 10.0),
    (("sphere", 20), ("sphere", 10), (30.1, 0, 0), 0.1),
    (("sphere", 20), ("sphere", 10), (-40, 0, 0), 10.0),
    (("sphere", 20), ("sphere", 10), (-30.1, 0, 0), 0.1),
    (("box", 10, 10, 10), ("box", 10, 10, 10), (10.1, 0, 0), 0.1),
    (("box", 10, 10, 10), ("box", 10, 10, 10), (20.1, 0, 0), 10.1),
    (("box", 10, 10, 10), ("box", 10, 10, 10), (0, 20.2, 0), 10.2),
    (("box", 10, 10, 10), ("box", 10, 10, 10), (10.1, 10.1, 0), 0.1 * sqrt(2)),
    (("box", 20, 40, 50), ("box", 10, 10, 10), (15.1, 0, 0), 0.1),
    (("box", 20, 40, 50), ("box", 10, 10, 10), (20, 0, 0), 5.0),
    (("sphere", 20), ("box", 5, 5, 5), (22.6, 0, 0), 0.1),
    (("sphere", 20), ("box", 5, 5, 5), (40, 0, 0), 17.5),
    (("cylinder", 5, 10), ("cylinder", 5, 10), (10.1, 0, 0), 0.1),
    (("cylinder", 5, 10), ("cylinder", 5, 10), (40, 0, 0), 30.0),
    (("cone", 5, 10), ("cone", 5, 10), (10.1, 0, 0), 0.1),
    (("cone", 5, 10), ("cone", 5, 10), (0, 0, 40), 30.0),
    (("cylinder", 5, 10), ("cone", 5, 10), (10.1, 0, 0), 0.1),
    (("cylinder", 5, 10), ("cone", 5, 10), (40, 0, 0), 30.0),
    # Sphere_Capsule_Distance_test_separated, and the intersections of that file that are separated.
    (("sphere", 50), ("capsule", 50, 200), (0, 0, 225), 25.0),
    (("sphere", 50), ("capsule", 50, 200), (0, 0, -250), 50.0),
    (("sphere", 50), ("capsule", 50, 200), (150, 0, 50), 50.0),
]


@both
@pytest.mark.parametrize(("first", "second", "at", "distance"), APART, ids=str)
def test_shape_distance(first, second, at, distance, frame):
    pair = nearest(first, second, at, frame)
    assert abs(pair.gap - distance) < CLOSE and distance - 1e-8 < pair.lower < distance + CLOSE
    assert pair.status is FeatureStatus.APART


CROSSING = [
    (("sphere", 20), ("sphere", 10), (29.9, 0, 0), -0.1),
    (("sphere", 20), ("sphere", 10), (-29.9, 0, 0), -0.1),
    (("cylinder", 5, 10), ("cylinder", 5, 10), (9.9, 0, 0), -0.1),  # 0.2 less than a fact
    (("box", 20, 40, 50), ("box", 10, 10, 10), (14.9, 0, 0), -0.1),  # the same
    # Sphere_Capsule_Intersect_test_penetration_z and ..._z_rotated
    (("sphere", 50), ("capsule", 50, 200), (0, 0, 175), -25.0),
    (("sphere", 50), ("capsule", 50, 200), asm.Pose.from_axis_angle((1, 0, 0), pi / 2, (0, 50, 75)), -25.0),
]


@both
@pytest.mark.parametrize(("first", "second", "at", "depth"), CROSSING, ids=str)
def test_penetration(first, second, at, depth, frame):
    pair = nearest(first, second, at, frame)
    assert pair.status is FeatureStatus.PENETRATING
    assert abs(pair.gap - depth) < CLOSE


LYING = asm.Pose.from_axis_angle((0, 1, 0), pi / 2).quaternion


@both
@pytest.mark.parametrize(
    ("at", "distance", "points"),
    [
        ((20.1, 0, 0), 10.1, None),  # side by side: a whole segment is nearest
        ((20, 20, 0), sqrt(800) - 10, None),
        ((0, 0, 20.1), 0.1, ((0, 0, 10), (0, 0, 10.1))),
        (asm.Pose((0, 0, 25.1), LYING), 10.1, ((0, 0, 10), (0, 0, 20.1))),
    ],
    ids=["origin", "transformXY", "transformZ", "transformZ2"],
)
def test_capsules(at, distance, points, frame):
    capsule = ("capsule", 5, 10)
    pair = nearest(capsule, capsule, at, frame)
    assert pair.status is FeatureStatus.APART and abs(pair.gap - distance) < CLOSE
    if points:
        assert np.abs(pair.points - frame.apply(points)).max() < 1e-6


@both
@pytest.mark.parametrize(
    ("pose", "distance", "points"),
    [
        (asm.Pose((3, 0, 0)), 0.5, None),  # any z between -2 and 2
        (asm.Pose((0, 0, 8)), 2.0, ((0, 0, 4), (0, 0, 2))),
        (asm.Pose((-10, 0, 0), LYING), 5.5, ((-6, 0, 0), (-0.5, 0, 0))),
        (asm.Pose((-10, 0.8, 1.5), LYING), 5.5, ((-6, 0.8, 1.5), (-0.5, 0.8, 1.5))),
    ],
    ids=["beside", "above", "behind", "capsule_box_2"],
)
def test_capsule_and_box(pose, distance, points, frame):
    pair = closest_features(shape("capsule", 2, 4), shape("box", 1, 2, 4), (frame @ pose).q, frame.q)
    assert pair.status is FeatureStatus.APART and abs(pair.gap - distance) < CLOSE
    if points:
        assert np.abs(pair.points - frame.apply(points)).max() < 1e-9


EIGHTH = asm.Pose.from_axis_angle((1, 1, 1), pi / 4, (0, 0, 10))


@both
def test_boxes_corner_to_corner(frame):
    # distance_box_box_1
    pair = nearest(("box", 6, 10, 2), ("box", 2, 2, 2), (25, 20, 5), frame)
    assert abs(pair.gap - sqrt(21**2 + 14**2 + 3**2)) < CLOSE
    assert np.abs(pair.points - frame.apply([(3, 5, 1), (24, 19, 4)])).max() < CLOSE


@both
def test_a_corner_over_a_face(frame):
    # distance_box_box_2: turned by 45 degrees about (1, 1, 1); the lowest corner by Rodrigues' formula, -1.62123444 in
    # the suite, at (0.60947571, 0.01175873).
    pair = nearest(("box", 6, 10, 2), ("box", 2, 2, 2), EIGHTH, frame)
    a, b, c = ((1 + 2 * cos(pi / 4)) / 3, *((1 - cos(pi / 4)) / 3 + sign * sin(pi / 4) / sqrt(3) for sign in (1, -1)))
    low = abs(a) + abs(b) + abs(c)
    assert abs(low - 1.62123444) < 1e-8
    assert abs(pair.gap - (10 - 1 - low)) < CLOSE
    corner = np.array((0.60947571, 0.01175873))
    assert np.abs(frame.inverse().apply(pair.points)[:, :2] - corner).max() < 1e-8


@both
def test_an_edge_across_an_edge(frame):
    # distance_box_box_3: two unit cubes turned by 45 degrees, one about z and one about y.
    first = asm.Pose.from_axis_angle((0, 0, 1), pi / 4, (-2, 1, 0.5))
    second = asm.Pose.from_axis_angle((0, 1, 0), pi / 4, (2, 0.5, 0.5))
    cube = shape("box", 1, 1, 1)
    pair = closest_features(cube, cube, (frame @ first).q, (frame @ second).q)
    assert abs(pair.gap - (4 - sqrt(2))) < CLOSE
    # The second's edge ends where the first's passes: y = 1.
    expected = [(sqrt(0.5) - 2, 1, 0.5), (2 - sqrt(0.5), 1, 0.5)]
    assert np.abs(pair.points - frame.apply(expected)).max() < 1e-12


@both
@pytest.mark.parametrize(("x", "distance"), [(2, 1.0), (1.01, 0.01), (0.99, -0.01)])
def test_unit_cubes(x, distance, frame):
    # distance_box_box_4
    pair = nearest(("box", 1, 1, 1), ("box", 1, 1, 1), (-x, 0, 0), frame)
    assert abs(pair.gap - distance) < CLOSE
