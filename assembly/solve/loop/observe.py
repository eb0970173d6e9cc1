"""The first two phases of a step: update of the contact manager, and evaluation of rows and objective."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.constraints.program.contact import TOUCHING
from assembly.constraints.program.records import header_at
from assembly.proximity.manager.records import memory_header_at
from assembly.proximity.manager.update import AS_NEEDED, CAREFUL, DOUBTFUL, IN_TURNS, MEASURED, SPARING
from assembly.solve.loop.begin import let_touch, overlap_allowed, rearrange
from assembly.solve.loop.clearances import place_clearance_rows, update_again
from assembly.solve.loop.contacts import choose_sides, lift_folds
from assembly.solve.loop.deadline import is_cut, may_end, set_deadline
from assembly.solve.loop.line_search import goal
from assembly.solve.loop.multipliers import choose_multipliers, weigh_rows
from assembly.solve.loop.parameters import LIFT_BELOW
from assembly.solve.loop.pauses import pause
from assembly.solve.loop.report import log
from assembly.solve.loop.settings import CONTACT_LOST, OUT_OF_TIME, RUNNING, STALLED
from assembly.solve.loop.violation import off_rows
from assembly.solve.loop.way_back import begin_way
from assembly.solve.loop.workspace import rows_in


@kernel(inline=True)
def observe(task, current, rows):
    """Choose sides of loops, update the contact manager, place clearance rows, weigh rows, count pairs to be lifted."""
    loop, limits, lifted = task.loop, task.limits, task.program.lifted
    table, one_sided = task.program.store.table, task.program.structure.one_sided
    if loop.iteration > 0:
        set_deadline(table, task.settings, lifted.memory, loop.begin)
    loop.late = is_cut(table, lifted.memory)
    choose_sides(task.program, current, rows, 0.0)
    if task.watched and not loop.changed:
        enough = loop.feasible if task.tick else TOUCHING
        holds = off_rows(table, lifted, one_sided, current, task.tick) <= enough
        clock = (loop.begin, loop.updates)
        loop.late = not holds and may_end(table, task.settings, lifted.memory, clock, loop.iteration, 1.0)
        if not loop.late:
            how = (CAREFUL if holds else AS_NEEDED) | (SPARING if task.tick else IN_TURNS | DOUBTFUL)
            how |= MEASURED if loop.measured else AS_NEEDED
            loop.changed = update_again(task.program.store, lifted, current, how)
            loop.late = is_cut(table, lifted.memory)
    if loop.changed:
        place_clearance_rows(table, lifted, current, rows, False)
    weigh_rows(rows, one_sided, current.residual)
    if loop.folded:
        # The row of the lost contact has not been evaluated yet.
        rows.active[loop.lost] = 1.0 / rows.mu
    if header_at(table, 0).contacts > 0:
        lift_trims = limits.lift_trims == 1.0
        loop.lifted = lift_folds(task.program.store, lifted, current, rows.active, LIFT_BELOW, loop.lost, lift_trims)


@kernel(inline=True)
def rearrange_rows(task, current, rows):
    """The rows and the system for other contacts or lifted pairs, with a penalty that begins anew."""
    loop = task.loop
    rows, system, lost = rearrange(task.program, loop.lifted, rows, current, task.room)
    loop.rows, loop.lost = rows.count, lost
    loop.changed = 0
    if loop.iteration == 0 and lost < 0:
        let_touch(task.program.store.table, current, overlap_allowed(task.settings))
    # A penalty that was needed for other rows need not be for these.
    loop.floor = task.limits.penalty_floor
    loop.mu = max(loop.mu, loop.floor)
    begin_way(task.way)
    if loop.folded:
        # Perhaps another contact is lost now.
        loop.folded = lost >= 0 and task.program.lifted.free[lost] < 0
        loop.lifts += 1
    return rows_in(loop, rows), system


@kernel(inline=True)
def evaluate_iterate(task, history, current, rows, system):
    """Violation, objective with its gradient, multipliers and dual residual. Whether the step goes on."""
    loop, limits = task.loop, task.limits
    program = task.program
    table = program.store.table
    header = header_at(table, 0)
    if loop.lost >= 0 and program.lifted.free[loop.lost] < 0:
        # A pair is lost and cannot be lifted (an idle row, a pole): no further step is possible.
        task.result.culprit = float(loop.lost)
        loop.status = CONTACT_LOST if loop.folded else STALLED
    loop.lost = -1
    violation = off_rows(table, program.lifted, program.structure.one_sided, current, task.tick)
    loop.violation = violation
    loop.value = goal(program, rows.count, current, 1, system.gradient, system.hessian)
    # Rows of vectors are dependent: their multipliers drift unless they are kept short.
    vectors = header.vector_trims == 1
    shortened = loop.iteration > 0 and (loop.alpha < 1.0 or vectors)
    # Which rows push is not known at a first start, nor for contacts; a least move has no forces where all rows hold.
    first = loop.iteration == 0 and violation <= loop.feasible and (rows.mu > loop.floor or header.implicit == 1)
    loop.first = first
    touches = first or (task.watched and not task.tick and violation <= TOUCHING)
    good = max(0.0 if first else 0.1 * loop.last_dual, limits.stationarity if touches else 0.0)
    loop.dual = choose_multipliers(program.structure, current, rows, system, shortened, vectors, touches, good)
    log(history, loop.iteration, (loop.value, violation, loop.dual, rows.mu, loop.shift, loop.alpha, loop.radius))
    asked, stops = pause(program.store, task.settings, task.results, loop.asked, loop.iteration, loop.value, violation)
    loop.asked = asked
    if stops and loop.status == RUNNING:
        loop.status = OUT_OF_TIME
    if loop.status == RUNNING and loop.late:
        # Not every pair of bodies that is near has been updated.
        loop.status, loop.violation = OUT_OF_TIME, math.inf
    if task.watched and limits.places == 1.0 and memory_header_at(program.lifted.memory, 0).crowded == 1.0:
        loop.status = OUT_OF_TIME
    if loop.status != RUNNING:
        loop.over = 1
        return False
    if not math.isfinite(violation) or not math.isfinite(loop.value) or not math.isfinite(loop.dual):
        # This happens only at the start: no step to such a pose is taken.
        loop.status = STALLED
        return False
    return True
