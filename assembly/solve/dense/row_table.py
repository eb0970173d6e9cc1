"""Rows, their dense Jacobian and the objective's gradient at a state: what diagnosis and statics look at.

Columns are twists of all bodies in the scene's order, fixed ones too, lengths over the scene's size; then four
coordinates of every contact whose pair is at a fold (`proximity/extrema/lifted_pair.py`). Rows are those of the
program, then four of tangency for every such contact.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store
from assembly.constraints.program.contact import copy_tracked
from assembly.constraints.program.evaluate import evaluate
from assembly.constraints.program.objective_terms import objective
from assembly.constraints.program.records import (
    EXTRA_COLUMN,
    JOINT_ROW,
    ROW,
    TAPE_RECORD,
    Iterate,
    LiftedPairs,
    Program,
    TapeWorkspace,
    body_coordinate_at,
    header_at,
    jacobian_row_at,
    joint_row_at,
    row_at,
    tape_at,
    trim_row_at,
)
from assembly.proximity.extrema.lifted_pair import VARIABLES, VECTORS
from assembly.proximity.features.solid_contact import CONTACT_RECORD, TRACK
from assembly.solve.loop.contacts import lift_folds, start_contacts
from assembly.solve.loop.line_search import goal
from assembly.solve.loop.parameters import LIFT_BELOW
from assembly.solve.loop.report import read_tracked, scaled_poses, write_tracked
from assembly.solve.loop.residuals import arrange, shape_of, size_of_shape

# A point of the loop at a state. lost: a contact without a pair there; -1: there is none, and all rows are evaluated;
# count: how many contacts are at folds; iterate: the iterate; program: its rows and unknowns have no places yet.
PointFound = namedtuple("PointFound", "lost count iterate program")


@kernel(inner=True)
def spread_block(packed, r, column, body, out):
    """The six entries of row r from `column` on, to the twist of a body; -1 is none."""
    if body >= 0:
        for k in range(6):
            out[r, 6 * body + k] += packed[r, column + k]


@kernel(inner=True)
def spread_lifted(packed, r, at, out):
    """The entries of row r for a lifted pair's coordinates, to the columns from `at` on."""
    row = jacobian_row_at(packed, r)
    for j in range(4):
        out[r, at + j] = row.lifted[j]


@kernel(inner=True)
def spread_rows(table, free, count, packed, out):
    """All rows of the program's Jacobian, from the twists of their own bodies to all columns."""
    header = header_at(table, 0)
    m = header.rows
    for r in range(m + 4 * count):
        for j in range(out.shape[1]):
            out[r, j] = 0.0
    for r in range(m):
        row = header.row_table + ROW * r
        spread_block(packed, r, 0, row_at(table, row).body_f, out)
        spread_block(packed, r, 6, row_at(table, row).body_g, out)
        second = joint_row_at(table, row).second
        if row_at(table, row).kind == JOINT_ROW and second >= 0:
            spread_block(packed, r, EXTRA_COLUMN, body_coordinate_at(table, second).body_f, out)
            spread_block(packed, r, EXTRA_COLUMN + 6, body_coordinate_at(table, second).body_g, out)
    for k in range(header.contacts):
        if free[k] >= 0:
            row = header.row_table + ROW * k
            e = m + 4 * free[k]
            at = 6 * header.bodies + 4 * free[k]
            for i in range(4):
                spread_block(packed, e + i, 0, row_at(table, row).body_f, out)
                spread_block(packed, e + i, 6, row_at(table, row).body_g, out)
                spread_lifted(packed, e + i, at, out)
            spread_lifted(packed, k, at, out)
    for r in range(header.contacts, header.contacts + header.trims):
        k = trim_row_at(table, header.row_table + ROW * r).contact
        if free[k] >= 0:
            spread_lifted(packed, r, 6 * header.bodies + 4 * free[k], out)
    for t in range(header.tapes):
        tape = tape_at(table, header.tape_table + TAPE_RECORD * t)
        for v in range(tape.values):
            for b in range(2, tape.bodies):
                body = table[tape.body_list + b]
                spread_block(packed, tape.first_row + v, EXTRA_COLUMN + 6 * (b - 2), body, out)


@kernel(inner=True, allocates=True)
def new_point(table):
    """Room for a point of the loop, with as many rows as there can be."""
    header = header_at(table, 0)
    pairs = header.contacts
    most = header.rows + 4 * pairs
    records = np.ones((pairs + header.joints + header.vector_trims, CONTACT_RECORD))
    packed = np.zeros((most, EXTRA_COLUMN + 6 * header.extra))
    tracked = np.empty((header.tracked, TRACK))
    return Iterate(np.empty((header.bodies, 7)), tracked, records, np.zeros(most), packed)


@kernel(inner=True, allocates=True)
def point_at(store, state, free):
    """A point of the loop at a state, a `PointFound`.

    Parameters of contacts that are NaN are found by a global start; pairs at folds are lifted, as in the loop.
    """
    header = header_at(store.table, 0)
    pairs = header.contacts
    tracks = header.tracked
    start = np.empty((tracks, TRACK))
    point = new_point(store.table)
    tracked = point.tracked
    o = header.tape_workspace
    workspace = TapeWorkspace(np.empty(store.table[o]), np.empty(store.table[o + 1]), np.empty(store.table[o + 2]))
    loose = LiftedPairs(
        free,
        np.empty((pairs, 4)),
        np.empty((VECTORS if pairs > 0 else 0, 3, VARIABLES)),
        np.empty((VARIABLES if pairs > 0 else 0, VARIABLES)),
        np.empty((tracks, TRACK)),
        np.empty(0),
    )
    program = Program(store, None, loose, workspace, None)
    scaled_poses(store, state, point.q)
    read_tracked(store.table, state, tracked)
    for k in range(pairs):
        free[k] = -1
    count = 0
    lost = start_contacts(store, point.q, tracked, free, loose.lengths)
    if lost < 0:
        # Every contact counts here, also one that pushes nothing.
        active = np.ones(point.residual.size)
        count = lift_folds(store, loose, point, active, -1.0, -1, False)
        before = -1
        while count != before:
            for k in range(tracks):
                copy_tracked(tracked, k, start)
            lost = evaluate(program, start, math.inf, point)
            before = count
            count = lift_folds(store, loose, point, active, LIFT_BELOW, lost, False)
    return PointFound(lost, count, point, program)


@kernel(inline=True, allocates=True)
def arranged(found, structure, end_effectors):
    """The program of a point that is found, with places of rows and unknowns."""
    return Program(found.program.store, structure, found.program.lifted, found.program.tapes, end_effectors)


@kernel(signatures="(i8[::1], f8[::1], f8[::1], i8[::1], f8[::1], f8[:, ::1])", allocates=True)
def rows_at(table, pool, state, free, residual, jacobian):
    """Evaluate all rows at a state. Returns a contact that has no pair there, or -1.

    state : tracked values are overwritten by those found; NaN parameters of a contact are found by a global start
    free (contacts) : place among the contacts at folds, or -1
    residual (m + 4 contacts), jacobian (m + 4 contacts, 6 bodies + 4 contacts) : as many rows and columns are written
    as there are folds
    """
    header = header_at(table, 0)
    found = point_at(Store(table, pool), state, free)
    lost, count, point = found.lost, found.count, found.iterate
    write_tracked(table, point.tracked, state)
    for r in range(header.rows + 4 * count):
        residual[r] = point.residual[r]
    if lost < 0:
        spread_rows(table, free, count, point.jacobian, jacobian)
    return lost


@kernel(signatures="(i8[::1], f8[::1], f8[::1], i8[::1], f8[::1], none)", allocates=True)
def gradient_at(table, pool, state, free, gradient, end_effectors):
    """The objective's gradient in the twists of all bodies (6 bodies), zero for fixed ones. Returns its value.

    `end_effectors` is None where no term is a dexterity. Dexterities are left out where a contact has no pair.
    """
    store = Store(table, pool)
    header = header_at(table, 0)
    found = point_at(store, state, free)
    integers, doubles = size_of_shape(table, header.rows + 4 * found.count, 6 * header.moving + 4 * found.count)
    # The blocks outlive what is carved from them: they are arguments of the kernel that carves.
    return slopes_at(store, free, found, end_effectors, gradient, np.empty(integers, np.int64), np.empty(doubles))


@kernel(inner=True, allocates=True)
def slopes_at(store, free, found, end_effectors, gradient, integers, doubles):
    """`gradient_at`, at a point that `point_at` found, with blocks of integers and doubles to work in."""
    header = header_at(store.table, 0)
    lost, count, point = found.lost, found.count, found.iterate
    rows = header.rows + 4 * count
    n = 6 * header.moving + 4 * count
    shape = shape_of(store.table, rows, n, store.table[:0], integers, doubles)
    arrange(store.table, free, shape, rows, n)
    program = arranged(found, shape, end_effectors)
    slopes = np.empty(n)
    curves = np.empty((n, n))
    if lost < 0:
        value = goal(program, rows, point, 1, slopes, curves)
    else:
        value = objective(store, point.q, 1, program.tapes, shape.sparsity, slopes, curves)
    for b in range(header.bodies):
        s = store.table[header.unknown_blocks + b]
        for k in range(6):
            gradient[6 * b + k] = slopes[6 * s + k] if s >= 0 else 0.0
    return value
