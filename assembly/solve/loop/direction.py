"""The step from a point: the system that gives it, rows foreseen to bind, how much of it may be taken."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.constraints.program.evaluate import evaluate
from assembly.constraints.program.records import header_at
from assembly.constraints.program.row_terms import add_row_terms
from assembly.solve.linear_algebra.factorize import factorize_shifted
from assembly.solve.loop.line_search import damped_step
from assembly.solve.loop.multipliers import curve_rows, leave_out, predict_active_set, weigh_rows
from assembly.solve.loop.predict import predict_pairs
from assembly.solve.loop.residuals import add_transposed, move, times

# The least shift of the Hessian; of violations alone, so much of the largest one, down to rounding. That is where rows
# gain nothing although they are off by less than CLOSE.
LEAST_SHIFT, SHIFT, TINIEST_SHIFT = 1e-8, 1e-2, 1e-13
CLOSE = 1e-6
# A step is computed so many times more for one-sided rows that it would break. Where they change places for ever, it
# is the one without them: half of an exchange may lead uphill.
FORESEEN = 12
# Where so many steps in a row that hold are cut by half and more, the next ones are damped until one is not: most of
# these may go where nothing holds, as a ring turns about its own axis.
OFTEN = 25
# Where violations are stationary, this much curvature downward makes a saddle of it; a small move leads off it, in a
# direction that nothing but a scene made for it has as a symmetry.
SADDLE, KICK = 1e-5, 1e-3


@kernel(inline=True)
def find_direction(
    program, current, rows, y, mu, shift, radius, cuts, dual, violation, restoring, is_fresh, weights, system
):
    """The step of the augmented Lagrangian at a point, into the system's lines; by the last factor unless `is_fresh`.

    `weights` gets which rows count, what they push with, and which do because the step would break them. Returns the
    shift of the matrix and that of the factor the step is by, negative where there is none; the step's largest
    component and turn.
    """
    store, shape, lifted, workspace = (
        program.store,
        program.structure,
        program.lifted,
        program.tapes,
    )
    header = header_at(store.table, 0)
    active, forces, foreseen = weights
    gradient, lines, lagrangian, matrix = system.gradient, system.directions, system.hessian, system.factor
    bases, one_sided, order = shape.bases, shape.one_sided, shape.sparsity
    descent, step, straight = lines.descent, lines.step, lines.straight
    n = descent.size
    residual, jacobian = current.residual, current.jacobian
    weigh_rows(rows, one_sided, residual, y, mu, forces, active)
    for i in range(n):
        descent[i] = -gradient[i]
    add_transposed(bases, jacobian, rows, forces, descent)
    for r in range(rows):
        foreseen[r] = 0.0
    if is_fresh:
        curve_rows(rows, residual, y, active, restoring, forces)
        add_row_terms(store, lifted, workspace, shape, current, forces, active, lagrangian)
        # What the inertia needs falls with the distance to the solution. Where rows alone count and depend on each
        # other there, the squares of their slopes do, too; contacts of a clearance come and go instead.
        least, off = LEAST_SHIFT, dual
        if restoring and violation < CLOSE and header.watch < 0:
            least, off = max(min(SHIFT * violation, least), TINIEST_SHIFT), violation
        shift = factorize_shifted(lagrangian, n, order, max(min(0.25 * shift, off), least), matrix)
        if shift < 0.0:
            return shift, shift, 0.0, 0.0
    damps = header.contacts == 0 or cuts >= OFTEN
    used, longest, turn = damped_step(
        store.table, lagrangian, n, order, shift, radius, damps, matrix, descent, step, straight
    )
    for attempt in range(FORESEEN + 1):
        if used < 0.0 or restoring:
            break
        changed = predict_active_set(
            store.table, shape, rows, residual, jacobian, y, mu, step, is_fresh, active, foreseen, descent, lagrangian
        )
        if changed == 0:
            break
        if attempt == FORESEEN:
            leave_out(shape, rows, residual, jacobian, y, mu, is_fresh, active, foreseen, descent, lagrangian)
        if not is_fresh:
            is_fresh = True
            curve_rows(rows, residual, y, active, restoring, forces)
            add_row_terms(store, lifted, workspace, shape, current, forces, active, lagrangian)
        shift = factorize_shifted(lagrangian, n, order, max(shift, LEAST_SHIFT), matrix)
        used = shift
        if shift >= 0.0:
            used, longest, turn = damped_step(
                store.table, lagrangian, n, order, shift, radius, damps, matrix, descent, step, straight
            )
    return shift, used, longest, turn


@kernel(inline=True)
def short_share(radius, longest, turn):
    """How much of a step is within the radius, and turns no body by more than a radian."""
    share = min(1.0, radius / longest) if longest > 0.0 else 1.0
    return min(share, 1.0 / turn) if turn > 0.0 else share


@kernel(inline=True)
def cut_step(shape, current, rows, y, mu, cut, foreseen, lines):
    """Shorten the step to a share. Returns the merit's slope along it, and the largest component of the descent."""
    descent, step, straight = lines.descent, lines.step, lines.straight
    slope = 0.0
    steepest = 0.0
    for i in range(descent.size):
        step[i] *= cut
        straight[i] = step[i]
        slope -= descent[i] * step[i]
        steepest = max(steepest, abs(descent[i]))
    for r in range(rows):
        if foreseen[r] == 1.0:
            # What the row adds to the descent is not in the merit before it binds.
            slope -= (y[r] + current.residual[r] / mu) * times(shape.bases, current.jacobian, r, step)
    return slope, steepest


@kernel(inline=True)
def propose(shape, current, rows, y, mu, active, straight, alpha, better_y):
    """The multipliers of first order after a share alpha of the straight step."""
    bases, one_sided = shape.bases, shape.one_sided
    for r in range(rows):
        better_y[r] = 0.0
        if active[r] > 0.0:
            better_y[r] = y[r] + alpha * (times(bases, current.jacobian, r, straight) + current.residual[r]) / mu
            if one_sided[r] == 1:
                better_y[r] = min(better_y[r], 0.0)


@kernel(inner=True)
def leave_saddle(program, current, trial, number, system):
    """A small move off a saddle of the violations, into the trial point; whether it is one.

    Of axes that are parallel and are to stand at right angles, say. `number` is how many moves there have been.
    """
    store, shape, lifted, workspace = (
        program.store,
        program.structure,
        program.lifted,
        program.tapes,
    )
    step, lagrangian, matrix = system.directions.step, system.hessian, system.factor
    n = step.size
    if not factorize_shifted(lagrangian, n, shape.sparsity, LEAST_SHIFT, matrix) > SADDLE:
        return False
    for i in range(n):
        step[i] = KICK * math.sin(number + 1 + i) if i < 6 * header_at(store.table, 0).moving else 0.0
    move(store.table, current.q, step, 1.0, trial.q)
    predict_pairs(store, shape.bases, lifted, current, trial, step, 1.0)
    return evaluate(store, lifted.guess, math.inf, lifted, workspace, trial) < 0
