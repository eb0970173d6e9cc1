"""The loop on a packed scene, and again another way where it did not end SOLVED."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.layout import DEEPEST_AT
from assembly.constraints.packing import Packed
from assembly.solve.augmented_lagrangian import solve_program
from assembly.solve.fit import Loop, fitted, fitted_again
from assembly.solve.leave import Fit, Outcome, settle
from assembly.solve.options import Options
from assembly.solve.postures import following_none
from assembly.solve.settings import (
    CONTACT_LOST,
    FIT,
    FREE_TRIMS,
    GATHER,
    HISTORY,
    ITERATIONS,
    SCATTER,
    SOLVED,
    UNSURE,
)

__all__ = ["attempt", "load"]

Array = NDArray[np.float64]
# Rows of history that are kept.
MOST_HISTORY = 1000
_LOADING = Options(max_iterations=0).settings()
_loaded: set[int | None] = set()


def load(packed: Packed, start: Callable[[], Array]) -> None:
    """Have the loop for such a scene in this process: loading it, or compiling it, is no part of a solve's time."""
    if packed.tips not in _loaded:
        solve_program(packed.table.copy(), packed.pool, _LOADING, start(), np.empty((1, HISTORY)), packed.tips)
        _loaded.add(packed.tips)


def attempt(packed: Packed, settings: Array, start: Callable[[], Array], apart: Array | None = None) -> Outcome:
    """The outcome of a solve from the states that `start` makes, where rows disagree by so much, if that is known."""
    if apart is not None:
        again = fitted_again(packed, settings, start(), apart, LOOP)
        if again is not None:
            return again
    # The loop writes contacts of clearances into its table: every solve has its own, also in another thread.
    table = packed.table.copy() if packed.guards else packed.table
    outcome = _run(packed, table, settings, start())
    if outcome.code == SOLVED:
        return outcome
    if outcome.code == CONTACT_LOST and packed.seek_penetration():
        # Perhaps solids cross at the start.
        table[DEEPEST_AT] = packed.table[DEEPEST_AT]
        outcome = _run(packed, table, settings, start())
    outcome = fitted(packed, settings, outcome, LOOP)
    if not _holds(outcome) and packed.trims:
        # With the coordinates of contacts as unknowns trims have exact second derivatives, except at poles.
        settings = settings.copy()
        settings[FREE_TRIMS] = 1.0
        other = fitted(packed, settings, _run(packed, table, settings, start()), LOOP)
        outcome = other if _holds(other) else outcome
    if not _holds(outcome) and settings[GATHER] == 0.0 and outcome.state[packed.results_at + SCATTER] == 1.0:
        # What the start itself did not lead to may be reached from gathered bodies.
        settings = settings.copy()
        settings[GATHER] = 1.0
        other = fitted(packed, settings, _run(packed, table, settings, start()), LOOP)
        outcome = other if _holds(other) else outcome
    outcome = settle(packed, settings, outcome, partial(_go_on_once, packed))
    return outcome._replace(fit=outcome.fit or Fit(float(settings[FIT])))


def _holds(outcome: Outcome) -> bool:
    """Whether rows hold and the objective is stationary, whatever it is of second order."""
    return outcome.code in (SOLVED, UNSURE)


def _run(packed: Packed, table: NDArray[np.int64], settings: Array, state: Array) -> Outcome:
    history = np.empty((min(int(settings[ITERATIONS]), MOST_HISTORY) + 1, HISTORY))
    return Outcome(solve_program(table, packed.pool, settings, state, history, packed.tips), state, history)


def _begin(packed: Packed, settings: Array, state: Array) -> Outcome:
    """The loop from the start of a solve, its end settled."""
    outcome = _run(packed, packed.table.copy(), settings, state)
    return settle(packed, settings, outcome, partial(_go_on_once, packed))


def _go_on(packed: Packed, settings: Array, state: Array) -> Outcome:
    """The loop from a state that a solve has led to, its end settled."""
    return settle(packed, settings, _go_on_once(packed, settings, state), partial(_go_on_once, packed))


def _go_on_once(packed: Packed, settings: Array, state: Array) -> Outcome:
    """The loop from a state that a solve has led to, with postures measured from where they were."""
    return _run(packed, following_none(packed), settings, state)


LOOP = Loop(_begin, _go_on)
