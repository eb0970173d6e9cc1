"""Bounding cells of a surface: where a global search for closest points starts.

The Bezier pieces are halved, always the one with the largest bounding sphere in its longer direction, until
there are enough. A sphere around the control points of a cell holds the cell, by the convex hull property
of positive weights (Piegl & Tiller, The NURBS Book, P1.10 and P4.9).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["COUNT", "split", "surface_cells"]

Array = NDArray[np.float64]
COUNT = 128
# Cells are listed so that this many in a row are neighbors: they are looked at together first.
GROUP = 8
# A round halves every cell whose sphere is larger than this part of the largest: halves are seldom larger,
# so that rounds of many cells give what halving one at a time gives.
_ROUND = 0.7


def _halves(points: Array, axis: int) -> tuple[Array, Array]:
    """De Casteljau's algorithm at the middle, along axis 1 or 2 of (cells, p + 1, q + 1, 4)."""
    row = np.moveaxis(points, axis, 1)
    left, right = np.empty_like(row), np.empty_like(row)
    last = row.shape[1] - 1
    for k in range(last + 1):
        left[:, k] = row[:, 0]
        right[:, last - k] = row[:, -1]
        row = 0.5 * (row[:, :-1] + row[:, 1:])
    return np.moveaxis(left, 1, axis), np.moveaxis(right, 1, axis)


def _measures(points: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Sphere centers (cells, 3), radii (cells,) and whether u is the longer direction."""
    xyz = points[..., :3] / points[..., 3:]
    center = 0.5 * (xyz.min(axis=(1, 2)) + xyz.max(axis=(1, 2)))
    radius = np.sqrt(((xyz - center[:, None, None]) ** 2).sum(axis=3).max(axis=(1, 2)))
    # Rounding of the coordinates and of the halving: the sphere must contain, not nearly contain.
    radius += 1e-14 * (radius + np.abs(center).max(axis=1))
    long_u = np.sqrt((np.diff(xyz, axis=1) ** 2).sum(axis=3)).sum(axis=1).mean(axis=1)
    long_v = np.sqrt((np.diff(xyz, axis=2) ** 2).sum(axis=3)).sum(axis=2).mean(axis=1)
    return center, radius, long_u >= long_v


def _neighborly(center: Array) -> NDArray[np.int64]:
    """An order in which cells that follow one another lie close together.

    Ranges are halved at the median along the direction in which their centers spread most, a level at a time, down to
    `GROUP` of them.
    """
    count = len(center)
    levels = max(0, int(np.ceil(np.log2(count / GROUP))))
    # Padded to equal ranges by copies of the last cell, which are dropped in the end.
    order = np.minimum(np.arange(GROUP << levels), count - 1)
    for level in range(levels):
        order = order.reshape(1 << level, -1)
        points = center[order]
        axis = np.ptp(points, axis=1).argmax(axis=1)
        along = np.take_along_axis(points, axis[:, None, None], axis=2)[:, :, 0]
        order = np.take_along_axis(order, np.argsort(along, axis=1, kind="stable"), axis=1)
    order = order.ravel()
    first = np.unique(order, return_index=True)[1]
    return order[np.sort(first)]


def split(surface: NurbsSurface, count: int = COUNT) -> tuple[Array, Array, Array]:
    """Boxes in (u, v) that tile the domain, with spheres around the surface over them, neighbors near in the list.

    Parameters
    ----------
    surface
        The surface.
    count
        How many; one a span where there are more spans than that.

    Returns
    -------
    boxes : (cells, 4)
        u_low, u_high, v_low, v_high.
    centers : (cells, 3)
    radii : (cells,)
    """
    pieces = surface.bezier_pieces()
    points = pieces.reshape((-1,) + pieces.shape[2:])
    at_u, at_v = surface.breaks()
    low = np.meshgrid(at_u[:-1], at_v[:-1], indexing="ij")
    high = np.meshgrid(at_u[1:], at_v[1:], indexing="ij")
    box = np.stack([low[0].ravel(), high[0].ravel(), low[1].ravel(), high[1].ravel()], axis=1)
    center, radius, along_u = _measures(points)
    while len(points) < count:
        order = np.argsort(-radius, kind="stable")
        large = order[radius[order] >= _ROUND * radius[order[0]]][: count - len(points)]
        kept = np.ones(len(points), dtype=bool)
        kept[large] = False
        new_points: list[Array] = []
        new_box: list[Array] = []
        for axis, chosen in ((1, large[along_u[large]]), (2, large[~along_u[large]])):
            new_points += _halves(points[chosen], axis)
            lower, upper = box[chosen].copy(), box[chosen].copy()
            first = 2 * (axis - 1)
            middle = 0.5 * (box[chosen, first] + box[chosen, first + 1])
            lower[:, first + 1] = middle
            upper[:, first] = middle
            new_box += [lower, upper]
        fresh = np.concatenate(new_points)
        measured = _measures(fresh)
        points = np.concatenate([points[kept], fresh])
        box = np.concatenate([box[kept], *new_box])
        center = np.concatenate([center[kept], measured[0]])
        radius = np.concatenate([radius[kept], measured[1]])
        along_u = np.concatenate([along_u[kept], measured[2]])
    order = _neighborly(center)
    return box[order], center[order], radius[order]


def surface_cells(surface: NurbsSurface) -> Array:
    """The cells of `split` as kernels read them: (cells, CELL_SIZE); more of them for a surface of many spans.

    A row is u and v of the middle of a cell, the surface point there, the center of its sphere, its radius, and half
    the widths of its box in u and in v.
    """
    spans = surface._pieces.shape[0] * surface._pieces.shape[1]
    box, center, radius = split(surface, min(max(COUNT, 8 * spans), 3 * COUNT))
    u, v = 0.5 * (box[:, 0] + box[:, 1]), 0.5 * (box[:, 2] + box[:, 3])
    half_u, half_v = 0.5 * (box[:, 1] - box[:, 0]), 0.5 * (box[:, 3] - box[:, 2])
    return np.column_stack([u, v, surface.evaluate(u, v), center, radius, half_u, half_v])
