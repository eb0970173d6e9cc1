"""Whether a run is worse than the stored one: times by their ratio to a calibration loop, counts, errors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

__all__ = ["Regression", "regressions"]

# A time may be so many times the stored one, both over the calibration loop of their runs: what medians of shared
# machines differ by. A time that short is mostly the clock's.
SLOWER, SHORT = 1.6, 1e-7
# An error may be so many times the stored one; below this it is rounding.
WORSE, ROUNDING = 10.0, 1e-13

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
