"""The decorator `@kernel` and the list of entries that it makes."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from numba import njit
from numba.core import config
from numba.core.sigutils import normalize_signature

from assembly._kernel.cache import EntryCache, NoCache
from assembly._kernel.linking import EntryCompiler
from assembly._kernel.overloads import announce, make_callable
from assembly._kernel.sources import PACKAGE, source_of, sources_of

__all__ = ["ENTRIES", "Entry", "kernel"]


@dataclass(frozen=True)
class Entry:
    """A kernel of this package with machine code of its own.

    Attributes
    ----------
    compiled
        Numba's object, which is called.
    signatures
        The argument types with which the package calls it, one string per signature.
    """

    compiled: Any
    signatures: tuple[str, ...]

    def argument_types(self) -> list[tuple[Any, ...]]:
        """The argument types as Numba objects, one tuple per signature."""
        return [normalize_signature(signature)[0] for signature in self.signatures]


# All of them, by the functions that they compile; filled as modules are imported.
ENTRIES: dict[Callable[..., Any], Entry] = {}


def kernel(
    function: Callable[..., Any] | None = None,
    *,
    signatures: str | tuple[str, ...] = (),
    inline: bool = False,
    inner: bool = False,
    exact: bool = False,
    allocates: bool = False,
) -> Any:
    """Compile a function with the project's settings.

    Parameters
    ----------
    signatures
        For an entry: the argument types with which the package calls it, one string per signature in Numba's notation,
        as ``"(f8[::1], i8)"`` for a vector of doubles and an integer. These signatures are compiled ahead of time. A
        call with other types is compiled when it occurs; within this package such a call is a fault.
    inline
        Copied into its callers by LLVM: for small helpers. From Python it runs as plain Python.
    inner
        Called by other kernels only, and not copied into them: it has no entry from Python and no cache entry, which
        saves a quarter of its compile time. From Python it runs as plain Python.
    exact
        No fused multiply-add: for code whose rounding is part of a proof.
    allocates
        Whether a kernel creates arrays. One that does not is compiled without reference counts: its caller holds the
        arrays that it is given, and atomic counts in nested calls cost more than the work itself.

    Notes
    -----
    A kernel outside this package (a test's, a user's) is compiled in every process: its dependencies are not known.
    """
    if function is None:
        return lambda f: kernel(f, signatures=signatures, inline=inline, inner=inner, exact=exact, allocates=allocates)
    # Every setting that a kernel would inherit from its caller is set here: a kernel is compiled once, for its first
    # caller, and must be the same for all callers.
    settings: dict[str, Any] = {
        "fastmath": False if exact else {"contract"},
        "error_model": "numpy",
        "nogil": True,
        "forceinline": inline,
        "_nrt": allocates,
    }
    if inline or inner:
        announce(function, settings)
        return function
    compiled = njit(pipeline_class=EntryCompiler, **settings)(function)
    if config.DISABLE_JIT:
        return compiled
    compiled._cache = NoCache(make_callable)
    if compiled.py_func.__module__.partition(".")[0] == PACKAGE.name:
        ENTRIES[function] = Entry(compiled, (signatures,) if isinstance(signatures, str) else signatures)
        with suppress(OSError):  # there are no sources, or they cannot be read
            sources_of(source_of(compiled.py_func))  # now, while this file is imported
            compiled.py_func.kernel_settings = settings
            compiled._cache = EntryCache(compiled.py_func, make_callable, compiled)
    return compiled
