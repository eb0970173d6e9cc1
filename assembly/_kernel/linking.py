"""How kernels become machine code: what an entry calls is linked with it and optimized as a whole, once."""

from __future__ import annotations

import gc
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from typing import Any

from numba.core import event
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

from assembly._kernel.lowering import ENTRY, short_calls
from assembly._kernel.progress import counted, progress
from assembly._kernel.shortcuts import needed_passes, nothing_twice
from assembly._kernel.translation import quick_translation

__all__ = ["EntryCompiler", "InnerCompiler"]


class _NoEnvironment:
    """Numba's code generator, but that a kernel without code of its own has no place for its environment either."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def set_env(self, _name: str, _environment: Any) -> None:
        """Nothing to do."""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)


class _Library(JITCodeLibrary):
    """A library whose functions are simplified one by one, by the same passes.

    Numba makes a list of passes for every function, and runs it over those that are declared alone as well.
    """

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout
        passes, builder = self._codegen._function_pass_manager()
        for function in module.functions:
            if not function.is_declaration:
                passes.run(function, builder)


class _InnerLibrary(_Library):
    """The code of a kernel that only kernels call: left as it is until an entry links it.

    Numba links every library with all it calls, optimizes it and makes machine code of it, once more at every level of
    calls. For inner kernels that is work for nothing: the entry that calls them is linked and optimized as a whole.
    """

    _whole: Any = None

    @property
    def codegen(self) -> Any:
        return _NoEnvironment(self._codegen)

    def get_pointer_to_function(self, _name: str) -> int:
        self._ensure_finalized()
        return 0

    def finalize(self) -> None:
        self._finalized = True

    def own_module(self) -> Any:
        """Its functions alone, for being linked more than once."""
        return super()._get_module_for_linking()

    def _get_module_for_linking(self) -> Any:
        """The same with all it calls: what Numba's own libraries link, where a user's function calls the kernel."""
        if self._whole is None:
            self._whole = self.own_module().clone()
            for called in _reached(self):
                self._whole.link_in(called._get_module_for_linking(), preserve=True)
        return self._whole


class _OwnCode:
    """Stands for an inner library where all that it calls is linked as well."""

    def __init__(self, library: _InnerLibrary) -> None:
        self._reload_init = library._reload_init
        self._get_module_for_linking = library.own_module


def _reached(library: Any) -> list[Any]:
    """The libraries that one calls, and those that inner ones among them call, inner ones by their own code."""
    found: dict[Any, None] = {}
    waiting = [library]
    while waiting:
        for called in waiting.pop()._linking_libraries:
            if called not in found:
                found[called] = None
                if isinstance(called, _InnerLibrary):
                    waiting.append(called)
    return [_OwnCode(called) if isinstance(called, _InnerLibrary) else called for called in found]


class _EntryLibrary(_Library):
    """The code of an entry: what it calls is linked as its own ("internal"), which nothing else can reach.

    Numba links it as what other libraries may call, too ("linkonce_odr"): then LLVM can neither drop an argument that
    is never used nor pass one in another way.
    """

    def finalize(self) -> None:
        self._entries = {function.name for function in self.get_defined_functions()}
        self._linking_libraries = _reached(self)
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

    def define_pipelines(self) -> list[Any]:
        """The passes, in one list."""
        return [needed_passes(self.state)]

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        """Compile a function, and all that it calls and that is not compiled yet."""
        compiled = super().compile_extra(func)
        counted(func)
        return compiled


class EntryCompiler(Compiler):
    """Numba's compiler, for entries."""

    def __init__(self, typing_context: Any, target_context: Any, _library: Any, *rest: Any) -> None:
        library = _EntryLibrary(target_context.codegen(), ENTRY)
        library.enable_object_caching()
        super().__init__(typing_context, target_context, library, *rest)

    def compile_extra(self, func: Any) -> Any:
        """Compile a function and all that it calls."""
        with _nothing_else(), quick_translation(), nothing_twice(), short_calls(), progress(func):
            return super().compile_extra(func)


@contextmanager
def _nothing_else() -> Iterator[None]:
    """Meanwhile no garbage is collected, of which there is little, and Numba times no nested compilation.

    Numba starts two timers for each of them, which hear of every call of LLVM. Numba compiles under a lock, so only one
    thread at a time is here.
    """
    collects, timer, here = gc.isenabled(), event.install_timer, threading.get_ident()

    def install_timer(kind: str, callback: Callable[[float], None]) -> Any:
        # Another thread asks for its timer before it waits for the lock.
        return nullcontext() if threading.get_ident() == here else timer(kind, callback)

    gc.disable()
    event.install_timer = install_timer
    try:
        yield
    finally:
        event.install_timer = timer
        if collects:
            gc.enable()
