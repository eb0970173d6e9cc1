"""The processors that entries are compiled for: this machine's own, or any of a kind.

Code for x86-64-v3 (AVX2 and fused multiply-add, as most x86 processors have had for ten years) was measured to be as
fast as code for the machine itself, and runs on other machines, too.
"""

from __future__ import annotations

import functools
import platform

import llvmlite.binding as llvm

__all__ = ["PORTABLE_VARIABLES", "PROCESSOR", "Target", "targets_that_run"]

# Triple, processor and features, as Numba's code generator names what it compiles for.
Target = tuple[str, str, str]

_X86_64_V3 = (
    *("cx16", "sahf", "popcnt", "sse3", "sse4.1", "sse4.2", "ssse3"),
    *("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave"),
)
# The processor of portable entries.
PROCESSOR = "x86-64-v3" if platform.machine().lower() in ("x86_64", "amd64") else "generic"
# A process with these environment variables compiles for the portable target. Numba reads them when it is imported.
PORTABLE_VARIABLES = {"NUMBA_CPU_NAME": PROCESSOR, "NUMBA_CPU_FEATURES": ""}


@functools.cache
def _runs_portable_code() -> bool:
    features = llvm.get_host_cpu_features()
    return PROCESSOR == "generic" or all(features.get(name) for name in _X86_64_V3)


def targets_that_run(own: Target) -> list[Target]:
    """The targets whose entries run here, best first: the one that this process compiles for, and the portable one."""
    portable = (own[0], PROCESSOR, "")
    return [own, portable] if _runs_portable_code() and portable != own else [own]
