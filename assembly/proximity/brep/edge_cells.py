"""Balls around parts of edges S(c(t)), halved until they are small against the edge; they are proven.

Over [t_low, t_high] the Bezier points of the plane curve span a box in (u, v) that holds it; cut to this box, the
Bezier points of the surface span a hull that holds the surface over the box (positive weights; Piegl & Tiller, The
NURBS Book, P1.10 and P4.9), and so the edge.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.brep.body_nets import BodyNets
from assembly.proximity.brep.edge_balls import write_balls

__all__ = ["edge_cells"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
# At least so many cells an edge, of balls no larger than this part of the edge's length while there are not too many.
_LEAST, _MOST, _PART = 16, 256, 0.0625


def _first_cells(at: Array) -> Array:
    """Cells (n, 2), t_low and t_high: the spans of a curve with these knots in equal parts, 16 or more together."""
    parts = -(-_LEAST // (at.size - 1))
    low = (at[:-1, None] + np.diff(at)[:, None] * (np.arange(parts) / parts)).ravel()
    return np.column_stack([low, np.append(low[1:], at[-1])])


def edge_cells(nets: BodyNets, faces: Indices, curves: Indices, lengths: Array) -> list[Array]:
    """Cells of edges S(c(t)).

    Parameters
    ----------
    nets
    faces, curves : (n,)
        Of every edge the number of its face, and that of its plane curve among all of the nets.
    lengths : (n,)
        Of the edges: balls are halved until they are small against them, or there are many.

    Returns
    -------
    list of (n, 6)
        For every edge rows of t_low, t_high, center (3) and radius, in the order of t.
    """
    if not len(faces):
        return []
    sides = np.column_stack([faces, nets.curve_records(curves)])
    first = [_first_cells(nets.breaks[curve]) for curve in curves.tolist()]
    cells, owner = np.concatenate(first), np.repeat(np.arange(len(first)), [len(rows) for rows in first])
    counts = np.bincount(owner, minlength=len(first))
    work = nets.workspace()
    done: list[Array] = []
    owners: list[Indices] = []
    while len(cells):
        balls = np.empty((len(cells), 4))
        write_balls(nets.table, nets.pool, sides[owner], cells, work, balls)
        large = _largest(balls[:, 3], _PART * lengths, owner, np.maximum(_MOST - counts, 0))
        done.append(np.concatenate([cells, balls], axis=1)[~large])
        owners.append(owner[~large])
        cells, owner = cells[large], owner[large]
        counts += np.bincount(owner, minlength=len(first))
        middle = cells.mean(axis=1)
        cells = np.concatenate([np.column_stack([cells[:, 0], middle]), np.column_stack([middle, cells[:, 1]])])
        owner = np.tile(owner, 2)
    rows, owner = np.concatenate(done), np.concatenate(owners)
    rows = rows[np.lexsort((rows[:, 0], owner))]
    return np.split(rows, np.cumsum(counts)[:-1])


def _largest(radius: Array, least: Array, owner: Indices, room: Indices) -> NDArray[np.bool_]:
    """Which balls are larger than the least of their edge; the largest alone where an edge has no room for all."""
    large = radius > least[owner]
    crowded = np.flatnonzero(np.bincount(owner[large], minlength=len(room)) > room)
    for edge in crowded.tolist():
        mine = np.flatnonzero(large & (owner == edge))
        large[mine[np.argsort(-radius[mine], kind="stable")][room[edge] :]] = False
    return large
