"""Back from where bodies have sunk into each other: from there rows lead out on either side, the far one as well.

A step may go as far as bodies may between looks, and a contact may slide around a thin wire on the way. Where bodies
are deeper in each other than half of what bends most there is no telling on which side they were, and where they cross
unseen no row says so. The solve goes back to the last pose at which nothing crossed, and on from there on a leash.

A solve that gets no further goes back to such a pose, too, and begins again there. Which contacts are listed depends on
the way it came: one that ends where bodies touch holds every step, and steps that are cut again and again leave short
ones behind. A solve that begins there has neither.
"""

from __future__ import annotations

from assembly._kernel import kernel
from assembly.constraints.program.records import (
    ROW,
    contact_row_at,
    header_at,
)
from assembly.proximity.manager.update import AS_NEEDED, any_crossed
from assembly.solve.loop.clearances import forget_clearance_rows, place_clearance_rows, update_around
from assembly.solve.loop.report import bring_back

# Deeper than this part of how far bodies may go in one step, which is half the least radius of theirs.
DEEP = 1.0
# How much shorter steps are after one that led too deep; as often as another pose is clear they may be twice as long.
SHORTER, LONGER = 0.25, 2.0
# So often at most a solve that gets no further begins again, while so many of its steps are left.
BEGINNINGS, LEFT = 3, 20


@kernel(inner=True)
def has_sunk(store, memory, residual):
    """Whether bodies are deep in each other, or where no contact says so.

    Of solids rows lead out the way they came: corners stay on their faces.
    """
    header = header_at(store.table, 0)
    for k in range(header.guards):
        r = header.first_guard + k
        row = contact_row_at(store.table, header.row_table + ROW * r)
        if row.guard_number > 0 and row.shell_f < 0:
            # How far bodies may go in one step is behind the least gap, which the residual is less.
            at = row.minimum
            if residual[r] + store.pool[at] < -DEEP * store.pool[at + 1]:
                return True
    return any_crossed(store.table, header.watch, memory)


@kernel(inner=True)
def begin_again(store, held, lifted, current, y, better_y):
    """Back to the pose that is held. Its contacts are found anew; no row has pushed yet."""
    header = header_at(store.table, 0)
    memory, free = lifted.memory, lifted.free
    bring_back(held, header.rows, current, y)
    forget_clearance_rows(store.table, memory)
    update_around(store, memory, current, AS_NEEDED)
    place_clearance_rows(store.table, memory, current, y, better_y, free, False)
    for r in range(header.rows):
        y[r] = 0.0
        better_y[r] = 0.0
