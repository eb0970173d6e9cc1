"""Scenes with closed forms: balls, planes and tori, and what must not change their answers."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import numpy as np
import pytest

import assembly as asm

RNG = np.random.default_rng(3)
# Balls are turned so that no contact falls on a pole of the surface, unless a test is about poles.
TURNED = np.array([0.8, 0.4, -0.4, 0.2])
TURNED = TURNED / np.linalg.norm(TURNED)
AS_MADE_AND_TURNED = pytest.mark.parametrize("quaternion", [(1.0, 0.0, 0.0, 0.0), TURNED], ids=["as made", "turned"])


def unit(v):
    return np.asarray(v, float) / np.linalg.norm(v)


def ball(name, radius, position=(0.0, 0.0, 0.0), fixed=False, quaternion=TURNED):
    return asm.Body(name, asm.shapes.sphere(radius), position, quaternion, fixed)


def scene_of(bodies, *contacts, unilateral=False):
    scene = asm.Assembly(bodies)
    scene.constrain(*(asm.Contact(scene.body(a), scene.body(b), unilateral=unilateral) for a, b in contacts))
    return scene


def solved(scene, *arguments, **options):
    solution = scene.solve(*arguments, **options)
    assert solution.success and solution.status is asm.Status.SOLVED, solution
    return solution


# Closed forms. Constraints hold to 1e-12 of the size, and sizes are up to 16; where the objective decides, a
# gradient of 1e-10 of the size over curvatures of two or so leaves errors below 1e-9.


@pytest.mark.parametrize("seed", range(12))
def test_two_balls_the_least_move_is_along_the_line_of_centers(seed):
    rng = np.random.default_rng(seed)
    r, s = rng.uniform(0.3, 2.0, 2)
    towards = unit(rng.normal(size=3))
    center = rng.normal(size=3)
    # Half of the starts are apart and half of them overlap a little.
    start = center + (r + s + (0.7 if seed % 2 else -0.3 * min(r, s))) * towards
    fixed, moving = ball("fixed", r, center, fixed=True), ball("moving", s, start, quaternion=unit(rng.normal(size=4)))
    solution = solved(scene_of([fixed, moving], ("fixed", "moving")))
    reached = solution.q[1, :3]
    assert abs(np.linalg.norm(reached - center) - (r + s)) < 1e-12 * (2.0 * np.sqrt(3.0) * max(r, s))
    np.testing.assert_allclose(reached, center + (r + s) * towards, rtol=0, atol=1e-9)
    np.testing.assert_allclose(solution.q[1, 3:], moving.q[3:], rtol=0, atol=1e-9)
    assert solution.objective == pytest.approx(np.linalg.norm(reached - start) ** 2, rel=1e-9, abs=1e-12)
    np.testing.assert_array_equal(solution.q[0], fixed.q)


@pytest.mark.parametrize("direction", [*np.eye(3), *-np.eye(3)])
@pytest.mark.parametrize("distance", [2.4, 1.4])
def test_two_balls_that_stand_as_they_were_made(direction, distance):
    # No turn, and centers along an axis: the contact is on seams and on poles of both surfaces.
    one = ball("one", 1.0, fixed=True, quaternion=(1, 0, 0, 0))
    two = ball("two", 0.5, distance * direction, quaternion=(1, 0, 0, 0))
    solution = solved(scene_of([one, two], ("one", "two")))
    np.testing.assert_allclose(solution.q[1, :3], 1.5 * direction, rtol=0, atol=1e-9)


def test_two_balls_that_both_move_share_the_way():
    one, two = ball("one", 1.0), ball("two", 0.5, (2.0, 2.0, 1.0))
    solution = solved(scene_of([one, two], ("one", "two")))
    # Centers 3 apart must be 1.5 apart: each moves half of 1.5.
    towards = unit([2.0, 2.0, 1.0])
    np.testing.assert_allclose(solution.q[0, :3], 0.75 * towards, rtol=0, atol=1e-9)
    np.testing.assert_allclose(solution.q[1, :3], 2.25 * towards, rtol=0, atol=1e-9)
    assert solution.objective == pytest.approx(2 * 0.75**2, rel=1e-9)


PLANE = asm.shapes.plane(10.0, 10.0)


@AS_MADE_AND_TURNED
@pytest.mark.parametrize("height", [3.0, 0.6, 0.3])
def test_a_ball_on_a_plane(height, quaternion):
    tilt = asm.Pose.from_axis_angle((1, 2, 3), 0.7, (1.0, 2.0, 3.0))
    floor = asm.Body("floor", PLANE, tilt.position, tilt.quaternion, fixed=True)
    start = asm.Pose((0.3, 2.1, height), quaternion)
    moving = asm.Body("ball", asm.shapes.sphere(0.5), (tilt @ start).position, (tilt @ start).quaternion)
    solution = solved(scene_of([floor, moving], ("floor", "ball")))
    # Straight down onto the plane, seen from it, and no turn.
    np.testing.assert_allclose(tilt.inverse().apply(solution.q[1, :3]), [0.3, 2.1, 0.5], rtol=0, atol=1e-9)
    assert abs(tilt.inverse().apply(solution.q[1, :3])[2] - 0.5) < 1e-12 * np.sqrt(200.0)
    np.testing.assert_allclose(solution.q[1, 3:], moving.q[3:], rtol=0, atol=1e-9)


def test_a_ball_in_a_corner_of_three_planes():
    turn_x = asm.Pose.from_axis_angle((0, 1, 0), np.pi / 2, (0, 5, 5))
    turn_y = asm.Pose.from_axis_angle((1, 0, 0), -np.pi / 2, (5, 0, 5))
    walls = [
        asm.Body("floor", PLANE, (5, 5, 0), fixed=True),
        asm.Body("wall x", PLANE, turn_x.position, turn_x.quaternion, fixed=True),
        asm.Body("wall y", PLANE, turn_y.position, turn_y.quaternion, fixed=True),
    ]
    scene = scene_of([*walls, ball("ball", 0.75, (2.0, 1.5, 1.2))], *((wall.name, "ball") for wall in walls))
    np.testing.assert_allclose(solved(scene).q[3, :3], [0.75] * 3, rtol=0, atol=1e-11)


@AS_MADE_AND_TURNED
@pytest.mark.parametrize("start", [(1.5, 1.0, 0.4), (1.8, 0.7, 0.4)])
def test_a_ball_on_two_balls_goes_to_the_circle_it_can_reach(start, quaternion):
    bodies = [
        ball("left", 1.0, fixed=True, quaternion=quaternion),
        ball("right", 1.0, (2.6, 0.0, 0.0), fixed=True, quaternion=quaternion),
        ball("top", 0.5, start, quaternion=quaternion),
    ]
    solution = solved(scene_of(bodies, ("left", "top"), ("right", "top")))
    # The circle x = 1.3 of radius sqrt(1.5^2 - 1.3^2); the least move to it is radial.
    across = np.sqrt(1.5**2 - 1.3**2) * unit(start[1:])
    np.testing.assert_allclose(solution.q[2, :3], [1.3, *across], rtol=0, atol=1e-9)


def test_a_ball_on_three_balls_has_one_place():
    centers = np.array([[0.0, 0.0, 0.0], [2.2, 0.1, 0.0], [1.0, 1.9, 0.2]])
    radii = np.array([1.0, 1.1, 0.9])
    bodies = [ball(f"b{k}", radii[k], centers[k], fixed=True) for k in range(3)]
    bodies.append(ball("top", 0.6, (1.1, 0.8, 1.5)))
    solution = solved(scene_of(bodies, *((f"b{k}", "top") for k in range(3))))
    distances = np.linalg.norm(solution.q[3, :3] - centers, axis=1)
    # 1e-12 of the largest ball's box.
    np.testing.assert_allclose(distances, radii + 0.6, rtol=0, atol=4e-12)
    assert solution.q[3, 2] > 0.5


def test_a_ball_on_a_torus():
    ring = asm.Body("ring", asm.shapes.torus(3.0, 1.0), fixed=True)
    start = np.array([2.4, 2.9, 1.6])
    solution = solved(scene_of([ring, ball("ball", 0.5, start)], ("ring", "ball")))
    # The center goes straight to its distance from the ring's center line.
    core = 3.0 * unit([2.4, 2.9, 0.0])
    np.testing.assert_allclose(solution.q[1, :3], core + 1.5 * unit(start - core), rtol=0, atol=1e-9)


def test_a_ball_in_a_hole():
    # A reversed face is seen from inside: the ball lies in the socket.
    socket = asm.Body("socket", asm.Face(asm.shapes.sphere(2.0), reversed=True), quaternion=TURNED, fixed=True)
    start = np.array([0.5, 0.4, -0.8])
    solution = solved(scene_of([socket, ball("ball", 0.75, start)], ("socket", "ball")))
    np.testing.assert_allclose(solution.q[1, :3], 1.25 * unit(start), rtol=0, atol=1e-9)


# One-sided contacts.


def one_sided(start, target=None, weight=1.0, quaternion=TURNED):
    bodies = [ball("one", 1.0, fixed=True, quaternion=quaternion), ball("two", 0.5, start, quaternion=quaternion)]
    scene = scene_of(bodies, ("one", "two"), unilateral=True)
    if target is not None:
        scene.minimize(asm.PointDistance(scene.body("two").point(0, 0, 0), target, weight))
    return scene


def test_one_sided_contacts_pull_nothing():
    solution = solved(one_sided((2.0, 1.0, 0.5)))
    np.testing.assert_allclose(solution.q[1, :3], [2.0, 1.0, 0.5], rtol=0, atol=1e-9)
    assert solution.objective == pytest.approx(0.0, abs=1e-15)
    assert solution.multipliers["one-two"] == pytest.approx(0.0, abs=1e-9)
    assert solution.violations["one-two"] == 0.0


@AS_MADE_AND_TURNED
@pytest.mark.parametrize("start", [(0.7, 0.6, 0.8), (1.2, 0.2, 0.1)])
def test_one_sided_contacts_push_out(start, quaternion):
    solution = solved(one_sided(start, quaternion=quaternion))
    np.testing.assert_allclose(solution.q[1, :3], 1.5 * unit(start), rtol=0, atol=1e-9)


@pytest.mark.parametrize("weight", [1.0, 1e-3, 1e3])
def test_one_sided_contacts_hold_what_is_drawn_into_them(weight):
    # The target is a fifth off the center line, so the ball rolls to the point nearest to it.
    target = np.array([0.6, 0.5, 0.3])
    solution = solved(one_sided((2.0, 0.3, 0.2), target, weight))
    np.testing.assert_allclose(solution.q[1, :3], 1.5 * unit(target), rtol=0, atol=1e-9)
    depth = 1.5 - np.linalg.norm(target)
    assert solution.objective == pytest.approx(weight * depth**2, rel=1e-9)
    # Of L = f + y gap: the slope of f along the normal is 2 weight depth.
    assert solution.multipliers["one-two"] == pytest.approx(-2.0 * weight * depth, rel=1e-8)


@AS_MADE_AND_TURNED
def test_one_sided_contacts_hold_what_starts_inside_and_is_drawn_inside(quaternion):
    target = np.array([0.2, 0.1, 0.3])
    solution = solved(one_sided((1.2, 0.2, 0.1), target, quaternion=quaternion))
    np.testing.assert_allclose(solution.q[1, :3], 1.5 * unit(target), rtol=0, atol=1e-9)


def test_one_sided_contacts_let_go():
    solution = solved(one_sided((1.5, 0.0, 0.0), (1.4, 2.0, -1.0)))
    np.testing.assert_allclose(solution.q[1, :3], [1.4, 2.0, -1.0], rtol=0, atol=1e-9)
    assert solution.multipliers["one-two"] == pytest.approx(0.0, abs=1e-9)


# Objectives.


def test_terms_add_up_with_their_weights_and_signs():
    body = asm.Body("free")
    scene = asm.Assembly([body])
    here, there = (3.0, 0.0, 0.0), (0.0, 1.0, 2.0)
    scene.minimize(asm.PointDistance(body.point(0, 0, 0), here, 2.0), asm.PointDistance(body.point(0, 0, 0), there))
    # Where 2 |x - a|^2 + |x - b|^2 is least.
    solution = solved(scene)
    np.testing.assert_allclose(solution.q[0, :3], [2.0, 1.0 / 3.0, 2.0 / 3.0], rtol=0, atol=1e-9)
    assert solution.objective == pytest.approx(2.0 / 3.0 * 14.0, rel=1e-12)
    scene.maximize(asm.PointDistance(body.point(0, 0, 0), here))
    solution = solved(scene)
    np.testing.assert_allclose(solution.q[0, :3], [1.5, 0.5, 1.0], rtol=0, atol=1e-9)


def test_what_is_maximized_counts_negative():
    scene = scene_of([ball("one", 1.0, fixed=True), ball("two", 0.5, (1.2, 0.7, 0.6))], ("one", "two"))
    target = np.array([-2.0, 0.5, 0.5])
    scene.maximize(asm.PointDistance(scene.body("two").point(0, 0, 0), target))
    solution = solved(scene)
    np.testing.assert_allclose(solution.q[1, :3], -1.5 * unit(target), rtol=0, atol=1e-9)
    assert solution.objective == pytest.approx(-((1.5 + np.linalg.norm(target)) ** 2), rel=1e-9)


def test_a_posture_without_contacts_goes_back_to_its_reference():
    body = asm.Body("free", asm.shapes.sphere(1.0), (1, 2, 3))
    scene = asm.Assembly([body])
    reference = np.array([[0.5, 2.5, 3.0, *unit([0.9, 0.1, -0.3, 0.2])]])
    scene.minimize(asm.Posture(reference, weight=3.0))
    solution = solved(scene)
    np.testing.assert_allclose(solution.q, reference, rtol=0, atol=1e-9)
    assert solution.objective == pytest.approx(0.0, abs=1e-15)


def test_posture_weighs_turns_with_half_the_size():
    # One point of a body is drawn: with |x|^2 + 4 s^2 sin^2(angle / 2) at the start itself the value is known.
    body = asm.Body("free", asm.shapes.sphere(1.0), quaternion=asm.Pose.from_axis_angle((0, 0, 1), 0.8).quaternion)
    scene = asm.Assembly([body])
    scene.minimize(asm.Posture([[3.0, 4.0, 0.0, 1.0, 0.0, 0.0, 0.0]], weight=2.0))
    solution = scene.solve(max_iterations=0)
    half = 0.5 * np.sqrt(12.0)
    assert solution.objective == pytest.approx(2.0 * (25.0 + half**2 * 4.0 * np.sin(0.4) ** 2), rel=1e-14)
    assert solution.status is asm.Status.ITERATION_LIMIT and not solution.success


# A scene without closed form: rings that touch and one that reaches for a place.

SIZES = {"base": (3.0, 0.5), "first": (2.5, 0.4), "second": (3.5, 0.6)}
TARGET = np.array([2.0, 6.0, 1.0])
STARTS = np.array(
    [
        [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
        [6.0, 0.3, 0.2, *unit([0.98, 0.17, 0.1, 0.05])],
        [3.1, 6.8, 0.4, *unit([0.97, -0.2, 0.1, 0.1])],
    ]
)


def rings(scale=1.0, offset=(0.0, 0.0, 0.0), sign=1.0, swap=False, starts=STARTS, target=TARGET, reference=None):
    offset = np.asarray(offset)
    bodies = [
        asm.Body(
            name,
            asm.shapes.torus(scale * major, scale * minor),
            scale * row[:3] + offset,
            sign * row[3:],
            fixed=name == "base",
        )
        for (name, (major, minor)), row in zip(SIZES.items(), starts, strict=True)
    ]
    scene = asm.Assembly(bodies)
    for a, b in (("base", "first"), ("base", "second"), ("first", "second")):
        sides = (scene.body(b), scene.body(a)) if swap else (scene.body(a), scene.body(b))
        scene.constrain(asm.Contact(*sides, name=f"{a}-{b}"))
    reach = asm.PointDistance(scene.body("second").point(0, 0, scale), scale * target + offset)
    # A little posture: without it a ring is free to turn about its axis.
    scene.minimize(reach, asm.Posture(reference, weight=0.1))
    return scene


@pytest.fixture(scope="module")
def reached():
    return solved(rings())


def test_rings_touch_where_their_contacts_say(reached):
    for pair in reached.contacts.values():
        # Found again from the pose alone; 1e-12 of the largest ring's box, which is 12 wide.
        assert abs(pair.gap) < 2e-11
        np.testing.assert_allclose(pair.points[0], pair.points[1], rtol=0, atol=1e-9)
    assert reached.feasibility < 2e-11
    assert max(reached.violations.values()) == pytest.approx(reached.feasibility, abs=1e-15)
    np.testing.assert_allclose(np.linalg.norm(reached.q[:, 3:], axis=1), 1.0, rtol=0, atol=1e-15)


def test_no_move_along_the_contacts_is_better(reached):
    # Poses beside the answer, put back onto the contacts: none of them has a smaller objective.
    scene = rings(reference=STARTS)
    best = solved(scene).objective
    assert best == pytest.approx(reached.objective, rel=1e-9)
    feasible = asm.Assembly(scene.bodies)
    feasible.constrain(*scene.constraints)
    for _ in range(5):
        beside = reached.q.copy()
        beside[1:, :3] += 0.02 * RNG.normal(size=(2, 3))
        q = solved(feasible, beside).q
        assert scene.solve(q, max_iterations=0).objective > best


@pytest.mark.parametrize("scale", [1e-3, 1e3, 1e6])
def test_units_do_not_matter(scale, reached):
    solution = solved(rings(scale))
    np.testing.assert_allclose(solution.q[:, :3] / scale, reached.q[:, :3], rtol=0, atol=1e-9)
    np.testing.assert_allclose(solution.q[:, 3:], reached.q[:, 3:], rtol=0, atol=1e-9)
    assert solution.objective == pytest.approx(reached.objective * scale**2, rel=1e-9)
    for name, multiplier in reached.multipliers.items():
        np.testing.assert_allclose(solution.multipliers[name], multiplier * scale, rtol=1e-7)


def test_a_far_offset_does_not_matter():
    offset = np.array([1e5, -1e5, 1e5])
    solution, reached = solved(rings(offset=offset), stationarity=1e-12), solved(rings(), stationarity=1e-12)
    # Coordinates of 1e5 are rounded to 1.5e-11.
    np.testing.assert_allclose(solution.q[:, :3] - offset, reached.q[:, :3], rtol=0, atol=1e-9)
    np.testing.assert_allclose(solution.q[:, 3:], reached.q[:, 3:], rtol=0, atol=1e-9)


def test_the_sign_of_a_quaternion_does_not_matter(reached):
    solution = solved(rings(sign=-1.0))
    np.testing.assert_allclose(solution.q[:, :3], reached.q[:, :3], rtol=0, atol=1e-9)
    np.testing.assert_allclose(solution.q[:, 3:], -reached.q[:, 3:], rtol=0, atol=1e-9)


def test_the_order_of_a_contact_s_sides_does_not_matter():
    # Another way to the same end: a gradient of 1e-12 over the posture's curvature of 0.2, times a size of ten.
    solution, reached = solved(rings(swap=True), stationarity=1e-12), solved(rings(), stationarity=1e-12)
    np.testing.assert_allclose(solution.q, reached.q, rtol=0, atol=1e-9)
    for name, pair in reached.contacts.items():
        np.testing.assert_allclose(solution.contacts[name].normal, -pair.normal, rtol=0, atol=1e-8)
        np.testing.assert_allclose(solution.multipliers[name], reached.multipliers[name], rtol=1e-7)


# Solving again.


def test_the_same_input_gives_the_same_bits(reached):
    scene = rings()
    for solution in (scene.solve(), scene.solve(), rings().solve()):
        np.testing.assert_array_equal(solution.q, reached.q)
        np.testing.assert_array_equal(solution.history, reached.history)
        assert solution.iterations == reached.iterations


@pytest.mark.parametrize("shared", [True, False], ids=["one scene", "two scenes"])
def test_two_threads_at_once_get_the_same_bits(shared, reached):
    scene = rings()
    scenes = [scene, scene] if shared else [scene, rings()]
    barrier = Barrier(2)

    def work(which):
        barrier.wait()
        return [scenes[which].solve() for _ in range(50)]

    with ThreadPoolExecutor(2) as pool:
        for solutions in pool.map(work, (0, 1)):
            for solution in solutions:
                np.testing.assert_array_equal(solution.q, reached.q)


def test_a_solve_moves_no_body():
    scene = rings()
    before = scene.q
    solution = solved(scene)
    np.testing.assert_array_equal(scene.q, before)
    assert np.abs(solution.q - before).max() > 0.1
    pose = solution.pose("first")
    np.testing.assert_allclose(pose.q, solution.q[1], rtol=0, atol=1e-15)
    assert solution.pose(scene.body("first")).q.tolist() == pose.q.tolist()


def test_earlier_solutions_stay_as_they_are():
    scene = rings()
    first = scene.solve()
    q, multipliers = first.q.copy(), {name: y.copy() for name, y in first.multipliers.items()}
    scene.objectives[0][1].target = (3.0, 5.0, 0.0)
    scene.solve(first)
    np.testing.assert_array_equal(first.q, q)
    for name, y in first.multipliers.items():
        np.testing.assert_array_equal(y, multipliers[name])


def test_a_moved_target_is_a_new_scene():
    scene = rings()
    scene.solve()
    for target in ((2.5, 5.5, 0.5), (1.0, 6.5, 1.5)):
        scene.objectives[0][1].target = target
        solution = solved(scene)
        np.testing.assert_array_equal(solution.q, rings(target=np.array(target)).solve().q)


def test_moved_bodies_are_a_new_start():
    scene = rings()
    scene.solve()
    moved = STARTS.copy()
    moved[1, :3] += [0.1, -0.2, 0.1]
    for body, row in zip(scene.bodies, moved, strict=True):
        body.pose = asm.Pose(row[:3], row[3:])
    np.testing.assert_allclose(solved(scene).q, solved(rings(starts=moved)).q, rtol=0, atol=1e-12)
    # And the same as rows.
    np.testing.assert_allclose(solved(rings(), moved).q, solved(rings(starts=moved)).q, rtol=0, atol=1e-12)


def test_a_solution_is_the_warmest_start():
    scene = rings(reference=STARTS)  # a fixed reference, so that the start is no part of the question
    cold = solved(scene)
    warm = solved(scene, cold)
    assert warm.iterations <= 1 < cold.iterations
    np.testing.assert_allclose(warm.q[:, :3], cold.q[:, :3], rtol=0, atol=1e-9)


def test_warm_starts_follow_a_target():
    scene = scene_of([ball("one", 1.0, fixed=True), ball("two", 0.5, (2.0, 0.3, 0.2))], ("one", "two"))
    reach = asm.PointDistance(scene.body("two").point(0, 0, 0), (3.0, 0.0, 0.0))
    scene.minimize(reach)
    solution = solved(scene)
    for angle in np.linspace(0.0, 3.0, 16):
        direction = np.array([np.cos(angle), np.sin(angle), 0.3 * np.sin(2.0 * angle)])
        reach.target = 3.0 * direction
        solution = solved(scene, solution)
        np.testing.assert_allclose(solution.q[1, :3], 1.5 * unit(direction), rtol=0, atol=1e-9)


def test_q0_rows_are_where_it_starts():
    scene = scene_of([ball("one", 1.0, fixed=True), ball("two", 0.5, (2.0, 0.3, 0.2))], ("one", "two"))
    start = np.array([-1.0, 2.0, -0.5])
    solution = solved(scene, [scene.q[0], [*start, *TURNED]])
    np.testing.assert_allclose(solution.q[1, :3], 1.5 * unit(start), rtol=0, atol=1e-9)


def test_starts_choose_the_pair():
    # Inside a socket the far wall is an extremal pair as good as the near one.
    socket = asm.Body("socket", asm.Face(asm.shapes.sphere(2.0), reversed=True), quaternion=TURNED, fixed=True)
    scene = scene_of([socket, ball("ball", 0.75, (0.6, 0.3, -0.2))], ("socket", "ball"))
    near = solved(scene)
    again = solved(scene, starts={"socket-ball": near.contacts["socket-ball"].parameters})
    np.testing.assert_allclose(again.q, near.q, rtol=0, atol=1e-9)


# What cannot be.


def test_a_ball_that_cannot_reach_two_others_is_infeasible():
    bodies = [
        ball("left", 1.0, fixed=True),
        ball("right", 1.0, (5.0, 0.0, 0.0), fixed=True),
        ball("between", 0.5, (2.4, 0.3, 0.4)),
    ]
    solution = scene_of(bodies, ("left", "between"), ("right", "between")).solve()
    assert solution.status is asm.Status.INFEASIBLE and not solution.success
    assert "'left-between' (1)" in solution.message and "'right-between' (1)" in solution.message
    # The least violation is halfway, with a gap of 1 on either side.
    np.testing.assert_allclose(solution.q[2, :3], [2.5, 0.0, 0.0], rtol=0, atol=1e-6)
    left, right = (pair.gap for pair in solution.contacts.values())
    assert left == pytest.approx(right, abs=1e-6)
    assert solution.violations == pytest.approx({"left-between": 1.0, "right-between": 1.0}, abs=1e-6)


def test_a_ball_squeezed_from_two_sides_is_infeasible():
    bodies = [
        ball("left", 1.0, fixed=True),
        ball("right", 1.0, (0.0, 2.6, 0.0), fixed=True),
        ball("left wall", 1.0, (2.2, 1.3, 0.0), fixed=True),
        ball("right wall", 1.0, (-2.2, 1.3, 0.0), fixed=True),
        ball("between", 0.5, (0.1, 1.3, 0.6)),
    ]
    names = [body.name for body in bodies[:4]]
    solution = scene_of(bodies, *((name, "between") for name in names)).solve()
    assert solution.status is asm.Status.INFEASIBLE
    assert all(repr(f"{name}-between") in solution.message for name in names)


def test_contacts_that_say_the_same_twice_are_no_contradiction():
    one, two = ball("one", 1.0, fixed=True), ball("two", 0.5, (1.4, 1.0, 0.3))
    scene = asm.Assembly([one, two])
    scene.constrain(*(asm.Contact(one, two, name=name) for name in ("this", "same", "again")))
    solution = solved(scene)
    np.testing.assert_allclose(solution.q[1, :3], 1.5 * unit([1.4, 1.0, 0.3]), rtol=0, atol=1e-9)


def test_out_of_iterations_is_said():
    solution = rings().solve(max_iterations=1)
    assert solution.status is asm.Status.ITERATION_LIMIT and not solution.success and solution.iterations == 1
    assert "raise max_iterations" in solution.message and "-second'" in solution.message
    assert solution.history.shape == (2, 7) and np.isfinite(solution.history[:, :4]).all()


def test_an_unsolved_result_holds_no_garbage():
    # A plate far beside the ball: no normal of the one meets the other, and 3 steps are not enough to get there.
    plate = asm.Body("plate", PLANE, (100.0, 0.0, 0.0), fixed=True)
    solution = scene_of([plate, ball("ball", 0.5, (0.0, 0.0, 3.0))], ("plate", "ball")).solve(max_iterations=3)
    assert not solution.success
    np.testing.assert_array_equal(solution.q[0], plate.q)
    assert np.isfinite(solution.q).all()
    # One and the same figure, known or not: never what was in memory by chance.
    assert solution.violations["plate-ball"] == pytest.approx(solution.feasibility, nan_ok=True)
    assert not solution.feasibility < 1.0
    assert "'plate-ball'" in solution.message
    assert "plate-ball" in str(solution)


def test_results_print_what_a_user_asks_first(reached):
    text = str(reached)
    assert text.startswith("SOLVED: every constraint holds") and "fixed" in text and "first-second" in text
    assert repr(reached).startswith("Solution(SOLVED, ")


def test_q_is_where_bodies_stand_now_and_cannot_be_written_to():
    scene = asm.Assembly([asm.Body("a", asm.shapes.sphere(1.0)), asm.Body("b", asm.shapes.sphere(1.0), (3, 0, 0))])
    q = scene.q
    with pytest.raises(ValueError, match="read-only"):
        q[:] = 7.0
    assert scene.q.tolist() == [[0, 0, 0, 1, 0, 0, 0], [3, 0, 0, 1, 0, 0, 0]]
    scene.body("b").pose = asm.Pose((0, 4, 0))
    assert scene.q[1].tolist() == [0, 4, 0, 1, 0, 0, 0]
    # What was given before stays as it was.
    assert q[1].tolist() == [3, 0, 0, 1, 0, 0, 0]
    scene.add(asm.Body("c", asm.shapes.sphere(1.0), (0, 0, 5)))
    assert scene.q.shape == (3, 7) and scene.q[2, 2] == 5.0
