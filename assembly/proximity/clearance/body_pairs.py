"""Pairs of bodies of which something is proven: their trees of cells, sizes, and lengths of ways between poses."""

from __future__ import annotations

from collections.abc import Sequence
from math import asin, hypot, sqrt

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.equal_shapes import first_equal
from assembly.geometry.faces.face import Face
from assembly.kinematics.pose import rotation_of
from assembly.proximity.clearance.body_cells import BodyCells
from assembly.proximity.clearance.forest import PackedForest

__all__ = ["BodyPairs"]

Array = NDArray[np.float64]
# What rounding may add to a length.
LONGER = 1.0 + 1e-12


class BodyPairs:
    """Pairs of bodies and their trees of cells.

    Parameters
    ----------
    shapes : sequence of tuple of Face
        Of every body its faces; bodies without any are of no pair.
    pairs : sequence of (int, int)
        Numbers of bodies.
    minimum : sequence of float
        Of every pair, what its gap is to be at least.

    Attributes
    ----------
    faces : list of tuple of Face
        Of every body; equal ones are the same objects.
    forest : PackedForest
        The trees of the bodies that are of a pair.
    """

    def __init__(
        self,
        shapes: Sequence[tuple[Face, ...]],
        pairs: Sequence[tuple[int, int]],
        minimum: Sequence[float],
    ) -> None:
        self.pairs = list(pairs)
        self.faces = shapes = [first_equal(faces) for faces in shapes]
        used = sorted({body for pair in pairs for body in pair})
        # Of every body that is of a pair, the number of its tree.
        self._number = {body: k for k, body in enumerate(used)}
        self.forest = PackedForest([shapes[body] for body in used])
        self.minimum = np.array(minimum, dtype=float)

    def cells_of(self, k: int) -> BodyCells:
        """The tree of the second body of pair k."""
        return self.forest.cells[self._number[self.pairs[k][1]]]

    def cells_of_both(self, k: int) -> tuple[BodyCells, BodyCells]:
        """The trees of both bodies of pair k."""
        a, b = self.pairs[k]
        return self.forest.cells[self._number[a]], self.forest.cells[self._number[b]]

    def size(self, k: int) -> float:
        """The size of the larger body of pair k."""
        return max(self.forest.cells[self._number[body]].size for body in self.pairs[k])

    def is_of_wires(self, k: int) -> bool:
        """Whether both bodies of pair k are round wires."""
        return all(cells.is_of_wires for cells in self.cells_of_both(k))

    def radius(self, k: int) -> float:
        """The least radius of what is round of either body of pair k."""
        return min(cells.radius for cells in self.cells_of_both(k))

    def near_pairs(self, q: Array, distance: float) -> list[int]:
        """The pairs whose balls around all of a body are no farther apart than a distance over their least gaps."""
        a, b = np.array(self.pairs, dtype=np.int64).reshape(-1, 2).T
        middle, radius = np.zeros((len(q), 3)), np.zeros(len(q))
        for body, k in self._number.items():
            cells = self.forest.cells[k]
            middle[body] = rotation_of(q[body, 3:]) @ cells.middle + q[body, :3]
            radius[body] = cells.extent
        apart = np.linalg.norm(middle[b] - middle[a], axis=1) - radius[a] - radius[b]
        found: list[int] = np.flatnonzero(apart <= self.minimum + distance).tolist()
        return found

    def relative(self, k: int, q: Array) -> tuple[Array, Array]:
        """The rotation and the shift of the second body of pair k, seen from the first."""
        a, b = self.pairs[k]
        turn = rotation_of(q[a, 3:])
        return turn.T @ rotation_of(q[b, 3:]), (q[b, :3] - q[a, :3]) @ turn

    def move_length(self, k: int, q: Array, move: Array) -> float:
        """How far a move takes points of the second body of pair k, at most."""
        if not move.any():
            return 0.0
        if not move[3:].any():
            return float(np.linalg.norm(move[:3]))
        cells = self.cells_of(k)
        # In plain floats: np.cross takes longer than all the rest.
        x, y, z = (rotation_of(q[self.pairs[k][1], 3:]) @ cells.middle).tolist()
        dx, dy, dz, u, v, w = move.tolist()
        way = hypot(dx + v * z - w * y, dy + w * x - u * z, dz + u * y - v * x)
        return way + cells.extent * hypot(u, v, w)

    def way_length(self, k: int, before: Array, after: Array) -> float:
        """How far points of the second body of pair k go between two poses, seen from the first, at most."""
        return self.length_between(k, self.relative(k, before), self.relative(k, after))

    def length_between(self, k: int, before: tuple[Array, Array], after: tuple[Array, Array]) -> float:
        """The same of what the second body is turned and shifted by."""
        cells = self.cells_of(k)
        turn, shift = after[0] - before[0], after[1] - before[1]
        angle = 2.0 * asin(min(1.0, hypot(*turn.ravel().tolist()) / sqrt(8.0)))
        return (hypot(*(turn @ cells.middle + shift).tolist()) + angle * cells.extent) * LONGER
