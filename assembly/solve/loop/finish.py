"""The end of a solve: crossings are reported, the last pose that held is restored, the returned pose is judged."""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.constraints.program.evaluate import evaluate
from assembly.constraints.program.objective_terms import recenter
from assembly.constraints.program.records import header_at, pool_header_at
from assembly.proximity.manager.update import EVERYTHING, any_crossed
from assembly.solve.loop.arrival import is_near_saddle
from assembly.solve.loop.clearances import clear_clearance_rows, go_back, place_clearance_rows, update_around
from assembly.solve.loop.inertia import test_end
from assembly.solve.loop.keep import leave
from assembly.solve.loop.line_search import goal
from assembly.solve.loop.multipliers import multipliers_at
from assembly.solve.loop.report import (
    bring_back,
    is_as_returned,
    is_clear,
    judge,
    scaled_poses,
    write_pose,
    write_rows,
)
from assembly.solve.loop.settings import (
    CONTACT_LOST,
    INFEASIBLE,
    ITERATION_LIMIT,
    OUT_OF_TIME,
    SOLVED,
    STALLED,
    UNSURE,
    results_at,
    settings_at,
)
from assembly.solve.loop.workspace import results_of

# How the loop ended: status, and objective, violation, dual residual of its last iterate; the violation that counts as
# zero, whether there is a last feasible iterate.
End = namedtuple("End", "status value violation dual feasible holds")


@kernel(inner=True)
def find_crossing(program, current, rows):
    """Update all pairs after a solve failed. Returns whether bodies cross, with or without a row that shows it."""
    table, lifted = program.store.table, program.lifted
    update_around(program.store, lifted.memory, current, EVERYTHING)
    place_clearance_rows(table, lifted, current, rows, False)
    lost = evaluate(program, current.tracked, math.inf, current)
    return (
        lost >= 0
        or not is_clear(table, current.residual)
        or any_crossed(table, header_at(table, 0).manager_record, lifted.memory)
    )


@kernel(inner=True)
def return_to(program, held, rows, current, tick):
    """Return to the last pose that held, and update the contacts there."""
    store, lifted = program.store, program.lifted
    bring_back(held, rows, current)
    if header_at(store.table, 0).manager_record >= 0:
        go_back(store.table, lifted.memory, held.numbers)
        if not tick:
            update_around(store, lifted.memory, current, EVERYTHING)
        place_clearance_rows(store.table, lifted, current, rows, False)


@kernel(inline=True)
def finish(program, settings, state, iterates, rows, system, at_end):
    """Write the end of the solve into the state.

    Returns status, objective, violation and dual residual of the pose returned.
    """
    limits = settings_at(settings, 0)
    store, lifted = program.store, program.lifted
    current, trial, held = iterates
    header = header_at(store.table, 0)
    gradient, lagrangian = system.gradient, system.hessian
    status, value, violation, dual = at_end.status, at_end.value, at_end.violation, at_end.dual
    feasible, holds = at_end.feasible, at_end.holds
    results = results_of(store.table, state)
    result = results_at(results, 0)
    tick = limits.tick == 1.0
    watched = header.manager_record >= 0
    tells = watched and not tick and status != SOLVED and status != CONTACT_LOST
    crosses = tells and find_crossing(program, current, rows)
    fails = status == STALLED or status == ITERATION_LIMIT or status == INFEASIBLE
    is_wish = limits.any_pose == 1.0 and (fails or status == SOLVED) and not crosses
    if holds and ((tick and not violation <= feasible and result.carried == 0.0) or crosses):
        return_to(program, held, rows, current, tick)
        result.last_feasible = 1.0
    gathered = header.implicit == 1 and limits.gather > 0.0 and result.scatter == 1.0
    if gathered:
        # The least move was measured from the assembled bodies; it is reported from the given poses.
        scaled_poses(store, state, trial.q)
        recenter(store, trial.q)
    write_pose(store, current.q, state)
    # A successful tick ends at a pose that was just evaluated, as do chord steps, whose poses are returned unchanged.
    is_as_told = (
        status == SOLVED and not gathered and rows.count == header.rows and is_as_returned(store, current.q, state)
    )
    is_judged = status != CONTACT_LOST and not (tick and result.last_feasible == 0.0) and not is_as_told
    if is_judged:
        bound = 1.25 * feasible
        good, violation = judge(program, state, rows.count, current, trial, bound, tick)
        is_cut_short = status == OUT_OF_TIME and not tick
        if (is_wish or is_cut_short) and holds and not good and not watched:
            return_to(program, held, rows, current, tick)
            result.last_feasible = 1.0
            write_pose(store, current.q, state)
            good, violation = judge(program, state, rows.count, current, trial, bound, tick)
        if is_wish and good and (fails or result.last_feasible == 1.0):
            status = SOLVED
            value = goal(program, rows.count, trial, 1, gradient, lagrangian)
            dual = multipliers_at(program.structure, trial, rows, system)
        elif gathered or is_cut_short:
            value = goal(program, rows.count, trial, 0, gradient, lagrangian)
        if status == SOLVED and not good:
            status = UNSURE if is_near_saddle(store.table, settings, results, violation, dual) else STALLED
    result.improper = write_rows(store.table, current, rows.y, lifted, tick, pool_header_at(store.pool, 0).scale, state)
    if limits.second_order > 0.0 and result.last_feasible + result.carried == 0.0 and status != CONTACT_LOST:
        status = test_end(program, settings, results, status, current, rows, system)
    # With clearances the end of a tick depends on rounding where wires wedge: there rows are evaluated afresh.
    lasts = status == SOLVED if watched else status != CONTACT_LOST
    is_kept = lasts and result.last_feasible == 0.0 and rows.count == header.rows
    leave(program, limits, state, trial if is_judged else current, rows, system, is_kept, status == SOLVED)
    if watched:
        clear_clearance_rows(store.table)
    return status, value, violation, dual
