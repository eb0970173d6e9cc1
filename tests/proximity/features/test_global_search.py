"""The nearest pair of two bodies against closed forms and against dense sampling polished by scipy.

Distances agree to 1e-12 of the size: the search ends where bounds and the least distance known are 1e-13 apart, and
the minimum is flat to first order in the coordinates. scipy's minimization stops at some 1e-8 of the coordinates, where
its distance is off by the square.
"""

from __future__ import annotations

import json

import numpy as np
import pytest

from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.shapes import solids
from assembly.proximity import FeatureStatus, closest_features
from benchmarks.dense_distance import Sampled, circle_distance, least_distance
from benchmarks.features import random_patch
from tests.laws.scenes import random_quaternion
from tests.laws.witness import rotated


def turned(q):
    """Rotation matrix of a pose."""
    return rotated(np.tile(np.concatenate([np.zeros(3), q[3:]]), (3, 1)), np.eye(3)).T


def test_tori_are_never_wrong(cases):
    rng = np.random.default_rng(12)
    count = 0
    while count < cases(50, 150):
        minor = rng.uniform(0.1, 0.5, 2)
        major = minor * rng.uniform(1.3, 6.0, 2)
        q = np.concatenate([rng.normal(size=3), random_quaternion(rng)])
        q[:3] *= rng.uniform(0.0, 1.2) * (major + minor).sum() / np.linalg.norm(q[:3])
        wanted = circle_distance(*major, turned(q), q[:3]) - minor.sum()
        if wanted < 1e-6:
            continue
        count += 1
        f, g = (shapes.torus(a, b) for a, b in zip(major, minor, strict=True))
        pair = closest_features(f, g, q_b=q)
        size = f.size + g.size
        assert pair.status is FeatureStatus.APART
        assert abs(pair.gap - wanted) < 1e-12 * size, (count, pair.gap, wanted)
        assert abs(pair.lower - wanted) < 1e-12 * size
        assert abs(np.linalg.norm(pair.points[1] - pair.points[0]) - wanted) < 1e-12 * size


def check(a, b, sampled_a, sampled_b, q, size):
    """One pair against the dense search; returns the kinds of its features."""
    pair = closest_features(a, b, q_b=q)
    wanted = least_distance(sampled_a, sampled_b, turned(q), q[:3])
    if pair.status in (FeatureStatus.PENETRATING, FeatureStatus.CROSSING):
        # The dense search finds a crossing to the precision of its coordinates.
        assert wanted < 1e-6
        return "crossing"
    assert pair.status is FeatureStatus.APART
    distance = np.linalg.norm(pair.points[1] - pair.points[0])
    assert abs(abs(pair.gap) - distance) < 1e-12 * size
    assert distance <= wanted + 1e-12 * size, (distance, wanted)
    assert distance > wanted - 1e-4 * size and pair.lower > distance - 1e-12 * size
    return "-".join(feature.kind for feature in pair.features)


def test_trimmed_patches(cases):
    rng = np.random.default_rng(13)
    kinds = set()
    for _ in range(cases(8, 16)):
        a, b = random_patch(rng), random_patch(rng)
        q = np.concatenate([rng.normal(size=3), random_quaternion(rng)])
        q[:3] *= rng.uniform(0.3, 1.2) / np.linalg.norm(q[:3])
        kinds.add(check(a, b, Sampled([a]), Sampled([b]), q, 2.0))
    assert len(kinds) > 2


def test_solids(cases):
    rng = np.random.default_rng(14)
    bodies = [
        shapes.box(1.0, 1.3, 0.8),
        solids.solid_cylinder(0.5, 1.5),
        solids.plate(2.0, 1.5, 0.3, [(0.4, 0.3, 0.15), (-0.5, -0.2, 0.25)]),
        solids.plate_with_slot(2.0, 1.0, 0.3, 0.8, 0.3),
        (Face(shapes.sphere(0.7)),),
    ]
    sampled = [Sampled(body, 20000) for body in bodies]
    kinds = set()
    for _ in range(cases(8, 20)):
        i, j = rng.integers(len(bodies), size=2)
        q = np.concatenate([rng.normal(size=3), random_quaternion(rng)])
        q[:3] *= rng.uniform(0.25, 0.65) * (sampled[i].size + sampled[j].size) / np.linalg.norm(q[:3])
        size = sampled[i].size + sampled[j].size
        kinds.add(check(bodies[i], bodies[j], sampled[i], sampled[j], q, size))
    assert len(kinds) > 4


@pytest.mark.parametrize(
    ("a", "b", "q", "gap"),
    [
        # Whole families of nearest points: faces that are parallel, axes that coincide, spheres in spheres.
        (shapes.box(1, 1, 1), shapes.box(1, 1, 1), [0.3, 0.2, 1.5, 1, 0, 0, 0], 0.5),
        (shapes.box(1, 1, 1), shapes.box(1, 1, 1), [0.3, 2.0, 1.0, 1, 0, 0, 0], 1.0),
        (shapes.box(4, 4, 1), solids.solid_cylinder(0.5, 2.0), [0, 0, 1.0, np.sqrt(0.5), np.sqrt(0.5), 0, 0], 0.0),
        (solids.solid_cylinder(0.5, 2.0), solids.solid_cylinder(0.5, 2.0), [1.5, 0.1, 0, 1, 0, 0, 0], None),
        (shapes.torus(3.0, 0.5), shapes.torus(1.0, 0.5), [0, 0, 0, 1, 0, 0, 0], 1.0),
        (shapes.torus(3.0, 0.5), shapes.torus(3.0, 0.5), [0, 0, 2.5, 1, 0, 0, 0], 1.5),
        (shapes.sphere(1.0), shapes.sphere(0.5), [0, 3.0, 0, 1, 0, 0, 0], 1.5),
        # Nearly touching.
        (shapes.sphere(1.0), shapes.sphere(0.5), [0, 1.5 + 1e-9, 0, 1, 0, 0, 0], 1e-9),
        (shapes.sphere(1.0), shapes.torus(3.0, 0.5), [2.0, 0.0, 1.5 + 1e-7, 1, 0, 0, 0], None),
    ],
)
def test_families_and_touching(a, b, q, gap):
    pair = closest_features(a, b, q_b=np.array(q, float))
    if gap is None and len(pair.points) and q[0] == 1.5:
        gap = np.hypot(1.5, 0.1) - 1.0
    elif gap is None:
        # The circle of the torus nearest to the sphere's middle lies in the plane y = 0.
        gap = np.hypot(3.0 - 2.0, 1.5 + 1e-7) - 1.5
    assert pair.status is not FeatureStatus.CROSSING
    assert abs(pair.gap - gap) < 1e-12


def test_a_box_in_a_corner_of_every_kind():
    box = shapes.box(1.0, 1.0, 1.0)
    s = 1.0 / np.sqrt(2.0)
    rng = np.random.default_rng(15)
    seen = set()
    for move, kind, wanted in (
        ((2.0, 0.1, 0.1), "face", 1.0),
        ((2.0, 2.0, 0.05), "edge", np.sqrt(2.0)),
        ((2.0, 2.0, 2.0), "vertex", np.sqrt(3.0)),
    ):
        pair = closest_features(box, box, q_b=[*move, 1.0, 0.0, 0.0, 0.0])
        assert abs(pair.gap - wanted) < 1e-13
        seen.add(kind)
    # A box standing on its corner over a face, and on its edge.
    on_edge = closest_features(box, box, q_b=[0.0, 0.0, 2.0, np.cos(np.pi / 8), np.sin(np.pi / 8), 0.0, 0.0])
    assert {feature.kind for feature in on_edge.features} <= {"face", "edge", "vertex"}
    assert abs(on_edge.gap - (2.0 - 0.5 - s)) < 1e-13
    for _ in range(5):
        q = np.concatenate([[0.05, -0.1, 2.5], random_quaternion(rng)])
        corners = turned(q) @ (0.5 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]).T)
        lowest = corners[:, np.argmin(corners[2])] + q[:3]
        if np.abs(lowest[:2]).max() < 0.5:
            pair = closest_features(box, box, q_b=q)
            assert [feature.kind for feature in pair.features] == ["face", "vertex"]
            assert abs(pair.gap - (lowest[2] - 0.5)) < 1e-13


def pairs_of_a_box_and_a_cylinder():
    rows, box, can = [], shapes.box(1, 1.3, 0.8), solids.solid_cylinder(0.4, 1.0)
    for move in ([0.9, 0.8, 0.9], [0.2, 0.1, 0.9]):
        pair = closest_features(box, can, q_b=[*move, 0.9, 0.3, 0.1, 0.2])
        rows.append([pair.status.name, [f.name for f in pair.features], pair.points.tolist(), pair.gap])
    return rows


PROGRAM = """
import json
from tests.proximity.features.test_global_search import pairs_of_a_box_and_a_cylinder
print(json.dumps(pairs_of_a_box_and_a_cylinder()))
"""


def test_plain_python_finds_the_same(run_python):
    plain = json.loads(run_python(PROGRAM, NUMBA_DISABLE_JIT="1"))
    for one, other in zip(pairs_of_a_box_and_a_cylinder(), plain, strict=True):
        assert one[:2] == other[:2]
        np.testing.assert_allclose(one[2], other[2], atol=1e-9)
        assert abs(one[3] - other[3]) < 1e-13
