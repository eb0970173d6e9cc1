"""First steps that are corrected as those of the last solve were: `solve/loop/course.py`."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest

import assembly as asm
from assembly._record import place_of
from assembly.constraints.program.kept import kept_header_at
from assembly.constraints.program.records import HEADER_RECORD
from assembly.solve.result import Ended
from tests.solve.loop.chord_scenes import (
    by_chords,
    four_bar,
    limited_arm,
    wires,
)


def _planar_four_bar(links):
    """A crank-rocker at an angle of 1: scene, hinge of the crank, the place of the free joint, solved and exact."""
    a, c, b, d = links

    def joint(angle):
        f = d - a * np.exp(1j * angle)
        turned = np.arccos((b**2 + abs(f) ** 2 - c**2) / (2 * b * abs(f)))
        return a * np.exp(1j * angle) + b * f / abs(f) * np.exp(1j * turned)

    near, far = a * np.exp(1j), joint(1.0)
    placed = [(0.0, near), (near, far), (d, far)]
    bars = []
    for name, (at, to) in zip(("crank", "coupler", "rocker"), placed, strict=True):
        turn = asm.Pose.from_axis_angle((0, 0, 1), np.angle(to - at)).quaternion
        bars.append(asm.Body(name, position=(np.real(at), np.imag(at), 0.0), quaternion=turn))
    ground = asm.Body("ground", fixed=True)
    scene, (crank, coupler, rocker) = asm.Assembly([ground, *bars]), bars
    hinge = asm.Revolute(ground, crank, "hinge")
    hinge.angle = 1.0
    scene.constrain(hinge, asm.Revolute(crank.frame((a, 0, 0)), coupler, "near"))
    scene.constrain(asm.Revolute(coupler.frame((b, 0, 0)), rocker.frame((c, 0, 0)), "far"))
    scene.constrain(asm.Revolute(ground.frame((d, 0, 0)), rocker, "base"))

    def exact(angle):
        return np.array([joint(angle).real, joint(angle).imag, 0.0])

    return scene, hinge, lambda solution: solution.pose(rocker).apply((c, 0.0, 0.0)), exact


def _left_by_first_steps(make, step):
    """The violations after the first steps of seven solves, each of which changes a value by as much."""
    case = make()
    case.change(0.0)
    solution = case.scene.solve()
    left = []
    for k in range(1, 8):
        case.change(step * k)
        solution = case.scene.solve(solution)
        assert solution.success and by_chords(solution)
        left.append(solution.history[1, 1])
    return np.array(left)


@pytest.mark.parametrize("make", [four_bar, wires, limited_arm])
def test_first_steps_are_corrected_as_the_last_ones_were(make):
    # A tangent leaves what goes with the square of a step; corrected as that of the last solve, with its cube; by how
    # that changed as well, with its fourth power. The powers that come next shift these a little.
    coarse, fine = (_left_by_first_steps(make, step * make().small) for step in (2.0, 1.0))
    powers = np.log2(coarse / fine)
    assert powers[0] == pytest.approx(2.0, abs=0.05)
    assert powers[1] > 2.7
    assert powers[-1] > 3.5
    assert fine[1] < 0.2 * fine[0]
    assert fine[-1] < 1e-2 * fine[0]


def test_steps_to_and_fro_are_corrected():
    case = four_bar()
    case.change(0.0)
    solution = case.scene.solve()
    left = []
    for k in range(1, 13):
        case.change(case.small * (k % 2))
        solution = case.scene.solve(solution)
        left.append(solution.history[1, 1])
    # At first as far as the cube of the step, which comes with the other sign on the way back; then this, too.
    assert max(left[-2:]) < 1e-3 * left[0]


def _without_course(solution, scene):
    """The same solution without what is kept of its steps."""
    other = deepcopy(solution)
    other._ended, other._scene = Ended(solution._packed, solution._state.copy()), scene
    kept_header_at(other._state, other._packed.kept_at).corrected = 0.0
    return other


def test_what_nothing_determines_is_not_foreseen():
    # A ball turns freely about its joint. A turn that came to one solve does not go on with the next ones.
    ground, arm, ball = asm.Body("ground", fixed=True), asm.Body("arm"), asm.Body("ball", position=(1.0, 0.0, 0.0))
    scene = asm.Assembly([ground, arm, ball])
    scene.constrain(asm.Revolute(ground, arm, "hinge"), asm.Spherical(arm.frame((1.0, 0.0, 0.0)), ball, "socket"))
    grip = asm.PointDistance(arm.point(1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    scene.minimize(grip)
    solution = scene.solve(scene.solve())
    turned = []
    for k in range(1, 9):
        grip.target = (np.cos(0.05 * k), np.sin(0.05 * k), 0.0)
        after = scene.solve(solution)
        assert after.success and by_chords(after)
        turned.append(abs(after.pose(ball).quaternion - solution.pose(ball).quaternion).max())
        solution = after
        if k == 3:
            # At the end of a state: three lists of 12 unknowns, the second of which is the correction, and two of rows.
            rows = solution._packed.rows_table[place_of(HEADER_RECORD, "rows")]
            steps = solution._state[-(36 + 2 * rows) :][:36].reshape(3, 12)
            steps[1, 9:] += 1e-3
    assert max(turned) < 1e-12


def test_a_corrected_step_is_followed_by_a_computed_one():
    # In steps of 6e-4 radians a corrected one leaves 7e-14, less than the tolerance of 2e-13, which is not the end.
    case = four_bar()
    case.change(0.0)
    solution = case.scene.solve()
    for k in range(1, 31):
        case.change(6e-4 * k)
        solution = case.scene.solve(solution)
        assert solution.success and by_chords(solution)
        if k > 10:
            assert solution.history[1, 1] < 1e-13
            assert solution.iterations == 2
            assert solution.history[2, 1] < 2e-15


@pytest.mark.parametrize("degrees", [1.0, 4.0])
def test_corrected_solves_end_as_near_to_the_exact_answer(degrees):
    # Planar four-bars with random links: the free joint as the circles of coupler and rocker meet.
    rng, off = np.random.default_rng(4), []
    for _ in range(4):
        links = rng.uniform(1.0, 1.3, 4) * (0.4, 1.0, 1.0, 1.0)
        scene, hinge, tip, where = _planar_four_bar(links)
        solution = scene.solve()
        for k in range(1, 61):
            hinge.angle = 1.0 + np.radians(degrees) * k
            after, plain = (scene.solve(s) for s in (solution, _without_course(solution, scene)))
            off.append([np.linalg.norm(tip(s) - where(hinge.angle)) for s in (after, plain)])
            solution = after
    corrected, plain = np.array(off).T
    for part in (0.5, 0.9, 0.99):
        assert np.quantile(corrected, part) <= max(np.quantile(plain, part), 1e-15)


def test_a_first_step_that_leads_elsewhere_is_not_corrected():
    case = wires()
    solution = case.scene.solve()
    for k in range(1, 4):
        case.change(case.small * k)
        solution = case.scene.solve(solution)
    plain = _without_course(solution, case.scene)
    case.change(case.small * 4)
    left, left_plain = (case.scene.solve(before).history[1, 1] for before in (solution, plain))
    assert left < 0.1 * left_plain
    ((_, grip),) = case.scene.objectives
    grip.target = grip.target + (0.5, 0.3, -0.5)
    aside, aside_plain = (case.scene.solve(before).history for before in (solution, plain))
    np.testing.assert_array_equal(aside, aside_plain)
