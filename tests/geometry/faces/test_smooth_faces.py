"""Creases are found, whatever the parameters, and faces are cut along them."""

import numpy as np
import pytest

from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.faces.smooth_faces import has_creases, smooth_faces
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface


def extruded(points, height=2.0, degree=1, knots=None):
    """A wall over a polyline, or over a spline with the points as control points."""
    points = np.array(points, dtype=float)
    n = len(points)
    if knots is None:
        knots = np.concatenate([[0.0], np.arange(n), [n - 1.0]])
    net = np.stack([np.column_stack([points, np.full(n, z)]) for z in (0.0, height)], axis=1)
    return NurbsSurface(net, (knots, [0, 0, 1, 1]), (degree, 1))


def rippled(n, m, rng):
    """Bilinear patches over a grid: creases along all lines of both directions."""
    x, y = np.meshgrid(np.arange(float(n)), np.arange(float(m)), indexing="ij")
    net = np.stack([x, y, rng.uniform(0.0, 0.7, x.shape)], axis=2)
    knots = [np.concatenate([[0.0], np.arange(float(k)), [k - 1.0]]) for k in (n, m)]
    return NurbsSurface(net, knots, (1, 1))


def circle(center, radius, clockwise=False):
    points = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float)
    points = radius * (points[::-1] if clockwise else points) + center
    return NurbsCurve(points, [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], 2, [1, np.sqrt(0.5)] * 4 + [1])


def polygon(*corners):
    ring = [*corners, corners[0]]
    return [NurbsCurve([a, b], [0, 0, 1, 1], 1) for a, b in zip(ring, ring[1:], strict=False)]


ROOF = extruded([(0, 0), (1, 1), (2, 0)])
SQUARE = extruded([(1, -1), (1, 1), (-1, 1), (-1, -1), (1, -1)])
# Two arcs of degree 2 that leave the seam at an angle; no other crease, and no knot.
DROP = extruded([(0, 0), (3, 2), (3, -2), (0, 0)], degree=3, knots=[0, 0, 0, 0, 1, 1, 1, 1])
# A vase: a profile with a corner, turned.
TURNED = shapes.cylinder(1.0, 2.0)


def vase():
    """A cylinder under a cone in one surface: a crease along the ring between them."""
    ring = TURNED.control_points[:, 0] * [1.0, 1.0, 0.0]
    rows = [ring + [0, 0, -1], ring, ring * [0.5, 0.5, 1.0] + [0, 0, 1.5]]
    net = np.stack(rows, axis=1)
    weights = np.repeat(TURNED.weights[:, :1], 3, axis=1)
    return NurbsSurface(net, (TURNED.knots[0], [0, 0, 1, 2, 2]), (2, 1), weights)


@pytest.mark.parametrize(
    ("surface", "u", "v"),
    [
        (ROOF, [1.0], []),
        (SQUARE, [0.0, 1.0, 2.0, 3.0], []),
        (DROP, [0.0], []),
        (vase(), [], [1.0]),
        (rippled(4, 3, np.random.default_rng(0)), [1.0, 2.0], [1.0]),
        # The same in other degrees; a knot of full multiplicity alone is none.
        (ROOF.elevate((4, 3)), [1.0], []),
        (ROOF.elevate((4, 3)).insert_knot(0, 0.5, 4), [1.0], []),
        # Different speeds on both sides of a knot, the tangent plane the same.
        (extruded([(0, 0), (1, 0), (1.5, 0), (4, 2)], degree=2, knots=[0, 0, 0, 1, 1.5, 1.5, 1.5]), [], []),
        (extruded([(0, 0), (1, 0), (2, 0), (2.2, 0), (4, 2)], degree=2, knots=[0, 0, 0, 1, 1, 2, 2, 2]), [], []),
        # Back on itself: tangents are parallel, and point opposite ways.
        (extruded([(0, 0), (1, 0), (0.2, 0)]), [1.0], []),
        # Points twice on the line: the direction is that of the rows beyond.
        (extruded([(0, 0), (1, 1), (1, 1), (2, 0), (3, 0)], degree=2, knots=[0, 0, 0, 1, 1, 2, 2, 2]), [1.0], []),
        *[(shape, [], []) for shape in (shapes.sphere(1.0), shapes.torus(3.0, 1.0), shapes.cone(1.0, 2.0), TURNED)],
        (shapes.paper_clip(), [], []),
    ],
)
def test_creases_are_found(surface, u, v):
    for moved in (surface, surface.transformed(scale=1e-6), surface.transformed(translation=(1e4, -3e4, 1e4))):
        found = moved._creases
        np.testing.assert_array_equal(found[0], u)
        np.testing.assert_array_equal(found[1], v)


@pytest.mark.parametrize("turn", [1e-5, 1e-4, -0.3])
def test_slight_creases_are_found(turn):
    points = [(0, 0), (1, 0), (1 + np.cos(turn), np.sin(turn))]
    assert has_creases(Face(extruded(points)))
    # Below a micro-radian surfaces count as smooth, as where two faces meet.
    assert not has_creases(Face(extruded([(0, 0), (1, 0), (2, 1e-7)])))


def test_a_waist_parts_a_double_cone():
    ring = TURNED.control_points[:, 0] * [1.0, 1.0, 0.0]
    net = np.stack([ring + [0, 0, -1], 0.0 * ring, ring + [0, 0, 1]], axis=1)
    surface = NurbsSurface(net, (TURNED.knots[0], [0, 0, 1, 2, 2]), (2, 1), np.repeat(TURNED.weights[:, :1], 3, axis=1))
    np.testing.assert_array_equal(surface._creases[1], [1.0])
    lower, upper = smooth_faces(Face(surface))
    assert lower.surface.domain[1] == (0.0, 1.0) and upper.surface.domain[1] == (1.0, 2.0)
    assert lower.surface.closed == upper.surface.closed == (True, False)


def test_smooth_faces_stay_what_they_are():
    for surface in (shapes.sphere(1.0), shapes.torus(3.0, 1.0), shapes.plane(1.0, 2.0)):
        face = Face(surface)
        assert smooth_faces(face) == [face]


RNG = np.random.default_rng(5)
TRIMMED = {
    "roof": Face(ROOF),
    "square": Face(SQUARE, reversed=True),
    "drop": Face(DROP),
    "vase": Face(vase()),
    "grid": Face(rippled(5, 4, RNG)),
    "hole over the ridge": Face(ROOF, holes=[circle((1.1, 0.5), 0.3, True)]),
    "hole beside the ridge": Face(ROOF, holes=[circle((1.5, 0.5), 0.3, True)]),
    "disk": Face(ROOF, circle((0.9, 0.5), 0.4)),
    "disk beside": Face(ROOF, circle((0.5, 0.5), 0.4)),
    "disk with a hole": Face(ROOF, circle((0.9, 0.5), 0.45), [circle((0.9, 0.5), 0.2, True)]),
    "along the ridge": Face(ROOF, polygon((1, 0.1), (1.7, 0.1), (1.7, 0.9), (1, 0.9))),
    "along it for a while": Face(ROOF, polygon((0.5, 0.1), (1.7, 0.1), (1.7, 0.9), (1, 0.9), (1, 0.5), (0.5, 0.5))),
    "a hole that touches it from beside": Face(ROOF, holes=[circle((1.3, 0.5), 0.3, True)]),
    "a notch down to it": Face(ROOF, polygon((0, 0.1), (1.7, 0.1), (1.0, 0.5), (1.7, 0.9), (0, 0.9))),
    "a corner at the ridge": Face(ROOF, polygon((1, 0.5), (1.7, 0.1), (1.7, 0.9))),
    "comb": Face(
        ROOF, polygon((0.2, 0.1), (1.8, 0.1), (1.8, 0.3), (0.6, 0.4), (1.8, 0.5), (1.8, 0.7), (0.6, 0.8), (0.2, 0.9))
    ),
    "grid with a hole": Face(rippled(5, 4, RNG), circle((2.0, 1.5), 1.4), [circle((2.1, 1.4), 0.8, True)]),
    "hole over a corner of a tube": Face(SQUARE, holes=[circle((1.2, 0.5), 0.35, True)]),
    "hole over the seam of a tube": Face(SQUARE, holes=[circle((0.2, 0.5), 0.35, True)]),
    "hole over the seam of a drop": Face(DROP, holes=[circle((0.05, 0.5), 0.2, True)]),
    "patch over the seam of a tube": Face(SQUARE, circle((3.9, 0.5), 0.35)),
    "patch over the seam of a vase": Face(vase(), circle((0.1, 0.9), 0.35)),
    "window in a vase": Face(vase(), holes=[circle((2.0, 0.9), 0.35, True)]),
}


@pytest.mark.parametrize("name", TRIMMED)
def test_parts_are_smooth_and_cover_the_face(name):
    face = TRIMMED[name]
    parts = smooth_faces(face)
    assert not any(has_creases(part) for part in parts)
    assert all(part.reversed == face.reversed for part in parts)
    # Areas in space add up.
    area = sum(part.area() for part in parts)
    assert area == pytest.approx(face.area(), rel=1e-9)
    rng = np.random.default_rng(7)
    surface = face.surface
    u, v = (rng.uniform(*bounds, 400) for bounds in surface.domain)
    inside = face.contains(u, v)
    count = np.zeros(400, dtype=int)
    for part in parts:
        # Parts of a closed surface may be some periods away.
        for turn in [0] if part.surface.closed[0] or not surface.closed[0] else [-1, 0, 1]:
            at = u + turn * (surface.domain[0][1] - surface.domain[0][0])
            held = np.ones(400, dtype=bool)
            for x, axis in ((at, 0), (v, 1)):
                if not part.surface.closed[axis]:
                    low, high = part.surface.domain[axis]
                    held &= (x >= low) & (x <= high)
            held[held] = part.contains(at[held], v[held])
            count += held
            if held.any():
                here, there = surface.evaluate(u[held], v[held]), part.surface.evaluate(at[held], v[held])
                np.testing.assert_allclose(there, here, atol=1e-13)
    np.testing.assert_array_equal(count, inside)
