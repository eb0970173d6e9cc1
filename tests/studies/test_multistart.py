"""Several starts: the distinct solutions, each once, in order, the same in every run."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.studies.distinct import are_one


def four_bar():
    """A crank at 1 radian, a coupler and a rocker in the plane: two circles meet in two points."""
    ground = asm.Body("ground", fixed=True)
    crank, coupler, rocker = (asm.Body(name) for name in ("crank", "coupler", "rocker"))
    scene = asm.Assembly([ground, crank, coupler, rocker])
    scene.constrain(
        asm.Revolute(ground, crank, "a", angle=1.0),
        asm.Revolute(crank.frame((1, 0, 0)), coupler, "b"),
        asm.Revolute(coupler.frame((3, 0, 0)), rocker.frame((2.5, 0, 0)), "c"),
        asm.Revolute(ground.frame((3.2, 0, 0)), rocker, "d"),
    )
    return scene


def tips():
    """Where coupler and rocker meet: the circles about the crank's tip and about the rocker's foot."""
    a, b = np.array([np.cos(1.0), np.sin(1.0)]), np.array([3.2, 0.0])
    d = np.linalg.norm(b - a)
    along = (d * d + 3.0**2 - 2.5**2) / (2.0 * d)
    across = np.sqrt(9.0 - along**2) * np.array([a[1] - b[1], b[0] - a[0]]) / d
    return a + along * (b - a) / d + across, a + along * (b - a) / d - across


def test_both_ways_to_close_a_four_bar_are_found():
    scene = four_bar()
    found = scene.solve_all(starts=20)
    assert len(found) == 2 and all(solution.success for solution in found)
    ends = [solution.pose("coupler").apply((3, 0, 0)) for solution in found]
    for tip in tips():
        assert min(np.linalg.norm(end - [*tip, 0.0]) for end in ends) < 1e-10
    # From the same poses measured, the nearer one first.
    assert found[0].objective < found[1].objective
    for solution in found:
        moved = solution.q - scene.q
        turned = 1.0 - np.abs((solution.q[:, 3:] * scene.q[:, 3:]).sum(axis=1)) ** 2
        lever = 0.5 * scene.packed().scale
        expected = (moved[:, :3] ** 2).sum() + 4.0 * lever**2 * turned.sum()
        assert solution.objective == pytest.approx(expected, rel=1e-9)


def test_the_same_seed_finds_the_same():
    first, again = (four_bar().solve_all(starts=6, seed=3) for _ in range(2))
    assert len(first) == len(again) > 0
    for one, other in zip(first, again, strict=True):
        np.testing.assert_array_equal(one.q, other.q)


def test_one_start_is_the_bodies_poses():
    scene = four_bar()
    scene.bodies[1].pose = asm.Pose.from_axis_angle((0, 0, 1), 0.9)
    scene.minimize(asm.PointDistance(scene.bodies[3].point(1, 0, 0), (1, 2, 0)))
    found = scene.solve_all(starts=1)
    assert len(found) == 1
    np.testing.assert_array_equal(found[0].q, scene.solve().q)


def test_solutions_are_of_the_scene_and_leave_it_as_it_was():
    scene = four_bar()
    before, alone = scene.q, scene.solve()
    found = scene.solve_all(starts=5, max_iterations=200)
    np.testing.assert_array_equal(scene.q, before)
    # A solve follows its start again, and goes on from what was found.
    np.testing.assert_array_equal(scene.solve().q, alone.q)
    onward = scene.solve(found[-1])
    np.testing.assert_allclose(onward.q, found[-1].q, rtol=0, atol=1e-10)
    assert onward.objective < 1e-18 < found[-1].objective


def test_what_cannot_be_has_no_solutions():
    scene = four_bar()
    scene.constraints[0].angle = None
    scene.constrain(asm.Distance(scene.bodies[0], scene.bodies[1].point(1, 0, 0), 2.0, "wrong"))
    assert scene.solve_all(starts=3) == []


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"starts": 0}, "starts is 0; expected an integer from 1"),
        ({"seed": -1}, "seed is -1; expected an integer from 0"),
        ({"tolerence": 1e-9}, "option 'tolerence' is unknown"),
    ],
)
def test_bad_input(options, text):
    with pytest.raises(InputError, match=text):
        four_bar().solve_all(**options)


def free_points(objective, count=2):
    """Points of bodies whose turns nothing asks for; the objective is of all their coordinates."""
    poses = [ca.SX.sym(f"q{k}", 7) for k in range(count)]
    bodies = [asm.Body(f"point {k}", position=(0.01, -0.2, 0.5 * k)) for k in range(count)]
    scene = asm.Assembly(bodies)
    coordinates = ca.vertcat(*(pose[:3] for pose in poses))
    scene.minimize(asm.Expression(ca.Function("f", poses, [objective(coordinates)]), bodies))
    return scene


def test_turns_that_nothing_asks_for_make_no_solutions_of_their_own():
    target = np.array([1.0, 2.0, 3.0, -1.0, 0.5, 0.0])
    scene = free_points(lambda x: ca.sumsqr(x - target))
    (best,) = scene.solve_all(starts=12)
    np.testing.assert_allclose(best.q[:, :3].ravel(), target, rtol=0, atol=1e-9)
    # The one that stays is that of the bodies' own poses.
    np.testing.assert_array_equal(best.q, scene.solve().q)


def test_an_optimum_that_is_flat_is_one():
    # Of a fourth power solves end where they are near enough, each from its side.
    found = free_points(lambda x: ca.sum1((x - 1.0) ** 4)).solve_all(starts=12)
    assert len(found) == 1 and found[0].objective < 1e-9


@pytest.mark.parametrize("tilt", [0.0, 1e-3])
def test_two_optima_are_two_however_alike(tilt):
    # Along x a double well; where it is level both have the same objective, and the poses between have not.
    found = free_points(lambda x: (x[0] ** 2 - 1.0) ** 2 + tilt * x[0] + ca.sumsqr(x[1:])).solve_all(starts=12)
    places = sorted(float(solution.q[0, 0]) for solution in found)
    assert places == pytest.approx([-1.0, 1.0], abs=2e-3)


def test_a_round_body_that_turned_is_at_the_same_place():
    plane = asm.Body("plane", asm.shapes.plane(20.0, 20.0), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(1.0), (0.0, 0.0, 3.0))
    scene = asm.Assembly([plane, ball])
    scene.constrain(asm.Contact(plane, ball))
    scene.minimize(asm.PointDistance(ball.point(0, 0, 0), (1.0, 2.0, 5.0)))
    found = scene.solve_all(starts=8)
    heights = {round(float(solution.q[1, 2]), 6) for solution in found}
    assert len(found) == len(heights) and 1.0 in heights


def test_a_ball_that_keeps_off_a_box_is_at_one_place_however_it_is_turned():
    box, ball = asm.Body("box", asm.shapes.box(2, 2, 2), fixed=True), asm.Body("ball", asm.shapes.sphere(1.0))
    ball.pose = asm.Pose((0.5, 0.3, 4.0))
    scene = asm.Assembly([box, ball])
    scene.constrain(asm.Clearance(minimum=0.1))
    scene.minimize(asm.PointDistance(ball.point(0, 0, 0), (0.5, 0.3, 0.2)))
    found = scene.solve_all(starts=8)
    places = {tuple(np.round(solution.q[1, :3], 6)) for solution in found}
    assert len(found) == len(places) and (0.5, 0.3, 2.1) in places


def test_solutions_with_something_between_them_are_two():
    # On either side of a wall, as far from where the point is to be; between them it is in the wall.
    wall, ball = asm.Body("wall", asm.shapes.box(8, 8, 1), fixed=True), asm.Body("ball", asm.shapes.sphere(0.5))
    ball.pose = asm.Pose((0.0, 0.0, 2.0))
    scene = asm.Assembly([wall, ball])
    scene.constrain(asm.Clearance())
    pose = ca.SX.sym("q", 7)
    scene.minimize(asm.Expression(ca.Function("f", [pose], [ca.sumsqr(pose[:2])]), [ball]))
    above = scene.solve()
    ball.pose = asm.Pose((0.0, 0.0, -2.0))
    below = scene.solve()
    ball.pose = asm.Pose((0.0, 0.0, 3.0))
    higher = scene.solve()
    assert not are_one(above, below)
    # Nothing asks how far above it is.
    assert are_one(above, higher)


def test_no_starts_at_all_are_refused():
    with pytest.raises(InputError, match="starts is empty; expected a number"):
        asm.Assembly([asm.Body("a")]).solve_all(starts=[])
