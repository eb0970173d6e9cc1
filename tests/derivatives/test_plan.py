"""Derivatives in two compiled calls are those of the general way, and what is set in place is what is measured."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.packing.scene_size import scene_size
from assembly.derivatives.implicit import _derived
from assembly.derivatives.kkt import System, solve_system
from assembly.derivatives.least_steps import least_steps
from assembly.derivatives.numbers import FrameOrigin, FrameTurn, LeastGap, RowNumber, TargetNumber
from tests.derivatives.sensitivity_scenes import CASES, Case, differences, rocker, slider_crank

PLANNED = (FrameOrigin, FrameTurn, LeastGap, RowNumber, TargetNumber)


def grasped():
    """A body that is drawn by a frame, and held by nothing else: no joint has a frame."""
    ground, block = asm.Body("ground", fixed=True), asm.Body("block", asm.shapes.box(2, 1, 1))
    scene = asm.Assembly([ground, block])
    grasp = asm.FrameDistance(block.frame(at=(1, 0.2, 0), z=(1, 0, 1)), asm.Pose((0.3, 0.1, 0.2)), length=2.0)
    scene.minimize(grasp)
    wrt = [asm.Parameter(grasp.frame, field, axis) for field in ("origin", "turn") for axis in "xyz"]
    return Case(scene, [asm.Measure(block, axis) for axis in "xyz"], [*wrt, asm.Parameter(grasp, "target", "y")])


def planned(case):
    """The same case with what has a plan."""
    wrt = [item for item in case.wrt if isinstance(item._number, PLANNED)]
    return Case(case.scene, [item for item in case.of if item.kind != "wrench"], wrt, case.q0)


@pytest.mark.parametrize(
    "name", ["slider_crank", "rocker", "cam", "clips", "pushed", "filmed", "trimmed", "leaning", "grasped"]
)
def test_derivatives_are_those_of_the_general_way(name):
    case = planned((CASES | {"grasped": grasped})[name]())
    solution = case.solved()
    d, general = (way(case.scene, solution, case.of, case.wrt) for way in (asm.sensitivity, _derived))
    assert [plan is not None for plan in solution._packed.derivative_plans.values()] == [True]
    # Both are the same formulas, by another factorization.
    scale = max(1.0, np.abs(general.matrix).max())
    assert np.abs(d.matrix - general.matrix).max() < 1e-12 * scale
    assert (d.rank, d.undetermined.tolist()) == (general.rank, general.undetermined.tolist())
    for told, expected in ((d.twists, general.twists), (d.multipliers, general.multipliers)):
        assert list(told) == list(expected)
        for key, rows in expected.items():
            assert np.abs(told[key] - rows).max(initial=0.0) < 1e-11 * max(1.0, np.abs(rows).max(initial=0.0))


def test_a_frame_of_a_scene_without_joints_is_differenced():
    case = grasped()
    solution = case.solved()
    d = asm.sensitivity(case.scene, solution, case.of, case.wrt)
    for k, parameter in enumerate(case.wrt):
        # What solves leave, 2e-13, over the step.
        assert np.abs(differences(case, solution, parameter, 1e-3) - d.matrix[:, k]).max() < 1e-8


@pytest.mark.parametrize(("rows", "unknowns", "repeated"), [(6, 6, 0), (3, 9, 0), (9, 6, 3), (8, 12, 3), (0, 6, 0)])
def test_steps_by_pivots_are_those_by_singular_values(rows, unknowns, repeated):
    rng = np.random.default_rng(rows)
    jacobian = rng.normal(size=(rows, unknowns))
    own = rows - repeated
    jacobian[own:] = rng.normal(size=(repeated, own)) @ jacobian[:own]
    hessian = rng.normal(size=(unknowns, unknowns))
    hessian = hessian @ hessian.T + np.eye(unknowns)
    rows_by, slopes_by = jacobian @ rng.normal(size=(unknowns, 4)), rng.normal(size=(unknowns, 4))
    expected = solve_system(System(jacobian, hessian, rows_by, slopes_by), np.ones(rows, dtype=bool))
    steps, forces = np.empty((unknowns, 4)), np.empty((rows, 4))
    room = steps, forces, np.empty((unknowns, unknowns))
    found = least_steps(jacobian, hessian, rows_by, slopes_by, *room)
    assert found == (expected.rank, 0)
    assert np.abs(steps - expected.steps).max() < 1e-12
    assert np.abs(forces - expected.forces).max(initial=0.0) < 1e-11 * max(1.0, np.abs(forces).max(initial=0.0))
    if repeated:
        rows_by[0] += 1.0
        *_, contradicting = least_steps(jacobian, hessian, rows_by, slopes_by, *room)
        assert contradicting == 4


def test_doubtful_ranks_are_left_to_singular_values():
    jacobian = np.array([[1.0, 0.0, 0.0], [1.0, 1e-7, 0.0]])
    room = np.empty((3, 1)), np.empty((2, 1)), np.empty((3, 3))
    assert least_steps(jacobian, np.eye(3), np.ones((2, 1)), np.zeros((3, 1)), *room) == (-1, 0)


def test_a_plan_follows_numbers_that_are_set():
    case = planned(rocker())
    solution = case.solved()
    asm.sensitivity(case.scene, solution, case.of, case.wrt)
    for value in (6.1, 6.2):
        case.wrt[2].value = value
        solution = case.solved(solution)
        d, general = (way(case.scene, solution, case.of, case.wrt) for way in (asm.sensitivity, _derived))
        assert np.abs(d.matrix - general.matrix).max() < 1e-12 * np.abs(general.matrix).max()


def test_numbers_of_other_scenes_pack_nothing_anew():
    one, two = slider_crank(), slider_crank()
    least = asm.Clearance([asm.Body("a", asm.shapes.sphere(1)), asm.Body("b", asm.shapes.sphere(1), (3, 0, 0))])
    apart = asm.Assembly(least.bodies)
    apart.constrain(least)
    apart.solve()
    packed = one.scene.packed(), apart.packed()
    two.wrt[1].value = 2.5
    assert one.scene.packed() is packed[0] and apart.packed() is packed[1]


def test_a_least_gap_is_set_in_place():
    plate = asm.Body("plate", asm.shapes.plane(20.0, 20.0), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(1.0), (0.3, 0.2, 3.0))
    scene = asm.Assembly([plate, ball])
    least = asm.Clearance([plate, ball], minimum=0.3)
    scene.constrain(least)
    scene.minimize(asm.PointDistance(ball.point(0, 0, 0), (0.0, 0.0, -1.0)))
    solution = scene.solve()
    table, gap = scene.packed().table, asm.Parameter(least, "minimum")
    for value in (0.4, 0.1):
        gap.value = value
        solution = scene.solve(solution)
        assert solution.success and solution.pose(ball).position[2] == pytest.approx(1.0 + value, abs=1e-9)
        assert np.array_equal(scene.packed().table, table)
    # Without a least gap contacts stand otherwise.
    gap.value = 0.0
    assert scene.solve(solution).pose(ball).position[2] == pytest.approx(1.0, abs=1e-9)


def test_the_size_is_measured_to_the_bits():
    """Frames are placed at random: the size that only they change is that of all that there is."""
    case = slider_crank()
    solution, rng = case.solved(), np.random.default_rng(0)
    frames = [frame for joint in case.scene.constraints for frame in (joint.frame_a, joint.frame_b)]
    for _ in range(40):
        frame = frames[rng.integers(len(frames))]
        asm.Parameter(frame, "origin", "x").value = rng.normal() * 3.0
        packed = case.scene.packed()
        assert packed.scale == scene_size(case.scene.bodies, case.scene.constraints, ())
    assert solution.success
