"""Where the controllers converge: convex patches, that of paper 000, the two counterexamples; figures of section IV.

The expected counts and modes are those found for these very points (paper 000 does not give its own).
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.proximity import (
    Controller,
    ControlStatus,
    convergence_hypotheses,
    extremal_pair,
    gain_limit,
    is_globally_convergent,
)
from assembly.proximity.controllers.bounds import final_parameters
from benchmarks.controllers import paraboloid, table_one
from tests.laws.control_scenes import (
    above,
    annular_sector,
    grid,
    random_paraboloid,
    thin_ellipsoid,
)
from tests.laws.scenes import dome, placed, random_quaternion

FORMS = ("unit", "covariant", "contravariant")
# Section IV-B, with our point: its closest point is at (0.12, 0.2).
Q = np.array([0.630, 1.267, 6.008])


def slopes(surface, x, point):
    """The distance's slopes along unit tangents, those that point out at an end of the domain left out."""
    p, su, sv = surface.evaluate(*x, 1)
    d = p - point
    result = [d @ t / np.linalg.norm(t) for t in (su, sv)]
    for k, (low, high) in enumerate(surface.domain):
        if (x[k] <= low and result[k] > 0.0) or (x[k] >= high and result[k] < 0.0):
            result[k] = 0.0
    return np.abs(result).max()


@pytest.mark.parametrize("form", FORMS)
def test_every_run_falls_stays_inside_and_ends_at_rest(form, cases):
    rng = np.random.default_rng(1)
    held, count = 0, cases(20, 60)
    for _ in range(count):
        surface = dome(rng)
        point = above(surface, *(rng.uniform(a, b) for a, b in surface.domain), 1.0) + rng.normal(size=3)
        start = [rng.uniform(a, b) for a, b in surface.domain]
        run = Controller(surface, point, form=form, start=start).run(100_000)
        assert run.status is ControlStatus.CLOSEST
        # The default gain is half of the largest: the second-order term never outweighs the first by much.
        assert np.diff(run.distance).max(initial=0.0) < 1e-12
        low, high = np.array(surface.domain).T
        assert np.all((run.parameters >= low) & (run.parameters <= high))
        assert slopes(surface, run.parameters[-1], point) < 1e-8
        held += bool(run.mode[-1])
    assert count / 12 < held < count / 12 * 11  # both kinds of ends are met


@pytest.mark.parametrize("form", FORMS)
def test_two_patches_fall_together(form, cases):
    rng = np.random.default_rng(2)
    for _ in range(cases(13, 40)):
        f, g = random_paraboloid(rng), random_paraboloid(rng)
        q_f = np.r_[rng.normal(size=3), random_quaternion(rng)]
        x, gap = rng.uniform(0.35, 0.65, 4), rng.uniform(1.0, 4.0)
        q_g = placed(Face(f), x[:2], q_f, Face(g), x[2:], gap, rng.uniform(0.0, 6.3))
        run = Controller(f, g, form=form, start=rng.uniform(0.0, 1.0, 4)).run(400_000, q_f, q_g)
        assert run.status is ControlStatus.CLOSEST and run.modes == ("interior", "interior")
        assert np.diff(run.distance).max() < 1e-12
        # Slopes of 1e-10 of the size over second derivatives that may be a thousandth.
        np.testing.assert_allclose(run.parameters[-1], x, atol=1e-5)
        assert abs(run.distance[-1] - gap) < 1e-9


@pytest.mark.parametrize("form", FORMS)
def test_two_patches_that_are_held_at_their_ends(form, cases):
    # What the printed law leaves: several parameters held at once, on both patches.
    rng = np.random.default_rng(9)
    several, count = 0, cases(13, 40)
    for _ in range(count):
        f, g = dome(rng), dome(rng)
        q = np.r_[rng.normal(size=3) + (0.0, 0.0, 3.0), random_quaternion(rng)]
        start = [rng.uniform(low, high) for side in (f, g) for low, high in side.domain]
        run = Controller(f, g, form=form, start=start).run(400_000, q_target=q)
        assert run.status in (ControlStatus.CLOSEST, ControlStatus.MEETING)
        assert np.diff(run.distance).max(initial=0.0) < 1e-12
        low, high = np.array([*f.domain, *g.domain]).T
        assert np.all((run.parameters >= low) & (run.parameters <= high))
        several += run.mode[-1].sum() > 1
        if run.status is ControlStatus.MEETING:
            continue
        x = run.parameters[-1]
        turn = Rotation.from_quat(q[3:], scalar_first=True)
        at_g = turn.apply(g.evaluate(*x[2:])) + q[:3]
        at_f = turn.inv().apply(f.evaluate(*x[:2]) - q[:3])
        assert max(slopes(f, x[:2], at_g), slopes(g, x[2:], at_f)) < 1e-8
    assert several > count / 4


@pytest.mark.parametrize("form", FORMS)
def test_patches_that_meet_the_hypotheses_attract_every_start(form):
    rng = np.random.default_rng(3)
    for surface in (paraboloid(0.06, 0.05, 0.3), *(random_paraboloid(rng) for _ in range(3))):
        assert is_globally_convergent(surface)
        for _ in range(6):
            best = rng.uniform(0.02, 0.98, 2)
            point = above(surface, *best, rng.uniform(0.1, 6.0))
            ends, rested = final_parameters(surface, point, grid(surface, 21), "controller", form)
            assert rested.all() and np.abs(ends - best).max() < 1e-6


def test_newton_does_not_on_the_same_patch():
    surface = paraboloid(0.06, 0.05, 0.3)
    rng = np.random.default_rng(4)
    shares = []
    for _ in range(10):
        best = rng.uniform(0.02, 0.98, 2)
        ends, rested = final_parameters(
            surface, above(surface, *best, rng.uniform(0.1, 6.0)), grid(surface, 21), "newton"
        )
        shares.append((rested & (np.abs(ends - best).max(axis=1) < 1e-6)).mean())
    assert min(shares) < 0.9 and np.mean(shares) < 0.99


@pytest.mark.parametrize(
    ("method", "form", "count"),
    [
        ("newton", "unit", 121),
        ("newton_saturated", "unit", 386),
        ("newton", "covariant", 124),
        ("newton_saturated", "covariant", 425),
        ("controller", "unit", 441),
        ("controller", "covariant", 441),
        ("controller", "contravariant", 441),
    ],
)
def test_region_of_attraction_on_table_one(method, form, count):
    surface = table_one()
    ends, rested = final_parameters(surface, Q, grid(surface, 21), method, form)
    right = rested & (np.abs(ends - [0.12, 0.2]).max(axis=1) < 1e-3)
    # A start on the border of a region may fall on either side by a rounding.
    assert abs(int(right.sum()) - count) <= (0 if method == "controller" else 3)


def test_table_one_is_not_convex():
    found = convergence_hypotheses(table_one())
    assert not found.hold
    assert abs(np.degrees(found.span) - 141.0) < 1.0
    # Tangent planes cut it by up to 1.95.
    assert abs(found.excess * table_one().size - 1.95) < 0.01


def test_hypotheses_of_simple_patches():
    flat = convergence_hypotheses(shapes.plane(2.0, 3.0))
    assert flat.hold and flat.half_angle == 0.0 and flat.excess < 1e-15
    whole = convergence_hypotheses(shapes.sphere(1.0))
    assert not whole.hold and whole.half_angle == np.pi
    assert not is_globally_convergent(shapes.cylinder(1.0, 2.0))
    bowl = paraboloid(-0.06, -0.05, 0.3)
    assert is_globally_convergent(bowl)  # convex from below
    saddle = convergence_hypotheses(paraboloid(0.03, -0.03, 0.0))
    assert not saddle.hold and saddle.excess > 0.01 and saddle.reentrance < 1e-9
    half = convergence_hypotheses(paraboloid(0.06, 0.05, 0.3))
    # The steepest normals are at corners: tan = 2 (a x, b y - 0.3 a x ...) there, 42 degrees.
    assert 0.7 < half.half_angle < 0.25 * np.pi and abs(half.span - 2.0 * half.half_angle) < 1e-6


def test_counterexample_of_a_reentrant_boundary():
    # Flat, so convex, normals span nothing; but a witness point is caught at a corner of the inner arc.
    surface = annular_sector()
    found = convergence_hypotheses(surface)
    assert found.excess < 1e-15 and found.half_angle < 1e-6 and found.reentrance > 0.01 and not found.hold
    best = (0.5, 0.05)
    point = above(surface, *best, 0.5)
    starts = grid(surface, 21)
    ends, rested = final_parameters(surface, point, starts)
    assert rested.all()
    wrong = np.abs(ends - best).max(axis=1) > 1e-6
    assert 0.3 < wrong.mean() < 0.45
    np.testing.assert_allclose(ends[wrong], np.tile([0.0, 1.0], (wrong.sum(), 1)), atol=1e-12)
    # There both components lead out of the patch.
    run = Controller(surface, point, start=starts[wrong][0]).run(10_000)
    assert run.modes == ("corner",) and run.distance[-1] > 2.0 * 0.5


def test_counterexample_of_normals_that_span_too_much():
    # Convex, a convex shadow from in front, normals within 173 degrees, less than the 180 of paper 000.
    surface = thin_ellipsoid()
    found = convergence_hypotheses(surface)
    assert found.excess < 1e-12 and np.pi / 2 < found.span < np.pi and not found.hold
    best = (0.1, 0.5)
    point = above(surface, *best, 0.3)
    ends, rested = final_parameters(surface, point, grid(surface, 21))
    distance = np.linalg.norm(surface.evaluate(ends[:, 0], ends[:, 1]) - point, axis=1)
    assert rested.all() and 0.3 < (distance > 0.4).mean() < 0.5 and abs(distance.min() - 0.3) < 1e-12


def test_invariance_through_mode_changes():
    # Section IV-A: interior, the edge u = 0, interior.
    run = Controller(table_one(), (0.175, 8.011, 4.576), gain=2.0, start=(0.383, 0.328), feedforward=False).run(
        5_000, dt=1e-3
    )
    changes = run.mode[np.r_[True, np.diff(run.mode[:, 0]) != 0], 0]
    assert changes.tolist() == [0, 1, 0]
    assert np.all(run.parameters[run.mode[:, 0] == 1, 0] == 0.0)
    assert np.diff(run.distance).max() < 1e-13
    np.testing.assert_allclose(run.parameters[-1], [0.017, 0.760], atol=5e-4)


def test_the_distance_falls_where_the_projections_grow():
    surface = table_one()
    runs = [Controller(surface, Q, gain=1.0, start=x).run(20_000, dt=1e-3) for x in grid(surface, 5)]
    assert max(np.diff(run.distance).max(initial=0.0) for run in runs) < 1e-12
    # On the way, not by rounding.
    assert max(np.diff(run.error).max(initial=0.0) for run in runs) > 1e-4


# Section IV-C: Q on a circle of radius 1.5 around (5, 5, 8.3), once a second, dt = 1e-4, unit projections.
TIMES = np.linspace(0.0, 1.0, 10_001)
PATH = np.pad(
    np.stack([5.0 + 1.5 * np.cos(2 * np.pi * TIMES), 5.0 + 1.5 * np.sin(2 * np.pi * TIMES), 8.3 + 0 * TIMES], 1),
    ((0, 0), (0, 4)),
)
PATH[:, 3] = 1.0


def follow(gain, feedforward=False, start=(0.1, 0.2)):
    control = Controller(table_one(), (0, 0, 0), gain=gain, feedforward=feedforward, start=start)
    return control.run(10_000, q_target=PATH, dt=1e-4)


def test_the_lag_is_one_over_the_gain():
    lag = {gain: follow(gain).error[5_000:].max() for gain in (25.0, 50.0, 100.0, 1000.0)}
    products = [gain * error for gain, error in lag.items()]
    assert 0.8 < min(products) and max(products) < 0.9
    assert abs(lag[50.0] - 1.782e-2) < 1e-4
    assert follow(0.02).error[-1] > 1.0  # slow


def test_feedforward_leaves_ten_thousandths_of_the_lag():
    assert follow(50.0, feedforward=True).error[5_000:].max() < 1e-6
    assert follow(1000.0, feedforward=True).error[5_000:].max() < 1e-7


def test_feedforward_along_an_edge():
    # Beside the patch: its closest points run along an end, held.
    surface = paraboloid(0.06, 0.05, 0.3)
    t = np.linspace(0.0, 1.0, 2_001)
    path = np.pad(np.stack([9.0 + np.sin(t), 3.0 * np.cos(2 * t), 6.0 + t], 1), ((0, 0), (0, 4)))
    path[:, 3] = 1.0
    errors = {}
    for feedforward in (False, True):
        control = Controller(surface, (0, 0, 0), gain=20.0, feedforward=feedforward)
        run = control.run(2_000, q_target=path, dt=5e-4)
        assert run.modes == ("edge",)
        errors[feedforward] = run.error[1_000:].max()
    assert errors[True] < 1e-3 * errors[False]


def test_the_largest_gain_is_that_of_the_eigenvalues():
    surface = table_one()
    on = Controller(surface, PATH[0, :3])
    on.run(100_000)
    tracked = follow(1000.0, feedforward=True, start=on.parameters).parameters[::100]
    limits = [gain_limit(surface, x, q[:3], 1e-4) for x, q in zip(tracked, PATH[::100], strict=True)]
    assert abs(min(limits) - 1358.0) < 5.0
    # From there it holds up to the limit; from afar the projections on the way are steeper.
    for gain, good in ((1300.0, True), (1340.0, True), (1400.0, False)):
        error = follow(gain, start=on.parameters).error[5_000:].max()
        assert (error < 1e-3) == good
    assert follow(1250.0).error[5_000:].max() < 1e-3
    assert follow(1300.0).error[5_000:].max() > 5.0


def test_a_patch_follows_a_patch_that_moves():
    f, g = paraboloid(0.06, 0.05, 0.3), paraboloid(0.03, 0.04, -0.2)
    t = np.linspace(0.0, 1.0, 2_001)[:, None]
    # Upside down above f, swinging and turning.
    q_g = np.hstack([2.0 * np.sin(3 * t), np.cos(2 * t), 18.0 + t, 0.1 * t, np.cos(t), np.sin(t), 0.1 * np.cos(t)])
    errors = {}
    for feedforward in (False, True):
        run = Controller(f, g, gain=20.0, feedforward=feedforward).run(2_000, q_target=q_g, dt=5e-4)
        errors[feedforward] = run.error[1_000:].max()
        if feedforward:
            pair = extremal_pair(f, (0, 0, 0, 1, 0, 0, 0), g, q_g[-1], run.parameters[-1])
            assert abs(abs(pair.gap) - run.distance[-1]) < 1e-6
    assert errors[True] < 1e-2 * errors[False]
