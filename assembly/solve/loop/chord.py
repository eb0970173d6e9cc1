"""The first steps of a solve from a solution: chord steps with the factor that the last solve left.

With A and W the Jacobian and the weights (1 / mu) of the active rows at the pose where the factor was computed,

    (H + d I + A^T W A) dx = -(grad f + J^T y + A^T W c),        dy = W (A dx + c)

is a step of the whole system of `augmented_lagrangian.py` with an older matrix (the chord method); the first one is the
tangent predictor for changed values and targets. Where it is k times the one of the last solve, it is corrected by
k^2 times the sum of that solve's other steps, which is of second order (`add_correction`), and by how that sum changed
from one solve to the next. After the first step the matrix is factorized anew, once: for the steps that follow, and for
the next solve. The iterate that reaches the tolerances is passed to the loop, which judges it as any other. If steps
gain too little, an active row begins to pull, or a pair is near a fold, the loop begins at the start of the solve as if
no step had been taken.
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
from assembly.solve.loop.deadline import is_cut
from assembly.solve.loop.keep import keep_factor, test_convexity
from assembly.solve.loop.line_search import goal
from assembly.solve.loop.multipliers import dual_residual
from assembly.solve.loop.parameters import (
    ASIDE,
    CHORD_GAIN,
    CHORD_LONGEST,
    CHORD_PENALTY,
    CHORD_SHIFT,
    CHORD_STEPS,
    FARTHER,
    FEW_STEPS,
    LIFT_BELOW,
)
from assembly.solve.loop.predict import predict_pairs
from assembly.solve.loop.report import log
from assembly.solve.loop.residuals import add_transposed, move, times, violation_of
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
    add_transposed(shape.bases, kept.factor_jacobian, rows.count, rows.forces, step)
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
def ratio_of(course, step):
    """How many times the first step of the last solve a first step is; 0 if it leads elsewhere."""
    along = before = now = 0.0
    for i in range(step.size):
        along += step[i] * course.tangent[i]
        before += course.tangent[i] * course.tangent[i]
        now += step[i] * step[i]
    is_along = now * before - along * along <= ASIDE * ASIDE * along * along
    return along / before if is_along and before > 0.0 and abs(along) <= FARTHER * before else 0.0


@kernel(inner=True)
def foresee(before, trend, ratio):
    """Write what corrects a step, foreseen from what did before it, into `before`; this, to scale, into `trend`."""
    for i in range(before.size):
        scaled = ratio * ratio * before[i] if ratio != 0.0 else 0.0
        before[i] = scaled + ratio * ratio * trend[i] if ratio != 0.0 else 0.0
        trend[i] = scaled


@kernel(inner=True)
def note_trend(after, trend, ratio):
    """Write into `trend` how what corrects a step will change next, from what it was, to scale (`foresee`), and is."""
    for i in range(after.size):
        trend[i] = ratio * (after[i] - trend[i]) if ratio != 0.0 else 0.0


@kernel(inner=True)
def add_correction(course, is_known, step):
    """Add to a tangent step what is foreseen to correct it. Returns the ratio of the step to the last solve's.

    Solutions are smooth functions of what is asked for. What their terms of higher order add to the tangent step goes
    with the square of its length, and changes from pose to pose as it did before.
    """
    ratio = ratio_of(course, step) if is_known else 0.0
    foresee(course.correction, course.trend, ratio)
    foresee(course.forces, course.forces_trend, ratio)
    for i in range(step.size):
        course.tangent[i] = step[i]
        step[i] += course.correction[i]
    return ratio


@kernel(inner=True)
def add_to_course(course, rows, step):
    """Add a step after the first one, and what multipliers changed by, to what came to the tangent step."""
    for i in range(step.size):
        course.correction[i] += step[i]
    for r in range(rows.count):
        course.forces[r] += rows.forces[r]


@kernel(inner=True)
def note_course(kept, shape, ratio, rows, system):
    """At the end of the steps, keep what they tell of the next solve's.

    With D and R what came to the tangent step and to the multipliers, it is the solution of the step's system for

        [ H   A^T ] [ D ]
        [ A    0  ] [ R ]

    that is kept. Directions that no row and no objective determines, and multipliers of rows that repeat each other,
    drop out: they would be foreseen, never undone, and grow from solve to solve.
    """
    course, off = kept.course, system.directions.step
    for i in range(off.size):
        off[i] = CHORD_SHIFT * course.correction[i]
    for r in range(rows.count):
        rows.forces[r] = -course.forces[r]
    add_transposed(shape.bases, kept.factor_jacobian, rows.count, rows.forces, off)
    solve_step(system.factor, off.size, shape.sparsity, off)
    for r in range(rows.count):
        course.forces[r] = -kept.weights[r] * times(shape.bases, kept.factor_jacobian, r, off)
    for i in range(off.size):
        course.correction[i] -= off[i]
    note_trend(course.correction, course.trend, ratio)
    note_trend(course.forces, course.forces_trend, ratio)


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
def weigh_as_kept(kept, one_sided, rows):
    """Make the rows active that are active in the kept factor. Whether none of these pulls.

    A row that is not active may be violated on the way: it is part of the violation, and holds at the end.
    """
    for r in range(rows.count):
        counts = one_sided[r] == 0 or kept.weights[r] > 0.0
        rows.active[r] = 1.0 / CHORD_PENALTY if counts else 0.0
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
    # Multipliers follow the step that was computed, and have a correction of their own.
    linear = kept.course.tangent if is_first else step
    for r in range(rows.count):
        rows.forces[r] = (times(shape.bases, kept.factor_jacobian, r, linear) + current.residual[r]) * kept.weights[r]
        rows.y[r] += rows.forces[r] + (kept.course.forces[r] if is_first else 0.0)
    if not is_first:
        add_to_course(kept.course, rows, step)
    return True


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
    for count in range(limit + 1):
        value = goal(program, rows.count, current, 1, system.gradient, system.hessian)
        violation = violation_of(current.residual, shape.one_sided, rows.count)
        dual = dual_residual(shape, current, rows, system, rows.y)
        log(history, count, (value, violation, dual, rows.mu, CHORD_SHIFT, 1.0, limits.radius))
        if not (math.isfinite(value) and weigh_as_kept(kept, shape.one_sided, rows)):
            return failed
        # A tick ends after its steps at any pose at which rows hold.
        arrived = violation <= feasible and (dual <= stationarity or (task.tick and count >= task.loop.limit))
        last = max(last_violation, last_dual)
        if not (arrived or max(violation, dual) <= CHORD_GAIN * last):
            return failed
        left = kept_header_at(state, kept.header)
        # The factor that is left for the next solve is made where the first step has led; a tick that arrives soon
        # leaves the one that it began with.
        is_wanted = count > 0 and left.factor == EARLIER_FACTOR and not (arrived and task.tick and count <= FEW_STEPS)
        if is_wanted:
            if not keep_factor(program, state, kept, current, rows, system):
                return failed
            if tests:
                test_convexity(task, rows, system, dual)
                take_factor(kept, system.factor)
        if arrived:
            if count > 0:
                note_course(kept, shape, ratio, rows, system)
                left.corrected = 1.0
            return Chord(count, swapped, violation, dual, last_violation, last_dual)
        if count == limit:
            return failed
        chord_step(shape, kept, current, rows, system)
        if count == 0:
            ratio = add_correction(kept.course, left.corrected == 1.0, system.directions.step)
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
