"""When the loop asks whether it is to go on (`interruption.py`): after 50 ms, or after the step that took longer."""

from __future__ import annotations

from assembly._address import call_address
from assembly._kernel import kernel
from assembly.constraints.program.records import BLOCK_RECORD, CLOCK_AT, SCALE, WATCH
from assembly.proximity.manager.state import GOES_ON, PAIRS, SLICE
from assembly.solve.loop.settings import ASK_AT, COUNT, OBJECTIVE, VIOLATION

# Steps of which a short solve has no more: it never looks at the clock, but in a large scene, where a step takes long.
# A scene with more pairs of bodies to look at is large.
SHORT, MANY_PAIRS = 4, 256


@kernel(inline=True)
def is_large(table):
    """Whether a step may take long: of many bodies, or of a look at many pairs of them."""
    return table[BLOCK_RECORD] != 0 or (table[WATCH] >= 0 and table[table[WATCH] + PAIRS] > MANY_PAIRS)


@kernel(inline=True)
def pause(table, pool, settings, results, asked, iteration, value, violation):
    """The time of the last question, or of the first look at the clock [ns]; and whether the solve is to end."""
    if settings[ASK_AT] == 0.0 or (iteration < SHORT and not is_large(table)):
        return asked, False
    now = call_address(table[CLOCK_AT], ()) if table[CLOCK_AT] != 0 else asked + SLICE
    if asked == 0 or now - asked < SLICE:
        return now if asked == 0 else asked, False
    results[COUNT], results[OBJECTIVE], results[VIOLATION] = float(iteration), value, violation * pool[SCALE]
    ends = call_address(int(settings[ASK_AT]), ()) != GOES_ON
    return call_address(table[CLOCK_AT], ()) if table[CLOCK_AT] != 0 else now, ends
