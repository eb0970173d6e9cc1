"""Contact velocities alone drift with the step; one Newton correction a step holds the pair."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.evaluate import OFFSETS, SURFACE_RECORD
from assembly.proximity import PairStatus, contact_jacobian, extremal_pair
from assembly.proximity.brep.records import FACE
from assembly.proximity.extrema.feature_query import feature_derivatives
from tests.laws.scenes import placed
from tests.laws.witness import Pairs, Stack, moved

F, G = Face(shapes.torus(3.0, 1.0)), Face(shapes.torus(2.5, 0.8))
PAIR = Pairs(Stack([F.surface]), Stack([G.surface]))
X = np.array([0.7, 0.9, 0.8, 0.6])
Q_F = np.array([0.3, -0.2, 0.1, 0.9, 0.2, -0.3, 0.1])
# A twist a unit of time that rolls and slides both bodies, without crossing a knot of either.
TWIST = np.array([[0.1, -0.05, 0.08, 0.05, 0.1, -0.15, -0.06, 0.1, 0.05, -0.12, 0.03, 0.08]])


Q = np.concatenate([Q_F, placed(F, X[:2], Q_F, G, X[2:], 0.2, 1.1)])


def q_at(t):
    return moved(Q[None], TWIST, t)


def rates(x, q):
    """The contact Jacobian at parameters that may be off a pair, as a velocity method meets them."""
    record, pool = F.packed()
    record_g, pool_g = G.packed()
    record_g = record_g.copy()
    record_g[list(OFFSETS)] += pool.size
    first, hessian = np.empty((5, 14)), np.empty((12, 12))
    store = np.concatenate([record, record_g]), np.concatenate([pool, pool_g])
    features = (FACE, 0), (FACE, SURFACE_RECORD)
    feature_derivatives(store, features, q.reshape(2, 7), tuple(x), (0.0, 0.0, 0.0), 1.0, first, hessian)
    return first[:4]


def end_of_path(count, corrections):
    """Parameters after unit time in `count` Euler steps, each with so many Newton corrections by the witness."""
    x = X.copy()
    for k in range(count):
        q, rate = q_at(k / count)
        x = x + rates(x, q) @ rate[0] / count
        x = PAIR.solve(x[None], q_at((k + 1) / count)[0], corrections)[0]
    return x


@pytest.fixture(scope="module")
def end():
    """The pair at unit time, by small steps solved to rounding."""
    return end_of_path(20, 6)


def test_velocity_alone_drifts_with_the_step(end):
    drift = [np.abs(end_of_path(count, 0) - end).max() for count in (40, 80, 160)]
    # First order: half the step, half the drift (the paper says that there is none).
    assert drift[0] > 1e-4
    assert all(1.8 < a / b < 2.2 for a, b in itertools.pairwise(drift))


def test_one_newton_correction_a_step_holds_the_pair(end):
    drift = [np.abs(end_of_path(count, 1) - end).max() for count in (10, 20, 320)]
    # The prediction is off by h^2, Newton squares that: fourth order, until rounding.
    assert drift[0] / drift[1] > 8.0
    assert drift[2] < 1e-12


def test_the_library_corrects_its_own_prediction(end):
    x = X.copy()
    for k in range(20):
        q, rate = q_at(k / 20)
        x = x + contact_jacobian(F, q[0, :7], G, q[0, 7:], x) @ rate[0] / 20
        q, _ = q_at((k + 1) / 20)
        pair = extremal_pair(F, q[0, :7], G, q[0, 7:], x)
        assert pair.status is PairStatus.CONVERGED
        x = pair.parameters
        assert np.abs(PAIR.residual(x[None], q)).max() < 1e-12
    np.testing.assert_allclose(x, end, rtol=0.0, atol=1e-12)


def test_derivatives_off_a_pair_are_refused(end):
    q, _ = q_at(1.0)
    with pytest.raises(ValueError, match="off an extremal pair"):
        contact_jacobian(F, q[0, :7], G, q[0, 7:], end + 1e-4)
