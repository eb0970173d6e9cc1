"""A solve with clearances that gets no further begins again from the last pose at which nothing crossed.

Which contacts are listed depends on the way a solve came: one that ends where bodies touch holds every step, and steps
that are cut again and again leave short ones behind. A solve that begins where this one stands has neither.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.constraints.layout import ROWS
from assembly.proximity.watch import AS_NEEDED
from assembly.solve.guards import forget_guards, look_around, place_guards
from assembly.solve.report import bring_back

# So often at most a solve begins again. It creeps where so many steps change its objective by less than this part.
BEGINNINGS, STRIDE, LEAST_PART = 3, 50, 0.02
# What is remembered: how often it began again, the step at which its objective is compared next, and with what.
BEGUN, NEXT, VALUE, PACE = 0, 1, 2, 3


@kernel(inner=True)
def set_pace(pace, begun, iteration):
    """A solve that begins at this step for the n-th time again."""
    pace[BEGUN] = begun
    pace[NEXT] = iteration + STRIDE
    pace[VALUE] = math.inf


@kernel(inner=True)
def creeps(pace, iteration, value):
    """Whether an objective hardly changed since it was compared before; every so many steps it is."""
    if iteration < pace[NEXT]:
        return False
    little = abs(value - pace[VALUE]) < LEAST_PART * abs(value)
    pace[NEXT] = iteration + STRIDE
    pace[VALUE] = value
    return little


@kernel(inner=True)
def begin_again(table, pool, held, loose, here, y, better_y):
    """Back to the pose that is held. Its contacts are found anew; no row has pushed yet."""
    memory, free = loose[5], loose[0]
    bring_back(held, table[ROWS], here, y)
    forget_guards(table, memory)
    look_around(table, pool, memory, here, AS_NEEDED)
    place_guards(table, memory, here, y, better_y, free, False)
    for r in range(table[ROWS]):
        y[r] = 0.0
        better_y[r] = 0.0
