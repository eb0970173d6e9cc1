"""The figures as a Markdown page, ``docs/performance.md``: ``python -m benchmarks.report`` writes it from the JSON.

A whole run of ``python -m benchmarks`` writes it too.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.figures import met, quantity

__all__ = ["PAGE", "lines", "page"]

PAGE = Path(__file__).resolve().parent.parent / "docs" / "performance.md"
RESULTS = Path(__file__).resolve().parent / "results" / "all.json"
# Load of a machine on which nothing else runs.
IDLE = 0.3
HEADING = """\
# Performance

Written by `python -m benchmarks`; do not edit. Every figure is from one run on one core of the machine below, times are
medians, and peers were measured in the same run. "Reach" is the figure we set out to reach."""


def _cells(row: Mapping[str, Any]) -> list[str]:
    """What, reach, measured, peers."""
    unit, of = row["unit"], row["of"]
    reach = "" if row["reach"] is None else quantity(row["reach"], unit, of)
    measured = quantity(row["measured"], unit, of)
    if met(row) is False:
        measured += " (not reached)"
    peers = "; ".join(f"{name} {quantity(value, unit, of)}" for name, value in row["peers"].items())
    return [row["what"], reach, measured, peers]


def lines(result: Mapping[str, Any]) -> list[str]:
    """The figures of one benchmark as lines of a Markdown table, or that it failed, and why."""
    if "error" in result:
        last = str(result["error"]).strip().splitlines()[-1]
        return [f"This benchmark failed: `{last}`"]
    rows = [_cells(row) for row in result.get("figures", [])]
    table = [["what", "reach", "measured", "peer"], ["---"] * 4, *rows]
    # A bar would end its cell.
    return ["| " + " | ".join(cell.replace("|", r"\|") for cell in row) + " |" for row in table]


def page(report: Mapping[str, Any]) -> str:
    """The whole page."""
    machine = report["machine"]
    versions = ", ".join(f"{name} {version}" for name, version in machine["versions"].items() if version != "absent")
    parts = [HEADING, f"Machine: {machine['processor']}. Python {machine['python']}, {versions}."]
    load = machine.get("load")
    if load is not None and load > IDLE:
        parts.append(
            f"**Provisional:** other programs ran on the machine (load {load:.1f} on {machine['cores']} cores when the "
            "run began), so that times are too long and unsteady."
        )
    for name, result in report["benchmarks"].items():
        parts.append(f"## {name.capitalize()}")
        if "about" in result:
            parts.append(result["about"])
        parts.append("\n".join(lines(result)))
    return "\n\n".join(parts) + "\n"


def main() -> int:
    PAGE.write_text(page(json.loads(RESULTS.read_text())))
    print(f"written to {PAGE}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
