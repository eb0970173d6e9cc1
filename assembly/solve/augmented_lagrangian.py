"""The loop: a primal-dual augmented Lagrangian with exact Hessians, steps in twists.

Minimize f subject to c = 0 (or c >= 0), multipliers y of L = f + y.c (y <= 0 for c >= 0). One step solves

    [ H + d I   J^T  ] [ dx ]     [ grad f + J^T y ]
    [    J    -mu I  ] [ dy ] = - [       c        ],

with H the Hessian of L, by eliminating dy: (H + d I + J^T J / mu) dx = -(grad f + J^T (y + c / mu)). The Cholesky
factorization of that matrix tells its inertia; d is raised until it exists. dx descends on the augmented Lagrangian,
along which a line search runs (`search.py`); multipliers follow every step. -mu I makes redundant rows harmless.

A contact whose pair comes to a fold gets its coordinates as unknowns (`proximity/free_pair.py`) for the rest of the
solve.
Scattered bodies are gathered first (`gather.py`). The objective of a solve that is given none, that bodies move little,
is then measured from where they are gathered.
Where rows cannot all hold, the same step with f = 0, y = 0, mu = 1 minimizes |c|^2 / 2, and the loop says INFEASIBLE
at its stationary point.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import call_address, kernel
from assembly.constraints.blocks import BLOCKS, FACTORED, is_blocked
from assembly.constraints.layout import (
    BODIES,
    CLOCK_AT,
    CONTACTS,
    EXTRA,
    EXTRA_COLUMN,
    GUARDS,
    IMPLICIT,
    JOINTS,
    MOVING,
    REFERENCE,
    RESULTS,
    ROWS,
    SCALE,
    SLOTS,
    TAPE_ROOM,
    TRACKED,
    VECTOR_TRIMS,
    WATCH,
)
from assembly.constraints.program import evaluate
from assembly.constraints.row_terms import add_row_terms
from assembly.constraints.sparsity import clear_upper
from assembly.constraints.terms import objective, recenter
from assembly.proximity.free_pair import VARIABLES, VECTORS
from assembly.proximity.solid_contact import CONTACT_RECORD, FOLD, TRACK
from assembly.proximity.watch import AS_NEEDED, CAREFUL, EVERYTHING, any_crossed
from assembly.solve.contacts import free_folds, is_of_surfaces, start_contacts
from assembly.solve.gather import gather, scattered
from assembly.solve.guards import (
    allowed_share,
    clear_guards,
    forget_guards,
    go_back,
    look_again,
    look_around,
    numbers_of,
    place_guards,
)
from assembly.solve.linear import factorize_shifted
from assembly.solve.multipliers import (
    choose_multipliers,
    curve_rows,
    foresee,
    least_multipliers,
    strongest,
    weigh_rows,
)
from assembly.solve.recall import leave, recall
from assembly.solve.report import bring_back, is_clear, judge, keep, write_pose, write_rows
from assembly.solve.restoration import way_back
from assembly.solve.rows import (
    add_transposed,
    arrange,
    carry,
    move,
    record_of_blocks,
    shape_of,
    times,
    turned,
    violation_of,
)
from assembly.solve.search import SHORTEST, damped_step, goal, search
from assembly.solve.tangency import off_rows

# Outcomes; `solution.Status` gives each a sentence. RUNNING is none of them.
SOLVED, INFEASIBLE, STALLED, ITERATION_LIMIT, CONTACT_LOST, OUT_OF_TIME, RUNNING = 0, 1, 2, 3, 4, 5, 6
# Settings, in scaled lengths.
FEASIBILITY, STATIONARITY, ITERATIONS, PENALTY, PENALTY_FLOOR, RADIUS, GATHER, FREE_TRIMS = 0, 1, 2, 3, 4, 5, 6, 7
# Whether all that moved is looked at once more before a pose counts as solved. Of a tick: whether it is one, which ends
# at a pose that holds after so many iterations, and at the last one that held where it ends otherwise; how long it may
# take (0: as long as it takes); whether its end is tested for a minimum; where in the state the rows are that the last
# one left (0: nowhere).
LAST_LOOK, TICK, BUDGET, SECOND_ORDER, RECALL, SETTINGS = 8, 9, 10, 11, 12, 13
# Results at the end of the state.
STATUS, COUNT, OBJECTIVE, VIOLATION, DUAL, CULPRIT, IMPROPER, SCATTER = 0, 1, 2, 3, 4, 5, 6, 7
# Of a tick: whether it ended at a pose that held before; whether its end is a minimum (0: not tested, 1, or -1: no).
HELD, CURVED = 8, 9
HISTORY = 7  # figures an iteration: objective, feasibility, stationarity, mu, regularization, step length, radius
# A pair this near to a fold (det H over |H|^2) gets its coordinates as unknowns.
FREE_BELOW = 0.02
# Every so many steps the largest violation must have halved, or the loop sees whether the rows can hold; so many times.
PATIENCE = 25
RESTORATIONS = 3
# A violation above this, at the stationary point of all violations, tells that the rows cannot hold.
TOUCHING = 1e-9
# A step is computed so many times more for one-sided rows that it would break.
FORESEEN = 4
# Where so many whole steps in a row do not halve the violation, the floor of the penalty gives way, down to here:
# rounding, times its inverse, must stay small against the objective's curvature.
SLOW, HARDEST = 3, 1e-10
# Back onto rows a step is shortened by this where it leads farther off; a tick's may lead off by this once, if the next
# one leads back.
SHORTENED, ASTRAY, LEAST_SHARE = 0.25, 10.0, 1e-4
# Where a solve with clearances ends at a pose that does not hold, so many more steps lead back onto the rows.
SETTLING = 30
# A tick that does not hold after its iterations has so many times more of them.
EXTRA_TIME = 4
# Multipliers this much stronger than the objective's slope are looked at once more.
EXCESS = 10.0
# Where violations are stationary, this much curvature downward makes a saddle of it; a small move leads off it, in a
# direction that nothing but a scene made for it has as a symmetry. So often at most.
SADDLE, KICK, KICKS = 1e-5, 1e-3, 3


@kernel(inline=True, allocates=True)
def unknowns(n, order):
    """Room for n unknowns: gradient, (right side or scratch, step, step before it was bent), Hessian, its factor."""
    vectors = np.empty((4, n))
    if is_blocked(order):
        hessian = np.empty((6 * order[3][BLOCKS], 6))
        factor = np.empty((1, 36 * order[3][FACTORED]))
    else:
        matrices = np.empty((2, n, n))
        hessian, factor = matrices[0], matrices[1]
    return vectors[0], (vectors[1], vectors[2], vectors[3]), hessian, factor


@kernel
def solve_program(table, pool, settings, state, history, tips):
    """Solve in place. State: q (n, 7) | tracked (k, 4) | multipliers (m) | residuals (m) | results.

    `tips` is None where no term of the objective is a dexterity.
    """
    bodies = table[BODIES]
    pairs = table[CONTACTS]
    tracks = table[TRACKED]
    m = table[ROWS]
    size = pool[SCALE]
    o_tracked = 7 * bodies
    o_y = o_tracked + TRACK * tracks
    results = state[o_y + 2 * m :]
    # What the watch of clearances knows, and whether there is one.
    memory = results[RESULTS:]
    watched = table[WATCH] >= 0
    # Rows and variables grow by four for every free pair.
    rows = m
    most = m + 4 * pairs
    n = 6 * table[MOVING]
    # One block of memory a kind, because each costs its allocation. A point of the search: poses, tracked values,
    # records, residual, Jacobian.
    poses = np.empty((2, bodies, 7))
    tracked = np.empty((3, tracks, TRACK))
    records = np.empty((2, pairs + table[JOINTS] + table[VECTOR_TRIMS], CONTACT_RECORD))
    by_row = np.zeros((7, most))
    jacobians = np.empty((2, most, EXTRA_COLUMN + 6 * table[EXTRA]))
    here = (poses[0], tracked[0], records[0], by_row[0], jacobians[0])
    trial = (poses[1], tracked[1], records[1], by_row[1], jacobians[1])
    y = by_row[2]
    better_y = by_row[3]
    active = by_row[4]
    forces = by_row[5]
    foreseen = by_row[6]
    reach = 0.0
    for b in range(bodies):
        for k in range(7):
            value = state[7 * b + k]
            if k < 3:
                reach = max(reach, abs(value) / size)
                value = (value - pool[REFERENCE + k]) / size
            here[0][b, k] = value
            trial[0][b, k] = value
    recenter(table, pool, here[0])
    for k in range(tracks):
        for i in range(TRACK):
            here[1][k, i] = state[o_tracked + TRACK * k + i]
    for k in range(pairs):
        # Before anything is evaluated no pair is near a fold.
        here[2][k, FOLD] = 1.0
    for r in range(m):
        here[3][r] = math.inf
        y[r] = state[o_y + r]
        better_y[r] = y[r]
    # Where rows stand: variables, sides, and where matrices of variables and of rows have entries.
    shape = shape_of(table, most, n + 4 * pairs, record_of_blocks(table))
    bases, one_sided, order, _of_rows = shape
    # What pairs need: which are free, the lengths of their coordinates, room for their derivatives; a guess of all.
    free = np.empty(pairs, np.int64)
    for k in range(pairs):
        free[k] = -1
    loose = (
        free,
        np.empty((pairs, 4)),
        np.empty((VECTORS if pairs > 0 else 0, 3, VARIABLES)),
        np.empty((VARIABLES if pairs > 0 else 0, VARIABLES)),
        tracked[2],
        memory,
    )
    arrange(table, free, shape, rows, n)
    o_room = table[TAPE_ROOM]
    room = (np.empty(table[o_room]), np.empty(table[o_room + 1]), np.empty(table[o_room + 2]))
    gram = np.empty((most + 1, most))
    gradient, lines, lagrangian, matrix = unknowns(n, order)

    reach = max(reach, turned(table, pool, here[1]))
    # What rounding of the user's coordinates, and of angles over many turns, alone can violate.
    feasible = max(settings[FEASIBILITY], 4e-16 * reach)
    limit = int(settings[ITERATIONS])
    mu = settings[PENALTY]
    floor = settings[PENALTY_FLOOR]
    slow_steps = 0
    softness = 1.0
    share = 1.0
    lowest = math.inf
    astray = False
    shift = 0.0
    radius = settings[RADIUS]
    violation = math.inf
    dual = math.inf
    value = math.inf
    last_violation = math.inf
    last_dual = math.inf
    kept = False
    restoring = False
    entered = math.inf
    restorations = 0
    kicks = 0
    check_at = PATIENCE
    check_violation = math.inf
    iteration = 0
    alpha = 0.0
    status = RUNNING
    results[CULPRIT] = -1.0

    free_trims = settings[FREE_TRIMS] == 1.0
    tick = settings[TICK] == 1.0
    begin = call_address(table[CLOCK_AT], ()) if settings[BUDGET] > 0.0 else 0
    # The last pose that held, its tracked values and multipliers; none yet.
    held = (np.empty((bodies, 7)), np.empty((tracks, TRACK)), np.empty(most))
    holds = False
    numbers = np.empty(table[GUARDS], np.int64)
    results[HELD] = 0.0
    results[CURVED] = 0.0
    lost = start_contacts(table, pool, here[0], here[1], free, loose[1])
    recalled = int(settings[RECALL])
    came = False
    if watched:
        place_guards(table, memory, here, y, better_y, free, True)
        if lost < 0:
            came = look_around(table, pool, memory, here, AS_NEEDED)
            place_guards(table, memory, here, y, better_y, free, False)
    count = free_folds(table, pool, here[2], here[1], active, free, loose[1], -1.0, -1, free_trims)
    folded = False
    freed = 0
    if lost < 0 and count == 0:
        if watched:
            arrange(table, free, shape, rows, n)
        if recalled == 0 or came or not recall(table, state, recalled, here):
            lost = evaluate(table, pool, here[1], math.inf, loose, room, here)
            # A tick begins where the last one ended: there a pair that Newton's method loses is at a fold.
            folded = tick and lost >= 0 and is_of_surfaces(table, lost)
    if lost >= 0 and not folded:
        status = CONTACT_LOST
        results[CULPRIT] = float(lost)
        value = objective(table, pool, here[0], 0, room, order, gradient, lagrangian)
    results[SCATTER] = 1.0 if status == RUNNING and scattered(table, here[3], one_sided) else 0.0
    if settings[GATHER] == 1.0 and results[SCATTER] == 1.0:
        gather(table, pool, bases, table[SLOTS], here)
        for k in range(pairs):
            here[1][k, 0] = math.nan
        if watched:
            forget_guards(table, memory)
            place_guards(table, memory, here, y, better_y, free, False)
        start_contacts(table, pool, here[0], here[1], free, loose[1])
        if watched:
            look_around(table, pool, memory, here, AS_NEEDED)
            place_guards(table, memory, here, y, better_y, free, False)
        if table[IMPLICIT] == 1:
            recenter(table, pool, here[0])
        for r in range(m):
            y[r] = 0.0
            better_y[r] = 0.0
        lost = evaluate(table, pool, here[1], math.inf, loose, room, here)
        if lost >= 0:
            status = CONTACT_LOST
            results[CULPRIT] = float(lost)
    if not folded:
        lost = np.int64(-1)
    below = FREE_BELOW
    # How a solve with clearances ended whose bodies are only pushed apart any more, and until when.
    ended = RUNNING
    settled_by = 0
    # Whether other contacts are near now than rows were placed for.
    changed = watched and settings[GATHER] == 1.0 and results[SCATTER] == 1.0
    while status == RUNNING:
        if watched and not changed:
            holds_now = off_rows(table, loose, one_sided, here, tick) <= TOUCHING
            how = CAREFUL if holds_now else AS_NEEDED
            changed = look_again(table, pool, memory, here, how, free, loose[4])
        if changed:
            place_guards(table, memory, here, y, better_y, free, False)
        weigh_rows(rows, one_sided, here[3], y, mu, forces, active)
        if folded:
            # Nothing is known of its row yet.
            active[lost] = 1.0 / mu
        if pairs > 0:
            count = free_folds(table, pool, here[2], here[1], active, free, loose[1], below, lost, free_trims)
        if m + 4 * count != rows or changed:
            changed = False
            for r in range(rows, most):
                # New rows of tangency say nothing yet: least squares leave them out.
                y[r] = 0.0
                better_y[r] = 0.0
                active[r] = 0.0
            rows = m + 4 * count
            n = 6 * table[MOVING] + 4 * count
            arrange(table, free, shape, rows, n)
            gradient, lines, lagrangian, matrix = unknowns(n, order)
            kept = False
            lost = evaluate(table, pool, here[1], math.inf, loose, room, here)
            lowest = math.inf
            astray = False
            share = 1.0
            if folded:
                # Perhaps another one is lost.
                folded = lost >= 0 and free[lost] < 0
                freed += 1
                if folded and freed <= pairs:
                    continue
        below = FREE_BELOW
        if lost >= 0 and free[lost] < 0:
            # A pair that is lost and cannot be freed (an idle row, a pole): nothing moves any more.
            results[CULPRIT] = float(lost)
            status = CONTACT_LOST if folded else STALLED
        lost = np.int64(-1)
        residual = here[3]
        jacobian = here[4]
        descent, step, straight = lines
        violation = off_rows(table, loose, one_sided, here, tick)
        value = goal(table, pool, shape, rows, loose, room, tips, here, 1, gradient, lagrangian)
        # Rows of vectors depend on one another: their multipliers drift where nothing keeps them short.
        shortened = iteration > 0 and (alpha < 1.0 or table[VECTOR_TRIMS] == 1)
        # At the start both are the same; later a tenth of the last residual is good.
        good = math.inf if iteration == 0 else 0.1 * last_dual
        dual = choose_multipliers(shape, rows, here, shortened, good, active, gradient, descent, gram, y, better_y)
        if iteration < history.shape[0]:
            figures = (value, violation, dual, mu, shift, alpha, radius)
            for k in range(HISTORY):
                history[iteration, k] = figures[k]
        if status != RUNNING:
            break
        if not math.isfinite(violation) or not math.isfinite(value) or not math.isfinite(dual):
            # Only where the start is so: a step to such a place is not taken.
            status = STALLED
            break
        looks_last = watched and settings[LAST_LOOK] == 1.0
        # Where every last look finds other contacts, the limit ends it.
        if violation <= feasible and dual <= settings[STATIONARITY] and not (looks_last and iteration > limit):
            if looks_last:
                changed = look_again(table, pool, memory, here, EVERYTHING, free, loose[4])
                if changed:
                    iteration += 1
                    continue
                if any_crossed(table, table[WATCH], memory):
                    # Deeper than looks reach: no row tells.
                    status = STALLED
                    break
            status = SOLVED
            if strongest(y, rows) > EXCESS * strongest(gradient, n):
                # Rows that depend on each other: of all multipliers that balance the objective, the least.
                dual = least_multipliers(shape, rows, here, active, gradient, descent, gram, dual, y, better_y)
            break
        # Of a tick, what holds; of a solve with clearances, the last pose at which nothing crosses.
        if (tick and violation <= feasible) or (watched and not tick and is_clear(table, residual)):
            holds = True
            keep(here, y, rows, held)
            if watched:
                numbers_of(table, numbers)
        if iteration >= limit and (not tick or violation <= feasible or iteration >= EXTRA_TIME * limit):
            if watched and not tick and ended == RUNNING:
                ended = ITERATION_LIMIT
                settled_by = iteration + SETTLING
            if ended == RUNNING:
                status = ITERATION_LIMIT
                break
        if ended != RUNNING and (violation <= feasible or iteration >= settled_by):
            status = ended
            break
        if settings[BUDGET] > 0.0 and iteration > 0 and call_address(table[CLOCK_AT], ()) - begin > settings[BUDGET]:
            status = OUT_OF_TIME
            break
        if ended != RUNNING or (tick and iteration >= limit):
            # Its time is over: the shortest way back onto the rows.
            if violation < lowest:
                lowest = violation
                astray = False
            softness, there = way_back(
                table,
                pool,
                memory,
                shape,
                loose,
                room,
                here,
                trial,
                rows,
                n,
                (active, forces),
                mu,
                softness,
                share,
                0.1 * feasible,
                lagrangian,
                matrix,
                step,
                tick,
            )
            if there < lowest or (tick and there < ASTRAY * lowest and not astray):
                astray = not there < lowest
                here, trial = trial, here
                for r in range(rows):
                    better_y[r] = y[r]
                share = min(share / SHORTENED, 1.0)
            else:
                share *= SHORTENED
                if share < LEAST_SHARE:
                    status = STALLED if ended == RUNNING else ended
                    break
            kept = False
            alpha = 1.0
            iteration += 1
            continue
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
            clear_upper(order, n, lagrangian)
        # The right side and the matrix.
        weigh_rows(rows, one_sided, residual, y, mu, forces, active)
        for i in range(n):
            descent[i] = -gradient[i]
        add_transposed(bases, jacobian, rows, forces, descent)
        # Where the last step gained so much that a second one by its factor will do, that is cheaper.
        gain = 2.0 * max(violation / max(last_violation, feasible), dual / max(last_dual, settings[STATIONARITY]))
        is_fresh = not (kept and gain * violation <= feasible and gain * dual <= settings[STATIONARITY])
        for r in range(rows):
            foreseen[r] = 0.0
        if is_fresh:
            curve_rows(rows, residual, y, active, restoring, forces)
            add_row_terms(table, pool, loose, room, shape, here, forces, active, lagrangian)
            # What the inertia needs falls with the distance to the solution.
            shift = factorize_shifted(lagrangian, n, order, max(min(0.25 * shift, dual), 1e-8), matrix)
            if shift < 0.0:
                status = STALLED
                break
        used, longest, turn = damped_step(table, lagrangian, n, order, shift, radius, matrix, descent, step, straight)
        for _ in range(FORESEEN):
            if used < 0.0 or restoring:
                break
            if (
                foresee(
                    table, shape, rows, residual, jacobian, y, mu, step, is_fresh, active, foreseen, descent, lagrangian
                )
                == 0
            ):
                break
            if not is_fresh:
                is_fresh = True
                curve_rows(rows, residual, y, active, restoring, forces)
                add_row_terms(table, pool, loose, room, shape, here, forces, active, lagrangian)
            shift = factorize_shifted(lagrangian, n, order, max(shift, 1e-8), matrix)
            used = shift
            if shift >= 0.0:
                used, longest, turn = damped_step(
                    table, lagrangian, n, order, shift, radius, matrix, descent, step, straight
                )
        if used < 0.0:
            status = STALLED
            break
        last_violation = violation
        last_dual = dual
        cut = min(1.0, radius / longest) if longest > 0.0 else 1.0
        cut = min(cut, 1.0 / turn) if turn > 0.0 else cut
        if watched:
            cut = allowed_share(table, pool, memory, here, trial, step, cut)
        slope = 0.0
        steepest = 0.0
        for i in range(n):
            step[i] *= cut
            straight[i] = step[i]
            slope -= descent[i] * step[i]
            steepest = max(steepest, abs(descent[i]))
        for r in range(rows):
            if foreseen[r] == 1.0:
                # What the row adds to the descent is not in the merit before it binds.
                slope -= (y[r] + residual[r] / mu) * times(bases, jacobian, r, step)
        if restoring:
            ends = steepest <= 1e-9 * violation or longest < 1e-12
            slows = iteration >= check_at and violation > 0.99 * check_violation
            if (ends or slows) and watched and iteration < limit:
                # A contact may have come to where a given one stands, of which no clearance asks anything.
                changed = look_again(table, pool, memory, here, EVERYTHING, free, loose[4])
                if changed:
                    iteration += 1
                    continue
            if ends:
                if kicks < KICKS and factorize_shifted(lagrangian, n, order, 1e-8, matrix) > SADDLE:
                    # A saddle of the violations: axes that are parallel and are to stand at right angles, say.
                    kicks += 1
                    for i in range(n):
                        step[i] = KICK * math.sin(kicks + i) if i < 6 * table[MOVING] else 0.0
                    move(table, here[0], step, 1.0, trial[0])
                    carry(table, pool, bases, loose, here, step, 1.0)
                    if evaluate(table, pool, loose[4], math.inf, loose, room, trial) < 0:
                        here, trial = trial, here
                        iteration += 1
                        continue
                status = INFEASIBLE if violation > TOUCHING else STALLED
                break
            if slows:
                status = STALLED
                break
            if iteration >= check_at:
                check_at = iteration + PATIENCE
                check_violation = violation
        longest *= cut
        accepted, alpha, lost = search(
            table,
            pool,
            shape,
            loose,
            room,
            tips,
            here,
            trial,
            lines,
            rows,
            y,
            0.0 if restoring else value,
            value,
            restoring,
            mu,
            slope,
            longest,
            matrix,
            active,
            forces,
            gradient,
            lagrangian,
        )
        if not accepted:
            if lost < 0:
                # Perhaps a fold is near enough to matter; else nothing moves any more.
                below = 0.3
                for k in range(pairs):
                    if free[k] < 0 and abs(here[2][k, FOLD]) < below and is_of_surfaces(table, k):
                        lost = np.int64(k)
            if lost >= 0 and free[lost] < 0 and is_of_surfaces(table, lost):
                continue
            lost = np.int64(-1)
            if not restoring and violation > feasible and restorations < RESTORATIONS:
                restoring = True
                restorations += 1
                entered = violation
                continue
            if watched and not tick and ended == RUNNING and violation > feasible:
                ended = STALLED
                settled_by = iteration + SETTLING
                continue
            status = STALLED
            break
        for r in range(rows):
            better_y[r] = 0.0
            if active[r] > 0.0:
                better_y[r] = y[r] + alpha * (times(bases, jacobian, r, straight) + residual[r]) / mu
                if one_sided[r] == 1:
                    better_y[r] = min(better_y[r], 0.0)
        here, trial = trial, here
        if alpha == 1.0:
            kept = cut == 1.0 and used == shift and mu == floor and not restoring
            if cut == 1.0 and used == shift:
                # Rows whose slopes all but vanish, at a dead center say: only a harder penalty holds them.
                slow = mu == floor and violation_of(here[3], one_sided, rows) > max(0.5 * violation, feasible)
                slow_steps = slow_steps + 1 if slow else 0
                if slow_steps >= SLOW and not tick:
                    floor = max(0.1 * floor, HARDEST)
                mu = max(0.1 * mu, floor)
            radius = min(2.0 * radius, 1e6)
        else:
            kept = False
            radius = max(2.0 * alpha * longest, SHORTEST)
        iteration += 1

    if folded and status == CONTACT_LOST:
        violation = math.inf
    tells = watched and not tick and status != SOLVED and status != CONTACT_LOST
    if tells:
        # Contacts that no row tells of yet.
        look_around(table, pool, memory, here, EVERYTHING)
        place_guards(table, memory, here, y, better_y, free, False)
        lost = evaluate(table, pool, here[1], math.inf, loose, room, here)
    crosses = tells and (lost >= 0 or not is_clear(table, here[3]))
    if holds and ((tick and not violation <= feasible) or crosses):
        # Back to the last pose that held; what is near there is looked for again.
        bring_back(held, rows, here, y)
        results[HELD] = 1.0
        if watched:
            go_back(table, memory, numbers)
            if not tick:
                look_around(table, pool, memory, here, EVERYTHING)
            place_guards(table, memory, here, y, better_y, free, False)
    write_pose(table, pool, here[0], state)
    if status != CONTACT_LOST and not (tick and results[HELD] == 0.0):
        # A tick that went well ends at a pose that was just evaluated.
        holds, violation = judge(table, pool, state, loose, room, shape, rows, here, trial, 1.25 * feasible, tick)
        if status == SOLVED and not holds:
            status = STALLED
    results[IMPROPER] = write_rows(table, here, y, loose, tick, size, state)
    if settings[SECOND_ORDER] == 1.0 and results[HELD] == 0.0 and status != CONTACT_LOST:
        goal(table, pool, shape, rows, loose, room, tips, here, 1, gradient, lagrangian)
        weigh_rows(rows, one_sided, here[3], y, settings[PENALTY_FLOOR], forces, active)
        add_row_terms(table, pool, loose, room, shape, here, y, active, lagrangian)
        results[CURVED] = 1.0 if factorize_shifted(lagrangian, n, order, 0.0, matrix) == 0.0 else -1.0
    if recalled > 0:
        # With clearances what a tick ends with depends on rounding where wires wedge: there, rows are evaluated afresh.
        good = status == SOLVED if watched else status != CONTACT_LOST
        leave(table, state, recalled, here, good and results[HELD] == 0.0 and rows == m)
    if watched:
        clear_guards(table)
    results[STATUS] = float(status)
    results[COUNT] = float(min(iteration, limit) if ended != RUNNING else iteration)
    results[OBJECTIVE] = value
    results[VIOLATION] = violation * size
    results[DUAL] = dual
    return status
