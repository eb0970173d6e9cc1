"""The processors that entries are compiled for: this machine's own, or any of a kind.

Code for x86-64-v3 (AVX2 and fused multiply-add, as most x86 processors have had for ten years) was measured to be as
fast as code for the machine itself, and runs on other machines, too.
"""

from __future__ import annotations

import functools
import platform
import re

import llvmlite.binding as llvm
from numba.core.registry import cpu_target

__all__ = [
    "PORTABLE_VARIABLES",
    "Target",
    "own_target",
    "portable_target",
    "refuse_portable",
    "targets_that_run",
    "why_portable_code_does_not_run",
]

# Triple, processor and features, as Numba's code generator names what it compiles for.
Target = tuple[str, str, str]

_X86_64_V3 = (
    *("cx16", "sahf", "popcnt", "sse3", "sse4.1", "sse4.2", "ssse3"),
    *("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave"),
)
# The processor of portable entries: any one that is not older than this.
_PROCESSOR = "x86-64-v3" if platform.machine().lower() in ("x86_64", "amd64") else "generic"
# A process with these environment variables compiles for the portable target. Numba reads them when it is imported.
PORTABLE_VARIABLES = {"NUMBA_CPU_NAME": _PROCESSOR, "NUMBA_CPU_FEATURES": ""}


@functools.cache
def why_portable_code_does_not_run() -> str:
    """What this processor lacks for portable code, in words; empty where it lacks nothing."""
    features = llvm.get_host_cpu_features() if _PROCESSOR != "generic" else {}
    lacking = [name for name in _X86_64_V3 if _PROCESSOR != "generic" and not features.get(name)]
    return f"this processor is without {', '.join(lacking)}" if lacking else ""


def own_target() -> Target:
    """What this process compiles for."""
    triple, processor, features = cpu_target.target_context.codegen().magic_tuple()
    # The release of macOS stands in its triples; code runs in the others, too.
    return re.sub(r"(darwin|macosx)[\d.]+$", r"\1", triple), processor, features


def portable_target() -> Target:
    """What processes compile for that have `PORTABLE_VARIABLES`."""
    return own_target()[0], _PROCESSOR, ""


# What `targets_that_run` leaves out.
_REFUSED: list[Target] = []


def refuse_portable() -> None:
    """Let this process run entries of its own target alone: what it has not is to be compiled, not borrowed."""
    _REFUSED.append(portable_target())


def targets_that_run() -> list[Target]:
    """The targets whose entries run here, best first: the one that this process compiles for, and the portable one."""
    own, portable = own_target(), portable_target()
    if portable == own or portable in _REFUSED or why_portable_code_does_not_run():
        return [own]
    return [own, portable]
