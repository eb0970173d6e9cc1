"""Ellipsoid: what a linear map makes of a unit ball, such as the velocities a hand can reach with unit joint rates.

Its points are center + axes (lengths * s) for all s with |s| <= 1. A length may be zero: then it is a disk, a line or a
point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays
from assembly.errors import InputError, positive, real_array, vector

__all__ = ["Ellipsoid"]

Array = NDArray[np.float64]
# Axes typed to six digits are off by less.
_ORTHONORMAL = 1e-5


@dataclass(frozen=True, eq=False)
class Ellipsoid(ReadOnlyArrays):
    """A solid ellipsoid in the world, to look at.

    Parameters
    ----------
    center : (3,)
    axes : (3, 3)
        Columns are the directions of the principal axes: unit vectors, orthogonal to each other, to five digits.
    lengths : (3,)
        Half the length of each axis, in the order of the columns; not below zero.
    color : (3,), optional
        Red, green, blue from 0 to 1.

    Raises
    ------
    InputError
        Not finite, wrong shapes, axes that are not orthonormal, a length below zero, a color out of range.
    """

    center: Array
    axes: Array
    lengths: Array
    color: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        center = vector("center", self.center)
        axes = real_array("axes", self.axes, (3, 3))
        lengths = vector("lengths", self.lengths)
        if not np.abs(axes.T @ axes - np.eye(3)).max() <= _ORTHONORMAL:
            raise InputError(f"axes is {axes.tolist()}; expected columns of length one, orthogonal to each other")
        if not lengths.min() >= 0.0:
            raise InputError(f"lengths is {lengths.tolist()}; expected numbers that are not below zero")
        if self.color is not None:
            red, green, blue = vector("color", self.color).tolist()
            if not (0.0 <= min(red, green, blue) and max(red, green, blue) <= 1.0):
                raise InputError(f"color is {(red, green, blue)}; expected red, green, blue from 0 to 1")
            object.__setattr__(self, "color", (red, green, blue))
        for name, array in (("center", center), ("axes", axes), ("lengths", lengths)):
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def scaled(self, factor: float) -> Ellipsoid:
        """The same ellipsoid with lengths times a positive factor, to fit what it is drawn beside."""
        return Ellipsoid(self.center, self.axes, self.lengths * positive("factor", factor), self.color)

    def __repr__(self) -> str:
        center, lengths = (", ".join(f"{value:g}" for value in row) for row in (self.center, self.lengths))
        return f"Ellipsoid(center=({center}), lengths=({lengths}))"
