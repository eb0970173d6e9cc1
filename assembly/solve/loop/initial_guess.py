"""Scattered bodies put together one after the other, so that the loop starts near where joints hold.

Bodies are taken in an order (`constraints/packing/numbering.py`) in which each has joints with bodies that are already
placed. Levenberg and Marquardt's method moves each body until the rows that it shares with those are as small as they
get: exactly zero where the joints form a tree. Rows that close a kinematic loop are left to the solve. If a driven
angle stays far from its value, because it would have to turn the other way around, the body is fitted to one of its
joints alone, and from there to all of them.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly.constraints.program.evaluate import joint_row
from assembly.constraints.program.primitives import place_frames
from assembly.constraints.program.records import (
    EXTRA_COLUMN,
    JOINT_RECORD,
    JOINT_ROW,
    ROW,
    coordinate_at,
    header_at,
    joint_at,
    joint_row_at,
    row_at,
)
from assembly.kinematics.motion import retract
from assembly.solve.linear_algebra.factorize import factorize, substitute
from assembly.solve.loop.parameters import DAMPING, FIT_STEPS, FITTED, LOWER, MOST_DAMPING, SCATTERED

# What the fit of one body works in: J^T J, the same with damping, how far its rows reach, a row, J^T c, the step; its
# poses at the start, at best, and before a step.
FitWorkspace = namedtuple("FitWorkspace", "matrix damped last row slope step poses")
START, BEST, BEFORE = 0, 1, 2
# A body to be placed: its number, where its twist begins, where its `count` rows are listed in the table.
Placed = namedtuple("Placed", "body first_unknown first count")


@kernel(inner=True)
def scattered(table, residual, one_sided):
    """Whether a row of a joint is far from holding."""
    header = header_at(table, 0)
    for r in range(header.contacts, header.rows):
        if row_at(table, header.row_table + ROW * r).kind == JOINT_ROW:
            c = min(residual[r], 0.0) if one_sided[r] == 1 else residual[r]
            if abs(c) > SCATTERED:
                return True
    return False


@kernel(inner=True)
def place_joint(store, k, q, records):
    """The world frames of joint k."""
    header = header_at(store.table, 0)
    joint = joint_at(store.table, header.joint_table + JOINT_RECORD * k)
    place_frames(store.pool, joint.frames, q, joint.body_f, joint.body_g, records, header.contacts + k)


@kernel(inline=True)
def is_of(table, row, joint):
    """Whether a row belongs to this joint alone; true for every row if `joint` is negative."""
    joint_there = joint_row_at(table, row)
    return joint < 0 or (joint_there.joint == joint and joint_there.second < 0)


@kernel(inner=True)
def body_rows(store, placed, joint, point):
    """Evaluate a body's rows, of a joint or of all (-1). Returns half the sum of squares of those that do not hold."""
    q, records, residual = point.q, point.records, point.residual
    cost = 0.0
    for l in range(placed.first, placed.first + placed.count):
        r = store.table[l]
        row = header_at(store.table, 0).row_table + ROW * r
        joint_there = joint_row_at(store.table, row)
        if not is_of(store.table, row, joint):
            continue
        second = joint_there.second
        place_joint(store, joint_there.joint, q, records)
        if second >= 0:
            place_joint(store, coordinate_at(store.table, second).joint, q, records)
        joint_row(store, r, point.tracked, point)
        if row_at(store.table, row).one_sided == 0 or residual[r] < 0.0:
            cost += 0.5 * residual[r] * residual[r]
    return cost


@kernel(inner=True)
def follow_drives(store, placed, tracked):
    """Set the tracked angles of a body's driven rows to the values they are driven to."""
    for l in range(placed.first, placed.first + placed.count):
        row = header_at(store.table, 0).row_table + ROW * store.table[l]
        joint = joint_row_at(store.table, row)
        if row_at(store.table, row).one_sided == 0 and joint.second < 0 and joint.angle >= 0:
            o = joint.parameters
            tracked[joint.angle, 0] = store.pool[o + 2] / store.pool[o]


@kernel(inner=True)
def body_row(bases, jacobian, r, s, out):
    """The part of row r of the Jacobian that belongs to the body whose twist begins at unknown s."""
    for i in range(6):
        out[i] = 0.0
    for b in range(bases.shape[1]):
        if bases[r, b] == s and b != 2:
            column = 6 * b if b < 2 else EXTRA_COLUMN + 6 * (b - 3)
            for i in range(6):
                out[i] += jacobian[r, column + i]


@kernel(inner=True)
def is_half_around(table, residual, placed):
    """Whether an angle of a body's rows is far from where it is driven to."""
    for l in range(placed.first, placed.first + placed.count):
        row = header_at(table, 0).row_table + ROW * table[l]
        joint = joint_row_at(table, row)
        driven = row_at(table, row).one_sided == 0 and joint.second < 0 and joint.angle >= 0
        if driven and abs(residual[table[l]]) > SCATTERED:
            return True
    return False


@kernel(inner=True)
def normal_equations(table, bases, placed, joint, point, workspace):
    """J^T J and J^T c of a body's rows that do not hold, in its twist."""
    residual, jacobian = point.residual, point.jacobian
    matrix, row, slope = workspace.matrix, workspace.row, workspace.slope
    for i in range(6):
        slope[i] = 0.0
        for j in range(i, 6):
            matrix[i, j] = 0.0
    for l in range(placed.first, placed.first + placed.count):
        r = table[l]
        at = header_at(table, 0).row_table + ROW * r
        if not is_of(table, at, joint) or (row_at(table, at).one_sided == 1 and residual[r] >= 0.0):
            continue
        body_row(bases, jacobian, r, placed.first_unknown, row)
        for i in range(6):
            slope[i] += row[i] * residual[r]
            for j in range(i, 6):
                matrix[i, j] += row[i] * row[j]


@kernel(inner=True)
def fit_body(store, bases, placed, joint, point, workspace):
    """Move a body until its rows, of a joint or of all (-1), are as small as they get.

    Returns half the sum of squares of those that do not hold.
    """
    q, body = point.q, placed.body
    matrix, damped, last, _row, slope, step, poses = workspace
    damping = DAMPING
    cost = body_rows(store, placed, joint, point)
    for _step in range(FIT_STEPS):
        if cost <= FITTED or damping > MOST_DAMPING:
            break
        normal_equations(store.table, bases, placed, joint, point, workspace)
        copy_pose(q, body, poses, BEFORE)
        while damping <= MOST_DAMPING:
            for i in range(6):
                step[i] = -slope[i]
                for j in range(i, 6):
                    damped[i, j] = matrix[i, j]
                damped[i, i] += damping
            if factorize(damped, 6, last):
                substitute(damped, 6, last, step)
                turn = math.sqrt(step[3] * step[3] + step[4] * step[4] + step[5] * step[5])
                cut = 1.0 if turn <= 1.0 else 1.0 / turn
                for i in range(6):
                    step[i] *= cut
                retract(q, body, (step[0], step[1], step[2]), (step[3], step[4], step[5]), q)
                there = body_rows(store, placed, joint, point)
                if there < cost:
                    cost = there
                    damping = max(0.1 * damping, 1e-12)
                    break
            copy_pose(poses, BEFORE, q, body)
            damping *= 10.0
    return body_rows(store, placed, joint, point)


@kernel(inline=True)
def copy_pose(poses, k, out, l):
    """Pose k of some to pose l of others."""
    for i in range(7):
        out[l, i] = poses[k, i]


@kernel(inner=True, allocates=True)
def assemble(store, bases, unknown_blocks, point):
    """Move the bodies of the point one by one."""
    header = header_at(store.table, 0)
    q, tracked, residual = point.q, point.tracked, point.residual
    matrices, vectors, poses = np.empty((2, 6, 6)), np.empty((3, 6)), np.empty((3, 7))
    workspace = FitWorkspace(matrices[0], matrices[1], np.full(6, 5), vectors[0], vectors[1], vectors[2], poses)
    o = header.gather_table + 1
    for _entry in range(store.table[header.gather_table]):
        body = store.table[o]
        placed = Placed(body, 6 * store.table[unknown_blocks + body], o + 2, store.table[o + 1])
        o = placed.first + placed.count
        copy_pose(q, body, poses, START)
        cost = fit_body(store, bases, placed, -1, point, workspace)
        if cost <= FITTED or not is_half_around(store.table, residual, placed):
            continue
        copy_pose(q, body, poses, BEST)
        tried = -1
        for l in range(placed.first, o):
            joint = joint_row_at(store.table, header.row_table + ROW * store.table[l]).joint
            if cost <= FITTED:
                break
            if joint == tried:
                continue
            tried = joint
            copy_pose(poses, START, q, body)
            follow_drives(store, placed, tracked)
            fit_body(store, bases, placed, joint, point, workspace)
            follow_drives(store, placed, tracked)
            there = fit_body(store, bases, placed, -1, point, workspace)
            if there < LOWER * cost:
                cost = there
                copy_pose(q, body, poses, BEST)
        copy_pose(poses, BEST, q, body)
        follow_drives(store, placed, tracked)
        body_rows(store, placed, -1, point)
