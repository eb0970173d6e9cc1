"""A curve given by a formula, as kernels read it: points, and bounds over an interval of its parameter.

    [C, C', C'']            by doubles, or by intervals that enclose them, at t (three numbers each; z = 0 in the plane)
    [C, C', C'', C''']      by intervals that enclose them over [t0, t1]

C is taken about a center, zero but for what measures distances.

A natural interval extension is too wide by about the width of its argument. What the derivative tells over h = (t1 -
t0) / 2 about the middle m, C in C(m) + [-h, h] C'([t0, t1]), is too wide by its square; the two are met.

Room for a run: 4 doubles of arguments, 24 of results, then the work of the tape.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of
from assembly.geometry.expression.arithmetic import LANES, lane_constants, run_lanes
from assembly.geometry.expression.tape import run_tape
from assembly.geometry.expression.tape_bounds import JUMP, KINK, SMOOTH, run_bounds
from assembly.geometry.interval import down, idifference, magnitude, meet, up, widened

# Record: dimension; where the tapes of points, of ranges and of the arc length begin (0: none); whether the range of C
# itself is among the ranges; whether C itself has no operation that jumps, so that jumps are those of derivatives and
# C' bounds C across them; doubles of room; whether the tape of the arc length is for plain doubles
# (`geometry/expression/rounding.py`). In
# the pool: the ends of the domain, how far C may be off, and the center that it is taken about.
FORMULA = record_dtype(
    "i8",
    dimension=1,
    point_tape=1,
    range_tape=1,
    arc_tape=1,
    has_range=1,
    continuous=1,
    room=1,
    arc_plain=1,
)
formula_at = record_view(FORMULA)
DIMENSION = place_of(FORMULA, "dimension")
POINT_TAPE = place_of(FORMULA, "point_tape")
RANGE_TAPE = place_of(FORMULA, "range_tape")
ARC_TAPE = place_of(FORMULA, "arc_tape")
HAS_RANGE = place_of(FORMULA, "has_range")
CONTINUOUS = place_of(FORMULA, "continuous")
ROOM = place_of(FORMULA, "room")
ARC_PLAIN = place_of(FORMULA, "arc_plain")
FORMULA_RECORD = size_of(FORMULA)
FORMULA_HEAD = record_dtype(
    "f8",
    domain=2,
    error=1,
    center=3,
)
formula_head_at = record_view(FORMULA_HEAD)
CENTER = place_of(FORMULA_HEAD, "center")
FORMULA_POOL = size_of(FORMULA_HEAD)
RESULTS, WORK_AT = 4, 28
_VALUES, _ORDERS = 9, 12


@kernel(inner=True)
def formula_point(table, pool, t, room):
    """C, C', C'' at t to room[RESULTS:], nine doubles."""
    room[0] = t
    run_tape(table, pool, formula_at(table, 0).point_tape, room, room[WORK_AT:], room[RESULTS:])
    for k in range(3):
        room[RESULTS + k] -= formula_head_at(pool, 0).center[k]


@kernel(inline=True)
def forget(table, room, first, last):
    """The whole line for orders of the results, as far as there are coordinates."""
    for order in range(first, last):
        for k in range(formula_at(table, 0).dimension):
            o = RESULTS + 6 * order + 2 * k
            room[o] = -math.inf
            room[o + 1] = math.inf


@kernel(inline=True)
def settle(table, pool, room, told, orders):
    """What a run tells forgets of its derivatives, below `orders`; C with its error, about the center."""
    head = formula_head_at(pool, 0)
    formula = formula_at(table, 0)
    if told >= KINK:
        forget(table, room, 2, orders)
    if told >= JUMP and formula.continuous == 0:
        forget(table, room, 1, 2)
    error = head.error
    for k in range(formula.dimension):
        o = RESULTS + 2 * k
        if error > 0.0:
            room[o] = down(room[o] - error)
            room[o + 1] = up(room[o + 1] + error)
        c = head.center[k]
        if c != 0.0:
            room[o], room[o + 1] = idifference((room[o], room[o + 1]), (c, c))


@kernel(inner=True, exact=True)
def point_bounds(table, pool, t, room):
    """Intervals of C, C', C'' at t to room[RESULTS:], nine pairs."""
    room[0] = t
    room[1] = t
    told = run_bounds(table, pool, formula_at(table, 0).point_tape, room, room[WORK_AT:], room[RESULTS:])
    settle(table, pool, room, told, 3)


@kernel(inner=True, exact=True)
def range_bounds(table, pool, lo, hi, room):
    """Intervals of C, C', C'', C''' over [lo, hi] to room[RESULTS:], twelve pairs."""
    formula = formula_at(table, 0)
    room[0] = lo
    room[1] = hi
    told = run_bounds(table, pool, formula.range_tape, room, room[WORK_AT:], room[RESULTS:])
    if formula.has_range == 0:
        forget(table, room, 0, 1)
    settle(table, pool, room, told, 4)
    return told


@kernel(inline=True)
def about_the_middle(middle, half, slope):
    """Range of a function from its value in the middle and its slope; `half` is half the width, rounded up."""
    reach = half * magnitude(slope)
    lo, hi = widened(middle[0] - reach, middle[1] + reach, 2.220446049250313e-16)
    # A second rounding, of the product.
    return down(lo), up(hi)


@kernel(inner=True, exact=True)
def refine(values, o, half, m):
    """Meet the ranges at values[o:] (twelve pairs) with what values at the middle, m (nine pairs from there), tell."""
    for order in range(2, -1, -1):
        for k in range(3):
            at = o + 6 * order + 2 * k
            middle = (values[m + 6 * order + 2 * k], values[m + 6 * order + 2 * k + 1])
            slope = (values[at + 6], values[at + 7])
            if slope[0] > -math.inf and slope[1] < math.inf:
                lo, hi = meet((values[at], values[at + 1]), about_the_middle(middle, half, slope))
                values[at] = lo
                values[at + 1] = hi


@kernel(inner=True, exact=True)
def arc_bound(table, pool, lo, hi, room):
    """Upper bound of the length of arc over [lo, hi] by the user's expression; infinite where it has no length."""
    formula = formula_at(table, 0)
    if formula.arc_tape == 0:
        return math.inf
    if formula.arc_plain != 0:
        room[0] = lo
        room[1] = hi
        run_tape(table, pool, formula.arc_tape, room, room[WORK_AT:], room[RESULTS:])
        return room[RESULTS] if room[RESULTS] >= 0.0 else math.inf
    room[0] = lo
    room[1] = lo
    room[2] = hi
    room[3] = hi
    run_bounds(table, pool, formula.arc_tape, room, room[WORK_AT:], room[RESULTS:])
    return room[RESULTS + 1] if room[RESULTS + 1] >= 0.0 else math.inf


@kernel(signatures="(i8[::1], f8[::1], f8[::1], f8[:, ::1], f8[::1])")
def formula_points(table, pool, t, out, room):
    """C, C', C'' at every t to out (n, 9). Returns the first place where C is not finite, or -1."""
    bad = -1
    for i in range(t.size):
        formula_point(table, pool, t[i], room)
        for k in range(_VALUES):
            out[i, k] = room[RESULTS + k]
        if bad < 0 and not math.isfinite(out[i, 0] + out[i, 1] + out[i, 2]):
            bad = i
    return bad


@kernel(signatures="(i8[::1], f8[::1], f8[::1], f8[::1], f8[:, ::1], f8[::1])")
def formula_ranges(table, pool, lo, hi, out, room):
    """Bounds over the intervals [lo[i], hi[i]] to out (n, 43).

    Twelve pairs over the interval, nine pairs at its middle, and the user's bound of the length of arc. Returns what
    the runs tell, the worst of it.
    """
    told = SMOOTH
    for i in range(lo.size):
        row = out[i]
        told = max(told, range_bounds(table, pool, lo[i], hi[i], room))
        for k in range(2 * _ORDERS):
            row[k] = room[RESULTS + k]
        middle = 0.5 * (lo[i] + hi[i])
        point_bounds(table, pool, middle, room)
        for k in range(2 * _VALUES):
            row[2 * _ORDERS + k] = room[RESULTS + k]
        refine(row, 0, up(max(middle - lo[i], hi[i] - middle)), 2 * _ORDERS)
        row[2 * (_ORDERS + _VALUES)] = arc_bound(table, pool, lo[i], hi[i], room)
    return told


@kernel(signatures="(i8[::1], f8[::1], f8[::1], f8[::1], f8[::1], f8[::1])")
def arc_bounds(table, pool, lo, hi, out, room):
    """`arc_bound` of every interval [lo[i], hi[i]]; many at a time where plain doubles do."""
    formula = formula_at(table, 0)
    if formula.arc_tape != 0 and formula.arc_plain != 0:
        work = lane_constants(table, pool, formula.arc_tape)
        for i in range(0, lo.size, LANES):
            run_lanes(table, formula.arc_tape, lo, hi, i, work, out)
        return
    for i in range(lo.size):
        out[i] = arc_bound(table, pool, lo[i], hi[i], room)
