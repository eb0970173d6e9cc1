"""A tape of two ends of an interval run on many intervals at a time, so that they share the cost of an instruction.

Of plain doubles, for the operations that `geometry/expression/rounding.py` bounds, with a place for every result
(`apart`): LLVM makes vectors of loops whose results are not written over their arguments.
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
    """Work of a tape, a row a result, with its constants in their places."""
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
    """Run the tape at table[o] on the intervals [lo, hi] from the first on, to out; infinite where it is no length."""
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
            # The rest of a last row is computed and not used.
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
