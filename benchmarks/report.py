"""The figures as a Markdown page, ``docs/performance.md``, and some of them in README.

``python -m benchmarks.report`` writes both from the JSON, and so does ``python -m benchmarks``.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks import counts
from benchmarks.figures import met, quantity

__all__ = ["PAGE", "PICTURES", "README", "block", "lines", "page", "with_block"]

PAGE = Path(__file__).resolve().parent.parent / "docs" / "performance.md"
README = PAGE.parent.parent / "README.md"
BEGIN, END = "<!-- figures -->\n", "<!-- /figures -->"
# What README tells: words for it, the section, and the figure there.
TOLD = (
    (
        "a point and all second derivatives of a bicubic surface, in a kernel",
        "evaluation",
        "inside a kernel, as 3-tuples",
    ),
    ("the extremal pair of two surfaces, from near, in a kernel", "pairs", "warm, as in a solve, inside a kernel"),
    ("certified distance of two Bezier curves of degree 5", "curves", "two Bezier curves of degree 5, median"),
    ("closest features of two solids, from anywhere", "features", "solids: a search"),
    ("spatial four-bar, a warm step of 1 degree", "mechanisms", "four-bar, a warm step of 1 degree: a call"),
    ("eight cubes on one another, from near", "joint_errors", "eight cubes, pulled, at 1e-14: a call"),
    ("64 cubes on one another, from scattered poses", "mechanisms", "64 boxes: a call"),
    ("three linked wires that touch, contacts given", "wires", "wires, near, contacts given: a call"),
    ("the same from nothing but poses", "wires", "wires, near, global start: a call"),
    ("the same, a warm step", "wires", "wires, near, warm update: a call"),
    ("three paper clips with a clearance follow a hand, a tick", "tracking", "three clips, 100,000 ticks, median"),
    ("contacts of twelve rings that move, an update", "tracking", "manager of twelve rings, an update"),
    ("`import assembly`", "start", "`import assembly`"),
    ("a process that solves one scene, kernels installed", "start", "three wires solved, kernels installed"),
)
PICTURES = PAGE.parent / "images" / "performance"
RESULTS = Path(__file__).resolve().parent / "results" / "all.json"
# Cores that programs of the system keep busy on a machine on which nothing else runs.
IDLE = 0.1
HEADING = """\
# Performance

Written by `python -m benchmarks`; do not edit. Every section is from one run on one core of the machine below, with
these versions where it names no others. Times are medians, and peers were measured in the same run. "Reach" is the
figure we set out to reach. Where other programs kept cores busy meanwhile, times are too long and unsteady, by a little
where there was a core left for them."""


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


def _circumstances(result: Mapping[str, Any], machine: Mapping[str, Any]) -> str:
    """When a section was measured, on how busy a machine, and with which versions that are not those of the heading."""
    known = machine["versions"]
    # The library itself may be run from its folder, where it has no version; and an absent peer has no figures.
    found = {name: version for name, version in result.get("versions", {}).items() if name != "assembly"}
    others = [f"{name} {version}" for name, version in found.items() if version not in ("absent", known.get(name))]
    beside = f"; other versions: {', '.join(others)}" if others else ""
    used = result.get("others")
    busy = "" if used is None else f"; other programs used {used:.2f} of {machine['cores']} cores meanwhile"
    provisional = "**Provisional:** " if used is None or used > IDLE else ""
    took = f" in {result['took_seconds']:.0f} s" if "took_seconds" in result else ""
    return f"{provisional}measured {result.get('date', 'with an earlier version')}{took}{busy}{beside}."


def page(report: Mapping[str, Any], work: Mapping[str, Any] | None = None) -> str:
    """The whole page, with counts of work where there are any."""
    machine = report["machine"]
    versions = ", ".join(f"{name} {version}" for name, version in machine["versions"].items() if version != "absent")
    # The library itself may be run from its folder.
    others = [name for name, version in machine["versions"].items() if version == "absent" and name != "assembly"]
    absent = ", ".join(others)
    parts = [HEADING, f"Machine: {machine['processor']}. Python {machine['python']}, {versions}."]
    if absent:
        parts.append(f"Not installed, and so absent from the tables: {absent}.")
    took = [result["took_seconds"] for result in report["benchmarks"].values() if "took_seconds" in result]
    parts.append(f"All sections together take {sum(took) / 60.0:.0f} minutes.")
    for name, result in report["benchmarks"].items():
        parts.append(f"## {name.capitalize()}")
        parts.append(_circumstances(result, machine))
        if "about" in result:
            parts.append(result["about"])
        parts.append("\n".join(lines(result)))
        for k, diagram in enumerate(result.get("curves", [])):
            # Drawn where matplotlib is installed; a page without them is one of another machine.
            picture = PICTURES / f"{name}-{k + 1}.png"
            if picture.exists():
                parts.append(f"![{diagram['title']}]({picture.relative_to(PAGE.parent).as_posix()})")
    if work is not None:
        parts += counts.section(work)
    return "\n\n".join(parts) + "\n"


def block(report: Mapping[str, Any]) -> str:
    """The lines of README between its two marks."""
    machine = report["machine"]
    rows = [["what", "takes", "others"], ["---"] * 3]
    for words, section, what in TOLD:
        found = {row["what"]: row for row in report["benchmarks"].get(section, {}).get("figures", [])}
        if what in found:
            _, _, measured, peers = _cells({**found[what], "reach": None})
            rows.append([words, measured, peers])
    table = "\n".join("| " + " | ".join(row) + " |" for row in rows)
    every = [met(row) for result in report["benchmarks"].values() for row in result.get("figures", [])]
    goals = [reached for reached in every if reached is not None]
    return f"""\
Medians on one core of an {machine["processor"]}, a call from Python unless it says otherwise, others in the same run.

{table}

`python -m benchmarks` measures these and many more, and writes `docs/performance.md`: {sum(goals)} of its {len(goals)}
goals are reached.
"""


def with_block(text: str, lines: str) -> str:
    """README with other lines between its two marks.

    Raises
    ------
    ValueError
        It has not one of each.
    """
    if text.count(BEGIN) != 1 or text.count(END) != 1:
        raise ValueError(f"README has {text.count(BEGIN)} and {text.count(END)} marks of figures, expected one of each")
    before, _, rest = text.partition(BEGIN)
    return f"{before}{BEGIN}{lines}{END}{rest.partition(END)[2]}"


def main() -> int:
    report = json.loads(RESULTS.read_text())
    work = json.loads(counts.STORED.read_text()) if counts.STORED.exists() else None
    PAGE.write_text(page(report, work))
    README.write_text(with_block(README.read_text(), block(report)))
    print(f"written to {PAGE} and {README}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
