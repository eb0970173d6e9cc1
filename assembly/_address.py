"""Kernels called by address.

What calls another kernel is optimized together with it, as often as it is called; a large kernel that is rarely needed
is compiled for itself, and its caller is given the address of its machine code.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils, config

from assembly._kernel.decorator import ENTRIES
from assembly._written import written_by

__all__ = ["address_of", "call_address", "callback_address", "clock_address"]

_ADDRESSED: dict[int, Callable[..., int]] = {}


def address_of(entry: Any) -> int:
    """The address of a kernel that is an entry and has one signature.

    The kernel returns an integer. The address is for this process: not to be kept in a file.
    """
    if config.DISABLE_JIT:
        address = id(entry)
        _ADDRESSED[address] = entry
        return address
    (argument_types,) = ENTRIES[entry.py_func].argument_types()
    entry.compile(argument_types)
    compiled = entry.overloads[argument_types]
    address = int(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_cfunc_wrapper_name))
    _ADDRESSED[address] = entry
    return address


def call_address(address: int, arguments: tuple[Any, ...]) -> int:
    """Call the kernel at an address that `address_of` gave; the arguments have the types of its signature.

    A named tuple passes for a plain one of the same parts, as signatures have it.
    """
    plain = (tuple(given) if isinstance(given, tuple) else given for given in arguments)
    return int(_ADDRESSED[int(address)](*plain))


def callback_address(function: Any) -> int:
    """The address of a function of the interpreter without arguments, made callable by ctypes; the caller keeps it."""
    address = int(ctypes.cast(function, ctypes.c_void_p).value or 0)
    if config.DISABLE_JIT:
        _ADDRESSED[address] = function
    return address


def clock_address() -> int:
    """Address of what tells the time in nanoseconds to `call_address`, without arguments; 0 where nothing does.

    It is the interpreter's own counter, which needs none of its locks. Python 3.13 has it under another name.
    """
    for name in ("_PyTime_GetPerfCounter", "_PyTime_PerfCounterUnchecked"):
        function = getattr(ctypes.pythonapi, name, None)
        if function is not None:
            address = int(ctypes.cast(function, ctypes.c_void_p).value or 0)
            _ADDRESSED[address] = time.perf_counter_ns
            return address
    return 0


if not config.DISABLE_JIT:

    def _call(_typing: Any, address: Any, arguments: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            kinds = [context.get_value_type(kind) for kind in signature.args[1]]
            function = ir.FunctionType(ir.IntType(64), kinds).as_pointer()
            return builder.call(builder.inttoptr(values[0], function), cgutils.unpack_tuple(builder, values[1]))

        return types.int64(address, arguments), generate

    written_by(call_address, _call)
