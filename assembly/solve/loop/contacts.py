"""The loop's contacts: where their pairs start, and which of them get their coordinates as unknowns."""

from __future__ import annotations

import math

from assembly._address import call_address
from assembly._kernel import kernel
from assembly.constraints.program.contact import is_guard, search_row, start_row
from assembly.constraints.program.records import (
    BODY_F,
    BODY_G,
    CONTACTS,
    EXTREMAL_AT,
    LENGTHS_AT,
    ONE_SIDED,
    ROW,
    ROW_TABLE,
    SHELL_F,
    SIGNED,
    SURFACE_F,
    SURFACE_G,
    TRIM_FORM,
    TRIM_PAIR,
    TRIMS,
)
from assembly.geometry.splines.pole import limits
from assembly.proximity.extrema.face_face import CONVERGED, SINGULAR
from assembly.proximity.features.solid_contact import ALLOWED, FEATURE_F, FOLD, IDLE, TRACK

# A parameter along which a point moves less, from end to end and over the scene's size, is one at a pole.
POLAR = 1e-6


@kernel(inline=True)
def is_of_surfaces(table, k):
    """Whether contact k is of two surfaces; else it is of solids, whose features switch where a pair ends."""
    return table[table[ROW_TABLE] + ROW * k + SHELL_F] < 0


@kernel(inner=True)
def free_pair(table, pool, row, k, contacts, free, lengths):
    """Make the coordinates of contact k unknowns; False where they cannot be: at a pole, and of solids.

    Features of solids switch, which coordinates on two fixed faces would not know.
    """
    x = (contacts[k, 0], contacts[k, 1], contacts[k, 2], contacts[k, 3])
    if table[row + SHELL_F] >= 0:
        return False
    call_address(table[LENGTHS_AT], (table, pool, table[row + SURFACE_F], table[row + SURFACE_G], x, lengths, k))
    for i in range(4):
        # Over the whole domain, because a parameter has a unit of its own.
        low, high, _closed = limits(table, pool, table[row + SURFACE_F + i // 2], i % 2)
        if lengths[k, i] * (high - low) < POLAR:
            return False
    free[k] = 0
    return True


@kernel(inner=True)
def start_contacts(table, pool, q, contacts, free, lengths):
    """Global starts for the contacts whose parameters are NaN. Returns a contact that found none, or -1.

    Where a pair does not exist yet (a face tilted against another), its coordinates become unknowns at once.
    """
    for k in range(table[CONTACTS]):
        row = table[ROW_TABLE] + ROW * k
        # What a clearance has lost its watch looks for.
        if not math.isnan(contacts[k, 0]) or table[row + BODY_F] < 0 or is_guard(table, k):
            continue
        if table[row + SHELL_F] >= 0:
            contacts[k, IDLE] = 0.0
            contacts[k, ALLOWED] = 0.0
            if not search_row(table, pool, row, q, contacts, k, True):
                return k
            continue
        status = start_row(table, pool, row, q, contacts, k)
        for l in range(FEATURE_F, TRACK):
            contacts[k, l] = 0.0
        if status != CONVERGED and status != SINGULAR:
            if not free_pair(table, pool, row, k, contacts, free, lengths):
                return k
    return -1


@kernel(inner=True)
def free_folds(table, pool, records, contacts, active, free, lengths, below, lost, trims):
    """Mark the pairs near a fold, and the lost one, as free. Returns how many are free now.

    An idle one-sided row asks nothing of its pair. With `trims`, pairs whose trims count are freed as well: the second
    derivative of a trim is known in the coordinates alone.
    """
    count = 0
    if trims:
        for r in range(table[CONTACTS], table[CONTACTS] + table[TRIMS]):
            row = table[ROW_TABLE] + ROW * r
            k = table[row + TRIM_PAIR]
            counts = table[row + TRIM_FORM] == SIGNED and not (table[row + ONE_SIDED] == 1 and active[r] == 0.0)
            if free[k] < 0 and counts:
                free_pair(table, pool, table[ROW_TABLE] + ROW * k, k, contacts, free, lengths)
    for k in range(table[CONTACTS]):
        row = table[ROW_TABLE] + ROW * k
        idle = table[row + ONE_SIDED] == 1 and active[k] == 0.0
        if free[k] < 0 and not idle and (abs(records[k, FOLD]) < below or k == lost):
            free_pair(table, pool, row, k, contacts, free, lengths)
        if free[k] >= 0:
            free[k] = count
            count += 1
    return count


@kernel(inner=True)
def free_pairs_hold(table, pool, q, contacts, free, tolerance):
    """Whether every free pair is extremal by the frames of tracked pairs, which know poles.

    Its own rows do not tell at a pole or an apex: there a tangent vanishes, and its row with it.
    """
    for k in range(table[CONTACTS]):
        row = table[ROW_TABLE] + ROW * k
        if free[k] < 0:
            continue
        f, g = table[row + SURFACE_F], table[row + SURFACE_G]
        i, j = table[row + BODY_F], table[row + BODY_G]
        if call_address(table[EXTREMAL_AT], (table, pool, f, g, i, j, q, contacts, k, tolerance)) == 0:
            return False
    return True
