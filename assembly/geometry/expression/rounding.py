"""Upper bounds of an expression that plain doubles compute: its rounding is bounded once, over the whole domain.

An expression E of the ends of an interval is computed as E (1 + d) + e. Where E is a product or a root of factors that
are not negative, roundings of its parts are parts of it: d = k 2^-52 for k operations. Of what is left, as the
difference of antiderivatives, e is the sum of

    addition           e_a + e_b + 2^-52 |a + b|
    product            |a| e_b + |b| e_a + e_a e_b + 2^-52 |a b|
    f, one argument    e_a max |f'| + 2^-52 |f|, or 8 units of sine, cosine, exponential and arc tangent

with |.| the largest on the domain, by intervals. Neither costs more than an addition and a product at every call.
"""

from __future__ import annotations

from math import exp, inf, isfinite, sqrt
from typing import TYPE_CHECKING

import numpy as np

from assembly._record import Store
from assembly.geometry.expression.instructions import Tape, compact, instructions, packed
from assembly.geometry.expression.tape import ADD, CONST, COUNT, DIV, HEAD, INPUT, INSTRUCTION, MUL, OUTPUT, SUB, WORK
from assembly.geometry.expression.tape_bounds import run_bounds
from assembly.geometry.interval import EPSILON, LIBRARY, TINY

if TYPE_CHECKING:
    import casadi as ca

__all__ = ["apart", "rounding_error", "upper_expression"]

# Pays for the roundings of the sum of errors itself.
_SAFE = 1.0 + 1e-9
# What `geometry/expression/arithmetic.py` runs.
_KNOWN = frozenset("CONST INPUT OUTPUT ADD SUB MUL DIV NEG TWICE SQ SQRT INV SIN COS ATAN EXP".split())


def rounding_error(ends: ca.SX, expression: ca.SX, domain: tuple[float, float]) -> float:
    """How far doubles may be off an expression of points of the domain; infinite where no bound is known."""
    function = compact("part", ends, expression)
    tape = packed(function)
    x = np.tile(domain, 2)
    work, y = np.zeros(2 * int(tape.table[WORK])), np.zeros(2)
    step = np.zeros(HEAD + INSTRUCTION, dtype=np.int64)
    step[COUNT] = 1
    errors: dict[int, float] = {}
    for k, (name, out, arguments) in enumerate(instructions(function)):
        if name == "OUTPUT":
            return errors[int(arguments[0])] * _SAFE
        if name in ("CONST", "INPUT"):
            known: list[tuple[float, float, float]] = []
        else:
            places = [int(i) for i in arguments]
            known = [(work[2 * i], work[2 * i + 1], errors[i]) for i in places]
        step[HEAD:] = tape.table[HEAD + INSTRUCTION * k : HEAD + INSTRUCTION * (k + 1)]
        with np.errstate(all="ignore"):
            run_bounds(Store(step, tape.constants), 0, x, work, y)
        lo, hi = float(work[2 * out]), float(work[2 * out + 1])
        errors[out] = _error_of(name, known, max(abs(lo), abs(hi)))
    return inf


def _error_of(name: str, known: list[tuple[float, float, float]], most: float) -> float:
    """Error of one operation from (lower, upper, error) of its arguments and its own largest value."""
    if not (isfinite(most) and all(isfinite(sum(row)) for row in known)):
        return inf
    if not known:
        return 0.0
    lo, hi, error = known[0]
    large = max(abs(lo), abs(hi))
    least = 0.0 if lo <= 0.0 <= hi else min(abs(lo), abs(hi))
    own = EPSILON * most + TINY
    if name in ("ADD", "SUB"):
        return error + known[1][2] + own
    if name in ("MUL", "DIV"):
        low, high, other = known[1]
        if name == "MUL":
            return large * other + max(abs(low), abs(high)) * error + error * other + own
        near = 0.0 if low <= 0.0 <= high else min(abs(low), abs(high))
        return (error + large * other / near) / near + own if near > 0.0 else inf
    slopes = {
        **{"NEG": 1.0, "TWICE": 2.0, "SQ": 2.0 * large + error},
        **{"SIN": 1.0, "COS": 1.0, "ATAN": 1.0, "EXP": exp(min(hi, 700.0))},
        **{"SQRT": 0.5 / sqrt(lo) if lo > 0.0 else inf, "INV": 1.0 / least**2 if least > 0.0 else inf},
    }
    if name not in slopes or (error > 0.0 and slopes[name] == inf):
        return inf
    if name in ("SIN", "COS", "ATAN", "EXP"):
        own = LIBRARY * most + TINY
    return own + (slopes[name] * error if error > 0.0 else 0.0)


def upper_expression(ends: ca.SX, expression: ca.SX, domain: tuple[float, float]) -> ca.SX | None:
    """An expression whose value in doubles is not less than the given one, at any ends[0] <= ends[1] of the domain.

    None where no bound of its rounding is known. A value that is no number, or negative, tells nothing.
    """
    import casadi as ca

    gap = ends[1] - ends[0]

    def not_negative(e: ca.SX) -> bool:
        if e.is_constant():
            return float(e) >= 0.0
        if e.op() == ca.OP_MUL:
            return not_negative(e.dep(0)) and not_negative(e.dep(1))
        return bool(ca.is_equal(e, gap, 2))

    def above(e: ca.SX) -> tuple[ca.SX, int]:
        """Not less than e up to some roundings, which are parts of it."""
        if e.is_constant() or ca.is_equal(e, gap, 2):
            return e, 1
        if e.op() == ca.OP_SQRT:
            inner, count = above(e.dep(0))
            return ca.sqrt(inner), count + 1
        if e.op() == ca.OP_MUL and (not_negative(e.dep(0)) or not_negative(e.dep(1))):
            (first, one), (second, two) = above(e.dep(0)), above(e.dep(1))
            # The least numbers pay for products that underflow.
            return first * second + TINY, one + two + 2
        return e + rounding_error(ends, e, domain), 1

    bound, count = above(expression)
    upper = bound * (1.0 + (count + 4) * EPSILON)
    names = set()
    for name, _out, arguments in instructions(compact("upper", ends, upper)):
        names.add(name)
        if name == "CONST" and not isfinite(arguments[0]):
            return None
    return upper if names <= _KNOWN else None


def apart(tape: Tape) -> Tape:
    """A tape whose results all have places of their own, so that none is written over."""
    table = tape.table.copy()
    rows = table[HEAD:].reshape(-1, INSTRUCTION)
    place: dict[int, int] = {}
    for k, row in enumerate(rows):
        code = int(row[0])
        if code not in (CONST, INPUT):
            row[2] = place[int(row[2])]
            if code in (ADD, SUB, MUL, DIV):
                row[3] = place[int(row[3])]
        if code != OUTPUT:
            place[int(row[1])] = k
            row[1] = k
    table[WORK] = len(rows)
    return Tape(table, tape.constants)
