"""Rows of contacts whose coordinates are unknowns (`proximity/extrema/lifted_pair.py`), and what they add to a Hessian.

Both kernels are called by their addresses.
"""

from __future__ import annotations

from assembly._kernel import kernel
from assembly._record import Store
from assembly.constraints.program.contact import copy_tracked, least_gap
from assembly.constraints.program.records import (
    ROW,
    contact_row_at,
    header_at,
    row_at,
)
from assembly.proximity.extrema.lifted_pair import VARIABLES, free_hessian, free_rows
from assembly.proximity.features.solid_contact import contact_record_at, tracked_at


@kernel(
    signatures=(
        "(i8[::1], f8[::1], i8, f8[:, ::1], i8[::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], "
        "f8[::1], f8[:, ::1])"
    ),
)
def free_row(table, pool, r, start, free, lengths, vectors, q, tracked, records, residual, jacobian):
    """Row r, of a contact at the coordinates in start[r]; its four rows of tangency follow the rows of the program."""
    store = Store(table, pool)
    header = header_at(table, 0)
    row = header.row_table + ROW * r
    contact = contact_row_at(table, row)
    fields = row_at(table, row)
    copy_tracked(start, r, tracked)
    free_rows(
        store,
        contact.surface_f,
        contact.surface_g,
        fields.body_f,
        fields.body_g,
        q,
        (start[r, 0], start[r, 1], start[r, 2], start[r, 3]),
        (lengths[r, 0], lengths[r, 1], lengths[r, 2], lengths[r, 3]),
        vectors,
        residual,
        jacobian,
        r,
        header.rows + 4 * free[r],
    )
    tracked_at(tracked, r).gap = residual[r]
    residual[r] -= least_gap(store, r, tracked)
    contact_record_at(records, r).slack = 0.0
    return 0


@kernel(
    signatures=(
        "(i8[::1], f8[::1], i8, i8[::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], "
        "f8[::1], f8[::1], f8[:, ::1])"
    ),
)
def free_terms(table, pool, r, free, lengths, vectors, block, q, tracked, jacobian, y, weights, hessian):
    """As `add_row_terms`, for the row of a free pair and its rows of tangency; `block` is room for its variables."""
    header = header_at(table, 0)
    row = header.row_table + ROW * r
    fields = row_at(table, row)
    contact = contact_row_at(table, row)
    f = 6 * table[header.slots + fields.body_f]
    g = 6 * table[header.slots + fields.body_g]
    e = header.rows + 4 * free[r]
    u = 6 * header.moving + 4 * free[r]
    free_hessian(
        Store(table, pool),
        contact.surface_f,
        contact.surface_g,
        fields.body_f,
        fields.body_g,
        q,
        (tracked[r, 0], tracked[r, 1], tracked[r, 2], tracked[r, 3]),
        (lengths[r, 0], lengths[r, 1], lengths[r, 2], lengths[r, 3]),
        (y[r], y[e], y[e + 1], y[e + 2], y[e + 3]),
        vectors,
        block,
    )
    for i in range(VARIABLES):
        base = f if i < 6 else (g - 6 if i < 12 else u - 12)
        if i < 12 and (f if i < 6 else g) < 0:
            continue
        for j in range(VARIABLES):
            other = f if j < 6 else (g - 6 if j < 12 else u - 12)
            if j < 12 and (f if j < 6 else g) < 0:
                continue
            value = block[i, j] + weights[r] * jacobian[r, i] * jacobian[r, j]
            for l in range(4):
                value += weights[e + l] * jacobian[e + l, i] * jacobian[e + l, j]
            hessian[base + i, other + j] += value
    return 0
