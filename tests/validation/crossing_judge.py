"""The least signed distance of two parts by closed forms: a judge of crossings that uses nothing of the library.

The surface of each part is sampled on grids, and the signed distances of these points from the other part are taken.
From the lowest ones steps go down on the surface. What is told is the signed distance of a point of one part from the
other, so that below zero they cross for certain, but for rounding: 1e-15 of the size. Two equal parts at one place
cross without such a point, so points inside of one are looked at as well. A sheet has no inside: that it comes through
a solid is told by points of the sheet, and two sheets cannot be judged.

What is missed: the least distance is lower than what is told where none of the points from which steps go down lies in
its basin. These are the `STARTS` lowest of every patch that are `APART` spacings from each other, of those not higher
than the lowest of all by more than `COVER` spacings; signed distances change by no more than the length of a way, so
no lower place is farther from all samples. A spacing is 1/70 of a part's extent or so. On a plane face before a
convex solid there is one basin, which is found. A second basin within `APART` spacings of a lower start, and those
behind the first `STARTS`, are missed. In a basin the least is found to 1e-11 of the size where the distance is smooth
or has kinks across the border of a patch, as before an edge. Where parts are deep in each other the lowest points are
on kinks, which are followed to a tenth of the depth at worst; whether parts cross does not depend on these.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tests.validation.exact_solids import Distance, Part, Patch

Array = NDArray[np.float64]

# Lowest points of a patch that steps go down from, and how far apart they are, in spacings.
STARTS, APART = 5, 3.0
# A point of a surface is no farther from all samples than that, in spacings: 0.71 on a patch without border; at a
# border inside of a cell a diagonal to the border, and half a spacing along it.
COVER = 2.0
# Directions that are tried at a time, and how small steps become, in parts of the size.
DIRECTIONS, CLOSE, ROUNDS = 14, 1e-11, 250


def rotation(quaternion: ArrayLike) -> Array:
    """The matrix of a unit quaternion w, x, y, z."""
    w, *u = np.asarray(quaternion, dtype=float)
    cross = np.array([[0.0, -u[2], u[1]], [u[2], 0.0, -u[0]], [-u[1], u[0], 0.0]])
    return np.asarray(np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross)


class Motion(NamedTuple):
    """Where a body stands: x -> turn x + place."""

    turn: Array
    place: Array

    @classmethod
    def of(cls, pose: ArrayLike) -> Motion:
        """Of a row x y z qw qx qy qz."""
        row = np.asarray(pose, dtype=float)
        return cls(rotation(row[3:]), row[:3])

    def seen_from(self, other: Motion) -> Motion:
        return Motion(other.turn.T @ self.turn, other.turn.T @ (self.place - other.place))

    def apply(self, points: Array) -> Array:
        return points @ self.turn.T + self.place

    def back(self, points: Array) -> Array:
        return (points - self.place) @ self.turn


def _lowest(values: Array, points: Array, apart: float) -> list[int]:
    """Places of the lowest values whose points are so far apart."""
    found: list[int] = []
    order = np.argsort(values, kind="stable")
    while len(order) and len(found) < STARTS:
        found.append(int(order[0]))
        order = order[np.linalg.norm(points[order] - points[order[0]], axis=1) > apart]
    return found


def _descend(patch: Patch, distance: Distance, start: Array, values: Array, step: float, close: float) -> float:
    """The lowest distance that steps in random directions come to on a patch, from some starts.

    Steps become shorter where no direction leads down. What is not within the patch is no place to go to: its border
    is that of others.
    """
    rng = np.random.default_rng(0)
    low, high = np.where(patch.bordered, patch.low, -np.inf), np.where(patch.bordered, patch.high, np.inf)
    at, best, steps = start.copy(), values.copy(), np.full(len(start), step / patch.stretch)
    count, k = at.shape
    for _ in range(ROUNDS):
        ways = rng.normal(size=(count, DIRECTIONS, k))
        ways /= np.linalg.norm(ways, axis=2)[..., None]
        tried = np.clip(at[:, None] + steps[:, None, None] * ways, low, high).reshape(-1, k)
        told = distance(patch.at(tried))
        if patch.within is not None:
            told = np.where(patch.within(tried), told, np.inf)
        least = DIRECTIONS * np.arange(count) + told.reshape(count, DIRECTIONS).argmin(axis=1)
        is_lower = told[least] < best
        at[is_lower], best[is_lower] = tried[least][is_lower], told[least][is_lower]
        steps = np.where(is_lower, np.minimum(1.2 * steps, step / patch.stretch), 0.6 * steps)
        if steps.max() * patch.stretch < close:
            break
    return float(best.min())


class _Side(NamedTuple):
    """The surface of one part before the distance from the other one."""

    part: Part
    distance: Distance
    values: Array

    @property
    def bound(self) -> float:
        """What no point of the surface is lower than."""
        return float(self.values.min()) - COVER * self.part.spacing

    def refined(self, least: float) -> float:
        """The lowest of the surface, no higher than `least`."""
        first = 0
        for patch, parameters in zip(self.part.patches, self.part.parameters, strict=True):
            values = self.values[first : first + len(parameters)]
            points = self.part.samples[first : first + len(parameters)]
            first += len(parameters)
            low = np.flatnonzero(values <= least + COVER * self.part.spacing)
            if len(low):
                starts = low[_lowest(values[low], points[low], APART * self.part.spacing)]
                close = CLOSE * self.part.size
                found = _descend(patch, self.distance, parameters[starts], values[starts], self.part.spacing, close)
                least = min(least, found)
        return least


def _sides(a: Part, b: Part, pose: Motion) -> tuple[_Side, _Side]:
    if not (a.is_closed or b.is_closed):
        raise ValueError(f"{a.name} and {b.name} are sheets; expected one of them to have an inside")

    def from_a(points: Array) -> Array:
        return a.distance(pose.apply(points))

    def from_b(points: Array) -> Array:
        return b.distance(pose.back(points))

    return _Side(b, from_a, from_a(b.samples)), _Side(a, from_b, from_b(a.samples))


def _common(a: Part, b: Part, pose: Motion) -> float:
    """Of points inside of one part, the lowest of what they are in both; for parts that are nearly equal."""
    return min(
        float(np.maximum(a.distance(points), b.distance(pose.back(points))).min(initial=np.inf))
        for points in (a.inner, pose.apply(b.inner))
    )


def sampled_distance(a: Part, b: Part, pose: Motion) -> float:
    """The least signed distance of samples alone, which is never too low."""
    return min(float(side.values.min()) for side in _sides(a, b, pose))


def least_signed_distance(a: Part, b: Part, pose: Motion) -> float:
    """The least signed distance of a point of one part's surface from the other part, which stands at a pose.

    Below zero where they cross: how deep a point is in the other one. See the head of this file for what is missed.
    """
    sides = _sides(a, b, pose)
    least = min(_common(a, b, pose), *(float(side.values.min()) for side in sides))
    for side in sides:
        least = side.refined(least)
    return least


def crossing_depth(a: Part, b: Part, pose: Motion) -> float:
    """How deep two parts are in each other, at most by what `least_signed_distance` tells; zero if they are apart."""
    sides = _sides(a, b, pose)
    # Apart for certain: of every point of either surface, and none of the two inside of the other.
    if all(side.bound > 0.0 for side in sides):
        return 0.0
    return max(0.0, -least_signed_distance(a, b, pose))
