"""A curve given by a formula, as kernels read it: points, and bounds over an interval of its parameter.

    [C, C', C'']            by doubles, or by intervals that enclose them, at t (three numbers each; z = 0 in the plane)
    [C, C', C'', C''']      by intervals that enclose them over [t0, t1]

C is relative to a center, which is zero except where distances are measured.

A natural interval extension is too wide by about the width of its argument. The mean value form about the middle m
with h = (t1 - t0) / 2, C in C(m) + [-h, h] C'([t0, t1]), is too wide by about the square of that width. The two are
intersected.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import Store, place_of, record_dtype, record_view, size_of
from assembly.geometry.expression.arithmetic import LANES, lane_constants, run_lanes
from assembly.geometry.expression.tape import run_tape
from assembly.geometry.expression.tape_bounds import JUMP, KINK, SMOOTH, run_bounds
from assembly.geometry.interval import down, idifference, magnitude, meet, up, widened

# A curve given by a formula, in the table.
FORMULA = record_dtype(
    "i8",
    dimension=1,  # 2 or 3
    point_tape=1,  # where the tape of points begins
    range_tape=1,  # where the tape of ranges begins
    arc_tape=1,  # where the tape of the arc length begins; 0: none
    has_range=1,  # 1: the range of C itself is among the ranges
    continuous=1,  # 1: no operation of C jumps, so that jumps are those of derivatives and C' bounds C across them
    workspace=1,  # doubles that a run works in
    arc_plain=1,  # 1: the tape of the arc length is for plain doubles (`geometry/expression/rounding.py`)
)
formula_at = record_view(FORMULA)
WORKSPACE = place_of(FORMULA, "workspace")
FORMULA_RECORD = size_of(FORMULA)
# The same in the pool.
FORMULA_HEAD = record_dtype(
    "f8",
    domain=2,  # ends of the parameter
    error=1,  # how far C may be off [length]
    center=3,  # subtracted from C [length]
)
formula_head_at = record_view(FORMULA_HEAD)
CENTER = place_of(FORMULA_HEAD, "center")
FORMULA_POOL = size_of(FORMULA_HEAD)
# Workspace of a run; the work array of the tape follows it.
FORMULA_WORKSPACE = record_dtype(
    "f8",
    arguments=4,  # t, or ends of intervals
    results=24,  # numbers, or pairs of intervals, of C, then of its derivatives
)
formula_workspace_at = record_view(FORMULA_WORKSPACE)
RESULTS = place_of(FORMULA_WORKSPACE, "results")
WORK_AT = size_of(FORMULA_WORKSPACE)
# How many numbers C, C', C'' at a point are, and C, C', C'', C''' over an interval; the row written for an interval.
_VALUES, _ORDERS = 9, 12
FORMULA_RANGE = record_dtype(
    "f8",
    over=2 * _ORDERS,  # pairs of C, C', C'', C''' over the interval
    middle=2 * _VALUES,  # pairs of C, C', C'' at its middle
    arc=1,  # the user's bound of the length of arc
)
formula_range_at = record_view(FORMULA_RANGE)


@kernel(inline=True, exact=True)
def run(store, tape, workspace):
    """Run a tape on the numbers in a workspace."""
    run_tape(store, tape, workspace, workspace[WORK_AT:], workspace[RESULTS:])


@kernel(inline=True, exact=True)
def bound(store, tape, workspace):
    """Run a tape on the intervals in a workspace; returns SMOOTH, KINK or JUMP."""
    return run_bounds(store, tape, workspace, workspace[WORK_AT:], workspace[RESULTS:])


@kernel(inner=True)
def formula_point(store, t, workspace):
    """C, C', C'' at t to the results of the workspace, nine doubles."""
    workspace[0] = t
    run(store, formula_at(store.table, 0).point_tape, workspace)
    results = formula_workspace_at(workspace, 0).results
    for k in range(3):
        results[k] -= formula_head_at(store.pool, 0).center[k]


@kernel(inline=True)
def forget(table, workspace, first, last):
    """Set the results of orders first to last - 1 to the whole line, in every coordinate of the curve."""
    results = formula_workspace_at(workspace, 0).results
    for order in range(first, last):
        for k in range(formula_at(table, 0).dimension):
            o = 6 * order + 2 * k
            results[o] = -math.inf
            results[o + 1] = math.inf


@kernel(inline=True)
def finish_bounds(store, workspace, told, orders):
    """Widen the bounds of a run: C by its error, derivatives below `orders` that may not exist to the whole line.

    C is then taken relative to the center.
    """
    head = formula_head_at(store.pool, 0)
    formula = formula_at(store.table, 0)
    if told >= KINK:
        forget(store.table, workspace, 2, orders)
    if told >= JUMP and formula.continuous == 0:
        forget(store.table, workspace, 1, 2)
    error = head.error
    results = formula_workspace_at(workspace, 0).results
    for k in range(formula.dimension):
        o = 2 * k
        if error > 0.0:
            results[o] = down(results[o] - error)
            results[o + 1] = up(results[o + 1] + error)
        c = head.center[k]
        if c != 0.0:
            results[o], results[o + 1] = idifference((results[o], results[o + 1]), (c, c))


@kernel(inner=True, exact=True)
def point_bounds(store, t, workspace):
    """Intervals of C, C', C'' at t to the results of the workspace, nine pairs."""
    workspace[0] = t
    workspace[1] = t
    told = bound(store, formula_at(store.table, 0).point_tape, workspace)
    finish_bounds(store, workspace, told, 3)


@kernel(inner=True, exact=True)
def range_bounds(store, lo, hi, workspace):
    """Intervals of C, C', C'', C''' over [lo, hi] to the results of the workspace, twelve pairs."""
    formula = formula_at(store.table, 0)
    workspace[0] = lo
    workspace[1] = hi
    told = bound(store, formula.range_tape, workspace)
    if formula.has_range == 0:
        forget(store.table, workspace, 0, 1)
    finish_bounds(store, workspace, told, 4)
    return told


@kernel(inline=True)
def about_the_middle(middle, half, slope):
    """The mean value form: bounds of a function from its value at the middle and its slope; `half` is rounded up."""
    reach = half * magnitude(slope)
    lo, hi = widened(middle[0] - reach, middle[1] + reach, 2.220446049250313e-16)
    # A second rounding, of the product.
    return down(lo), up(hi)


@kernel(inner=True, exact=True)
def refine(values, o, half, m):
    """Intersect the ranges at values[o:] (twelve pairs) with mean value forms; values[m:] has the middle's (nine)."""
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
def arc_bound(store, lo, hi, workspace):
    """Upper bound of the arc length over [lo, hi] by the user's expression; infinite where that gives none."""
    formula = formula_at(store.table, 0)
    results = formula_workspace_at(workspace, 0).results
    if formula.arc_tape == 0:
        return math.inf
    if formula.arc_plain != 0:
        workspace[0] = lo
        workspace[1] = hi
        run(store, formula.arc_tape, workspace)
        return results[0] if results[0] >= 0.0 else math.inf
    workspace[0] = lo
    workspace[1] = lo
    workspace[2] = hi
    workspace[3] = hi
    bound(store, formula.arc_tape, workspace)
    return results[1] if results[1] >= 0.0 else math.inf


@kernel(signatures="(i8[::1], f8[::1], f8[::1], f8[:, ::1], f8[::1])")
def formula_points(table, pool, t, out, workspace):
    """C, C', C'' at every t to out (n, 9). Returns the first place where C is not finite, or -1."""
    results = formula_workspace_at(workspace, 0).results
    bad = -1
    for i in range(t.size):
        formula_point(Store(table, pool), t[i], workspace)
        for k in range(_VALUES):
            out[i, k] = results[k]
        if bad < 0 and not math.isfinite(out[i, 0] + out[i, 1] + out[i, 2]):
            bad = i
    return bad


@kernel(signatures="(i8[::1], f8[::1], f8[::1], f8[::1], f8[:, ::1], f8[::1])")
def formula_ranges(table, pool, lo, hi, out, workspace):
    """Bounds over the intervals [lo[i], hi[i]] to out (n, 43).

    Twelve pairs over the interval, nine pairs at its middle, and the user's bound of the arc length. Returns the
    worst of SMOOTH, KINK and JUMP over the intervals.
    """
    store = Store(table, pool)
    results = formula_workspace_at(workspace, 0).results
    told = SMOOTH
    for i in range(lo.size):
        row = formula_range_at(out, i)
        told = max(told, range_bounds(store, lo[i], hi[i], workspace))
        for k in range(2 * _ORDERS):
            row.over[k] = results[k]
        middle = 0.5 * (lo[i] + hi[i])
        point_bounds(store, middle, workspace)
        for k in range(2 * _VALUES):
            row.middle[k] = results[k]
        refine(out[i], 0, up(max(middle - lo[i], hi[i] - middle)), 2 * _ORDERS)
        row.arc = arc_bound(store, lo[i], hi[i], workspace)
    return told


@kernel(signatures="(i8[::1], f8[::1], f8[::1], f8[::1], f8[::1], f8[::1])", allocates=True)
def arc_bounds(table, pool, lo, hi, out, workspace):
    """`arc_bound` of every interval [lo[i], hi[i]]; many at a time where plain doubles suffice."""
    store = Store(table, pool)
    formula = formula_at(table, 0)
    if formula.arc_tape != 0 and formula.arc_plain != 0:
        work = lane_constants(store, formula.arc_tape)
        for i in range(0, lo.size, LANES):
            run_lanes(table, formula.arc_tape, lo, hi, i, work, out)
        return
    for i in range(lo.size):
        out[i] = arc_bound(store, lo[i], hi[i], workspace)
