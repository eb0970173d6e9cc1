from __future__ import annotations

import numpy as np
import pytest

from assembly.errors import InputError
from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.faces.loop import Loop
from assembly.geometry.faces.relinked import _are_near, _distances
from assembly.geometry.splines.curve import NurbsCurve
from tests.geometry.loops import circle, polygon, polyline, random_face, segment

PLANE = shapes.plane(10.0, 10.0)
CYLINDER = shapes.cylinder(1.0, 2.0)
AROUND = 2.0 * np.pi  # the period of u of CYLINDER and of the sphere of radius one
SQUARE = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))


def test_a_loop_joins_its_curves_and_knows_its_area():
    loop = Loop(polygon(*SQUARE))
    assert len(loop.curves) == 4 and not loop.turn.any()
    assert loop.area == pytest.approx(4.0, abs=1e-15)
    back = loop.reversed()
    assert back.area == pytest.approx(-4.0, abs=1e-15)
    np.testing.assert_array_equal(back.curves[0].control_points[0], loop.curves[-1].control_points[-1])
    # A circle is rational: eight nodes a quarter leave less than 1e-11 of its area.
    assert Loop(circle((100.0, 50.0), 2.0)).area == pytest.approx(4.0 * np.pi, rel=1e-9)
    assert "4 curves" in repr(loop)


@pytest.mark.parametrize("gap", [1e-10, 9e-8])
def test_small_gaps_are_closed_exactly(gap):
    curves = polygon(*SQUARE)
    points = curves[1].control_points + [gap, 0.0]
    curves[1] = NurbsCurve(points, curves[1].knots, 1)
    loop = Loop(curves, tolerance=1e-7)
    ends = [curve.control_points[[0, -1]] for curve in loop.curves]
    for before, after in zip(ends, ends[1:] + ends[:1], strict=True):
        np.testing.assert_array_equal(before[1], after[0])
    np.testing.assert_allclose(ends[1][0], [1.0 + 0.5 * gap, -1.0], rtol=0, atol=1e-15)
    assert Face(PLANE, loop).locate(0.0, 0.0) == 1
    if gap > 1e-8:
        with pytest.raises(InputError, match=r"loop is open: a gap of 9e-08 between curves 0 and 1"):
            Loop(curves)


def test_an_unclamped_curve_gets_ends_that_can_be_moved():
    # A periodic uniform cubic on twelve points of a circle, closed without a clamped end.
    angle = np.arange(15) * np.pi / 6.0
    points = np.column_stack([np.cos(angle), np.sin(angle)])
    curve = NurbsCurve(points, np.arange(19.0), 3)
    loop = Loop(curve)
    t = np.linspace(3.0, 15.0, 50)
    np.testing.assert_allclose(loop.curves[0].evaluate(t), curve.evaluate(t), rtol=0, atol=1e-15)
    np.testing.assert_array_equal(*loop.curves[0].control_points[[0, -1]])


def test_a_loop_may_turn_once_around():
    ring = Loop(segment((0.0, 1.0), (AROUND, 1.0)))
    np.testing.assert_array_equal(ring.turn, [AROUND, 0.0])
    np.testing.assert_array_equal(ring.reversed().turn, [-AROUND, 0.0])
    # Drawn in two sheets.
    parts = [segment((0.0, 1.0), (4.0, 1.5)), segment((4.0 - 2 * AROUND, 1.5), (-AROUND, 1.0))]
    sheets = Loop(parts, period=(AROUND, 0.0))
    np.testing.assert_allclose(sheets.turn, [AROUND, 0.0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(sheets.curves[1].control_points[0], [4.0, 1.5], rtol=0, atol=1e-14)


def test_seams_are_no_crossings_of_a_loop():
    loop = Loop(seamed(0.5, 1.5), tolerance=1e-7, period=(AROUND, 0.0))
    assert not loop.turn.any()
    assert len(Face(CYLINDER, loop).boundary) == 2


@pytest.mark.parametrize(
    ("curves", "text"),
    [
        ([], "loop is empty"),
        ([segment((0, 0), (1, 1))], r"loop is open: a gap of 1\.41 between its end and its start"),
        ([segment((0, 0), (2, 0)), segment((2, 0.1), (0, 0))], r"a gap of 0\.1 between curves 0 and 1"),
        (segment((1.0, 1.0), (1.0, 1.0)), "single point"),
        (NurbsCurve([[0, 0, 0], [1, 1, 1]], [0, 0, 1, 1], 1), r"loop\[0\] is a curve in space"),
        (polyline((0, 0), (1, 1), (1, 0), (0, 1)), r"loop crosses or touches itself near \(u, v\) = \(0\.5, 0\.5\)"),
    ],
    ids=["empty", "open", "gap", "point", "space", "crossing"],
)
def test_bad_loops_are_refused(curves, text):
    with pytest.raises(InputError, match=text):
        Loop(curves)
    with pytest.raises(TypeError, match=r"loop\[0\] is 'circle'"):
        Loop(["circle"])


@pytest.mark.parametrize(
    "period", [[], {}, "x", 3, np.array([1.0]), np.array([np.nan, 0, 0]), (1.0, -1.0), (1.0, np.inf)]
)
def test_bad_periods_are_refused(period):
    with pytest.raises(InputError, match="^period.* expected "):
        Loop(segment((0.0, 0.0), (1.0, 0.0)), period=period)


def eight():
    points = [[0, 0], [2, 2], [-2, 2], [0, 0], [-2, -2], [2, -2], [0, 0]]
    return NurbsCurve(points, [0, 0, 0, 0, 1, 1, 1, 2, 2, 2, 2], 3)


SPIKE = polygon((0, 0), (2, 0), (3, 0), (2, 0), (1, 1))


@pytest.mark.parametrize(
    ("outer", "holes", "text"),
    [
        (polyline((0, 0), (1, 1), (1, 0), (0, 1)), [], "outer crosses or touches itself"),
        (SPIKE, [], "outer crosses or touches itself"),
        (
            circle((0, 0), 3),
            [circle((0, 0), 1), eight()],
            r"holes\[1\] crosses or touches itself|holes\[1\] crosses or touches holes\[0\]",
        ),
        (circle((0, 0), 3), [circle((2.5, 0), 1)], r"holes\[0\] crosses or touches outer"),
        (circle((0, 0), 3), [circle((0, 0), 3)], r"holes\[0\] crosses or touches outer"),
        (circle((0, 0), 3), [circle((0, 0), 3 - 1e-9)], r"holes\[0\] crosses or touches outer"),
        (circle((0, 0), 3), [circle((2.01, 0), 1)], r"holes\[0\] crosses or touches outer"),
        (circle((0, 0), 3), [circle((0.9, 0), 1), circle((-0.9, 0), 1)], r"holes\[1\] crosses or touches holes\[0\]"),
        (circle((0, 0), 1), [circle((2.5, 0), 1)], r"holes\[0\] does not bound one face"),
        (circle((0, 0), 4), [circle((0, 0), 2), circle((0, 0), 1)], r"holes\[1\] does not bound one face"),
        # In lists, as files have them, and run so that each has material on its left.
        ([circle((0, 0), 1)], [[circle((2.5, 0), 1)]], r"holes\[0\] does not bound one face"),
        ([circle((0, 0), 4)], [[circle((0, 0), 2).reversed()], [circle((0, 0), 1)]], r"holes\[1\] does not"),
        ([circle((0, 0), 1).reversed()], [[circle((0, 0), 4)]], "a hole goes around outer"),
        (circle((0, 0), 1), [circle((0, 0), 4)], "a hole goes around outer"),
        (circle((4.5, 0), 1), [], r"outer leaves the domain: curve 0 has u from 3\.5 to 5\.5"),
        (polygon((0, 0), (1, 0), (0, 1))[:2], [], "outer is open"),
        (segment((-1, 0), (1, 0)), [], "outer is open: a gap of 2"),
        (circle((0, 0), 3), [[segment((0, 0), (1, 0))]], r"holes\[0\] is open"),
    ],
)
def test_faces_name_the_loop_that_does_not_fit(outer, holes, text):
    with pytest.raises(InputError, match=text):
        Face(PLANE, outer, holes)


@pytest.mark.parametrize("apart", [1e-5, 1e-7])
def test_loops_may_come_near_one_another(apart):
    face = Face(
        PLANE,
        circle((0, 0), 3),
        [
            circle((0, 0), 3 - apart),
        ],
    )
    assert face.locate(3.0 - 0.5 * apart, 0.0) == 1
    assert face.locate(0.0, 0.0) == -1
    face = Face(PLANE, circle((0, 0), 3), [circle((2.0 - apart, 0), 1)])
    assert face.locate(3.0 - 0.5 * apart, 0.0) == 1


@pytest.mark.parametrize(
    "outer",
    [
        polyline((0, 0), (1, 0), (1, 1), (0, 1)),
        NurbsCurve([[0, 0], [3, 3], [-3, 3], [0, 0]], [0, 0, 0, 0, 1, 1, 1, 1], 3),  # a corner where it closes
        # Two arcs that meet tangentially at both ends, one inside the other.
        [
            NurbsCurve([[0, -2], [4, -2], [4, 2], [0, 2]], [0] * 4 + [1] * 4, 3),
            NurbsCurve([[0, 2], [2, 2], [2, -2], [0, -2]], [0] * 4 + [1] * 4, 3),
        ],
        polygon((0, 0), (2, 0), (0, 2e-6)),
    ],
    ids=["square", "drop", "crescent", "needle"],
)
def test_corners_are_not_crossings(outer):
    Face(PLANE, outer)


def test_many_loops_of_random_kind_are_accepted():
    rng = np.random.default_rng(0)
    for _ in range(20):
        face = random_face(rng, PLANE)
        assert [len(chain) for chain in face.chains] == [1, 1, 1, 1]


def test_loops_are_turned_so_that_material_is_on_the_left():
    for turned in (False, True):
        outer, hole = circle((0, 0), 3), circle((0, 0), 1)
        if turned:
            outer, hole = outer.reversed(), hole.reversed()
        face = Face(PLANE, outer, [hole])
        assert face.outer.area > 0.0 and face.holes[0].area < 0.0
        np.testing.assert_array_equal(face.locate([0.0, 2.0, 4.0], 0.0), [-1, 1, -1])
        assert [list(chain) for chain in face.chains] == [[0], [1]]


def test_the_edge_of_the_domain_is_the_boundary_of_a_face_without_loops():
    face = Face(PLANE)
    assert face.outer is None and face.holes == ()
    assert [list(chain) for chain in face.chains] == [[0, 1, 2, 3]]
    corners = [curve.control_points[0].tolist() for curve in face.boundary]
    assert corners == [[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]]
    assert [list(chain) for chain in Face(CYLINDER).chains] == [[0], [1]]
    assert [list(chain) for chain in Face(shapes.cone(1.0, 2.0)).chains] == [[0]]
    for closed in (shapes.sphere(1.0), shapes.torus(3.0, 1.0)):
        assert Face(closed).boundary == () and Face(closed).chains == ()
    # A quarter of a sphere: two edges run from pole to pole, and the poles are no edges.
    ball = shapes.sphere(1.0)
    quarter = type(ball)(
        ball.control_points[:3], (ball.knots[0][[0, 0, 0, 3, 3, 3]], ball.knots[1]), (2, 2), ball.weights[:3]
    )
    assert [list(chain) for chain in Face(quarter).chains] == [[0], [1]]


def seamed(low, high, sheet=0.0):
    """A stretch of a cylinder as CAD files have it: ring, seam, ring, seam."""
    a, b = sheet, sheet + AROUND
    return polygon((a, low), (b, low), (b, high), (a, high))


@pytest.mark.parametrize("sheet", [0.0, -3.0 * AROUND, 1.0])
@pytest.mark.parametrize("turned", [False, True])
def test_seams_cancel(sheet, turned):
    curves = seamed(0.5, 1.5, sheet)
    if turned:
        curves = [curve.reversed() for curve in curves[::-1]]
    face = Face(CYLINDER, curves, [circle((AROUND, 1.0), 0.3)])
    assert [list(chain) for chain in face.chains] == [[0], [1], [2]]
    assert len(face.outer.curves) == 4
    u, v = np.array([0.1, 1.0, 1.0, 1.0, -0.1, AROUND + 0.35]), np.array([1.0, 1.0, 0.4, 1.6, 1.0, 1.0])
    np.testing.assert_array_equal(face.locate(u, v), [-1, 1, -1, -1, -1, 1])


def test_a_seam_in_two_curves_cancels():
    a, b = 0.0, AROUND
    curves = polygon((a, 0.5), (b, 0.5), (b, 0.9), (b, 1.5), (a, 1.5), (a, 0.9))
    assert [list(chain) for chain in Face(CYLINDER, curves).chains] == [[0], [1]]


def test_pole_edges_are_dropped():
    ball = shapes.sphere(1.0)
    face = Face(ball, seamed(1.0, np.pi))
    assert len(face.boundary) == 1
    np.testing.assert_array_equal(face.locate(0.3, [0.5, 1.0, 2.0, np.pi]), [-1, 0, 1, 1])
    # All of it: nothing is left of the loop.
    assert Face(ball, seamed(0.0, np.pi)).boundary == ()
    assert Face(ball, seamed(0.0, np.pi)).locate(0.0, 0.0) == 1
    wedge = Face(ball, polygon((1.0, 0.0), (2.0, 0.0), (2.0, np.pi), (1.0, np.pi)))
    assert [list(chain) for chain in wedge.chains] == [[0], [1]]
    np.testing.assert_array_equal(wedge.locate([1.5, 0.5, 1.5, 1.0], [1.0, 1.0, 0.0, 2.0]), [1, -1, 1, 0])


def test_rings_say_by_their_direction_which_side_is_material():
    ball = shapes.sphere(1.0)
    up = Face(ball, segment((0.0, 1.0), (AROUND, 1.0)))
    down = Face(ball, segment((AROUND, 1.0), (0.0, 1.0)))
    v = np.array([0.0, 0.5, 1.0, 2.0, np.pi])
    np.testing.assert_array_equal(up.locate(0.3, v), [-1, -1, 0, 1, 1])
    np.testing.assert_array_equal(down.locate(0.3, v), [1, 1, 0, -1, -1])
    band = Face(CYLINDER, segment((1.0, 0.5), (1.0 + AROUND, 0.5)), [segment((0.0, 1.5), (-AROUND, 1.5))])
    np.testing.assert_array_equal(band.locate(0.3, [0.0, 0.5, 1.0, 1.5, 2.0]), [-1, 0, 1, 0, -1])


@pytest.mark.parametrize(
    ("outer", "holes", "text"),
    [
        (segment((0, 0.5), (AROUND, 0.5)), [], "outer has material up to the end of the domain at v = 2"),
        (segment((AROUND, 0.5), (0, 0.5)), [], "outer has material up to the end of the domain at v = 0"),
        (segment((0, 0.5), (AROUND, 0.5)), [segment((0, 1.5), (AROUND, 1.5))], r"holes\[0\] does not bound one face"),
        (segment((0, 0.5), (0.5 * AROUND, 0.5)), [], "outer is open: a gap of 3.14"),
        (None, [circle((0, 1), 0.3), circle((AROUND + 0.2, 1), 0.3)], r"holes\[1\] crosses or touches holes\[0\]"),
        (None, [polygon((0, 0.5), (8, 0.5), (8, 1.5), (0, 1.5))], r"holes\[0\] crosses or touches itself"),
        (segment((0, 0.5), (2 * AROUND, 0.5)), [], "turns .* times around"),
    ],
)
def test_loops_around_a_cylinder_are_checked_in_all_sheets(outer, holes, text):
    with pytest.raises(InputError, match=text):
        Face(CYLINDER, outer, holes)


def test_curves_a_little_beyond_the_domain_are_clamped():
    slip = 5e-9
    face = Face(PLANE, polygon((-5 - slip, -5), (5, -5 - slip), (5, 5 + slip), (-5, 5)))
    points = np.concatenate([curve.control_points for curve in face.boundary])
    assert np.abs(points).max() == 5.0


def test_arguments_of_another_kind_are_named():
    with pytest.raises(TypeError, match="outer is 3"):
        Face(PLANE, 3)
    for holes in (3, None, segment((0, 0), (1, 1))):
        with pytest.raises(TypeError, match="holes is .*; expected a sequence of loops"):
            Face(PLANE, None, holes)
    with pytest.raises(TypeError, match=r"holes\[0\]\[0\] is 'x'"):
        Face(PLANE, None, [["x"]])
    with pytest.raises(InputError, match="u is nan"):
        Face(PLANE).locate(np.nan, 0.0)
    with pytest.raises(InputError, match=r"v is inf"):
        Face(PLANE).trim_distance(0.0, [0.0, np.inf])
    with pytest.raises(InputError, match="shapes that broadcast"):
        Face(PLANE).locate([0.0, 1.0], [0.0, 1.0, 2.0])
    with pytest.raises(InputError, match="has no boundary"):
        Face(shapes.torus(3.0, 1.0)).nearest_on_boundary(0.0, 0.0)


def cusp(dip):
    """A side, and a curve back to where it began that comes there along it, from below by a dip."""
    back = NurbsCurve([(8, 0), (8, 6), (4, -dip), (0, 0)], [0, 0, 0, 0, 1, 1, 1, 1], 3)
    return [NurbsCurve([(0, 0), (8, 0)], [0, 0, 1, 1], 1), back]


def test_curves_may_cross_by_rounding_where_they_leave_a_corner_along_one_tangent():
    plane = shapes.plane(40.0, 40.0)
    # They cross at u = 2 dip, and are 3 dip^2 / 72 in each other before.
    for dip in (0.0, 1e-9, 1e-5, 1e-4):
        face = Face(plane, cusp(dip), tolerance=1e-8)
        assert face.area() == pytest.approx(Face(plane, cusp(-1e-3)).area(), rel=1e-3)
        assert len(face.boundary) == 2
    with pytest.raises(InputError, match="crosses or touches itself"):
        Face(plane, cusp(0.5), tolerance=1e-8)


@pytest.mark.parametrize("periods", [(0.0, 0.0), (7.0, 0.0), (7.0, 5.0)])
def test_points_near_a_polygon_are_told_as_by_all_its_sides(periods):
    random = np.random.default_rng(5)
    answers = []
    for spread in np.linspace(0.8, 1.4, 40):
        polygon = np.cumsum(random.normal(size=(12, 2)), axis=0)
        part = random.uniform(size=(40, 1))
        k = random.integers(11, size=40)
        at = polygon[k] + part * (polygon[k + 1] - polygon[k])
        way = random.normal(size=at.shape)
        at += spread * random.uniform(size=part.shape) * way / np.linalg.norm(way, axis=1)[:, None]
        at += np.array(periods) * random.integers(-2, 3, size=at.shape)
        apart = at[:, None] - polygon
        for axis in (0, 1):
            if periods[axis]:
                apart[..., axis] -= periods[axis] * np.round(apart[..., axis] / periods[axis])
        answers.append(bool((_distances(apart) <= 1.0).all()))
        assert _are_near(at, polygon, np.array(periods)) == answers[-1]
    assert True in answers and False in answers
