"""Solves and ticks that go on by the factor the last one left: `solve/loop/chord.py`, `constraints/program/kept.py`."""

from __future__ import annotations

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import assembly as asm
from assembly._record import place_of
from assembly.constraints.program.kept import EARLIER_FACTOR
from assembly.constraints.program.records import TAPE_FIELDS, TAPE_TABLE
from assembly.solve.attempts.attempts import go_on_once
from assembly.solve.interruption import CTRL_C
from assembly.solve.loop.settings import GATHER, GATHERS, SCATTER
from benchmarks import linkages, scenes
from benchmarks.running import example
from tests.solve.loop.chord_scenes import (
    CASES,
    by_chords,
    expression,
    factor_of,
    four_bar,
    limited_arm,
    wires,
    without_kept,
)


@pytest.mark.parametrize("make", CASES)
@pytest.mark.parametrize("far", [1.0, 10.0, 100.0])
def test_what_is_kept_changes_no_pose(make, far, cases):
    case = make()
    solution = case.scene.solve()
    rng = np.random.default_rng(3)
    value = 0.0
    for _ in range(cases(8, 100)):
        value += far * case.small * rng.uniform(-1.0, 1.0)
        case.change(value)
        plain = case.scene.solve(without_kept(solution))
        quick = case.scene.solve(solution)
        if make is not wires:
            # Wires may slide along themselves, and whichever end of that is as good; far ones are out of reach.
            assert quick.status is plain.status
            size = case.scene.packed().scale
            # Both are off by the root of what an objective may be off, which is its stationarity here: 1e-10.
            np.testing.assert_allclose(quick.q[:, :3], plain.q[:, :3], rtol=0, atol=1e-9 * size)
            turned = np.abs(np.sum(quick.q[:, 3:] * plain.q[:, 3:], axis=1))
            np.testing.assert_allclose(turned, 1.0, rtol=0, atol=1e-12)
        if make is wires and not (plain.success and quick.success):
            assert far == 100.0
            break
        assert quick.success
        assert quick.objective == pytest.approx(plain.objective, rel=1e-9, abs=1e-12)
        solution = quick


@pytest.mark.parametrize("make", CASES)
def test_small_changes_are_followed_by_chords(make):
    case = make()
    solution = case.scene.solve()
    taken = 0
    for k in range(1, 21):
        assert factor_of(solution) == EARLIER_FACTOR
        case.change(0.2 * case.small * k)
        solution = case.scene.solve(solution)
        assert solution.success
        taken += by_chords(solution)
    assert taken >= 18


@pytest.mark.parametrize("make", CASES)
def test_what_is_returned_holds_to_what_it_says(make):
    # By rows that are evaluated anew, at the poses as they are told.
    case = make()
    solution = case.scene.solve()
    for k in range(1, 6):
        case.change(case.small * k)
        solution = case.scene.solve(solution)
        again = case.scene.solve(without_kept(solution), max_iterations=0)
        np.testing.assert_array_equal(again.q, solution.q)
        # Pairs of contacts are found anew from where they are, to rounding.
        assert abs(again.feasibility - solution.feasibility) <= 1e-14 * case.scene.packed().scale


def test_a_row_that_begins_to_count_is_left_to_the_loop():
    ground, slide = asm.Body("ground", fixed=True), asm.Body("slide")
    guide = asm.Prismatic(ground.frame(), slide.frame(), "guide", limits=(-1.0, 1.0))
    scene = asm.Assembly([ground, slide])
    scene.constrain(guide)
    grip = asm.PointDistance(slide.point(0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    scene.minimize(grip)
    grip.target = (0.2, 0.0, 0.75)
    solution = scene.solve()
    by_chord = []
    for z in np.arange(0.85, 1.2, 0.1):
        grip.target = (0.2, 0.0, z)
        solution = scene.solve(solution)
        assert solution.success
        assert solution.values["guide.slide"] == pytest.approx(min(z, 1.0), abs=1e-10)
        by_chord.append(by_chords(solution))
    # Free, at its limit for the first time, and held there.
    assert by_chord == [True, True, False, True]


@pytest.mark.parametrize("turns", [1, 3, -2])
def test_angles_on_other_turns(turns):
    case = four_bar()
    solution = case.scene.solve()
    (hinge,) = [item for item in case.scene.constraints if isinstance(item, asm.Revolute) and item.angle is not None]
    hinge.angle = hinge.angle + 2.0 * np.pi * turns + 0.01
    after = case.scene.solve(solution)
    assert after.success
    assert after.values[f"{hinge.name}.angle"] == pytest.approx(hinge.angle, abs=1e-11)


def test_a_scene_whose_fixed_body_was_moved_is_evaluated_anew():
    case = wires()
    solution = case.scene.solve(case.scene.solve())
    fixed = next(body for body in case.scene.bodies if body.fixed)
    q = solution.q.copy()
    q[case.scene.bodies.index(fixed), 0] += 0.1
    after = case.scene.solve(q)
    assert after.success and after.q[case.scene.bodies.index(fixed), 0] == q[case.scene.bodies.index(fixed), 0]


def test_without_what_is_kept_the_same_pose_comes_to_the_tolerance():
    case = four_bar()
    solution = case.scene.solve()
    case.change(0.02)
    expected = case.scene.solve(solution)
    scene, copied = pickle.loads(pickle.dumps((case.scene, solution)))
    np.testing.assert_allclose(scene.solve(copied).q, expected.q, rtol=0, atol=1e-11)
    np.testing.assert_allclose(case.scene.solve(without_kept(solution)).q, expected.q, rtol=0, atol=1e-11)


def test_the_same_solution_gives_the_same_bits_whatever_was_solved_meanwhile():
    case = wires()
    solution = case.scene.solve()
    case.change(0.3)
    first = case.scene.solve(solution)
    case.change(5.0)
    case.scene.solve(first)
    case.change(0.3)
    again = case.scene.solve(solution)
    assert again.q.tobytes() == first.q.tobytes() and again.history.tobytes() == first.history.tobytes()


def test_threads_have_workspaces_of_their_own():
    cases = [four_bar() for _ in range(4)]
    expected = []

    def sweep(case):
        solution, poses = case.scene.solve(), []
        for k in range(40):
            case.change(0.01 * k)
            solution = case.scene.solve(solution)
            poses.append(solution.q)
        return np.array(poses)

    expected = sweep(four_bar())
    with ThreadPoolExecutor(4) as threads:
        for found in threads.map(sweep, cases):
            assert found.tobytes() == expected.tobytes()


def test_the_state_of_a_tick_has_no_place_for_it():
    scene = example("paper_clips").paper_clips()
    ((_, grip),) = scene.objectives
    follower = scene.tracker(grip.point, stiffness=2.0)
    step = follower.step(np.asarray(grip.target) + 0.01)
    packed = step.solution._packed
    assert step.solution._state.size == packed.kept_at
    assert step.solution.mobility.dof >= 0


def test_large_scenes_keep_no_factor():
    scene = linkages.parallelograms(12)
    solution = scene.solve()
    assert solution.success and 6 * (len(scene.bodies) - 1) > 60
    assert solution._state.size == solution._packed.kept_at
    assert scene.solve(solution).success


def test_a_tick_goes_on_by_chords():
    wired = scenes.linked_wires(1).scene
    blue = wired.bodies[-1]
    start = wired.solve().pose(blue).position
    plain, quick = (wired.tracker(blue.point(0.0, 0.0, 0.0), iterations=8) for _ in range(2))
    for k in range(30):
        target = start + 0.004 * k * np.array([1.0, 0.5, -0.3])
        plain._state[plain._packed.kept_at :] = 0.0
        slow, fast = plain.step(target), quick.step(target)
        assert fast.status is asm.TrackStatus.FOLLOWED
        assert fast.objective == pytest.approx(slow.objective, rel=1e-6, abs=1e-12)


def test_an_angle_at_its_pole_follows_its_drive():
    # Where the axes lie on each other an azimuth is what it is driven to, and no motion changes it.
    ground, body = asm.Body("ground", fixed=True), asm.Body("body")
    ball = asm.Spherical(ground.frame(), body.frame(), "ball", azimuth=0.3)
    scene = asm.Assembly([ground, body])
    scene.constrain(ball)
    solution = scene.solve()
    ball.azimuth = 0.35
    after = scene.solve(solution)
    assert after.success and after.iterations == 0 and not after.restarted
    np.testing.assert_array_equal(after.q, solution.q)
    assert after.values["ball.azimuth"] == ball.azimuth


def test_a_pair_that_is_started_elsewhere_is_evaluated_anew():
    ground = asm.Body("ground", asm.shapes.ellipsoid(1.0, 0.8, 0.7), fixed=True)
    body = asm.Body("body", asm.shapes.ellipsoid(2.0, 0.5, 0.4), position=(0.5, 0.2, 1.6))
    scene = asm.Assembly([ground, body])
    scene.constrain(asm.Contact(ground, body, name="touch"))
    solution = scene.solve()
    # Of the two ellipsoids another pair of parallel planes, which does not touch where the nearest one does.
    after = scene.solve(solution, starts={"touch": (5.4, 1.6, 1.9, 1.4)})
    assert after.success
    assert abs(after.contacts["touch"].gap) <= 2e-13 * scene.packed().scale


def test_bodies_that_are_gathered_stay_so():
    # The kept factor is of where the last solve ended: steps by it lead nowhere from here, and must not lead back.
    scene, hinge = linkages.four_bar()
    solution = scene.solve()
    hinge.angle = 2.0
    settings = scene._settings({}, CTRL_C, warm=True).copy()
    settings[GATHER] = GATHERS
    plain, quick = (scene._solved(settings, start, None, CTRL_C) for start in (without_kept(solution), solution))
    assert plain._state[scene.packed().results_at + SCATTER] == 1.0
    assert plain.success and quick.success
    np.testing.assert_array_equal(quick.history, plain.history)


def test_twins_work_in_the_memory_of_their_scene():
    # A fit makes a twin a solve; what twins work in is as large, and it takes long to tell how large that is.
    packed = four_bar().scene.packed()
    assert packed.twin().workspaces is packed.workspaces


def test_rows_of_another_pool_are_evaluated_anew():
    # In a twin expressions may have other weights, and what is off by them is another number.
    case = expression()
    packed = case.scene.packed()
    start = case.scene.solve(max_iterations=0)
    assert start.feasibility > 0.1
    twin = packed.twin()
    twin.pool[packed.table[packed.table[TAPE_TABLE] + place_of(TAPE_FIELDS, "unit")]] *= 2.0
    settings = case.scene._settings({"max_iterations": 0}, CTRL_C, warm=True)
    states = [solution._state.copy() for solution in (start, without_kept(start))]
    kept, anew = (go_on_once(CTRL_C, twin, settings, state).history[0, 1] for state in states)
    assert kept == anew != pytest.approx(start.history[0, 1])


def test_what_holds_is_not_moved_by_a_bit():
    # The multipliers are those of the last least move, and ask for more of it.
    case = four_bar()
    solution = case.scene.solve()
    case.change(0.1)
    solution = case.scene.solve(solution)
    assert solution.iterations > 0
    after = case.scene.solve(solution)
    assert after.success and after.iterations == 0
    assert after.q.tobytes() == solution.q.tobytes()


def test_no_chord_step_leads_through_a_wire():
    # Rings that are linked stay so, although a step over the wire would be at the target at once.
    ground = asm.Body("ground", asm.shapes.torus(1.0, 0.02), fixed=True)
    turn = asm.Pose.from_axis_angle((1, 0, 0), 1.5).quaternion
    ring = asm.Body("ring", asm.shapes.torus(1.0, 0.02), (1.9, 0.0, 0.0), turn)
    scene = asm.Assembly([ground, ring])
    scene.constrain(asm.Clearance())
    grip = asm.PointDistance(ring.point(0.0, 0.0, 0.0), (1.92, 0.0, 0.0))
    scene.minimize(grip, asm.Posture(scene.q, weight=0.1))
    first = scene.solve()
    grip.target = (2.2, 0.0, 0.0)
    touching = scene.solve(first)
    # The wires touch, two of their radii before 2. Where a clearance pushes, a factor is kept.
    assert touching.success and factor_of(touching) == EARLIER_FACTOR
    assert touching.pose(ring).position[0] == pytest.approx(1.96, abs=1e-9)
    # At the other side of its way the ring meets the wire opposite.
    grip.target = (-0.3, 0.0, 0.0)
    after = scene.solve(touching)
    assert after.success
    assert after.pose(ring).position[0] == pytest.approx(0.04, abs=1e-9)


@pytest.mark.parametrize("make", [wires, limited_arm])
def test_a_solve_without_a_step_returns_the_poses_it_began_with(make):
    case = make()
    solution = case.scene.solve()
    for k in range(1, 9):
        case.change(case.small * k)
        solution = case.scene.solve(solution)
        # Another solve in the same workspace.
        case.change(-case.small * k)
        case.scene.solve(solution)
        case.change(case.small * k)
        again = case.scene.solve(solution)
        assert again.iterations == 0
        assert again.q.tobytes() == solution.q.tobytes()
