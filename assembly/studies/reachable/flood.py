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
from assembly.studies.reachable.drawn_tip import DrawnTip, Stops
from assembly.studies.reachable.grid import Grid
from assembly.studies.reachable.known_poses import KnownPoses

__all__ = ["Flood", "Limit"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
# [cells] Poses of one cell that are nearer are one; a place of the boundary that is farther from the middle of a cell
# tells nothing of the cell.
_ONE, _FAR = 1e-3, 2.0
# Flips that a search may have, and one more; bits of a cell's number, with which they are one of 64 bits.
_FLIPS, _BITS = 65, 56


class Limit(NamedTuple):
    """Where the tip stopped on the way to the middle of a cell.

    Attributes
    ----------
    target, place, normal : (3,)
        The middle, the place, and the outward normal there, in the world.
    solution : Solution
    """

    target: Array
    place: Array
    normal: Array
    solution: Solution


class _Front(NamedTuple):
    """Cells (k, d) that were reached, how, and after how many flips (k,)."""

    cells: Indices
    flips: Indices
    stops: Stops

    def take(self, rows: Indices) -> _Front:
        return _Front(self.cells[rows], self.flips[rows], self.stops.take(rows))


class _Asked(NamedTuple):
    """Cells (k, d) to which the tip is to be drawn, with their numbers and flips as one, and the stops to begin at."""

    cells: Indices
    keys: Indices
    starts: Indices

    def take(self, rows: Indices) -> _Asked:
        return _Asked(self.cells[rows], self.keys[rows], self.starts[rows])


@dataclass(eq=False)
class Flood:
    """Cells found so far, by numbers that count them from the first one.

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
    limits : dict of number -> list of Limit
        Of cells beside reached ones whose middles are not reached.
    undecided : set of int
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
    limits: dict[int, list[Limit]] = field(default_factory=dict)
    undecided: set[int] = field(default_factory=set)
    solves: int = 0
    advance: Callable[[int], object] = bool
    _done: set[int] = field(default_factory=set)
    _waiting: list[_Front] = field(default_factory=list)
    # What rows of a call did not arrive at: most of it is reached from elsewhere before its turn comes.
    _left: list[tuple[_Asked, _Front]] = field(default_factory=list)
    _first: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    def __post_init__(self) -> None:
        self.reached = KnownPoses((self.grid.dimension, self.tip.bodies), self.arm, _ONE * self.grid.size)

    def run(self, first: tuple[int, ...], stop: Stops, within: Callable[[Array], NDArray[np.bool_]]) -> None:
        """All cells that can be reached from a pose at which the tip is in the first cell.

        `within` tells of places (..., 3) of the world whether they are in the region where it is looked.
        """
        around = np.array([first, *self.grid.around(first)], dtype=np.int64)
        if not len(self.reached):
            self._first = around[0]
        inside = within(self.grid.centers(around))
        if not inside.any():
            place = self.tip.places(stop.poses)[0].tolist()
            raise InputError(f"within has no cell beside the tip, which starts at {place}; expected a box around it")
        start = _Front(around[:1], np.zeros(1, dtype=np.int64), stop)
        cells = around[inside]
        self._try_all(_Asked(cells, self._numbers(cells) * _FLIPS, np.zeros(len(cells), dtype=np.int64)), start)
        while self._waiting or self._left:
            if not self._waiting:
                left, self._left = self._left, []
                for asked, starts in left:
                    self._try_all(self._open(asked), starts, True)
                continue
            fronts, self._waiting = self._waiting, []
            front = _Front(
                np.concatenate([each.cells for each in fronts]),
                np.concatenate([each.flips for each in fronts]),
                Stops.joined([each.stops for each in fronts]),
            )
            beside = self.grid.beside(front.cells)
            rows, sides = np.nonzero(within(self.grid.centers(beside)))
            cells = beside[rows, sides]
            asked = _Asked(cells, self._numbers(cells) * _FLIPS + front.flips[rows], rows)
            self._try_all(self._open(asked), front)
        for number in self.reached.numbers:
            self.limits.pop(number, None)
        self.undecided -= self.reached.numbers

    def _numbers(self, cells: Indices) -> Indices:
        """A number for each of some cells (k, d), in their order."""
        side = 2 ** (_BITS // self.grid.dimension)
        steps = cells - self._first
        if np.abs(steps).max(initial=0) >= side // 2:
            raise InputError(f"the tip goes {side // 2} cells of {self.grid.size:g} far; expected a larger cell")
        powers = side ** np.arange(self.grid.dimension - 1, -1, -1, dtype=np.int64)
        numbers: Indices = (steps + side // 2) @ powers
        return numbers

    def _open(self, asked: _Asked) -> _Asked:
        """Those that no way with as many flips has reached yet."""
        done = self._done
        return asked.take(np.flatnonzero([key not in done for key in asked.keys.tolist()]))

    def _try_all(self, asked: _Asked, front: _Front, alone: bool = False) -> None:
        """Draw the tip to the middles of cells from where it is, to each once where that reaches it."""
        while len(asked.keys):
            _, now = np.unique(asked.keys, return_index=True)
            now.sort()
            first = asked.take(now)
            targets = self.grid.centers(first.cells)
            stops = self.tip.all_to(targets, front.stops.take(first.starts), alone)
            self._count(len(targets))
            left = np.flatnonzero(stops.is_left)
            if left.size:
                own = first.take(left)
                self._left.append((own._replace(starts=np.arange(left.size)), front.take(own.starts)))
            told = np.flatnonzero(~stops.is_left)
            self._tell(first.take(told), targets[told], front, stops.take(told))
            later = np.ones(len(asked.keys), dtype=bool)
            later[now] = False
            asked = self._open(asked.take(np.flatnonzero(later)))

    def _tell(self, asked: _Asked, targets: Array, front: _Front, stops: Stops) -> None:
        """Add what was reached, and look for other configurations where the tip stopped before."""
        flips = front.flips[asked.starts]
        there = np.flatnonzero(stops.is_there)
        self._add(_Front(asked.cells[there], flips[there], stops.take(there)))
        self.undecided.update((asked.keys[~stops.has_ended] // _FLIPS).tolist())
        before = np.flatnonzero(stops.has_ended & ~stops.is_there)
        if not before.size:
            return
        places = self.tip.places(stops.poses[before])
        ways = targets[before] - places
        lengths = np.sqrt((ways**2).sum(axis=1))
        for k, place, way, length in zip(before.tolist(), places, ways, lengths.tolist(), strict=True):
            if length <= _FAR * self.grid.size:
                limit = Limit(targets[k], place, way / length, self.tip.limit(targets[k], stops, k))
                self.limits.setdefault(int(asked.keys[k]) // _FLIPS, []).append(limit)
        starts = asked.starts[before]
        known = self.reached.has(self._numbers(front.cells[starts]))
        turned = np.flatnonzero((flips[before] < self.flips) & known)
        if turned.size:
            self._turn_back(front.take(starts[turned]), stops.poses[before[turned]])

    def _turn_back(self, starts: _Front, poses: Array) -> None:
        """Draw the tip back from beyond stops to the cells where it came from; in other configurations it goes on."""
        backs = self.tip.all_from(self.grid.centers(starts.cells), _mirrored(starts.stops.poses, poses))
        self._count(len(poses))
        there = np.flatnonzero(backs.is_there)
        self._add(_Front(starts.cells[there], starts.flips[there] + 1, backs.take(there)))

    def _count(self, solves: int) -> None:
        self.solves += solves
        self.advance(solves)

    def _add(self, found: _Front) -> None:
        """Poses with the tip in the middles of cells: those that are new go on."""
        numbers = self._numbers(found.cells)
        self._done.update((numbers * _FLIPS + found.flips).tolist())
        new = self.reached.add(numbers, found.cells, found.stops.poses)
        if new.size:
            self._waiting.append(found.take(new))
        if len(self.reached) > self.most:
            raise InputError(
                f"the tip reaches more than {self.most} cells of {self.grid.size:g}; expected a larger cell, "
                "a region `within` which to look, or limits of the joints"
            )


def _mirrored(starts: Array, stops: Array) -> Array:
    """As far beyond stops as the starts are before them, poses (k, n, 7)."""
    result: Array = 2.0 * stops - starts
    # The turn from start to stop once more: of unit quaternions at before* at = 2 (at . before) at - before.
    at, before = stops[..., 3:], starts[..., 3:]
    result[..., 3:] = 2.0 * (at * before).sum(axis=2)[..., None] * at - before
    return result
