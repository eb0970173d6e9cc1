"""Whether a solve has arrived: rows hold where bodies are now, and the Lagrangian is stationary."""

from __future__ import annotations

from assembly._kernel import kernel
from assembly.constraints.program.records import header_at, pool_header_at
from assembly.solve.linear_algebra.factorize import greatest_on_diagonal
from assembly.solve.loop.inertia import DOWNWARD
from assembly.solve.loop.multipliers import strongest
from assembly.solve.loop.parameters import MOST_ROUNDING, NEAR_SADDLE, OFF_SADDLE, ROUNDING, STEPS_OF_ROUNDING
from assembly.solve.loop.residuals import largest_turn
from assembly.solve.loop.settings import TESTED, results_at, settings_at


@kernel(inner=True)
def reach_of(store, q):
    """The largest coordinate of a body's origin in the user's frame, over the size of the scene."""
    units = pool_header_at(store.pool, 0)
    reach = 0.0
    for b in range(header_at(store.table, 0).bodies):
        for k in range(3):
            reach = max(reach, abs(q[b, k] + units.reference[k] / units.scale))
    return reach


@kernel(inner=True)
def rounding_at(store, settings, current):
    """The largest violation that counts as none: the tolerance, or what rounding of coordinates and angles causes."""
    reach = max(reach_of(store, current.q), largest_turn(store, current.tracked))
    return max(settings_at(settings, 0).feasibility, min(ROUNDING * reach, MOST_ROUNDING))


@kernel(inner=True)
def is_rounding(program, current, rows, system, moved, dual):
    """Whether a step moved poses by no more than doubles tell apart, and rounding explains the slope that is left.

    The slope explained is the rounding of poses times the largest diagonal entry of the Hessian, plus that of
    multipliers.
    """
    store, shape = program.store, program.structure
    reach, n = max(1.0, reach_of(store, current.q)), system.gradient.size
    most = ROUNDING * (reach * greatest_on_diagonal(system.hessian, n, shape.sparsity) + strongest(rows.y, rows.count))
    return moved <= STEPS_OF_ROUNDING * ROUNDING * reach and dual <= most


@kernel(inner=True)
def is_near_saddle(table, settings, results, violation, dual):
    """Whether a solve is near a saddle that is to be left: steps toward one gain little, and are of no use."""
    limits = settings_at(settings, 0)
    if limits.second_order != TESTED or limits.tick == 1.0 or header_at(table, 0).implicit == 1:
        return False
    return results_at(results, 0).curved == DOWNWARD and violation <= OFF_SADDLE and dual <= NEAR_SADDLE


@kernel(inner=True)
def has_arrived(table, settings, results, violation, feasible, dual):
    """Whether rows hold and the Lagrangian is stationary, or all but so at a saddle that is to be left."""
    limits = settings_at(settings, 0)
    if is_near_saddle(table, settings, results, violation, dual):
        return True
    return violation <= feasible and dual <= limits.stationarity
