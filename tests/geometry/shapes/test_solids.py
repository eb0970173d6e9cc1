from __future__ import annotations

from math import pi

import numpy as np
import pytest

from assembly.errors import InputError
from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.faces.loop import Loop
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.curve_parts import between, crease_knots, smooth_parts
from tests.solids import FALL_X, FALL_Y, HALF_X, HALF_Y, roof_height, tiled_solid

# Sums of some hundred terms of the size of the result.
TIGHT = 1e-12


def circle(center, radius):
    s = np.sqrt(0.5)
    points = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float)
    knots = np.array([0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4.0])
    return NurbsCurve(radius * points + center, knots, 2, [1, s, 1, s, 1, s, 1, s, 1])


def polygon(corners):
    points = np.concatenate([corners, corners[:1]])
    return NurbsCurve(points, np.concatenate([[0], np.arange(len(points)), [len(points) - 1]]), 1)


def moments(curve):
    """Signed area inside a closed curve and its length: Gauss quadrature on every span."""
    x, w = np.polynomial.legendre.leggauss(40)
    at = curve.breaks()
    t = 0.5 * (at[:-1, None] + at[1:, None] + np.diff(at)[:, None] * x)
    weights = 0.5 * np.diff(at)[:, None] * w
    p, d = curve.evaluate(t, 1)
    area = 0.5 * (weights * (p[..., 0] * d[..., 1] - p[..., 1] * d[..., 0])).sum()
    return float(area), float((weights * np.linalg.norm(d, axis=-1)).sum())


def names(faces):
    return [face.name for face in faces]


def volume(faces):
    return sum(face.volume_integral() for face in faces)


def area(faces):
    return sum(face.area() for face in faces)


def check_normals(faces, inside):
    """A little way against the outward normal is material, and the other way is none."""
    rng = np.random.default_rng(0)
    for face in faces:
        (a, b), (c, d) = face.surface.domain
        u, v = rng.uniform(a, b, 400), rng.uniform(c, d, 400)
        on = face.locate(u, v) > 0
        assert on.sum() > 10
        u, v = u[on], v[on]
        points, normals = face.surface.evaluate(u, v), face.normal(u, v)
        # So near to the sides of a face that a step of 1e-6 leaves it are few points.
        assert inside(points - 1e-6 * normals).mean() > 0.99
        assert inside(points + 1e-6 * normals).mean() < 0.01


def test_solid_cylinder():
    r, h = 1.5, 0.7
    faces = shapes.solid_cylinder(r, h)
    assert names(faces) == ["wall", "bottom", "top"]
    assert [face.reversed for face in faces] == [False, True, False]
    np.testing.assert_allclose([face.area() for face in faces], [2 * pi * r * h, pi * r**2, pi * r**2], rtol=TIGHT)
    assert volume(faces) == pytest.approx(pi * r**2 * h, rel=TIGHT)
    check_normals(faces, lambda x: (np.hypot(x[:, 0], x[:, 1]) < r) & (np.abs(x[:, 2]) < 0.5 * h))
    wall, same = faces[0].surface, shapes.cylinder(r, h)
    np.testing.assert_array_equal(wall.domain, same.domain)
    u, v = np.random.default_rng(0).uniform(0, [[2 * pi * r], [h]], (2, 100))
    np.testing.assert_allclose(wall.evaluate(u, v), same.evaluate(u, v), atol=1e-15 * 8)


def test_plate():
    x, y, z = 4.0, 3.0, 0.5
    holes = [(0.0, 0.0, 0.5), (1.2, 0.5, 0.3), (-1.5, -1.0, 0.25)]
    faces = shapes.plate(x, y, z, holes)
    assert names(faces) == ["front", "right", "back", "left", "hole 1", "hole 2", "hole 3", "bottom", "top"]
    r = np.array(holes)[:, 2]
    cut = pi * (r**2).sum()
    expected = [x * z, y * z, x * z, y * z, *(2 * pi * r * z), x * y - cut, x * y - cut]
    np.testing.assert_allclose([face.area() for face in faces], expected, rtol=TIGHT)
    assert volume(faces) == pytest.approx((x * y - cut) * z, rel=TIGHT)

    def inside(p):
        out = [np.hypot(p[:, 0] - cx, p[:, 1] - cy) > radius for cx, cy, radius in holes]
        return (np.abs(p) < [0.5 * x, 0.5 * y, 0.5 * z]).all(axis=1) & np.all(out, axis=0)

    check_normals(faces, inside)
    outward = {"front": [0, -1, 0], "right": [1, 0, 0], "back": [0, 1, 0], "left": [-1, 0, 0], "bottom": [0, 0, -1]}
    for face in faces:
        if face.name in outward:
            np.testing.assert_array_equal(face.normal(*np.mean(face.surface.domain, axis=1)), outward[face.name])


def test_plate_without_holes_is_a_box():
    faces = {face.name: face for face in shapes.plate(1, 2, 3)}
    for face in shapes.box(1, 2, 3):
        assert faces[face.name].area() == pytest.approx(face.area(), rel=1e-14)
        middle = np.mean(face.surface.domain, axis=1), np.mean(faces[face.name].surface.domain, axis=1)
        np.testing.assert_allclose(
            face.surface.evaluate(*middle[0]), faces[face.name].surface.evaluate(*middle[1]), atol=1e-15
        )


@pytest.mark.parametrize(("center", "angle"), [((0.0, 0.0), 0.0), ((0.2, -0.1), 0.5), ((-0.5, 0.3), -2.5)])
def test_plate_with_slot(center, angle):
    length, width, z = 2.0, 0.6, 0.5
    faces = shapes.plate_with_slot(4, 3, z, length, width, center=center, angle=angle)
    sides = ["front", "right", "back", "left"]
    assert names(faces) == [*sides, "slot left", "slot end", "slot right", "slot start", "bottom", "top"]
    straight = length - width
    cut = straight * width + 0.25 * pi * width**2
    by_name = {face.name: face.area() for face in faces}
    assert by_name["slot left"] == pytest.approx(straight * z, rel=TIGHT)
    assert by_name["slot end"] == pytest.approx(0.5 * pi * width * z, rel=TIGHT)
    assert by_name["top"] == pytest.approx(12.0 - cut, rel=TIGHT)
    assert volume(faces) == pytest.approx((12.0 - cut) * z, rel=TIGHT)
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])

    def inside(p):
        a, b = (p[:, :2] - center) @ along, (p[:, :2] - center) @ across
        gap = np.hypot(np.maximum(np.abs(a) - 0.5 * straight, 0.0), b)
        return (np.abs(p) < [2.0, 1.5, 0.5 * z]).all(axis=1) & (gap > 0.5 * width)

    check_normals(faces, inside)
    # Where the names say: looking along the slot.
    for name, direction in (
        ("slot left", across),
        ("slot end", along),
        ("slot right", -across),
        ("slot start", -along),
    ):
        face = next(face for face in faces if face.name == name)
        point = face.surface.evaluate(*np.mean(face.surface.domain, axis=1))
        assert (point[:2] - center) @ direction > 0.29


def test_cam():
    base, lift, h, bore = 2.0, 0.8, 0.6, 0.5
    radii = base + 0.5 * lift * (1.0 - np.cos(np.linspace(0, 2 * pi, 24, endpoint=False)))
    faces = shapes.cam(radii, h, bore)
    assert names(faces) == ["cam", "bore", "bottom", "top"]
    profile = faces[3].boundary[0]
    inner, length = moments(profile)
    # Points of r = 2.4 - 0.4 cos, whose area is exact for the spline's limit: pi (2.4^2 + 0.4^2 / 2).
    assert inner == pytest.approx(pi * (2.4**2 + 0.08), rel=1e-4)
    assert volume(faces) == pytest.approx((inner - pi * bore**2) * h, rel=TIGHT)
    np.testing.assert_allclose(
        [face.area() for face in faces],
        [length * h, 2 * pi * bore * h, inner - pi * bore**2, inner - pi * bore**2],
        rtol=TIGHT,
    )
    # Closed, and smooth where it closes: tangent and curvature.
    wall = faces[0].surface
    assert wall.closed == (True, False)
    u0, u1 = wall.domain[0]
    ends = wall.evaluate([u0, u1], 0.1, 2)
    for quantity in ends:
        np.testing.assert_allclose(quantity[0], quantity[1], atol=1e-13)
    knots = profile.breaks()
    assert len(knots) == 25
    points = profile.evaluate(knots[:-1])
    np.testing.assert_allclose(np.hypot(*points.T), radii, rtol=1e-14)
    angles = np.arctan2(points[:, 1], points[:, 0]) % (2 * pi)
    np.testing.assert_allclose(angles, np.linspace(0, 2 * pi, 24, endpoint=False), atol=1e-14)


def test_extrusion_of_anything():
    corners = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3.0]])
    for profile in (polygon(corners), polygon(corners[::-1]), Loop(polygon(corners)), [polygon(corners)]):
        faces = shapes.extrusion(profile, 2.0, holes=[circle((0.5, 2.0), 0.2), polygon(corners * 0.1 + 0.3)])
        walls = [f"wall {k + 1}" for k in range(6)]
        inner = [f"hole 2 wall {k + 1}" for k in range(6)]
        assert names(faces) == [*walls, "hole 1", *inner, "bottom", "top"]
        net = 5.0 - pi * 0.04 - 0.05
        assert faces[-1].area() == faces[-2].area() == pytest.approx(net, rel=TIGHT)
        assert volume(faces) == pytest.approx(2.0 * net, rel=TIGHT)
        around = 12.0 + 0.4 * pi + 1.2
        assert area(faces) == pytest.approx(2.0 * net + 2.0 * around, rel=TIGHT)
    # Walls are numbered as the curves came, in either sense.
    first = shapes.extrusion(polygon(corners), 2.0)[0]
    last = shapes.extrusion(polygon(corners[::-1]), 2.0)[4]
    np.testing.assert_allclose(first.area(), 6.0, rtol=1e-14)
    np.testing.assert_allclose(last.area(), 6.0, rtol=1e-14)
    assert names(shapes.extrusion(circle((0, 0), 1), 1, [circle((0, 0), 0.5)])) == ["wall", "hole", "bottom", "top"]
    assert names(shapes.extrusion(circle((0, 0), 1), 1, [polygon(corners * 0.1)]))[1] == "hole wall 1"


def test_trimmed_plane():
    face = shapes.trimmed_plane(circle((3.0, 2.0), 1.5), [circle((3.0, 2.5), 0.5)], name="washer")
    assert face.name == "washer" and not face.reversed
    assert face.area() == pytest.approx(2.0 * pi, rel=TIGHT)
    np.testing.assert_array_equal(face.locate([3.0, 3.0, 3.0, 1.4], [1.0, 2.5, 3.0, 2.0]), [1, -1, 0, -1])
    np.testing.assert_array_equal(face.surface.evaluate(2.5, 1.25), [2.5, 1.25, 0.0])
    np.testing.assert_array_equal(face.normal(2.5, 1.25), [0, 0, 1])
    # The plane goes on around the loop.
    (a, b), (c, d) = face.surface.domain
    assert a < 1.4 and b > 4.6 and c < 0.4 and d > 3.6


def test_tiled_solid():
    faces = tiled_solid()
    assert names(faces) == ["front", "right", "back", "left", "bottom", "top"]
    base = 4 * HALF_X * HALF_Y
    expected = base * 8.0 - base * (FALL_X * HALF_X**2 + FALL_Y * HALF_Y**2) / 3
    assert volume(faces) == pytest.approx(expected, rel=TIGHT)
    assert faces[0].area() == pytest.approx(2 * HALF_X * (roof_height(0, HALF_Y) - FALL_X * HALF_X**2 / 3), rel=TIGHT)

    def inside(p):
        box = (np.abs(p[:, 0]) < HALF_X) & (np.abs(p[:, 1]) < HALF_Y)
        return box & (p[:, 2] > 0) & (p[:, 2] < roof_height(p[:, 0], p[:, 1]))

    check_normals(faces, inside)


def test_bodies_take_them():
    import assembly as asm

    body = asm.Body("plate", asm.shapes.plate_with_slot(4, 3, 1, 2, 0.5))
    assert body.face("slot end").face.area() == pytest.approx(0.25 * pi, rel=TIGHT)


OPEN = NurbsCurve([[0, 0], [1, 0], [1, 1.0]], [0, 0, 1, 2, 2], 1)
BAD = [
    (lambda: shapes.solid_cylinder(0, 1), "radius is 0; expected a positive"),
    (lambda: shapes.solid_cylinder(1, -1), "height is -1; expected a positive"),
    (lambda: shapes.plate(1, 1, 0), "z is 0; expected a positive"),
    (lambda: shapes.plate(1, 1, 1, [(0, 0, 0.6)]), r"holes\[0\] is .*expected a circle inside the plate"),
    (lambda: shapes.plate(9, 9, 1, [(0, 0, 1), (1, 1, 1)]), r"holes\[1\] is .*expected a circle clear of holes\[0\]"),
    (lambda: shapes.plate(9, 9, 1, [(0, 0, -1)]), r"holes\[0\]\[2\] is -1; expected a positive"),
    (lambda: shapes.plate(9, 9, 1, [(0, 0)]), r"holes\[0\] has shape \(2,\)"),
    (lambda: shapes.plate_with_slot(4, 3, 1, 1, 1), "length is 1; expected more than the width of the slot, 1"),
    (lambda: shapes.plate_with_slot(4, 3, 1, 4, 1), "expected a slot inside the plate of 4 by 3"),
    (lambda: shapes.plate_with_slot(4, 3, 1, 3.1, 0.5, angle=1.5708), "expected a slot inside the plate"),
    (lambda: shapes.cam([1, 1, 1], 1, 0.1), "radii is .*expected four or more positive numbers"),
    (lambda: shapes.cam([1, 1, -1, 1], 1, 0.1), "radii is .*expected four or more positive numbers"),
    (lambda: shapes.cam([1, 1, 1, 1], 1, 1), "bore is 1; expected less than the least radius of the profile, 0.97"),
    (lambda: shapes.extrusion(OPEN, 1), "profile is open: a gap of 1.41"),
    (lambda: shapes.extrusion(circle((0, 0), 1), 1, [OPEN]), r"holes\[0\] is open: a gap of 1.41"),
    (lambda: shapes.extrusion(circle((0, 0), 1), 1, [circle((3, 0), 1)]), r"holes\[0\]"),
    (lambda: shapes.extrusion(circle((0, 0), 1), 1, [circle((0.05, 0), 1)]), "crosses or touches"),
    (lambda: shapes.trimmed_plane(polygon(np.array([[0, 0], [1, 1], [1, 0], [0, 1.0]]))), "crosses or touches itself"),
    (lambda: shapes.trimmed_plane([]), "outer is empty; expected at least one curve"),
]


@pytest.mark.parametrize(("call", "text"), BAD, ids=range(len(BAD)))
def test_bad_input(call, text):
    with pytest.raises(InputError, match=text):
        call()


def test_wrong_types():
    with pytest.raises(TypeError, match="profile is 3; expected a Loop, a closed NurbsCurve, or several that close"):
        shapes.extrusion(3, 1.0)
    with pytest.raises(TypeError, match="holes is NurbsCurve.*expected a sequence of closed profiles"):
        shapes.extrusion(circle((0, 0), 1), 1.0, circle((0, 0), 0.5))
    with pytest.raises(TypeError, match=r"holes is 1; expected a sequence of \(center_x, center_y, radius\)"):
        shapes.plate(1, 1, 1, 1)
    with pytest.raises(TypeError, match=r"outer\[0\] is 1; expected a NurbsCurve"):
        shapes.trimmed_plane([1])


@pytest.mark.parametrize("degree", [1, 2, 3, 5])
def test_parts_of_a_curve(degree):
    rng = np.random.default_rng(degree)
    for knots in (np.sort(rng.uniform(0, 1, 4)), [0.5] * degree, []):
        count = degree + 1 + len(knots)
        full = np.concatenate([np.zeros(degree + 1), knots, np.ones(degree + 1)])
        curve = NurbsCurve(rng.normal(size=(count, 2)), full, degree, rng.uniform(0.5, 2, count), name="c")
        for _ in range(10):
            low, high = np.sort(rng.uniform(0, 1, 2))
            part = between(curve, low, high)
            assert part.domain == (low, high) and part.name == "c"
            t = np.linspace(low, high, 50)
            np.testing.assert_allclose(part.evaluate(t), curve.evaluate(t), atol=1e-12)
        whole = between(curve, 0.0, 1.0)
        np.testing.assert_allclose(whole.evaluate(t), curve.evaluate(t), atol=1e-12)
        # An end that all but meets a knot is the knot.
        for knot in curve.breaks()[1:-1]:
            assert between(curve, 0.0, knot + 1e-12).domain == (0.0, knot)
            assert between(curve, knot - 1e-12, 1.0).domain == (knot, 1.0)


def test_corners_of_a_curve():
    bent = polygon(np.array([[0, 0], [1, 0], [2, 0], [2, 2.0]]))
    np.testing.assert_array_equal(crease_knots(bent), [1, 2, 3])
    np.testing.assert_array_equal(crease_knots(circle((0, 0), 1)), [1, 2, 3])
    assert not crease_knots(bent.elevate(2).insert_knot(0.5)).tolist() == []
    assert crease_knots(NurbsCurve([[0, 0], [1, 0], [2, 1], [3, 3.0]], [0, 0, 0, 1, 2, 2, 2], 2)).size == 0
    parts = smooth_parts(bent)
    assert [part.domain for part in parts] == [(0, 2), (2, 3), (3, 4)]
    round_one = circle((0, 0), 1)
    assert smooth_parts(round_one) == [round_one]
    # Quadratic pieces that turn back on themselves.
    spike = NurbsCurve([[0, 0], [1, 0], [2, 0], [1, 0], [0, 0.0]], [0, 0, 0, 1, 1, 2, 2, 2], 2)
    assert len(smooth_parts(spike)) == 2


def test_faces_know_their_surfaces():
    faces = shapes.plate(4, 3, 1, [(0, 0, 0.5)])
    assert all(isinstance(face, Face) for face in faces)
    assert {len(face.boundary) for face in faces} == {2, 4, 5}
