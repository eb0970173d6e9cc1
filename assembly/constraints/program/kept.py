"""What a solve or a tick leaves for the next one, which begins at the same poses: rows, derivatives, a factor.

These data stand at the end of a state, in the order of `Kept`, and are no part of what a solution means. They are used
where the poses are the same to the last bit; without them the next solve evaluates its rows anew. Of what rows are made
from, only the values of joints may have changed in between.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._carve import carve
from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.constraints.program.contact import contact_of, idle_row
from assembly.constraints.program.primitives import RECORD as JOINT_FRAMES
from assembly.constraints.program.primitives import coordinate
from assembly.constraints.program.records import (
    COORDINATE,
    EXTRA_COLUMN,
    FREE_COLUMN,
    JOINT_ROW,
    ROW,
    coordinate_at,
    header_at,
    joint_row_at,
    pool_header_at,
    row_at,
)
from assembly.proximity.features.solid_contact import CONTACT_RECORD

KEPT_HEADER = record_dtype(
    "f8",
    has_rows=1,  # 1: rows and their derivatives
    version=1,  # of the pool
    factor=1,  # NO_FACTOR, or which solve made it
    corrected=1,  # 1: with the factor is what corrected the tangent step of the solve that ended here
    ratio=1,  # of that tangent step to the one before; 0: it was not corrected as that was
)
kept_header_at = record_view(KEPT_HEADER)
HEADER = size_of(KEPT_HEADER)
# [unknowns] In scenes with more unknowns no factor is kept: to copy it takes longer than to make it, and solutions are
# large. Doubled: solutions of larger scenes take four times the memory. Chosen.
MOST_KEPT = 60
NO_FACTOR, EARLIER_FACTOR, NEW_FACTOR = 0.0, 1.0, 2.0
# `header`: where the header is. `poses`: of every body, as in the state. `angles`: of every tracked angle its value.
# `values`, `residual`, `weights`: of every row the value that it subtracts, its residual, and its weight in the factor
# (0: it did not count). `numbers`: of every contact its clearance number. At these poses: the records of `contacts`,
# `joints` and vector `trims`, and the `jacobian` without the columns of lifted pairs. At these poses or others close
# by: `factor`, the Cholesky factor of a step's matrix, its upper triangle row by row, and the Jacobian that is in it,
# without those columns as well.
# `course`: of the solve that ended here, in chord steps.
Kept = namedtuple(
    "Kept",
    "header poses angles values residual weights numbers contacts joints trims jacobian factor_jacobian factor course",
)
# `tangent`: the first step of a solve. `correction`: the sum of what came to it, and `forces`: of the changes of
# multipliers that came with that, of every row. `before`, `forces_before`: such sums of the solve before, to scale.
Course = namedtuple("Course", "tangent correction before forces forces_before")


@kernel(inline=True)
def kept_size(table):
    """The number of doubles that `Kept` takes in a state."""
    header = header_at(table, 0)
    n, columns = kept_unknowns(table), FREE_COLUMN + 6 * header.extra
    records = (header.contacts + header.vector_trims) * CONTACT_RECORD + header.joints * JOINT_FRAMES
    by_row = header.rows * (5 + 2 * columns)
    return HEADER + 7 * header.bodies + header.tracked + by_row + records + n * (n + 1) // 2 + 3 * n


@kernel(inline=True)
def kept_unknowns(table):
    """The number of unknowns whose factor is kept: all, or in a large scene none."""
    header = header_at(table, 0)
    n = 6 * header.moving
    return 0 if n > MOST_KEPT or header.block_record > 0 else n


@kernel(inline=True)
def has_place(table, state):
    """Whether a state has a place for `Kept`; the state of a tick's result has none."""
    return state.size >= header_at(table, 0).kept + kept_size(table)


@kernel(inline=True)
def forget_factor(table, state):
    """Drop the factor that is kept in a state, which must have a place for one."""
    left = kept_header_at(state, header_at(table, 0).kept)
    left.factor, left.corrected = NO_FACTOR, 0.0


@kernel(inline=True)
def kept_in(table, state):
    """What is kept in a state, as arrays in it."""
    header = header_at(table, 0)
    rows, n = header.rows, kept_unknowns(table)
    columns = FREE_COLUMN + 6 * header.extra
    at = header.kept + HEADER
    poses = carve(state, at, (header.bodies, 7))
    at += 7 * header.bodies
    angles = carve(state, at, (header.tracked - header.contacts,))
    at += header.tracked - header.contacts
    by_row = carve(state, at, (3, rows))
    at += 3 * rows
    numbers = carve(state, at, (header.contacts,))
    at += header.contacts
    contacts = carve(state, at, (header.contacts, CONTACT_RECORD))
    at += header.contacts * CONTACT_RECORD
    joints = carve(state, at, (header.joints, JOINT_FRAMES))
    at += header.joints * JOINT_FRAMES
    trims = carve(state, at, (header.vector_trims, CONTACT_RECORD))
    at += header.vector_trims * CONTACT_RECORD
    jacobian = carve(state, at, (rows, columns))
    at += rows * columns
    factor_jacobian = carve(state, at, (rows, columns))
    at += rows * columns
    factor = carve(state, at, (n * (n + 1) // 2,))
    at += n * (n + 1) // 2
    steps, forces = carve(state, at, (3, n)), carve(state, at + 3 * n, (2, rows))
    course = Course(steps[0], steps[1], steps[2], forces[0], forces[1])
    return Kept(
        header.kept,
        poses,
        angles,
        by_row[0],
        by_row[1],
        by_row[2],
        numbers,
        contacts,
        joints,
        trims,
        jacobian,
        factor_jacobian,
        factor,
        course,
    )


@kernel(inline=True)
def value_of(store, r):
    """The value that row r subtracts, which may change between solves."""
    row = header_at(store.table, 0).row_table + ROW * r
    return (
        store.pool[joint_row_at(store.table, row).parameters + 2] if row_at(store.table, row).kind == JOINT_ROW else 0.0
    )


@kernel(inner=True)
def has_followed(table, kept, at, tracked):
    """Whether a coordinate is an angle at its pole, where it takes the state's value, and that value has changed."""
    asked, contacts = coordinate_at(table, at), header_at(table, 0).contacts
    if asked.angle < 0 or kept.angles[asked.angle - contacts] == tracked[asked.angle, 0]:
        return False
    near = tracked[asked.angle, 0]
    found = coordinate(asked.kind, asked.component, kept.joints, asked.joint, near)
    return found.value != kept.angles[asked.angle - contacts]


@kernel(inner=True)
def is_of(store, state, kept, tracked):
    """Whether the kept rows belong to the poses, the contacts and the revolution counts of angles in a state."""
    header = header_at(store.table, 0)
    left = kept_header_at(state, kept.header)
    if left.has_rows != 1.0 or left.version != pool_header_at(store.pool, 0).version:
        return False
    for b in range(header.bodies):
        for k in range(7):
            if kept.poses[b, k] != state[7 * b + k]:
                return False
    for k in range(header.contacts):
        if kept.numbers[k] != float(contact_of(store.table, k).clearance_number):
            return False
    for k in range(header.contacts, header.tracked):
        # An angle is the one next to its value in the state.
        if not abs(kept.angles[k - header.contacts] - tracked[k, 0]) < math.pi:
            return False
    for r in range(header.rows):
        row = header.row_table + ROW * r
        if row_at(store.table, row).kind == JOINT_ROW:
            second = joint_row_at(store.table, row).second
            if has_followed(store.table, kept, row + COORDINATE, tracked):
                return False
            if second >= 0 and has_followed(store.table, kept, second, tracked):
                return False
    return True


@kernel(inner=True)
def take_array(first, source, records):
    """Rows that are kept, into an iterate's array from the first one on."""
    for r in range(source.shape[0]):
        for i in range(source.shape[1]):
            records[first + r, i] = source[r, i]


@kernel(inner=True)
def keep_array(first, records, out):
    """Rows of an iterate's array from the first one on, as many and as much of each as is kept."""
    for r in range(out.shape[0]):
        for i in range(out.shape[1]):
            out[r, i] = records[first + r, i]


@kernel(inner=True)
def take_jacobian(source, jacobian):
    """A Jacobian that is kept, into one that has columns of lifted pairs as well."""
    lifted = EXTRA_COLUMN - FREE_COLUMN
    for r in range(source.shape[0]):
        for i in range(FREE_COLUMN):
            jacobian[r, i] = source[r, i]
        for i in range(FREE_COLUMN, source.shape[1]):
            jacobian[r, lifted + i] = source[r, i]


@kernel(inner=True)
def keep_jacobian(jacobian, out):
    """Keep an iterate's Jacobian without the columns of lifted pairs: the inverse of `take_jacobian`."""
    lifted = EXTRA_COLUMN - FREE_COLUMN
    for r in range(out.shape[0]):
        for i in range(FREE_COLUMN):
            out[r, i] = jacobian[r, i]
        for i in range(FREE_COLUMN, out.shape[1]):
            out[r, i] = jacobian[r, lifted + i]


@kernel(inner=True)
def take_factor(kept, factor):
    """The factor that is kept, as the steps of a solve have it."""
    at = 0
    for i in range(factor.shape[0]):
        for j in range(i, factor.shape[0]):
            factor[i, j] = kept.factor[at]
            at += 1


@kernel(inner=True)
def put_factor(factor, ends, jacobian, kept):
    """Keep the factor of a step, of which row i goes to column ends[i], and the Jacobian that is in it."""
    at = 0
    for i in range(factor.shape[0]):
        for j in range(i, factor.shape[0]):
            kept.factor[at] = factor[i, j] if j <= ends[i] else 0.0
            at += 1
    keep_jacobian(jacobian, kept.factor_jacobian)


@kernel(inner=True)
def take_rows(store, state, kept, point):
    """The rows that are kept, with their derivatives, into a point whose poses these are. Whether there are any."""
    if not is_of(store, state, kept, point.tracked):
        return False
    header = header_at(store.table, 0)
    take_array(0, kept.contacts, point.records)
    take_array(header.contacts, kept.joints, point.records)
    take_array(header.contacts + header.joints, kept.trims, point.records)
    for k in range(header.contacts, header.tracked):
        point.tracked[k, 0] = kept.angles[k - header.contacts]
    for r in range(header.rows):
        # Where the value has not changed, this gives the same bits.
        point.residual[r] = kept.residual[r] + (kept.values[r] - value_of(store, r))
    take_jacobian(kept.jacobian, point.jacobian)
    for r in range(header.contacts):
        if contact_of(store.table, r).body_f < 0:
            idle_row(r, 1.0, point)
    return True


@kernel(inner=True)
def keep_rows(store, state, kept, point):
    """Keep the rows of a point whose poses are in the state."""
    header = header_at(store.table, 0)
    for b in range(header.bodies):
        for k in range(7):
            kept.poses[b, k] = state[7 * b + k]
    for k in range(header.contacts, header.tracked):
        kept.angles[k - header.contacts] = point.tracked[k, 0]
    for r in range(header.rows):
        kept.residual[r] = point.residual[r]
        kept.values[r] = value_of(store, r)
    for r in range(header.contacts):
        kept.numbers[r] = float(contact_of(store.table, r).clearance_number)
    keep_array(0, point.records, kept.contacts)
    keep_array(header.contacts, point.records, kept.joints)
    keep_array(header.contacts + header.joints, point.records, kept.trims)
    keep_jacobian(point.jacobian, kept.jacobian)
    left = kept_header_at(state, kept.header)
    left.has_rows, left.version = 1.0, pool_header_at(store.pool, 0).version
