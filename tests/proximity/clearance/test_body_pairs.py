"""Lengths of moves and ways of pairs of bodies are no less than those of sampled points."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from tests.proximity.clearance.scenes import at, direction, poses, proof_of, quaternion, start_of

# Of lengths of some units, by rounding of samples.
ROUNDING = 1e-12


def placed(pose, points):
    """Points of a body at a pose."""
    return quaternion(pose).apply(points) + pose[:3]


def begins():
    """Pairs of parts, and random numbers for each."""
    for number in range(12):
        yield start_of(number), np.random.default_rng([3, number])


def random_pose(rng, far=1.0):
    return at(*far * rng.normal(size=3), Rotation.from_rotvec(rng.uniform(0.0, 3.0) * direction(rng)))


def test_no_point_goes_farther_than_a_way_is_long():
    for begin, rng in begins():
        proof, points = proof_of(begin.a.shape, begin.b.shape), begin.b.samples
        before, after = (poses(random_pose(rng), random_pose(rng)) for _ in range(2))
        one, other = (quaternion(q[0]).inv().apply(placed(q[1], points) - q[0, :3]) for q in (before, after))
        farthest = np.linalg.norm(other - one, axis=1).max()
        length = proof.way_length(0, before, after)
        assert farthest <= length + ROUNDING
        # A turn is counted by its arc, and as if the body were a ball.
        assert length <= 2.0 * farthest


def test_no_point_goes_farther_than_a_move_is_long():
    for begin, rng in begins():
        proof, q = proof_of(begin.a.shape, begin.b.shape), poses(random_pose(rng))
        move = rng.normal(size=6)
        arms = quaternion(q[1]).apply(begin.b.samples)
        farthest = np.linalg.norm(move[:3] + np.cross(move[3:], arms), axis=1).max()
        length = proof.move_length(0, q, move)
        assert farthest <= length + ROUNDING
        assert length <= 2.0 * farthest
        assert proof.move_length(0, q, np.r_[move[:3], np.zeros(3)]) == np.linalg.norm(move[:3])


def test_pairs_that_are_not_near_are_farther_apart_than_asked():
    found = set()
    for begin, rng in begins():
        proof = proof_of(begin.a.shape, begin.b.shape, minimum=0.5)
        q = random_pose(rng, 8.0)
        one, other = begin.a.samples, placed(q, begin.b.samples)
        least = cKDTree(one).query(other)[0].min()
        for distance in (0.0, 0.5, 20.0):
            near = proof.near_pairs(poses(q), distance) == [0]
            found.add(near)
            assert near or least > 0.5 + distance
    assert found == {True, False}


def test_sizes_are_those_of_the_larger_body_and_the_least_radius():
    for begin, _ in begins():
        proof = proof_of(begin.a.shape, begin.b.shape)
        one, other = proof.cells_of_both(0)
        assert proof.cells_of(0) is other
        assert proof.size(0) == max(one.size, other.size)
        assert proof.radius(0) == min(one.radius, other.radius)
