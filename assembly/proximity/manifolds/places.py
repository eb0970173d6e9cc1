"""What a row of a manifold is between: points, lines, circles, planes and walls, with their derivatives.

Each has k coordinates and is evaluated where these are x: its point (3,), slopes (3, k) and bends (3, k, k).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["Affine", "Arc", "Place", "Wall"]

Array = NDArray[np.float64]


class Place(Protocol):
    """A point, curve or surface of a body, with coordinates."""

    @property
    def count(self) -> int:
        """How many coordinates it has."""

    def at(self, x: Array) -> tuple[Array, Array, Array]:
        """Its point, slopes and bends at coordinates x (k,)."""


@dataclass(frozen=True, eq=False)
class Affine:
    """A point, a line or a plane: point + slopes x.

    Attributes
    ----------
    point : (3,)
    slopes : (3, k)
    """

    point: Array
    slopes: Array

    @property
    def count(self) -> int:
        """How many coordinates it has."""
        return int(self.slopes.shape[1])

    def at(self, x: Array) -> tuple[Array, Array, Array]:
        """Its point, slopes and bends at x (k,)."""
        return self.point + self.slopes @ x, self.slopes, np.zeros((3, self.count, self.count))


@dataclass(frozen=True, eq=False)
class Arc:
    """A circle: center + cos(x) right + sin(x) up.

    Attributes
    ----------
    center, right, up : (3,)
    """

    center: Array
    right: Array
    up: Array
    count: int = 1

    def at(self, x: Array) -> tuple[Array, Array, Array]:
        """Its point, slopes and bends at an angle x (1,)."""
        c, s = np.cos(x[0]), np.sin(x[0])
        out = c * self.right + s * self.up
        return self.center + out, (c * self.up - s * self.right)[:, None], -out[:, None, None]


@dataclass(frozen=True, eq=False)
class Wall:
    """A cylinder or a cone: of heights along an axis and angles about it.

    Attributes
    ----------
    origin, axis, right, up : (3,)
        Unit vectors, right and up across the axis.
    radius, widening : float
        The radius at the origin, and by what it grows with the height.
    """

    origin: Array
    axis: Array
    right: Array
    up: Array
    radius: float
    widening: float
    count: int = 2

    def at(self, x: Array) -> tuple[Array, Array, Array]:
        """Its point, slopes and bends at a height and an angle x (2,)."""
        c, s = np.cos(x[1]), np.sin(x[1])
        out, around = c * self.right + s * self.up, c * self.up - s * self.right
        radius = self.radius + self.widening * x[0]
        point = self.origin + x[0] * self.axis + radius * out
        bends = np.zeros((3, 2, 2))
        bends[:, 0, 1] = bends[:, 1, 0] = self.widening * around
        bends[:, 1, 1] = -radius * out
        return point, np.column_stack([self.axis + self.widening * out, radius * around]), bends
