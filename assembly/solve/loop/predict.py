"""Contacts along a step: where their pairs are expected at its end, and which rows stay open for certain."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.constraints.program.contact import copy_tracked, is_guard
from assembly.constraints.program.records import (
    BODY_F,
    CONTACTS,
    FREE_COLUMN,
    MINIMUM,
    ROW,
    ROW_TABLE,
    SHELL_F,
    SURFACE_F,
    TRACKED,
)
from assembly.geometry.splines.domain import into_domain
from assembly.proximity.extrema.rates import RATES, ZED
from assembly.proximity.features.solid_contact import CONTACT_RECORD, IDLE, PAIR_GAP, SLACK
from assembly.solve.loop.residuals import times


@kernel(inline=True)
def longest_way(d, at, alpha, far):
    """How far a body's points go along alpha d, which are not farther than `far` from its origin."""
    if at < 0:
        return 0.0
    shift = math.sqrt(d[at] * d[at] + d[at + 1] * d[at + 1] + d[at + 2] * d[at + 2])
    turn = math.sqrt(d[at + 3] * d[at + 3] + d[at + 4] * d[at + 4] + d[at + 5] * d[at + 5])
    return alpha * (shift + far * turn)


@kernel(inner=True)
def stays_open(table, pool, bases, k, here, trial, d, alpha):
    """Whether row k, of a clearance, is open all along alpha d for certain; if so, what is known of it goes on.

    No gap changes by more than points of the two bodies go, those of each seen from where they were.
    """
    left = here[2][k, SLACK]
    if not left > 0.0 or bases[k, 2] >= 0:
        return False
    minimum = table[table[ROW_TABLE] + ROW * k + MINIMUM]
    left -= longest_way(d, bases[k, 0], alpha, pool[minimum + 4])
    left -= longest_way(d, bases[k, 1], alpha, pool[minimum + 5])
    if not left > 0.0:
        return False
    for i in range(CONTACT_RECORD):
        trial[2][k, i] = here[2][k, i]
    for i in range(FREE_COLUMN):
        trial[4][k, i] = here[4][k, i]
    trial[2][k, SLACK] = left
    return True


@kernel(inner=True)
def carry(table, pool, bases, loose, here, trial, d, alpha):
    """Contact coordinates along alpha d: by the contact velocity, or, for a free pair, by its own unknowns.

    Gaps follow to first order, angles start from where they are: a step turns no body by more than a radian. The guess
    goes into `loose`. Rows of clearances that stay open for certain are marked there as IDLE, and their derivatives go
    on to the trial point as they are.
    """
    _q, tracked, records, _residual, jacobian = here
    lengths = loose[1]
    out = loose[4]
    for k in range(table[TRACKED]):
        copy_tracked(tracked, k, out)
    for k in range(table[CONTACTS]):
        row = table[ROW_TABLE] + ROW * k
        if table[row + BODY_F] < 0:
            continue
        f = bases[k, 0]
        g = bases[k, 1]
        u = bases[k, 2]
        out[k, PAIR_GAP] += alpha * times(bases, jacobian, k, d)
        if u >= 0:
            for i in range(4):
                out[k, i] += alpha * d[u + i] / lengths[k, i]
        else:
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
        keep_inside(table, pool, row, k, out)
        if is_guard(table, k) and stays_open(table, pool, bases, k, here, trial, d, alpha):
            out[k, IDLE] = 1.0
            out[k, PAIR_GAP] = max(out[k, PAIR_GAP], pool[table[row + MINIMUM]] + trial[2][k, SLACK])


@kernel(inner=True)
def keep_inside(table, pool, row, k, out):
    """A prediction may run over the end of a patch; Newton starts inside. What becomes of edges is up to switching."""
    if table[row + SHELL_F] >= 0:
        return
    for side in range(2):
        i = 2 * side
        out[k, i], out[k, i + 1], _clamped = into_domain(
            table, pool, table[row + SURFACE_F + side], out[k, i], out[k, i + 1]
        )
