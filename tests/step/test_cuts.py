"""Regions cut open at seams, which needs no OCCT."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

import assembly as asm
from assembly._record import place_of
from assembly.geometry.seams.region_cuts import cut_open, part_of
from assembly.geometry.seams.region_pieces import EDGE, POLE, SEAM, Uncut
from assembly.geometry.seams.region_strips import strip
from assembly.geometry.splines.bezier import full_knots
from assembly.step import edge_ends
from assembly.step.chains import chained
from assembly.step.edge_ends import EDGE_SIZE, FREE, LOOSE, POINT, U_LEVEL, V_LEVEL, join_ends
from assembly.step.profiles import Straight, Turning, Unreadable, approximated, arc, spline
from assembly.step.surfaces import Patch
from assembly.step.trims import HIGH, LOW, Drawn, curves_of, moved


def circle(center, radius, clockwise=False):
    points = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float)
    points = radius * (points[::-1] if clockwise else points) + center
    half = np.sqrt(0.5)
    return asm.NurbsCurve(points, full_knots(np.linspace(0.0, 1.0, 5), 2), 2, [1, half] * 4 + [1])


def line(a, b):
    return asm.NurbsCurve([a, b], [0, 0, 1, 1], 1)


def polygon_area(chain):
    """Signed area in (u, v)."""
    points = np.concatenate([piece.curve.evaluate(np.linspace(*piece.curve.domain, 4001)[:-1]) for piece in chain])
    x, y = points.T
    return 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))


TUBE, BALL, WHEEL = asm.shapes.cylinder(1.0, 4.0), asm.shapes.sphere(1.0), asm.shapes.torus(4.0, 1.0)
U = 2.0 * pi
# Face, area in (u, v), number of chains, and of seam pieces and poles.
CASES = {
    "whole cylinder": (lambda: asm.Face(TUBE), 4.0 * U, 1, 2, 0),
    "whole sphere": (lambda: asm.Face(BALL), pi * U, 1, 2, 2),
    "whole torus": (lambda: asm.Face(WHEEL), 4.0 * U * U, 1, 4, 0),
    "window beside the seam": (lambda: asm.Face(TUBE, holes=[circle((3.0, 2.0), 0.5, True)]), 4 * U - pi / 4, 2, 2, 0),
    "window at the seam": (lambda: asm.Face(TUBE, holes=[circle((0.1, 2.0), 0.5, True)]), 4 * U - pi / 4, 1, 4, 0),
    "two at the seam": (
        lambda: asm.Face(TUBE, holes=[circle((0.1, 1.0), 0.5, True), circle((U, 3.0), 0.5, True)]),
        4 * U - pi / 2,
        1,
        6,
        0,
    ),
    "cut twice": (
        lambda: asm.Face(asm.shapes.torus(1.5891826, 0.6356730), holes=[circle((9.9, 1.1), 0.5, True)]),
        U * 1.5891826 * U * 0.6356730 - pi / 4,
        1,
        6,
        0,
    ),
    "window at both seams": (lambda: asm.Face(WHEEL, holes=[circle((0, 0), 0.5, True)]), 4 * U * U - pi / 4, 1, 4, 0),
    "rings": (
        lambda: asm.Face(TUBE, [line((0.3, 1.0), (0.3 + U, 1.0))], [[line((0.5 + U, 2.5), (0.5, 2.5))]]),
        1.5 * U,
        1,
        2,
        0,
    ),
    "a ring and a pole": (lambda: asm.Face(BALL, [line((1.0, 2.0), (1.0 + U, 2.0))]), (pi - 2.0) * U, 1, 2, 1),
    "the other pole": (lambda: asm.Face(BALL, [line((1.0 + U, 2.0), (1.0, 2.0))]), 2.0 * U, 1, 2, 1),
    "ring over the seam of a torus": (
        lambda: asm.Face(WHEEL, [line((0, -1.0), (4 * U, -1.0))], [[line((4 * U, 1.0), (0, 1.0))]]),
        8.0 * U,
        1,
        2,
        0,
    ),
    "ring the other way": (
        lambda: asm.Face(WHEEL, [line((-1.0, U), (-1.0, 0.0))], [[line((1.0, 0), (1.0, U))]]),
        2.0 * U,
        1,
        2,
        0,
    ),
    "patch at both seams": (lambda: asm.Face(WHEEL, circle((0.0, 0.0), 0.5)), pi / 4, 1, 0, 0),
}


@pytest.mark.parametrize("name", CASES)
def test_chains_close_in_the_domain_around_the_region(name):
    make, area, chains, seams, poles = CASES[name]
    surface, found = cut_open(make())
    pieces = [piece for chain in found for piece in chain]
    assert len(found) == chains
    assert [sum(piece.kind == kind for piece in pieces) for kind in (SEAM, POLE)] == [seams, poles]
    low, high = np.array(surface.domain).T
    for chain in found:
        for before, piece in zip(chain[-1:] + chain[:-1], chain, strict=True):
            # Roots of crossings are good to rounding.
            np.testing.assert_allclose(before.ends[1], piece.ends[0], rtol=0, atol=1e-13 * (high - low).max())
            points = piece.curve.control_points
            assert (points >= low - 1e-12).all() and (points <= high + 1e-12).all() or piece.kind == EDGE
            at = piece.curve.evaluate(np.linspace(*piece.curve.domain, 50))
            assert (at >= low - 1e-12).all() and (at <= high + 1e-12).all()
    # Of polygons with thousands of corners.
    assert sum(map(polygon_area, found)) == pytest.approx(area, rel=1e-6)
    # Seams are lines to the last bit, however often they are cut, and their two sides run against each other.
    sides = {axis: set(surface.domain[axis]) for axis in (0, 1)}
    for piece in pieces:
        if piece.kind == SEAM:
            axis = int(np.ptp(piece.ends[:, 1]) == 0.0)
            assert set(piece.ends[:, axis].tolist()) <= sides[axis] and np.ptp(piece.ends[:, axis]) == 0.0
    along = np.array([piece.ends[1] - piece.ends[0] for piece in pieces if piece.kind == SEAM]).reshape(-1, 2)
    np.testing.assert_allclose(along.sum(axis=0), 0.0, atol=1e-12)


def test_a_ring_without_its_other_side_is_open():
    face = asm.Face(TUBE)
    surface, (chain,) = cut_open(face)
    assert [piece.kind for piece in chain].count(EDGE) == 2

    class Broken:
        surface = TUBE
        boundary = face.boundary[:1]
        chains = face.chains[:1]

    with pytest.raises(Uncut, match="open at the seam"):
        cut_open(Broken())


@pytest.mark.parametrize("seed", range(5))
def test_parts_of_curves_are_the_curve(seed):
    random = np.random.default_rng(seed)
    knots = np.concatenate([[0.0] * 4, [0.3, 0.3, 0.7], [1.0] * 4])
    curve = asm.NurbsCurve(random.normal(size=(7, 2)), knots, 3, random.uniform(0.5, 2.0, 7), name="edge 4")
    cuts = [0.2, 0.3, float(random.uniform(0.4, 0.6)), 0.9]
    parts = part_of(curve, cuts)
    assert [part.domain for part in parts] == list(zip([0.0, *cuts], [*cuts, 1.0], strict=True))
    for part in parts:
        t = np.linspace(*part.domain, 11)
        # Knot insertion is convex: rounding alone.
        np.testing.assert_allclose(part.evaluate(t), curve.evaluate(t), rtol=0, atol=1e-14)
        assert part.name == "edge 4"


@pytest.mark.parametrize(("low", "high"), [(0.3, 1.0), (-1.0, 0.5), (5.0, 20.0), (0.0, U), (1.25 * U, 1.75 * U)])
@pytest.mark.parametrize("axis", [0, 1])
def test_strips_are_the_surface_unrolled(axis, low, high):
    scale = (4.0, 1.0)[axis]
    made = strip(WHEEL, axis, scale * low, scale * high)
    assert made.domain[axis] == (scale * low, scale * high)
    assert made.closed[axis] == (high - low == U) and made.closed[1 - axis]
    t, other = np.linspace(scale * low, scale * high, 40), np.linspace(0.0, 1.0, 40)
    at = (t, other) if axis == 0 else (other, t)
    inside = np.where(np.arange(40) < 39, t, t[-1] - 1e-15)
    wrapped = np.mod(inside, scale * U)
    where = (wrapped, other) if axis == 0 else (other, wrapped)
    np.testing.assert_allclose(made.evaluate(*at), WHEEL.evaluate(*where), rtol=0, atol=1e-13)


@pytest.mark.parametrize(("low", "high"), [(0.0, U), (-3.0, 1.0), (0.1, 0.2), (1.0, 6.9)])
def test_turning_is_the_angle_on_rational_arcs(low, high):
    turning = Turning.between(low, high, 2.5)
    ring = arc(turning)
    points, weights = ring.cartesian
    curve = asm.NurbsCurve(points, ring.knots, 2, weights)
    angles = np.linspace(low, high, 101)
    at = np.clip(turning(angles), *curve.domain)
    # Both are exact formulas.
    np.testing.assert_allclose(
        curve.evaluate(at), np.column_stack([np.cos(angles), np.sin(angles)]), rtol=0, atol=1e-14
    )
    assert (np.diff(turning(angles)) > 0.0).all()
    np.testing.assert_allclose(turning(np.array([low, high])), curve.domain, rtol=0, atol=0)
    # Joints are the same number from either side, and go on with the period.
    np.testing.assert_allclose(turning(turning.joints(low, high)), curve.breaks(), rtol=1e-15, atol=1e-15)
    np.testing.assert_allclose(turning(angles + high - low), turning(angles) + 2.5 * (high - low), rtol=1e-13)


def test_nearly_a_turn_is_a_whole_one():
    assert Turning.over(0.5, 0.5 + 0.96 * U, 1.0).high == pytest.approx(0.5 + U, rel=1e-15)
    made = Turning.over(1e-9, U - 1e-9, 1.0)
    assert (made.low, made.spans) == (0.0, 4)
    part = Turning.over(0.0, 3.2, 1.0)
    assert part.low == pytest.approx(-0.1) and part.high == pytest.approx(3.3) and part.spans == 3


def test_approximations_say_how_far_off_they_are():
    def helix(t):
        return np.column_stack([np.cos(3.0 * t), np.sin(3.0 * t), t])

    made, error = approximated(helix, np.array([0.0, 2.0]), 1e-11)
    points, weights = made.cartesian
    curve = asm.NurbsCurve(points, made.knots, made.degree, weights)
    t = np.linspace(0.0, 2.0, 5001)
    worst = np.abs(curve.evaluate(t) - helix(t)).max()
    # The check looks at twenty-two points a piece.
    assert error <= 1e-11 and worst <= 1.2 * error + 1e-15
    np.testing.assert_array_equal(curve.control_points[[0, -1]], helix(np.array([0.0, 2.0])))
    with pytest.raises(Unreadable, match="too sharply"):
        approximated(lambda t: np.abs(t[:, None] - 0.3), np.array([0.0, 1.0]), 1e-12)


def test_a_sharp_turn_is_followed_and_noise_is_not():
    """A line that passes a pole by a millionth, in polar coordinates, and what no curve follows."""

    def past(t):
        return np.column_stack([np.arctan2(t, 1e-6), np.hypot(t, 1e-6)])

    made, _ = approximated(past, np.array([-1.0, 1.0]), 1e-10, lambda at: np.column_stack([at[:, 1], np.ones(len(at))]))
    points, _ = made.cartesian
    t = np.concatenate([-np.geomspace(1e-9, 1.0, 3000), np.geomspace(1e-9, 1.0, 3000)])
    turn, far = asm.NurbsCurve(points, made.knots, made.degree).evaluate(t).T
    assert np.abs(np.column_stack([far * np.cos(turn) - 1e-6, far * np.sin(turn) - t])).max() < 4e-10
    # No corners where stretches were halved.
    spans, legs = np.diff(np.unique(made.knots))[:, None], np.diff(points, axis=0)
    out, into = legs[6:-1:7] / spans[:-1], legs[7::7] / spans[1:]
    assert (np.linalg.norm(into - out, axis=1) <= 1e-6 * np.linalg.norm(out, axis=1)).all()
    calls = []

    def noise(t):
        calls.append(t.size)
        return np.sin(1e9 * t)[:, None]

    with pytest.raises(Unreadable, match="too sharply"):
        approximated(noise, np.array([0.0, 1.0]), 1e-10)
    assert sum(calls) < 1e6


@pytest.mark.parametrize("end", [0, 1])
def test_an_end_that_turns_around_a_pole_moves_nothing_far_from_it(end):
    """A meridian that ends a millionth from the pole, its end moved around that by a tenth of a turn."""
    sphere = asm.shapes.sphere(2.0)
    place = Patch(sphere, Straight(True), Straight(True))
    top = sphere.domain[1][1]
    at = np.linspace(0.5 * top, top - 1e-6, 8)
    points = np.column_stack([np.full(8, 1.0), at])[:: 1 if end else -1]
    given = spline(points, np.repeat([0.0, 1.0], 8), 7)
    ends = [tuple(row) for row in points[[0, -1]].tolist()]
    ends[end] = (1.0 + 0.1 * sphere.domain[0][1], ends[end][1])
    made = moved(given, FREE, *ends, place)
    curves = [asm.NurbsCurve(one.cartesian[0], one.knots, 7) for one in (given, made)]
    assert [tuple(row) for row in curves[1].control_points[[0, -1]].tolist()] == ends
    inner = np.geomspace(1e-9, 1.0, 4000)
    t = 1.0 - inner if end else inner
    both = [sphere.evaluate(*curve.evaluate(t).T) for curve in curves]
    # The end itself moves by 6e-7.
    assert np.abs(both[1] - both[0]).max() < 1e-5


def test_a_line_along_a_pole_begins_where_a_loose_edge_comes_in():
    rows = np.zeros((2, EDGE_SIZE))
    rows[:, LOW : HIGH + 1] = 0.0, 1.0
    # A loose edge up to the pole at v = 3, and the line along that, whose u is off.
    rows[0, :4] = 1.0, 0.0, 1.5, 2.9999
    rows[1, :4] = 4.0, 3.0, 1.0, 3.0
    rows[:, place_of(edge_ends.EDGE, "level")] = FREE, V_LEVEL
    rows[:, place_of(edge_ends.EDGE, "loose")] = LOOSE, POINT
    joints = np.empty((2, 2))
    assert join_ends(rows, np.zeros(2), np.full(2, 1e-12), np.empty((3, 2)), np.empty((2, 2)), joints) > 0
    np.testing.assert_array_equal(joints[1], [1.5, 3.0])


def test_both_sides_of_a_seam_end_at_the_same_places():
    # A cylinder whose lower edge comes back 1e-8 beside and above where it began.
    turn = Turning.over(0.0, U, 1.0)
    where = Patch(TUBE, turn, Straight(True))

    def edge(name, a, b, level):
        return (*a, *b, 0.0, 1.0, 1e-7, level, 1.0, 0.0, 0.0, float(name == "edge 1"))

    rows = {
        "edge 1": edge("edge 1", (U, 1.0), (U, 3.0), U_LEVEL),
        "edge 2": edge("edge 2", (U, 3.0), (0.0, 3.0), V_LEVEL),
        "edge 1 back": edge("edge 1", (0.0, 3.0), (0.0, 1.0), U_LEVEL),
        "edge 3": edge("edge 3", (0.0, 1.0), (U - 1e-8, 1.0 + 2e-8), FREE),
    }
    names = ["edge 1", "edge 2", "edge 1", "edge 3"]
    drawn = Drawn(np.array(list(rows.values())), [None] * 4, names, seams=True, deviation=0.0)
    drawn, made, gap = chained(drawn, where)
    # A unit of the parameter is within a tenth of a unit of length.
    assert gap == pytest.approx(np.sqrt(5.0) * 1e-8, rel=0.1)
    np.testing.assert_array_equal(made[0] + [-U, 0.0], made[2][::-1])
    np.testing.assert_array_equal(np.roll(made[:, 1], 1, axis=0), made[:, 0])
    # Half of the gap each, and half of that again for the other side of the seam.
    assert made[0, 0, 1] == pytest.approx(1.0 + 0.5e-8, abs=1e-15)
    face = asm.Face(TUBE, curves_of(drawn, made, np.ones(2)))
    assert len(face.boundary) == 2


@pytest.mark.parametrize("move", [1e-12, 1e-7, 1e-5])
@pytest.mark.parametrize("end", [0, 1])
def test_an_end_that_is_moved_by_more_than_the_first_leg_does_not_turn_back(move, end):
    """A short span at the end, as where a seam is next to it, and a corner of the file beside."""
    x = np.concatenate([np.linspace(0.0, 1e-8, 4), np.linspace(1e-8, 1.0, 4)[1:]])
    points = np.column_stack([x, 0.1 * x * x, np.ones(7)])
    knots = np.array([0.0, 0.0, 0.0, 0.0, 1e-8, 1e-8, 1e-8, 1.0, 1.0, 1.0, 1.0])
    if end:
        points, knots = points[::-1].copy(), 1.0 - knots[::-1]
    given = spline(points[:, :2], knots, 3)
    ends = [tuple(row) for row in given.cartesian[0][[0, -1]].tolist()]
    ends[end] = (move, move)
    made = moved(given, FREE, *ends)
    assert [tuple(row) for row in made.cartesian[0][[0, -1]].tolist()] == ends
    ways = np.diff(made.cartesian[0], axis=0) * (-1.0 if end else 1.0)
    # No leg goes back: of those along which the move is spread each has nine tenths left.
    assert (ways[:, 0] > 0.0).all()
    assert np.abs(made.cartesian[0] - given.cartesian[0]).max() <= move * (1.0 + 1e-12)
