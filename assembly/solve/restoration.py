"""The shortest way back onto the rows, where the time of a solve or a tick is over and they do not hold yet."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.constraints.layout import ROWS, WATCH
from assembly.constraints.program import evaluate
from assembly.proximity.extremal import BEND
from assembly.solve.guards import is_too_far
from assembly.solve.multipliers import toward_rows
from assembly.solve.rows import carry, move
from assembly.solve.tangency import off_rows


@kernel(inner=True)
def way_back(
    table,
    pool,
    memory,
    shape,
    loose,
    room,
    here,
    trial,
    rows,
    n,
    weights,
    mu,
    softness,
    share,
    enough,
    lagrangian,
    matrix,
    step,
    tick,
):
    """A share of the least step that leaves little of the gaps, into the trial point.

    `weights` is room for which rows count, and for forces. Returns the softness that the step took, and how far off the
    rows it leads: infinitely where bodies may not go so far, or a pair is lost.
    """
    active, forces = weights
    bases, one_sided, _order, _of_rows = shape
    softness = toward_rows(
        shape, table[ROWS], rows, here[3], here[4], mu, active, softness, enough, lagrangian, matrix, n, forces, step
    )
    move(table, here[0], step, share, trial[0])
    carry(table, pool, bases, loose, here, step, share)
    if table[WATCH] >= 0 and is_too_far(table, pool, memory, trial):
        return softness, math.inf
    if evaluate(table, pool, loose[4], BEND, loose, room, trial) >= 0:
        return softness, math.inf
    return softness, off_rows(table, loose, one_sided, trial, tick)
