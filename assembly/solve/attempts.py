"""The loop on a packed scene, and again another way where it did not end SOLVED."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.layout import DEEPEST_AT
from assembly.constraints.packing import Packed
from assembly.solve.augmented_lagrangian import solve_program
from assembly.solve.options import Options
from assembly.solve.settings import CONTACT_LOST, FREE_TRIMS, GATHER, HISTORY, ITERATIONS, SCATTER

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


def attempt(packed: Packed, settings: Array, start: Callable[[], Array]) -> tuple[int, Array, Array]:
    """Outcome, state and history of a solve from the states that `start` makes."""
    state = start()
    history = np.empty((min(int(settings[ITERATIONS]), MOST_HISTORY) + 1, HISTORY))
    # The loop writes contacts of clearances into its table: every solve has its own, also in another thread.
    arguments = (packed.table.copy() if packed.guards else packed.table, packed.pool)
    tips = packed.tips
    code = solve_program(*arguments, settings, state, history, tips)
    if code == CONTACT_LOST and packed.seek_penetration():
        # Perhaps solids cross at the start.
        arguments[0][DEEPEST_AT] = packed.table[DEEPEST_AT]
        state = start()
        code = solve_program(*arguments, settings, state, history, tips)
    if code != 0 and packed.trims:
        # With the coordinates of contacts as unknowns trims have exact second derivatives, except at poles.
        settings = settings.copy()
        settings[FREE_TRIMS] = 1.0
        other, rows = start(), np.empty_like(history)
        if solve_program(*arguments, settings, other, rows, tips) == 0:
            code, state, history = 0, other, rows
    if code != 0 and settings[GATHER] == 0.0 and state[packed.results_at + SCATTER] == 1.0:
        # What the start itself did not lead to may be reached from gathered bodies.
        settings = settings.copy()
        settings[GATHER] = 1.0
        other, rows = start(), np.empty_like(history)
        if solve_program(*arguments, settings, other, rows, tips) == 0:
            code, state, history = 0, other, rows
    return code, state, history
