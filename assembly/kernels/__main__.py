"""``python -m assembly.kernels``: which kernels are compiled, how large they are and where they came from."""

from __future__ import annotations

import argparse
import os
import sys

from assembly._kernel.folders import entry_folder
from assembly._kernel.targets import PORTABLE_VARIABLES, own_target, portable_target
from assembly.kernels.ahead import compile_all, default_workers
from assembly.kernels.listing import Item, all_items

ABOUT = """\
Lists the compiled kernels of this installation. A kernel that is not there is compiled when it is first needed;
--compile makes all of them ahead. ASSEMBLY_KERNELS=portable in the environment makes ones that run on any processor
of this machine's kind, which a disk image or a shared folder may need."""


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m assembly.kernels", description=ABOUT)
    parser.add_argument("--compile", action="store_true", help="compile what this machine would have to")
    parser.add_argument("--native", action="store_true", help="for this machine, where portable ones are there, too")
    parser.add_argument("--workers", type=int, default=default_workers(), help="processes; as many as processors, to 6")
    return parser


def _list(items: list[Item]) -> None:
    """Print a line a kernel, and the sum."""
    width = max(len(item.name) for item in items)
    total, count = 0, 0
    for item in items:
        found = item.found()
        if found is None:
            print(f"{item.name:{width}}         -  not compiled")
            continue
        path, target = found
        size = path.stat().st_size
        total, count = total + size, count + 1
        print(f"{item.name:{width}}  {size / 1e3:5.0f} kB  for {target[1]}")
    print(f"{count} of {len(items)} are compiled, {total / 1e6:.1f} MB, in {entry_folder()}")


def main(arguments: list[str]) -> int:
    """Run the command; 0, or 1 where kernels cannot be kept, or 2 for what it cannot do."""
    parser = _arguments()
    wanted = parser.parse_args(arguments)
    kind = os.environ.get("ASSEMBLY_KERNELS", "native")
    if kind not in ("native", "portable"):
        parser.error(f"ASSEMBLY_KERNELS is {kind!r}; expected native or portable")
    if wanted.workers < 1:
        parser.error(f"--workers is {wanted.workers}; expected at least 1")
    items = all_items()
    if not items:
        parser.error("NUMBA_DISABLE_JIT is set, so nothing is compiled")
    if not wanted.compile:
        _list(items)
        return 0
    if entry_folder() is None:
        parser.error("there is no folder to keep kernels in; set NUMBA_CACHE_DIR to one that can be written to")
    makes_portable = kind == "portable" and not wanted.native
    target = portable_target() if makes_portable else own_target()
    only_this = makes_portable or wanted.native

    def missing() -> list[Item]:
        return [item for item in items if (item.path(target) if only_this else item.found()) is None]

    wanting = missing()
    if wanting:
        compile_all(wanting, wanted.workers, PORTABLE_VARIABLES if makes_portable else {})
    unkept = missing()
    if unkept:
        print(f"{len(unkept)} kernels were compiled but could not be kept in {entry_folder()}", file=sys.stderr)
        return 1
    print(f"{len(items) - len(wanting)} kernels were compiled, {len(wanting)} are compiled now, in {entry_folder()}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
