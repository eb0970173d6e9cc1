"""The loop's contacts: where pairs start, which are lifted (their coordinates become unknowns), sides of trim loops."""

from __future__ import annotations

import math

from assembly._address import call_address
from assembly._kernel import kernel
from assembly.constraints.program.contact import (
    contact_of,
    is_clearance_row,
    is_of_solids,
    search_row,
    start_row,
    surface_of,
)
from assembly.constraints.program.records import ROW, SIGNED, header_at, trim_row_at
from assembly.geometry.splines.pole import limits
from assembly.proximity.extrema.face_face import CONVERGED, SINGULAR
from assembly.proximity.features.solid_contact import FEATURE_F, TRACK, contact_record_at, tracked_at
from assembly.solve.loop.parameters import POLAR


@kernel(inner=True)
def lift_pair(store, k, contacts, free, lengths):
    """Make the coordinates of contact k unknowns. False where this is not possible: at a pole, and for solids.

    The closest features of solids change from face to face, and coordinates on two fixed faces cannot follow that.
    """
    contact = contact_of(store.table, k)
    x = (contacts[k, 0], contacts[k, 1], contacts[k, 2], contacts[k, 3])
    if contact.shell_f >= 0:
        return False
    call_address(
        header_at(store.table, 0).lengths_address,
        (store.table, store.pool, contact.surface_f, contact.surface_g, x, lengths, k),
    )
    for i in range(4):
        # Over the whole domain, because a parameter has a unit of its own.
        low, high, _closed = limits(store, surface_of(contact, i // 2), i % 2)
        if lengths[k, i] * (high - low) < POLAR:
            return False
    free[k] = 0
    return True


@kernel(inner=True)
def start_contacts(store, q, contacts, free, lengths):
    """Find global starts of the contacts whose parameters are NaN. Returns a contact that has none, or -1.

    Where a pair does not exist yet (a face tilted against another), its coordinates become unknowns at once.
    """
    header = header_at(store.table, 0)
    for k in range(header.contacts):
        pair = tracked_at(contacts, k)
        # Contacts that a clearance has lost are found again by its contact manager.
        idle = contact_of(store.table, k).body_f < 0 or is_clearance_row(store.table, k)
        if not math.isnan(contacts[k, 0]) or idle:
            continue
        if is_of_solids(store.table, k):
            pair.idle = 0.0
            pair.allowed = 0.0
            if not search_row(store, q, contacts, k, True):
                return k
            continue
        status = start_row(store, q, contacts, k)
        for l in range(FEATURE_F, TRACK):
            contacts[k, l] = 0.0
        if status != CONVERGED and status != SINGULAR:
            if not lift_pair(store, k, contacts, free, lengths):
                return k
    return -1


@kernel(inline=True)
def is_near_fold(records, k, below):
    """Whether the pair of contact k is so near to a fold that its coordinates are to be unknowns."""
    return abs(contact_record_at(records, k).fold) < below


@kernel(inner=True)
def lift_folds(store, lifted, point, active, below, lost, trims):
    """Mark the pairs near a fold, and the lost one, as lifted. Returns how many are lifted now.

    An idle one-sided row does not need its pair. With `trims`, pairs with active trims are lifted as well: the second
    derivative of a trim is known in the coordinates only.
    """
    header = header_at(store.table, 0)
    free, lengths, contacts, records = lifted.free, lifted.lengths, point.tracked, point.records
    count = 0
    if trims:
        for r in range(header.contacts, header.contacts + header.trims):
            trim = trim_row_at(store.table, header.row_table + ROW * r)
            k = trim.contact
            counts = trim.form == SIGNED and not (trim.one_sided == 1 and active[r] == 0.0)
            if free[k] < 0 and counts:
                lift_pair(store, k, contacts, free, lengths)
    for k in range(header.contacts):
        idle = contact_of(store.table, k).one_sided == 1 and active[k] == 0.0
        if free[k] < 0 and not idle and (is_near_fold(records, k, below) or k == lost):
            lift_pair(store, k, contacts, free, lengths)
        if free[k] >= 0:
            free[k] = count
            count += 1
    return count


@kernel(inner=True)
def lifted_pairs_hold(store, q, contacts, free, tolerance):
    """Whether every lifted pair is extremal by the frames of tracked pairs, which handle poles.

    At a pole or an apex the pair's own rows do not show this: a tangent vanishes there, and so does its row.
    """
    header = header_at(store.table, 0)
    for k in range(header.contacts):
        contact = contact_of(store.table, k)
        if free[k] < 0:
            continue
        surfaces = (contact.surface_f, contact.surface_g)
        bodies = (contact.body_f, contact.body_g)
        if call_address(header.extremal_address, (store, surfaces, bodies, q, contacts, k, tolerance)) == 0:
            return False
    return True


@kernel(inner=True)
def choose_sides(program, current, rows, least):
    """Choose the sides of trim loops for the trim rows at the iterate, and evaluate these. Whether a side changed.

    Proposed multipliers tell whether a contact moves on around a corner, if they are above `least`.
    """
    store, lifted = program.store, program.lifted
    header = header_at(store.table, 0)
    if header.trim_sides_address == 0:
        return False
    if call_address(header.trim_sides_address, (store, lifted, current, least, rows.y, rows.better_y)) == 0:
        return False
    call_address(header.trim_rows_address, (store, lifted, current))
    return True
