"""What all joints have in common: two frames, rows between them, and coordinates by name.

The z axes of the frames are the joint's axes. "aligned" lets them point the same way, "opposed" against each other,
as the outward normals of two faces do that lie on each other; "nearest" is the one of the two that they are nearer to
where a solve starts.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, ClassVar, Literal, Self, overload

import numpy as np
from numpy.typing import NDArray

from assembly._copies import OwnState
from assembly.constraints.model.constraint import (
    Bounds,
    Constraint,
    Coordinate,
    Equation,
    FramePair,
    Freedom,
    RowConstraint,
    count_change,
    words,
)
from assembly.constraints.model.mate_features import CenterLike, one_feature, point_frame
from assembly.constraints.program.primitives import COINCIDENT, SLIDE, SWING
from assembly.errors import InputError, bounded
from assembly.kinematics.body import Body, BodyFace
from assembly.kinematics.frame import Frame, OpposedFrame, Point
from assembly.kinematics.pose import rotation_matrix
from assembly.selection.edges import BodyEdge
from assembly.selection.vertices import BodyVertex

__all__ = ["Axes", "Driven", "Joint", "Limits", "Offset", "Sense", "Side", "SidePoint"]

Array = NDArray[np.float64]
Axes = Literal["aligned", "opposed", "nearest"]
Sense = Literal["aligned", "opposed"]
Side = Frame | Body
SidePoint = CenterLike | Frame | Body

SAME_POINT = ((COINCIDENT, 0), (COINCIDENT, 1), (COINCIDENT, 2))
SAME_AXIS = ((SWING, 0), (SWING, 1))
ON_AXIS = ((SLIDE, 0), (SLIDE, 1))
# Where axes are perpendicular at a start, to this cosine, one body counts as turned by a thousandth about a direction
# that is nobody's: so the joints of two bodies choose alike, and none by rounding.
_ACROSS = 1e-9
_LEAN = rotation_matrix(np.array([1.0, 0.00024, 0.0003, 0.00032]))


def _frame(name: str, side: Any, takes_point: bool) -> Frame:
    """The frame that a side stands for; a point's and a body's axes are those of the body."""
    side = one_feature(side)
    if isinstance(side, Frame):
        return side
    if isinstance(side, Body):
        return side.frame()
    if takes_point and isinstance(side, (Point, BodyVertex, BodyFace, BodyEdge)):
        return point_frame(name, side)
    expected = "a point, a frame or a body" if takes_point else "a frame, body.frame(...) or face.frame(), or a body"
    raise TypeError(f"{name} is {side!r}; expected {expected}")


class Joint(OwnState, RowConstraint):
    """A joint between two bodies; see its subclasses.

    What it asks for is in `equations`, what it leaves free in `freedoms`. A coordinate is driven where it has a value,
    and kept within limits where it has limits; both may be set between solves.

    Parameters
    ----------
    frame_a, frame_b : Frame or Body
        `body.frame(at, z, x)`; of a body the frame at its origin. Where a point is asked for, a vertex will do, or a
        sphere or a circle, whose center is meant, and selections of a single one.
    name : str, optional
        The kind and the bodies' names by default, as in "revolute ground-crank".
    axes : "aligned", "opposed" or "nearest"
        Whether the z axes point the same way or against each other, of joints that ask for either; or whichever is
        nearer where a solve starts, which `Solution.axes` tells.
    settings : (value, limits) by coordinate
        Driven value or None; limits (lower, upper) or None.

    Raises
    ------
    InputError, TypeError
        Both sides on one body, a driven value outside the limits, a value that is no number, an unknown word.
    """

    # Coordinates, by kind and component, that are zero; and those that are free, by name.
    _zero: ClassVar[tuple[tuple[int, int], ...]] = ()
    _free: ClassVar[Mapping[str, tuple[int, int]]] = {}
    # What messages call the two sides, and which of them may be points.
    _sides: ClassVar[tuple[str, str]] = ("frame_a", "frame_b")
    _points: ClassVar[tuple[bool, bool]] = (False, False)
    # The argument that says the value, where it is not a drive of the joint but what the joint holds.
    _argument: ClassVar[str | None] = None

    def __init__(
        self,
        frame_a: SidePoint,
        frame_b: SidePoint,
        name: str | None = None,
        axes: Axes = "aligned",
        **settings: tuple[float | None, Sequence[float | None] | None],
    ) -> None:
        sides = zip(self._sides, (frame_a, frame_b), self._points, strict=True)
        self._frame_a, self._frame_b = (_frame(*side) for side in sides)
        if self._frame_a.body is self._frame_b.body:
            a, b = self._sides
            raise InputError(f"{a} and {b} are both on body {self._frame_a.body.name!r}; expected two bodies")
        if not isinstance(axes, str) or axes not in ("aligned", "opposed", "nearest"):
            raise InputError(f"axes is {axes!r}; expected 'aligned', 'opposed' or 'nearest'")
        super().__init__((self._frame_a.body, self._frame_b.body), name, "" if name else words(type(self)))
        self._asked_axes = axes
        bodies = self._frame_a.body, self._frame_b.body
        self._axes: Sense = self._nearest_at({body: body.q for body in bodies}) if axes == "nearest" else axes
        pairs = FramePair(self._frame_a, self._frame_b), FramePair(self._frame_a, OpposedFrame(self._frame_b))
        self._senses: Mapping[Sense, FramePair] = {"aligned": pairs[0], "opposed": pairs[1]}
        # Coordinates of the one sense and of the other, of what "nearest" may turn around.
        self._twins: dict[Coordinate, Coordinate] = {}
        self._frames = self._senses[self._axes]
        self._own = tuple(Equation(((1.0, self._coordinate(*which)),)) for which in self._zero)
        limits_names = ["limits"] if len(self._free) == 1 else [f"{freedom}_limits" for freedom in self._free]
        self._freedoms = {
            freedom: Freedom(
                self, freedom, self._free_coordinate(freedom), *settings[freedom], self._argument, limits_name
            )
            for freedom, limits_name in zip(self._free, limits_names, strict=True)
        }

    def _shared(self) -> Iterable[object]:
        return *self._bodies, self._frame_a, self._frame_b

    @property
    def frame_a(self) -> Frame:
        """The first frame, as it was given."""
        return self._frame_a

    @property
    def frame_b(self) -> Frame:
        """The second frame, as it was given."""
        return self._frame_b

    @property
    def axes(self) -> Sense:
        """Whether the z axes are aligned or opposed, where the joint asks for either.

        Of a joint that takes what is nearest: what it was where the last solve began, before that where bodies stood
        when it was made.
        """
        return self._axes

    @property
    def asked_axes(self) -> Axes:
        """The same as it was asked for: "nearest" where a start decides."""
        return self._asked_axes

    @property
    def freedoms(self) -> Mapping[str, Freedom]:
        """Coordinates by name."""
        return MappingProxyType(self._freedoms)

    def freedom(self, name: str | None = None) -> Freedom:
        """A coordinate by name; the only one when no name is given.

        Raises
        ------
        InputError
            No such coordinate, or no name where there are several; the message lists the names.
        """
        if name is None and len(self._freedoms) == 1:
            return next(iter(self._freedoms.values()))
        if isinstance(name, str) and name in self._freedoms:
            return self._freedoms[name]
        known = ", ".join(map(repr, self._freedoms)) or "none, the joint leaves no coordinate free"
        raise InputError(f"name is {name!r}; expected a coordinate of {self.name!r}: {known}")

    def coordinate(self, name: str | None = None) -> Freedom:
        """The same as `freedom`."""
        return self.freedom(name)

    @property
    def equations(self) -> tuple[Equation, ...]:
        """Rows now: the joint's own, then driven values, then limits, both in the order of the coordinates."""
        asked = [row for freedom in self._freedoms.values() for row in freedom.equations]
        return (*self._own, *(row for row in asked if not row.one_sided), *(row for row in asked if row.one_sided))

    def _nearest_at(self, poses: Mapping[Body, Array]) -> Sense:
        """Whether z axes are nearer to aligned or to opposed where bodies are at these poses (7,)."""
        z_a, z_b = (rotation_matrix(poses[f.body][3:]) @ f.axes[:, 2] for f in (self._frame_a, self._frame_b))
        cosine = float(z_a @ z_b)
        if abs(cosine) <= _ACROSS:
            cosine = float(z_a @ _LEAN @ z_b)
        return "opposed" if cosine < 0.0 else "aligned"

    def _take_axes(self, axes: Sense) -> None:
        """Have the axes aligned or opposed from now on: rows and coordinates are of other frames."""
        if axes == self._axes:
            return
        self._axes, self._frames = axes, self._senses[axes]
        self._own = tuple(
            replace(row, terms=tuple((factor, self._twin(each)) for factor, each in row.terms)) for row in self._own
        )
        for freedom in self._freedoms.values():
            freedom._coordinate = self._twin(freedom.coordinate)
        count_change()

    def _twin(self, coordinate: Coordinate) -> Coordinate:
        """A coordinate of the other sense, always the same one."""
        if coordinate not in self._twins:
            other = Coordinate(coordinate.kind, coordinate.component, self._frames)
            self._twins[coordinate], self._twins[other] = other, coordinate
        return self._twins[coordinate]

    def _coordinate_in(self, name: str, axes: Sense | None) -> Coordinate:
        """What a joint coordinate measures where the axes are aligned or opposed."""
        coordinate = self._freedoms[name].coordinate
        return coordinate if axes is None or axes == self._axes else self._twins[coordinate]

    def _coordinate(self, kind: int, component: int) -> Coordinate:
        return Coordinate(kind, component, self._frames)

    def _free_coordinate(self, freedom: str) -> Coordinate:
        return self._coordinate(*self._free[freedom])

    def __repr__(self) -> str:
        a, b = self._bodies
        axes = f", axes={self._asked_axes!r}" if self._asked_axes != "aligned" else ""
        settings = "".join(freedom.settings() for freedom in self._freedoms.values())
        return f"{type(self).__name__}({a.name!r}, {b.name!r}, name={self.name!r}{axes}{settings})"


class Driven:
    """Attribute of a joint: the driven value of a coordinate, None where it is free. Settable."""

    def __init__(self, freedom: str, meaning: str) -> None:
        self._freedom = freedom
        self.__doc__ = f"Driven value: {meaning}; None where it is free. Settable between solves."

    @overload
    def __get__(self, joint: None, owner: type[Joint]) -> Self: ...

    @overload
    def __get__(self, joint: Joint, owner: type[Joint]) -> float | None: ...

    def __get__(self, joint: Joint | None, owner: type[Joint]) -> Self | float | None:
        return self if joint is None else joint._freedoms[self._freedom].value

    def __set__(self, joint: Joint, value: float | None) -> None:
        joint._freedoms[self._freedom].value = value


class Limits:
    """Attribute of a joint: the limits of a coordinate, None without. Settable."""

    def __init__(self, freedom: str) -> None:
        self._freedom = freedom
        self.__doc__ = f"(lower, upper) of {freedom}; either may be None; None without limits. Settable between solves."

    @overload
    def __get__(self, joint: None, owner: type[Joint]) -> Self: ...

    @overload
    def __get__(self, joint: Joint, owner: type[Joint]) -> Bounds | None: ...

    def __get__(self, joint: Joint | None, owner: type[Joint]) -> Self | Bounds | None:
        return self if joint is None else joint._freedoms[self._freedom].limits

    def __set__(self, joint: Joint, value: Sequence[float | None] | None) -> None:
        joint._freedoms[self._freedom].limits = value


class Offset:
    """Attribute of a constraint: the number that one of its rows equals. Settable."""

    def __init__(self, meaning: str) -> None:
        self.__doc__ = f"{meaning} Settable between solves."

    @overload
    def __get__(self, constraint: None, owner: type[Constraint]) -> Self: ...

    @overload
    def __get__(self, constraint: Constraint, owner: type[Constraint]) -> float: ...

    def __get__(self, constraint: Constraint | None, owner: type[Constraint]) -> Self | float:
        if constraint is None:
            return self
        value: float = constraint.__dict__["offset"]
        return value

    def __set__(self, constraint: Constraint, value: float) -> None:
        constraint.__dict__["offset"] = bounded("offset", value)
