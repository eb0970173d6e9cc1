from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import pytest

from assembly.geometry import shapes
from assembly.geometry.faces.face import BoundaryPoint, Face
from assembly.geometry.faces.trim import locate_points
from assembly.geometry.faces.trim_nearest import nearest_points
from assembly.geometry.faces.trim_pieces import trim_at
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.evaluate import CURVE_RECORD
from assembly.geometry.splines.surface import NurbsSurface
from tests.geometry.loops import circle, polygon, polyline, random_face, segment

PLANE = shapes.plane(10.0, 10.0)
CYLINDER = shapes.cylinder(1.0, 2.0)
AROUND = 2.0 * np.pi
# Coordinates are a few units; their roundings are what is left.
ROUNDING = 4e-15

# An L: five convex corners and one reflex one at the origin.
ELL = ((-2.0, -2.0), (2.0, -2.0), (2.0, 0.0), (0.0, 0.0), (0.0, 2.0), (-2.0, 2.0))


def test_side_and_distance_of_an_annulus():
    face = Face(PLANE, circle((0, 0), 3), [circle((0.5, 0.2), 1)])
    u, v = np.random.default_rng(0).uniform(-4, 4, (2, 5000))
    outer, inner = 3.0 - np.hypot(u, v), np.hypot(u - 0.5, v - 0.2) - 1.0
    distance = np.minimum(outer, inner)
    np.testing.assert_array_equal(face.locate(u, v), np.sign(distance))
    np.testing.assert_array_equal(face.contains(u, v), distance >= 0)
    np.testing.assert_allclose(face.trim_distance(u, v), distance, rtol=0, atol=ROUNDING)
    near = face.nearest_on_boundary(u, v)
    assert isinstance(near, BoundaryPoint)
    np.testing.assert_array_equal(near.curve, np.where(outer < inner, 0, 1))
    for k, curve in enumerate(face.boundary):
        mine = near.curve == k
        np.testing.assert_allclose(curve.evaluate(near.t[mine]), near.point[mine], rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(np.hypot(*(near.point.T - [u, v])), np.abs(distance), rtol=0, atol=ROUNDING)


def test_arrays_broadcast():
    face = Face(PLANE, circle((0, 0), 3))
    assert face.locate(0.0, 0.0).shape == ()
    u, v = np.zeros((3, 1)), np.zeros(4)
    for method in (face.locate, face.contains, face.trim_distance, face.space_distance):
        assert method(u, v).shape == (3, 4)
    near = face.nearest_on_boundary(u, v)
    assert near.distance.shape == near.curve.shape == near.t.shape == (3, 4) and near.point.shape == (3, 4, 2)
    assert face.locate([], []).shape == (0,)


@pytest.mark.parametrize("outer", [polygon(*ELL), polyline(*ELL)], ids=["segments", "one curve"])
def test_signs_at_convex_and_reflex_corners(outer):
    face = Face(PLANE, outer)
    # Around the reflex corner: nearest to it is the material beyond it, on the diagonal the other way it is not.
    for radius in (1e-9, 1e-3, 0.5):
        angle = np.array([-135.0, -95.0, -170.0, 45.0, 10.0, 80.0]) * np.pi / 180.0
        u, v = radius * np.cos(angle), radius * np.sin(angle)
        wanted = radius * np.array([1, 1, 1, -np.sin(np.pi / 4), -np.sin(angle[4]), -np.cos(angle[5])])
        np.testing.assert_allclose(face.trim_distance(u, v), wanted, rtol=1e-12, atol=ROUNDING * 1e-1)
        np.testing.assert_array_equal(face.locate(u, v), [1, 1, 1, -1, -1, -1])
    # Outside a convex corner.
    np.testing.assert_allclose(face.trim_distance([2.3, -2.3], [-2.4, 2.4]), -0.5, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(face.trim_distance([1.9, 2.1], [-1.0, -1.0]), [0.1, -0.1], rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("outer", [polygon(*ELL), polyline(*ELL)], ids=["segments", "one curve"])
def test_corners_edges_and_their_levels_are_no_exceptions(outer):
    face = Face(PLANE, outer)
    corners = np.array(ELL)
    assert (face.locate(*corners.T) == 0).all()
    middles = 0.5 * (corners + np.roll(corners, -1, axis=0))
    assert (face.locate(*middles.T) == 0).all()
    # Points level with corners and edges, where a ray would run through them.
    grid = np.linspace(-3.0, 3.0, 25)
    u, v = (x.ravel() for x in np.meshgrid(grid, grid))
    inside = (np.abs(u) < 2) & (np.abs(v) < 2) & ((u < 0) | (v < 0))
    on = (face.trim_distance(u, v) == 0) | (np.abs(face.trim_distance(u, v)) < 1e-13)
    np.testing.assert_array_equal(face.locate(u, v), np.where(on, 0, np.where(inside, 1, -1)))
    assert on.sum() > 40


def test_what_is_nearer_than_a_billionth_of_a_thousandth_of_the_size_is_on():
    face = Face(PLANE, circle((0, 0), 3))
    size = np.hypot(6.0, 6.0)
    angle = np.linspace(0.0, AROUND, 1000)
    for off, side in ((0.9e-12, 0), (-0.9e-12, 0), (1.1e-12, -1), (-1.1e-12, 1)):
        radius = 3.0 + off * size
        assert (face.locate(radius * np.cos(angle), radius * np.sin(angle)) == side).all()


def test_the_center_of_a_circle_is_as_far_from_all_of_it():
    face = Face(PLANE, circle((0.5, -0.25), 2))
    # All points are nearest to within rounding; the search lets go of 1e-10 of the square of the distance.
    assert face.trim_distance(0.5, -0.25) == pytest.approx(2.0, rel=1e-10)
    for off in (1e-3, 1e-6, 1e-9):
        assert face.trim_distance(0.5 + off, -0.25) == pytest.approx(2.0 - off, rel=1e-10)


def test_a_curve_of_high_degree_with_a_flat_bottom():
    # v = u^8 between straight sides: nearest to (0, a) is the bottom, with seven vanishing derivatives.
    low = np.zeros(9)
    low[-1] = 1.0
    half = NurbsCurve(np.column_stack([np.linspace(0, 1, 9), low]), [0] * 9 + [1] * 9, 8)
    other = NurbsCurve(np.column_stack([np.linspace(-1, 0, 9), low[::-1]]), [0] * 9 + [1] * 9, 8)
    face = Face(PLANE, [other, half, segment((1, 1), (-1, 1))])
    assert face.trim_distance(0.0, 0.25) == pytest.approx(0.25, abs=1e-14)
    assert face.trim_distance(0.0, -2.0) == pytest.approx(-2.0, abs=1e-14)
    u = np.linspace(-1.0, 1.0, 41)
    assert (face.locate(u, u**8) == 0).all()
    assert (face.locate(u[1:-1], u[1:-1] ** 8 + 1e-9) == 1).all()
    assert (face.locate(u, u**8 - 1e-9) == -1).all()


def test_a_cusp_has_the_right_sides():
    # The semicubical parabola (t^2, t^3) closed by a segment: the boundary turns back at the origin.
    curve = NurbsCurve([[1, -1], [-1 / 3, 1], [-1 / 3, -1], [1, 1]], [0] * 4 + [1] * 4, 3)
    face = Face(PLANE, [curve.reversed(), segment((1, -1), (1, 1))])
    u = np.array([0.25, 0.25, 0.25, -0.1, 0.01, 0.01])
    v = np.array([0.0, 0.124, 0.126, 0.0, 0.0, 0.0011])
    np.testing.assert_array_equal(face.locate(u, v), [1, 1, -1, -1, 1, -1])
    np.testing.assert_array_equal(np.sign(face.trim_distance(u, v)), [1, 1, -1, -1, 1, -1])
    assert face.trim_distance(-0.1, 0.0) == pytest.approx(-0.1, abs=1e-14)
    assert face.locate(0.0, 0.0) == 0


@pytest.mark.parametrize("size", [1e-2, 1e-4])
def test_a_small_face_far_from_the_origin(size):
    # Coordinates of 1e4 have a rounding of 2e-12: a billionth of the size is less.
    at = np.array([1e4, -1e4])
    low, high = at - 1.0, at + 1.0
    corners = [[[u, v, 0.0] for v in (low[1], high[1])] for u in (low[0], high[0])]
    knots = [np.repeat([a, b], 2) for a, b in zip(low, high, strict=True)]
    face = Face(NurbsSurface(corners, knots, (1, 1)), circle(at, size), [circle(at, 0.5 * size)])
    radius = size * np.array([0.0, 0.25, 0.4, 0.6, 0.75, 0.9, 1.1])
    np.testing.assert_array_equal(face.locate(at[0] + radius, at[1]), [-1, -1, -1, 1, 1, 1, -1])
    wanted = np.minimum(size - radius, radius - 0.5 * size)
    np.testing.assert_allclose(face.trim_distance(at[0] + radius, at[1]), wanted, rtol=0, atol=2e-11)


def test_repeated_points_and_curves_of_no_length_do_no_harm():
    corners = [ELL[0], ELL[0], *ELL[1:4], ELL[3], *ELL[4:]]
    edges = polygon(*ELL)
    edges.insert(2, segment(ELL[2], ELL[2]))
    plain = Face(PLANE, polygon(*ELL))
    u, v = np.random.default_rng(0).uniform(-3, 3, (2, 500))
    u, v = np.append(u, [0.0, -2.3, 0.0]), np.append(v, [0.0, -2.4, -1e-3])
    for outer in (polyline(*corners), edges):
        face = Face(PLANE, outer)
        np.testing.assert_array_equal(face.locate(u, v), plain.locate(u, v))
        np.testing.assert_allclose(face.trim_distance(u, v), plain.trim_distance(u, v), rtol=0, atol=ROUNDING)


def test_sheets_of_a_cylinder():
    face = Face(CYLINDER, None, [circle((0.1, 1.0), 0.3)])
    u, v = np.random.default_rng(1).uniform(0, AROUND, 2000), np.random.default_rng(2).uniform(0, 2, 2000)
    away = np.minimum(np.hypot(u - 0.1, v - 1.0), np.hypot(u - 0.1 - AROUND, v - 1.0)) - 0.3
    distance = np.minimum(away, np.minimum(v, 2.0 - v))
    for sheet in (0, -1, 5):
        x = u + sheet * AROUND
        np.testing.assert_array_equal(face.locate(x, v), np.sign(distance))
        np.testing.assert_allclose(face.trim_distance(x, v), distance, rtol=0, atol=10 * ROUNDING)
        near = face.nearest_on_boundary(x, v)
        # The foot is in the sheet of the point.
        np.testing.assert_allclose(np.hypot(*(near.point.T - [x, v])), np.abs(distance), rtol=0, atol=10 * ROUNDING)


def test_a_torus_with_a_slanting_ring():
    torus = shapes.torus(3.0, 1.0)
    (_, a), (_, b) = torus.domain
    # Two bands that run once around both ways cannot be: rings turn around u alone, or around v alone.
    for axis in (0, 1):
        turn = [a, 0.0] if axis == 0 else [0.0, b]
        across = np.array([0.0, b]) if axis == 0 else np.array([a, 0.0])
        first, second = 0.2 * across, 0.7 * across
        wave = 0.2 * across
        forward = NurbsCurve([first, first + wave + 0.5 * np.array(turn), first + turn], [0, 0, 0, 1, 1, 1], 2)
        back = segment(second + turn, second)
        face = Face(torus, forward, [back]) if axis == 0 else Face(torus, forward.reversed(), [back.reversed()])
        other = Face(torus, forward.reversed(), [back.reversed()]) if axis == 0 else Face(torus, forward, [back])
        u, v = np.random.default_rng(3).uniform(0, 1, (2, 2000)) * [[a], [b]]
        s, t = (u / a, v / b) if axis == 0 else (v / b, u / a)
        # The ring is the parabola 0.2 + 0.4 s (1 - s) in parts of the periods.
        inside = (t > 0.2 + 0.4 * s * (1.0 - s)) & (t < 0.7)
        for shift in (0.0, 2.0):
            np.testing.assert_array_equal(face.locate(u + shift * a, v - shift * b), np.where(inside, 1, -1))
            np.testing.assert_array_equal(other.locate(u - shift * a, v), np.where(inside, -1, 1))
        np.testing.assert_allclose(face.trim_distance(u, v), -other.trim_distance(u, v), rtol=0, atol=1e-14)


def test_points_outside_the_domain_are_outside():
    face = Face(CYLINDER)
    np.testing.assert_array_equal(face.locate([1.0, 1.0, -20.0], [-0.1, 2.1, 1.0]), [-1, -1, 1])
    ball = Face(shapes.sphere(1.0))
    np.testing.assert_array_equal(ball.locate(0.0, [-0.1, 0.0, np.pi, 3.2]), [-1, 1, 1, -1])
    assert ball.trim_distance(0.0, 1.0) == np.inf and ball.space_distance(0.0, 1.0) == np.inf


def test_the_packed_trim_may_stand_anywhere():
    face = random_face(np.random.default_rng(5), PLANE)
    table, pool = face.packed_trim()
    moved_table, moved_pool = face.packed_trim(7, 11)
    table, moved_table = table.copy(), np.concatenate([np.full(7, -9), moved_table])
    moved_pool = np.concatenate([np.full(11, np.nan), moved_pool])
    u, v = np.random.default_rng(6).uniform(-4, 4, (2, 300))
    sides = np.empty(300, dtype=np.int64), np.empty(300, dtype=np.int64)
    feet = np.empty((300, 7)), np.empty((300, 7))
    locate_points(table, pool, 0, u, v, sides[0])
    locate_points(moved_table, moved_pool, 7, u, v, sides[1])
    nearest_points(table, pool, 0, 0, 4, u, v, feet[0])
    nearest_points(moved_table, moved_pool, 7, 0, 4, u, v, feet[1])
    np.testing.assert_array_equal(*sides)
    np.testing.assert_array_equal(*feet)
    # The curves' records are those of the curves themselves.
    assert trim_at(moved_table, 7).curves == 4
    first = trim_at(moved_table, 7).first
    for k, curve in enumerate(face.boundary):
        record, own = curve.packed()
        here = moved_table[first + k * CURVE_RECORD : first + (k + 1) * CURVE_RECORD]
        np.testing.assert_array_equal(here[[0, 1, 4]], record[[0, 1, 4]])
        np.testing.assert_array_equal(moved_pool[here[2] :][: record[3]], own[: record[3]])
        count = own.size - record[3]
        # Sums of the same products in another order.
        np.testing.assert_allclose(
            moved_pool[here[3] :][:count], own[record[3] :], rtol=0, atol=1e-13 * np.abs(own).max()
        )


def test_nearest_of_some_of_the_curves():
    face = Face(PLANE, circle((0, 0), 3), [circle((0, 0), 1)])
    table, pool = face.packed_trim()
    u, v = np.array([2.9, 0.5, 3.5]), np.zeros(3)
    out = np.empty((3, 7))
    nearest_points(table, pool, 0, 1, 1, u, v, out)
    np.testing.assert_allclose(out[:, 0], [1.9, -0.5, 2.5], rtol=0, atol=ROUNDING)
    np.testing.assert_array_equal(out[:, 1], 1)
    np.testing.assert_allclose(out[:, 5:], np.tile([1.0, 0.0], (3, 1)), rtol=0, atol=ROUNDING)
    square = Face(PLANE, polygon((0, 0), (1, 0), (1, 1), (0, 1)))
    table, pool = square.packed_trim()
    nearest_points(table, pool, 0, 0, 1, np.array([0.5, 2.0, 2.0]), np.array([0.9, 1.0, -1.0]), out)
    # Of one edge alone: to its left is material, also beyond its end.
    np.testing.assert_allclose(out[:, 0], [0.9, np.sqrt(2.0), -np.sqrt(2.0)], rtol=0, atol=ROUNDING)


def test_distance_in_space():
    face = Face(PLANE, circle((0, 0), 3), [circle((0, 0), 1)])
    u, v = np.random.default_rng(0).uniform(-4, 4, (2, 500))
    r = np.hypot(u, v)
    np.testing.assert_allclose(face.space_distance(u, v), np.minimum(3 - r, r - 1), rtol=0, atol=10 * ROUNDING)
    # On a sphere the distance to a circle of latitude is a chord; parameters are arc lengths at the knots alone.
    ball = shapes.sphere(2.0)
    cap = Face(ball, segment((0.0, np.pi), (4.0 * np.pi, np.pi)))
    v = np.linspace(0.1, 6.0, 40)
    height = ball.evaluate(0.7, v)[:, 2]
    latitude = np.arcsin(height / 2.0)
    np.testing.assert_allclose(cap.space_distance(0.7, v), 4.0 * np.sin(0.5 * latitude), rtol=0, atol=1e-14)


PROGRAM = """
import json, sys
import numpy as np
from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from tests.geometry.loops import circle, polygon, random_face
faces = [
    random_face(np.random.default_rng(0), shapes.plane(10.0, 10.0)),
    Face(shapes.cylinder(1.0, 2.0), None, [circle((0.1, 1.0), 0.3)]),
    Face(shapes.torus(3.0, 1.0), None, [polygon((4.2, 0.2), (5.2, 0.4), (4.5, 0.9))]),
]
out = []
# Of each measure, which plain Python takes a second for, two faces of three.
for face, measures in zip(faces, (["area"], ["area", "volume_integral"], ["volume_integral"]), strict=True):
    u, v = np.random.default_rng(1).uniform(-3, 3, (2, 8))
    near = face.nearest_on_boundary(u, v)
    side = face.locate(u, v).tolist()
    inside = v.clip(*face.surface.domain[1])
    out.append([side, near.distance.tolist(), near.point.tolist(), face.space_distance(u, inside).tolist()])
    out[-1] += [getattr(face, measure)() for measure in measures]
refused = []
for outer in (circle((0, 0), 2.5), circle((4.5, 0), 1)):
    try:
        Face(shapes.plane(10.0, 10.0), outer, [circle((2, 0), 1)])
    except ValueError as error:
        refused.append(str(error).partition(" near ")[0])
json.dump([out, refused], sys.stdout)
"""


def test_plain_python_gives_the_numbers_of_the_compiled_kernels():
    here = io.StringIO()
    with redirect_stdout(here):
        exec(PROGRAM, {})
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", PROGRAM],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        cwd=Path(__file__).parents[3],
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    (compiled, refused), (plain, refused_plain) = (json.loads(text) for text in (here.getvalue(), done.stdout))
    for one, other in zip(compiled, plain, strict=True):
        for a, b in zip(one, other, strict=True):
            # Fused multiplications and additions round less.
            np.testing.assert_allclose(a, b, rtol=1e-13, atol=1e-13)
    assert refused == refused_plain and len(refused) == 2


def test_scale_and_place_do_not_matter():
    base = random_face(np.random.default_rng(9), PLANE)
    u, v = np.random.default_rng(10).uniform(-4, 4, (2, 500))
    distance = base.trim_distance(u, v)
    for scale, offset in ((1e-6, 0.0), (1e6, 0.0), (1.0, 1e4)):
        low, high = np.array([-5.0, 5.0]) * scale + offset
        corners = [[[a, b, 0.0] for b in (low, high)] for a in (low, high)]
        surface = NurbsSurface(corners, ([low, low, high, high], [low, low, high, high]), (1, 1))
        loops = [NurbsCurve(c.control_points * scale + offset, c.knots, c.degree, c.weights) for c in base.boundary]
        face = Face(surface, loops[0], loops[1:])
        x, y = u * scale + offset, v * scale + offset
        np.testing.assert_array_equal(face.locate(x, y), base.locate(u, v))
        # Some roundings of the coordinates themselves.
        np.testing.assert_allclose(face.trim_distance(x, y) / scale, distance, rtol=0, atol=1e-14 + 2e-15 * offset)
