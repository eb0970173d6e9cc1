"""Pairs of bodies whose clearances have rows in a tick only where a proof asks for them.

Links of a mechanism slide on each other and turn in each other's bores. Hundreds of their contacts are near, and none
pushes: joints alone determine the motion. So the contact manager of a tracker lists no contact of such a pair. The
tick is solved without, and the proof tells whether bodies are clear, or touch only, at the pose and on the way there.
Only where it refuses the pose of a pair, that pair's contacts are listed, and the tick is solved once more. They are
listed until none of them pushes at the end of a tick.

It is the same with a shaft in a bore, whether joints connect them or not. A thousand pairs of patches of such walls
face each other, so that an update takes milliseconds and is due at every step, though the contacts stay: they are on
the rims at both ends of what the walls have in common, which keep apart all that is between. So between two refusals
of the proof nothing is updated, contacts go along their rims, and those of wall on wall have no rows. Before the shaft
is in the bore, the pair has rows like others, but only while a contact is near.

Other bodies that no chain of joints connects, and pairs with a contact between the two, have rows at all times.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._record import place_of
from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.contact import Contact
from assembly.proximity.features.solid_contact import FEATURE_F, FEATURE_G, PAIR_GAP, TRACK
from assembly.proximity.manager.records import (
    CROSSED,
    MEMORY_HEADER,
    MOTION_BOUND,
    PAIR_MEMORY,
    PAIR_STATE,
    PAIR_TURN,
    PART,
    PLACE_MEMORY,
    PLACE_NUMBER,
    PLACE_PAIR,
)
from assembly.solve.clearance_proof import owned_pairs
from assembly.solve.contact_pairs import rows_of_contacts
from assembly.solve.loop.settings import HISTORY
from assembly.solve.scene import Scene, Status
from assembly.solve.solution import Solution
from assembly.tracking.closing import closing_rates
from assembly.tracking.fitting import Fit

if TYPE_CHECKING:
    from assembly.constraints.model.constraint import Constraint
    from assembly.constraints.packing.scene import Packed
    from assembly.kinematics.body import Body

__all__ = ["ProvenPairs", "joined_pairs"]

Array = NDArray[np.float64]
# [over the size of the scene] A motion bound that no motion uses up, and no product of two of which overflows.
ANY_MOTION = 1e100
# [over the size of the scene] A contact that is not as open touches: what counts as touching by default.
CLOSED = 1e-9
SOON = 10.0
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


class _Parts(NamedTuple):
    """Views of a state: rows of pairs, of slots, of the contacts tracked in them, and the multipliers of these."""

    pairs: Array
    slots: Array
    tracked: Array
    multipliers: Array


class ProvenPairs:
    """Which pairs of a tracker's clearances have no rows now.

    Parameters
    ----------
    packed : Packed
    joined : sequence of int
        Numbers of the pairs that joints connect.
    fits : dict of int -> list of Fit
        Of every pair its bores with shafts that fit.
    first : array
        State of the solution with which the tracker begins; pairs that push there keep their rows.

    Attributes
    ----------
    packed : Packed
        Set anew where the scene is packed with more slots.
    fitting : frozenset of int
        Pairs with a bore and a shaft that fits it.
    unlisted : frozenset of int
        Pairs whose contacts are not listed.
    """

    def __init__(self, packed: Packed, joined: Sequence[int], fits: dict[int, list[Fit]], first: Array) -> None:
        self.packed, self._joined, self._fits = packed, frozenset(joined), fits
        self.fitting, self.unlisted = frozenset(fits), frozenset[int]()
        # Pairs whose contacts are listed, and of which motion asks for no update.
        self._kept = frozenset[int]()
        # Numbers and gaps of contacts at the end of the last tick.
        self._last = np.empty(0), np.empty(0)
        # Numbers of contacts that joints let close, and the poses that were refused in this tick.
        self._closing = frozenset[float]()
        self._refused: Array | None = None
        self.settle(first)

    @property
    def are_some(self) -> bool:
        """Whether any pair may be without rows, or without updates of them."""
        return bool(self._joined or self.fitting)

    @property
    def has_no_rows(self) -> bool:
        """Whether no pair that clearances keep apart has rows, so that the contact manager has nothing to do."""
        return bool(self.unlisted) and len(self.unlisted) == len(self.packed.kept_pairs)

    def _parts(self, state: Array) -> _Parts:
        """Views of a state: what is known of pairs, of slots, and of the contacts tracked in them."""
        packed = self.packed
        pairs_at = packed.memory_at + MEMORY_HEADER
        slots_at = pairs_at + PAIR_MEMORY * len(packed.kept_pairs)
        first, row = packed.contacts_at + TRACK * len(packed.contacts), packed.multipliers_at + len(packed.contacts)
        return _Parts(
            state[pairs_at:slots_at].reshape(-1, PAIR_MEMORY),
            state[slots_at:][: PLACE_MEMORY * packed.clearance_rows].reshape(-1, PLACE_MEMORY),
            state[first:][: TRACK * packed.clearance_rows].reshape(-1, TRACK),
            state[row:][: packed.clearance_rows],
        )

    def leave_out(self, state: Array) -> None:
        """Free the slots of pairs that are not listed, and have no motion ask for updates of these and of shafts."""
        if not self.unlisted and not self._kept:
            return
        parts = self._parts(state)
        out = np.array(sorted(self.unlisted | self._kept))
        out = out[(parts.pairs[out, MOTION_BOUND] != ANY_MOTION) | np.isnan(parts.pairs[out, PAIR_TURN])]
        if not len(out):
            return
        # What is to be updated keeps the rows that it gets.
        fresh = [k for k in out.tolist() if k not in self.unlisted and np.isnan(parts.pairs[k, PAIR_TURN])]
        out = np.setdiff1d(out, fresh)
        free = np.isin(parts.slots[:, PLACE_PAIR], sorted(self.unlisted))
        for k in self._kept.difference(fresh):
            for fit in self._fits[k]:
                if not fit.is_by_rims:
                    continue
                walls = (parts.tracked[:, [FEATURE_F, FEATURE_G]] == fit.numbers).all(axis=1)
                free |= walls & (parts.slots[:, PLACE_PAIR] == k)
        known = parts.pairs[out]
        known[:, PAIR_TURN : PAIR_TURN + 4] = (1.0, 0.0, 0.0, 0.0)
        known[:, MOTION_BOUND] = ANY_MOTION
        known[:, [BALL_BOUND, SURE]] = np.inf
        known[:, [PART, CROSSED, DOUBT, CUT_SHORT, WANTING]] = 0.0
        parts.pairs[out] = known
        parts.slots[free, PLACE_PAIR] = -1.0
        parts.tracked[free, 0] = np.nan
        parts.multipliers[free] = 0.0

    def without_updates(self, which: Iterable[int]) -> frozenset[int]:
        """Those of some pairs that have no rows, or rows which motion does not ask to be updated."""
        return (self.unlisted | self.fitting).intersection(which)

    def list_again(self, state: Array, which: Iterable[int], refused: Array | None = None) -> None:
        """Have the next run of the loop update pairs, of those without updates of their own.

        Parameters
        ----------
        state : array
        which : iterable of int
        refused : (n, 7), optional
            The poses that the proof refused because of these pairs.
        """
        some = sorted(self.without_updates(which))
        if some:
            pairs = self._parts(state).pairs
            pairs[some, PAIR_TURN], pairs[some, MOTION_BOUND] = np.nan, 0.0
            self._kept |= self.unlisted.intersection(some) & self.fitting
            if refused is not None and self.unlisted.intersection(some):
                self._refused = refused
            self.unlisted = self.unlisted.difference(some)

    def update_all(self) -> None:
        """Have motion ask for updates of all that is listed, and cut steps by them, until a tick holds."""
        self._kept = frozenset[int]()

    def settle(self, state: Array, scene: Scene | None = None) -> None:
        """Leave out pairs, from the next tick on, of which no contact pushes at the end of a tick.

        None of their contacts may be so near, either, that it could touch within some ticks (SOON) if it went on as in
        this one. Of bodies that joints connect only contacts count that joints let close (`closing.py`): what is free
        to go is pushed by nothing, and yet is pushed. Of bodies of which one fits a bore of the other one, and no joint
        connects them, all count. So a pin that is let down into its hole is proven to go in, and no row of the hole's
        rim, which it passes, turns it aside. What is near, and not in its bore, has rows like others.
        """
        if (self._joined | self.fitting) <= self.unlisted:
            return
        q = state[: self.packed.contacts_at].reshape(-1, 7)
        free = self.fitting - self._joined
        held = {k for k in self.fitting - self.unlisted if any(fit.holds(q) for fit in self._fits[k])}
        parts = self._parts(state)
        gone = self._kept - held
        self.list_again(state, gone)
        pairs, numbers, gaps = parts.slots[:, PLACE_PAIR], parts.slots[:, PLACE_NUMBER], parts.tracked[:, PAIR_GAP]
        busy = set(pairs[parts.multipliers != 0.0].tolist())
        before = self._last if len(self._last[0]) == len(numbers) else (np.full(len(numbers), -1.0), gaps)
        same = before[0] == numbers
        went = np.where(same, np.abs(gaps - before[1]), np.inf)
        self._last = numbers.copy(), gaps.copy()
        is_near = gaps <= np.maximum(SOON * went, CLOSED)
        near = set(pairs[is_near].tolist())
        self._closing = self._closing.intersection(numbers.tolist()).union(numbers[same & (went > CLOSED)].tolist())
        if self._refused is not None and scene is not None:
            self._closing |= self._closed_by_joints(state, scene, self._refused)
            self._refused = None
        closing = set(pairs[is_near & np.isin(numbers, list(self._closing))].tolist())
        self.unlisted |= (self._joined - busy - closing) | (free - busy - near - gone)
        self._kept = frozenset(held) - self.unlisted

    def _closed_by_joints(self, state: Array, scene: Scene, refused: Array) -> set[float]:
        """Numbers of the contacts whose gaps are others where joints alone led, at poses (n, 7) that were refused."""
        solution = Solution(scene, self.packed, state.copy(), Status.SOLVED, 0.0, np.empty((0, HISTORY)))
        found = rows_of_contacts(solution)
        if found is None:
            return set()
        # The listed ones come in the order of their numbers, without those that are lost.
        parts, is_listed = self._parts(state), found.pairs >= 0
        numbers = parts.slots[:, PLACE_NUMBER][(parts.slots[:, PLACE_PAIR] >= 0.0) & ~np.isnan(parts.tracked[:, 0])]
        rates = closing_rates(found, solution.q, refused)[is_listed]
        return set(np.sort(numbers)[np.abs(rates) > CLOSED * self.packed.scale].tolist())
