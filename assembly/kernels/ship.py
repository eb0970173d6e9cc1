"""``python -m assembly.kernels.ship FOLDER``: what a build of the package runs to put compiled kernels into it.

Kernels are compiled for the cache, which a build has in the checkout's ``build`` folder, so that the next build finds
what did not change; what goes into the package is the machine code alone.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from assembly._kernel.cache import write_machine_code
from assembly._kernel.targets import PORTABLE_VARIABLES, Target, own_target, portable_target
from assembly._kernel.toolchain import toolchain
from assembly.kernels.ahead import compile_all, default_workers
from assembly.kernels.listing import Item, all_items

__all__ = ["ship"]

# One core takes so many seconds to compile a kernel with all that it calls, where none of that is compiled yet.
_SECONDS_PER_ENTRY = 3.2


def _compile_missing(items: list[Item], target: Target, is_portable: bool) -> None:
    """Compile what the cache has not, and say so before and after."""
    missing = [item for item in items if item.compiled_for(target) is None]
    workers = default_workers()
    estimate = _SECONDS_PER_ENTRY * len(missing) / workers
    said = f"{len(items) - len(missing)} of {len(items)} kernels for {target[1]} are there from an earlier build"
    if not missing:
        print(said, flush=True)
        return
    print(f"{said}; compiling {len(missing)} in {workers} processes, about {estimate:.0f} s", flush=True)
    begin = time.monotonic()
    compile_all(missing, workers, PORTABLE_VARIABLES if is_portable else {})
    print(f"compiled {len(missing)} kernels in {time.monotonic() - begin:.0f} s", flush=True)


def ship(folder: Path, is_portable: bool) -> int:
    """Compile all kernels and write their machine code below a folder.

    Parameters
    ----------
    folder
        Where the package has its entries.
    is_portable
        For any processor of this machine's kind, not for this one.

    Returns
    -------
    int
        How many were written.

    Raises
    ------
    RuntimeError
        A kernel could not be compiled or kept, with its name.
    """
    items = all_items()
    target = portable_target() if is_portable else own_target()
    _compile_missing(items, target, is_portable)
    size = 0
    for item in items:
        form = item.compiled_for(target)
        if form is None:
            raise RuntimeError(f"{item.name} was compiled but could not be kept")
        shipped = folder / toolchain() / form.path.name
        write_machine_code(form.path, shipped)
        size += shipped.stat().st_size
    print(f"{len(items)} kernels for {target[1]} in the package, {size / 1e6:.1f} MB", flush=True)
    return len(items)


if __name__ == "__main__":
    ship(Path(sys.argv[1]), os.environ.get("ASSEMBLY_KERNELS") == "portable")
