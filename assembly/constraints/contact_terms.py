"""What rows of contacts add to a Hessian; what other rows do is in `row_terms.py`, which calls this by its address."""

from __future__ import annotations

from assembly._kernel import kernel
from assembly.constraints.blocks import add_patch, clear_patch, is_blocked
from assembly.constraints.layout import (
    BODY_F,
    BODY_G,
    CONTACTS,
    MOVING,
    ROW,
    ROW_TABLE,
    ROWS,
    SLOTS,
    SURFACE_F,
    SURFACE_G,
)
from assembly.proximity.free_pair import VARIABLES, free_hessian
from assembly.proximity.velocity import add_gap_terms


@kernel(inner=True)
def add_free_terms(table, pool, r, loose, point, y, weights, hessian):
    """Second derivative of y . rows + J^T diag(weights) J, for the row of a free pair and its rows of tangency."""
    q, tracked, _records, _residual, jacobian = point
    free, lengths, vectors, block = loose[0], loose[1], loose[2], loose[3]
    row = table[ROW_TABLE] + ROW * r
    f = 6 * table[table[SLOTS] + table[row + BODY_F]]
    g = 6 * table[table[SLOTS] + table[row + BODY_G]]
    e = table[ROWS] + 4 * free[r]
    u = 6 * table[MOVING] + 4 * free[r]
    free_hessian(
        table,
        pool,
        table[row + SURFACE_F],
        table[row + SURFACE_G],
        table[row + BODY_F],
        table[row + BODY_G],
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


@kernel(
    signatures=(
        "(i8[::1], f8[::1], i8[::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], i8[:, ::1], i8[:, ::1], i8[:, ::1], "
        "f8[:, ::1], i8[::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[::1], f8[:, ::1], f8[::1], f8[::1], f8[:, ::1])"
    ),
)
def contact_terms(
    table, pool, free, lengths, vectors, values, bases, places, folds, scratch, blocks,
    q, tracked, records, residual, jacobian, y, weights, hessian,
):  # fmt: skip
    """Upper triangle of hessian += second derivative of y . rows + J^T diag(weights) J, for rows of contacts.

    The rows of tangency of a free pair go with its row.
    """
    loose = (free, lengths, vectors, values)
    order = (places, folds, scratch, blocks)
    point = (q, tracked, records, residual, jacobian)
    blocked = is_blocked(order)
    for r in range(table[CONTACTS]):
        if free[r] >= 0:
            add_free_terms(table, pool, r, loose, point, y, weights, hessian)
        elif blocked and (y[r] != 0.0 or weights[r] != 0.0):
            f, g = clear_patch(order, bases[r, 0], bases[r, 1])
            add_gap_terms(records, r, jacobian, r, y[r], weights[r], scratch[1:], f, g)
            add_patch(order, bases[r, 0], bases[r, 1], hessian)
        elif y[r] != 0.0 or weights[r] != 0.0:
            add_gap_terms(records, r, jacobian, r, y[r], weights[r], hessian, bases[r, 0], bases[r, 1])
    return 0
