"""Return to the last pose at which nothing crossed, because from crossed poses rows may lead out on the far side.

In a step bodies may go as far as their motion bounds allow, and a contact may slide around a thin wire on the way.
Where bodies overlap by more than half their least radius of curvature, the side they came from is unknown, and where
they cross without a listed contact, no row says so. The solve goes back to the last pose at which nothing crossed, and
its next steps are bounded by the loop's `leash`.

A solve that makes no progress returns to such a pose, too, and begins again there. Which contacts are listed depends on
its path so far: a contact that ends where bodies touch blocks every step, and steps that were cut again and again leave
a short radius. A solve that begins anew there has neither.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.constraints.program.contact import contact_of
from assembly.constraints.program.records import header_at
from assembly.proximity.manager.update import AS_NEEDED, any_crossed
from assembly.solve.loop.clearances import forget_clearance_rows, place_clearance_rows, update_around
from assembly.solve.loop.finish import return_to
from assembly.solve.loop.parameters import BEGINNINGS, DEEP, LEFT, PATIENCE, SHORTER, SHORTEST
from assembly.solve.loop.report import bring_back
from assembly.solve.loop.settings import RUNNING, STALLED
from assembly.solve.loop.workspace import rows_in


@kernel(inner=True)
def has_sunk(store, memory, residual):
    """Whether bodies overlap deeply, or without a contact that shows it.

    For solids, rows lead bodies back out the way they came: corners stay on their faces.
    """
    header = header_at(store.table, 0)
    for k in range(header.clearance_rows):
        r = header.first_clearance_row + k
        row = contact_of(store.table, r)
        if row.clearance_number > 0 and row.shell_f < 0:
            # The residual is the gap minus the least gap.
            at = row.minimum
            if residual[r] + store.pool[at] < -DEEP * store.pool[at + 1]:
                return True
    return any_crossed(store.table, header.manager_record, memory)


@kernel(inner=True)
def begin_again(store, held, lifted, current, rows):
    """Return to the last feasible pose. Its contacts are found anew; multipliers are zero."""
    header = header_at(store.table, 0)
    bring_back(held, rows, current)
    forget_clearance_rows(store.table, lifted.memory)
    update_around(store, lifted.memory, current, AS_NEEDED)
    place_clearance_rows(store.table, lifted, current, rows, False)
    for r in range(header.rows):
        rows.y[r] = 0.0
        rows.better_y[r] = 0.0


@kernel(inline=True)
def must_roll_back(task):
    """Whether bodies have sunk into each other, and there is a pose to return to."""
    loop = task.loop
    return loop.sunk and loop.holds and loop.ended == RUNNING and loop.iteration < loop.limit


@kernel(inline=True)
def roll_back(task, held, current, rows):
    """Return to the last feasible iterate, and continue from there with shorter steps."""
    loop = task.loop
    loop.leash = SHORTER * min(loop.leash, loop.alpha * loop.longest)
    if loop.leash < SHORTEST:
        loop.status = STALLED
        return
    return_to(task.program, held, rows, current, task.tick)
    # Rows of tangency belong to other pairs now.
    loop.rows = header_at(task.program.store.table, 0).rows
    loop.measured, loop.changed = 0, 1
    loop.iteration += 1
    loop.back_at = loop.iteration


@kernel(inline=True)
def restart(task, held, current, rows):
    """Let a solve that makes no progress begin again at its last feasible iterate. Whether it does."""
    loop, limits = task.loop, task.limits
    may_begin = task.watched and not task.tick and loop.holds and loop.begun < BEGINNINGS
    if loop.status != STALLED or loop.over or not may_begin or loop.iteration + LEFT > loop.limit:
        return False
    loop.rows, loop.mu = header_at(task.program.store.table, 0).rows, limits.penalty
    begin_again(task.program.store, held, task.program.lifted, current, rows_in(loop, rows))
    loop.measured, loop.changed = 0, 1
    loop.begun += 1
    loop.iteration += 1
    loop.status = loop.ended = RUNNING
    loop.radius, loop.leash, loop.shift, loop.last_dual = limits.radius, math.inf, 0.0, math.inf
    loop.restoring = loop.restorations = loop.cuts = 0
    loop.cut_length = loop.check_violation = math.inf
    loop.check_at = loop.iteration + PATIENCE
    loop.lost = -1
    return True
