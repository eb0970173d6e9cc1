"""Rows of lifted pairs, whose coordinates are unknowns (`proximity/extrema/lifted_pair.py`), and their Hessian terms.

Both kernels are called by their addresses.
"""

from __future__ import annotations

from assembly._kernel import kernel
from assembly._record import Store
from assembly.constraints.program.contact import contact_of, copy_tracked, least_gap
from assembly.constraints.program.records import header_at
from assembly.proximity.extrema.lifted_pair import VARIABLES, LiftedPair, free_hessian, free_rows
from assembly.proximity.features.solid_contact import contact_record_at, tracked_at


@kernel(inline=True)
def lifted_pair(table, tracked, lengths, r):
    """The `LiftedPair` of row r at the coordinates in tracked[r]."""
    contact = contact_of(table, r)
    return LiftedPair(
        surfaces=(contact.surface_f, contact.surface_g),
        bodies=(contact.body_f, contact.body_g),
        x=(tracked[r, 0], tracked[r, 1], tracked[r, 2], tracked[r, 3]),
        lengths=(lengths[r, 0], lengths[r, 1], lengths[r, 2], lengths[r, 3]),
    )


@kernel(
    signatures=(
        "(Tuple((i8[::1], f8[::1])), i8, f8[:, ::1], "
        "Tuple((i8[::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1], f8[::1])), "
        "Tuple((f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[::1], f8[:, ::1])))"
    )
)
def free_row(scene, r, start, lifted, point):
    """Row r, of a lifted pair at the coordinates in start[r]; all rows of tangency follow the rows of the program.

    `lifted` and `point` have the parts of `LiftedPairs` and of an `Iterate`.
    """
    table, pool = scene
    store = Store(table, pool)
    free, lengths, vectors, _variables, _guess, _memory = lifted
    q, tracked, records, residual, jacobian = point
    header = header_at(table, 0)
    copy_tracked(start, r, tracked)
    pair = lifted_pair(table, start, lengths, r)
    free_rows(store, pair, q, vectors, residual, jacobian, r, header.rows + 4 * free[r])
    tracked_at(tracked, r).gap = residual[r]
    residual[r] -= least_gap(store, r, tracked)
    contact_record_at(records, r).slack = 0.0
    return 0


@kernel(
    signatures=(
        "(Tuple((i8[::1], f8[::1])), i8, "
        "Tuple((i8[::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1], f8[::1])), "
        "Tuple((f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[::1], f8[:, ::1])), "
        "f8[::1], f8[::1], f8[:, ::1])"
    )
)
def free_terms(scene, r, lifted, point, y, weights, hessian):
    """As `add_row_terms`, for the row of a lifted pair and its four rows of tangency."""
    table, pool = scene
    free, lengths, vectors, block, _guess, _memory = lifted
    q, tracked, _records, _residual, jacobian = point
    header = header_at(table, 0)
    contact = contact_of(table, r)
    f = 6 * table[header.unknown_blocks + contact.body_f]
    g = 6 * table[header.unknown_blocks + contact.body_g]
    e = header.rows + 4 * free[r]
    u = 6 * header.moving + 4 * free[r]
    pair = lifted_pair(table, tracked, lengths, r)
    free_hessian(Store(table, pool), pair, q, (y[r], y[e], y[e + 1], y[e + 2], y[e + 3]), vectors, block)
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
