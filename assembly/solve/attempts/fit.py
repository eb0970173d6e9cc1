"""Redundant rows that disagree slightly, as those of CAD files do, held as well as possible.

Where |c|^2 is stationary, J^T c = 0, rows are off by a combination of them that no motion changes. If their values are
changed by it they agree, and the loop continues with these values; the change is the disagreement.

With J = U S V^T, no motion nearby changes a combination u where |c| / s is longer than a neighborhood: rows tilted
against each other by e have s of about e and disagree by about e, while next to a dead center c is of the order of s^2.
Contacts, limits and expressions have no value that could be changed: their part is balanced by the others. See
docs/derivations.md.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.scene import Packed
from assembly.constraints.program.contact import TOUCHING
from assembly.constraints.program.primitives import AZIMUTH, TURN
from assembly.constraints.program.records import IMPLICIT
from assembly.errors import InputError
from assembly.solve.dense.jacobian import Rows, moving_columns, rows_of
from assembly.solve.dense.rank import centered
from assembly.solve.loop.parameters import NEIGHBORHOOD
from assembly.solve.loop.settings import (
    COUNT,
    FEASIBILITY,
    FIT,
    GATHER,
    INFEASIBLE,
    ITERATIONS,
    OBJECTIVE,
    PENALTY,
    PENALTY_FLOOR,
    SCATTER,
    SOLVED,
    STALLED,
    VIOLATION,
)
from assembly.solve.second_order.leave import Fit, Outcome

__all__ = ["Loop", "fitted"]

Array = NDArray[np.float64]
Run = Callable[[Packed, Array, Array], Outcome]


class Loop(NamedTuple):
    """The loop with settings from a state: one that a solve begins with, and one it has led to.

    From the first one postures without a reference are measured.
    """

    begin: Run
    go_on: Run


# So often values are moved, until what rows disagree by, which depends on the pose, changes by no more than this part.
ROUNDS, SAME = 5, 1e-6
# A slope of the violation that is rounding; where the step to mend it is longer than this.
LEVEL, NEGLIGIBLE = 1e-14, 1e-4
# What combinations of rows may miss of what they are to balance, in parts.
BALANCED = 1e-3


def fitted(packed: Packed, settings: Array, outcome: Outcome, loop: Loop) -> Outcome:
    """An outcome; if rows are off by no more than they may disagree, that of a solve in which their values agree."""
    off = outcome.state[packed.results_at + VIOLATION]
    if outcome.code not in (INFEASIBLE, STALLED) or not 0.0 < off <= settings[FIT] * packed.scale:
        return outcome
    apart = _disagreement(packed, outcome.state)
    if apart is None or not settings[FEASIBILITY] < np.abs(apart).max() <= settings[FIT]:
        return outcome
    return _fitted_from(packed.twin(), settings, outcome, loop) or outcome


def _fitted_from(twin: Packed, settings: Array, outcome: Outcome, loop: Loop) -> Outcome | None:
    """The outcome of solves with values that agree, from where another one ended; the pool of `twin` is written to."""
    onward = settings.copy()
    onward[GATHER], onward[PENALTY] = 0.0, settings[PENALTY_FLOOR]
    at = twin.results_at
    # Of bodies that were assembled the least move was that from there; it is not looked for anew from the start.
    gathered = twin.table[IMPLICIT] == 1 and settings[GATHER] == 1.0 and outcome.state[at + SCATTER] == 1.0
    run, pool = loop.begin if gathered else loop.go_on, twin.pool.copy()
    moved: Array | None = None
    for _ in range(ROUNDS):
        apart = _disagreement(twin, outcome.state)
        if apart is None:
            return None
        worst = float(np.abs(apart).max(initial=0.0))
        if not worst <= settings[FIT]:
            return None
        if worst <= settings[FEASIBILITY]:
            # They agree.
            apart = np.zeros_like(apart)
        if moved is not None and np.abs(apart - moved).max() <= max(settings[FEASIBILITY], SAME * worst):
            if gathered:
                twin.pool[:] = pool
                onward[ITERATIONS] = 0.0
                outcome.state[at + OBJECTIVE] = loop.go_on(twin, onward, outcome.state.copy()).state[at + OBJECTIVE]
            return _told(twin, outcome, moved, float(settings[FIT]))
        spent = int(outcome.state[at + COUNT])
        onward[ITERATIONS] = settings[ITERATIONS] - spent
        if onward[ITERATIONS] < 0.0:
            return None
        moved = apart
        twin.move_values(moved)
        after = run(twin, onward, outcome.state.copy())
        twin.move_values(-moved)
        if after.code != SOLVED:
            return None
        after.state[at + COUNT] += spent
        outcome = after._replace(history=np.concatenate([outcome.history[:spent], after.history]))
    return None


def _told(packed: Packed, outcome: Outcome, moved: Array, allowed: float) -> Outcome:
    """The outcome of a solve whose values were moved, with what rows are off by their own values."""
    if not moved.any():
        return outcome
    state = outcome.state
    state[packed.residuals_at : packed.results_at] += moved * np.where(packed.lengths, packed.scale, 1.0)
    state[packed.results_at + VIOLATION] = np.abs(moved).max() * packed.scale
    return outcome._replace(fit=Fit(allowed, moved))


def _disagreement(packed: Packed, state: Array) -> Array | None:
    """What the values of rows have to be moved by to agree near a state, (m,); None: they cannot, or a pair is lost."""
    try:
        rows = rows_of(packed, state)
    except InputError:
        return None
    if _nears_pole(packed, rows):
        return None
    columns = moving_columns(np.flatnonzero(packed.unknown_blocks >= 0).tolist())
    jacobian = centered(rows.jacobian[:, columns])[0]
    movable = np.isin(rows.program_rows, packed.value_rows) & ~rows.one_sided
    counted = ~rows.one_sided | (rows.residual < TOUCHING)
    apart = np.zeros(packed.rows)
    while True:
        which = np.flatnonzero(counted)
        combined = _unmoved(jacobian[which], rows.residual[which], movable[which])
        if combined is None:
            return None
        # A one-sided row that would have to pull takes no part.
        pulls = rows.one_sided[which] & (combined > 0.0)
        if not pulls.any():
            break
        counted[which[pulls]] = False
    off = which[movable[which]]
    apart[rows.program_rows[off]] = combined[movable[which]]
    return apart


def _nears_pole(packed: Packed, rows: Rows) -> bool:
    """Whether an angle is so near to its pole that its slope changes completely within a neighborhood.

    The slope grows as the inverse of the distance to the pole, where the angle has no value. Any value can be reached
    beside it, so violated rows there are not redundant.
    """
    slopes = np.zeros(packed.rows)
    slopes[rows.program_rows] = np.linalg.norm(rows.jacobian, axis=1)
    for row, (equation, _, _) in zip(packed.value_rows, packed._values, strict=True):
        factors = [abs(factor) for factor, coordinate in equation.terms if coordinate.kind in (TURN, AZIMUTH)]
        if factors and not 0.0 < slopes[row] <= max(factors) / NEIGHBORHOOD:
            return True
    return False


def _unmoved(jacobian: Array, residual: Array, movable: NDArray[np.bool_]) -> Array | None:
    """The combination w of rows, J^T w = 0, with w = c on what of the movable rows no motion nearby changes, (m,)."""
    left, sizes, _ = np.linalg.svd(jacobian, full_matrices=True)
    worst = float(np.abs(residual).max(initial=0.0))
    sizes = np.pad(sizes, (0, len(left) - len(sizes)))
    parts = np.abs(left.T @ residual)
    # Next to a dead center that is out of reach the violation is stationary to rounding, and cannot be reduced.
    level = (sizes * parts <= LEVEL) & (parts > sizes * NEGLIGIBLE)
    kept = left[:, (sizes <= worst / NEIGHBORHOOD) | level]
    wanted = kept.T @ residual
    square = kept[movable].T @ kept[movable]
    shares = np.linalg.lstsq(square, wanted, rcond=1e-9)[0]
    if np.abs(square @ shares - wanted).max(initial=0.0) > BALANCED * np.abs(wanted).max(initial=0.0):
        return None
    combined: Array = kept @ shares
    return combined
