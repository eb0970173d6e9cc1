"""Figures: what was measured, what was to be reached, and what a peer needed in the same run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Literal

__all__ = ["Unit", "figure", "met", "quantity"]

Unit = Literal["seconds", "count", "error", "ratio"]
_SUFFIXES = (("s", 1.0), ("ms", 1e-3), ("us", 1e-6))


def figure(
    what: str,
    unit: Unit,
    measured: float,
    *,
    reach: float | None = None,
    of: int | None = None,
    peers: Mapping[str, float | None] | None = None,
) -> dict[str, Any]:
    """One figure, as it goes to the JSON.

    Parameters
    ----------
    what
        What was measured.
    unit
        "seconds", "error" (an absolute or relative deviation) and "ratio" are better when they are small, a "count"
        of cases that went well when it is large.
    measured
        The figure; of times, a median.
    reach
        The figure to reach; None where there is no such goal.
    of
        Of a count: the number of cases.
    peers
        The same for others, measured in the same run, by name; None for one that is not installed.

    Raises
    ------
    ValueError
        A count without `of`, or `of` with another unit.
    """
    if (unit == "count") != (of is not None):
        raise ValueError(f"of is {of} with unit {unit!r}, expected the number of cases for counts and for nothing else")
    return {"what": what, "unit": unit, "measured": measured, "reach": reach, "of": of, "peers": dict(peers or {})}


def met(row: Mapping[str, Any]) -> bool | None:
    """Whether a figure was reached; None without a goal. A figure that is not a number reaches nothing."""
    if row["reach"] is None:
        return None
    if row["unit"] == "count":
        return bool(row["measured"] >= row["reach"])
    return bool(row["measured"] <= row["reach"])


def quantity(value: float | None, unit: Unit, of: int | None = None) -> str:
    """A number with its unit; "absent" for None."""
    if value is None:
        return "absent"
    if math.isnan(value):
        return "none"
    if unit == "count":
        return f"{value:g} of {of}"
    if unit == "seconds":
        for suffix, size in _SUFFIXES:
            if abs(value) >= size:
                return f"{value / size:.3g} {suffix}"
        return f"{value / 1e-9:.3g} ns"
    return f"{value:.1e}" if unit == "error" else f"{value:.3g}"
