"""What Numba finds out again and again while an entry compiles, found once; and the passes that kernels need.

Nothing here changes what Numba finds: the same types, the same code for LLVM, the same machine code.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import CodeType
from typing import Any
from weakref import WeakSet

from numba.core import base, compiler, datamodel, transforms, typed_passes, untyped_passes
from numba.core.base import BaseContext
from numba.core.compiler_machinery import PassManager
from numba.core.postproc import PostProcessor
from numba.core.types.functions import BaseFunction
from numba.core.typing import npydecl

from assembly._kernel.lowering import KernelLowering

__all__ = ["needed_passes", "nothing_twice"]

# Passes that change nothing in a plain kernel without arrays of its own; after most of them Numba finds the lifetimes
# of all variables anew.
_FOR_OTHERS: tuple[type, ...] = (
    untyped_passes.WithLifting,
    untyped_passes.InlineClosureLikes,
    untyped_passes.RewriteDynamicRaises,
    untyped_passes.MakeFunctionToJitFunction,
    untyped_passes.InlineInlinables,
    untyped_passes.FindLiterallyCalls,
    untyped_passes.LiteralUnroll,
    untyped_passes.LiteralPropagationSubPipelinePass,
    typed_passes.InlineOverloads,
    typed_passes.NopythonRewrites,
    typed_passes.AnnotateTypes,
    typed_passes.DumpParforDiagnostics,
)


def _is_plain(code: CodeType) -> bool:
    """Whether there are no functions, generators and comprehensions in it, and nothing that catches an error."""
    return not code.co_exceptiontable and not any(isinstance(part, CodeType) for part in code.co_consts)


def needed_passes(state: Any) -> PassManager:
    """Numba's passes without those that change nothing in this kernel."""
    passes = compiler.DefaultPassBuilder.define_nopython_pipeline(state)
    if state.flags.nrt or not _is_plain(state.func_id.code):
        return passes
    short = PassManager("kernel")
    last: Any = None
    for made, said in passes.passes:
        # Branches are pruned where constants are known, and where variables have one definition each; not in between.
        is_between = made is untyped_passes.DeadBranchPrune and last is untyped_passes.GenericRewrites
        if made not in _FOR_OTHERS and not is_between:
            short.add_pass(KernelLowering if made is typed_passes.NativeLowering else made, said)
            last = made
    short.finalize()
    _WITHOUT_LIFETIMES.add(state.func_id)
    return short


# Functions that `KernelLowering` writes, which asks for nobody's lifetime.
_WITHOUT_LIFETIMES: WeakSet[Any] = WeakSet()


def _finish_blocks(finish: Callable[..., None], processor: Any, *given: Any, **named: Any) -> None:
    """Bring blocks into Numba's form; it finds the lifetimes of all variables then, five times a function."""
    function = processor.func_ir
    if function.func_id in _WITHOUT_LIFETIMES:
        function.blocks = transforms.canonicalize_cfg(function.blocks)
        function.generator_info = None
    else:
        finish(processor, *given, **named)


class _Found:
    """What is found while one entry compiles; types are told apart by being the same object, as Numba's are."""

    def __init__(self) -> None:
        self.declared: dict[int, tuple[int, ...]] = {}
        self.signatures: dict[Any, Any] = {}
        self.packers: dict[Any, Any] = {}
        self.loops: dict[Any, Any] = {}
        self.sizes: dict[str, int] = {}
        self.asks_where: dict[int, Any] = {}

    def refresh(self, context: Any, numba_refreshes: Callable[[Any], None]) -> None:
        """Look for new declarations, which imports and intrinsics bring; Numba looks before every function."""
        registries = context._registries
        declared = len(sys.modules), sum(len(one.functions) for one in registries)
        # Contexts that Numba derives from one another have their registries in common.
        if declared != self.declared.get(id(registries)):
            numba_refreshes(context)
            self.declared[id(registries)] = declared

    def call_type(self, find: Callable[..., Any], function: Any, context: Any, arguments: Any, named: Any) -> Any:
        """The signature of a call with arguments of these types.

        Only where it leads to code that Numba writes itself, as for operators. Functions that are compiled are asked
        for anew, since Numba compiles them by the settings of whoever calls.
        """
        key = (id(context), id(function), *map(id, arguments), *((name, id(kind)) for name, kind in named.items()))
        if key in self.signatures:
            return self.signatures[key][0]
        signature = find(function, context, arguments, named)
        if function._impl_keys.get(signature.args) is function.typing_key:
            # The objects are kept, since another one could get the same id.
            self.signatures[key] = signature, function, context, arguments, named
        return signature

    def packer(self, context: Any, kinds: Any) -> Any:
        """How arguments of these types are passed."""
        key = tuple(map(id, kinds))
        found = self.packers.get(key)
        if found is None:
            found = self.packers[key] = datamodel.ArgPacker(context.data_model_manager, kinds), tuple(kinds)
        return found[0]

    def loop(self, find: Callable[..., Any], function: Any, kinds: Any) -> Any:
        """The loop of a NumPy function for these types, which Numba looks for at every operator."""
        key = (function, *kinds)
        if key not in self.loops:
            self.loops[key] = find(function, kinds)
        return self.loops[key]

    def has_loc(self, find: Callable[[Any], bool], function: Any) -> bool:
        """Whether a function that writes code asks where in a source it is for."""
        if id(function) not in self.asks_where:
            self.asks_where[id(function)] = find(function), function
        return bool(self.asks_where[id(function)][0])

    def size(self, find: Callable[[Any, Any], int], context: Any, kind: Any) -> int:
        """How many bytes a value of LLVM's takes."""
        name = str(kind)
        if name not in self.sizes:
            self.sizes[name] = find(context, kind)
        return self.sizes[name]


@contextmanager
def nothing_twice() -> Iterator[None]:
    """Have Numba look up what it found, until the end. Numba compiles under a lock: one thread at a time is here."""
    found = _Found()
    call_type, find_loop = BaseFunction.get_call_type, npydecl.ufunc_find_matching_loop
    refresh, size = BaseContext.refresh, BaseContext.get_abi_sizeof
    finish, has_loc = PostProcessor.run, base._has_loc
    shortcuts: tuple[tuple[Any, str, Callable[..., Any]], ...] = (
        (BaseFunction, "get_call_type", lambda *given: found.call_type(call_type, *given)),
        (BaseContext, "refresh", lambda context: found.refresh(context, refresh)),
        (BaseContext, "get_arg_packer", lambda context, kinds: found.packer(context, kinds)),
        (BaseContext, "get_abi_sizeof", lambda context, kind: found.size(size, context, kind)),
        (base, "_has_loc", lambda function: found.has_loc(has_loc, function)),
        (PostProcessor, "run", lambda *given, **named: _finish_blocks(finish, *given, **named)),
        (npydecl, "ufunc_find_matching_loop", lambda *given: found.loop(find_loop, *given)),
    )
    before = [(where, name, getattr(where, name)) for where, name, _shortcut in shortcuts]
    for where, name, shortcut in shortcuts:
        setattr(where, name, shortcut)
    try:
        yield
    finally:
        for where, name, original in before:
            setattr(where, name, original)
