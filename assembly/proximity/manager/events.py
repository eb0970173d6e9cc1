"""What a contact manager did: contacts that came near, went away, were handed back to the global stage, or merged."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.proximity.manager import records as manager_records

__all__ = ["Event", "EventKind", "EventReason", "PairState", "events_of", "fresh_memory", "listed_places"]

Array = NDArray[np.float64]


class EventKind(Enum):
    """What became of a contact."""

    ADDED = "added"
    REMOVED = "removed"
    HANDED_OFF = "handed off"
    MERGED = "merged"
    REFUSED = "refused"


class EventReason(Enum):
    """Why; the value says it in a sentence."""

    CAME_NEAR = "its gap came below the pair's reach"
    WENT_AWAY = "its gap grew beyond the pair's reach"
    LOST = "its extremum ended, or left its patch: the global stage looks for what is there now"
    SAME_ROOT = "it came to the points of another contact, near along the surfaces as well"
    NO_PLACE = "all places were taken"


class PairState(Enum):
    """How a pair of bodies is watched."""

    FAR = "no patches face each other within reach: not looked at until the bodies have moved as far"
    NEAR = "patches face each other within reach, no contact is near"
    TRACKING = "contacts are near, each is tracked exactly"


@dataclass(frozen=True, slots=True)
class Event:
    """One line of the log.

    Attributes
    ----------
    kind : EventKind
    reason : EventReason
    bodies : (str, str)
        Names.
    contact : int
        Number of the contact; numbers count up and are not used twice.
    gap : float
        When it happened, in the user's units.
    """

    kind: EventKind
    reason: EventReason
    bodies: tuple[str, str]
    contact: int
    gap: float

    def __str__(self) -> str:
        return f"{' and '.join(self.bodies)}: contact {self.contact} {self.kind.value} at gap {self.gap:.3g}"


_KINDS, _REASONS = tuple(EventKind), tuple(EventReason)


def fresh_memory(pairs: int, places: int, reach: float) -> Array:
    """What a contact manager knows that has seen nothing yet; `reach` is that of its first looks."""
    pairs_at = manager_records.MEMORY_HEADER
    places_at = pairs_at + manager_records.PAIR_MEMORY * pairs
    events_at = places_at + manager_records.PLACE_MEMORY * places
    memory = np.zeros(events_at + manager_records.EVENT * manager_records.EVENTS)
    states = memory[pairs_at:places_at].reshape(pairs, manager_records.PAIR_MEMORY)
    known = rows_of(manager_records.PAIR_STATE, states)
    known.turn[:, 0] = np.nan
    known.margin = reach
    slots = memory[places_at:events_at].reshape(places, manager_records.PLACE_MEMORY)
    rows_of(manager_records.PLACE_STATE, slots).pair = -1.0
    return memory


def listed_places(memory: Array, pairs: int, places: int) -> list[list[int]]:
    """Of every place its pair of bodies, or -1, the number of its contact, and 1 if that is in a given one's place."""
    at = manager_records.MEMORY_HEADER + manager_records.PAIR_MEMORY * pairs
    rows = memory[at : at + manager_records.PLACE_MEMORY * places].reshape(-1, manager_records.PLACE_MEMORY)
    found: list[list[int]] = rows.astype(np.int64).tolist()
    return found


def events_of(memory: Array, names: list[tuple[str, str]], scale: float, since: int = 0) -> tuple[Event, ...]:
    """The events in a memory after the first `since`; the oldest may be gone.

    Parameters
    ----------
    memory : array
    names : list of (str, str)
        Of the bodies of every pair.
    scale : float
        Length of one.
    since : int
    """
    count = int(manager_records.memory_header_at(memory, 0).event_count)
    rows = memory[-manager_records.EVENT * manager_records.EVENTS :].reshape(-1, manager_records.EVENT)
    return tuple(
        Event(_KINDS[int(kind)], _REASONS[int(reason)], names[int(pair)], int(contact), gap * scale)
        for kind, reason, pair, contact, gap, _ in rows[
            [k % manager_records.EVENTS for k in range(max(since, count - manager_records.EVENTS), count)]
        ].tolist()
    )
