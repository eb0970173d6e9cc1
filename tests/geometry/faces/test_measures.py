"""Areas and volumes against closed forms; everything is smooth, so that only rounding is left."""

from __future__ import annotations

import numpy as np
import pytest

from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from tests.geometry.loops import blob, circle, dense, polygon, segment

PI = np.pi
AROUND = 2.0 * PI
RIGHT = 1e-13


def latitude(ball, v):
    return ball.evaluate(0.0, v)[2]


def test_plane_figures():
    plane = shapes.plane(10.0, 10.0)
    assert Face(plane).area() == pytest.approx(100.0, rel=RIGHT)
    assert Face(plane, circle((1, 2), 1.5)).area() == pytest.approx(2.25 * PI, rel=RIGHT)
    assert Face(plane, circle((0, 0), 3), [circle((1, 0), 1)]).area() == pytest.approx(8.0 * PI, rel=RIGHT)
    assert Face(plane, polygon((0, 0), (3, 0), (0, 4))).area() == pytest.approx(6.0, rel=RIGHT)
    face = Face(plane, None, [circle((0, 0), 2)])
    assert face.area() == pytest.approx(100.0 - 4.0 * PI, rel=RIGHT)
    # Through the origin a plane adds nothing; at height 2 it adds height times area / 3.
    assert face.volume_integral() == 0.0
    high = Face(plane.transformed(translation=(0, 0, 2)), circle((0, 0), 1))
    assert high.volume_integral() == pytest.approx(2.0 * PI / 3.0, rel=RIGHT)


def test_whole_shapes():
    for surface, area, volume in (
        (shapes.sphere(2.0), 16.0 * PI, 32.0 * PI / 3.0),
        (shapes.torus(3.0, 1.0), 12.0 * PI**2, 6.0 * PI**2),
        (shapes.cylinder(2.0, 3.0), 12.0 * PI, 8.0 * PI),
        (shapes.cone(2.0, 3.0), 2.0 * PI * np.sqrt(13.0), PI * 2.0**2 * 3.0 / 3.0 - PI * 2.0**2 * 1.5 / 3.0),
    ):
        assert Face(surface).area() == pytest.approx(area, rel=RIGHT)
        assert Face(surface).volume_integral() == pytest.approx(volume, rel=RIGHT)
        assert Face(surface, reversed=True).volume_integral() == pytest.approx(-volume, rel=RIGHT)
        assert Face(surface, reversed=True).area() == pytest.approx(area, rel=RIGHT)


def test_the_faces_of_a_box_enclose_its_volume():
    faces = shapes.box(2.0, 3.0, 5.0)
    moved = [Face(face.surface.transformed(translation=(7.0, -4.0, 1.0))) for face in faces]
    assert sum(face.area() for face in faces) == pytest.approx(62.0, rel=RIGHT)
    assert sum(face.volume_integral() for face in moved) == pytest.approx(30.0, rel=1e-12)


def test_caps_of_a_sphere():
    ball = shapes.sphere(1.0)
    for v in (0.4, 1.0, 2.5):
        z = latitude(ball, v)
        up = Face(ball, segment((0, v), (AROUND, v)))
        down = Face(ball, segment((AROUND, v), (0, v)))
        drawn = Face(ball, polygon((0, v), (AROUND, v), (AROUND, PI), (0, PI)))
        assert up.area() == pytest.approx(2.0 * PI * (1.0 - z), rel=1e-12)
        assert drawn.area() == pytest.approx(up.area(), rel=RIGHT)
        assert down.area() == pytest.approx(2.0 * PI * (1.0 + z), rel=1e-12)
        assert up.volume_integral() == pytest.approx(up.area() / 3.0, rel=RIGHT)
    hole = circle((3.0, 1.5), 0.7)
    rest, inside = Face(ball, None, [hole]), Face(ball, hole)
    assert rest.area() + inside.area() == pytest.approx(4.0 * PI, rel=RIGHT)
    assert inside.area() == pytest.approx(0.49 * PI, rel=0.2)


def test_a_cylinder_with_a_window():
    # u of a cylinder is not the angle but between the knots; a window with sides at knots has the angle's area.
    cylinder = shapes.cylinder(2.0, 3.0)
    quarter = PI
    window = polygon((0, 1), (quarter, 1), (quarter, 2), (0, 2))
    assert Face(cylinder, None, [window]).area() == pytest.approx(12.0 * PI - PI, rel=RIGHT)
    assert Face(cylinder, window).area() == pytest.approx(PI, rel=RIGHT)
    # Across the seam, and in another sheet.
    shifted = polygon((-quarter, 1), (quarter, 1), (quarter, 2), (-quarter, 2))
    assert Face(cylinder, shifted).area() == pytest.approx(2.0 * PI, rel=RIGHT)
    away = polygon(*((u + 8.0 * PI, v) for u, v in ((-quarter, 1), (quarter, 1), (quarter, 2), (-quarter, 2))))
    assert Face(cylinder, None, [away]).area() == pytest.approx(10.0 * PI, rel=RIGHT)
    seamed = polygon((0, 1), (4 * PI, 1), (4 * PI, 2), (0, 2))
    assert Face(cylinder, seamed, [circle((quarter, 1.5), 0.2)]).area() < Face(cylinder, seamed).area()
    assert Face(cylinder, seamed).area() == pytest.approx(4.0 * PI, rel=RIGHT)


def test_parts_of_a_torus():
    torus = shapes.torus(3.0, 1.0)
    (_, a), (_, b) = torus.domain
    # Rings around the tube leave half of it, rings around the axis the outer half.
    half = Face(torus, segment((0, b), (0, 0)), [segment((0.5 * a, 0), (0.5 * a, b))])
    assert half.area() == pytest.approx(6.0 * PI**2, rel=RIGHT)
    outer = Face(torus, segment((0, -0.25 * b), (a, -0.25 * b)), [segment((a, 0.25 * b), (0, 0.25 * b))])
    assert outer.area() == pytest.approx(2.0 * PI * (3.0 * PI + 2.0), rel=RIGHT)
    inner = Face(torus, segment((a, -0.25 * b), (0, -0.25 * b)), [segment((0, 0.25 * b), (a, 0.25 * b))])
    assert inner.area() == pytest.approx(2.0 * PI * (3.0 * PI - 2.0), rel=RIGHT)
    assert outer.volume_integral() + inner.volume_integral() == pytest.approx(6.0 * PI**2, rel=RIGHT)
    hole = circle((0.0, 0.0), 0.5)
    assert Face(torus, hole).area() + Face(torus, None, [hole]).area() == pytest.approx(12.0 * PI**2, rel=RIGHT)


def test_random_loops_have_the_area_of_fine_polygons():
    plane = shapes.plane(10.0, 10.0)
    rng = np.random.default_rng(0)
    for _ in range(10):
        curve = blob(rng, (0.5, -0.3), 3.0)
        areas = []
        for count in (4001, 8001):
            (x, y) = dense(curve, count).T
            areas.append(0.5 * abs(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])))
        # Polygons are off by a multiple of the square of their chords.
        limit = areas[1] + (areas[1] - areas[0]) / 3.0
        assert Face(plane, curve).area() == pytest.approx(limit, rel=1e-8)
