"""A tape, whose inputs are the two ends of an interval, run on many intervals at once to share its overhead.

It runs on plain doubles, for the operations that `geometry/expression/rounding.py` bounds. Every result has a place
of its own (`apart`), because LLVM vectorizes loops that do not overwrite their arguments.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.expression.tape import (
    ADD,
    CONST,
    COS,
    DIV,
    EXP,
    HEAD,
    INPUT,
    INSTRUCTION,
    INV,
    MUL,
    NEG,
    OUTPUT,
    SIN,
    SQ,
    SQRT,
    SUB,
    TWICE,
    tape_at,
)

LANES = 64


@kernel(inner=True, allocates=True)
def lane_constants(store, o):
    """The work array of a tape, one row per result, with its constants filled in."""
    tape = tape_at(store.table, o)
    count = tape.count
    work = np.empty((count, LANES))
    for k in range(count):
        p = o + HEAD + INSTRUCTION * k
        if store.table[p] == CONST:
            work[k, :] = store.pool[tape.constants + store.table[p + 2]]
    return work


@kernel(inner=True, exact=True)
def run_lanes(table, o, lo, hi, first, work, out):
    """Run the tape at table[o] on up to LANES intervals [lo, hi] from `first` on; infinity where no length results."""
    count = min(LANES, lo.size - first)
    for k in range(tape_at(table, o).count):
        p = o + HEAD + INSTRUCTION * k
        code = table[p]
        if code == CONST:
            continue
        i = table[p + 2]
        r = work[k]
        if code == INPUT:
            ends = lo if i == 0 else hi
            for m in range(count):
                r[m] = ends[first + m]
            # Lanes beyond the last interval are computed too, but not used.
            for m in range(count, LANES):
                r[m] = ends[first]
            continue
        a = work[i]
        if code == OUTPUT:
            for m in range(count):
                out[first + m] = a[m] if a[m] >= 0.0 else math.inf
            return
        if code == MUL:
            b = work[table[p + 3]]
            for m in range(LANES):
                r[m] = a[m] * b[m]
        elif code == ADD:
            b = work[table[p + 3]]
            for m in range(LANES):
                r[m] = a[m] + b[m]
        elif code == SUB:
            b = work[table[p + 3]]
            for m in range(LANES):
                r[m] = a[m] - b[m]
        elif code == NEG:
            for m in range(LANES):
                r[m] = -a[m]
        elif code == SQ:
            for m in range(LANES):
                r[m] = a[m] * a[m]
        elif code == TWICE:
            for m in range(LANES):
                r[m] = 2.0 * a[m]
        elif code == DIV:
            b = work[table[p + 3]]
            for m in range(LANES):
                r[m] = a[m] / b[m]
        elif code == INV:
            for m in range(LANES):
                r[m] = 1.0 / a[m]
        elif code == SQRT:
            for m in range(LANES):
                r[m] = np.sqrt(a[m])
        elif code == SIN:
            for m in range(LANES):
                r[m] = np.sin(a[m])
        elif code == COS:
            for m in range(LANES):
                r[m] = np.cos(a[m])
        elif code == EXP:
            for m in range(LANES):
                r[m] = np.exp(a[m])
        else:
            for m in range(LANES):
                r[m] = np.arctan(a[m])
