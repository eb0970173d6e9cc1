"""The address of the loop, for kernels that run it many times."""

from __future__ import annotations

import functools

from assembly._address import address_of
from assembly._kernel.decorator import ENTRIES
from assembly.solve.loop.augmented_lagrangian import solve_program

__all__ = ["loop_address"]


@functools.cache
def loop_address(end_effectors: int | None) -> int:
    """The address of `solve_program` in this process, for scenes with a dexterity (1) or without (None)."""
    entry = ENTRIES.get(getattr(solve_program, "py_func", solve_program))
    if entry is None:
        # Kernels run as plain Python.
        return address_of(solve_program)
    types = entry.argument_types()[0 if end_effectors is not None else 1]
    solve_program.compile(types)
    compiled = solve_program.overloads[types]
    return int(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_cfunc_wrapper_name))
