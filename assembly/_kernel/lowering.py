"""How inner kernels are written for LLVM: variables as values, and calls without questions that have one answer.

For kernels that count no references. Numba keeps a variable that several blocks use in a slot of memory, and asks after
every call whether it raised an error; kernels hardly ever raise one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from llvmlite.ir import instructions
from numba.core import base, cgutils, ir
from numba.core.analysis import compute_cfg_from_blocks
from numba.core.compiler_machinery import register_pass
from numba.core.imputils import impl_ret_new_ref
from numba.core.lowering import Lower
from numba.core.typed_passes import NativeLowering
from numba.core.types.misc import Optional
from numba.np import arrayobj

from assembly._kernel.translation import variables_in
from assembly._kernel.values import ValueBuilder

__all__ = ["ENTRY", "KernelLowering", "short_calls"]

# The name of an entry's library.
ENTRY = "entry"

# Names of functions that raise no error.
_CALM: set[str] = set()


class _KernelLower(Lower):
    """Numba's translator of a function into instructions of LLVM."""

    def _find_singly_assigned_variable(self) -> None:
        """As values all variables that are assigned once, before all their uses; Numba's own are used in one block."""
        self._singly_assigned_vars = _assigned_before(self.blocks)
        self._blk_local_varmap: dict[str, Any] = {}

    def lower_block(self, block: Any) -> None:
        """Write a block; Numba prepares a message for an error at every statement."""
        self.pre_block(block)
        for statement in block.body:
            self.loc = statement.loc
            try:
                self.lower_inst(statement)
            except Exception as error:
                error.add_note(f"This was translated: {statement}, {statement.loc}")
                raise
        self.post_block(block)

    def delvar(self, name: str) -> None:
        """Nothing to do: there are no references to count."""

    def setup_function(self, fndesc: Any) -> None:
        """Begin the function."""
        super().setup_function(fndesc)
        self.builder = ValueBuilder(self.entry_block)
        self.call_helper = self.call_conv.init_call_helper(self.builder)

    def lower_normal_function(self, fndesc: Any) -> None:
        """Write the function."""
        super().lower_normal_function(fndesc)
        self.builder.finish()


def _assigned_before(blocks: dict[int, Any]) -> set[str]:
    """Names of variables that are assigned once, and used only after it, whichever way a run takes."""
    assigned: dict[str, tuple[int, int]] = {}
    several: set[str] = set()
    for offset, block in blocks.items():
        for place, statement in enumerate(block.body):
            if isinstance(statement, ir.Assign):
                name = statement.target.name
                if name in assigned:
                    several.add(name)
                assigned[name] = offset, place
    dominators = compute_cfg_from_blocks(blocks).dominators()
    for offset, block in blocks.items():
        for place, statement in enumerate(block.body):
            used = statement.value if isinstance(statement, ir.Assign) else statement
            for variable in variables_in(used):
                at = assigned.get(variable.name)
                if at is None or at >= (offset, place) or at[0] not in dominators.get(offset, ()):
                    several.add(variable.name)
    return set(assigned) - several


@register_pass(mutates_CFG=True, analysis_only=False)
class KernelLowering(NativeLowering):
    """Numba's pass that writes a function for LLVM."""

    _name = "kernel_lowering"

    @property
    def lowering_class(self) -> Any:
        """The translator."""
        return _KernelLower


def _short_call(function: Any, libraries: Any, numba_calls: Callable[..., Any]) -> Any:
    """What writes the call of a function: an error is passed on as it came, and asked for only where there may be one.

    Numba keeps every error of a call apart and asks whether someone catches it. In a kernel nobody does.
    """
    call = numba_calls(function, libraries)

    def write(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        if not isinstance(builder, ValueBuilder) or isinstance(function.restype, Optional):
            return call(context, builder, signature, values)
        called = context.declare_function(builder.module, function)
        with builder.goto_entry_block():
            place = builder.alloca(context.call_conv.get_return_type(function.restype).pointee)
        given = context.get_arg_packer(function.argtypes).as_arguments(builder, values)
        code = builder.call(called, [place, builder.function.args[1], *given])
        if function.mangled_name not in _CALM:
            with cgutils.if_unlikely(builder, builder.icmp_signed("!=", code, code.type(0))):
                builder.ret(code)
        value = context.get_returned_value(builder, function.restype, builder.load(place))
        return impl_ret_new_ref(context, builder, function.restype, value)

    # Numba reads these of whatever writes a call; mypy knows of no attributes of functions.
    write.signature, write.libs = call.signature, call.libs  # type: ignore[attr-defined]
    return write


def _remember_whether_calm(function: Any, name: str) -> None:
    ends = [block.terminator for block in function.blocks if isinstance(block.terminator, instructions.Ret)]
    if all(getattr(end.return_value, "constant", None) == 0 for end in ends):
        _CALM.add(name)


@contextmanager
def short_calls() -> Iterator[None]:
    """Have Numba write calls so, until the end. Numba compiles under a lock: one thread at a time is here."""
    before = base.user_function, arrayobj.mark_positive, Lower.lower_normal_function

    def mark_positive(builder: Any, load: Any) -> None:
        # What is no load cannot be marked; LLVM forgets the mark where it makes a value of what is loaded from a slot.
        if not isinstance(builder, ValueBuilder):
            before[1](builder, load)

    def lower_normal_function(lower: Any, function: Any) -> None:
        before[2](lower, function)
        # An entry may come from the cache another time, where nobody knows it.
        if lower.library.name != ENTRY:
            _remember_whether_calm(lower.function, function.mangled_name)

    Lower.lower_normal_function = lower_normal_function
    base.user_function = lambda function, libraries: _short_call(function, libraries, before[0])
    arrayobj.mark_positive = mark_positive
    try:
        yield
    finally:
        base.user_function, arrayobj.mark_positive, Lower.lower_normal_function = before
