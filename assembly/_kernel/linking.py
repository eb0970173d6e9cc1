"""How kernels become machine code: what an entry calls is linked with it and optimized as a whole, once."""

from __future__ import annotations

import gc
from collections.abc import Callable
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

__all__ = ["EntryCompiler", "InnerCompiler"]


class _NoEnvironment:
    """Numba's code generator, but that a kernel without code of its own has no place for its environment either."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def set_env(self, _name: str, _environment: Any) -> None:
        """Nothing to do."""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)


class _InnerLibrary(JITCodeLibrary):
    """The code of a kernel that only kernels call: linked together and left as it is.

    Numba optimizes every library with all it calls and makes machine code of it, once more at every level of calls.
    Of inner kernels neither is ever used: the entry that calls them is optimized as a whole.
    """

    @property
    def codegen(self) -> Any:
        return _NoEnvironment(self._codegen)

    def get_pointer_to_function(self, _name: str) -> int:
        self._ensure_finalized()
        return 0

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


class _EntryLibrary(JITCodeLibrary):
    """The code of an entry: what it calls is linked as its own ("internal"), which nothing else can reach.

    Numba links it as what other libraries may call, too ("linkonce_odr"): then LLVM can neither drop an argument that
    is never used nor pass one in another way.
    """

    def finalize(self) -> None:
        self._entries = {function.name for function in self.get_defined_functions()}
        super().finalize()

    def _optimize_final_module(self) -> None:
        for function in self.get_defined_functions():
            if function.name not in self._entries:
                function.linkage = "internal"
        super()._optimize_final_module()


class InnerCompiler(Compiler):
    """Numba's compiler, for kernels that only kernels call."""

    def __init__(self, typing_context: Any, target_context: Any, _library: Any, *rest: Any) -> None:
        library = _InnerLibrary(target_context.codegen(), "inner")
        library.enable_object_caching()
        super().__init__(typing_context, target_context, library, *rest)


class EntryCompiler(Compiler):
    """Numba's compiler, for entries."""

    def __init__(self, typing_context: Any, target_context: Any, _library: Any, *rest: Any) -> None:
        library = _EntryLibrary(target_context.codegen(), "entry")
        library.enable_object_caching()
        super().__init__(typing_context, target_context, library, *rest)

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        """Compile a function, and what it calls, without collecting garbage: a seventh of the time, and little is."""
        collects = gc.isenabled()
        gc.disable()
        try:
            return super().compile_extra(func)
        finally:
            if collects:
                gc.enable()
