"""Expressions that do not hold, weighed by their slopes instead of by the scales they were given.

Where rows do not hold, the loop minimizes |c|^2 / 2, and ends where J^T c = 0. These points depend on the scale of each
row: an expression with a scale of 1000 hardly contributes to the sum, so that the loop may end anywhere on the curve
along which the other rows hold, where the expression is violated least. The scale says what counts as held, not that
the row may be given up. So before a violation is called a contradiction, the loop continues with every expression
divided by its steepest slope at the end, and from there, if that is better, with the given scales.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of as records_in
from assembly.constraints.packing.scene import Packed
from assembly.constraints.program.records import TAPE_FIELDS, TAPE_RECORD, TAPE_TABLE, TAPES
from assembly.errors import InputError
from assembly.solve.attempts.fit import Run
from assembly.solve.dense.jacobian import moving_columns, rows_of
from assembly.solve.dense.rank import HELD
from assembly.solve.loop.settings import (
    COUNT,
    GATHER,
    INFEASIBLE,
    ITERATIONS,
    PENALTY,
    PENALTY_FLOOR,
    SOLVED,
    STALLED,
    VIOLATION,
)
from assembly.solve.second_order.leave import Outcome

__all__ = ["balanced"]

Array = NDArray[np.float64]
# Smaller slopes count as zero.
FLAT = 1e-12
# How much of the forces of violated rows may remain along a coordinate, in parts of the forces there, or of the
# strongest one anywhere.
CANCELED, LEVEL = 1e-3, 1e-8


def balanced(packed: Packed, settings: Array, outcome: Outcome, run: Run) -> Outcome:
    """An outcome; if expressions do not hold, that of a solve that weights them by their slopes, if it holds.

    INFEASIBLE is an end that is least with the scales as they were given, or with these weights. `run` is the loop of a
    packed scene with settings from a state.
    """
    at = packed.results_at
    off = outcome.state[at + VIOLATION]
    if not packed.table[TAPES] or outcome.code not in (INFEASIBLE, STALLED) or off <= HELD * packed.scale:
        return outcome
    slopes = _slopes(packed, outcome.state)
    if slopes is None:
        return outcome
    twin = packed.twin()
    twin.pool[_records(packed).unit] *= slopes
    onward = settings.copy()
    onward[GATHER] = 0.0
    alike = run(twin, onward, _with_multipliers(packed, outcome.state, 0.0 * slopes))
    spent = int(alike.state[at + COUNT])
    onward[ITERATIONS] = max(settings[ITERATIONS] - spent, 0.0)
    # A soft penalty would lead back to where it came from.
    onward[PENALTY] = settings[PENALTY_FLOOR]
    after = run(packed, onward, _with_multipliers(packed, alike.state, 1.0 / slopes))
    if after.code != SOLVED:
        if outcome.code == INFEASIBLE and _is_least(packed, outcome.state):
            return outcome
        if alike.code != INFEASIBLE or not _is_least(twin, alike.state):
            return outcome._replace(code=STALLED)
        # The violation there, with the given scales.
        onward[ITERATIONS] = 0.0
        after = run(packed, onward, alike.state.copy())._replace(code=INFEASIBLE)
    after.state[at + COUNT] += spent
    return after._replace(history=np.concatenate([alike.history[:spent], after.history]))


def _is_least(packed: Packed, state: Array) -> bool:
    """Whether violations at a state are stationary, and not only so flat that no motion nearby changes them.

    How far nearby is, is known of joints and contacts. A violated expression may be in any units, and be flat along a
    coordinate that counts in others.
    """
    try:
        rows = rows_of(packed, state)
    except InputError:
        return False
    moving = moving_columns(np.flatnonzero(packed.unknown_blocks >= 0).tolist())
    off = np.where(rows.one_sided, np.minimum(rows.residual, 0.0), rows.residual)
    parts = off[:, None] * rows.jacobian[:, moving]
    left, whole = np.abs(parts.sum(axis=0)), np.abs(parts).sum(axis=0)
    strongest = np.linalg.norm(parts, axis=1).max(initial=0.0)
    return bool((left <= np.maximum(CANCELED * whole, LEVEL * strongest)).all())


def _with_multipliers(packed: Packed, state: Array, shares: Array) -> Array:
    """A copy of a state with so much of every expression's multipliers, and without those of others where that is 0."""
    state = state.copy()
    if not shares.any():
        state[packed.multipliers_at : packed.residuals_at] = 0.0
    for record, share in zip(_records(packed), shares, strict=True):
        first = packed.multipliers_at + record.first_row
        state[first : first + record.values] *= share
    return state


def _records(packed: Packed) -> Any:
    """The records of expressions that are rows."""
    table = packed.table
    return records_in(TAPE_FIELDS, table[table[TAPE_TABLE] :][: TAPE_RECORD * table[TAPES]].reshape(-1, TAPE_RECORD))


def _slopes(packed: Packed, state: Array) -> Array | None:
    """The steepest slope of each expression at a state; None where there are none."""
    try:
        rows = rows_of(packed, state)
    except InputError:
        return None
    steepest = np.zeros(packed.rows)
    np.maximum.at(steepest, rows.program_rows, np.linalg.norm(rows.jacobian, axis=1))
    first = _records(packed).first_row
    counts = _records(packed).values
    found = np.array([steepest[k : k + n].max() for k, n in zip(first, counts, strict=True)])
    return np.where(found > FLAT, found, 1.0)
