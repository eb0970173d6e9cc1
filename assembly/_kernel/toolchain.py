"""The toolchain that compiles kernels, as a name: entries of one name can be exchanged, others cannot."""

from __future__ import annotations

import functools
import hashlib
import re
import sys

import llvmlite
import numba
from numba.core import config

__all__ = ["is_toolchain", "toolchain"]

_SETTINGS = (
    *("OPT", "BOUNDSCHECK", "LOOP_VECTORIZE", "SLP_VECTORIZE", "DEBUGINFO_DEFAULT"),
    *("USING_SVML", "DISABLE_INTEL_SVML", "LLVM_REFPRUNE_PASS", "LLVM_REFPRUNE_FLAGS"),
)
_NAME = re.compile(r"[\w.-]+-numba\d+\.\d+-llvmlite\d+\.\d+-[0-9a-f]{8}")


def _minor(version: str) -> str:
    return ".".join(version.split(".")[:2])


@functools.cache
def toolchain() -> str:
    """The name: minor versions of Python, Numba and llvmlite, and a hash of the settings that change machine code.

    Entries of one patch release load in another (tested), and no entry depends on NumPy: its arrays are read by their
    layout in memory, through Numba's own library.
    """
    settings = [getattr(config, name, None) for name in _SETTINGS]
    digest = hashlib.sha256(repr((settings, sys.flags.optimize)).encode()).hexdigest()[:8]
    python = sys.implementation.cache_tag
    return f"{python}-numba{_minor(numba.__version__)}-llvmlite{_minor(llvmlite.__version__)}-{digest}"


def is_toolchain(name: str) -> bool:
    """Whether a folder of this name was made for the entries of a toolchain."""
    return _NAME.fullmatch(name) is not None
