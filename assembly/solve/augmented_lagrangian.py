"""The loop: a primal-dual augmented Lagrangian with exact Hessians, steps in twists.

Minimize f subject to c = 0 (or c >= 0), multipliers y of L = f + y.c (y <= 0 for c >= 0). One step solves

    [ H + d I   J^T  ] [ dx ]     [ grad f + J^T y ]
    [    J    -mu I  ] [ dy ] = - [       c        ],

with H the Hessian of L, by eliminating dy: (H + d I + J^T J / mu) dx = -(grad f + J^T (y + c / mu)). The Cholesky
factorization of that matrix tells its inertia; d is raised until it exists. dx descends on the augmented Lagrangian,
along which a line search runs; multipliers follow every step. -mu I makes redundant rows harmless.
A step that the rows' curvature spoils is bent back onto the rows with the same factorization before it is shortened.

A contact whose pair comes to a fold gets its coordinates as unknowns (`proximity/free_pair.py`) for the rest of the
solve.
Where rows cannot all hold, the same step with f = 0, y = 0, mu = 1 minimizes |c|^2 / 2, and the loop says INFEASIBLE
at its stationary point.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.constraints.program import (
    BODIES,
    CONTACT,
    CONTACT_RECORD,
    CONTACTS,
    FOLD,
    MOVING,
    PROPER,
    REFERENCE,
    ROW,
    ROW_TABLE,
    ROWS,
    SCALE,
    SLOTS,
    add_row_terms,
    evaluate,
    objective,
)
from assembly.proximity.extremal import BEND
from assembly.proximity.free_pair import VARIABLES, VECTORS
from assembly.solve.contacts import free_folds, free_pairs_hold, start_contacts
from assembly.solve.linear import factorize_shifted, substitute
from assembly.solve.rows import (
    add_transposed,
    carry,
    dual_residual,
    least_squares_multipliers,
    merit,
    move,
    place_rows,
    times,
    violation_of,
)

# Outcomes; `solution.Status` gives each a sentence. RUNNING is none of them.
SOLVED, INFEASIBLE, STALLED, ITERATION_LIMIT, CONTACT_LOST, RUNNING = 0, 1, 2, 3, 4, 5
# Settings, in scaled lengths.
FEASIBILITY, STATIONARITY, ITERATIONS, PENALTY, PENALTY_FLOOR, RADIUS, SETTINGS = 0, 1, 2, 3, 4, 5, 8
# Results at the end of the state.
STATUS, COUNT, OBJECTIVE, VIOLATION, DUAL, CULPRIT, IMPROPER, RESULTS = 0, 1, 2, 3, 4, 5, 6, 8
HISTORY = 7  # figures an iteration: objective, feasibility, stationarity, mu, regularization, step length, radius
# A pair this near to a fold (det H over |H|^2) gets its coordinates as unknowns.
FREE_BELOW = 0.02
# Every so many steps the largest violation must have halved, or the loop sees whether the rows can hold; so many times.
PATIENCE = 25
RESTORATIONS = 3
# Multipliers below this count for nothing against the objective's curvature, which is of order one.
WEAK = 1e-3
# A gap that counts as touching where crossing surfaces are reported.
TOUCHING = 1e-9
# A step shorter than this decides nothing.
SHORTEST = 1e-6


@kernel(inner=True)
def write_pose(table, pool, q, state):
    """Poses of the moving bodies into the state, in the user's coordinates."""
    for b in range(table[BODIES]):
        if table[table[SLOTS] + b] >= 0:
            for k in range(3):
                state[7 * b + k] = q[b, k] * pool[SCALE] + pool[REFERENCE + k]
            for k in range(3, 7):
                state[7 * b + k] = q[b, k]


@kernel(inner=True)
def write_rows(table, contacts, y, residual, free, size, state):
    """Contacts, multipliers and residuals into the state, lengths in the user's unit."""
    m = table[ROWS]
    o = 7 * table[BODIES]
    for k in range(table[CONTACTS]):
        for i in range(4):
            state[o + 4 * k + i] = contacts[k, i]
    o += 4 * table[CONTACTS]
    for r in range(m):
        state[o + r] = y[r]
        worst = residual[r]
        k = table[table[ROW_TABLE] + ROW * r + CONTACT]
        if free[k] >= 0:
            # What a free pair lacks to be extremal is a violation of its contact, too.
            for i in range(4):
                if abs(residual[m + 4 * free[k] + i]) > abs(worst):
                    worst = -abs(residual[m + 4 * free[k] + i])
        state[o + m + r] = worst * size


@kernel
def solve_program(table, pool, settings, state, history):
    """Solve in place. State: q (n, 7) | contacts (k, 4) | multipliers (m) | residuals (m) | results."""
    bodies = table[BODIES]
    pairs = table[CONTACTS]
    m = table[ROWS]
    size = pool[SCALE]
    o_contacts = 7 * bodies
    o_y = o_contacts + 4 * pairs
    o_residual = o_y + m
    results = state[o_residual + m :]
    q = np.empty((bodies, 7))
    reach = 0.0
    for b in range(bodies):
        for k in range(3):
            q[b, k] = (state[7 * b + k] - pool[REFERENCE + k]) / size
            reach = max(reach, abs(state[7 * b + k]) / size)
        for k in range(3, 7):
            q[b, k] = state[7 * b + k]
    contacts = np.empty((pairs, 4))
    for k in range(pairs):
        for i in range(4):
            contacts[k, i] = state[o_contacts + 4 * k + i]
    # Rows and variables grow by four for every free pair.
    rows = m
    most = m + 4 * pairs
    n = 6 * table[MOVING]
    free = np.empty(pairs, np.int64)
    for k in range(pairs):
        free[k] = -1
    bases = np.empty((most, 3), np.int64)
    one_sided = np.empty(most, np.int64)
    place_rows(table, free, bases, one_sided)
    lengths = np.empty((pairs, 4))
    vectors = np.empty((VECTORS, 3, VARIABLES))
    block = np.empty((VARIABLES, VARIABLES))
    y = np.zeros(most)
    better_y = np.zeros(most)
    for r in range(m):
        y[r] = state[o_y + r]
        better_y[r] = y[r]
    trial_q = np.empty((bodies, 7))
    for b in range(bodies):
        for k in range(7):
            trial_q[b, k] = q[b, k]
    guess = np.empty((pairs, 4))
    trial_contacts = np.empty((pairs, 4))
    records = np.empty((pairs, CONTACT_RECORD))
    trial_records = np.empty((pairs, CONTACT_RECORD))
    residual = np.empty(most)
    for r in range(most):
        residual[r] = math.inf
    for k in range(pairs):
        for i in range(CONTACT_RECORD):
            records[k, i] = 1.0
    trial_residual = np.empty(most)
    jacobian = np.empty((most, VARIABLES))
    trial_jacobian = np.empty((most, VARIABLES))
    active = np.empty(most)
    gram = np.empty((most, most))
    forces = np.zeros(most)
    gradient = np.empty(n)
    descent = np.empty(n)
    step = np.empty(n)
    straight = np.empty(n)
    lagrangian = np.empty((n, n))
    matrix = np.empty((n, n))

    # What rounding of the user's coordinates alone can violate.
    feasible = max(settings[FEASIBILITY], 4e-16 * reach)
    limit = int(settings[ITERATIONS])
    mu = settings[PENALTY]
    shift = 0.0
    radius = settings[RADIUS]
    violation = math.inf
    dual = math.inf
    value = math.inf
    restoring = False
    entered = math.inf
    restorations = 0
    check_at = PATIENCE
    check_violation = math.inf
    iteration = 0
    alpha = 0.0
    status = RUNNING
    results[CULPRIT] = -1.0

    lost = start_contacts(table, pool, q, contacts, free, lengths)
    count = free_folds(table, pool, records, contacts, forces, free, lengths, -1.0, -1)
    if lost < 0 and count == 0:
        lost = evaluate(
            table, pool, q, contacts, math.inf, free, lengths, vectors, contacts, records, residual, jacobian
        )
    if lost >= 0:
        status = CONTACT_LOST
        results[CULPRIT] = float(lost)
        value = objective(table, pool, q, gradient, lagrangian)
    lost = np.int64(-1)
    below = FREE_BELOW
    while status == RUNNING:
        for r in range(rows):
            forces[r] = 0.0 if one_sided[r] == 1 and y[r] + residual[r] / mu >= 0.0 else 1.0
        count = free_folds(table, pool, records, contacts, forces, free, lengths, below, lost)
        if m + 4 * count != rows:
            for r in range(rows, most):
                y[r] = 0.0
                better_y[r] = 0.0
            rows = m + 4 * count
            n = 6 * table[MOVING] + 4 * count
            place_rows(table, free, bases, one_sided)
            gradient = np.empty(n)
            descent = np.empty(n)
            step = np.empty(n)
            straight = np.empty(n)
            lagrangian = np.empty((n, n))
            matrix = np.empty((n, n))
            lost = evaluate(
                table, pool, q, contacts, math.inf, free, lengths, vectors, contacts, records, residual, jacobian
            )
        below = FREE_BELOW
        if lost >= 0 and free[lost] < 0:
            # A pair that is lost and cannot be freed (an idle row, a pole): nothing moves any more.
            results[CULPRIT] = float(lost)
            status = STALLED
        lost = -1
        value = objective(table, pool, q, gradient, lagrangian)
        violation = violation_of(residual, one_sided, rows)
        dual = dual_residual(bases, jacobian, rows, one_sided, residual, gradient, better_y, descent)
        other = dual_residual(bases, jacobian, rows, one_sided, residual, gradient, y, descent)
        if dual <= other:
            for r in range(rows):
                y[r] = better_y[r]
        else:
            dual = other
        if iteration > 0 and alpha < 1.0:
            least_squares_multipliers(bases, jacobian, rows, one_sided, forces, gradient, descent, gram, better_y)
            other = dual_residual(bases, jacobian, rows, one_sided, residual, gradient, better_y, descent)
            if other < dual:
                dual = other
                for r in range(rows):
                    y[r] = better_y[r]
        if iteration < history.shape[0]:
            history[iteration, 0] = value
            history[iteration, 1] = violation
            history[iteration, 2] = dual
            history[iteration, 3] = mu
            history[iteration, 4] = shift
            history[iteration, 5] = alpha
            history[iteration, 6] = radius
        if violation <= feasible and dual <= settings[STATIONARITY]:
            status = SOLVED
            break
        if iteration >= limit:
            status = ITERATION_LIMIT
            break
        if restoring and violation <= max(0.1 * entered, feasible):
            restoring = False
            mu = 1e-4
            check_at = iteration + PATIENCE
            check_violation = violation
        if not restoring and iteration >= check_at:
            # The rows gain nothing: see whether they can hold at all.
            if violation > feasible and violation > 0.5 * check_violation and restorations < RESTORATIONS:
                restoring = True
                restorations += 1
                entered = violation
            check_at = iteration + PATIENCE
            check_violation = violation
        if restoring:
            mu = 1.0
            for r in range(rows):
                y[r] = 0.0
            for i in range(n):
                gradient[i] = 0.0
                for j in range(n):
                    lagrangian[i, j] = 0.0
        # The right side and the matrix.
        for r in range(rows):
            t = y[r] + residual[r] / mu
            idle = one_sided[r] == 1 and t >= 0.0
            forces[r] = 0.0 if idle else -t
            active[r] = 0.0 if idle else 1.0 / mu
        for i in range(n):
            descent[i] = -gradient[i]
        add_transposed(bases, jacobian, rows, forces, descent)
        strongest = 0.0
        for r in range(rows):
            # Far from feasible, c / mu would drown the curvature of the objective; y is what it tends to.
            forces[r] = (residual[r] if active[r] > 0.0 else 0.0) if restoring else y[r]
            strongest = max(strongest, abs(forces[r]))
        if strongest < WEAK:
            # Forces on their way to zero: their curvature would only spoil the inertia, and cost the fast end.
            for r in range(rows):
                forces[r] = 0.0
        for r in range(m):
            add_row_terms(
                table,
                pool,
                r,
                q,
                contacts,
                free,
                lengths,
                vectors,
                block,
                records,
                jacobian,
                forces,
                active,
                lagrangian,
            )
        # What the inertia needs falls with the distance to the solution.
        shift = factorize_shifted(lagrangian, n, max(min(0.25 * shift, dual), 1e-8), matrix)
        if shift < 0.0:
            status = STALLED
            break
        for i in range(n):
            step[i] = descent[i]
        substitute(matrix, n, step)
        longest = 0.0
        turn = 0.0
        for i in range(n):
            longest = max(longest, abs(step[i]))
            if i % 6 >= 3 and i < 6 * table[MOVING]:
                turn = max(turn, abs(step[i]))
        # Turns stay below a radian; moves may grow as long as they succeed.
        cut = min(1.0, radius / longest) if longest > 0.0 else 1.0
        cut = min(cut, 1.0 / turn) if turn > 0.0 else cut
        slope = 0.0
        for i in range(n):
            step[i] *= cut
            straight[i] = step[i]
            slope -= descent[i] * step[i]
        if restoring:
            steepest = 0.0
            for i in range(n):
                steepest = max(steepest, abs(descent[i]))
            if steepest <= 1e-9 * violation or longest < 1e-12:
                status = INFEASIBLE if violation > TOUCHING else STALLED
                break
            if iteration >= check_at:
                if violation > 0.99 * check_violation:
                    status = STALLED
                    break
                check_at = iteration + PATIENCE
                check_violation = violation
        # Line search on the augmented Lagrangian.
        here = merit(residual, one_sided, rows, y, mu)
        if not restoring:
            here += value
        noise = 1e-14 * (abs(here) + abs(value) + 1e-300)
        alpha = 1.0
        accepted = False
        bends = 0
        while alpha * longest * cut > 1e-9 * SHORTEST or alpha == 1.0:
            move(table, q, step, alpha, trial_q)
            carry(table, pool, bases, free, lengths, contacts, records, step, alpha, guess)
            lost = evaluate(
                table,
                pool,
                trial_q,
                guess,
                BEND,
                free,
                lengths,
                vectors,
                trial_contacts,
                trial_records,
                trial_residual,
                trial_jacobian,
            )
            if lost < 0:
                there = merit(trial_residual, one_sided, rows, y, mu)
                if not restoring:
                    there += objective(table, pool, trial_q, gradient, lagrangian)
                if there <= here + 1e-4 * alpha * slope + noise:
                    accepted = True
                    break
                if bends < 2:
                    bends += 1
                    for i in range(n):
                        descent[i] = 0.0
                    for r in range(rows):
                        forces[r] = -(trial_residual[r] - (1.0 - alpha) * residual[r]) * active[r]
                    add_transposed(bases, jacobian, rows, forces, descent)
                    substitute(matrix, n, descent)
                    for i in range(n):
                        step[i] += descent[i] / alpha
                    continue
                if bends == 2:
                    bends = 3
                    for i in range(n):
                        step[i] = straight[i]
            alpha *= 0.5
            if lost >= 0 and alpha * longest * cut < 0.01:
                break
        if not accepted:
            if lost < 0:
                # Perhaps a fold is near enough to matter; else nothing moves any more.
                below = 0.3
                for k in range(pairs):
                    if free[k] < 0 and abs(records[k, FOLD]) < below:
                        lost = k
            if lost >= 0 and free[lost] < 0:
                continue
            lost = -1
            if not restoring and violation > feasible and restorations < RESTORATIONS:
                restoring = True
                restorations += 1
                entered = violation
                continue
            status = STALLED
            break
        for r in range(rows):
            better_y[r] = 0.0
            if active[r] > 0.0:
                better_y[r] = y[r] + alpha * (times(bases, jacobian, r, straight) + residual[r]) / mu
                if one_sided[r] == 1:
                    better_y[r] = min(better_y[r], 0.0)
        q, trial_q = trial_q, q
        contacts, trial_contacts = trial_contacts, contacts
        records, trial_records = trial_records, records
        residual, trial_residual = trial_residual, residual
        jacobian, trial_jacobian = trial_jacobian, jacobian
        if alpha == 1.0:
            if cut == 1.0:
                mu = max(0.1 * mu, settings[PENALTY_FLOOR])
            radius = min(2.0 * radius, 1e6)
        else:
            radius = max(2.0 * alpha * longest * cut, SHORTEST)
        iteration += 1

    write_pose(table, pool, q, state)
    if status != CONTACT_LOST:
        # The pose as it is returned, rounded to the user's coordinates, judged afresh.
        for b in range(bodies):
            for k in range(3):
                trial_q[b, k] = (state[7 * b + k] - pool[REFERENCE + k]) / size
            for k in range(3, 7):
                trial_q[b, k] = q[b, k]
        lost = evaluate(
            table,
            pool,
            trial_q,
            contacts,
            BEND,
            free,
            lengths,
            vectors,
            trial_contacts,
            trial_records,
            trial_residual,
            trial_jacobian,
        )
        violation = violation_of(trial_residual, one_sided, rows) if lost < 0 else math.inf
        if status == SOLVED and not (
            violation <= 1.25 * feasible and free_pairs_hold(table, pool, trial_q, contacts, free, 1e-9)
        ):
            status = STALLED
        if lost < 0:
            residual, trial_residual = trial_residual, residual
    write_rows(table, contacts, y, residual, free, size, state)
    results[STATUS] = float(status)
    results[COUNT] = float(iteration)
    results[OBJECTIVE] = value
    results[VIOLATION] = violation * size
    results[DUAL] = dual
    results[IMPROPER] = 0.0
    for r in range(m):
        k = table[table[ROW_TABLE] + ROW * r + CONTACT]
        if free[k] < 0 and records[k, PROPER] == 0.0 and abs(residual[r]) <= TOUCHING:
            results[IMPROPER] += 1.0
    return status
