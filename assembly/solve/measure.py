"""Coordinates of joints by their definitions, in plain floats: what the rows of a pose are judged by.

The definitions are those of `constraints/program/primitives.py`; nothing is shared with its code but the names of the
kinds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import atan2, hypot, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.constraint import Coordinate, Equation
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
from assembly.kinematics.body import Frame

__all__ = ["JointRow", "Near", "Standing", "measure", "standing"]

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
# A number near every angle in a plane: it tells its turn.
Near = Mapping[Coordinate, float]
# The cosine and the sine part of an angle that has no value; and the sine of a swing whose direction has none.
_POLE, _UNDEFINED = 1e-12, 1e-12


class Standing(NamedTuple):
    """How two frames stand in the world: p_b - p_a, and the x, y and z axis of each."""

    apart: Vector
    a: tuple[Vector, Vector, Vector]
    b: tuple[Vector, Vector, Vector]


def standing(coordinate: Coordinate, q: Array, places: tuple[int, int]) -> Standing:
    """The frames of a coordinate whose bodies are rows `places` of q, (n, 7)."""
    pair, (i, j) = coordinate.frames, places
    (place_a, arm_a, a), (place_b, arm_b, b) = _in_world(pair.frame_a, q[i]), _in_world(pair.frame_b, q[j])
    # Positions are subtracted first: a common offset cancels.
    x, y, z = ((pb - pa) + (qb - qa) for pa, pb, qa, qb in zip(place_a, place_b, arm_a, arm_b, strict=True))
    return Standing((x, y, z), a, b)


def _in_world(frame: Frame, row: Array) -> tuple[Vector, Vector, tuple[Vector, Vector, Vector]]:
    """Where a frame's body is, from there to the frame's origin, and the frame's axes.

    In plain floats: arrays this small take four times the time.
    """
    p1, p2, p3, w, x, y, z = row.tolist()
    part = 2.0 / (w * w + x * x + y * y + z * z)
    diagonal = 1.0 - part * (x * x + y * y + z * z)
    xy, xz, yz = part * x * y, part * x * z, part * y * z
    wx, wy, wz = part * w * x, part * w * y, part * w * z
    m11, m22, m33 = diagonal + part * x * x, diagonal + part * y * y, diagonal + part * z * z
    m12, m13, m21, m23, m31, m32 = xy - wz, xz + wy, xy + wz, yz - wx, xz - wy, yz + wx
    arm, *axes = [
        (m11 * v1 + m12 * v2 + m13 * v3, m21 * v1 + m22 * v2 + m23 * v3, m31 * v1 + m32 * v2 + m33 * v3)
        for v1, v2, v3 in (frame.origin.tolist(), *frame.axes.T.tolist())
    ]
    return (p1, p2, p3), arm, (axes[0], axes[1], axes[2])


def _dot(u: Vector, v: Vector) -> float:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def _polar(coordinate: Coordinate, frames: Standing) -> tuple[float, float]:
    """Sine and cosine part, of one common length, of a coordinate that is an angle in a plane."""
    a, b = frames.a, frames.b
    if coordinate.kind == TURN:
        return _dot(a[1], b[0]) - _dot(a[0], b[1]), _dot(a[0], b[0]) + _dot(a[1], b[1])
    if coordinate.kind == AZIMUTH:
        along = b[coordinate.component]
        return _dot(a[1], along), _dot(a[0], along)
    assert coordinate.kind == ANGLE
    (x, y, z), (u, v, w) = a[2], b[2]
    return hypot(y * w - z * v, z * u - x * w, x * v - y * u), _dot(a[2], b[2])


def _swing(component: int, frames: Standing) -> float:
    """The turn from z_a to z_b as a vector, of which this is the part along an axis of a; opposed, it is along x."""
    across = _dot(frames.a[0], frames.b[2]), _dot(frames.a[1], frames.b[2])
    cosine, sine = _dot(frames.a[2], frames.b[2]), hypot(*across)
    if sine > _UNDEFINED:
        return atan2(sine, cosine) * across[component] / sine
    return across[component] if cosine > 0.0 else pi * (component == 0)


def measure(coordinate: Coordinate, frames: Standing, near: float = 0.0) -> float:
    """The value of a coordinate; of an angle in a plane the one within pi of `near`."""
    kind, component = coordinate.kind, coordinate.component
    if kind == COINCIDENT:
        return frames.apart[component]
    if kind == SLIDE:
        return _dot(frames.a[component], frames.apart)
    if kind == DISTANCE:
        return hypot(*frames.apart)
    if kind == RADIUS:
        return hypot(_dot(frames.a[0], frames.apart), _dot(frames.a[1], frames.apart))
    if kind == DOT:
        return _dot(frames.a[component // 3], frames.b[component % 3])
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
