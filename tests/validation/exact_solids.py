"""Solids with signed distances and surfaces in closed form, for judges.

`Part.shape` is made by the library, for the scenes that are judged; nothing else is. That both are the same solid is a
test of its own (`test_crossing_judge.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

import assembly as asm
from assembly.geometry.shapes.path import Path

Array = NDArray[np.float64]
Distance = Callable[[Array], Array]

# Samples of a part's surface, about.
SAMPLES = 5000


class Patch(NamedTuple):
    """A piece of a surface: where parameters of a box are mapped to, if they are within.

    Two parameters are lengths on the surface. Three are a place in space, which is mapped to the surface of a round
    body: no poles. Steps stay in the box where it is a border, as are the ends of a wall.
    """

    low: Array
    high: Array
    at: Callable[[Array], Array]
    bordered: Array
    within: Callable[[Array], NDArray[np.bool_]] | None = None
    # Length on the surface over that of the parameters, at most.
    stretch: float = 1.0

    def grid(self, spacing: float) -> Array:
        """Parameters so far apart, those of the borders among them; of three, those of the faces of their box."""
        ticks = [
            np.linspace(low, high, 1 + int(np.ceil(self.stretch * (high - low) / spacing)))
            for low, high in zip(self.low, self.high, strict=True)
        ]
        if len(ticks) == 2:
            found = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, 2)
        else:
            sides = [
                np.stack(
                    np.meshgrid(*(t[[0, -1]] if i == k else t for i, t in enumerate(ticks)), indexing="ij"), axis=-1
                )
                for k in range(3)
            ]
            found = np.concatenate([side.reshape(-1, 3) for side in sides])
        return found if self.within is None else found[self.within(found)]


@dataclass(frozen=True)
class Part:
    """A body that is judged: how the library makes it, its signed distance, its surface, and a box around it.

    `is_closed` is False of a sheet, whose distance has no sign.
    """

    name: str
    shape: Any
    distance: Distance
    patches: tuple[Patch, ...]
    half_extents: Array
    is_closed: bool = True

    @property
    def size(self) -> float:
        """The diameter of a ball around it."""
        return 2.0 * float(np.linalg.norm(self.half_extents))

    @cached_property
    def spacing(self) -> float:
        x, y, z = 2.0 * self.half_extents
        return float(np.sqrt(2.0 * (x * y + y * z + z * x) / SAMPLES))

    @cached_property
    def parameters(self) -> tuple[Array, ...]:
        """Of samples, a patch each."""
        return tuple(patch.grid(self.spacing) for patch in self.patches)

    @cached_property
    def samples(self) -> Array:
        """Points of the surface, (n, 3), patch after patch."""
        return np.concatenate([patch.at(p) for patch, p in zip(self.patches, self.parameters, strict=True)])

    @cached_property
    def inner(self) -> Array:
        """Points inside, (n, 3); none in a sheet."""
        tried = np.random.default_rng(0).uniform(-1.0, 1.0, (400, 3)) * self.half_extents
        return tried[self.distance(tried) < 0.0][:40]


def polygon_distance(corners: ArrayLike) -> Distance:
    """Of plane points from a polygon; inside by the crossings of a ray."""
    a = np.asarray(corners, dtype=float)
    b = np.roll(a, -1, axis=0)
    edge = b - a
    rise = np.where(edge[:, 1] == 0.0, 1.0, edge[:, 1])

    def distance(p: Array) -> Array:
        off = p[:, None] - a
        part = np.clip((off * edge).sum(axis=2) / (edge * edge).sum(axis=1), 0.0, 1.0)
        nearest = np.sqrt(((off - part[..., None] * edge) ** 2).sum(axis=2).min(axis=1))
        straddles = (a[:, 1] <= p[:, 1:]) != (b[:, 1] <= p[:, 1:])
        left = p[:, :1] < a[:, 0] + edge[:, 0] * off[..., 1] / rise
        return np.asarray(np.where((straddles & left).sum(axis=1) % 2 == 1, -nearest, nearest))

    return distance


def box_distance(half: ArrayLike) -> Distance:
    """From a box about the origin, in the plane or in space; of a box without height, of a sheet."""
    h = np.asarray(half, dtype=float)

    def distance(p: Array) -> Array:
        q = np.abs(p) - h
        return np.asarray(np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0))

    return distance


def less_discs(outline: Distance, discs: ArrayLike) -> Distance:
    """From a plane region less discs inside of it, clear of each other, rows (x, y, radius)."""
    rows = np.asarray(discs, dtype=float).reshape(-1, 3)

    def distance(p: Array) -> Array:
        in_discs = rows[:, 2] - np.hypot(p[:, :1] - rows[:, 0], p[:, 1:2] - rows[:, 1])
        return np.asarray(np.maximum(outline(p), in_discs.max(axis=1, initial=-np.inf)))

    return distance


def extruded_distance(outline: Distance, half: float) -> Distance:
    """From a plane region drawn along z from -half to half."""

    def distance(p: Array) -> Array:
        across, along = outline(p[:, :2]), np.abs(p[:, 2]) - half
        return np.minimum(np.maximum(across, along), 0.0) + np.hypot(np.maximum(across, 0.0), np.maximum(along, 0.0))

    return distance


def ellipsoid_distance(half_axes: ArrayLike) -> Distance:
    """From an ellipsoid: the foot x of a point y is x_i = a_i^2 y_i / (a_i^2 - a_min^2 + t), where t > 0 puts it on it.

    With the sum s of (x_i / a_i)^2, 1 / sqrt(s) - 1 is nearly straight in t and bends so that Newton's method comes to
    its root from the left of it, in a few steps, as for the radius of a trust region.
    """
    a = np.asarray(half_axes, dtype=float)
    wider = a * a - a.min() ** 2

    def distance(p: Array) -> Array:
        # A coordinate of exactly zero may have its foot off the plane of symmetry.
        y = np.maximum(np.abs(p), 1e-14 * a.min())
        t = (a * y - wider).max(axis=1)
        for _ in range(30):
            below = t[:, None] + wider
            squares = (a * y / below) ** 2
            total = squares.sum(axis=1)
            t = t + np.maximum((np.sqrt(total) - 1.0) * total / (squares / below).sum(axis=1), 0.0)
        off = np.linalg.norm(y - a * a * y / (t[:, None] + wider), axis=1)
        return np.asarray(np.where(((y / a) ** 2).sum(axis=1) < 1.0, -off, off))

    return distance


class Outline(NamedTuple):
    """A piece of a plane outline: a point for a length along it, and whether it closes smoothly."""

    length: float
    at: Callable[[Array], Array]
    closes: bool


def segments(corners: ArrayLike) -> list[Outline]:
    """The sides of a polygon."""
    a = np.asarray(corners, dtype=float)
    return [_segment(start, end) for start, end in zip(a, np.roll(a, -1, axis=0), strict=True)]


def _segment(start: Array, end: Array) -> Outline:
    length = float(np.linalg.norm(end - start))
    return Outline(length, lambda s: start + (s / length)[:, None] * (end - start), False)


def circle(x: float, y: float, radius: float) -> Outline:
    return Outline(
        2.0 * np.pi * radius,
        lambda s: np.stack([x + radius * np.cos(s / radius), y + radius * np.sin(s / radius)], axis=1),
        True,
    )


def _wall(outline: Outline, half: float) -> Patch:
    return Patch(
        np.array([0.0, -half]),
        np.array([outline.length, half]),
        lambda p: np.column_stack([outline.at(p[:, 0]), p[:, 1]]),
        np.array([not outline.closes, True]),
    )


def _cap(region: Distance | None, half_extents: Array, z: float) -> Patch:
    half = half_extents[:2]
    return Patch(
        -half,
        half,
        lambda p: np.column_stack([p, np.full(len(p), z)]),
        np.array([True, True]),
        None if region is None else lambda p: region(p) <= 0.0,
    )


def extruded(name: str, shape: Any, region: Distance, outlines: Iterable[Outline], half_extents: ArrayLike) -> Part:
    """A plane region drawn along z, about the origin; its edges are the borders of its walls."""
    h = np.asarray(half_extents, dtype=float)
    patches = [*(_wall(outline, h[2]) for outline in outlines), _cap(region, h, -h[2]), _cap(region, h, h[2])]
    return Part(name, shape, extruded_distance(region, h[2]), tuple(patches), h)


def _round(half: ArrayLike, at: Callable[[Array], Array], stretch: float = 1.0) -> tuple[Patch]:
    """One patch of places in space, from the faces of a box that are mapped onto all of a surface."""
    h = np.asarray(half, dtype=float)
    return (Patch(-h, h, at, np.array([False] * 3), stretch=stretch),)


def box(x: float, y: float, z: float, name: str = "box") -> Part:
    half = np.array([x, y, z]) / 2.0
    corners = half[:2] * [[-1, -1], [1, -1], [1, 1], [-1, 1]]
    return extruded(name, asm.shapes.box(x, y, z), box_distance(half[:2]), segments(corners), half)


def sheet(x: float, y: float, name: str = "sheet") -> Part:
    half = np.array([x / 2.0, y / 2.0, 0.0])
    return Part(name, asm.shapes.plane(x, y), box_distance(half), (_cap(None, half, 0.0),), half, is_closed=False)


def plate(x: float, y: float, z: float, holes: Sequence[tuple[float, float, float]], name: str = "plate") -> Part:
    half = np.array([x, y, z]) / 2.0
    corners = half[:2] * [[-1, -1], [1, -1], [1, 1], [-1, 1]]
    outlines = [*segments(corners), *(circle(*hole) for hole in holes)]
    return extruded(name, asm.shapes.plate(x, y, z, holes), less_discs(box_distance(half[:2]), holes), outlines, half)


def pin(radius: float, height: float, name: str = "pin") -> Part:
    def region(p: Array) -> Array:
        return np.hypot(p[:, 0], p[:, 1]) - radius

    shape = asm.shapes.solid_cylinder(radius, height)
    return extruded(name, shape, region, [circle(0.0, 0.0, radius)], (radius, radius, height / 2.0))


def tube(outer: float, inner: float, height: float, name: str = "tube") -> Part:
    """Open at both ends."""

    def region(p: Array) -> Array:
        r = np.hypot(p[:, 0], p[:, 1])
        return np.maximum(r - outer, inner - r)

    # A circle of four arcs, each a rational parabola.
    corners = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]])
    knots, weights = np.repeat(np.arange(5.0), [3, 2, 2, 2, 3]), np.array([1, np.sqrt(0.5)] * 4 + [1])
    disc, hole = (asm.NurbsCurve(r * corners, knots, 2, weights) for r in (outer, inner))
    shape = asm.shapes.extrusion(disc, height, [hole])
    outlines = [circle(0.0, 0.0, outer), circle(0.0, 0.0, inner)]
    return extruded(name, shape, region, outlines, (outer, outer, height / 2.0))


def polygonal(corners: ArrayLike, height: float, name: str) -> Part:
    a = np.asarray(corners, dtype=float)
    lengths = np.linalg.norm(np.roll(a, -1, axis=0) - a, axis=1)
    sides = [
        asm.NurbsCurve([start, end], [0.0, 0.0, length, length], 1)
        for start, end, length in zip(a, np.roll(a, -1, axis=0), lengths, strict=True)
    ]
    half = np.array([*np.abs(a).max(axis=0), height / 2.0])
    return extruded(name, asm.shapes.extrusion(sides, height), polygon_distance(a), segments(a), half)


def ball(radius: float, name: str = "ball") -> Part:
    def distance(p: Array) -> Array:
        return np.asarray(np.linalg.norm(p, axis=1) - radius)

    def at(p: Array) -> Array:
        return np.asarray(radius * p / np.linalg.norm(p, axis=1)[:, None])

    half = np.full(3, radius)
    return Part(name, asm.shapes.sphere(radius), distance, _round(half, at), half)


def ellipsoid(a: float, b: float, c: float, name: str = "ellipsoid") -> Part:
    half = np.array([a, b, c])

    def at(p: Array) -> Array:
        return np.asarray(half * p / np.linalg.norm(p, axis=1)[:, None])

    patches = _round(np.ones(3), at, stretch=float(half.max()))
    return Part(name, asm.shapes.ellipsoid(a, b, c), ellipsoid_distance(half), patches, half)


def capsule(radius: float, length: float, name: str = "capsule") -> Part:
    """A rod along z with half balls on its ends."""

    def from_axis(p: Array) -> Array:
        off = p.copy()
        off[:, 2] -= np.clip(p[:, 2], -length / 2.0, length / 2.0)
        return off

    def distance(p: Array) -> Array:
        return np.asarray(np.linalg.norm(from_axis(p), axis=1) - radius)

    def at(p: Array) -> Array:
        off = from_axis(p)
        return np.asarray(p - off + radius * off / np.linalg.norm(off, axis=1)[:, None])

    half = np.array([radius, radius, length / 2.0 + radius])
    shape = asm.shapes.pipe(Path((0.0, 0.0, -length / 2.0), (0.0, 0.0, 1.0)).line(length), radius)
    return Part(name, shape, distance, _round(half, at), half)


def torus(major: float, minor: float, name: str = "torus") -> Part:
    def distance(p: Array) -> Array:
        return np.asarray(np.hypot(np.hypot(p[:, 0], p[:, 1]) - major, p[:, 2]) - minor)

    def at(p: Array) -> Array:
        u, v = p[:, 0] / (major + minor), p[:, 1] / minor
        r = major + minor * np.cos(v)
        return np.stack([r * np.cos(u), r * np.sin(u), minor * np.sin(v)], axis=1)

    around = 2.0 * np.pi * np.array([major + minor, minor])
    patch = Patch(np.zeros(2), around, at, np.array([False, False]))
    half = np.array([major + minor, major + minor, minor])
    return Part(name, asm.shapes.torus(major, minor), distance, (patch,), half)


def star(points: int, inner: float, outer: float) -> Array:
    """Corners of a star."""
    angle = np.pi / points * np.arange(2 * points)
    radius = np.where(np.arange(2 * points) % 2 == 0, outer, inner)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
