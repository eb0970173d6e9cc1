"""A hand on a joint's coordinate: a spring between the two bodies of the joint."""

from __future__ import annotations

from math import isfinite, pi
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.constraint import Freedom
from assembly.constraints.model.coordinate_distance import CoordinateDistance
from assembly.constraints.packing.scene import Packed
from assembly.errors import FARTHEST, InputError
from assembly.tracking.hands import Followable, Hand, SpringNumbers

__all__ = ["CoordinateHand"]

Array = NDArray[np.float64]
# Radians: cosines of larger angles are those of an angle that is rounded.
FARTHEST_ANGLE = 1e6 * pi


class CoordinateHand(Hand):
    """A hand that draws a joint's coordinate to a value.

    What it does to the second body, along or about the joint's axis, it does to the first one the other way.

    Parameters
    ----------
    freedom : Freedom
    places : list of int
        Of the joint's bodies, among those of the scene.
    q : (n, 7)
        Where the bodies are: the hand is at rest there.
    weight : float
        Half the stiffness.
    """

    def __init__(self, freedom: Freedom, places: list[int], q: Array, weight: float) -> None:
        self._distance = CoordinateDistance(freedom, 0.0, weight)
        self._places = places
        self.follow: Followable | tuple[Followable, ...] = freedom
        self.terms = (self._distance,)
        self._held, self._spring, self._size, self._writes = freedom, 2.0 * weight, 1, False
        self.begin_anew(q)

    def pack(self, packed: Packed) -> None:
        """Take the scene that is told of targets, and how far they may be."""
        self._packed, self._far = packed, FARTHEST * packed.scale

    def where(self) -> Array:
        """The target that the loop has, (1,)."""
        return np.array([self._distance.target])

    def checked(self, target: Any) -> Array | None:
        """A number as an array (1,); None for what is none, or is too far."""
        if not isinstance(target, (Real, np.ndarray)) or isinstance(target, (bool, np.bool_, np.ma.MaskedArray)):
            return None
        row = np.asarray(target)
        if row.size != 1 or row.dtype.kind not in "iuf":
            return None
        value, far = float(row.reshape(())), FARTHEST_ANGLE if self._distance.is_angle else self._far
        return np.array([value]) if isfinite(value) and abs(value) <= far else None

    def read(self, row: Array) -> float:
        """A target that was checked as the term takes it."""
        return float(row[0])

    def aim(self, target: float) -> None:
        """Draw to a target that was read, from the next time on that the scene is read."""
        self._distance.target = target

    def numbers_in(self, packed: Packed) -> CoordinateNumbers:
        """Where the loop has the numbers of the spring."""
        return CoordinateNumbers(packed, self._distance)

    def can_hold(self, k: int, follow: Followable) -> Followable:
        """What hand k, this one, may hold instead: the same coordinate.

        Raises
        ------
        InputError
            Anything else.
        """
        if follow is not self._distance.freedom:
            raise InputError(
                f"follow is {follow!r}; expected {self._distance.freedom!r}, which is what hand {k} was made with"
            )
        return follow

    def take(self, held: Followable | None, stiffness: float, q: Array) -> None:
        """Hold the coordinate from now on, at rest, or nothing, bodies at q (n, 7)."""
        self._held, self._spring = held, stiffness
        self.rest(q)

    def begin_anew(self, q: Array) -> None:
        """Have the term at rest, bodies at q (n, 7)."""
        self._distance.target = self._coordinate_at(q)[0]

    def rest(self, q: Array) -> None:
        """The same."""
        self.begin_anew(q)

    def wrench(self, q: Array, target: Array) -> Array:
        """What the joint's second body does to the spring, (6,): a force along the axis, or a torque about it."""
        wrench = np.zeros(6)
        if self._held is not None:
            value, axis = self._coordinate_at(q)
            lack = value - float(target[0])
            if self._distance.is_angle:
                wrench[3:] = self._spring * self._distance.length**2 * np.sin(lack) * axis
            else:
                wrench[:3] = self._spring * lack * axis
        return wrench

    def _coordinate_at(self, q: Array) -> tuple[float, Array]:
        first, second = self._places
        return self._distance.coordinate_at(q[first], q[second])


class CoordinateNumbers(SpringNumbers):
    """Where the loop has the weight of a spring on a coordinate."""

    def __init__(self, packed: Packed, term: CoordinateDistance) -> None:
        self._pool, self._weight = packed.pool, term.weight
        self._at = next(places[0] for each, places in packed._coordinates if each is term)
        # As it was packed, for the stiffness that the term has.
        self._drawn = float(self._pool[self._at])

    def restore(self) -> None:
        """Have the spring draw what its term says."""
        self._pool[self._at] = self._drawn

    def write(self, held: Followable | None, stiffness: float) -> None:
        """Have the spring draw the coordinate; nothing for None."""
        self._pool[self._at] = 0.0 if held is None else 0.5 * stiffness / self._weight * self._drawn
