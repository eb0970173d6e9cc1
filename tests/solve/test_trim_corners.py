"""Contacts kept by loops with corners: the best place of each, found another way, and hands that lead around them."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.model.trim_contact import FORMS
from assembly.geometry.splines.curve import NurbsCurve
from tests.laws.trim_scenes import arcs, polygon
from tests.solve.test_trims import HELD, ONE_SIDED, Plate

SQUARE = [(-2, -2), (2, -2), (2, 2), (-2, 2)]
NOTCHED = [(-3, -3), (3, -3), (0, 0), (3, 3), (-3, 3)]
# Lines and arcs; kinks within one curve; one corner; two.
LOOPS = {
    "square": polygon(SQUARE),
    "clockwise": polygon(SQUARE[::-1]),
    "notched": polygon(NOTCHED),
    "raised": [NurbsCurve([*NOTCHED, NOTCHED[0]], [0, 0, 1, 2, 3, 4, 5, 5], 1).elevate(3)],
    "arcs outward": arcs(SQUARE, 0.1),
    "arcs inward": arcs(SQUARE, -0.1),
    "lens": arcs([(-3, 0), (3, 0)], 0.3),
    "drop": [NurbsCurve([(-2, 0), (3, -4), (3, 4), (-2, 0)], [0, 0, 0, 0, 1, 1, 1, 1], 3)],
    "mouth": [*arcs([(2, 2), (-3, 0), (2, -2)], 0.2)[:2], *polygon([(2, -2), (-0.5, 0.0), (2, 2)])[:2]],
}


def points_of(trim):
    """Points along the loop, corners among them, a few thousandths apart."""
    rows = []
    for curve in trim.region.boundary:
        at = curve.breaks()
        t = np.unique(np.concatenate([np.linspace(a, b, 4001) for a, b in zip(at[:-1], at[1:], strict=True)]))
        rows.append(curve.evaluate(t))
    return np.concatenate(rows)


def gain(trim, keep, target, place):
    """How much nearer to the target the loop allows a place next to this one to be, over the distance between them."""
    along = points_of(trim)
    if keep == "on":
        steps = np.linalg.norm(along - place, axis=1)
        near = along[(steps > 2e-3) & (steps < 6e-3)]
    else:
        turns = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
        near = place + 1e-3 * np.stack([np.cos(turns), np.sin(turns)], 1)
        near = near[trim.region.locate(near[:, 0], near[:, 1]) == (1 if keep == "inside" else -1)]
    if not len(near):
        return 0.0
    closer = np.linalg.norm(place - target) - np.linalg.norm(near - target, axis=1)
    return float((closer / np.linalg.norm(near - place, axis=1)).max())


@pytest.mark.parametrize("keep", ["on", "inside", "outside"])
@pytest.mark.parametrize("name", LOOPS)
def test_no_neighbor_is_better(name, keep):
    """Random starts and targets: the loop is kept, and no place next to the contact that it allows is nearer."""
    rng = np.random.default_rng(len(name))
    forms = FORMS if keep == "on" else ONE_SIDED
    for k in range(8):
        target, start = rng.uniform(-4.0, 4.0, 2), rng.uniform(-2.5, 2.5, 2)
        case = Plate(target, (*start, 1.2), swapped=k % 2 == 1)
        trim = case.keep(LOOPS[name], keep, forms[0 if k < 4 else k % len(forms)])
        solution = case.scene.solve()
        assert solution.success, (k, solution.message)
        place = case.place(solution)[:2]
        distance = float(trim.region.trim_distance(*place))
        assert abs(case.place(solution)[2] - 1.0) < HELD
        held = abs(distance) if keep == "on" else max(0.0, -distance if keep == "inside" else distance)
        assert held < HELD
        # Of steps of 1e-3 and more along bent sides: what they bend by.
        assert gain(trim, keep, target, place) < 3e-2, (k, place, target)
        # What the rows push with balances the objective: its slope is taken from the poses alone.
        pushed = solution.wrenches["rests"]["ball"].vector + solution.wrenches["trim"]["ball"].vector
        slope = 2.0 * (solution.pose(case.ball).position - case.wish.target)
        np.testing.assert_allclose(pushed, [*slope, 0.0, 0.0, 0.0], rtol=0, atol=1e-6)


# Forms that contain the gap are for `on` alone.
@pytest.mark.parametrize(("keep", "form"), [("on", form) for form in FORMS] + [("inside", form) for form in ONE_SIDED])
def test_both_sides_of_a_corner_push(keep, form):
    """At a corner of a square each side takes its part of the pull: multipliers in closed form."""
    case = Plate((3.0, 2.5), start=(0.2, 0.1, 1.1))
    case.keep(polygon(SQUARE), keep, form)
    solution = case.scene.solve()
    assert solution.success, solution.message
    np.testing.assert_allclose(case.place(solution), [2.0, 2.0, 1.0], rtol=0, atol=HELD)
    if form == "signed":
        # The two distances are 2 - x and 2 - y.
        np.testing.assert_allclose(sorted(solution.multipliers["trim"]), [-2.0, -1.0], rtol=0, atol=1e-7)
    assert solution.multipliers["trim"][-1] < -0.5
    assert solution.iterations < 30


def test_a_reflex_corner_holds_from_outside():
    case = Plate((-1.0, 0.2), start=(2.5, 0.3, 1.1))
    case.keep(polygon(NOTCHED), "outside")
    solution = case.scene.solve()
    assert solution.success, solution.message
    np.testing.assert_allclose(case.place(solution), [0.0, 0.0, 1.0], rtol=0, atol=HELD)
    assert (solution.multipliers["trim"] < -0.1).all()


def test_a_start_at_a_corner_that_is_none():
    """Drawn along either side from where they meet, and from the corner to the end of a side."""
    for target, expected in (((0.5, 5.0), (0.5, 2.0)), ((5.0, 0.5), (2.0, 0.5))):
        for start in ((2.0, 2.0, 1.0), (2.0 + 1e-9, 2.0 - 1e-9, 1.0)):
            case = Plate(target, start)
            case.keep(polygon(SQUARE), "on")
            solution = case.scene.solve()
            assert solution.success, solution.message
            np.testing.assert_allclose(case.place(solution), [*expected, 1.0], rtol=0, atol=HELD)


@pytest.mark.parametrize("keep", ["on", "inside"])
@pytest.mark.parametrize("form", ["signed", "parametric"])
def test_warm_solves_around_a_square(keep, form):
    case = Plate((3.0, 0.0), (1.9, 0.1, 1.1))
    case.keep(polygon(SQUARE), keep, form)
    solution = case.scene.solve()
    for angle in np.linspace(0.0, 2.0 * np.pi, 49):
        target = 4.0 * np.array([np.cos(angle), np.sin(angle)])
        case.wish.target = np.array([*target, 1.0])
        solution = case.scene.solve(solution)
        assert solution.success, (angle, solution.message)
        np.testing.assert_allclose(case.place(solution), [*np.clip(target, -2.0, 2.0), 1.0], rtol=0, atol=1e-7)


@pytest.mark.parametrize("keep", ["on", "inside"])
@pytest.mark.parametrize("name", ["square", "arcs outward", "notched"])
def test_a_hand_leads_around_corners(name, keep):
    """Every tick holds, and the contact follows the hand past every corner."""
    case = Plate((3.0, 0.0), (1.9, 0.1, 1.1))
    trim = case.keep(LOOPS[name], keep)
    first = case.scene.solve()
    assert first.success
    tracker = case.scene.tracker(case.ball.point(0.0, 0.0, 0.0))
    for angle in np.linspace(0.0, 2.0 * np.pi, 200):
        target = 4.0 * np.array([np.cos(angle), np.sin(angle)])
        # The scene's own wish goes with the hand: it would hold the ball back.
        case.wish.target = np.array([*target, 1.0])
        step = tracker.step((*target, 1.0))
        assert step.status.name in ("FOLLOWED", "APPROACHING"), (angle, step.status)
        place = step.q[1, :2]
        distance = float(trim.region.trim_distance(*place))
        assert (abs(distance) if keep == "on" else -distance) < 1e-7
        if name == "square":
            assert np.linalg.norm(place - np.clip(target, -2.0, 2.0)) < 0.1


def test_a_corner_on_a_cylinder():
    """Of a loop across the seam of a closed surface, beyond the seam."""
    tube = asm.shapes.cylinder(2.0, 8.0)
    (low, high), (bottom, top) = tube.domain
    period, middle, height = high - low, 0.5 * (bottom + top), 0.2 * (top - bottom)
    corners = [(-0.1, -1.0), (0.1, -1.0), (0.1, 1.0), (-0.1, 1.0), (-0.1, -1.0)]
    points = [(low + period * u, middle + height * v) for u, v in corners]
    loop = [NurbsCurve([a, b], [0, 0, 1, 1], 1) for a, b in zip(points[:-1], points[1:], strict=True)]
    for place, sign, keep in ((2, 1.0, "inside"), (3, -1.0, "on"), (3, -1.0, "inside")):
        at, du, dv = tube.evaluate(low + (points[place][0] - low) % period, points[place][1], 1)
        normal = np.array([*at[:2], 0.0]) / 2.0
        post = asm.Body("post", asm.Face(tube), fixed=True)
        # Beside the loop's middle, on the other side of the seam.
        start = tube.evaluate(low + (0.02 if sign < 0.0 else 0.98) * period, middle)
        ball = asm.Body("ball", asm.shapes.sphere(0.5), position=1.3 * start * [1.0, 1.0, 1.0 / 1.3])
        contact = asm.Contact(post, ball, "touch", edges=False)
        scene = asm.Assembly([post, ball])
        trim = asm.TrimContact(contact, asm.Loop(loop, period=(period, 0.0)), keep, side="a")
        scene.constrain(contact, trim)
        beyond = at + 2.0 * normal + 2.0 * (sign * du + dv)
        scene.minimize(asm.PointDistance(ball.point(0, 0, 0), tuple(beyond)))
        solution = scene.solve()
        assert solution.success, solution.message
        np.testing.assert_allclose(solution.pose(ball).position, at + 0.5 * normal, rtol=0, atol=1e-8)
        assert np.abs(solution.multipliers[trim.name]).min() > 1e-3
