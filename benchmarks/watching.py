"""Looks of the global manager at given poses, from outside of any solve: what a clearance would know there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly._record import Store, rows_of
from assembly.constraints.program import records as layout
from assembly.proximity.features.solid_contact import PAIR_GAP, TRACK
from assembly.proximity.manager import records as manager_records
from assembly.proximity.manager import update as watch
from assembly.proximity.manager.parameters import CROWDED_PART, TAKE

__all__ = ["Listed", "Watch"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Listed:
    """Contacts that are listed at a pose.

    Attributes
    ----------
    bodies : (n, 2)
    points : (n, 2, 3)
        On the surfaces.
    gap : (n,)
    take : (pairs,)
        All contacts of a pair with gaps below this are to be listed.
    looked : (pairs,)
        Whether the look was at this pair.
    """

    bodies: Table
    points: Array
    gap: Array
    take: Array
    looked: NDArray[np.bool_]


class Watch:
    """Bodies of one whole surface each, all pairs watched.

    Parameters
    ----------
    surfaces : sequence of NurbsSurface
    """

    def __init__(self, surfaces: Sequence[asm.NurbsSurface]) -> None:
        self.surfaces = list(surfaces)
        self.bodies = [asm.Body(f"body {k + 1}", surface) for k, surface in enumerate(surfaces)]
        scene = asm.Assembly(self.bodies)
        # Wires that move fast are looked at far ahead, and as many contacts are listed.
        scene.constrain(asm.Clearance(slots=16))
        self._packed = packed = scene.packed()
        self._at = int(packed.table[layout.MANAGER_RECORD])
        self.pairs = [(self.bodies.index(a), self.bodies.index(b)) for a, b in packed.clearance_pairs[0]]
        self._pairs_at = manager_records.MEMORY_HEADER
        self._places_at = self._pairs_at + manager_records.PAIR_MEMORY * len(self.pairs)
        manager = manager_records.ContactManager(Store(packed.table, packed.pool), self._at, packed._memory)
        self._first = int(manager_records.record_of(manager).first)
        lengths = [manager_records.pair_lengths_of(manager, p) for p in range(len(self.pairs))]
        self._curved = np.array([each.curved_bound for each in lengths])
        self.forget()

    def forget(self) -> None:
        """Know nothing: the next look is a first one."""
        self.memory = self._packed._memory.copy()
        self.tracked = np.full((self._packed.tracked, TRACK), np.nan)

    @property
    def scale(self) -> float:
        """The length that is one in the contact manager's memory."""
        return self._packed.scale

    def _pairs(self) -> Array:
        return self.memory[self._pairs_at : self._places_at].reshape(-1, manager_records.PAIR_MEMORY)

    def look(self, q: Array, everything: bool = True) -> Listed:
        """Look at poses (n, 7); a pair that is not looked at lists nothing.

        Raises
        ------
        RuntimeError
            There were not enough places.
        """
        packed, memory = self._packed, self.memory
        scaled = q.copy()
        scaled[:, :3] = (q[:, :3] - packed.reference) / packed.scale
        calls = manager_records.memory_header_at(memory, 0).calls + 1.0
        how = watch.EVERYTHING if everything else watch.IN_TURNS
        watch.update(packed.table, packed.pool, self._at, memory, scaled, self.tracked, how)
        if memory[manager_records.CROWDED]:
            raise RuntimeError("contacts are near for which there is no place")
        known = rows_of(manager_records.PAIR_STATE, self._pairs())
        looked = known.called == calls
        slots = memory[self._places_at :][: manager_records.PLACE_MEMORY * packed.clearance_rows]
        owner = rows_of(manager_records.PLACE_STATE, slots.reshape(-1, manager_records.PLACE_MEMORY)).pair.astype(int)
        rows = np.flatnonzero((owner >= 0) & looked[owner])
        tracked = self.tracked[self._first + rows]
        bodies = np.array(self.pairs)[owner[rows]]
        points = np.empty((rows.size, 2, 3))
        for k, (pair, row) in enumerate(zip(bodies, tracked, strict=True)):
            for side, body in enumerate(pair):
                local = self.surfaces[body].evaluate(*row[2 * side : 2 * side + 2])
                points[k, side] = Rotation.from_quat(q[body, 3:], scalar_first=True).apply(local) + q[body, :3]
        # An update that meets many patches takes what is as near as its motion bounds, which say what it left out; that
        # of a ball may be less for other reasons, and in a crowd no less than this is looked into.
        around = np.maximum(known.ball_bound, CROWDED_PART * self._curved)
        take = np.minimum(TAKE * known.margin, known.motion_bound)
        take = np.minimum(take, around) * packed.scale
        return Listed(bodies, points, tracked[:, PAIR_GAP] * packed.scale, take, looked)
