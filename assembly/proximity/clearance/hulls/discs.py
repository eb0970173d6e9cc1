"""Discs, and points as discs without a radius: what hulls of faces are made of."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Discs"]

Array = NDArray[np.float64]


class Discs(NamedTuple):
    """Discs, and points as discs without a radius, whose axes are zero: centers, axes (m, 3), radii (m,)."""

    centers: Array
    axes: Array
    radii: Array

    @classmethod
    def of_points(cls, points: Array) -> Discs:
        """Points (m, 3)."""
        return cls(points, np.zeros_like(points), np.zeros(len(points)))

    def reach(self, normals: Array) -> Array:
        """How far each reaches along unit vectors (k, 3): (m, k)."""
        far: Array = self.centers @ normals.T
        (wide,) = np.nonzero(self.radii)
        if len(wide):
            axes = self.axes[wide]
            # The part across the axis, and not the root of what is left of one, which is off by 1e-8 at zero.
            across = normals - (axes @ normals.T)[..., None] * axes[:, None]
            far[wide] += self.radii[wide, None] * np.sqrt((across**2).sum(axis=2))
        return far

    def posed(self, turn: Array, shift: Array) -> Discs:
        """The same after x -> turn x + shift."""
        return Discs(self.centers @ turn.T + shift, self.axes @ turn.T, self.radii)
