"""How times are taken, so that two of them can be compared.

A time is the median over repeats, each repeat long enough for the clock and short enough to fall
between two interruptions. What is compared runs side by side, one repeat of each in turn, so that a
machine that slows down does so for all. The first call is kept apart: it may compile or fill caches.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

__all__ = ["Busy", "Timing", "calibration", "compare", "measure"]

Clock = Callable[[], float]


@dataclass(frozen=True)
class Timing:
    """Seconds a call takes.

    Attributes
    ----------
    seconds
        Median over the repeats, per call.
    low, high
        Quartiles over the repeats, per call.
    first
        The very first call.
    calls
        Calls in one repeat.
    """

    seconds: float
    low: float
    high: float
    first: float
    calls: int


class _Series:
    """One callable under measurement: its first call, then repeats of as many calls as fill `duration`."""

    def __init__(self, function: Callable[[], Any], duration: float, clock: Clock) -> None:
        self._function = function
        self._clock = clock
        self._times: list[float] = []
        self._first = self._run(1)
        self._calls = 1
        # Doubling, and not one division by a single call's time, which one interruption would spoil.
        while (spent := self._run(self._calls)) < 0.5 * duration:
            self._calls *= 2 if spent > 0.0625 * duration else 8

    def _run(self, calls: int) -> float:
        function, clock = self._function, self._clock
        start = clock()
        for _ in range(calls):
            function()
        return clock() - start

    def repeat(self) -> None:
        self._times.append(self._run(self._calls) / self._calls)

    def timing(self) -> Timing:
        low, median, high = statistics.quantiles(self._times, n=4, method="inclusive")
        return Timing(median, low, high, self._first, self._calls)


def compare(
    candidates: Mapping[str, Callable[[], Any] | None],
    *,
    repeats: int = 25,
    duration: float = 2e-3,
    clock: Clock = time.perf_counter,
) -> list[dict[str, Any]]:
    """Time several callables side by side.

    Parameters
    ----------
    candidates
        Name to what is called without arguments, or None for a peer that is not installed. Ratios
        are against the first one that is there.
    repeats
        Repeats of each, at least 2.
    duration
        Seconds a repeat lasts, about.
    clock
        Returns seconds; for tests.

    Returns
    -------
    list of dict
        One row a candidate, in the given order: ``who``, then ``seconds``, ``low``, ``high``,
        ``first_seconds`` and ``ratio``, or ``absent: True``.

    Raises
    ------
    ValueError
        `repeats` is below 2 or `duration` is not positive.
    """
    if repeats < 2:
        raise ValueError(f"repeats is {repeats}, expected at least 2")
    if not duration > 0.0:
        raise ValueError(f"duration is {duration}, expected a positive number of seconds")
    series = {who: _Series(call, duration, clock) for who, call in candidates.items() if call is not None}
    for _ in range(repeats):
        for one in series.values():
            one.repeat()
    timings = {who: one.timing() for who, one in series.items()}
    base = next((timing.seconds for timing in timings.values()), 0.0)
    return [
        {
            "who": who,
            "seconds": timings[who].seconds,
            "low": timings[who].low,
            "high": timings[who].high,
            "first_seconds": timings[who].first,
            "ratio": timings[who].seconds / base,
        }
        if who in timings
        else {"who": who, "absent": True}
        for who in candidates
    ]


def measure(
    function: Callable[[], Any],
    *,
    repeats: int = 25,
    duration: float = 2e-3,
    clock: Clock = time.perf_counter,
) -> Timing:
    """Time one callable; see `compare` for the arguments and `Timing` for the answer."""
    series = _Series(function, duration, clock)
    for _ in range(max(repeats, 2)):
        series.repeat()
    return series.timing()


def calibration() -> float:
    """Seconds of a fixed loop in plain Python: divide by it to compare two machines, roughly."""

    def loop() -> None:
        total = 0
        for k in range(10_000):
            total += k * k

    return measure(loop).seconds


class Busy:
    """How long something took, and how busy other programs kept the machine meanwhile."""

    def __init__(self) -> None:
        self._begin = time.perf_counter(), *_processor_seconds()

    def read(self) -> tuple[float, float | None]:
        """Seconds since this was made, and how many cores other programs used of them; None where it is not told.

        Children count as this program's own from when they end.
        """
        seconds, everyone, own = self._begin
        now = time.perf_counter() - seconds
        everyone_now, own_now = _processor_seconds()
        if everyone is None or everyone_now is None:
            return now, None
        return now, max(0.0, (everyone_now - everyone - (own_now - own)) / now)


def _processor_seconds() -> tuple[float | None, float]:
    """Seconds of processors that all programs have used since the machine began, and this one and its children."""
    times = os.times()
    own = times.user + times.system + times.children_user + times.children_system
    try:
        # "cpu", then user, nice, system, idle, waiting, interrupts twice, and what the host took.
        spent = Path("/proc/stat").read_text().split(maxsplit=9)[1:9]
    except OSError:
        return None, own
    user, nice, system, _, _, hard, soft, stolen = map(int, spent)
    return (user + nice + system + hard + soft + stolen) / os.sysconf("SC_CLK_TCK"), own
