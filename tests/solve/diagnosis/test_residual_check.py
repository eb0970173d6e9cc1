from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.geometry import shapes
from assembly.kinematics.pose import retract
from assembly.proximity.extrema.pairs import gap_gradient
from assembly.solve.diagnosis.residual_check import Claim, Sides, audit, is_extremal, twist_gradients


def poses(rng, count):
    q = rng.normal(size=(count, 7))
    q[:, 3:] /= np.linalg.norm(q[:, 3:], axis=1, keepdims=True)
    return q


def two_balls(gap, radius=0.5):
    shape = shapes.sphere(radius)
    first, second = asm.Body("first", shape), asm.Body("second", shape, position=(2 * radius + gap, 0.0, 0.0))
    return Sides((first.faces[0], second.faces[0]), (0, 1)), np.array([first.q, second.q])


def test_twist_gradients_are_differences_along_retractions():
    rng = np.random.default_rng(0)
    q, weights = poses(rng, 5), rng.normal(size=(7, 7))
    slopes = q @ (weights + weights.T)
    got = twist_gradients(q, slopes)
    h = 1e-5
    for k, twist in enumerate(np.eye(6)):
        ends = [retract(q, np.tile(sign * h * twist, (5, 1))) for sign in (1.0, -1.0)]
        values = [np.einsum("ni,ij,nj->n", end, weights, end) for end in ends]
        # Central differences: h^2, and rounding over h.
        np.testing.assert_allclose(got[:, k], (values[0] - values[1]) / (2 * h), rtol=0, atol=1e-8)


def test_wrench_is_the_gap_s_gradient():
    rng = np.random.default_rng(1)
    shape = shapes.ellipsoid(1.0, 0.7, 0.5)
    sides = Sides((asm.Body("a", shape).faces[0], asm.Body("b", shape).faces[0]), (0, 1))
    for q in (poses(rng, 2) for _ in range(10)):
        q[1, :3] = q[0, :3] + 3.0 * q[1, :3] / np.linalg.norm(q[1, :3])
        pair = sides.find(q, None)
        assert is_extremal(pair)
        slopes = gap_gradient(sides.faces[0], q[0], sides.faces[1], q[1], pair.parameters).reshape(2, 7)
        # Two formulas of products of numbers near one; the pair is good to 1e-13.
        np.testing.assert_allclose(sides.wrench(q, pair, 1.0), twist_gradients(q, slopes), rtol=0, atol=1e-11)


@pytest.mark.parametrize(("radius", "crosses"), [(0.3, False), (0.79, False), (0.81, True), (2.0, True)])
def test_a_ball_wider_than_the_hole_crosses_the_ring_it_touches_from_within(radius, crosses):
    # At the ring's inner equator the hole's radius is 0.8.
    ring, ball = asm.Body("ring", shapes.torus(1.0, 0.2)), asm.Body("ball", shapes.sphere(radius))
    sides = Sides((ring.faces[0], ball.faces[0]), (0, 1))
    q = np.array([ring.q, ball.q])
    q[1, 0] = 0.8 - radius
    near = asm.Body("near", shapes.sphere(0.3), position=(0.45, 0.0, 0.0))
    start = asm.proximity.extremal_pair(ring.faces[0], ring.q, near.faces[0], near.q).parameters.copy()
    start[2:] *= radius / 0.3  # parameters of a ball are lengths
    pair = sides.find(q, start)
    # Touching, nothing but rounding moves the pair.
    np.testing.assert_allclose(pair.points, [[0.8, 0.0, 0.0]] * 2, rtol=0, atol=1e-12)
    assert sides.cross(q, pair) is crosses


def test_a_pole_says_nothing_of_crossing():
    first, second = asm.Body("first", shapes.sphere(0.5)), asm.Body("second", shapes.sphere(0.5), position=(0, 0, 1.0))
    sides = Sides((first.faces[0], second.faces[0]), (0, 1))
    q = np.array([first.q, second.q])
    assert sides.cross(q, sides.find(q, None)) is False


def no_rows(q):
    return np.empty(0)


@pytest.mark.parametrize(
    ("gap", "one_sided", "force", "held", "balanced"),
    [
        (0.0, False, 2.0, True, True),
        (0.0, False, 1.999, True, False),  # does not carry the load
        (0.0, True, 2.0, True, False),  # pulls, and a one-sided contact cannot
        (1e-3, False, 2.0, False, True),
        (-1e-3, True, 2.0, False, False),
        (1e-3, True, 2.0, True, False),  # carries a load without touching
        (1e-3, True, 0.0, True, False),
    ],
)
def test_an_audit_finds_what_is_wrong(gap, one_sided, force, held, balanced):
    sides, q = two_balls(gap)
    gradient = np.zeros((2, 6))
    gradient[1, 0] = -2.0
    start = sides.find(q, None).parameters[None]
    claim = Claim(q, start, np.array([force]), gradient, gradient, np.empty(0))
    found = audit([sides], no_rows, np.array([one_sided]), [1], 1.0, claim)
    assert (found.held, found.balanced) == (held, balanced)
    assert found.residuals[0] == pytest.approx(gap, abs=1e-13)
    assert found.feasibility == pytest.approx(max(-gap, 0.0) if one_sided else abs(gap), abs=1e-13)
    assert not found.crossing


def audit_rows(residuals, one_sided, forces, gradient=0.0, balance=0.0, aside=(), scale=1.0):
    """An audit of one body without contacts."""
    q = poses(np.random.default_rng(2), 1)
    given = [np.array(values, dtype=float) for values in (residuals, forces, aside)]
    slopes = np.full((1, 6), gradient), np.full((1, 6), balance)
    claim = Claim(q, np.empty((0, 4)), given[1], *slopes, given[2])
    sides = np.array(one_sided, dtype=bool)
    return audit([], lambda at: given[0] if at is q else np.full(3, np.nan), sides, [0], scale, claim)


@pytest.mark.parametrize(
    ("arguments", "held", "balanced"),
    [
        (([], [], []), True, True),
        (([], [], [], 1e-3, 1e-3), True, False),  # nothing balances the objective
        (([0.0], [False], [3.0], 1.0, 0.0), True, True),
        (([0.0], [False], [3.0], 1.0, 1e-3), True, False),
        (([0.0], [False], [3.0], 1.0, 0.0, [1e-3]), True, False),  # the multiplier of an angle's definition
        (([2e-9], [False], [0.0]), False, True),
        (([2e-9, 0.0], [True, True], [0.0, 0.0]), True, True),
        (([0.0, -2e-9], [True, True], [0.0, 0.0]), False, True),
        (([0.0], [True], [-3.0]), True, True),
        (([0.0], [True], [3.0]), True, False),
        (([0.5], [True], [-3.0]), True, False),
        (([np.inf], [False], [0.0]), False, True),
        (([-np.inf], [True], [0.0]), False, True),
        (([], [], [], np.nan, np.nan), True, False),
        (([], [], [], np.inf, np.inf), True, False),
    ],
)
def test_an_audit_looks_at_every_row(arguments, held, balanced):
    found = audit_rows(*arguments)
    assert (found.held, found.balanced) == (held, balanced)
    assert not np.isnan(found.stationarity) and found.parameters.shape == (0, 4)


def test_violations_of_lengths_are_in_the_user_s_unit():
    found = audit_rows([0.25, -0.5], [False, True], [0.0, 0.0], scale=8.0)
    assert found.feasibility == 4.0
    np.testing.assert_array_equal(found.residuals, [0.25, -0.5])
