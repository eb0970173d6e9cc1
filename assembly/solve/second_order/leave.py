"""Leaving saddles and maxima: to a pose that is seen to be lower, and on from there with the loop."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.scene import Packed
from assembly.solve.loop.settings import (
    COUNT,
    DUAL,
    FEASIBILITY,
    GATHER,
    ITERATION_LIMIT,
    ITERATIONS,
    OBJECTIVE,
    PENALTY,
    PENALTY_FLOOR,
    REACHED,
    SECOND_ORDER,
    SOLVED,
    STALLED,
    STATIONARITY,
    UNSURE,
    VIOLATION,
)
from assembly.solve.second_order.classification import SecondOrder, Way, judge, judge_kink
from assembly.solve.second_order.dense import LocalModel, Neighbor

__all__ = ["Fit", "Outcome", "leave_saddles"]

Array = NDArray[np.float64]
# The first step along a way in a scene with clearances; by what steps grow while poses become lower; the longest.
SHY, GROWTH, LONGEST = 1e-3, 3.0, 1.0
# A step that leads to no lower pose is shortened by this, down to here; lower is what gives this part of what the
# curvature promises.
SHORTENED, SHORTEST, PROMISE = 0.25, 1e-4, 0.01
# What of the way down to a pose is not given back by the loop that goes on from there.
KEPT = 0.5
# Rows that hold at a kink; and at an end, to what is asked for or what rounding of far coordinates may leave.
HOLDS, MARGIN, FAR_OUT = 1e-11, 1.25, 1e-11
# Ways that are tried from one saddle.
MOST_WAYS = 6


class Fit(NamedTuple):
    """What rows that repeat each other may disagree by, over the size, and what they do, (m,), if at all
    (`solve/attempts/fit.py`).
    """

    allowed: float
    apart: Array | None = None


class Outcome(NamedTuple):
    """How the loop ended, the state and the history it left; of what was judged, what the end is."""

    code: int
    state: Array
    history: Array
    order: SecondOrder | None = None
    fit: Fit | None = None


Run = Callable[[Array, Array], Outcome]


def lower_neighbor(model: LocalModel, way: Way) -> Neighbor | None:
    """A pose that holds and is lower, as far along a way as they become lower; None where there is none."""
    shy = model.packed.clearance_rows > 0
    share = min(SHY, way.share) if shy else way.share
    best: Neighbor | None = None
    while SHORTEST <= share <= LONGEST:
        there = model.neighbor(way.direction, share)
        rise = there.rise if there is not None else np.inf
        promised = 0.5 * PROMISE * way.curvature * share**2 if best is None else best.rise
        if not rise < min(promised, 0.0):
            if best is not None:
                break
            share *= SHORTENED
            continue
        best = there
        if shy:
            break
        share *= GROWTH
    return best


def leave_saddles(packed: Packed, settings: Array, outcome: Outcome, run: Run) -> Outcome:
    """An outcome whose end is no saddle that can be left, from one of which no factorization told.

    `run` is the loop with settings from a state. A saddle left counts as a step; where steps are spent, or no lower
    pose is found, the saddle is returned, and is not SOLVED.
    """
    first = settings[PENALTY] > settings[PENALTY_FLOOR]
    onward = settings.copy()
    onward[GATHER] = 0.0
    at = packed.results_at
    while outcome.code == UNSURE or _is_at_kink(packed, outcome):
        spent = int(outcome.state[at + COUNT])
        stands = outcome.code == UNSURE
        sample = first and spent == 0
        verdict, model = judge(packed, outcome.state, sample) if stands else judge_kink(packed, outcome.state)
        left: Outcome | None = None
        if model is not None and verdict.ways:
            onward[ITERATIONS] = settings[ITERATIONS] - spent - 1
            if onward[ITERATIONS] >= 0.0:
                left = _left(model, verdict.ways, onward, run)
            elif verdict.kind is SecondOrder.SADDLE:
                return outcome._replace(code=ITERATION_LIMIT, order=verdict.kind)
        if left is None and stands and onward[SECOND_ORDER] != REACHED and not _is_at_end(packed, settings, outcome):
            # It was taken for a saddle on the way to it: multipliers that leave the form positive need no shift.
            onward[ITERATIONS], onward[SECOND_ORDER] = settings[ITERATIONS] - spent - 1, REACHED
            if onward[ITERATIONS] < 0.0:
                return outcome._replace(code=ITERATION_LIMIT, order=verdict.kind)
            left = run(onward, _with_forces(packed, outcome.state, verdict.forces))
        if left is None and not stands:
            return outcome
        if left is None:
            # A saddle for certain is no solution; what rows that depend on each other say of motions may be none.
            code = STALLED if verdict.kind is SecondOrder.SADDLE else SOLVED
            return outcome._replace(code=code, order=verdict.kind)
        left.state[at + COUNT] += spent + 1
        outcome = left._replace(history=np.concatenate([outcome.history[: spent + 1], left.history]))
    return outcome


def _with_forces(packed: Packed, state: Array, forces: Array | None) -> Array:
    """A copy of a state, with multipliers of its rows where they are given."""
    state = state.copy()
    if forces is not None:
        state[packed.multipliers_at : packed.residuals_at] = forces[: packed.rows]
    return state


def _is_at_end(packed: Packed, settings: Array, outcome: Outcome) -> bool:
    """Whether rows hold and the Lagrangian is stationary, and not only nearly so."""
    results = outcome.state[packed.results_at :]
    holds = results[VIOLATION] <= max(MARGIN * settings[FEASIBILITY], FAR_OUT) * packed.scale
    return bool(holds and results[DUAL] <= settings[STATIONARITY])


def _is_at_kink(packed: Packed, outcome: Outcome) -> bool:
    """Whether a solve ended where it began, at a pose that holds, because the objective has no derivatives there."""
    if outcome.code != STALLED:
        return False
    results = outcome.state[packed.results_at :]
    begins = results[COUNT] == 0.0 and results[VIOLATION] <= HOLDS * packed.scale
    return bool(begins and np.isfinite(results[OBJECTIVE]) and not np.isfinite(results[DUAL]))


def _left(model: LocalModel, ways: list[Way], settings: Array, run: Run) -> Outcome | None:
    """Where the loop ends from lower poses along one of several ways; None where none is found.

    A soft penalty takes fewer steps, and a hard one does not fall back to where it was.
    """
    left: Outcome | None = None
    settings = settings.copy()
    penalties = sorted({settings[PENALTY], settings[PENALTY_FLOOR]}, reverse=True)
    for way in ways[:MOST_WAYS]:
        lower = lower_neighbor(model, way)
        for settings[PENALTY] in penalties if lower is not None else ():
            assert lower is not None
            outcome = run(settings, lower.state.copy())
            if outcome.code not in (SOLVED, UNSURE):
                left = left or outcome
                break
            if outcome.state[model.packed.results_at + OBJECTIVE] < model.value + KEPT * lower.rise:
                return outcome
    return left
