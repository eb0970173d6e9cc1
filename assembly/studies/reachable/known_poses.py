"""Poses at which cells were reached: the first of each cell, and which others differ from all before."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["KnownPoses"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class KnownPoses:
    """Poses of cells, cells by their numbers.

    Parameters
    ----------
    shape : (int, int)
        Of how many numbers a cell is, and how many bodies there are.
    arm : float
        A turn by an angle counts as a motion this far from the axis.
    one : float
        Poses of one cell that are nearer are one.
    """

    def __init__(self, shape: tuple[int, int], arm: float, one: float) -> None:
        dimension, bodies = shape
        self._arm, self._one = arm, one
        # Of every cell which of the poses are its, and marks of all poses, with room for more.
        self._own: dict[int, list[int]] = {}
        self._marks, self._count = np.empty((1024, 19 * bodies)), 0
        self._cells: list[Indices] = [np.empty((0, dimension), dtype=np.int64)]
        self._poses: list[Array] = [np.empty((0, bodies, 7))]

    @property
    def numbers(self) -> set[int]:
        """Of the cells."""
        return set(self._own)

    def __len__(self) -> int:
        """How many cells there are."""
        return len(self._own)

    def has(self, numbers: Indices) -> NDArray[np.bool_]:
        """Whether cells were reached."""
        return np.array([number in self._own for number in numbers.tolist()], dtype=bool)

    def in_order(self) -> tuple[Indices, Array]:
        """The cells (k, d) in the order of their numbers, and the first pose (n, 7) of each."""
        rows = [self._own[number][0] for number in sorted(self._own)]
        return np.concatenate(self._cells)[rows], np.concatenate(self._poses)[rows]

    def add(self, numbers: Indices, cells: Indices, poses: Array) -> Indices:
        """Add poses (k, n, 7) of cells (k, d); which of them are new."""
        marks = self._marked(poses)
        differs = np.ones(len(numbers), dtype=bool)
        known = [self._own.get(number, ()) for number in numbers.tolist()]
        pairs = [(row, other) for row, others in enumerate(known) for other in others]
        if pairs:
            own, others = np.array(pairs).T
            apart = np.abs(marks[own] - self._marks[others]).max(axis=1)
            differs[own[apart < self._one]] = False
        rows: Indices = np.flatnonzero(differs)
        if len(set(numbers[rows].tolist())) < len(rows):
            rows = self._first_ones(rows, numbers, marks)
        for at, number in enumerate(numbers[rows].tolist(), self._count):
            self._own.setdefault(number, []).append(at)
        self._keep(marks[rows])
        self._cells.append(cells[rows])
        self._poses.append(poses[rows])
        return rows

    def _first_ones(self, rows: Indices, numbers: Indices, marks: Array) -> Indices:
        """Of rows some of which are of one cell those that differ from all before them."""
        here: dict[int, list[int]] = {}
        for row in rows.tolist():
            before = here.setdefault(int(numbers[row]), [])
            if all(np.abs(marks[row] - marks[other]).max() >= self._one for other in before):
                before.append(row)
        return np.array(sorted(row for own in here.values() for row in own), dtype=np.int64)

    def _keep(self, marks: Array) -> None:
        end = self._count + len(marks)
        if end > len(self._marks):
            room = np.empty((2 * end, marks.shape[1]))
            room[: self._count] = self._marks[: self._count]
            self._marks = room
        self._marks[self._count : end] = marks
        self._count = end

    def _marked(self, poses: Array) -> Array:
        """Numbers that differ by about as much as poses (k, n, 7) do, (k, 19 n): origins, and 2 arm e e^T of turns e.

        A quaternion and its negative have the same; of a turn by a small angle they change by about arm times it.
        """
        e = poses[..., 3:]
        turns = 2.0 * self._arm * e[..., :, None] * e[..., None, :]
        marks: Array = np.concatenate([poses[..., :3], turns.reshape(*e.shape[:2], 16)], axis=2)
        return marks.reshape(len(poses), marks.shape[1] * marks.shape[2])
