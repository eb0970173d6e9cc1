"""Room that a solve works in. One block of memory a kind, because each costs its allocation."""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly.constraints.blocks import BLOCKS, FACTORED, is_blocked
from assembly.constraints.layout import (
    BODIES,
    CONTACTS,
    EXTRA,
    EXTRA_COLUMN,
    JOINTS,
    ROWS,
    TAPE_ROOM,
    TRACKED,
    VECTOR_TRIMS,
)
from assembly.proximity.free_pair import VARIABLES, VECTORS
from assembly.proximity.solid_contact import CONTACT_RECORD, TRACK

# What a row has a number of, behind its residuals here and at the trial point: its multiplier, a better one, whether it
# counts, what it pushes with, whether a step would break it.
BY_ROW = 7


@kernel(inline=True, allocates=True)
def results_of(table, state):
    """The end of a state, behind poses, tracked values, multipliers and residuals."""
    return state[7 * table[BODIES] + TRACK * table[TRACKED] + 2 * table[ROWS] :]


@kernel(inline=True, allocates=True)
def points(table, most):
    """Two points of the search, room by row, and tracked values more, for a guess.

    A point: poses, tracked values, records, residual, Jacobian. `most` rows at most.
    """
    poses = np.empty((2, table[BODIES], 7))
    tracked = np.empty((3, table[TRACKED], TRACK))
    records = np.empty((2, table[CONTACTS] + table[JOINTS] + table[VECTOR_TRIMS], CONTACT_RECORD))
    by_row = np.zeros((BY_ROW, most))
    jacobians = np.empty((2, most, EXTRA_COLUMN + 6 * table[EXTRA]))
    here = (poses[0], tracked[0], records[0], by_row[0], jacobians[0])
    trial = (poses[1], tracked[1], records[1], by_row[1], jacobians[1])
    return here, trial, by_row, tracked[2]


@kernel(inline=True, allocates=True)
def pairs_room(table, guess, memory):
    """What pairs need: which are free, the lengths of their coordinates, room for their derivatives; a guess of all.

    With what a watch of clearances remembers. No pair is free yet.
    """
    pairs = table[CONTACTS]
    vectors = np.empty((VECTORS if pairs > 0 else 0, 3, VARIABLES))
    values = np.empty((VARIABLES if pairs > 0 else 0, VARIABLES))
    return np.full(pairs, np.int64(-1)), np.empty((pairs, 4)), vectors, values, guess, memory


@kernel(inline=True, allocates=True)
def tape_room(table):
    """What the instructions of expressions work in."""
    o = table[TAPE_ROOM]
    return np.empty(table[o]), np.empty(table[o + 1]), np.empty(table[o + 2])


@kernel(inline=True, allocates=True)
def held_room(table, most):
    """A pose, its tracked values and its multipliers."""
    return np.empty((table[BODIES], 7)), np.empty((table[TRACKED], TRACK)), np.empty(most)


@kernel(inline=True, allocates=True)
def unknowns(n, order):
    """Room for n unknowns: gradient, (right side or scratch, step, step before it was bent), Hessian, its factor."""
    vectors = np.empty((4, n))
    if is_blocked(order):
        hessian = np.empty((6 * order[3][BLOCKS], 6))
        factor = np.empty((1, 36 * order[3][FACTORED]))
    else:
        matrices = np.empty((2, n, n))
        hessian, factor = matrices[0], matrices[1]
    return vectors[0], (vectors[1], vectors[2], vectors[3]), hessian, factor
