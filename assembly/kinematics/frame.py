"""Points and frames on a body, in its coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._read_only import ReadOnlyArrays
from assembly.errors import InputError, check_coordinates, vector
from assembly.kinematics.changes import count_number

if TYPE_CHECKING:
    from assembly.kinematics.body import Body

__all__ = ["Frame", "OpposedFrame", "Point", "frozen", "checked_place"]

Array = NDArray[np.float64]


def checked_place(name: str, value: ArrayLike) -> Array:
    """Coordinates of a point, read-only."""
    place = vector(name, value)
    check_coordinates(name, place.tolist())
    return frozen(place)


def frozen(array: Array) -> Array:
    """The array itself, read-only from now on."""
    array.flags.writeable = False
    return array


@dataclass(frozen=True, eq=False)
class Point(ReadOnlyArrays):
    """A point of a body, in body coordinates (3,)."""

    body: Body
    coordinates: Array

    def __repr__(self) -> str:
        x, y, z = self.coordinates
        return f"{self.body.name}.point({x:g}, {y:g}, {z:g})"


@dataclass(frozen=True, eq=False, repr=False)
class Frame(ReadOnlyArrays):
    """A frame on a body: origin (3,) and axes (3, 3), the columns x, y, z, in body coordinates."""

    body: Body
    origin: Array
    axes: Array

    def __repr__(self) -> str:
        rows = (row + 0.0 for row in (self.origin, *self.axes.T))  # no minus zeros
        at, x, _, z = ("({:g}, {:g}, {:g})".format(*row) for row in rows)
        return f"{self.body.name}.frame({at}, z={z}, x={x})"

    def place(self, at: ArrayLike | None = None, z: ArrayLike | None = None, x: ArrayLike | None = None) -> None:
        """Set the frame anew on its body: its origin, its axes, or both, as `Body.frame` takes them.

        Whatever has the frame, joints, terms and scenes, has it in its new place from then on.
        """
        if z is None:
            if x is not None:
                raise InputError("x is given without z; expected both, or neither to keep the axes")
            self._stand(self.origin if at is None else checked_place("at", at), self.axes)
            return
        other = self.body.frame(self.origin if at is None else at, z, x)
        self._stand(other.origin, other.axes)
        self.__dict__.pop("_turned", None)

    def _move(self, origin: Array) -> None:
        """Have another origin, an array of its own, and the same axes."""
        self.__dict__["origin"] = frozen(origin)
        count_number(self)

    def _stand(self, origin: Array, axes: Array) -> None:
        """Have another origin and other axes, orthonormal ones."""
        self.__dict__.update(origin=frozen(origin.copy()), axes=frozen(axes.copy()))
        count_number(self)


class OpposedFrame(Frame):
    """A frame turned by pi about the x axis of another one, wherever that stands."""

    def __init__(self, frame: Frame) -> None:
        self.__dict__.update(body=frame.body, _frame=frame)

    @property
    def origin(self) -> Array:
        """That of the other frame."""
        return self.base.origin

    @property
    def axes(self) -> Array:
        """Those of the other frame, y and z reversed."""
        return frozen(self.base.axes * np.array([1.0, -1.0, -1.0]))

    @property
    def base(self) -> Frame:
        """The frame that it is turned from."""
        frame: Frame = self.__dict__["_frame"]
        return frame

    def _stand(self, origin: Array, axes: Array) -> None:
        self.base._stand(origin, axes * np.array([1.0, -1.0, -1.0]))
