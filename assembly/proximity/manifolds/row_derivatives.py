"""Rows of a manifold with exact first and second derivatives, from what each is between.

Rows of a manifold take arcs that lean for circles, and lines of what is round for its lowest points over a border; here
each begins there, and goes to where it is stationary.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from math import hypot, sqrt, tan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.geometry.recognition.forms import Cone, Cylinder, Sphere
from assembly.proximity.manifolds.manifold import Manifold
from assembly.proximity.manifolds.places import Affine, Arc, Place, Wall
from assembly.proximity.manifolds.records import (
    CORNER_A,
    CORNER_B,
    CROSSING,
    END,
    FRAME,
    LOWEST_A,
    LOWEST_B,
    NEAREST_RING,
    RIM,
    RING,
    SEGMENT,
)
from assembly.proximity.manifolds.regions import PlaneRegion
from assembly.proximity.manifolds.second_rates import ALIKE, Level, Ray, Row, Socket, skew

__all__ = ["all_straight", "flat_derivatives", "line_derivatives", "round_derivatives", "socket_row"]

Array = NDArray[np.float64]
NONE = np.empty(0)
# The sine of the angle at which borders cross that are tangent as far as rounding tells.
TANGENT = 1e-7
# What rounding may make of the gap of a ball in its socket, in parts of the coordinates.
ROUNDING = 1e-15


class _Segment(NamedTuple):
    """A record of `SEGMENT`."""

    begin: Array
    end: Array
    center: Array
    radius: float
    sweep: float


@lru_cache(maxsize=256)
def _segments_of(region: PlaneRegion) -> tuple[_Segment, ...]:
    """The borders of a region, read once: fields of NumPy's records take some microseconds each."""
    s = rows_of(SEGMENT, region.segments)
    return tuple(map(_Segment, s.begin, s.end, s.center, s.radius.tolist(), s.sweep.tolist()))


@lru_cache(maxsize=256)
def _frame_of(region: PlaneRegion) -> Array:
    """The origin of a region and its directions right and up, and its normal, (4, 3)."""
    frame = rows_of(FRAME, region.frame[None])[0]
    return np.array([frame.origin, frame.right, frame.up, frame.normal])


class _Posed:
    """A trimmed plane at x -> turn x + shift."""

    def __init__(self, region: PlaneRegion, turn: Array, shift: Array) -> None:
        origin, self.right, self.up, self.normal = _frame_of(region) @ turn.T
        self.origin: Array = origin + shift
        self._axes = np.array([self.right, self.up])
        self._segments = _segments_of(region)

    def flat(self, place: Array) -> Array:
        """Coordinates of a place seen along the normal."""
        return np.asarray(self._axes @ (place - self.origin))

    def lifted(self, xy: Array) -> Array:
        """The point of the plane at coordinates."""
        return np.asarray(self.origin + xy @ self._axes)

    def plane(self, place: Array) -> tuple[Place, Array]:
        """All of it, and the coordinates of what of it is at a place."""
        return Affine(self.origin, self._axes.T), self.flat(place)

    def border(self, k: int, place: Array) -> tuple[Place, Array]:
        """A border, and the coordinate of what of it is at a place."""
        s, at = self._segments[k], self.flat(place)
        if s.radius == 0.0:
            way = s.end - s.begin
            way = way / sqrt(way @ way)
            slope = (way @ self._axes)[:, None]
            return Affine(self.lifted(s.begin), slope), np.array([(at - s.begin) @ way])
        off = at - s.center
        return Arc(self.lifted(s.center), s.radius * self.right, s.radius * self.up), np.array([np.arctan2(*off[::-1])])

    def corner(self, number: float) -> Place:
        """The beginning of a border, or the middle of an arc."""
        s = self._segments[int(number)]
        at = s.begin
        if number % 1.0:
            out = 0.5 * (s.begin + s.end) - s.center
            at = s.center + s.radius / np.linalg.norm(out) * out
        return Affine(self.lifted(at), np.empty((3, 0)))


def _told(manifold: Manifold) -> Iterator[tuple[list[float], tuple[float, Array, Array]]]:
    """What each row is of, and its gap, normal and place."""
    rows = zip(manifold.gaps.tolist(), manifold.normals, manifold.places, strict=True)
    return zip(manifold.kinds.tolist(), rows, strict=True)


def flat_derivatives(a: PlaneRegion, b: PlaneRegion, turn: Array, shift: Array, manifold: Manifold) -> Sequence[Row]:
    """Of the rows of two plane faces, the second one at x -> turn x + shift."""
    first, second = _Posed(a, np.eye(3), np.zeros(3)), _Posed(b, turn, shift)
    found = []
    for (kind, i, j), at in _told(manifold):
        place = at[2]
        stays, moves = first.plane(place), second.plane(place)
        if kind == CORNER_A:
            stays = first.corner(i), NONE
        elif kind == CORNER_B:
            moves = second.corner(j), NONE
        if kind in (CROSSING, LOWEST_A):
            stays = first.border(int(i), place)
        if kind in (CROSSING, LOWEST_B):
            moves = second.border(int(j), place)
        if kind == CROSSING and _are_tangent(stays, moves, first.normal):
            # Where borders touch they do not cross for long: what is on the first stays there.
            stays = Affine(place - at[0] * first.normal, np.empty((3, 0))), NONE
            moves = second.plane(place)
        is_straight = _is_straight((a, b), kind, i, j)
        found.append((Ray.there if is_straight else Ray.near)(stays, moves, first.normal, at))
    return found


def _is_straight(regions: tuple[PlaneRegion, PlaneRegion], kind: float, i: float, j: float) -> bool:
    """Whether a row of two plane faces is of straight borders: then it is where the manifold has it."""
    if kind in (LOWEST_A, LOWEST_B):
        return False
    is_first = kind == CORNER_B or _segments_of(regions[0])[int(i)].radius == 0.0
    return is_first and (kind == CORNER_A or _segments_of(regions[1])[int(j)].radius == 0.0)


def all_straight(a: PlaneRegion, b: PlaneRegion, manifold: Manifold) -> bool:
    """Whether all rows of two plane faces are of straight borders."""
    return all(_is_straight((a, b), kind, i, j) for kind, i, j in manifold.kinds.tolist())


def _are_tangent(one: tuple[Place, Array], other: tuple[Place, Array], n: Array) -> bool:
    s, t = (place.at(x)[1][:, 0] for place, x in (one, other))
    return bool(abs(s @ skew(n) @ t) <= TANGENT * np.linalg.norm(s) * np.linalg.norm(t))


class _PosedWall:
    """A cylinder or a cone at x -> turn x + shift."""

    def __init__(self, form: Cylinder | Cone, turn: Array, shift: Array) -> None:
        self._axis: Array = turn @ form.axis
        self._around = skew(self._axis)
        self.origin: Array = turn @ (form.apex if isinstance(form, Cone) else form.point) + shift
        self._radius = 0.0 if isinstance(form, Cone) else form.radius
        self._widening = tan(form.half_angle) if isinstance(form, Cone) else 0.0

    def toward(self, way: Array) -> Wall:
        """The surface with angles from a direction across its axis."""
        right = way - float(way @ self._axis) * self._axis
        right = right / sqrt(right @ right)
        return Wall(self.origin, self._axis, right, self._around @ right, self._radius, self._widening)


def _circle(wall: Wall, height: float) -> Arc:
    """The circle of a wall at a height."""
    radius = wall.radius + height * wall.widening
    return Arc(wall.origin + height * wall.axis, radius * wall.right, radius * wall.up)


def line_derivatives(
    region: PlaneRegion, form: Cylinder | Cone | Sphere, turn: Array, shift: Array, manifold: Manifold
) -> tuple[Sequence[Row], float]:
    """Of the rows of a plane face and what is round, at x -> turn x + shift; and a bound of gaps of the whole pair.

    Over the plane what is round and full is convex. So it is nowhere below its tangent plane where its lowest row is,
    and nowhere below the lower end of its line.
    """
    plane, found = _Posed(region, np.eye(3), np.zeros(3)), []
    n = plane.normal
    if isinstance(form, Sphere):
        center = Affine(turn @ form.center + shift, np.empty((3, 0)))
        (_, at), *_ = _told(manifold)
        return [Level(*at, False, NONE, center, plane.origin, None)], manifold.bound
    wall = _PosedWall(form, turn, shift).toward(-n)
    ends = [_circle(wall, height).at(np.zeros(1))[0] for height in form.heights]
    for (kind, i, end), at in _told(manifold):
        place = at[2]
        if kind == END:
            moves: tuple[Place, Array] = _circle(wall, form.heights[int(end)]), np.zeros(1)
            stays = plane.plane(ends[int(end)])
            if wall.radius + form.heights[int(end)] * wall.widening <= 0.0:
                moves = Affine(ends[int(end)], np.empty((3, 0))), NONE
        else:
            moves = wall, np.array([(place - wall.origin) @ wall.axis, 0.0])
            stays = plane.border(int(i), place)
        found.append(Ray.near(stays, moves, n, at))
    lowest = min(found, key=lambda row: row.gap)
    slope = -np.array([lowest.normal @ plane.right, lowest.normal @ plane.up])
    over_face = lowest.gap + _least(region, slope) - float(slope @ plane.flat(lowest.place))
    whole = min(float((end - plane.origin) @ n) for end in ends)
    return found, min(max(whole, over_face), lowest.gap) - float(manifold.gaps.min() - manifold.bound)


def _least(region: PlaneRegion, slope: Array) -> float:
    """The least of slope.x over a region."""
    segments = _segments_of(region)
    least = min(float(s.begin @ slope) for s in segments)
    way = -slope / max(sqrt(slope @ slope), 1e-300)
    for s in segments:
        if s.radius > 0.0:
            # An arc turns by a quarter at most: what is within it is on one side of its chord.
            (x, y), (u, v) = s.end - s.begin, s.center + s.radius * way - s.begin
            if (x * v - y * u) * s.sweep <= 0.0:
                least = min(least, float((s.center + s.radius * way) @ slope))
    return least


def round_derivatives(
    hollow: Cylinder | Cone, full: Cylinder | Cone, turn: Array, shift: Array, manifold: Manifold
) -> Sequence[Row]:
    """Of the rows of a bore and a shaft, or of cones: what is full at x -> turn x + shift, seen from the wall."""
    found = []
    here = np.eye(3), np.zeros(3)
    rings = _PosedWall(hollow, *here), _PosedWall(full, turn, shift)
    rims = _PosedWall(full, *here), _PosedWall(hollow, turn.T, -turn.T @ shift)
    for (kind, *_), (gap, normal, place) in _told(manifold):
        is_ring = kind in (RING, NEAREST_RING)
        if not is_ring:
            normal, place = -turn.T @ normal, turn.T @ (place - shift)
        wall, other = rings if is_ring else rims
        stays, moves = wall.toward(-normal if is_ring else normal), other.toward(place - other.origin)
        # Normals of a wall by their angle are right - widening axis, over the length of that.
        size = (-1.0 if is_ring else 1.0) / hypot(1.0, stays.widening)
        circle: Place = _circle(moves, float((place - moves.origin) @ moves.axis))
        of, x = (Affine(place, np.empty((3, 0))), NONE) if kind == RIM else (circle, np.zeros(1))
        angle = None if kind == RING else (size * stays.up, -size * stays.right)
        found.append(Level(gap, normal, place, not is_ring, x, of, stays.origin, angle))
    return found


def socket_row(hollow: Sphere, full: Sphere, turn: Array, shift: Array) -> tuple[Sequence[Row], float] | None:
    """The row of a ball at x -> turn x + shift in its socket, and a bound of all gaps; None if its center is not in it.

    Both are taken to be whole: where faces end, gaps are larger.
    """
    center = turn @ full.center + shift
    away = center - hollow.center
    apart = float(np.linalg.norm(away))
    if apart >= hollow.radius:
        return None
    if apart <= ALIKE * hollow.radius:
        # All directions are nearest ones. It is taken to lie on the side of -z.
        normal, middle = np.array([0.0, 0.0, 1.0]), 0.0
    else:
        normal, middle = -away / apart, apart
    gap = hollow.radius - full.radius - apart
    row = Socket(gap, normal, center - full.radius * normal, False, NONE, center, middle)
    off = ROUNDING * (float(np.abs(hollow.center).max() + np.abs(center).max()) + hollow.radius + full.radius)
    return [row], gap - hollow.deviation - full.deviation - off
