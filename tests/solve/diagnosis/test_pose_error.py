"""`Solution.pose_error` against how far poses are from ones that are known."""

from __future__ import annotations

from math import acos, inf, sqrt

import pytest

import assembly as asm

Z = (0, 0, 1)


def triangle(base, unit=1.0, redundant=False):
    """Two unit links from the ground and back to it, `base` away; stretched at 2, its dead center."""
    ground, a, b = asm.Body("ground", fixed=True), asm.Body("a"), asm.Body("b")
    a.pose = asm.Pose.from_axis_angle(Z, 0.3)
    b.pose = asm.Pose.from_axis_angle(Z, -0.4, (unit, 0.3 * unit, 0))
    pins = [
        (ground.frame(), a.frame(), "shoulder"),
        (a.frame((unit, 0, 0)), b.frame(), "elbow"),
        (b.frame((unit, 0, 0)), ground.frame((base * unit, 0, 0)), "wrist"),
    ]
    scene = asm.Assembly([ground, a, b])
    scene.constrain(*(asm.Revolute(*pin) for pin in pins))
    if redundant:
        scene.constrain(*(asm.Spherical(f, g, f"{name} again") for f, g, name in pins))
    return scene


def off(solution, base):
    """How far both links are turned from where they belong, and the second one's origin is off."""
    angle = acos(base / 2)
    turn = abs(abs(solution.values["shoulder.angle"]) - angle)
    return sqrt(3.0) * turn


@pytest.mark.parametrize("redundant", [False, True])
@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e5])
@pytest.mark.parametrize("base", [1.0, 1.9, 1.9999, 1.999999, 1.99999999, 1.9999999999, 2.0])
def test_it_bounds_the_error_of_a_triangle_up_to_its_dead_center(base, unit, redundant):
    solution = triangle(base, unit, redundant).solve()
    assert solution.success
    # The three rows that are off have lengths and a turn among them: which of them says how much is a factor of 2.
    assert off(solution, base) <= 2.0 * solution.pose_error + 1e-15
    # And it is no excuse: the residual is of the order of the tolerance, and so is the error but for the slope there.
    slope = sqrt(1.0 - (base / 2) ** 2)
    size, residual = solution._scene.scale / unit, max(solution.feasibility / unit, 1e-15)
    assert solution.pose_error <= 30.0 * min(residual / max(slope, 1e-30), sqrt(residual)) * max(size, 1.0)


def test_a_dead_center_is_uncertain_by_the_root_of_the_residual():
    solution = triangle(2.0).solve()
    assert 1e-8 < solution.pose_error < 1e-5
    assert triangle(1.0).solve().pose_error < 1e-13


def test_free_motions_are_no_errors():
    ball = asm.Body("ball", asm.shapes.sphere(1.0), (0, 0, 2))
    assert asm.Assembly([ball]).solve().pose_error == 0.0
    plane = asm.Body("plane", asm.shapes.plane(9, 9), fixed=True)
    scene = asm.Assembly([plane, ball])
    scene.constrain(asm.Contact(plane, ball))
    assert scene.solve().pose_error < 1e-12
    # A body that nothing ties, beside a dead center.
    dead = triangle(2.0)
    dead.add(asm.Body("free"))
    assert 1e-8 < dead.solve().pose_error < 1e-5


def four_bar(turn):
    """A planar four-bar of hinges in space, three of whose rows repeat others."""
    bodies = ground, crank, rod, rocker = [asm.Body(name, fixed=name == "ground") for name in ("ground", "b", "c", "d")]
    scene = asm.Assembly(bodies)
    scene.constrain(
        asm.Revolute(ground.frame(), crank.frame(), "drive", angle=turn),
        asm.Revolute(crank.frame((2, 0, 0)), rod.frame()),
        asm.Revolute(rod.frame((5, 0, 0)), rocker.frame((4, 0, 0))),
        asm.Revolute(ground.frame((6, 0, 0)), rocker.frame()),
    )
    return scene


def test_rows_that_repeat_others_are_not_taken_for_a_dead_center():
    solution = four_bar(0.5).solve()
    assert solution.success and solution.mobility.dof == 0
    assert solution.pose_error < 1e-10
    free = four_bar(None).solve()
    assert free.success and free.mobility.dof == 1
    assert free.pose_error < 1e-10


def test_limits_count_where_they_bind():
    ground, slider = asm.Body("ground", fixed=True), asm.Body("slider")
    scene = asm.Assembly([ground, slider])
    scene.constrain(asm.Prismatic(ground, slider, limits=(None, 1.0)))
    scene.minimize(asm.PointDistance(slider.point(0, 0, 0), (0, 0, 2)))
    assert scene.solve().pose_error < 1e-11


def test_it_is_infinite_where_rows_do_not_hold():
    assert triangle(2.5).solve().pose_error == inf


def test_it_is_not_looked_at_before_it_is_read():
    solution = triangle(1.0).solve()
    _ = str(solution)
    assert "pose_error" not in solution.__dict__
