"""Solve rows of a batch one after the other, without the interpreter."""

from __future__ import annotations

from collections import namedtuple

from assembly._address import call_address
from assembly._kernel import kernel

# What each thread has for itself: its scene, and the memory of a solve (`solve/attempts/attempts.py`).
Desk = namedtuple("Desk", "table pool state history doubles integers")
# Where in the pool a row writes its numbers, (w,), and where in a state the turn of an angle begins at a number of the
# pool, (d, 2); the numbers of all rows, (n, w).
Writes = namedtuple("Writes", "places turns numbers")
# The first row, the one after the last, and the address of `solve_program`.
Span = namedtuple("Span", "first last loop")

_DESK = "Tuple((i8[::1], f8[::1], f8[::1], f8[:, ::1], f8[::1], i8[::1]))"
_WRITES = "Tuple((i8[::1], i8[:, ::1], f8[:, ::1]))"
_GIVEN = f"{_DESK}, f8[::1], {_WRITES}, f8[:, ::1], f8[:, ::1], UniTuple(i8, 3)"


@kernel(signatures=(f"({_GIVEN}, i8)", f"({_GIVEN}, none)"), allocates=True)
def solve_rows(desk, settings, writes, begun, ended, span, end_effectors):
    """Solve rows of a span: row k begins with the state in row k of `begun`, or in its only row.

    The state that it ends with, up to the results of the loop, becomes row k of `ended`. Nothing passes from one row to
    the next. Returns how many the loop itself solved.
    """
    table, pool, state, history, doubles, integers = desk
    places, turns, numbers = writes
    first, last, loop = span
    solved = 0
    for k in range(first, last):
        for j in range(places.size):
            pool[places[j]] = numbers[k, j]
        start = k if begun.shape[0] > 1 else 0
        known = begun.shape[1]
        for j in range(state.size):
            state[j] = begun[start, j] if j < known else 0.0
        for j in range(turns.shape[0]):
            state[turns[j, 0]] = pool[turns[j, 1]]
        code = call_address(loop, (table, pool, settings, state, history, doubles, integers, end_effectors))
        solved += int(code == 0)
        for j in range(ended.shape[1]):
            ended[k, j] = state[j]
    return solved
