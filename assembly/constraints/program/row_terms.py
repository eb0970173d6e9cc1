"""What rows add to a Hessian, dense or in blocks: second derivative of y . rows, weighted squares of their gradients.

`bases` has the unknowns that the columns of a row belong to (`solve/loop/residuals.py`); the blocks of large scenes are
in `constraints/program/hessian_blocks.py`. A lifted pair (`proximity/extrema/lifted_pair.py`) has unknowns of its own
and four rows of tangency.
"""

from __future__ import annotations

from assembly._address import call_address
from assembly._kernel import kernel
from assembly.constraints.program.coordinate_hessian import add_coordinate_hessian
from assembly.constraints.program.hessian_blocks import add_patch, block_row, clear_patch, is_blocked
from assembly.constraints.program.records import (
    COORDINATE,
    EXTRA_COLUMN,
    JOINT_ROW,
    ROW,
    TAPE_RECORD,
    coordinate_at,
    header_at,
    joint_row_at,
    row_at,
    tape_at,
)
from assembly.constraints.program.tapes import add_tape_hessian
from assembly.proximity.extrema.rates import add_gap_terms


@kernel(inline=True)
def column_of(b):
    """First column of block b of a row: twists of f and g, coordinates of a lifted pair, further twists."""
    return 6 * b if b <= 2 else EXTRA_COLUMN + 6 * (b - 3)


@kernel(inline=True)
def width(b):
    """The number of columns of block b."""
    return 4 if b == 2 else 6


@kernel(inner=True)
def add_gram(bases, jacobian, r, weight, hessian):
    """Upper triangle of hessian += weight J_r^T J_r, for a row r of two or more bodies."""
    for b in range(bases.shape[1]):
        at = bases[r, b]
        if at < 0:
            continue
        column, height = column_of(b), width(b)
        for c in range(bases.shape[1]):
            other = bases[r, c]
            if other < at:
                continue
            across, breadth = column_of(c), width(c)
            for i in range(height):
                s = weight * jacobian[r, column + i]
                if s != 0.0:
                    for j in range(breadth):
                        hessian[at + i, other + j] += s * jacobian[r, across + j]


@kernel(inner=True)
def add_gram_blocks(blocks, bases, jacobian, r, weight, hessian):
    """As `add_gram`, for a Hessian in blocks, where no pair is lifted."""
    for b in range(bases.shape[1]):
        at = bases[r, b]
        if at < 0:
            continue
        column = column_of(b)
        for c in range(bases.shape[1]):
            other = bases[r, c]
            if other < at:
                continue
            across = column_of(c)
            row = block_row(blocks, at, other)
            for i in range(6):
                s = weight * jacobian[r, column + i]
                for j in range(6):
                    hessian[row + i, j] += s * jacobian[r, across + j]


@kernel(inline=True)
def add_square(order, bases, jacobian, r, weight, hessian):
    """Upper triangle of hessian += weight J_r^T J_r, for a Hessian dense or in blocks."""
    if is_blocked(order):
        add_gram_blocks(order.blocks, bases, jacobian, r, weight, hessian)
    else:
        add_gram(bases, jacobian, r, weight, hessian)


@kernel(inner=True)
def add_coordinate(asked, records, k, y, order, hessian, f, g):
    """As `add_coordinate_hessian`, for a Hessian dense or in blocks."""
    if is_blocked(order):
        at_f, at_g = clear_patch(order, f, g)
        add_coordinate_hessian(asked.kind, asked.component, records, k, y, order.scratch[1:], at_f, at_g)
        add_patch(order, f, g, hessian)
    else:
        add_coordinate_hessian(asked.kind, asked.component, records, k, y, hessian, f, g)


@kernel(inner=True)
def add_row_terms(program, point, y, weights, hessian):
    """Upper triangle of hessian += second derivative of y . rows + J^T diag(weights) J.

    The row of a lifted pair adds the terms of its rows of tangency as well.
    """
    store, lifted = program.store, program.lifted
    header = header_at(store.table, 0)
    records, jacobian = point.records, point.jacobian
    bases, order = program.structure.bases, program.structure.sparsity
    blocked = is_blocked(order)
    pairs = header.contacts
    for r in range(pairs):
        if lifted.free[r] >= 0:
            call_address(header.free_terms_address, (store, r, lifted, point, y, weights, hessian))
        elif blocked and (y[r] != 0.0 or weights[r] != 0.0):
            f, g = clear_patch(order, bases[r, 0], bases[r, 1])
            add_gap_terms(records, jacobian, r, y[r], weights[r], order.scratch[1:], f, g)
            add_patch(order, bases[r, 0], bases[r, 1], hessian)
        elif y[r] != 0.0 or weights[r] != 0.0:
            add_gap_terms(records, jacobian, r, y[r], weights[r], hessian, bases[r, 0], bases[r, 1])
    for r in range(pairs, pairs + header.trims):
        if weights[r] != 0.0:
            add_gram(bases, jacobian, r, weights[r], hessian)
        if y[r] != 0.0:
            call_address(header.trim_terms_address, (store, r, lifted, bases, point, y[r], hessian))
    for r in range(pairs + header.trims, header.rows):
        if weights[r] != 0.0:
            add_square(order, bases, jacobian, r, weights[r], hessian)
        row = header.row_table + ROW * r
        joint = joint_row_at(store.table, row)
        if y[r] == 0.0 or row_at(store.table, row).kind != JOINT_ROW:
            continue
        second = joint.second
        for part in range(1 if second < 0 else 2):
            asked = coordinate_at(store.table, row + COORDINATE if part == 0 else second)
            f = bases[r, 0 if part == 0 else 3]
            g = bases[r, 1 if part == 0 else 4]
            k = pairs + asked.joint
            factor = y[r] * store.pool[joint.parameters + part]
            add_coordinate(asked, records, k, factor, order, hessian, f, g)
    for t in range(header.tapes):
        tape = header.tape_table + TAPE_RECORD * t
        expression = tape_at(store.table, tape)
        idle = True
        for v in range(expression.values):
            idle = idle and y[expression.first_row + v] == 0.0
        if not idle:
            add_tape_hessian(store, tape, point.q, program.tapes, order, y, hessian)
