"""Coordinates of joints by their definitions, in plain numpy: what the rows of a pose are judged by.

The definitions are those of `constraints/program/primitives.py`; nothing is shared with its code but the names of the
kinds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import atan2, hypot, pi

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
from assembly.kinematics.pose import rotation_of

__all__ = ["JointRow", "Near", "Standing", "measure", "standing"]

Array = NDArray[np.float64]
# A number near every angle in a plane: it tells its turn.
Near = Mapping[Coordinate, float]
# The cosine and the sine part of an angle that has no value; and the sine of a swing whose direction has none.
_POLE, _UNDEFINED = 1e-12, 1e-12


@dataclass(frozen=True, eq=False)
class Standing:
    """How two frames stand in the world: p_b - p_a, and the axes of each as columns."""

    apart: Array
    a: Array
    b: Array


def standing(coordinate: Coordinate, q: Array, places: tuple[int, int]) -> Standing:
    """The frames of a coordinate whose bodies are rows `places` of q, (n, 7)."""

    def arm_and_axes(frame: Frame, row: Array) -> tuple[Array, Array]:
        turn = rotation_of(row[3:])
        return turn @ frame.origin, turn @ frame.axes

    pair, (i, j) = coordinate.frames, places
    (arm_a, a), (arm_b, b) = arm_and_axes(pair.frame_a, q[i]), arm_and_axes(pair.frame_b, q[j])
    # Positions are subtracted first: a common offset cancels.
    return Standing((q[j, :3] - q[i, :3]) + (arm_b - arm_a), a, b)


def _polar(coordinate: Coordinate, frames: Standing) -> tuple[float, float]:
    """Sine and cosine part, of one common length, of a coordinate that is an angle in a plane."""
    a, b = frames.a, frames.b
    if coordinate.kind == TURN:
        return float(a[:, 1] @ b[:, 0] - a[:, 0] @ b[:, 1]), float(a[:, 0] @ b[:, 0] + a[:, 1] @ b[:, 1])
    if coordinate.kind == AZIMUTH:
        along = b[:, coordinate.component]
        return float(a[:, 1] @ along), float(a[:, 0] @ along)
    assert coordinate.kind == ANGLE
    return float(np.linalg.norm(np.cross(a[:, 2], b[:, 2]))), float(a[:, 2] @ b[:, 2])


def _swing(component: int, frames: Standing) -> float:
    """The turn from z_a to z_b as a vector, of which this is the part along an axis of a; opposed, it is along x."""
    across = frames.a[:, :2].T @ frames.b[:, 2]
    cosine, sine = float(frames.a[:, 2] @ frames.b[:, 2]), float(np.linalg.norm(across))
    if sine > _UNDEFINED:
        return atan2(sine, cosine) * float(across[component]) / sine
    return float(across[component]) if cosine > 0.0 else pi * (component == 0)


def measure(coordinate: Coordinate, frames: Standing, near: float = 0.0) -> float:
    """The value of a coordinate; of an angle in a plane the one within pi of `near`."""
    kind, component = coordinate.kind, coordinate.component
    if kind == COINCIDENT:
        return float(frames.apart[component])
    if kind == SLIDE:
        return float(frames.a[:, component] @ frames.apart)
    if kind == DISTANCE:
        return float(np.linalg.norm(frames.apart))
    if kind == RADIUS:
        return hypot(*(frames.a[:, :2].T @ frames.apart).tolist())
    if kind == DOT:
        return float(frames.a[:, component // 3] @ frames.b[:, component % 3])
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
