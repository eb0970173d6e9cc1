"""Hollows: convex sets into which faces do not go; tubes and rings, for balls; what is known of a face."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi, sin
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.clearance.hulls.discs import Discs
from assembly.proximity.clearance.hulls.prism import Prism
from assembly.proximity.clearance.hulls.sheet import Sheet

__all__ = ["AnyHollow", "FaceHulls", "ForBalls", "Hollow", "Ring", "Tube", "depths_within", "parts_of_one"]

Array = NDArray[np.float64]
# [radii] A point so near to an axis is on it: rounding decides where it is seen from there.
ON_AXIS = 1e-9


class Hollow(NamedTuple):
    """A convex set: what is within a cylinder, one side of a cone, d(x) <= radius + h(x) tan(slope), or a ball.

    Attributes
    ----------
    center, axis : (3,)
        h(x) is the height along the axis over the center, d(x) the distance from it. The axis of a ball is zero.
    radius : float
    slope : float
        Half the angle of a cone, whose radius grows along the axis [rad].
    is_wall : bool
        Whether the body is outside of it: nothing is in contact with a face from within the body.
    """

    center: Array
    axis: Array
    radius: float
    slope: float = 0.0
    is_wall: bool = True

    @property
    def is_one_sided(self) -> bool:
        """Whether a half line along the axis stays in it, and none against that."""
        return self.slope > 0.0

    def depth(self, discs: Discs) -> Array:
        """How far discs (m,) are within, at least; below zero where they may not be."""
        return _depths_in_round([self], discs)[0] if self.axis.any() else self._depth_in_ball(discs)

    def _depth_in_ball(self, discs: Discs) -> Array:
        away = discs.centers - self.center
        height = (away * discs.axes).sum(axis=1)
        beside = np.sqrt(((away - height[:, None] * discs.axes) ** 2).sum(axis=1))
        return np.asarray(self.radius - np.hypot(beside + discs.radii, height))

    def depth_of(self, points: Array) -> Array:
        """How far points (m, 3) are within."""
        return self.depth(Discs.of_points(points))

    def planes(self, near: Array) -> tuple[Array, Array]:
        """Some half spaces that it is in: unit vectors inward (m, 3), and the heights of their borders.

        The first touches the hollow where that is nearest to a point: what lies along a wall is moved straight off it.
        """
        away = near - self.center
        if not self.axis.any():
            length = float(np.linalg.norm(away))
            ways = np.concatenate([away[None] / length, _SPHERE]) if length > 0.0 else _SPHERE
            return -ways, -ways @ self.center - self.radius
        across = away - (away @ self.axis) * self.axis
        if not np.linalg.norm(across) > 0.0:
            across = np.cross(self.axis, np.eye(3)[np.abs(self.axis).argmin()])
        around = _around(self.axis, across)
        inward = sin(self.slope) * self.axis - cos(self.slope) * around
        return inward, inward @ self.center - self.radius * cos(self.slope)

    def posed(self, turn: Array, shift: Array) -> Hollow:
        """The same after x -> turn x + shift."""
        return self._replace(center=turn @ self.center + shift, axis=turn @ self.axis)

    def scaled(self, left: float, shift: Array) -> Hollow:
        """The same after x -> left x + shift."""
        return self._replace(center=left * self.center + shift, radius=left * self.radius)


class Tube(NamedTuple):
    """What is outside of a torus, or inside of its tube: not convex, but how far a ball is in it is known exactly.

    Attributes
    ----------
    center, normal : (3,)
        Of the circle of the tube's middles.
    major : float
        The radius of that circle.
    minor : float
        Of the tube.
    outside : bool
        Whether it is the outside.
    is_wall : bool
        As of a Hollow.
    """

    center: Array
    normal: Array
    major: float
    minor: float
    outside: bool
    is_wall: bool
    # No half line is known to stay in it.
    axis: Array = np.zeros(3)
    is_one_sided: bool = False

    def depth(self, discs: Discs) -> Array:
        """How far the centers of discs (m,) are within: of balls, which are points with a radius, their centers."""
        return self.depth_of(discs.centers)

    def depth_of(self, points: Array) -> Array:
        """How far points (m, 3) are within."""
        away = points - self.center
        height = away @ self.normal
        beside = np.sqrt(((away - height[:, None] * self.normal) ** 2).sum(axis=1))
        over = np.hypot(beside - self.major, height) - self.minor
        return np.asarray(over if self.outside else -over)

    def planes(self, near: Array) -> tuple[Array, Array]:
        """Half spaces at whose borders the tube is, where it is next to a point (3,), and around from there."""
        away = near - self.center
        beside = away - (away @ self.normal) * self.normal
        if not np.linalg.norm(beside) > ON_AXIS * self.major:
            beside = np.cross(self.normal, np.eye(3)[np.abs(self.normal).argmin()])
        around = _around(self.normal, beside)
        # A ball within the tube touches it at its nearest point alone.
        feet = self.center + self.major * (around if self.outside else around[:1])
        ways = near - feet
        lengths = np.linalg.norm(ways, axis=1)
        # From a point on the circle of middles, every way across that leads to where the tube is nearest.
        is_middle = lengths == 0.0
        ways[is_middle], lengths[is_middle] = (around[: len(feet)])[is_middle], 1.0
        ways /= lengths[:, None]
        inward = ways if self.outside else -ways
        return inward, (inward * feet).sum(axis=1) + (self.minor if self.outside else -self.minor)

    def posed(self, turn: Array, shift: Array) -> Tube:
        """The same after x -> turn x + shift."""
        return self._replace(center=turn @ self.center + shift, normal=turn @ self.normal)

    def scaled(self, left: float, shift: Array) -> Tube:
        """The same after x -> left x + shift."""
        return self._replace(center=left * self.center + shift, major=left * self.major, minor=left * self.minor)


class Ring(NamedTuple):
    """What is beside a part of a cone, a cylinder or a plane about an axis: how far a ball is off it is known exactly.

    A ball goes through the hole that it lies on, and into the bore: no plane is between, nor is it in the cylinder.

    Attributes
    ----------
    center, normal : (3,)
        A point of the axis, and its direction.
    ends : (2, 2)
        A straight profile: of both ends the height over the center, and the distance from the axis.
    off : float
        What the face may be off it.
    """

    center: Array
    normal: Array
    ends: Array
    off: float
    # No half line is known to stay in it.
    axis: Array = np.zeros(3)
    is_one_sided: bool = False
    is_wall: bool = True

    def depth(self, discs: Discs) -> Array:
        """How far the centers of discs (m,) are away: of balls, which are points with a radius, their centers."""
        return self.depth_of(discs.centers)

    def _seen(self, points: Array) -> tuple[Array, Array]:
        """Heights of points and their distances from the axis (m, 2), and of the profile what is nearest to each."""
        away = points - self.center
        height = away @ self.normal
        beside = np.linalg.norm(away - height[:, None] * self.normal, axis=1)
        seen = np.stack([height, beside], axis=1)
        way = self.ends[1] - self.ends[0]
        part = np.clip((seen - self.ends[0]) @ way / (way @ way), 0.0, 1.0)
        return seen, self.ends[0] + part[:, None] * way

    def depth_of(self, points: Array) -> Array:
        """How far points (m, 3) are away."""
        seen, nearest = self._seen(points)
        return np.asarray(np.hypot(*(seen - nearest).T) - self.off)

    def planes(self, near: Array) -> tuple[Array, Array]:
        """Half spaces at whose borders it is, where it is next to a point (3,), and around from there."""
        (seen,), (nearest,) = self._seen(near[None])
        away = near - self.center
        beside = away - (away @ self.normal) * self.normal
        if not np.linalg.norm(beside) > ON_AXIS * float(np.abs(self.ends[:, 1]).max()):
            beside = np.cross(self.normal, np.eye(3)[np.abs(self.normal).argmin()])
        around = _around(self.normal, beside)
        feet = self.center + nearest[0] * self.normal + nearest[1] * around
        ways = near - feet
        lengths = np.linalg.norm(ways, axis=1)
        if not (lengths > 0.0).all():
            return np.empty((0, 3)), np.empty(0)
        inward = ways / lengths[:, None]
        return inward, (inward * feet).sum(axis=1) + self.off

    def posed(self, turn: Array, shift: Array) -> Ring:
        """The same after x -> turn x + shift."""
        return self._replace(center=turn @ self.center + shift, normal=turn @ self.normal)

    def scaled(self, left: float, shift: Array) -> Ring:
        """The same after x -> left x + shift."""
        return self._replace(center=left * self.center + shift, ends=left * self.ends, off=left * self.off)


def depths_within(hollows: Sequence[AnyHollow], discs: Discs) -> Array:
    """Of every hollow how far discs (m,) are within, at least: (h, m); cylinders and cones are asked at once."""
    found = np.empty((len(hollows), len(discs.radii)))
    axes = np.array([hollow.axis for hollow in hollows]).reshape(-1, 3)
    both = zip(hollows, np.count_nonzero(axes, axis=1).tolist(), strict=True)
    some = {k: hollow for k, (hollow, parts) in enumerate(both) if parts and isinstance(hollow, Hollow)}
    if some:
        found[list(some)] = _depths_in_round(list(some.values()), discs)
    for k, hollow in enumerate(hollows):
        if k not in some:
            found[k] = hollow.depth(discs)
    return found


def _depths_in_round(hollows: Sequence[Hollow], discs: Discs) -> Array:
    """Of every cylinder or cone how far discs (m,) are within, at least: (h, m)."""
    center, axis = (np.array([hollow[k] for hollow in hollows])[:, None] for k in range(2))
    radius, slope = (np.array([hollow[k] for hollow in hollows])[:, None] for k in range(2, 4))
    away = discs.centers - center
    height = (away @ axis[:, 0, :, None])[..., 0]
    off = away - height[..., None] * axis
    square = np.einsum("hmi,hmi->hm", off, off)
    (wide,) = np.nonzero(discs.radii)
    if len(wide):
        axes, radii, off = discs.axes[wide], discs.radii[wide], off[:, wide]
        lean = axes - (axes @ axis[:, 0, :, None]) * axis
        height[:, wide] -= radii * np.sqrt(np.einsum("hmi,hmi->hm", lean, lean))
        # A disc whose axis leads away from this one is nowhere farther off than by its radius across.
        across = off - np.einsum("hmi,mi->hm", off, axes)[..., None] * axes
        square[:, wide] += (2.0 * np.sqrt(np.einsum("hmi,hmi->hm", across, across)) + radii) * radii
    return np.asarray((radius - np.sqrt(square)) * np.cos(slope) + height * np.sin(slope))


def _around(axis: Array, first: Array, count: int = 12) -> Array:
    """Unit vectors (count, 3) across an axis, equally far apart, from one of any length that is across it."""
    across = first / np.linalg.norm(first)
    angle = 2.0 * pi / count * np.arange(count)[:, None]
    return np.asarray(np.cos(angle) * across + np.sin(angle) * np.cross(axis, across))


_SPHERE = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z], dtype=float)
_SPHERE /= np.linalg.norm(_SPHERE, axis=1, keepdims=True)


# What is for balls alone: it is not convex, and what is in it with all of its discs need not be.
ForBalls: TypeAlias = Tube | Ring | Sheet
AnyHollow: TypeAlias = Hollow | Prism | ForBalls


class FaceHulls(NamedTuple):
    """What is known of a face.

    Attributes
    ----------
    hulls : list of (Discs, float)
        Each with the radius of a ball around all of it.
    hollows : sequence of Hollow, Prism, Tube, Ring or Sheet
    points : (p, 3)
        Points of it.
    direction : (3,) or None
        Its normal if it is flat, or its axis.
    line : (center, axis) or None
        What it goes around; the axis of a ball is zero.
    """

    hulls: list[tuple[Discs, float]]
    hollows: Sequence[AnyHollow]
    points: Array
    direction: Array | None
    line: tuple[Array, Array] | None


def parts_of_one(parts: list[FaceHulls]) -> list[FaceHulls]:
    """Parts of one face, which is connected: of all but the first one point of it is enough."""
    return [parts[0], *(part._replace(points=part.points[:1]) for part in parts[1:])]
