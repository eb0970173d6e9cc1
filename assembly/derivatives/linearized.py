"""A solution as linear equations: what a unit of each parameter adds to rows and slopes, and how measures change.

They are made from an evaluated scene whose frames stand on probes (`derivatives/probed.py`), and reduced to the twists
of the moving bodies. The formulas are those of docs/sensitivity.md. They do not cover parameters of the shape of faces,
for which finite differences are used (`derivatives/columns.py`).
"""

from __future__ import annotations

import math

import numpy as np

from assembly._carve import carve
from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.constraints.program.records import pool_header_at
from assembly.geometry.vec import quaternion_matrix

# What is known of a scene before it is evaluated, in a table; offsets are in that table.
PLAN = record_dtype(
    "i8",
    bodies=1,
    probes=1,
    rows=1,
    coordinates=1,  # further rows, behind those: coordinates that are measured
    unknowns=1,
    implicit=1,  # 1: the least motion is asked for
    blocks=1,  # of every body the place of its block of unknowns, or -1
    hosts=1,  # of every probe its body
    entries=1,
    entry_count=1,
    parameters=1,
    measured=1,  # how many measures there are
    measures=1,
    measure_count=1,
    one_sided=1,  # of every row 1 if it may open
    limits=1,  # of rows and balance, in the figures: see `derivatives/derived.py`
)
plan_at = record_view(PLAN)
PLAN_SIZE = size_of(PLAN)
# What a parameter adds somewhere; one may have several.
ORIGIN, TURN, ROW, TARGET = range(4)
ENTRY = record_dtype(
    "i8",
    kind=1,
    parameter=1,
    axis=1,
    probe=1,  # of a frame
    at=1,  # where its origin is in the pool; of a target its place; of a row its number
    is_length=1,
    sign=1,
    rates=1,  # of a turn: where the rates of its vector are in the figures
    body=1,  # of a target
)
entry_at = record_view(ENTRY)
ENTRY_SIZE = size_of(ENTRY)
# What is measured. A distance has two records, the second one for its other end.
COORDINATE, GAP, PLACE, DISTANCE, END = range(5)
MEASURE = record_dtype(
    "i8",
    kind=1,
    number=1,  # of the measure
    row=1,
    body=1,
    axis=1,
    probe=1,  # whose frame is the place, or -1
    at=1,  # where the place on the body is in the figures
)
measure_at = record_view(MEASURE)
MEASURE_SIZE = size_of(MEASURE)


@kernel(inner=True)
def reduce_rows(plan, table, rows, out):
    """Add the columns of rows to those of moving bodies; the columns of a probe go to its body."""
    for b in range(plan.bodies + plan.probes):
        body = b if b < plan.bodies else table[plan.hosts + b - plan.bodies]
        block = table[plan.blocks + body]
        if block < 0:
            continue
        for r in range(out.shape[0]):
            for i in range(6):
                out[r, 6 * block + i] += rows[r, 6 * b + i]


@kernel(inner=True)
def reduce_hessian(plan, table, hessian, out):
    """Reduce rows and columns of a Hessian as `reduce_rows` does."""
    count = plan.bodies + plan.probes
    for a in range(count):
        first = table[plan.blocks + (a if a < plan.bodies else table[plan.hosts + a - plan.bodies])]
        if first < 0:
            continue
        for b in range(count):
            second = table[plan.blocks + (b if b < plan.bodies else table[plan.hosts + b - plan.bodies])]
            if second < 0:
                continue
            for i in range(6):
                for j in range(6):
                    out[6 * first + i, 6 * second + j] += hessian[6 * a + i, 6 * b + j]


@kernel(inner=True)
def write_twist(entry, pool, turn, figures, scale, twist):
    """The twist (6,) of a frame per unit of its parameter, about its body's origin, lengths over the scene's size."""
    for i in range(3):
        twist[i] = turn[i, entry.axis] / scale
        twist[3 + i] = 0.0
    if entry.kind == TURN:
        for i in range(3):
            for j in range(3):
                twist[3 + i] += turn[i, j] * figures[entry.rates + 3 * j + entry.axis]
        x, y, z = 0.0, 0.0, 0.0
        for j in range(3):
            x += turn[0, j] * pool[entry.at + j]
            y += turn[1, j] * pool[entry.at + j]
            z += turn[2, j] * pool[entry.at + j]
        a, b, c = twist[3], twist[4], twist[5]
        twist[0], twist[1], twist[2] = c * y - b * z, a * z - c * x, b * x - a * y


@kernel(inner=True, allocates=True)
def add_frame(plan, table, entry, twist, seen, out):
    """What the twist of a frame adds to rows, slopes, and the value."""
    jacobian, hessian, gradient, forces = seen
    rows_by, slopes_by, values, coordinates_by = out
    r, first, m = entry.parameter, 6 * (plan.bodies + entry.probe), plan.rows
    for k in range(6):
        amount = twist[k]
        if amount == 0.0:
            continue
        for i in range(m):
            rows_by[i, r] += jacobian[i, first + k] * amount
        for i in range(plan.coordinates):
            coordinates_by[i, r] += jacobian[m + i, first + k] * amount
        values[r] += gradient[first + k] * amount
        if plan.implicit == 1:
            continue
        for b in range(plan.bodies + plan.probes):
            block = table[plan.blocks + (b if b < plan.bodies else table[plan.hosts + b - plan.bodies])]
            if block >= 0:
                for i in range(6):
                    slopes_by[6 * block + i, r] += hessian[6 * b + i, first + k] * amount
    block = table[plan.blocks + table[plan.hosts + entry.probe]]
    if plan.implicit == 1 or block < 0:
        return
    pull = np.zeros(6)
    for k in range(6):
        pull[k] = gradient[first + k]
        for i in range(m):
            pull[k] += forces[i] * jacobian[i, first + k]
    # The body turns after the frame's twist; the second derivative takes it as half before and half after.
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        off = pull[j] * twist[k] - pull[k] * twist[j] + 0.5 * (pull[3 + j] * twist[3 + k] - pull[3 + k] * twist[3 + j])
        slopes_by[6 * block + 3 + i, r] -= off


@kernel(inner=True, allocates=True)
def add_target(plan, table, entry, pool, state, turn, out):
    """What a coordinate of a target adds to the slopes of w |p - t|^2, and to its value."""
    _, slopes_by, values, _ = out
    r, at = entry.parameter, entry.at
    header = pool_header_at(pool, 0)
    arm = np.zeros(3)
    for i in range(3):
        for j in range(3):
            arm[i] += turn[i, j] * pool[at - 3 + j]
    factor = -2.0 * pool[at - 4] / header.scale
    axis = entry.axis
    place = (state[7 * entry.body + axis] - header.reference[axis]) / header.scale + arm[axis]
    values[r] += factor * (place - pool[at + axis])
    block = table[plan.blocks + entry.body]
    if block >= 0 and plan.implicit == 0:
        j, k = (axis + 1) % 3, (axis + 2) % 3
        slopes_by[6 * block + axis, r] += factor
        slopes_by[6 * block + 3 + j, r] += factor * arm[k]
        slopes_by[6 * block + 3 + k, r] -= factor * arm[j]


@kernel(inner=True)
def write_turns(plan, state, turns):
    """Rotation matrices of all bodies, (b, 3, 3)."""
    for b in range(plan.bodies):
        at = 7 * b + 3
        matrix = quaternion_matrix(state[at], state[at + 1], state[at + 2], state[at + 3])
        for i in range(3):
            for j in range(3):
                turns[b, i, j] = matrix[3 * i + j]


@kernel(inner=True, allocates=True)
def add_parameters(plan, table, given, seen, out):
    """Add the effect of every parameter on rows, slopes and the value."""
    pool, state, figures, turns = given
    scale, twist = pool_header_at(pool, 0).scale, np.zeros(6)
    for e in range(plan.entry_count):
        entry = entry_at(table, plan.entries + ENTRY_SIZE * e)
        if entry.kind == ROW:
            out[0][entry.at, entry.parameter] += entry.sign * (1.0 / scale if entry.is_length == 1 else 1.0)
        elif entry.kind == TARGET:
            add_target(plan, table, entry, pool, state, turns[entry.body], out)
        else:
            write_twist(entry, pool, turns[table[plan.hosts + entry.probe]], figures, scale, twist)
            add_frame(plan, table, entry, twist, seen, out)


@kernel(inner=True, allocates=True)
def add_place(plan, table, measure, way, given, out):
    """Add how a place moves in the direction `way`: its slopes, and what parameters of its frame add."""
    pool, _, figures, turns = given
    slopes, own = out
    scale, turn, i = pool_header_at(pool, 0).scale, turns[measure.body], measure.number
    block = table[plan.blocks + measure.body]
    if block >= 0:
        arm = np.zeros(3)
        for a in range(3):
            for b in range(3):
                arm[a] += turn[a, b] * figures[measure.at + b]
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            slopes[i, 6 * block + a] += way[a] * scale
            slopes[i, 6 * block + 3 + a] += arm[b] * way[c] - arm[c] * way[b]
    if measure.probe >= 0:
        for e in range(plan.entry_count):
            entry = entry_at(table, plan.entries + ENTRY_SIZE * e)
            if entry.kind == ORIGIN and entry.probe == measure.probe:
                for a in range(3):
                    own[i, entry.parameter] += way[a] * turn[a, entry.axis]


@kernel(inner=True)
def write_way(table, at, measure, given, way):
    """Write the unit vector (3,) from one end of a distance to the other. Returns whether there is one."""
    _, state, figures, turns = given
    end = measure_at(table, at + MEASURE_SIZE)
    square = 0.0
    for a in range(3):
        way[a] = state[7 * end.body + a] - state[7 * measure.body + a]
        for b in range(3):
            way[a] += turns[end.body][a, b] * figures[end.at + b] - turns[measure.body][a, b] * figures[measure.at + b]
        square += way[a] * way[a]
    length = math.sqrt(square)
    for a in range(3):
        way[a] /= length
    return length > 0.0


@kernel(inner=True, allocates=True)
def add_measures(plan, table, given, out):
    """Add all measures. Returns whether every distance has a direction (is not zero)."""
    slopes, own, rows, rows_by, coordinates_by = out
    way = np.zeros(3)
    for e in range(plan.measure_count):
        at = plan.measures + MEASURE_SIZE * e
        measure = measure_at(table, at)
        i = measure.number
        if measure.kind == COORDINATE:
            for j in range(plan.unknowns):
                slopes[i, j] = rows[plan.rows + measure.row, j]
            for r in range(plan.parameters):
                own[i, r] = coordinates_by[measure.row, r]
        elif measure.kind == GAP:
            for j in range(plan.unknowns):
                slopes[i, j] = rows[measure.row, j]
            for r in range(plan.parameters):
                own[i, r] = rows_by[measure.row, r]
            # The row is the gap less the least gap, which may be a parameter.
            for other in range(plan.entry_count):
                entry = entry_at(table, plan.entries + ENTRY_SIZE * other)
                if entry.kind == ROW and entry.at == measure.row:
                    own[i, entry.parameter] -= entry.sign / pool_header_at(given[0], 0).scale
        elif measure.kind == PLACE:
            for a in range(3):
                way[a] = 1.0 if a == measure.axis else 0.0
            add_place(plan, table, measure, way, given, (slopes, own))
        elif measure.kind == DISTANCE:
            if not write_way(table, at, measure, given, way):
                return False
            add_place(plan, table, measure_at(table, at + MEASURE_SIZE), way, given, (slopes, own))
            for a in range(3):
                way[a] = -way[a]
            add_place(plan, table, measure, way, given, (slopes, own))
    return True


@kernel(inner=True, allocates=True)
def linearize(table, pool, state, figures, forces, evaluated, out):
    """Write the equations of a solution. Returns whether they are finite and no measured distance is zero.

    Parameters
    ----------
    table, figures
        The plan (`PLAN`), and doubles that it refers to; first of every body half its size over the scene's.
    pool, state
        Of the packed scene.
    forces : (m,)
    evaluated
        What `curvature_at` wrote of the scene with probes: m rows and coordinates, n twists of bodies and probes.
    out
        Zeros, the first of which become: rows and coordinates (m + e, n), the Hessian (n, n), what a unit of each
        parameter adds to rows (m, p), coordinates (e, p), slopes (n, p) and the value (p,); slopes of measures (k, n)
        and what parameters add to these (k, p); the slopes of the Lagrangian (n,), and the largest of them.
    """
    plan = plan_at(table, 0)
    m, e, n, p = plan.rows, plan.coordinates, plan.unknowns, plan.parameters
    k, columns = plan.measured, 6 * (plan.bodies + plan.probes)
    size = 1 + (m + e) + columns + (m + e) * columns + columns * columns
    infinite = 0
    for i in range(size):
        infinite += not math.isfinite(evaluated[i])
    if infinite > 0:
        return False
    gradient = carve(evaluated, 1 + m + e, (1, columns))
    jacobian = carve(evaluated, 1 + m + e + columns, (m + e, columns))
    hessian = carve(evaluated, 1 + m + e + columns + (m + e) * columns, (columns, columns))
    at = 0
    rows = carve(out, at, (m + e, n))
    at += (m + e) * n
    curvature = carve(out, at, (n, n))
    at += n * n
    rows_by = carve(out, at, (m, p))
    at += m * p
    coordinates_by = carve(out, at, (e, p))
    at += e * p
    slopes_by = carve(out, at, (n, p))
    at += n * p
    values = carve(out, at, (p,))
    at += p
    slopes = carve(out, at, (k, n))
    at += k * n
    own = carve(out, at, (k, p))
    at += k * p
    left = carve(out, at, (1, n))
    reduce_rows(plan, table, jacobian, rows)
    if plan.implicit == 1:
        for b in range(plan.bodies):
            block = table[plan.blocks + b]
            if block >= 0:
                for i in range(6):
                    curvature[6 * block + i, 6 * block + i] = 1.0 if i < 3 else figures[b] * figures[b]
    else:
        reduce_hessian(plan, table, hessian, curvature)
        reduce_rows(plan, table, gradient, left)
        for r in range(m):
            for i in range(n):
                left[0, i] += forces[r] * rows[r, i]
        for i in range(n):
            out[at + n] = max(out[at + n], abs(left[0, i]))
    turns = np.empty((plan.bodies, 3, 3))
    write_turns(plan, state, turns)
    given = (pool, state, figures, turns)
    add_parameters(
        plan, table, given, (jacobian, hessian, gradient[0], forces), (rows_by, slopes_by, values, coordinates_by)
    )
    return add_measures(plan, table, given, (slopes, own, rows, rows_by, coordinates_by))
