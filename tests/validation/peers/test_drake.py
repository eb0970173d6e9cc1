"""Drake, `geometry/proximity/test`: signed distances and witness points of spheres, boxes, capsules and cylinders.

Tables `GenDistPairTest...` of `distance_to_shape_callback_test.cc`, points of `distance_to_point_test.cc`, touching
bodies of `distance_to_shape_touching_test.cc`; each at the identity and at the poses that the suite transforms them to.

Where a small body is wholly inside of a large one Drake's signed distance goes on growing; that is the gap of the
facing surfaces, `extremal_pair`. `closest_features` answers for solids that are apart or cross, and is asked for those.
"""

from __future__ import annotations

from itertools import product
from math import cos, pi, sin, sqrt

import numpy as np
import pytest

import assembly as asm
from assembly.proximity import FeatureStatus, closest_features, extremal_pair, minimum_distance

# Drake asks for 1e-14 of its closed forms; distances here come from searches over splines, in coordinates up to 30.
CLOSE = 2e-13
# Of points: where Newton's method ends on a sphere's surface, within which the gap no longer changes.
PLACE = 2e-12


def rpy(roll, pitch, yaw, at=(0.0, 0.0, 0.0)):
    """A pose by roll, pitch and yaw about the fixed axes x, y and z."""
    turn = asm.Pose.from_axis_angle
    pose = turn((0, 0, 1), yaw) @ turn((0, 1, 0), pitch) @ turn((1, 0, 0), roll)
    return asm.Pose(at, pose.quaternion)


def moved(pose, at):
    return pose @ asm.Pose(at)


def turned(pose, rotation):
    return pose @ asm.Pose((0, 0, 0), rotation.quaternion)


HERE = asm.Pose((0, 0, 0))
# Pose of the large body, turn of the sphere: SphereSphere, ...Transform, ...GimbalLock and so on.
POSES = {
    "identity": (HERE, HERE),
    "transform": (rpy(3 * pi / 8, 5 * pi / 6, pi / 12, (1, 2, 3)), rpy(pi / 8, pi / 6, 2 * pi / 3)),
    "gimbal lock": (HERE, rpy(pi / 8, pi / 2, pi / 8)),
}
posed = pytest.mark.parametrize("poses", POSES.values(), ids=POSES)


def capsule(radius, length):
    """A cylinder about z with half balls at its ends; its length is that of the axis."""
    axis = asm.shapes.Path((0, 0, -0.5 * length), (0, 0, 1)).line(length)
    return asm.shapes.pipe(axis, radius)


def named(faces, name):
    return next(face for face in faces if face.name == name)


BOX = asm.shapes.box(16, 12, 8)
CYLINDER = asm.shapes.solid_cylinder(12, 16)
CAPSULE = capsule(6, 16)
# A sphere comes from outside along an axis, touches, and goes on to deep inside: where its center is, and the distance.
SPHERE_BOX = ((14, 4.0), (10, 0.0), (9, -1.0), (8, -2.0), (7, -3.0), (6, -4.0), (5, -5.0))
SPHERE_CYLINDER = SPHERE_BOX
SPHERE_CAPSULE = tuple((14 + 2 + distance, distance) for distance in (4.0, 0.0, -1.0, -2.0, -3.0, -4.0, -5.0))


@posed
@pytest.mark.parametrize(
    ("center", "distance"),
    [(4, 1.0), (3, 0.0), (2.5, -0.5), (1, -2.0)],  # apart, kissing, overlapping, covering
)
def test_sphere_sphere(poses, center, distance):
    pose, turn = poses
    q = turned(moved(pose, (center, 0, 0)), turn)
    pair = extremal_pair(asm.shapes.sphere(1.0), pose.q, asm.shapes.sphere(2.0), q.q)
    assert abs(pair.gap - distance) < CLOSE
    assert np.abs(pair.points - pose.apply([(1, 0, 0), (center - 2, 0, 0)])).max() < PLACE


@posed
def test_sphere_sphere_in_general_position(poses):
    # 0.25^2 + 1^2 + 2^2 = 2.25^2 and 1^2 + 4^2 + 8^2 = 9^2: the second sphere goes through the first one's center.
    pose, turn = poses
    q = turned(moved(pose, (1, 4, 8)), turn)
    pair = extremal_pair(asm.shapes.sphere(2.25), pose.q, asm.shapes.sphere(9.0), q.q)
    assert abs(pair.gap + 2.25) < CLOSE
    assert np.abs(pair.points - pose.apply([(0.25, 1, 2), (0, 0, 0)])).max() < PLACE


def assert_signed_distance(surface, pose, sphere_at, turn, distance, normal):
    """Of a sphere of radius 2 and a face: the distance, and the points along the normal (body axes of the face)."""
    q, along = turned(moved(pose, sphere_at), turn), np.array(normal, dtype=float)
    pair = extremal_pair(surface, pose.q, asm.shapes.sphere(2.0), q.q)
    assert abs(pair.gap - distance) < CLOSE
    lowest = np.array(sphere_at) - 2 * along
    assert np.abs(pair.points - pose.apply([lowest - distance * along, lowest])).max() < PLACE


def assert_apart_or_crossing(solid, pose, sphere_at, turn, distance):
    q = turned(moved(pose, sphere_at), turn)
    pair = closest_features(asm.shapes.sphere(2.0), solid, q.q, pose.q)
    assert abs(pair.gap - distance) < CLOSE
    if abs(distance) > CLOSE:
        assert pair.status is (FeatureStatus.APART if distance > 0 else FeatureStatus.PENETRATING)


@posed
@pytest.mark.parametrize(("center", "distance"), SPHERE_BOX)
def test_sphere_box(poses, center, distance):
    pose, turn = poses
    assert_signed_distance(named(BOX, "right"), pose, (center, 0, 0), turn, distance, (1, 0, 0))
    if distance > -4:
        assert_apart_or_crossing(BOX, pose, (center, 0, 0), turn, distance)


@posed
@pytest.mark.parametrize(("center", "distance"), SPHERE_CAPSULE)
def test_sphere_capsule(poses, center, distance):
    pose, turn = poses
    assert_signed_distance(CAPSULE, pose, (0, 0, center), turn, distance, (0, 0, 1))
    if distance > -4:
        assert_apart_or_crossing(CAPSULE, pose, (0, 0, center), turn, distance)


@posed
@pytest.mark.parametrize(("center", "distance"), SPHERE_CYLINDER)
def test_sphere_cylinder(poses, center, distance):
    pose, turn = poses
    assert_signed_distance(named(CYLINDER, "top"), pose, (0, 0, center), turn, distance, (0, 0, 1))
    if distance > -4:
        assert_apart_or_crossing(CYLINDER, pose, (0, 0, center), turn, distance)


@pytest.mark.parametrize("signs", [s for s in product((-1, 0, 1), repeat=3) if any(s)], ids=str)
@pytest.mark.parametrize("poses", list(POSES.values())[:2], ids=list(POSES)[:2])
def test_sphere_centered_on_the_boundary_of_a_box(poses, signs):
    # SphereBoxBoundary: corners, middles of edges and of faces; always minus the radius.
    pose, turn = poses
    assert_apart_or_crossing(BOX, pose, np.array(signs) * (8, 6, 4), turn, -2.0)


@pytest.mark.parametrize("angle", [0.0, 1.0, 2.5])
@pytest.mark.parametrize(("part", "height"), [(0.0, 1), (0.5, -1), (1.0, 1), (1.0, 0.5), (1.0, -1)])
def test_sphere_centered_on_the_boundary_of_a_cylinder(part, height, angle):
    # SphereCylinderBoundary: a sphere of radius 4 on a cap, a rim or the barrel; always minus the radius.
    at = 8 * part * cos(angle), 8 * part * sin(angle), 8 * height
    solid = asm.shapes.solid_cylinder(8, 16)
    pair = closest_features(asm.shapes.sphere(4.0), solid, asm.Pose(at).q)
    assert pair.status is FeatureStatus.PENETRATING and abs(pair.gap + 4) < CLOSE


@pytest.mark.parametrize("distance", [0.25, 0.0, -0.25])
@pytest.mark.parametrize("pose", [HERE, rpy(pi / 3, pi / 6, pi / 2, (10, 11, 12))], ids=["identity", "turned"])
def test_half_space_and_sphere(pose, distance):
    # HalfspaceSphere: a sphere of radius 1.75 over (1.25, 1.5, 0). A half space is a large rectangle here.
    plane = asm.shapes.plane(20.0, 20.0)
    q = moved(pose, (1.25, 1.5, 1.75 + distance))
    pair = extremal_pair(plane, pose.q, asm.shapes.sphere(1.75), asm.Pose(q.position).q)
    assert abs(pair.gap - distance) < CLOSE
    assert np.abs(pair.points - pose.apply([(1.25, 1.5, 0), (1.25, 1.5, distance)])).max() < PLACE
    assert np.abs(pair.normal - pose.matrix[:3, 2]).max() < CLOSE


WORLD = asm.Pose.from_axis_angle((1, 2, 3), pi / 5, (0.5, 1.25, -2))
CORNERS = np.array(list(product((-0.5, 0.5), (-1.0, 1.0), (-1.5, 1.5))))


@pytest.mark.parametrize("signs", [s for s in product((-1, 0, 1), repeat=3) if any(s)], ids=str)
def test_point_and_box(signs):
    # `DistanceToPoint, Box`: 1 x 2 x 3, nearest to a vertex, an edge or a face; one along every axis, 1.5 over a face.
    along = np.array(signs, dtype=float) * (1.5 if sum(map(abs, signs)) == 1 else 1.0)
    nearest = np.array(signs) * (0.5, 1.0, 1.5)
    answer = minimum_distance(WORLD.apply(nearest + along), WORLD.apply(CORNERS), 1e-12)
    distance = sqrt(along @ along)
    assert answer.lower <= distance + CLOSE and answer.upper >= distance - CLOSE
    assert answer.upper - answer.lower < 1e-11
    assert np.abs(answer.points[1] - WORLD.apply(nearest)).max() < 1e-6


@pytest.mark.parametrize("along", [(2, -3, 6), (2, -3, 0), (2, -3, -6)], ids=str)
@pytest.mark.parametrize("distance", [1.5, -0.35])
def test_point_and_capsule(along, distance):
    # `DistanceToPoint, Capsule`: radius 0.7, length 1.3; over an end, over the spine, under the other end. The query
    # knows sheets, so that inside it gives the distance to the wall.
    unit = np.array(along) / np.linalg.norm(along)
    spine = np.array((0, 0, {6: 0.65, 0: 0.325, -6: -0.65}[along[2]]))
    answer = minimum_distance(spine + (0.7 + distance) * unit, capsule(0.7, 1.3), 1e-12)
    assert abs(answer.upper - abs(distance)) < 1e-11 and answer.lower <= abs(distance) + CLOSE


@pytest.mark.parametrize("part", [1.5 + 0.7, 0.7 - 0.15], ids=["outside", "inside"])
def test_point_and_sphere(part):
    # `DistanceToPoint, Sphere`: radius 0.7, along (2, -3, 6) / 7.
    answer = minimum_distance(part * np.array((2, -3, 6)) / 7, asm.shapes.sphere(0.7), 1e-12)
    assert abs(answer.upper - abs(part - 0.7)) < 1e-11 and answer.lower <= answer.upper


@pytest.mark.parametrize(
    "angles", [(0, 0), (7 * pi / 5, pi / 6), (3 * pi / 7, 4 * pi / 5)], ids=["pole", "low", "high"]
)
@pytest.mark.parametrize("distance", [1.0, 0.25, -0.25])
def test_ball_and_ellipsoid(angles, distance):
    # `DistanceToPoint, Ellipsoid`: half axes 1.5, 0.75, 1.25, at three of its points; a small ball stands for the
    # point here, so that the gap has a sign.
    theta, phi = angles
    half = np.array((1.5, 0.75, 1.25))
    at = half * (cos(theta) * sin(phi), sin(theta) * sin(phi), cos(phi))
    normal = at / half**2
    normal /= np.linalg.norm(normal)
    center = WORLD @ asm.Pose(at + (distance + 0.3) * normal)
    pair = closest_features(asm.shapes.ellipsoid(*half), asm.shapes.sphere(0.3), WORLD.q, center.q)
    assert abs(pair.gap - distance) < CLOSE
    assert np.abs(pair.normal - WORLD.matrix[:3, :3] @ normal).max() < 1e-7


TOUCHING = rpy(pi, pi / 2, pi / 4, (0.5, 1, 2))


def test_sphere_touches_ellipsoid():
    # `CalcGradientWhenTouching, SphereTouch`
    a, b = moved(TOUCHING, (-2, 0, 0)), moved(TOUCHING, (2, 0, 0))
    pair = extremal_pair(asm.shapes.sphere(2.0), a.q, asm.shapes.ellipsoid(2, 3, 4), b.q)
    assert abs(pair.gap) < CLOSE
    assert np.abs(pair.points - TOUCHING.position).max() < 1e-6
    assert np.abs(pair.normal - TOUCHING.matrix[:3, 0]).max() < 1e-7


QUARTER = asm.Pose.from_axis_angle((0, 0, 1), pi / 4)
ACROSS = asm.Pose.from_axis_angle((1, 1, 0), pi / 2)


@pytest.mark.parametrize(
    ("sizes", "second", "point"),
    [
        (((2, 3, 4), (2, 5, 6)), asm.Pose((2, 0, 0)), None),  # box_touches_box: faces
        (((1, 1, 1), (3, 3, 3)), asm.Pose((2, 0, 0)), None),  # Face
        (((2, 2, 2), (2, 2, 2)), asm.Pose((2, 2, 0), ACROSS.quaternion), (1, 1, 0)),  # EdgeCrossEdge
        (((2, 2, 2), (2, 2, 2)), asm.Pose((2, 2, 0)), None),  # ParallelEdgeEdge
        (
            ((2, 2, 2), (2, 2, 2)),
            asm.Pose((1 + sqrt(0.5), 1 + sqrt(0.5), 2), QUARTER.quaternion),
            None,
        ),  # EdgeVertex
    ],
    ids=["box_touches_box", "Face", "EdgeCrossEdge", "ParallelEdgeEdge", "EdgeVertex"],
)
def test_boxes_touch(sizes, second, point):
    pair = closest_features(*(asm.shapes.box(*size) for size in sizes), HERE.q, second.q)
    assert abs(pair.gap) < CLOSE
    if point is not None:
        assert np.abs(pair.points - point).max() < 1e-7
