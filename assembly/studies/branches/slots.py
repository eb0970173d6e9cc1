"""Slots of the contact manager in states: the contacts of clearances, as rows of the branch and beside it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.corners import body_of
from assembly.constraints.packing.scene import Packed
from assembly.constraints.program.contact import contact_rows
from assembly.constraints.program.records import FREE_COLUMN, header_at
from assembly.proximity.extrema.rates import derivatives_at
from assembly.proximity.features.solid_contact import CONTACT_RECORD, FEATURE_F, FEATURE_G, IDLE, TRACK
from assembly.proximity.manager.records import MEMORY_HEADER, PAIR_MEMORY, PLACE_MEMORY, PLACE_PAIR

__all__ = [
    "NOBODY",
    "Meeting",
    "copy_slots",
    "ended_slots",
    "features_of",
    "gaps_of_slots",
    "held_alone",
    "meeting",
    "rows_of_slots",
    "wake",
]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


class Meeting(NamedTuple):
    """Where two bodies meet: their names, and the place in the world (3,); NaN where that is not known."""

    bodies: tuple[str, ...]
    place: Array


NOBODY = Meeting((), np.full(3, np.nan))


def rows_of_slots(packed: Packed) -> slice:
    """The rows of slots among all rows."""
    return slice(len(packed.contacts), len(packed.contacts) + packed.clearance_rows)


def gaps_of_slots(packed: Packed, state: Array) -> Array | None:
    """By how much the contacts of slots (s,) are open at the poses of a state, over the size; infinite: there is none.

    None where one ends in bodies that cross.
    """
    own = rows_of_slots(packed)
    found = _evaluated(packed, state, np.arange(own.start, own.stop))
    if found is None:
        return None
    is_listed = np.array([pair >= 0 for pair, _ in packed.listed(state)], dtype=np.bool_)
    gaps: Array = np.where(is_listed, found[0][own], np.inf)
    return gaps


def ended_slots(packed: Packed, state: Array) -> Flags:
    """Which of the contacts of slots (s,) have no pair at the poses of a state."""
    own = rows_of_slots(packed)
    found = _evaluated(packed, state, np.arange(own.start, own.stop))
    if found is None:
        return np.ones(packed.clearance_rows, dtype=np.bool_)
    is_listed = np.array([pair >= 0 for pair, _ in packed.listed(state)], dtype=np.bool_)
    ended: Flags = is_listed & np.isnan(found[2][own, 0])
    return ended


def meeting(packed: Packed, state: Array, row: int) -> Meeting:
    """Which bodies meet at the contact of a row at the poses of a state, and where."""
    if packed.pairs[row] < 0:
        return NOBODY
    own = rows_of_slots(packed)
    if row < own.start:
        bodies = tuple(packed.contacts[row].bodies)
    else:
        pair = packed.listed(state)[row - own.start][0]
        if pair < 0:
            return NOBODY
        bodies = tuple(body_of(side) for side in packed.kept_pairs[pair])
    names = tuple(sorted(body.name for body in bodies))
    found = _evaluated(packed, state, np.array([row]))
    if found is None:
        return Meeting(names, NOBODY.place)
    record = derivatives_at(found[1], row)
    first = state[7 * packed.body_places[bodies[0]] :][:3]
    place = first + packed.scale * (record.arm_f - 0.5 * record.gap * record.normal)
    return Meeting(names, place)


def features_of(packed: Packed, state: Array, row: int) -> tuple[float, ...]:
    """The features of both sides, by their numbers, that the contact of solids of a row is on in a state."""
    at = packed.contacts_at + TRACK * row
    return float(state[at + FEATURE_F]), float(state[at + FEATURE_G])


def held_alone(packed: Packed, state: Array, rows: Flags) -> Array:
    """A state in which those slots alone have contacts whose rows (m,) are flagged."""
    state = state.copy()
    free = ~rows[rows_of_slots(packed)]
    _slots(packed, state)[free, PLACE_PAIR] = -1.0
    _tracked(packed, state)[free, 0] = np.nan
    return state


def wake(packed: Packed, state: Array) -> None:
    """Have all contacts of slots evaluated, those as well that a solve left as open for certain."""
    _tracked(packed, state)[:, IDLE] = 0.0


def copy_slots(earlier: Packed, before: Array, packed: Packed, state: Array) -> None:
    """Copy slots, and what is tracked of their contacts, to a state of the same scene with other numbers."""
    _slots(packed, state)[:] = _slots(earlier, before)
    _tracked(packed, state)[:] = _tracked(earlier, before)


def _evaluated(packed: Packed, state: Array, rows: NDArray[np.int64]) -> tuple[Array, Array, Array] | None:
    """Residuals, records and tracked pairs of some rows of contacts at a state's poses; None where one has no pair."""
    table = packed.table_at(state)
    header = header_at(table, 0)
    count, q = int(header.contacts), state[: packed.contacts_at].reshape(-1, 7).copy()
    q[:, :3] = (q[:, :3] - packed.reference) / packed.scale
    free = np.zeros(count, dtype=np.int64)
    free[rows] = -1
    start = state[packed.contacts_at :][: TRACK * count].reshape(-1, TRACK).copy()
    records, residual = np.zeros((count, CONTACT_RECORD)), np.zeros(count)
    tracked = start.copy()
    work = q, tracked, records, residual, np.zeros((count, FREE_COLUMN + 4 + int(header.extra)))
    lost = contact_rows((table, packed.pool), start, np.inf, free, work) >= 0
    return None if lost else (residual, records, tracked)


def _slots(packed: Packed, state: Array) -> Array:
    """The slots (s, k) of the contact manager in a state."""
    at = packed.memory_at + MEMORY_HEADER + PAIR_MEMORY * len(packed.kept_pairs)
    return state[at:][: PLACE_MEMORY * packed.clearance_rows].reshape(-1, PLACE_MEMORY)


def _tracked(packed: Packed, state: Array) -> Array:
    """What is tracked (s, TRACK) of the contacts of slots in a state."""
    first = packed.contacts_at + TRACK * len(packed.contacts)
    return state[first:][: TRACK * packed.clearance_rows].reshape(-1, TRACK)
