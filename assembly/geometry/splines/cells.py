"""Bounding cells of a surface: where a global search for closest points starts.

The Bezier pieces are halved, always the one with the largest bounding sphere in its longer direction, until
there are enough. A sphere around the control points of a cell holds the cell, by the convex hull property
of positive weights (Piegl & Tiller, The NURBS Book, P1.10 and P4.9).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.geometry.splines.cell_splitting import BOUNDS, BOUNDS_SIZE, put_neighbors_together, split_cells

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
    spans = pieces.shape[0] * pieces.shape[1]
    count = max(count, spans)
    nets = np.empty((2, count, *pieces.shape[2:]))
    boxes, measured = np.empty((2, count, 4)), np.empty((2, count, BOUNDS_SIZE))
    nets[0, :spans] = pieces.reshape(-1, *pieces.shape[2:])
    at_u, at_v = surface.breaks()
    many_u, many_v = at_u.size - 1, at_v.size - 1
    boxes[0, :spans, :2] = np.repeat(np.column_stack([at_u[:-1], at_u[1:]]), many_v, axis=0)
    boxes[0, :spans, 2:] = np.tile(np.column_stack([at_v[:-1], at_v[1:]]), (many_u, 1))
    last = split_cells(nets, boxes, measured, spans, _ROUND, np.empty(count, dtype=np.int64))
    levels = max(0, int(np.ceil(np.log2(count / GROUP))))
    order, along = np.empty(GROUP << levels, dtype=np.int64), np.empty(GROUP << levels)
    put_neighbors_together(measured[last], GROUP, order, along)
    order = order[:count]
    found = rows_of(BOUNDS, measured[last][order])
    return boxes[last][order], np.asarray(found.center), np.asarray(found.radius)


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
