"""Joints of points and directions: a point on a line or a plane, a distance, an angle."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from assembly.constraints.model.constraint import Bounds, Equation, Freedom
from assembly.constraints.model.joint import ON_AXIS, Driven, Joint, Limits, Offset, Side, SidePoint
from assembly.constraints.model.joints import ALONG, Number, Range
from assembly.constraints.model.mate_features import AxisLike, PlaneLike, axis_frame, one_feature, plane_frame
from assembly.constraints.program.primitives import ANGLE, DISTANCE, RADIUS, SLIDE
from assembly.errors import InputError, number
from assembly.kinematics.body import BodyFace
from assembly.kinematics.frame import Frame
from assembly.selection.edges import BodyEdge

__all__ = ["Angle", "Distance", "PointOnLine", "PointOnPlane"]


def _of_feature(frame: Side | AxisLike, frame_of: Callable[[str, Any], Frame]) -> Any:
    """The frame of a face or an edge, or what else was given."""
    given = one_feature(frame)
    return frame_of("frame", given) if isinstance(given, (BodyFace, BodyEdge)) else given


class PointOnLine(Joint):
    """A point stays on the z axis of a frame: 2 rows. Or at a distance from it: 1 row, or one for each limit.

    Frame a is the line's. Free with a name: `slide` along z_a; the bodies turn freely against each other. Of a point
    at a distance, or within limits, `distance` is a coordinate as well, whose value the joint holds.

    Parameters
    ----------
    point : Point, vertex, sphere or circle; Frame or Body
        A sphere or circle stands for its center, a frame or body for its origin.
    frame : Frame or Body; or a face or an edge with an axis
        Its z axis is the line.
    distance : float or None
        From the line: 0 is on it, None within `distance_limits`.
    slide, limits
        Driven value and limits along the line.
    distance_limits : (lower, upper), optional
        Of the distance, which is None or above zero then.
    """

    _zero = ON_AXIS
    _free = {"slide": ALONG}
    _sides = ("frame", "point")
    _points = (False, True)
    slide = Driven("slide", "the point along the line")
    limits = Limits("slide")

    def __init__(
        self,
        point: SidePoint,
        frame: Side | AxisLike,
        name: str | None = None,
        *,
        distance: Number = 0.0,
        slide: Number = None,
        limits: Range = None,
        distance_limits: Range = None,
    ) -> None:
        super().__init__(_of_feature(frame, axis_frame), point, name, slide=(slide, limits))
        if distance is None or distance_limits is not None or number("distance", distance) != 0.0:
            self._own = ()
            radius = self._coordinate(RADIUS, 0)
            self._freedoms["distance"] = Freedom(
                self, "distance", radius, distance, distance_limits, "distance", "distance_limits"
            )

    @property
    def distance(self) -> float | None:
        """From the line: 0 on it, None where it is within limits. Settable, of a point that was made at a distance."""
        return self._freedoms["distance"].value if "distance" in self._freedoms else 0.0

    @distance.setter
    def distance(self, value: float | None) -> None:
        self._away().value = value

    @property
    def distance_limits(self) -> Bounds | None:
        """(lower, upper) of distance; either may be None; None without limits. Settable, as `distance` is."""
        return self._freedoms["distance"].limits if "distance" in self._freedoms else None

    @distance_limits.setter
    def distance_limits(self, value: Range) -> None:
        self._away().limits = value

    def _away(self) -> Freedom:
        """The distance as a coordinate."""
        if "distance" not in self._freedoms:
            raise InputError(f"{self.name!r} was made for a point on the line; expected one made with a distance")
        return self._freedoms["distance"]


class PointOnPlane(Joint):
    """A point stays in the x-y plane of a frame, or at a height above it: 1 row.

    Frame a is the plane's. Free with a name: `x` and `y` along its axes; the bodies turn freely against each other.

    Parameters
    ----------
    point : Point, vertex, sphere or circle; Frame or Body
        A sphere or circle stands for its center, a frame or body for its origin.
    frame : Frame or Body, or a flat face
        Its z axis is the plane's normal, of a face the outward one.
    offset : float
        Height of the point along z_a.
    """

    _free = {"x": (SLIDE, 0), "y": (SLIDE, 1)}
    _sides = ("frame", "point")
    _points = (False, True)
    x = Driven("x", "the point along x_a")
    y = Driven("y", "the point along y_a")
    x_limits = Limits("x")
    y_limits = Limits("y")
    offset = Offset("Height of the point above the plane.")

    def __init__(
        self,
        point: SidePoint,
        frame: Side | PlaneLike,
        name: str | None = None,
        *,
        offset: float = 0.0,
        x: Number = None,
        y: Number = None,
        x_limits: Range = None,
        y_limits: Range = None,
    ) -> None:
        super().__init__(_of_feature(frame, plane_frame), point, name, x=(x, x_limits), y=(y, y_limits))
        self.offset = offset
        self._own = (Equation(((1.0, self._coordinate(*ALONG)),), (self, "offset")),)


class Distance(Joint):
    """Two points are a given distance apart, or within limits of each other: 1 row, or one for each limit.

    Parameters
    ----------
    point_a, point_b : Point, vertex, sphere or circle; Frame or Body
        A sphere or circle stands for its center, a frame or body for its origin.
    value : float, optional
        Above zero; points that coincide are `Spherical`.
    limits : (lower, upper), optional
        At least one of value and limits is needed.
    """

    _free = {"distance": (DISTANCE, 0)}
    _sides = ("point_a", "point_b")
    _points = (True, True)
    _argument = "value"
    value = Driven("distance", "the distance")
    limits = Limits("distance")

    def __init__(
        self,
        point_a: SidePoint,
        point_b: SidePoint,
        value: Number = None,
        name: str | None = None,
        *,
        limits: Range = None,
    ) -> None:
        super().__init__(point_a, point_b, name, distance=(value, limits))


class Angle(Joint):
    """The z axes of two frames make a given angle, or one within limits: 1 row, or one for each limit.

    Parameters
    ----------
    frame_a, frame_b : Frame or Body
    value : float, optional
        Between 0 and pi [rad], both excluded; axes along each other are `Parallel`, aligned or opposed.
    limits : (lower, upper), optional
        At least one of value and limits is needed.
    """

    _free = {"angle": (ANGLE, 0)}
    _argument = "value"
    value = Driven("angle", "the angle between the z axes [rad]")
    limits = Limits("angle")

    def __init__(
        self, frame_a: Side, frame_b: Side, value: Number = None, name: str | None = None, *, limits: Range = None
    ) -> None:
        super().__init__(frame_a, frame_b, name, angle=(value, limits))
