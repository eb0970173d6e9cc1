"""When the loop asks whether it is to go on (`interruption.py`): after 50 ms, or after the step that took longer."""

from __future__ import annotations

from assembly._address import call_address
from assembly._kernel import kernel
from assembly.constraints.program.records import header_at, pool_header_at
from assembly.proximity.manager.parameters import SLICE
from assembly.proximity.manager.records import GOES_ON, manager_at
from assembly.solve.loop.parameters import MANY_PAIRS, SHORT
from assembly.solve.loop.settings import results_at, settings_at


@kernel(inline=True)
def is_large(table):
    """Whether a step may take long: of many bodies, or with an update of many pairs of them."""
    header = header_at(table, 0)
    return header.block_record != 0 or (
        header.manager_record >= 0 and manager_at(table, header.manager_record).pairs > MANY_PAIRS
    )


@kernel(inline=True)
def pause(store, settings, results, asked, iteration, value, violation):
    """The time of the last question, or when the clock was first read [ns]; and whether the solve is to end."""
    header = header_at(store.table, 0)
    result = results_at(results, 0)
    limits = settings_at(settings, 0)
    if limits.ask_address == 0.0 or (iteration < SHORT and not is_large(store.table)):
        return asked, False
    now = call_address(header.clock_address, ()) if header.clock_address != 0 else asked + SLICE
    if asked == 0 or now - asked < SLICE:
        return now if asked == 0 else asked, False
    result.count, result.objective, result.violation = (
        float(iteration),
        value,
        violation * pool_header_at(store.pool, 0).scale,
    )
    ends = call_address(int(limits.ask_address), ()) != GOES_ON
    return call_address(header.clock_address, ()) if header.clock_address != 0 else now, ends
