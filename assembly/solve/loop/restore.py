"""The policy for a violation that does not decrease: restoration of the rows alone, to see whether they can hold.

Steps of a restoration minimize |c|^2 / 2: f = 0, y = 0, mu = 1. Where |c|^2 / 2 is stationary and rows do not hold,
they contradict each other nearby.
"""

from __future__ import annotations

from assembly._kernel import kernel
from assembly.constraints.program.contact import TOUCHING
from assembly.constraints.program.records import header_at
from assembly.proximity.manager.update import EVERYTHING
from assembly.solve.loop.clearances import update_again
from assembly.solve.loop.direction import leave_saddle
from assembly.solve.loop.loop_state import lead_back
from assembly.solve.loop.multipliers import forget_objective, strongest
from assembly.solve.loop.parameters import KICKS, NEARLY_HELD, PATIENCE, RESTORATIONS
from assembly.solve.loop.settings import INFEASIBLE, STALLED
from assembly.solve.loop.standstill import contradicts, count_drag, count_standstill, is_stuck, stays_off
from assembly.solve.loop.workspace import rows_in


@kernel(inline=True)
def choose_restoration(task, rows, system):
    """Begin or end a restoration of rows. Returns whether the step goes on."""
    loop = task.loop
    # At a pose where rows are dependent the least move only leads away: rows are restored until they hold.
    is_singular = task.any_pose and not task.watched and loop.entered < NEARLY_HELD
    if loop.restoring and loop.violation <= (loop.feasible if is_singular else max(0.1 * loop.entered, loop.feasible)):
        if is_singular:
            loop.status = STALLED
            return False
        loop.restoring = 0
        loop.mu = 1e-4
        check_later(loop)
    if detect_standstill(task, rows):
        loop.check_at, loop.check_violation = loop.iteration, loop.violation
    if not loop.restoring and loop.iteration >= loop.check_at:
        # The violation does not decrease: see whether rows can hold at all. A row that has just become active has
        # had no time to gain.
        least = TOUCHING if loop.check_violation <= loop.feasible else loop.feasible
        if loop.violation > max(least, 0.5 * loop.check_violation) and loop.restorations < RESTORATIONS:
            begin_restoration(loop)
            # The shift of the penalty's matrix does not apply to this one.
            loop.shift = 0.0
        check_later(loop)
    if loop.restoring:
        loop.mu = 1.0
        forget_objective(task.program.structure.sparsity, rows_in(loop, rows), system)
    return True


@kernel(inline=True)
def detect_standstill(task, rows):
    """Count steps that do not reduce the violation; whether there were enough in a row."""
    loop, way = task.loop, task.way
    is_open = loop.violation > loop.feasible and not (loop.restoring or task.watched or task.tick)
    by_floor = is_open and loop.mu <= loop.floor
    force = strongest(rows.y, rows.count) if by_floor else 0.0
    left = loop.violation / max(loop.last_violation, loop.feasible) if loop.alpha * loop.cut == 1.0 else 0.0
    if by_floor and count_standstill(
        way, task.settings, loop.feasible, loop.violation, left, loop.dual, force, loop.mu
    ):
        return True
    # Contacts bend as much as a step is long, and may gain little for a while.
    any_step = is_open and task.any_pose and header_at(task.program.store.table, 0).contacts == 0
    return any_step and count_drag(way, loop.violation, loop.last_violation)


@kernel(inline=True)
def begin_restoration(loop):
    """Ignore the objective until rows hold, or it is known that they cannot."""
    loop.restoring = 1
    loop.restorations += 1
    loop.entered = loop.violation


@kernel(inline=True)
def check_later(loop):
    """Check again after some steps whether the violation has decreased."""
    loop.check_at, loop.check_violation = loop.iteration + PATIENCE, loop.violation


@kernel(inline=True)
def judge_restoring_step(task, iterates, system, steepest):
    """For a step that restores rows: whether it is taken, and if not, whether the trial iterate is the next one.

    If it is stationary, or gains next to nothing, rows contradict each other, or the solve is led back.
    """
    loop, way, program = task.loop, task.way, task.program
    ends = steepest <= 1e-9 * loop.violation or loop.longest < 1e-12
    ends = ends or stays_off(way, loop.feasible, steepest, loop.violation, loop.restored)
    slows = loop.iteration >= loop.check_at and loop.violation > 0.99 * loop.check_violation
    if (ends or slows) and task.watched and loop.iteration < loop.limit:
        # A contact may have moved to where a given one is, to which no clearance applies.
        loop.changed = update_again(program.store, program.lifted, iterates.current, EVERYTHING)
        if loop.changed:
            loop.iteration += 1
            return False, False
    if ends:
        if loop.kicks < KICKS and leave_saddle(program, iterates.current, iterates.trial, loop.kicks, system):
            loop.kicks += 1
            loop.iteration += 1
            return False, True
        if loop.violation > TOUCHING or task.watched or not task.any_pose or is_stuck(way):
            loop.status = INFEASIBLE if contradicts(way, loop.feasible, loop.violation) else STALLED
            loop.over = 1
            return False, False
    if ends or slows:
        if task.leads_back and not task.watched:
            lead_back(loop, STALLED)
        else:
            loop.status = STALLED
        return False, False
    if loop.iteration >= loop.check_at:
        check_later(loop)
    return True, False
