"""Mechanisms next to where they are singular: flat parallelograms, dead centers, arms that are stretched."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from tests.solve.mechanisms import parallelograms
from tests.stress.honest import check


def two_bars(reach, bend=0.3):
    """Two rods of length one in the plane, hinged, the end of the second held at a distance from the first hinge."""
    ground = asm.Body("ground", fixed=True)
    turns = [asm.Pose.from_axis_angle((0, 0, 1), angle) for angle in (bend, -bend)]
    first = asm.Body("first", None, (0, 0, 0), turns[0].quaternion)
    second = asm.Body("second", None, turns[0].matrix[:3, 0], turns[1].quaternion)
    scene = asm.Assembly([ground, first, second])
    scene.constrain(
        asm.Revolute(ground, first, "shoulder"),
        asm.Revolute(first.frame((1, 0, 0)), second, "elbow"),
        asm.Distance(ground.point(0, 0, 0), second.point(1, 0, 0), reach, "rod"),
    )
    return scene


@pytest.mark.parametrize("bend", [0.1, 0.3, 0.5])
@pytest.mark.parametrize("short", [1e-1, 1e-3, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-12, 0.0])
def test_an_arm_nearly_stretched(short, bend):
    scene = two_bars(2.0 - short, bend)
    solution = scene.solve(max_iterations=1_000)
    status = check(scene, solution)
    tip = asm.Pose(solution.q[2, :3], solution.q[2, 3:]).apply((1, 0, 0))
    reach = np.linalg.norm(tip)
    if status is asm.Status.SOLVED:
        assert abs(reach - (2.0 - short)) < 1e-11
    # Stretched, the row's slope vanishes: what is left of it is the square of what is left of the angle, and rows hold
    # to rounding, SOLVED or not.
    assert abs(reach - (2.0 - short)) < 1e-12
    if short > 0.0:
        assert status is asm.Status.SOLVED


@pytest.mark.parametrize("over", [1e-12, 1e-9, 1e-6, 1e-3, 1e-1])
def test_an_arm_too_short(over):
    scene = two_bars(2.0 + over)
    solution = scene.solve(max_iterations=1_000, fit=0.0)
    status = check(scene, solution)
    # What is asked is out of reach by that much; less than rows are held to is not seen.
    if over > 1e-11:
        assert status is not asm.Status.SOLVED
    if over >= 1e-6:
        assert status is asm.Status.INFEASIBLE
        assert "rod" in solution.conflicting


@pytest.mark.parametrize("cells", range(1, 9))
@pytest.mark.parametrize("seed", range(3))
def test_squares_that_are_folded_all_but_flat(cells, seed):
    """From poses 2 percent off flat ones: rows depend on each other where they end, which is not far from flat."""
    scene = parallelograms(cells)
    rng = np.random.default_rng(seed)
    q = scene.q.copy()
    size = scene.packed().scale
    for k in range(1, len(q)):
        off = asm.Pose.from_axis_angle(rng.normal(size=3), 0.02, 0.02 * size * rng.uniform(-1.0, 1.0, 3))
        q[k] = (asm.Pose(q[k, :3], q[k, 3:]) @ off).q
    solution = scene.solve(q)
    assert check(scene, solution) is asm.Status.SOLVED
    poses = {body: asm.Pose(row[:3], row[3:]) for body, row in zip(scene.bodies, solution.q, strict=True)}
    for hinge in scene.constraints:
        (a, one), (b, other) = ((poses[frame.body], frame) for frame in (hinge.frame_a, hinge.frame_b))
        # Rows hold to 1e-12 of the size.
        assert np.abs(a.apply(one.origin) - b.apply(other.origin)).max() < 2e-12 * size
        axes = [pose.matrix[:3, :3] @ frame.axes[:, 2] for pose, frame in ((a, one), (b, other))]
        assert np.linalg.norm(np.cross(*axes)) < 2e-12
        assert np.dot(*axes) > 0.9


@pytest.mark.parametrize("angle", [1.0, 1e-2, 1e-4, 1e-6, 1e-8, 0.0])
def test_a_parallelogram_nearly_flat(angle):
    """Crank and rocker of length one on a base of length two."""
    ground = asm.Body("ground", fixed=True)
    pose = asm.Pose.from_axis_angle((0, 0, 1), angle)
    tip = pose.matrix[:3, 0]
    crank, rocker = (
        asm.Body(name, None, at, pose.quaternion) for name, at in (("crank", (0, 0, 0)), ("rocker", (2, 0, 0)))
    )
    coupler = asm.Body("coupler", None, tip)
    scene = asm.Assembly([ground, crank, coupler, rocker])
    hinge = asm.Revolute(ground, crank, "crank hinge", angle=angle + 1e-3)
    scene.constrain(
        hinge,
        asm.Revolute(crank.frame((1, 0, 0)), coupler, "one"),
        asm.Revolute(coupler.frame((2, 0, 0)), rocker.frame((1, 0, 0)), "other"),
        asm.Revolute(ground.frame((2, 0, 0)), rocker, "rocker hinge"),
    )
    solution = scene.solve()
    status = check(scene, solution)
    if status is asm.Status.SOLVED:
        found = solution.values["crank hinge.angle"]
        np.testing.assert_allclose(found, angle + 1e-3, rtol=0, atol=1e-10)
    if angle >= 1e-2:
        assert status is asm.Status.SOLVED
