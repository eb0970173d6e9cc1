"""The manifold of a ball in a hollow cone or in a bore: one ring, along which it touches if it lies on the axis.

About the axis a of the wall, from the apex or a point of the axis o, the wall's tangent plane at the direction u across
the axis has the normal N(u) = cos(alpha) u - sin(alpha) a (`round_pair.py`). A ball of radius r about c is

    R - N(u).c - r

away from it, affine in c, with R = 0 of a cone. The least of them is R - cos(alpha) |c across a| + sin(alpha) a.c - r,
which is the gap between the ball and the whole wall, exactly. So there is a row in each of some directions that stay,
and one in the direction in which the ball is nearest.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi, sin, sqrt, tan

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.recognition.forms import Cone, Cylinder, Sphere
from assembly.proximity.manifolds.places import Affine
from assembly.proximity.manifolds.round_pair import HELD, across_axis
from assembly.proximity.manifolds.second_rates import ALIKE, Level, Row

__all__ = ["ball_rows", "seats", "touched_circles"]

Array = NDArray[np.float64]
# What rounding may make of a gap, in parts of the coordinates.
ROUNDING = 1e-15


def ball_rows(hollow: Cylinder | Cone, ball: Sphere, turn: Array, shift: Array) -> tuple[Sequence[Row], float] | None:
    """The rows of a ball at x -> turn x + shift in a hollow wall, and a bound of all gaps.

    Which part of the wall's turn is there is not asked. None where the circle along which they are nearest is beyond
    the wall's ends all around.
    """
    origin, angle, radius = _wall(hollow)
    center = turn @ ball.center + shift
    off, size = center - origin, float(np.abs(origin).max() + np.abs(center).max()) + radius + ball.radius
    height = float(off @ hollow.axis)
    aside = off - height * hollow.axis
    apart = sqrt(float(aside @ aside))
    # Where on the wall's generators the ball is nearest.
    middle, reach = height * cos(angle) ** 2, apart * sin(angle) * cos(angle)
    if middle + reach < hollow.heights[0] or middle - reach > hollow.heights[1]:
        return None
    right = np.array(across_axis(tuple(hollow.axis.tolist())))
    up = np.cross(hollow.axis, right)
    place, rows = Affine(center, np.empty((3, 0))), []
    ways = [cos(0.5 * pi * k) * right + sin(0.5 * pi * k) * up for k in range(HELD)]
    # Where the center is on the axis all directions are nearest ones: one of them stands for all.
    nearest = aside / apart if apart > ALIKE * size else right
    for k, way in enumerate([*ways, nearest]):
        normal = sin(angle) * hollow.axis - cos(angle) * way
        gap = radius + float(normal @ off) - ball.radius
        bends = (-cos(angle) * np.cross(hollow.axis, way), cos(angle) * way) if k == HELD else None
        rows.append(Level(gap, normal, center - ball.radius * normal, False, np.empty(0), place, origin, bends))
    least = radius + sin(angle) * height - cos(angle) * apart - ball.radius
    return rows, least - hollow.deviation - ROUNDING * size


def seats(hollow: Cylinder | Cone, ball: Sphere) -> list[Array]:
    """Where the center of a ball is that lies in a hollow wall: along a circle of a cone, or on a rim of either."""
    origin, angle, radius = _wall(hollow)
    found = []
    touched = ball.radius * cos(angle) ** 2 / sin(angle) if angle > 0.0 else -np.inf
    for k, sign in ((0, -1.0), (1, 1.0)):
        end = hollow.heights[k]
        rim = radius + end * tan(angle)
        # From the larger rim of a cone a ball goes up, and from the smaller one as well; a bore has one at either end.
        is_beyond = sign * (touched - end) > 0.0 if angle > 0.0 else True
        if 0.0 < rim < ball.radius and is_beyond:
            up = 1.0 if angle > 0.0 else sign
            found.append(origin + (end + up * sqrt(ball.radius**2 - rim**2)) * hollow.axis)
    if hollow.heights[0] <= touched <= hollow.heights[1]:
        found.append(origin + ball.radius / sin(angle) * hollow.axis)
    return found


def touched_circles(hollow: Cylinder | Cone, center: Array, count: int) -> list[tuple[Array, Array]]:
    """Points of a wall (count, 3) where a ball may touch it all around, and unit vectors from them to its center.

    Along a circle of a cone, and both rims.
    """
    origin, angle, at_origin = _wall(hollow)
    right = np.array(across_axis(tuple(hollow.axis.tolist())))
    turns = 2.0 * pi / count * np.arange(count)
    ways = np.outer(np.cos(turns), right) + np.outer(np.sin(turns), np.cross(hollow.axis, right))
    found = []
    if angle > 0.0:
        normals = sin(angle) * hollow.axis - cos(angle) * ways
        points = center - (normals @ (center - origin))[:, None] * normals
        heights = (points - origin) @ hollow.axis
        if hollow.heights[0] <= heights.min() and heights.max() <= hollow.heights[1]:
            found.append((points, normals))
    for end in hollow.heights:
        points = origin + end * hollow.axis + (at_origin + end * tan(angle)) * ways
        away = center - points
        found.append((points, away / np.linalg.norm(away, axis=1)[:, None]))
    return found


def _wall(hollow: Cylinder | Cone) -> tuple[Array, float, float]:
    """A wall's origin, half angle and radius there."""
    if isinstance(hollow, Cone):
        return hollow.apex, hollow.half_angle, 0.0
    return hollow.point, 0.0, hollow.radius
