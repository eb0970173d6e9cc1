"""Coordinates of joints by their definitions, in plain floats: what the rows of a pose are judged by.

The definitions are those of `constraints/program/primitives.py`; nothing is shared with its code but the names of the
kinds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import atan2, hypot, pi

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.constraint import Coordinate, Equation, FramePair
from assembly.constraints.program.primitives import (
    ANGLE,
    AZIMUTH,
    COINCIDENT,
    DISTANCE,
    DOT,
    RADIUS,
    SLIDE,
    SWING,
    TURN,
)

__all__ = ["JointRow", "Near", "Standing", "measure", "standing"]

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
# Rows one after the other.
Rotation = tuple[float, float, float, float, float, float, float, float, float]
# A number near every angle in a plane: it tells its turn.
Near = Mapping[Coordinate, float]
# The cosine and the sine part of an angle that has no value; and the sine of a swing whose direction has none.
_POLE, _UNDEFINED = 1e-12, 1e-12


class Standing:
    """How two frames stand in the world: an axis is turned where it is asked for, as most coordinates ask for few.

    In plain floats: arrays this small take four times the time.

    Parameters
    ----------
    frames : FramePair
    a, b : (7,)
        Rows of the poses of their bodies.
    """

    __slots__ = ("_axes_a", "_axes_b", "_frames", "_place_a", "_place_b", "_turn_a", "_turn_b")

    def __init__(self, frames: FramePair, a: Array, b: Array) -> None:
        self._frames = frames
        self._place_a, self._turn_a = _placed(a)
        self._place_b, self._turn_b = _placed(b)
        self._axes_a, self._axes_b = frames.frame_a.axes.tolist(), frames.frame_b.axes.tolist()

    @property
    def apart(self) -> Vector:
        """p_b - p_a."""
        arm_a = _turned(self._turn_a, *self._frames.frame_a.origin.tolist())
        arm_b = _turned(self._turn_b, *self._frames.frame_b.origin.tolist())
        # Positions are subtracted first: a common offset cancels.
        parts = zip(self._place_a, self._place_b, arm_a, arm_b, strict=True)
        x, y, z = ((pb - pa) + (qb - qa) for pa, pb, qa, qb in parts)
        return x, y, z

    def a(self, k: int) -> Vector:
        """Axis k of the first frame."""
        x, y, z = self._axes_a
        return _turned(self._turn_a, x[k], y[k], z[k])

    def b(self, k: int) -> Vector:
        """Axis k of the second frame."""
        x, y, z = self._axes_b
        return _turned(self._turn_b, x[k], y[k], z[k])


def standing(coordinate: Coordinate, q: Array, places: tuple[int, int]) -> Standing:
    """The frames of a coordinate whose bodies are rows `places` of q, (n, 7)."""
    return Standing(coordinate.frames, q[places[0]], q[places[1]])


def _placed(row: Array) -> tuple[Vector, Rotation]:
    """Where a body is, and its rotation, of the row of its pose."""
    p1, p2, p3, w, x, y, z = row.tolist()
    part = 2.0 / (w * w + x * x + y * y + z * z)
    diagonal = 1.0 - part * (x * x + y * y + z * z)
    xy, xz, yz = part * x * y, part * x * z, part * y * z
    wx, wy, wz = part * w * x, part * w * y, part * w * z
    m11, m22, m33 = diagonal + part * x * x, diagonal + part * y * y, diagonal + part * z * z
    return (p1, p2, p3), (m11, xy - wz, xz + wy, xy + wz, m22, yz - wx, xz - wy, yz + wx, m33)


def _turned(rotation: Rotation, v1: float, v2: float, v3: float) -> Vector:
    """A vector of the body in the world."""
    m11, m12, m13, m21, m22, m23, m31, m32, m33 = rotation
    return m11 * v1 + m12 * v2 + m13 * v3, m21 * v1 + m22 * v2 + m23 * v3, m31 * v1 + m32 * v2 + m33 * v3


def _dot(u: Vector, v: Vector) -> float:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def _polar(coordinate: Coordinate, frames: Standing) -> tuple[float, float]:
    """Sine and cosine part, of one common length, of a coordinate that is an angle in a plane."""
    if coordinate.kind == TURN:
        a_x, a_y, b_x, b_y = frames.a(0), frames.a(1), frames.b(0), frames.b(1)
        return _dot(a_y, b_x) - _dot(a_x, b_y), _dot(a_x, b_x) + _dot(a_y, b_y)
    if coordinate.kind == AZIMUTH:
        along = frames.b(coordinate.component)
        return _dot(frames.a(1), along), _dot(frames.a(0), along)
    assert coordinate.kind == ANGLE
    (x, y, z), (u, v, w) = a_z, b_z = frames.a(2), frames.b(2)
    return hypot(y * w - z * v, z * u - x * w, x * v - y * u), _dot(a_z, b_z)


def _swing(component: int, frames: Standing) -> float:
    """The turn from z_a to z_b as a vector, of which this is the part along an axis of a; opposed, it is along x."""
    along = frames.b(2)
    across = _dot(frames.a(0), along), _dot(frames.a(1), along)
    cosine, sine = _dot(frames.a(2), along), hypot(*across)
    if sine > _UNDEFINED:
        return atan2(sine, cosine) * across[component] / sine
    return across[component] if cosine > 0.0 else pi * (component == 0)


def measure(coordinate: Coordinate, frames: Standing, near: float = 0.0) -> float:
    """The value of a coordinate; of an angle in a plane the one within pi of `near`."""
    kind, component = coordinate.kind, coordinate.component
    if kind == COINCIDENT:
        return frames.apart[component]
    if kind == SLIDE:
        return _dot(frames.a(component), frames.apart)
    if kind == DISTANCE:
        return hypot(*frames.apart)
    if kind == RADIUS:
        apart = frames.apart
        return hypot(_dot(frames.a(0), apart), _dot(frames.a(1), apart))
    if kind == DOT:
        return _dot(frames.a(component // 3), frames.b(component % 3))
    if kind == SWING:
        return _swing(component, frames)
    sine, cosine = _polar(coordinate, frames)
    if kind == ANGLE:
        return atan2(sine, cosine)
    if hypot(sine, cosine) < _POLE:
        return near
    angle = atan2(sine, cosine)
    return angle + 2.0 * pi * round((near - angle) / (2.0 * pi))


@dataclass(frozen=True, eq=False)
class JointRow:
    """A row of a joint or a coupling: its equation, the rows of q of the bodies of each term, and its unit."""

    equation: Equation
    places: tuple[tuple[int, int], ...]
    unit: float

    def residual(self, q: Array, near: Near) -> float:
        """How much the sum is above the value, over the unit; `near` tells the turns of angles."""
        total = -self.equation.current()
        for (factor, coordinate), places in zip(self.equation.terms, self.places, strict=True):
            total += factor * measure(coordinate, standing(coordinate, q, places), near.get(coordinate, 0.0))
        return total / self.unit

    def value(self) -> float:
        """The right-hand side now, over the unit."""
        return self.equation.current() / self.unit
