"""Cells that a tip can reach, front after front: each is tried from the poses at which its neighbors are reached.

A solve draws the tip to the middle of a cell, with all constraints. Where the tip comes there, the cell is reached, and
its neighbors are tried from the new pose. Where it does not, the tip stops at the place of the set that is nearest to
the middle: a place of the set's boundary, whose outward normal is the direction in which the rest of the way lies,
because at the least distance all that can still move moves at right angles to it.

The neighbors of all cells that were reached in one turn are the front of the next one, and are drawn to in one call.
One that several cells are beside is tried from the first of these, and from the next one where that does not reach it.

A mechanism may reach a place in several configurations (an elbow to the left or to the right), and a boundary of the
one need not be one of the other. They meet where the tip stops with the mechanism straight or folded: what has moved
on as it came there brings the tip back in another configuration. So from each stop the motion is carried on to its
mirror image, and the cell that it came from is solved for from there; a pose that differs goes on by itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError
from assembly.solve.solution import Solution
from assembly.studies.reachable.drawn_tip import DrawnTip, Stop
from assembly.studies.reachable.grid import Cell, Grid

__all__ = ["Flood"]

Array = NDArray[np.float64]
# [cells] Poses of one cell that are nearer are one: solves end much nearer to the middle.
_ONE = 1e-3
# [cells] A place of the boundary that is farther from the middle of a cell tells nothing of the cell.
_FAR = 2.0


class _Reached(NamedTuple):
    """A cell that was reached, how, and after how many flips."""

    cell: Cell
    stop: Stop
    flips: int


@dataclass(eq=False)
class Flood:
    """Cells found so far.

    Attributes
    ----------
    grid : Grid
    tip : DrawnTip
    arm : float
        Half the scene's size: a turn by an angle counts as a motion this far from the axis.
    flips : int
        How often a way may go on in another configuration.
    most : int
        Cells that may be reached.
    reached : dict of cell -> list of (poses (n, 7), marks (n, 19))
    limits : dict of cell -> list of (middle, place, outward normal, solution)
        Of cells beside reached ones whose middles are not reached: where the tip stopped on the way there.
    undecided : set of cell
        Cells at which a solve has not ended; none of them is reached.
    solves : int
        How many there were.
    advance : callable
        Hears of each.
    """

    grid: Grid
    tip: DrawnTip
    arm: float
    flips: int
    most: int
    reached: dict[Cell, list[tuple[Array, Array]]] = field(default_factory=dict)
    limits: dict[Cell, list[tuple[Array, Array, Array, Solution]]] = field(default_factory=dict)
    undecided: set[Cell] = field(default_factory=set)
    solves: int = 0
    advance: Callable[[int], object] = bool
    _done: set[tuple[int, Cell]] = field(default_factory=set)
    _waiting: list[_Reached] = field(default_factory=list)

    def run(self, first: Cell, stop: Stop, within: Callable[[Array], NDArray[np.bool_]]) -> None:
        """All cells that can be reached from a pose at which the tip is in the first cell.

        `within` tells of places (..., 3) of the world whether they are in the region where it is looked.
        """
        start = _Reached(first, stop, 0)
        around = (first, *self.grid.around(first))
        inside = within(self.grid.centers(np.array(around))).tolist()
        if not any(inside):
            place = self.tip.place(stop).tolist()
            raise InputError(f"within has no cell beside the tip, which starts at {place}; expected a box around it")
        self._try_all([(cell, start) for cell, holds in zip(around, inside, strict=True) if holds])
        while self._waiting:
            front, self._waiting = self._waiting, []
            beside = self.grid.beside(np.array([start.cell for start in front]))
            inside = within(self.grid.centers(beside)).tolist()
            self._try_all(
                [
                    (cell, start)
                    for start, cells, holds in zip(front, beside.tolist(), inside, strict=True)
                    for cell, is_in in zip(map(tuple, cells), holds, strict=True)
                    if is_in and (start.flips, cell) not in self._done
                ]
            )
        for cell in self.reached:
            self.limits.pop(cell, None)
        self.undecided -= set(self.reached)

    def _marks(self, poses: Array) -> Array:
        """Numbers that differ by about as much as poses (k, n, 7) do, (k, n, 19): origins, and 2 arm e e^T of turns e.

        A quaternion and its negative have the same; of a turn by a small angle they change by about arm times it.
        """
        e = poses[..., 3:]
        turns = 2.0 * self.arm * e[..., :, None] * e[..., None, :]
        return np.concatenate([poses[..., :3], turns.reshape(*e.shape[:2], 16)], axis=2)

    def _try_all(self, asked: list[tuple[Cell, _Reached]]) -> None:
        """Draw the tip to the middles of cells from where it is, to each once where that reaches it."""
        while asked:
            now: dict[tuple[int, Cell], _Reached] = {}
            later = []
            for cell, start in asked:
                key = start.flips, cell
                if key in now:
                    later.append((cell, start))
                else:
                    now[key] = start
            cells = [cell for _, cell in now]
            targets = self.grid.centers(np.array(cells))
            stops = self.tip.all_to(targets, [start.stop for start in now.values()])
            self._count(len(stops))
            self._tell(cells, targets, list(now.values()), stops)
            asked = [(cell, start) for cell, start in later if (start.flips, cell) not in self._done]

    def _tell(self, cells: list[Cell], targets: Array, starts: list[_Reached], stops: list[Stop]) -> None:
        """Add what was reached, and look for other configurations where the tip stopped before."""
        marks = self._marks(np.array([stop.poses for stop in stops]))
        stopped = []
        for cell, target, start, stop, mark in zip(cells, targets, starts, stops, marks, strict=True):
            if stop.is_there:
                self._add(cell, stop, start.flips, mark)
            elif not stop.has_ended:
                self.undecided.add(cell)
            else:
                place = self.tip.place(stop)
                length = float(np.linalg.norm(target - place))
                if length <= _FAR * self.grid.size:
                    limit = target, place, (target - place) / length, self.tip.limit(target, stop)
                    self.limits.setdefault(cell, []).append(limit)
                if start.flips < self.flips and start.cell in self.reached:
                    stopped.append((start, stop))
        if stopped:
            self._turn_back(stopped)

    def _turn_back(self, stopped: list[tuple[_Reached, Stop]]) -> None:
        """Draw the tip back from beyond stops to the cells where it came from; in other configurations it goes on."""
        poses = np.array([self._mirrored(start.stop, stop) for start, stop in stopped])
        backs = self.tip.all_from(self.grid.centers(np.array([start.cell for start, _ in stopped])), poses)
        self._count(len(backs))
        marks = self._marks(np.array([back.poses for back in backs]))
        for (start, _), back, mark in zip(stopped, backs, marks, strict=True):
            if back.is_there:
                self._add(start.cell, back, start.flips + 1, mark)

    def _count(self, solves: int) -> None:
        self.solves += solves
        self.advance(solves)

    def _mirrored(self, start: Stop, stop: Stop) -> Array:
        """As far beyond a stop as the start is before it, poses (n, 7)."""
        result = 2.0 * stop.poses - start.poses
        # The turn from start to stop once more: of unit quaternions at before* at = 2 (at . before) at - before.
        at, before = stop.poses[:, 3:], start.poses[:, 3:]
        result[:, 3:] = 2.0 * (at * before).sum(axis=1)[:, None] * at - before
        return result

    def _add(self, cell: Cell, stop: Stop, flips: int, marks: Array) -> None:
        """A pose with the tip in the middle of a cell, and its marks (n, 19): one that is new goes on."""
        known = self.reached.setdefault(cell, [])
        self._done.add((flips, cell))
        if any(np.abs(marks - other).max() < _ONE * self.grid.size for _, other in known):
            return
        known.append((stop.poses, marks))
        self._waiting.append(_Reached(cell, stop, flips))
        if len(self.reached) > self.most:
            raise InputError(
                f"the tip reaches more than {self.most} cells of {self.grid.size:g}; expected a larger cell, "
                "a region `within` which to look, or limits of the joints"
            )
