"""The rows of a packed scene evaluated, with their first and second derivatives; `layout.py` says what stands where.

A row of a joint is c_1 coordinate_1 + c_2 coordinate_2 - value (`primitives.py`), a row of a trim the signed distance
of a contact to a loop (`proximity/trim_distance.py`); rows of a tape are the values of a user's expression (`tape.py`).
"""

from __future__ import annotations

import math

from assembly._kernel import call_address, kernel
from assembly.constraints.blocks import add_patch, block_row, clear_patch, is_blocked, spot
from assembly.constraints.layout import (
    BODY_F,
    BODY_G,
    CONTACTS,
    COORDINATE,
    DEEPEST_AT,
    EXTRA_COLUMN,
    FIRST_GUARD,
    FREE_COLUMN,
    GUARDS,
    JOINT_RECORD,
    JOINT_ROW,
    JOINT_TABLE,
    JOINTS,
    KIND,
    MINIMUM,
    MOVING,
    NEAREST_AT,
    ONE_SIDED,
    PARAMETERS,
    REFERENCE,
    ROW,
    ROW_TABLE,
    ROWS,
    SCALE,
    SEARCH_AT,
    SECOND,
    SHELL_F,
    SHELL_G,
    SLOTS,
    SURFACE_F,
    SURFACE_G,
    TAPE_BODIES,
    TAPE_FIRST,
    TAPE_LIST,
    TAPE_RECORD,
    TAPE_ROW_AT,
    TAPE_SCALE,
    TAPE_SECOND,
    TAPE_TABLE,
    TAPE_VALUES,
    TAPES,
    TRACK_AT,
    TRACKED,
    TRIM_ROWS_AT,
    TRIM_TERMS_AT,
    TRIMS,
)
from assembly.constraints.primitives import add_coordinate_hessian, coordinate, place_frames, write_gradient
from assembly.geometry.tape import run_tape
from assembly.geometry.vec import dot, sub
from assembly.kinematics.motion import relative_pose, rotation
from assembly.proximity.extremal import CLOSE, CONVERGED, LEFT_PATCH, SINGULAR, solve_pair
from assembly.proximity.free_pair import VARIABLES, free_hessian, free_rows
from assembly.proximity.solid_contact import CONTACT_RECORD, FEATURE_F, FOLD, PAIR_GAP, PROPER, STAYS, TRACK
from assembly.proximity.start import global_start
from assembly.proximity.velocity import GAP, RATES, add_gap_terms, gradient_row, store_record


@kernel(inner=True)
def track_contact(table, pool, row, q, start, patience, records, k):
    """Newton on the pair of one row; fills its record. Returns status, parameters, the points' signed distance."""
    i = table[row + BODY_F]
    j = table[row + BODY_G]
    turn = rotation(q, i)
    relative, shift = relative_pose(q, i, turn, j, rotation(q, j))
    status, x, _count, frame, curvature = solve_pair(
        table, pool, table[row + SURFACE_F], table[row + SURFACE_G], relative, shift, start, 1.0, patience, CLOSE
    )
    apart = sub(frame[4], frame[3])
    distance = math.sqrt(dot(apart, apart))
    if status == CONVERGED or status == SINGULAR:
        store_record(turn, shift, frame, curvature, records, k)
        # Relative curvature -H (I + beta A)^-1: indefinite means the surfaces cross beside the point.
        h = curvature[1]
        det = h[0] * h[3] - h[1] * h[2]
        norm2 = h[0] * h[0] + h[1] * h[1] + h[2] * h[2] + h[3] * h[3]
        records[k, PROPER] = 1.0 if det > -1e-9 * norm2 and h[0] + h[3] <= 0.0 else 0.0
        records[k, FOLD] = det / norm2 if norm2 > 1e-18 else 0.0
    return status, x, distance if frame[10] > 0.0 else -distance


@kernel(inner=True)
def restart_contact(table, pool, row, q, records, k):
    """As `track_contact`, from a global start."""
    i = table[row + BODY_F]
    j = table[row + BODY_G]
    relative, shift = relative_pose(q, i, rotation(q, i), j, rotation(q, j))
    status, x, _gap = global_start(table, pool, table[row + SURFACE_F], table[row + SURFACE_G], relative, shift, 1.0)
    if status == CONVERGED or status == SINGULAR:
        status, x, _distance = track_contact(table, pool, row, q, x, math.inf, records, k)
    return status, x


@kernel(inner=True)
def search_row(table, pool, row, q, tracked, r):
    """The closest features of the solids of a row wherever they are, into tracked[r]. Whether there are any."""
    shell_f = table[row + SHELL_F]
    shell_g = table[row + SHELL_G]
    i = table[row + BODY_F]
    j = table[row + BODY_G]
    nearest = table[NEAREST_AT]
    deepest = table[DEEPEST_AT]
    found = call_address(table[SEARCH_AT], (table, pool, shell_f, shell_g, i, j, q, nearest, deepest, tracked, r))
    return found == 1


@kernel(inner=True)
def track_row(table, pool, row, q, start, patience, records, tracked, r):
    """The features of the solids of a row from start[r] on, into tracked[r] and record r. A status."""
    shell_f = table[row + SHELL_F]
    shell_g = table[row + SHELL_G]
    i = table[row + BODY_F]
    j = table[row + BODY_G]
    return call_address(table[TRACK_AT], (table, pool, shell_f, shell_g, i, j, q, start, patience, records, tracked, r))


@kernel(inline=True)
def is_guard(table, r):
    """Whether row r is a clearance's."""
    return table[FIRST_GUARD] <= r < table[FIRST_GUARD] + table[GUARDS]


@kernel(inline=True)
def idle_row(r, gap, point):
    """A row that is open by `gap`."""
    records = point[2]
    records[r, GAP] = gap
    records[r, PROPER] = 1.0
    records[r, FOLD] = 1.0
    point[3][r] = gap


@kernel(inner=True)
def lost_guard(table, pool, r, start, point, past):
    """Row r of a clearance whose pair was lost: idle, if its gap would be open, or it is a corner `past` its face.

    What the neighborhood holds now is for the next look to find.
    """
    row = table[ROW_TABLE] + ROW * r
    gap = start[r, PAIR_GAP] - pool[table[row + MINIMUM]]
    if past:
        gap = max(gap, 0.0)
    elif not gap > 0.0:
        return False
    idle_row(r, gap, point)
    # Nothing moves it: its pair is not known.
    for i in range(RATES, CONTACT_RECORD - 2):
        point[2][r, i] = 0.0
    for i in range(FREE_COLUMN):
        point[4][r, i] = 0.0
    point[1][r, 0] = math.nan
    return True


@kernel(inner=True)
def solids_row(table, pool, r, start, patience, point):
    """Row r, of a contact of solids. Returns whether its pair was found.

    Where the pair that is tracked is lost, the closest one there is takes over, if the row is one-sided or a step may
    end anywhere: the loop shortens steps as long as it can. A clearance has a watch for that.
    """
    q, tracked, records, residual, jacobian = point
    row = table[ROW_TABLE] + ROW * r
    status = track_row(table, pool, row, q, start, patience, records, tracked, r)
    found = status == CONVERGED or status == SINGULAR
    if not found:
        if is_guard(table, r):
            past = start[r, STAYS] == 1.0 and status == LEFT_PATCH
            return lost_guard(table, pool, r, start, point, past)
        if table[row + ONE_SIDED] == 1 or patience == math.inf:
            found = search_row(table, pool, row, q, tracked, r)
            if found:
                status = track_row(table, pool, row, q, tracked, math.inf, records, tracked, r)
                found = status == CONVERGED or status == SINGULAR
    if found:
        residual[r] = records[r, GAP] - pool[table[row + MINIMUM]]
        tracked[r, PAIR_GAP] = records[r, GAP]
        gradient_row(records, r, jacobian, r)
    return found


@kernel(inner=True)
def contact_row(table, pool, r, start, patience, loose, point):
    """Row r, of contact r. Returns whether its pair was found.

    A tracked contact is carried from `start` to its extremal pair, by steps that turn no normal by more than
    `patience`. A free one (free[r] >= 0, its place among the free ones) is evaluated at `start` itself, and its four
    rows of tangency follow the rows of the program. A one-sided row that loses its pair takes the
    nearest one there is.
    """
    q, tracked, records, residual, jacobian = point
    free = loose[0]
    lengths = loose[1]
    row = table[ROW_TABLE] + ROW * r
    if table[row + BODY_F] < 0:
        idle_row(r, 1.0, point)
        return True
    if table[row + SHELL_F] >= 0:
        return solids_row(table, pool, r, start, patience, point)
    for i in range(FEATURE_F, TRACK):
        tracked[r, i] = start[r, i]
    x = (start[r, 0], start[r, 1], start[r, 2], start[r, 3])
    if free[r] < 0:
        status, x, distance = track_contact(table, pool, row, q, x, patience, records, r)
        if status != CONVERGED and status != SINGULAR:
            if table[row + ONE_SIDED] == 0:
                return False
            if is_guard(table, r):
                return lost_guard(table, pool, r, start, point, False)
            # A one-sided contact is of the nearest pair, whichever that is now.
            held = status == LEFT_PATCH and distance > 0.0
            status, x = restart_contact(table, pool, row, q, records, r)
            if status != CONVERGED and status != SINGULAR:
                if not held:
                    return False
                for i in range(CONTACT_RECORD):
                    records[r, i] = 0.0
                records[r, GAP] = distance
                records[r, PROPER] = 1.0
                records[r, FOLD] = 1.0
            elif not records[r, GAP] > 0.0:
                return False
        residual[r] = records[r, GAP] - pool[table[row + MINIMUM]]
        gradient_row(records, r, jacobian, r)
    else:
        e = table[ROWS] + 4 * free[r]
        free_rows(
            table,
            pool,
            table[row + SURFACE_F],
            table[row + SURFACE_G],
            table[row + BODY_F],
            table[row + BODY_G],
            q,
            x,
            (lengths[r, 0], lengths[r, 1], lengths[r, 2], lengths[r, 3]),
            loose[2],
            residual,
            jacobian,
            r,
            e,
        )
        residual[r] -= pool[table[row + MINIMUM]]
    tracked[r, 0], tracked[r, 1], tracked[r, 2], tracked[r, 3] = x
    tracked[r, PAIR_GAP] = residual[r] + pool[table[row + MINIMUM]]
    return True


@kernel(inner=True)
def coordinate_row(pool, kind, component, k, angle, factor, start, tracked, records, jacobian, r, column):
    """Factor times a coordinate, its gradient into row r from `column` on; its angle is tracked."""
    near = start[angle, 0] if angle >= 0 else 0.0
    value, n, arm_f, arm_g, h = coordinate(kind, component, records, k, near)
    if angle >= 0:
        tracked[angle, 0] = value
    write_gradient(n, arm_f, arm_g, h, factor, jacobian, r, column)
    return factor * value


@kernel(inner=True)
def joint_row(table, pool, r, start, tracked, records, residual, jacobian):
    """Row r, of a joint."""
    row = table[ROW_TABLE] + ROW * r
    o = table[row + PARAMETERS]
    pairs = table[CONTACTS]
    second = table[row + SECOND]
    value = -pool[o + 2]
    for part in range(1 if second < 0 else 2):
        at = row + COORDINATE if part == 0 else second
        value += coordinate_row(
            pool,
            table[at],
            table[at + 1],
            pairs + table[at + 2],
            table[at + 3],
            pool[o + part],
            start,
            tracked,
            records,
            jacobian,
            r,
            0 if part == 0 else EXTRA_COLUMN,
        )
    residual[r] = value


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
    """All rows of a tape; a value or a slope that is not finite is an infinite violation."""
    inputs, outputs, work = room
    place_tape(table, pool, tape, q, inputs)
    run_tape(table, pool, table[tape + TAPE_FIRST], inputs, work, outputs)
    m = table[tape + TAPE_VALUES]
    count = table[tape + TAPE_BODIES]
    each = 1.0 / pool[table[tape + TAPE_SCALE]]
    size = pool[SCALE]
    for v in range(m):
        r = table[tape + TAPE_ROW_AT] + v
        residual[r] = outputs[v] * each
        if not math.isfinite(outputs[v]):
            residual[r] = math.inf
        for b in range(count):
            at = m + 6 * (count * v + b)
            column = 6 * b if b < 2 else EXTRA_COLUMN + 6 * (b - 2)
            for i in range(3):
                jacobian[r, column + i] = outputs[at + i] * each * size
                jacobian[r, column + 3 + i] = outputs[at + 3 + i] * each
                if not (math.isfinite(outputs[at + i]) and math.isfinite(outputs[at + 3 + i])):
                    residual[r] = math.inf


@kernel(inner=True)
def evaluate(table, pool, start, patience, loose, room, point):
    """Evaluate all rows at the point's poses. Returns the contact whose pair was lost, or -1.

    `start` are the tracked values to begin from. `point` is (poses, tracked values, records, residual, Jacobian); all
    but the poses are written. `loose` is what pairs need: (places of the free ones, lengths, room, ...).
    """
    q, tracked, records, residual, jacobian = point
    pairs = table[CONTACTS]
    for r in range(pairs):
        if not contact_row(table, pool, r, start, patience, loose, point):
            return r
    if table[TRIMS] > 0:
        call_address(table[TRIM_ROWS_AT], (table, pool, loose[0], loose[1], q, tracked, records, residual, jacobian))
    for k in range(pairs, table[TRACKED]):
        # Of an angle that no row has, only an input of a dexterity, this is all that is known.
        tracked[k, 0] = start[k, 0]
    for k in range(table[JOINTS]):
        joint = table[JOINT_TABLE] + JOINT_RECORD * k
        place_frames(pool, table[joint + 2], q, table[joint], table[joint + 1], records, pairs + k)
    for r in range(pairs, table[ROWS]):
        if table[table[ROW_TABLE] + ROW * r + KIND] == JOINT_ROW:
            joint_row(table, pool, r, start, tracked, records, residual, jacobian)
    for t in range(table[TAPES]):
        tape_rows(table, pool, table[TAPE_TABLE] + TAPE_RECORD * t, q, room, residual, jacobian)
    return -1


@kernel(inline=True)
def block_at(b):
    """First column and width of block b of a row: twists of f and g, coordinates of a free pair, further twists."""
    if b < 2:
        return 6 * b, 6
    return (FREE_COLUMN, EXTRA_COLUMN - FREE_COLUMN) if b == 2 else (EXTRA_COLUMN + 6 * (b - 3), 6)


@kernel(inner=True)
def add_gram(bases, jacobian, r, weight, hessian):
    """Upper triangle of hessian += weight J_r^T J_r, for row r of two bodies and more."""
    for b in range(bases.shape[1]):
        at = bases[r, b]
        if at < 0:
            continue
        column, width = block_at(b)
        for c in range(bases.shape[1]):
            other = bases[r, c]
            if other < at:
                continue
            across, breadth = block_at(c)
            for i in range(width):
                s = weight * jacobian[r, column + i]
                if s != 0.0:
                    for j in range(breadth):
                        hessian[at + i, other + j] += s * jacobian[r, across + j]


@kernel(inner=True)
def add_gram_blocks(blocks, bases, jacobian, r, weight, hessian):
    """As `add_gram`, for a Hessian by blocks; no pair has unknowns of its own."""
    for b in range(bases.shape[1]):
        at = bases[r, b]
        if at < 0:
            continue
        column, _width = block_at(b)
        for c in range(bases.shape[1]):
            other = bases[r, c]
            if other < at:
                continue
            across, _breadth = block_at(c)
            row = block_row(blocks, at, other)
            for i in range(6):
                s = weight * jacobian[r, column + i]
                for j in range(6):
                    hessian[row + i, j] += s * jacobian[r, across + j]


@kernel(inline=True)
def add_square(order, bases, jacobian, r, weight, hessian):
    """Upper triangle of hessian += weight J_r^T J_r, however it is kept."""
    if is_blocked(order):
        add_gram_blocks(order[3], bases, jacobian, r, weight, hessian)
    else:
        add_gram(bases, jacobian, r, weight, hessian)


@kernel(inner=True)
def add_free_terms(table, pool, r, loose, point, y, weights, hessian):
    """As `add_row_terms`, for the row of a free pair and its rows of tangency."""
    q, tracked, _records, _residual, jacobian = point
    free, lengths, vectors, block = loose[0], loose[1], loose[2], loose[3]
    row = table[ROW_TABLE] + ROW * r
    f = 6 * table[table[SLOTS] + table[row + BODY_F]]
    g = 6 * table[table[SLOTS] + table[row + BODY_G]]
    e = table[ROWS] + 4 * free[r]
    u = 6 * table[MOVING] + 4 * free[r]
    free_hessian(
        table,
        pool,
        table[row + SURFACE_F],
        table[row + SURFACE_G],
        table[row + BODY_F],
        table[row + BODY_G],
        q,
        (tracked[r, 0], tracked[r, 1], tracked[r, 2], tracked[r, 3]),
        (lengths[r, 0], lengths[r, 1], lengths[r, 2], lengths[r, 3]),
        (y[r], y[e], y[e + 1], y[e + 2], y[e + 3]),
        vectors,
        block,
    )
    for i in range(VARIABLES):
        base = f if i < 6 else (g - 6 if i < 12 else u - 12)
        if i < 12 and (f if i < 6 else g) < 0:
            continue
        for j in range(VARIABLES):
            other = f if j < 6 else (g - 6 if j < 12 else u - 12)
            if j < 12 and (f if j < 6 else g) < 0:
                continue
            value = block[i, j] + weights[r] * jacobian[r, i] * jacobian[r, j]
            for l in range(4):
                value += weights[e + l] * jacobian[e + l, i] * jacobian[e + l, j]
            hessian[base + i, other + j] += value


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
    run_tape(table, pool, table[tape + TAPE_SECOND], inputs, work, outputs)
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


@kernel(inner=True)
def add_coordinate_blocks(kind, component, records, k, y, order, hessian, f, g):
    """As `add_coordinate_hessian`, for a Hessian by blocks."""
    at_f, at_g = clear_patch(order, f, g)
    add_coordinate_hessian(kind, component, records, k, y, order[2][1:], at_f, at_g)
    add_patch(order, f, g, hessian)


@kernel(inner=True)
def add_row_terms(table, pool, loose, room, shape, point, y, weights, hessian):
    """Upper triangle of hessian += second derivative of y . rows + J^T diag(weights) J.

    The rows of tangency of a free pair go with its row.
    """
    q, _tracked, records, _residual, jacobian = point
    bases, order = shape[0], shape[2]
    blocked = is_blocked(order)
    pairs = table[CONTACTS]
    for r in range(pairs):
        if loose[0][r] >= 0:
            add_free_terms(table, pool, r, loose, point, y, weights, hessian)
        elif blocked and (y[r] != 0.0 or weights[r] != 0.0):
            f, g = clear_patch(order, bases[r, 0], bases[r, 1])
            add_gap_terms(records, r, jacobian, r, y[r], weights[r], order[2][1:], f, g)
            add_patch(order, bases[r, 0], bases[r, 1], hessian)
        elif y[r] != 0.0 or weights[r] != 0.0:
            add_gap_terms(records, r, jacobian, r, y[r], weights[r], hessian, bases[r, 0], bases[r, 1])
    for r in range(pairs, pairs + table[TRIMS]):
        if weights[r] != 0.0:
            add_gram(bases, jacobian, r, weights[r], hessian)
        if y[r] != 0.0:
            call_address(
                table[TRIM_TERMS_AT],
                (table, pool, r, loose[0], loose[1], bases, point[1], records, jacobian, y[r], hessian),
            )
    for r in range(pairs + table[TRIMS], table[ROWS]):
        if weights[r] != 0.0 and blocked:
            add_gram_blocks(order[3], bases, jacobian, r, weights[r], hessian)
        elif weights[r] != 0.0:
            add_gram(bases, jacobian, r, weights[r], hessian)
        row = table[ROW_TABLE] + ROW * r
        if y[r] == 0.0 or table[row + KIND] != JOINT_ROW:
            continue
        second = table[row + SECOND]
        for part in range(1 if second < 0 else 2):
            at = row + COORDINATE if part == 0 else second
            f = bases[r, 0 if part == 0 else 3]
            g = bases[r, 1 if part == 0 else 4]
            k = pairs + table[at + 2]
            factor = y[r] * pool[table[row + PARAMETERS] + part]
            if blocked:
                add_coordinate_blocks(table[at], table[at + 1], records, k, factor, order, hessian, f, g)
            else:
                add_coordinate_hessian(table[at], table[at + 1], records, k, factor, hessian, f, g)
    for t in range(table[TAPES]):
        tape = table[TAPE_TABLE] + TAPE_RECORD * t
        idle = True
        for v in range(table[tape + TAPE_VALUES]):
            idle = idle and y[table[tape + TAPE_ROW_AT] + v] == 0.0
        if not idle:
            add_tape_hessian(table, pool, tape, q, room, order, y, hessian)
