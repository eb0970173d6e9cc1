"""The loop's multipliers: which rows push and how hard, and which of several proposals balances the objective best."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.constraints.layout import CONTACTS, TRIMS
from assembly.constraints.program import add_gram
from assembly.solve.linear import factorize, factorize_shifted, substitute
from assembly.solve.rows import add_row, add_transposed, clear_row, times

# Multipliers below this count for nothing against the objective's curvature, which is of order one.
WEAK = 1e-3


@kernel(inner=True)
def weigh_rows(rows, one_sided, residual, y, mu, forces, active):
    """Into active 1 / mu for the rows that count, into forces what they push with: -(y + c / mu)."""
    for r in range(rows):
        t = y[r] + residual[r] / mu
        idle = one_sided[r] == 1 and t >= 0.0
        forces[r] = 0.0 if idle else -t
        active[r] = 0.0 if idle else 1.0 / mu


@kernel(inner=True)
def foresee(table, shape, rows, residual, jacobian, y, mu, step, in_matrix, active, foreseen, descent, lagrangian):
    """Let one-sided rows count that are idle here and would push at the end of the step; those that would not, no more.

    Their sign is that of y + (c + J step) / mu. Descent changes with them, and so does the Lagrangian, if it holds the
    rows' terms (`in_matrix`). Returns how many rows changed.
    """
    bases, one_sided = shape[0], shape[1]
    changed = 0
    for r in range(rows):
        if one_sided[r] == 0 or (active[r] > 0.0 and foreseen[r] == 0.0):
            continue
        if table[CONTACTS] <= r < table[CONTACTS] + table[TRIMS]:
            # Their slopes change too fast for that.
            continue
        pushes = y[r] + (residual[r] + times(bases, jacobian, r, step)) / mu < 0.0
        if pushes == (foreseen[r] == 1.0):
            continue
        changed += 1
        sign = 1.0 if pushes else -1.0
        foreseen[r] = 1.0 if pushes else 0.0
        active[r] = 1.0 / mu if pushes else 0.0
        add_row(bases, jacobian, r, -sign * (y[r] + residual[r] / mu), descent)
        if in_matrix:
            add_gram(bases, jacobian, r, sign / mu, lagrangian)
    return changed


@kernel(inner=True)
def toward_rows(shape, rows, residual, jacobian, active, lagrangian, matrix, n, forces, out):
    """The shortest step after which the rows that bind hold to first order, into out; both matrices are overwritten."""
    bases, _one_sided, last, _last_row = shape
    for i in range(n):
        out[i] = 0.0
        for j in range(i, last[i] + 1):
            lagrangian[i, j] = 0.0
    for r in range(rows):
        forces[r] = -residual[r] * active[r]
        if active[r] > 0.0:
            add_gram(bases, jacobian, r, active[r], lagrangian)
    add_transposed(bases, jacobian, rows, forces, out)
    if factorize_shifted(lagrangian, n, last, 1.0, matrix) > 0.0:
        substitute(matrix, n, last, out)


@kernel(inner=True)
def curve_rows(rows, residual, y, active, restoring, forces):
    """Into forces the multipliers whose rows' curvature goes into the matrix."""
    most = 0.0
    for r in range(rows):
        # Far from feasible, c / mu would drown the curvature of the objective; y is what it tends to.
        forces[r] = (residual[r] if active[r] > 0.0 else 0.0) if restoring else y[r]
        most = max(most, abs(forces[r]))
    if most < WEAK:
        # Forces on their way to zero: their curvature would only spoil the inertia, and cost the fast end.
        for r in range(rows):
            forces[r] = 0.0


@kernel(inner=True)
def dual_residual(bases, jacobian, rows, one_sided, residual, gradient, y, scratch):
    """Largest component of grad f + J^T y, and of complementarity."""
    for i in range(gradient.size):
        scratch[i] = gradient[i]
    add_transposed(bases, jacobian, rows, y, scratch)
    worst = 0.0
    for i in range(gradient.size):
        if not abs(scratch[i]) <= worst:
            worst = abs(scratch[i])
    for r in range(rows):
        if one_sided[r] == 1:
            worst = max(worst, min(abs(y[r]), abs(residual[r])))
    return worst


@kernel(inner=True)
def least_squares_multipliers(bases, jacobian, rows, one_sided, active, gradient, scratch, last_row, gram, y):
    """The multipliers of the active rows that leave the smallest grad f + J^T y."""
    for i in range(gradient.size):
        scratch[i] = 0.0
    for r in range(rows):
        if active[r] > 0.0:
            add_row(bases, jacobian, r, 1.0, scratch)
        for s in range(r, last_row[r] + 1):
            gram[r, s] = times(bases, jacobian, s, scratch) if active[s] > 0.0 else 0.0
        gram[r, r] += 1e-10 if active[r] > 0.0 else 1.0
        y[r] = -times(bases, jacobian, r, gradient) if active[r] > 0.0 else 0.0
        if active[r] > 0.0:
            clear_row(bases, r, scratch)
    if factorize(gram, rows, last_row):
        substitute(gram, rows, last_row, y)
    for r in range(rows):
        if one_sided[r] == 1:
            y[r] = min(y[r], 0.0)


@kernel(inner=True)
def choose_multipliers(shape, rows, here, shortened, good, active, gradient, scratch, gram, y, better_y):
    """The better of y, of what the last step proposed, and after a shortened step of least squares; into y.

    Returns the dual residual.
    """
    bases, one_sided, _last, last_row = shape
    residual = here[3]
    jacobian = here[4]
    dual = dual_residual(bases, jacobian, rows, one_sided, residual, gradient, better_y, scratch)
    # Where they are as good as they should be, the old ones need no look.
    other = math.inf
    if dual > good:
        other = dual_residual(bases, jacobian, rows, one_sided, residual, gradient, y, scratch)
    if dual <= other:
        for r in range(rows):
            y[r] = better_y[r]
    else:
        dual = other
    if shortened:
        least_squares_multipliers(bases, jacobian, rows, one_sided, active, gradient, scratch, last_row, gram, better_y)
        other = dual_residual(bases, jacobian, rows, one_sided, residual, gradient, better_y, scratch)
        if other < dual:
            dual = other
            for r in range(rows):
                y[r] = better_y[r]
    return dual


@kernel(inner=True)
def strongest(values, count):
    """The largest of the first so many, without its sign."""
    most = 0.0
    for i in range(count):
        most = max(most, abs(values[i]))
    return most


@kernel(inner=True)
def least_multipliers(shape, rows, here, active, gradient, scratch, gram, dual, y, better_y):
    """The shortest multipliers that balance the objective, if they do so as well as y; into y. The dual residual."""
    bases, one_sided, _last, last_row = shape
    residual = here[3]
    jacobian = here[4]
    least_squares_multipliers(bases, jacobian, rows, one_sided, active, gradient, scratch, last_row, gram, better_y)
    other = dual_residual(bases, jacobian, rows, one_sided, residual, gradient, better_y, scratch)
    if other > max(10.0 * dual, 1e-11):
        return dual
    for r in range(rows):
        y[r] = better_y[r]
    return max(dual, other)
