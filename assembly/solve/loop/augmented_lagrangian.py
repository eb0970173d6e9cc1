"""The loop: a primal-dual augmented Lagrangian with exact Hessians, steps in twists.

Minimize f subject to c = 0 (or c >= 0), multipliers y of L = f + y.c (y <= 0 for c >= 0). One step solves

    [ H + d I   J^T  ] [ dx ]     [ grad f + J^T y ]
    [    J    -mu I  ] [ dy ] = - [       c        ],

with H the Hessian of L, by eliminating dy: (H + d I + J^T J / mu) dx = -(grad f + J^T (y + c / mu)). The Cholesky
factorization of that matrix tells its inertia; d is raised until it exists. dx descends on the augmented Lagrangian,
along which a line search runs (`solve/loop/line_search.py`); multipliers follow every step. -mu I makes redundant rows
harmless.

A contact whose pair comes to a fold gets its coordinates as unknowns (`proximity/extrema/lifted_pair.py`) for the rest
of the
solve. Scattered bodies are gathered first (`solve/loop/initial_guess.py`). Bodies that sank into each other go back
(`rollback.py`). Where
rows cannot all hold, the same step with f = 0, y = 0, mu = 1 minimizes |c|^2 / 2, and the loop says INFEASIBLE at its
stationary point. What the last factorization tells of second order is kept for the end (`inertia.py`).
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store
from assembly.constraints.program.contact import TOUCHING
from assembly.constraints.program.objective_terms import objective
from assembly.constraints.program.records import (
    RESULTS,
    header_at,
    pool_header_at,
)
from assembly.proximity.features.solid_contact import contact_record_at
from assembly.proximity.manager.update import (
    AS_NEEDED,
    CAREFUL,
    DOUBTFUL,
    EVERYTHING,
    IN_TURNS,
    MEASURED,
    SPARING,
    any_crossed,
)
from assembly.solve.loop.arrival import GAIN, has_arrived, is_rounding, reach_of, rounding_at
from assembly.solve.loop.begin import let_touch, overlap_allowed, read_state, rearrange, set_out
from assembly.solve.loop.clearances import allowed_share, numbers_of, place_clearance_rows, update_again
from assembly.solve.loop.contacts import free_folds, is_of_surfaces
from assembly.solve.loop.deadline import HALF, begin_tick, is_cut, is_spent, may_end, set_deadline
from assembly.solve.loop.direction import CLOSE, cut_step, find_direction, leave_saddle, propose, short_share
from assembly.solve.loop.finish import End, finish, return_to
from assembly.solve.loop.inertia import note_factor
from assembly.solve.loop.line_search import SHORTEST, goal, search
from assembly.solve.loop.multipliers import (
    choose_multipliers,
    forget_objective,
    least_multipliers,
    strongest,
    weigh_rows,
)
from assembly.solve.loop.pauses import SHORT, pause
from assembly.solve.loop.report import is_clear, keep, log
from assembly.solve.loop.residuals import violation_of
from assembly.solve.loop.restoration import LEAST_SHARE, begin_way, restoration_at, step_back
from assembly.solve.loop.rollback import BEGINNINGS, LEFT, LONGER, SHORTER, begin_again, has_sunk
from assembly.solve.loop.settings import (
    CONTACT_LOST,
    FREE_BELOW,
    INFEASIBLE,
    ITERATION_LIMIT,
    OUT_OF_TIME,
    RUNNING,
    SOLVED,
    STALLED,
    results_at,
    settings_at,
)
from assembly.solve.loop.standstill import (
    bound_nearby,
    contradicts,
    drags,
    is_stuck,
    next_floor,
    stands_still,
    stays_off,
)
from assembly.solve.loop.violation import off_rows
from assembly.solve.loop.workspace import Program, carve_all, results_of, workspace_needed

# Every so many steps the largest violation must have halved, or the loop sees whether the rows can hold; so many times.
PATIENCE = 25
RESTORATIONS = 3
# Where a solve with clearances ends at a pose that does not hold, so many more steps lead back onto the rows.
SETTLING = 30
# Where nothing is asked for but that constraints hold: so many iterations may follow one at which bodies touch.
LINGERS = 40
# A tick that does not hold after its iterations has so many times more of them.
EXTRA_TIME = 4
# Where a solve may stray, and its bodies are so many times farther out, or sizes, after so many steps, it is looked at
# whether that goes on.
FAR, STRAYING = 1e3, 60
# After so many whole steps in a row that gain nothing of the slope, rounding may explain what is left of it.
STANDS = 20
# So often at most a solve leaves a saddle of its violations.
KICKS = 3


@kernel(
    signatures=(
        "(i8[::1], f8[::1], f8[::1], f8[::1], f8[:, ::1], i8)",
        "(i8[::1], f8[::1], f8[::1], f8[::1], f8[:, ::1], none)",
    ),
)
def solve_program(table, pool, settings, state, history, tips):
    """Solve in place. State: q (n, 7) | tracked (k, 4) | multipliers (m) | residuals (m) | results.

    `tips` is None where no term of the objective is a dexterity.
    """
    doubles, integers = workspace_needed(table)
    return run(Store(table, pool), settings, state, history, tips, np.empty(doubles), np.empty(integers, np.int64))


@kernel(inner=True, allocates=True)
def run(store, settings, state, history, tips, doubles, integers):
    """The same, with what it works in."""
    header = header_at(store.table, 0)
    limits = settings_at(settings, 0)
    pairs = header.contacts
    m = header.rows
    results = results_of(store.table, state)
    # What the watch of clearances knows, and whether there is one.
    result = results_at(results, 0)
    memory = results[RESULTS:]
    watched = header.watch >= 0
    # Rows and variables grow by four for every free pair.
    rows = m
    n = 6 * header.moving
    # The last pose that held is none yet.
    workspace = carve_all(store.table, memory, doubles, integers)
    shape, lifted, room, system = workspace.structure, workspace.lifted, workspace.tapes, workspace.system
    by_row, numbers, gram, way = workspace.by_row, workspace.numbers, workspace.gram, workspace.way
    progress = restoration_at(way, 0)
    current, trial, held = workspace.here, workspace.trial, workspace.held
    y, better_y, active, forces, foreseen = by_row.y, by_row.better_y, by_row.active, by_row.forces, by_row.foreseen
    weights = (active, forces, foreseen)
    read_state(store, state, current, trial, y, better_y)
    one_sided, order = shape.one_sided, shape.sparsity
    free = lifted.free
    # What stays as it is for the whole solve.
    program = Program(store, shape, lifted, room)
    gradient, lines, lagrangian = system.gradient, system.directions, system.hessian

    feasible = rounding_at(store, settings, current)
    farthest = FAR * (1.0 + reach_of(store, current.q)) if limits.strays == 1.0 else math.inf
    tick = limits.tick == 1.0
    # A tick goes on with the last one, if that one's time was spent.
    begin, done, looks = begin_tick(store.table, settings, results, memory)
    clock = (begin, looks)
    limit = int(limits.iterations) - done
    longest_tick = EXTRA_TIME * int(limits.iterations) - done
    mu = limits.penalty
    floor, asked = limits.penalty_floor, 0
    progress.softness = 1e-2
    begin_way(way)
    # The first step of a tick needs about what that of the last one did; half of it is tried first.
    shift = 2.0 * result.first_shift if tick else 0.0
    radius = limits.radius
    violation = math.inf
    dual = math.inf
    value = math.inf
    last_violation = last_dual = restored = math.inf
    kept = False
    restoring = False
    entered = math.inf
    restorations = 0
    kicks = 0
    cuts = 0
    workspace_left = math.inf
    # How long steps may be after one that led bodies deep into each other, when that was, how long the last one was.
    leash = math.inf
    back_at = -1
    longest = 0.0
    stood = 0
    check_at = PATIENCE
    check_violation = math.inf
    iteration = 0
    alpha, cut = 0.0, 1.0
    free_trims = limits.free_trims == 1.0
    any_pose = limits.any_pose == 1.0
    # Whether what fails is led back onto its rows at the end.
    settles = not tick and (watched or any_pose)
    lingers = 0
    holds = False
    status, lost, folded = set_out(program, settings, state, current, by_row, n)
    if status == CONTACT_LOST:
        value = objective(store, current.q, 0, room, order, gradient, lagrangian)
    count = 0
    freed = 0
    below = FREE_BELOW
    # How a solve with clearances ended whose bodies are only pushed apart any more, and until when.
    ended = RUNNING
    settled_by = 0
    # When a tick looked because a step was to go too far; when a last look found other contacts than rows stood for.
    asked_at = -1
    looked_at = -1
    begun = 0
    # Whether other contacts are near than rows are placed for.
    changed = watched and limits.gather > 0.0 and result.scatter == 1.0
    # Whether it is known which parts of allowances are used here.
    measured = True
    while True:
        may_begin = watched and not tick and holds and begun < BEGINNINGS and iteration + LEFT <= limit
        if status == STALLED and may_begin:
            begin_again(store, held, lifted, current, y, better_y)
            measured = False
            begun += 1
            iteration += 1
            status = ended = RUNNING
            rows = m
            mu, radius, leash, shift, last_dual = limits.penalty, limits.radius, math.inf, 0.0, math.inf
            restoring, restorations, cuts, workspace_left = False, 0, 0, math.inf
            check_at, check_violation = iteration + PATIENCE, math.inf
            lost, below, changed = np.int64(-1), FREE_BELOW, True
        if status != RUNNING:
            break
        if iteration > 0:
            set_deadline(store.table, settings, memory, begin)
        late = is_cut(store.table, memory)
        holds_now = False
        if watched and not changed:
            holds_now = off_rows(store.table, lifted, one_sided, current, tick) <= (feasible if tick else TOUCHING)
            late = not holds_now and may_end(store.table, settings, memory, clock, iteration, 1.0)
        if watched and not changed and not late:
            how = (CAREFUL if holds_now else AS_NEEDED) | (SPARING if tick else IN_TURNS | DOUBTFUL)
            how |= MEASURED if measured else AS_NEEDED
            changed = update_again(store, memory, current, how, free, lifted.guess)
            late = is_cut(store.table, memory)
        if changed:
            place_clearance_rows(store.table, memory, current, y, better_y, free, False)
        weigh_rows(rows, one_sided, current.residual, y, mu, forces, active)
        if folded:
            # Nothing is known of its row yet.
            active[lost] = 1.0 / mu
        if pairs > 0:
            count = free_folds(
                store, current.records, current.tracked, active, free, lifted.lengths, below, lost, free_trims
            )
        if m + 4 * count != rows or changed:
            changed = False
            rows, n, system, lost = rearrange(program, count, rows, current, y, better_y, active)
            if iteration == 0 and lost < 0:
                let_touch(store.table, current, overlap_allowed(settings))
            gradient, lines, lagrangian = system.gradient, system.directions, system.hessian
            kept = False
            # What was hard for other rows need not be for these.
            floor, mu = limits.penalty_floor, max(mu, limits.penalty_floor)
            begin_way(way)
            if folded:
                # Perhaps another one is lost.
                folded = lost >= 0 and free[lost] < 0
                freed += 1
                if folded and freed <= pairs:
                    continue
        below = FREE_BELOW
        if lost >= 0 and free[lost] < 0:
            # A pair that is lost and cannot be freed (an idle row, a pole): nothing moves any more.
            result.culprit = float(lost)
            status = CONTACT_LOST if folded else STALLED
        lost = np.int64(-1)
        residual = current.residual
        violation = off_rows(store.table, lifted, one_sided, current, tick)
        value = goal(store, shape, rows, lifted, room, tips, current, 1, gradient, lagrangian)
        # Rows of vectors depend on one another: their multipliers drift where nothing keeps them short.
        vectors = header.vector_trims == 1
        shortened = iteration > 0 and (alpha < 1.0 or vectors)
        # Which rows push is not known at a first start, nor of contacts, and a least move has none where all holds.
        first = iteration == 0 and violation <= feasible and (mu > floor or header.implicit == 1)
        touches = first or (watched and not tick and violation <= TOUCHING)
        good = max(0.0 if first else 0.1 * last_dual, limits.stationarity if touches else 0.0)
        dual = choose_multipliers(
            shape, rows, current, shortened, vectors, touches, good, active, gradient, lines.descent, gram, y, better_y
        )
        log(history, iteration, (value, violation, dual, mu, shift, alpha, radius))
        asked, stops = pause(store, settings, results, asked, iteration, value, violation)
        status = OUT_OF_TIME if stops and status == RUNNING else status
        if status != RUNNING:
            break
        if late:
            # Not all that is near has been looked at.
            status, violation = OUT_OF_TIME, math.inf
            break
        if not math.isfinite(violation) or not math.isfinite(value) or not math.isfinite(dual):
            # Only where the start is so: a step to such a place is not taken.
            status = STALLED
            continue
        sunk = watched and not tick and has_sunk(store, memory, residual)
        if sunk and iteration == back_at:
            # Bodies were in each other there too, and nothing had asked: that is no place to return to.
            holds, leash = False, math.inf
        retreats = sunk and holds and ended == RUNNING and iteration < limit
        looks_last = watched and limits.last_look == 1.0
        # What whole steps gain nothing of, several in a row, may be rounding.
        stands = alpha * cut == 1.0 and dual > max(GAIN * last_dual, limits.stationarity) and violation <= feasible
        stood = stood + 1 if stands else 0
        rounded = stood >= STANDS and is_rounding(program, current, lagrangian, n, rows, y, longest, dual)
        unbalanced = 0.0 if rounded else dual
        arrived = has_arrived(program, settings, results, current, violation, last_violation, feasible, unbalanced)
        # Where every last look finds other contacts, the limit ends it.
        if arrived and not retreats and not (looks_last and iteration > limit):
            # A contact that ends right here is lost and found again, however often it is looked for.
            if looks_last and iteration != looked_at:
                changed = update_again(store, memory, current, EVERYTHING, free, lifted.guess)
                if changed:
                    looked_at = iteration = iteration + 1
                    continue
            # Deeper than looks reach no row tells of a crossing.
            status = STALLED if looks_last and any_crossed(store.table, header.watch, memory) else SOLVED
            if status == SOLVED:
                dual = least_multipliers(shape, rows, current, active, gradient, lines.descent, gram, dual, y, better_y)
            break
        # What holds, of a tick or where nothing else is asked for; with clearances, what does not cross.
        clear = watched and not tick and not sunk and is_clear(store.table, residual)
        lasts = not watched and (any_pose or first or iteration >= SHORT)
        if clear or (violation <= feasible and (tick or lasts)):
            holds = True
            leash *= LONGER if iteration != back_at else 1.0
            keep(current, y, rows, held)
            if watched:
                numbers_of(store.table, numbers)
        if iteration == STRAYING and limits.strays == 1.0 and not reach_of(store, current.q) <= farthest:
            status = ITERATION_LIMIT
            break
        if iteration >= limit and (not tick or violation <= feasible or iteration >= longest_tick):
            if watched and not tick and ended == RUNNING:
                ended = ITERATION_LIMIT
                settled_by = iteration + SETTLING
            if ended == RUNNING:
                status = ITERATION_LIMIT
                break
        # A least move may be at a kink, where steps go to and fro.
        lingers += 1 if any_pose and not (restoring and not watched) and (lingers > 0 or violation <= TOUCHING) else 0
        if settles and ended == RUNNING and lingers > LINGERS:
            ended = STALLED
            settled_by = iteration + SETTLING
        if ended != RUNNING and (violation <= feasible or iteration >= settled_by):
            status = ended
            continue
        # What holds is not left for what there is hardly time to end, and ends what an earlier call began.
        part = 1.0 if violation > feasible else (0.0 if done > 0 else HALF)
        if iteration + done > 0 and (iteration > 0 or part < 1.0) and is_spent(store.table, settings, begin, part):
            status = OUT_OF_TIME
            break
        if retreats:
            leash = SHORTER * min(leash, alpha * longest)
            if leash < SHORTEST:
                status = STALLED
                continue
            return_to(store, held, numbers, lifted, rows, current, y, better_y, tick)
            measured = False
            # Rows of tangency have other pairs now.
            rows = m
            changed = True
            back_at = iteration = iteration + 1
            continue
        if ended != RUNNING or (tick and iteration >= limit):
            # Its time is over: the shortest way back onto the rows.
            measured = step_back(
                program, current, trial, rows, weights, mu, violation, 0.1 * feasible, system, tick, way
            )
            if measured:
                current, trial = trial, current
                for r in range(rows):
                    better_y[r] = y[r]
            elif progress.share < LEAST_SHARE:
                status = STALLED if ended == RUNNING else ended
                continue
            kept = False
            alpha = 1.0
            iteration += 1
            continue
        # At a pose where rows depend on each other a wish only leads away: then they are restored until they hold.
        is_singular = any_pose and not watched and entered < CLOSE
        if restoring and violation <= (feasible if is_singular else max(0.1 * entered, feasible)):
            if is_singular:
                status = STALLED
                continue
            restoring = False
            mu = 1e-4
            check_at, check_violation = iteration + PATIENCE, violation
        is_open = violation > feasible and not (restoring or watched or tick)
        gains_nothing = is_open and mu <= floor
        force = strongest(y, rows) if gains_nothing else 0.0
        left = violation / max(last_violation, feasible) if alpha * cut == 1.0 else 0.0
        still = gains_nothing and stands_still(way, settings, feasible, violation, left, dual, force, mu)
        # Contacts bend as much as a step is long, and may gain little for a while.
        if still or (is_open and any_pose and pairs == 0 and drags(way, violation, last_violation)):
            check_at, check_violation = iteration, violation
        if not restoring and iteration >= check_at:
            # The rows gain nothing: see whether they can hold at all. One that has just closed has had no time to.
            least = TOUCHING if check_violation <= feasible else feasible
            if violation > max(least, 0.5 * check_violation) and restorations < RESTORATIONS:
                restoring = True
                # What the penalty's matrix needed says nothing of this one.
                shift = 0.0
                restorations += 1
                entered = violation
            check_at, check_violation = iteration + PATIENCE, violation
        if restoring:
            mu = 1.0
            forget_objective(order, rows, y, gradient, lagrangian)
        # Where the last step gained so much that a second one by its factor will do, that is cheaper.
        gain = 2.0 * max(violation / max(last_violation, feasible), dual / max(last_dual, limits.stationarity))
        is_fresh = not (kept and gain * violation <= feasible and gain * dual <= limits.stationarity)
        reach = min(radius, leash)
        if restoring:
            reach = min(reach, bound_nearby(way, violation, restored))
        shift, used, longest, turn = find_direction(
            program, current, rows, y, mu, shift, min(reach, workspace_left), cuts, dual, violation, restoring,
            is_fresh, weights, system,
        )  # fmt: skip
        if used < 0.0:
            status = STALLED
            continue
        note_factor(settings, results, iteration, shift, dual, restoring, is_fresh, rows, one_sided, active, y)
        last_violation = violation
        last_dual = dual
        measured = False
        cut, may_go = short_share(reach, longest, turn), True
        if watched:
            most_of_it = cut
            cut, may_go = allowed_share(store, memory, current, trial, lines.step, most_of_it)
            if tick and not may_go and asked_at != iteration:
                # A tick looks where a step would go farther than is known to be free: at pairs that would use much.
                if may_end(store.table, settings, memory, clock, iteration, HALF):
                    status = OUT_OF_TIME
                    violation = violation if iteration > 0 else math.inf
                    break
                asked_at = iteration
                changed = update_again(store, memory, current, AS_NEEDED | MEASURED, free, lifted.guess)
                if changed or is_cut(store.table, memory):
                    continue
                cut, may_go = allowed_share(store, memory, current, trial, lines.step, most_of_it)
        slope, steepest = cut_step(shape, current, rows, y, mu, cut, foreseen, lines)
        if restoring:
            ends = steepest <= 1e-9 * violation or longest < 1e-12
            ends = ends or stays_off(way, feasible, steepest, violation, restored)
            slows = iteration >= check_at and violation > 0.99 * check_violation
            if (ends or slows) and watched and iteration < limit:
                # A contact may have come to where a given one stands, of which no clearance asks anything.
                changed = update_again(store, memory, current, EVERYTHING, free, lifted.guess)
                if changed:
                    iteration += 1
                    continue
            if ends:
                if kicks < KICKS and leave_saddle(program, current, trial, kicks, system):
                    kicks += 1
                    current, trial = trial, current
                    iteration += 1
                    continue
                if violation > TOUCHING or watched or not any_pose or is_stuck(way):
                    status = INFEASIBLE if contradicts(way, feasible, violation) else STALLED
                    break
            if ends or slows:
                if settles and not watched:
                    ended = STALLED
                    settled_by = iteration + SETTLING
                else:
                    status = STALLED
                continue
            if iteration >= check_at:
                check_at, check_violation = iteration + PATIENCE, violation
        restored = violation if restoring else math.inf
        longest *= cut
        cuts = cuts + 1 if watched and cut < 0.5 and violation <= TOUCHING else 0
        workspace_left = 2.0 * longest if cuts > 0 else math.inf
        base = 0.0 if restoring else value
        leave = (not tick, may_go)
        accepted, alpha, lost = search(
            program, tips, current, trial, rows, y, base, value, restoring, leave, mu, slope, longest, weights, system
        )
        measured = accepted
        if not accepted:
            if lost < 0:
                # Perhaps a fold is near enough to matter; else nothing moves any more.
                below = 0.3
                for k in range(pairs):
                    if (
                        free[k] < 0
                        and abs(contact_record_at(current.records, k).fold) < below
                        and is_of_surfaces(store.table, k)
                    ):
                        lost = np.int64(k)
            if lost >= 0 and free[lost] < 0 and is_of_surfaces(store.table, lost):
                # A look may put another contact in its place, time and again.
                freed += 1
                iteration += 1 if freed > pairs else 0
                continue
            lost = np.int64(-1)
            if not restoring and violation > feasible and restorations < RESTORATIONS:
                restoring = True
                restorations += 1
                entered = violation
                continue
            if settles and ended == RUNNING and violation > feasible:
                ended = STALLED
                settled_by = iteration + SETTLING
                continue
            status = STALLED
            continue
        propose(shape, current, rows, y, mu, active, lines.straight, alpha, better_y)
        current, trial = trial, current
        if alpha == 1.0:
            kept = cut == 1.0 and used == shift and mu == floor and not restoring
            if cut == 1.0 and used == shift:
                slow = mu == floor and violation_of(current.residual, one_sided, rows) > max(0.5 * violation, feasible)
                floor = next_floor(way, floor, slow and not tick)
                mu = max(0.1 * mu, floor)
            radius = min(2.0 * radius, 1e6)
        else:
            kept = False
            radius = max(2.0 * alpha * longest, SHORTEST)
        iteration += 1

    if folded and status == CONTACT_LOST:
        violation = math.inf
    if limits.carries == 1.0 and status == OUT_OF_TIME and not violation <= feasible:
        result.carried = float(1 + done + iteration)
    at_end = End(status, value, violation, dual, feasible, rows, holds)
    status, value, violation, dual = finish(
        program, settings, state, tips, current, trial, by_row, at_end, held, numbers, system, gram
    )
    result.status = float(status)
    result.count = float(min(iteration, limit) if ended != RUNNING else iteration)
    result.objective = value
    result.violation = violation * pool_header_at(store.pool, 0).scale
    result.dual = dual
    return status
