"""Contacts of solids that come to lie on each other: corners with rows of their own carry them."""

from __future__ import annotations

import itertools
import pickle
from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.constraints.packing.earlier import is_earlier, taken_over
from assembly.proximity.features.holding import HELD_F, HELD_G
from assembly.proximity.features.solid_contact import STAYS, TRACK, tracked_at
from assembly.solve.attempts.corners import _turn_around, corners_first
from assembly.solve.interruption import CTRL_C
from assembly.solve.loop.settings import SOLVED
from assembly.solve.second_order.leave import Outcome

CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
# The upper side of the box that all others come to lie on.
TOP = 1.0


def base():
    return asm.Body("base", asm.shapes.box(10.0, 10.0, 2.0), fixed=True)


def turned(rng, by):
    return Rotation.from_rotvec(rng.normal(0.0, by, 3)).as_quat(scalar_first=True)


def drawn_down(rng, size, unilateral=False, clearance=False):
    """A box over another one; four of its corners are drawn to points below the other one's upper side."""
    a, b = base(), asm.Body("b", asm.shapes.box(*size), (*rng.uniform(-2.0, 2.0, 2), 4.0), turned(rng, 0.3))
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Clearance() if clearance else asm.Contact(a, b, "touch", unilateral=unilateral))
    goals = []
    shift = rng.uniform(-0.5, 0.5, 2)
    for x, y in itertools.product((-0.5, 0.5), repeat=2):
        goals.append(
            ((x * size[0], y * size[1], -0.5 * size[2]), (x * size[0] + shift[0], y * size[1] + shift[1], 0.5))
        )
        scene.minimize(asm.PointDistance(b.point(*goals[-1][0]), goals[-1][1]))
    return scene, b, np.array(goals)


def lowest(solution, size):
    """Heights of the box's corners above the other box, sorted."""
    return np.sort([solution.pose("b").apply(0.5 * corner * size)[2] - TOP for corner in CORNERS])


@pytest.mark.parametrize("unilateral", [False, True], ids=["closed", "one-sided"])
def test_a_box_that_is_pressed_down_lies_flat(unilateral, cases):
    # Of 60 such scenes of boxes, cylinders and plates 25 were SOLVED when the nearest features had the only row.
    rng = np.random.default_rng(3)
    for _ in range(cases(4, 30)):
        size = rng.uniform([3.0, 3.0, 1.0], [5.0, 5.0, 2.0])
        seed = int(rng.integers(1 << 30))
        scene, b, goals = drawn_down(np.random.default_rng(seed), size, unilateral)
        solution = scene.solve()
        assert solution.success and solution.contacts["touch"].gap == pytest.approx(0.0, abs=1e-11)
        # Rows hold to 1e-12 of the scene's 14 lengths.
        heights = lowest(solution, size)
        assert np.abs(heights[:4]).max() < 2e-11 and heights[4] > 0.9
        kept, *_ = drawn_down(np.random.default_rng(seed), size, clearance=True)
        # The same minimum, to what first-order conditions of 1e-12 leave of its value.
        assert solution.objective == pytest.approx(kept.solve().objective, rel=1e-9)
        # What presses it down, by hand: the objective is the sum of squares.
        points = solution.pose(b).apply(goals[:, 0])
        assert solution.wrenches["touch"]["b"].force == pytest.approx(
            2.0 * (points - goals[:, 1]).sum(axis=0), abs=1e-8
        )
        # No corner pulls: one-sided rows have multipliers that are not positive.
        assert solution.multipliers["touch"][1:].max() <= 1e-9


def test_a_solid_that_is_pulled_away_touches_still():
    a, b = (
        base(),
        asm.Body("b", asm.shapes.box(4.0, 4.0, 2.0), (0.3, -0.4, 1.9), turned(np.random.default_rng(0), 0.02)),
    )
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Contact(a, b, "touch"))
    # A corner is drawn up, the middle down: one edge or corner stays.
    scene.minimize(
        asm.PointDistance(b.point(2, 2, -1), (2.0, 2.0, 3.0)), asm.PointDistance(b.point(0, 0, 0), (0, 0, 1.5))
    )
    solution = scene.solve()
    heights = lowest(solution, np.array([4.0, 4.0, 2.0]))
    assert solution.success and abs(heights[0]) < 2e-11 and heights[-1] > 1.0


def test_a_stack_comes_to_rest():
    a = base()
    b = asm.Body("b", asm.shapes.box(4.0, 4.0, 1.0), (0.2, 0.1, 3.0), (0.99, 0.1, 0.05, 0.02))
    c = asm.Body("c", asm.shapes.solid_cylinder(1.0, 2.0), (0.1, 0.3, 6.0), (0.98, -0.1, 0.15, 0.0))
    scene = asm.Assembly([a, b, c])
    scene.constrain(asm.Contact(a, b, "lower"), asm.Contact(b, c, "upper"))
    for body, low in ((b, 1.0), (c, 3.0)):
        scene.minimize(*(asm.PointDistance(body.point(x, y, 0), (x, y, low)) for x, y in ((0, 0), (1, 0), (0, 1))))
    solution = scene.solve()
    assert solution.success
    assert solution.pose(b).position[2] == pytest.approx(1.5, abs=1e-10)
    assert solution.pose(c).apply((0.0, 0.0, -1.0))[2] == pytest.approx(2.0, abs=1e-10)
    for body, high in ((b, 0.5), (c, 1.0)):
        top = solution.pose(body).apply([(1.0, 0.0, high), (0.0, 1.0, high)])
        assert np.ptp(top[:, 2]) < 1e-10


def test_a_hand_drags_a_box_that_lies_flat():
    scene, b, _ = drawn_down(np.random.default_rng(1), np.array([4.0, 4.0, 2.0]))
    hand = b.point(0, 0, 0)
    tracker = scene.tracker(hand, q0=scene.solve())
    begin = tracker.q[1, :3].copy()
    for k in range(60):
        step = tracker.step((0.02 * k, 0.01 * k, 1.5))
        pose = asm.Pose(step.q[1, :3], step.q[1, 3:])
        heights = np.array([pose.apply(0.5 * c * np.array([4.0, 4.0, 2.0]))[2] for c in CORNERS]) - TOP
        # It lies flat all the way, and the spring and the goals are in balance at every tick.
        assert step.status.name == "FOLLOWED" and np.abs(np.sort(heights)[:4]).max() < 2e-11
    assert np.hypot(*(pose.position - begin)[:2]) > 0.1


def test_solutions_of_before_are_starts_still():
    """Forces and poses of a solution that had no rows of corners go on in a scene that has them."""
    rng = np.random.default_rng(5)
    scene, b, goals = drawn_down(rng, np.array([4.0, 4.0, 2.0]))
    joint = asm.Distance(scene.body("base").point(0, 0, 1), b.point(0, 0, 1), limits=(0.0, 9.0))
    scene.constrain(joint)
    first = scene.solve(max_iterations=0)
    plain = scene.packed()
    state = first._state.copy()
    state[plain.multipliers_at : plain.residuals_at] = np.arange(1.0, plain.rows + 1.0)
    assert scene.solve().success
    packed = scene.packed()
    assert packed.corners and is_earlier(plain, packed) and not is_earlier(packed, plain)
    taken = taken_over(plain, packed, state)
    np.testing.assert_array_equal(taken[: packed.contacts_at], state[: plain.contacts_at])
    forces = taken[packed.multipliers_at : packed.residuals_at]
    for rows, before in zip(packed.spans, plain.spans, strict=True):
        old = state[plain.multipliers_at : plain.residuals_at][before]
        # A contact's corners are behind its own row; nothing has pushed there.
        np.testing.assert_allclose(forces[rows][: len(old)], old * plain.unit / packed.unit, rtol=1e-15)
        assert not forces[rows][len(old) :].any()
    assert scene.solve(first).success


def test_corners_are_in_what_a_solution_says():
    scene, *_ = drawn_down(np.random.default_rng(2), np.array([4.0, 4.0, 2.0]))
    solution = scene.solve()
    names = [name for name in solution.contacts if name.startswith("touch: corner")]
    assert len(names) >= 3 and "touch" in solution.contacts
    assert set(solution.violations) == {"touch"} and solution.violations["touch"] < 2e-11
    again = pickle.loads(pickle.dumps(solution))
    assert again.contacts.keys() == solution.contacts.keys()


def test_what_cannot_be_leaves_the_scene_as_it_was():
    a, c = base(), asm.Body("c", asm.shapes.box(1.0, 1.0, 1.0), (0.0, 0.0, 40.0), fixed=True)
    b = asm.Body("b", asm.shapes.box(4.0, 4.0, 2.0), (0.1, 0.2, 5.0), (0.99, 0.1, 0.0, 0.0))
    scene = asm.Assembly([a, b, c])
    scene.constrain(asm.Contact(a, b, "low"), asm.Contact(b, c, "high"))
    before = scene.packed()
    assert not scene.solve().success and scene.packed() is before


def test_contacts_of_surfaces_have_no_corners():
    a, b = base(), asm.Body("b", asm.shapes.sphere(1.0), (0.0, 0.0, 4.0))
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Contact(a, b, "touch"))
    scene.minimize(asm.PointDistance(b.point(0, 0, 0), (0.3, 0.2, 0.0)))
    assert scene.solve().success and not scene.packed().corners


def test_a_pair_that_the_user_starts_is_kept():
    """Of a contact whose place is given corners are listed, but no nearer pair takes its place."""
    plane = asm.Body("plane", asm.Face(asm.shapes.plane(6.0, 6.0)), fixed=True)
    other = asm.Body("other", asm.Face(asm.shapes.plane(2.0, 2.0)), (0.0, 0.0, 1.0), (0.99, 0.1, 0.0, 0.0))
    scene = asm.Assembly([plane, other])
    scene.constrain(asm.Contact(plane, other, "touch", edges=True))
    before = scene.packed()
    scene._corners = True
    packed = scene._pack(before)
    assert packed.corners
    seen = []

    def run(_table, _settings, state):
        seen.append(state)
        raise AssertionError("nothing is left to keep apart first")

    for starts, is_asked in ((None, True), ({"touch": (0.5, 0.5, 0.5, 0.5)}, False)):
        settings = scene._settings({}, CTRL_C, warm=False)
        start = partial(scene._start, packed, None, starts)
        if is_asked:
            with pytest.raises(AssertionError):
                corners_first(packed, settings, start, run, run)
        else:
            assert corners_first(packed, settings, start, run, run) is None
    assert len(seen) == 1


@pytest.mark.parametrize("pull", [-1.0, 1.0], ids=["pushes", "pulls"])
def test_a_corner_that_would_have_to_pull_is_not_held(pull):
    """A solve that ends with the contact held at a corner is taken if that pushes; else features may switch."""
    scene, *_ = drawn_down(np.random.default_rng(4), np.array([4.0, 4.0, 2.0]))
    solution = scene.solve()
    packed, begun = scene.packed(), []

    def run(_table, _settings, state):
        state[:] = solution._state
        return Outcome(SOLVED, state, np.zeros((1, 7)))

    def go_on(_packed, _settings, state):
        begun.append(state[packed.contacts_at : packed.angles_at].reshape(-1, TRACK)[0, STAYS])
        ended = state.copy()
        ended[packed.multipliers_at : packed.residuals_at][0] = pull
        return Outcome(SOLVED, ended, np.zeros((1, 7)))

    settings = scene._settings({}, CTRL_C, warm=False)
    found = corners_first(packed, settings, partial(scene._start, packed, None, None), run, go_on)
    assert found is not None and found.code == SOLVED
    # First it is held, with its features; then it may switch.
    assert begun[0] > 0.0 and begun[1:] == ([0.0] if pull > 0.0 else [])


def test_a_pair_that_is_listed_the_other_way_around_is_turned_around():
    rng = np.random.default_rng(0)
    for _ in range(20):
        turn_f, turn_g = turned(rng, 2.0), turned(rng, 2.0)
        before = rng.normal(size=TRACK)
        pair = tracked_at(before, 0)
        pair.stays, pair.feature_f, pair.feature_g = HELD_F, 3.0, 7.0
        after = before.copy()
        # From g to f it was, with the normal in the axes of g.
        _turn_around(after, turn_f, turn_g)
        turned_pair = tracked_at(after, 0)
        assert turned_pair.stays == HELD_G and (turned_pair.feature_f, turned_pair.feature_g) == (7.0, 3.0)
        assert np.array_equal(turned_pair.parameters, np.roll(pair.parameters, 2))
        world_f, world_g = (Rotation.from_quat(turn, scalar_first=True) for turn in (turn_f, turn_g))
        assert world_f.apply(turned_pair.normal) == pytest.approx(-world_g.apply(pair.normal), abs=1e-14)
        _turn_around(after, turn_g, turn_f)
        assert after == pytest.approx(before, abs=1e-14)
