"""Certified distances of posed bodies: closed forms, other queries as judges, budgets, bodies in bodies, bad input."""

from __future__ import annotations

import copy
import math
import pickle
import threading

import numpy as np
import pytest
from scipy.optimize import lsq_linear, minimize_scalar

import assembly as asm
from assembly.errors import InputError
from assembly.geometry.faces.face import Face
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity import DistanceStatus, FeatureStatus, closest_features, distance, minimum_distance
from assembly.proximity.brep.solid import solid_of
from assembly.proximity.features.places import is_closed
from benchmarks.distances import rounded_box
from tests.distance.bodies.example_shapes import HALF, ellipse, points_on, random_pose, solids, trimmed_faces, wavy

SHAPES = asm.shapes
# Bounds of a search for 1e-10 are that far from each other; closed forms are off by some units of the last place.
TOLERANCE = 1e-10
TIGHT = 1e-14
HOLE = [(0.0, 0.0, 0.3)]


def at(x, y=0.0, z=0.0):
    return np.array([x, y, z, 1.0, 0.0, 0.0, 0.0])


def check(a, b, poses, expected, status=DistanceStatus.CONVERGED, features=None):
    """The distance in both orders: its bounds, its points, its features."""
    for order in (1, -1):
        found = distance(*(a, b)[::order], poses=poses[::order])
        assert found.status is status
        assert found.converged
        assert found.lower - TIGHT <= expected <= found.upper + TIGHT
        assert found.upper - found.lower <= TOLERANCE
        assert abs(np.linalg.norm(found.points[0] - found.points[1]) - found.upper) <= 1e-12
        if features is not None:
            assert tuple(feature.kind for feature in found.features) == features[::order]
    return found


@pytest.mark.parametrize(
    ("a", "b", "pose", "expected"),
    [
        (SHAPES.sphere(1.0), SHAPES.sphere(0.5), at(2.0, 1.0, 2.0), 1.5),
        (SHAPES.sphere(1.0), SHAPES.cylinder(0.5, 4.0), at(3.0, 4.0, 0.3), 3.5),
        (SHAPES.torus(1.0, 0.25), SHAPES.sphere(0.5), at(0.0, 3.0, 1.5), 1.75),
        (SHAPES.ellipsoid(3.0, 2.0, 1.0), SHAPES.sphere(0.5), at(0.0, 0.0, 4.0), 2.5),
        (SHAPES.plane(2.0, 2.0), SHAPES.sphere(0.5), at(4.0, 5.0, 0.0), 4.5),
        (SHAPES.cone(1.0, 2.0), SHAPES.plane(9.0, 9.0), at(0.0, 0.0, 1.7), 0.7),
    ],
)
def test_closed_forms_of_surfaces(a, b, pose, expected):
    turned = random_pose(np.random.default_rng(1), 2.0)
    turn = rotation_matrix(turned[3:])
    moved = np.concatenate([turn @ pose[:3] + turned[:3], turned[3:]])
    check(a, b, (None, pose), expected)
    # Turned together; poses are rounded.
    found = distance(a, b, poses=(turned, moved))
    assert found.lower - 4e-14 <= expected <= found.upper + 4e-14


def test_surfaces_against_the_search_by_bounds_alone(cases):
    """Without polish two surfaces go through the search for curves and surfaces, which has other bounds."""
    rng = np.random.default_rng(7)
    for _ in range(cases(25, 1000)):
        a, b = wavy(rng, int(rng.integers(1, 4)), rng.random() < 0.5), wavy(rng, int(rng.integers(1, 4)), False)
        q = random_pose(rng, 0.5) + [0.0, 0.0, rng.uniform(0.0, 2.0), 0, 0, 0, 0]
        found = distance(a, b, poses=(None, q))
        moved = b.transformed(rotation_matrix(q[3:]), q[:3])
        judge = minimum_distance(a, moved, 1e-6, polish=False, max_evaluations=20_000)
        # The moved surface is rounded.
        assert found.converged
        assert found.lower <= judge.upper + 4e-15 and judge.lower <= found.upper + 4e-15
        same = minimum_distance(a, moved)
        assert same.lower <= found.upper + 4e-15 and found.lower <= same.upper + 4e-15
        u, v, s, t = same.parameters
        ends = [a.evaluate(u, v), moved.evaluate(s, t)]
        np.testing.assert_allclose(same.points, ends, atol=1e-14)


def test_trimmed_bodies_against_the_search_for_features(cases):
    rng = np.random.default_rng(11)
    shapes = [*solids().values(), *((face,) for face in trimmed_faces(rng).values())]
    apart = 0
    for _ in range(cases(25, 2000)):
        a, b = (shapes[int(k)] for k in rng.integers(len(shapes), size=2))
        q = np.stack([random_pose(rng, 0.3), random_pose(rng, 1.5)])
        found = distance(a, b, poses=(q[0], q[1]))
        judge = closest_features(a, b, q[0], q[1])
        assert found.converged
        if judge.status is FeatureStatus.APART:
            apart += 1
            # What that search lets go is up to 1e-9 of the sizes.
            assert abs(abs(judge.gap) - found.upper) < 1e-8
            np.testing.assert_allclose(found.points, judge.points, atol=1e-4)
        else:
            assert found.upper < 1e-10
    assert apart > cases(10, 800)


def test_points_of_trimmed_faces_are_no_nearer(cases):
    rng = np.random.default_rng(12)
    for face in trimmed_faces(rng).values():
        points = points_on(face)
        for _ in range(cases(2, 100)):
            ball = random_pose(rng, 1.0)
            found = distance(face, SHAPES.sphere(0.05), poses=(None, ball))
            least = float(np.linalg.norm(points - ball[:3], axis=1).min()) - 0.05
            assert found.converged
            assert found.lower <= max(abs(least), 0.0) + 1e-12 or found.upper < 1e-10
            # The grid's points are this dense.
            assert found.upper >= least - 0.1


def test_a_hole_is_no_part_of_a_face():
    plane = SHAPES.plane(4.0, 4.0)
    holed = Face(plane, holes=[ellipse(0.0, 0.0, 1.0, 1.0)])
    ball = SHAPES.sphere(0.25)
    check(holed, ball, (None, at(0.0)), 0.75, features=("edge", "face"))
    check(holed, ball, (None, at(0.4)), 0.35, features=("edge", "face"))
    check(holed, ball, (None, at(1.5, 0.0, 1.0)), 0.75, features=("face", "face"))
    check(plane, ball, (None, at(0.0, 0.0, 1.0)), 0.75, features=("face", "face"))


def test_features_of_boxes():
    box = SHAPES.box(1.0, 1.0, 1.0)
    check(box, box, (None, at(2.0, 2.0, 2.0)), math.sqrt(3.0), features=("vertex", "vertex"))
    # On its corner: a turn that takes (1, 1, 1) to the z axis.
    half = 0.5 * math.acos(1.0 / math.sqrt(3.0))
    on_corner = np.array(
        [0.0, 0.0, 2.0, math.cos(half), *(math.sin(half) * np.array([1.0, -1.0, 0.0]) * math.sqrt(0.5))]
    )
    check(box, box, (None, on_corner), 1.5 - math.sqrt(0.75), features=("face", "vertex"))
    # Over each other's edges, crosswise.
    a = np.array([0.0, 0.0, 0.0, math.cos(math.pi / 8), math.sin(math.pi / 8), 0.0, 0.0])
    b = np.array([0.0, 0.0, 2.0, math.cos(math.pi / 8), 0.0, math.sin(math.pi / 8), 0.0])
    check(box, box, (a, b), 2.0 - math.sqrt(2.0), features=("edge", "edge"))
    name = distance(box, box, poses=(None, at(3.0, 0.1, 0.2))).features[0].name
    assert "right" in name


def test_a_crease_of_one_face_is_an_edge():
    """A roof of one surface: two planes that meet over x = 0."""
    ridge = np.array(
        [
            [[-1.0, -1.0, 0.0], [-1.0, 1.0, 0.0]],
            [[0.0, -1.0, 1.0], [0.0, 1.0, 1.0]],
            [[1.0, -1.0, 0.0], [1.0, 1.0, 0.0]],
        ]
    )
    roof = asm.NurbsSurface(ridge, ([0.0, 0.0, 1.0, 2.0, 2.0], [0.0, 0.0, 1.0, 1.0]), (1, 1))
    ball = SHAPES.sphere(0.25)
    check(roof, ball, (None, at(0.0, 0.2, 2.0)), 0.75, features=("edge", "face"))
    faces = [distance(roof, ball, poses=(None, at(x, 0.2, 1.5))).features[0] for x in (-1.0, 1.0)]
    assert [feature.kind for feature in faces] == ["face", "face"] and faces[0] != faces[1]


def test_a_pin_in_its_bore():
    plate, pin = SHAPES.plate(2.0, 2.0, 1.0, [(0.0, 0.0, 0.5)]), SHAPES.solid_cylinder(0.4, 2.0)
    check(plate, pin, (None, at(0.0)), 0.1)
    check(plate, pin, (None, at(0.05)), 0.05)


@pytest.mark.parametrize(
    ("shift", "turn", "expected", "pairs"),
    [
        # Side by side: the walls are parallel, and their rims are in a plane.
        ((5.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), 2.0, 700),
        ((5.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0), 2.0, 700),
        # Crossed, and end to end.
        ((5.0, 0.0, 0.0), (HALF, HALF, 0.0, 0.0), 2.0, 700),
        ((0.0, 0.0, 4.0), (1.0, 0.0, 0.0, 0.0), 1.0, 700),
    ],
)
def test_solid_pins(shift, turn, expected, pairs):
    # Counts of pairs: thousands, where parts of flat faces beside the other pin are kept.
    found = distance(SHAPES.solid_cylinder(1.0, 3.0), SHAPES.solid_cylinder(2.0, 3.0), poses=(None, [*shift, *turn]))
    assert found.lower <= expected <= found.upper and found.upper - found.lower < 1e-11
    assert found.evaluations < pairs


def rim_gap(turn, shift, radius, height, pin):
    """The least distance of points of the circles at both ends of a hole from the wall of a pin about the z axis."""

    def gap(t, z):
        x = turn @ (radius * np.cos(t), radius * np.sin(t), z) + shift
        return np.hypot(x[0], x[1]) - pin

    ends = (-0.5 * height, 0.5 * height)
    starts = [(t, z) for z in ends for t in np.linspace(0.0, 2.0 * np.pi, 60)]
    t, z = min(starts, key=lambda at: gap(*at))
    near = minimize_scalar(lambda s: gap(s, z), bracket=(t - 0.1, t, t + 0.1), tol=1e-14)
    return near.fun


def test_a_tilted_pin_in_a_hole(cases):
    # At the rim, where the wall and the bore bend alike, no direction in which the distance is convex in all places.
    rng = np.random.default_rng(4)
    pin, plate = SHAPES.solid_cylinder(1.0, 3.0), SHAPES.plate(6.0, 6.0, 1.0, [(0.0, 0.0, 1.1)])
    for _ in range(cases(4, 200)):
        e = np.array([1.0, *rng.normal(scale=0.02, size=2), 0.0])
        shift = np.array([*rng.normal(scale=0.01, size=2), rng.uniform(-0.5, 0.5)])
        turn = rotation_matrix(e / np.linalg.norm(e))
        expected = rim_gap(turn, shift, 1.1, 1.0, 1.0)
        found = distance(pin, plate, poses=(None, [*shift, *e]))
        assert found.status is DistanceStatus.CONVERGED and found.evaluations < 40_000
        # The reference finds its place to the root of the last digit, and the value to some units of it.
        assert found.lower <= expected + 1e-14 and expected - 1e-14 <= found.upper


def test_a_ball_over_the_ridge_of_a_trimmed_roof():
    # Both halves are flat, and the nearest point is on the crease between them, which is no boundary of the face.
    net = np.array([[[-1, -1, 0], [-1, 1, 0]], [[0, -1, 1], [0, 1, 1]], [[1, -1, 0], [1, 1, 0]]], dtype=float)
    surface = asm.NurbsSurface(net, ([0, 0, 0.5, 1, 1], [0, 0, 1, 1]), (1, 1))
    roof = Face(surface, holes=[ellipse(0.25, 0.2, 0.05, 0.05)])
    check(roof, SHAPES.sphere(0.5), (None, at(0.1, 0.3, 2.5)), np.hypot(0.1, 1.5) - 0.5)


def test_bodies_that_meet_are_nowhere_apart():
    box = SHAPES.box(1.0, 1.0, 1.0)
    for shift in (at(0.5, 0.5, 0.5), at(1.0), at(0.999, 0.3, 0.2)):
        found = distance(box, box, poses=(None, shift))
        assert found.status is DistanceStatus.CONVERGED
        assert found.lower == 0.0
        assert found.upper < 1e-10


def test_convex_solids_are_parted_by_a_plane_at_once(cases):
    # The distance of rounded boxes is that of their inner boxes less the radii; of these it is a least square.
    rng = np.random.default_rng(9)
    halves, radii = ([1.0, 0.7, 0.5], [0.8, 0.8, 0.4]), (0.15, 0.1)
    a, b = (asm.Body("box", rounded_box(tuple(half), radius)) for half, radius in zip(halves, radii, strict=True))
    inner = np.concatenate([np.array(half) - radius for half, radius in zip(halves, radii, strict=True)])
    pairs = []
    for _ in range(cases(30, 1000)):
        q = np.stack([random_pose(rng, 0.5), random_pose(rng, 0.5)])
        q[1, :3] += rng.uniform(1.5, 4.0) * (way := rng.standard_normal(3)) / np.linalg.norm(way)
        turns = np.concatenate([rotation_matrix(q[0, 3:]), -rotation_matrix(q[1, 3:])], axis=1)
        least = lsq_linear(turns, q[1, :3] - q[0, :3], (-inner, inner), tol=1e-15)
        expected = math.sqrt(2.0 * least.cost) - sum(radii)
        if expected > 1e-3:
            found = distance(a, b, poses=tuple(q))
            assert found.converged
            # The judge's own tolerance.
            assert found.lower - 1e-8 <= expected <= found.upper + 1e-8
            pairs.append(found.evaluations)
    # Of 676 pairs of faces.
    assert np.median(pairs) <= 10 and len(pairs) > 20


def test_trimmed_planes_are_parted_by_their_boundaries():
    # Planes of trimmed faces go on beyond these, and so do their control points.
    plate, washer = SHAPES.plate(12.0, 3.0, 0.5, [(-4.0, 0.4, 0.3), (4.0, 0.4, 0.3)]), SHAPES.plate(0.8, 0.8, 0.4, HOLE)
    for gap in (0.1, 5.0):
        found = check(plate, washer, (None, at(4.0, 0.4, -0.45 - gap)), gap)
        assert found.evaluations <= 20


def test_a_descent_goes_on_along_the_rim_that_is_near():
    # Rims of two holes lie on each other; beside them is the ball of a long edge.
    plate, washer = SHAPES.plate(4.0, 4.0, 0.5, [(0.9, 0.4, 0.3)]), SHAPES.plate(1.0, 1.0, 0.4, HOLE)
    for order in (1, -1):
        found = distance(*(plate, washer)[::order], poses=(None, at(0.9, 0.4, 0.45))[::order])
        assert found.converged and found.lower == 0.0
        assert found.evaluations <= 20


def test_a_budget_leaves_true_bounds():
    rng = np.random.default_rng(4)
    a, b = solids()["plate"], (Face(SHAPES.torus(1.0, 0.25)),)
    poses = (random_pose(rng, 0.0), random_pose(rng, 0.5) + at(0.0, 0.0, 1.5) * [1, 1, 1, 0, 0, 0, 0])
    full = distance(a, b, poses=poses)
    last = (0.0, math.inf)
    for budget in (1, 10, 50, 200, 1000):
        found = distance(a, b, poses=poses, budget=budget)
        assert found.lower <= full.upper and full.lower <= found.upper
        assert found.lower >= last[0] and found.upper <= last[1]
        assert found.converged or found.status is DistanceStatus.BUDGET_SPENT
        assert found.evaluations <= budget + 4
        last = found.lower, found.upper
    assert full.converged


def test_a_coarse_tolerance_is_met():
    rng = np.random.default_rng(8)
    a, b = wavy(rng, 3), wavy(rng, 3)
    pose = at(0.2, 0.1, 1.5)
    fine = distance(a, b, poses=(None, pose))
    coarse = distance(a, b, poses=(None, pose), tolerance=1e-3)
    assert coarse.upper - coarse.lower <= 1e-3
    assert coarse.lower <= fine.upper and fine.lower <= coarse.upper
    assert coarse.evaluations < fine.evaluations
    tiny = distance(a, b, poses=(None, pose), tolerance=1e-18)
    assert tiny.status is DistanceStatus.ROUNDED
    assert tiny.upper - tiny.lower < 1e-11


def test_weights_far_apart():
    rng = np.random.default_rng(9)
    plain = wavy(rng, 2, False)
    for ratio in (1e3, 1e6, 1e9):
        weights = ratio ** rng.uniform(0.0, 1.0, plain.weights.shape)
        a = asm.NurbsSurface(plain.control_points, plain.knots, plain.degree, weights)
        found = distance(a, SHAPES.sphere(0.25), poses=(None, at(0.5, 0.4, 1.5)))
        judge = minimum_distance(a, np.array([0.5, 0.4, 1.5]))
        assert found.upper - found.lower <= TOLERANCE
        assert found.lower - TIGHT <= judge.upper - 0.25 and judge.lower - 0.25 <= found.upper + TIGHT


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("offset", [0.0, 1e4])
def test_sizes_and_places(scale, offset):
    a, b = SHAPES.sphere(scale), SHAPES.box(scale, scale, scale)
    shift = scale * np.array([2.0, 0.1, 0.2])
    far = scale * offset * np.array([1.0, 2.0, 3.0])
    found = distance(a, b, poses=(at(*far), at(*(far + shift))), tolerance=1e-10 * scale)
    assert found.converged
    # Poses so far away are rounded themselves.
    assert abs(found.upper - 0.5 * scale) <= (1e-10 + 1e-15 * offset) * scale


ENCLOSED = {
    "ball in a ball": (SHAPES.sphere(2.0), SHAPES.sphere(0.5), at(0.3), 1.2),
    "ball in a box": (SHAPES.box(2.0, 2.0, 2.0), SHAPES.sphere(0.5), at(0.25), 0.25),
    "box in a box": (SHAPES.box(2.0, 2.0, 2.0), SHAPES.box(0.5, 0.6, 0.7), at(0.1, 0.0, 0.2), 0.45),
    "box in a ball": (SHAPES.sphere(2.0), SHAPES.box(1.0, 1.0, 1.0), at(0.0), 2.0 - math.sqrt(0.75)),
    "sheet in a ball": (SHAPES.sphere(2.0), SHAPES.plane(1.0, 1.0), at(0.0), 2.0 - math.sqrt(0.5)),
    "ball in a ring": (SHAPES.torus(2.0, 0.5), SHAPES.sphere(0.2), at(2.1), 0.2),
}


@pytest.mark.parametrize("name", list(ENCLOSED))
def test_a_body_inside_another_one(name):
    a, b, pose, expected = ENCLOSED[name]
    check(a, b, (None, pose), expected, DistanceStatus.ENCLOSED)


DEPTHS = {
    "ball in a ball": 2.2,
    "ball in a box": 1.25,
    "box in a box": 1.15,
    # Through the middle of a face of the box.
    "box in a ball": 2.5,
    # A sheet leaves as it lies.
    "sheet in a ball": 2.0,
}


@pytest.mark.parametrize("name", list(DEPTHS))
def test_how_deep_a_body_is_inside_a_convex_one(name):
    a, b, pose, _expected = ENCLOSED[name]
    turned = random_pose(np.random.default_rng(2), 1.0)
    turn = rotation_matrix(turned[3:])
    moved = np.concatenate([turn @ pose[:3] + turned[:3], turned[3:]])
    # The other order takes another second where faces are curved.
    for order in (1, -1) if name == "box in a box" else (1,):
        shapes, places = (a, b)[::order], (turned, moved)[::order]
        found = distance(*shapes, poses=places)
        assert abs(found.depth - DEPTHS[name]) < 1e-10
        assert found.proved is (name == "ball in a ball")
        # Moved so far, and a little more, they are apart.
        away = places[1] + np.concatenate([found.translation * (1.0 + 1e-9), np.zeros(4)])
        after = distance(*shapes, poses=(places[0], away))
        assert after.status is DistanceStatus.CONVERGED
        assert after.upper < 1e-7


def test_a_ball_in_a_ring_comes_out_some_way():
    ring, ball = SHAPES.torus(2.0, 0.5), SHAPES.sphere(0.2)
    found = distance(ring, ball, poses=(None, at(2.1)))
    # Outward, and not through the hole: the hull of the ring has none.
    assert abs(found.depth - 0.6) < 1e-10 and not found.proved
    apart = distance(ring, ball, poses=(None, at(4.0)))
    assert apart.depth is None and apart.translation is None and apart.proved


def test_a_surface_without_a_boundary_is_closed_as_its_topology_says():
    torus = SHAPES.torus(1.0, 0.3)
    surfaces = [SHAPES.sphere(1.0), SHAPES.ellipsoid(1.0, 0.8, 0.6), torus, SHAPES.cylinder(1.0, 2.0)]
    surfaces += [SHAPES.cone(1.0, 2.0), SHAPES.plane(1.0, 1.0), wavy(np.random.default_rng(0))]
    faces = [Face(surface) for surface in surfaces]
    faces += [Face(torus, holes=[ellipse(0.0, 0.0, 0.5, 0.3)]), Face(SHAPES.sphere(1.0), reversed=True)]
    said = [is_closed((face,)) for face in faces]
    assert said == [solid_of((face,)).is_closed for face in faces]
    assert any(said) and not all(said)


def test_what_is_beside_or_in_a_cavity_is_not_inside():
    ring, ball = SHAPES.torus(2.0, 0.5), SHAPES.sphere(0.2)
    check(ring, ball, (None, at(0.0)), 1.3)
    check(SHAPES.plate(2.0, 2.0, 1.0, [(0.0, 0.0, 0.5)]), ball, (None, at(0.1)), 0.2)
    sphere = SHAPES.sphere(2.0)
    hollow = (Face(sphere), Face(SHAPES.sphere(1.0), reversed=True, name="cavity"))
    check(hollow, ball, (None, at(0.3)), 0.5)
    check(hollow, ball, (None, at(1.4)), 0.2, DistanceStatus.ENCLOSED)
    # An open shell has no inside; nor has one that is inside out.
    check(Face(sphere, holes=[ellipse(1.0, 3.0, 0.5, 0.5)]), ball, (None, at(0.0)), 1.8)
    check(Face(sphere, reversed=True), ball, (None, at(0.0)), 1.8)


def test_a_corner_that_points_inward_is_outside():
    """A ball in the corner of an L: its nearest point is the concave edge from inside, a convex one from outside."""
    corners = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2], [0, 0]], dtype=float)
    solid = SHAPES.extrusion([asm.NurbsCurve.polyline(corners[k : k + 2]) for k in range(6)], 1.0)
    ball = SHAPES.sphere(0.05)
    inside = check(solid, ball, (None, at(0.7, 0.7)), 0.3 * math.sqrt(2.0) - 0.05, DistanceStatus.ENCLOSED)
    assert {feature.kind for feature in inside.features} == {"edge", "face"}
    check(solid, ball, (None, at(1.1, 1.2)), 0.05)
    check(solid, ball, (None, at(-0.1, -0.1)), 0.1 * math.sqrt(2.0) - 0.05)


def test_bodies_of_a_scene_are_where_they_stand():
    a = asm.Body("a", SHAPES.sphere(1.0))
    b = asm.Body("b", SHAPES.box(1.0, 1.0, 1.0))
    b.pose = asm.Pose((3.0, 0.0, 0.0))
    assert abs(distance(a, b).upper - 1.5) < 1e-12
    assert abs(distance(a, b, poses=(at(0.5), None)).upper - 1.0) < 1e-12
    assert abs(distance(a.face(), b).upper - 1.5) < 1e-12


def test_queries_give_the_same_again_and_from_several_threads():
    rng = np.random.default_rng(6)
    a, b = SHAPES.plate(2.0, 1.5, 0.3, [(0.0, 0.0, 0.4)]), wavy(rng, 4)
    poses = [(random_pose(rng, 0.3), random_pose(rng, 2.0)) for _ in range(12)]
    first = [distance(a, b, poses=pose) for pose in poses]
    again = [distance(a, b, poses=pose) for pose in poses]
    assert [found.lower for found in first] == [found.lower for found in again]
    results = {}

    def run(k):
        results[k] = [distance(*((a, b) if k % 2 else (b, a)), poses=p if k % 2 else p[::-1]).upper for p in poses]

    threads = [threading.Thread(target=run, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(results) == 4
    for uppers in results.values():
        np.testing.assert_allclose(uppers, [found.upper for found in first], atol=2e-10)


def test_results_are_copied_and_pickled():
    found = distance(SHAPES.box(1.0, 1.0, 1.0), SHAPES.sphere(1.0), poses=(None, at(3.0)))
    for other in (copy.copy(found), copy.deepcopy(found), pickle.loads(pickle.dumps(found))):
        assert (other.lower, other.upper, other.status) == (found.lower, found.upper, found.status)
        assert [str(feature) for feature in other.features] == [str(feature) for feature in found.features]
    with pytest.raises(ValueError, match="read-only"):
        found.points[0, 0] = 1.0


def test_faces_of_several_degrees():
    """Faces of degrees 1 to 5 in one body."""
    sheet = wavy(np.random.default_rng(3), 1, False)
    tall = sheet.elevate((5, 4)).transformed(translation=(0.0, 0.0, 3.0))
    body = [Face(sheet, name="low"), Face(tall, name="high"), Face(SHAPES.plane(0.5, 0.5), name="flat")]
    ball = SHAPES.sphere(0.1)
    check(body, ball, (None, at(0.5, 0.5, 5.0)), minimum_distance(tall, np.array([0.5, 0.5, 5.0])).upper - 0.1)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"tolerance": 0.0}, "tolerance is 0"),
        ({"tolerance": math.nan}, "tolerance is nan"),
        ({"budget": 0}, "budget is 0"),
        ({"budget": 1.5}, "budget is 1.5"),
        ({"poses": (None,)}, "poses is"),
        ({"poses": (None, [0.0] * 7)}, r"poses\[1\]"),
        ({"poses": ([math.inf, 0, 0, 1, 0, 0, 0], None)}, r"poses\[0\]"),
    ],
)
def test_bad_arguments(arguments, text):
    sphere = SHAPES.sphere(1.0)
    with pytest.raises((InputError, TypeError), match=text):
        distance(sphere, sphere, **arguments)


def test_bad_shapes():
    with pytest.raises(TypeError, match="a is 3"):
        distance(3, SHAPES.sphere(1.0))
    with pytest.raises(InputError, match="without a shape"):
        distance(asm.Body("none"), SHAPES.sphere(1.0))
