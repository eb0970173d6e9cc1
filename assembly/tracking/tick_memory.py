"""The packed scene that the ticks of a tracker solve, and the memory that they go on in."""

from __future__ import annotations

from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assembly._copies import InOneProcess
from assembly.constraints.model.constraint import structure_changes
from assembly.constraints.packing.corners import body_of
from assembly.constraints.packing.earlier import taken_over
from assembly.constraints.packing.renumbered import numbers_told
from assembly.constraints.packing.scene import structure_of
from assembly.constraints.program.records import CLOCK_AT, MANAGER_RECORD
from assembly.kinematics.changes import changes
from assembly.proximity.clearance.kept_looks import NEVER, Until
from assembly.proximity.features.solid_contact import STAYS, TRACK
from assembly.proximity.manager.records import (
    CLOCK,
    EVENT_COUNT,
    MARK_AT,
    MEMORY_HEADER,
    PAIR_MEMORY,
    PAIR_TURN,
    PAIRS,
)
from assembly.solve.attempts.attempts import new_workspace
from assembly.solve.clearance_proof import can_prove
from assembly.solve.loop.settings import CARRIES, HISTORY, RADIUS, VIOLATION
from assembly.solve.scene import Scene
from assembly.solve.solution import Solution
from assembly.solve.start_proof import is_for_proofs
from assembly.tracking.clear_ticks import ClearTicks
from assembly.tracking.fitting import fits_of
from assembly.tracking.followed import Followed
from assembly.tracking.hands import Hands, Targets
from assembly.tracking.proven_pairs import ProvenPairs, joined_pairs
from assembly.tracking.tick import Step, TrackStatus

if TYPE_CHECKING:
    from assembly.assembly import Assembly
    from assembly.constraints.packing.scene import Packed

__all__ = ["TickMemory", "forget_updates"]

Array = NDArray[np.float64]


def forget_updates(packed: Packed, state: Array) -> None:
    """Let the next tick search all pairs of bodies that clearances keep apart."""
    pairs = state[packed.memory_at + MEMORY_HEADER :][
        : PAIR_MEMORY * int(packed.table[packed.table[MANAGER_RECORD] + PAIRS])
    ]
    pairs.reshape(-1, PAIR_MEMORY)[:, PAIR_TURN] = np.nan


def _follow_extrema(packed: Packed, state: Array, keeps_time: bool) -> None:
    """Let rows of clearances follow extrema, from edges onto faces as well, which corners do not.

    Ticks have no final update. Which rows are in the place of a contact, or are its own pair, their first update tells.
    """
    record = packed.table[MANAGER_RECORD]
    packed.table[record + CLOCK] = packed.table[CLOCK_AT] if keeps_time else 0
    first, count = len(packed.contacts), sum(packed.places[: len(packed.clearances)])
    # Corners of contacts, which are listed behind, carry bodies that lie on each other: they stay.
    state[packed.contacts_at : packed.angles_at].reshape(-1, TRACK)[first : first + count, STAYS] = 0.0
    if packed.table[record + MARK_AT]:
        forget_updates(packed, state)


class TickMemory(InOneProcess):
    """What ticks of a scene with hands read and write: the packed scene, a state, workspaces, settings, and proofs.

    A subclass sets the scene with its hands, the settings and what counts as touching before the first solution is
    taken in.
    """

    _inner: Assembly
    _hands: Hands
    _settings: Array
    _budget: float | None
    _touching: float
    _tolerance: float

    def _take_packed(self, first: Solution) -> None:
        """Go on with the scene as it is packed once a solution has listed its contacts, which may need more places."""
        _ = first._state
        self._packed: Packed = self._inner.packed()
        assert self._inner._scene is not None
        self._scene: Scene = self._inner._scene
        self._edits, self._numbers = changes(), self._told()

    def _begin_at(self, first: Solution) -> None:
        """Have ticks go on from a solution of the packed scene."""
        packed, self._begun = self._packed, first.status
        # Of a tick whose proof goes on: how it ended otherwise, its targets, and its state.
        self._awaited: tuple[TrackStatus, Targets, Array] | None = None
        self._set_up(first._state)
        proves = packed.keeps_apart and can_prove(packed)
        self._clear = ClearTicks(first, self._touching * packed.scale) if proves else None
        # What no proof tells of, rows alone keep apart.
        proves = self._clear is not None and self._clear.proved and is_for_proofs(packed)
        bodies, constraints = self._inner.bodies, self._inner.constraints
        joined, fits = (joined_pairs(packed, constraints, bodies), fits_of(packed, bodies)) if proves else ([], {})
        self._rows = ProvenPairs(packed, joined, fits, first._state)

    def _set_up(self, begin: Array) -> None:
        """What ticks work in, and what they read and write directly; they go on from a state of the packed scene."""
        packed, budget = self._packed, self._budget
        self._history = np.zeros((1, HISTORY))
        names = [(body_of(a).name, body_of(b).name) for a, b in packed.kept_pairs]
        self._followed = Followed(self._scene, packed, names, self._hands, self._begun)
        # At its end are the rows of the last tick; steps have no copy of those.
        self._size = packed.kept_at
        self._state = np.zeros(packed.kept_at + packed.kept_size)
        self._state[: begin.size] = begin
        if packed.clearance_rows:
            _follow_extrema(packed, self._state, budget is not None)
        self._pose = self._state[: self._size]
        # Numbers are read from a view in half the time it takes to read them from the array.
        self._view: Any = self._state.data
        self._before = self._pose.copy()
        self._knobs: Any = self._settings.data
        _, doubles, integers = new_workspace(packed)
        work = (self._settings, self._state, self._history, doubles, integers, packed.end_effectors)
        self._arguments = (packed.table, packed.pool, *work)
        # Where no pair has rows, there is no contact manager.
        self._rows_alone = (packed.without_manager(), packed.pool, *work)
        self._radius = float(self._settings[RADIUS])
        self._seen = float(self._state[packed.memory_at + EVENT_COUNT]) if packed.clearance_rows else 0.0
        self._hands.pack(packed)
        # Other values of constraints may ask for another pose than the one that a tick goes on from, or goes back to.
        self._settings[CARRIES] = float(budget is not None and not packed._sources)

    def _take_more_places(self) -> None:
        """Have more places for contacts of clearances: from the last pose all of them are found anew.

        What found no place at a tick no row keeps away from there on.
        """
        before, radius = self._packed, self._radius
        self._packed = packed = self._inner._pack_with_more_places()
        assert self._inner._scene is not None
        self._scene, self._numbers = self._inner._scene, self._told()
        result = self._before[before.results_at : before.memory_at]
        self._set_up(taken_over(before, packed, self._before))
        self._rows.packed = packed
        self._radius = radius
        self._before[packed.results_at : packed.memory_at] = result
        self._pose[:] = self._before

    def _has_changed(self) -> bool:
        """Whether a constraint of the scene, and not of another one, gained or lost a row, or a number was set anew."""
        packed = self._packed
        if packed.structure != structure_of(self._inner._seated_constraints()) or self._told() != self._numbers:
            return True
        packed.stamp, self._edits = structure_changes(), changes()
        return False

    def _told(self) -> list[object]:
        return numbers_told(self._packed, self._inner.bodies, self._inner.constraints)

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
        self._pose[:] = self._before
        # The contact that was crossed may not be listed: all pairs are searched again.
        self._rows.list_again(self._state, [] if self._clear is None else self._clear.in_the_way)
        self._rows.update_all()
        forget_updates(self._packed, self._state)
        return TrackStatus.HELD, self._pose.copy()

    def _holds(self) -> Array:
        """Go on from a pose at which all pairs hold; its state, which nobody writes to."""
        self._rows.settle(self._pose)
        return self._pose.copy()

    def _way_depth(self) -> float | None:
        """How deep the way to the last pose may go in; None where that is not proven."""
        if self._clear is None:
            return 0.0
        return self._clear.way_depth if self._clear.proved else None
