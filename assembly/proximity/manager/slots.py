"""Slots for contacts: which extrema are listed, keep their slots or give them up, and the log of these events."""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.proximity.bvh.tree import three_of
from assembly.proximity.features.holding import HELD_F
from assembly.proximity.features.solid_contact import pair_parameters, tracked_at
from assembly.proximity.manager.extrema import (
    ALIKE,
    BESIDE_CONTACT,
    LISTED,
    MINIMUM_FOUND,
    NEW,
    OF_CONTACT,
    USELESS,
    add_extremum,
    add_given,
    extremum_at,
    is_list_full,
)
from assembly.proximity.manager.near_singular_points import sunk
from assembly.proximity.manager.overlap import is_outside
from assembly.proximity.manager.parameters import KEEP, TAKE
from assembly.proximity.manager.records import (
    ADDED,
    CAME_NEAR,
    EVENT,
    EVENTS,
    HANDED_OFF,
    LOST,
    MERGED,
    NO_PLACE,
    REFUSED,
    REMOVED,
    SAME_EXTREMUM,
    WENT_AWAY,
    event_at,
    header_of,
    lengths_of,
    memory_places,
    pair_lengths_of,
    pair_of,
    pair_state_of,
    record_of,
    slot_of,
)
from assembly.proximity.manager.wires import both_radii

# A point of a valley that is a row moves to the valley's bottom if that is lower by more than this.
SUNK = 1e-13


@kernel(inner=True)
def log_event(manager, kind, reason, p, number, gap):
    """Write an event into the log."""
    header = header_of(manager)
    events = memory_places(manager.store.table, manager.at)[2]
    event = event_at(manager.memory, events + EVENT * (np.int64(header.event_count) % EVENTS))
    event.kind = float(kind)
    event.reason = float(reason)
    event.pair = float(p)
    event.number = number
    event.gap = gap
    event.time = header.time
    header.event_count += 1.0


@kernel(inner=True)
def any_listed(manager, p):
    """Whether pair p has a listed contact."""
    pair = pair_of(manager, p)
    for k in range(pair.low, pair.high):
        if slot_of(manager, k).pair == p:
            return True
    return False


@kernel(inner=True)
def any_lost(manager, p, tracked):
    """Whether a listed contact of pair p has lost its extremum."""
    first = record_of(manager).first
    pair = pair_of(manager, p)
    for k in range(pair.low, pair.high):
        if slot_of(manager, k).pair == p and math.isnan(tracked_at(tracked, first + k).parameters[0]):
            return True
    return False


@kernel(inner=True)
def release(manager, k, tracked):
    """Make slot k free."""
    slot_of(manager, k).pair = -1.0
    tracked_at(tracked, record_of(manager).first + k).parameters[0] = math.nan


@kernel(inner=True)
def free_slot(manager, p):
    """A slot without a contact among those of pair p, or -1."""
    pair = pair_of(manager, p)
    for k in range(pair.low, pair.high):
        if slot_of(manager, k).pair < 0.0:
            return k
    return -1


@kernel(inner=True)
def track_extremum(extremum, pair):
    """Track an extremum in a row of `tracked`."""
    for k in range(4):
        pair.parameters[k] = extremum.parameters[k]
    pair.feature_f = extremum.code_f
    pair.feature_g = extremum.code_g
    for k in range(3):
        pair.normal[k] = extremum.normal[k]
    pair.gap = extremum.gap
    pair.stays = extremum.corner
    pair.idle = 0.0
    pair.facing = 0.0


@kernel(inner=True)
def is_of_far_sides(posed, extremum):
    """Whether an extremum with a negative gap is of sides that are turned away from each other."""
    if posed.centerlines[0] >= 0:
        return extremum.gap < -both_radii(posed.store, posed.centerlines)
    return is_outside(posed, extremum)


@kernel(inner=True)
def known_extrema(manager, p, posed, tracked, extrema):
    """Add the extrema that contacts of pair p have now: given ones, then listed ones.

    A listed contact that lost its extremum, or came to that of another one or to the far sides, gives up its slot.
    Returns whether any was lost.
    """
    pair = pair_of(manager, p)
    merge_radius = lengths_of(manager).merge_radius
    # A contact that is to close a gap would contradict a clearance that asks for one, if both were one extremum.
    radius = merge_radius if pair_lengths_of(manager, p).least == 0.0 else math.inf
    add_given(posed, tracked, pair.given, pair.given_count if posed.surfaces[0] >= 0 else 0, radius, extrema)
    first, last = pair.low, pair.high
    any_gone = False
    # Extrema first, then vertex contacts, which give way to them.
    for step in range(2 * (last - first)):
        k = first + step % (last - first)
        slot = slot_of(manager, k)
        tracked_pair = tracked_at(tracked, record_of(manager).first + k)
        vertex_contact = tracked_pair.stays if tracked_pair.stays > 0.0 else 0.0
        if slot.pair != p or (vertex_contact > 0.0) != (step >= last - first):
            continue
        lost = math.isnan(tracked_pair.parameters[0])
        before = extrema.count[0]
        extremum = extremum_at(extrema.rows, before)
        if not lost and not is_list_full(extrema):
            start = pair_parameters(tracked_pair)
            codes = (np.int64(tracked_pair.feature_f), np.int64(tracked_pair.feature_g))
            n = three_of(tracked_pair.normal)
            if vertex_contact >= HELD_F:
                start = sunk(posed, codes, vertex_contact, start)
            found = add_extremum(posed, codes, start, n, merge_radius, extrema, vertex_contact)
            lost = found != ALIKE and found != MINIMUM_FOUND
            if extrema.count[0] > before and vertex_contact == 0.0 and extremum.gap < 0.0:
                lost = lost or is_of_far_sides(posed, extremum)
        if extrema.count[0] > before and not lost:
            extremum.origin = LISTED + k
            if vertex_contact >= HELD_F and extremum.gap < tracked_pair.gap - SUNK:
                # The contact has moved: the solve has to know.
                log_event(manager, HANDED_OFF, SAME_EXTREMUM, p, slot.number, extremum.gap)
            track_extremum(extremum, tracked_pair)
        else:
            # A vertex contact that has left its face does not count as lost.
            any_gone = any_gone or (lost and vertex_contact == 0.0)
            kind, reason = (HANDED_OFF, LOST) if lost else (MERGED, SAME_EXTREMUM)
            log_event(manager, kind, reason, p, slot.number, tracked_pair.gap)
            release(manager, k, tracked)
    return any_gone


@kernel(inline=True)
def gap_beyond(extrema, i, least):
    """By how much the gap of extremum i exceeds its least gap, which is zero in the place of a contact."""
    extremum = extremum_at(extrema.rows, i)
    return extremum.gap - (0.0 if extremum.place == BESIDE_CONTACT else least)


@kernel(inner=True)
def give_up(manager, p, extremum, kind, reason, tracked):
    """Free the slot of a listed extremum, and note it."""
    k = np.int64(extremum.origin) - LISTED
    log_event(manager, kind, reason, p, slot_of(manager, k).number, extremum.gap)
    release(manager, k, tracked)


@kernel(inner=True)
def release_given(manager, p, extrema, tracked):
    """Free the slots of extrema that are a given contact's own pair, or that came into its place or left it.

    Those that came or left have another least gap from now on, and are listed anew.
    """
    for i in range(extrema.count[0]):
        extremum = extremum_at(extrema.rows, i)
        origin = np.int64(extremum.origin)
        own = extremum.place == OF_CONTACT
        if origin >= LISTED:
            if own or (extremum.place == BESIDE_CONTACT) != (slot_of(manager, origin - LISTED).given == 1.0):
                give_up(manager, p, extremum, MERGED if own else HANDED_OFF, SAME_EXTREMUM, tracked)
                extremum.origin = NEW
        if own and extremum.origin == NEW:
            extremum.origin = USELESS


@kernel(inner=True)
def nearest_new(extrema, least):
    """The new extremum whose gap is the least beyond its own least gap, or -1."""
    best = -1
    for i in range(extrema.count[0]):
        if extremum_at(extrema.rows, i).origin == NEW and (
            best < 0 or gap_beyond(extrema, i, least) < gap_beyond(extrema, best, least)
        ):
            best = i
    return best


@kernel(inner=True)
def list_extrema(manager, p, extrema, tracked):
    """Give slots to the near extrema of pair p and take them from the far ones.

    Of the extrema that are not listed, returns the least excess of a gap over its least gap, and the lowest gap; and
    whether a near one found no slot.
    """
    header, known = header_of(manager), pair_state_of(manager, p)
    wanting = False
    margin = known.margin
    least = pair_lengths_of(manager, p).least
    rest = math.inf
    lowest = math.inf
    for i in range(extrema.count[0]):
        extremum = extremum_at(extrema.rows, i)
        if np.int64(extremum.origin) >= LISTED and gap_beyond(extrema, i, least) > KEEP * margin:
            give_up(manager, p, extremum, REMOVED, WENT_AWAY, tracked)
            rest = min(rest, gap_beyond(extrema, i, least))
            lowest = min(lowest, extremum.gap)
    # The nearest first: if there are too few slots, the far ones get none.
    while True:
        best = nearest_new(extrema, least)
        if best < 0:
            break
        gap = gap_beyond(extrema, best, least)
        extremum = extremum_at(extrema.rows, best)
        extremum.origin = USELESS
        k = free_slot(manager, p) if gap <= TAKE * margin else -1
        if k < 0:
            rest = min(rest, gap)
            lowest = min(lowest, extremum.gap)
            if gap <= TAKE * margin and not wanting:
                wanting = True
                if known.wanting == 0.0:
                    log_event(manager, REFUSED, NO_PLACE, p, 0.0, extremum.gap)
            continue
        slot = slot_of(manager, k)
        slot.pair = float(p)
        header.born += 1.0
        slot.number = header.born
        slot.given = 1.0 if extremum.place == BESIDE_CONTACT else 0.0
        tracked_pair = tracked_at(tracked, record_of(manager).first + k)
        track_extremum(extremum, tracked_pair)
        tracked_pair.allowed = -gap if -header.overlap <= gap < 0.0 else 0.0
        log_event(manager, ADDED, CAME_NEAR, p, header.born, extremum.gap)
    known.wanting = 1.0 if wanting else 0.0
    return rest, lowest, wanting
