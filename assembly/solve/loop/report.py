"""What a solve leaves in its state: the pose judged afresh, rows in the user's units."""

from __future__ import annotations

import math

from assembly._carve import carve
from assembly._kernel import kernel
from assembly.constraints.program.contact import TOUCHING, copy_tracked
from assembly.constraints.program.evaluate import evaluate
from assembly.constraints.program.records import ROW, header_at, pool_header_at, row_at
from assembly.proximity.extrema.face_face import BEND
from assembly.proximity.features.solid_contact import TRACK, contact_record_at
from assembly.solve.loop.contacts import lifted_pairs_hold
from assembly.solve.loop.settings import HISTORY
from assembly.solve.loop.violation import off_rows, off_tangency


@kernel(inner=True)
def log(history, iteration, figures):
    """Write the figures of an iteration, if the history has room for them."""
    if iteration < history.shape[0]:
        for k in range(HISTORY):
            history[iteration, k] = figures[k]


@kernel(inner=True)
def scaled_poses(store, state, q):
    """Write the poses of a state into q, in the scaled coordinates of the program."""
    units = pool_header_at(store.pool, 0)
    for b in range(header_at(store.table, 0).bodies):
        for k in range(3):
            q[b, k] = (state[7 * b + k] - units.reference[k]) / units.scale
        for k in range(3, 7):
            q[b, k] = state[7 * b + k]


@kernel(inner=True)
def write_pose(store, q, state):
    """Poses of the moving bodies into the state, in the user's coordinates; what did not move keeps its bits."""
    units = pool_header_at(store.pool, 0)
    header = header_at(store.table, 0)
    for b in range(header.bodies):
        if store.table[header.unknown_blocks + b] >= 0:
            for k in range(3):
                if q[b, k] != (state[7 * b + k] - units.reference[k]) / units.scale:
                    state[7 * b + k] = q[b, k] * units.scale + units.reference[k]
            for k in range(3, 7):
                state[7 * b + k] = q[b, k]


@kernel(inner=True)
def is_as_returned(store, q, state):
    """Whether poses are those of a state to the last bit."""
    units = pool_header_at(store.pool, 0)
    for b in range(header_at(store.table, 0).bodies):
        for k in range(7):
            told = state[7 * b + k]
            if k < 3:
                told = (told - units.reference[k]) / units.scale
            if q[b, k] != told:
                return False
    return True


@kernel(inner=True)
def read_tracked(table, state, tracked):
    """Tracked values of a state, which stand behind its poses, into those of a point."""
    header = header_at(table, 0)
    kept = carve(state, 7 * header.bodies, (header.tracked, TRACK))
    for k in range(header.tracked):
        copy_tracked(kept, k, tracked)


@kernel(inner=True)
def write_tracked(table, tracked, state):
    """Tracked values of a point into a state."""
    header = header_at(table, 0)
    kept = carve(state, 7 * header.bodies, (header.tracked, TRACK))
    for k in range(header.tracked):
        copy_tracked(tracked, k, kept)


@kernel(inner=True)
def is_clear(table, residual):
    """Whether bodies overlap by more than TOUCHING at no contact, given or of a clearance."""
    for r in range(header_at(table, 0).contacts):
        if residual[r] < -TOUCHING:
            return False
    return True


@kernel(inner=True)
def keep_point(current, rows, held):
    """Copy poses, tracked values and multipliers of a point."""
    for b in range(held.q.shape[0]):
        for k in range(7):
            held.q[b, k] = current.q[b, k]
    for r in range(held.tracked.shape[0]):
        copy_tracked(current.tracked, r, held.tracked)
    for r in range(rows.count):
        held.y[r] = rows.y[r]


@kernel(inner=True)
def bring_back(held, rows, current):
    """Restore the point that `keep_point` copied."""
    for b in range(held.q.shape[0]):
        for k in range(7):
            current.q[b, k] = held.q[b, k]
    for r in range(held.tracked.shape[0]):
        copy_tracked(held.tracked, r, current.tracked)
    for r in range(rows.count):
        rows.y[r] = held.y[r]


@kernel(inner=True)
def judge(program, state, count, current, trial, bound, lax):
    """The pose as it is returned, rounded to the user's coordinates, evaluated afresh into `trial`.

    Residuals of its `count` rows and pairs found are copied to `current`. Returns whether every row holds within the
    bound, and the largest violation, tangency counted by gaps if `lax`.
    """
    store, lifted = program.store, program.lifted
    scaled_poses(store, state, trial.q)
    lost = evaluate(program, current.tracked, BEND, trial)
    if lost >= 0:
        return False, math.inf
    for r in range(count):
        current.residual[r] = trial.residual[r]
    for k in range(header_at(store.table, 0).contacts):
        copy_tracked(trial.tracked, k, current.tracked)
    violation = off_rows(store.table, lifted, program.structure.one_sided, trial, lax)
    holds = lifted_pairs_hold(store, trial.q, current.tracked, lifted.free, 1e-9)
    return holds and violation <= bound, violation


@kernel(inner=True)
def write_rows(table, current, y, lifted, lax, size, state):
    """Tracked values, multipliers and residuals into the state; returns at how many contacts surfaces cross."""
    header = header_at(table, 0)
    tracked, records, residual, jacobian = current.tracked, current.records, current.residual, current.jacobian
    free = lifted.free
    m = header.rows
    write_tracked(table, tracked, state)
    o = 7 * header.bodies + TRACK * header.tracked
    crossing = 0.0
    for r in range(m):
        state[o + r] = y[r]
        worst = residual[r]
        if r < header.contacts:
            if free[r] >= 0:
                # How far a lifted pair is from extremal is a violation of its contact, too.
                off = off_tangency(residual, jacobian, r, m + 4 * free[r], lax, lifted.variables)
                if off > abs(worst):
                    worst = -off
            elif contact_record_at(records, r).proper == 0.0 and abs(worst) <= TOUCHING:
                crossing += 1.0
        state[o + m + r] = worst * size if row_at(table, header.row_table + ROW * r).is_length == 1 else worst
    return crossing
