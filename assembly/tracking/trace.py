"""Recorded motions of a target: samples at times, and interpolation between them.

Between samples a trace is a cubic spline through all of them, with continuous velocity and acceleration, so that a
hand recorded at 60 Hz can be followed at 1000. Orientations are the normalized spline of quaternions that are first
brought to the same side: the same motion whatever frame it is seen from, and off a smooth one by the fourth power of
the interval, up to its ends. (Scipy's `RotationSpline`, which has no angular acceleration at the ends, is off by the
square of the interval there, and some twenty times slower.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Self
from zipfile import BadZipFile

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._read_only import ReadOnlyArrays
from assembly.errors import InputError, number, positive, real_array
from assembly.kinematics.pose import UNIT_ROUNDING, UNIT_TOLERANCE, Pose

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

__all__ = ["Speed", "Trace"]

Array = NDArray[np.float64]
# Entries of a target, what such targets are, and the heading of a table of them.
_KINDS = {1: "numbers", 3: "points", 7: "poses"}
_HEADINGS = {
    1: ("time", "value"),
    3: ("time", "x", "y", "z"),
    7: ("time", "x", "y", "z", "qw", "qx", "qy", "qz"),
}
# Two traces meet where one ends and the other begins within this, relative to their largest coordinate; radians.
_MEETING = 1e-9
# Part of an interval by which rounding may make a duration shorter.
_DURATION_ROUNDING = 1e-9


class Speed(NamedTuple):
    """The largest speed from a sample to the next, and the one that is exceeded half of the time."""

    peak: float
    median: float


@dataclass(frozen=True, eq=False)
class Trace(ReadOnlyArrays):
    """A recorded motion of a target: points, poses, or values of a joint coordinate, at times.

    Parameters
    ----------
    times : (k,)
        Increasing, in seconds; two at least.
    targets : (k, 3), (k, 7) or (k,), or sequence of k Pose
        Points, or rows x y z qw qx qy qz, or values of a joint coordinate. Quaternions are normalized, and each is
        taken on the side of the one before: q and -q are the same turn. From one to the next the shorter turn is meant.
        Values are taken as they are: an angle of 3.1 that is followed by -3.1 goes back through zero, and `np.unwrap`
        makes such angles continuous.

    Raises
    ------
    InputError
        Wrong shapes, numbers that are not finite, times that do not increase, quaternions far from unit.
    """

    times: Array
    targets: Array

    def __post_init__(self) -> None:
        times = real_array("times", self.times, ("k",))
        if len(times) < 2:
            raise InputError("times has 1 entry; expected two at least")
        steps = np.diff(times)
        if not (steps > 0.0).all():
            k = int(np.argmin(steps > 0.0))
            raise InputError(f"times[{k + 1}] is {times[k + 1]} after {times[k]}; expected increasing times")
        targets = _target_rows("targets", self.targets, len(times))
        times.flags.writeable = targets.flags.writeable = False
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "targets", targets)

    @classmethod
    def through(cls, points: ArrayLike | Sequence[Pose], times: ArrayLike, rate: float = 1000.0) -> Self:
        """A computed motion: from rest through points or poses at given times to rest, evenly sampled.

        Smooth as a hand: velocity and acceleration are continuous. Between poses turns must be less than half a turn;
        a twist by more goes through several.

        Parameters
        ----------
        points : (k, 3), (k, 7) or (k,), or sequence of k Pose
        times : (k,)
        rate : float
            Samples per second, slightly more if needed to have one at both ends.

        Raises
        ------
        InputError
            As for a trace of the points; a rate that is not positive.
        """
        when = real_array("times", times, ("k",))
        path = cls(when, _target_rows("points", points, len(when)))
        count = max(int(np.ceil(path.duration * positive("rate", rate) - _DURATION_ROUNDING)), 1) + 1
        even = np.linspace(when[0], when[-1], count)
        return cls(even, path._evaluated(path._fit("clamped"), even))

    @classmethod
    def concatenate(cls, traces: Sequence[Trace], pause: float = 0.0) -> Self:
        """One trace after the other; the times go on from those of the first.

        Parameters
        ----------
        traces : sequence of Trace
            All of points, all of poses, or all of values; one at least.
        pause : float
            Seconds from the end of one to the begin of the next. With none, the next must begin where the one ends.

        Raises
        ------
        InputError
            No traces, ones of different kinds, a negative pause, or none where two do not meet.
        """
        if not traces:
            raise InputError("traces is empty; expected one trace at least")
        wait = number("pause", pause)
        if wait < 0.0:
            raise InputError(f"pause is {wait:g}; expected seconds, not below zero")
        times, targets = [traces[0].times], [traces[0].targets]
        for k, trace in enumerate(traces[1:], 1):
            if trace.kind != traces[0].kind:
                raise InputError(f"traces[{k}] has {trace.kind}; expected {traces[0].kind} as traces[0]")
            skip = 0
            if wait == 0.0:
                _require_meeting(f"traces[{k}]", traces[k - 1], trace)
                skip = 1
            times.append(trace.times[skip:] - trace.times[0] + (times[-1][-1] + wait))
            targets.append(trace.targets[skip:])
        return cls(np.concatenate(times), np.concatenate(targets))

    def then(self, other: Trace, pause: float = 0.0) -> Self:
        """The motion of another trace after the one of this, as `concatenate`."""
        return self.concatenate([self, other], pause)

    @property
    def kind(self) -> str:
        """What the targets are: "points", "poses" or "numbers"."""
        return _KINDS[_width(self.targets)]

    @property
    def duration(self) -> float:
        """Seconds from the first sample to the last."""
        return float(self.times[-1] - self.times[0])

    @property
    def positions(self) -> Array:
        """Points, or the origins of poses, (k, 3).

        Raises
        ------
        InputError
            Targets that are numbers.
        """
        if self.targets.ndim == 1:
            raise InputError("targets are numbers; expected points or poses")
        return self.targets[:, :3]

    @property
    def speed(self) -> Speed:
        """Peak and median speed of the points, of the origins of poses, or of the values, over seconds."""
        return self._speed(np.linalg.norm(np.diff(_places(self.targets), axis=0), axis=1))

    @property
    def turning(self) -> Speed:
        """Peak and median angular speed of poses, radians over seconds; zero for points and numbers."""
        if self.kind != "poses":
            return Speed(0.0, 0.0)
        e = self.targets[:, 3:]
        # |e - f| and |e + f| are twice the sine and twice the cosine of a quarter of the angle between them.
        sine, cosine = (np.linalg.norm(e[1:] - sign * e[:-1], axis=1) for sign in (1.0, -1.0))
        return self._speed(4.0 * np.arctan2(sine, cosine))

    def _speed(self, ways: Array) -> Speed:
        steps = np.diff(self.times)
        speeds = ways / steps
        order = np.argsort(speeds)
        passed = np.cumsum(steps[order])
        return Speed(float(speeds.max()), float(speeds[order[np.searchsorted(passed, 0.5 * passed[-1])]]))

    @cached_property
    def _spline(self) -> CubicSpline:
        return self._fit("not-a-knot")

    def _fit(self, ends: str) -> CubicSpline:
        from scipy.interpolate import CubicSpline  # a second of import

        return CubicSpline(self.times, self.targets, bc_type=ends)

    def at(self, t: ArrayLike) -> Array:
        """Targets at times (...), (..., 3), (..., 7) or (...); before the first sample the first, later the last."""
        times = np.asarray(t)
        asked = real_array("t", t, times.shape)
        return self._evaluated(self._spline, asked)

    def _evaluated(self, spline: CubicSpline, times: Array) -> Array:
        rows: Array = spline(np.clip(times, self.times[0], self.times[-1]))
        if self.kind == "poses":
            rows[..., 3:] /= np.linalg.norm(rows[..., 3:], axis=-1, keepdims=True)
        return rows

    def resampled(self, rate: float) -> Self:
        """The same motion at a uniform rate [Hz], from the first time to the last, or less than an interval before it.

        Raises
        ------
        InputError
            A rate that is not positive, or leaves a single sample.
        """
        frequency = positive("rate", rate)
        count = int(np.floor(self.duration * frequency + _DURATION_ROUNDING)) + 1
        if count < 2:
            raise InputError(f"rate is {frequency:g} for {self.duration:g} s; expected two samples at least")
        times = self.times[0] + np.arange(count) / frequency
        return type(self)(times, self.at(times))

    def save(self, path: str | PathLike[str]) -> None:
        """Write a `.csv` file or a `.npz`, with every bit.

        The heading of a `.csv` is time,x,y,z or time,x,y,z,qw,qx,qy,qz or time,value.

        Raises
        ------
        InputError
            A path with another ending.
        """
        file = _known_file(path)
        if file.suffix == ".npz":
            np.savez(file, times=self.times, targets=self.targets)
            return
        rows = np.column_stack([self.times, self.targets])
        lines = [",".join(_HEADINGS[_width(self.targets)]), *(",".join(map(repr, row)) for row in rows.tolist())]
        file.write_text("\n".join(lines) + "\n", encoding="utf-8")

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Self:
        """Read what `save` writes; of a `.csv` file any program may be the author.

        Raises
        ------
        InputError
            A path with another ending; a file that is no such table, the message names the line.
        OSError
            No such file.
        """
        file = _known_file(path)
        times, targets = _arrays(file) if file.suffix == ".npz" else _table(file)
        try:
            return cls(times, targets)
        except InputError as error:
            raise InputError(f"{file}: {error}") from None

    def __iter__(self) -> Iterator[tuple[float, Array]]:
        """A time and a target, (3,), (7,) or a number, after the other."""
        return zip(self.times.tolist(), self.targets, strict=True)

    def __len__(self) -> int:
        return len(self.times)

    def __repr__(self) -> str:
        return f"Trace({len(self)} {self.kind} in {self.duration:g} s, speed up to {self.speed.peak:.3g}/s)"


def _width(targets: Array) -> int:
    """How many numbers a target has."""
    return 1 if targets.ndim == 1 else int(targets.shape[1])


def _places(targets: Array) -> Array:
    """Points and the origins of poses (k, 3), or values (k, 1)."""
    return targets[:, None] if targets.ndim == 1 else targets[:, :3]


def _target_rows(name: str, value: ArrayLike | Sequence[Pose], count: int) -> Array:
    """Points (count, 3), values (count,), or pose rows (count, 7), unit quaternions on the side of the one before."""
    given: ArrayLike = value  # type: ignore[assignment]  # poses become rows
    if isinstance(value, (list, tuple)) and any(isinstance(entry, Pose) for entry in value):
        given = [entry.q if isinstance(entry, Pose) else entry for entry in value]
    try:
        shape = np.shape(given)
    except ValueError:
        raise InputError(f"{name} has rows of different lengths; expected points or poses") from None
    if shape not in ((count, 3), (count, 7), (count,)):
        expected = f"({count}, 3) for points, ({count}, 7) for poses or ({count},) for numbers"
        raise InputError(f"{name} has shape {shape}; expected {expected}")
    rows = real_array(name, given, shape)
    if shape == (count, 7):
        norms = np.linalg.norm(rows[:, 3:], axis=1)
        far = ~(np.abs(norms - 1.0) <= UNIT_TOLERANCE)
        if far.any():
            k = int(np.argmax(far))
            came = f"{name}[{k}, 3:] is {rows[k, 3:].tolist()} with norm {norms[k]:.6g}"
            raise InputError(f"{came}; expected a unit quaternion (w, x, y, z)")
        rows[:, 3:] /= np.where(np.abs(norms - 1.0) <= UNIT_ROUNDING, 1.0, norms)[:, None]
        turned_over = (rows[1:, 3:] * rows[:-1, 3:]).sum(axis=1) < 0.0
        rows[1:, 3:] *= np.cumprod(np.where(turned_over, -1.0, 1.0))[:, None]
    return rows


def _require_meeting(name: str, first: Trace, second: Trace) -> None:
    before, after = _places(first.targets), _places(second.targets)
    apart = float(np.linalg.norm(after[0] - before[-1]))
    size = float(max(np.abs(before).max(), np.abs(after).max()))
    end, begin = (row if first.kind == "poses" else np.empty(0) for row in (first.targets[-1], second.targets[0]))
    turn = 2.0 * float(min(np.linalg.norm(begin[3:] - end[3:]), np.linalg.norm(begin[3:] + end[3:])))
    if apart > _MEETING * size or turn > _MEETING:
        off = f"{apart:.3g} away" + (f", turned by {turn:.3g} rad," if turn > _MEETING else "")
        raise InputError(f"{name} begins {off} from where the one before ends; expected the same place, or a pause")


def _known_file(path: str | PathLike[str]) -> Path:
    file = Path(path)
    if file.suffix not in (".csv", ".npz"):
        raise InputError(f"path is {str(path)!r}; expected a name that ends with .csv or .npz")
    return file


def _arrays(file: Path) -> tuple[Array, Array]:
    try:
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as data:
            return data["times"], data["targets"]
    except (BadZipFile, EOFError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{file} is no file of a trace: {error}; expected arrays times and targets") from None


def _table(file: Path) -> tuple[Array, Array]:
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise InputError(f"{file} is no text: {error}; expected a table of numbers") from None
    heading, *rows = [[cell.strip(' "') for cell in line.split(",")] for line in lines] or [[""]]
    if tuple(heading) not in _HEADINGS.values():
        expected = " or ".join(",".join(_HEADINGS[width]) for width in (3, 7, 1))
        raise InputError(f"{file} line 1 is {','.join(heading)!r}; expected {expected}")
    values = []
    for k, row in enumerate(rows, 2):
        if row == [""]:
            continue
        try:
            values.append([float(cell) for cell in row])
        except ValueError as error:
            raise InputError(f"{file} line {k}: {error}; expected numbers") from None
        if len(row) != len(heading):
            came = f"{len(row)} value{'s' if len(row) > 1 else ''}"
            raise InputError(f"{file} line {k} has {came}; expected {','.join(heading)}")
    table = np.array(values, dtype=np.float64).reshape(-1, len(heading))
    return table[:, 0], table[:, 1] if len(heading) == 2 else table[:, 1:]
