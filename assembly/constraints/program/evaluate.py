"""Evaluation of the rows of a packed scene and their first derivatives.

A row of a joint is c_1 coordinate_1 + c_2 coordinate_2 - value (`constraints/program/primitives.py`), a row of a trim
is the signed distance of a contact to a loop (`proximity/features/trim_distance.py`), and rows of a tape are the values
of a user's expression (`geometry/expression/tape.py`). Rows of contacts are in `constraints/program/contact.py`, second
derivatives in `row_terms.py`, and the layout of the records in `constraints/program/records.py`.
"""

from __future__ import annotations

from assembly._address import call_address
from assembly._kernel import kernel
from assembly.constraints.program.contact import copy_tracked
from assembly.constraints.program.primitives import coordinate, place_frames, write_gradient
from assembly.constraints.program.records import (
    COORDINATE,
    EXTRA_COLUMN,
    JOINT_RECORD,
    JOINT_ROW,
    ROW,
    TAPE_RECORD,
    coordinate_at,
    header_at,
    joint_at,
    joint_row_at,
    row_at,
)
from assembly.constraints.program.tapes import tape_rows


@kernel(inline=True)
def coordinate_row(asked, k, factor, start, point, r, column):
    """Return `factor` times a coordinate of record k, write its gradient to row r from `column`, track its angle."""
    angle = asked.angle
    near = start[angle, 0] if angle >= 0 else 0.0
    found = coordinate(asked.kind, asked.component, point.records, k, near)
    if angle >= 0:
        point.tracked[angle, 0] = found.value
    write_gradient(found.n, found.arm_f, found.arm_g, found.h, factor, point.jacobian, r, column)
    return factor * found.value


@kernel(inline=True)
def joint_row(store, r, start, point):
    """Row r, of a joint."""
    header = header_at(store.table, 0)
    row = header.row_table + ROW * r
    joint = joint_row_at(store.table, row)
    o = joint.parameters
    second = joint.second
    value = -store.pool[o + 2]
    for part in range(1 if second < 0 else 2):
        asked = coordinate_at(store.table, row + COORDINATE if part == 0 else second)
        column = 0 if part == 0 else EXTRA_COLUMN
        value += coordinate_row(asked, header.contacts + asked.joint, store.pool[o + part], start, point, r, column)
    point.residual[r] = value


@kernel(inner=True)
def evaluate(program, start, patience, point):
    """Evaluate all rows at the point's poses. Returns the contact whose pair was lost, or -1.

    `start` has the tracked values to begin from. All of `point`, an `Iterate`, is written except its poses.
    """
    store, lifted = program.store, program.lifted
    header = header_at(store.table, 0)
    pairs = header.contacts
    for r in range(pairs):
        if lifted.free[r] >= 0:
            call_address(header.free_row_address, (store, r, start, lifted, point))
    if pairs > 0:
        lost = call_address(header.contact_rows_address, (store, start, patience, lifted.free, point))
        if lost >= 0:
            return lost
    for k in range(pairs, header.tracked):
        # No row updates an angle that only a dexterity uses, nor the sides of loops: their values are copied.
        copy_tracked(start, k, point.tracked)
    if header.trims > 0:
        call_address(header.trim_rows_address, (store, lifted, point))
    for k in range(header.joints):
        joint = joint_at(store.table, header.joint_table + JOINT_RECORD * k)
        place_frames(store.pool, joint.frames, point.q, joint.body_f, joint.body_g, point.records, pairs + k)
    for r in range(pairs, header.rows):
        if row_at(store.table, header.row_table + ROW * r).kind == JOINT_ROW:
            joint_row(store, r, start, point)
    for t in range(header.tapes):
        tape_rows(store, header.tape_table + TAPE_RECORD * t, program.tapes, point)
    return -1
