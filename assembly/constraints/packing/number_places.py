"""Where a packed scene has the numbers of each thing, found once, so that setting a number is writing it.

What is written has the bits of the scene packed anew. That is so while the scene's size is the same; where it becomes
another one everything is divided by it, and `packing/renumbered.py` writes the whole pool.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.dexterity import Dexterity
from assembly.constraints.model.objectives import FrameDistance, Objective
from assembly.constraints.packing.measured_size import MeasuredSize, base_of
from assembly.constraints.packing.rescaled import FRAME, RescaledNumbers
from assembly.constraints.program import records as layout
from assembly.kinematics.body import Body
from assembly.kinematics.changes import numbers_set
from assembly.kinematics.frame import Frame
from assembly.proximity.manager import records as manager_records

if TYPE_CHECKING:
    from assembly.constraints.packing.scene import Packed

__all__ = ["NumberPlaces"]

Array = NDArray[np.float64]


class NumberPlaces:
    """What depends on which thing in a packed scene, and in its twins with other numbers.

    Things are known by their identities: those of the scene are alive as long as it is.

    Parameters
    ----------
    packed : Packed
    bodies, constraints, objectives
        What it was packed of.

    Attributes
    ----------
    size : float or None
        The scene's size when numbers were last set, where it was measured.
    """

    def __init__(
        self,
        packed: Packed,
        bodies: Sequence[Body],
        constraints: Sequence[Constraint],
        objectives: Sequence[tuple[float, Objective]],
    ) -> None:
        self._numbers = numbers_set()
        self.size: float | None = None
        self._size = MeasuredSize(bodies, constraints, objectives)
        # Made when the size is another one for the first time.
        self._rescaled: RescaledNumbers | None = None
        self._packed_of = bodies, objectives
        # Frames whose origins were set since `_rescaled` took them.
        self._stale: set[int] = set()
        self._bodies = {id(body) for body in bodies}
        self._clearances = {id(item): k for k, item in enumerate(packed.clearances)}
        self._contacts = {id(item): (item, at) for item, at in zip(packed.contacts, packed.gaps, strict=True)}
        places = (*packed.drawn, *(place for place, _ in packed.placed))
        self._placed = {id(place) for place in places}
        self._has_corners = bool(packed.corners)
        self._ends = list(accumulate(map(len, packed.pairs_of_kept)))
        # Of every frame where its origin is in the pool, and whether axes are behind it.
        self._frames: dict[int, tuple[Frame, list[tuple[int, Frame, bool]]]] = {}
        # The axes of frames that were written last.
        self._axes: dict[int, Array] = {}
        for k, pair in enumerate(packed._frames):
            for side, frame in enumerate((pair.frame_a, pair.frame_b)):
                self._keep(frame, packed.frames_at + 24 * k + 12 * side, True)
        for term, at in packed._targets:
            if isinstance(term, FrameDistance):
                self._keep(term.frame, at - 3, False)
        tips = [term.tip_task.tip for _, term in objectives if isinstance(term, Dexterity)]
        self._tips = {id(base_of(tip)) for tip in tips if isinstance(tip, Frame)}

    def _keep(self, frame: Frame, at: int, with_axes: bool) -> None:
        base = base_of(frame)
        self._frames.setdefault(id(base), (base, []))[1].append((at, frame, with_axes))

    def renumbered(self, packed: Packed, things: Sequence[object], reference: Array) -> Packed | None:
        """The scene with the numbers that these things have now; itself if none of them is another one.

        None where the size is another one, or cannot be told, or shapes are: then all numbers are to be compared.

        Parameters
        ----------
        packed : Packed
            As it was before they were set.
        things : sequence
            All of those whose numbers were set since, of this scene or another one.
        reference : (3,)
            Where the first body is, which positions are relative to.
        """
        self.size = None
        frames: list[int] = []
        clearances: list[Clearance] = []
        contacts: list[int] = []
        for thing in things:
            key = id(thing)
            if key in self._bodies or key in self._tips or key in self._placed:
                return None
            if key in self._frames:
                if packed._coordinates:
                    # The instructions that draw a coordinate have the numbers of its frames.
                    return None
                frames.append(key)
            elif key in self._contacts:
                if self._has_corners or packed.clearances:
                    # Corners have the gap of their contact, and clearances allow none.
                    return None
                contacts.append(key)
            elif isinstance(thing, Clearance) and key in self._clearances:
                if packed._unwritten is not None:
                    return None
                clearances.append(thing)
        is_next = packed.numbers == self._numbers
        # Else another packing with the same places was asked for meanwhile.
        self._size.read(frames if is_next else self._size.frames)
        self._stale.update(frames if is_next else self._frames)
        self._numbers = numbers_set()
        self.size = self._size.size()
        if self.size is None or not packed.has_size or packed._reference != reference.tolist():
            return None
        if self.size != packed.scale:
            return self._of_size(packed, self.size, frames, is_next)
        changed = [own for key in frames for own in self._changed(packed, key, is_next)]
        gaps = [own for item in clearances for own in self._gaps_of(packed, item) if packed.pool[own[0]] != own[1]]
        if clearances and any((packed.pool[at] > 0.0) != (gap > 0.0) for at, gap in gaps):
            # Contacts stand in other places beside a least gap that is none.
            return None
        films = [(at, item.minimum / packed.scale) for item, at in map(self._contacts.__getitem__, contacts)]
        gaps += [film for film in films if packed.rows_pool[film[0]] != film[1]]
        if not changed and not gaps:
            packed.numbers = self._numbers
            return packed
        other = packed.twin()
        other.numbers = self._numbers
        pool = other.rows_pool
        for at, numbers in changed:
            pool[at : at + len(numbers)] = numbers
        for at, gap in gaps:
            pool[at] = gap
        if gaps:
            # What was proven was of other gaps.
            other.proofs = []
        return other

    def _of_size(self, packed: Packed, size: float, frames: Sequence[int], is_next: bool) -> Packed | None:
        """The scene with another size, and numbers of frames; None where it has lengths that are not of frames."""
        if self._rescaled is None:
            self._rescaled = RescaledNumbers(packed, *self._packed_of)
            self._stale.clear()
        if not self._rescaled.is_possible:
            return None
        for key in self._stale:
            base, entries = self._frames[key]
            self._rescaled.has_moved([(at - packed.frames_at) // FRAME for at, _, _ in entries], base)
        self._stale.clear()
        other = self._rescaled.written(packed, size)
        if other is None:
            return None
        other.numbers = self._numbers
        for key in frames:
            base, entries = self._frames[key]
            if not is_next or self._axes.get(key) is not base.axes:
                for at, frame, _ in entries:
                    other.rows_pool[at + 3 : at + FRAME] = frame.axes.T.ravel()
                self._axes[key] = base.axes
        return other

    def _changed(self, packed: Packed, key: int, is_next: bool) -> list[tuple[int, list[float]]]:
        """What is not in the pool of a frame as it is now, and where it goes."""
        base, entries = self._frames[key]
        pool, changed = packed.rows_pool, []
        origin = (base.origin / packed.scale).tolist()
        is_turned = not is_next or self._axes.get(key) is not base.axes
        for at, frame, with_axes in entries:
            if pool[at : at + 3].tolist() != origin:
                changed.append((at, origin))
            if with_axes and is_turned:
                axes = frame.axes.T.ravel().tolist()
                if pool[at + 3 : at + 12].tolist() != axes:
                    changed.append((at + 3, axes))
        self._axes[key] = base.axes
        return changed

    def _gaps_of(self, packed: Packed, clearance: Clearance) -> list[tuple[int, float]]:
        """Where the least gap of every pair of a clearance is in the pool, and what it is now."""
        k = self._clearances[id(clearance)]
        table = packed.table
        pairs = range(self._ends[k - 1] if k else 0, self._ends[k])
        record = int(table[layout.MANAGER_RECORD])
        gap = clearance.minimum / packed.scale
        return [(int(manager_records.pair_in(table, record, place).minimum), gap) for place in pairs]
