"""`closest_features` says how far apart bodies are at least: no point of one is nearer to any of the other one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

import assembly as asm
from assembly.kinematics.pose import rotate
from assembly.proximity import FeatureStatus, closest_features
from tests.laws.scenes import random_quaternion

CYLINDER = asm.shapes.solid_cylinder(5.0, 10.0)
CONE = (asm.Face(asm.shapes.cone(5.0, 10.0)), CYLINDER[-2])
BOX = asm.shapes.box(3.0, 4.0, 5.0)
# Sizes of the shapes are up to this.
SIZE = 15.0
# What counts as proven.
PROVEN = 1e-9


def samples(shape, count):
    """Points of a shape, (n, 3): of its faces within their boundaries, in its axes."""
    points = []
    for face in shape if isinstance(shape, tuple) else (asm.Face(shape),):
        u, v = np.meshgrid(*(np.linspace(low, high, count) for low, high in face.surface.domain))
        within = np.ones(u.shape, dtype=bool) if face.outer is None else face.contains(u, v)
        points.append(face.surface.evaluate(u[within], v[within]))
    return np.concatenate(points)


def moved(points, q):
    return rotate(q[3:], points) + q[:3]


def turned(rng):
    """A unit quaternion."""
    e = random_quaternion(rng)
    return e / np.linalg.norm(e)


def beside(kind, rng):
    """Shapes, poses and how far apart they are, where the nearest points are many or at a tip."""
    turn, gap = turned(rng), 10.0 ** rng.uniform(-3.0, 1.5)
    angle, along = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(-6.0, 6.0)
    off = rng.uniform(-2.0, 2.0, 2)
    a, b, place = {
        "parallel cylinders": (CYLINDER, CYLINDER, (10.0 + gap) * np.array([np.cos(angle), np.sin(angle), 0.0])),
        "a tip under a disk": (CONE, CYLINDER, np.array([*off, 10.0 + gap])),
        "a tip under a box": (CONE, BOX, np.array([*(0.5 * off), 7.5 + gap])),
        "a tip under a tip's disk": (CONE, CONE, np.array([*off, 10.0 + gap])),
        "faces of boxes": (BOX, BOX, np.array([*(0.5 * off), 5.0 + gap])),
    }[kind]
    if kind == "parallel cylinders":
        place = place + [0.0, 0.0, along]
    frame = asm.Pose(rng.uniform(-20.0, 20.0, 3), turn)
    return a, b, frame.q, (frame @ asm.Pose(place)).q, gap


@pytest.mark.parametrize(
    "kind",
    [
        "parallel cylinders",
        "a tip under a disk",
        "a tip under a box",
        "a tip under a tip's disk",
        "faces of boxes",
    ],
)
def test_a_continuum_and_a_tip_are_proven(kind, cases):
    rng = np.random.default_rng(sum(map(ord, kind)))
    for _ in range(cases(4, 40)):
        a, b, q_a, q_b, gap = beside(kind, rng)
        pair = closest_features(a, b, q_a, q_b)
        assert pair.status is FeatureStatus.APART
        # Rounding of coordinates of some tens, and what is proven.
        assert abs(pair.gap - gap) < 1e-12 * SIZE
        assert gap - PROVEN * 2.0 * SIZE <= pair.lower <= gap + 1e-12 * SIZE


def test_no_sample_is_nearer_than_the_lower_bound(cases):
    shapes = (CYLINDER, CONE, BOX, asm.shapes.torus(4.0, 1.0), asm.shapes.sphere(2.0))
    points = [samples(shape, 40) for shape in shapes]
    rng = np.random.default_rng(7)
    for _ in range(cases(12, 200)):
        i, j = rng.integers(len(shapes), size=2)
        q_a = np.array([*rng.uniform(-3.0, 3.0, 3), *turned(rng)])
        q_b = np.array([*(rng.normal(size=3) * 9.0), *turned(rng)])
        pair = closest_features(shapes[i], shapes[j], q_a, q_b)
        if pair.status is not FeatureStatus.APART:
            continue
        nearest = cKDTree(moved(points[i], q_a)).query(moved(points[j], q_b))[0].min()
        assert pair.lower <= abs(pair.gap) + 1e-13 * SIZE and abs(pair.gap) - pair.lower <= PROVEN * 2.0 * SIZE
        assert pair.lower <= nearest
