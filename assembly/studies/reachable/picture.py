"""The cells of a workspace as triangles, colored by numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.errors import InputError
from assembly.kinematics.picture_mesh import PictureMesh
from assembly.studies.reachable.grid import Grid

__all__ = ["cell_values", "cells_picture"]

Array = NDArray[np.float64]
# From least to greatest: dark violet, blue, green, yellow; even steps of it look even, in gray too.
_COLORS = np.array([[0.27, 0.00, 0.33], [0.23, 0.32, 0.55], [0.13, 0.57, 0.55], [0.37, 0.79, 0.38], [0.99, 0.91, 0.14]])
_GRAY = (0.75, 0.77, 0.80)


def cell_values(values: ArrayLike, count: int) -> Array:
    """Numbers, one a cell; NaN where there is none."""
    try:
        numbers = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"values are {values!r}; expected {count} numbers, one a cell") from None
    if numbers.shape != (count,):
        raise InputError(f"values have the shape {numbers.shape}; expected ({count},), one number a cell")
    return numbers


def cells_picture(grid: Grid, cells: NDArray[np.int64], values: Array | None) -> PictureMesh:
    """Squares of cells (k, 2), or the outer sides of cells (k, 3), colored by values (k,)."""
    corners, owners = (_squares if grid.dimension == 2 else _sides)(cells)
    points = grid.origin + grid.size * corners.reshape(-1, grid.dimension) @ grid.axes
    first = 4 * np.arange(len(corners))[:, None]
    triangles = np.concatenate([first + [0, 1, 2], first + [0, 2, 3]])
    return PictureMesh(points, triangles, np.repeat(_colors(values, len(cells))[owners], 4, axis=0))


def _squares(cells: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    around = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    return cells[:, None, :] + around, np.arange(len(cells))


def _sides(cells: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Corners (m, 4, 3) of sides between a cell and no cell, counterclockwise from outside; their cells (m,)."""
    known = {tuple(cell) for cell in cells.tolist()}
    corners, owners = [], []
    for axis in range(3):
        after, last = np.roll(np.eye(3, dtype=np.int64), -axis, axis=0)[1:]
        along = np.eye(3, dtype=np.int64)[axis]
        for step in (-1, 1):
            beside = cells + step * along
            open_ = np.array([tuple(cell) not in known for cell in beside.tolist()])
            square = np.array([0 * after, after, after + last, last])[::step]
            corners.append(cells[open_][:, None, :] + (along if step > 0 else 0 * along) + square)
            owners.append(np.flatnonzero(open_))
    return np.concatenate(corners), np.concatenate(owners)


def _colors(values: Array | None, count: int) -> Array:
    """Red, green and blue of cells; gray for those without a value."""
    result = np.tile(_GRAY, (count, 1))
    if values is None:
        return result
    known = np.isfinite(values)
    if known.any():
        low, span = values[known].min(), np.ptp(values[known])
        share = (values[known] - low) / span if span > 0.0 else np.zeros(known.sum())
        stops = np.linspace(0.0, 1.0, len(_COLORS))
        result[known] = np.column_stack([np.interp(share, stops, column) for column in _COLORS.T])
    return result
