"""Rows of clearances: places of a watch (`proximity/manager/update.py`) as one-sided contacts of a packed scene."""

from __future__ import annotations

import math

import numpy as np

from assembly._address import call_address
from assembly._kernel import kernel
from assembly.constraints.program.contact import is_of_solids
from assembly.constraints.program.records import (
    BODY_F,
    BODY_G,
    FIRST_GUARD,
    GUARD_NUMBER,
    GUARDS,
    LOOK_AT,
    MINIMUM,
    PARTS_AT,
    ROW,
    ROW_TABLE,
    SHELL_F,
    STAYED_AT,
    SURFACE_F,
    SURFACE_G,
    WATCH,
    WENT_AT,
)
from assembly.proximity.features.solid_contact import FOLD, SLACK, TRACK
from assembly.proximity.manager.motion_bounds import STILL
from assembly.proximity.manager.state import (
    ALLOWANCE,
    CLOCK,
    CUT_SHORT,
    DEADLINE,
    GO_ON_AT,
    IN_PLACE,
    LAST_REACH,
    LENGTHS,
    NEGLECT,
    PAIR_F,
    PAIR_G,
    PAIR_MEMORY,
    PAIR_MINIMUM,
    PAIR_RECORD,
    PAIR_SHELL_F,
    PAIR_SURFACE_F,
    PAIR_TABLE,
    PAIRS,
    PART,
    PLACE_GIVEN,
    PLACE_MEMORY,
    PLACE_NUMBER,
    REACH,
    SLICE,
    TURN,
    memory_places,
)
from assembly.proximity.manager.update import USED
from assembly.solve.loop.residuals import move

# Where solids are in each other by no more, in sizes of the scene, the next look lists what is to part them.
SLIGHTLY = 1e-5


@kernel(inner=True)
def clear_guards(table):
    """No row has a contact: so a packed scene is left, whose solutions have contacts of their own."""
    for k in range(table[FIRST_GUARD], table[FIRST_GUARD] + table[GUARDS]):
        row = table[ROW_TABLE] + ROW * k
        table[row + BODY_F] = -1
        table[row + BODY_G] = -1
        table[row + GUARD_NUMBER] = 0


@kernel(inner=True)
def forget_guards(table, memory):
    """Begin again: nothing has been looked at, and no contact has a place."""
    watch = table[WATCH]
    pairs, places, _events = memory_places(table, watch)
    for p in range(table[watch + PAIRS]):
        memory[pairs + PAIR_MEMORY * p + TURN] = math.nan
    for k in range(table[GUARDS]):
        memory[places + PLACE_MEMORY * k] = -1.0


@kernel(inner=True)
def place_guards(table, memory, here, y, better_y, free, begins):
    """Make every row the contact that its place has; multipliers of one that is new are zero.

    Where a solve begins, rows know no contacts yet, and multipliers are those of the places.
    """
    watch = table[WATCH]
    places = memory_places(table, watch)[1]
    for k in range(table[GUARDS]):
        r = table[FIRST_GUARD] + k
        row = table[ROW_TABLE] + ROW * r
        p = np.int64(memory[places + PLACE_MEMORY * k])
        number = np.int64(memory[places + PLACE_MEMORY * k + PLACE_NUMBER]) if p >= 0 else 0
        if number == table[row + GUARD_NUMBER]:
            continue
        table[row + GUARD_NUMBER] = number
        if not begins:
            y[r] = 0.0
            better_y[r] = 0.0
        free[r] = -1
        # Nothing is known of it yet.
        here[2][r, FOLD] = 1.0
        here[2][r, SLACK] = 0.0
        here[3][r] = 1.0
        if p < 0:
            table[row + BODY_F] = -1
            table[row + BODY_G] = -1
            continue
        pair = table[watch + PAIR_TABLE] + PAIR_RECORD * p
        table[row + BODY_F] = table[pair + PAIR_F]
        table[row + BODY_G] = table[pair + PAIR_G]
        in_place = memory[places + PLACE_MEMORY * k + PLACE_GIVEN] == 1.0
        table[row + MINIMUM] = table[pair + PAIR_MINIMUM] + (IN_PLACE if in_place else 0)
        for i in range(2):
            table[row + SURFACE_F + i] = table[pair + PAIR_SURFACE_F + i]
            table[row + SHELL_F + i] = table[pair + PAIR_SHELL_F + i]


@kernel(inner=True)
def look_around(table, pool, memory, point, how):
    """The watch's look at a point; whether rows changed.

    A long one asks between two slices whether it is to go on. Where what it is for is thrown away, it ends as one that
    is cut (`solve/loop/deadline.py`), and so do those that come after it; they say that rows changed: nothing is known
    to hold.
    """
    watch = table[WATCH]
    asks = table[watch + GO_ON_AT] != 0 and table[watch + CLOCK] != 0
    if asks and memory[DEADLINE] < 0.0:
        return True
    if asks:
        memory[DEADLINE] = call_address(table[watch + CLOCK], ()) + SLICE
    changed = call_address(table[LOOK_AT], (table, pool, watch, memory, point[0], point[1], how)) > 0
    aborted = asks and memory[DEADLINE] < 0.0
    if asks and not aborted:
        memory[DEADLINE] = math.inf
    return changed or aborted


@kernel(inner=True)
def look_again(table, pool, memory, point, how, free, scratch):
    """The watch's look at a point that is evaluated; whether rows changed.

    A look puts contacts on their extrema. Those whose coordinates are unknowns are on their way there: their rows have
    been evaluated where they are, and they stay. One that is as far from the extremum that it stands for as two
    contacts are from each other may be on its way to a saddle, and goes there.
    """
    tracked = point[1]
    first = table[FIRST_GUARD]
    for r in range(first, first + table[GUARDS]):
        if free[r] >= 0:
            for i in range(TRACK):
                scratch[r, i] = tracked[r, i]
    changed = look_around(table, pool, memory, point, how)
    places = memory_places(table, table[WATCH])[1]
    neglect = pool[table[table[WATCH] + LENGTHS] + NEGLECT]
    for r in range(first, first + table[GUARDS]):
        place = places + PLACE_MEMORY * (r - first)
        number = np.int64(memory[place + PLACE_NUMBER]) if memory[place] >= 0.0 else 0
        if free[r] >= 0 and number == table[table[ROW_TABLE] + ROW * r + GUARD_NUMBER]:
            row = table[ROW_TABLE] + ROW * r
            f, g = table[row + SURFACE_F], table[row + SURFACE_G]
            if call_address(table[STAYED_AT], (table, pool, f, g, tracked, scratch, r, neglect)) == 1:
                for i in range(TRACK):
                    tracked[r, i] = scratch[r, i]
            else:
                changed = True
    return changed


@kernel(inner=True)
def numbers_of(table, out):
    """The numbers of the contacts that rows have now."""
    for k in range(table[GUARDS]):
        out[k] = table[table[ROW_TABLE] + ROW * (table[FIRST_GUARD] + k) + GUARD_NUMBER]


@kernel(inner=True)
def go_back(table, memory, numbers):
    """Keep the contacts that rows had with these numbers; where others came or went, everything is looked at again."""
    watch = table[WATCH]
    pairs, places, _events = memory_places(table, watch)
    same = True
    for k in range(table[GUARDS]):
        number = table[table[ROW_TABLE] + ROW * (table[FIRST_GUARD] + k) + GUARD_NUMBER]
        if number != numbers[k]:
            same = False
            memory[places + PLACE_MEMORY * k] = -1.0
    if not same:
        for p in range(table[watch + PAIRS]):
            memory[pairs + PAIR_MEMORY * p + TURN] = math.nan


@kernel(inner=True)
def measure(table, pool, memory, first, end, q):
    """Measure what pairs from first to before `end` used of their allowances. The largest part that is known."""
    watch = table[WATCH]
    most = call_address(table[PARTS_AT], (table, pool, watch, memory, first, end, q))
    return memory[memory_places(table, watch)[0] + PAIR_MEMORY * most + PART]


@kernel(inner=True)
def allowed_share(table, pool, memory, here, trial, step, share):
    """How much of a step the watch allows, at most `share`, and whether it is all of that.

    The poses at the end of the share go into the trial point. Of what it would use of allowances there it is then known
    of which pairs more is known by another look.
    """
    move(table, here[0], step, share, trial[0])
    watch = table[WATCH]
    if measure(table, pool, memory, 0, table[watch + PAIRS], trial[0]) <= 1.0:
        return share, True
    at = memory_places(table, watch)[0]
    allowed = 1.0
    for p in range(table[watch + PAIRS]):
        # Of every pair by itself: one that is nearly spent, but hardly moves, is not in the way.
        o = at + PAIR_MEMORY * p
        end = memory[o + PART]
        memory[o + CUT_SHORT] = end * memory[o + ALLOWANCE]
        begin = end
        if end > USED:
            measure(table, pool, memory, p, p + 1, here[0])
            begin = memory[o + PART]
            memory[o + PART] = end
        if end > max(begin, 1.0):
            allowed = min(allowed, max(0.95 - begin, 0.05) / (end - begin))
        flank = pool[table[table[watch + PAIR_TABLE] + PAIR_RECORD * p + PAIR_MINIMUM] + 1]
        most = min(flank, pool[table[watch + LENGTHS] + LAST_REACH])
        if begin <= STILL and memory[o + REACH] >= min(memory[o + CUT_SHORT], most):
            # It was looked at right here, as far as another look would.
            memory[o + PART] = begin
    return share * allowed, False


@kernel(inner=True)
def is_too_far(table, pool, memory, point):
    """Whether the poses of a point are farther than the watch allows."""
    return measure(table, pool, memory, 0, table[table[WATCH] + PAIRS], point[0]) > 1.0


@kernel(inner=True)
def ends_unseen(table, pool, memory, before, after):
    """Whether a clearance's contact of solids ends along a step that goes farther than it is open.

    What takes its place, where features meet, is not listed yet, and was no nearer: over such a step it could pass
    through, and be found at the far side, or nowhere.
    """
    watch = table[WATCH]
    places = memory_places(table, watch)[1]
    for k in range(table[GUARDS]):
        r = table[FIRST_GUARD] + k
        p = np.int64(memory[places + PLACE_MEMORY * k])
        if p >= 0 and math.isnan(after[1][r, 0]) and not math.isnan(before[1][r, 0]) and is_of_solids(table, r):
            most = max(before[3][r], SLIGHTLY)
            if call_address(table[WENT_AT], (table, pool, watch, p, before[0], after[0], most)) == 1:
                return True
    return False
