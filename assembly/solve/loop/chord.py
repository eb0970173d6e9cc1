"""The first steps of a solve from a solution: chord steps with the factor that the last solve left.

With A and W the Jacobian and the weights (1 / mu) of the active rows at the pose where the factor was computed,

    (H + d I + A^T W A) dx = -(grad f + J^T y + A^T W c),        dy = W (A dx + c)

is a step of the whole system of `augmented_lagrangian.py` with an older matrix (the chord method); the first one is the
tangent predictor for changed values and targets. In a solve that goes the way of the last one, or back, it is corrected
by what corrected that one (`course.py`). The matrix is factorized anew, once, after a corrected step, or where one more
step would not reach the tolerances. The iterate that reaches them is passed to the loop, which judges it as any other.
If steps gain too little, an active row begins to pull, or a pair is near a fold, the loop begins at the start of the
solve as if no step had been taken.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.constraints.program.evaluate import evaluate
from assembly.constraints.program.kept import (
    EARLIER_FACTOR,
    forget_factor,
    has_place,
    kept_header_at,
    kept_in,
    take_factor,
    take_rows,
)
from assembly.constraints.program.records import header_at, pool_header_at
from assembly.proximity.extrema.face_face import BEND
from assembly.proximity.manager.update import AS_NEEDED, MEASURED
from assembly.solve.linear_algebra.factorize import solve_step
from assembly.solve.loop.begin import read_state
from assembly.solve.loop.clearances import allowed_share, ends_unseen, update_again
from assembly.solve.loop.contacts import is_near_fold
from assembly.solve.loop.course import add_correction, follow_course
from assembly.solve.loop.deadline import is_cut
from assembly.solve.loop.keep import add_kept_transposed, keep_factor, kept_times, test_convexity
from assembly.solve.loop.line_search import goal
from assembly.solve.loop.multipliers import dual_residual
from assembly.solve.loop.parameters import (
    AFTER_CORRECTED,
    CHORD_GAIN,
    CHORD_LONGEST,
    CHORD_SHIFT,
    CHORD_STEPS,
    CORRECTED_PENALTY,
    FEW_STEPS,
    LIFT_BELOW,
)
from assembly.solve.loop.predict import predict_pairs
from assembly.solve.loop.report import log
from assembly.solve.loop.residuals import move, violation_of
from assembly.solve.loop.settings import RUNNING
from assembly.solve.loop.terminate import keep_what_holds

# How such steps ended: their number, or -1 if the loop is to begin from the start; whether the two iterates were
# exchanged; the violation and the dual residual at the last iterate, and at the one before.
Chord = namedtuple("Chord", "steps swapped violation dual last_violation last_dual")


@kernel(inner=True)
def chord_step(shape, kept, point, rows, system):
    """Compute the step by the kept factor from the Lagrangian's gradient, which `dual_residual` left in `descent`."""
    slope, step = system.directions.descent, system.directions.step
    for i in range(step.size):
        step[i] = -slope[i]
    for r in range(rows.count):
        rows.forces[r] = -point.residual[r] * kept.weights[r]
    add_kept_transposed(shape.bases, kept.factor_jacobian, rows.count, rows.forces, step)
    solve_step(system.factor, step.size, shape.sparsity, step)


@kernel(inner=True)
def largest_component(step):
    """The largest component of a step; one that is not finite is the largest."""
    longest = 0.0
    for i in range(step.size):
        if not abs(step[i]) <= longest:
            longest = abs(step[i])
    return longest


@kernel(inner=True)
def round_poses(store, q, told):
    """Round poses to what the user's coordinates can represent; these coordinates go into `told`."""
    units, header = pool_header_at(store.pool, 0), header_at(store.table, 0)
    for b in range(header.bodies):
        if store.table[header.unknown_blocks + b] >= 0:
            for k in range(3):
                told[b, k] = q[b, k] * units.scale + units.reference[k]
                q[b, k] = (told[b, k] - units.reference[k]) / units.scale
            for k in range(3, 7):
                told[b, k] = q[b, k]


@kernel(inner=True)
def write_told(table, told, state):
    """Poses of moving bodies, rounded to the user's coordinates, into a state."""
    for b in range(told.shape[0]):
        if table[header_at(table, 0).unknown_blocks + b] >= 0:
            for k in range(7):
                state[7 * b + k] = told[b, k]


@kernel(inner=True)
def weigh_as_kept(kept, one_sided, penalty, rows):
    """Make the rows active that are active in the kept factor, with a penalty. Whether none of these pulls.

    A row that is not active may be violated on the way: it is part of the violation, and holds at the end.
    """
    for r in range(rows.count):
        counts = one_sided[r] == 0 or kept.weights[r] > 0.0
        rows.active[r] = 1.0 / penalty if counts else 0.0
        if counts and one_sided[r] == 1 and rows.y[r] > 0.0:
            return False
    return True


@kernel(inner=True)
def may_go(task, current, trial, step, is_first):
    """Whether motion bounds cover a step. A tick updates the pairs that its first one would use up, and asks again."""
    program, loop = task.program, task.loop
    store, memory = program.store, program.lifted.memory
    if not task.watched or allowed_share(store, memory, current, trial, step, 1.0)[1]:
        return True
    if not (task.tick and is_first):
        return False
    loop.changed = update_again(store, program.lifted, current, AS_NEEDED | MEASURED)
    if loop.changed or is_cut(store.table, memory):
        return False
    return allowed_share(store, memory, current, trial, step, 1.0)[1]


@kernel(inner=True)
def go_along(task, kept, iterates, rows, system, is_first):
    """Write the iterate at the end of the step, with rows and multipliers, into `trial`. Whether all is regular."""
    program, (current, trial) = task.program, iterates
    store, shape, step, memory = program.store, program.structure, system.directions.step, program.lifted.memory
    if not may_go(task, current, trial, step, is_first):
        return False
    move(store.table, current.q, step, 1.0, trial.q)
    round_poses(store, trial.q, task.told)
    predict_pairs(store, shape.bases, program.lifted, current, trial, step, 1.0)
    if evaluate(program, program.lifted.guess, BEND, trial) >= 0:
        return False
    if task.watched and ends_unseen(store, memory, current, trial):
        return False
    for k in range(header_at(store.table, 0).contacts):
        if is_near_fold(trial.records, k, LIFT_BELOW):
            return False
    # Multipliers follow the step that was computed; a correction has multipliers of its own.
    linear = kept.course.tangent if is_first and not task.tick else step
    for r in range(rows.count):
        rows.forces[r] = (
            kept_times(shape.bases, kept.factor_jacobian, r, linear) + current.residual[r]
        ) * kept.weights[r]
        rows.y[r] += rows.forces[r]
    if not task.tick:
        follow_course(kept.course, rows, step, is_first)
    return True


@kernel(inline=True)
def wants_factor(task, count, arrived, is_corrected, violation, dual, last):
    """Whether a factor is to be made at an iterate, in place of an earlier solve's.

    At the end of the steps the new factor is for the next solve; a tick that arrived soon keeps its old one. On the way
    a factor is made if one more step with the old one would not arrive. Newton's step leaves L e^2 / 2 of a distance e,
    a chord step with the same matrix leaves L e of the remainder: twice the part that the step before has left. What a
    corrected step has left does not tell L.
    """
    if arrived:
        return not (task.tick and count <= FEW_STEPS)
    rate = 2.0 * max(violation, dual) / last
    return is_corrected or not (rate * violation <= task.loop.feasible and rate * dual <= task.limits.stationarity)


@kernel(inner=True)
def chord_steps(task, history, state, kept, current, trial, rows, system):
    """Steps by the kept factor from the current iterate, whose rows are evaluated; a `Chord`."""
    program, limits, feasible = task.program, task.limits, task.loop.feasible
    shape, stationarity = program.structure, limits.stationarity
    last_violation = last_dual = math.inf
    swapped, ratio = False, 0.0
    failed = Chord(-1, False, math.inf, math.inf, math.inf, math.inf)
    limit = min(CHORD_STEPS, task.loop.longest_tick if task.tick else task.loop.limit)
    tests = not task.tick and header_at(program.store.table, 0).implicit == 0
    penalty, left = rows.mu, kept_header_at(state, kept.header)
    for count in range(limit + 1):
        value = goal(program, rows.count, current, 1, system.gradient, system.hessian)
        violation = violation_of(current.residual, shape.one_sided, rows.count)
        dual = dual_residual(shape, current, rows, system, rows.y)
        log(history, count, (value, violation, dual, rows.mu, CHORD_SHIFT, 1.0, limits.radius))
        if not (math.isfinite(value) and weigh_as_kept(kept, shape.one_sided, penalty, rows)):
            return failed
        # A tick ends after its steps at any pose at which rows hold.
        arrived = violation <= feasible and (dual <= stationarity or (task.tick and count >= task.loop.limit))
        # A corrected step may happen to end within the tolerances. Only computed ones leave as little as ever.
        is_corrected = count == 1 and ratio != 0.0
        leaves_much = count == 2 and ratio != 0.0 and violation > AFTER_CORRECTED * feasible
        arrived = arrived and not is_corrected and not leaves_much
        last = max(last_violation, last_dual)
        if not (arrived or max(violation, dual) <= CHORD_GAIN * last):
            return failed
        is_old = count > 0 and left.factor == EARLIER_FACTOR
        if is_old and wants_factor(task, count, arrived, is_corrected, violation, dual, last):
            if not keep_factor(program, state, kept, current, rows, system):
                return failed
            if tests:
                test_convexity(task, rows, system, dual)
                take_factor(kept, system.factor)
        if arrived:
            if count > 0 and not task.tick:
                # A tangent that arrives alone is not corrected.
                left.corrected, left.ratio = 1.0 if count > 1 else 0.0, ratio
            return Chord(count, swapped, violation, dual, last_violation, last_dual)
        if count == limit:
            return failed
        chord_step(shape, kept, current, rows, system)
        if count == 0 and not task.tick:
            ratio = add_correction(kept, shape, left, rows, system)
            penalty = min(rows.mu, CORRECTED_PENALTY) if ratio != 0.0 else rows.mu
        if not largest_component(system.directions.step) <= CHORD_LONGEST:
            return failed
        if not go_along(task, kept, (current, trial), rows, system, count == 0):
            return failed
        current, trial = trial, current
        swapped = not swapped
        last_violation, last_dual = violation, dual
    return failed


@kernel(inline=True)
def go_on_by_chords(task, history, state, iterates, rows, system):
    """Steps with the factor that the last solve left, if any. Whether the two iterates were exchanged."""
    loop, limits, store = task.loop, task.limits, task.program.store
    current, trial, held = iterates
    kept = kept_in(store.table, state)
    may = loop.status == RUNNING and has_place(store.table, state) and limits.lift_trims == 0.0
    if not may or is_cut(store.table, task.program.lifted.memory):
        return False
    if kept_header_at(state, kept.header).factor != EARLIER_FACTOR:
        return False
    loop.violation = violation_of(current.residual, task.program.structure.one_sided, rows.count)
    if task.any_pose and loop.violation <= loop.feasible:
        # If rows hold, nothing is moved, whatever the least move of the last solve was.
        return False
    if task.tick or task.watched:
        keep_what_holds(task, held, current, rows)
    take_factor(kept, system.factor)
    chord = chord_steps(task, history, state, kept, current, trial, rows, system)
    if chord.steps < 0:
        forget_factor(store.table, state)
        # The recorded use of motion bounds belongs to other poses.
        loop.measured = 0
        if loop.changed:
            # Other contacts are listed at the start: no step was taken yet.
            return False
        read_state(store, state, current, trial, rows)
        take_rows(store, state, kept, current)
        return False
    if chord.steps > 0:
        # From here on the state has the new poses, not those of the start.
        write_told(store.table, task.told, state)
    loop.iteration, loop.alpha = chord.steps, 1.0
    loop.last_violation, loop.last_dual = chord.last_violation, chord.last_dual
    for r in range(rows.count):
        rows.better_y[r] = rows.y[r]
    return chord.swapped
