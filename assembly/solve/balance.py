"""Expressions that do not hold, weighed by their slopes instead of by the scales they were given.

Where rows do not hold, the loop minimizes |c|^2 / 2, and ends where J^T c = 0. Which points these are depends on what
each row is divided by: nearly nothing of the sum is due to an expression of a scale of 1000, so that rows of joints
hold along a curve on which it is off least, and only there. Its scale says what counts as held, and not that it may be
given up. So before what is violated is called a contradiction, the loop goes on with every expression divided by its
steepest slope where it ended; from where all holds, or is off by less, with the scales as they were given.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.layout import TAPE_RECORD, TAPE_ROW_AT, TAPE_SCALE, TAPE_TABLE, TAPE_VALUES, TAPES
from assembly.constraints.packing import Packed
from assembly.errors import InputError
from assembly.solve.jacobian import rows_of
from assembly.solve.fit import Run
from assembly.solve.leave import Outcome
from assembly.solve.rank import HELD
from assembly.solve.settings import (
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

__all__ = ["balanced"]

Array = NDArray[np.float64]
# Slopes that are less are none.
FLAT = 1e-12


def balanced(packed: Packed, settings: Array, outcome: Outcome, run: Run) -> Outcome:
    """An outcome; where expressions do not hold, that of a solve that weighs them by their slopes, if it holds.

    `run` is the loop of a packed scene with settings from a state.
    """
    at = packed.results_at
    off = outcome.state[at + VIOLATION]
    if not packed.table[TAPES] or outcome.code not in (INFEASIBLE, STALLED) or off <= HELD * packed.scale:
        return outcome
    slopes = _slopes(packed, outcome.state)
    if slopes is None:
        return outcome
    twin = packed.twin()
    records = _records(packed)
    twin.pool[records[:, TAPE_SCALE]] *= slopes
    onward = settings.copy()
    onward[GATHER] = 0.0
    alike = run(twin, onward, _without_multipliers(packed, outcome.state))
    spent = int(alike.state[at + COUNT])
    onward[ITERATIONS] = settings[ITERATIONS] - spent
    if onward[ITERATIONS] < 0.0:
        return outcome
    # A soft penalty would draw it back to where it came from.
    onward[PENALTY] = settings[PENALTY_FLOOR]
    state = alike.state.copy()
    for record, slope in zip(records, slopes, strict=True):
        first = packed.multipliers_at + record[TAPE_ROW_AT]
        state[first : first + record[TAPE_VALUES]] /= slope
    after = run(packed, onward, state)
    if after.code != SOLVED:
        return outcome
    after.state[at + COUNT] += spent
    return after._replace(history=np.concatenate([alike.history[:spent], after.history]))


def _without_multipliers(packed: Packed, state: Array) -> Array:
    """A copy of a state whose multipliers, which grew against each other, are forgotten."""
    state = state.copy()
    state[packed.multipliers_at : packed.residuals_at] = 0.0
    return state


def _records(packed: Packed) -> NDArray[np.int64]:
    """The records of expressions that are rows."""
    table = packed.table
    return table[table[TAPE_TABLE] :][: TAPE_RECORD * table[TAPES]].reshape(-1, TAPE_RECORD)


def _slopes(packed: Packed, state: Array) -> Array | None:
    """The steepest slope of each expression at a state; None where there are none."""
    try:
        rows = rows_of(packed, state)
    except InputError:
        return None
    steepest = np.zeros(packed.rows)
    np.maximum.at(steepest, rows.program_rows, np.linalg.norm(rows.jacobian, axis=1))
    first = _records(packed)[:, TAPE_ROW_AT]
    counts = _records(packed)[:, TAPE_VALUES]
    found = np.array([steepest[k : k + n].max() for k, n in zip(first, counts, strict=True)])
    return np.where(found > FLAT, found, 1.0)
