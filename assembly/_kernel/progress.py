"""Messages while kernels compile: how many, for what, about how long, and how far."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import CodeType, FunctionType
from typing import Any

from assembly._kernel.sources import closure_of

__all__ = ["announce_compilation", "counted", "progress"]

_LOG = logging.getLogger("assembly")
# Seconds a kernel, its part in what Numba and LLVM do for the whole entry included: 40 s for the 290 of a linkage.
_SECONDS_PER_KERNEL = 0.14
# Entries that take less are not worth a line each.
_SECONDS_TOLD = 2.0
# What kernels are for, by the folder of the package that they are in.
_PURPOSES = {
    "constraints": "constraints",
    "geometry": "curves and surfaces",
    "kinematics": "poses",
    "proximity": "contacts and distances",
    "solve": "solves",
    "tracking": "tracking",
}
# The kernels that this process has compiled, and the bars that are shown while it does: one, as Numba's lock has it.
_COMPILED: set[Callable[..., Any]] = set()
_BARS: list[Any] = []


def _names(code: CodeType) -> Iterator[str]:
    """The global names and attributes that a function's code uses, and the code of functions in it."""
    yield from code.co_names
    for part in code.co_consts:
        if isinstance(part, CodeType):
            yield from _names(part)


def _reached(function: FunctionType) -> set[FunctionType]:
    """A kernel and all kernels that it can call, by the names in their code."""
    found: set[FunctionType] = set()
    waiting = [function]
    while waiting:
        parts = [part for part in closure_of(waiting.pop()) if isinstance(part, FunctionType)]
        for part in parts:
            if part not in found and hasattr(part, "kernel_settings"):
                found.add(part)
                named = (part.__globals__.get(name) for name in _names(part.__code__))
                called = (getattr(value, "py_func", value) for value in named)
                waiting += [value for value in called if isinstance(value, FunctionType)]
    return found


def _missing(function: FunctionType) -> int:
    """How many kernels have to be compiled for an entry, itself included."""
    return len(_reached(function) - _COMPILED)


def announce_compilation(function: FunctionType, reason: str, kept_in: str) -> None:
    """Log that an entry is compiled now, unless it is a matter of a second or two."""
    count = _missing(function)
    seconds = _SECONDS_PER_KERNEL * count
    if seconds < _SECONDS_TOLD:
        return
    room = function.__module__.split(".")[1]
    purpose = f"{_PURPOSES.get(room, room)} ({function.__name__})"
    _LOG.warning("compiling %d kernels for %s, about %.0f s, once%s; %s", count, purpose, seconds, reason, kept_in)


@contextmanager
def progress(function: FunctionType) -> Iterator[None]:
    """Meanwhile an entry is compiled: show a bar in a terminal, unless the library's log is silenced."""
    count = _missing(function)
    if _SECONDS_PER_KERNEL * count < _SECONDS_TOLD or not sys.stderr.isatty() or not _LOG.isEnabledFor(logging.WARNING):
        yield
        counted(function)
        return
    from tqdm import tqdm

    with tqdm(desc="compiling", total=count, unit="kernel", leave=False) as bar:
        _BARS.append(bar)
        try:
            yield
            counted(function)
        finally:
            _BARS.remove(bar)


def counted(function: Callable[..., Any]) -> None:
    """Count a kernel as compiled."""
    if function not in _COMPILED:
        _COMPILED.add(function)
        for bar in _BARS:
            bar.update()
