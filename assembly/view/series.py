"""What changes over a trajectory, frame by frame, and its values between frames."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import permutations, product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.assembly import Assembly
from assembly.errors import InputError, real_array
from assembly.kinematics.ellipsoid import Ellipsoid
from assembly.kinematics.pose import pose_rows
from assembly.solve.solution import Solution
from assembly.view.item import Color
from assembly.view.motion import between, quaternions, rotations, turned

__all__ = [
    "Ellipsoids",
    "Pairs",
    "Trajectory",
    "contact_series",
    "ellipsoid_series",
    "poses_at",
    "solution_rows",
    "stills",
    "trajectory_rows",
]

Array = NDArray[np.float64]
Trajectory = ArrayLike | Sequence[Solution]

# The 24 rotations that map coordinate axes to coordinate axes, that is the ways to number the axes of an ellipsoid.
_NAMINGS = [
    naming
    for order in permutations(range(3))
    for signs in product((1.0, -1.0), repeat=3)
    if np.linalg.det(naming := np.eye(3)[:, order] * signs) > 0.0
]


@dataclass(frozen=True, eq=False)
class Pairs:
    """A contact at k times: points (k, 2, 3), normals (k, 3), gaps (k,), and shown (k,), 1 where there is a pair."""

    name: str
    points: Array
    normals: Array
    gaps: Array
    shown: Array


@dataclass(frozen=True, eq=False)
class Ellipsoids:
    """An ellipsoid at k times: centers (k, 3), axes (k, 3, 3), right-handed, and lengths (k, 3)."""

    centers: Array
    axes: Array
    lengths: Array
    color: Color | None


def _parts(times: Array, frames: int) -> tuple[NDArray[np.int64], Array]:
    """The frame before each time, and the part of the way to the next."""
    before = np.minimum(times.astype(np.int64), max(frames - 2, 0))
    return before, times - before


def _values(series: Array, times: Array) -> Array:
    """A series (frames, ...) at times, straight from frame to frame."""
    before, part = _parts(times, len(series))
    part = part.reshape(-1, *[1] * (series.ndim - 1))
    after = np.minimum(before + 1, len(series) - 1)
    result: Array = (1.0 - part) * series[before] + part * series[after]
    return result


def poses_at(q: Array, times: Array) -> Array:
    """Poses (k, n, 7) at times, of a trajectory (frames, n, 7)."""
    if len(q) == 1:
        return q
    before, part = _parts(times, len(q))
    return between(q[before], q[before + 1], part[:, None, None])


def _entries(value: object) -> list[Any] | None:
    """What an iterable other than text yields."""
    return list(value) if isinstance(value, Iterable) and not isinstance(value, (str, bytes)) else None


def solution_rows(scene: Assembly, solution: Solution) -> Array:
    """Poses (n, 7) of a scene's bodies in a solution."""
    return np.array([solution.pose(body).q for body in scene.bodies])


def trajectory_rows(scene: Assembly, trajectory: Trajectory) -> tuple[Array, list[Solution]]:
    """Poses (frames, n, 7) of a trajectory, and its solutions where it consists of them.

    Raises
    ------
    InputError, TypeError
        Another shape, fewer than two frames, a quaternion far from unit, a solution of other bodies.
    """
    count = len(scene.bodies)
    if isinstance(trajectory, Solution):
        raise TypeError("trajectory is one Solution; expected a sequence of them, or poses of shape (frames, n, 7)")
    entries = None if isinstance(trajectory, np.ndarray) else _entries(trajectory)
    if entries is not None and any(isinstance(entry, Solution) for entry in entries):
        rows = np.empty((len(entries), count, 7))
        for k, entry in enumerate(entries):
            if not isinstance(entry, Solution):
                raise TypeError(f"trajectory[{k}] is of type {type(entry).__name__}; expected a Solution, as others")
            try:
                rows[k] = solution_rows(scene, entry)
            except InputError as error:
                raise InputError(f"trajectory[{k}] is a solution of another scene: {error}") from None
        return _several(rows), entries
    poses: Any = trajectory if entries is None else entries
    rows = real_array("trajectory", poses, ("frames", count, 7))
    return _several(np.array([pose_rows(f"trajectory[{k}]", frame, count) for k, frame in enumerate(rows)])), []


def _several(q: Array) -> Array:
    if len(q) < 2:
        raise InputError(f"trajectory has {len(q)} frame; expected two at least")
    return q


def contact_series(solutions: Sequence[Solution], times: Array) -> list[Pairs]:
    """Contacts that some of the solutions have a pair of."""
    names = list(dict.fromkeys(name for solution in solutions for name in solution.contacts))
    series = []
    for name in names:
        pairs = [solution.contacts.get(name) for solution in solutions]
        finite = [k for k, pair in enumerate(pairs) if pair is not None and np.isfinite(pair.points).all()]
        if not finite:
            continue
        # A frame without a pair of points takes those of the nearest frame that has one.
        chosen = [pairs[min(finite, key=lambda other: abs(other - k))] for k in range(len(pairs))]
        known = [pair for pair in chosen if pair is not None]
        points = np.array([pair.points for pair in known])
        normals = np.array([pair.normal for pair in known])
        gaps = np.array([pair.gap for pair in known])
        shown = np.isin(np.arange(len(pairs)), finite).astype(np.float64)
        parts = (_values(values, times) for values in (points, normals, gaps, shown))
        series.append(Pairs(name, *parts))
    return series


def stills(ellipsoids: Ellipsoid | Iterable[Ellipsoid]) -> list[Ellipsoids]:
    """Ellipsoids that do not change."""
    shapes = _entries([ellipsoids] if isinstance(ellipsoids, Ellipsoid) else ellipsoids)
    if shapes is None:
        raise TypeError(f"ellipsoids is {ellipsoids!r}; expected an Ellipsoid or several")
    found = []
    for k, shape in enumerate(shapes):
        if not isinstance(shape, Ellipsoid):
            raise TypeError(f"ellipsoids[{k}] is {shape!r}; expected an Ellipsoid")
        found.append(_joined([shape], np.zeros(1)))
    return found


def ellipsoid_series(
    ellipsoids: Ellipsoid | Iterable[Ellipsoid | Iterable[Ellipsoid]], frames: int, times: Array
) -> list[Ellipsoids]:
    """Ellipsoids of every frame, one or as many in each; a single one for all frames stays.

    Raises
    ------
    InputError, TypeError
        Not an entry for each frame, not as many ellipsoids in each.
    """
    if isinstance(ellipsoids, Ellipsoid):
        return stills(ellipsoids)
    entries = _entries(ellipsoids)
    if entries is None:
        raise TypeError(f"ellipsoids is {ellipsoids!r}; expected an Ellipsoid, or one or several for each frame")
    if not entries:
        return []
    if len(entries) != frames:
        raise InputError(
            f"ellipsoids has {len(entries)} entries; expected {frames}, one for each frame, or an Ellipsoid that stays"
        )
    rows: list[list[Ellipsoid]] = []
    for k, entry in enumerate(entries):
        row = [entry] if isinstance(entry, Ellipsoid) else _entries(entry)
        if row is None or not all(isinstance(shape, Ellipsoid) for shape in row):
            raise TypeError(f"ellipsoids[{k}] is {entry!r}; expected an Ellipsoid or several")
        if rows and len(row) != len(rows[0]):
            raise InputError(f"ellipsoids[{k}] holds {len(row)}; expected {len(rows[0])}, as in the first frame")
        rows.append(row)
    return [_joined(column, times) for column in zip(*rows, strict=True)]


def _joined(shapes: Sequence[Ellipsoid], times: Array) -> Ellipsoids:
    """One ellipsoid's frames, its axes named so that they turn least from one to the next."""
    last = np.eye(3)
    axes, lengths = [], []
    for k, shape in enumerate(shapes):
        own = shape.axes * [1.0, 1.0, np.sign(np.linalg.det(shape.axes))]
        naming = np.eye(3) if k == 0 else max(_NAMINGS, key=lambda way: float((last * (own @ way)).sum()))
        last = own @ naming
        axes.append(last)
        lengths.append(np.abs(naming.T) @ shape.lengths)
    e = quaternions(np.array(axes))
    before, part = _parts(times, len(e))
    after = np.minimum(before + 1, len(e) - 1)
    return Ellipsoids(
        _values(np.array([shape.center for shape in shapes]), times),
        rotations(turned(e[before], e[after], part[:, None])),
        _values(np.array(lengths), times),
        shapes[0].color,
    )
