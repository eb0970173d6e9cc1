"""A solve with clearances that gets no further begins again from the last pose at which nothing crossed.

Which contacts are listed depends on the way a solve came: one that ends where bodies touch holds every step, and steps
that are cut again and again leave short ones behind. A solve that begins where this one stands has neither.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.constraints.layout import ROWS, WATCH
from assembly.proximity.watch import AS_NEEDED
from assembly.proximity.watch_memory import PAIR_RECORD, PAIR_SHELL_F, PAIR_TABLE, PAIRS
from assembly.solve.guards import forget_guards, look_around, place_guards
from assembly.solve.report import bring_back

# So often at most a solve begins again, and with so many steps left. It creeps where so many change its objective by
# less than this part of it, and of what all have changed.
BEGINNINGS, LEFT, STRIDE, LEAST_PART = 3, 20, 50, 0.02
# What is remembered: how often it began again, the step at which its objective is compared next, with what, and what it
# was at the first comparison.
BEGUN, NEXT, VALUE, FIRST, PACE = 0, 1, 2, 3, 4


@kernel(inner=True)
def set_pace(pace, begun, iteration):
    """A solve that begins at this step, for the n-th time again."""
    pace[BEGUN] = begun
    pace[NEXT] = iteration + (STRIDE if begun > 0.0 else 0)
    pace[VALUE] = math.inf
    if begun == 0.0:
        pace[FIRST] = math.inf


@kernel(inner=True)
def may_begin(pace, iteration, limit):
    """Whether a solve may begin again at this step."""
    return pace[BEGUN] < BEGINNINGS and iteration + LEFT <= limit


@kernel(inner=True)
def creeps(pace, iteration, value):
    """Whether an objective hardly changed since it was compared before; every so many steps it is."""
    if iteration < pace[NEXT]:
        return False
    if pace[FIRST] == math.inf:
        pace[FIRST] = value
    little = abs(value - pace[VALUE]) < LEAST_PART * min(abs(value), abs(value - pace[FIRST]))
    pace[NEXT] = iteration + STRIDE
    pace[VALUE] = value
    return little


@kernel(inner=True)
def has_solids(table):
    """Whether a clearance is of solids with edges: where these come to rest corners come and go all the time."""
    watch = table[WATCH]
    for p in range(table[watch + PAIRS]):
        if table[table[watch + PAIR_TABLE] + PAIR_RECORD * p + PAIR_SHELL_F] >= 0:
            return True
    return False


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
