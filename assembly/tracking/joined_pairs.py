"""Pairs of bodies that joints connect, whose clearances have rows in a tick only where a proof asks for them.

Links of a mechanism slide on each other and turn in each other's bores. Hundreds of their contacts are near, and none
pushes: joints alone determine the motion. So the contact manager of a tracker lists no contact of such a pair. The
tick is solved without, and the proof tells whether bodies are clear, or touch only, at the pose and on the way there.
Only where it refuses the pose of a pair, that pair's contacts are listed, and the tick is solved once more. They are
listed until none of them pushes at the end of a tick.

Bodies that no chain of joints connects, and pairs with a contact between the two, have rows at all times.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly._record import place_of
from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.contact import Contact
from assembly.proximity.features.solid_contact import TRACK
from assembly.proximity.manager.records import (
    CROSSED,
    FAR,
    MEMORY_HEADER,
    MOTION_BOUND,
    PAIR_MEMORY,
    PAIR_STATE,
    PAIR_TURN,
    PART,
    PLACE_MEMORY,
    PLACE_PAIR,
    STATE,
)
from assembly.solve.clearance_proof import owned_pairs

if TYPE_CHECKING:
    from assembly.constraints.model.constraint import Constraint
    from assembly.constraints.packing.scene import Packed
    from assembly.kinematics.body import Body

__all__ = ["JoinedPairs", "joined_pairs"]

Array = NDArray[np.float64]
# [over the size of the scene] A motion bound that no motion uses up, and no product of two of which overflows.
ANY_MOTION = 1e100
BALL_BOUND, SURE, DOUBT, CUT_SHORT, WANTING = (
    place_of(PAIR_STATE, name) for name in ("ball_bound", "sure", "doubt", "cut_short", "wanting")
)


def _components(constraints: Iterable[Constraint], bodies: Sequence[Body]) -> dict[int, int]:
    """Of every body, by its id, the number of what joints connect it with; fixed bodies are one."""
    parent = {id(body): id(body) for body in bodies}

    def root(body: int) -> int:
        while parent[body] != body:
            parent[body] = parent[parent[body]]
            body = parent[body]
        return body

    fixed = [body for body in bodies if body.fixed]
    groups: list[Sequence[Body]] = [fixed]
    groups += [item.bodies for item in constraints if item._is_asked and not isinstance(item, (Clearance, Contact))]
    for group in groups:
        for body in group[1:]:
            parent[root(id(body))] = root(id(group[0]))
    return {body: root(body) for body in parent}


def joined_pairs(packed: Packed, constraints: Iterable[Constraint], bodies: Sequence[Body]) -> list[int]:
    """Numbers of the pairs of a packed scene's clearances whose bodies are connected by joints, and by no contact.

    Parameters
    ----------
    packed : Packed
    constraints : iterable of Constraint
        Of the scene.
    bodies : sequence of Body
    """
    part = _components(constraints, bodies)
    return [
        k for k, (_, (a, b), touched) in enumerate(owned_pairs(packed)) if not touched and part[id(a)] == part[id(b)]
    ]


class JoinedPairs:
    """Which pairs of a tracker's clearances have no rows now.

    Parameters
    ----------
    packed : Packed
    joined : sequence of int
        Numbers of the pairs that may be without.
    state : array
        Of the solution with which the tracker begins; pairs that push there keep their rows.

    Attributes
    ----------
    packed : Packed
        Set anew where the scene is packed with more slots.
    unlisted : frozenset of int
        Pairs whose contacts are not listed.
    """

    def __init__(self, packed: Packed, joined: Sequence[int], state: Array) -> None:
        self.packed, self._joined = packed, frozenset(joined)
        self.unlisted = self._joined - self._pushing(state)

    @property
    def has_no_rows(self) -> bool:
        """Whether no pair that clearances keep apart has rows, so that the contact manager has nothing to do."""
        return bool(self.unlisted) and len(self.unlisted) == len(self.packed.kept_pairs)

    def _parts(self, state: Array) -> tuple[Array, Array, Array]:
        """Views of a state: what is known of pairs, of slots, and of the contacts tracked in them."""
        packed = self.packed
        pairs_at = packed.memory_at + MEMORY_HEADER
        slots_at = pairs_at + PAIR_MEMORY * len(packed.kept_pairs)
        first = packed.contacts_at + TRACK * len(packed.contacts)
        return (
            state[pairs_at:slots_at].reshape(-1, PAIR_MEMORY),
            state[slots_at:][: PLACE_MEMORY * packed.clearance_rows].reshape(-1, PLACE_MEMORY),
            state[first:][: TRACK * packed.clearance_rows].reshape(-1, TRACK),
        )

    def _pushing(self, state: Array) -> set[int]:
        """The pairs a contact of which pushes."""
        packed = self.packed
        slots = self._parts(state)[1]
        first = packed.multipliers_at + len(packed.contacts)
        pushes = state[first : first + packed.clearance_rows] != 0.0
        return set(slots[pushes, PLACE_PAIR].astype(int).tolist())

    def leave_out(self, state: Array) -> None:
        """Free the slots of pairs that are not listed, and have no motion ask for an update of theirs."""
        if not self.unlisted:
            return
        pairs, slots, tracked = self._parts(state)
        out = sorted(self.unlisted)
        known = pairs[out]
        known[:, PAIR_TURN : PAIR_TURN + 4] = (1.0, 0.0, 0.0, 0.0)
        known[:, MOTION_BOUND], known[:, STATE] = ANY_MOTION, FAR
        known[:, [BALL_BOUND, SURE]] = np.inf
        known[:, [PART, CROSSED, DOUBT, CUT_SHORT, WANTING]] = 0.0
        pairs[out] = known
        free = np.isin(slots[:, PLACE_PAIR], out)
        if free.any():
            slots[free, PLACE_PAIR] = -1.0
            tracked[free, 0] = np.nan
            first = self.packed.multipliers_at + len(self.packed.contacts)
            state[first : first + len(free)][free] = 0.0

    def list_again(self, state: Array, which: Iterable[int]) -> None:
        """Have the next tick list contacts of some pairs."""
        some = sorted(self.unlisted.intersection(which))
        self._parts(state)[0][some, PAIR_TURN] = np.nan
        self.unlisted = self.unlisted.difference(some)

    def settle(self, state: Array) -> None:
        """Leave out pairs, from the next tick on, of which no contact pushes at the end of a tick."""
        if len(self.unlisted) < len(self._joined):
            self.unlisted = self._joined - self._pushing(state)
