"""Newton's method in joint coordinates: bodies hang on a tree of joints, and loops are closed.

A joint of the tree leads from the frame on its parent to that on its child by a motion M (a rotation by rows, then a
shift), which holds whatever the coordinates are. A unit of coordinate k moves M to M exp(S_k), S_k constant in the
moving frame: so all lower pairs are alike. Other rows c close loops. From coordinates near a branch,
(J^T J + d I) step = -J^T c, with d = |c|^2 / 1000, which allows for dependent rows and vanishes at the solution.
Branches are sought from many starts: each costs 3 microseconds a step for an arm of six joints.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view
from assembly.constraints.program.primitives import COINCIDENT, SLIDE, SWING
from assembly.geometry.vec import blend, cross, dot, quaternion_matrix, sub
from assembly.kinematics.motion import exponential

# A joint's bodies, the first of its coordinates, and how many it has.
TREE_JOINT = record_dtype("i8", parent=1, child=1, first=1, count=1)
# The frame on the parent, the body as seen from the frame on it, and S_k of each coordinate: shift, then turn.
TREE_FRAMES = record_dtype("f8", before=12, after=12, twists=36)
CLOSING_ROW = record_dtype("i8", kind=1, component=1, body_a=1, body_b=1)
CLOSING_FRAMES = record_dtype("f8", frame_a=12, frame_b=12, value=1)
tree_joint_at, tree_frames_at = record_view(TREE_JOINT), record_view(TREE_FRAMES)
closing_row_at, closing_frames_at = record_view(CLOSING_ROW), record_view(CLOSING_FRAMES)
# Most steps; the largest norm of the residuals at the end; the most that a coordinate changes by in a step.
STEPS, CLOSED, LONGEST = 60, 1e-13, 0.7
# The damping over the sum of the squared residuals, and what is left of it at the end.
DAMPING, LEAST = 1e-3, 1e-15
# 1 + cosine of axes that are opposed but for rounding.
OPPOSED = 1e-14


@kernel(inner=True)
def composed(a, b, out):
    """The product of two poses, out = a b; out must be another array."""
    for i in range(3):
        for j in range(3):
            out[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j]
        out[9 + i] = a[3 * i] * b[9] + a[3 * i + 1] * b[10] + a[3 * i + 2] * b[11] + a[9 + i]


@kernel(inline=True)
def turned(a, x, y, z):
    """A vector rotated by the rotation of a pose."""
    return (
        a[0] * x + a[1] * y + a[2] * z,
        a[3] * x + a[4] * y + a[5] * z,
        a[6] * x + a[7] * y + a[8] * z,
    )


@kernel(inline=True)
def axis_of(a, k):
    """Axis k of a frame."""
    return (a[k], a[3 + k], a[6 + k])


@kernel(inline=True)
def shift_of(a):
    """The place of a pose."""
    return (a[9], a[10], a[11])


@kernel(inner=True)
def place_bodies(joints, frames, motions, poses, columns, scratch):
    """Poses (n, 12) of bodies on the tree, and of every coordinate its place, shift and turn in the world (k, 9)."""
    for e in range(joints.shape[0]):
        joint = tree_joint_at(joints, e)
        fixed = tree_frames_at(frames, e)
        composed(poses[joint.parent], fixed.before, scratch[0])
        composed(scratch[0], motions[e], scratch[1])
        composed(scratch[1], fixed.after, poses[joint.child])
        for k in range(joint.count):
            o = 6 * k
            shift = turned(scratch[1], fixed.twists[o], fixed.twists[o + 1], fixed.twists[o + 2])
            turn = turned(scratch[1], fixed.twists[o + 3], fixed.twists[o + 4], fixed.twists[o + 5])
            for i in range(3):
                columns[joint.first + k, i] = scratch[1, 9 + i]
                columns[joint.first + k, 3 + i] = shift[i]
                columns[joint.first + k, 6 + i] = turn[i]


@kernel(inner=True)
def closing_slopes(kind, component, frame_a, frame_b, record):
    """Write a row's n and h, and the place that n is at on body a, into a record of 9; return its value.

    Its rate is n . (v_b - v_a) + h . (w_b - w_a), with velocities v of the origin of frame b and of that place.
    """
    d = sub(shift_of(frame_b), shift_of(frame_a))
    n, h, place = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), shift_of(frame_b)
    if kind == COINCIDENT:
        n = (1.0 if component == 0 else 0.0, 1.0 if component == 1 else 0.0, 1.0 if component == 2 else 0.0)
        place, value = shift_of(frame_a), d[component]
    elif kind == SLIDE:
        n = axis_of(frame_a, component)
        value = dot(n, d)
    elif kind == SWING:
        z = axis_of(frame_b, 2)
        cosine = dot(axis_of(frame_a, 2), z)
        # 2 sin(theta / 2) in the direction that z_b leans to: opposed axes are no root of it, nor do steps lead there.
        above = max(1.0 + cosine, OPPOSED)
        factor = math.sqrt(2.0 / above)
        a = axis_of(frame_a, component)
        value = factor * dot(a, z)
        h = blend(factor, cross(z, a), -0.5 * value / above, cross(z, axis_of(frame_a, 2)))
    else:
        x = axis_of(frame_b, 0)
        y = axis_of(frame_b, 1)
        u = axis_of(frame_a, 0)
        v = axis_of(frame_a, 1)
        value = math.atan2(dot(v, x) - dot(u, y), dot(u, x) + dot(v, y))
        h = axis_of(frame_a, 2)
    for i in range(3):
        record[i] = n[i]
        record[3 + i] = h[i]
        record[6 + i] = place[i]
    return value


@kernel(inline=True)
def rate_of(record, place, column, body_moves, sign):
    """The rate of a row for a unit rate of a coordinate that moves one of its bodies; `place`: its point there."""
    if body_moves == 0:
        return 0.0
    turn = (column[6], column[7], column[8])
    arm = cross(turn, sub(place, (column[0], column[1], column[2])))
    n = dot((record[0], record[1], record[2]), (column[3] + arm[0], column[4] + arm[1], column[5] + arm[2]))
    return sign * (n + dot((record[3], record[4], record[5]), turn))


@kernel(inner=True)
def close_rows(rows, row_frames, poses, columns, moves, residual, jacobian, scratch):
    """Residuals (m) of the rows that close loops, and slopes (m, k); returns the sum of their squares."""
    square = 0.0
    for r in range(rows.shape[0]):
        row = closing_row_at(rows, r)
        given = closing_frames_at(row_frames, r)
        composed(poses[row.body_a], given.frame_a, scratch[0])
        composed(poses[row.body_b], given.frame_b, scratch[1])
        off = closing_slopes(row.kind, row.component, scratch[0], scratch[1], scratch[2]) - given.value
        if row.kind != COINCIDENT and row.kind != SLIDE:
            off -= 2.0 * math.pi * math.floor(off / (2.0 * math.pi) + 0.5)
        residual[r] = off
        square += off * off
        place = (scratch[2, 6], scratch[2, 7], scratch[2, 8])
        for k in range(columns.shape[0]):
            jacobian[r, k] = rate_of(scratch[2], shift_of(scratch[1]), columns[k], moves[row.body_b, k], 1.0)
            jacobian[r, k] += rate_of(scratch[2], place, columns[k], moves[row.body_a, k], -1.0)
    return square


@kernel(inner=True)
def damped_step(residual, jacobian, damping, matrix, step):
    """The step of least squares: Cholesky's factors of J^T J + damping."""
    k = step.size
    for i in range(k):
        for j in range(i + 1):
            total = damping if i == j else 0.0
            for r in range(residual.size):
                total += jacobian[r, i] * jacobian[r, j]
            for l in range(j):
                total -= matrix[i, l] * matrix[j, l]
            if i == j:
                matrix[i, i] = math.sqrt(max(total, LEAST))
            else:
                matrix[i, j] = total / matrix[j, j]
        total = 0.0
        for r in range(residual.size):
            total -= jacobian[r, i] * residual[r]
        for l in range(i):
            total -= matrix[i, l] * step[l]
        step[i] = total / matrix[i, i]
    for i in range(k - 1, -1, -1):
        for l in range(i + 1, k):
            step[i] -= matrix[l, i] * step[l]
        step[i] /= matrix[i, i]


@kernel(inner=True)
def move_joint(joint, fixed, step, share, motion, scratch):
    """Move a joint of the tree by a share of a step of all coordinates."""
    twist = scratch[2]
    for i in range(6):
        twist[i] = 0.0
        for k in range(joint.count):
            twist[i] += share * step[joint.first + k] * fixed.twists[6 * k + i]
    e = exponential((twist[3], twist[4], twist[5]))
    turn = quaternion_matrix(e[0], e[1], e[2], e[3])
    for i in range(9):
        scratch[0, i] = turn[i]
    for i in range(3):
        scratch[0, 9 + i] = twist[i]
    composed(motion, scratch[0], scratch[1])
    for i in range(12):
        motion[i] = scratch[1, i]


@kernel(
    signatures=("(i8[:, ::1], f8[:, ::1], i8[:, ::1], f8[:, ::1], f8[:, :, ::1], f8[:, :, ::1], f8[::1])"),
    allocates=True,
)
def close_loops(joints, frames, rows, row_frames, motions, poses, off):
    """Close the loops of many starts, each a set of motions of the tree's joints, which are moved.

    joints (e), frames (e) : TREE_JOINT, TREE_FRAMES, a parent's joint before a child's; of the coordinates of all
    rows (m), row_frames (m) : CLOSING_ROW, CLOSING_FRAMES
    motions (s, e, 12) : in and out
    poses (s, n, 12) : of bodies that no joint carries in; of all others out
    off (s) : out, the norm of the residuals; not finite where a start led nowhere
    """
    k = 0
    for e in range(joints.shape[0]):
        k += tree_joint_at(joints, e).count
    m, n = rows.shape[0], poses.shape[1]
    moves = np.zeros((n, k), np.int64)
    for e in range(joints.shape[0]):
        joint = tree_joint_at(joints, e)
        for c in range(k):
            moves[joint.child, c] = moves[joint.parent, c]
        for c in range(joint.count):
            moves[joint.child, joint.first + c] = 1
    columns, scratch = np.empty((k, 9)), np.empty((3, 12))
    residual, jacobian, matrix, step = np.empty(m), np.empty((m, k)), np.empty((k, k)), np.empty(k)
    for s in range(motions.shape[0]):
        for _ in range(STEPS):
            place_bodies(joints, frames, motions[s], poses[s], columns, scratch)
            square = close_rows(rows, row_frames, poses[s], columns, moves, residual, jacobian, scratch)
            off[s] = math.sqrt(square)
            if off[s] <= CLOSED or not math.isfinite(square) or k == 0:
                break
            damped_step(residual, jacobian, DAMPING * square + LEAST, matrix, step)
            longest = 0.0
            for c in range(k):
                longest = max(longest, abs(step[c]))
            share = min(1.0, LONGEST / longest) if longest > 0.0 else 1.0
            for e in range(joints.shape[0]):
                move_joint(tree_joint_at(joints, e), tree_frames_at(frames, e), step, share, motions[s, e], scratch)
