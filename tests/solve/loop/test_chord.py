"""Solves and ticks that go on by the factor the last one left: `solve/loop/chord.py`, `constraints/program/kept.py`."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from functools import partial
from typing import NamedTuple

import casadi
import numpy as np
import pytest

import assembly as asm
from assembly._record import place_of
from assembly.constraints.program.kept import EARLIER_FACTOR, kept_header_at
from assembly.constraints.program.records import HEADER_RECORD, TAPE_FIELDS, TAPE_TABLE
from assembly.solve.attempts.attempts import go_on_once
from assembly.solve.interruption import CTRL_C
from assembly.solve.loop.parameters import CHORD_SHIFT
from assembly.solve.loop.settings import GATHER, GATHERS, SCATTER
from assembly.solve.result import Ended
from benchmarks import linkages, scenes
from benchmarks.running import example


class Case(NamedTuple):
    """A scene, and what changes one of its values or targets; how far a change by one goes."""

    scene: asm.Assembly
    change: Callable[[float], None]
    small: float


def _drive(joint, start, value):
    joint.angle = start + value


def _draw(grip, start, way, value):
    grip.target = np.asarray(start) + value * np.asarray(way)


def four_bar():
    scene, hinge = linkages.four_bar()
    return Case(scene, partial(_drive, hinge, 0.0), 0.01)


def wires():
    scene = example("paper_clips").paper_clips()
    ((_, grip),) = scene.objectives
    return Case(scene, partial(_draw, grip, grip.target, (1.0, -0.7, 0.4)), 0.05)


def gears():
    scene, crank, _ = example("gear_train").gear_train()
    return Case(scene, partial(_drive, crank, 0.0), 0.01)


def limited_arm():
    scene, tip, hinges = linkages.arm(4, seed=3)
    for hinge in hinges:
        hinge.angle = None
    # The first one ends at its limit, and stays there.
    hinges[0].limits = (-0.1, 0.1)
    grip = asm.PointDistance(tip, (1.0, 9.0, 0.4))
    scene.minimize(grip)
    return Case(scene, partial(_draw, grip, grip.target, (0.3, 0.1, -0.2)), 0.05)


def expression():
    x = casadi.SX.sym("q", 7)
    ball = asm.Body("ball", position=(0.3, 0.2, 2.0))
    round_ = casadi.Function("round", [x], [casadi.sumsqr(x[:3]) - 4.0 + 0.3 * casadi.sin(x[0])])
    scene = asm.Assembly([ball])
    scene.constrain(asm.Expression(round_, [ball], name="egg"))
    grip = asm.PointDistance(ball.point(0.0, 0.0, 0.0), (0.5, 0.4, 3.0))
    scene.minimize(grip, asm.Posture(weight=0.1))
    return Case(scene, partial(_draw, grip, grip.target, (0.3, 0.1, 0.2)), 0.02)


CASES = [four_bar, wires, gears, limited_arm, expression]


def _without(solution):
    """The same solution without what is kept with it."""
    other = deepcopy(solution)
    # The copy has a packed scene of its own: it is put beside the one of the scene again.
    other._ended, other._scene = Ended(solution._packed, solution._state.copy()), solution._scene
    other._state[solution._packed.kept_at :] = 0.0
    return other


def _by_chords(solution):
    """Whether the steps of a solution were by a factor that was kept."""
    return solution.iterations > 0 and solution.history[0, 4] == CHORD_SHIFT


def _factor(solution):
    """Which factor is kept with a solution."""
    return kept_header_at(solution._state, solution._packed.kept_at).factor


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
        plain = case.scene.solve(_without(solution))
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
        assert _factor(solution) == EARLIER_FACTOR
        case.change(0.2 * case.small * k)
        solution = case.scene.solve(solution)
        assert solution.success
        taken += _by_chords(solution)
    assert taken >= 18


@pytest.mark.parametrize("make", CASES)
def test_what_is_returned_holds_to_what_it_says(make):
    # By rows that are evaluated anew, at the poses as they are told.
    case = make()
    solution = case.scene.solve()
    for k in range(1, 6):
        case.change(case.small * k)
        solution = case.scene.solve(solution)
        again = case.scene.solve(_without(solution), max_iterations=0)
        np.testing.assert_array_equal(again.q, solution.q)
        # Pairs of contacts are found anew from where they are, to rounding.
        assert abs(again.feasibility - solution.feasibility) <= 1e-14 * case.scene.packed().scale


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
        assert solution.success and _by_chords(solution)
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
        assert after.success and _by_chords(after)
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
        assert solution.success and _by_chords(solution)
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


def test_a_row_that_begins_to_count_is_left_to_the_loop():
    ground, slide = asm.Body("ground", fixed=True), asm.Body("slide")
    guide = asm.Prismatic(ground.frame(), slide.frame(), "guide", limits=(-1.0, 1.0))
    scene = asm.Assembly([ground, slide])
    scene.constrain(guide)
    grip = asm.PointDistance(slide.point(0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    scene.minimize(grip)
    grip.target = (0.2, 0.0, 0.75)
    solution = scene.solve()
    by_chords = []
    for z in np.arange(0.85, 1.2, 0.1):
        grip.target = (0.2, 0.0, z)
        solution = scene.solve(solution)
        assert solution.success
        assert solution.values["guide.slide"] == pytest.approx(min(z, 1.0), abs=1e-10)
        by_chords.append(_by_chords(solution))
    # Free, at its limit for the first time, and held there.
    assert by_chords == [True, True, False, True]


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
    np.testing.assert_allclose(case.scene.solve(_without(solution)).q, expected.q, rtol=0, atol=1e-11)


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
    plain, quick = (scene._solved(settings, start, None, CTRL_C) for start in (_without(solution), solution))
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
    states = [solution._state.copy() for solution in (start, _without(start))]
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
    assert touching.success and _factor(touching) == EARLIER_FACTOR
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
