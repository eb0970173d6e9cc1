"""Solves whose contacts are kept by loops: closed forms for a ball on a plate, and freeform ones looked at afresh."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.model.trim_contact import FORMS
from assembly.proximity.extrema.pairs import extremal_pair
from assembly.solve.scene import Status
from tests.laws.scenes import dome
from tests.laws.trim_scenes import circle, polygon, spline

RADIUS = 2.0
# A length over the size of the scene that a solve leaves as a violation at most.
HELD = 1e-9


class Plate:
    """A ball of radius 1 on a plate, drawn to a target at the height of its center; loops are on the plate."""

    def __init__(self, target, start=(3.0, 0.3, 1.2), unit=1.0, offset=(0.0, 0.0, 0.0), swapped=False):
        self.unit, self.offset, self.swapped = unit, np.asarray(offset, float), swapped
        self.plate = asm.Body("plate", asm.shapes.plane(10.0 * unit, 10.0 * unit), self.offset, fixed=True)
        self.ball = asm.Body("ball", asm.shapes.sphere(unit), self.offset + unit * np.array(start))
        sides = (self.ball, self.plate) if swapped else (self.plate, self.ball)
        self.contact = asm.Contact(*sides, "rests")
        self.scene = asm.Assembly([self.plate, self.ball])
        self.scene.constrain(self.contact)
        self.wish = asm.PointDistance(self.ball.point(0.0, 0.0, 0.0), self.offset + unit * np.array([*target, 1.0]))
        self.scene.minimize(self.wish)

    def keep(self, loop, keep, form="signed", name="trim"):
        side = "b" if self.swapped else None
        trim = asm.TrimContact(self.contact, loop, keep, form, side=side, name=name)
        self.scene.constrain(trim)
        return trim

    def place(self, solution):
        """Where the ball's center is, in units, and the height of its contact above the plate."""
        return (solution.pose(self.ball).position - self.offset) / self.unit


def rim(target):
    """The point of the circle about the origin nearest to a target."""
    return RADIUS * np.asarray(target) / np.linalg.norm(target)


ONE_SIDED = [form for form in FORMS if form != "between"]
CASES = {
    "outside": ((0.3, 0.1), (3.0, 0.6, 1.2)),
    "inside": ((4.0, 1.0), (0.4, 0.2, 1.2)),
    "on": ((0.5, -0.7), (2.5, 0.0, 1.1)),
}
# A vector that contains the gap cannot be one-sided; started far off it moves the ball into the plate and stays there.
STOPS = [(keep, form) for keep in CASES for form in FORMS if form != "between"]


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize(("keep", "form"), STOPS)
def test_a_ball_stops_at_the_loop(keep, form, swapped):
    target, start = CASES[keep]
    case = Plate(target, start, swapped=swapped)
    trim = case.keep(circle((0.0, 0.0), RADIUS), keep, form)
    solution = case.scene.solve()
    assert solution.success, solution.message
    # The scene's size is 14: a solve leaves 1e-12 of it, and steps converge faster than that.
    np.testing.assert_allclose(case.place(solution), [*rim(target), 1.0], rtol=0, atol=HELD)
    # A vector's components, whose rates forbid sliding along the loop, took 20 to 300 where lengths take six.
    assert solution.iterations < 12
    pair = solution.contacts["rests"]
    where = pair.parameters[2:] if swapped else pair.parameters[:2]
    assert abs(trim.region.trim_distance(*where)) < (1e-11 if keep == "on" else HELD)
    assert solution.violations["trim"] < 1e-11 * 14.2
    assert abs(pair.gap) < HELD
    if form == "signed":
        # (r - t)^2 falls by 2 (r - t) on the way to the target, and s = R - r rises by 1.
        force = 2.0 * (RADIUS - np.linalg.norm(target))
        expected = -force if keep == "outside" else force
        np.testing.assert_allclose(solution.multipliers["trim"], [expected], rtol=1e-7)
        assert keep == "on" or expected < 0.0


@pytest.mark.parametrize("form", ONE_SIDED)
def test_far_from_the_loop_nothing_changes(form):
    free, kept = Plate((-1.0, 3.0)), Plate((-1.0, 3.0))
    kept.keep(circle((0.0, 0.0), RADIUS), "outside", form)
    expected, solution = free.scene.solve(), kept.scene.solve()
    assert solution.success and expected.success
    np.testing.assert_allclose(kept.place(solution), [-1.0, 3.0, 1.0], rtol=0, atol=HELD)
    np.testing.assert_allclose(solution.q, expected.q, rtol=0, atol=HELD)
    np.testing.assert_array_equal(solution.multipliers["trim"], 0.0)
    assert solution.violations["trim"] == 0.0
    assert solution.mobility.dof == 5


def test_from_the_middle_of_the_hole():
    """Where all points of the rim are equally near, and on the wrong side."""
    case = Plate((0.5, 0.2), start=(0.0, 0.0, 1.3))
    case.keep(circle((0.0, 0.0), RADIUS), "outside")
    solution = case.scene.solve()
    assert solution.success, solution.message
    # The nearest point of the rim is the only minimum; the farthest one is a saddle.
    np.testing.assert_allclose(case.place(solution), [*rim((0.5, 0.2)), 1.0], rtol=0, atol=HELD)


@pytest.mark.parametrize("form", ONE_SIDED)
def test_a_corner_holds_the_contact(form):
    """Inside a square with a target beyond a corner: the contact stops in the corner, where no edge is smooth."""
    case = Plate((3.0, 2.5), start=(0.2, 0.1, 1.1))
    case.keep(polygon([(-2, -2), (2, -2), (2, 2), (-2, 2)]), "inside", form)
    solution = case.scene.solve(max_iterations=300)
    np.testing.assert_allclose(case.place(solution), [2.0, 2.0, 1.0], rtol=0, atol=1e-6)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (1e5, -2e5, 3e5)])
def test_units_and_offsets_do_not_matter(unit, offset):
    case = Plate((0.3, 0.1), (3.0, 0.6, 1.2), unit, unit * np.asarray(offset))
    case.keep(circle((0.0, 0.0), RADIUS * unit), "outside")
    solution = case.scene.solve()
    assert solution.success, solution.message
    # Coordinates of 1e5 have 1e-11 of it at least.
    np.testing.assert_allclose(case.place(solution), [*rim((0.3, 0.1)), 1.0], rtol=0, atol=3e-9)
    # (length)^2 over length.
    np.testing.assert_allclose(solution.multipliers["trim"], [-2.0 * unit * (RADIUS - np.hypot(0.3, 0.1))], rtol=1e-6)


def test_a_warm_start_follows_the_target():
    case = Plate((0.3, 0.1), (3.0, 0.6, 1.2))
    case.keep(circle((0.0, 0.0), RADIUS), "outside")
    solution = case.scene.solve()
    angle = np.arctan2(0.1, 0.3)
    for k in range(1, 13):
        way = np.array([np.cos(angle + 0.1 * k), np.sin(angle + 0.1 * k)])
        case.wish.target = np.array([*(0.4 * way), 1.0])
        solution = case.scene.solve(solution)
        assert solution.success, solution.message
        # Along the rim the objective is flat: a slope of 1e-10, which is none, is a place 4e-9 off at the most.
        np.testing.assert_allclose(case.place(solution), [*(RADIUS * way), 1.0], rtol=0, atol=4e-9)
        # The first one leaves a start whose penalty is spent; the others are near.
        assert solution.iterations <= (80 if k == 1 else 12)
    # Away from the hole, and back: the row goes idle and comes back.
    for target, expected in (((0.0, 3.0), (0.0, 3.0)), ((0.1, 0.5), rim((0.1, 0.5)))):
        case.wish.target = np.array([*target, 1.0])
        solution = case.scene.solve(solution)
        assert solution.success, solution.message
        np.testing.assert_allclose(case.place(solution), [*expected, 1.0], rtol=0, atol=HELD)


def test_two_loops_of_one_contact():
    """Between a rim and an outer square: the nearer of both to the target stops the ball, or none."""
    square = polygon([(-4, -4), (4, -4), (4, 4), (-4, 4)])
    for target, expected in (((0.3, 0.1), rim((0.3, 0.1))), ((6.0, 1.0), (4.0, 1.0)), ((3.0, -1.0), (3.0, -1.0))):
        case = Plate(target)
        case.keep(circle((0.0, 0.0), RADIUS), "outside", name="hole")
        case.keep(square, "inside", name="edge")
        solution = case.scene.solve()
        assert solution.success, solution.message
        np.testing.assert_allclose(case.place(solution), [*expected, 1.0], rtol=0, atol=HELD)
    # Where two circles cross both hold.
    case = Plate((0.0, 3.0), (0.5, 1.0, 1.1))
    case.keep(circle((-1.0, 0.0), RADIUS), "on", name="left")
    case.keep(circle((1.0, 0.0), RADIUS), "on", name="right")
    solution = case.scene.solve()
    assert solution.success, solution.message
    np.testing.assert_allclose(case.place(solution), [0.0, np.sqrt(3.0), 1.0], rtol=0, atol=HELD)
    assert solution.mobility.dof == 3


def test_loops_that_contradict_each_other():
    case = Plate((1.5, 0.0), (1.5, 0.3, 1.2))
    case.keep(circle((0.0, 0.0), 1.0), "inside", name="in")
    case.keep(circle((0.0, 0.0), 2.0), "outside", name="out")
    solution = case.scene.solve()
    assert solution.status is Status.INFEASIBLE
    assert set(solution.conflicting) == {"rests", "in", "out"}
    # Least squares put the contact half way.
    assert solution.violations["in"] == pytest.approx(0.5, abs=1e-6)
    assert solution.violations["out"] == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize("form", FORMS)
def test_rows_that_a_joint_says_already(form):
    """A ball led along a line on the plate, kept on a square with an edge there."""
    case = Plate((1.0, 5.0), (0.3, 2.0, 1.0))
    lead = asm.Prismatic(
        case.plate.frame((0.0, 2.0, 1.0), z=(1.0, 0.0, 0.0)), case.ball.frame(z=(1.0, 0.0, 0.0)), "lead"
    )
    case.scene.constrain(lead)
    case.keep(polygon([(-3, -2), (3, -2), (3, 2), (-3, 2)]), "on", form)
    solution = case.scene.solve()
    assert solution.success, solution.message
    np.testing.assert_allclose(case.place(solution), [1.0, 2.0, 1.0], rtol=0, atol=HELD)
    mobility = solution.mobility
    assert mobility.dof == 1
    assert set(mobility.redundant) == {"lead", "rests", "trim"}


@pytest.mark.parametrize("form", FORMS)
def test_degrees_of_freedom(form):
    for keep, dof in (("on", 4), ("inside", 5)):
        if keep == "inside" and form not in ONE_SIDED:
            continue
        case = Plate((4.0, 1.0), (0.4, 0.2, 1.2))
        case.keep(circle((0.0, 0.0), RADIUS), keep, form)
        solution = case.scene.solve()
        assert solution.success
        mobility = solution.mobility
        # On the loop the ball rolls along it, spins about its normal, and slides: a one-sided row counts for nothing.
        assert mobility.dof == dof
        # Forms of several rows repeat themselves, and "between" the gap, too.
        repeated = {"signed": [], "between": ["rests", "trim"]}.get(form, ["trim"])
        assert mobility.redundant == (repeated if keep == "on" else [])
    case.keep(circle((0.0, 0.0), RADIUS), "on", name="again")
    case.keep(circle((0.0, 0.0), RADIUS), "on", name="once more")
    assert set(case.scene.solve().mobility.redundant) >= {"again", "once more"}


@pytest.mark.parametrize("keep", ["outside", "on"])
def test_wrenches_balance_the_objective(keep):
    case = Plate((0.3, 0.1), (3.0, 0.6, 1.2))
    case.keep(circle((0.0, 0.0), RADIUS), keep)
    solution = case.scene.solve()
    assert solution.success
    wrenches = solution.wrenches
    slope = 2.0 * (solution.pose(case.ball).position - case.wish.target)
    pushed = wrenches["rests"]["ball"].vector + wrenches["trim"]["ball"].vector
    # The ball is pushed against what draws it to the target.
    np.testing.assert_allclose(pushed, [*slope, 0.0, 0.0, 0.0], rtol=0, atol=1e-6)
    np.testing.assert_allclose(wrenches["trim"]["ball"].force[:2], slope[:2], rtol=0, atol=1e-6)
    for name in ("rests", "trim"):
        back = wrenches[name]["plate"].at(case.plate.pose.position) + wrenches[name]["ball"].at(
            case.plate.pose.position
        )
        np.testing.assert_allclose(back, 0.0, rtol=0, atol=1e-6)


def test_a_loop_on_the_ball():
    """The ball is to roll until its mark is beside it; its contact stays within a patch of the ball."""
    plate = asm.Body("plate", asm.shapes.plane(20.0, 20.0), fixed=True)
    ball = asm.Body(
        "ball", asm.shapes.sphere(1.0), position=(0.0, 0.0, 1.0), quaternion=(np.sqrt(0.5), np.sqrt(0.5), 0, 0)
    )
    surface = ball.faces[0].face.surface
    contact = asm.Contact(plate, ball)
    at = np.mean(surface.domain, axis=1)
    away = surface.evaluate(*at)
    loop = circle(at, 0.5)
    trim = asm.TrimContact(contact, loop, "inside", side="b")
    scene = asm.Assembly([plate, ball])
    scene.constrain(contact, trim, asm.Distance(plate.point(0.0, 0.0, 1.0), ball.point(0.0, 0.0, 0.0), 1e-0))
    scene.minimize(asm.PointDistance(ball.point(*away), (0.0, 5.0, 1.0)))
    solution = scene.solve(max_iterations=300)
    assert solution.success, solution.message
    s = trim.region.trim_distance(*solution.contacts["plate-ball"].parameters[2:])
    assert abs(s) < HELD and solution.multipliers[trim.name] < -1e-3


@pytest.mark.parametrize("form", FORMS)
def test_freeform_faces_and_loops(form):
    """A dome under an ellipsoid whose contact is kept on a closed spline: every form finds the same pose."""
    rng = np.random.default_rng(3)
    surface = dome(rng)
    low, high = np.array(surface.domain).T
    middle = 0.5 * (low + high)
    ground = asm.Body("ground", surface, fixed=True)
    top = surface.evaluate(*middle)
    egg = asm.Body("egg", asm.shapes.ellipsoid(0.3, 0.4, 0.5), position=top + np.array([0.1, 0.0, 0.5]))
    contact = asm.Contact(ground, egg)
    trim = asm.TrimContact(contact, spline(rng, middle, 0.25 * (high - low).min()), "on", form)
    scene = asm.Assembly([ground, egg])
    scene.constrain(contact, trim)
    scene.minimize(asm.PointDistance(egg.point(0.0, 0.0, 0.0), top + np.array([0.9, 0.4, 0.3])), asm.Posture())
    solution = scene.solve(max_iterations=200)
    assert solution.success, solution.message
    pair = extremal_pair(
        surface, solution.q[0], egg.faces[0].face, solution.q[1], solution.contacts["ground-egg"].parameters
    )
    assert abs(pair.gap) < HELD
    assert abs(trim.region.trim_distance(*pair.parameters[:2])) < HELD
    expected = _freeform_answer(scene, contact)
    np.testing.assert_allclose(solution.objective, expected, rtol=1e-8)


def _freeform_answer(scene, contact):
    """The objective with the signed form."""
    trim = scene.constraints[1]
    other = asm.Assembly(scene.bodies)
    other.constrain(contact, asm.TrimContact(contact, trim.loop, "on"))
    other.minimize(*(term for _, term in scene.objectives))
    solution = other.solve(max_iterations=200)
    assert solution.success
    return solution.objective
