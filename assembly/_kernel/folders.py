"""Where compiled entries are: in the user's cache, in the installed package, in the `build` folder of a checkout.

Each place has a folder a toolchain. What a process compiles is kept in the user's cache, or among the temporary files
where that cannot be written to.
"""

from __future__ import annotations

import functools
import logging
import os
import shutil
import stat
import tempfile
from dataclasses import dataclass
from pathlib import Path

from assembly._kernel.sources import PACKAGE
from assembly._kernel.toolchain import is_toolchain, toolchain

__all__ = ["BUILD", "SHIPPED", "Folder", "entry_folder", "folders_to_read", "other_toolchains"]

_LOG = logging.getLogger("assembly")
_FOLDERS_KEPT = 4
# Where an installed package has its entries, and where a build from a checkout leaves them.
SHIPPED = PACKAGE / "_entries"
BUILD = PACKAGE.parent / "build" / "kernels"
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


@dataclass(frozen=True)
class Folder:
    """A folder in which entries are looked for.

    Attributes
    ----------
    path
        The folder.
    origin
        Who keeps entries there, in words.
    """

    path: Path
    origin: str


def _user_folder() -> Path:
    """The user's cache."""
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    return Path(base or "~/.cache").expanduser().absolute() / "assembly"


def _temporary_folder() -> Path:
    """The same among the temporary files, and private: entries are unpickled, so nobody else may write them."""
    user = _user()
    folder = Path(tempfile.gettempdir()) / f"assembly-{user}"
    folder.mkdir(mode=0o700, exist_ok=True)
    status = folder.lstat()
    if os.name != "nt" and (not stat.S_ISDIR(status.st_mode) or status.st_uid != user or status.st_mode & 0o022):
        raise PermissionError(f"{folder} can be written by somebody else")
    return folder


def _user() -> int:
    return os.getuid() if hasattr(os, "getuid") else 0


def _writable_folder(name: str) -> Path | None:
    """A folder for the toolchain of this name that can be written to, or None."""
    for root in (_user_folder, _temporary_folder):
        try:
            folder = root() / name
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
            if is_toolchain(folder.name) and folder.is_dir():
                used.append((folder.stat().st_mtime, folder))
        except OSError:  # another process dropped it first
            continue
    for _, folder in sorted(used, reverse=True)[_FOLDERS_KEPT:]:
        shutil.rmtree(folder, ignore_errors=True)


@functools.cache
def entry_folder() -> Path | None:
    """The folder for what this process compiles, or None: then nothing is kept."""
    return _writable_folder(toolchain())


@functools.cache
def folders_to_read() -> tuple[Folder, ...]:
    """The folders in which this process looks for entries, first come first: the user's, the package's, a build's.

    The user's is among them also where it cannot be written to.
    """
    own = entry_folder()
    found = [Folder(_user_folder() / toolchain(), "user's cache")]
    if own is not None and own != found[0].path:
        found.append(Folder(own, "temporary files"))
    found += [Folder(root / toolchain(), origin) for root, origin in _installed() if _is_as_safe_as_the_package(root)]
    return tuple(folder for folder in found if folder.path.is_dir())


def _installed() -> list[tuple[Path, str]]:
    """Where an installation keeps entries for all its users."""
    is_checkout = (PACKAGE.parent / "pyproject.toml").is_file()
    return [(SHIPPED, "package"), *([(BUILD / "assembly", "build")] if is_checkout else [])]


def _is_as_safe_as_the_package(root: Path) -> bool:
    """Whether only those who may write the package, or this user, wrote what is in a folder of entries.

    Entries are unpickled and run, as the package's sources are: who may write the one may write the other.
    """
    if os.name == "nt":
        return True
    try:
        package = PACKAGE.stat()
        for path in (root.parent, root, root / toolchain(), *(root / toolchain()).iterdir()):
            status = path.lstat()
            theirs = status.st_uid not in (package.st_uid, _user())
            if theirs or stat.S_ISLNK(status.st_mode) or status.st_mode & _OTHERS_WRITE & ~package.st_mode:
                _LOG.warning("compiled kernels in %s are not used: somebody else can write them", root)
                return False
    except OSError:
        return False
    return True


def other_toolchains() -> list[str]:
    """The toolchains for which the installed package has entries, without the one that is here."""
    try:
        return sorted(path.name for path in SHIPPED.iterdir() if path.name != toolchain())
    except OSError:
        return []
