"""The work of fixed solves, ticks and queries, counted: no clock, so that a change which makes more of it is found.

Kernels run as plain Python, where the calls of a function can be counted, and then compiled for any processor of this
kind, under Callgrind where it is installed. ``python -m benchmarks.counts HOW FILE`` is a process that counts.
"""

from __future__ import annotations

import gc
import json
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from cProfile import Profile
from importlib import import_module, metadata
from pathlib import Path
from typing import Any

from benchmarks import callgrind

__all__ = ["COUNTS", "INSTRUCTIONS", "STORED", "count_all", "lines", "section"]

Work = dict[str, dict[str, int]]
ROOT = Path(__file__).resolve().parent.parent
STORED = ROOT / "benchmarks" / "results" / "counts.json"
# Functions whose calls are counted, by what a call of them is.
PLAIN: dict[str, tuple[str, ...]] = {
    "row evaluations": ("constraints.program.evaluate.evaluate",),
    "factorizations": ("solve.linear_algebra.factorize.factorize",),
    "surface points": ("geometry.splines.evaluate.surface_lanes",),
    # Of the distance, or the gap, of two pieces, two nodes of trees, or two parts of centerlines.
    "bounds": (
        "distance.curves.search.pair_bound",
        "distance.curves.squared_distance.least_quotient",
        "distance.enclosures.search.pair_bound",
        "distance.bodies.search.pair_bound",
        "distance.patches.search.pair_bound",
        "distance.batch.filter.is_apart",
        "proximity.features.global_search.node_bound",
        "proximity.bvh.tree.admits",
        "proximity.bvh.box_descent.box_distance",
        "proximity.manager.centerlines.box.box_of",
        "proximity.manager.centerlines.parts.parts_apart",
    ),
}
TOLD = ("iterations", "evaluations")
COUNTS = (*PLAIN, *TOLD)
INSTRUCTIONS = "instructions"
# Calls before the one whose instructions are counted. Python 3.11 replaces the instructions of a function by special
# ones in its first eight calls or so: what one call executes differs by 3 percent until then, and by 0.2 afterwards.
BEFORE = 16
ABOUT = """\
Calls of functions, counted in kernels that run as plain Python; iterations, and evaluations of queries, as compiled
code tells them; instructions of one call from Python, in kernels for any processor, by Callgrind, after 16 calls of its
kind. `python -m benchmarks --only counts --gate` fails where one of them became more."""


def count_all() -> dict[str, Any]:
    """All counts, with what they depend on; under "missing" why instructions are not counted here."""
    missing = callgrind.why_not()
    with tempfile.TemporaryDirectory() as folder:
        parts = [_count_apart(how, Path(folder)) for how in ("plain", "compiled")]
        if not missing:
            parts.append(_count_apart("instructions", Path(folder)))
    work: Work = {case: {} for case in parts[0]}
    for part in parts:
        for case, counts in part.items():
            work[case] |= counts
    return {"stamp": stamp(), "missing": missing, "work": work}


def stamp() -> dict[str, str]:
    """What counts depend on beside the code: they can be compared exactly where this is the same."""
    versions = {name: metadata.version(name) for name in ("casadi", "llvmlite", "numba", "numpy", "scipy")}
    system = {"python": platform.python_version(), "machine": f"{sys.platform} {platform.machine()}"}
    return {**system, "libc": " ".join(platform.libc_ver()), **versions}


def _count_apart(how: str, folder: Path) -> Work:
    """The counts of a process of its own."""
    file = folder / f"{how}.json"
    # Sets of strings have an order of their own in every process, unless they are told to have the same.
    portable = import_module("assembly._kernel.targets").PORTABLE_VARIABLES
    variables = {**os.environ, **portable, "PYTHONHASHSEED": "0"}
    if how == "plain":
        variables["NUMBA_DISABLE_JIT"] = "1"
    tool = callgrind.command(folder / "callgrind") if how == "instructions" else []
    command = [*tool, sys.executable, "-m", "benchmarks.counts", how, str(file)]
    subprocess.run(command, cwd=ROOT, env=variables, check=True)
    work: Work = json.loads(file.read_text())
    if how == "instructions":
        counted = callgrind.read_counts(folder / "callgrind")
        return {case: {INSTRUCTIONS: counted[case]} for case in work}
    return work


def _in_plain_python() -> tuple[Work, Callable[[str, Callable[[], Any]], Any]]:
    """Where counts go, and who counts the calls of functions."""
    kinds = {}
    for kind, names in PLAIN.items():
        for name in names:
            module, _, function = name.rpartition(".")
            kinds[getattr(import_module(f"assembly.{module}"), function).__code__] = kind
    work: Work = {}

    def count(case: str, call: Callable[[], Any]) -> Any:
        profile = Profile(subcalls=False, builtins=False)
        profile.enable()
        result = call()
        profile.disable()
        work[case] = dict.fromkeys(PLAIN, 0)
        for entry in profile.getstats():
            if entry.code in kinds:
                work[case][kinds[entry.code]] += entry.callcount
        return result

    return work, count


def _in_compiled_code() -> tuple[Work, Callable[[str, Callable[[], Any]], Any]]:
    """Where counts go, and who notes what results tell of them."""
    work: Work = {}

    def count(case: str, call: Callable[[], Any]) -> Any:
        result = call()
        told = result if isinstance(result, list) else [result]
        values = {name: [getattr(one, name) for one in told if hasattr(one, name)] for name in TOLD}
        work[case] = {name: sum(found) for name, found in values.items() if found}
        return result

    return work, count


def _under_callgrind() -> tuple[Work, Callable[[str, Callable[[], Any]], Any]]:
    """Names of cases, and who has a call counted that is made after `BEFORE` others."""
    counter, chosen = callgrind.Counter(), import_module("benchmarks.work_cases").BY_INSTRUCTION
    work: Work = {}
    gc.disable()

    def count(case: str, call: Callable[[], Any]) -> Any:
        result = call()
        if case in chosen:
            for _ in range(BEFORE - 1):
                call()
            counter.count(case, call)
            work[case] = {}
        return result

    return work, count


WAYS = {"plain": _in_plain_python, "compiled": _in_compiled_code, "instructions": _under_callgrind}


def main(arguments: Sequence[str]) -> int:
    """Count in this process, in one of `WAYS`, into a file; of some families of cases where they are named."""
    how, file, *families = arguments
    work, count = WAYS[how]()
    for family in import_module("benchmarks.work_cases").FAMILIES:
        if not families or family.__name__ in families:
            family(count)
    Path(file).write_text(json.dumps(work))
    return 0


def lines(result: Mapping[str, Any]) -> list[str]:
    """All counts as lines of a Markdown table."""
    kinds = (*COUNTS, INSTRUCTIONS)
    table = [["what", *kinds], ["---"] * (len(kinds) + 1)]
    for case, counts in result["work"].items():
        table.append([case, *(f"{counts[kind]:,}" if counts.get(kind) else "" for kind in kinds)])
    return ["| " + " | ".join(row) + " |" for row in table]


def section(result: Mapping[str, Any]) -> list[str]:
    """Paragraphs of the page."""
    versions = ", ".join(f"{name} {version}" for name, version in result["stamp"].items())
    parts = ["## Counts", f"Counted with {versions}.", ABOUT, "\n".join(lines(result))]
    return [*parts, f"{result['missing'].capitalize()}."] if result["missing"] else parts


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
