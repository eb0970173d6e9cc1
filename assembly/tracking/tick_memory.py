"""The packed scene that the ticks of a tracker solve, and the memory that they go on in."""

from __future__ import annotations

from collections import Counter
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
from assembly.solve.clearance_proof import can_prove
from assembly.solve.loop.settings import CARRIES, HISTORY, RADIUS
from assembly.solve.scene import Scene
from assembly.solve.solution import Solution
from assembly.solve.start_proof import is_for_proofs
from assembly.solve.workspace import new_workspace
from assembly.tracking.clear_ticks import ClearTicks
from assembly.tracking.fitting import fits_of
from assembly.tracking.followed import Followed
from assembly.tracking.hands import Hands, Targets
from assembly.tracking.proven_pairs import ProvenPairs, joined_pairs
from assembly.tracking.tick import TrackStatus
from assembly.tracking.tick_call import TickCall

if TYPE_CHECKING:
    from assembly.assembly import Assembly
    from assembly.constraints.packing.scene import Packed

__all__ = ["TickMemory", "forget_updates"]

Array = NDArray[np.float64]


def _contents(scene: Assembly) -> tuple[tuple[int, ...], Counter[tuple[float, int]]]:
    """Which bodies, constraints and terms a scene has; constraints and terms in any order."""
    items = [(0.0, id(item)) for item in scene.constraints] + [(sign, id(term)) for sign, term in scene.objectives]
    return tuple(map(id, scene.bodies)), Counter(items)


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

    A subclass sets the scene, the same with its hands, the settings and what counts as touching before the first
    solution is taken in.
    """

    _scene_given: Assembly
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
        self._call = TickCall(packed, (packed.pool, self._settings, self._state, self._history, doubles, integers))
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

    def _keep_contents(self) -> None:
        """Note what the scene is made of, which the scene with the hands is made of as well."""
        self._edition, self._contents = self._scene_given._edition, _contents(self._scene_given)

    def _has_other_contents(self) -> bool:
        """Whether bodies, constraints or terms were added to the scene, or removed; not where they are there again."""
        if self._scene_given._edition is not self._edition:
            if _contents(self._scene_given) != self._contents:
                return True
            self._edition = self._scene_given._edition
        return False

    def _has_changed(self) -> bool:
        """Whether ticks do not follow what is asked for now.

        The scene is made of other things; a constraint of it, and not of another one, gained or lost a row; or a number
        was set anew.
        """
        packed = self._packed
        if self._has_other_contents():
            return True
        if packed.structure != structure_of(self._inner._seated_constraints()) or self._told() != self._numbers:
            return True
        packed.stamp, self._edits = structure_changes(), changes()
        return False

    def _told(self) -> list[object]:
        return numbers_told(self._packed, self._inner.bodies, self._inner.constraints)
