"""The step from an iterate: its linear system, prediction of active rows, bounds of its length."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.constraints.program.evaluate import evaluate
from assembly.constraints.program.records import header_at
from assembly.constraints.program.row_terms import add_row_terms
from assembly.solve.linear_algebra.factorize import factorize_shifted
from assembly.solve.loop.ends import find_ends, hold_ends
from assembly.solve.loop.line_search import Trust, damped_step
from assembly.solve.loop.multipliers import (
    curvature_multipliers,
    leave_out,
    let_pushing_count,
    predict_active_set,
    weigh_rows,
)
from assembly.solve.loop.parameters import (
    FORESEEN,
    FORESEEN_IN_TICKS,
    KICK,
    LEAST_SHIFT,
    NEARLY_HELD,
    SADDLE,
    SHIFT,
    TINIEST_SHIFT,
)
from assembly.solve.loop.predict import predict_pairs
from assembly.solve.loop.residuals import add_transposed, move, times


@kernel(inline=True)
def first_shift(program, restoring, shift, violation, dual):
    """The shift to try first, after the last one of `shift`: no larger than inertia needs near a solution.

    It decreases with the distance to the solution. So do the squares of the rows' slopes where rows alone count and
    become dependent at the solution; with clearances, contacts come and go instead.
    """
    least, off = LEAST_SHIFT, dual
    if restoring and violation < NEARLY_HELD and header_at(program.store.table, 0).manager_record < 0:
        least, off = max(min(SHIFT * violation, least), TINIEST_SHIFT), violation
    return max(min(0.25 * shift, off), least)


@kernel(inline=True)
def find_direction(program, current, rows, system, trust, restoring, tick):
    """Compute the step of the augmented Lagrangian at a point, into the system.

    Sets which rows are active, their forces, and which are active because the step would break them. Returns the shift
    of the matrix and that of the factor (negative if there is none), and the step's largest component and rotation.
    """
    shape, order = program.structure, program.structure.sparsity
    gradient, lagrangian, matrix = system.gradient, system.hessian, system.factor
    descent = system.directions.descent
    n = descent.size
    shift = trust.shift
    weigh_rows(rows, shape.one_sided, current.residual)
    for i in range(n):
        descent[i] = -gradient[i]
    add_transposed(shape.bases, current.jacobian, rows.count, rows.forces, descent)
    for r in range(rows.count):
        rows.foreseen[r] = 0.0
    find_ends(program, current, system.directions)
    curvature_multipliers(rows, current.residual, restoring)
    add_row_terms(program, current, rows.forces, rows.active, lagrangian)
    if not tick:
        let_pushing_count(program, current, rows, system)
    hold_ends(system)
    shift = factorize_shifted(lagrangian, n, order, shift, matrix)
    if shift < 0.0:
        return shift, shift, 0.0, 0.0
    used, longest, turn = damped_step(program, system, Trust(shift, trust.radius, trust.damps))
    fewest, rounds = rows.count + 1, FORESEEN_IN_TICKS if tick else FORESEEN
    for attempt in range(rounds + 1):
        if used < 0.0 or restoring:
            break
        wrong = predict_active_set(program, current, rows, system, fewest)
        if wrong == 0:
            break
        if not tick:
            fewest = min(fewest, wrong)
        if attempt == rounds:
            leave_out(shape, current, rows, system)
        hold_ends(system)
        shift = factorize_shifted(lagrangian, n, order, max(shift, LEAST_SHIFT), matrix)
        used = shift
        if shift >= 0.0:
            used, longest, turn = damped_step(program, system, Trust(shift, trust.radius, trust.damps))
    return shift, used, longest, turn


@kernel(inline=True)
def short_share(radius, longest, turn):
    """The share of a step within the radius, with no component of a rotation vector above one radian."""
    share = min(1.0, radius / longest) if longest > 0.0 else 1.0
    return min(share, 1.0 / turn) if turn > 0.0 else share


@kernel(inline=True)
def cut_step(shape, current, rows, system, cut):
    """Shorten the step to a share. Returns the merit's slope along it, and the largest component of the descent."""
    descent, step, straight = system.directions.descent, system.directions.step, system.directions.straight
    slope = 0.0
    steepest = 0.0
    for i in range(descent.size):
        step[i] *= cut
        straight[i] = step[i]
        slope -= descent[i] * step[i]
        steepest = max(steepest, abs(descent[i]))
    for r in range(rows.count):
        if rows.foreseen[r] == 1.0:
            # The row's part of the descent is not in the merit before the row becomes active.
            slope -= (rows.y[r] + current.residual[r] / rows.mu) * times(shape.bases, current.jacobian, r, step)
    return slope, steepest


@kernel(inline=True)
def propose(shape, current, rows, straight, alpha):
    """First-order multipliers after a share alpha of the straight step."""
    y, better_y = rows.y, rows.better_y
    for r in range(rows.count):
        better_y[r] = 0.0
        if rows.active[r] > 0.0:
            change = alpha * (times(shape.bases, current.jacobian, r, straight) + current.residual[r])
            better_y[r] = y[r] + change / rows.mu
            if shape.one_sided[r] == 1:
                better_y[r] = min(better_y[r], 0.0)


@kernel(inner=True)
def leave_saddle(program, current, trial, number, system):
    """Move the trial point a little off a saddle of the violation. Returns whether it was moved.

    Parallel axes that are to be perpendicular, for example, are at a saddle. `number` counts these moves.
    """
    store, step = program.store, system.directions.step
    n = step.size
    if not factorize_shifted(system.hessian, n, program.structure.sparsity, LEAST_SHIFT, system.factor) > SADDLE:
        return False
    for i in range(n):
        step[i] = KICK * math.sin(number + 1 + i) if i < 6 * header_at(store.table, 0).moving else 0.0
    move(store.table, current.q, step, 1.0, trial.q)
    predict_pairs(store, program.structure.bases, program.lifted, current, trial, step, 1.0)
    return evaluate(program, program.lifted.guess, math.inf, trial) < 0
