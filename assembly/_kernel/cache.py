"""Compiled entries on disk: one file for every signature and state of the sources, with a checksum of its own.

Numba's own cache has an index file a function and looks at the function's own file alone. Here an entry is found by its
name, so that processes which run at the same time can at worst write the same entry twice. Whatever is wrong with an
entry, the answer is to compile again.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import logging
import os
import pickle
import tempfile
import time
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from types import FunctionType
from typing import Any

import llvmlite.binding as llvm
from numba.core import caching, serialize
from numba.core.compiler import CompileResult
from numba.core.runtime import rtsys
from numba.core.sigutils import normalize_signature

from assembly._kernel.folders import SHIPPED, entry_folder, folders_to_read, other_toolchains
from assembly._kernel.progress import announce_compilation
from assembly._kernel.sources import closure_of, source_stamp
from assembly._kernel.targets import Target, own_target, targets_that_run, why_portable_code_does_not_run
from assembly._kernel.toolchain import toolchain

__all__ = ["EntryCache", "NoCache", "read_entry", "write_entry", "write_machine_code"]

_LOG = logging.getLogger("assembly")
_CHECKSUM = hashlib.sha256().digest_size
_HASH_LENGTH = 16
# So many states of the sources are kept of every signature, those used last: branches that one goes between.
_STATES_KEPT = 4
# Files of this name that are older than so many seconds were left by a process that was ended.
_UNFINISHED, _ENDED = "unfinished-", 3600.0


def _description(value: object) -> object:
    """What a kernel made by a factory closes over: functions by name, as the stamp has their sources."""
    if isinstance(value, FunctionType):
        return value.__module__, value.__qualname__
    return (type(value), len(value)) if isinstance(value, tuple) else serialize.dumps(value)


def read_entry(path: Path) -> bytes:
    """What an entry holds.

    Raises
    ------
    OSError
        There is none, or it cannot be read.
    ValueError
        Its checksum does not fit.
    """
    entry = path.read_bytes()
    payload = entry[_CHECKSUM:]
    if hashlib.sha256(payload).digest() != entry[:_CHECKSUM]:
        raise ValueError("the checksum does not fit")
    return payload


def write_entry(path: Path, payload: bytes) -> None:
    """Write an entry so that no process reads half of it.

    Raises
    ------
    OSError
        It cannot be written there.
    """
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=path.parent, prefix=_UNFINISHED, delete=False) as file:
        try:
            file.write(hashlib.sha256(payload).digest() + payload)
            file.close()
            os.chmod(file.name, 0o644)  # others may read it, as where one user compiles for all
            os.replace(file.name, path)
        except BaseException:
            os.unlink(file.name)
            raise


def write_machine_code(source: Path, target: Path) -> None:
    """Copy an entry without its bitcode, two thirds of it, which only kernels of other packages would link to.

    Raises
    ------
    OSError, ValueError
        It cannot be written there; the source is not there or damaged.
    """
    (name, kind, (machine_code, _)), *rest = pickle.loads(read_entry(source))
    write_entry(target, serialize.dumps(((name, kind, (machine_code, b"")), *rest)))


class EntryCache(caching._Cache):
    """The compiled forms of one kernel on disk."""

    # What a loaded entry holds of its code for others to link to: nothing, until one does.
    _no_code = b""

    def __init__(self, function: FunctionType, prepare: Callable[[], None], compiled: Any) -> None:
        self._function = function
        self._prepare = prepare
        self._compiler = compiled._compiler
        self._title = f"{function.__module__}.{function.__qualname__}".replace("<", "").replace(">", "")

    @property
    def cache_path(self) -> str:
        return str(entry_folder() or "")

    def enable(self) -> None:
        """Nothing to do: whether a kernel is cached is decided when it is made."""

    def disable(self) -> None:
        """Nothing to do, as in `enable`."""

    def flush(self) -> None:
        folder = entry_folder()
        for path in folder.glob(f"{self._title}-*") if folder else ():
            with contextlib.suppress(OSError):
                path.unlink()

    def paths(self, sig: Any, target: Target) -> list[Path]:
        """Where the entry of a signature for a target may be."""
        if self._stamp is None:
            return []
        return [folder.path / f"{self._variant(sig, target)}-{self._stamp}" for folder in folders_to_read()]

    @functools.cached_property
    def _stamp(self) -> str | None:
        stamp = source_stamp(self._function)
        return stamp and stamp[:_HASH_LENGTH]

    def _variant(self, sig: Any, target: Target) -> str:
        """What tells entries of one function apart: types of arguments, processor, what it closes over."""
        closed_over = [_description(value) for value in closure_of(self._function)]
        key = repr((normalize_signature(sig), target, closed_over)).encode()
        return f"{self._title}-{target[1]}-{hashlib.sha256(key).hexdigest()[:_HASH_LENGTH]}"

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        # What machine code calls is there then; all else that Numba's own cache has loaded is for who compiles.
        rtsys.initialize(target_context)
        for path in (path for target in targets_that_run() for path in self.paths(sig, target)):
            try:
                return self._load(path, sig, target_context)
            except FileNotFoundError:
                continue
            except Exception as error:  # loading is a shortcut: nothing that goes wrong in it may stop a solve
                _LOG.warning("the compiled form of %s is damaged: %s (%s)", self._title, path, error)
        self._prepare()
        folder = entry_folder()
        kept_in = f"kept in {folder}" if folder and self._stamp else "not kept"
        announce_compilation(self._function, self._why_nothing_shipped_fits(), kept_in)
        return None

    def _why_nothing_shipped_fits(self) -> str:
        """Why the entry that came with the package is of no use here, for a log line; empty if none came."""
        folder, others = SHIPPED / toolchain(), other_toolchains()
        if not folder.is_dir():
            return f" (those of the package are for {', '.join(others)}, not for {toolchain()})" if others else ""
        ends = f"-{self._stamp}"
        found = [path.name.removeprefix(f"{self._title}-") for path in folder.glob(f"{self._title}-*{ends}")]
        processors = sorted({name.removesuffix(ends)[: -_HASH_LENGTH - 1] for name in found})
        if processors:
            here = why_portable_code_does_not_run() or f"this one is {own_target()[1]}"
            return f" (those of the package are for processors {', '.join(processors)}; {here})"
        return " (those of the package were made from other sources)"

    def _load(self, path: Path, sig: Any, target_context: Any) -> Any:
        loaded = self._rebuilt(target_context, sig, *pickle.loads(read_entry(path)))
        if path.parent == entry_folder():
            with contextlib.suppress(OSError):
                os.utime(path)  # the time of last use
        return loaded

    def _rebuilt(self, target_context: Any, sig: Any, library: Any, names: Any, *rest: Any) -> Any:
        """A kernel from its parts, as Numba does it, but that bitcode is not read unless another kernel links to it."""
        name, kind, (machine_code, bitcode) = library
        EntryCache._no_code = EntryCache._no_code or llvm.parse_assembly("").as_bitcode()
        # What Numba would read from there.
        symbols = (names.llvm_func_name, names.llvm_cpython_wrapper_name, names.llvm_cfunc_wrapper_name)
        target_context.codegen()._engine._defined_symbols.update(symbols)
        parts = (name, kind, (machine_code, self._no_code))
        result = CompileResult._rebuild(target_context, parts, names, *rest)

        @functools.cache
        def module_for_linking() -> Any:
            return llvm.parse_bitcode(bitcode) if bitcode else self._compiled_again(sig, names.llvm_func_name)

        result.library._get_module_for_linking = module_for_linking
        return result

    def _compiled_again(self, sig: Any, name: str) -> Any:
        """The code of an entry that was loaded without it, for another kernel to link to, by the name it was loaded by.

        Numba gives a function another name every time it compiles it.
        """
        self._prepare()
        again = self._compiler.compile(*normalize_signature(sig))
        module = again.library._get_module_for_linking().clone()
        module.get_function(again.fndesc.llvm_func_name).name = name
        return module

    def save_overload(self, sig: Any, data: Any) -> None:
        if data.library.has_dynamic_globals:
            warnings.warn(f"{self._title} uses an address or a large global array and is not cached", stacklevel=2)
            return
        folder = entry_folder()
        if folder is None or self._stamp is None:
            return
        variant = self._variant(sig, own_target())
        try:
            write_entry(folder / f"{variant}-{self._stamp}", serialize.dumps(data._reduce()))
            _drop(_by_age(folder.glob(f"{variant}-*"))[_STATES_KEPT:])
            _drop([one for one in _by_age(folder.glob(f"{_UNFINISHED}*")) if one[0] < time.time() - _ENDED])
        except OSError as error:
            _LOG.info("%s is not cached: %s", self._title, error)


def _by_age(paths: Iterable[Path]) -> list[tuple[float, Path]]:
    """Times of last use and files, the youngest first."""
    used: list[tuple[float, Path]] = []
    for path in paths:
        with contextlib.suppress(OSError):  # another process dropped it first
            used.append((path.stat().st_mtime, path))
    return sorted(used, reverse=True)


def _drop(used: Iterable[tuple[float, Path]]) -> None:
    """Remove files, as far as this process may."""
    for _, path in used:
        with contextlib.suppress(OSError):
            path.unlink()


class NoCache(caching.NullCache):
    """Of a kernel that every process compiles."""

    def __init__(self, prepare: Callable[[], None]) -> None:
        self._prepare = prepare

    def load_overload(self, _sig: Any, _target_context: Any) -> None:
        self._prepare()
