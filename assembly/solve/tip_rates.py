"""The tip's Jacobian at a state, outside the loop: what `solve/tip.py` calls."""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.constraints.program import (
    BODIES,
    CONTACT_RECORD,
    CONTACTS,
    EXTRA,
    EXTRA_COLUMN,
    JOINTS,
    MOVING,
    ROWS,
    TAPE_ROOM,
    TRACKED,
    evaluate,
)
from assembly.constraints.terms import TERM_BODY, TERM_PARAMETERS, TERM_TAPE
from assembly.proximity.free_pair import VARIABLES, VECTORS
from assembly.solve.augmented_lagrangian import FREE_BELOW
from assembly.solve.contacts import free_folds, start_contacts
from assembly.solve.dexterity import INPUTS, measure_jacobian, rate_system, tip_rates, tip_slack
from assembly.solve.row_table import scaled_poses
from assembly.solve.rows import place_rows


@kernel(inner=True, allocates=True)
def point_at(table, pool, state, free):
    """A point of the loop at a state: whether all its rows are evaluated (-1, or the contact that is lost), how many
    contacts are at folds, the point, and what pairs and tapes need.

    Parameters of contacts that are NaN are found by a global start, pairs at folds are freed, as the loop does.
    """
    pairs = table[CONTACTS]
    tracks = table[TRACKED]
    most = table[ROWS] + 4 * pairs
    q = np.empty((table[BODIES], 7))
    tracked = np.empty((tracks, 4))
    start = np.empty((tracks, 4))
    records = np.ones((pairs + table[JOINTS], CONTACT_RECORD))
    packed = np.zeros((most, EXTRA_COLUMN + 6 * table[EXTRA]))
    point = (q, tracked, records, np.zeros(most), packed)
    o = table[TAPE_ROOM]
    room = (np.empty(table[o]), np.empty(table[o + 1]), np.empty(table[o + 2]))
    loose = (
        free,
        np.empty((pairs, 4)),
        np.empty((VECTORS if pairs > 0 else 0, 3, VARIABLES)),
        np.empty((VARIABLES if pairs > 0 else 0, VARIABLES)),
        np.empty((tracks, 4)),
    )
    scaled_poses(table, pool, state, q)
    for k in range(tracks):
        for i in range(4):
            tracked[k, i] = state[7 * table[BODIES] + 4 * k + i]
    for k in range(pairs):
        free[k] = -1
    count = 0
    lost = start_contacts(table, pool, q, tracked, free, loose[1])
    if lost < 0:
        # Every contact counts here, also one that pushes nothing.
        active = np.ones(most)
        count = free_folds(table, pool, records, tracked, active, free, loose[1], -1.0, -1)
        before = -1
        while count != before:
            for k in range(tracks):
                for i in range(4):
                    start[k, i] = tracked[k, i]
            lost = evaluate(table, pool, start, math.inf, loose, room, point)
            before = count
            count = free_folds(table, pool, records, tracked, active, free, loose[1], FREE_BELOW, lost)
    return lost, count, point, loose, room


@kernel
def tip_at(table, pool, term, state, free, jacobian):
    """The Jacobian of a term of dexterity at a state, in the user's units.

    Returns a contact that has no pair there or -1; by how much unit rates of the inputs are missed, and how much of the
    tip's motion they leave open (`dexterity.UNDETERMINED` is the most that counts as none); the measure.
    """
    lost, count, point, _loose, _room = point_at(table, pool, state, free)
    if lost >= 0:
        return lost, 0.0, 0.0, 0.0
    rows = table[ROWS] + 4 * count
    n = 6 * table[MOVING] + 4 * count
    bases = np.empty((rows, 3 + table[EXTRA]), np.int64)
    place_rows(table, free, bases, np.empty(rows, np.int64))
    record = table[term + TERM_TAPE]
    o = table[term + TERM_PARAMETERS]
    body = table[term + TERM_BODY]
    system = rate_system(table, record, bases, rows, n, point)
    missed = tip_rates(table, pool, record, o, body, system, point[0], np.empty((table[record + INPUTS], n)), jacobian)
    slack = tip_slack(table, pool, record, o, body, system, point[0])
    return lost, missed, slack, measure_jacobian(table, pool, record, o, jacobian, np.empty(jacobian.shape))
