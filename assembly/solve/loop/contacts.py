"""The loop's contacts: where their pairs start, and which of them get their coordinates as unknowns."""

from __future__ import annotations

import math

from assembly._address import call_address
from assembly._kernel import kernel
from assembly.constraints.program.contact import is_clearance_row, search_row, start_row, surface_of
from assembly.constraints.program.records import (
    ROW,
    SIGNED,
    contact_row_at,
    header_at,
    row_at,
    trim_row_at,
)
from assembly.geometry.splines.pole import limits
from assembly.proximity.extrema.face_face import CONVERGED, SINGULAR
from assembly.proximity.features.solid_contact import (
    FEATURE_F,
    TRACK,
    contact_record_at,
    tracked_at,
)

# A parameter along which a point moves less, from end to end and over the scene's size, is one at a pole.
POLAR = 1e-6


@kernel(inline=True)
def is_of_surfaces(table, k):
    """Whether contact k is of two surfaces; else it is of solids, whose features switch where a pair ends."""
    return contact_row_at(table, header_at(table, 0).row_table + ROW * k).shell_f < 0


@kernel(inner=True)
def free_pair(store, row, k, contacts, free, lengths):
    """Make the coordinates of contact k unknowns; False where they cannot be: at a pole, and of solids.

    Features of solids switch, which coordinates on two fixed faces would not know.
    """
    contact = contact_row_at(store.table, row)
    x = (contacts[k, 0], contacts[k, 1], contacts[k, 2], contacts[k, 3])
    if contact.shell_f >= 0:
        return False
    call_address(
        header_at(store.table, 0).lengths_address,
        (store.table, store.pool, contact.surface_f, contact.surface_g, x, lengths, k),
    )
    for i in range(4):
        # Over the whole domain, because a parameter has a unit of its own.
        low, high, _closed = limits(store, surface_of(store.table, row, i // 2), i % 2)
        if lengths[k, i] * (high - low) < POLAR:
            return False
    free[k] = 0
    return True


@kernel(inner=True)
def start_contacts(store, q, contacts, free, lengths):
    """Global starts for the contacts whose parameters are NaN. Returns a contact that found none, or -1.

    Where a pair does not exist yet (a face tilted against another), its coordinates become unknowns at once.
    """
    header = header_at(store.table, 0)
    for k in range(header.contacts):
        pair = tracked_at(contacts, k)
        row = header.row_table + ROW * k
        # What a clearance has lost its watch looks for.
        if not math.isnan(contacts[k, 0]) or row_at(store.table, row).body_f < 0 or is_clearance_row(store.table, k):
            continue
        if contact_row_at(store.table, row).shell_f >= 0:
            pair.idle = 0.0
            pair.allowed = 0.0
            if not search_row(store, row, q, contacts, k, True):
                return k
            continue
        status = start_row(store, row, q, contacts, k)
        for l in range(FEATURE_F, TRACK):
            contacts[k, l] = 0.0
        if status != CONVERGED and status != SINGULAR:
            if not free_pair(store, row, k, contacts, free, lengths):
                return k
    return -1


@kernel(inner=True)
def free_folds(store, records, contacts, active, free, lengths, below, lost, trims):
    """Mark the pairs near a fold, and the lost one, as free. Returns how many are free now.

    An idle one-sided row asks nothing of its pair. With `trims`, pairs whose trims count are freed as well: the second
    derivative of a trim is known in the coordinates alone.
    """
    header = header_at(store.table, 0)
    count = 0
    if trims:
        for r in range(header.contacts, header.contacts + header.trims):
            row = header.row_table + ROW * r
            k = trim_row_at(store.table, row).contact
            counts = trim_row_at(store.table, row).form == SIGNED and not (
                row_at(store.table, row).one_sided == 1 and active[r] == 0.0
            )
            if free[k] < 0 and counts:
                free_pair(store, header.row_table + ROW * k, k, contacts, free, lengths)
    for k in range(header.contacts):
        row = header.row_table + ROW * k
        idle = row_at(store.table, row).one_sided == 1 and active[k] == 0.0
        if free[k] < 0 and not idle and (abs(contact_record_at(records, k).fold) < below or k == lost):
            free_pair(store, row, k, contacts, free, lengths)
        if free[k] >= 0:
            free[k] = count
            count += 1
    return count


@kernel(inner=True)
def free_pairs_hold(store, q, contacts, free, tolerance):
    """Whether every free pair is extremal by the frames of tracked pairs, which know poles.

    Its own rows do not tell at a pole or an apex: there a tangent vanishes, and its row with it.
    """
    header = header_at(store.table, 0)
    for k in range(header.contacts):
        row = header.row_table + ROW * k
        contact = contact_row_at(store.table, row)
        fields = row_at(store.table, row)
        if free[k] < 0:
            continue
        f, g = contact.surface_f, contact.surface_g
        i, j = fields.body_f, fields.body_g
        if call_address(header.extremal_address, (store.table, store.pool, f, g, i, j, q, contacts, k, tolerance)) == 0:
            return False
    return True
