"""Whether a run is worse than the stored one: times by their ratio to a calibration loop, errors, cases, counts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from benchmarks.counts import COUNTS, INSTRUCTIONS

__all__ = ["Regression", "more_work", "regressions"]

# A time may be so many times the stored one, both over the calibration loop of their runs: what medians of shared
# machines differ by. A time that short is mostly the clock's.
SLOWER, SHORT = 1.6, 1e-7
# An error may be so many times the stored one; below this it is rounding.
WORSE, ROUNDING = 10.0, 1e-13
# A count may be so many times the stored one, and so many more, where other versions or another machine rounds in other
# ways; where they are the same, none. Of the instructions of one program, 0.2 percent depend on the lengths of paths.
ROUNDS, MORE, LONGER = 1.02, 1, 1.02

Regression = tuple[str, str, float, float]


def _figures(report: Mapping[str, Any]) -> dict[tuple[str, str], Mapping[str, Any]]:
    return {
        (name, row["what"]): row
        for name, result in report["benchmarks"].items()
        for row in result.get("figures", [])
        if math.isfinite(row["measured"])
    }


def regressions(report: Mapping[str, Any], baseline: Mapping[str, Any]) -> list[Regression]:
    """What became worse: (benchmark, what, before, now), times in calibration loops.

    Figures that only one of the two has are not compared; a benchmark that failed is a regression where it did not
    before.

    Raises
    ------
    ValueError
        One of the two is a quick run and the other is not: they measure different things.
    """
    if report["quick"] != baseline["quick"]:
        raise ValueError("one run is quick and the other is not; expected two of a kind")
    loops = report["machine"]["calibration_seconds"], baseline["machine"]["calibration_seconds"]
    found: list[Regression] = []
    for name, result in report["benchmarks"].items():
        if "error" in result and "error" not in baseline["benchmarks"].get(name, {"error": ""}):
            found.append((name, "failed", 0.0, math.inf))
    before = _figures(baseline)
    for key, row in _figures(report).items():
        old = before.get(key)
        if old is None or old["unit"] != row["unit"]:
            continue
        now, then, unit = row["measured"], old["measured"], row["unit"]
        if unit == "seconds":
            now, then = now / loops[0], then / loops[1]
            worse = row["measured"] > SHORT and now > SLOWER * then
        elif unit == "error":
            worse = now > WORSE * max(then, ROUNDING)
        elif unit == "count":
            worse = now / row["of"] < then / old["of"]
        else:
            # Ratios come with their own goals.
            worse = row["reach"] is not None and then <= row["reach"] * 1.1 < now
        if worse:
            found.append((*key, then, now))
    return found


def more_work(now: Mapping[str, Any], then: Mapping[str, Any]) -> list[Regression]:
    """What takes more work than it did: (case, what is counted, before, now).

    Instructions are compared where all versions are the same, and both runs have them. A case that is no longer there
    is a regression; one that only the new run has is not compared.
    """
    is_same = now["stamp"] == then["stamp"]
    found: list[Regression] = []
    for case, old in then["work"].items():
        new = now["work"].get(case)
        if new is None:
            found.append((case, "is gone", 0.0, math.inf))
            continue
        for kind in COUNTS:
            count, before = new.get(kind, 0), old.get(kind, 0)
            if count > (before if is_same else ROUNDS * before + MORE):
                found.append((case, kind, before, count))
        if is_same and INSTRUCTIONS in new and new[INSTRUCTIONS] > LONGER * old.get(INSTRUCTIONS, math.inf):
            found.append((case, INSTRUCTIONS, old[INSTRUCTIONS], new[INSTRUCTIONS]))
    return found
