"""CasADi functions of one column as packed lists of instructions, which `geometry/expression/tape.py` runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError
from assembly.geometry.expression.tape import CONST, HEAD, INPUT, OPERATIONS

if TYPE_CHECKING:
    import casadi as ca

__all__ = ["Tape", "compact", "instructions", "packed"]

Array = NDArray[np.float64]


class Tape(NamedTuple):
    """A packed list of instructions, as in `geometry/expression/tape.py`; constants begin at 0 of their own array."""

    table: NDArray[np.int64]
    constants: Array


def compact(name: str, x: ca.SX, y: ca.SX) -> ca.Function:
    """A function of one column whose common parts are computed once."""
    import casadi as ca

    return ca.Function(name, [x], [ca.densify(y)], {"cse": True})


def instructions(function: ca.Function) -> Iterator[tuple[str, int, tuple[int, ...] | tuple[float]]]:
    """Operation, place of the result, and places of the arguments (or the constant) of every instruction."""
    import casadi as ca

    names = {getattr(ca, f"OP_{name}"): name for name in OPERATIONS}
    for k in range(function.n_instructions()):
        code = function.instruction_id(k)
        if code not in names:
            unknown = next(name for name in dir(ca) if name.startswith("OP_") and getattr(ca, name) == code)
            raise InputError(
                f"function {function.name()!r} has the instruction {unknown}; expected elementary functions alone"
            )
        name, out, arguments = names[code], function.instruction_output(k), function.instruction_input(k)
        if name == "CONST":
            yield name, out[0], (function.instruction_constant(k),)
        elif name == "INPUT":
            yield name, out[0], (arguments[1],)
        elif name == "OUTPUT":
            yield name, out[1], (arguments[0],)
        else:
            yield name, out[0], tuple(arguments)


def packed(function: ca.Function, numbers: Sequence[float] = ()) -> Tape:
    """The instructions of a function of one column as integers and constants.

    The last inputs may be numbers that are written between solves: they are the first of the constants.
    """
    codes = {name: code for code, name in enumerate(OPERATIONS)}
    constants = list(numbers)
    first = function.size1_in(0) - len(constants)
    table: list[tuple[int, int, int, int]] = []
    for name, out, arguments in instructions(function):
        code = codes[name]
        if code == INPUT and arguments[0] >= first:
            table.append((CONST, out, int(arguments[0]) - first, 0))
        elif code == CONST:
            table.append((code, out, len(constants), 0))
            constants.append(arguments[0])
        else:
            a, b = (*arguments, 0)[:2]
            table.append((code, out, int(a), int(b)))
    row = np.empty(HEAD + 4 * len(table), dtype=np.int64)
    row[:HEAD] = len(table), 0, function.sz_w()
    row[HEAD:] = np.ravel(table)
    return Tape(row, np.array(constants, dtype=np.float64))
