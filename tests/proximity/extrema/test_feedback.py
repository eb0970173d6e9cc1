"""The descent from any start, the controller as an object, and what both say to bad input."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from assembly.errors import InputError
from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.surface import NurbsSurface
from assembly.kinematics.body import Body
from assembly.proximity import (
    Controller,
    ControlStatus,
    PairStatus,
    closest_features,
    convergence_hypotheses,
    descend,
    extremal_pair,
    gain_bounds,
    gain_limit,
)
from assembly.proximity.controllers.bounds import final_parameters
from tests.laws.scenes import dome, inside, placed, quadratic, random_quaternion

HOME = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


def at(x, y, z, e=(1.0, 0.0, 0.0, 0.0)):
    return np.array([x, y, z, *e], dtype=float)


def anywhere(rng, *surfaces):
    """Parameters all over the domains."""
    return [rng.uniform(low, high) for surface in surfaces for low, high in surface.domain]


def world(surface, q, u, v):
    turn = Rotation.from_quat(q[3:], scalar_first=True)
    return turn.apply(surface.evaluate(u, v)) + q[:3]


def distance(f, q_f, g, q_g, x):
    return np.linalg.norm(world(f, q_f, *x[:2]) - world(g, q_g, *x[2:]))


def apart(pair):
    return np.linalg.norm(pair.points[1] - pair.points[0])


def random_poses(rng, reach):
    q_f, q_g = (np.r_[rng.normal(size=3), random_quaternion(rng)] for _ in range(2))
    away = rng.normal(size=3)
    q_g[:3] = q_f[:3] + reach * away / np.linalg.norm(away)
    return q_f, q_g


# ---- the descent ---------------------------------------------------------------------------------------------------


def test_spheres_from_every_side(cases):
    rng = np.random.default_rng(1)
    f, g = shapes.sphere(1.0), shapes.sphere(0.7)
    lost, count = 0, cases(70, 200)
    for _ in range(count):
        gap = 10.0 ** rng.uniform(-3.0, 1.0)
        q_f, q_g = random_poses(rng, 1.7 + gap)
        start = anywhere(rng, f, g)
        pair = descend(f, q_f, g, q_g, start)
        assert pair.status is PairStatus.CONVERGED
        assert abs(pair.gap - gap) < 1e-13 * (1.0 + gap)
        newton = extremal_pair(f, q_f, g, q_g, start)
        lost += newton.status is not PairStatus.CONVERGED or abs(newton.gap - gap) > 1e-9
    # What this is for: Newton's method goes to the far sides, or nowhere.
    assert lost > 0.5 * count


def test_never_apart_and_never_another_root(cases):
    rng = np.random.default_rng(2)
    seen = set()
    for k in range(cases(50, 150)):
        f, g = ((quadratic, quadratic), (dome, quadratic), (dome, dome))[k % 3]
        f, g = f(rng), g(rng)
        q_f, q_g = random_poses(rng, rng.uniform(1.0, 8.0))
        start = anywhere(rng, f, g)
        pair = descend(f, q_f, g, q_g, start)
        seen.add(pair.status)
        found = apart(pair)
        # A shallow penetration that was found has its points apart again.
        if pair.status is not PairStatus.CONVERGED or pair.gap > 0.0:
            assert found <= distance(f, q_f, g, q_g, start) + 1e-12
        if pair.status is PairStatus.CONVERGED:
            again = extremal_pair(f, q_f, g, q_g, pair.parameters)
            assert np.abs(again.parameters - pair.parameters).max() < 1e-9
        nearest = closest_features(f, g, q_f, q_g)
        if pair.status is PairStatus.NOT_CONVERGED:
            # The surfaces cross, and the points met.
            assert found < 1e-4 and nearest.lower < 1e-9
        else:
            assert pair.gap < 0.0 or found > nearest.lower - 1e-12
    assert seen == {PairStatus.CONVERGED, PairStatus.LEFT_PATCH, PairStatus.NOT_CONVERGED}


def test_ends_of_patches_are_minima_there():
    rng = np.random.default_rng(3)
    ends = 0
    for _ in range(40):
        f, g = dome(rng), dome(rng)
        q_f, q_g = random_poses(rng, rng.uniform(3.0, 8.0))
        pair = descend(f, q_f, g, q_g, anywhere(rng, f, g))
        ends += pair.status is PairStatus.LEFT_PATCH
        if pair.status is not PairStatus.LEFT_PATCH:
            continue
        # A local search with bounds finds nothing lower beside it; its differences are good to some 1e-8.
        local = minimize(
            lambda x, f=f, g=g, q_f=q_f, q_g=q_g: distance(f, q_f, g, q_g, x),
            pair.parameters,
            bounds=[*f.domain, *g.domain],
            method="L-BFGS-B",
        )
        assert apart(pair) <= local.fun + 1e-9
    assert ends > 30


@pytest.mark.parametrize("gap", [1e-2, 1e-6, 0.0, -1e-6, -1e-3, -2e-2])
def test_touching_and_shallow_penetration(gap):
    rng = np.random.default_rng(4)
    f, g = Face(shapes.ellipsoid(1.0, 1.3, 0.8)), Face(shapes.torus(2.0, 0.6))
    for _ in range(30):
        q_f = np.r_[rng.normal(size=3), random_quaternion(rng)]
        # On the outer half of the tube both are convex: the pair is a minimum, or the deepest one.
        x = np.r_[inside(rng, f.surface), inside(rng, g.surface)]
        if np.hypot(*g.surface.evaluate(*x[2:])[:2]) < 2.1:
            continue
        q_g = placed(f, x[:2], q_f, g, x[2:], gap, rng.uniform(0.0, 6.3))
        for spread in (0.01, 0.2):
            speeds = [
                np.linalg.norm(s, axis=-1)
                for k, side in ((0, f), (2, g))
                for s in side.surface.evaluate(*x[k : k + 2], 1)[1:]
            ]
            pair = descend(f, q_f, g, q_g, np.clip(x + spread * rng.normal(size=4) / speeds, 0.0, None))
            assert pair.status is PairStatus.CONVERGED
            assert abs(pair.gap - gap) < 1e-12


def test_poles_and_seams():
    ball = shapes.sphere(1.0)
    (_, _), (south, north) = ball.domain
    for start in ((0.2, north, 0.5, south), (0.2, 1.0, 0.5, 2.0), (3.0, north, 6.0, 1.0), (0.01, 0.3, 6.27, 3.0)):
        for away in ((3.0, 0.0, 0.0), (0.0, 0.0, 3.0), (-2.0, 0.1, -2.0), (0.0, -3.0, 1e-9)):
            pair = descend(ball, HOME, ball, at(*away), start)
            assert pair.status is PairStatus.CONVERGED
            assert abs(pair.gap - (np.linalg.norm(away) - 2.0)) < 1e-12


def test_one_of_a_continuum():
    side = at(0.0, 0.0, 1.5, (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0))
    pair = descend(shapes.plane(8.0, 8.0), HOME, shapes.cylinder(1.0, 3.0), side, (2.0, 2.0, 0.5, 1.5))
    assert pair.status is PairStatus.SINGULAR and abs(pair.gap - 0.5) < 1e-12


def test_maxima_and_spent_steps_are_said():
    ball = shapes.sphere(1.0)
    (_, _), (south, north) = ball.domain
    worst = descend(ball, HOME, ball, at(0.0, 0.0, 3.0), (0.2, south, 0.5, north))
    assert worst.status is PairStatus.NOT_CONVERGED and abs(apart(worst) - 5.0) < 1e-12
    few = descend(ball, HOME, ball, at(0.0, 0.0, 3.0), (0.2, south + 0.1, 0.5, north - 0.1), steps=2)
    assert few.status is PairStatus.NOT_CONVERGED and 3.0 < apart(few) < 5.0


@pytest.mark.parametrize("unit", [1e-6, 1e-3, 1e3])
def test_units_change_nothing(unit):
    rng = np.random.default_rng(5)
    for _ in range(10):
        surfaces = dome(rng), quadratic(rng)
        scaled = [NurbsSurface(unit * s.control_points, s.knots, s.degree, s.weights) for s in surfaces]
        q_f, q_g = random_poses(rng, 8.0)
        start = anywhere(rng, *surfaces)
        pair = descend(surfaces[0], q_f, surfaces[1], q_g, start)
        there = [np.r_[unit * q[:3], q[3:]] for q in (q_f, q_g)]
        other = descend(scaled[0], there[0], scaled[1], there[1], start)
        assert other.status is pair.status
        assert abs(apart(other) / unit - apart(pair)) < 1e-9


# ---- the controller as an object ------------------------------------------------------------------------------------


def test_steps_are_a_run():
    rng = np.random.default_rng(6)
    surface = dome(rng)
    t = np.linspace(0.0, 1.0, 51)
    path = np.stack([np.sin(t), np.cos(t), 2.0 + t, 1 + 0 * t, 0.2 * t, 0 * t, 0 * t], axis=1)
    one, many = (Controller(surface, (0.1, 0.0, 0.0), gain=3.0) for _ in range(2))
    run = many.run(50, q_target=path, dt=0.02)
    one.step(q_target=path[0], dt=1e-300)  # where the motion begins
    rows = [one.step(q_target=q, dt=0.02) for q in path[1:]]
    np.testing.assert_allclose([r.distance[0] for r in rows], run.distance[1:], atol=1e-13)
    np.testing.assert_allclose([r.parameters[0] for r in rows], run.parameters[1:], atol=1e-13)
    np.testing.assert_array_equal(many.parameters, run.parameters[-1])


def test_bodies_and_their_poses():
    turn = (0.9, 0.1, -0.3, 0.2)
    ball = Body("ball", shapes.sphere(1.0), position=(1.0, 2.0, 3.0), quaternion=np.array(turn) / np.linalg.norm(turn))
    tool = Body("tool", position=(4.0, 2.0, 3.0))
    run = Controller(ball.face(), tool.point(0.5, 0.0, 0.0), start=(1.0, 1.0)).run(2_000)
    assert run.status is ControlStatus.CLOSEST and run.modes == ("interior",)
    assert abs(run.distance[-1] - 2.5) < 1e-12


def test_points_that_meet():
    flat = shapes.plane(2.0, 2.0)
    run = Controller(flat, (0.3, 0.2, 0.0)).run(200)
    assert run.status is ControlStatus.MEETING and run.distance[-1] < 1e-11
    # Two patches that cross: nothing but the crossing is found, and that is said.
    crossing = Controller(flat, flat, start=(0.5, 0.4, 0.1, 0.6)).run(
        20_000, q_target=at(0.0, 0.0, 0.0, (0.8, 0.6, 0.0, 0.0))
    )
    assert crossing.status is ControlStatus.MEETING


def test_modes_and_errors():
    flat = shapes.plane(2.0, 2.0)
    for point, modes in (((0.3, 0.2, 1.0), "interior"), ((3.0, 0.2, 1.0), "edge"), ((3.0, -2.0, 1.0), "corner")):
        run = Controller(flat, point).run(1_000)
        assert run.status is ControlStatus.CLOSEST and run.modes == (modes,)
        foot = np.clip(point[:2], -1.0, 1.0)
        assert abs(run.distance[-1] - np.linalg.norm(np.r_[foot, 0.0] - point)) < 1e-12
        assert run.error[-1] <= 1e-10 * flat.size


def test_too_large_a_gain_is_said():
    assert Controller(shapes.plane(2.0, 2.0), (0.3, 0.2, 1.0), gain=5.0).run(100).status is ControlStatus.ON_ITS_WAY


def test_no_gain_makes_numbers_that_are_none():
    for surface in (shapes.sphere(1.0), shapes.plane(2.0, 2.0)):
        for form in ("unit", "covariant", "contravariant"):
            control = Controller(surface, (3.0, 0.5, 1.0), form=form, gain=1e308, start=[0.6, 0.7])
            run = control.run(20, dt=1e5)
            assert run.status in (ControlStatus.IRREGULAR, ControlStatus.ON_ITS_WAY, ControlStatus.CLOSEST)
            assert np.isfinite(run.parameters).all() and np.isfinite(run.distance).all()
            assert np.isfinite(control.parameters).all()
    # Newton's method where its matrix is singular, and far from everything.
    ends, _rested = final_parameters(shapes.plane(2.0, 2.0), (1e200, 0.0, 0.0), [[0.1, 0.2]], "newton")
    assert np.isfinite(ends).all()


def test_bad_input():
    flat = shapes.plane(2.0, 2.0)
    cases = [
        (TypeError, "surface is 3", lambda: Controller(3, (0, 0, 1))),
        (InputError, "target has shape", lambda: Controller(flat, (0, 0))),
        (InputError, "form is 'best'", lambda: Controller(flat, (0, 0, 1), form="best")),
        (InputError, "gain is -1", lambda: Controller(flat, (0, 0, 1), gain=-1)),
        (InputError, "gain is 1 and rate is 2", lambda: Controller(flat, (0, 0, 1), gain=1, rate=2)),
        (InputError, r"start\[1\] is 9", lambda: Controller(flat, (0, 0, 1), start=(0, 9))),
        (InputError, "start has shape", lambda: Controller(flat, flat, start=(0, 0))),
        (InputError, "nearest is nan", lambda: Controller(flat, (0, 0, 1), nearest=np.nan)),
        (InputError, "dt is 0", lambda: Controller(flat, (0, 0, 1)).step(dt=0.0)),
        (InputError, "steps is 0", lambda: Controller(flat, (0, 0, 1)).run(0)),
        (InputError, "q_target has 3 rows|q has 2 rows", lambda: Controller(flat, flat).run(3, [HOME] * 2, [HOME] * 3)),
        (InputError, "expected one pose", lambda: Controller(flat, flat).step([HOME] * 2)),
        (InputError, r"q_target\[0, 3:\]", lambda: Controller(flat, flat).step(q_target=np.zeros(7))),
        (InputError, "steps is 0", lambda: descend(flat, HOME, flat, HOME, (0, 0, 0, 0), steps=0)),
        (InputError, r"start\[2\] is 7", lambda: descend(flat, HOME, flat, HOME, (0, 0, 7, 0))),
        (TypeError, "surface_g is None", lambda: descend(flat, HOME, None, HOME, (0, 0, 0, 0))),
        (InputError, "samples is 2", lambda: convergence_hypotheses(flat, 2)),
        (InputError, "speed is 0", lambda: gain_bounds(flat, (0, 0), (0, 0, 1), (0, 0), 0.0)),
        (InputError, "closest is", lambda: gain_bounds(flat, (0.5, 0), (0, 0, 0), (0, 0), 1.0)),
        (InputError, "form is", lambda: gain_limit(flat, (0, 0), (0, 0, 1), 1.0, "none")),
        (InputError, "method is 'luck'", lambda: final_parameters(flat, (0, 0, 1), [[0, 0]], "luck")),
        (InputError, "starts", lambda: final_parameters(flat, (0, 0, 1), [0, 0])),
    ]
    for kind, text, call in cases:
        with pytest.raises(kind, match=text):
            call()


def pairs_and_runs():
    home = [0, 0, 0, 1, 0, 0, 0]
    torus, egg = shapes.torus(3.0, 1.0), shapes.ellipsoid(1.0, 2.0, 1.5)
    flat = shapes.plane(2.0, 2.0)
    out = []
    for f, g, q, x in (
        (torus, egg, [6.5, 1, 2, 1, 0.2, 0.1, 0.4], (0.5, 0.5, 1.0, 3.0)),
        (flat, egg, [4.0, 0.2, 2.5, 0.5, 0.0, 0.5, 0.0], (0.5, 0.3, 0.3, 2.0)),
        (egg, egg, [0.3, 0.2, 2.999, 1, 0, 0, 0], (0.5, 1.5, 4.0, 0.4)),
    ):
        pair = descend(f, home, g, q, x)
        out.append([pair.status.name, pair.parameters.tolist(), pair.points.tolist()])
        run = Controller(f, g, start=x, form="contravariant").run(20, q_target=q)
        out.append([run.status.name, run.parameters.tolist(), run.distance.tolist()])
    return out


def test_plain_python_gives_the_same(run_python):
    code = "import json; from tests.proximity.extrema.test_feedback import *; print(json.dumps(pairs_and_runs()))"
    compiled, plain = pairs_and_runs(), json.loads(run_python(code, NUMBA_DISABLE_JIT="1"))
    assert {row[0] for row in plain} >= {"CONVERGED", "LEFT_PATCH", "ON_ITS_WAY"}
    for a, b in zip(compiled, plain, strict=True):
        assert a[0] == b[0]
        for x, y in zip(a[1:], b[1:], strict=True):
            # Without fused multiply-add: other roundings, amplified over twenty steps that do not contract.
            np.testing.assert_allclose(y, x, rtol=0.0, atol=1e-7)
