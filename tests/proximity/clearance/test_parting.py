"""The least move that opens contacts: it opens all by what is asked, and none is shorter.

The other minimizer is SLSQP, whose answers are off by about 1e-9 of themselves.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from assembly.proximity.clearance.parting import least_move
from tests.proximity.clearance.scenes import direction


def opened(move, normals, arms):
    """What contacts open by."""
    return normals @ move[:3] + (np.cross(arms, normals) @ move[3:])


def size_of(move, radius):
    return float(np.hypot(np.linalg.norm(move[:3]), radius * np.linalg.norm(move[3:])))


def peer(normals, arms, asked, radius):
    """The size of the least move by SLSQP, in units of what is asked, or None."""
    rates = np.column_stack([normals, np.cross(arms, normals) / radius])
    found = minimize(
        lambda x: 0.5 * x @ x,
        np.linalg.lstsq(rates, asked, rcond=None)[0],
        jac=lambda x: x,
        constraints={"type": "ineq", "fun": lambda x: rates @ x - asked, "jac": lambda x: rates},
        method="SLSQP",
        options={"ftol": 1e-15, "maxiter": 500},
    )
    holds = found.success and (rates @ found.x - asked).min() > -1e-7
    return float(np.linalg.norm(found.x)) if holds else None


def test_random_contacts(cases):
    rng, both = np.random.default_rng(0), 0
    for _ in range(cases(120, 5000)):
        many, radius = int(rng.integers(1, 9)), 10.0 ** rng.uniform(-2.0, 2.0)
        toward = direction(rng)
        normals = np.array([direction(rng) for _ in range(many)])
        if rng.random() < 0.7:
            normals = normals + 0.9 * toward
            normals /= np.linalg.norm(normals, axis=1)[:, None]
        arms, asked = radius * rng.normal(size=(many, 3)), rng.uniform(-0.5, 1.0, many)
        move = least_move(normals, arms, asked, radius)
        expected = peer(normals, arms, asked, radius)
        if move is None:
            assert expected is None
            continue
        assert (opened(move, normals, arms) - asked).min() > -1e-12 * max(1.0, size_of(move, radius))
        if expected is not None and expected > 0.0:
            both += 1
            assert size_of(move, radius) == pytest.approx(expected, rel=1e-6, abs=1e-9)
    assert both > 30


@pytest.mark.parametrize("scale", [1e-12, 1e-6, 1.0, 1e3])
def test_sizes_make_no_difference(scale):
    rng = np.random.default_rng(1)
    normals = np.array([direction(rng) for _ in range(3)])
    arms, asked = rng.normal(size=(3, 3)), np.array([1.0, 0.3, -0.2])
    one, other = least_move(normals, arms, asked, 2.0), least_move(normals, arms, scale * asked, 2.0)
    assert other == pytest.approx(scale * one, rel=1e-9, abs=1e-12 * scale)


def test_what_opens_already_is_not_moved():
    assert not least_move(np.eye(3), np.ones((3, 3)), np.array([-1.0, 0.0, -1e-9]), 1.0).any()


def test_one_contact_through_the_middle():
    n = np.array([[0.0, 0.6, 0.8]])
    assert least_move(n, 3.0 * n, np.array([1e-9]), 5.0) == pytest.approx([0.0, 6e-10, 8e-10, 0.0, 0.0, 0.0], abs=1e-22)


def test_held_from_all_sides():
    """Opposed contacts through one line; a body in a cage of six; but not one that may turn out of both."""
    n = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    one = np.array([[0.1, 0.0, -0.5], [0.1, 0.0, 0.5]])
    assert least_move(n, one, np.full(2, 1e-9), 1.0) is None
    cage = np.vstack([np.eye(3), -np.eye(3)])
    assert least_move(cage, -cage, np.full(6, 1.0), 1.0) is None
    apart = np.array([[0.3, 0.0, -0.5], [-0.3, 0.0, 0.5]])
    move = least_move(n, apart, np.full(2, 1e-9), 1.0)
    assert opened(move, n, apart) == pytest.approx([1e-9, 1e-9], rel=1e-9)
    # A wedge that closes by what it may.
    move = least_move(n, one, np.array([0.5, -1.0]), 1.0)
    assert opened(move, n, one)[0] >= 0.5 * (1 - 1e-12) and opened(move, n, one)[1] >= -1.0
