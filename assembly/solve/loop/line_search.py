"""The step and the line search on the augmented Lagrangian.

A step that the rows' curvature spoils is bent back onto the rows, with the factorization at hand, before it is
shortened.
"""

from __future__ import annotations

from assembly._kernel import kernel
from assembly.constraints.program.contact import MAY_GO, hold_all, is_clearance_row, may_go
from assembly.constraints.program.evaluate import evaluate
from assembly.constraints.program.objective_terms import objective
from assembly.constraints.program.records import header_at
from assembly.proximity.extrema.face_face import BEND
from assembly.proximity.features.solid_contact import tracked_at
from assembly.solve.linear_algebra.factorize import factorize_shifted, forward_step, solve_step
from assembly.solve.loop.clearances import ends_unseen, is_too_far
from assembly.solve.loop.dexterity import add_dexterities
from assembly.solve.loop.predict import predict_pairs
from assembly.solve.loop.residuals import add_transposed, merit, move

# A step shorter than this decides nothing.
SHORTEST = 1e-6
# A body turns by this much at most in a step, and this often a step is shortened by a larger shift.
TURN = 1.0
SHORTENINGS = 4
# A clearance's contact that no longer step, nor one halved so far, finds again is given up.
LETS_GO, HALVED = 1e-5, 0.0625


@kernel(inner=True)
def damped_step(table, lagrangian, n, order, shift, radius, damps, matrix, descent, step, scratch):
    """The step of the factor in `matrix`, its shift raised until the step is not much longer than the radius.

    Nor may a body turn by much more than a radian. Scaled down instead, a step would lose what its stiff directions
    gain, those that bring the rows to hold. That is for who `damps`; with contacts rows change fast along the step.
    Returns the shift, and the step's largest component and turn.
    """
    for attempt in range(SHORTENINGS + 1):
        for i in range(n):
            step[i] = descent[i]
        solve_step(matrix, n, order, step)
        longest = 0.0
        turn = 0.0
        for i in range(n):
            longest = max(longest, abs(step[i]))
            if i % 6 >= 3 and i < 6 * header_at(table, 0).moving:
                turn = max(turn, abs(step[i]))
        excess = max(turn / TURN, longest / radius)
        if excess <= 1.5 or attempt == SHORTENINGS or not damps:
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
        shift = factorize_shifted(lagrangian, n, order, shift + square / slope * (excess - 1.0), matrix)
        if shift < 0.0:
            break
    return shift, longest, turn


@kernel(inner=True)
def goal(store, shape, rows, lifted, workspace, tips, point, order, gradient, hessian):
    """The objective at a point whose rows are evaluated; from order 1 on its gradient and the Hessian's upper half.

    `tips` is None where no term is a dexterity: then what these need is not even compiled.
    """
    value = objective(store, point.q, order, workspace, shape.sparsity, gradient, hessian)
    if tips is not None:
        value += add_dexterities(store, shape, rows, lifted, workspace, point, order, gradient, hessian)
    return value


@kernel(inline=True)
def search(program, tips, current, trial, rows, y, base, value, restoring, leave, mu, slope, longest, weights, system):
    """Try alpha times the step, alpha from 1 down, until the augmented Lagrangian falls enough.

    The trial point is left in `trial`. Returns whether one was accepted, alpha, and the contact lost by the last trial
    or -1. `base` is the objective's part of the merit here, `longest` the largest component of the step. The `leave`
    says whether a contact that ends where solids are in each other may be given up, and whether bodies may go all the
    way for certain.
    """
    store, shape, lifted, workspace = (
        program.store,
        program.structure,
        program.lifted,
        program.tapes,
    )
    header = header_at(store.table, 0)
    active, forces, _foreseen = weights
    lets_go, may_go_all = leave
    gradient, descent, step, straight, lagrangian, matrix = (
        system.gradient,
        system.directions.descent,
        system.directions.step,
        system.directions.straight,
        system.hessian,
        system.factor,
    )
    bases, one_sided, order = shape.bases, shape.one_sided, shape.sparsity
    n = descent.size
    residual = current.residual
    current_merit = merit(residual, one_sided, rows, y, mu) + base
    # Of the violations alone no objective rounds anything off.
    noise = 1e-14 * (abs(current_merit) + (0.0 if restoring else abs(value)) + 1e-300)
    # Rounding of the poses, of order one, is felt through the objective's slope and the rows' forces.
    for i in range(n):
        noise += 4e-16 * abs(gradient[i])
    for r in range(rows):
        noise += 4e-16 * (abs(y[r]) + abs(residual[r]) / mu)
    alpha = 1.0
    bends = 0
    lost = -1
    while alpha * longest > 1e-9 * SHORTEST or alpha == 1.0:
        move(store.table, current.q, step, alpha, trial.q)
        predict_pairs(store, bases, lifted, current, trial, step, alpha)
        known = may_go_all and alpha == 1.0 and bends == 0
        if header.watch >= 0 and not known and is_too_far(store, lifted.memory, trial):
            # Bent, it would go farther than is known to be free.
            bends = 2
            alpha *= 0.5
            continue
        lost = evaluate(store, lifted.guess, BEND, lifted, workspace, trial)
        if header.watch >= 0 and not lets_go and lost < 0 and ends_unseen(store, lifted.memory, current, trial):
            # A tick has no last look, which would tell of what it led through.
            bends = 2
            alpha *= 0.5
            continue
        if lost < 0:
            there = merit(trial.residual, one_sided, rows, y, mu)
            if not restoring:
                there += goal(store, shape, rows, lifted, workspace, tips, trial, 0, gradient, lagrangian)
            if there <= current_merit + 1e-4 * alpha * slope + noise:
                return True, alpha, lost
            if bends < 2:
                bends += 1
                for i in range(n):
                    descent[i] = 0.0
                for r in range(rows):
                    forces[r] = -(trial.residual[r] - (1.0 - alpha) * residual[r]) * active[r]
                add_transposed(bases, current.jacobian, rows, forces, descent)
                solve_step(matrix, n, order, descent)
                for i in range(n):
                    step[i] += descent[i] / alpha
                continue
            if bends == 2:
                bends = 3
                for i in range(n):
                    step[i] = straight[i]
        # A bent step may be longer than it was.
        short = lets_go and bends % 3 == 0 and alpha <= HALVED and alpha * longest < LETS_GO
        if (
            lost >= 0
            and short
            and may_go(store.table, lost, residual)
            and tracked_at(current.tracked, lost).stays >= 0.0
        ):
            tracked_at(current.tracked, lost).stays = MAY_GO - tracked_at(current.tracked, lost).stays
            continue
        alpha *= 0.5
        # A pair near a fold is freed; a clearance's is given up where its gap does not close.
        if lost >= 0 and alpha * longest < 0.01 and not is_clearance_row(store.table, lost):
            break
    hold_all(store.table, current.tracked)
    return False, alpha, lost
