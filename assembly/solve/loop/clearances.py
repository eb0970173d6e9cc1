"""Rows of clearances: slots of a contact manager (`proximity/manager/update.py`) as one-sided contacts of a scene."""

from __future__ import annotations

import math

import numpy as np

from assembly._address import call_address
from assembly._kernel import kernel
from assembly.constraints.program.contact import contact_of, copy_tracked, is_of_solids
from assembly.constraints.program.records import header_at
from assembly.proximity.features.solid_contact import contact_record_at
from assembly.proximity.manager.parameters import SLICE, UNMOVED, USED
from assembly.proximity.manager.records import (
    IN_PLACE,
    PAIR_MEMORY,
    PAIR_RECORD,
    PLACE_MEMORY,
    lengths_at,
    manager_at,
    memory_header_at,
    memory_places,
    pair_at,
    pair_state_at,
    place_at,
)
from assembly.solve.loop.parameters import SLIGHTLY
from assembly.solve.loop.residuals import move


@kernel(inner=True)
def clear_clearance_rows(table):
    """Empty all clearance rows at the end of a solve: every solution keeps its own list of contacts in its state."""
    header = header_at(table, 0)
    for k in range(header.first_clearance_row, header.first_clearance_row + header.clearance_rows):
        contact = contact_of(table, k)
        contact.body_f = -1
        contact.body_g = -1
        contact.clearance_number = 0


@kernel(inner=True)
def forget_clearance_rows(table, memory):
    """Reset the contact manager: no pair counts as updated, and no contact has a slot."""
    header = header_at(table, 0)
    record = header.manager_record
    pairs, places, _events = memory_places(table, record)
    for p in range(manager_at(table, record).pairs):
        pair_state_at(memory, pairs + PAIR_MEMORY * p).turn[0] = math.nan
    for k in range(header.clearance_rows):
        place_at(memory, places + PLACE_MEMORY * k).pair = -1.0


@kernel(inner=True)
def place_clearance_rows(table, lifted, current, rows, begins):
    """Write into every clearance row the contact in its slot; a new contact gets the multiplier zero.

    If the solve `begins`, the rows are still empty, and the multipliers in the state are kept.
    """
    header = header_at(table, 0)
    record = header.manager_record
    memory, free = lifted.memory, lifted.free
    places = memory_places(table, record)[1]
    for k in range(header.clearance_rows):
        place = place_at(memory, places + PLACE_MEMORY * k)
        r = header.first_clearance_row + k
        contact_record = contact_record_at(current.records, r)
        contact = contact_of(table, r)
        p = np.int64(place.pair)
        number = np.int64(place.number) if p >= 0 else 0
        if number == contact.clearance_number:
            continue
        contact.clearance_number = number
        if not begins:
            rows.y[r] = 0.0
            rows.better_y[r] = 0.0
        free[r] = -1
        # The row of the new contact has not been evaluated yet.
        contact_record.fold = 1.0
        contact_record.slack = 0.0
        current.residual[r] = 1.0
        if p < 0:
            contact.body_f = -1
            contact.body_g = -1
            continue
        pair_record = pair_at(table, manager_at(table, record).pair_table + PAIR_RECORD * p)
        contact.body_f = pair_record.body_f
        contact.body_g = pair_record.body_g
        in_place = place.given == 1.0
        contact.minimum = pair_record.minimum + (IN_PLACE if in_place else 0)
        contact.surface_f = pair_record.surface_f
        contact.surface_g = pair_record.surface_g
        contact.shell_f = pair_record.shell_f
        contact.shell_g = pair_record.shell_g


@kernel(inner=True)
def update_around(store, memory, point, how):
    """Update the contact manager at a point. Returns whether rows changed.

    In a long update the caller is asked every 50 ms (SLICE) whether to go on. If not, this update and all later ones of
    the solve end at once, as with a spent budget (`is_cut` in `solve/loop/deadline.py`), and return True: which
    contacts there are is then unknown.
    """
    header = header_at(store.table, 0)
    state = memory_header_at(memory, 0)
    record = header.manager_record
    manager = manager_at(store.table, record)
    asks = manager.go_on_address != 0 and manager.clock != 0
    if asks and state.deadline < 0.0:
        return True
    if asks:
        state.deadline = call_address(manager.clock, ()) + SLICE
    changed = (
        call_address(header.update_address, (store.table, store.pool, record, memory, point.q, point.tracked, how)) > 0
    )
    aborted = asks and state.deadline < 0.0
    if asks and not aborted:
        state.deadline = math.inf
    return changed or aborted


@kernel(inner=True)
def update_again(store, lifted, point, how):
    """Update the contact manager at a point whose rows are evaluated. Returns whether rows changed.

    An update moves every contact onto its extremum. The coordinates of lifted pairs are unknowns of the solve, and
    their rows have been evaluated: their old values are put back. But where the extremum is farther away than the merge
    radius, the pair may be converging to a saddle, and the extremum's coordinates are taken.
    """
    header = header_at(store.table, 0)
    memory, free, scratch, tracked = lifted.memory, lifted.free, lifted.guess, point.tracked
    first = header.first_clearance_row
    for r in range(first, first + header.clearance_rows):
        if free[r] >= 0:
            copy_tracked(tracked, r, scratch)
    changed = update_around(store, memory, point, how)
    places = memory_places(store.table, header.manager_record)[1]
    merge_radius = lengths_at(store.pool, manager_at(store.table, header.manager_record).lengths).merge_radius
    for r in range(first, first + header.clearance_rows):
        place = places + PLACE_MEMORY * (r - first)
        number = np.int64(place_at(memory, place).number) if place_at(memory, place).pair >= 0.0 else 0
        contact = contact_of(store.table, r)
        if free[r] >= 0 and number == contact.clearance_number:
            f, g = contact.surface_f, contact.surface_g
            if (
                call_address(header.stayed_address, (store.table, store.pool, f, g, tracked, scratch, r, merge_radius))
                == 1
            ):
                copy_tracked(scratch, r, tracked)
            else:
                changed = True
    return changed


@kernel(inner=True)
def numbers_of(table, out):
    """The numbers of the contacts that rows have now."""
    header = header_at(table, 0)
    for k in range(header.clearance_rows):
        out[k] = contact_of(table, header.first_clearance_row + k).clearance_number


@kernel(inner=True)
def go_back(table, memory, numbers):
    """Keep only the contacts with these saved numbers.

    If a row has another contact now, its slot is emptied, and every pair is to be updated again.
    """
    header = header_at(table, 0)
    record = header.manager_record
    pairs, places, _events = memory_places(table, record)
    same = True
    for k in range(header.clearance_rows):
        number = contact_of(table, header.first_clearance_row + k).clearance_number
        if number != numbers[k]:
            same = False
            place_at(memory, places + PLACE_MEMORY * k).pair = -1.0
    if not same:
        for p in range(manager_at(table, record).pairs):
            pair_state_at(memory, pairs + PAIR_MEMORY * p).turn[0] = math.nan


@kernel(inner=True)
def measure_pairs(store, memory, first, end, q):
    """Measure which part of its motion bound each pair, first to end - 1, uses at q. Returns the largest known part."""
    header = header_at(store.table, 0)
    record = header.manager_record
    most = call_address(header.parts_address, (store.table, store.pool, record, memory, first, end, q))
    return pair_state_at(memory, memory_places(store.table, record)[0] + PAIR_MEMORY * most).part


@kernel(inner=True)
def allowed_share(store, memory, current, trial, step, share):
    """The share of a step that the contact manager allows, at most `share`, and whether this is all of `share`.

    The poses after `share` of the step go into the trial iterate. Every pair records the part of its motion bound that
    this step would use, so that an update (MEASURED) can begin with the largest part. But if a pair was updated at the
    current poses with as large a query margin as another update would take, it records the part used there.
    """
    move(store.table, current.q, step, share, trial.q)
    record = header_at(store.table, 0).manager_record
    manager = manager_at(store.table, record)
    if measure_pairs(store, memory, 0, manager.pairs, trial.q) <= 1.0:
        return share, True
    at = memory_places(store.table, record)[0]
    allowed = 1.0
    for p in range(manager.pairs):
        # For every pair by itself: a pair whose bound is nearly used but that hardly moves does not limit the step.
        o = pair_state_at(memory, at + PAIR_MEMORY * p)
        end = o.part
        o.cut_short = end * o.motion_bound
        begin = end
        if end > USED:
            measure_pairs(store, memory, p, p + 1, current.q)
            begin = o.part
            o.part = end
        if end > max(begin, 1.0):
            allowed = min(allowed, max(0.95 - begin, 0.05) / (end - begin))
        flank = pair_at(store.table, manager.pair_table + PAIR_RECORD * p).minimum + 1
        most = min(store.pool[flank], lengths_at(store.pool, manager.lengths).largest_margin)
        if begin <= UNMOVED and o.margin >= min(o.cut_short, most):
            # The pair was updated at this pose, with as large a query margin as another update would take.
            o.part = begin
    return share * allowed, False


@kernel(inner=True)
def is_too_far(store, memory, point):
    """Whether the poses of a point exceed the motion bound of a pair."""
    pairs = manager_at(store.table, header_at(store.table, 0).manager_record).pairs
    return measure_pairs(store, memory, 0, pairs, point.q) > 1.0


@kernel(inner=True)
def ends_unseen(store, memory, before, after):
    """Whether a clearance's contact of solids ends in a step that moves the bodies by more than its residual.

    Where features meet, another contact replaces it, which is not listed yet and was no nearer. In such a step the
    bodies could pass through each other there, and that contact be found on the far side, or not at all.
    """
    header = header_at(store.table, 0)
    record = header.manager_record
    places = memory_places(store.table, record)[1]
    for k in range(header.clearance_rows):
        r = header.first_clearance_row + k
        p = np.int64(place_at(memory, places + PLACE_MEMORY * k).pair)
        if (
            p >= 0
            and math.isnan(after.tracked[r, 0])
            and not math.isnan(before.tracked[r, 0])
            and is_of_solids(store.table, r)
        ):
            most = max(before.residual[r], SLIGHTLY)
            if call_address(header.went_address, (store.table, store.pool, record, p, before.q, after.q, most)) == 1:
                return True
    return False
