"""What a tick leaves for the next one, which begins at the same poses: its rows with their first derivatives.

whether there is something | poses, as in the state | of every contact: number, residual, record, gradient
"""

from __future__ import annotations

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.constraints.program.contact import contact_of, idle_row
from assembly.constraints.program.records import FREE_COLUMN, header_at
from assembly.proximity.features.solid_contact import CONTACT_RECORD

# What is left of a contact.
WARM_CONTACT_RECORD = record_dtype(
    "f8",
    number=1,  # of a clearance's contact; 0: of none
    residual=1,
    record=CONTACT_RECORD,  # its row of records (`solid_contact.py`)
    gradient=FREE_COLUMN,  # of the residual, in the twists of both bodies
)
warm_contact_at = record_view(WARM_CONTACT_RECORD)
WARM_CONTACT = size_of(WARM_CONTACT_RECORD)


@kernel(inline=True)
def warm_start_size(bodies, pairs):
    """Doubles of what is left."""
    return 1 + 7 * bodies + WARM_CONTACT * pairs


@kernel(inline=True)
def is_simple(table):
    """Whether all rows are contacts; others have values that change between ticks."""
    header = header_at(table, 0)
    return header.rows == header.contacts and header.tracked == header.contacts and header.joints == 0


@kernel(inline=True)
def warm_start(table, state, at, point):
    """Take over the rows that were left at these poses, with these contacts. Whether there were."""
    header = header_at(table, 0)
    if state[at] != 1.0 or not is_simple(table):
        return False
    for k in range(7 * header.bodies):
        if state[at + 1 + k] != state[k]:
            return False
    o = at + 1 + 7 * header.bodies
    for r in range(header.contacts):
        if warm_contact_at(state, o + WARM_CONTACT * r).number != float(contact_of(table, r).clearance_number):
            return False
    for r in range(header.contacts):
        if contact_of(table, r).body_f < 0:
            idle_row(r, 1.0, point)
            continue
        left = warm_contact_at(state, o + WARM_CONTACT * r)
        point.residual[r] = left.residual
        for i in range(CONTACT_RECORD):
            point.records[r, i] = left.record[i]
        for i in range(FREE_COLUMN):
            point.jacobian[r, i] = left.gradient[i]
    return True


@kernel(inline=True)
def leave(table, state, at, point, good):
    """Leave the rows of a point whose poses are in the state, if they are `good`."""
    header = header_at(table, 0)
    state[at] = 0.0
    if not good or not is_simple(table):
        return
    state[at] = 1.0
    for k in range(7 * header.bodies):
        state[at + 1 + k] = state[k]
    o = at + 1 + 7 * header.bodies
    for r in range(header.contacts):
        left = warm_contact_at(state, o + WARM_CONTACT * r)
        contact = contact_of(table, r)
        left.number = float(contact.clearance_number)
        if contact.body_f < 0:
            continue
        left.residual = point.residual[r]
        for i in range(CONTACT_RECORD):
            left.record[i] = point.records[r, i]
        for i in range(FREE_COLUMN):
            left.gradient[i] = point.jacobian[r, i]
