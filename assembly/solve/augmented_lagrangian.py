"""The loop: a primal-dual augmented Lagrangian with exact Hessians, steps in twists.

Minimize f subject to c = 0 (or c >= 0), multipliers y of L = f + y.c (y <= 0 for c >= 0). One step solves

    [ H + d I   J^T  ] [ dx ]     [ grad f + J^T y ]
    [    J    -mu I  ] [ dy ] = - [       c        ],

with H the Hessian of L, by eliminating dy: (H + d I + J^T J / mu) dx = -(grad f + J^T (y + c / mu)). The Cholesky
factorization of that matrix tells its inertia; d is raised until it exists. dx descends on the augmented Lagrangian,
along which a line search runs; multipliers follow every step. -mu I makes redundant rows harmless.
Where rows cannot all hold, the same step with f = 0, y = 0, mu = 1 minimizes |c|^2 / 2 and the loop says
INFEASIBLE at its stationary point.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.constraints.program import (
    BODIES,
    BODY_F,
    BODY_G,
    CONTACT,
    CONTACTS,
    MOVING,
    ONE_SIDED,
    PROPER,
    RATES,
    RECORD,
    ROW,
    ROW_TABLE,
    ROWS,
    SCALE,
    SLOTS,
    add_row_hessian,
    evaluate,
    objective,
)
from assembly.kinematics.motion import relative_pose, retract, rotation
from assembly.proximity.extremal import CONVERGED, SINGULAR
from assembly.proximity.start import global_start
from assembly.solve.linear import factorize, substitute

# Outcomes; `solution.Status` gives each a sentence.
SOLVED, INFEASIBLE, STALLED, ITERATION_LIMIT, CONTACT_LOST = 0, 1, 2, 3, 4
# Settings, in scaled lengths.
FEASIBILITY, STATIONARITY, ITERATIONS, PENALTY, PENALTY_FLOOR, RADIUS, WARM, SETTINGS = 0, 1, 2, 3, 4, 5, 6, 8
# Results at the end of the state.
STATUS, COUNT, OBJECTIVE, VIOLATION, DUAL, CULPRIT, IMPROPER, RESULTS = 0, 1, 2, 3, 4, 5, 6, 8
HISTORY = 7  # figures an iteration: objective, feasibility, stationarity, mu, regularization, step length, radius


@kernel
def violation_of(table, residual):
    """Largest violation and its row."""
    worst = 0.0
    where = -1
    for r in range(table[ROWS]):
        c = residual[r]
        if table[table[ROW_TABLE] + ROW * r + ONE_SIDED] == 1:
            c = min(c, 0.0)
        if abs(c) > worst:
            worst = abs(c)
            where = r
    return worst, where


@kernel
def merit(table, f, residual, y, mu):
    """Augmented Lagrangian; a one-sided row counts only while y + c / mu is negative."""
    value = f
    for r in range(table[ROWS]):
        c = residual[r]
        if table[table[ROW_TABLE] + ROW * r + ONE_SIDED] == 1 and y[r] + c / mu >= 0.0:
            value -= 0.5 * mu * y[r] * y[r]
        else:
            value += y[r] * c + 0.5 * c * c / mu
    return value


@kernel
def add_transposed(table, jacobian, weights, out):
    """out += J^T weights."""
    for r in range(table[ROWS]):
        w = weights[r]
        if w == 0.0:
            continue
        row = table[ROW_TABLE] + ROW * r
        f = 6 * table[table[SLOTS] + table[row + BODY_F]]
        g = 6 * table[table[SLOTS] + table[row + BODY_G]]
        for k in range(6):
            if f >= 0:
                out[f + k] += w * jacobian[r, k]
            if g >= 0:
                out[g + k] += w * jacobian[r, 6 + k]


@kernel
def add_squares(table, jacobian, weights, out):
    """out += J^T diag(weights) J (upper triangle and more)."""
    for r in range(table[ROWS]):
        w = weights[r]
        if w == 0.0:
            continue
        row = table[ROW_TABLE] + ROW * r
        f = 6 * table[table[SLOTS] + table[row + BODY_F]]
        g = 6 * table[table[SLOTS] + table[row + BODY_G]]
        for i in range(12):
            base = f if i < 6 else g
            if base < 0:
                continue
            s = w * jacobian[r, i]
            o = base + i % 6
            if f >= 0:
                for j in range(6):
                    out[o, f + j] += s * jacobian[r, j]
            if g >= 0:
                for j in range(6):
                    out[o, g + j] += s * jacobian[r, 6 + j]


@kernel
def times(table, jacobian, r, d):
    """Row r of J d."""
    row = table[ROW_TABLE] + ROW * r
    f = 6 * table[table[SLOTS] + table[row + BODY_F]]
    g = 6 * table[table[SLOTS] + table[row + BODY_G]]
    s = 0.0
    for k in range(6):
        if f >= 0:
            s += jacobian[r, k] * d[f + k]
        if g >= 0:
            s += jacobian[r, 6 + k] * d[g + k]
    return s


@kernel
def move(table, q, d, alpha, out):
    """Every moving body retracted by alpha d."""
    for b in range(table[BODIES]):
        s = 6 * table[table[SLOTS] + b]
        if s >= 0:
            retract(
                q,
                b,
                (alpha * d[s], alpha * d[s + 1], alpha * d[s + 2]),
                (alpha * d[s + 3], alpha * d[s + 4], alpha * d[s + 5]),
                out,
            )


@kernel
def predict(table, contacts, records, z, d, alpha, out):
    """Contact coordinates carried by the contact velocity along alpha d."""
    for r in range(table[ROWS]):
        row = table[ROW_TABLE] + ROW * r
        f = 6 * table[table[SLOTS] + table[row + BODY_F]]
        g = 6 * table[table[SLOTS] + table[row + BODY_G]]
        k = table[row + CONTACT]
        rates = records[k, RATES : RATES + 16]
        for i in range(4):
            out[k, i] = contacts[k, i]
        for j in range(4):
            s = 0.0
            for i in range(6):
                if f >= 0:
                    s += z[k, j, i] * d[f + i]
                if g >= 0:
                    s += z[k, j, 6 + i] * d[g + i]
            s *= alpha
            for i in range(4):
                out[k, i] += rates[4 * i + j] * s


@kernel
def start_contacts(table, pool, q, contacts):
    """Global starts for the contacts whose parameters are NaN. Returns the contact that found none, or -1."""
    for r in range(table[ROWS]):
        row = table[ROW_TABLE] + ROW * r
        k = table[row + CONTACT]
        if not math.isnan(contacts[k, 0]):
            continue
        i = table[row + BODY_F]
        j = table[row + BODY_G]
        turn, shift = relative_pose(q, i, rotation(q, i), j, rotation(q, j))
        status, x, _gap = global_start(
            table, pool, table[row + 3], table[row + 4], turn, shift, 1.0, 40
        )
        if status != CONVERGED and status != SINGULAR:
            return k
        contacts[k, 0], contacts[k, 1], contacts[k, 2], contacts[k, 3] = x
    return -1


@kernel
def solve_program(table, pool, settings, state, history):
    """Solve in place. State: q (n, 7) | contacts (k, 4) | multipliers (m) | residuals (m) | results."""
    bodies = table[BODIES]
    pairs = table[CONTACTS]
    m = table[ROWS]
    n = 6 * table[MOVING]
    size = pool[SCALE]
    o_contacts = 7 * bodies
    o_y = o_contacts + 4 * pairs
    o_residual = o_y + m
    o_results = o_residual + m
    q = np.empty((bodies, 7))
    contacts = np.empty((pairs, 4))
    y = np.empty(m)
    for b in range(bodies):
        for k in range(3):
            q[b, k] = (state[7 * b + k] - pool[1 + k]) / size
        for k in range(3, 7):
            q[b, k] = state[7 * b + k]
    for k in range(pairs):
        for i in range(4):
            contacts[k, i] = state[o_contacts + 4 * k + i]
    for r in range(m):
        y[r] = state[o_y + r]
    trial_q = q.copy()
    guess = np.empty((pairs, 4))
    trial_contacts = np.empty((pairs, 4))
    records = np.empty((pairs, RECORD))
    trial_records = np.empty((pairs, RECORD))
    z = np.empty((pairs, 4, 12))
    trial_z = np.empty((pairs, 4, 12))
    residual = np.empty(m)
    trial_residual = np.empty(m)
    jacobian = np.empty((m, 12))
    trial_jacobian = np.empty((m, 12))
    gradient = np.empty(n)
    descent = np.empty(n)
    step = np.empty(n)
    straight = np.empty(n)
    bent = np.empty(n)
    lagrangian = np.empty((n, n))
    matrix = np.empty((n, n))
    active = np.empty(m)
    forces = np.empty(m)

    results = state[o_results:]
    results[CULPRIT] = -1.0
    status = ITERATION_LIMIT
    iteration = 0
    mu = settings[PENALTY]
    shift = 0.0
    radius = settings[RADIUS]
    violation = math.inf
    dual = math.inf
    value = math.inf
    restoring = False
    best = math.inf
    stuck = 0

    lost = start_contacts(table, pool, q, contacts)
    if lost < 0:
        code, lost = evaluate(table, pool, q, contacts, 40, contacts, records, z, residual, jacobian)
    if lost >= 0:
        status = CONTACT_LOST
        results[CULPRIT] = float(lost)
    limit = int(settings[ITERATIONS])
    alpha = 0.0
    while status == ITERATION_LIMIT:
        value = objective(table, pool, q, gradient, lagrangian, True)
        violation, _worst = violation_of(table, residual)
        weight = 0.0 if restoring else 1.0
        if restoring:
            for i in range(n):
                gradient[i] = 0.0
                for j in range(n):
                    lagrangian[i, j] = 0.0
        # Stationarity of the Lagrangian.
        for i in range(n):
            step[i] = gradient[i]
        add_transposed(table, jacobian, y, step)
        dual = 0.0
        for i in range(n):
            dual = max(dual, abs(step[i]))
        for r in range(m):
            if table[table[ROW_TABLE] + ROW * r + ONE_SIDED] == 1:
                dual = max(dual, min(abs(y[r]), abs(residual[r])))
        if iteration < history.shape[0]:
            history[iteration, 0] = value
            history[iteration, 1] = violation
            history[iteration, 2] = dual
            history[iteration, 3] = mu
            history[iteration, 4] = shift
            history[iteration, 5] = alpha
            history[iteration, 6] = records[:, 43].min()
        if violation <= settings[FEASIBILITY] and dual <= settings[STATIONARITY] and not restoring:
            status = SOLVED
            break
        if iteration >= limit:
            break
        # The right side and the matrix.
        for r in range(m):
            t = y[r] + residual[r] / mu
            one_sided = table[table[ROW_TABLE] + ROW * r + ONE_SIDED] == 1
            if one_sided and t >= 0.0:
                forces[r] = 0.0
                active[r] = 0.0
            else:
                forces[r] = t
                active[r] = 1.0 / mu
        for i in range(n):
            descent[i] = -gradient[i]
        for r in range(m):
            forces[r] = -forces[r]
        add_transposed(table, jacobian, forces, descent)
        for r in range(m):
            curvature = y[r]
            if restoring:
                curvature = residual[r] if active[r] > 0.0 else 0.0
            if curvature != 0.0:
                add_row_hessian(table, r, records, z, curvature, lagrangian)
        add_squares(table, jacobian, active, lagrangian)
        scale = 0.0
        for i in range(n):
            scale = max(scale, abs(lagrangian[i, i]))
        attempt = max(0.25 * shift, 1e-8)
        while True:
            for i in range(n):
                for j in range(n):
                    matrix[i, j] = lagrangian[i, j]
                matrix[i, i] += attempt
            if factorize(matrix, n):
                break
            attempt = max(4.0 * attempt, 1e-4)
            if attempt > 1e12 * (1.0 + scale):
                status = STALLED
                break
        if status == STALLED:
            break
        shift = attempt
        for i in range(n):
            step[i] = descent[i]
        substitute(matrix, n, step)
        longest = 0.0
        for i in range(n):
            longest = max(longest, abs(step[i]))
        if longest > radius:
            for i in range(n):
                step[i] *= radius / longest
        slope = 0.0
        for i in range(n):
            slope -= descent[i] * step[i]
        if restoring and longest < 1e-9:
            status = INFEASIBLE
            break
        # Line search on the augmented Lagrangian.
        here = merit(table, weight * value, residual, y, mu)
        noise = 1e-14 * (abs(here) + abs(weight * value) + 1e-300)
        alpha = 1.0
        accepted = False
        corrections = 0
        for i in range(n):
            straight[i] = step[i]
        while alpha > 1e-7:
            move(table, q, step, alpha, trial_q)
            predict(table, contacts, records, z, step, alpha, guess)
            code, lost = evaluate(
                table, pool, trial_q, guess, 12, trial_contacts, trial_records, trial_z, trial_residual, trial_jacobian
            )
            if lost < 0:
                there = weight * objective(table, pool, trial_q, gradient, lagrangian, False)
                there = merit(table, there, trial_residual, y, mu)
                if there <= here + 1e-4 * alpha * slope + noise:
                    accepted = True
                    break
                if corrections < 2:
                    # The rows' curvature, not the direction, is at fault as a rule: bend the step back onto the rows.
                    corrections += 1
                    for i in range(n):
                        bent[i] = 0.0
                    for r in range(m):
                        forces[r] = -(trial_residual[r] - (1.0 - alpha) * residual[r]) * active[r]
                    add_transposed(table, jacobian, forces, bent)
                    substitute(matrix, n, bent)
                    for i in range(n):
                        step[i] += bent[i] / alpha
                    continue
                if corrections == 2:
                    for i in range(n):
                        step[i] = straight[i]
                    corrections = 3
            alpha *= 0.5
        if not accepted:
            status = STALLED
            break
        if not restoring:
            for r in range(m):
                if active[r] > 0.0:
                    dy = alpha * (times(table, jacobian, r, straight) + residual[r]) / mu
                    y[r] += dy
                    if table[table[ROW_TABLE] + ROW * r + ONE_SIDED] == 1:
                        y[r] = min(y[r], 0.0)
                else:
                    y[r] = 0.0
        q, trial_q = trial_q, q
        contacts, trial_contacts = trial_contacts, contacts
        records, trial_records = trial_records, records
        z, trial_z = trial_z, z
        residual, trial_residual = trial_residual, residual
        jacobian, trial_jacobian = trial_jacobian, jacobian
        if alpha == 1.0:
            if longest <= radius:
                mu = max(0.1 * mu, settings[PENALTY_FLOOR])
            radius = min(2.0 * radius, 1.0)
        else:
            radius = max(alpha * radius, 1e-6)
        iteration += 1
    for b in range(bodies):
        if table[table[SLOTS] + b] >= 0:
            for k in range(3):
                state[7 * b + k] = q[b, k] * size + pool[1 + k]
            for k in range(3, 7):
                state[7 * b + k] = q[b, k]
    for k in range(pairs):
        for i in range(4):
            state[o_contacts + 4 * k + i] = contacts[k, i]
    for r in range(m):
        state[o_y + r] = y[r]
        state[o_residual + r] = residual[r] * size
    results[STATUS] = float(status)
    results[COUNT] = float(iteration)
    results[OBJECTIVE] = value
    results[VIOLATION] = violation * size
    results[DUAL] = dual
    results[IMPROPER] = 0.0
    for k in range(pairs):
        if records[k, PROPER] == 0.0:
            results[IMPROPER] += 1.0
    return status
