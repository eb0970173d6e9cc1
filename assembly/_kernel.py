"""The one door to Numba: `@kernel`, and a cache that cannot be stale.

Kernels that kernels call are marked ``inline`` or ``inner``; the others are cached on disk, in a folder named by a hash
of all kernel sources, because Numba's own cache does not notice an edit in another file. An entry is one file with its
own checksum, so that no reader can meet a half-written or damaged one.
"""

from __future__ import annotations

import functools
import hashlib
import logging
import os
import pickle
import shutil
import stat
import sys
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import llvmlite
import llvmlite.binding as llvm
import numba
import numpy as np
from numba import njit, types
from numba.core import caching, config, serialize
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult
from numba.core.typing.templates import infer, infer_global, make_overload_template

__all__ = ["kernel"]

_PACKAGE = Path(__file__).resolve().parent
_LOG = logging.getLogger("assembly")
_STAMP_LENGTH = 24
_FOLDERS_KEPT = 4


def _source_stamp(package: Path) -> str | None:
    """Hash of every kernel source and of what compiles it; None where the sources cannot be read.

    A kernel source is a file of the package that names this module. Settings that change the machine code, and versions
    whose entries cannot be exchanged, are part of the hash.
    """
    toolchain = (sys.implementation.cache_tag, numba.__version__, llvmlite.__version__, np.__version__)
    settings = (config.OPT, config.BOUNDSCHECK, config.LOOP_VECTORIZE, config.SLP_VECTORIZE)
    digest = hashlib.sha256(repr((toolchain, settings)).encode())
    found = False
    for path in sorted(package.rglob("*.py")):
        text = path.read_bytes()
        if b"_kernel" in text:
            found = True
            digest.update(path.relative_to(package).as_posix().encode() + b"\0" + text + b"\0")
    return digest.hexdigest()[:_STAMP_LENGTH] if found else None


def _user_folder() -> Path:
    """The user's cache."""
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    return Path(base or os.path.expanduser("~/.cache")) / "assembly"


def _temporary_folder() -> Path:
    """The same among the temporary files, and private: entries are unpickled, so nobody else may write them."""
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = Path(tempfile.gettempdir()) / f"assembly-{user}"
    folder.mkdir(mode=0o700, exist_ok=True)
    status = folder.lstat()
    if os.name != "nt" and (not stat.S_ISDIR(status.st_mode) or status.st_uid != user or status.st_mode & 0o022):
        raise PermissionError(f"{folder} can be written by somebody else")
    return folder


def _cache_folder(stamp: str | None) -> Path | None:
    """A writable folder for this stamp, or None: then kernels are compiled in every process."""
    if stamp is None:
        return None
    for root in (_user_folder, _temporary_folder):
        try:
            folder = root() / stamp
            is_new = not folder.exists()
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                os.utime(folder)  # the time of last use, by which old folders are dropped
        except OSError as error:
            _LOG.info("no kernel cache there: %s", error)
            continue
        if is_new:
            _drop_old_folders(folder.parent)
        return folder
    return None


def _drop_old_folders(root: Path) -> None:
    """Keep the few stamps used last. A process that still uses a dropped one compiles again."""
    used: list[tuple[float, Path]] = []
    for folder in root.iterdir():
        try:
            if len(folder.name) == _STAMP_LENGTH and folder.is_dir():
                used.append((folder.stat().st_mtime, folder))
        except OSError:  # another process dropped it first
            continue
    for _, folder in sorted(used, reverse=True)[_FOLDERS_KEPT:]:
        shutil.rmtree(folder, ignore_errors=True)


_FOLDER = _cache_folder(_source_stamp(_PACKAGE))


class _Cache(caching._Cache):
    """The compiled forms of one kernel on disk: a checksum, then what Numba needs to load it.

    One file a signature, found by name and replaced as a whole: processes that run at the same
    time can at worst write the same entry twice. Whatever is wrong with an entry, the answer is to
    compile again.
    """

    _announced = False
    # What an entry holds of its code for others to link to: nothing, until one does.
    _no_code = b""

    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        self._function = function
        self._folder = folder

    @property
    def cache_path(self) -> str:
        return str(self._folder)

    def enable(self) -> None:
        """Nothing to do: whether a kernel is cached is decided when it is made."""

    def disable(self) -> None:
        """Nothing to do, as in `enable`."""

    def flush(self) -> None:
        for path in self._folder.glob(f"{self._title()}-*"):
            path.unlink(missing_ok=True)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        target_context.refresh()
        path = self._path(sig, target_context.codegen())
        try:
            entry = path.read_bytes()
            payload = entry[32:]
            if hashlib.sha256(payload).digest() != entry[:32]:
                raise ValueError("the checksum does not fit")
            return self._rebuilt(target_context, *pickle.loads(payload))
        except FileNotFoundError:
            if not _Cache._announced:
                _Cache._announced = True
                _LOG.warning("compiling kernels for the first time (some seconds; kept in %s)", self._folder)
        except Exception as error:  # loading is a shortcut: nothing that goes wrong in it may stop a solve
            _LOG.warning("compiling %s again: its cache entry %s is damaged (%s)", self._title(), path, error)
        _make_callable()
        return None

    @classmethod
    def _rebuilt(cls, target_context: Any, library: Any, names: Any, *rest: Any) -> Any:
        """A kernel from its parts, as Numba does it, but that bitcode is not read unless another kernel links to it."""
        name, kind, (machine_code, bitcode) = library
        cls._no_code = cls._no_code or llvm.parse_assembly("").as_bitcode()
        # What Numba would read from there.
        symbols = (names.llvm_func_name, names.llvm_cpython_wrapper_name, names.llvm_cfunc_wrapper_name)
        target_context.codegen()._engine._defined_symbols.update(symbols)
        parts = (name, kind, (machine_code, cls._no_code))
        result = CompileResult._rebuild(target_context, parts, names, *rest)
        result.library._get_module_for_linking = functools.cache(lambda: llvm.parse_bitcode(bitcode))
        return result

    def save_overload(self, sig: Any, data: Any) -> None:
        if data.library.has_dynamic_globals:
            warnings.warn(f"{self._title()} uses an address or a large global array and is not cached", stacklevel=2)
            return
        payload = serialize.dumps(data._reduce())
        path = self._path(sig, data.codegen)
        try:
            self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            handle, unfinished = tempfile.mkstemp(dir=self._folder)
            try:
                with os.fdopen(handle, "wb") as file:
                    file.write(hashlib.sha256(payload).digest() + payload)
                os.replace(unfinished, path)
            except OSError:
                os.unlink(unfinished)
                raise
        except OSError as error:
            _LOG.info("%s is not cached: %s", self._title(), error)

    def _title(self) -> str:
        name = f"{self._function.__module__}.{self._function.__qualname__}"
        return f"{name.replace('<', '').replace('>', '')}-{self._function.__code__.co_firstlineno}"

    def _path(self, sig: Any, codegen: Any) -> Path:
        """The entry of a signature; a kernel made by a factory also depends on what it closes over."""
        closed_over = [cell.cell_contents for cell in self._function.__closure__ or ()]
        key = repr((sig, codegen.magic_tuple())).encode() + self._function.__code__.co_code
        key += serialize.dumps(closed_over)
        return self._folder / f"{self._title()}-{hashlib.sha256(key).hexdigest()[:32]}"


class _NoCache(caching.NullCache):
    """Of a kernel that every process compiles."""

    def load_overload(self, _sig: Any, _target_context: Any) -> None:
        _make_callable()


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


class _InnerCompiler(Compiler):
    """Numba's compiler, with such a library."""

    def __init__(self, typing_context: Any, target_context: Any, _library: Any, *rest: Any) -> None:
        library = _InnerLibrary(target_context.codegen(), "inner")
        library.enable_object_caching()
        super().__init__(typing_context, target_context, library, *rest)


class _OncePerSignature(dict[Any, Any]):
    """Numba keys what it has compiled for kernels by types and by the caller's flags. Ours have flags of their own.

    Without this a kernel is compiled up to three times: for inline callers, for inner ones, for those that make arrays.
    """

    def __getitem__(self, key: Any) -> Any:
        return super().__getitem__(key[:-1])

    def __setitem__(self, key: Any, value: Any) -> None:
        super().__setitem__(key[:-1], value)


@functools.cache
def _trust_indices() -> None:
    """Have kernels of this package take an index into an array as it stands; it is never negative.

    Numba lets one count from the end. To look whether it does takes a fifth of a large factorization, and a tenth of
    what there is to compile. With `NUMBA_BOUNDSCHECK=1` a negative index is an error, as is one past the end.
    """
    from numba.np import arrayobj

    counting = arrayobj.fix_integer_index
    ours = f"_ZN{len(_PACKAGE.name)}{_PACKAGE.name}"

    def as_it_stands(context: Any, builder: Any, kind: Any, index: Any, size: Any) -> Any:
        if builder.function.name.startswith(ours):
            return context.cast(builder, index, kind, types.intp)
        return counting(context, builder, kind, index, size)

    arrayobj.fix_integer_index = as_it_stands


# Functions that kernels may call, and how they are compiled, of which Numba has not been told.
_WAITING: list[tuple[Callable[..., Any], dict[str, Any]]] = []


def _make_callable() -> None:
    """Tell Numba of all functions that kernels may call: when it is to compile one, and not before."""
    _trust_indices()
    while _WAITING:
        _callable_from_kernels(*_WAITING[-1])
        del _WAITING[-1]


def _callable_from_kernels(function: Callable[..., Any], settings: dict[str, Any]) -> None:
    """Let kernels call a function, compiled by these settings; in Python it stays what it is."""
    options = {
        "no_cpython_wrapper": True,
        "no_cfunc_wrapper": True,
        "nopython": True,
        "pipeline_class": _InnerCompiler,
        **settings,
    }

    def implementation(*_arguments: Any, **_keywords: Any) -> Callable[..., Any]:
        return function

    template = make_overload_template(function, implementation, options, False, "never", False)
    template._impl_cache = _OncePerSignature()
    infer(template)
    infer_global(function, types.Function(template))


def kernel(
    function: Callable[..., Any] | None = None,
    *,
    inline: bool = False,
    inner: bool = False,
    exact: bool = False,
    allocates: bool = False,
) -> Any:
    """Compile a function with the project's settings.

    Parameters
    ----------
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
    A kernel outside this package (a test's, a user's) is compiled in every process: the stamp of
    the cache knows nothing of its source.
    """
    if function is None:
        return lambda f: kernel(f, inline=inline, inner=inner, exact=exact, allocates=allocates)
    fastmath: Any = False if exact else {"contract"}
    settings: dict[str, Any] = {"fastmath": fastmath, "error_model": "numpy", "nogil": True}
    if inline or inner:
        _WAITING.append((function, {**settings, "forceinline": inline, "_nrt": allocates}))
        return function
    compiled = njit(**settings)(function)
    if not config.DISABLE_JIT:
        stamped = _PACKAGE in Path(function.__code__.co_filename).resolve().parents
        compiled._cache = _Cache(function, _FOLDER) if stamped and _FOLDER is not None else _NoCache()
    return compiled
