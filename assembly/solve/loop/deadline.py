"""The time budget of a tick: when it is spent, and how the next tick continues unfinished work.

If the budget is spent while rows do not hold, or before every pair of bodies that is near was updated, the tick leaves
its iterate to the next one (`CARRIED`), which continues from it; the tracker returns the last pose that held. Every
tick makes progress that lasts: a step of the loop, or the update of a pair of bodies.
"""

from __future__ import annotations

import math

from assembly._address import call_address
from assembly._kernel import kernel
from assembly.constraints.program.records import header_at
from assembly.proximity.manager.records import manager_at, memory_header_at
from assembly.solve.loop.parameters import HALF, UPDATES_ALONE
from assembly.solve.loop.settings import results_at, settings_at


@kernel(inline=True)
def is_spent(table, settings, begin, part):
    """Whether this part of a tick's budget is spent."""
    limits = settings_at(settings, 0)
    return limits.budget > 0.0 and call_address(header_at(table, 0).clock_address, ()) - begin > part * limits.budget


@kernel(inline=True)
def is_cut(table, memory):
    """Whether an update ended before all pairs that were due were updated: then this call ends."""
    return header_at(table, 0).manager_record >= 0 and memory_header_at(memory, 0).deadline < 0.0


@kernel(inner=True)
def begin_tick(table, settings, results, memory):
    """When this call began [ns]; how many steps the tick that it continues has made; how many updates came before.

    The number of updates is infinite if there is no budget, or if a tick has to make a step: then updates are not cut
    short. Updates of solves ask the caller whether to go on (`solve/loop/clearances.py`).
    """
    header = header_at(table, 0)
    state = memory_header_at(memory, 0)
    result = results_at(results, 0)
    limits = settings_at(settings, 0)
    manager = manager_at(table, header.manager_record)
    begin = call_address(header.clock_address, ()) if limits.budget > 0.0 else 0
    is_new = result.carried == 0.0
    done = 0 if is_new else int(result.carried) - 1
    result.carried = 0.0
    updates = math.inf
    if header.manager_record >= 0:
        state.deadline = math.inf
        # Updates of ticks are short, and with a budget end by it.
        asks = limits.tick == 0.0
        manager.go_on_address = int(limits.ask_address) if asks else 0
        if asks:
            manager.clock = header.clock_address
        if is_new:
            state.earlier = state.updates
        if limits.carries == 1.0 and state.updates - state.earlier < UPDATES_ALONE * manager.pairs:
            updates = state.updates
            state.deadline = begin + HALF * limits.budget
    return begin, done, updates


@kernel(inner=True)
def may_end(table, settings, memory, clock, iteration, part):
    """Whether a tick may leave the rest to the next one, and this part of its budget is spent or an update was cut.

    After a step it may end; before its first step, only if it has updated a pair, so that every tick makes progress.
    """
    begin, updates = clock
    if settings_at(settings, 0).carries == 0.0:
        return False
    if iteration == 0 and not (updates < math.inf and memory_header_at(memory, 0).updates > updates):
        return False
    return is_cut(table, memory) or is_spent(table, settings, begin, part)


@kernel(inline=True)
def set_deadline(table, settings, memory, begin):
    """After a step, let updates end when the part HALF of the budget is spent."""
    limits = settings_at(settings, 0)
    if limits.carries == 1.0 and header_at(table, 0).manager_record >= 0 and not is_cut(table, memory):
        memory_header_at(memory, 0).deadline = begin + HALF * limits.budget
