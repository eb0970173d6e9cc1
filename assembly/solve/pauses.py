"""When the loop asks whether it is to go on (`interruption.py`): after 50 ms, or after the step that took longer."""

from __future__ import annotations

from assembly._address import call_address
from assembly._kernel import kernel
from assembly.constraints.layout import CLOCK_AT, SCALE
from assembly.solve.settings import ASK_AT, COUNT, OBJECTIVE, VIOLATION

# Nanoseconds between two questions.
SLICE = 50_000_000
# Steps of which a short solve has no more: it looks at the clock once, as it begins.
SHORT = 4


@kernel(inline=True)
def pause(table, pool, settings, results, asked, iteration, value, violation):
    """The time of the last question [ns], of the begin where there was none; and whether the solve is to end."""
    if settings[ASK_AT] == 0.0 or 0 < iteration < SHORT:
        return asked, False
    now = call_address(table[CLOCK_AT], ()) if table[CLOCK_AT] != 0 else asked + SLICE
    if iteration == 0 or now - asked < SLICE:
        return now if iteration == 0 else asked, False
    results[COUNT], results[OBJECTIVE], results[VIOLATION] = float(iteration), value, violation * pool[SCALE]
    ends = call_address(int(settings[ASK_AT]), ()) != 0
    return call_address(table[CLOCK_AT], ()) if table[CLOCK_AT] != 0 else now, ends
