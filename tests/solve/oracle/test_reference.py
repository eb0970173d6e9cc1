from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import assembly as asm
from assembly.geometry import shapes
from assembly.solve.oracle.reference import ReferenceSolver
from assembly.solve.oracle.surfaces import spline_function
from assembly.solve.result import Iteration
from assembly.solve.scene import Status
from tests.geometry.reference import knot_vector


def random_surface(seed, degree, kind):
    rng = np.random.default_rng([seed, *degree])
    counts = [p + 3 for p in degree]
    knots = [knot_vector(rng, p, n, kind) for p, n in zip(degree, counts, strict=True)]
    return asm.NurbsSurface(rng.normal(size=(*counts, 3)), knots, degree, rng.uniform(0.5, 2.0, counts))


SURFACES = {
    "plane": shapes.plane(2.0, 3.0),
    "sphere": shapes.sphere(0.5),
    "torus": shapes.torus(1.0, 0.2),
    "cone": shapes.cone(1.0, 0.4, 2.0),
    "biquadratic": random_surface(1, (2, 2), "clamped"),
    "kinked": random_surface(2, (1, 3), "multiple"),
    "unclamped": random_surface(3, (4, 2), "unclamped"),
    "high degree": random_surface(4, (5, 7), "clamped"),
}


def derivatives(surface):
    """(u, v) -> S, the six derivatives to order 2, and all of order 3, by CasADi."""
    x = ca.MX.sym("x", 2)
    point, su, sv = spline_function(surface)(x)
    second = [ca.jacobian(rate, x) for rate in (su, sv)]
    third = [ca.jacobian(column, x) for both in second for column in (both[:, 0], both[:, 1])]
    outputs = [point, su, sv, second[0][:, 0], second[0][:, 1], second[1][:, 1], *third]
    function = ca.Function("derivatives", [x], outputs)
    return lambda u, v: [np.array(value) for value in function([u, v])]


def random_parameters(surface, count, seed=0):
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(*domain, count) for domain in surface.domain])


@pytest.mark.parametrize("name", SURFACES)
def test_casadi_s_splines_are_the_surface(name):
    surface = SURFACES[name]
    function = derivatives(surface)
    for u, v in random_parameters(surface, 40):
        want = surface.evaluate(u, v, 2)
        for got, value in zip(function(u, v)[:6], want, strict=True):
            # Two exact formulas: some roundings of the largest control points, divided by short spans in derivatives.
            np.testing.assert_allclose(got.ravel(), value, rtol=0, atol=1e-12 * max(1.0, np.abs(want).max()))


@pytest.mark.parametrize("name", ["torus", "biquadratic", "cone"])
def test_third_derivatives_are_differences_of_the_second(name):
    # What an exact Hessian of the rows takes; CasADi's own quadratic splines end the process here.
    surface = SURFACES[name]
    function = derivatives(surface)
    h = 1e-5
    for u, v in random_parameters(surface, 10, 1):
        if min(np.abs(x - at).min() for x, at in zip((u, v), surface.breaks(), strict=True)) < 2 * h:
            continue
        suuu = function(u, v)[6][:, 0]
        difference = (surface.evaluate(u + h, v, 2)[3] - surface.evaluate(u - h, v, 2)[3]) / (2 * h)
        # Differences: h^2 of the fifth derivative, and rounding over h.
        np.testing.assert_allclose(suuu, difference, rtol=1e-5, atol=1e-5 * (1.0 + np.abs(suuu).max()))


@pytest.mark.parametrize("name", ["sphere", "torus", "cone"])
def test_closed_directions_run_on_over_the_seam(name):
    surface = SURFACES[name]
    assert any(surface.closed)
    function = derivatives(surface)
    periods = [
        high - low if closed else 0.0 for (low, high), closed in zip(surface.domain, surface.closed, strict=True)
    ]
    for u, v in random_parameters(surface, 20, 2):
        here = function(u, v)[:6]
        for turns in (-3, -1, 1, 7):
            there = function(u + turns * periods[0], v + turns * periods[1])[:6]
            for a, b in zip(here, there, strict=True):
                # u + k period is rounded, and derivatives carry that on.
                np.testing.assert_allclose(a, b, rtol=0, atol=1e-12 * max(1.0, np.abs(np.hstack(here)).max()))
    # On both sides of the seam, one point.
    u, v = (low for low, _ in surface.domain)
    step = 1e-9
    a, b = (
        function(u + sign * step * (periods[0] > 0), v + 0.3 + sign * step * (periods[1] > 0))[0] for sign in (-1, 1)
    )
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-8 * surface.size)


def unit(*e):
    return np.array(e) / np.linalg.norm(e)


def chain(*bodies, **options):
    """An assembly in which every body touches the one before."""
    scene = asm.Assembly(bodies)
    scene.constrain(*(asm.Contact(a, b, **options) for a, b in zip(bodies, bodies[1:], strict=False)))
    return scene


def ellipsoids(gap=2.5, size=1.0, offset=0.0, **options):
    shape = shapes.ellipsoid(1.0 * size, 0.7 * size, 0.5 * size)
    place = np.array([gap, 0.3, 0.2]) * size + offset
    first = asm.Body("first", shape, position=(offset,) * 3, fixed=True)
    return chain(first, asm.Body("second", shape, position=place, quaternion=unit(0.9, 0.1, 0.3, 0.2)), **options)


def wires():
    shape = shapes.torus(1.0, 0.12)
    scene = chain(
        asm.Body("a", shape, fixed=True),
        asm.Body("b", shape, position=(0.9, 0.0, 0.1), quaternion=unit(1.0, 1.0, 0.0, 0.0)),
        asm.Body("c", shape, position=(0.5, 0.8, 0.0), quaternion=unit(1.0, 0.0, 1.0, 0.0)),
    )
    scene.constrain(asm.Contact(scene.body("a"), scene.body("c")))
    return scene


def ball_on_plane(height, **options):
    # Turned, so that no pole of the ball comes to the plane.
    ball = asm.Body("ball", shapes.sphere(0.5), position=(0.1, 0.2, height), quaternion=unit(1.0, 1.0, 0.2, 0.0))
    return chain(asm.Body("plane", shapes.plane(4.0, 4.0), fixed=True), ball, **options)


def pulled():
    scene = ellipsoids()
    tip = scene.body("second").point(0.0, 0.0, 0.1)
    scene.minimize(asm.Posture(weight=3.0))
    scene.maximize(asm.PointDistance(tip, (3.0, 1.0, 2.0), weight=0.5))
    return scene


def held_to_a_reference():
    scene = wires()
    reference = scene.q.copy()
    reference[:, :3] += [0.05, -0.02, 0.03]
    scene.minimize(asm.Posture(reference, weight=2.0))
    return scene


def inside_a_shell():
    shell = asm.Face(shapes.ellipsoid(1.2, 1.0, 0.9), reversed=True)
    ball = asm.Body("ball", shapes.sphere(0.3), position=(0.7, 0.3, 0.2), quaternion=unit(1.0, 1.0, 0.2, 0.0))
    return chain(asm.Body("shell", shell, fixed=True), ball)


SCENES = {
    "inside a shell": inside_a_shell,
    "ellipsoids": ellipsoids,
    "micrometers, far away": lambda: ellipsoids(size=1e-3, offset=100.0),
    "a far origin": lambda: ellipsoids(offset=1e5),
    "kilometers": lambda: ellipsoids(size=1e3),
    "one-sided, active": lambda: ellipsoids(1.4, unilateral=True),
    "one-sided, inactive": lambda: ellipsoids(2.5, unilateral=True),
    "three wires": wires,
    "reference": held_to_a_reference,
    "maximized": pulled,
    "plane and ball": lambda: ball_on_plane(0.8),
    "plane and ball, pushed": lambda: ball_on_plane(0.3, unilateral=True),
    "ball in a ring": lambda: chain(
        asm.Body("ring", shapes.torus(1.0, 0.2), fixed=True),
        asm.Body("ball", shapes.sphere(0.3), position=(0.6, 0, 0.05)),
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_two_independent_solvers_agree(name):
    scene = SCENES[name]()
    scale = scene.packed().scale
    ours, theirs = scene.solve(), asm.reference.solve(scene)
    assert ours.success and theirs.success, (ours.message, theirs.message)
    # Both stop at residuals below 1e-10; positions far away are rounded to 1e-16 of their own size.
    far = 1e-15 * np.abs(theirs.q[:, :3]).max()
    np.testing.assert_allclose(theirs.q[:, :3], ours.q[:, :3], rtol=0, atol=1e-8 * scale + far)
    np.testing.assert_allclose(theirs.q[:, 3:], ours.q[:, 3:], rtol=0, atol=1e-8)
    assert theirs.feasibility <= 1e-9 * scale
    assert theirs.objective == pytest.approx(ours.objective, rel=1e-7, abs=1e-12 * scale**2)
    weight = max((term.weight for _, term in scene.objectives), default=1.0)
    for constraint, force in ours.multipliers.items():
        np.testing.assert_allclose(theirs.multipliers[constraint], force, rtol=1e-6, atol=1e-6 * scale * weight)
        pair = theirs.contacts[constraint]
        assert theirs.violations[constraint] <= 1e-9 * scale
        np.testing.assert_allclose(pair.points, ours.contacts[constraint].points, rtol=0, atol=1e-7 * scale + far)


def test_multiplier_of_a_ball_pushed_into_a_plane_is_known():
    # Least (z - 0.3)^2 with z >= 0.5: the force is -2 (0.5 - 0.3), not positive for a gap >= 0.
    solution = asm.reference.solve(ball_on_plane(0.3, unilateral=True))
    assert solution.success
    # The barrier leaves 1e-11 / force.
    assert solution.q[1, 2] == pytest.approx(0.5, abs=1e-9)
    assert solution.objective == pytest.approx(0.04, abs=1e-9)
    assert solution.multipliers["plane-ball"][0] == pytest.approx(-0.4, abs=1e-8)


def test_a_contact_crosses_the_seam():
    ring = asm.Body("ring", shapes.torus(1.0, 0.2), fixed=True)
    ball = asm.Body("ball", shapes.sphere(0.3), position=(0.5 * np.cos(0.2), 0.5 * np.sin(0.2), 0.0))
    scene = chain(ring, ball)
    target = 0.5 * np.cos(0.6), -0.5 * np.sin(0.6), 0.0
    scene.minimize(asm.PointDistance(ball.point(0, 0, 0), target, weight=20.0), asm.Posture())
    first = asm.proximity.extremal_pair(ring.faces[0], ring.q, ball.faces[0], ball.q).parameters[0]
    solution = asm.reference.solve(scene)
    last = solution.contacts["ring-ball"].parameters[0]
    (low, high), _ = ring.faces[0].face.surface.domain
    assert low < first < low + 0.1 * (high - low) and high - 0.15 * (high - low) < last < high
    assert solution.success
    np.testing.assert_allclose(solution.q, scene.solve().q, rtol=0, atol=1e-8)  # as above


def test_what_cannot_hold_is_infeasible_and_named():
    shape = shapes.sphere(0.5)
    left, right = (asm.Body(name, shape, position=(x, 0, 0), fixed=True) for name, x in (("left", -2), ("right", 2)))
    ball = asm.Body("ball", shape, position=(0.2, 0.1, 0.3))
    scene = asm.Assembly([left, right, ball])
    scene.constrain(asm.Contact(left, ball), asm.Contact(ball, right))
    solution = asm.reference.solve(scene)
    assert solution.status is Status.INFEASIBLE and not solution.success
    assert "'left-ball'" in solution.message and "'ball-right'" in solution.message
    # Centers are 4 apart and radii sum up to 2: no pose violates by less than 2 in all.
    assert sum(solution.violations.values()) == pytest.approx(2.0, abs=1e-6)
    assert solution.feasibility == max(solution.violations.values())


def test_a_pair_that_is_not_there_is_lost_by_name():
    ball = asm.Body("ball", shapes.sphere(0.5), position=(3.0, 0.0, 1.0))
    scene = chain(asm.Body("plane", shapes.plane(1.0, 1.0), fixed=True), ball)
    solution = asm.reference.solve(scene)
    assert solution.status is Status.CONTACT_LOST
    assert "'plane-ball'" in solution.message
    np.testing.assert_array_equal(solution.q, scene.q)
    assert solution.feasibility > 0.0 and solution.iterations == 0


def test_a_row_said_twice_still_solves():
    scene = ellipsoids()
    scene.constrain(asm.Contact(*scene.bodies, name="again"))
    solution = asm.reference.solve(scene)
    assert solution.success
    np.testing.assert_allclose(solution.q, asm.reference.solve(ellipsoids()).q, rtol=0, atol=1e-8)


def test_without_contacts_the_target_is_reached():
    body = asm.Body("body", position=(1.0, 2.0, 3.0))
    scene = asm.Assembly([body])
    scene.minimize(asm.PointDistance(body.point(0.5, 0.0, 0.0), (0.0, 0.0, 1.0)))
    solution = asm.reference.solve(scene)
    assert solution.success
    # IPOPT stops at 1e-11 of the scene's size.
    np.testing.assert_allclose(solution.pose("body").apply([0.5, 0.0, 0.0]), [0.0, 0.0, 1.0], rtol=0, atol=1e-9)


def test_stopping_early_is_said():
    solution = asm.reference.solve(wires(), ipopt={"max_iter": 1})
    assert solution.status is Status.ITERATION_LIMIT and not solution.success
    assert solution.iterations == 1


def test_solutions_are_starts_and_targets_change(capfd):
    scene = wires()
    tip = scene.body("c").point(0.0, 0.0, -1.0)
    objective = asm.PointDistance(tip, (0.5, 1.2, -1.2))
    scene.minimize(objective, asm.Posture(scene.q, weight=0.5))
    solver = ReferenceSolver(scene)
    first = solver.solve()
    again = solver.solve(first)
    assert first.success and again.success
    # A solution is stationary already, but for the rounding of its way through the user's units.
    assert again.iterations <= 1
    np.testing.assert_allclose(again.q, first.q, rtol=0, atol=1e-9)
    assert solver.solve(scene.solve(first)).iterations <= 1
    objective.target = (0.6, 1.3, -1.1)
    moved = solver.solve(first)
    assert moved.success and moved.iterations < first.iterations
    assert np.abs(moved.q - first.q).max() > 1e-3
    np.testing.assert_allclose(moved.q, asm.reference.solve(scene, first.q).q, rtol=0, atol=1e-8)
    assert moved.history.shape == (moved.iterations + 1, len(Iteration.COLUMNS))
    assert moved.history[-1, 1] <= 1e-9 and not np.isnan(moved.history).any()
    assert capfd.readouterr() == ("", "")


def test_starts_choose_the_pair():
    # The ball is nearer to the right of the ring, but the pair to track is that of a ball on the left.
    ring = asm.Body("ring", shapes.torus(1.0, 0.2), fixed=True)
    ball = asm.Body("ball", shapes.ellipsoid(0.5, 0.4, 0.3), position=(0.1, 0.0, 0.05))
    scene = chain(ring, ball)
    moved = ball.q - [0.2, 0, 0, 0, 0, 0, 0]
    start = asm.proximity.extremal_pair(ring.faces[0], ring.q, ball.faces[0], moved).parameters
    right = asm.reference.solve(scene)
    left = asm.reference.solve(scene, starts={"ring-ball": start})
    assert right.success and left.success
    assert right.contacts["ring-ball"].points[0, 0] > 0.7
    assert left.contacts["ring-ball"].points[0, 0] < -0.7


@pytest.mark.parametrize(
    ("arguments", "error", "text"),
    [
        ({"q0": np.zeros((3, 7))}, ValueError, r"q0 .*\(3, 7\).*\(2, 7\)"),
        ({"q0": np.full((2, 7), np.nan)}, ValueError, "q0.*nan.*finite"),
        ({"starts": {"nothing": (0, 0, 0, 0)}}, ValueError, "starts names 'nothing'; expected .*'first-second'"),
        ({"starts": {"first-second": (0, 0)}}, ValueError, "starts.*shape"),
        ({"ipopt": ["tol"]}, TypeError, "ipopt is .*expected a mapping"),
        ({"ipopt": {"tol": None}}, ValueError, "ipopt.*'tol'.*None.*expected"),
        ({"ipopt": {"tolerance": 1e-9}}, ValueError, "ipopt is .*tolerance.*expected options of IPOPT"),
        ({"ipopt": {"tol": "small"}}, ValueError, "ipopt is .*small.*expected options of IPOPT"),
    ],
)
def test_bad_input_is_named(arguments, error, text):
    with pytest.raises(error, match=text):
        asm.reference.solve(ellipsoids(), **arguments)


def test_what_is_no_assembly_is_refused():
    with pytest.raises(TypeError, match=r"scene is 'scene'; expected an Assembly"):
        asm.reference.solve("scene")
    with pytest.raises(ValueError, match="none moving"):
        asm.reference.solve(asm.Assembly([asm.Body("a", shapes.sphere(1.0), fixed=True)]))


def test_a_solver_of_a_changed_scene_is_refused():
    scene = ellipsoids()
    solver = ReferenceSolver(scene)
    before = asm.reference.solve(scene)
    scene.minimize(asm.PointDistance(scene.body("second").point(0, 0, 0), (0.0, 3.0, 0.0)), asm.Posture())
    with pytest.raises(ValueError, match="scene was changed"):
        solver.solve()
    with pytest.raises(ValueError, match="q0 is a solution of another assembly"):
        asm.reference.solve(scene, before)
    assert np.abs(asm.reference.solve(scene).q - before.q).max() > 0.1
