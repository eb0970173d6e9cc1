"""Whole steps that do not reduce the violation: rows contradict each other, or need a harder penalty."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.constraints.program.contact import TOUCHING
from assembly.solve.loop.parameters import (
    BEYOND_ROUNDING,
    DRAGGED,
    HARDEST,
    LITTLE,
    MOST_TILTED,
    NEIGHBORHOOD,
    NOT_NEARBY,
    ROUNDED,
    SLOW,
    STUCK,
    UNCHANGED,
)
from assembly.solve.loop.settings import settings_at
from assembly.solve.loop.way_back import way_at


@kernel(inline=True)
def out_of_reach(violation):
    """The largest |J^T c| at which no motion within a neighborhood removes the violation; rounding is not included.

    Two rows that repeat each other, tilted by an angle s, have |J^T c| = s |c|, and would agree after a step |c| / s.
    For violations above LITTLE the bound is zero: only J^T c = 0 counts.
    """
    return min(violation / NEIGHBORHOOD, MOST_TILTED) * violation if violation <= LITTLE else 0.0


@kernel(inline=True)
def count_standstill(way, settings, feasible, violation, left, dual, force, mu):
    """Count whole steps in a row at a stationary point that left the violation as it was. Whether no motion changes it.

    The multipliers y + c / mu of the next step leave the Lagrangian as stationary as y only where J^T c = 0. `force` is
    the largest multiplier, which grows with every step, `left` the part of the violation that the last whole step left.
    """
    progress = way_at(way, 0)
    nearly = (
        settings_at(settings, 0).stationarity * max(1.0, force) + (out_of_reach(violation) + ROUNDED * feasible) / mu
    )
    still = left > UNCHANGED and dual <= nearly
    progress.stills = progress.stills + 1.0 if still else 0.0
    return progress.stills == STUCK


@kernel(inline=True)
def count_drag(way, violation, before):
    """Count steps in a row, long or short, that left a small violation as it was. Whether there were enough.

    The violation of a linkage that can move may decrease along that motion for as long as it moves: each step goes as
    far as the rows' curvature lets it, and gains next to nothing. `before` is the violation a step ago.
    """
    progress = way_at(way, 0)
    by_little = TOUCHING < violation <= LITTLE
    progress.drags = progress.drags + 1.0 if by_little and violation > UNCHANGED * before else 0.0
    if progress.drags < DRAGGED:
        return False
    progress.drags = 0.0
    progress.nearby = 1.0
    return True


@kernel(inline=True)
def bound_nearby(way, violation, before):
    """The largest length of steps that restore rows after `count_drag` found a drag; infinite otherwise.

    The first step that gains ends the bound. `before` is the violation a step ago.
    """
    progress = way_at(way, 0)
    if progress.nearby == 0.0:
        return math.inf
    if violation <= UNCHANGED * before < math.inf:
        progress.nearby = 0.0
        progress.drags = 0.0
        return math.inf
    progress.drags += 1.0 if before < math.inf else 0.0
    return NEIGHBORHOOD


@kernel(inline=True)
def stays_off(way, feasible, steepest, violation, before):
    """Whether no motion nearby changes the violation of restored rows; `before` is the violation a step ago.

    Near a dead center |J^T c| decreases faster than |c|, in the end below its rounding, but every step still gains.
    """
    progress = way_at(way, 0)
    if progress.nearby == 1.0 and progress.drags >= NOT_NEARBY:
        return True
    gains = violation <= UNCHANGED * before
    return steepest <= out_of_reach(violation) + (0.0 if gains else ROUNDED * feasible)


@kernel(inline=True)
def is_stuck(way):
    """Whether the loop was found at a standstill, and has since taken only steps that restore rows."""
    return way_at(way, 0).stills == STUCK


@kernel(inline=True)
def contradicts(way, feasible, violation):
    """Whether the violation of restored rows shows a contradiction; a smaller one does where the loop stood still."""
    return violation > (BEYOND_ROUNDING * feasible if is_stuck(way) else TOUCHING)


@kernel(inline=True)
def update_floor(way, floor, is_slow):
    """Count slow steps in a row at the floor of the penalty. Returns the next floor, lower after SLOW of them.

    A slow step does not halve the violation. Rows whose gradients almost vanish, for example at a dead center, are held
    only by a harder penalty.
    """
    progress = way_at(way, 0)
    progress.slow_steps = progress.slow_steps + 1.0 if is_slow else 0.0
    return max(0.1 * floor, HARDEST) if progress.slow_steps >= SLOW else floor
