"""Multipliers: which rows push and how hard, and which of several candidates balances the objective best."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.constraints.program.envelope import clear_upper
from assembly.constraints.program.records import header_at
from assembly.constraints.program.row_terms import add_square
from assembly.solve.linear_algebra.factorize import factorize, factorize_shifted, solve_step, substitute
from assembly.solve.loop.parameters import (
    BLOCKED,
    EXCHANGES,
    LEFT_OVER,
    NEAR,
    PULLS,
    RELEASES,
    ROUNDS,
    SOFTER,
    SOFTEST,
    WANTED,
    WEAK,
)
from assembly.solve.loop.residuals import NOT_ORDERED, add_row, add_transposed, clear_row, order_rows, times


@kernel(inner=True)
def weigh_rows(rows, one_sided, residual):
    """Write 1 / mu into `active` for active rows, and their forces -(y + c / mu) into `forces`."""
    for r in range(rows.count):
        t = rows.y[r] + residual[r] / rows.mu
        idle = one_sided[r] == 1 and t >= 0.0
        rows.forces[r] = 0.0 if idle else -t
        rows.active[r] = 0.0 if idle else 1.0 / rows.mu


@kernel(inline=True)
def let_count(shape, r, counts, point, rows, system):
    """Make row r, which is idle here, active in the step, or inactive again: in the descent and in the Lagrangian."""
    mu, jacobian = rows.mu, point.jacobian
    sign = 1.0 if counts else -1.0
    rows.foreseen[r] = 1.0 if counts else 0.0
    rows.active[r] = 1.0 / mu if counts else 0.0
    add_row(shape.bases, jacobian, r, -sign * (rows.y[r] + point.residual[r] / mu), system.directions.descent)
    add_square(shape.sparsity, shape.bases, jacobian, r, sign / mu, system.hessian)


@kernel(inline=True)
def is_trim(table, r):
    """Whether row r is of a trim. Its slope changes too fast for a prediction."""
    header = header_at(table, 0)
    return header.contacts <= r < header.contacts + header.trims


@kernel(inner=True)
def let_pushing_count(program, point, rows, system):
    """Make one-sided rows active that have a multiplier but a gap, by which c / mu outweighs it.

    Bodies that slide over each other part by the square of a step. The rows are active until `predict_active_set` finds
    that they do not push at the end of the step.
    """
    shape = program.structure
    for r in range(rows.count):
        is_idle = shape.one_sided[r] == 1 and rows.active[r] == 0.0
        if is_idle and rows.y[r] < 0.0 and not is_trim(program.store.table, r):
            let_count(shape, r, True, point, rows, system)


@kernel(inline=True)
def is_foreseen_wrong(program, point, rows, system, r):
    """Whether row r, one-sided and idle here, would push at the end of the step and is not foreseen to, or other way.

    The sign is that of y + (c + J step) / mu.
    """
    shape, foreseen = program.structure, rows.foreseen[r] == 1.0
    if shape.one_sided[r] == 0 or (rows.active[r] > 0.0 and not foreseen) or is_trim(program.store.table, r):
        return False
    there = point.residual[r] + times(shape.bases, point.jacobian, r, system.directions.step)
    return (rows.y[r] + there / rows.mu < 0.0) != foreseen


@kernel(inner=True)
def predict_active_set(program, point, rows, system, fewest):
    """Foresee rows that are idle here and would push at the end of the step, and no longer those that would not.

    Returns how many were wrong. If `fewest` or more were, the first of them alone changes: all of them at once may
    change places for ever where rows depend on each other, one at a time in a fixed order agree in the end, because the
    matrix is positive (Murty's least-index method for linear complementarity).
    """
    wrong = 0
    for r in range(rows.count):
        wrong += 1 if is_foreseen_wrong(program, point, rows, system, r) else 0
    left = wrong if wrong < fewest else 1
    for r in range(rows.count):
        if left > 0 and is_foreseen_wrong(program, point, rows, system, r):
            let_count(program.structure, r, rows.foreseen[r] == 0.0, point, rows, system)
            left -= 1
    return wrong


@kernel(inner=True)
def leave_out(shape, point, rows, system):
    """Make the rows inactive again that are active only by prediction."""
    for r in range(rows.count):
        if rows.foreseen[r] == 1.0:
            let_count(shape, r, False, point, rows, system)


@kernel(inner=True)
def toward_rows(program, point, rows, system, softness, enough):
    """The shortest step after which rows hold to first order, into the system, whose matrices are overwritten.

    One-sided rows that hold are active if the step would break them by more than `enough`, and none is that the step
    would pull back: to bring such rows to zero would require more than they do, and a long step where they nearly
    depend on others. Where active rows nearly depend on each other, `softness` weighs the square of the step against
    their residuals. The residuals that remain are to be a small part or at most `enough`: the softness is lowered until
    they are. Returns the softness.
    """
    shape, residual, jacobian = program.structure, point.residual, point.jacobian
    bases, one_sided, order = shape.bases, shape.one_sided, shape.sparsity
    mu, active, forces = rows.mu, rows.active, rows.forces
    lagrangian, matrix, out = system.hessian, system.factor, system.directions.step
    m, n = header_at(program.store.table, 0).rows, out.size
    for r in range(rows.count):
        active[r] = 0.0 if one_sided[r] == 1 and residual[r] >= 0.0 else 1.0 / mu
    releases = 0
    while True:
        for i in range(n):
            out[i] = 0.0
        clear_upper(order, n, lagrangian)
        for r in range(rows.count):
            forces[r] = -residual[r] * active[r]
            if active[r] > 0.0:
                add_square(order, bases, jacobian, r, active[r], lagrangian)
        add_transposed(bases, jacobian, rows.count, forces, out)
        if factorize_shifted(lagrangian, n, order, softness, matrix) > 0.0:
            solve_step(matrix, n, order, out)
        worst = 0.0
        left = 0.0
        broken = False
        pulled = False
        for r in range(rows.count):
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
def curvature_multipliers(rows, residual, restoring):
    """Write into `forces` the multipliers whose rows' curvature goes into the matrix."""
    forces = rows.forces
    most = 0.0
    for r in range(rows.count):
        # Far from feasible, c / mu would hide the curvature of the objective; y is its limit.
        forces[r] = (residual[r] if rows.active[r] > 0.0 else 0.0) if restoring else rows.y[r]
        most = max(most, abs(forces[r]))
    if most < WEAK and not restoring:
        # The curvature of forces that tend to zero would only spoil the inertia and fast convergence. Forces of
        # violations that cannot all vanish do not tend to zero.
        for r in range(rows.count):
            forces[r] = 0.0


@kernel(inline=True)
def write_slope(shape, point, rows, system, y):
    """The Lagrangian's slope, grad f + J^T y, into the array of the descent."""
    slope = system.directions.descent
    for i in range(slope.size):
        slope[i] = system.gradient[i]
    add_transposed(shape.bases, point.jacobian, rows.count, y, slope)


@kernel(inner=True)
def dual_residual(shape, point, rows, system, y):
    """Largest component of grad f + J^T y, and of complementarity."""
    write_slope(shape, point, rows, system, y)
    slope = system.directions.descent
    worst = 0.0
    for i in range(slope.size):
        if not abs(slope[i]) <= worst:
            worst = abs(slope[i])
    for r in range(rows.count):
        if shape.one_sided[r] == 1:
            worst = max(worst, min(abs(y[r]), abs(point.residual[r])))
    return worst


@kernel(inner=True)
def least_squares_multipliers(shape, point, rows, system, rounds, y):
    """The multipliers of the active rows, of either sign, that leave the smallest grad f + J^T y.

    J J^T + 1e-10 I is factorized. Further rounds refine what the 1e-10 leaves where rows nearly depend on each other;
    where they depend on each other exactly, every round adds rounding to an undetermined part. The last row of `gram`
    is workspace for the right side.
    """
    bases, jacobian, active = shape.bases, point.jacobian, rows.active
    gram, count, scratch = rows.gram, rows.count, system.directions.descent
    sequence, last_row = shape.row_order
    if count > 0 and sequence[0] == NOT_ORDERED:
        order_rows(shape, count, system.gradient.size)
    side = gram[gram.shape[0] - 1]
    for i in range(scratch.size):
        scratch[i] = 0.0
    for k in range(count):
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
    if not factorize(gram, count, last_row):
        return
    for _ in range(rounds):
        write_slope(shape, point, rows, system, y)
        for k in range(count):
            r = sequence[k]
            side[k] = -times(bases, jacobian, r, scratch) if active[r] > 0.0 else 0.0
        substitute(gram, count, last_row, side)
        for k in range(count):
            y[sequence[k]] += side[k]


@kernel(inner=True)
def exchange(shape, point, rows, system, y, most):
    """Make one-sided rows that pull inactive, and those active that are near their bound and would balance more.

    At most `most` rows are changed, the last ones first. Returns how many there are to change.
    """
    active, slope = rows.active, system.directions.descent
    write_slope(shape, point, rows, system, y)
    found = 0
    for r in range(rows.count - 1, -1, -1):
        if shape.one_sided[r] == 0:
            continue
        pulls = active[r] > 0.0 and y[r] > 0.0
        near = active[r] == 0.0 and abs(point.residual[r]) <= NEAR
        wanted = near and times(shape.bases, point.jacobian, r, slope) > WANTED
        if pulls or wanted:
            found += 1
            if found <= most:
                active[r] = 1.0 if wanted else 0.0
    return found


@kernel(inner=True)
def pushing_multipliers(shape, point, rows, system, exchanges, rounds, y):
    """Least-squares multipliers, none of which pulls, with a limited number of exchanges of active rows.

    Where rows are dependent only some of them push, and gaps do not tell which. All wrong ones are exchanged at once as
    long as they become fewer (block pivoting, Portugal, Judice and Vicente 1994); what still pulls in the end is set to
    zero.
    """
    fewest = rows.count + 1
    patience = BLOCKED
    for k in range(exchanges + 1):
        least_squares_multipliers(shape, point, rows, system, rounds, y)
        if k == exchanges:
            break
        found = exchange(shape, point, rows, system, y, rows.count if patience > 0 else 1)
        if found == 0:
            break
        if found < fewest:
            fewest = found
            patience = BLOCKED
        else:
            patience -= 1
    for r in range(rows.count):
        if shape.one_sided[r] == 1:
            y[r] = min(y[r], 0.0)


@kernel(inline=True)
def take_better(rows):
    """Make the proposed multipliers those of the iterate."""
    for r in range(rows.count):
        rows.y[r] = rows.better_y[r]


@kernel(inline=True)
def choose_multipliers(shape, point, rows, system, shortened, vectors, holds, good):
    """Choose the best of y, the multipliers proposed by the last step, and least squares, into y.

    Least squares are computed after a `shortened` step, and where rows hold (`holds`) but the best of the others leaves
    a dual residual above `good`: the active set may be wrong, and one-sided rows are exchanged. In the latter case, and
    with vector trims (`vectors`), they are refined. Returns the dual residual.
    """
    dual = dual_residual(shape, point, rows, system, rows.better_y)
    # If the proposed multipliers are good enough, the old ones are not compared.
    other = dual_residual(shape, point, rows, system, rows.y) if dual > good else math.inf
    if dual <= other:
        take_better(rows)
    else:
        dual = other
    if shortened or (holds and dual > good):
        exchanges = EXCHANGES if holds and dual > good else 0
        rounds = ROUNDS if exchanges > 0 or vectors else 1
        pushing_multipliers(shape, point, rows, system, exchanges, rounds, rows.better_y)
        other = dual_residual(shape, point, rows, system, rows.better_y)
        if other < dual:
            dual = other
            take_better(rows)
    return dual


@kernel(inner=True)
def forget_objective(order, rows, system):
    """No objective and no multipliers: if rows cannot all hold, they are to be violated least."""
    for r in range(rows.count):
        rows.y[r] = 0.0
    for i in range(system.gradient.size):
        system.gradient[i] = 0.0
    clear_upper(order, system.gradient.size, system.hessian)


@kernel(inner=True)
def strongest(values, count):
    """The largest absolute value among the first `count`."""
    most = 0.0
    for i in range(count):
        most = max(most, abs(values[i]))
    return most


@kernel(inner=True)
def multipliers_at(shape, point, rows, system):
    """Least-squares multipliers of the rows that touch at a point, which need not be an extremum.

    Returns the dual residual.
    """
    for r in range(rows.count):
        rows.active[r] = 1.0 if shape.one_sided[r] == 0 or point.residual[r] <= NEAR else 0.0
    pushing_multipliers(shape, point, rows, system, EXCHANGES, ROUNDS, rows.y)
    return dual_residual(shape, point, rows, system, rows.y)
