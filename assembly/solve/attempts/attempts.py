"""The loop on a packed scene, and other attempts if it did not end SOLVED."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.scene import Packed
from assembly.constraints.program.records import DEEPEST_AT, MANAGER_RECORD
from assembly.solve.attempts.assembled import run_gathered
from assembly.solve.attempts.balance import balanced
from assembly.solve.attempts.corners import corners_first
from assembly.solve.attempts.fit import Loop, fitted
from assembly.solve.attempts.postures import following_none, rows_measured_from
from assembly.solve.interruption import Interruption
from assembly.solve.loop.augmented_lagrangian import solve_program
from assembly.solve.loop.settings import (
    ALLOWED_OVERLAP,
    ANY_POSE,
    CONTACT_LOST,
    COUNT,
    FEASIBILITY,
    FIT,
    GATHER,
    ITERATIONS,
    LAST_FEASIBLE,
    LIFT_TRIMS,
    NEVER,
    OBJECTIVE,
    PENALTY,
    PENALTY_FLOOR,
    PLACES,
    SCATTER,
    SOLVED,
    UNSURE,
    VIOLATION,
)
from assembly.solve.options import Options
from assembly.solve.second_order.leave import Fit, Outcome, leave_saddles
from assembly.solve.workspace import Workspace, new_workspace

__all__ = [
    "as_it_stands",
    "attempt",
    "begin",
    "go_on_once",
    "load",
    "rows_alone",
    "run",
    "with_listed",
]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
# A violation larger than any scene's.
ANYTHING = 1e6
_LOADING = Options(max_iterations=0).settings()
_loaded: set[int | None] = set()


def load(packed: Packed, start: Callable[[], Array]) -> None:
    """Load or compile the loop for such a scene, so that this does not count as time of a solve."""
    if packed.end_effectors not in _loaded:
        table, workspace = packed.without_manager(), new_workspace(packed)
        solve_program(table, packed.rows_pool, _LOADING, start(), *workspace, packed.end_effectors)
        _loaded.add(packed.end_effectors)


def attempt(
    packed: Packed,
    settings: Array,
    start: Callable[[], Array],
    interruption: Interruption,
    turns: Array | None = None,
) -> Outcome:
    """The outcome of a solve from the states that `start` makes; no other attempt is made once it is interrupted.

    `turns` are values near which angles start, which determine their revolution counts; zeros by default.
    """
    # A contact has corners of its own only after a solve has met a kink.
    if packed.corners and settings[PENALTY] > settings[PENALTY_FLOOR]:
        found = _with_corners_first(packed, settings, start, interruption, turns)
        return _attempt(packed, settings, start, interruption, turns) if found is None else found
    outcome = _attempt(packed, settings, start, interruption, turns)
    if outcome.code == SOLVED or not packed.clearance_rows:
        return outcome
    is_crowded = settings[PLACES] == 1.0 and packed.is_crowded(outcome.state)
    if is_crowded or interruption.is_over():
        return outcome
    return _with_corners_first(packed, settings, start, interruption, turns) or outcome


def _with_corners_first(
    packed: Packed, settings: Array, start: Callable[[], Array], interruption: Interruption, turns: Array | None
) -> Outcome | None:
    """The same, with corners of contacts before the contacts; None where that does not hold."""
    run, go_on = partial(_run, packed, interruption), _loop(interruption, turns).go_on
    return corners_first(packed, settings, start, run, go_on)


def _attempt(
    packed: Packed, settings: Array, start: Callable[[], Array], interruption: Interruption, turns: Array | None
) -> Outcome:
    """The same, with contacts at once."""
    # The loop writes contacts of clearances into its table: every solve has its own, also in another thread.
    table = packed.table.copy() if packed.clearance_rows else packed.table
    outcome = begin(packed, interruption, table, settings, start(), turns)
    if outcome.code == SOLVED or (settings[PLACES] == 1.0 and packed.is_crowded(outcome.state)):
        return outcome
    loop = _loop(interruption, turns)

    def again(settings: Array) -> Outcome:
        return fitted(packed, settings, begin(packed, interruption, table, settings, start(), turns), loop)

    if outcome.code == CONTACT_LOST and packed.seek_penetration():
        # Solids may cross at the start.
        table[DEEPEST_AT] = packed.table[DEEPEST_AT]
        outcome = begin(packed, interruption, table, settings, start(), turns)
    outcome = fitted(packed, settings, outcome, loop)
    if not interruption.is_over():
        outcome = balanced(packed, settings, outcome, loop.go_on)
    if packed.trims and not _holds(outcome) and not interruption.is_over():
        # With the coordinates of contacts as unknowns trims have exact second derivatives, except at poles.
        settings = settings.copy()
        settings[LIFT_TRIMS] = 1.0
        other = again(settings)
        outcome = other if _holds(other) else outcome
    is_scattered = settings[GATHER] == 0.0 and outcome.state[packed.results_at + SCATTER] == 1.0
    if is_scattered and not _holds(outcome) and not interruption.is_over():
        # From assembled bodies the solve may succeed where it failed from the start itself.
        settings = settings.copy()
        settings[GATHER] = 1.0
        other = again(settings)
        outcome = other if _holds(other) else outcome
    if not interruption.is_over():
        outcome = leave_saddles(packed, settings, outcome, partial(go_on_once, interruption, packed))
    return outcome._replace(fit=outcome.fit or Fit(float(settings[FIT])))


def begin(
    packed: Packed, interruption: Interruption, table: Table, settings: Array, state: Array, turns: Array | None
) -> Outcome:
    """The outcome of the loop from a state, with turns chosen anew where bodies are assembled; see `attempt`."""
    if packed.chooses_turns and settings[GATHER] > 0.0:
        return run_gathered(packed, table, settings, state, turns, partial(_run, packed, interruption))
    return _run(packed, interruption, table, settings, state)


def _loop(interruption: Interruption, turns: Array | None) -> Loop:
    """The loop from the start of a solve and from a state that a solve has led to; saddles are left."""

    def first(packed: Packed, settings: Array, state: Array) -> Outcome:
        outcome = begin(packed, interruption, packed.table.copy(), settings, state, turns)
        return leave_saddles(packed, settings, outcome, partial(go_on_once, interruption, packed))

    def go_on(packed: Packed, settings: Array, state: Array) -> Outcome:
        outcome = go_on_once(interruption, packed, settings, state)
        return leave_saddles(packed, settings, outcome, partial(go_on_once, interruption, packed))

    return Loop(first, go_on)


def _holds(outcome: Outcome) -> bool:
    """Whether rows hold and the objective is stationary, whatever its second order."""
    return outcome.code in (SOLVED, UNSURE)


def as_it_stands(packed: Packed, interruption: Interruption, settings: Array, state: Array) -> Outcome:
    """The outcome of the loop without steps and without searching contacts of clearances."""
    settings = settings.copy()
    settings[ITERATIONS], settings[GATHER], settings[PLACES], settings[ANY_POSE] = 0.0, NEVER, 0.0, 0.0
    return _run(packed, interruption, packed.without_manager(), settings, state)


def rows_alone(
    packed: Packed, interruption: Interruption, settings: Array, state: Array, reference: Array | None = None
) -> Outcome:
    """The outcome of the loop without searching contacts of clearances, and without initial assembly.

    Postures are measured from the state's poses, or from a reference (n, 7).
    """
    settings = settings.copy()
    settings[GATHER], settings[PLACES] = NEVER, 0.0
    table = packed.without_manager() if reference is None else rows_measured_from(packed, reference)
    return _run(packed, interruption, table, settings, state)


def with_listed(packed: Packed, interruption: Interruption, settings: Array, state: Array) -> Outcome:
    """The same with the contacts of clearances listed, whatever their rows.

    If the settings say so, it ends when these find no slot.
    """
    settings = settings.copy()
    settings[ITERATIONS], settings[GATHER], settings[FEASIBILITY] = 0.0, NEVER, ANYTHING
    return _run(packed, interruption, packed.table.copy(), settings, state)


def _run(packed: Packed, interruption: Interruption, table: Table, settings: Array, state: Array) -> Outcome:
    return Outcome(*run(packed, interruption, table, settings, state))


def run(
    packed: Packed, interruption: Interruption, table: Table, settings: Array, state: Array
) -> tuple[int, Array, Array]:
    """The loop once: the code it ended with, the state, which is written to, and the history."""
    if interruption.callback is not None:
        state[packed.results_at + OBJECTIVE], state[packed.results_at + VIOLATION] = np.nan, np.inf
        interruption.watched = (state, packed.results_at)
    # Threads have workspaces of their own.
    spare = packed.workspaces
    workspace = spare.pop() if spare else Workspace(packed)
    try:
        has_manager = packed.clearance_rows > 0 and table[MANAGER_RECORD] >= 0
        pool = packed.pool if has_manager else packed.rows_pool
        history, doubles, integers = workspace.arrays
        code = solve_program(table, pool, settings, state, history, doubles, integers, packed.end_effectors)
        # A solution keeps the rows that were written: untouched memory is slow to allocate.
        history = history[: int(state[packed.results_at + COUNT]) + 1].copy()
        if code != SOLVED and has_manager and state[packed.results_at + LAST_FEASIBLE] == 1.0:
            # The last pose that held is returned, and the loop tells the objective of its last iterate.
            state[packed.results_at + OBJECTIVE] = _objective_at(packed, table, settings, state, workspace)
    finally:
        spare.append(workspace)
    return code, state, history


def _objective_at(packed: Packed, table: Table, settings: Array, state: Array, workspace: Workspace) -> float:
    """The objective at the poses of a state, with postures measured from where the solve did that."""
    settings = settings.copy()
    settings[ITERATIONS], settings[GATHER], settings[PLACES], settings[ANY_POSE] = 0.0, NEVER, 0.0, 0.0
    table = following_none(table)
    table[MANAGER_RECORD] = -1
    history, doubles, integers = workspace.arrays
    solve_program(table, packed.rows_pool, settings, state.copy(), history, doubles, integers, packed.end_effectors)
    return float(history[0, 0])


def go_on_once(interruption: Interruption, packed: Packed, settings: Array, state: Array) -> Outcome:
    """The loop from a state that a solve has led to, with postures measured from where they were.

    Bodies may keep only the overlap that they had at the beginning of the solve, which is in the state.
    """
    settings = settings.copy()
    settings[ALLOWED_OVERLAP] = 0.0
    return _run(packed, interruption, following_none(packed.table), settings, state)
