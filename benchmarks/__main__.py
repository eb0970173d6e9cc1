"""Run the benchmarks: ``python -m benchmarks [--quick] [--only NAME] [--output FOLDER] [--gate]``.

A run that is not quick, with its JSON where it belongs, writes ``docs/performance.md`` and its pictures too, of one
benchmark that one's section. `--gate` compares a run with the stored one of its kind (``benchmarks/results``) and fails
where something became worse. ``--only counts`` counts work and takes no times; a run of all does without it.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from benchmarks import counts
from benchmarks import report as pages
from benchmarks.gate import Regression, more_work, regressions
from benchmarks.pictures import draw
from benchmarks.running import run_apart
from benchmarks.timing import Busy, calibration

# Modules with `run(quick: bool) -> dict`. The dict goes to the JSON as it is; its "rows", a list of
# flat dicts, are printed as a table, and so are its "figures" (`figures.figure`), which go to the page as well.
BENCHMARKS = (
    "evaluation",
    "trims",
    "pairs",
    "surface_errors",
    "controllers",
    "curves",
    "curve_errors",
    "distances",
    "proximity_paper",
    "features",
    "facets",
    "manifolds",
    "clear_ticks",
    "wires",
    "contact_errors",
    "tracking",
    "tracking_errors",
    "mechanisms",
    "derivatives",
    "joint_errors",
    "batches",
    "studies",
    "laws",
    "accuracy",
    "step",
    "growth",
    "skip",
    "start",
)
COUNTS = "counts"
LIBRARIES = (
    *("assembly", "casadi", "meshcat", "numba", "numpy", "scipy"),
    *("cadquery", "cadquery-ocp", "coal", "distributed", "drake"),
)
RESULTS = Path(__file__).resolve().parent / "results"


def machine() -> dict[str, Any]:
    """What the figures depend on: the machine, what is installed, and the time of a fixed loop."""
    versions = {}
    for library in LIBRARIES:
        try:
            versions[library] = metadata.version(library)
        except metadata.PackageNotFoundError:
            versions[library] = "absent"
    return {
        "processor": processor_name(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "versions": versions,
        "calibration_seconds": calibration(),
    }


def processor_name() -> str:
    """Model of the processor, where the system tells."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "unknown")


def pin_to_one_core() -> None:
    """Keep this process and its children on one core, and their libraries to one thread."""
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ[variable] = "1"
    if hasattr(os, "sched_setaffinity"):
        # The last one: the first serves most interrupts.
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def shown(key: str, value: object) -> str:
    """A cell of the table; times in a unit that suits them."""
    if isinstance(value, float):
        if key in ("low", "high") or key.endswith("seconds"):
            for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
                if abs(value) >= size:
                    return f"{value / size:.3g} {unit}"
            return f"{value / 1e-9:.3g} ns"
        return f"{value:.4g}"
    return str(value)


def table(result: dict[str, Any]) -> str:
    """The rows of a result as text; columns are the keys in order of appearance."""
    if "error" in result:
        return f"failed\n{result['error']}"
    rows = result.get("rows", [])
    if not rows:
        return ""
    keys = list(dict.fromkeys(key for row in rows for key in row))
    cells = [keys, *([shown(key, row.get(key, "")) for key in keys] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in cells]
    return "\n".join(lines)


def write(report: dict[str, Any], output: Path, only: str | None) -> Path:
    """Write what was measured so far; sections of the stored whole run that are not measured again stay."""
    if report["quick"]:
        path = output / f"{only or 'all'}-quick.json"
        path.write_text(json.dumps(report, indent=1) + "\n")
        return path
    path = output / "all.json"
    kept = json.loads(path.read_text())["benchmarks"] if path.exists() else {}
    both = {**kept, **report["benchmarks"]}
    if only and path.exists():
        # The page's heading is that of the last whole run; a section says what differed when it was measured.
        report = {**report, "machine": json.loads(path.read_text())["machine"]}
    whole = {**report, "benchmarks": {name: both[name] for name in BENCHMARKS if name in both}}
    path.write_text(json.dumps(whole, indent=1) + "\n")
    return path


def tell(worse: list[Regression]) -> None:
    """Print what became worse."""
    for name, what, then, now in worse:
        print(f"worse: {name}: {what}: {then:,.7g} became {now:,.7g}")


def count_work(output: Path, gate: bool) -> int:
    """Count work, print and write it; how many counts of the stored ones became more."""
    before = json.loads(counts.STORED.read_text()) if gate else None
    result = counts.count_all()
    path = output / counts.STORED.name
    path.write_text(json.dumps(result, indent=1) + "\n")
    print("\n".join([*counts.section(result), f"\nwritten to {path}"]))
    if path == counts.STORED:
        pages.main()
    if before is None:
        return 0
    if before["stamp"] != result["stamp"]:
        print("versions are not those of the stored counts: some more is let pass, and instructions are not compared")
    worse = more_work(result, before)
    tell(worse)
    return len(worse)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print and write; the number of benchmarks that failed."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer repeats and cases: does everything still run?")
    names = (*BENCHMARKS, COUNTS)
    parser.add_argument("--only", choices=names, metavar="NAME", help=f"one of {', '.join(names)}")
    parser.add_argument("--output", type=Path, default=RESULTS, metavar="FOLDER", help="where the JSON goes")
    parser.add_argument("--gate", action="store_true", help="compare with the stored run, fail where it is worse")
    options = parser.parse_args(arguments)

    pin_to_one_core()
    options.output.mkdir(parents=True, exist_ok=True)
    if options.only == COUNTS:
        return count_work(options.output, options.gate)
    report: dict[str, Any] = {"quick": options.quick, "machine": machine(), "benchmarks": {}}
    stored = RESULTS / ("all-quick.json" if options.quick else "all.json")
    before = json.loads(stored.read_text()) if options.gate else {}
    for name in [options.only] if options.only else BENCHMARKS:
        watch = Busy()
        result = run_apart(f"benchmarks.{name}", options.quick)
        took, others = watch.read()
        circumstances = {
            "date": f"{datetime.now(UTC):%Y-%m-%d}",
            "took_seconds": took,
            "others": others,
            "versions": report["machine"]["versions"],
        }
        report["benchmarks"][name] = {**result, **circumstances}
        lines = ["", f"{name}, {took:.0f} s", table(result), *pages.lines(result)]
        print("\n".join(lines), flush=True)
        # After each, for a whole run takes its time, and may be ended.
        path = write(report, options.output, options.only)
    print(f"\nwritten to {path}")
    worse = regressions(report, before) if options.gate else []
    tell(worse)
    if not options.quick and options.output == RESULTS:
        for name, result in report["benchmarks"].items():
            draw(name, result.get("curves", []), pages.PICTURES)
        pages.main()
    return sum("error" in result for result in report["benchmarks"].values()) + len(worse)


if __name__ == "__main__":
    sys.exit(main())
