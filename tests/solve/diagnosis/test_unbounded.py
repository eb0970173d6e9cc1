"""UNBOUNDED: an objective that falls on and on along poses that hold, and nothing else, is called so."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import assembly as asm
from assembly.solve.scene import Status
from tests.solve.lower_poses import random_scene


def balls(unit=1.0, far=0.0):
    a = asm.Body("a", asm.shapes.sphere(unit), (far, 0, 0))
    b = asm.Body("b", asm.shapes.sphere(unit), (far + 2 * unit, 0, 0))
    return asm.Assembly([a, b]), a, b


def rail(make, at=(0.3, 0, 0)):
    """A body on a joint to the ground, a point of which is to go away."""
    ground, slider = asm.Body("ground", fixed=True), asm.Body("slider")
    scene = asm.Assembly([ground, slider])
    scene.constrain(make(ground, slider))
    scene.maximize(asm.PointDistance(slider.point(*at), (0, 0, -1)))
    return scene


def assert_unbounded(scene):
    solution = scene.solve()
    assert solution.status is Status.UNBOUNDED and not solution.success
    assert "unbounded" in solution.message and "violated" not in solution.message


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e6])
@pytest.mark.parametrize("both", [False, True])
def test_free_bodies_in_any_unit(unit, both):
    scene, a, b = balls(unit)
    scene.maximize(asm.PointDistance(b.point(0, 0, 0), (0.1 * unit, 0, 0)))
    if both:
        scene.maximize(asm.PointDistance(a.point(0, 0, 0), (0.1 * unit, 0.2 * unit, 0)))
    assert_unbounded(scene)


@pytest.mark.parametrize("far", [1e3, -1e5])
def test_a_start_far_away(far):
    scene, _, b = balls(far=far)
    scene.maximize(asm.PointDistance(b.point(0, 0, 0), (0.1, 0, 0)))
    assert_unbounded(scene)


@pytest.mark.parametrize(
    "make",
    [
        asm.Prismatic,
        asm.Cylindrical,
        lambda a, b: asm.Prismatic(a, b, limits=(-1.0, None)),
        lambda a, b: asm.Screw(a, b, pitch=1.0),
    ],
)
def test_joints_without_an_end(make):
    assert_unbounded(rail(make))


def test_an_arm_that_grows_longer():
    ground, arm, slider = asm.Body("ground", fixed=True), asm.Body("arm"), asm.Body("slider")
    scene = asm.Assembly([ground, arm, slider])
    x = (1, 0, 0)
    scene.constrain(asm.Revolute(ground, arm), asm.Prismatic(arm.frame(z=x), slider.frame(z=x)))
    scene.maximize(asm.PointDistance(slider.point(0, 0, 0), (0.3, 0.4, 0)))
    assert_unbounded(scene)


@pytest.mark.parametrize("how", ["one-sided contact", "clearance"])
def test_bodies_that_only_stay_apart(how):
    scene, a, b = balls()
    scene.constrain(asm.Clearance() if how == "clearance" else asm.Contact(a, b, unilateral=True))
    scene.maximize(asm.PointDistance(b.point(0, 0, 0), (0.1, 0.3, 0)))
    assert_unbounded(scene)


X = ca.SX.sym("x", 7)


@pytest.mark.parametrize(
    ("value", "falls"),
    [
        (X[0], True),
        (-ca.log(1 + X[0] ** 2), True),
        (-ca.sqrt(1 + X[0] ** 2), True),
        (X[0] - 1e-3 * ca.log(1 + X[0] ** 2), True),
        (-(X[0] ** 3), True),
        # Past all doubles on the way.
        (-ca.exp(X[0]), True),
        (-ca.sinh(3 * X[0]), True),
        (-ca.exp(X[0] ** 2), True),
        (1e-300 * ca.exp(1.1 * X[0]) - ca.exp(X[0]), False),
        # A finite value is neared at infinity, fast or slowly.
        (-ca.atan(X[0]), False),
        (1 / (1 + X[0] ** 2), False),
        (1 / ca.sqrt(1 + X[0] ** 2), False),
        (ca.exp(-X[0]), False),
    ],
)
def test_what_falls_without_end_and_what_nears_a_value(value, falls):
    scene, _, b = balls()
    scene.minimize(asm.Expression(ca.Function("f", [X], [value]), [b]))
    assert (scene.solve().status is Status.UNBOUNDED) is falls


@pytest.mark.parametrize("limit", [5.0, 1e3, 1e9, 1e20])
def test_a_limit_bounds_however_far_it_is(limit):
    solution = rail(lambda a, b: asm.Prismatic(a, b, limits=(None, limit))).solve()
    assert solution.status is not Status.UNBOUNDED
    assert solution.success == (limit < 1e4)


def test_what_is_bounded_by_something_else():
    scene, a, b = balls()
    scene.minimize(asm.PointDistance(b.point(0, 0, 0), (1e3, 0, 0)))
    assert scene.solve().success
    scene, a, b = balls()
    scene.minimize(asm.PointDistance(b.point(0, 0, 0), (9, 0, 0), 2.0))
    scene.maximize(asm.PointDistance(b.point(0, 0, 0), (0, 0, 0)))
    assert scene.solve().success
    # A distance of two bodies that touch is.
    scene, a, b = balls()
    scene.constrain(asm.Contact(a, b))
    scene.minimize(asm.PointDistance(a.point(0, 0, 0), (0, 0, 0), 1e3))
    scene.maximize(asm.PointDistance(b.point(0, 0, 0), (0.1, 0.3, 0)))
    assert scene.solve().status is not Status.UNBOUNDED


def test_a_ball_ends_at_the_edge_of_a_plane():
    plane, ball = asm.Body("plane", asm.shapes.plane(40, 40), fixed=True), asm.Body("ball", asm.shapes.sphere(1.0))
    ball.pose = asm.Pose((0, 0, 1.5))
    scene = asm.Assembly([plane, ball])
    scene.constrain(asm.Contact(plane, ball))
    scene.maximize(asm.PointDistance(ball.point(0, 0, 0), (0.3, 0.1, 1)))
    assert scene.solve().status is not Status.UNBOUNDED


def test_too_few_steps_are_no_proof():
    scene, _, b = balls()
    scene.maximize(asm.PointDistance(b.point(0, 0, 0), (0.1, 0, 0)))
    assert scene.solve(max_iterations=3).status is Status.ITERATION_LIMIT


def beside(pitch, unit=1.0, at=(2.0, 1.0), turned=None, rising=False):
    """A nut whose origin is not on the axis of its screw: away from a point on the axis, or up."""
    ground, nut = asm.Body("ground", fixed=True), asm.Body("nut")
    axis = (0.0, 0.0, 1.0)
    if turned is not None:
        ground.pose = turned
        axis = turned.apply((0, 0, 1)) - turned.position
    scene = asm.Assembly([ground, nut])
    scene.constrain(asm.Screw(ground, nut.frame(at=(unit * at[0], unit * at[1], 0)), pitch=unit * pitch))
    if rising:
        height = ca.dot(ca.DM(np.array(axis)), X[:3])
        scene.minimize(asm.Expression(ca.Function("height", [X], [-height]), [nut]))
    else:
        scene.maximize(asm.PointDistance(nut.point(0.3 * unit, 0, 0), (0, 0, -unit)))
    return scene


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("pitch", [0.1, 0.5, -1.0, 3.0, 100.0])
def test_a_nut_beside_its_axis_goes_on_as_a_helix(pitch, unit):
    assert_unbounded(beside(pitch, unit))
    assert_unbounded(beside(pitch, unit, rising=True))
    assert_unbounded(beside(pitch, unit, (-0.7, 1.0), asm.Pose((0, 1, 2), (0.5, 0.5, -0.5, 0.5)), rising=True))


@pytest.mark.parametrize("limit", [50.0, 1e6])
def test_a_nut_with_a_limit_does_not(limit):
    for pitch in (0.5, 3.0):
        scene = beside(pitch, rising=True)
        scene.constraints[0].slide_limits = (None, limit)
        assert scene.solve().status is not Status.UNBOUNDED


def test_what_turns_without_going_away_is_bounded():
    # A wheel that is turned on and on by an angle that is worth less and less comes to no end of its own.
    ground, wheel = asm.Body("ground", fixed=True), asm.Body("wheel")
    scene = asm.Assembly([ground, wheel])
    scene.constrain(asm.Revolute(ground, wheel.frame(at=(1, 0, 0))))
    scene.maximize(asm.PointDistance(wheel.point(3, 0, 0), (0.3, 0.4, 0)))
    assert scene.solve(max_iterations=3).status is Status.ITERATION_LIMIT
    assert scene.solve().success


@pytest.mark.parametrize("shape", ["balls", "boxes"])
@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_what_touches_is_towed(shape, unit):
    make = asm.shapes.sphere if shape == "balls" else lambda r: asm.shapes.box(r, r, r)
    a, b = asm.Body("a", make(unit)), asm.Body("b", make(unit), (0, 0, 2.2 * unit))
    for first in (a, b):
        scene = asm.Assembly([a, b])
        scene.constrain(asm.Contact(a, b))
        scene.maximize(asm.PointDistance(first.point(0.1 * unit, 0, 0), (0.1 * unit, 0.3 * unit, 0)))
        assert_unbounded(scene)


def test_what_touches_something_held_is_not():
    for hold in (True, False):
        scene, a, b = balls()
        scene.constrain(asm.Contact(a, b))
        if hold:
            scene.constrain(asm.Spherical(a, scene.add(asm.Body("ground", fixed=True))))
        else:
            scene.constrain(asm.Distance(a, scene.add(asm.Body("ground", fixed=True)), 3.0))
        scene.maximize(asm.PointDistance(b.point(0, 0, 0), (0.1, 0.3, 0)))
        assert scene.solve().status is not Status.UNBOUNDED


def test_it_is_seen_early_and_what_comes_back_goes_on():
    scene, _, b = balls()
    scene.maximize(asm.PointDistance(b.point(0, 0, 0), (0.1, 0, 0)))
    solution = scene.solve()
    assert solution.status is Status.UNBOUNDED and solution.iterations <= 60
    # A limit far out, in a scene of size 1: bodies are farther than the look waits for, and arrive.
    solution = rail(lambda a, b: asm.Prismatic(a, b, limits=(None, 1e7)), (0.3, 0, 0)).solve(max_iterations=1000)
    assert solution.status is not Status.UNBOUNDED and (solution.success or solution.iterations > 60)


def test_bounded_scenes_that_run_out_of_steps_are_bounded(cases):
    # Sums of squares never fall without end, wherever a solve is stopped.
    for seed in range(cases(40, 600)):
        scene, model = random_scene(np.random.default_rng(seed), exact=False)
        for steps in (2, 7, 20) if model.sign > 0.0 else ():
            assert scene.solve(max_iterations=steps).status is not Status.UNBOUNDED, seed
