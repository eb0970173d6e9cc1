"""How far rows are from holding, with the tangency of lifted pairs counted in full, or by its effect on the gaps.

A lifted pair's coordinates are unknowns; it is an extremum of the distance only where its rows of tangency t hold.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.constraints.program.records import FREE_COLUMN, header_at
from assembly.solve.loop.residuals import violation_of


@kernel(inner=True)
def untouched(residual, jacobian, r, e, work):
    """The first-order change of the gap in row r when the rows of tangency, from e on, are brought to hold.

    The coordinates change by d = -T^-1 t, with t the residuals of the tangency and T their Jacobian in the coordinates.
    Infinite where T is singular.
    """
    c = FREE_COLUMN
    for i in range(4):
        for j in range(4):
            work[i, j] = jacobian[e + i, c + j]
        work[i, 4] = -residual[e + i]
    for k in range(4):
        pivot = k
        for i in range(k + 1, 4):
            if abs(work[i, k]) > abs(work[pivot, k]):
                pivot = i
        if not abs(work[pivot, k]) > 1e-300:
            return math.inf
        for j in range(k, 5):
            work[k, j], work[pivot, j] = work[pivot, j], work[k, j]
        for i in range(k + 1, 4):
            factor = work[i, k] / work[k, k]
            for j in range(k, 5):
                work[i, j] -= factor * work[k, j]
    change = 0.0
    for k in range(3, -1, -1):
        for j in range(k + 1, 4):
            work[k, 4] -= work[k, j] * work[j, 4]
        work[k, 4] /= work[k, k]
        change += jacobian[r, c + k] * work[k, 4]
    return abs(change)


@kernel(inner=True)
def off_tangency(residual, jacobian, r, e, lax, work):
    """The largest residual of a lifted pair's rows of tangency, which begin at e.

    If `lax`, the change of the gap in row r that it causes to first order, where that is less.
    """
    off = 0.0
    for i in range(4):
        if not abs(residual[e + i]) <= off:
            off = abs(residual[e + i])
    return min(off, untouched(residual, jacobian, r, e, work)) if lax and off > 0.0 else off


@kernel(inner=True)
def off_rows(table, lifted, one_sided, point, lax):
    """The largest violation of rows and of the tangency of lifted pairs, which `off_tangency` measures."""
    header = header_at(table, 0)
    free = lifted.free
    worst = violation_of(point.residual, one_sided, header.rows)
    for k in range(header.contacts):
        if free[k] >= 0:
            off = off_tangency(point.residual, point.jacobian, k, header.rows + 4 * free[k], lax, lifted.variables)
            if not off <= worst:
                worst = off
    return worst
