"""How near patches are that face each other: never said to be farther than they are, nor below each other wrongly."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from assembly._record import Store
from assembly.geometry.vec import quaternion_matrix
from assembly.kinematics.motion import RelativePose
from assembly.proximity.bvh.tree import view_of
from assembly.proximity.manager.candidates import element_distance
from tests.laws.scenes import posed
from tests.laws.test_facet_enclosure import BODIES, Descent, placed, sample

POINTS = 7
REACH = 0.3


def points_of(tree, k):
    """A net of points of a patch, or None of an edge or a vertex."""
    faces = tree.topology.faces
    if tree.feature[k] >= len(faces):
        return None
    u0, u1, v0, v1 = tree.parameters[k]
    surface = faces[tree.feature[k]].surface
    net = [(u, v) for u in np.linspace(u0, u1, POINTS) for v in np.linspace(v0, v1, POINTS)]
    return np.array([surface.evaluate(u, v) for u, v in net])


@pytest.mark.parametrize("names", [("torus", "torus"), ("box", "torus"), ("box", "cylinder"), ("sphere", "mixed")])
def test_patches_are_no_nearer_than_they_are_said_to_be(names, cases):
    rng = np.random.default_rng(21)
    descent = Descent(*(BODIES[name] for name in names))
    apart, below, count = 0, 0, cases(13, 40)
    for _ in range(count):
        (_, _, f, n), (_, _, g, m) = (sample(tree, rng) for tree in descent.trees)
        turn, shift = placed(rng, f, n, g, m, rng.uniform(-0.25, 0.25))
        e = Rotation.from_matrix(turn).as_quat(scalar_first=True)
        there, shift = quaternion_matrix(*e), np.array(shift)
        pairs = sorted(descent.found(turn, shift, REACH))
        for i, j in (pairs[k] for k in rng.integers(0, len(pairs), min(40, len(pairs)))):
            p, q = points_of(descent.trees[0], i), points_of(descent.trees[1], j)
            if p is None or q is None:
                continue
            q = q @ turn.T + shift
            at = tuple(shift.tolist())
            pair = posed(Store(descent.table, descent.pool), there, at, trees=(descent.f, descent.g))
            distance = element_distance(pair, view_of(RelativePose(there, at)), i, j)
            nearest = np.linalg.norm(p[:, None] - q, axis=2).min()
            if np.isfinite(distance):
                # Points of nets are no nearer than the patches are; rounding of lengths of order one.
                assert distance <= nearest + 1e-12
                apart += distance > 0.0
            else:
                # Along some normal all of g is below all of f.
                ways = np.array([descent.trees[0].axis[i], -turn @ descent.trees[1].axis[j]])
                ways = np.vstack([ways, ways.sum(axis=0) / np.linalg.norm(ways.sum(axis=0))])
                assert ((ways @ q.T).max(axis=1) < (ways @ p.T).min(axis=1) + 1e-12).any()
                below += 1
    assert apart > count / 4 and below > count / 4
