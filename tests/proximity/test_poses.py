"""Queries of shapes take a pose as a `Pose` and as its row, and answer the same."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly import proximity

TURN = asm.Pose.from_axis_angle((1.0, 2.0, 0.5), 0.3)
HERE = asm.Pose(np.array([0.1, -0.2, 0.3]), TURN.quaternion)
THERE = asm.Pose(np.array([0.2, 0.1, 3.1]), np.array([1.0, 0.0, 0.0, 0.0]))
BALL, BOX = asm.shapes.sphere(1.0), asm.shapes.box(1.0, 1.2, 0.8)


def box_faces(first, second):
    """The rows of a box's top and of another one's bottom."""
    a, b = asm.Body("a", BOX), asm.Body("b", BOX)
    found = proximity.contact_manifold(a.face("top"), b.face("bottom"), poses=(first, second))
    return np.concatenate([found.gaps, found.places.ravel()])


def tracked(first, second):
    """The gap and the points that a tracker of the nearest features gives."""
    pair = proximity.FeatureTracker(BALL, BOX).step(first, second)
    return np.append(pair.points.ravel(), pair.gap)


QUERIES = {
    "distance": lambda p, q: proximity.distance(BALL, BOX, poses=(p, q)).points,
    "closest_features": lambda p, q: proximity.closest_features(BALL, BOX, p, q).points,
    "tracker": tracked,
    "contact_manifold": box_faces,
    "extremal_pair": lambda p, q: proximity.extremal_pair(BALL, p, BALL, q).points,
}


@pytest.mark.parametrize("name", QUERIES)
def test_a_pose_is_its_row(name):
    query = QUERIES[name]
    there = asm.Pose(THERE.position if name != "contact_manifold" else (0.2, 0.1, 1.0), THERE.quaternion)
    here = HERE if name != "contact_manifold" else asm.Pose((0.1, -0.2, 0.1), (1.0, 0.01, 0.0, 0.0))
    of_poses = query(here, there)
    assert of_poses.size > 0
    assert (of_poses == query(here.q, there.q)).all() and (of_poses == query(here, there.q)).all()
