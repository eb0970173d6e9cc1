"""What the loop does with rows: their places among the unknowns, products with the Jacobian, the merit.

`bases` says where the variables of each row stand, negative for none: twist of f, twist of g, a lifted pair's
coordinates, then twists of further bodies.
"""

from __future__ import annotations

from collections import namedtuple

from assembly._carve import carve
from assembly._kernel import kernel
from assembly.constraints.program.envelope import close_envelope, place_folds
from assembly.constraints.program.hessian_blocks import choose_storage
from assembly.constraints.program.objective_terms import TAPE_TERM, TERM, term_at
from assembly.constraints.program.records import (
    JOINT_ROW,
    ROW,
    TAPE_RECORD,
    Sparsity,
    body_coordinate_at,
    header_at,
    jacobian_row_at,
    joint_row_at,
    row_at,
    tape_at,
    trim_row_at,
)
from assembly.constraints.program.row_terms import column_of, width
from assembly.kinematics.motion import retract

# Where rows and unknowns stand. `bases`: see the heading; `one_sided`: 1 for rows residual >= 0; where the Hessian has
# entries (`constraints/program/envelope.py`); rows in the order of their bodies, and how far those of J J^T reach.
Structure = namedtuple("Structure", "bases one_sided sparsity row_order")
# The first row in an order that is not known yet.
NOT_ORDERED = -1


@kernel(inline=True)
def first_unknown(table, body):
    """Where a body's twist begins among the unknowns; negative for a fixed one, and for none."""
    return 6 * table[header_at(table, 0).unknown_blocks + body] if body >= 0 else -1


@kernel(inner=True)
def place_rows(table, free, bases, one_sided):
    """Write where each row's variables stand, and whether it is one-sided."""
    header = header_at(table, 0)
    for r in range(header.rows):
        row = header.row_table + ROW * r
        fields = row_at(table, row)
        one_sided[r] = fields.one_sided
        for b in range(bases.shape[1]):
            bases[r, b] = -1
        bases[r, 0] = first_unknown(table, fields.body_f)
        bases[r, 1] = first_unknown(table, fields.body_g)
        second = joint_row_at(table, row).second
        if fields.kind == JOINT_ROW and second >= 0:
            bases[r, 3] = first_unknown(table, body_coordinate_at(table, second).body_f)
            bases[r, 4] = first_unknown(table, body_coordinate_at(table, second).body_g)
    for r in range(header.contacts):
        if free[r] >= 0:
            bases[r, 2] = 6 * header.moving + 4 * free[r]
            for i in range(4):
                e = header.rows + 4 * free[r] + i
                one_sided[e] = 0
                for j in range(bases.shape[1]):
                    bases[e, j] = bases[r, j]
    for r in range(header.contacts, header.contacts + header.trims):
        k = trim_row_at(table, header.row_table + ROW * r).contact
        bases[r, 2] = bases[k, 2]
    for t in range(header.tapes):
        tape = tape_at(table, header.tape_table + TAPE_RECORD * t)
        for v in range(tape.values):
            for b in range(2, tape.bodies):
                bases[tape.first_row + v, b + 1] = first_unknown(table, table[tape.body_list + b])


@kernel(inline=True, allocates=True)
def record_of_blocks(table):
    """The part of the table that has the record of Hessian blocks; empty if the scene has none."""
    header = header_at(table, 0)
    return carve(table, header.block_record, (header.block_length,))


@kernel(inner=True)
def body_span(bases, r, n):
    """First unknown and last one of the bodies of row r; n and -1 where it has none."""
    low = n
    high = -1
    for b in range(bases.shape[1]):
        at = bases[r, b]
        if at >= 0 and b != 2:
            low = min(low, at)
            high = max(high, at + 5)
    return low, high


@kernel(inner=True)
def place_unknowns(table, bases, rows, n, order):
    """Where the Hessian of the Lagrangian has entries, and its factor (see `constraints/program/envelope.py`)."""
    header = header_at(table, 0)
    places, folds = order.places, order.folds
    last, ends = places[0], places[2]
    choose_storage(order, n)
    first = 6 * header.moving
    for i in range(n):
        last[i] = first + (i - first) // 4 * 4 + 3 if i >= first else i // 6 * 6 + 5
    for r in range(rows):
        low, high = body_span(bases, r, n)
        if high >= 0:
            last[low] = max(last[low], high)
    for t in range(header.terms):
        term = term_at(table, header.term_table + TERM * t)
        if term.kind == TAPE_TERM:
            tape = tape_at(table, term.tape)
            low = n
            high = -1
            for b in range(tape.bodies):
                at = first_unknown(table, table[tape.body_list + b])
                if at >= 0:
                    low = min(low, at)
                    high = max(high, at + 5)
            if high >= 0:
                last[low] = max(last[low], high)
    close_envelope(last, first)
    count = (n - first) // 4
    folds[folds.shape[0] - 1, 0] = 0
    if count == 0 or header.dexterities > 0:
        for i in range(n):
            if header.dexterities > 0:
                last[i] = n - 1
            ends[i] = last[i]
        return
    for r in range(header.contacts):
        if bases[r, 2] >= 0:
            k = (bases[r, 2] - first) // 4
            folds[k, 0] = bases[r, 0]
            folds[k, 1] = bases[r, 1]
    folds[folds.shape[0] - 1, 0] = count
    place_folds(n, order)


@kernel(inner=True)
def order_rows(shape, rows, n):
    """Rows in the order of their first bodies, and how far those of J J^T reach then (see `factorize`)."""
    bases, (sequence, last_row), latest = shape.bases, shape.row_order, shape.sparsity.places[3]
    # Rows meet in J J^T where they share a variable. First how many begin at each, then where the next one goes.
    for i in range(n + 1):
        latest[i] = 0
    for r in range(rows):
        latest[body_span(bases, r, n)[0]] += 1
    total = 0
    for i in range(n + 1):
        total, latest[i] = total + latest[i], total
    for r in range(rows):
        low = body_span(bases, r, n)[0]
        sequence[latest[low]] = r
        latest[low] += 1
    for at in range(rows):
        for b in range(bases.shape[1]):
            if bases[sequence[at], b] >= 0:
                latest[bases[sequence[at], b]] = at
    for at in range(rows):
        last_row[at] = at
        for b in range(bases.shape[1]):
            if bases[sequence[at], b] >= 0:
                last_row[at] = max(last_row[at], latest[bases[sequence[at], b]])
    close_envelope(last_row, rows)


@kernel(inner=True)
def arrange(table, free, shape, rows, n):
    """Where rows and unknowns stand, now that the pairs in `free` are at folds."""
    place_rows(table, free, shape.bases, shape.one_sided)
    place_unknowns(table, shape.bases, rows, n, shape.sparsity)
    if rows > 0:
        # Few solves ask for their order (`multipliers.least_squares_multipliers`).
        shape.row_order[0][0] = NOT_ORDERED


@kernel(inline=True)
def size_of_shape(table, most, n):
    """How many integers and doubles `shape_of` carves at most."""
    header = header_at(table, 0)
    integers = (6 + header.extra) * most + 2 * (header.contacts + 1) + 4 * (n + 1)
    return integers, 13 * max(n, 36)


@kernel(inline=True, allocates=True)
def shape_of(table, most, n, blocks, integers, doubles):
    """Carve a `Structure`, which `arrange` fills, for at most `most` rows and n unknowns.

    `blocks` is the scene's record of Hessian blocks (`record_of_blocks`), or an empty one for a dense Hessian. The
    arrays are carved from the ends of `integers` and `doubles`.
    """
    header = header_at(table, 0)
    end, tail = size_of_shape(table, most, n)
    at = integers.size - end
    of_rows = carve(integers, at, (3, most))
    folds = carve(integers, at + 3 * most, (header.contacts + 1, 2))
    places = carve(integers, at + 3 * most + 2 * (header.contacts + 1), (4, n + 1))
    bases = carve(integers, integers.size - (3 + header.extra) * most, (most, 3 + header.extra))
    scratch = carve(doubles, doubles.size - tail, (13 if blocks.size > 0 else 1, max(n, 36)))
    sparsity = Sparsity(places, folds, scratch, blocks)
    return Structure(bases, of_rows[0], sparsity, (of_rows[1], of_rows[2]))


@kernel(inline=True)
def times(bases, jacobian, r, d):
    """Row r of J d."""
    row = jacobian_row_at(jacobian, r)
    s = 0.0
    f = bases[r, 0]
    if f >= 0:
        for k in range(6):
            s += row.twist_f[k] * d[f + k]
    g = bases[r, 1]
    if g >= 0:
        for k in range(6):
            s += row.twist_g[k] * d[g + k]
    u = bases[r, 2]
    if u >= 0:
        for k in range(4):
            s += row.lifted[k] * d[u + k]
    for b in range(3, bases.shape[1]):
        at, column = bases[r, b], column_of(b)
        if at >= 0:
            for k in range(6):
                s += jacobian[r, column + k] * d[at + k]
    return s


@kernel(inline=True)
def add_row(bases, jacobian, r, factor, out):
    """out += factor times row r of J."""
    row = jacobian_row_at(jacobian, r)
    f = bases[r, 0]
    if f >= 0:
        for k in range(6):
            out[f + k] += factor * row.twist_f[k]
    g = bases[r, 1]
    if g >= 0:
        for k in range(6):
            out[g + k] += factor * row.twist_g[k]
    u = bases[r, 2]
    if u >= 0:
        for k in range(4):
            out[u + k] += factor * row.lifted[k]
    for b in range(3, bases.shape[1]):
        at, column = bases[r, b], column_of(b)
        if at >= 0:
            for k in range(6):
                out[at + k] += factor * jacobian[r, column + k]


@kernel(inner=True)
def add_transposed(bases, jacobian, rows, weights, out):
    """out += J^T weights."""
    for r in range(rows):
        if weights[r] != 0.0:
            add_row(bases, jacobian, r, weights[r], out)


@kernel(inner=True)
def violation_of(residual, one_sided, rows):
    """Largest violation."""
    worst = 0.0
    for r in range(rows):
        c = residual[r]
        if one_sided[r] == 1:
            c = min(c, 0.0)
        if not abs(c) <= worst:
            worst = abs(c)
    return worst


@kernel(inner=True)
def merit(residual, one_sided, rows):
    """What the rows add to the augmented Lagrangian; a one-sided row counts only while y + c / mu is negative."""
    value = 0.0
    y, mu = rows.y, rows.mu
    for r in range(rows.count):
        c = residual[r]
        if one_sided[r] == 1 and y[r] + c / mu >= 0.0:
            value -= 0.5 * mu * y[r] * y[r]
        else:
            value += y[r] * c + 0.5 * c * c / mu
    return value


@kernel(inner=True)
def move(table, q, d, alpha, out):
    """Write the poses of all moving bodies after the step alpha d (a retraction) into `out`."""
    header = header_at(table, 0)
    for b in range(header.bodies):
        s = 6 * table[header.unknown_blocks + b]
        if s >= 0:
            retract(
                q,
                b,
                (alpha * d[s], alpha * d[s + 1], alpha * d[s + 2]),
                (alpha * d[s + 3], alpha * d[s + 4], alpha * d[s + 5]),
                out,
            )


@kernel(inner=True)
def largest_turn(store, tracked):
    """The largest product of a factor and an angle in a row."""
    header = header_at(store.table, 0)
    most = 0.0
    for r in range(header.contacts, header.rows):
        row = header.row_table + ROW * r
        joint = joint_row_at(store.table, row)
        if row_at(store.table, row).kind != JOINT_ROW:
            continue
        o = joint.parameters
        if joint.angle >= 0:
            most = max(most, max(abs(store.pool[o + 2]), abs(store.pool[o] * tracked[joint.angle, 0])))
        second = joint.second
        if second >= 0 and store.table[second + 3] >= 0:
            most = max(most, abs(store.pool[o + 1] * tracked[store.table[second + 3], 0]))
    return most


@kernel(inner=True)
def clear_row(bases, r, out):
    """Set `out` to zero at the variables of row r."""
    for b in range(bases.shape[1]):
        at = bases[r, b]
        if at >= 0:
            for k in range(width(b)):
                out[at + k] = 0.0
