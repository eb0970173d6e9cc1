"""The benchmarks' scenes are what they are said to be."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from benchmarks.scenes import MAJOR, MINOR, crossing, dome_pairs, linked, linked_wires, torus_pairs


def circle(pose, samples):
    """Points and tangents of the center line, an angle apart."""
    t = np.linspace(0.0, 2.0 * np.pi, samples, endpoint=False)
    turn = Rotation.from_quat(pose[3:], scalar_first=True)
    zero = np.zeros(samples)
    points = turn.apply(MAJOR * np.column_stack([np.cos(t), np.sin(t), zero])) + pose[:3]
    return points, turn.apply(MAJOR * np.column_stack([-np.sin(t), np.cos(t), zero]))


def linking_number(a, b, samples=300):
    """Gauss's integral; the sum converges like exp(-samples distance)."""
    (p, dp), (r, dr) = circle(a, samples), circle(b, samples)
    d = p[:, None] - r[None, :]
    volume = (d * np.cross(dp[:, None], dr[None, :])).sum(axis=2)
    return (volume / np.linalg.norm(d, axis=2) ** 3).sum() * (2.0 * np.pi / samples) ** 2 / (4.0 * np.pi)


def random_poses(count, seed):
    rng = np.random.default_rng(seed)
    e = rng.normal(size=(count, 4))
    return np.hstack([rng.uniform(-1.2, 1.2, (count, 3)), e / np.linalg.norm(e, axis=1, keepdims=True)])


def test_linked_is_an_odd_linking_number():
    a, b = random_poses(200, 1), random_poses(200, 2)
    found = []
    for p, r in zip(a, b, strict=True):
        nearest = np.linalg.norm(circle(p, 300)[0][:, None] - circle(r, 300)[0][None, :], axis=2).min()
        if nearest < 0.1:
            continue
        number = linking_number(p, r)
        assert abs(number - round(number)) < 1e-6  # 300 samples a tenth apart: exp(-30) and rounding
        assert linked(p, r) == linked(r, p) == (round(number) % 2 != 0)
        found.append(linked(p, r))
    assert 20 < sum(found) < len(found) - 20


def test_circles_in_one_plane_are_not_linked():
    here = np.array([0.0, 0, 0, 1, 0, 0, 0])
    assert not linked(here, np.array([0.5, 0, 0, 1, 0, 0, 0]))
    assert not linked(here, here)


def test_wires_start_linked_and_clear():
    wires = linked_wires(5)
    assert wires.q.shape == (5, 3, 7) and np.abs(np.linalg.norm(wires.q[..., 3:], axis=2) - 1.0).max() < 1e-15
    for q, grasp, starts in zip(wires.q, wires.grasp, wires.starts, strict=True):
        for i, j in ((0, 1), (1, 2), (0, 2)):
            assert round(abs(linking_number(q[i], q[j]))) == 1
        assert not crossing(q)
        np.testing.assert_allclose(asm.Pose(q[2, :3], q[2, 3:]).apply([MAJOR, 0.0, 0.0]), grasp, rtol=0, atol=1e-14)
        assert list(starts) == [contact.name for contact in wires.scene.constraints]


def test_targets_are_as_far_as_they_should_be():
    wires = linked_wires(5)
    for distance in (0.3, 3.0):
        targets = wires.targets(distance)
        # The root of three squares.
        assert np.abs(np.linalg.norm(targets - wires.grasp, axis=1) - distance).max() < 1e-14
    # What is linked with the first wire reaches no farther than three radii.
    assert np.linalg.norm(targets, axis=1).min() >= 3.0


def test_a_wire_through_another_is_seen():
    q = linked_wires(1).q[0]
    assert not crossing(q)
    through = q.copy()
    through[1] = [2.0 * MAJOR - 0.5 * MINOR, 0, 0, 1, 0, 0, 0]
    assert crossing(through)


@pytest.mark.parametrize("gap", [0.1, 0.0, -1e-2])
def test_pairs_are_where_they_were_placed(gap):
    pairs = torus_pairs(20, gap)
    table, pool, records = pairs.packed()
    assert records.shape == (20, 2) and np.unique(records).size == 40 and records.max() < table.size
    for (f, g), q, x in zip(pairs.surfaces, pairs.q, pairs.parameters, strict=True):
        pair = asm.proximity.extremal_pair(f, q[0], g, q[1], x)
        # Roundings of lengths of a few, over curvatures of at least 0.3.
        np.testing.assert_allclose(pair.parameters, x, rtol=0, atol=1e-13)
        assert abs(pair.gap - gap) < 1e-14
    same = torus_pairs(20, 0.1)
    np.testing.assert_array_equal(same.parameters, pairs.parameters)


def test_surfaces_that_pairs_share_are_packed_once():
    pairs = dome_pairs(6)
    table, pool, records = pairs.packed()
    assert np.unique(records).size == 2
    assert table.size == sum(surface.packed()[0].size for surface in pairs.surfaces[0])
    assert pool.size == sum(surface.packed()[1].size for surface in pairs.surfaces[0])
    for (f, g), q, x in zip(pairs.surfaces, pairs.q, pairs.parameters, strict=True):
        pair = asm.proximity.extremal_pair(f, q[0], g, q[1], x)
        np.testing.assert_allclose(pair.parameters, x, rtol=0, atol=1e-13)
        assert abs(pair.gap - 0.1) < 1e-14
