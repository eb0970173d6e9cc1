"""Contacts along a step: where their pairs are expected at its end, and which rows stay open for certain."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.constraints.program.contact import contact_of, copy_tracked, is_clearance_row, predict_pair, surface_of
from assembly.constraints.program.records import FREE_COLUMN, header_at
from assembly.geometry.splines.domain import into_domain
from assembly.proximity.extrema.rates import derivatives_at
from assembly.proximity.features.solid_contact import CONTACT_RECORD, contact_record_at, tracked_at
from assembly.solve.loop.residuals import times


@kernel(inline=True)
def longest_way(d, at, alpha, far):
    """A bound on how far a body's points within a distance `far` of its origin move along alpha d."""
    if at < 0:
        return 0.0
    shift = math.sqrt(d[at] * d[at] + d[at + 1] * d[at + 1] + d[at + 2] * d[at + 2])
    turn = math.sqrt(d[at + 3] * d[at + 3] + d[at + 4] * d[at + 4] + d[at + 5] * d[at + 5])
    return alpha * (shift + far * turn)


@kernel(inner=True)
def keep_open_row(store, bases, k, current, trial, d, alpha):
    """Keep the values of row k of a clearance if it is certainly open all along alpha d. Whether it is.

    No gap changes by more than the points of one body and those of the other move, added.
    """
    left = contact_record_at(current.records, k).slack
    if not left > 0.0 or bases[k, 2] >= 0:
        return False
    minimum = contact_of(store.table, k).minimum
    left -= longest_way(d, bases[k, 0], alpha, store.pool[minimum + 4])
    left -= longest_way(d, bases[k, 1], alpha, store.pool[minimum + 5])
    if not left > 0.0:
        return False
    for i in range(CONTACT_RECORD):
        trial.records[k, i] = current.records[k, i]
    for i in range(FREE_COLUMN):
        trial.jacobian[k, i] = current.jacobian[k, i]
    contact_record_at(trial.records, k).slack = left
    return True


@kernel(inner=True)
def predict_pairs(store, bases, lifted, current, trial, d, alpha):
    """Contact coordinates along alpha d: by the contact velocity, or, for a lifted pair, by its own unknowns.

    Gaps follow to first order. Angles start from their current values: no component of a straight step's rotation
    vectors is above a radian. The guess goes into `lifted`. Rows of clearances that stay open for certain are marked
    there as idle, and their derivatives are copied to the trial iterate.
    """
    header = header_at(store.table, 0)
    tracked, records, jacobian = current.tracked, current.records, current.jacobian
    lengths = lifted.lengths
    out = lifted.guess
    for k in range(header.tracked):
        copy_tracked(tracked, k, out)
    for k in range(header.contacts):
        contact = contact_of(store.table, k)
        if contact.body_f < 0:
            continue
        f = bases[k, 0]
        g = bases[k, 1]
        u = bases[k, 2]
        tracked_at(out, k).gap += alpha * times(bases, jacobian, k, d)
        if u >= 0:
            for i in range(4):
                out[k, i] += alpha * d[u + i] / lengths[k, i]
            keep_inside(store, k, out)
        else:
            for j in range(4):
                s = 0.0
                for i in range(6):
                    if f >= 0:
                        s += derivatives_at(records, k).zed[j, i] * d[f + i]
                    if g >= 0:
                        s += derivatives_at(records, k).zed[j, 6 + i] * d[g + i]
                s *= alpha
                for i in range(4):
                    out[k, i] += derivatives_at(records, k).rates[i, j] * s
            predict_pair(store, k, tracked, out)
        if is_clearance_row(store.table, k) and keep_open_row(store, bases, k, current, trial, d, alpha):
            tracked_at(out, k).idle = 1.0
            tracked_at(out, k).gap = max(
                tracked_at(out, k).gap, store.pool[contact.minimum] + contact_record_at(trial.records, k).slack
            )


@kernel(inner=True)
def keep_inside(store, k, out):
    """Bring coordinates of a lifted pair back into the domains: as unknowns they may pass the end of a patch."""
    for side in range(2):
        i = 2 * side
        out[k, i], out[k, i + 1], _clamped = into_domain(
            store, surface_of(contact_of(store.table, k), side), out[k, i], out[k, i + 1]
        )
