"""The third phase of a step: whether the solve has arrived or its time is over; feasible iterates are kept."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.constraints.program.contact import TOUCHING
from assembly.constraints.program.records import header_at
from assembly.proximity.manager.update import EVERYTHING, any_crossed
from assembly.solve.loop.arrival import has_arrived, is_rounding, reach_of
from assembly.solve.loop.clearances import numbers_of, update_again
from assembly.solve.loop.contacts import choose_sides
from assembly.solve.loop.deadline import is_spent
from assembly.solve.loop.loop_state import lead_back
from assembly.solve.loop.parameters import GAIN, HALF, LINGERS, LONGER, SHORT, STANDS, STRAYING
from assembly.solve.loop.report import is_clear, keep_point
from assembly.solve.loop.rollback import has_sunk, must_roll_back, roll_back
from assembly.solve.loop.settings import ITERATION_LIMIT, OUT_OF_TIME, RUNNING, SOLVED, STALLED


@kernel(inline=True)
def terminate(task, held, current, rows, system):
    """Whether the loop ends at this iterate, or continues from another one; otherwise the step continues from it."""
    loop, program = task.loop, task.program
    loop.sunk = task.watched and not task.tick and has_sunk(program.store, program.lifted.memory, current.residual)
    if loop.sunk and loop.iteration == loop.back_at:
        # Bodies crossed at that pose too, unnoticed: the solve must not return to it.
        loop.holds, loop.leash = 0, math.inf
    goes_back = must_roll_back(task)
    count_rounded_steps(loop, task.limits)
    arrived = is_solution(task, current, rows, system)
    final_update = task.watched and task.limits.final_update == 1.0
    # If every final update finds other contacts, the limit ends the solve.
    if arrived and goes_around(task, current, rows):
        return True
    if arrived and not goes_back and not (final_update and loop.iteration > loop.limit):
        arrive(task, final_update, current)
        return True
    keep_what_holds(task, held, current, rows)
    if stop_at_limits(task, current):
        return True
    if goes_back:
        roll_back(task, held, current, rows)
        return True
    return False


@kernel(inline=True)
def count_rounded_steps(loop, limits):
    """Count whole steps in a row at feasible iterates that do not reduce the dual residual: it may be rounding."""
    most = max(GAIN * loop.last_dual, limits.stationarity)
    stands = loop.alpha * loop.cut == 1.0 and loop.dual > most and loop.violation <= loop.feasible
    loop.stood = loop.stood + 1 if stands else 0


@kernel(inline=True)
def is_solution(task, current, rows, system):
    """Whether the iterate is feasible and its dual residual zero, or rounding."""
    loop = task.loop
    rounded = loop.stood >= STANDS and is_rounding(task.program, current, rows, system, loop.longest, loop.dual)
    dual = 0.0 if rounded else loop.dual
    table = task.program.store.table
    return has_arrived(table, task.settings, task.results, loop.violation, loop.feasible, dual)


@kernel(inline=True)
def goes_around(task, current, rows):
    """Whether a contact on a loop moves on around a corner, by the iterate's multipliers: then the solve goes on."""
    loop = task.loop
    if header_at(task.program.store.table, 0).trim_sides_address == 0:
        return False
    for r in range(rows.count):
        rows.better_y[r] = rows.y[r]
    goes = choose_sides(task.program, current, rows, task.limits.stationarity)
    loop.iteration += 1 if goes else 0
    return goes


@kernel(inline=True)
def arrive(task, final_update, current):
    """End at a solution, unless a final update of all pairs finds other contacts."""
    loop, program = task.loop, task.program
    # A contact that ends at this pose is lost and found again by every update.
    if final_update and loop.iteration != loop.final_update_at:
        loop.changed = update_again(program.store, program.lifted, current, EVERYTHING)
        if loop.changed:
            loop.iteration += 1
            loop.final_update_at = loop.iteration
            return
    table = program.store.table
    # Crossings deeper than updates search have no row.
    crosses = final_update and any_crossed(table, header_at(table, 0).manager_record, program.lifted.memory)
    loop.status = STALLED if crosses else SOLVED
    loop.over = 1


@kernel(inline=True)
def keep_what_holds(task, held, current, rows):
    """Keep a feasible iterate, of a tick or without an objective; with clearances, one at which nothing crosses."""
    loop = task.loop
    table = task.program.store.table
    clear = task.watched and not task.tick and not loop.sunk and is_clear(table, current.residual)
    lasts = not task.watched and (task.any_pose or loop.first or loop.iteration >= SHORT)
    if clear or (loop.violation <= loop.feasible and (task.tick or lasts)):
        loop.holds = 1
        loop.leash *= LONGER if loop.iteration != loop.back_at else 1.0
        keep_point(current, rows, held)
        if task.watched:
            numbers_of(table, held.numbers)


@kernel(inline=True)
def stop_at_limits(task, current):
    """End the loop if its steps or its time are used up, or bodies move away without bound. Returns whether it ends.

    In some cases it goes on instead, with steps that only lead back onto the rows.
    """
    loop, limits = task.loop, task.limits
    store = task.program.store
    feasible = loop.violation <= loop.feasible
    if loop.iteration == STRAYING and limits.strays == 1.0 and not reach_of(store, current.q) <= loop.farthest:
        loop.status, loop.over = ITERATION_LIMIT, 1
        return True
    if loop.iteration >= loop.limit and (not task.tick or feasible or loop.iteration >= loop.longest_tick):
        if task.watched and not task.tick and loop.ended == RUNNING:
            lead_back(loop, ITERATION_LIMIT)
        if loop.ended == RUNNING:
            loop.status, loop.over = ITERATION_LIMIT, 1
            return True
    # The least move may be at a kink, where steps alternate.
    touches = loop.lingers > 0 or loop.violation <= TOUCHING
    loop.lingers += 1 if task.any_pose and not (loop.restoring and not task.watched) and touches else 0
    if task.leads_back and loop.ended == RUNNING and loop.lingers > LINGERS:
        lead_back(loop, STALLED)
    if loop.ended != RUNNING and (feasible or loop.iteration >= loop.led_back_by):
        loop.status = loop.ended
        return True
    # A feasible iterate is kept rather than starting what there is hardly time to finish; it also ends what an earlier
    # call began.
    part = 1.0 if not feasible else (0.0 if loop.done > 0 else HALF)
    begins = loop.iteration + loop.done > 0 and (loop.iteration > 0 or part < 1.0)
    if begins and is_spent(store.table, task.settings, loop.begin, part):
        loop.status, loop.over = OUT_OF_TIME, 1
        return True
    return False
