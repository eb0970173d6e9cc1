"""A log of ticks: times, violations, statuses, poses and events."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from os import PathLike
from pathlib import Path
from typing import Any, Protocol, Self
from zipfile import BadZipFile

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._copies import InOneProcess
from assembly._html import Table, as_html
from assembly._read_only import ReadOnlyArrays, read_only
from assembly.errors import InputError, integer, number, positive

__all__ = ["Happening", "LoggedEvent", "Recorder", "TrackLog"]

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
_VERSION = 1
_PERCENTILES = {"median": 50.0, "p90": 90.0, "p99": 99.0, "p99.9": 99.9, "max": 100.0}


class Happening(Protocol):
    """What a log takes as an event: something of a kind, an Enum or a text, that prints as a line."""

    @property
    def kind(self) -> Any:
        """What happened."""


@dataclass(frozen=True)
class LoggedEvent:
    """An event as a file keeps it.

    Attributes
    ----------
    kind : str
    text : str
        What the event printed as.
    """

    kind: str
    text: str

    def __str__(self) -> str:
        return self.text


def kind_name(event: Happening) -> str:
    """The kind of an event as a text."""
    kind = event.kind
    return kind.name if isinstance(kind, Enum) else str(kind)


@dataclass(frozen=True, eq=False)
class TrackLog(ReadOnlyArrays):
    """Ticks of a tracker, in the order they came.

    Parameters
    ----------
    times : (k,)
        Times of the targets, in the trace's seconds; increasing.
    seconds : (k,)
        What each tick took.
    feasibility : (k,)
        Worst violation after each, in the user's units.
    status : (k,) of int
        How each ended: indices into `statuses`.
    iterations : (k,) of int
    q : (m, n, 7)
        Poses after ticks 0, stride, 2 stride ...: one row per body, x y z qw qx qy qz.
    statuses : sequence of str
        Names of the statuses.
    events : sequence of (tick, event)
        What happened in which tick; an event has a `kind` and prints as a line.
    stride : int
    budget : float, optional
        Seconds a tick may take.

    Raises
    ------
    InputError
        Arrays of shapes that do not fit each other, times that do not increase, a status or tick out of range.
    """

    times: Array
    seconds: Array
    feasibility: Array
    status: Integers
    iterations: Integers
    q: Array
    statuses: tuple[str, ...]
    events: tuple[tuple[int, Happening], ...] = ()
    stride: int = 1
    budget: float | None = None

    def __post_init__(self) -> None:
        times = _tick_times(self.times)
        count = len(times)
        stride = integer("stride", self.stride, 1, 2**62)
        fields: dict[str, Any] = {
            "times": times,
            "seconds": _numbers("seconds", self.seconds, (count,), np.float64),
            "feasibility": _numbers("feasibility", self.feasibility, (count,), np.float64),
            "status": _numbers("status", self.status, (count,), np.int64),
            "iterations": _numbers("iterations", self.iterations, (count,), np.int64),
            "q": _numbers("q", self.q, (-(-count // stride), "n", 7), np.float64),
            "statuses": tuple(str(name) for name in self.statuses),
            "events": tuple((integer("tick of an event", tick, 0, count - 1), event) for tick, event in self.events),
            "stride": stride,
            "budget": None if self.budget is None else positive("budget", self.budget),
        }
        if fields["status"].min() < 0 or fields["status"].max() >= len(fields["statuses"]):
            raise InputError(
                f"status goes from {fields['status'].min()} to {fields['status'].max()}; expected places in "
                f"{len(fields['statuses'])} statuses"
            )
        for name, value in fields.items():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
            object.__setattr__(self, name, value)

    @staticmethod
    def recorder(
        times: ArrayLike, bodies: int, statuses: type[Enum], *, stride: int = 1, budget: float | None = None
    ) -> Recorder:
        """A recorder for ticks at times (k,) of a number of bodies; a status is its index in an Enum."""
        return Recorder(times, bodies, statuses, stride=stride, budget=budget)

    def __len__(self) -> int:
        return len(self.times)

    def percentile(self, p: float) -> float:
        """Seconds that p percent of the ticks took at most: the duration of one of the ticks, not interpolated."""
        part = number("p", p)
        if not 0.0 <= part <= 100.0:
            raise InputError(f"p is {part:g}; expected percents from 0 to 100")
        # 99.9 percent of 1000 are 999, but 999.0000000000001 in doubles.
        rank = max(int(np.ceil(part * len(self) / 100.0 - 1e-9)), 1)
        return float(np.partition(self.seconds, rank - 1)[rank - 1])

    @property
    def median(self) -> float:
        """Seconds that half of the ticks took at most."""
        return self.percentile(50.0)

    @property
    def late(self) -> Integers:
        """Ticks that took longer than the budget; none where there is no budget."""
        return read_only(self.later_than(np.inf if self.budget is None else self.budget))

    def later_than(self, seconds: float) -> Integers:
        """Ticks that took longer than so many seconds."""
        return np.flatnonzero(self.seconds > seconds)

    @property
    def worst_violation(self) -> float:
        """Largest violation after any tick, in the user's units; NaN if there is one."""
        return float(self.feasibility.max())

    @property
    def pose_times(self) -> Array:
        """Times of the poses in `q`, (m,)."""
        return self.times[:: self.stride]

    def count(self, status: Enum | str) -> int:
        """How many ticks ended so: a member of the statuses' Enum, or its name.

        Raises
        ------
        InputError
            An unknown status; the message lists the known ones.
        """
        name = status.name if isinstance(status, Enum) else status
        if name not in self.statuses:
            raise InputError(f"status is {name!r}; expected one of {', '.join(map(repr, self.statuses))}")
        return int((self.status == self.statuses.index(name)).sum())

    @property
    def kinds(self) -> dict[str, int]:
        """How many events there were of every kind, in the order they first came."""
        return dict(Counter(kind_name(event) for _, event in self.events))

    def save(self, path: str | PathLike[str]) -> None:
        """Write a `.npz` file; of an event its kind and its text are kept.

        Raises
        ------
        InputError
            A path with another ending.
        """
        np.savez(
            _archive(path),
            version=_VERSION,
            times=self.times,
            seconds=self.seconds,
            feasibility=self.feasibility,
            status=self.status,
            iterations=self.iterations,
            q=self.q,
            statuses=np.array(self.statuses, dtype=np.str_),
            stride=self.stride,
            budget=np.nan if self.budget is None else self.budget,
            event_ticks=np.array([tick for tick, _ in self.events], dtype=np.int64),
            event_kinds=np.array([kind_name(event) for _, event in self.events], dtype=np.str_),
            event_texts=np.array([str(event) for _, event in self.events], dtype=np.str_),
        )

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Self:
        """Read what `save` writes; events are `LoggedEvent`.

        Raises
        ------
        InputError
            A path with another ending, or a file that holds no log.
        OSError
            No such file.
        """
        file = _archive(path)
        try:
            with file.open("rb") as stream, np.load(stream, allow_pickle=False) as data:
                if int(data["version"]) != _VERSION:
                    raise ValueError(f"version {data['version']}")
                budget = float(data["budget"])
                texts = zip(data["event_kinds"].tolist(), data["event_texts"].tolist(), strict=True)
                events = [LoggedEvent(kind, text) for kind, text in texts]
                return cls(
                    times=data["times"],
                    seconds=data["seconds"],
                    feasibility=data["feasibility"],
                    status=data["status"],
                    iterations=data["iterations"],
                    q=data["q"],
                    statuses=tuple(data["statuses"].tolist()),
                    events=tuple(zip(data["event_ticks"].tolist(), events, strict=True)),
                    stride=int(data["stride"]),
                    budget=None if np.isnan(budget) else budget,
                )
        except (BadZipFile, EOFError, KeyError, TypeError, ValueError) as error:
            raise InputError(f"{file} holds no log of version {_VERSION}: {error}") from None

    def __repr__(self) -> str:
        return f"TrackLog({len(self)} ticks, median {1e6 * self.median:.3g} us, worst {self.worst_violation:.1e})"

    def __str__(self) -> str:
        span = self.times[-1] - self.times[0]
        lines = [
            f"{len(self)} ticks over {span:.6g} s",
            "          " + "".join(f"{name:>10}" for name in _PERCENTILES),
            "tick [us] " + "".join(f"{1e6 * self.percentile(p):>10.4g}" for p in _PERCENTILES.values()),
        ]
        if self.budget is not None:
            lines.append(f"late      {self.late.size} of {len(self)}, budget {1e6 * self.budget:.4g} us")
        return "\n".join(lines + self._last_lines())

    def _last_lines(self) -> list[str]:
        lines = [f"violation {self.worst_violation:.1e} at worst, in tick {int(self.feasibility.argmax())}"]
        found = np.bincount(self.status, minlength=len(self.statuses)).tolist()
        listed = ", ".join(f"{count} {name}" for name, count in zip(self.statuses, found, strict=True) if count)
        lines.append(f"status    {listed}")
        lines.append(f"events    {', '.join(f'{count} {name}' for name, count in self.kinds.items()) or 'none'}")
        return lines

    def _repr_html_(self) -> str:
        span = self.times[-1] - self.times[0]
        late = [] if self.budget is None else [f"late {self.late.size}, budget {1e6 * self.budget:.4g} us"]
        ticks = tuple(float(f"{1e6 * self.percentile(p):.4g}") for p in _PERCENTILES.values())
        table = Table(("", *_PERCENTILES), [("tick [us]", *ticks)])
        return as_html(f"{len(self)} ticks over {span:.6g} s", table, *late, *self._last_lines())


class Recorder(InOneProcess):
    """Arrays for a number of ticks, filled one tick after the other; `log` makes the log of what was filled.

    Parameters
    ----------
    times : (k,)
        Of the ticks to come.
    bodies : int
    statuses : Enum
        The status of a tick is a place in it.
    stride : int
        Poses are kept of every so many ticks.
    budget : float, optional
        Seconds a tick may take.
    """

    _instead = "keep its `log()`"

    def __init__(
        self, times: ArrayLike, bodies: int, statuses: type[Enum], *, stride: int = 1, budget: float | None = None
    ) -> None:
        # All that a log would raise is raised before the first tick.
        self.times = _tick_times(times)
        self.stride = integer("stride", stride, 1, 2**62)
        self.budget = None if budget is None else positive("budget", budget)
        self.statuses = tuple(member.name for member in statuses)
        count = len(self.times)
        # Filled, not only reserved, so that no tick waits for its page of memory.
        self.seconds = np.full(count, 0.0)
        self.feasibility = np.full(count, 0.0)
        self.status = np.full(count, 0)
        self.iterations = np.full(count, 0)
        self.q = np.full((-(-count // self.stride), integer("bodies", bodies, 1, 2**31), 7), 0.0)
        # A number goes into one of these in half the time it takes to go into the array below it.
        parts: tuple[Any, ...] = (self.seconds, self.feasibility, self.status, self.iterations)
        self._views: tuple[memoryview[Any], ...] = tuple(memoryview(part) for part in parts)
        self.events: list[tuple[int, Happening]] = []
        self.ticks = 0

    def record(self, k: int, q: Array, seconds: float, feasibility: float, status: int, iterations: int) -> None:
        """Keep tick k; ticks come in order, from 0."""
        took, violation, ended, steps = self._views
        took[k] = seconds
        violation[k] = feasibility
        ended[k] = status
        steps[k] = iterations
        if k % self.stride == 0:
            self.q[k // self.stride] = q
        self.ticks = k + 1

    def note(self, k: int, events: Sequence[Happening]) -> None:
        """Keep what happened in tick k."""
        self.events.extend((k, event) for event in events)

    def log(self) -> TrackLog:
        """The log of the ticks so far; of a single one at least."""
        k = self.ticks
        return TrackLog(
            times=self.times[:k],
            seconds=self.seconds[:k],
            feasibility=self.feasibility[:k],
            status=self.status[:k],
            iterations=self.iterations[:k],
            q=self.q[: -(-k // self.stride)],
            statuses=self.statuses,
            events=tuple(self.events),
            stride=self.stride,
            budget=self.budget,
        )


def _tick_times(value: ArrayLike) -> Array:
    times: Array = _numbers("times", value, ("k",), np.float64)
    if len(times) == 0 or not (np.diff(times) > 0.0).all():
        raise InputError("times is empty or does not increase; expected the times of one tick at least")
    return times


def _numbers(name: str, value: ArrayLike, shape: tuple[int | str, ...], dtype: type) -> NDArray[Any]:
    """A new array of the given shape; a string stands for any extent. Logs are long: nothing is done for each entry."""
    try:
        array: NDArray[Any] = np.array(value).astype(dtype, casting="same_kind", copy=False)
    except (TypeError, ValueError):
        raise InputError(f"{name} is {type(value).__name__}; expected numbers") from None
    fits = array.ndim == len(shape) and all(
        isinstance(want, str) or has == want for has, want in zip(array.shape, shape, strict=True)
    )
    if not fits:
        raise InputError(f"{name} has shape {array.shape}; expected ({', '.join(map(str, shape))})")
    return array


def _archive(path: str | PathLike[str]) -> Path:
    file = Path(path)
    if file.suffix != ".npz":
        raise InputError(f"path is {str(path)!r}; expected a name that ends with .npz")
    return file
