"""The loop on a packed scene, and again another way where it did not end SOLVED."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.layout import DEEPEST_AT
from assembly.constraints.packing import Packed
from assembly.solve.assembled import run_gathered
from assembly.solve.augmented_lagrangian import solve_program
from assembly.solve.interruption import Interruption
from assembly.solve.leave import Outcome, settle
from assembly.solve.options import Options
from assembly.solve.postures import following_none
from assembly.solve.settings import (
    CONTACT_LOST,
    FREE_TRIMS,
    GATHER,
    HISTORY,
    ITERATIONS,
    SCATTER,
    SOLVED,
    UNSURE,
)

__all__ = ["attempt", "begin", "load"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
# Rows of history that are kept.
MOST_HISTORY = 1000
_LOADING = Options(max_iterations=0).settings()
_loaded: set[int | None] = set()


def load(packed: Packed, start: Callable[[], Array]) -> None:
    """Have the loop for such a scene in this process: loading it, or compiling it, is no part of a solve's time."""
    if packed.tips not in _loaded:
        solve_program(packed.table.copy(), packed.pool, _LOADING, start(), np.empty((1, HISTORY)), packed.tips)
        _loaded.add(packed.tips)


def attempt(
    packed: Packed,
    settings: Array,
    start: Callable[[], Array],
    interruption: Interruption,
    turns: Array | None = None,
) -> Outcome:
    """The outcome of a solve from the states that `start` makes; no other attempt is made once it is interrupted.

    `turns` are the values that angles are near, where they start on a turn of their own; zeros by default.
    """
    # The loop writes contacts of clearances into its table: every solve has its own, also in another thread.
    table = packed.table.copy() if packed.guards else packed.table
    outcome = begin(packed, interruption, table, settings, start(), turns)
    if outcome.code == SOLVED:
        return outcome

    def again(settings: Array) -> Outcome:
        return begin(packed, interruption, table, settings, start(), turns)

    if outcome.code == CONTACT_LOST and packed.seek_penetration():
        # Perhaps solids cross at the start.
        table[DEEPEST_AT] = packed.table[DEEPEST_AT]
        outcome = again(settings)
    if packed.trims and not _holds(outcome) and not interruption.is_over():
        # With the coordinates of contacts as unknowns trims have exact second derivatives, except at poles.
        settings = settings.copy()
        settings[FREE_TRIMS] = 1.0
        other = again(settings)
        outcome = other if _holds(other) else outcome
    is_scattered = settings[GATHER] == 0.0 and outcome.state[packed.results_at + SCATTER] == 1.0
    if is_scattered and not _holds(outcome) and not interruption.is_over():
        # What the start itself did not lead to may be reached from gathered bodies.
        settings = settings.copy()
        settings[GATHER] = 1.0
        other = again(settings)
        outcome = other if _holds(other) else outcome
    if interruption.is_over():
        return outcome
    # Postures are measured from where they were.
    follows = following_none(packed)
    return settle(packed, settings, outcome, lambda onward, state: _run(packed, interruption, follows, onward, state))


def begin(
    packed: Packed, interruption: Interruption, table: Table, settings: Array, state: Array, turns: Array | None
) -> Outcome:
    """The outcome of the loop from a state, with turns chosen anew where bodies are gathered; see `attempt`."""
    if packed.chooses_turns and settings[GATHER] > 0.0:
        return run_gathered(packed, table, settings, state, turns, partial(_run, packed, interruption))
    return _run(packed, interruption, table, settings, state)


def _holds(outcome: Outcome) -> bool:
    """Whether rows hold and the objective is stationary, whatever it is of second order."""
    return outcome.code in (SOLVED, UNSURE)


def _run(packed: Packed, interruption: Interruption, table: Table, settings: Array, state: Array) -> Outcome:
    history = np.empty((min(int(settings[ITERATIONS]), MOST_HISTORY) + 1, HISTORY))
    interruption.watched = (state, packed.results_at)
    return Outcome(solve_program(table, packed.pool, settings, state, history, packed.tips), state, history)
