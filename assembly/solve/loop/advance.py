"""The last phases of a step: its direction, the line search along it, and the acceptance of its result."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.constraints.program.contact import TOUCHING, is_of_solids
from assembly.constraints.program.records import header_at
from assembly.proximity.manager.update import AS_NEEDED, MEASURED
from assembly.solve.loop.clearances import allowed_share, update_again
from assembly.solve.loop.deadline import is_cut, may_end
from assembly.solve.loop.direction import find_direction, first_shift, propose, short_share
from assembly.solve.loop.inertia import note_factor
from assembly.solve.loop.line_search import Line, Trust, search_line
from assembly.solve.loop.loop_state import lead_back
from assembly.solve.loop.parameters import HALF, OFTEN, RESTORATIONS, SHORTEST
from assembly.solve.loop.residuals import violation_of
from assembly.solve.loop.restore import begin_restoration
from assembly.solve.loop.settings import OUT_OF_TIME, RUNNING, STALLED
from assembly.solve.loop.standstill import bound_nearby, update_floor


@kernel(inline=True)
def find_step(task, current, trial, rows, system):
    """Compute the step, and the part of it to try. Returns whether there is one."""
    loop, program, restoring = task.loop, task.program, task.loop.restoring == 1
    reach = min(loop.radius, loop.leash)
    if restoring:
        reach = min(reach, bound_nearby(task.way, loop.violation, loop.restored))
    loop.shift = first_shift(program, restoring, loop.shift, loop.violation, loop.dual)
    damps = header_at(program.store.table, 0).contacts == 0 or loop.cuts >= OFTEN
    trust = Trust(loop.shift, min(reach, loop.cut_length), damps)
    shift, used, longest, turn = find_direction(program, current, rows, system, trust, restoring, task.tick)
    loop.shift, loop.used_shift, loop.longest = shift, used, longest
    if used < 0.0:
        loop.status = STALLED
        return False
    if loop.iteration == 0:
        task.result.first_shift = shift
    if not task.tick:
        note_factor(task.results, rows, program.structure.one_sided, shift, loop.dual, restoring)
    loop.last_violation, loop.last_dual = loop.violation, loop.dual
    loop.measured = 0
    loop.cut, loop.may_go = short_share(reach, longest, turn), 1
    return not task.watched or cut_to_motion_bounds(task, current, trial, system)


@kernel(inline=True)
def cut_to_motion_bounds(task, current, trial, system):
    """Cut the step to the motion bounds. Returns whether to try it: a tick may update the manager first, or end."""
    loop, program = task.loop, task.program
    store, memory, step = program.store, program.lifted.memory, system.directions.step
    most_of_it = loop.cut
    loop.cut, loop.may_go = allowed_share(store, memory, current, trial, step, most_of_it)
    if task.tick and not loop.may_go and loop.asked_at != loop.iteration:
        # If a step would go beyond motion bounds, a tick updates the pairs that would use much of theirs.
        if may_end(store.table, task.settings, memory, (loop.begin, loop.updates), loop.iteration, HALF):
            loop.status, loop.over = OUT_OF_TIME, 1
            loop.violation = loop.violation if loop.iteration > 0 else math.inf
            return False
        loop.asked_at = loop.iteration
        loop.changed = update_again(store, program.lifted, current, AS_NEEDED | MEASURED)
        if loop.changed or is_cut(store.table, memory):
            return False
        loop.cut, loop.may_go = allowed_share(store, memory, current, trial, step, most_of_it)
    return True


@kernel(inline=True)
def take_step(task, current, trial, rows, system):
    """Line search along the step, into the trial iterate. Returns whether that becomes the next iterate."""
    loop = task.loop
    restoring = loop.restoring == 1
    loop.restored = loop.violation if restoring else math.inf
    loop.longest *= loop.cut
    loop.cuts = loop.cuts + 1 if task.watched and loop.cut < 0.5 and loop.violation <= TOUCHING else 0
    loop.cut_length = 2.0 * loop.longest if loop.cuts > 0 else math.inf
    line = Line(loop.slope, loop.longest, not task.tick, loop.may_go == 1)
    accepted, alpha, lost = search_line(task.program, current, trial, rows, system, line, loop.value, restoring)
    loop.measured, loop.alpha, loop.lost = accepted, alpha, lost
    if not accepted:
        refuse(task)
    return accepted


@kernel(inline=True)
def refuse(task):
    """If no part of a step was accepted: lift a pair, restore rows, lead back, or end."""
    loop, free = task.loop, task.program.lifted.free
    table = task.program.store.table
    pairs = header_at(table, 0).contacts
    if loop.lost >= 0 and free[loop.lost] < 0 and not is_of_solids(table, loop.lost):
        # An update may replace it by another contact, again and again.
        loop.lifts += 1
        loop.iteration += 1 if loop.lifts > pairs else 0
        return
    loop.lost = -1
    if not loop.restoring and loop.violation > loop.feasible and loop.restorations < RESTORATIONS:
        begin_restoration(loop)
    elif task.leads_back and loop.ended == RUNNING and loop.violation > loop.feasible:
        lead_back(loop, STALLED)
    else:
        loop.status = STALLED


@kernel(inline=True)
def accept(task, current, trial, rows, system):
    """Multipliers at the trial iterate, the next penalty, and how long the next step may be."""
    loop = task.loop
    propose(task.program.structure, current, rows, system.directions.straight, loop.alpha)
    loop.iteration += 1
    if loop.alpha < 1.0:
        loop.radius = max(2.0 * loop.alpha * loop.longest, SHORTEST)
        return
    is_whole = loop.cut == 1.0 and loop.used_shift == loop.shift
    if is_whole:
        off = violation_of(trial.residual, task.program.structure.one_sided, rows.count)
        slow = loop.mu == loop.floor and off > max(0.5 * loop.violation, loop.feasible)
        loop.floor = update_floor(task.way, loop.floor, slow and not task.tick)
        loop.mu = max(0.1 * loop.mu, loop.floor)
    loop.radius = min(2.0 * loop.radius, 1e6)
