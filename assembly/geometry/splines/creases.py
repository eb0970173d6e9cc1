"""Creases of a surface: knot lines at which its normal jumps.

A piecewise surface is smooth inside its spans. Across the knot line u = c its tangent plane is spanned by S_v, which
both sides share, and by S_u of either side, whose direction is that from the next row of Bezier points to the one on
the line. All of that is polynomial along the line, but for positive factors: where the sides are in one plane at more
places of a span than 3 q, q the degree along it, they are all along it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.splines import bezier
from assembly.geometry.splines.curve_parts import CORNER

if TYPE_CHECKING:
    from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["crease_lines"]

Array = NDArray[np.float64]
# Tangents shorter than this part of the surface's size, or nearer to parallel, have no normal.
_SHORT, _PARALLEL = 1e-12, 1e-9
# Rounding of a point, over its distance from the origin.
_POINT_ROUNDING = 8e-15


def crease_lines(surface: NurbsSurface) -> tuple[Array, Array]:
    """Parameters of creases in u and v, increasing; the low end of the domain for a seam that is one."""
    result = []
    for axis in (0, 1):
        if surface.bezier_pieces().shape[axis] == 1 and not surface.closed[axis]:
            result.append(np.empty(0))
            continue
        at, degree, knots = surface.breaks()[axis], surface.degree[axis], surface.knots[axis]
        # Across a knot that is there less often than the degree, the derivative has no jump.
        lines = np.flatnonzero(np.searchsorted(knots, at, "right") - np.searchsorted(knots, at, "left") >= degree)
        lines = lines[(lines > 0) & (lines < len(at) - 1)]
        if surface.closed[axis]:
            lines = np.append(0, lines)
        result.append(at[lines[_jumps(surface, axis, lines)]] if lines.size else np.empty(0))
    return result[0], result[1]


def _jumps(surface: NurbsSurface, axis: int, lines: NDArray[np.intp]) -> NDArray[np.bool_]:
    """At which knot lines of a direction the normal jumps."""
    pieces = surface.bezier_pieces()
    if axis == 1:
        pieces = pieces.transpose(1, 0, 3, 2, 4)
    degree = pieces.shape[3] - 1
    count = 3 * degree + 1
    x = (np.arange(count) + 0.5) / count
    reach = float(np.abs(surface.control_points).max())
    least = max(_SHORT * surface.size, _POINT_ROUNDING * reach)
    # Rows of points along the line and beside it (lines, rows, samples, 3), from the line on.
    basis = bezier.bernstein(degree, x)
    sides = []
    for side in (pieces[lines - 1, :, ::-1], pieces[lines]):
        rows = np.moveaxis(basis @ side, 1, 2)
        sides.append((rows[..., :3] / rows[..., 3:]).reshape(*rows.shape[:2], -1, 3))
    along = _along(pieces[lines, :, 0], x)
    (out, noise), (back, more) = (_normals(rows, along, least) for rows in sides)
    # The first rows lead backward.
    turn = np.arctan2(np.linalg.norm(np.cross(-out, back), axis=-1), -(out * back).sum(axis=-1))
    jumps = (turn > CORNER + _POINT_ROUNDING * reach * (noise + more)).any(axis=1)
    # A line that is one point inside of the surface, as the waist of a double cone, parts it as a crease does.
    spread = np.abs(sides[1][:, 0] - sides[1][:, 0].mean(axis=1, keepdims=True)).max(axis=(1, 2))
    return np.asarray(jumps | (spread <= least))


def _along(line: Array, x: Array) -> Array:
    """Unit tangents (lines, samples, 3) of lines (lines, spans, degree + 1, 4) by the quotient rule; zero: none."""
    degree = line.shape[2] - 1
    p, d = bezier.bernstein(degree, x) @ line, bezier.bernstein(degree - 1, x) @ np.diff(line, axis=2)
    tangent = (d[..., :3] * p[..., 3:] - p[..., :3] * d[..., 3:]).reshape(len(line), -1, 3)
    length = np.linalg.norm(tangent, axis=-1, keepdims=True)
    return np.asarray(np.divide(tangent, length, out=np.zeros_like(tangent), where=length > 0.0))


def _normals(rows: Array, along: Array, least: float) -> tuple[Array, Array]:
    """Unit normals (lines, samples, 3) beside lines, NaN where there are none, and what a unit of noise turns them."""
    toward = np.zeros_like(along)
    for k in range(1, rows.shape[1]):
        # Where the next row is on the line, the one behind it has the direction.
        step = rows[:, k] - rows[:, 0]
        unset = ~toward.any(axis=-1, keepdims=True)
        toward = np.where(unset & (np.linalg.norm(step, axis=-1, keepdims=True) > least), step, toward)
    normal = np.cross(toward, along)
    size = np.linalg.norm(normal, axis=-1)
    size[size <= _PARALLEL * np.linalg.norm(toward, axis=-1)] = np.nan
    return normal / size[..., None], 1.0 / size
