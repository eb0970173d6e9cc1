"""Curves of profiles, revolutions, lofts, moved faces and joined shapes: by formulas and by each other."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.kinematics.pose import rotation_matrix
from tests.geometry.shapes.test_solids import area, check_normals, names, volume

TIGHT = 1e-12


def space(curve, z=0.0):
    """A plane curve in the plane at a height."""
    points = np.column_stack([curve.control_points, np.full(len(curve.control_points), z)])
    return asm.NurbsCurve(points, curve.knots, curve.degree, curve.weights)


@pytest.mark.parametrize(("start", "end"), [(0.3, 2.0), (0.3, -2.0), (-5, 1.2), (1, 1.001)])
def test_arcs_are_on_their_circle_and_their_parameter_is_the_length(start, end):
    curve = asm.curves.arc(2.5, start, end, center=(1, -2))
    t = np.linspace(*curve.domain, 101)
    points = curve.evaluate(t) - [1, -2]
    assert abs(np.linalg.norm(points, axis=1) - 2.5).max() < TIGHT
    assert np.ptp(curve.domain) == pytest.approx(2.5 * abs(end - start))
    for at, angle in ((0, start), (-1, end)):
        assert abs(points[at] - 2.5 * np.array([cos(angle), sin(angle)])).max() < TIGHT
    circle = asm.curves.circle(2.5, (1, -2))
    assert circle.closed and np.ptp(circle.domain) == pytest.approx(5 * pi)
    assert abs(np.linalg.norm(circle.evaluate(np.linspace(*circle.domain, 99)) - [1, -2], axis=1) - 2.5).max() < TIGHT


def test_polygons_close_and_their_parameter_is_the_length():
    curve = asm.curves.polygon([(0, 0), (3, 0), (3, 4)])
    assert curve.closed and np.ptp(curve.domain) == pytest.approx(12)
    assert abs(curve.evaluate([0, 3, 7, 12]) - [[0, 0], [3, 0], [3, 4], [0, 0]]).max() < TIGHT
    faces = asm.shapes.extrusion(curve, 2)
    assert names(faces) == ["wall 1", "wall 2", "wall 3", "bottom", "top"] and volume(faces) == pytest.approx(12)


@pytest.mark.parametrize("angle", [0.4, pi / 2, 2.0, pi, 5.0, 2 * pi])
@pytest.mark.parametrize("turned", [False, True])
def test_revolutions_have_the_volume_of_pappus(angle, turned):
    """Area of the profile times the way of its centroid, whichever way it is drawn; normals point out."""
    corners = np.array([(1, 0), (3, 0), (3, 1), (2, 2), (1, 2)], dtype=float)
    faces = asm.shapes.revolution(asm.curves.polygon(corners[::-1] if turned else corners), angle)
    ends = [] if angle == 2 * pi else ["start", "end"]
    assert names(faces) == ["wall 1", "wall 2", "wall 3", "wall 4", "wall 5", *ends]
    first_moment = 4 * 2 - 0.5 * (3 - 1 / 3)  # of the rectangle less the corner's triangle
    assert volume(faces) == pytest.approx(first_moment * angle, rel=1e-10)
    body = asm.Body("ring", faces)
    assert all(len(edge.faces) == 2 for edge in body.edges)

    def inside(points):
        r, phi = np.hypot(points[:, 0], points[:, 1]), np.arctan2(points[:, 1], points[:, 0]) % (2 * pi)
        z = points[:, 2]
        return (r > 1) & (r < 3) & (z > 0) & (z < 2) & (r + z < 4) & ((phi < angle) | (angle == 2 * pi))

    check_normals(faces, inside)


def test_revolutions_of_curves_and_of_profiles_on_the_axis():
    line = asm.NurbsCurve([[2, -1], [2, 1]], [0, 0, 2, 2], 1)
    wall = asm.shapes.revolution(line, name="wall")
    other = asm.shapes.cylinder(2, 2)
    u, v = np.linspace(0, 4 * pi, 9), 1.3
    assert abs(wall.evaluate(u, v) - other.evaluate(u, v)).max() < TIGHT and wall.name == "wall"
    half = asm.curves.arc(2, -pi / 2, pi / 2)
    ball = asm.shapes.revolution([half, asm.NurbsCurve([[0, 2], [0, -2]], [0, 0, 4, 4], 1)])
    assert (
        names(ball) == ["wall"] and volume(ball) == pytest.approx(32 * pi / 3) and area(ball) == pytest.approx(16 * pi)
    )
    assert asm.Body("ball", ball).face().kind == "sphere"
    wedge = asm.shapes.revolution([half, asm.NurbsCurve([[0, 2], [0, -2]], [0, 0, 4, 4], 1)], 1.0)
    assert names(wedge) == ["wall", "start", "end"] and volume(wedge) == pytest.approx(16 / 3)
    assert len(asm.Body("wedge", wedge).edges) == 3


@pytest.mark.parametrize("seed", range(6))
def test_lofts_go_through_their_curves(seed):
    rng = np.random.default_rng(seed)
    curves = []
    for k in range(rng.integers(2, 7)):
        degree, spans = rng.integers(1, 4), rng.integers(1, 4)
        inner = np.sort(rng.uniform(0.1, 0.9, spans - 1))
        knots = np.concatenate([np.zeros(degree + 1), inner, np.ones(degree + 1)]) * rng.uniform(1, 3)
        points = rng.normal(size=(degree + spans, 3)) + [0, 0, 4 * k]
        weights = rng.uniform(0.8, 1.2, degree + spans)
        curves.append(asm.NurbsCurve(points, knots, int(degree), weights))
    surface = asm.shapes.loft(curves, name="skin")
    assert surface.name == "skin" and surface.degree[1] == min(3, len(curves) - 1)
    v = np.linspace(*surface.domain[1], 4001)
    for curve in curves:
        part = np.linspace(0, 1, 7)
        t = curve.domain[0] + part * np.ptp(curve.domain)
        u = surface.domain[0][0] + part * np.ptp(surface.domain[0])
        points = curve.evaluate(t)
        # Somewhere along v all points of a curve are on the surface at once.
        off = np.linalg.norm(surface.evaluate(u[None], v[:, None]) - points, axis=-1).max(axis=1)
        k = int(np.argmin(off))
        fine = np.linspace(v[max(k - 1, 0)], v[min(k + 1, v.size - 1)], 4001)
        for _ in range(3):
            off = np.linalg.norm(surface.evaluate(u[None], fine[:, None]) - points, axis=-1).max(axis=1)
            k = int(np.argmin(off))
            fine = np.linspace(fine[max(k - 1, 0)], fine[min(k + 1, fine.size - 1)], 4001)
        assert off.min() < 1e-8


def test_lofts_of_circles_are_cones_and_cylinders():
    low, high = space(asm.curves.circle(2)), space(asm.curves.circle(1), 3)
    cone = asm.Body("part", asm.shapes.loft([low, high])).face()
    assert cone.kind == "cone" and abs(cone.apex - [0, 0, 6]).max() < 1e-10 and not cone.is_hole
    assert asm.shapes.loft([low, high]).closed == (True, False)


@pytest.mark.parametrize("seed", range(4))
def test_moved_faces_keep_their_loops(seed):
    rng = np.random.default_rng(seed)
    rotation = rotation_matrix((e := rng.normal(size=4)) / np.linalg.norm(e))
    offset, scale = rng.normal(size=3), rng.uniform(0.5, 2)
    for face in asm.shapes.plate(10, 8, 2, [(1, 1, 1.5)]):
        face.color = (1, 0, 0)
        moved = face.transformed(rotation, offset, scale, name="moved")
        assert moved.name == "moved" and moved.color == (1, 0, 0) and moved.reversed == face.reversed
        assert moved.area() == pytest.approx(scale**2 * face.area())
        assert abs(moved.centroid() - (scale * rotation @ face.centroid() + offset)).max() < 1e-9
        (a, b), (c, d) = face.surface.domain
        u, v = rng.uniform(a, b, 200), rng.uniform(c, d, 200)
        assert (moved.locate(u, v) == face.locate(u, v)).all()
        assert abs(moved.normal(u, v) - face.normal(u, v) @ rotation.T).max() < TIGHT
    with pytest.raises(InputError, match="rotation is .*; expected a proper rotation matrix"):
        face.transformed(-np.eye(3))


def test_joined_shapes_have_distinct_names():
    box, plate = asm.shapes.box(1, 1, 1), asm.shapes.plate(4, 4, 1)
    joined = asm.shapes.joined(box, plate, asm.shapes.sphere(1), asm.shapes.sphere(2))
    assert names(joined)[:8] == ["left", "right", "front", "back", "bottom", "top", "front 2", "right 2"]
    assert names(joined)[-2:] == ["face 1", "face 1 2"] and len(set(names(joined))) == 14
    named = asm.shapes.joined(base=plate, boss=asm.shapes.solid_cylinder(1, 2), ball=asm.shapes.sphere(1))
    assert names(named)[-4:] == ["boss wall", "boss bottom", "boss top", "ball"]
    assert names(asm.Body("part", named).faces.named("boss*")) == ["boss wall", "boss bottom", "boss top"]
    assert names(box) == ["left", "right", "front", "back", "bottom", "top"]  # as they were
    with pytest.raises(InputError, match="two faces named 'left'; .*joined"):
        asm.Body("part", [*box, *box])


LINE = asm.NurbsCurve([[0, 0, 0], [1, 0, 0]], [0, 0, 1, 1], 1)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: asm.curves.circle(0), "radius is 0; expected a positive number"),
        (lambda: asm.curves.arc(1, 0, 7), "expected angles less than a whole turn apart"),
        (lambda: asm.curves.arc(1, 2, 2), "start and end are 2 and 2"),
        (lambda: asm.curves.polygon([(0, 0), (1, 0)]), "expected three corners or more"),
        (lambda: asm.curves.polygon([(0, 0), (1, 0), (1, 0)]), "as the next one; expected sides that have a length"),
        (lambda: asm.shapes.revolution(asm.curves.circle(1)), "control point of radius -1"),
        (lambda: asm.shapes.revolution(asm.curves.circle(1, (2, 0)), 7), "angle is 7; expected a positive angle"),
        (lambda: asm.shapes.revolution(asm.curves.circle(1, (2, 0)), 0), "angle is 0; expected a positive angle"),
        (lambda: asm.shapes.revolution(LINE), "is a curve in space"),
        (lambda: asm.shapes.revolution([asm.curves.arc(1, 0, 1, (2, 0))] * 2), "profile"),
        (lambda: asm.shapes.loft([LINE]), "curves is 1 curve; expected two or more"),
        (lambda: asm.shapes.loft([LINE, LINE]), r"curves\[0\] and curves\[1\] are equal"),
        (lambda: asm.shapes.loft([LINE, asm.curves.circle(1)]), r"curves\[1\] is a plane curve"),
        (lambda: asm.shapes.loft([LINE, space(asm.curves.circle(1))]), "closed and open ones"),
        (lambda: asm.shapes.joined(), "shapes are none; expected one or more"),
    ],
)
def test_bad_input(call, text):
    with pytest.raises(InputError, match=text):
        call()


def test_wrong_kinds():
    for call in (lambda: asm.shapes.loft([LINE, 3]), lambda: asm.shapes.joined(3), lambda: asm.shapes.joined([3])):
        with pytest.raises(TypeError):
            call()
