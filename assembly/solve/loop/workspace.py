"""The workspace of a solve: arrays in two blocks of memory, of doubles and of integers (`_carve.py`)."""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from assembly._carve import carve
from assembly._kernel import kernel
from assembly.constraints.program.hessian_blocks import blocks_at, is_blocked
from assembly.constraints.program.records import (
    EXTRA_COLUMN,
    RESULTS,
    Iterate,
    LiftedPairs,
    Program,
    TapeWorkspace,
    header_at,
)
from assembly.proximity.extrema.lifted_pair import VARIABLES, VECTORS
from assembly.proximity.features.solid_contact import CONTACT_RECORD, TRACK
from assembly.solve.loop.loop_state import LOOP
from assembly.solve.loop.residuals import arrange, record_of_blocks, shape_of, size_of_shape
from assembly.solve.loop.way_back import WAY

# Numbers per row: residuals at the current and the trial iterate, five fields of `Rows`, one of `Held`.
BY_ROW = 8
# The rows: how many there are now, with those of lifted pairs; mu, whose inverse is the weight of an active row. For
# every row: its multiplier, a proposed one, its weight (0: inactive), its force, whether it is active because a step
# would break it (1 or 0). `gram` is workspace for least-squares multipliers: J J^T, and a right side in its last row.
Rows = namedtuple("Rows", "count mu y better_y active forces foreseen gram")
# The last feasible iterate: poses, tracked values, multipliers, and the numbers of the contacts that clearances had.
Held = namedtuple("Held", "q tracked y numbers")
Iterates = namedtuple("Iterates", "current trial held")
# The linear system of a step: the objective's gradient, vectors, the Hessian of the Lagrangian, its Cholesky factor.
System = namedtuple("System", "gradient directions hessian factor")
# Of all unknowns: right side of the system, or scratch; the step; the step before its second-order correction. Of the
# coordinates of lifted pairs, the last unknowns: 1 where one is held at the end of its patch (`ends.py`), else 0.
Directions = namedtuple("Directions", "descent step straight ends")
# All that a solve works in. `told`: workspace for poses in the user's coordinates (`chord.py`); `way`: what is known of
# a way back (`way_back.py`); `room`: where the system is, with as much as it takes if all pairs are lifted.
Workspace = namedtuple("Workspace", "program iterates rows told way loop system room")


@kernel(inline=True)
def resized(rows, count):
    """The same rows with another count of them."""
    return Rows(count, rows.mu, rows.y, rows.better_y, rows.active, rows.forces, rows.foreseen, rows.gram)


@kernel(inline=True)
def rows_in(loop, rows):
    """The rows with the loop's number of them and its penalty."""
    return Rows(loop.rows, loop.mu, rows.y, rows.better_y, rows.active, rows.forces, rows.foreseen, rows.gram)


@kernel(inline=True)
def penalized(rows, mu):
    """The rows with another penalty."""
    return Rows(rows.count, mu, rows.y, rows.better_y, rows.active, rows.forces, rows.foreseen, rows.gram)


@kernel(inline=True, allocates=True)
def new_rows(count, mu):
    """Newly allocated rows for use outside the loop, which needs only their weights and forces."""
    vectors = np.zeros((5, count))
    return Rows(count, mu, vectors[0], vectors[1], vectors[2], vectors[3], vectors[4], vectors)


@kernel(inline=True, allocates=True)
def results_of(table, state):
    """The results at the end of a state, after poses, tracked values, multipliers and residuals."""
    header = header_at(table, 0)
    end = 7 * header.bodies + TRACK * header.tracked + 2 * header.rows
    return carve(state, end, (state.size - end,))


@kernel(inline=True, allocates=True)
def memory_of(table, state):
    """What the contact manager remembers, behind the results."""
    header = header_at(table, 0)
    end = 7 * header.bodies + TRACK * header.tracked + 2 * header.rows + RESULTS
    return carve(state, end, (state.size - end,))


@kernel(inline=True)
def workspace_needed(table):
    """How many doubles and integers a solve works in: what is carved below, and by `shape_of`."""
    header = header_at(table, 0)
    pairs, bodies, tracks, tapes = header.contacts, header.bodies, header.tracked, header.tape_workspace
    most, n = header.rows + 4 * pairs, 6 * header.moving
    integers, doubles = size_of_shape(table, most, n + 4 * pairs)
    # Poses, tracked values, records, Jacobians, what a row has one of.
    doubles += 28 * bodies + 4 * TRACK * tracks + 2 * record_count(table) * CONTACT_RECORD
    doubles += 2 * most * (EXTRA_COLUMN + 6 * header.extra) + BY_ROW * most
    # Of pairs; of tapes; multipliers of least squares; the way back.
    doubles += 4 * pairs + (3 * VECTORS + VARIABLES) * VARIABLES
    doubles += table[tapes] + table[tapes + 1] + table[tapes + 2] + (most + 1) * most + WAY + LOOP
    # Of unknowns, with those of all pairs: where one is lifted, no Hessian is kept by blocks (`choose_storage`).
    n, blocks = n + 4 * pairs, blocks_at(table, header.block_record)
    by_blocks = header.block_record > 0 and pairs == 0
    doubles += 4 * n + 4 * pairs + (36 * (blocks.blocks + blocks.factored) if by_blocks else 2 * n * n)
    return doubles, integers + pairs + header.clearance_rows


@kernel(inline=True)
def record_count(table):
    """How many records a point has."""
    header = header_at(table, 0)
    return header.contacts + header.joints + header.vector_trims


@kernel(inline=True)
def carve_points(table, most, doubles, integers):
    """The iterates, the rows (`most` at most), room for a guess of tracked values; where the doubles of these end."""
    header = header_at(table, 0)
    bodies, tracks, columns = header.bodies, header.tracked, EXTRA_COLUMN + 6 * header.extra
    poses = carve(doubles, 0, (3, bodies, 7))
    at = 21 * bodies
    tracked = carve(doubles, at, (4, tracks, TRACK))
    at += 4 * tracks * TRACK
    records = carve(doubles, at, (2, record_count(table), CONTACT_RECORD))
    at += 2 * record_count(table) * CONTACT_RECORD
    jacobians = carve(doubles, at, (2, most, columns))
    at += 2 * most * columns
    by_row = carve(doubles, at, (BY_ROW, most))
    at += BY_ROW * most
    by_row[:] = 0.0
    current = Iterate(poses[0], tracked[0], records[0], by_row[0], jacobians[0])
    trial = Iterate(poses[1], tracked[1], records[1], by_row[1], jacobians[1])
    gram = carve(doubles, at, (most + 1, most))
    at += (most + 1) * most
    rows = Rows(header.rows, 0.0, by_row[2], by_row[3], by_row[4], by_row[5], by_row[6], gram)
    held = Held(poses[2], tracked[3], by_row[7], carve(integers, header.contacts, (header.clearance_rows,)))
    return Iterates(current, trial, held), rows, tracked[2], at


@kernel(inline=True)
def carve_pairs(table, guess, memory, doubles, at, integers):
    """Carve what lifted pairs need: which pairs are lifted (none yet), lengths of coordinates, room for derivatives.

    The guess of tracked values and the contact manager's memory are given. Also returns where the doubles of these end.
    """
    pairs = header_at(table, 0).contacts
    free = carve(integers, 0, (pairs,))
    for k in range(pairs):
        free[k] = -1
    lengths = carve(doubles, at, (pairs, 4))
    at += 4 * pairs
    vectors = carve(doubles, at, (VECTORS, 3, VARIABLES))
    at += 3 * VECTORS * VARIABLES
    values = carve(doubles, at, (VARIABLES, VARIABLES))
    return LiftedPairs(free, lengths, vectors, values, guess, memory), at + VARIABLES * VARIABLES


@kernel(inline=True)
def carve_tapes(table, doubles, at):
    """Carve the workspace for instructions of expressions. Also returns where its doubles end."""
    o = header_at(table, 0).tape_workspace
    inputs = carve(doubles, at, (table[o],))
    outputs = carve(doubles, at + table[o], (table[o + 1],))
    work = carve(doubles, at + table[o] + table[o + 1], (table[o + 2],))
    return TapeWorkspace(inputs, outputs, work), at + table[o] + table[o + 1] + table[o + 2]


@kernel(inline=True)
def sides_of(n, order):
    """Rows and columns of the Hessian's array and of its factor's, for n unknowns."""
    layout = blocks_at(order.blocks, 0)
    if is_blocked(order):
        return (6 * layout.blocks, 6), (1, 36 * layout.factored)
    return (n, n), (n, n)


@kernel(inline=True)
def carve_unknowns(n, lifted, order, room):
    """The system of a step of n unknowns, of which the last 4 `lifted` are coordinates of lifted pairs."""
    hessian, factor = sides_of(n, order)
    vectors, ends = carve(room, 0, (4, n)), carve(room, 4 * n, (4 * lifted,))
    ends[:] = 0.0
    at = 4 * n + 4 * lifted
    matrices = carve(room, at, hessian), carve(room, at + hessian[0] * hessian[1], factor)
    return System(vectors[0], Directions(vectors[1], vectors[2], vectors[3], ends), matrices[0], matrices[1])


@kernel(inline=True)
def carve_all(store, memory, end_effectors, doubles, integers):
    """Carve all that a solve works in, as `workspace_needed` counts it; rows and unknowns exclude lifted pairs."""
    table = store.table
    header = header_at(table, 0)
    pairs = header.contacts
    most, n = header.rows + 4 * pairs, 6 * header.moving
    iterates, rows, guess, at = carve_points(table, most, doubles, integers)
    shape = shape_of(table, most, n + 4 * pairs, record_of_blocks(table), integers, doubles)
    lifted, at = carve_pairs(table, guess, memory, doubles, at, integers)
    arrange(table, lifted.free, shape, header.rows, n)
    tapes, at = carve_tapes(table, doubles, at)
    told = carve(doubles, at, (header.bodies, 7))
    at += 7 * header.bodies
    way, loop = carve(doubles, at, (WAY,)), carve(doubles, at + WAY, (LOOP,))
    at += WAY + LOOP
    room = carve(doubles, at, (doubles.size - size_of_shape(table, most, n + 4 * pairs)[1] - at,))
    system = carve_unknowns(n, 0, shape.sparsity, room)
    return Workspace(Program(store, shape, lifted, tapes, end_effectors), iterates, rows, told, way, loop, system, room)


@kernel(inline=True, allocates=True)
def new_system(n, lifted, order):
    """A newly allocated system of n unknowns, of which the last 4 `lifted` are coordinates of lifted pairs."""
    hessian, factor = sides_of(n, order)
    vectors = np.empty((4, n))
    directions = Directions(vectors[1], vectors[2], vectors[3], np.zeros(4 * lifted))
    return System(vectors[0], directions, np.empty(hessian), np.empty(factor))
