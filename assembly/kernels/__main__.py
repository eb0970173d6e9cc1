"""``python -m assembly.kernels``: which kernels are compiled, how large they are, and for which processor."""

from __future__ import annotations

import argparse
import os
import sys

from assembly._kernel.folders import entry_folder, folders_to_read
from assembly._kernel.targets import PORTABLE_VARIABLES, own_target, portable_target
from assembly.kernels.ahead import compile_all, default_workers
from assembly.kernels.listing import Item, all_items

ABOUT = """\
Lists the compiled kernels of this installation: their sizes, the processors that they are for, where they are kept. A
kernel that is not there is compiled when it is first needed; --compile makes all of them ahead.
ASSEMBLY_KERNELS=portable in the environment makes ones for every processor of this machine's kind (of x86-64: every one
with AVX2 and FMA)."""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m assembly.kernels", description=ABOUT)
    parser.add_argument("--compile", action="store_true", help="compile what this machine would have to")
    parser.add_argument("--native", action="store_true", help="for this machine, where portable ones are there, too")
    parser.add_argument("--workers", type=int, help=f"processes; here {default_workers()} if it is not given")
    return parser


def _folders() -> str:
    """Where kernels are looked for."""
    return ", ".join(str(folder.path) for folder in folders_to_read()) or "no folder"


def _show(items: list[Item]) -> None:
    """Print one line per kernel, and the sum."""
    width = max(len(item.name) for item in items)
    total, count = 0, 0
    for item in items:
        found = item.found()
        if found is None:
            print(f"{item.name:{width}}         -  not compiled")
            continue
        total, count = total + found.size, count + 1
        print(f"{item.name:{width}}  {found.size / 1e3:5.0f} kB  for {found.target[1]}, {found.origin}")
    print(f"{count} of {len(items)} are compiled, {total / 1e6:.1f} MB, in {_folders()}")


def _compile(items: list[Item], workers: int, portable: bool, native: bool) -> int:
    """Compile what is missing, for one target or for any that runs; 0, or 1 where it cannot be kept."""

    def missing() -> list[Item]:
        if portable or native:
            target = portable_target() if portable else own_target()
            return [item for item in items if item.compiled_for(target) is None]
        return [item for item in items if item.found() is None]

    wanting = missing()
    if wanting:
        compile_all(wanting, workers, PORTABLE_VARIABLES if portable else {})
    unkept = missing()
    if unkept:
        print(f"{len(unkept)} kernels were compiled but could not be kept in {entry_folder()}", file=sys.stderr)
        return 1
    print(f"{len(wanting)} kernels compiled, {len(items) - len(wanting)} were there, in {_folders()}")
    return 0


def main(arguments: list[str]) -> int:
    """Run the command; 0, or 1 where kernels cannot be kept, or 2 for what it cannot do."""
    parser = _parser()
    wanted = parser.parse_args(arguments)
    kind = os.environ.get("ASSEMBLY_KERNELS") or "native"
    if kind not in ("native", "portable"):
        parser.error(f"ASSEMBLY_KERNELS is {kind!r}; expected native or portable")
    if not wanted.compile and (wanted.native or wanted.workers is not None):
        parser.error("--native and --workers say how to compile; expected --compile with them")
    workers = default_workers() if wanted.workers is None else wanted.workers
    if workers < 1:
        parser.error(f"--workers is {workers}; expected at least 1")
    items = all_items()
    if not items:
        parser.error("nothing is compiled: NUMBA_DISABLE_JIT is set, or the library's sources are not there")
    if not wanted.compile:
        _show(items)
        return 0
    if entry_folder() is None:
        parser.error("there is no folder to keep kernels in; set NUMBA_CACHE_DIR to one that can be written to")
    return _compile(items, workers, kind == "portable" and not wanted.native, wanted.native)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
