"""Rows of a loop with corners: each is of a smooth side, through a corner and beyond it, with exact derivatives."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.model.trim_contact import FORMS
from assembly.constraints.program import records as layout
from assembly.constraints.program.trim_corners import trim_sides
from assembly.geometry.faces.loop_sides import loop_sides
from assembly.geometry.splines.curve import NurbsCurve
from tests.laws.loop_point import LoopPoint, moved
from tests.laws.test_trim_rows import as_vectors, differences
from tests.laws.trim_scenes import FreePoint, arcs, polygon, spline, trim_scene

# Convex corners by turns in and out of reach, sides straight and bent.
PLACES = [(60 + k, ("polygon", "arcs")[k % 2], "ab"[k // 2 % 2], k % 3 == 0) for k in range(4)]


def chosen(point, y=None, least=0.0):
    """The sides that a solve chooses at a point, with the multipliers `y`; and what becomes of these."""
    y = np.zeros(point.rows) if y is None else np.array(y, dtype=float)
    proposed = y.copy()
    iterate, pairs = tuple(point.point), tuple(point.loose)
    trim_sides((point.table, point.pool), pairs, iterate, least, y, proposed)
    np.testing.assert_array_equal(y, proposed)
    return point.point.tracked[int(point.table[layout.FIRST_SIDE]) :, 0].copy(), y


def corner_of(made):
    """The corner of the loop that is nearest to the contact."""
    corners = np.array([curve.evaluate(curve.domain[0]) for curve in made.curves])
    return corners[np.argmin(np.linalg.norm(corners - made.uv, axis=1))]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("place", PLACES, ids=str)
def test_gradients_next_to_a_corner(place, form):
    """Of a contact that is tracked, next to a corner, inside and outside."""
    seed, loop, side, inside = place
    made = trim_scene(seed, "ellipsoid", loop, side, form, gap=0.03, inside=inside, corner=True)
    sides, _y = chosen(made.at(made.q))
    assert sides[0] > 0.0 and sides[1] > 0.0
    point = made.at(made.q, sides=sides)
    ways = np.linalg.qr(np.random.default_rng(seed).normal(size=(12, 12)))[0]

    def rows(steps):
        return made.at(moved(made.scene, made.q, ways @ steps), point.tracked[0, :4], sides).residual

    found = point.jacobian() @ ways
    assert np.abs(found[1]).max() > 0.1 and np.abs(found[-1]).max() > 0.1
    # A twentieth of the distance from the corner: through it curvatures jump.
    np.testing.assert_allclose(found, differences(rows, 12, 1e-4), rtol=0, atol=1e-8)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("place", PLACES, ids=str)
def test_gradients_where_the_contact_is_free(place, form):
    """In the corner, in the extension of each side, and anywhere near; vectors by their components.

    Their lengths have a sign of their own only where the pair is extremal.
    """
    seed, loop, side, inside = place
    made = as_vectors(trim_scene(seed, "ellipsoid", loop, side, form, gap=0.03, inside=inside, corner=True))
    sides, _y = chosen(made.at(made.q))
    rng = np.random.default_rng(seed)
    ways = np.linalg.qr(rng.normal(size=(16, 16)))[0]
    radius = np.linalg.norm(corner_of(made) - made.uv) / 0.1
    for off in (0.0, 0.05, 0.05):
        x = made.x.copy()
        x[2 * made.side : 2 * made.side + 2] = corner_of(made) + off * radius * rng.normal(size=2)
        point = FreePoint(made, made.q, x, sides=sides)

        def rows(steps, x=x, lengths=point.lengths):
            d = ways @ steps
            return FreePoint(made, moved(made.scene, made.q, d[:12]), x + d[12:] / lengths[0], lengths, sides).residual

        # At the corner the second derivative jumps: a difference is of first order.
        step, allowed = (1e-4, 1e-7) if off else (1e-6, 2e-5)
        np.testing.assert_allclose(point.jacobian() @ ways, differences(rows, 16, step), rtol=0, atol=allowed)


@pytest.mark.parametrize("place", PLACES, ids=str)
def test_hessians_of_both_rows(place):
    seed, loop, side, inside = place
    made = trim_scene(seed, "ellipsoid", loop, side, "signed", inside=inside, corner=True)
    sides, _y = chosen(made.at(made.q))
    point = FreePoint(made, made.q, made.x, sides=sides)
    ways = np.linalg.qr(np.random.default_rng(seed).normal(size=(16, 16)))[0]
    y = np.zeros(point.rows)
    y[1:3] = 0.7, -0.4

    def slopes(steps):
        d = ways @ steps
        x = made.x + d[12:] / point.lengths[0]
        at = FreePoint(made, moved(made.scene, made.q, d[:12]), x, point.lengths, sides)
        return y[1:3] @ at.jacobian()[1:3]

    expected = differences(slopes, 16, 1e-4) @ ways.T
    found = point.row_terms(y, np.zeros(point.rows))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)
    if loop == "polygon":
        # Straight, and so are extensions.
        assert np.abs(found).max() == 0.0


LOOPS = {
    "square": polygon([(-2, -2), (2, -2), (2, 2), (-2, 2)]),
    "clockwise": polygon([(-2, 2), (2, 2), (2, -2), (-2, -2)]),
    "one polyline": [NurbsCurve([(-2, -2), (2, -2), (0, 0), (2, 2), (-2, 2), (-2, -2)], [0, 0, 1, 2, 3, 4, 5, 5], 1)],
    "raised": [
        NurbsCurve([(-2, -2), (2, -2), (0, 0), (2, 2), (-2, 2), (-2, -2)], [0, 0, 1, 2, 3, 4, 5, 5], 1).elevate(3)
    ],
    "arcs outward": arcs([(-2, -2), (2, -2), (2, 2), (-2, 2)], 0.2),
    "arcs inward": arcs([(-2, -2), (2, -2), (2, 2), (-2, 2)], -0.2),
    "lens": arcs([(-2, 0), (2, 0)], 0.3),
    "drop": [NurbsCurve([(-2, 0), (3, -3), (3, 3), (-2, 0)], [0, 0, 0, 0, 1, 1, 1, 1], 3)],
    "mouth": [
        *arcs([(1.5, 1.5), (-2, 0), (1.5, -1.5)], 0.4)[:2],
        *polygon([(1.5, -1.5), (0.0, 0.0), (1.5, 1.5)])[:2],
    ],
}


def length_of(points):
    """Of a line through points."""
    return np.linalg.norm(np.diff(points, axis=0), axis=1).sum()


@pytest.mark.parametrize("name", LOOPS)
def test_sides_are_the_loop(name):
    """Between corners: on the loop point by point, at each end straight on, turning as the loop does."""
    face = asm.Face(asm.shapes.plane(20.0, 20.0), LOOPS[name])
    sides, stretches = loop_sides(face.boundary, face.chains, (0.0, 0.0))
    assert len(sides) >= 2
    total = sum(length_of(curve.evaluate(np.linspace(*curve.domain, 4001))) for curve in face.boundary)
    lengths = 0.0
    for k, side in enumerate(sides):
        t = np.linspace(side.start, side.end, 4001)
        points = side.curve.evaluate(t)
        lengths += length_of(points)
        assert np.abs(face.trim_distance(points[::50, 0], points[::50, 1])).max() < 1e-14 * 4e1
        assert sides[side.after].before == k and sides[side.after].turn_before == side.turn_after
        eps = 1e-9 * (side.end - side.start)
        for at in (side.start, side.end):
            before, after = (side.curve.evaluate(at + sign * eps, 1)[1] for sign in (-1, 1))
            # The direction and the speed of an extension are those of the end.
            np.testing.assert_allclose(before, after, rtol=0, atol=1e-7 * np.abs(after).max())
        outside = side.curve.evaluate(np.linspace(side.end + 1e-3 * eps, side.curve.domain[1], 9))
        along = outside - points[-1]
        assert np.linalg.norm(along[-1]) > 1e-3
        assert abs(along[3, 0] * along[-1, 1] - along[3, 1] * along[-1, 0]) < 1e-13
        # The loop goes on inside of the tangent where it turns left, outside where it turns right.
        way, following = along[-1], sides[side.after].curve.evaluate(sides[side.after].start + 1e6 * eps) - points[-1]
        turn = way[0] * following[1] - way[1] * following[0]
        if side.turn_after:
            assert np.sign(turn) == side.turn_after
        # Nothing else of the side is as near to its extension as its end.
        near = np.linalg.norm(points[:, None] - outside[None], axis=2).min(axis=0)
        np.testing.assert_allclose(near, np.linalg.norm(along, axis=1), rtol=0, atol=2e-2)
    # By sums of chords.
    assert lengths == pytest.approx(total, rel=1e-5)
    for stretch in stretches:
        t = np.linspace(stretch.start, stretch.end, 5)
        points = face.boundary[stretch.curve].evaluate(t)
        side = sides[stretch.side].curve.evaluate(np.linspace(sides[stretch.side].start, sides[stretch.side].end, 4001))
        assert np.linalg.norm(points[:, None] - side[None], axis=2).min(axis=1).max() < 1e-2


def test_smooth_loops_have_none():
    rng = np.random.default_rng(0)
    for loop in (spline(rng, np.zeros(2), 2.0), arcs([(-2, 0), (0, -2), (2, 0), (0, 2)], 0.5 * np.tan(np.pi / 8))):
        face = asm.Face(asm.shapes.plane(20.0, 20.0), loop)
        assert loop_sides(face.boundary, face.chains, (0.0, 0.0)) == ([], [])


def at_corner(keep, turn, y, form="signed"):
    """The sides at a corner of a loop that turns left or right there, before and after multipliers y of its rows."""
    points = [(-4, -4), (4, -4), (0, 0), (4, 4), (-4, 4)]
    ground = asm.Body("ground", asm.Face(asm.shapes.plane(20.0, 20.0)), fixed=True)
    place = (4.0, 4.0) if turn > 0 else (0.0, 0.0)
    ball = asm.Body("ball", asm.shapes.sphere(1.0), position=(*place, 1.0))
    scene = asm.Assembly([ground, ball])
    contact = asm.Contact(ground, ball)
    scene.constrain(contact, asm.TrimContact(contact, polygon(points), keep, form))
    point = LoopPoint(scene, scene.q)
    first, _ = chosen(point)
    point = LoopPoint(scene, scene.q, point.tracked)
    given = np.zeros(point.rows)
    given[1], given[-1] = y
    after, y = chosen(point, given)
    return first, after, y[[1, -1]]


@pytest.mark.parametrize("turn", [1, -1])
def test_a_contact_goes_on_around_a_corner_where_it_gains(turn):
    """Not where both rows push, and not along its own side."""
    first, after, y = at_corner("on", turn, (-0.3 * turn, -0.2))
    assert first[1] * turn > 0.0
    np.testing.assert_array_equal(after, first)
    np.testing.assert_array_equal(y, [-0.3 * turn, -0.2])
    _first, after, y = at_corner("on", turn, (0.3 * turn, 0.0))
    np.testing.assert_array_equal(after, first)
    first, after, y = at_corner("on", turn, (0.3 * turn, -0.2))
    # The other side's equation, and this one's inequality without a force.
    np.testing.assert_array_equal(after, [abs(first[1]), turn * first[0]])
    np.testing.assert_array_equal(y, [-0.2 * turn, 0.0])


def test_one_sided_rows_are_two_where_the_corner_is_convex():
    for keep, turn in (("inside", 1), ("outside", -1)):
        first, after, y = at_corner(keep, turn, (-0.3, -0.2))
        assert first[1] * turn > 0.0
        np.testing.assert_array_equal(after, first)
        np.testing.assert_array_equal(y, [-0.3, -0.2])
        first, _after, _y = at_corner(keep, -turn, (0.0, 0.0))
        # Around a reflex one the distance is that of the loop, as from a point.
        assert first[1] == 0.0
