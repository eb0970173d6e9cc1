"""The public side of features: names, poses, tracking against the search, penetration, bad input."""

from __future__ import annotations

import numpy as np
import pytest

from assembly.errors import InputError
from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.shapes import solids
from assembly.geometry.splines.curve import NurbsCurve
from assembly.kinematics.body import Body
from assembly.proximity import Feature, FeaturePair, FeatureStatus, FeatureTracker, closest_features
from tests.laws.scenes import random_quaternion


def test_features_say_what_they_are():
    plate = Body("plate", solids.plate(2.0, 1.5, 0.3))
    ball = Body("ball", shapes.sphere(0.2, name="shell"), position=(0.1, 0.2, 1.0))
    pair = closest_features(plate, ball)
    assert isinstance(pair, FeaturePair) and pair.status is FeatureStatus.APART
    assert pair.features == (Feature("face", pair.features[0].index, "face 'top'"), Feature("face", 0, "face 'shell'"))
    np.testing.assert_allclose(pair.points, [[0.1, 0.2, 0.15], [0.1, 0.2, 0.8]], atol=1e-13)
    np.testing.assert_allclose(pair.normal, [0.0, 0.0, 1.0], atol=1e-13)
    assert pair.parameters.shape == (2, 2)
    assert abs(pair.gap - 0.65) < 1e-13 and 0.65 - 1e-11 < pair.lower <= 0.65 + 1e-13
    beside = closest_features(plate, ball, q_b=[2.0, 0.1, 1.0, 1.0, 0.0, 0.0, 0.0])
    edge = beside.features[0]
    assert edge.kind == "edge" and edge.name.startswith("edge ") and "'top'" in edge.name and "'right'" in edge.name
    # The point of the edge is where its parameter says: (t, 0).
    assert beside.parameters[0, 1] == 0.0
    corner = closest_features(plate, ball, q_b=[2.0, 2.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    assert corner.features[0].kind == "vertex" and corner.features[0].name == f"vertex {corner.features[0].index}"
    np.testing.assert_allclose(corner.points[0], [1.0, 0.75, 0.15], atol=1e-14)
    assert repr(corner.features[0]) == corner.features[0].name


def test_poses_are_the_bodies_own_and_swap():
    rng = np.random.default_rng(1)
    q_a, q_b = (np.concatenate([3.0 * k + rng.normal(size=3), random_quaternion(rng)]) for k in range(2))
    faces_a, faces_b = shapes.box(1.0, 2.0, 0.5), solids.solid_cylinder(0.4, 1.0)
    a, b = Body("a", faces_a, q_a[:3], q_a[3:]), Body("b", faces_b, q_b[:3], q_b[3:])
    own, given, swapped = closest_features(a, b), closest_features(faces_a, faces_b, q_a, -q_b), closest_features(b, a)
    minus = closest_features(faces_a, faces_b, q_a, np.concatenate([q_b[:3], -q_b[3:]]))
    assert abs(own.gap - minus.gap) < 1e-13 and given.gap != own.gap
    assert abs(own.gap - swapped.gap) < 1e-12
    np.testing.assert_allclose(own.points, swapped.points[::-1], atol=1e-9)
    np.testing.assert_allclose(own.normal, -swapped.normal, atol=1e-9)
    # Moved together by much, and in other units.
    far = np.array([1e3, -2e3, 5e2, 0, 0, 0, 0])
    assert abs(closest_features(a, b, q_a + far, q_b + far).gap - own.gap) < 1e-10
    small = [tuple(Face(f.surface.transformed(scale=1e-3), f.outer) for f in faces) for faces in (faces_a, faces_b)]
    scale = np.array([1e-3] * 3 + [1.0] * 4)
    assert abs(1e3 * closest_features(*small, scale * q_a, scale * q_b).gap - own.gap) < 1e-11


@pytest.mark.parametrize("seed", range(3))
def test_tracking_gives_what_a_search_gives(seed):
    rng = np.random.default_rng(seed)
    a, b = solids.plate(2.0, 1.4, 0.4), [shapes.box(0.6, 0.8, 0.5), solids.solid_cylinder(0.3, 0.9)][seed % 2]
    tracker = FeatureTracker(a, b)
    turn, offset = random_quaternion(rng), rng.uniform(-0.3, 0.3, 2)
    kinds, before = set(), None
    for k in range(300):
        x = -2.0 + 4.0 * k / 299
        q = np.concatenate([[x, offset[0] + 0.3 * x, 1.0 + 0.1 * np.sin(5.0 * x)], turn + 0.05 * np.sin(3.0 * x)])
        pair = tracker.step(None, q)
        kinds.add(tuple(feature.kind for feature in pair.features))
        assert pair.gap > 0.0
        if k % 10 == 0:
            assert abs(pair.gap - closest_features(a, b, q_b=q).gap) < 1e-12
        # No jumps: the gap changes by no more than points of the moving body do.
        assert before is None or abs(pair.gap - before) < 0.03
        before = pair.gap
    assert tracker.searches == 1 and tracker.switches >= 2 and len(kinds) >= 2


def test_through_touching_and_apart_again():
    plate, ball = solids.plate(2.0, 1.5, 0.3), shapes.sphere(0.2)
    tracker = FeatureTracker(plate, ball)
    for z in np.concatenate([np.linspace(0.6, 0.3, 31), np.linspace(0.3, 0.6, 31)]):
        q = [0.1, 0.2, z, 1.0, 0.0, 0.0, 0.0]
        wanted = z - 0.2 - 0.15
        assert abs(tracker.step(None, q).gap - wanted) < 1e-13
        pair = closest_features(plate, ball, q_b=q)
        # Without a past: the same pair, the one by which they come apart along the normal of their crossing.
        assert pair.gap <= 0.0 if wanted < -1e-9 else abs(pair.gap - wanted) < 1e-12
        assert pair.status is (FeatureStatus.PENETRATING if wanted < -1e-9 else FeatureStatus.APART)


def test_two_boxes_in_each_other():
    box = shapes.box(1.0, 1.0, 1.0)
    pair = closest_features(box, box, q_b=[0.1, 0.05, 0.9, 1.0, 0.02, 0.03, 0.0])
    assert pair.status is FeatureStatus.PENETRATING
    assert -0.2 < pair.gap < -0.05
    d = pair.points[1] - pair.points[0]
    assert abs(d @ pair.normal - pair.gap) < 1e-13 and np.linalg.norm(np.cross(d, pair.normal)) < 1e-12


def test_bad_input_is_named():
    box, ball = shapes.box(1.0, 1.0, 1.0), shapes.sphere(1.0)
    with pytest.raises(TypeError, match="a is 3"):
        closest_features(3, ball)
    with pytest.raises(TypeError, match=r"b\[1\] is 'x'"):
        closest_features(ball, [ball, "x"])
    with pytest.raises(InputError, match="b is empty"):
        closest_features(ball, [])
    with pytest.raises(InputError, match="without a shape"):
        closest_features(Body("none"), ball)
    with pytest.raises(InputError, match="q_a"):
        closest_features(box, ball, q_a=[0.0] * 6)
    with pytest.raises(InputError, match="q_b"):
        closest_features(box, ball, q_b=[np.nan] * 7)
    with pytest.raises(InputError, match=r"q_b\[2\] is -1e\+160; expected coordinates"):
        closest_features(shapes.sphere(1.0), shapes.plane(1.0, 1.0), q_b=(0.0, 0.0, -1e160, 1.0, 0.0, 0.0, 0.0))
    # No direction, or one whose squares no double holds.
    for length in (0.0, 1e-160, 1e160):
        with pytest.raises(InputError, match=r"q_b\[3:\]"):
            FeatureTracker(box, ball).step(None, [1.0, 2.0, 3.0, length, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("gap", [1e-6, 1e-9, 1e-10, 1e-12, 1e-14, 0.0, -1e-14, -1e-12, -1e-9])
def test_bodies_that_all_but_touch_are_told_apart_to_rounding(gap):
    # A ball beside faces, edges and corners of a box: the gap is the distance to the foot, minus the radius.
    rng = np.random.default_rng(5)
    side, radius = np.array([1.0, 1.4, 0.7]), 0.35
    box, ball = Body("box", shapes.box(*side)), Body("ball", shapes.sphere(radius))
    for kind in (1, 2, 3, 2, 3, 2):
        axes = rng.permutation(3)[:kind]
        signs = rng.choice([-1.0, 1.0], 3)
        foot = rng.uniform(-0.45, 0.45, 3) * side
        foot[axes] = 0.5 * (signs * side)[axes]
        n = np.zeros(3)
        n[axes] = signs[axes] * rng.uniform(0.1, 1.0, kind)
        n /= np.linalg.norm(n)
        q = np.concatenate([foot + (radius + gap) * n, random_quaternion(rng)])
        q[3:] /= np.linalg.norm(q[3:])
        pair = closest_features(box, ball, q_b=q)
        # Rounding of numbers near one.
        assert abs(pair.gap - gap) < 2e-15
        np.testing.assert_allclose(pair.normal, n, atol=1e-12)
        assert pair.status is FeatureStatus.APART or (pair.status is FeatureStatus.PENETRATING and pair.gap <= 0.0)


BOX, PLATE = shapes.box(1.0, 1.0, 1.0), shapes.box(2.0, 2.0, 0.1)
BLOCK, ROD = shapes.box(2.0, 2.0, 1.0), shapes.solid_cylinder(0.5, 1.0)


@pytest.mark.parametrize(
    ("a", "b", "place", "gap"),
    [
        (BLOCK, ROD, (0.3, 0.2, 1.0), 0.0),
        (BLOCK, ROD, (0.3, 0.2, 0.999), -0.001),
        (PLATE, PLATE, (0.3, 0.2, 0.1), 0.0),
        (BOX, BOX, (0.3, 0.2, 1.0 - 1e-9), -1e-9),
        (BOX, BOX, (0.9, 0.1, 0.1), -0.1),
        (BOX, BOX, (0.1, -0.95, 0.2), -0.05),
        (shapes.torus(1.0, 0.72), shapes.sphere(0.57), (0.04, 0.01, 0.79), None),
    ],
    ids=["rod on block", "rod in block", "plates", "stacked", "side by side", "behind", "ball in a torus"],
)
def test_bodies_in_each_other_come_apart_by_the_shortest_way(a, b, place, gap):
    # Ways out along other faces than the nearest ones are longer by hundreds.
    if gap is None:
        # A ball beside the ring of a torus: the distance from its middle to the circle, less both radii.
        gap = np.hypot(np.hypot(*place[:2]) - 1.0, place[2]) - 0.72 - 0.57
    for first, second, sign in ((a, b, 1.0), (b, a, -1.0)):
        # A way of 1e-9 is one, too.
        pair = closest_features(first, second, q_b=[*(sign * np.array(place)), 1.0, 0.0, 0.0, 0.0], touching=0.0)
        assert pair.gap == pytest.approx(gap, abs=1e-12)
        assert pair.status is (FeatureStatus.PENETRATING if pair.gap < 0.0 else FeatureStatus.APART)


def stair():
    """A block with a step: the tread is y = 1 from x = 1 on, the riser x = 1 above it."""
    corners = np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], dtype=float)
    sides = [np.array([corners[k], corners[(k + 1) % 6]]) for k in range(6)]
    return shapes.extrusion([NurbsCurve(side, [0.0, 0.0, 1.0, 1.0], 1) for side in sides], 1.0)


def test_what_touches_at_one_place_and_crosses_at_another_is_not_apart():
    # A box that rests on the tread, a tenth deep in the riser: a way out upward ends at the tread, gap zero.
    for height in (0.0, 0.13):
        there = np.array([1.4, 1.5, height])
        pair = closest_features(stair(), BOX, q_b=[*there, 1.0, 0.0, 0.0, 0.0])
        assert pair.status is FeatureStatus.PENETRATING and pair.gap == pytest.approx(-0.1, abs=1e-13)
        back = closest_features(BOX, stair(), q_b=[*-there, 1.0, 0.0, 0.0, 0.0])
        assert back.status is FeatureStatus.PENETRATING and back.gap < -0.09


@pytest.mark.parametrize(("radius", "place"), [(0.4, (0.1, 0.0, 1.0)), (0.5, (0.17, -0.12, 1.0))])
def test_stacked_cylinders_touch(radius, place):
    # Their walls meet on the rims, to rounding: the way out is along the caps' normal.
    lower, upper = shapes.solid_cylinder(radius, 1.0), shapes.solid_cylinder(0.4, 1.0)
    pair = closest_features(lower, upper, q_b=[*place, 1.0, 0.0, 0.0, 0.0])
    assert pair.status is FeatureStatus.APART and abs(pair.gap) < 1e-15


@pytest.mark.parametrize("place", [(0.5, 0.0, 0.0), (0.0, -0.25, 0.0), (0.0, 0.5, 0.5), (0.0, 0.0, 0.0)], ids=str)
def test_solids_with_flush_faces_that_overlap_are_not_apart(place):
    # All that a search finds first are points in common, at distance zero.
    pair = closest_features(BOX, BOX, q_b=[*place, 1.0, 0.0, 0.0, 0.0])
    assert pair.status is FeatureStatus.PENETRATING and pair.gap <= -0.5


@pytest.mark.parametrize("place", [(1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (1.0, -1.0, 1.0), (1.0, 0.3, 0.2)], ids=str)
def test_solids_that_touch_do_not_overlap(place):
    pair = closest_features(BOX, BOX, q_b=[*place, 1.0, 0.0, 0.0, 0.0])
    assert pair.status is not FeatureStatus.CROSSING and abs(pair.gap) < 1e-14


def test_a_ball_that_crosses_the_axis_of_a_hole_has_the_near_side_of_the_rim():
    # Behind the axis the rim's point that was nearest is the farthest one, and still one where nothing pulls.
    plate = shapes.plate(2.0, 2.0, 0.2, holes=[(0.0, 0.0, 0.5)])
    ball = shapes.sphere(0.1)
    tracker = FeatureTracker(plate, ball)
    for k in range(60):
        pose = (0.3 - 0.0101 * k, 0.0, 0.35, 1.0, 0.0, 0.0, 0.0)
        pair = tracker.step(None, pose)
        assert pair.gap == pytest.approx(np.hypot(0.5 - abs(pose[0]), 0.25) - 0.1, abs=1e-12)
    assert tracker.searches == 2
