"""Rows of users' expressions: their tapes (`geometry/expression/tape.py`) run at poses, with first and second
derivatives.

The kernel that runs a tape is large and therefore called by its address.
"""

from __future__ import annotations

import math

from assembly._address import call_address
from assembly._kernel import kernel
from assembly._record import Store
from assembly.constraints.program.hessian_blocks import spot
from assembly.constraints.program.records import EXTRA_COLUMN, ROW, header_at, pool_header_at, row_at, tape_at
from assembly.geometry.expression.tape import run_tape


@kernel(signatures="(i8[::1], f8[::1], i8, f8[::1], f8[::1], f8[::1])")
def run_scene_tape(table, pool, o, x, work, y):
    """`run_tape`, to be called by its address."""
    run_tape(Store(table, pool), o, x, work, y)
    return 0


@kernel(inner=True)
def place_tape(store, tape, q, workspace):
    """Write the poses of a tape's bodies, in the user's units, to its inputs. Returns where these poses end."""
    units = pool_header_at(store.pool, 0)
    expression = tape_at(store.table, tape)
    size = units.scale
    for b in range(expression.bodies):
        body = store.table[expression.body_list + b]
        for i in range(3):
            workspace[7 * b + i] = q[body, i] * size + units.reference[i]
        for i in range(3, 7):
            workspace[7 * b + i] = q[body, i]
    return 7 * expression.bodies


@kernel(inner=True)
def tape_rows(store, tape, workspace, point):
    """All rows of a tape. A value or slope that is not finite makes the row infinitely violated, one-sided rows too."""
    header = header_at(store.table, 0)
    expression = tape_at(store.table, tape)
    inputs, outputs, work = workspace
    residual, jacobian = point.residual, point.jacobian
    place_tape(store, tape, point.q, inputs)
    call_address(header.run_tape_address, (store.table, store.pool, expression.first_order, inputs, work, outputs))
    m = expression.values
    count = expression.bodies
    each = 1.0 / store.pool[expression.unit]
    size = pool_header_at(store.pool, 0).scale
    for v in range(m):
        r = expression.first_row + v
        nowhere = -math.inf if row_at(store.table, header.row_table + ROW * r).one_sided == 1 else math.inf
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
def add_tape_hessian(store, tape, q, workspace, order, y, hessian):
    """Upper triangle of hessian += second derivative of y . rows, for the rows of a tape."""
    header = header_at(store.table, 0)
    expression = tape_at(store.table, tape)
    inputs, outputs, work = workspace
    m = expression.values
    count = expression.bodies
    each = 1.0 / store.pool[expression.unit]
    size = pool_header_at(store.pool, 0).scale
    end = place_tape(store, tape, q, inputs)
    for v in range(m):
        inputs[end + v] = y[expression.first_row + v] * each
    call_address(header.run_tape_address, (store.table, store.pool, expression.second_order, inputs, work, outputs))
    for b in range(count):
        at = 6 * store.table[header.unknown_blocks + store.table[expression.body_list + b]]
        for c in range(count):
            other = 6 * store.table[header.unknown_blocks + store.table[expression.body_list + c]]
            if at < 0 or other < at:
                continue
            row, column = spot(order, at, other)
            for i in range(6):
                for j in range(6):
                    factor = (size if i < 3 else 1.0) * (size if j < 3 else 1.0)
                    hessian[row + i, column + j] += factor * outputs[6 * count * (6 * b + i) + 6 * c + j]
