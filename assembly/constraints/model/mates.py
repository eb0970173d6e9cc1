"""Mates: joints of faces and edges, by their kinds. Each says how many of six degrees of freedom it takes away.

    top, foot = plate.faces(">Z"), bracket.faces("<Z")
    asm.Flush(top, foot)                                             # face on face: 3
    asm.Insert(plate.faces.cylinders(hole=True).near(p), bolt.faces.cylinders(radius=3))     # hole and shank: 5

They are joints of frames that faces and edges have (`face.frame()`), so coordinates, driven values and limits are those
of the joints they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from assembly.constraints.model.constraint import Equation
from assembly.constraints.model.insert_seats import Seats, found_seats
from assembly.constraints.model.joint import ON_AXIS, SAME_AXIS, Axes, Offset
from assembly.constraints.model.joints import ALONG, Cylindrical, Planar, Revolute, Spherical
from assembly.constraints.model.mate_features import (
    AxisLike,
    Mate,
    PlaneLike,
    axis_frame,
    center_of_ball,
    one_feature,
    plane_frame,
)
from assembly.errors import InputError
from assembly.kinematics.body import BodyFace
from assembly.kinematics.frame import Frame
from assembly.selection.edges import BodyEdge, Edges
from assembly.selection.faces import Faces
from assembly.selection.selection import Selection, are_parallel

__all__ = ["Coaxial", "Concentric", "Flush", "Insert", "Width"]


class Flush(Mate, Planar):
    """A flat face on a flat face: 3 rows, takes away 3 degrees of freedom.

    The planes are at a distance `offset` along the outward normal of the first, zero by default. Free: what `Planar`
    leaves free, `x`, `y` and `angle`.

    Parameters
    ----------
    face_a, face_b : flat face, or Frame
        Or selections of a single face. For a frame, its x-y plane, with z outward.
    name : str, optional
    offset : float
        Height of face b above face a.
    axes : "opposed", "aligned" or "nearest"
        Outward normals opposed, as for faces that lie on each other, or aligned, as for faces of two parts that end at
        one level.
    **freedoms
        Driven values and limits of `x`, `y` and `angle`; see `Planar`.

    Raises
    ------
    InputError
        A face that is not flat, a selection that is not a single face, both on one body.
    TypeError
        Something else than a face or a frame.
    """

    _sides = ("face_a", "face_b")

    def __init__(
        self,
        face_a: PlaneLike,
        face_b: PlaneLike,
        name: str | None = None,
        *,
        offset: float = 0.0,
        axes: Axes = "opposed",
        **freedoms: Any,
    ) -> None:
        a, b = one_feature(face_a), one_feature(face_b)
        frames = plane_frame("face_a", a), plane_frame("face_b", b)
        super().__init__(*frames, name, axes=axes, offset=offset, **freedoms)
        self._given = {"face_a": a, "face_b": b}

    def _settings(self) -> str:
        return f"{super()._settings()}, axes={self.asked_axes!r}, offset={self.offset!r}{_freedoms(self)}"


class Coaxial(Mate, Cylindrical):
    """Two axes lie on each other: 4 rows, takes away 4 degrees of freedom.

    Free: what `Cylindrical` leaves free, `angle` and `slide`.

    Parameters
    ----------
    a, b : cylinder, cone, torus or revolution; circle or line; or Frame
        Faces, edges, or selections of a single one. For a frame, its z axis.
    name : str, optional
    axes : "nearest", "aligned" or "opposed"
        Axes of faces other than cones have no sense; by default the nearer one at the start of a solve is taken, which
        `solution.axes` tells.
    **freedoms
        Driven values and limits of `angle` and `slide`; see `Cylindrical`.

    Raises
    ------
    InputError
        Something without an axis, a selection that is not a single thing, both on one body.
    TypeError
        Something else than a face, an edge or a frame.
    """

    _sides = ("a", "b")

    def __init__(
        self, a: AxisLike, b: AxisLike, name: str | None = None, *, axes: Axes = "nearest", **freedoms: Any
    ) -> None:
        one, other = one_feature(a), one_feature(b)
        super().__init__(axis_frame("a", one), axis_frame("b", other), name, axes=axes, **freedoms)
        self._given = {"a": one, "b": other}

    def _settings(self) -> str:
        return f"{super()._settings()}, axes={self.asked_axes!r}{_freedoms(self)}"


class Insert(Mate, Revolute):
    """A shank in a hole, to where it sits: coaxial and flush, 5 rows, takes away 5 degrees of freedom.

    The circles at which both end, their seats, come to lie in one plane about one axis. A given edge is a seat itself.
    A shank with a shoulder, such as a bolt's under its head, has the shoulder on the face at a mouth of the hole. A
    shank without a shoulder sits on the bottom of a blind hole; in a through hole its end is level with a mouth. Among
    several mouths and ends the nearest pair is taken that faces the right way at the poses when the mate is made;
    `seats` tells which, and can be given. Free: `angle`.

    Parameters
    ----------
    hole, shank : cylinder, or circle
        Faces, edges, or selections of a single one.
    name : str, optional
    offset : float
        How far the seat of the shank is above that of the hole, along the outward normal there.
    axes : "opposed", "aligned" or "nearest", optional
        Of the outward normals of the flat faces at the seats: "opposed" if one comes to lie on the other, "aligned" if
        they end at one level. By default as above, and "opposed" for edges.
    seats : (circle, circle), optional
        The edges at which hole and shank sit.
    **freedoms
        Driven value and limits of `angle`; see `Revolute`.

    Raises
    ------
    InputError
        A hole that is not hollow, a shank that is not full (they may be in the wrong order), a shank with the larger
        radius, a face without a circle at which it ends on a flat face, both on one body.
    TypeError
        Something else than a face or an edge.
    """

    _sides = ("hole", "shank")
    # The origin on the axis, and at a height above it that is a number.
    _zero = (*ON_AXIS, *SAME_AXIS)
    offset = Offset("How far the seat of the shank is above that of the hole.")

    def __init__(
        self,
        hole: BodyFace | BodyEdge | Faces | Edges,
        shank: BodyFace | BodyEdge | Faces | Edges,
        name: str | None = None,
        *,
        offset: float = 0.0,
        axes: Axes | None = None,
        seats: Sequence[BodyEdge | Edges] | None = None,
        **freedoms: Any,
    ) -> None:
        a, b = one_feature(hole), one_feature(shank)
        self._seats = found_seats(a, b, seats)
        chosen: Axes = self._seats.axes if axes is None else axes
        super().__init__(self._seats.hole.frame(), self._seats.shank.frame(), name, axes=chosen, **freedoms)
        self.offset = offset
        self._own = (*self._own, Equation(((1.0, self._coordinate(*ALONG)),), (self, "offset")))
        self._given = {"hole": a, "shank": b}

    @property
    def seats(self) -> Seats:
        """The circles at which hole and shank sit."""
        return self._seats

    def _settings(self) -> str:
        offset = f", offset={self.offset!r}" if self.offset else ""
        seats = f", seats=({self._seats.hole!r}, {self._seats.shank!r})"
        return f"{super()._settings()}, axes={self.asked_axes!r}{offset}{seats}{_freedoms(self)}"


class Concentric(Mate, Spherical):
    """Two spheres about one center, or a sphere in a cone: 3 rows, takes away 3 degrees of freedom.

    A sphere touches a cone along a circle, from within the cone or, if the sphere is hollow, from around it: then its
    center is on the axis, at radius / sin(half angle) from the apex. Free: what `Spherical` leaves free.

    Parameters
    ----------
    a, b : sphere; or one of them a cone
        Faces, or selections of a single one.
    name : str, optional
    **freedoms
        Driven values and limits of `swing`, `azimuth` and `twist`; see `Spherical`.

    Raises
    ------
    InputError
        Faces of other kinds, a cone and a sphere that are both full or both hollow, both on one body.
    TypeError
        Something else than a face.
    """

    _sides = ("a", "b")

    def __init__(self, a: BodyFace | Faces, b: BodyFace | Faces, name: str | None = None, **freedoms: Any) -> None:
        one, other = one_feature(a), one_feature(b)
        super().__init__(center_of_ball("a", one, other), center_of_ball("b", other, one), name, **freedoms)
        self._given = {"a": one, "b": other}

    def _settings(self) -> str:
        return f"{super()._settings()}{_freedoms(self)}"


class Width(Mate, Planar):
    """A tab centered in a slot: 3 rows, takes away 3 degrees of freedom.

    The plane in the middle of two parallel faces of the one body lies on that of the other. Free: what `Planar` leaves
    free, `x`, `y` and `angle`.

    Parameters
    ----------
    slot, tab : (face, face)
        Two parallel flat faces of one body each, or selections of a single face, or a selection of two.
    name : str, optional
    offset : float
        Height of the middle of the tab above that of the slot, along the outward normal of the slot's first face.
    axes : "nearest", "aligned" or "opposed"
        Of the normals of the two first faces; a tab fits both ways, so by default the nearer one at the start of a
        solve.
    **freedoms
        Driven values and limits of `x`, `y` and `angle`; see `Planar`.

    Raises
    ------
    InputError
        Faces that are not flat, not two, not parallel, or not of one body.
    TypeError
        Something else than faces.
    """

    _sides = ("slot", "tab")

    def __init__(
        self,
        slot: Sequence[PlaneLike] | Faces,
        tab: Sequence[PlaneLike] | Faces,
        name: str | None = None,
        *,
        offset: float = 0.0,
        axes: Axes = "nearest",
        **freedoms: Any,
    ) -> None:
        sides = two_faces("slot", slot), two_faces("tab", tab)
        frames = middle_frame("slot", *sides[0]), middle_frame("tab", *sides[1])
        super().__init__(*frames, name, axes=axes, offset=offset, **freedoms)
        self._given = {"slot": sides[0], "tab": sides[1]}

    def _settings(self) -> str:
        return f"{super()._settings()}, axes={self.asked_axes!r}, offset={self.offset!r}{_freedoms(self)}"


def two_faces(name: str, value: Any) -> tuple[Any, Any]:
    """Two faces, of a selection or a sequence."""
    if isinstance(value, (BodyFace, Frame, str)) or not isinstance(value, Sequence):
        raise TypeError(f"{name} is {value!r}; expected two flat faces")
    if len(value) != 2:
        what = (
            f"{len(value)} faces: {value.listed() or 'none'}"
            if isinstance(value, Selection)
            else f"{len(value)} things"
        )
        raise InputError(f"{name} is {what}; expected two flat faces")
    return one_feature(value[0]), one_feature(value[1])


def middle_frame(name: str, first: Any, second: Any) -> Frame:
    """The frame in the middle between two parallel planes, with the z axis of the first."""
    one, other = plane_frame(f"{name}[0]", first), plane_frame(f"{name}[1]", second)
    if one.body is not other.body:
        raise InputError(f"{name} is on bodies {one.body.name!r} and {other.body.name!r}; expected faces of one body")
    if first == second:
        raise InputError(f"{name} is {first!r} twice; expected two faces")
    z = one.axes[:, 2]
    if not are_parallel(z, other.axes[:, 2]):
        raise InputError(f"{name} is {first!r} and {second!r}, which are not parallel; expected parallel faces")
    half = 0.5 * float(z @ (other.origin - one.origin))
    return one.body.frame(np.asarray(one.origin + half * z), z, one.axes[:, 0])


def _freedoms(joint: Any) -> str:
    return "".join(freedom.settings() for freedom in joint.freedoms.values())
