"""The witness for wires and ellipsoids against closed forms, the oracle for balls, and the library's pairs."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.geometry.shapes.path import Path
from benchmarks.center_lines import ball_wire, path_wire, torus_wire
from benchmarks.wire_oracle import WireOracle
from tests.laws.ellipsoid_witness import minima, nearest

HERE = np.array([0.0, 0, 0, 1, 0, 0, 0])
SEMI_AXES = np.array([0.7, 0.4, 0.3])
ROD = Path((0, 0, -1), (0, 0, 1)).line(1.2).arc(0.7, 2.0, (1, 0, 0))


def poses(rng, count, extent):
    e = rng.normal(size=(count, 4))
    return np.hstack([rng.uniform(-extent, extent, (count, 3)), e / np.linalg.norm(e, axis=1, keepdims=True)])


def test_nearest_points_have_their_normal_along_the_way():
    rng = np.random.default_rng(1)
    x = rng.normal(size=(500, 3))
    x *= rng.uniform(1.001, 4.0, (500, 1)) / np.linalg.norm(x / SEMI_AXES, axis=1)[:, None]
    y = nearest(SEMI_AXES, x)
    assert np.abs(np.square(y / SEMI_AXES).sum(axis=1) - 1.0).max() < 1e-14
    normal = y / SEMI_AXES**2
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    across = (x - y) - ((x - y) * normal).sum(axis=1)[:, None] * normal
    assert np.abs(across).max() < 1e-14 and (((x - y) * normal).sum(axis=1) > 0.0).all()


@pytest.mark.parametrize("wire", [torus_wire(1.0, 0.12), path_wire(ROD, 0.12)], ids=["torus", "rod"])
def test_an_ellipsoid_with_equal_axes_is_a_ball(wire, cases):
    rng = np.random.default_rng(2)
    oracle, count, pairs = WireOracle([wire, ball_wire(0.4)]), 0, cases(16, 40)
    for q in poses(rng, 2 * pairs, 1.5).reshape(-1, 2, 7):
        expected = oracle.minima(q)
        if expected.gap.min() < -0.1:
            continue
        gaps, points = minima(wire, q[0], [0.4] * 3, q[1])
        order = np.argsort(gaps)
        # Bisection finds places to rounding over the slope's slope.
        np.testing.assert_allclose(gaps[order], expected.gap, rtol=0, atol=1e-13)
        np.testing.assert_allclose(points[order], expected.points, rtol=0, atol=1e-10)
        count += 1
    assert count > pairs / 2


@pytest.mark.parametrize("wire", [torus_wire(1.0, 0.12), path_wire(ROD, 0.12)], ids=["torus", "rod"])
def test_the_library_finds_the_nearest(wire, cases):
    rng = np.random.default_rng(3)
    surface = asm.shapes.torus(1.0, 0.12) if wire.ends[0].size == 0 else asm.shapes.pipe(ROD, 0.12)
    ellipsoid, several, pairs = asm.shapes.ellipsoid(*SEMI_AXES), 0, cases(30, 80)
    for q in poses(rng, 2 * pairs, 0.7).reshape(-1, 2, 7):
        try:
            gaps, points = minima(wire, q[0], SEMI_AXES, q[1])
        except ValueError:
            continue
        several += gaps.size > 1
        if gaps.min() < 0.0:
            continue
        pair = asm.proximity.extremal_pair(surface, q[0], ellipsoid, q[1])
        assert abs(pair.gap - gaps.min()) < 1e-13
        np.testing.assert_allclose(pair.points, points[gaps.argmin()], rtol=0, atol=1e-10)
    assert several > pairs / 27


def test_a_wire_that_dips_in_is_refused():
    with pytest.raises(ValueError, match="enters"):
        minima(torus_wire(1.0, 0.12), HERE, SEMI_AXES, np.array([0.7, 0, 0, 1, 0, 0, 0]))
