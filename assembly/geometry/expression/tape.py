"""User expressions as lists of instructions, and the machine that runs them.

A tape computes y from x with one work array. From place o on, the table holds

    number of instructions, where its constants begin in the pool, size of the work array,

then four integers per instruction: the operation, where the result goes, and the places of two arguments

    CONST    work[out] = constant a          INPUT    work[out] = x[a]
    others   work[out] = operation(work[a], work[b])
    OUTPUT   y[out] = work[a]

Every result equals that of CasADi's own machine (casadi/core/calculus.hpp), with infinities, signs of zeros and NaN,
so no multiplication is fused with an addition here. Run uncompiled, numpy's functions warn of invalid arguments.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of

# Head of a tape in the table; its instructions stand behind it.
TAPE = record_dtype(
    "i8",
    count=1,  # of instructions
    constants=1,  # where in the pool its constants begin
    work=1,  # size of the work array
)
tape_at = record_view(TAPE)
COUNT = place_of(TAPE, "count")
CONSTANTS = place_of(TAPE, "constants")
WORK = place_of(TAPE, "work")
HEAD = size_of(TAPE)
# An instruction of a tape.
TAPE_INSTRUCTION = record_dtype(
    "i8",
    code=1,  # operation
    out=1,  # where the result goes
    a=1,  # places of two arguments
    b=1,
)
instruction_at = record_view(TAPE_INSTRUCTION)
INSTRUCTION = size_of(TAPE_INSTRUCTION)

# Names of CasADi's operations (without its OP_) in the order of our codes, the frequent ones first. LLVM makes a jump
# table of codes without gaps.
OPERATIONS = (
    *("MUL", "ADD", "SUB", "INPUT", "OUTPUT", "CONST", "NEG", "SQ", "TWICE", "DIV", "SQRT", "INV", "SIN", "COS"),
    *("ASSIGN", "LIFT", "POW", "CONSTPOW", "EXP", "LOG", "TAN", "ASIN", "ACOS", "ATAN", "ATAN2", "HYPOT", "FABS"),
    *("SIGN", "COPYSIGN", "FMIN", "FMAX", "LT", "LE", "EQ", "NE", "NOT", "AND", "OR", "IF_ELSE_ZERO", "FLOOR", "CEIL"),
    *("FMOD", "REMAINDER", "LOG1P", "EXPM1", "SINH", "COSH", "TANH", "ASINH", "ACOSH", "ATANH", "ERF", "ERFINV"),
)
MUL, ADD, SUB, INPUT, OUTPUT, CONST, NEG, SQ, TWICE, DIV, SQRT, INV, SIN, COS = range(14)
ASSIGN, LIFT, POW, CONSTPOW, EXP, LOG, TAN, ASIN, ACOS, ATAN, ATAN2, HYPOT, FABS = range(14, 27)
SIGN, COPYSIGN, FMIN, FMAX, LT, LE, EQ, NE, NOT, AND, OR, IF_ELSE_ZERO, FLOOR, CEIL = range(27, 41)
FMOD, REMAINDER, LOG1P, EXPM1, SINH, COSH, TANH, ASINH, ACOSH, ATANH, ERF, ERFINV = range(41, 53)


@kernel(inner=True, exact=True)
def remainder(x, y):
    """x - n y with n the integer nearest to x / y, the even one of two (IEEE 754): exact."""
    size = abs(y)
    low = np.fmod(abs(x), size)
    high = size - low
    if low < high:
        r = low
    elif low > high:
        r = -high
    elif low == high:
        # Halfway: the multiple of y that was taken off is odd where half of it leaves half of y.
        r = low - 2.0 * np.fmod(0.5 * (abs(x) - low), size)
    else:
        return low + y  # NaN
    return r if math.copysign(1.0, x) > 0.0 else -r


@kernel(inner=True, exact=True)
def erfinv(x):
    """CasADi's inverse error function: good to 4e-6 below -0.7, where no Newton step follows, to 2e-15 elsewhere."""
    if x >= 1.0 or x <= -1.0:
        return math.copysign(math.inf, x) if x == 1.0 or x == -1.0 else math.nan
    if -0.7 <= x < 0.7:
        z = x * x
        above = ((-0.140543331 * z + 0.914624893) * z - 1.645349621) * z + 0.886226899
        y = x * above / ((((-0.329097515 * z + 0.012229801) * z + 1.442710462) * z - 2.118377725) * z + 1.0)
    else:
        z = np.sqrt(-np.log((1.0 - abs(x)) / 2.0))
        above = ((1.641345311 * z + 3.429567803) * z - 1.624906493) * z - 1.970840454
        y = above / ((1.637067800 * z + 3.543889200) * z + 1.0)
        if x < -0.7:
            return -y
    slope = 2.0 / math.sqrt(math.pi)
    y = y - (math.erf(y) - x) / (slope * np.exp(-y * y))
    return y - (math.erf(y) - x) / (slope * np.exp(-y * y))


@kernel(inline=True, exact=True)
def rare_operation(code, x, y):
    """The result of one of the operations from POW on."""
    if code == POW or code == CONSTPOW:
        return x**y
    if code == EXP:
        return np.exp(x)
    if code == LOG:
        return np.log(x)
    if code == TAN:
        return np.tan(x)
    if code == ASIN:
        return np.arcsin(x)
    if code == ACOS:
        return np.arccos(x)
    if code == ATAN:
        return math.atan(x)
    if code == ATAN2:
        return math.atan2(x, y)
    if code == HYPOT:
        return np.hypot(x, y)
    if code == FABS:
        return abs(x)
    if code == SIGN:
        return -1.0 if x < 0.0 else (1.0 if x > 0.0 else x)
    if code == COPYSIGN:
        return math.copysign(x, y)
    if code == FMIN:
        return x if x <= y or y != y else y
    if code == FMAX:
        return x if x >= y or y != y else y
    if code == LT:
        return 1.0 if x < y else 0.0
    if code == LE:
        return 1.0 if x <= y else 0.0
    if code == EQ:
        return 1.0 if x == y else 0.0
    if code == NE:
        return 1.0 if x != y else 0.0
    if code == NOT:
        return 1.0 if x == 0.0 else 0.0
    if code == AND:
        return 1.0 if x != 0.0 and y != 0.0 else 0.0
    if code == OR:
        return 1.0 if x != 0.0 or y != 0.0 else 0.0
    if code == IF_ELSE_ZERO:
        return 0.0 if x == 0.0 else y
    if code == FLOOR:
        return np.floor(x)
    if code == CEIL:
        return np.ceil(x)
    if code == FMOD:
        return np.fmod(x, y)
    if code == REMAINDER:
        return remainder(x, y)
    if code == LOG1P:
        return np.log1p(x)
    if code == EXPM1:
        return np.expm1(x)
    if code == SINH:
        return np.sinh(x)
    if code == COSH:
        return np.cosh(x)
    if code == TANH:
        return np.tanh(x)
    if code == ASINH:
        return np.arcsinh(x)
    if code == ACOSH:
        return np.arccosh(x)
    if code == ATANH:
        return np.arctanh(x)
    if code == ERF:
        return math.erf(x)
    return erfinv(x)


@kernel(inner=True, exact=True)
def run_tape(store, o, x, work, y):
    """Run the tape that begins at table[o]: y from x. Entries of y without an OUTPUT instruction keep their values."""
    tape = tape_at(store.table, o)
    constants = np.uint64(tape.constants)
    begin = o + HEAD
    for k in range(begin, begin + INSTRUCTION * tape.count, INSTRUCTION):
        instruction = instruction_at(store.table, k)
        code = instruction.code
        # Unsigned: Numba checks whether a signed index is negative, which takes a fifth of the time.
        out = np.uint64(instruction.out)
        a = np.uint64(instruction.a)
        b = np.uint64(instruction.b)
        if code == MUL:
            work[out] = work[a] * work[b]
        elif code == ADD:
            work[out] = work[a] + work[b]
        elif code == SUB:
            work[out] = work[a] - work[b]
        elif code == INPUT:
            work[out] = x[a]
        elif code == OUTPUT:
            y[out] = work[a]
        elif code == CONST:
            work[out] = store.pool[constants + a]
        elif code == NEG:
            work[out] = -work[a]
        elif code == SQ:
            work[out] = work[a] * work[a]
        elif code == TWICE:
            work[out] = 2.0 * work[a]
        elif code == DIV:
            work[out] = work[a] / work[b]
        elif code == SQRT:
            work[out] = np.sqrt(work[a])
        elif code == INV:
            work[out] = 1.0 / work[a]
        elif code == SIN:
            work[out] = np.sin(work[a])
        elif code == COS:
            work[out] = np.cos(work[a])
        elif code == ASSIGN or code == LIFT:
            work[out] = work[a]
        else:
            work[out] = rare_operation(code, work[a], work[b])
