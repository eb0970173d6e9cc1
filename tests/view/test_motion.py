"""Rotations of many things at once, and the screw between two poses, against independent formulas."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm, logm

from assembly.kinematics.pose import Pose, rotation_matrix
from assembly.view.motion import aligned, between, quaternions, rotations, sample_times, turned

RNG = np.random.default_rng(11)


def random_pose(size=1.0):
    e = RNG.normal(size=4)
    return Pose(size * RNG.normal(size=3), e / np.linalg.norm(e))


def test_rotations_and_quaternions():
    e = RNG.normal(size=(50, 4))
    found = rotations(e.reshape(5, 10, 4)).reshape(50, 3, 3)
    # A few products of numbers up to one.
    assert found == pytest.approx(np.array([rotation_matrix(row) for row in e]), abs=1e-14)
    assert rotations(quaternions(found)) == pytest.approx(found, abs=1e-14)
    # Half turns, where the scalar part vanishes, and no turn at all.
    turns = np.array([np.eye(3), np.diag([1.0, -1, -1]), np.diag([-1.0, 1, -1]), np.diag([-1.0, -1, 1])])
    assert (rotations(quaternions(turns)) == turns).all()


def test_quaternions_stay_on_one_side():
    angle = np.linspace(0.0, 4.0 * np.pi, 100)
    e = np.stack([np.cos(0.5 * angle), 0 * angle, 0.6 * np.sin(0.5 * angle), 0.8 * np.sin(0.5 * angle)], axis=1)
    # Two turns and back to where it began: every quaternion, not only its rotation.
    assert quaternions(rotations(e)) == pytest.approx(e, abs=1e-14)


def test_aligned_follows_directions_and_turns_no_more():
    path = np.cumsum(RNG.normal(size=(60, 3)), axis=0) + [9.0, 0.0, 0.0]
    unit = path / np.linalg.norm(path, axis=1, keepdims=True)
    found = aligned(path)
    assert found[:, :, 2] == pytest.approx(unit, abs=1e-13)  # rounding of 60 products
    assert found @ np.swapaxes(found, 1, 2) == pytest.approx(np.tile(np.eye(3), (60, 1, 1)), abs=1e-13)
    assert np.linalg.det(found) == pytest.approx(1.0, abs=1e-13)
    steps = np.swapaxes(found[:-1], 1, 2) @ found[1:]
    cosine = 0.5 * (np.einsum("kii->k", steps) - 1.0)
    assert cosine == pytest.approx((unit[:-1] * unit[1:]).sum(axis=1), abs=1e-13)


def test_aligned_stays_a_rotation_where_directions_turn_around_again_and_again():
    """Each turn by nearly half a turn would make rounding of the last one a thousand times larger."""
    rng = np.random.default_rng(8)
    path = rng.normal(size=(2000, 3))
    path[1::2] = -path[::2] + 1e-3 * rng.normal(size=(1000, 3))
    found = aligned(path)
    assert np.abs(np.einsum("kji,kjl->kil", found, found) - np.eye(3)).max() < 1e-14
    assert found[:, :, 2] == pytest.approx(path / np.linalg.norm(path, axis=1, keepdims=True), abs=1e-14)


def test_aligned_with_opposite_and_missing_directions():
    found = aligned(np.array([[0, 0, -2.0], [0, 0, 0], [0, 0, 3.0], [1e-100, 0, 0]]))
    assert found[:, :, 2] == pytest.approx(np.array([[0, 0, -1], [0, 0, -1], [0, 0, 1], [1, 0, 0]]), abs=1e-15)
    assert np.linalg.det(found) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize("part", [0.0, 0.3, 0.5, 1.0])
def test_between_is_the_screw_of_the_logarithm(part):
    for _ in range(20):
        start, end = random_pose(), random_pose()
        step = end.matrix @ np.linalg.inv(start.matrix)
        if np.trace(step) < 0.05:
            continue  # near half a turn a logarithm has no digits
        expected = np.real(expm(part * logm(step))) @ start.matrix
        found = between(start.q, end.q, np.array([part]))
        # scipy's logarithm has some 1e-13 where the turn is large.
        assert Pose(found[:3], found[3:]).matrix == pytest.approx(expected, abs=1e-11)


def test_between_does_not_know_where_the_origin_of_a_body_is():
    start, end = random_pose(), random_pose()
    origin = random_pose(5.0)
    part = np.array([0.37])
    here = between(start.q, end.q, part)
    there = between((start @ origin).q, (end @ origin).q, part)
    # Arcs of radius 5 from rounded ends.
    assert (Pose(here[:3], here[3:]) @ origin).matrix == pytest.approx(Pose(there[:3], there[3:]).matrix, abs=1e-13)


def test_a_hinge_on_a_fixed_axis_stays_closed():
    hinge, offset = random_pose(), random_pose()
    start, end = (hinge @ Pose.from_axis_angle((0, 0, 1), angle) @ offset for angle in (0.3, 2.9))
    row = between(start.q, end.q, np.array([0.4]))
    found = hinge.inverse() @ Pose(row[:3], row[3:]) @ offset.inverse()
    expected = Pose.from_axis_angle((0, 0, 1), 0.3 + 0.4 * 2.6)
    assert found.matrix == pytest.approx(expected.matrix, abs=1e-14)


def test_without_a_turn_between_is_straight():
    start = random_pose()
    end = Pose(start.position + [1.0, 2.0, -4.0], -start.quaternion)
    row = between(start.q, end.q, np.array([0.25]))
    assert row[:3] == pytest.approx(start.position + [0.25, 0.5, -1.0], abs=1e-15)
    assert rotation_matrix(row[3:]) == pytest.approx(rotation_matrix(start.quaternion), abs=1e-15)
    # Both sides of where the turn vanishes: a turn of 1e-7 bends a way of length 4.6 by less than 1e-6.
    end = Pose(end.position, (Pose.from_axis_angle((1, 1, 0), 1e-7) @ start).quaternion)
    assert between(start.q, end.q, np.array([0.25]))[:3] == pytest.approx(row[:3], abs=1e-6)


def test_turned_goes_the_shorter_way():
    start, end = Pose.from_axis_angle((0, 0, 1), 0.2).quaternion, Pose.from_axis_angle((0, 0, 1), 1.2).quaternion
    for sign in (1.0, -1.0):
        found = turned(start, sign * end, np.array([0.5]))
        assert rotation_matrix(found) == pytest.approx(Pose.from_axis_angle((0, 0, 1), 0.7).matrix[:3, :3], abs=1e-15)


def test_sample_times():
    def poses(*angles):
        return np.array([[Pose.from_axis_angle((0, 1, 0), angle).q, Pose().q] for angle in angles])

    assert sample_times(poses(1.0)).tolist() == [0.0]
    assert sample_times(poses(0.0, 0.0, 0.01)).tolist() == [0.0, 1.0, 2.0]
    # A quarter turn in steps of five degrees, then nothing; every frame is a time.
    times = sample_times(poses(0.0, np.deg2rad(89.9), np.deg2rad(89.9)))
    assert times == pytest.approx([*np.arange(18) / 18, 1.0, 2.0], abs=1e-15)
    assert {0.0, 1.0, 2.0} <= set(times)
