"""Looks at pairs of bodies, kept from one to the next, all at once or piece by piece."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from assembly._lent import lent_table
from assembly.geometry.faces.face import Face
from assembly.proximity.clearance.body_pairs import BodyPairs
from assembly.proximity.clearance.forest import Fronts
from assembly.proximity.clearance.pair_looks import (
    AT_POSE,
    BEGUN_ANEW,
    GOING_ON,
    GROWN,
    MANY,
    ON_WAY,
    ON_WAY_ANEW,
    ON_WAY_AT_ONCE,
    PASSED_BY,
    look_at_pairs,
    stay_clear,
)
from assembly.proximity.clearance.records import CLEAR, NO_ROOM, OPEN, SPENT

__all__ = ["NEVER", "KeptLooks", "Until", "run_through"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
Result = TypeVar("Result")
# When the time of looks is over: the address of a clock, and nanoseconds; never.
Until = tuple[int, int]
NEVER: Until = (0, 0)


def run_through(looks: Generator[None, None, Result]) -> Result:
    """What looks that are made piece by piece return, whatever time it takes."""
    while True:
        try:
            next(looks)
        except StopIteration as end:
            result: Result = end.value
            return result


class KeptLooks(BodyPairs):
    """Looks at pairs of bodies and the fronts that they keep; made as `BodyPairs` are.

    Attributes
    ----------
    fronts : Fronts
    until : (int, int)
        When the time of looks that are made piece by piece is over: a clock's address, and nanoseconds.
    """

    def __init__(
        self,
        shapes: Sequence[tuple[Face, ...]],
        pairs: Sequence[tuple[int, int]],
        minimum: Sequence[float],
    ) -> None:
        super().__init__(shapes, pairs, minimum)
        local = [(self._number[a], self._number[b]) for a, b in pairs]
        self.fronts = Fronts(self.forest, local, minimum)
        self.fronts.counts.body_a, self.fronts.counts.body_b = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
        self._codes = np.zeros(len(self.pairs), dtype=np.int64)
        # Last poses before the last looks that asked whether pairs stay clear.
        self._before = np.zeros((len(self.pairs), 12))
        self._begun = np.zeros(len(self.pairs), dtype=bool)
        # Columns: to ask records for them by name takes longer than a tick.
        self._turn, self._shift = self.fronts.pair.turn, self.fronts.pair.shift
        # Poses of the last looks, where all pairs had them at the same ones.
        self._at: bytes | None = None
        self.until = NEVER
        self._lent: tuple[object, object, Table] = None, None, np.empty(0, dtype=np.int64)

    @property
    def lent(self) -> Table:
        """The arrays that looks work on, as kernels take them (`pair_looks.py`); others once they had to grow."""
        forest, fronts, table = self._lent
        if forest is not self.forest.arrays or fronts is not self.fronts.arrays:
            table = lent_table((*self.forest.arrays, *self.fronts.arrays, self._codes, self._before))
            self._lent = self.forest.arrays, self.fronts.arrays, table
        return table

    def _looked(
        self, q: Array, touching: float, moves: Array, rows: Sequence[int], swept: bool, budget: int | None
    ) -> Generator[None, None, list[int]]:
        """Look at some pairs; what was asked of each."""
        self.forget_cells()
        tasks = np.zeros(len(self.pairs), dtype=np.int64)
        counts, pair = self.fronts.counts, self.fronts.pair
        # Not while a look goes on with what its time was over for.
        idle = (counts.fresh > 0) & (pair.underway == 0.0)
        grown = idle & (counts.count > GROWN * counts.fresh + MANY)
        asked = np.where(grown | ~self._begun, BEGUN_ANEW, AT_POSE)
        if swept:
            asked = np.where(pair.known == 1.0, np.where(grown, ON_WAY_ANEW, ON_WAY), asked)
        tasks[rows] = asked[rows]
        yield from self._look(q, touching, moves, tasks, budget)
        self._begun[rows] = True
        at = q.tobytes()
        if len(rows) == len(self.pairs):
            self._at = at
        elif self._at != at:
            self._at = None
        told: list[int] = tasks.tolist()
        return told

    def stays_clear(
        self, q: Array, touching: float, moves: Array, budget: int | None = None, at_once: bool = False
    ) -> bool:
        """Whether all pairs, all of which were clear at the last look, are so at poses and on the way there.

        Where one is not, nothing is known: `look` tells what it is. The budget is as there. A way that is to be proven
        at once is not taken in parts.
        """
        task = ON_WAY_AT_ONCE if at_once else ON_WAY
        return self._stay_clear(q, touching, moves, (task, budget), NEVER) == CLEAR

    def staying_clear(
        self, q: Array, touching: float, moves: Array, budget: int | None = None, code: int | None = None
    ) -> Generator[None, None, bool]:
        """As `stays_clear`, piece by piece: it yields whenever the time of `until` is over.

        Parameters
        ----------
        q, touching, moves, budget
        code : int, optional
            How the first piece ended, of one who called the kernel with the task ON_WAY himself.
        """
        code = self._stay_clear(q, touching, moves, (ON_WAY, budget), self.until, code)
        while code == SPENT:
            yield
            code = self._stay_clear(q, touching, moves, (GOING_ON, budget), self.until)
        return code == CLEAR

    def _stay_clear(
        self,
        q: Array,
        touching: float,
        moves: Array,
        asked: tuple[int, int | None],
        until: Until,
        code: int | None = None,
    ) -> int:
        """How looks at all pairs end that do a task within a budget; `code` if they were made already."""
        self._at, at = None, np.array(q, dtype=float)
        task, budget = asked
        if code is None:
            self.forget_cells()
            code = stay_clear(self.lent, at, moves, touching, (task, budget or 0), until)
        while code == NO_ROOM and self._grow():
            if task != ON_WAY_AT_ONCE:
                # Other pairs have been looked at: they are at these poses.
                self._codes[self._codes == NO_ROOM] = SPENT
                task = GOING_ON
            code = stay_clear(self.lent, at, moves, touching, (task, budget or 0), until)
        if code == NO_ROOM:
            self._give_up()
        if code == CLEAR:
            self._at = at.tobytes()
        return int(code)

    def forget_cells(self) -> None:
        """Forget cells where contacts that went along bodies have left too many."""
        if self.forest.is_large:
            self.forest.forget(self.fronts)

    def _grow(self) -> bool:
        """Make more room for cells, or for fronts; False where there may be no more."""
        return self.forest.grow() if self.forest.is_full else self.fronts.grow()

    def _look(
        self, q: Array, touching: float, moves: Array, tasks: Table, budget: int | None
    ) -> Generator[None, None, None]:
        """Look at pairs, and again with more room at those that had too little; yield where the time is over."""
        waiting, at, counts, pair = tasks.copy(), np.array(q, dtype=float), self.fronts.counts, self.fronts.pair
        while waiting.any():
            usual, pair.touch = counts.budget.copy(), touching
            if budget is not None:
                counts.budget = budget
            look_at_pairs(self.lent, at, moves, waiting, self.until)
            counts.budget = usual
            asked = waiting != PASSED_BY
            short, late = asked & (self._codes == NO_ROOM), asked & (self._codes == SPENT)
            if short.any() and not self._grow():
                self._give_up()
                self._codes[short] = OPEN
                short[:] = False
            # What is in the front already stays there; where the time was over there may be none yet.
            begun = (short | late) & (pair.underway > 0.0)
            kept = np.where(begun & (waiting == BEGUN_ANEW), AT_POSE, waiting)
            kept = np.where(begun & (waiting == ON_WAY_ANEW), ON_WAY, kept)
            waiting = np.where(short | late, kept, PASSED_BY)
            if late.any():
                yield

    def last_poses(self) -> tuple[Array, Array]:
        """The rotations (pairs, 9) and shifts (pairs, 3) of second bodies at the last looks that ended clear."""
        return self._turn.copy(), self._shift.copy()

    def poses_before(self) -> tuple[Array, Array]:
        """What `last_poses` were before the last looks that asked whether all pairs stay clear."""
        return self._before[:, :9].copy(), self._before[:, 9:].copy()

    def go_back(self, poses: tuple[Array, Array]) -> None:
        """Make earlier poses, from which all ways were clear, the last ones again. Looks that go on are given up."""
        pair, self._at = self.fronts.pair, None
        for k in np.flatnonzero(pair.underway).tolist():
            self.fronts.take_back(k)
        for k, (turn, shift) in enumerate(zip(*poses, strict=True)):
            self._begin_at(k, turn, shift)

    def _begin_at(self, k: int, turn: Array, shift: Array) -> None:
        """Make an earlier pose of pair k, from which all of the way was clear, the last one again."""
        pair = self.fronts.pair
        now = pair.turn[k].reshape(3, 3).copy(), pair.shift[k].copy()
        pair.travelled[k] += self.length_between(k, now, (turn.reshape(3, 3), shift))
        pair.turn[k], pair.shift[k] = turn, shift

    def _give_up(self) -> None:
        """Give up looks that go on, where there may be no more room: last poses are those at which they began."""
        pair = self.fronts.pair
        for k in np.flatnonzero((self._codes == NO_ROOM) & (pair.underway > 0.0)).tolist():
            self.fronts.take_back(k)
            if pair.behind[k] > 0.0:
                self._begin_at(k, pair.origin_turn[k].copy(), pair.origin_shift[k].copy())
