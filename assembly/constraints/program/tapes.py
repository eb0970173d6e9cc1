"""Rows of users' expressions: their tapes (`geometry/expression/tape.py`) run at poses, with first and second
derivatives.

What runs a tape is large, and called by its address.
"""

from __future__ import annotations

import math

from assembly._address import call_address
from assembly._kernel import kernel
from assembly.constraints.program.hessian_blocks import spot
from assembly.constraints.program.records import (
    EXTRA_COLUMN,
    ONE_SIDED,
    REFERENCE,
    ROW,
    ROW_TABLE,
    RUN_TAPE_AT,
    SCALE,
    SLOTS,
    TAPE_BODIES,
    TAPE_FIRST,
    TAPE_LIST,
    TAPE_ROW_AT,
    TAPE_SCALE,
    TAPE_SECOND,
    TAPE_VALUES,
)
from assembly.geometry.expression.tape import run_tape


@kernel(signatures="(i8[::1], f8[::1], i8, f8[::1], f8[::1], f8[::1])")
def run_scene_tape(table, pool, o, x, work, y):
    """`run_tape`, for who calls it by its address."""
    run_tape(table, pool, o, x, work, y)
    return 0


@kernel(inner=True)
def place_tape(table, pool, tape, q, room):
    """The poses of a tape's bodies, in the user's units, to the front of its room. Returns where its inputs end."""
    size = pool[SCALE]
    for b in range(table[tape + TAPE_BODIES]):
        body = table[table[tape + TAPE_LIST] + b]
        for i in range(3):
            room[7 * b + i] = q[body, i] * size + pool[REFERENCE + i]
        for i in range(3, 7):
            room[7 * b + i] = q[body, i]
    return 7 * table[tape + TAPE_BODIES]


@kernel(inner=True)
def tape_rows(table, pool, tape, q, room, residual, jacobian):
    """All rows of a tape; a value or a slope that is not finite is an infinite violation, of one side too."""
    inputs, outputs, work = room
    place_tape(table, pool, tape, q, inputs)
    call_address(table[RUN_TAPE_AT], (table, pool, table[tape + TAPE_FIRST], inputs, work, outputs))
    m = table[tape + TAPE_VALUES]
    count = table[tape + TAPE_BODIES]
    each = 1.0 / pool[table[tape + TAPE_SCALE]]
    size = pool[SCALE]
    for v in range(m):
        r = table[tape + TAPE_ROW_AT] + v
        nowhere = -math.inf if table[table[ROW_TABLE] + ROW * r + ONE_SIDED] == 1 else math.inf
        residual[r] = outputs[v] * each if math.isfinite(outputs[v]) else nowhere
        for b in range(count):
            at = m + 6 * (count * v + b)
            column = 6 * b if b < 2 else EXTRA_COLUMN + 6 * (b - 2)
            for i in range(3):
                jacobian[r, column + i] = outputs[at + i] * each * size
                jacobian[r, column + 3 + i] = outputs[at + 3 + i] * each
                if not (math.isfinite(outputs[at + i]) and math.isfinite(outputs[at + 3 + i])):
                    residual[r] = nowhere


@kernel(inner=True)
def add_tape_hessian(table, pool, tape, q, room, order, y, hessian):
    """Upper triangle of hessian += second derivative of y . rows, for the rows of a tape."""
    inputs, outputs, work = room
    m = table[tape + TAPE_VALUES]
    count = table[tape + TAPE_BODIES]
    each = 1.0 / pool[table[tape + TAPE_SCALE]]
    size = pool[SCALE]
    end = place_tape(table, pool, tape, q, inputs)
    for v in range(m):
        inputs[end + v] = y[table[tape + TAPE_ROW_AT] + v] * each
    call_address(table[RUN_TAPE_AT], (table, pool, table[tape + TAPE_SECOND], inputs, work, outputs))
    for b in range(count):
        at = 6 * table[table[SLOTS] + table[table[tape + TAPE_LIST] + b]]
        for c in range(count):
            other = 6 * table[table[SLOTS] + table[table[tape + TAPE_LIST] + c]]
            if at < 0 or other < at:
                continue
            row, column = spot(order, at, other)
            for i in range(6):
                for j in range(6):
                    factor = (size if i < 3 else 1.0) * (size if j < 3 else 1.0)
                    hessian[row + i, column + j] += factor * outputs[6 * count * (6 * b + i) + 6 * c + j]
