"""Where compiled entries are kept: a folder a toolchain in the user's cache, or among the temporary files."""

from __future__ import annotations

import functools
import hashlib
import logging
import os
import shutil
import stat
import sys
import tempfile
from pathlib import Path

import llvmlite
import numba
import numpy as np
from numba.core import config

__all__ = ["entry_folder", "folders_to_read"]

_LOG = logging.getLogger("assembly")
_NAME_LENGTH = 24
_FOLDERS_KEPT = 4


@functools.cache
def _toolchain() -> str:
    """Hash of what compiles: versions whose entries cannot be exchanged, and settings that change the machine code."""
    versions = (sys.implementation.cache_tag, numba.__version__, llvmlite.__version__, np.__version__)
    names = (
        *("OPT", "BOUNDSCHECK", "LOOP_VECTORIZE", "SLP_VECTORIZE", "DEBUGINFO_DEFAULT"),
        *("USING_SVML", "DISABLE_INTEL_SVML", "LLVM_REFPRUNE_PASS", "LLVM_REFPRUNE_FLAGS"),
    )
    settings = [getattr(config, name, None) for name in names]
    return hashlib.sha256(repr((versions, settings, sys.flags.optimize)).encode()).hexdigest()[:_NAME_LENGTH]


def _user_folder() -> Path:
    """The user's cache."""
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    return Path(base or "~/.cache").expanduser().absolute() / "assembly"


def _temporary_folder() -> Path:
    """The same among the temporary files, and private: entries are unpickled, so nobody else may write them."""
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = Path(tempfile.gettempdir()) / f"assembly-{user}"
    folder.mkdir(mode=0o700, exist_ok=True)
    status = folder.lstat()
    if os.name != "nt" and (not stat.S_ISDIR(status.st_mode) or status.st_uid != user or status.st_mode & 0o022):
        raise PermissionError(f"{folder} can be written by somebody else")
    return folder


def _writable_folder(toolchain: str) -> Path | None:
    """A folder for this toolchain that can be written to, or None."""
    for root in (_user_folder, _temporary_folder):
        try:
            folder = root() / toolchain
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
    """Keep the few toolchains used last. A process that still uses a dropped one compiles again."""
    used: list[tuple[float, Path]] = []
    for folder in root.iterdir():
        try:
            if len(folder.name) == _NAME_LENGTH and folder.is_dir():
                used.append((folder.stat().st_mtime, folder))
        except OSError:  # another process dropped it first
            continue
    for _, folder in sorted(used, reverse=True)[_FOLDERS_KEPT:]:
        shutil.rmtree(folder, ignore_errors=True)


@functools.cache
def entry_folder() -> Path | None:
    """The folder for what this process compiles, or None: then nothing is kept."""
    return _writable_folder(_toolchain())


@functools.cache
def folders_to_read() -> tuple[Path, ...]:
    """The folders in which this process looks for entries: the user's, also where it cannot be written to, first."""
    users, own = _user_folder() / _toolchain(), entry_folder()
    found = [users] if users.is_dir() else []
    return tuple(found if own is None or own in found else [*found, own])
