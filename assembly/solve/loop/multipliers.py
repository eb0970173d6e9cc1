"""The loop's multipliers: which rows push and how hard, and which of several proposals balances the objective best."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.constraints.program.envelope import clear_upper
from assembly.constraints.program.records import header_at
from assembly.constraints.program.row_terms import add_square
from assembly.solve.linear_algebra.factorize import factorize, factorize_shifted, solve_step, substitute
from assembly.solve.loop.residuals import add_row, add_transposed, clear_row, times

# So often a step back onto rows is computed again for one-sided rows that would hold without it; for those that it
# breaks it is as often as there are any. A row pulls that ends above this part of what it is off.
RELEASES, PULLS = 4, 1e-12
# What such a step is weighed with: one, and less where it would leave more than this part of the violations, because
# the rows all but depend on each other.
LEFT_OVER, SOFTER, SOFTEST = 0.1, 1e-3, 1e-9
# Multipliers below this count for nothing against the objective's curvature, which is of order one.
WEAK = 1e-3
# Multipliers this much stronger than the objective's slope are looked at once more.
EXCESS = 10.0
# One-sided rows that hold by less than this may push; so often they are exchanged for those that would pull, and after
# so many rounds that gain nothing one at a time. A row is wanted that would take more than this off the objective's
# slope. Their least squares are refined so often.
NEAR, EXCHANGES, BLOCKED, WANTED, ROUNDS = 1e-9, 40, 3, 1e-12, 3


@kernel(inner=True)
def weigh_rows(rows, one_sided, residual, y, mu, forces, active):
    """Into active 1 / mu for the rows that count, into forces what they push with: -(y + c / mu)."""
    for r in range(rows):
        t = y[r] + residual[r] / mu
        idle = one_sided[r] == 1 and t >= 0.0
        forces[r] = 0.0 if idle else -t
        active[r] = 0.0 if idle else 1.0 / mu


@kernel(inline=True)
def let_count(shape, r, counts, residual, jacobian, y, mu, in_matrix, active, foreseen, descent, lagrangian):
    """Let row r, which is idle here, count in the step, or no more.

    Descent changes with it, and so does the Lagrangian, if it holds the rows' terms (`in_matrix`).
    """
    sign = 1.0 if counts else -1.0
    foreseen[r] = 1.0 if counts else 0.0
    active[r] = 1.0 / mu if counts else 0.0
    add_row(shape.bases, jacobian, r, -sign * (y[r] + residual[r] / mu), descent)
    if in_matrix:
        add_square(shape.sparsity, shape.bases, jacobian, r, sign / mu, lagrangian)


@kernel(inner=True)
def predict_active_set(
    table, shape, rows, residual, jacobian, y, mu, step, in_matrix, active, foreseen, descent, lagrangian
):
    """Let one-sided rows count that are idle here and would push at the end of the step; those that would not, no more.

    Their sign is that of y + (c + J step) / mu. Returns how many rows changed.
    """
    header = header_at(table, 0)
    bases, one_sided = shape.bases, shape.one_sided
    changed = 0
    for r in range(rows):
        if one_sided[r] == 0 or (active[r] > 0.0 and foreseen[r] == 0.0):
            continue
        if header.contacts <= r < header.contacts + header.trims:
            # Their slopes change too fast for that.
            continue
        pushes = y[r] + (residual[r] + times(bases, jacobian, r, step)) / mu < 0.0
        if pushes != (foreseen[r] == 1.0):
            changed += 1
            let_count(shape, r, pushes, residual, jacobian, y, mu, in_matrix, active, foreseen, descent, lagrangian)
    return changed


@kernel(inner=True)
def leave_out(shape, rows, residual, jacobian, y, mu, in_matrix, active, foreseen, descent, lagrangian):
    """No row that is idle here counts in the step."""
    for r in range(rows):
        if foreseen[r] == 1.0:
            let_count(shape, r, False, residual, jacobian, y, mu, in_matrix, active, foreseen, descent, lagrangian)


@kernel(inner=True)
def toward_rows(shape, m, rows, residual, jacobian, mu, active, softness, enough, lagrangian, matrix, n, forces, out):
    """The shortest step after which rows hold to first order, into out; both matrices are overwritten.

    One-sided rows that hold count where it would break them by more than `enough`, and none does that it would pull
    back: to bring such rows to zero is to ask for more than they do, and where they all but depend on others, for a
    long step. Where those that count do so, too, `softness` weighs its square against theirs. What it leaves of the
    first `m` by that, those of the program, is to be a small part or at most `enough`: the softness falls until it is.
    Returns the softness.
    """
    bases, one_sided, order = shape.bases, shape.one_sided, shape.sparsity
    for r in range(rows):
        active[r] = 0.0 if one_sided[r] == 1 and residual[r] >= 0.0 else 1.0 / mu
    releases = 0
    while True:
        for i in range(n):
            out[i] = 0.0
        clear_upper(order, n, lagrangian)
        for r in range(rows):
            forces[r] = -residual[r] * active[r]
            if active[r] > 0.0:
                add_square(order, bases, jacobian, r, active[r], lagrangian)
        add_transposed(bases, jacobian, rows, forces, out)
        if factorize_shifted(lagrangian, n, order, softness, matrix) > 0.0:
            solve_step(matrix, n, order, out)
        worst = 0.0
        left = 0.0
        broken = False
        pulled = False
        for r in range(rows):
            there = residual[r] + times(bases, jacobian, r, out)
            if active[r] == 0.0:
                if there < -enough:
                    active[r] = 1.0 / mu
                    broken = True
            elif one_sided[r] == 1 and there > PULLS * abs(residual[r]) and releases < RELEASES:
                active[r] = 0.0
                pulled = True
            elif r < m:
                worst = max(worst, abs(residual[r]))
                left = max(left, abs(there))
        if pulled:
            releases += 1
        elif not broken:
            if left <= max(LEFT_OVER * worst, enough) or softness <= SOFTEST:
                return softness
            softness = max(SOFTER * softness, SOFTEST)


@kernel(inner=True)
def curve_rows(rows, residual, y, active, restoring, forces):
    """Into forces the multipliers whose rows' curvature goes into the matrix."""
    most = 0.0
    for r in range(rows):
        # Far from feasible, c / mu would drown the curvature of the objective; y is what it tends to.
        forces[r] = (residual[r] if active[r] > 0.0 else 0.0) if restoring else y[r]
        most = max(most, abs(forces[r]))
    if most < WEAK and not restoring:
        # Forces on their way to zero: their curvature would only spoil the inertia, and cost the fast end. What is left
        # of violations that cannot all vanish does not go to zero.
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
def least_squares_multipliers(bases, jacobian, rows, active, rounds, gradient, scratch, of_rows, gram, y):
    """The multipliers of the active rows, of either sign, that leave the smallest grad f + J^T y.

    After the first round it is again for what that 1e-10 leaves, where rows all but depend on each other; where they do
    so altogether every round adds rounding to what nothing determines. The last row of `gram` is room for the right
    side.
    """
    sequence, last_row = of_rows
    side = gram[gram.shape[0] - 1]
    for i in range(gradient.size):
        scratch[i] = 0.0
    for k in range(rows):
        r = sequence[k]
        if active[r] > 0.0:
            add_row(bases, jacobian, r, 1.0, scratch)
        for l in range(k, last_row[k] + 1):
            s = sequence[l]
            gram[k, l] = times(bases, jacobian, s, scratch) if active[s] > 0.0 else 0.0
        gram[k, k] += 1e-10 if active[r] > 0.0 else 1.0
        if active[r] > 0.0:
            clear_row(bases, r, scratch)
        y[r] = 0.0
    if not factorize(gram, rows, last_row):
        return
    for _ in range(rounds):
        for i in range(gradient.size):
            scratch[i] = gradient[i]
        add_transposed(bases, jacobian, rows, y, scratch)
        for k in range(rows):
            r = sequence[k]
            side[k] = -times(bases, jacobian, r, scratch) if active[r] > 0.0 else 0.0
        substitute(gram, rows, last_row, side)
        for k in range(rows):
            y[sequence[k]] += side[k]


@kernel(inner=True)
def exchange(bases, jacobian, rows, one_sided, residual, active, gradient, scratch, y, most):
    """Let one-sided rows that pull count no more, and those count that are near and would balance more, the last first.

    `most` of them at most. Returns how many there are.
    """
    for i in range(gradient.size):
        scratch[i] = gradient[i]
    add_transposed(bases, jacobian, rows, y, scratch)
    found = 0
    for r in range(rows - 1, -1, -1):
        if one_sided[r] == 0:
            continue
        pulls = active[r] > 0.0 and y[r] > 0.0
        wanted = active[r] == 0.0 and abs(residual[r]) <= NEAR and times(bases, jacobian, r, scratch) > WANTED
        if pulls or wanted:
            found += 1
            if found <= most:
                active[r] = 1.0 if wanted else 0.0
    return found


@kernel(inner=True)
def pushing_multipliers(shape, rows, residual, jacobian, active, exchanges, rounds, gradient, scratch, gram, y):
    """Multipliers of least squares, none of which pulls: with so many exchanges of the active rows at most.

    Where rows depend on each other, it takes some of them only, and which these are is not known from the gaps. All
    that are wrong are exchanged at once as long as they become fewer (block pivoting, Portugal, Judice and Vicente
    1994); what still pulls in the end is set to zero.
    """
    bases, one_sided, of_rows = shape.bases, shape.one_sided, shape.row_order
    fewest = rows + 1
    patience = BLOCKED
    for k in range(exchanges + 1):
        least_squares_multipliers(bases, jacobian, rows, active, rounds, gradient, scratch, of_rows, gram, y)
        if k == exchanges:
            break
        found = exchange(
            bases, jacobian, rows, one_sided, residual, active, gradient, scratch, y, rows if patience > 0 else 1
        )
        if found == 0:
            break
        if found < fewest:
            fewest = found
            patience = BLOCKED
        else:
            patience -= 1
    for r in range(rows):
        if one_sided[r] == 1:
            y[r] = min(y[r], 0.0)


@kernel(inline=True)
def choose_multipliers(
    shape, rows, current, shortened, vectors, holds, good, active, gradient, scratch, gram, y, better_y
):
    """The better of y, of what the last step proposed, and of least squares, into y.

    These are for after a shortened step, and for where rows hold and neither of the others is good: it depends on which
    rows push then. There, and with rows of `vectors`, they are refined. Returns the dual residual.
    """
    bases, one_sided = shape.bases, shape.one_sided
    residual = current.residual
    jacobian = current.jacobian
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
    if shortened or (holds and dual > good):
        exchanges = EXCHANGES if holds and dual > good else 0
        rounds = ROUNDS if exchanges > 0 or vectors else 1
        pushing_multipliers(
            shape, rows, residual, jacobian, active, exchanges, rounds, gradient, scratch, gram, better_y
        )
        other = dual_residual(bases, jacobian, rows, one_sided, residual, gradient, better_y, scratch)
        if other < dual:
            dual = other
            for r in range(rows):
                y[r] = better_y[r]
    return dual


@kernel(inner=True)
def forget_objective(order, rows, y, gradient, lagrangian):
    """No objective and no multipliers: where rows cannot all hold, what is left is to violate them least."""
    for r in range(rows):
        y[r] = 0.0
    for i in range(gradient.size):
        gradient[i] = 0.0
    clear_upper(order, gradient.size, lagrangian)


@kernel(inner=True)
def strongest(values, count):
    """The largest of the first so many, without its sign."""
    most = 0.0
    for i in range(count):
        most = max(most, abs(values[i]))
    return most


@kernel(inner=True)
def least_multipliers(shape, rows, current, active, gradient, scratch, gram, dual, y, better_y):
    """The shortest multipliers that balance the objective, if they do so as well as y; into y. The dual residual.

    They are for y much stronger than the objective's slope: of rows that depend on each other.
    """
    if not strongest(y, rows) > EXCESS * strongest(gradient, gradient.size):
        return dual
    bases, one_sided = shape.bases, shape.one_sided
    residual = current.residual
    jacobian = current.jacobian
    pushing_multipliers(shape, rows, residual, jacobian, active, 0, 1, gradient, scratch, gram, better_y)
    other = dual_residual(bases, jacobian, rows, one_sided, residual, gradient, better_y, scratch)
    if other > max(10.0 * dual, 1e-11):
        return dual
    for r in range(rows):
        y[r] = better_y[r]
    return max(dual, other)


@kernel(inner=True)
def multipliers_at(shape, rows, point, active, gradient, scratch, gram, y):
    """Multipliers of least squares at a point that may be no extremum, of rows that touch there. The dual residual."""
    bases, one_sided = shape.bases, shape.one_sided
    residual = point.residual
    jacobian = point.jacobian
    for r in range(rows):
        active[r] = 1.0 if one_sided[r] == 0 or residual[r] <= NEAR else 0.0
    pushing_multipliers(shape, rows, residual, jacobian, active, EXCHANGES, ROUNDS, gradient, scratch, gram, y)
    return dual_residual(bases, jacobian, rows, one_sided, residual, gradient, y, scratch)
