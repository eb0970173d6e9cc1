"""Threads that solve one scene take turns: every solve is measured from its own start, to the bit."""

from __future__ import annotations

import copy
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import assembly as asm

RNG = np.random.default_rng(11)
STARTS = 24


def ball_on_a_plane(asks_for_posture):
    """Whose least move is straight down from wherever it starts, so that a start of another solve would show."""
    floor = asm.Body("floor", asm.shapes.plane(20.0, 20.0), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(0.5), position=(0.0, 0.0, 1.0))
    scene = asm.Assembly([floor, ball])
    scene.constrain(asm.Contact(floor, ball))
    if asks_for_posture:
        scene.minimize(asm.Posture())
    return scene


def starts_of(scene):
    for _ in range(STARTS):
        q = scene.q.copy()
        q[1, :3] = RNG.uniform((-5.0, -5.0, 0.4), (5.0, 5.0, 3.0))
        yield q


def in_two_threads(work, items):
    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(work, items))


@pytest.mark.parametrize("asks_for_posture", [False, True], ids=["least move", "posture"])
def test_each_solve_is_measured_from_its_own_start(asks_for_posture):
    scene = ball_on_a_plane(asks_for_posture)
    starts = list(starts_of(scene))
    alone = [scene.solve(q) for q in starts]
    together = in_two_threads(scene.solve, starts * 4)
    for k, solution in enumerate(together):
        here = alone[k % STARTS]
        assert solution.success and (solution.q == here.q).all()
        assert solution.objective == here.objective
    # The least move of a ball is straight down: what the law above compares depends on the start.
    assert np.abs(alone[0].q[1, :2] - starts[0][1, :2]).max() < 1e-9
    assert np.abs(alone[0].q[1, :2] - alone[1].q[1, :2]).max() > 1e-3


def test_warm_solves_of_two_threads_are_those_of_one():
    scene = ball_on_a_plane(False)
    begun = [scene.solve(q) for q in starts_of(scene)]
    alone = [scene.solve(solution).q for solution in begun]
    assert all(
        (q == alone[k % STARTS]).all() for k, q in enumerate(in_two_threads(lambda s: scene.solve(s).q, begun * 4))
    )


def test_copies_have_turns_of_their_own():
    scene = ball_on_a_plane(False)
    others = [copy.copy(scene), copy.deepcopy(scene), pickle.loads(pickle.dumps(scene))]
    with scene._turn.lock:
        # A copy that shared the lock would wait for this thread, which waits for the copy.
        for other in others:
            with ThreadPoolExecutor(1) as pool:
                assert pool.submit(other.solve).result(timeout=60.0).success


def test_an_earlier_solution_is_measured_from_its_own_start():
    floor = asm.Body("floor", asm.shapes.plane(20.0, 20.0), fixed=True)
    ball = asm.Body("ball", asm.shapes.ellipsoid(0.5, 0.7, 0.9), position=(0.0, 0.0, 2.0))
    scene = asm.Assembly([floor, ball])
    scene.constrain(asm.Contact(floor, ball, minimum=0.1))
    scene.minimize(asm.Posture())
    gap, height = asm.Parameter(scene.constraints[0], "minimum"), asm.Measure(ball.point(0.1, 0.2, 0.0), "z")

    def told(solution):
        return asm.sensitivity(scene, solution, [height], [gap]).matrix

    near, far = scene.q.copy(), scene.q.copy()
    near[1, 3:] = np.array([0.9, 0.3, -0.2, 0.1]) / np.linalg.norm([0.9, 0.3, -0.2, 0.1])
    far[1] = [4.0, 3.0, 5.0, *np.array([0.1, 0.5, 0.7, -0.4]) / np.linalg.norm([0.1, 0.5, 0.7, -0.4])]
    expected = told(scene.solve(near))
    earlier = scene.solve(near)
    later = scene.solve(far)
    assert earlier.second_order is asm.SecondOrder.MINIMUM
    np.testing.assert_array_equal(told(earlier), expected)
    assert np.abs(told(later) - expected).max() > 1e-3


@pytest.mark.parametrize("asks_for_posture", [False, True], ids=["least move", "posture"])
def test_solves_beside_one_from_all_starts_are_measured_from_their_own(asks_for_posture):
    scene = ball_on_a_plane(asks_for_posture)
    starts = list(starts_of(scene))
    alone = [scene.solve(q).q for q in starts]
    ends = [solution.q for solution in scene.solve_all(starts=4)]
    with ThreadPoolExecutor(1) as pool:
        searches = [pool.submit(scene.solve_all, starts=4) for _ in range(4)]
        beside = [scene.solve(q).q for q in starts * 2]
    assert all((q == alone[k % STARTS]).all() for k, q in enumerate(beside))
    for search in searches:
        np.testing.assert_array_equal([solution.q for solution in search.result()], ends)


def test_a_solve_within_one_from_all_starts_is_measured_from_its_own():
    scene = ball_on_a_plane(False)
    start = next(starts_of(scene))
    alone, found = scene.solve(start).q, []
    ends = [solution.q for solution in scene.solve_all(starts=4)]
    again = scene.solve_all(starts=4, progress=lambda *_: found.append(scene.solve(start)))
    assert len(found) > 1 and all((solution.q == alone).all() for solution in found)
    np.testing.assert_array_equal([solution.q for solution in again], ends)
    # It is a solution of this scene like any other.
    assert scene.solve(found[0]).success and scene.mobility(found[0]).dof == scene.mobility(scene.solve(start)).dof


def test_a_callback_that_solves_the_scene_from_elsewhere_changes_nothing():
    """The objective is measured from where the solve begins, which the solve in the callback does elsewhere."""
    links = 400
    bodies = [asm.Body("ground", fixed=True), *(asm.Body(f"link {k}", position=(k, 0, 0)) for k in range(links))]
    scene = asm.Assembly(bodies)
    for k, (a, b) in enumerate(zip(bodies, bodies[1:], strict=False)):
        scene.constrain(asm.Revolute(a.frame(at=(float(k > 0), 0, 0)), b.frame(), f"hinge {k}"))
    drawn = asm.PointDistance(bodies[-1].point(1, 0, 0), target=(-0.3 * links, 0.5 * links, 0.0))
    scene.minimize(drawn, asm.Posture())
    alone, away, within = scene.solve(), np.array(scene.q), []
    away[1:, 1] += 40.0

    def solve_elsewhere(*_):
        if len(within) < 2:
            within.append(scene.solve(away, max_iterations=1))

    beside = scene.solve(callback=solve_elsewhere)
    assert within, "the solve was too short for a callback"
    np.testing.assert_array_equal(beside.q, alone.q)
    assert beside.objective == alone.objective and beside.iterations == alone.iterations
