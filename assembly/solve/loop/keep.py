"""What a solve leaves for the next one, beside its rows: the factor of a step's matrix at or near its end."""

from __future__ import annotations

from assembly._kernel import kernel
from assembly.constraints.program.kept import (
    EARLIER_FACTOR,
    NEW_FACTOR,
    NO_FACTOR,
    has_place,
    keep_rows,
    kept_header_at,
    kept_in,
    put_factor,
)
from assembly.constraints.program.row_terms import add_row_terms
from assembly.solve.linear_algebra.factorize import factorize_shifted
from assembly.solve.loop.inertia import note_factor
from assembly.solve.loop.line_search import goal
from assembly.solve.loop.multipliers import curvature_multipliers, weigh_rows
from assembly.solve.loop.parameters import CHORD_SHIFT, LEAST_SHIFT
from assembly.solve.loop.workspace import penalized


@kernel(inner=True)
def kept_times(bases, jacobian, r, d):
    """Row r of J d with a Jacobian that is kept, which has no columns of lifted pairs (`residuals.times`)."""
    s = 0.0
    for b in range(bases.shape[1]):
        at = bases[r, b] if b != 2 else -1
        column = 6 * b if b < 2 else 6 * (b - 1)
        if at >= 0:
            for k in range(6):
                s += jacobian[r, column + k] * d[at + k]
    return s


@kernel(inner=True)
def add_kept_transposed(bases, jacobian, rows, weights, out):
    """out += J^T weights with a Jacobian that is kept."""
    for r in range(rows):
        for b in range(bases.shape[1]):
            at = bases[r, b] if b != 2 else -1
            column = 6 * b if b < 2 else 6 * (b - 1)
            if at >= 0 and weights[r] != 0.0:
                for k in range(6):
                    out[at + k] += weights[r] * jacobian[r, column + k]


@kernel(inner=True)
def keep_factor(program, state, kept, point, rows, system):
    """Factorize the matrix of a step at a point, in the system, and keep the factor. Returns whether there is one.

    The system has the Hessian of the objective before, and that of the Lagrangian afterwards.
    """
    shape, header = program.structure, kept_header_at(state, kept.header)
    header.factor = NO_FACTOR
    curvature_multipliers(rows, point.residual, False)
    add_row_terms(program, point, rows.forces, rows.active, system.hessian)
    n = system.gradient.size
    if factorize_shifted(system.hessian, n, shape.sparsity, CHORD_SHIFT, system.factor) != CHORD_SHIFT:
        return False
    put_factor(system.factor, shape.sparsity.places[2], point.jacobian, kept)
    for r in range(rows.count):
        kept.weights[r] = rows.active[r]
    header.factor = NEW_FACTOR
    return True


@kernel(inner=True)
def test_convexity(task, rows, system, dual):
    """Write into the results whether the Lagrangian's Hessian, just computed, shows no negative curvature."""
    n, shape = system.gradient.size, task.program.structure
    shift = factorize_shifted(system.hessian, n, shape.sparsity, LEAST_SHIFT, system.factor)
    note_factor(task.results, rows, shape.one_sided, shift, dual, False)


@kernel(inline=True)
def leave(program, limits, state, point, rows, system, is_kept, is_solved):
    """Keep the rows of a point whose poses are in the state, if `is_kept`, and the factor if it is a solution."""
    store = program.store
    if not has_place(store.table, state):
        return
    kept = kept_in(store.table, state)
    header = kept_header_at(state, kept.header)
    header.has_rows = 0.0
    if not is_kept:
        header.factor = NO_FACTOR
        return
    keep_rows(store, state, kept, point)
    if not is_solved or kept.factor.shape[0] == 0:
        header.factor = NO_FACTOR
    elif header.factor == NO_FACTOR:
        header.corrected = 0.0
        rows = penalized(rows, limits.penalty_floor)
        goal(program, rows.count, point, 1, system.gradient, system.hessian)
        weigh_rows(rows, program.structure.one_sided, point.residual)
        keep_factor(program, state, kept, point, rows, system)
    if header.factor == NEW_FACTOR:
        header.factor = EARLIER_FACTOR
