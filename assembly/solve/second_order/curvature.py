"""Second derivatives of a scene at a state, and nearby poses at which rows hold: ends of solves are judged by these.

Unknowns are those of the loop: twists of the moving bodies in the order of their blocks, lengths over the scene's
size, then four coordinates of every contact whose pair is at a fold. Rows are those of the program, then four of
tangency a fold. What else is asked of second order is computed from these
in `solve/second_order/classification.py`.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._carve import carve
from assembly._kernel import kernel
from assembly._record import Store
from assembly.constraints.program.evaluate import evaluate
from assembly.constraints.program.records import header_at
from assembly.constraints.program.row_terms import add_row_terms
from assembly.proximity.extrema.face_face import BEND
from assembly.solve.dense.row_table import arranged, new_point, point_at
from assembly.solve.linear_algebra.factorize import factorize_shifted, solve_step
from assembly.solve.loop.line_search import goal
from assembly.solve.loop.multipliers import toward_rows
from assembly.solve.loop.predict import predict_pairs
from assembly.solve.loop.report import write_pose, write_tracked
from assembly.solve.loop.residuals import add_row, arrange, move, record_of_blocks, shape_of, size_of_shape
from assembly.solve.loop.violation import off_rows
from assembly.solve.loop.workspace import new_rows, new_system

# Residuals of rows that hold, and that hold exactly; at most so many steps lead back onto them, none longer than this.
HOLDS, EXACT, STEPS, LONGEST = 1e-11, 1e-14, 12, 1.0
# In large scenes the least curvature is found by so many inverse iterations, with the shift that a step tries first.
ITERATIONS, LEAST_SHIFT = 60, 1e-8
# The penalty of rows in these steps, whose inverse is their weight, and the weight of the steps' own squares. Once rows
# hold, a step that leaves more than this part of the violation is the last.
MU, SOFTNESS, GAIN = 1e-6, 1e-2, 0.1


@kernel(inner=True, allocates=True)
def write_curvature(store, state, forces, out, end_effectors, integers, doubles):
    """Do what `curvature_at` does, in a given workspace."""
    header = header_at(store.table, 0)
    pairs = header.contacts
    free = np.empty(pairs, np.int64)
    found = point_at(store, state, free)
    count, point = found.count, found.iterate
    if found.lost >= 0:
        return -1
    write_tracked(store.table, point.tracked, state)
    rows, n = header.rows + 4 * count, 6 * header.moving + 4 * count
    shape = shape_of(
        store.table, header.rows + 4 * pairs, 6 * header.moving + 4 * pairs, store.table[:0], integers, doubles
    )
    arrange(store.table, free, shape, rows, n)
    jacobian = carve(out, 1 + rows + n, (rows, n))
    hessian = carve(out, 1 + rows + n + rows * n, (n, n))
    slopes = np.zeros(n)
    for i in range(out.size):
        out[i] = 0.0
    program = arranged(found, shape, end_effectors)
    out[0] = goal(program, rows, point, 1, slopes, hessian)
    add_row_terms(program, point, forces, np.zeros(rows), hessian)
    for r in range(rows):
        out[1 + r] = point.residual[r]
        add_row(shape.bases, point.jacobian, r, 1.0, jacobian[r])
    for i in range(n):
        out[1 + rows + i] = slopes[i]
        for j in range(i):
            hessian[i, j] = hessian[j, i]
    return count


@kernel(
    signatures=(
        "(i8[::1], f8[::1], f8[::1], f8[::1], f8[::1], i8)",
        "(i8[::1], f8[::1], f8[::1], f8[::1], f8[::1], none)",
    ),
    allocates=True,
)
def curvature_at(table, pool, state, forces, out, end_effectors):
    """Evaluate a state and write tracked values into it. Returns how many folds there are, or -1 if a pair is lost.

    With m rows and n unknowns, these included: out gets the objective's value, residuals (m), the objective's gradient
    (n), the rows' Jacobian (m, n), and the Hessian of objective + forces . rows (n, n). `end_effectors` is None where
    no term of the objective is a dexterity.
    """
    header = header_at(table, 0)
    pairs = header.contacts
    integers, doubles = size_of_shape(table, header.rows + 4 * pairs, 6 * header.moving + 4 * pairs)
    return write_curvature(
        Store(table, pool), state, forces, out, end_effectors, np.empty(integers, np.int64), np.empty(doubles)
    )


@kernel(inline=True)
def is_at_most(values, limit):
    """Whether every absolute value is at most the limit; false if a value is NaN."""
    for value in values:
        if not abs(value) <= limit:
            return False
    return True


@kernel(inner=True, allocates=True)
def walk_within(store, state, step, share, kept, residual, end_effectors, memory):
    """Do what `walk` does, in a given workspace."""
    header = header_at(store.table, 0)
    pairs = header.contacts
    free = np.empty(pairs, np.int64)
    found = point_at(store, state, free)
    here = found.iterate
    count, n = header.rows + 4 * found.count, 6 * header.moving + 4 * found.count
    if found.lost >= 0 or n != step.size:
        return math.inf
    integers, doubles = memory
    blocks = record_of_blocks(store.table)
    shape = shape_of(store.table, header.rows + 4 * pairs, 6 * header.moving + 4 * pairs, blocks, integers, doubles)
    arrange(store.table, free, shape, count, n)
    program = arranged(found, shape, end_effectors)
    lifted = program.lifted
    for r in range(header.rows):
        if kept[r] > 0.0:
            shape.one_sided[r] = 0
    trial = new_point(store.table)
    trial.q[:] = here.q
    system = new_system(n, (n - 6 * header.moving) // 4, shape.sparsity)
    rows, way = new_rows(count, MU), system.directions.step
    way[:] = step
    before = math.inf
    for _ in range(STEPS):
        move(store.table, here.q, way, share, trial.q)
        predict_pairs(store, shape.bases, lifted, here, trial, way, share)
        if evaluate(program, lifted.guess, BEND, trial) >= 0:
            return math.inf
        here, trial = trial, here
        share = 1.0
        off = off_rows(store.table, lifted, shape.one_sided, here, False)
        if off <= EXACT or (off <= HOLDS and off > GAIN * before):
            write_pose(store, here.q, state)
            write_tracked(store.table, here.tracked, state)
            for r in range(count):
                residual[r] = here.residual[r]
            return goal(program, count, here, 0, system.gradient, system.hessian)
        before = off
        if not math.isfinite(off):
            break
        toward_rows(program, here, rows, system, SOFTNESS, EXACT)
        if not is_at_most(way, LONGEST):
            break
    return math.inf


@kernel(
    signatures=(
        "(i8[::1], f8[::1], f8[::1], f8[::1], f8, f8[::1], f8[::1], i8)",
        "(i8[::1], f8[::1], f8[::1], f8[::1], f8, f8[::1], f8[::1], none)",
    ),
    allocates=True,
)
def walk(table, pool, state, step, share, kept, residual, end_effectors):
    """Move a state by a share of a step, and by least steps back onto the rows. Returns the objective's value there.

    One-sided rows that are `kept` (not zero) stay at their bound. Infinite, with the state as it was, where no pose
    near it holds. The residuals left, within rounding, are written.
    """
    header = header_at(table, 0)
    pairs = header.contacts
    integers, doubles = size_of_shape(table, header.rows + 4 * pairs, 6 * header.moving + 4 * pairs)
    # The blocks outlive what is carved from them: they are an argument of the kernel that carves.
    memory = (np.empty(integers, np.int64), np.empty(doubles))
    return walk_within(Store(table, pool), state, step, share, kept, residual, end_effectors, memory)


@kernel(inner=True, allocates=True)
def least_within(store, state, forces, active, direction, end_effectors, integers, doubles):
    """Do what `least_curvature` does, in a given workspace."""
    header = header_at(store.table, 0)
    found = point_at(store, state, np.empty(header.contacts, np.int64))
    point = found.iterate
    rows, n = header.rows, 6 * header.moving
    if found.lost >= 0 or found.count > 0:
        return math.nan
    shape = shape_of(store.table, rows, n, record_of_blocks(store.table), integers, doubles)
    arrange(store.table, found.program.lifted.free, shape, rows, n)
    program = arranged(found, shape, end_effectors)
    system = new_system(n, 0, shape.sparsity)
    gradient, lines, lagrangian, matrix = system.gradient, system.directions, system.hessian, system.factor
    goal(program, rows, point, 1, gradient, lagrangian)
    add_row_terms(program, point, forces, active, lagrangian)
    shift = factorize_shifted(lagrangian, n, shape.sparsity, LEAST_SHIFT, matrix)
    if shift < 0.0:
        return math.nan
    for i in range(n):
        direction[i] = math.sin(1.0 + i)
    curvature = math.nan
    before, after = lines.descent, lines.step
    for _ in range(ITERATIONS):
        square = 0.0
        for i in range(n):
            square += direction[i] * direction[i]
        for i in range(n):
            before[i] = direction[i] / math.sqrt(square)
            after[i] = before[i]
        # With A + s I the matrix and w = (A + s I)^-1 v: w^T A w = w.v - s w.w.
        solve_step(matrix, n, shape.sparsity, after)
        across, square = 0.0, 0.0
        for i in range(n):
            across += after[i] * before[i]
            square += after[i] * after[i]
            direction[i] = after[i]
        curvature = across / square - shift
        for i in range(n):
            direction[i] /= math.sqrt(square)
    return curvature


@kernel(
    signatures=(
        "(i8[::1], f8[::1], f8[::1], f8[::1], f8[::1], f8[::1], i8)",
        "(i8[::1], f8[::1], f8[::1], f8[::1], f8[::1], f8[::1], none)",
    ),
    allocates=True,
)
def least_curvature(table, pool, state, forces, active, direction, end_effectors):
    """The least curvature of objective + forces . rows along motions that keep the rows; its direction is written.

    `active` has the weight of every row that is to be kept, zero for others. NaN if a contact is at a fold.
    """
    header = header_at(table, 0)
    integers, doubles = size_of_shape(table, header.rows, 6 * header.moving)
    return least_within(
        Store(table, pool),
        state,
        forces,
        active,
        direction,
        end_effectors,
        np.empty(integers, np.int64),
        np.empty(doubles),
    )
