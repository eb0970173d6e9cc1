"""What a solution tells of clearances, and of bodies that cross where nobody asked for one."""

from __future__ import annotations

import copy
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.proximity import closest_features
from benchmarks.center_lines import torus_wire
from benchmarks.hands import NEAR, linked_rings
from benchmarks.wire_oracle import WireOracle

BALL = asm.shapes.sphere(1.0)
RING = asm.Face(asm.shapes.torus(1.0, 0.1))


def pile():
    """Three balls in a row along x, drawn together: the outer ones press on the one between, which is fixed."""
    balls = [asm.Body(name, BALL, (2.5 * k, 0.1 * k, 0), fixed=k == 1) for k, name in enumerate("abc")]
    scene = asm.Assembly(balls)
    scene.constrain(asm.Clearance())
    for k in (0, 2):
        scene.minimize(asm.PointDistance(balls[k].point(0, 0, 0), (2.5, 0.1, 0)))
    return scene


def test_contacts_of_a_clearance_have_names_points_and_gaps():
    scene = pile()
    solution = scene.solve()
    assert solution.success, solution.message
    assert set(solution.contacts) == {"clearance: a-b", "clearance: b-c"}
    for name, (i, j) in (("clearance: a-b", (0, 1)), ("clearance: b-c", (1, 2))):
        pair = solution.contacts[name]
        x, y = solution.q[i, :3], solution.q[j, :3]
        normal = (y - x) / np.linalg.norm(y - x)
        # The gap to the loop's tolerance, the rest to rounding.
        assert abs(pair.gap) < 1e-9 and pair.gap == pytest.approx(np.linalg.norm(y - x) - 2.0, abs=1e-14)
        assert np.abs(pair.normal - normal).max() < 1e-12
        assert np.abs(pair.points - [x + normal, y - normal]).max() < 1e-12


def test_the_wrenches_of_a_clearance_balance_the_objective():
    solution = pile().solve()
    push = solution.wrenches["clearance"]
    assert set(push) == {"a", "b", "c"}
    center = solution.q[1, :3]
    for name, k in (("a", 0), ("c", 2)):
        # The objective |x - target|^2 pulls with twice the distance.
        pull = -2.0 * (solution.q[k, :3] - center)
        assert np.abs(push[name].force + pull).max() < 1e-6
        assert np.linalg.norm(push[name].force) == pytest.approx(4.0, abs=1e-6)
        assert np.abs(push[name].torque).max() < 1e-9


def test_contacts_of_bodies_with_edges():
    box = asm.Body("box", asm.shapes.box(2.0, 2.0, 2.0), fixed=True)
    ball = asm.Body("ball", BALL, (0.1, 0.2, 2.6))
    scene = asm.Assembly([box, ball])
    scene.constrain(asm.Clearance([box, ball], minimum=0.25, name="room"))
    scene.minimize(asm.PointDistance(ball.point(0, 0, 0), (0.1, 0.2, 0.0)))
    solution = scene.solve()
    assert solution.success, solution.message
    assert solution.contacts["room: box-ball"].gap == pytest.approx(0.25, abs=1e-9)
    assert np.abs(solution.q[1, :3] - [0.1, 0.2, 2.25]).max() < 1e-6


@pytest.mark.parametrize("how", [copy.deepcopy, lambda scene: pickle.loads(pickle.dumps(scene))])
def test_copies_of_a_packed_scene_solve_the_same(how):
    scene = pile()
    solution = scene.solve()
    other = how(scene).solve()
    assert other.q.tobytes() == solution.q.tobytes()


@pytest.mark.parametrize("how", [copy.deepcopy, lambda scene: pickle.loads(pickle.dumps(scene))])
def test_copies_of_a_packed_scene_know_its_angles_and_bodies(how):
    ground, crank, rack = asm.Body("ground", fixed=True), asm.Body("crank"), asm.Body("rack")
    scene = asm.Assembly([ground, crank, rack])
    hinge, slide = asm.Revolute(ground, crank, name="hinge"), asm.Prismatic(ground, rack, name="slide", slide=100.0)
    scene.constrain(hinge, slide, asm.RackPinion(hinge, slide, 3.0))
    solution = scene.solve()
    # Five turns and more: where angles begin is told by what is driven.
    assert solution.success and abs(solution.values["hinge.angle"]) > 30.0
    other = how(scene)
    again = other.solve()
    assert again.q.tobytes() == solution.q.tobytes() and again.values == solution.values
    arms = [
        asm.tip_jacobian(each, each.body("crank").point(1.0, 0.0, 0.0), [each.constraints[1].freedom()])
        for each in (scene, other)
    ]
    np.testing.assert_array_equal(arms[1], arms[0])


def test_what_is_left_of_a_solve_does_not_depend_on_what_was_in_memory():
    states = []
    for fill in (1.0, -2.0, np.nan):
        scene = pile()
        # Freed memory that later arrays are likely to get.
        for size in range(1, 4000, 7):
            np.full(size, fill)
        solution = scene.solve()
        states.append((solution._state.tobytes(), solution.history.tobytes()))
    assert states[0] == states[1] == states[2]


def test_a_scene_file_keeps_clearances(tmp_path):
    bodies = [asm.Body(name, BALL, (3.0 * k, 0, 0)) for k, name in enumerate("abc")]
    a, b, c = bodies
    scene = asm.Assembly(bodies)
    scene.constrain(
        asm.Clearance([a, b], minimum=0.125, name="first", merge_radius=1e-3, slots=7),
        asm.Clearance(exclude=[(a, b), (b, c)]),
    )
    scene.save(tmp_path / "scene.json")
    first, rest = asm.load(tmp_path / "scene.json").constraints
    assert (first.name, first.minimum, first.merge_radius, first.slots, first.is_of_all) == (
        "first",
        0.125,
        1e-3,
        7,
        False,
    )
    assert [body.name for body in first.bodies] == ["a", "b"] and first.exclude == ()
    assert (rest.name, rest.minimum, rest.merge_radius, rest.slots, rest.is_of_all) == (
        "clearance",
        0.0,
        1e-6,
        None,
        True,
    )
    assert [[body.name for body in pair] for pair in rest.exclude] == [["a", "b"], ["b", "c"]]


def test_the_reference_solver_takes_no_clearance():
    text = r"constraint 'clearance' is Clearance\(all bodies, .*; expected what the reference solver takes"
    with pytest.raises(InputError, match=text):
        asm.reference.solve(pile())


def test_what_a_clearance_says_of_itself():
    a, b = (asm.Body(name, BALL) for name in "ab")
    assert repr(asm.Clearance()) == "Clearance(all bodies, minimum=0, name='clearance')"
    assert repr(asm.Clearance([a, b], 0.5)) == "Clearance(['a', 'b'], minimum=0.5, name='clearance a-b')"


def rings(x):
    """Rings a and b that touch, and a third one that stays where it is, across a."""
    upright = (np.sqrt(0.5), np.sqrt(0.5), 0, 0)
    a = asm.Body("a", RING, fixed=True)
    b = asm.Body("b", RING, (1.0, 0.0, 0.3), upright)
    c = asm.Body("c", RING, (x, 0.0, 0.0), upright)
    scene = asm.Assembly([a, b, c])
    scene.constrain(asm.Contact(a, b))
    return scene


@pytest.mark.parametrize("x", [-1.3, -1.95, -2.1, -2.19, -2.25])
def test_bodies_that_cross_are_named(x):
    solution = rings(x).solve()
    gaps = WireOracle([torus_wire(1.0, 0.1)] * 3).gaps(solution.q)
    expected = tuple(pair for pair, gap in zip((("a", "b"), ("a", "c"), ("b", "c")), gaps, strict=True) if gap < -1e-6)
    assert (x > -2.2) == (("a", "c") in expected) or x == -1.3
    assert "crossings" not in solution.__dict__  # nobody asked yet
    assert solution.crossings == expected
    said = [line for line in str(solution).splitlines() if " cross" in line]
    assert said == [f"  {a} and {b} cross; asm.Clearance() keeps them apart" for a, b in expected]


def test_contacts_and_clearances_that_hold_do_not_cross():
    scene = rings(-2.5)
    assert scene.solve().crossings == ()
    scene = rings(-2.15)
    scene.constrain(asm.Clearance())
    solution = scene.solve()
    assert solution.success and solution.crossings == ()
    assert WireOracle([torus_wire(1.0, 0.1)] * 3).deepest(solution.q) > -1e-9


def test_solves_in_threads_are_those_of_one():
    rings_ = linked_rings(4, NEAR)
    scene = rings_.drag.scene
    scene.constrain(asm.Clearance())
    alone = [scene.solve(q).q for q in rings_.q]
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(lambda q: scene.solve(q).q, [*rings_.q] * 3))
    # The same to the last bit: the target is one for all, and nothing else is shared.
    assert all((q == alone[k % 4]).all() for k, q in enumerate(together))


def test_balls_less_deep_than_a_tenth_of_the_scene_are_pushed_apart():
    bodies = [asm.Body("a", BALL, fixed=True), asm.Body("b", BALL, (1.8, 0.0, 0.0))]
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())
    scene.minimize(asm.PointDistance(bodies[1].point(0, 0, 0), (1.8, 0.01, 0)))
    solution = scene.solve()
    # The gap counts as closed to 1e-12 of the size.
    assert solution.success and np.linalg.norm(solution.q[1, :3]) == pytest.approx(2.0, abs=1e-11)


@pytest.mark.parametrize(
    ("a", "b", "x"),
    [
        *((BALL, BALL, x) for x in (1.4, 1.0, 0.3)),
        (BALL, asm.shapes.sphere(0.3), 0.05),
        (asm.shapes.box(1, 1, 1), asm.shapes.box(1, 1, 1), 0.7),
        (RING, RING, 1.0),
        (asm.shapes.box(1, 1, 1), asm.shapes.box(0.2, 0.3, 0.1), 0.1),
        (asm.shapes.box(1, 1, 1), asm.shapes.sphere(0.2), 0.1),
        (BALL, asm.shapes.box(0.2, 0.3, 0.1), 0.1),
    ],
    ids=[
        *("balls-1.4", "balls-1.0", "balls-0.3", "ball-in-ball", "boxes", "rings"),
        *("box-in-box", "ball-in-box", "box-in-ball"),
    ],
)
def test_bodies_deep_in_each_other_are_moved_apart(a, b, x):
    # Deeper than updates reach: no row knows of them.
    bodies = [asm.Body("a", a, fixed=True), asm.Body("b", b, (x, 0, 0))]
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())
    hold = bodies[1].point(0, 0, 0)
    scene.minimize(asm.PointDistance(hold, (x, 0.01, 0)))
    for q in (scene.solve().q, scene.tracker(hold).q):
        # Drawn to where they were, they end touching; a level ring is nearest all around, known to the square root
        # of what stationary means.
        assert closest_features(*bodies, *q).gap == pytest.approx(0.0, abs=1e-9)


def test_former_names_work_and_warn():
    a, b = (asm.Body(name, asm.shapes.sphere(1.0)) for name in "ab")
    with pytest.warns(DeprecationWarning, match="neglect is called merge_radius now"):
        clearance = asm.Clearance([a, b], neglect=1e-3)
    with pytest.warns(DeprecationWarning, match="places is called slots now"):
        manager = asm.Manager([a, b], places=4)
    assert clearance.merge_radius == 1e-3
    with pytest.warns(DeprecationWarning, match="neglect is called"):
        assert clearance.neglect == 1e-3
    with pytest.warns(DeprecationWarning, match="neglect is called"):
        assert manager.neglect == manager.merge_radius == 1e-6
    with pytest.warns(DeprecationWarning, match="places is called"):
        assert clearance.places is None
