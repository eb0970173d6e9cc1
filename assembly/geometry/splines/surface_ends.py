"""The four ends of a surface, its edges at both ends of u and of v: which are one curve, and which are one point."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.splines import bezier
from assembly.geometry.splines.curve import COINCIDENT

if TYPE_CHECKING:
    from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["closed_directions", "is_one_curve", "pole_bits", "surely_apart"]

Array = NDArray[np.float64]
_BITS = (1, 2, 4, 8)


def closed_directions(surface: NurbsSurface) -> tuple[bool, bool]:
    """Whether u, and v, come back to the edge they start from."""
    apart_u, apart_v = surface._apart
    if apart_u and apart_v:
        return False, False
    if apart_v and _ends_are_equal(surface):
        return True, False
    pieces, tolerance = surface._pieces, COINCIDENT * surface.size
    u = not apart_u and is_one_curve(pieces[0, :, 0], pieces[-1, :, -1], tolerance)
    v = not apart_v and is_one_curve(pieces[:, 0, :, 0], pieces[:, -1, :, -1], tolerance)
    return u, v


def surely_apart(surface: NurbsSurface) -> tuple[bool, bool]:
    """Whether ends in u, and in v, are surely at two points, so that neither edge is the other, nor one point.

    Corners that are nearer to each other are left to a look along the whole edges.
    """
    if not surface._is_clamped:
        return False, False
    net, least = surface.control_points, 10.0 * COINCIDENT * surface.size
    corners = net[[0, -1, 0, -1], [0, 0, -1, -1]]
    a, b, c, d = corners.tolist()

    def apart(p: list[float], q: list[float]) -> bool:
        return max(abs(p[0] - q[0]), abs(p[1] - q[1]), abs(p[2] - q[2])) > least

    return apart(a, b) and apart(c, d), apart(a, c) and apart(b, d)


def _ends_are_equal(surface: NurbsSurface) -> bool:
    """Whether the edges at both ends of u have the same control points and weights."""
    net, weights = surface.control_points, surface.weights
    return bool((net[0] == net[-1]).all() and (weights[0] == weights[-1]).all())


def is_one_curve(first: Array, last: Array, tolerance: float) -> bool:
    """Whether two edges (spans, degree + 1, 4), homogeneous, are one curve and not one point."""
    start, other = first[0, 0, :3] / first[0, 0, 3], last[0, 0, :3] / last[0, 0, 3]
    if float(np.linalg.norm(start - other)) > 2.0 * tolerance:
        return False
    # Two rational pieces of degree q that agree at 2 q + 1 points are equal.
    degree = first.shape[1] - 1
    basis = bezier.bernstein(degree, np.linspace(0.0, 1.0, 2 * degree + 1))
    a, b = basis @ first, basis @ last
    a, b = a[..., :3] / a[..., 3:], b[..., :3] / b[..., 3:]
    is_point = float(np.ptp(a, axis=(0, 1)).max()) <= tolerance
    return not is_point and float(np.linalg.norm(a - b, axis=-1).max()) <= tolerance


def pole_bits(surface: NurbsSurface) -> int:
    """Bits 1, 2, 4, 8: whether the edge at the low and high end of u, then of v, is one point."""
    if all(surface._apart):
        return 0
    if surface._is_clamped:
        # Control points of an edge that is one point are that point; others are clearly apart, or looked at below.
        ends, least = surface.control_points[[0, -1]], 1e3 * COINCIDENT * surface.size
        sides = (ends.max(axis=1) - ends.min(axis=1)).max(axis=1).tolist()
        ends = surface.control_points[:, [0, -1]]
        sides += (ends.max(axis=0) - ends.min(axis=0)).max(axis=1).tolist()
        if all(side == 0.0 or side > least for side in sides):
            return sum(bit for bit, side in zip(_BITS, sides, strict=True) if side == 0.0)
    pieces, tolerance = surface._pieces, COINCIDENT * surface.size
    edges = (pieces[0, :, 0], pieces[-1, :, -1], pieces[:, 0, :, 0], pieces[:, -1, :, -1])
    points = (edge[..., :3] / edge[..., 3:] for edge in edges)
    return sum(
        bit for bit, edge in zip(_BITS, points, strict=True) if float(np.ptp(edge, axis=(0, 1)).max()) <= tolerance
    )
