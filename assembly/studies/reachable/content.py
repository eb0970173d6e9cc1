"""Area or volume of the cells that were reached, with the parts of cells that the boundary cuts."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from assembly.studies.reachable.grid import Grid

__all__ = ["SIDE", "Content", "cells_beside", "content", "sample_points", "steps_around"]

Array = NDArray[np.float64]
# Points a side of a cell at which it is asked whether they are in the set.
SIDE = {2: 10, 3: 6}


class Content(NamedTuple):
    """Area or volume: of cells reached like all around them, of cells reached or next to one, and the best guess."""

    inner: float
    outer: float
    estimate: float


def content(
    grid: Grid,
    reached: NDArray[np.int64],
    places: Array,
    normals: Array,
    within: Callable[[Array], NDArray[np.bool_]],
) -> Content:
    """Area or volume, from the cells (k, d) reached and places (m, 3) of the boundary with outward normals.

    A cell all of whose neighbors are reached counts whole. Of the others a point counts where it is behind the tangent
    plane of the boundary at the place nearest to it, which is off by the square of the cell's size, and where it is
    `within` the region, that is told of points (m, 3) of the world.
    """
    near, cut = cells_beside(reached)
    inner = grid.content * (len(reached) - len(cut))
    outer = grid.content * (len(reached) + len(near))
    if not len(reached):
        return Content(inner, outer, 0.0)
    shares = _shares(grid, np.concatenate([cut, near]), places, normals, within)
    return Content(inner, outer, inner + grid.content * float(shares.sum()))


def cells_beside(reached: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Cells not reached that share a side, an edge or a corner with one that is, and those reached beside one not."""
    if not len(reached):
        return reached, reached
    dimension = reached.shape[1]
    # Cells as single numbers, with one row of cells around those reached.
    low = reached.min(axis=0) - 1
    counts = reached.max(axis=0) + 2 - low
    weights = np.cumprod(np.concatenate([[1], counts[:-1]]))
    inside = (reached - low) @ weights
    around = inside[:, None] + steps_around(dimension) @ weights
    is_in = np.isin(around, inside)
    near = np.unique(around[~is_in])
    cells = near[:, None] // weights % counts + low
    return cells, reached[~is_in.all(axis=1)]


def steps_around(dimension: int) -> NDArray[np.int64]:
    """From a cell to all that share a side, an edge or a corner with it, and to itself."""
    return np.stack(np.meshgrid(*[(-1, 0, 1)] * dimension, indexing="ij"), axis=-1).reshape(-1, dimension)


def sample_points(grid: Grid, cells: NDArray[np.int64]) -> Array:
    """Points of cells (k, d) at which it is asked whether they are in the set, cell after cell, in units of cells."""
    count = SIDE[grid.dimension]
    steps = (np.arange(count) + 0.5) / count
    offsets = np.stack(np.meshgrid(*[steps] * grid.dimension, indexing="ij"), axis=-1).reshape(-1, grid.dimension)
    result: Array = (cells[:, None, :] + offsets).reshape(-1, grid.dimension)
    return result


def _heights(grid: Grid, points: Array, places: Array, normals: Array) -> tuple[Array, NDArray[np.int64]]:
    """How far points (k, d) are before the tangent plane at the place nearest to each, in cells; and which that is."""
    # In units of cells, along the grid's axes.
    flat, sides = grid.flat(places), normals @ grid.axes.T
    _, nearest = cKDTree(flat).query(points)
    return ((points - flat[nearest]) * sides[nearest]).sum(axis=1), nearest


def _shares(
    grid: Grid,
    cells: NDArray[np.int64],
    places: Array,
    normals: Array,
    within: Callable[[Array], NDArray[np.bool_]],
) -> Array:
    """Which part of each cell (k, d) is in the set, (k,)."""
    points = sample_points(grid, cells)
    behind = within(grid.origin + grid.size * points @ grid.axes)
    if len(places):
        behind &= _heights(grid, points, places, normals)[0] <= 0.0
    result: Array = behind.reshape(len(cells), -1).mean(axis=1)
    return result
