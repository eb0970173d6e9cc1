"""SOLVED is a local minimum: saddles, maxima and kinks are left, and an end says what it is."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import assembly as asm
from assembly.solve.second_order import leave
from assembly.solve.second_order.dense import LocalModel
from tests.solve.lower_poses import Joint, lowest_neighbor, random_scene

MINIMUM, NOT_ISOLATED, UNDECIDED = asm.SecondOrder.MINIMUM, asm.SecondOrder.NOT_ISOLATED, asm.SecondOrder.UNDECIDED


def chain(count, axes=((0, 0, 1),), limits=None):
    """Unit links that are straight along x, and their scene."""
    ground = asm.Body("ground", fixed=True)
    links = [asm.Body(f"link {k}", position=(k, 0, 0)) for k in range(count)]
    scene = asm.Assembly([ground, *links])
    for k, link in enumerate(links):
        before = links[k - 1].frame(at=(1, 0, 0), z=axes[k % len(axes)]) if k else ground.frame(z=axes[0])
        settings = {} if limits is None else {"limits": limits}
        scene.constrain(asm.Revolute(before, link.frame(z=axes[k % len(axes)]), f"joint {k}", **settings))
    return scene, links


def drawn(count, target, **settings):
    """Such a chain whose end is drawn to a place, and what draws it."""
    scene, links = chain(count, **settings)
    goal = asm.PointDistance(links[-1].point(1, 0, 0), target)
    scene.minimize(goal)
    return scene, goal


def crank(term, limits=None, sign=1.0):
    """A crank along x with a term of the place y of its tip, its sine."""
    pose = ca.SX.sym("pose", 7)
    x = 1.0 - 2.0 * (pose[5] ** 2 + pose[6] ** 2)
    y = 2.0 * (pose[4] * pose[5] + pose[3] * pose[6])
    ground, body = asm.Body("ground", fixed=True), asm.Body("crank")
    scene = asm.Assembly([ground, body])
    scene.constrain(asm.Revolute(ground, body, "hinge", limits=limits))
    (scene.minimize if sign > 0.0 else scene.maximize)(asm.Expression(ca.Function("f", [pose], [term(x, y)]), [body]))
    return scene


@pytest.fixture
def judged(monkeypatch):
    """How many ends were judged, in a list of one number."""
    count = [0]

    def counting(*arguments):
        count[0] += 1
        return judge(*arguments)

    judge = leave.judge
    monkeypatch.setattr(leave, "judge", counting)
    return count


@pytest.mark.parametrize("seed", [0])
def test_no_end_has_a_lower_pose_beside_it(seed, cases):
    # Every tenth starts at a maximum or a saddle by symmetry. A SOLVED end is judged by a Newton of the tests' own.
    count = cases(60, 10_000)
    begun = failed = 0
    wrong = []
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        exact = k % 10 == 0
        scene, model = random_scene(rng, exact)
        begins = exact and model.violation(scene.q) < 1e-12
        solution = scene.solve()
        # Where two slides become parallel bodies go off for ever, to an objective that no pose has.
        begins = begins and (solution.success or np.abs(solution.q[:, :3]).max() < 50.0 * scene.packed().scale)
        begun += begins
        failed += begins and not solution.success
        if not solution.success:
            continue
        for row, constraint in zip(model.rows, scene.constraints, strict=True):
            if isinstance(row, Joint):
                row.near = solution.values.get(f"{constraint.name}.angle", 0.0)
        assert model.violation(solution.q) < 1e-9
        assert solution.objective == pytest.approx(float(model.value(solution.q)), rel=1e-9, abs=1e-9)
        lower = lowest_neighbor(model, solution.q, rng, 4)
        if lower > 1e-9 * (abs(solution.objective) + scene.packed().scale ** 2):
            wrong.append((k, solution.objective, lower, solution.second_order))
    assert wrong == []
    assert failed <= max(1, begun // 100)


@pytest.mark.parametrize("count", [1, 2, 3, 4, 6, 12])
def test_an_arm_that_points_away_from_its_target_turns_around(count):
    scene, _ = drawn(count, (-count - 2.0, 0.0, 0.0))
    solution = scene.solve()
    assert solution.success and solution.objective == pytest.approx(4.0, abs=1e-9)
    assert solution.history.shape == (solution.iterations + 1, 7)


@pytest.mark.parametrize("start", [0.0, np.pi])
def test_a_maximum_is_left_for_a_maximum_of_the_other_sense(start):
    ground, body = (
        asm.Body("ground", fixed=True),
        asm.Body("crank", quaternion=(np.cos(start / 2), 0, 0, np.sin(start / 2))),
    )
    scene = asm.Assembly([ground, body])
    scene.constrain(asm.Revolute(ground, body))
    scene.maximize(asm.PointDistance(body.point(1, 0, 0), (3.0, 0.0, 0.0)))
    solution = scene.solve()
    assert solution.success and solution.second_order is MINIMUM
    assert solution.objective == pytest.approx(-16.0, abs=1e-9)


def test_a_saddle_that_a_solve_comes_to_is_left():
    # The bodies are all at the origin: the rows of a straight arm are not held yet, and the way to them is along x.
    ground = asm.Body("ground", fixed=True)
    links = [asm.Body(f"link {k}") for k in range(3)]
    scene = asm.Assembly([ground, *links])
    for k, link in enumerate(links):
        before = links[k - 1].frame(at=(1, 0, 0)) if k else ground.frame()
        scene.constrain(asm.Revolute(before, link, f"joint {k}"))
    scene.minimize(asm.PointDistance(links[-1].point(1, 0, 0), (-1.5, 0.0, 0.0)))
    solution = scene.solve()
    assert solution.success and solution.objective < 1e-18


@pytest.mark.parametrize(("target", "best"), [((5.0, 0, 0), 9.0), ((0.5, 0, 0), 0.25), ((-3.0, 0, 0), 9.0)])
def test_a_closed_loop_that_is_stretched_moves_the_way_that_exists(target, best):
    # A rhomb folded onto a line: its motions to first order are more than there are, and rows depend on each other. The
    # end goes around the fourth joint.
    ground, a, b, c = asm.Body("ground", fixed=True), asm.Body("a"), asm.Body("b", position=(1, 0, 0)), asm.Body("c")
    scene = asm.Assembly([ground, a, b, c])
    scene.constrain(
        asm.Revolute(ground, a, "first"),
        asm.Revolute(a.frame(at=(1, 0, 0)), b, "second"),
        asm.Revolute(b.frame(at=(1, 0, 0)), c.frame(at=(1, 0, 0)), "third"),
        asm.Revolute(ground.frame(at=(1, 0, 0)), c, "fourth"),
    )
    c.pose = asm.Pose((1, 0, 0))
    scene.minimize(asm.PointDistance(b.point(1, 0, 0), target))
    solution = scene.solve()
    assert solution.success and solution.objective == pytest.approx(best, abs=1e-9)


def is_lowest(solution, scene, model, rng):
    """Whether a solution is SOLVED, and no pose beside it is lower that the tests' own Newton finds."""
    for row, constraint in zip(model.rows, scene.constraints, strict=True):
        if isinstance(row, Joint):
            row.near = solution.values.get(f"{constraint.name}.angle", 0.0)
    lower = lowest_neighbor(model, solution.q, rng, 4)
    return solution.success and lower <= 1e-9 * (abs(solution.objective) + scene.packed().scale ** 2)


@pytest.mark.parametrize(
    ("seed", "k"),
    [
        # A stretched arm that touches a ball without a force: what it touches forbids ways by its curvature alone.
        (0, 760),
        (1, 3810),
        # A loop that is stretched, and comes to be so again: with multipliers that are open no form has to be shifted.
        (1, 2830),
        # Small arms on a large floor: rows are off by much more than the objective pulls, and steps a part of Newton's.
        (0, 210),
        (0, 1750),
        (0, 8580),
    ],
)
def test_starts_that_are_hard_to_leave(seed, k):
    rng = np.random.default_rng([seed, k])
    scene, model = random_scene(rng, True)
    solution = scene.solve()
    assert is_lowest(solution, scene, model, rng) and solution.iterations < 250


@pytest.mark.parametrize(
    ("term", "limits", "best", "kind"),
    [
        (lambda x, y: y**2, None, 0.0, MINIMUM),
        (lambda x, y: -(y**2), None, -1.0, MINIMUM),
        (lambda x, y: -(y**4), None, -1.0, MINIMUM),
        (lambda x, y: -(y**6), None, -1.0, MINIMUM),
        (lambda x, y: y**3, None, -1.0, MINIMUM),
        (lambda x, y: y**4, None, 0.0, UNDECIDED),
        (lambda x, y: 0.0 * y, None, 0.0, NOT_ISOLATED),
        # At a stop without a force the allowed sign alone counts.
        (lambda x, y: -(y**2), (0.0, 0.5), -(np.sin(0.5) ** 2), MINIMUM),
        (lambda x, y: -(y**2), (-0.5, 0.0), -(np.sin(0.5) ** 2), MINIMUM),
        (lambda x, y: y**3, (0.0, 0.5), 0.0, UNDECIDED),
        (lambda x, y: y**2, (0.0, 0.5), 0.0, MINIMUM),
        # One that pushes needs no curvature.
        (lambda x, y: y - y**2, (0.0, 0.5), 0.0, MINIMUM),
    ],
)
def test_orders_and_stops(term, limits, best, kind):
    solution = crank(term, limits).solve()
    assert solution.success and solution.objective == pytest.approx(best, abs=1e-9)
    assert solution.second_order is kind


def test_a_way_that_two_stops_forbid_is_none():
    # f = -2 a b, lower where both turn the same way: one may turn up alone, the other one down.
    poses = [ca.SX.sym(f"p{k}", 7) for k in range(2)]
    sines = [2.0 * (p[4] * p[5] + p[3] * p[6]) for p in poses]
    for limits, lower in (((0.0, 0.5), True), ((-0.5, 0.0), False)):
        ground, a, b = asm.Body("ground", fixed=True), asm.Body("a"), asm.Body("b")
        scene = asm.Assembly([ground, a, b])
        scene.constrain(asm.Revolute(ground, a, "a", limits=(0.0, 0.5)), asm.Revolute(ground, b, "b", limits=limits))
        scene.minimize(asm.Expression(ca.Function("f", poses, [-2.0 * sines[0] * sines[1]]), [a, b]))
        solution = scene.solve()
        assert solution.success
        assert solution.objective == pytest.approx(-2.0 * np.sin(0.5) ** 2 if lower else 0.0, abs=1e-9)


def test_kinks_are_left():
    # |sin| of the elbow has its least value, zero, at a straight arm, and no slope there.
    ground, upper, lower = asm.Body("ground", fixed=True), asm.Body("upper"), asm.Body("lower", position=(1, 0, 0))
    shoulder = asm.Revolute(ground.frame(), upper.frame(), "shoulder")
    elbow = asm.Revolute(upper.frame(at=(1, 0, 0)), lower.frame(), "elbow")
    scene = asm.Assembly([ground, upper, lower])
    scene.constrain(shoulder, elbow)
    scene.maximize(asm.Dexterity(lower.point(1, 0, 0), [shoulder, elbow], measure="manipulability"))
    solution = scene.solve()
    assert solution.success and abs(np.sin(solution.values["elbow.angle"])) == pytest.approx(1.0, abs=1e-12)

    def distance(x, y):
        return ca.sqrt((x - 1.0) ** 2 + y**2)

    # The distance from a place that is reached has no derivative at all; it is a minimum of the distance.
    solution = crank(distance, sign=-1.0).solve()
    assert solution.success and solution.objective == pytest.approx(-2.0, abs=1e-9)
    solution = crank(distance).solve()
    assert solution.status is asm.Status.STALLED and solution.second_order is None and solution.iterations == 0


def test_contacts_bend_what_they_hold():
    # An egg that stands on its end, drawn down: the floor's force bends it over, to lie on its longest side.
    floor = asm.Body("floor", asm.shapes.plane(20.0, 20.0), fixed=True)
    for constraint in (asm.Contact, asm.Clearance):
        egg = asm.Body("egg", asm.shapes.ellipsoid(0.5, 0.7, 1.1), position=(0, 0, 1.1))
        scene = asm.Assembly([floor, egg])
        scene.constrain(asm.Contact(floor, egg, unilateral=True) if constraint is asm.Contact else asm.Clearance())
        scene.minimize(asm.PointDistance(egg.point(0, 0, 0), (0.0, 0.0, -3.0)))
        solution = scene.solve()
        assert solution.success and solution.pose(egg).position[2] == pytest.approx(0.5, abs=1e-9)
        assert solution.second_order in (NOT_ISOLATED, UNDECIDED)


def test_a_factorization_tells_in_warm_solves(judged):
    # None of these ends is judged: free motions, stops that push, a stop at its bound without a force.
    scene, goal = drawn(3, (1.0, 1.5, 0.0))
    solution = scene.solve()
    for k in range(30):
        goal.target = (1.0 + 0.01 * k, 1.5, 0.0)
        solution = scene.solve(solution)
        assert solution.success
    scene, goal = drawn(2, (2.0, 0.0, 0.0), limits=(0.0, 1.0))
    solution = scene.solve()
    judged[0] = 0
    for k in range(30):
        goal.target = (2.0 + 0.1 * k, 0.0, 0.0)
        solution = scene.solve(solution)
        assert solution.success and solution.objective == pytest.approx((0.1 * k) ** 2, abs=1e-9)
    assert judged[0] == 0
    assert solution.second_order is MINIMUM


def test_a_saddle_on_a_warm_path_is_left():
    # The target of a straight arm goes through its base: behind it the arm stands at a maximum of the distance.
    scene, goal = drawn(1, (0.5, 0.0, 0.0))
    solution = scene.solve()
    for x in np.linspace(0.5, -0.5, 41):
        goal.target = (x, 0.0, 0.0)
        solution = scene.solve(solution)
        assert solution.success and solution.objective <= (1.0 - abs(x)) ** 2 + 1e-9


def test_steps_of_saddles_count():
    scene, _ = drawn(2, (-3.0, 0.0, 0.0))
    solution = scene.solve(max_iterations=0)
    assert solution.status is asm.Status.ITERATION_LIMIT and solution.second_order is asm.SecondOrder.SADDLE
    assert solution.iterations == 0 and len(solution.history) == 1
    for limit in (1, 3, 5):
        solution = scene.solve(max_iterations=limit)
        assert solution.iterations <= limit and len(solution.history) == solution.iterations + 1
        assert solution.status is asm.Status.ITERATION_LIMIT


def test_the_same_saddle_is_left_the_same_way():
    # Curvatures that are equal leave the direction open; rounding does not choose it.
    runs = [drawn(4, (-1.0, 0.0, 0.0), axes=((0, 0, 1), (0, 1, 0)))[0].solve() for _ in range(5)]
    assert len({run.q.tobytes() for run in runs}) == 1


def test_what_is_not_asked_is_not_said():
    scene, _ = chain(2)
    assert scene.solve().second_order is asm.SecondOrder.NO_OBJECTIVE
    scene, goal = drawn(1, (3.0, 1.0, 0.0))
    solution = scene.solve()
    # The target that it was solved for is gone when it is asked.
    goal.target = (0.0, 3.0, 0.0)
    assert scene.solve(solution).second_order is MINIMUM
    assert solution.success and solution.second_order is UNDECIDED
    scene, _ = drawn(1, (3.0, 0.0, 0.0))
    scene.constrain(asm.Distance(scene.bodies[0], scene.bodies[1].frame(at=(1, 0, 0)), 5.0, "far"))
    assert scene.solve().second_order is None


def test_a_posture_that_follows_the_start_does_not_follow_a_saddle():
    scene, links = chain(1)
    scene.minimize(asm.PointDistance(links[0].point(1, 0, 0), (-3.0, 0.0, 0.0)), asm.Posture(weight=0.01))
    solution = scene.solve()
    tip = solution.pose(links[0]).apply((1, 0, 0))
    turn = 4.0 * np.sin(0.5 * solution.values["joint 0.angle"]) ** 2
    lever = 0.5 * scene.packed().scale
    assert solution.success
    assert solution.objective == pytest.approx(((tip - [-3, 0, 0]) ** 2).sum() + 0.01 * lever**2 * turn, abs=1e-9)


def test_large_scenes_leave_saddles_by_a_sparse_factor(monkeypatch):
    # Each of 70 cranks points away from its target; dense decompositions would be of 420 unknowns.
    monkeypatch.setattr(LocalModel, "at", None)
    ground = asm.Body("ground", fixed=True)
    cranks = [asm.Body(f"crank {k}", position=(0.0, 0.0, k)) for k in range(70)]
    scene = asm.Assembly([ground, *cranks])
    for k, crank in enumerate(cranks):
        scene.constrain(asm.Revolute(ground.frame(at=(0.0, 0.0, k)), crank, f"hinge {k}"))
        scene.minimize(asm.PointDistance(crank.point(1.0, 0.0, 0.0), (-3.0, 0.0, k)))
    solution = scene.solve()
    assert solution.success and solution.objective == pytest.approx(4.0 * 70, abs=1e-7)


def test_a_contact_that_pushes_stays_closed_on_the_way_down():
    # Tilted by an angle the egg is lower by less than it would be off the floor if it did not follow.
    floor = asm.Body("floor", asm.shapes.plane(20.0, 20.0), fixed=True)
    egg = asm.Body("egg", asm.shapes.ellipsoid(1.3, 0.5, 0.8), position=(0, 0, 0.8))
    scene = asm.Assembly([floor, egg])
    scene.constrain(asm.Contact(floor, egg, unilateral=True))
    scene.minimize(asm.FrameDistance(egg.frame(), asm.Pose((0.0, 0.0, -0.5)), length=0.7))
    solution = scene.solve()
    angles = np.linspace(0.0, 1.0, 100_001)
    heights = np.sqrt((0.5 * np.sin(angles)) ** 2 + (0.8 * np.cos(angles)) ** 2)
    best = ((heights + 0.5) ** 2 + 0.49 * 4.0 * np.sin(0.5 * angles) ** 2).min()
    # The angles are 1e-5 apart.
    assert solution.success and solution.objective == pytest.approx(best, abs=1e-9)
