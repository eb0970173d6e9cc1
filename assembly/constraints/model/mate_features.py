"""What mates are made of: planes, axes and centers of faces and edges, as frames on their bodies."""

from __future__ import annotations

from collections.abc import Mapping
from math import sin
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.constraint import RowConstraint
from assembly.errors import InputError
from assembly.geometry.recognition.forms import Cone
from assembly.kinematics.body import BodyFace
from assembly.kinematics.frame import Frame, Point
from assembly.selection.edges import BodyEdge, Edges
from assembly.selection.faces import Faces
from assembly.selection.selection import Selection
from assembly.selection.vertices import BodyVertex, Vertices

__all__ = [
    "AxisLike",
    "CenterLike",
    "Mate",
    "PlaneLike",
    "axis_frame",
    "center_of_ball",
    "one_feature",
    "plane_frame",
    "point_frame",
    "refused",
]

Array = NDArray[np.float64]
PlaneLike = BodyFace | Frame | Faces
AxisLike = BodyFace | BodyEdge | Frame | Faces | Edges
CenterLike = Point | BodyVertex | BodyFace | BodyEdge | Vertices | Faces | Edges


class Mate(RowConstraint):
    """What mates have: the features that they tie, and how many degrees of freedom they take away.

    Features are faces, edges and vertices, or selections of a single one. Two bodies often have several mates of a
    kind: where nobody said names the second one is "flush a-b 2" from when an assembly takes it.
    """

    _is_numbered = True

    _given: Mapping[str, Any]

    @property
    def features(self) -> tuple[Any, ...]:
        """What was given: faces, edges, points or frames."""
        return tuple(self._given.values())

    @property
    def removes(self) -> int:
        """How many degrees of freedom the mate itself takes away; driven values take away one more each."""
        return sum(not (row.one_sided or row.is_drive) for row in self.equations)

    def _settings(self) -> str:
        """What is said beyond the features: ", name=..." and the like."""
        return f", name={self.name!r}"

    def __repr__(self) -> str:
        given = ", ".join(map(repr, self._given.values()))
        return f"{type(self).__name__}({given}{self._settings()}; takes away {self.removes} of 6 degrees of freedom)"


def one_feature(value: Any) -> Any:
    """The only thing of a selection; what is no selection as it is."""
    return value.one() if isinstance(value, Selection) else value


def refused(name: str, value: Any, expected: str) -> NoReturn:
    """Raise for what cannot be used: a TypeError for a wrong kind of thing, else an InputError that says what it is."""
    if isinstance(value, (BodyFace, BodyEdge)):
        raise InputError(f"{name} is {value!r}, a {value.kind}; expected {expected}")
    raise TypeError(f"{name} is {value!r}; expected {expected}")


def plane_frame(name: str, value: Any) -> Frame:
    """The frame of a flat face, z outward; a frame as it is."""
    if isinstance(value, Frame):
        return value
    if isinstance(value, BodyFace) and value.kind == "plane":
        return value.frame()
    refused(name, value, "a flat face of a body, or a frame whose x-y plane is meant")


def axis_frame(name: str, value: Any) -> Frame:
    """The frame of a face or an edge that has an axis, z along it; a frame as it is."""
    if isinstance(value, Frame):
        return value
    if isinstance(value, BodyFace) and value.kind in ("cylinder", "cone", "torus", "revolution"):
        return value.frame()
    if isinstance(value, BodyEdge) and value.kind in ("circle", "line"):
        return value.frame()
    refused(name, value, "a cylinder, cone, torus or revolution, a circle or a line, or a frame whose z axis is meant")


def center_of_ball(name: str, value: Any, other: Any) -> Frame:
    """The frame at the center of a sphere, or at the place on a cone's axis where a sphere of another side fits it."""
    if isinstance(value, BodyFace):
        form = value.form
        if value.kind == "sphere":
            return value.frame()
        if isinstance(form, Cone) and isinstance(other, BodyFace) and other.kind == "sphere":
            if value.is_hole == other.is_hole:
                both = "hollow" if value.is_hole else "full"
                raise InputError(
                    f"{name} is {value!r}, a cone, and the sphere is {other!r}, both {both}; "
                    "expected one hollow, one full"
                )
            return value.body.frame(form.apex + other.radius / sin(form.half_angle) * form.axis, form.axis)
    refused(name, value, "a sphere, or a cone with a sphere on the other side")


def point_frame(name: str, value: Any) -> Frame:
    """The frame, with the axes of its body, at a point, a vertex, or the center of a sphere or a circle."""
    if isinstance(value, Point):
        return value.body.frame(value.coordinates)
    if isinstance(value, BodyVertex):
        return value.body.frame(value.center)
    if isinstance(value, BodyFace) and value.kind == "sphere":
        return value.frame()
    if isinstance(value, BodyEdge) and value.kind == "circle":
        return value.body.frame(value.center)
    refused(name, value, "a point of a body, a vertex, a sphere or a circle, whose center is meant")
