"""Revolution counts chosen where scattered bodies were put together, and the loop from there.

Poses do not tell how often a body has turned, so revolution counts are chosen for the poses at which a loop begins
(`Turns`). Those of scattered bodies are meaningless: a body that initial assembly turns by half a turn might have a
count that contradicts its limits, or other angles around a loop, and no step changes that.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.scene import Packed
from assembly.solve.attempts.postures import following_none, postures_from
from assembly.solve.loop.settings import ASSEMBLES, GATHER, ITERATIONS, OBJECTIVE, SCATTER, SOLVED
from assembly.solve.second_order.leave import Outcome

__all__ = ["run_gathered"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
Run = Callable[[Table, Array, Array], Outcome]


def run_gathered(packed: Packed, table: Table, settings: Array, state: Array, turns: Array | None, run: Run) -> Outcome:
    """The outcome of the loop from a state; scattered bodies are assembled, with revolution counts chosen then.

    `turns` are the values that angles are near, zeros by default; `run` is the loop on a table, with settings, from a
    state.
    """
    given = state.copy()
    outcome = run(table, settings, state)
    if outcome.state[packed.results_at + SCATTER] == 0.0:
        return outcome
    solved = outcome.code == SOLVED
    if solved and _has_turns_of_its_pose(packed, outcome.state, turns):
        return outcome
    other = _assembled(packed, table, settings, given, turns, run)
    return outcome if solved and other.code != SOLVED else other


def _has_turns_of_its_pose(packed: Packed, state: Array, turns: Array | None) -> bool:
    """Whether the revolution counts in a state are those of a start from its poses."""
    fresh = state.copy()
    _choose_turns(packed, fresh, turns)
    angles = packed.angles
    return bool((np.abs(fresh[angles] - state[angles]) < np.pi).all())


def _choose_turns(packed: Packed, state: Array, turns: Array | None) -> None:
    state[packed.angles] = 0.0 if turns is None else turns
    packed.start_angles(state, warm=False)


def _assembled(packed: Packed, table: Table, settings: Array, given: Array, turns: Array | None, run: Run) -> Outcome:
    """The outcome of the loop from assembled bodies, with their revolution counts there."""
    onward = settings.copy()
    onward[GATHER] = ASSEMBLES
    state = run(table, onward, given.copy()).state
    _choose_turns(packed, state, turns)
    onward[GATHER] = 0.0
    if not packed.is_implicit:
        return run(following_none(packed.table), onward, state)
    # The least move is sought from the present poses, and reported from the original ones.
    outcome = run(table, onward, state)
    onward[ITERATIONS] = 0.0
    with postures_from(packed, given[: packed.contacts_at].reshape(-1, 7)):
        measured = run(packed.table, onward, outcome.state.copy()).state
    outcome.state[packed.results_at + OBJECTIVE] = measured[packed.results_at + OBJECTIVE]
    return outcome
