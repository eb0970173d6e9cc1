"""The controllers' rates against differences: the distance's, the closest point's, and what gains may be."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from assembly.geometry.faces.face import Face
from assembly.proximity import Controller, ControlStatus, extremal_pair, gain_bounds, gain_limit
from benchmarks.controllers import table_one
from tests.laws.control_scenes import above, random_paraboloid
from tests.laws.scenes import placed, random_quaternion

FORMS = ("unit", "covariant", "contravariant")
GAIN = 0.7
HOME = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


def moving(place, velocity, dt):
    """Poses of a point at the origin of its body that is at a place and dt later elsewhere: (2, 7)."""
    return np.stack([np.r_[place, 1, 0, 0, 0], np.r_[place + dt * velocity, 1, 0, 0, 0]])


def closest(surface, point, start):
    """Parameters at rest: rounding of the closest point is the root of that of a length, hence the small tolerance."""
    run = Controller(surface, point, form="contravariant", start=start, tolerance=1e-14).run(10_000)
    assert run.error[-1] < 1e-13 * surface.size
    return run.parameters[-1]


@pytest.mark.parametrize("form", FORMS)
def test_rate_of_the_distance_over_the_least_one(form):
    # V' = -K psi.B psi / |D| - q.(D / |D| - N*), N* = (P* - Q) / E: errata eq. 3, q the velocity of Q.
    rng = np.random.default_rng(1)
    for _ in range(10):
        surface = random_paraboloid(rng)
        best = rng.uniform(0.2, 0.8, 2)
        point = above(surface, *best, rng.uniform(0.5, 4.0))
        start = rng.uniform(0.1, 0.9, 2)
        q = rng.normal(size=3)
        p, su, sv = surface.evaluate(*start, 1)
        d = p - point
        distance = np.linalg.norm(d)
        tangents = np.stack([su, sv])
        first = tangents @ tangents.T
        psi = tangents @ d
        b = {
            "unit": np.diag(1 / np.sqrt(np.diag(first))),
            "covariant": np.eye(2),
            "contravariant": np.linalg.inv(first),
        }
        limit = surface.evaluate(*best) - point
        rate = -GAIN * psi @ b[form] @ psi / distance - q @ (d / distance - limit / np.linalg.norm(limit))

        def excess(dt, surface=surface, start=start, point=point, q=q, best=best):
            control = Controller(surface, (0, 0, 0), form=form, gain=GAIN, feedforward=False, start=start)
            run = control.run(1, q_target=moving(point, q, dt), dt=dt)
            there = point + dt * q
            return run.distance, np.linalg.norm(surface.evaluate(*closest(surface, there, best)) - there)

        dt = 1e-4 / (1.0 + abs(rate))
        whole, half = excess(dt), excess(0.5 * dt)
        v = [(run[1] - e) - (run[0] - np.linalg.norm(limit)) for run, e in (whole, half)]
        # Richardson's difference: rounding 1e-15 / dt, and the third derivative times dt^2.
        assert abs((4 * v[1] - v[0]) / dt - rate) < 1e-6 * (1.0 + abs(rate))


def test_feedforward_is_the_rate_of_the_closest_point():
    rng = np.random.default_rng(2)
    for _ in range(10):
        surface = random_paraboloid(rng)
        best = rng.uniform(0.2, 0.8, 2)
        point = above(surface, *best, rng.uniform(0.5, 4.0))
        q = rng.normal(size=3)
        dt = 1e-3
        ends = [closest(surface, point + s * dt * q, best) for s in (-1.0, 1.0)]
        # A gain that does nothing.
        control = Controller(surface, (0, 0, 0), gain=1e-12, start=best)
        moved = control.run(1, q_target=moving(point, q, dt), dt=dt).parameters[-1] - best
        # Differences of a path bent by its curvature: dt^2.
        np.testing.assert_allclose(moved / dt, (ends[1] - ends[0]) / (2 * dt), atol=1e-6)


def test_feedforward_of_two_patches():
    rng = np.random.default_rng(3)
    for _ in range(10):
        f, g = random_paraboloid(rng), random_paraboloid(rng)
        q_f = np.r_[rng.normal(size=3), random_quaternion(rng)]
        x = rng.uniform(0.3, 0.7, 4)
        q_g = placed(Face(f), x[:2], q_f, Face(g), x[2:], rng.uniform(0.5, 4.0), rng.uniform(0.0, 6.3))
        dt = 1e-4
        rates = rng.normal(size=(2, 7))
        moved, solved = [], []
        for s in (-dt, dt):
            there = q_f + s * rates[0], q_g + s * rates[1]
            solved.append(extremal_pair(f, there[0], g, there[1], x).parameters)
            run = Controller(f, g, gain=1e-12, start=x).run(1, np.stack([q_f, there[0]]), np.stack([q_g, there[1]]), dt)
            moved.append(run.parameters[-1])
        # Both central: dt^2 times third derivatives of rates up to ten.
        np.testing.assert_allclose((moved[1] - moved[0]) / (2 * dt), (solved[1] - solved[0]) / (2 * dt), atol=1e-5)


@pytest.mark.parametrize("form", FORMS)
def test_gain_limit_is_where_steps_stop_settling(form):
    rng = np.random.default_rng(4)
    for _ in range(5):
        surface = random_paraboloid(rng)
        best = rng.uniform(0.3, 0.7, 2)
        point = above(surface, *best, rng.uniform(0.5, 4.0))
        limit = gain_limit(surface, best, point, 1e-2, form)
        off = best + 1e-6 * rng.normal(size=2)
        below, beyond = (
            Controller(surface, point, form=form, gain=c * limit, start=off, tolerance=1e-15).run(1500, dt=1e-2).error
            for c in (0.97, 1.03)
        )
        assert below[-1] < 1e-2 * below[0] and beyond[1400:].max() > 1e2 * beyond[0]


def test_gain_limit_bounds_the_default_gain():
    rng = np.random.default_rng(5)
    for form in FORMS:
        for _ in range(10):
            surface = random_paraboloid(rng)
            start = rng.uniform(0.1, 0.9, 2)
            point = above(surface, *rng.uniform(0.3, 0.7, 2), 2.0)
            run = Controller(surface, point, form=form, start=start).run(1, dt=0.3)
            # Half of the limit, exactly, while nothing is held.
            assert abs(run.gain[0] / gain_limit(surface, start, point, 0.3, form) - 0.5) < 1e-9


def test_gain_bounds_outrun_the_worst_motion():
    rng = np.random.default_rng(6)
    for _ in range(20):
        surface = random_paraboloid(rng)
        best = rng.uniform(0.2, 0.8, 2)
        height = rng.uniform(0.5, 4.0)
        point = above(surface, *best, height)
        start = rng.uniform(0.1, 0.9, 2)
        speed = rng.uniform(0.1, 3.0)
        bounds = gain_bounds(surface, start, point, best, speed)
        p, su, sv = surface.evaluate(*start, 1)
        d = p - point
        n = d / np.linalg.norm(d)
        limit = (surface.evaluate(*best) - point) / height
        worst = speed * np.linalg.norm(n - limit)
        tangents = np.stack([su, sv])
        first = tangents @ tangents.T
        psi = tangents @ d
        supply = psi @ np.linalg.solve(first, psi) / np.linalg.norm(d)
        # What theorem 1 says, at the bound and, for there it is sharp where both eigenvalues are alike, not far below.
        assert bounds.interior * supply >= worst * (1 - 1e-12)
        assert bounds.interior * supply <= worst * np.linalg.cond(first) * (1 + 1e-12)
        for k, bound in enumerate((bounds.along_u, bounds.along_v)):
            assert abs(bound * psi[k] ** 2 / first[k, k] / np.linalg.norm(d) - worst) < 1e-9 * worst


def test_gain_bounds_grow_towards_the_closest_point():
    # Paper 000 says they do not: numerator O(e), denominator O(e^2).
    surface = table_one()
    best = np.array([0.45, 0.5])
    point = above(surface, *best, 1.0)
    bounds = [gain_bounds(surface, best + e, point, best, 1.0).interior for e in (1e-2, 1e-3, 1e-4, 1e-5)]
    ratios = np.array(bounds[1:]) / bounds[:-1]
    assert np.all((ratios > 8.0) & (ratios < 12.0))


@pytest.mark.parametrize("form", FORMS)
def test_exponential_rate(form):
    # V falls as exp(-c t) while nothing is held, but for the error of Euler's method, of the order of c dt.
    surface = table_one()
    best = np.array([0.4, 0.55])
    point = above(surface, *best, 1.5)
    assert np.abs(closest(surface, point, best) - best).max() < 1e-9
    rate, dt = 2.0, 1e-4
    control = Controller(surface, point, form=form, rate=rate, nearest=1.5, start=(0.55, 0.4))
    run = control.run(10_000, dt=dt)
    assert not run.mode.any()
    over = run.distance - 1.5
    times = dt * np.arange(over.size)
    seen = over > 1e-3 * over[0]
    np.testing.assert_allclose(over[seen], over[0] * np.exp(-rate * times[seen]), rtol=5e-3)
    # Bounded input: the gain settles instead of growing with 1 / |psi|.
    assert run.gain[seen].max() < 3.0 * run.gain[0] and run.status is ControlStatus.ON_ITS_WAY


def test_turning_the_bodies_together_changes_nothing():
    rng = np.random.default_rng(8)
    f, g = random_paraboloid(rng), random_paraboloid(rng)
    q_g = np.array([0.5, 1.0, 20.0, 0.0, 1.0, 0.1, 0.0])
    here = Controller(f, g).run(50, HOME, q_g)
    e = random_quaternion(rng)
    w, x = e[0] / np.linalg.norm(e), e[1:] / np.linalg.norm(e)
    a, b = q_g[3], q_g[4:]
    turned = q_g[:3] + 2 * np.cross(x, np.cross(x, q_g[:3]) + w * q_g[:3])
    there = Controller(f, g).run(
        50, np.r_[1.0, 2.0, 3.0, e], np.r_[turned + [1.0, 2.0, 3.0], w * a - x @ b, w * b + a * x + np.cross(x, b)]
    )
    # Roundings of lengths of 20.
    np.testing.assert_allclose(there.parameters, here.parameters, atol=1e-12)
    np.testing.assert_allclose(there.distance, here.distance, atol=1e-12)


def test_a_surface_that_moves_is_a_point_that_moves_the_other_way():
    rng = np.random.default_rng(9)
    surface = random_paraboloid(rng)
    t = np.linspace(0.0, 1.0, 201)
    q = np.stack([np.sin(t), t, 0 * t, 1 + 0 * t, 0.3 * t, 0.2 * np.sin(t), 0.1 * t], axis=1)
    point = np.array([1.0, -2.0, 12.0])
    turn = Rotation.from_quat(q[:, 3:], scalar_first=True)
    seen = np.pad(turn.inv().apply(point - q[:, :3]), ((0, 0), (0, 4)))
    seen[:, 3] = 1.0
    for feedforward in (False, True):
        one, other = (Controller(surface, place, gain=5.0, feedforward=feedforward) for place in (point, (0, 0, 0)))
        a, b = one.run(200, q=q, dt=5e-3), other.run(200, q_target=seen, dt=5e-3)
        # Roundings of lengths of ten.
        np.testing.assert_allclose(a.parameters, b.parameters, atol=1e-12)
        np.testing.assert_allclose(a.error, b.error, atol=1e-11)
