"""What the loop does with rows: their places among the unknowns, products with the Jacobian, the merit."""

from __future__ import annotations

from assembly._kernel import kernel
from assembly.constraints.program import (
    BODIES,
    BODY_F,
    BODY_G,
    CONTACT,
    MOVING,
    ONE_SIDED,
    ROW,
    ROW_TABLE,
    ROWS,
    SLOTS,
)
from assembly.kinematics.motion import retract
from assembly.proximity.extremal import into_domain
from assembly.proximity.velocity import RATES, ZED
from assembly.solve.linear import factorize, substitute


@kernel(inner=True)
def place_rows(table, free, bases, one_sided):
    """Where each row's variables stand (twist of f, twist of g, free coordinates; negative: none), and its side."""
    for r in range(table[ROWS]):
        row = table[ROW_TABLE] + ROW * r
        k = table[row + CONTACT]
        one_sided[r] = table[row + ONE_SIDED]
        bases[r, 0] = 6 * table[table[SLOTS] + table[row + BODY_F]]
        bases[r, 1] = 6 * table[table[SLOTS] + table[row + BODY_G]]
        bases[r, 2] = 6 * table[MOVING] + 4 * free[k] if free[k] >= 0 else -1
        if free[k] >= 0:
            for i in range(4):
                e = table[ROWS] + 4 * free[k] + i
                one_sided[e] = 0
                for j in range(3):
                    bases[e, j] = bases[r, j]


@kernel(inner=True)
def times(bases, jacobian, r, d):
    """Row r of J d."""
    s = 0.0
    f = bases[r, 0]
    if f >= 0:
        for k in range(6):
            s += jacobian[r, k] * d[f + k]
    g = bases[r, 1]
    if g >= 0:
        for k in range(6):
            s += jacobian[r, 6 + k] * d[g + k]
    u = bases[r, 2]
    if u >= 0:
        for k in range(4):
            s += jacobian[r, 12 + k] * d[u + k]
    return s


@kernel(inner=True)
def add_row(bases, jacobian, r, factor, out):
    """out += factor times row r of J."""
    f = bases[r, 0]
    if f >= 0:
        for k in range(6):
            out[f + k] += factor * jacobian[r, k]
    g = bases[r, 1]
    if g >= 0:
        for k in range(6):
            out[g + k] += factor * jacobian[r, 6 + k]
    u = bases[r, 2]
    if u >= 0:
        for k in range(4):
            out[u + k] += factor * jacobian[r, 12 + k]


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
def merit(residual, one_sided, rows, y, mu):
    """What the rows add to the augmented Lagrangian; a one-sided row counts only while y + c / mu is negative."""
    value = 0.0
    for r in range(rows):
        c = residual[r]
        if one_sided[r] == 1 and y[r] + c / mu >= 0.0:
            value -= 0.5 * mu * y[r] * y[r]
        else:
            value += y[r] * c + 0.5 * c * c / mu
    return value


@kernel(inner=True)
def move(table, q, d, alpha, out):
    """Every moving body retracted by alpha d."""
    for b in range(table[BODIES]):
        s = 6 * table[table[SLOTS] + b]
        if s >= 0:
            retract(
                q,
                b,
                (alpha * d[s], alpha * d[s + 1], alpha * d[s + 2]),
                (alpha * d[s + 3], alpha * d[s + 4], alpha * d[s + 5]),
                out,
            )


@kernel(inner=True)
def carry(table, pool, bases, free, lengths, contacts, records, d, alpha, out):
    """Contact coordinates along alpha d: by the contact velocity, or, for a free pair, by its own unknowns."""
    for r in range(table[ROWS]):
        row = table[ROW_TABLE] + ROW * r
        k = table[row + CONTACT]
        f = bases[r, 0]
        g = bases[r, 1]
        u = bases[r, 2]
        if u >= 0:
            out[k, 0], out[k, 1], _clamped = into_domain(
                table,
                pool,
                table[row + 3],
                contacts[k, 0] + alpha * d[u] / lengths[k, 0],
                contacts[k, 1] + alpha * d[u + 1] / lengths[k, 1],
            )
            out[k, 2], out[k, 3], _clamped = into_domain(
                table,
                pool,
                table[row + 4],
                contacts[k, 2] + alpha * d[u + 2] / lengths[k, 2],
                contacts[k, 3] + alpha * d[u + 3] / lengths[k, 3],
            )
            continue
        for i in range(4):
            out[k, i] = contacts[k, i]
        for j in range(4):
            s = 0.0
            for i in range(6):
                if f >= 0:
                    s += records[k, ZED + 12 * j + i] * d[f + i]
                if g >= 0:
                    s += records[k, ZED + 12 * j + 6 + i] * d[g + i]
            s *= alpha
            for i in range(4):
                out[k, i] += records[k, RATES + 4 * i + j] * s
        # The prediction may run over the end of a patch; Newton starts inside.
        out[k, 0], out[k, 1], _clamped = into_domain(table, pool, table[row + 3], out[k, 0], out[k, 1])
        out[k, 2], out[k, 3], _clamped = into_domain(table, pool, table[row + 4], out[k, 2], out[k, 3])


@kernel(inner=True)
def dual_residual(bases, jacobian, rows, one_sided, residual, gradient, y, scratch):
    """Largest component of grad f + J^T y, and of complementarity."""
    for i in range(gradient.size):
        scratch[i] = gradient[i]
    add_transposed(bases, jacobian, rows, y, scratch)
    worst = 0.0
    for i in range(gradient.size):
        if not abs(scratch[i]) <= worst:
            worst = abs(scratch[i])
    for r in range(rows):
        if one_sided[r] == 1:
            worst = max(worst, min(abs(y[r]), abs(residual[r])))
    return worst


@kernel(inner=True)
def least_squares_multipliers(bases, jacobian, rows, one_sided, active, gradient, scratch, gram, y):
    """The multipliers of the active rows that leave the smallest grad f + J^T y."""
    n = gradient.size
    for r in range(rows):
        for i in range(n):
            scratch[i] = 0.0
        if active[r] > 0.0:
            add_row(bases, jacobian, r, 1.0, scratch)
        for s in range(r, rows):
            gram[r, s] = times(bases, jacobian, s, scratch) if active[s] > 0.0 else 0.0
        gram[r, r] += 1e-10 if active[r] > 0.0 else 1.0
        y[r] = -times(bases, jacobian, r, gradient) if active[r] > 0.0 else 0.0
    if factorize(gram, rows):
        substitute(gram, rows, y)
    for r in range(rows):
        if one_sided[r] == 1:
            y[r] = min(y[r], 0.0)
