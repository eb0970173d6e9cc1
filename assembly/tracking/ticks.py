"""How a tick goes: the loop, the proof of where that led, and what is left to the next tick."""

from __future__ import annotations

from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.scene import MOST_CROWDING
from assembly.constraints.program.records import CLOCK_AT
from assembly.proximity.clearance.kept_looks import NEVER, Until
from assembly.proximity.manager.records import CROWDED, EVENT_COUNT
from assembly.solve.loop.settings import (
    CARRIED,
    CARRIES,
    CONTACT_LOST,
    LAST_FEASIBLE,
    OUT_OF_TIME,
    RADIUS,
    SOLVED,
    VIOLATION,
)
from assembly.tracking.hands import Targets, are_same
from assembly.tracking.standing import Standing
from assembly.tracking.tick import Step, TrackStatus
from assembly.tracking.tick_memory import TickMemory, forget_updates

__all__ = ["LOOP_SHARE", "Ticks"]

Array = NDArray[np.float64]
# Steps of a tick may be bounded to this, in parts of the scene's size, after ticks that failed.
SHORTEST_RADIUS = 1e-7
# The part of a budget in which the loop may begin steps, where what it ends at has to be proven: proofs take less than
# loops, and most end at once. Halved: one in five ticks more is LATE. Twice the rest: as many as now.
LOOP_SHARE = 0.8
# Made once: to make one of a type with a parameter takes half a microsecond.
_NO_PAIRS: frozenset[int] = frozenset()
# What the loop says of a tick whose pose holds.
_STATUSES = {SOLVED: TrackStatus.FOLLOWED, OUT_OF_TIME: TrackStatus.LATE}


class Ticks(TickMemory):
    """Ticks in the memory of a tracker."""

    def _moved_clear(self, row: Targets, until: Until) -> tuple[TrackStatus, Array] | None:
        """Run the loop, and prove where that led; None if the loop or the proof goes on in the next tick.

        Some pairs have no rows at first, or those of earlier ticks (`proven_pairs.py`). Where the proof refuses a pose,
        they get others, once, and the tick begins again. Pairs that had rows get those of the pose that was refused,
        and the tick goes on from there: where a flat face turns to its other side, the lowest point of its rim is one
        that it was not near before. If that does not hold either, and for pairs that had none, it begins at the last
        pose, with the rows of that.
        """
        begun_again, goes_on = _NO_PAIRS, False
        clear = self._clear
        while True:
            if clear is not None:
                clear.unlisted, clear.renewable = self._rows.unlisted, self._rows.fitting - begun_again
            status, code = self._moved(until)
            if status is None:
                # The next tick goes on from a pose that does not hold yet.
                return None
            ended, is_violated = self._pose.copy(), status is TrackStatus.VIOLATED
            if clear is None or (is_violated and not goes_on):
                return status, ended
            holds = not is_violated and clear.hold_at(Standing(self._scene, self._packed, ended), until, code)
            if holds is None:
                self._awaited = status, row, ended
                return None
            if holds:
                return status, self._holds() if self._rows.are_some else ended
            again = self._rows.without_updates(clear.doubtful) & set(clear.in_the_way)
            if self._budget is not None or not (goes_on or again - begun_again):
                return self._refused()
            goes_on = not (goes_on or begun_again or again & self._rows.unlisted)
            if not goes_on:
                self._pose[:] = self._before
            self._rows.list_again(self._state, again, self._poses_of(ended))
            begun_again |= again

    def _run(self, until: Until) -> tuple[int, int | None]:
        """Run the loop, and the first part of the proof where that is the straight way: how these ended."""
        rows, clear = self._rows, self._clear
        rows.leave_out(self._state)
        if clear is None or not clear.begins_straight:
            return self._call.run(rows.has_no_rows, self._tolerance), None
        return self._call.run_and_prove(rows.has_no_rows, self._tolerance, clear.last, until[1])

    def _moved(self, until: Until) -> tuple[TrackStatus | None, int | None]:
        """Run the loop once, and what of the proof begins at once.

        Returns the status of the tick if bodies are clear, None if the loop goes on in the next one; and how the proof
        ended, None where it was not asked.
        """
        view, at = self._view, self._packed.results_at
        carried = view[at + CARRIED] > 0.0
        code, found = self._run(until)
        if view[at + CARRIED] > 0.0:
            return None, None
        status = _STATUSES.get(code, TrackStatus.APPROACHING)
        if not view[at + VIOLATION] <= self._tolerance:
            # If a contact appeared that the rows of the last tick did not have, there is no pose to return to.
            begun = carried or self._history[0, 1] * self._packed.scale <= self._tolerance
            if code == CONTACT_LOST or (begun and self._stands):
                self._pose[:] = self._before
                return TrackStatus.HELD if self._stands else TrackStatus.VIOLATED, None
            return TrackStatus.VIOLATED, None
        return TrackStatus.HELD if view[at + LAST_FEASIBLE] == 1.0 else status, found

    def _gone_on(self, row: Targets, begin: float, until: Until) -> Step | None:
        """The step of a tick that goes on with a proof; None where there is time for the loop as well."""
        assert self._clear is not None and self._awaited is not None
        holds = self._clear.go_on(until)
        if holds is None:
            return self._late(row, begin)
        status, asked, ended = self._awaited
        self._awaited = None
        if not holds:
            status, ended = self._refused()
        else:
            ended = self._holds() if self._rows.are_some else ended
            if not are_same(row, asked):
                # It is as near as it can be to another target.
                status = TrackStatus.LATE
                if perf_counter() - begin < LOOP_SHARE * (self._budget or 0.0):
                    self._before = ended
                    return None
        return self._ended(status, ended, row, begin)

    def _ended(self, status: TrackStatus, ended: Array, row: Targets, begin: float) -> Step:
        """The step of a tick that ended at a state (k,), which nobody writes to."""
        packed = self._packed
        # After a step that was too long the next ones are shorter, until they succeed.
        radius = self._knobs[RADIUS]
        if status is TrackStatus.HELD:
            self._knobs[RADIUS] = max(0.25 * radius, SHORTEST_RADIUS)
        elif radius < self._radius:
            self._knobs[RADIUS] = min(4.0 * radius, self._radius)
        seen, view, is_crowded = self._seen, self._view, False
        if packed.clearance_rows:
            self._seen, is_crowded = view[packed.memory_at + EVENT_COUNT], view[packed.memory_at + CROWDED] == 1.0
        self._before, followed = ended, self._followed
        if is_crowded and self._inner._crowding < MOST_CROWDING:
            self._take_more_places()
        return Step(followed, ended, status, row, seen, perf_counter() - begin, self._way_depth())

    def _until(self, begin: float) -> Until:
        """When the time of a tick is over that began at a time; what is not done is left to the next one only then."""
        if self._budget is None or self._knobs[CARRIES] == 0.0:
            return NEVER
        return int(self._packed.table[CLOCK_AT]), int(1e9 * (begin + self._budget))

    @property
    def _stands(self) -> bool:
        """Whether constraints hold at the pose of the last tick."""
        return bool(self._before[self._packed.results_at + VIOLATION] <= self._tolerance)

    def _late(self, row: Targets, begin: float) -> Step:
        """The step of a tick whose time was over: the last pose stands."""
        status = TrackStatus.LATE if self._stands else TrackStatus.VIOLATED
        seen, packed = self._seen, self._packed
        if packed.clearance_rows:
            # A proof that ended in this tick may have led to it: the next ones do not tell its events again.
            self._seen = float(self._before[packed.memory_at + EVENT_COUNT])
        return Step(self._followed, self._before, status, row, seen, perf_counter() - begin, self._way_depth())

    def _refused(self) -> tuple[TrackStatus, Array]:
        """Go back to the last pose from one at which bodies are not known to be clear."""
        refused = self._poses_of(self._pose).copy()
        self._pose[:] = self._before
        # The contact that was crossed may not be listed: all pairs are searched again.
        self._rows.list_again(self._state, [] if self._clear is None else self._clear.in_the_way, refused)
        self._rows.update_all()
        forget_updates(self._packed, self._state)
        return TrackStatus.HELD, self._pose.copy()

    def _holds(self) -> Array:
        """Go on from a pose at which all pairs hold; its state, which nobody writes to."""
        self._rows.settle(self._pose, self._scene)
        return self._pose.copy()

    def _poses_of(self, state: Array) -> Array:
        """The poses of the bodies in a state, (n, 7)."""
        return state[: self._packed.contacts_at].reshape(-1, 7)

    def _way_depth(self) -> float | None:
        """How deep the way to the last pose may go in; None where that is not proven."""
        if self._clear is None:
            return 0.0
        return self._clear.way_depth if self._clear.proved else None
