"""The decorator `@kernel` and the list of entries that it makes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from numba import njit
from numba.core import config

from assembly._kernel.cache import EntryCache, NoCache
from assembly._kernel.folders import entry_folder
from assembly._kernel.linking import EntryCompiler
from assembly._kernel.overloads import announce, make_callable
from assembly._kernel.sources import PACKAGE, source_of, sources_of

__all__ = ["ENTRIES", "Entry", "kernel"]


@dataclass(frozen=True)
class Entry:
    """A kernel with machine code of its own.

    Attributes
    ----------
    compiled
        Numba's object, which is called.
    signatures
        The types of arguments for which the package calls it, as Numba writes them.
    """

    compiled: Any
    signatures: tuple[str, ...]


# By the function that is compiled.
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
        Of an entry: the types of arguments for which the package calls it, one string each, as in
        ``"(float64[::1], int64)"``. They say what can be compiled ahead. A call with other types is compiled when it
        comes.
    inline
        Copied into its callers by LLVM: for small helpers. From Python it runs as plain Python.
    inner
        Called by kernels alone, and not copied: no entry from Python and no cache entry, which saves a quarter
        of its compile time. From Python it runs as plain Python.
    exact
        No fused multiply-add: for code whose rounding is part of a proof.
    allocates
        Whether an inline or inner kernel makes arrays. One that does not counts no references to those it is given,
        which its caller holds: the atomic counts of nested calls cost more than their work.

    Notes
    -----
    A kernel outside this package (a test's, a user's) is compiled in every process: what it depends on is not known.
    """
    if function is None:
        return lambda f: kernel(f, signatures=signatures, inline=inline, inner=inner, exact=exact, allocates=allocates)
    fastmath: Any = False if exact else {"contract"}
    settings: dict[str, Any] = {"fastmath": fastmath, "error_model": "numpy", "nogil": True}
    if inline or inner:
        announce(function, {**settings, "forceinline": inline, "_nrt": allocates})
        return function
    compiled = njit(pipeline_class=EntryCompiler, **settings)(function)
    if not config.DISABLE_JIT:
        compiled._cache = _cache_of(function)
        ENTRIES[function] = Entry(compiled, (signatures,) if isinstance(signatures, str) else signatures)
    return compiled


def _cache_of(function: Any) -> EntryCache | NoCache:
    """Where the machine code of an entry is kept."""
    path, folder = source_of(function), entry_folder()
    try:
        if PACKAGE in path.parents and folder is not None:
            sources_of(path)  # read now, so that the cache knows what this process imported
            return EntryCache(function, folder, make_callable)
    except OSError:  # there are no sources, or they cannot be read
        pass
    return NoCache(make_callable)
