"""The step and the line search on the augmented Lagrangian.

Before a step that fails because of the rows' curvature is shortened, it is bent with the present factor (the
second-order correction): to where the rows hold, and if that is too far, to the residuals that its linear model
predicts.
"""

from __future__ import annotations

from collections import namedtuple

from assembly._address import call_address
from assembly._kernel import kernel
from assembly.constraints.program.contact import MAY_GO, hold_all, is_clearance_row, may_go
from assembly.constraints.program.evaluate import evaluate
from assembly.constraints.program.objective_terms import objective
from assembly.constraints.program.records import header_at
from assembly.proximity.extrema.face_face import BEND
from assembly.proximity.features.solid_contact import tracked_at
from assembly.solve.linear_algebra.factorize import factorize_shifted, forward_step
from assembly.solve.loop.clearances import ends_unseen, is_too_far
from assembly.solve.loop.dexterity import add_dexterities
from assembly.solve.loop.ends import solve_within
from assembly.solve.loop.parameters import BENT, HALVED, LARGEST_TURN, LETS_GO, SHORTENINGS, SHORTEST, TO_ROWS
from assembly.solve.loop.predict import predict_pairs
from assembly.solve.loop.residuals import add_transposed, merit, move, times

# How the length of a step is limited: the shift of the Hessian, the largest length, whether the shift is raised for it.
Trust = namedtuple("Trust", "shift radius damps")
# What is known of a step: the merit's slope, the step's largest component; whether a contact that ends where solids
# overlap may be given up, and whether motion bounds cover the whole step.
Line = namedtuple("Line", "slope longest lets_go is_free")


@kernel(inner=True)
def damped_step(program, system, trust):
    """The step of the system's factor, its shift raised until the step is not much longer than the radius.

    Nor may a body turn by much more than a radian. Scaling the step instead would also shorten its stiff directions,
    which bring the rows to hold. The shift is raised only if `damps`: with contacts rows change fast along the step.
    Returns the shift, and the step's largest component and rotation.
    """
    order, matrix = program.structure.sparsity, system.factor
    descent, step, scratch = system.directions.descent, system.directions.step, system.directions.straight
    n, turning = step.size, 6 * header_at(program.store.table, 0).moving
    shift = trust.shift
    for attempt in range(SHORTENINGS + 1):
        for i in range(n):
            step[i] = descent[i]
        solve_within(system, order, step)
        longest = 0.0
        turn = 0.0
        for i in range(n):
            longest = max(longest, abs(step[i]))
            if i % 6 >= 3 and i < turning:
                turn = max(turn, abs(step[i]))
        excess = max(turn / LARGEST_TURN, longest / trust.radius)
        if excess <= 1.5 or attempt == SHORTENINGS or not trust.damps:
            break
        # Newton's method on 1 / |step|, whose slope is |U^-T step|^2.
        for i in range(n):
            scratch[i] = step[i]
        forward_step(matrix, n, order, scratch)
        square = 0.0
        slope = 0.0
        for i in range(n):
            square += step[i] * step[i]
            slope += scratch[i] * scratch[i]
        shift = factorize_shifted(system.hessian, n, order, shift + square / slope * (excess - 1.0), matrix)
        if shift < 0.0:
            break
    return shift, longest, turn


@kernel(inline=True)
def dexterities_at(end_effectors, program, count, point, order, gradient, hessian):
    """Dexterity terms of the objective; none if `end_effectors` is None, whose kernels are then not compiled."""
    return 0.0 if end_effectors is None else add_dexterities(program, count, point, order, gradient, hessian)


@kernel(inner=True)
def goal(program, count, point, order, gradient, hessian):
    """The objective where `count` rows are evaluated; from order 1 on its gradient and the Hessian's upper half."""
    shape = program.structure
    value = objective(program.store, point.q, order, program.tapes, shape.sparsity, gradient, hessian)
    address = header_at(program.store.table, 0).place_terms_address
    if address != 0:
        lifted = program.lifted
        call_address(address, (program.store, lifted, shape.bases, point, order, gradient, hessian))
        value += lifted.variables[0, 0]
    return value + dexterities_at(program.end_effectors, program, count, point, order, gradient, hessian)


@kernel(inline=True)
def rounding_of(rows, residual, gradient, size):
    """The rounding of a merit of this size: its own, and that of poses of order one, times gradient and forces."""
    noise = 1e-14 * (size + 1e-300)
    for i in range(gradient.size):
        noise += 4e-16 * abs(gradient[i])
    for r in range(rows.count):
        noise += 4e-16 * (abs(rows.y[r]) + abs(residual[r]) / rows.mu)
    return noise


@kernel(inline=True)
def bend_step(shape, current, trial, rows, system, alpha, promised):
    """Bend a step, a share alpha of which leads to the trial point, with the present factor (second-order correction).

    It is bent to where rows hold, or if `promised` to the residuals that the linear model of the straight step
    predicts.
    """
    descent, step = system.directions.descent, system.directions.step
    residual, active, forces = current.residual, rows.active, rows.forces
    for i in range(step.size):
        descent[i] = 0.0
    for r in range(rows.count):
        left = (1.0 - alpha) * residual[r]
        if promised:
            left = residual[r] + alpha * times(shape.bases, current.jacobian, r, system.directions.straight)
        forces[r] = -(trial.residual[r] - left) * active[r]
    add_transposed(shape.bases, current.jacobian, rows.count, forces, descent)
    solve_within(system, shape.sparsity, descent)
    for i in range(step.size):
        step[i] += descent[i] / alpha


@kernel(inline=True)
def search_line(program, current, trial, rows, system, line, value, restoring):
    """Try alpha times the step, alpha from 1 down, until the augmented Lagrangian decreases enough.

    The trial point is left in `trial`. Returns whether one was accepted, alpha, and the contact lost by the last trial
    or -1. `value` is the objective here, which counts unless rows alone do (`restoring`).
    """
    store, shape, lifted = program.store, program.structure, program.lifted
    header = header_at(store.table, 0)
    step, straight, longest = system.directions.step, system.directions.straight, line.longest
    residual = current.residual
    current_merit = merit(residual, shape.one_sided, rows) + (0.0 if restoring else value)
    # If violations alone count, there is no rounding of an objective.
    size = abs(current_merit) + (0.0 if restoring else abs(value))
    noise = rounding_of(rows, residual, system.gradient, size)
    alpha = 1.0
    bends = 0
    lost = -1
    while alpha * longest > 1e-9 * SHORTEST or alpha == 1.0:
        move(store.table, current.q, step, alpha, trial.q)
        predict_pairs(store, shape.bases, lifted, current, trial, step, alpha)
        known = line.is_free and alpha == 1.0 and bends % 3 == 0
        if header.manager_record >= 0 and not known and is_too_far(store, lifted.memory, trial):
            # The bent step would exceed motion bounds.
            bends = BENT
            alpha *= 0.5
            continue
        lost = evaluate(program, lifted.guess, BEND, trial)
        if (
            header.manager_record >= 0
            and not line.lets_go
            and lost < 0
            and ends_unseen(store, lifted.memory, current, trial)
        ):
            # A tick has no final update, which would detect what it passed through.
            bends = BENT
            alpha *= 0.5
            continue
        if lost < 0:
            there = merit(trial.residual, shape.one_sided, rows)
            if not restoring:
                there += goal(program, rows.count, trial, 0, system.gradient, system.hessian)
            if there <= current_merit + 1e-4 * alpha * line.slope + noise:
                return True, alpha, lost
            bends = min(bends + 1, BENT + 1)
            if bends % 3 == 0:
                for i in range(step.size):
                    step[i] = straight[i]
            else:
                bend_step(shape, current, trial, rows, system, alpha, bends > TO_ROWS)
            if bends <= BENT:
                continue
        # A bent step may be longer than the straight one.
        short = line.lets_go and bends % 3 == 0 and alpha <= HALVED and alpha * longest < LETS_GO
        if lost >= 0 and short and may_go(store.table, lost, residual):
            pair = tracked_at(current.tracked, lost)
            if pair.stays >= 0.0:
                pair.stays = MAY_GO - pair.stays
                continue
        alpha *= 0.5
        # A pair near a fold is lifted; a clearance's pair is given up if its gap does not close.
        if lost >= 0 and alpha * longest < 0.01 and not is_clearance_row(store.table, lost):
            break
    hold_all(store.table, current.tracked)
    return False, alpha, lost
