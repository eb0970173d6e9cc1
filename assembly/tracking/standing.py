"""Where bodies stand at the end of a tick, as proofs of the ways there ask for it."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._record import place_of
from assembly.proximity.clearance.answers import Contacts
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.proximity.features.solid_contact import TRACK, TRACKED_PAIR
from assembly.proximity.manager.records import MEMORY_HEADER, PAIR_MEMORY, PLACE_MEMORY, PLACE_NUMBER, PLACE_PAIR
from assembly.solve.loop.settings import HISTORY
from assembly.solve.near_contacts import near_contacts, opening_move
from assembly.solve.scene import Scene, Status
from assembly.solve.solution import Solution

if TYPE_CHECKING:
    from assembly.constraints.packing.scene import Packed

__all__ = ["Standing"]

Array = NDArray[np.float64]
# Where the normal of a contact is among what is tracked of it.
NORMAL = slice(place_of(TRACKED_PAIR, "normal"), place_of(TRACKED_PAIR, "normal") + 3)
# Contacts that are nearer, in parts of the size, are remembered of a pose.
NEAR = 1e-2


class Listed(NamedTuple):
    """What slots for contacts have: pairs of bodies, or -1; numbers; normals (k, 3) in the axes of first bodies."""

    pairs: Array
    numbers: Array
    normals: Array


class Standing:
    """Poses of the bodies in a state, and the contacts that are near there, found when they are first needed.

    Parameters
    ----------
    scene : Scene
    packed : Packed
    state : (k,)
        Nobody writes to it.
    """

    def __init__(self, scene: Scene, packed: Packed, state: Array) -> None:
        self.scene, self.packed, self._state = scene, packed, state
        self._relative: dict[int, tuple[Array, Array]] = {}
        self._near: dict[int, Contacts] | None = None
        self._ways: dict[int, float] = {}

    @cached_property
    def q(self) -> Array:
        """The poses, (n, 7)."""
        return self._state[: self.packed.contacts_at].reshape(-1, 7)

    def near(self, proof: ClearanceProof) -> dict[int, Contacts]:
        """The contacts that are near, by the number of their pair."""
        if self._near is None:
            solution = Solution(self.scene, self.packed, self._state, Status.SOLVED, 0.0, np.empty((0, HISTORY)))
            self._near = near_contacts(solution, proof, NEAR * max(map(proof.size, range(len(proof.pairs)))))
        return self._near

    def relative(self, proof: ClearanceProof, k: int) -> tuple[Array, Array]:
        """The rotation and the shift of the second body of pair k, seen from the first."""
        if k not in self._relative:
            self._relative[k] = proof.relative(k, self.q)
        return self._relative[k]

    @cached_property
    def listed(self) -> Listed:
        """The contacts that are listed."""
        packed, state = self.packed, self._state
        slots_at = packed.memory_at + MEMORY_HEADER + PAIR_MEMORY * len(packed.kept_pairs)
        slots = state[slots_at:][: PLACE_MEMORY * packed.clearance_rows].reshape(-1, PLACE_MEMORY)
        first = packed.contacts_at + TRACK * len(packed.contacts)
        tracked = state[first:][: TRACK * packed.clearance_rows].reshape(-1, TRACK)
        return Listed(slots[:, PLACE_PAIR], slots[:, PLACE_NUMBER], tracked[:, NORMAL])

    def way_length(self, proof: ClearanceProof, k: int, before: Array) -> float:
        """How far points of the second body of pair k went from the poses (n, 7) of the last tick, at most."""
        if k not in self._ways:
            self._ways[k] = proof.way_length(k, before, self.q)
        return self._ways[k]

    def opened(self, proof: ClearanceProof, k: int, depth: float) -> Array:
        """The least move (6) of the second body of pair k, by no more than a depth, that opens its contacts."""
        return opening_move(proof, k, self.q, self.near(proof).get(k), depth)
