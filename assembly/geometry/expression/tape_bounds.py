"""A tape run on intervals: bounds of an expression over an interval, rounded outward (`geometry/interval.py`).

Where an argument leaves the domain of a square root, a logarithm, an arc sine and the like, only its part inside
counts: the expression is assumed to be defined, and intervals are wider than true ranges. With no part inside, the
result is the whole line.

A run also returns whether a kink (of abs, min, max ...) or a jump (of sign, floor, comparisons ...) may lie in the
interval: CasADi's derivatives of an expression ignore those.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.expression.tape import (
    ACOS,
    ACOSH,
    ADD,
    AND,
    ASIN,
    ASINH,
    ASSIGN,
    ATAN,
    ATAN2,
    ATANH,
    CEIL,
    CONST,
    CONSTPOW,
    COPYSIGN,
    COS,
    COSH,
    DIV,
    EQ,
    ERF,
    ERFINV,
    EXP,
    EXPM1,
    FABS,
    FLOOR,
    FMAX,
    FMIN,
    FMOD,
    HEAD,
    HYPOT,
    IF_ELSE_ZERO,
    INPUT,
    INSTRUCTION,
    INV,
    LE,
    LIFT,
    LOG,
    LOG1P,
    LT,
    MUL,
    NE,
    NEG,
    NOT,
    OR,
    OUTPUT,
    POW,
    REMAINDER,
    SIGN,
    SIN,
    SINH,
    SQ,
    SQRT,
    SUB,
    TAN,
    TANH,
    TWICE,
    erfinv,
    instruction_at,
    tape_at,
)
from assembly.geometry.interval import (
    EPSILON,
    FAR,
    LIBRARY,
    iarctangent2,
    icosine,
    idifference,
    ipower,
    iproduct,
    iquotient,
    isine,
    isquare,
    isum,
    magnitude,
    reaches,
    widened,
)

# What a run returns: no kink or jump inside, a possible kink, a possible jump.
SMOOTH, KINK, JUMP = 0, 1, 2
# Relative error allowed for CasADi's inverse error function, far above rounding.
_ERFINV = 1e-5


@kernel(inline=True)
def truth(sure, possible):
    """Bounds of a comparison, as 0 or 1, from whether it surely holds and whether it possibly does."""
    return (1.0 if sure else 0.0), (1.0 if possible else 0.0)


@kernel(inline=True)
def least_size(a):
    """The least absolute value in an interval."""
    return 0.0 if a[0] <= 0.0 <= a[1] else min(abs(a[0]), abs(a[1]))


@kernel(inline=True, exact=True)
def smooth_bounds(code, a, b):
    """Bounds of an operation without kinks, their relative error, and SMOOTH or JUMP."""
    told = SMOOTH
    lo, hi = -math.inf, math.inf
    part = LIBRARY
    if code == POW or code == CONSTPOW:
        lo, hi = ipower(a, b)
        part = 0.0
    elif code == EXP:
        lo, hi = math.exp(a[0]), math.exp(a[1])
    elif code == LOG:
        if a[1] > 0.0:
            lo = math.log(a[0]) if a[0] > 0.0 else -math.inf
            hi = math.log(a[1])
    elif code == TAN:
        inside = a[1] - a[0] < math.pi and abs(a[0]) < FAR and abs(a[1]) < FAR
        if inside and not reaches(a[0], a[1], 0.5 * math.pi, math.pi):
            lo, hi = math.tan(a[0]), math.tan(a[1])
    elif code == ASIN:
        if a[0] <= 1.0 and a[1] >= -1.0:
            lo, hi = math.asin(min(max(a[0], -1.0), 1.0)), math.asin(min(max(a[1], -1.0), 1.0))
    elif code == ACOS:
        if a[0] <= 1.0 and a[1] >= -1.0:
            lo, hi = math.acos(min(max(a[1], -1.0), 1.0)), math.acos(min(max(a[0], -1.0), 1.0))
    elif code == ATAN:
        lo, hi = math.atan(a[0]), math.atan(a[1])
    elif code == ATAN2:
        lo, hi, cut = iarctangent2(a, b)
        told = JUMP if cut else SMOOTH
    elif code == HYPOT:
        lo, hi = math.hypot(least_size(a), least_size(b)), math.hypot(magnitude(a), magnitude(b))
    elif code == LOG1P:
        if a[1] > -1.0:
            lo = math.log1p(a[0]) if a[0] > -1.0 else -math.inf
            hi = math.log1p(a[1])
    elif code == EXPM1:
        lo, hi = math.expm1(a[0]), math.expm1(a[1])
    elif code == SINH:
        lo, hi = math.sinh(a[0]), math.sinh(a[1])
    elif code == COSH:
        lo, hi = math.cosh(least_size(a)), math.cosh(magnitude(a))
    elif code == TANH:
        lo, hi = math.tanh(a[0]), math.tanh(a[1])
    elif code == ASINH:
        lo, hi = math.asinh(a[0]), math.asinh(a[1])
    elif code == ACOSH:
        if a[1] >= 1.0:
            lo, hi = math.acosh(max(a[0], 1.0)), math.acosh(max(a[1], 1.0))
    elif code == ATANH:
        lo = math.atanh(a[0]) if a[0] > -1.0 else -math.inf
        hi = math.atanh(a[1]) if a[1] < 1.0 else math.inf
    elif code == ERF:
        lo, hi = math.erf(a[0]), math.erf(a[1])
    elif code == ERFINV:
        lo = erfinv(a[0]) if a[0] > -1.0 else -math.inf
        hi = erfinv(a[1]) if a[1] < 1.0 else math.inf
        part = _ERFINV
    return lo, hi, part, told


@kernel(inline=True, exact=True)
def kinked_bounds(code, a, b):
    """Bounds of an operation with kinks or jumps that is not a comparison, and SMOOTH, KINK or JUMP."""
    told = SMOOTH
    lo, hi = -math.inf, math.inf
    if code == FABS:
        lo, hi = least_size(a), magnitude(a)
        if a[0] <= 0.0 <= a[1]:
            told = KINK
    elif code == SIGN:
        lo = 1.0 if a[0] > 0.0 else (0.0 if a[0] == 0.0 else -1.0)
        hi = -1.0 if a[1] < 0.0 else (0.0 if a[1] == 0.0 else 1.0)
        if lo != hi or lo == 0.0:
            told = JUMP
    elif code == COPYSIGN:
        near, far = least_size(a), magnitude(a)
        if near == 0.0:
            told = KINK
        if b[0] > 0.0:
            lo, hi = near, far
        elif b[1] < 0.0:
            lo, hi = -far, -near
        else:
            lo, hi = -far, far
            told = JUMP
    elif code == FMIN or code == FMAX:
        lo = min(a[0], b[0]) if code == FMIN else max(a[0], b[0])
        hi = min(a[1], b[1]) if code == FMIN else max(a[1], b[1])
        if a[0] <= b[1] and b[0] <= a[1]:
            told = KINK
    elif code == FLOOR or code == CEIL:
        # Not those of `math`, which return integers and fail at infinity.
        lo = np.floor(a[0]) if code == FLOOR else np.ceil(a[0])
        hi = np.floor(a[1]) if code == FLOOR else np.ceil(a[1])
        if lo != hi or a[0] == lo or a[1] == hi:
            told = JUMP
    elif code == FMOD or code == REMAINDER:
        divisor = least_size(b)
        whole = 1.0 if code == FMOD else 0.5
        if magnitude(a) < whole * divisor:
            lo, hi = a
        elif code == FMOD and b[0] == b[1] and same_quotient(a, b[0]):
            # The fmod of doubles is exact.
            lo, hi = np.fmod(a[0], b[0]), np.fmod(a[1], b[0])
        else:
            far = min(magnitude(a), magnitude(b))
            lo, hi = -far, far
            told = JUMP
    return lo, hi, told


@kernel(inline=True)
def compared(code, a, b):
    """Bounds of a comparison, or of a choice by one, and SMOOTH or JUMP."""
    told = SMOOTH
    no_a = a[0] == 0.0 and a[1] == 0.0
    no_b = b[0] == 0.0 and b[1] == 0.0
    yes_a = a[0] > 0.0 or a[1] < 0.0
    yes_b = b[0] > 0.0 or b[1] < 0.0
    if code == LT:
        lo, hi = truth(a[1] < b[0], a[0] < b[1])
    elif code == LE:
        lo, hi = truth(a[1] <= b[0], a[0] <= b[1])
    elif code == EQ:
        lo, hi = truth(a[0] == a[1] and b[0] == b[1] and a[0] == b[0], a[0] <= b[1] and b[0] <= a[1])
    elif code == NE:
        lo, hi = truth(a[0] > b[1] or b[0] > a[1], not (a[0] == a[1] and b[0] == b[1] and a[0] == b[0]))
    elif code == NOT:
        lo, hi = truth(no_a, not yes_a)
    elif code == AND:
        lo, hi = truth(yes_a and yes_b, not no_a and not no_b)
    elif code == OR:
        lo, hi = truth(yes_a or yes_b, not (no_a and no_b))
    elif no_a:
        lo, hi = 0.0, 0.0
    elif yes_a:
        lo, hi = b
    else:
        lo, hi = min(b[0], 0.0), max(b[1], 0.0)
        told = JUMP
    if code != IF_ELSE_ZERO and lo != hi:
        told = JUMP
    return lo, hi, told


@kernel(inner=True, exact=True)
def elementary(code, a, b):
    """Bounds of one rare operation, and SMOOTH, KINK or JUMP."""
    if LT <= code <= IF_ELSE_ZERO:
        lo, hi, told = compared(code, a, b)
    elif FABS <= code <= REMAINDER:
        lo, hi, told = kinked_bounds(code, a, b)
    else:
        lo, hi, part, told = smooth_bounds(code, a, b)
        if part > 0.0:
            lo, hi = widened(lo, hi, part)
    if not (lo <= hi):
        lo, hi = -math.inf, math.inf
    return lo, hi, told


@kernel(inline=True)
def same_quotient(a, b):
    """Whether a / b has the same integer part over the whole interval a; below 1e15 roundings do not hide it."""
    if b == 0.0 or not magnitude(a) < 1e15 * abs(b):
        return False
    low = np.floor((a[0] - np.fmod(a[0], b)) / b + 0.5)
    return low == np.floor((a[1] - np.fmod(a[1], b)) / b + 0.5)


@kernel(inline=True)
def is_undefined(code, a, b, lo, hi):
    """Whether an operation may have no value somewhere in the intervals a and b, given the bounds of its values."""
    if not (lo > -math.inf and hi < math.inf):
        return True
    if code == SQRT:
        return a[0] < 0.0
    if code == ASIN or code == ACOS:
        return a[0] < -1.0 or a[1] > 1.0
    if code == ACOSH:
        return a[0] < 1.0
    if code == POW or code == CONSTPOW:
        return a[0] < 0.0 and not (b[0] == b[1] and b[0] == np.floor(b[0]))
    return False


@kernel(inline=True)
def chosen(code, a, b, lo, hi, told):
    """Bounds of an operation whose result is a number though an argument may be NaN: fmin(x, NaN) is x."""
    if code == FMIN or code == FMAX:
        return min(a[0], b[0]), max(a[1], b[1]), JUMP
    if LT <= code <= OR:
        return 0.0, 1.0, JUMP
    if code == IF_ELSE_ZERO:
        return min(b[0], 0.0), max(b[1], 0.0), JUMP
    return lo, hi, told


@kernel(inner=True, exact=True)
def run_bounds(store, o, x, work, y):
    """Run the tape that begins at table[o] on intervals, pairs (lo, hi) in x, work and y; SMOOTH, KINK or JUMP."""
    tape = tape_at(store.table, o)
    constants = np.uint64(tape.constants)
    begin = o + HEAD
    told = SMOOTH
    # Whether some value so far may be undefined (NaN).
    undefined = False
    for k in range(begin, begin + INSTRUCTION * tape.count, INSTRUCTION):
        instruction = instruction_at(store.table, k)
        code = instruction.code
        out = np.uint64(2) * np.uint64(instruction.out)
        i = np.uint64(instruction.a)
        j = np.uint64(2) * np.uint64(instruction.b)
        if code == INPUT:
            work[out] = x[np.uint64(2) * i]
            work[out + np.uint64(1)] = x[np.uint64(2) * i + np.uint64(1)]
            continue
        if code == CONST:
            work[out] = store.pool[constants + i]
            work[out + np.uint64(1)] = store.pool[constants + i]
            continue
        i = np.uint64(2) * i
        a = (work[i], work[i + np.uint64(1)])
        if code == OUTPUT:
            y[out] = a[0]
            y[out + np.uint64(1)] = a[1]
            continue
        b = a
        if code == MUL:
            b = iproduct(a, (work[j], work[j + np.uint64(1)]))
        elif code == ADD:
            b = isum(a, (work[j], work[j + np.uint64(1)]))
        elif code == SUB:
            b = idifference(a, (work[j], work[j + np.uint64(1)]))
        elif code == NEG:
            b = (-a[1], -a[0])
        elif code == SQ:
            b = isquare(a)
            if not (b[0] <= b[1]):
                b = (0.0, math.inf)
        elif code == TWICE:
            b = (2.0 * a[0], 2.0 * a[1])
        elif code == DIV:
            b = iquotient(a, (work[j], work[j + np.uint64(1)]))
        elif code == SQRT:
            if a[1] >= 0.0:
                lo, hi = widened(math.sqrt(max(a[0], 0.0)), math.sqrt(a[1]), EPSILON)
                b = (max(lo, 0.0), hi)
            else:
                b = (-math.inf, math.inf)
        elif code == INV:
            b = iquotient((1.0, 1.0), a)
        elif code == SIN:
            b = isine(a[0], a[1])
        elif code == COS:
            b = icosine(a[0], a[1])
        elif code == ASSIGN or code == LIFT:
            b = a
        else:
            c = (work[j], work[j + np.uint64(1)])
            lo, hi, tells = elementary(code, a, c)
            if undefined:
                lo, hi, tells = chosen(code, a, c, lo, hi, tells)
            undefined = undefined or is_undefined(code, a, c, lo, hi)
            told = max(told, tells)
            b = (lo, hi)
        if code == SQRT or not (b[0] > -math.inf and b[1] < math.inf):
            undefined = undefined or is_undefined(code, a, a, b[0], b[1])
        work[out] = b[0]
        work[out + np.uint64(1)] = b[1]
    return told


@kernel(signatures="(i8[::1], f8[::1], i8, f8[::1], f8[::1], f8[::1])")
def bound_outputs(table, pool, o, x, work, y):
    """`run_bounds` for Python."""
    return run_bounds(Store(table, pool), o, x, work, y)
