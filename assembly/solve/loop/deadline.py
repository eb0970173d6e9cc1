"""The time of a tick: when it is spent, and how the next tick goes on with what is not done.

A tick whose budget is spent where its pose does not hold, or where not everything that is near is known yet, leaves
where it is (`CARRIED`): the tracker returns the last pose that held, and the next tick goes on from there. Each does
something for good: a step of the loop, or a look at a pair of bodies.
"""

from __future__ import annotations

import math

from assembly._address import call_address
from assembly._kernel import kernel
from assembly.constraints.program.records import CLOCK_AT, WATCH
from assembly.proximity.manager.state import CLOCK, DEADLINE, EARLIER, GO_ON_AT, LOOKS, PAIRS
from assembly.solve.loop.settings import ASK_AT, BUDGET, CARRIED, CARRIES, TICK

# No look begins, and no step from a pose that holds, where so much of a budget is spent: either may take as long as the
# rest of it.
HALF = 0.5
# A tick may end with a look until there were so many of every pair; then a step has to come first.
LOOKS_ALONE = 4


@kernel(inline=True)
def is_spent(table, settings, begin, part):
    """Whether so much of a tick's budget is spent."""
    return settings[BUDGET] > 0.0 and call_address(table[CLOCK_AT], ()) - begin > part * settings[BUDGET]


@kernel(inline=True)
def is_cut(table, memory):
    """Whether a look left out pairs that were due: then this call ends."""
    return table[WATCH] >= 0 and memory[DEADLINE] < 0.0


@kernel(inner=True)
def begin_tick(table, settings, results, memory):
    """When this call began; how many steps it goes on from; how many looks there were before it.

    These are infinitely many where there is no budget, or a tick has to make a step: then looks take their time. Those
    of solves ask whether they are to go on (`solve/loop/clearances.py`).
    """
    begin = call_address(table[CLOCK_AT], ()) if settings[BUDGET] > 0.0 else 0
    is_new = results[CARRIED] == 0.0
    done = 0 if is_new else int(results[CARRIED]) - 1
    results[CARRIED] = 0.0
    looks = math.inf
    if table[WATCH] >= 0:
        memory[DEADLINE] = math.inf
        # Looks of ticks are short, and with a budget end by it.
        asks = settings[TICK] == 0.0
        table[table[WATCH] + GO_ON_AT] = int(settings[ASK_AT]) if asks else 0
        if asks:
            table[table[WATCH] + CLOCK] = table[CLOCK_AT]
        if is_new:
            memory[EARLIER] = memory[LOOKS]
        if settings[CARRIES] == 1.0 and memory[LOOKS] - memory[EARLIER] < LOOKS_ALONE * table[table[WATCH] + PAIRS]:
            looks = memory[LOOKS]
            memory[DEADLINE] = begin + HALF * settings[BUDGET]
    return begin, done, looks


@kernel(inner=True)
def may_end(table, settings, memory, clock, iteration, part):
    """Whether a tick may leave the rest to the next one, and so much of its budget is spent.

    What it is to go on from after a step is as good as at its begin; without one, there has to be a look.
    """
    begin, looks = clock
    if settings[CARRIES] == 0.0:
        return False
    if iteration == 0 and not (looks < math.inf and memory[LOOKS] > looks):
        return False
    return is_cut(table, memory) or is_spent(table, settings, begin, part)


@kernel(inline=True)
def set_deadline(table, settings, memory, begin):
    """After a step looks may end early."""
    if settings[CARRIES] == 1.0 and table[WATCH] >= 0 and not is_cut(table, memory):
        memory[DEADLINE] = begin + HALF * settings[BUDGET]
