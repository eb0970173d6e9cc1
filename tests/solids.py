"""Solids that several tests are about."""

from __future__ import annotations

import numpy as np

from assembly.geometry.faces.face import Face
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface

# Half the sides of the tiled solid's base, its height in the middle, and how fast its roof falls off.
HALF_X, HALF_Y, HEIGHT, FALL_X, FALL_Y = 5.0, 4.0, 8.0, 0.06, 0.05


def roof_height(x, y):
    """z of the curved face of the tiled solid."""
    return HEIGHT - FALL_X * x**2 - FALL_Y * y**2


def parabola_points(half: float, end: float, middle: float) -> np.ndarray:
    """Bezier points (3, 2) of the parabola over [-half, half] with given heights at both ends and in the middle."""
    return np.array([[-half, end], [0.0, 2.0 * middle - end], [half, end]])


def _line(start, end) -> NurbsCurve:
    length = float(np.hypot(*np.subtract(end, start)))
    return NurbsCurve([start, end], [0.0, 0.0, length, length], 1)


def _side(half: float, end: float, middle: float, along, normal, distance: float, name: str) -> Face:
    """A plane side under a parabola: u runs along it over [-half, half], v is the height."""
    along, normal = np.array(along, dtype=float), np.array(normal, dtype=float)
    up = np.array([0.0, 0.0, 1.0])
    points = np.empty((2, 2, 3))
    u, v = 1.25 * half, (-0.25 * middle, 1.25 * middle)
    for i, x in enumerate((-u, u)):
        for j, z in enumerate(v):
            points[i, j] = distance * normal + x * along + z * up
    surface = NurbsSurface(points, ([-u, -u, u, u], [v[0], v[0], v[1], v[1]]), (1, 1))
    arch = NurbsCurve(parabola_points(half, end, middle)[::-1], [-half] * 3 + [half] * 3, 2)
    outer = [
        _line((-half, 0.0), (half, 0.0)),
        _line((half, 0.0), (half, end)),
        arch,
        _line((-half, end), (-half, 0.0)),
    ]
    return Face(surface, outer, name=name)


def tiled_solid() -> list[Face]:
    """Five plane faces and a curved convex one on top: the kind of solid of paper 000, figure 9.

    Its base is [-5, 5] x [-4, 4] at z = 0; the roof is z = 8 - 0.06 x^2 - 0.05 y^2 with u = x and v = y. The faces are
    "front" (-y), "right" (+x), "back" (+y), "left" (-x), "bottom" and "top". Convex, 12 edges, 8 vertices.
    """
    corner = roof_height(HALF_X, HALF_Y)
    over_x, over_y = roof_height(0.0, HALF_Y), roof_height(HALF_X, 0.0)
    sides = [
        _side(HALF_X, corner, over_x, (1, 0, 0), (0, -1, 0), HALF_Y, "front"),
        _side(HALF_Y, corner, over_y, (0, 1, 0), (1, 0, 0), HALF_X, "right"),
        _side(HALF_X, corner, over_x, (-1, 0, 0), (0, 1, 0), HALF_Y, "back"),
        _side(HALF_Y, corner, over_y, (0, -1, 0), (-1, 0, 0), HALF_X, "left"),
    ]
    x, y = HALF_X, HALF_Y
    base = [[[-x, y, 0.0], [-x, -y, 0.0]], [[x, y, 0.0], [x, -y, 0.0]]]
    bottom = Face(NurbsSurface(base, ([-x, -x, x, x], [-y, -y, y, y]), (1, 1)), name="bottom")
    points = np.zeros((3, 3, 3))
    points[..., 0] = np.array([-x, 0.0, x])[:, None]
    points[..., 1] = np.array([-y, 0.0, y])
    # A parabola's middle Bezier point is where its end tangents meet: minus the fall at the ends.
    fall_x, fall_y = FALL_X * x**2 * np.array([1.0, -1.0, 1.0]), FALL_Y * y**2 * np.array([1.0, -1.0, 1.0])
    points[..., 2] = HEIGHT - fall_x[:, None] - fall_y
    roof = NurbsSurface(points, ([-x] * 3 + [x] * 3, [-y] * 3 + [y] * 3), (2, 2))
    return [*sides, bottom, Face(roof, name="top")]
