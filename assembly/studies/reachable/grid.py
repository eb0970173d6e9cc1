"""The grid of square or cubic cells that a workspace is looked for in."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError
from assembly.kinematics.frame import Frame

__all__ = ["Cell", "Grid", "grid_of"]

Array = NDArray[np.float64]
Cell = tuple[int, ...]
_PLANES = {"xy": (0, 1), "yz": (1, 2), "zx": (2, 0)}


@dataclass(frozen=True, eq=False)
class Grid:
    """Cells in a plane, or in space.

    Attributes
    ----------
    origin : (3,)
        A corner of cell (0, 0) or (0, 0, 0), in the world.
    axes : (d, 3)
        Unit vectors at right angles along which cells are counted; two in a plane, three in space.
    size : float
        Length of a cell's sides.
    """

    origin: Array
    axes: Array
    size: float

    @property
    def dimension(self) -> int:
        """Two or three."""
        return len(self.axes)

    @property
    def content(self) -> float:
        """Area or volume of a cell."""
        return float(self.size**self.dimension)

    def centers(self, cells: NDArray[np.int64]) -> Array:
        """Middles of cells (k, d), in the world, (k, 3)."""
        result: Array = self.origin + self.size * (cells + 0.5) @ self.axes
        return result

    def flat(self, points: Array) -> Array:
        """Points (..., 3) of the world in units of cells along the axes, (..., d)."""
        result: Array = (points - self.origin) @ self.axes.T / self.size
        return result

    def cell(self, point: Array) -> Cell:
        """The cell that a point is in."""
        return tuple(np.floor(self.flat(point)).astype(np.int64).tolist())

    def beside(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        """Of each of some cells (k, d) those that share a side with it, (k, 2 d, d)."""
        forward = np.eye(self.dimension, dtype=np.int64)
        steps = np.stack([-forward, forward], axis=1).reshape(-1, self.dimension)
        return cells[:, None] + steps

    def around(self, cell: Cell) -> Iterator[Cell]:
        """Cells that share a side, an edge or a corner with one."""
        for steps in product((-1, 0, 1), repeat=self.dimension):
            if any(steps):
                yield tuple(k + step for k, step in zip(cell, steps, strict=True))


def grid_of(plane: Frame | str | None, tip: Array, size: float) -> Grid:
    """The grid in space, or in a plane, for a tip that is at a place of the world at the start."""
    if plane is None:
        return Grid(np.zeros(3), np.eye(3), size)
    if isinstance(plane, Frame):
        if not plane.body.fixed:
            raise InputError(f"plane is a frame of {plane.body.name!r}, which moves; expected one of a fixed body")
        pose = plane.body.pose
        turn = pose.matrix[:3, :3] @ plane.axes
        return Grid(pose.apply(plane.origin), np.ascontiguousarray(turn[:, :2].T), size)
    if not isinstance(plane, str) or plane not in _PLANES:
        raise InputError(f"plane is {plane!r}; expected a frame of a fixed body, 'xy', 'yz', 'zx' or None")
    axes = np.eye(3)[list(_PLANES[plane])]
    return Grid(tip - axes.T @ (axes @ tip), axes, size)
