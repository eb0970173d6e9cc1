"""What a surface can be recognized as: records of the kinds, in the coordinates of the surface.

Each has a `deviation`: no point of the surface is farther than that from the plane, cylinder and so on; of an extrusion
and a revolution, from one that is exactly that. `outward` says on which side S_u x S_v is: away from the axis or the
center (of a torus, of the circle of its tube), or toward it. What the side of a face is follows with its sign.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays

__all__ = ["Cone", "Cylinder", "Extrusion", "Form", "Freeform", "Plane", "Revolution", "Sphere", "Torus", "Turn"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Turn(ReadOnlyArrays):
    """How far a surface goes around an axis.

    Attributes
    ----------
    start : (3,)
        The unit direction from the axis at which it begins.
    angle : float
        How far it goes from there, counterclockwise about the axis: 2 pi all around [rad].
    """

    start: Array
    angle: float


@dataclass(frozen=True, eq=False)
class Plane(ReadOnlyArrays):
    """A plane through `point`; its unit `normal` is that of S_u x S_v."""

    point: Array
    normal: Array
    deviation: float


@dataclass(frozen=True, eq=False)
class Cylinder(ReadOnlyArrays):
    """A circular cylinder.

    Attributes
    ----------
    point, axis : (3,)
        The middle of its axis, and the unit direction of that.
    radius : float
    heights : (float, float)
        From where to where it goes along the axis, from the point.
    turn : Turn
    outward : bool
    deviation : float
    """

    point: Array
    axis: Array
    radius: float
    heights: tuple[float, float]
    turn: Turn
    outward: bool
    deviation: float


@dataclass(frozen=True, eq=False)
class Cone(ReadOnlyArrays):
    """One side of a circular cone.

    Attributes
    ----------
    apex, axis : (3,)
        The axis is a unit direction from the apex to where the surface is.
    half_angle : float
        Between the axis and the lines of the cone [rad].
    heights : (float, float)
        From where to where it goes along the axis, from the apex.
    turn : Turn
    outward : bool
    deviation : float
    """

    apex: Array
    axis: Array
    half_angle: float
    heights: tuple[float, float]
    turn: Turn
    outward: bool
    deviation: float


@dataclass(frozen=True, eq=False)
class Sphere(ReadOnlyArrays):
    """A sphere."""

    center: Array
    radius: float
    outward: bool
    deviation: float


@dataclass(frozen=True, eq=False)
class Torus(ReadOnlyArrays):
    """A torus whose tube does not meet its axis.

    Attributes
    ----------
    center, axis : (3,)
        The axis is a unit direction.
    major, minor : float
        Radii of the circle of the tube's centers, and of the tube.
    turn : Turn
    outward : bool
    deviation : float
    """

    center: Array
    axis: Array
    major: float
    minor: float
    turn: Turn
    outward: bool
    deviation: float


@dataclass(frozen=True, eq=False)
class Extrusion(ReadOnlyArrays):
    """Parallel lines, each of one value of the other parameter.

    Attributes
    ----------
    direction : (3,)
        Of the lines, a unit one.
    along : int
        Which parameter runs along them: 0 is u, 1 is v.
    deviation : float
    """

    direction: Array
    along: int
    deviation: float


@dataclass(frozen=True, eq=False)
class Revolution(ReadOnlyArrays):
    """Circles about an axis, each of one value of the other parameter.

    Attributes
    ----------
    point, axis : (3,)
        A point of the axis, and its unit direction.
    around : int
        Which parameter runs along the circles: 0 is u, 1 is v.
    turn : Turn
    deviation : float
    """

    point: Array
    axis: Array
    around: int
    turn: Turn
    deviation: float


@dataclass(frozen=True, eq=False)
class Freeform:
    """Not exactly any of the others."""


Form: TypeAlias = Plane | Cylinder | Cone | Sphere | Torus | Extrusion | Revolution | Freeform
