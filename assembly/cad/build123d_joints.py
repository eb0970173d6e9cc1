"""Joints of build123d connected by `connect_to`, as joints of this package with their ranges.

build123d places the second part of each tie for itself, in the order of the calls; a loop that the last call closes is
open elsewhere. With A, B the placements of the parts, J of the joint on the first and K of the one on the second:

| tied | what build123d makes hold | joint |
|---|---|---|
| rigid to rigid | A J = B K | Fixed |
| revolute to rigid | A J Rz(angle) = B K | Revolute |
| linear to rigid | A T(p + d position) = B K | Prismatic |
| cylindrical to rigid | A T(p + d position) P Rz(angle) = B K | Cylindrical |
| linear to revolute | A T(p + d position) P Rz(angle) = B T(o) | Prismatic and Revolute, a slide between them |
| ball to rigid | A J Rx(x) Ry(y) Rz(z) = B K | Spherical; with ranges or driven three Revolute, as in a gimbal |

p, d are origin and direction of the first joint's axis, o the origin of the second one's, and P the axes that the
reference of angles, x, and the axis, z, make; a revolute joint with a reference has J P for J. A tie that a rigid
joint began is that of the other joint.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import radians
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.cad.locations import pose_of
from assembly.constraints.model.constraint import Bounds
from assembly.constraints.model.joint import Joint
from assembly.constraints.model.joints import Cylindrical, Fixed, Prismatic, Revolute, Spherical
from assembly.errors import InputError, number, vector
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame
from assembly.kinematics.pose import Pose, axes_quaternion, rotation_matrix

__all__ = ["Tie", "kind_of"]

Array = NDArray[np.float64]
IDENTITY = np.eye(3)
# Degrees beyond which a range of angles leaves all of them.
WHOLE_TURN = 360.0


class Tie:
    """One `first.connect_to(second)`.

    Parameters
    ----------
    first, second : build123d joints
        As they were tied.
    bodies : (Body, Body)
        Of their parts.
    name : str
    driven : number or mapping, optional
        Values that are held: degrees of "angle", of a ball three "angles", length of "position".
    """

    def __init__(self, first: Any, second: Any, bodies: tuple[Body, Body], name: str, driven: Any) -> None:
        if kind_of(first) == "Rigid" and kind_of(second) != "Rigid":
            first, second, bodies = second, first, (bodies[1], bodies[0])
        self._first, self._second = first, second
        self._a, self._b = bodies
        self._name = name
        self._driven = _checked(name, driven)
        self.between: list[Body] = []

    def joints(self) -> list[Joint]:
        """The joints, after which `between` has the bodies that they needed.

        Raises
        ------
        InputError
            Of other kinds, or with values for what the joint does not leave free.
        """
        kinds = kind_of(self._first), kind_of(self._second)
        makers = {
            ("Rigid", "Rigid"): self._fixed,
            ("Revolute", "Rigid"): self._revolute,
            ("Linear", "Rigid"): self._prismatic,
            ("Cylindrical", "Rigid"): self._cylindrical,
            ("Linear", "Revolute"): self._slide_and_turn,
            ("Ball", "Rigid"): self._ball,
        }
        if kinds not in makers:
            known = ", ".join(f"{a} to {b}" for a, b in makers)
            raise InputError(f"{self._name!r} ties {kinds[0]} to {kinds[1]}; expected one of {known}")
        found = makers[kinds]()
        if self._driven:
            raise InputError(
                f"driven has {', '.join(map(repr, self._driven))} of {self._name!r}, which the joint "
                "does not leave free"
            )
        return found

    def _value(self, what: str, limits: tuple[float, float] | None) -> float | None:
        """A driven value, in the unit of build123d, as the limits are; None if there is none."""
        value = self._driven.pop(what, None)
        if value is None or limits is None or limits[0] <= value <= limits[1]:
            return value
        low, high = limits
        expected = f"expected one in its range, {low:g} to {high:g}"
        raise InputError(f"driven has the {what} {value:g} for {self._name!r}; {expected}")

    def _turn(self, degrees: Any, what: str = "angle") -> tuple[float | None, Bounds | None]:
        """Driven angle and limits [rad] of a range [degrees], which has none where it leaves every angle."""
        low, high = (float(value) for value in degrees)
        limits = None if high - low >= WHOLE_TURN else (low, high)
        value = self._value(what, limits)
        return (None if value is None else radians(value)), (limits and (radians(low), radians(high)))

    def _slide(self, joint: Any) -> tuple[float | None, Bounds | None]:
        low, high = joint.linear_range
        limits = None if low == -np.inf and high == np.inf else (float(low), float(high))
        return self._value("position", limits), limits

    def _fixed(self) -> list[Joint]:
        return [Fixed(_frame(self._a, self._first), _frame(self._b, self._second), name=self._name)]

    def _revolute(self) -> list[Joint]:
        frame = _frame(self._a, self._first)
        if self._first._angle_reference_provided:
            frame = Frame(self._a, frame.origin, frame.axes @ _reference(self._a, self._first).axes)
        angle, limits = self._turn(self._first.angular_range)
        return [Revolute(frame, _frame(self._b, self._second), name=self._name, angle=angle, limits=limits)]

    def _prismatic(self) -> list[Joint]:
        along, other = _along(self._a, self._first), _frame(self._b, self._second)
        # The parts' axes stay those of each other, whatever the direction of the slide.
        turned = Frame(self._b, other.origin, other.axes @ along.axes)
        slide, limits = self._slide(self._first)
        return [Prismatic(along, turned, name=self._name, slide=slide, limits=limits)]

    def _cylindrical(self) -> list[Joint]:
        angle, angle_limits = self._turn(self._first.angular_range)
        slide, slide_limits = self._slide(self._first)
        return [
            Cylindrical(
                _reference(self._a, self._first),
                _frame(self._b, self._second),
                name=self._name,
                angle=angle,
                slide=slide,
                angle_limits=angle_limits,
                slide_limits=slide_limits,
            )
        ]

    def _slide_and_turn(self) -> list[Joint]:
        slider = Body(f"slide of {self._name}")
        self.between.append(slider)
        slide, slide_limits = self._slide(self._first)
        angle, limits = self._turn(self._second.angular_range)
        along = _along(self._a, self._first)
        # The slider has the axes of the first part, and the joint's origin for its own.
        turns = _reference(self._a, self._second).axes
        end = Frame(self._b, _vector(self._second.relative_axis.position), IDENTITY)
        return [
            Prismatic(
                along,
                Frame(slider, np.zeros(3), along.axes),
                name=f"{self._name}, position",
                slide=slide,
                limits=slide_limits,
            ),
            Revolute(Frame(slider, np.zeros(3), turns), end, name=f"{self._name}, angle", angle=angle, limits=limits),
        ]

    def _ball(self) -> list[Joint]:
        a, b = _frame(self._a, self._first), _frame(self._b, self._second)
        turns = [self._turn(one, axis) for one, axis in zip(self._first.angular_range, "xyz", strict=True)]
        if all(turn == (None, None) for turn in turns):
            return [Spherical(a, b, name=self._name)]
        # Turns about x, y and z, each carried by the ones before.
        rings = [Body(f"{ring} ring of {self._name}") for ring in ("outer", "inner")]
        self.between += rings
        chain = [a, *(Frame(ring, np.zeros(3), IDENTITY) for ring in rings), b]
        found: list[Joint] = []
        for k, axis in enumerate("xyz"):
            cyclic = np.roll(IDENTITY, -(k + 1), axis=1)
            before, after = (Frame(end.body, end.origin, end.axes @ cyclic) for end in chain[k : k + 2])
            angle, limits = turns[k]
            found.append(Revolute(before, after, name=f"{self._name}, {axis}", angle=angle, limits=limits))
        return found

    def begin(self, poses: Mapping[Body, Pose]) -> None:
        """Put the bodies between to where the parts stand."""
        for k, body in enumerate(self.between):
            if kind_of(self._first) == "Linear":
                along = _along(self._a, self._first)
                a, b = poses[self._a], poses[self._b]
                away = b.apply(_vector(self._second.relative_axis.position)) - a.apply(along.origin)
                way = rotation_matrix(a.quaternion) @ along.axes[:, 2]
                body.pose = Pose(a.apply(along.origin) + (away @ way) * way, a.quaternion)
            else:
                body.pose = _rings(_frame(self._a, self._first), _frame(self._b, self._second), poses)[k]


def _rings(a: Frame, b: Frame, poses: Mapping[Body, Pose]) -> list[Pose]:
    """Where the rings of a gimbal stand between two frames: turned by the first, and the first two, of their angles."""
    outside = rotation_matrix(poses[a.body].quaternion) @ a.axes
    r = outside.T @ rotation_matrix(poses[b.body].quaternion) @ b.axes
    x, y = np.arctan2(-r[1, 2], r[2, 2]), np.arctan2(r[0, 2], np.hypot(r[1, 2], r[2, 2]))
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, np.cos(x), -np.sin(x)], [0.0, np.sin(x), np.cos(x)]])
    about_y = np.array([[np.cos(y), 0.0, np.sin(y)], [0.0, 1.0, 0.0], [-np.sin(y), 0.0, np.cos(y)]])
    middle = poses[a.body].apply(a.origin)
    turned = (outside @ about_x, outside @ about_x @ about_y)
    return [Pose(middle, axes_quaternion(axes)) for axes in turned]


def kind_of(joint: Any) -> str:
    """The kind of a joint of build123d, "Revolute" say, also of a class made of one."""
    for cls in type(joint).__mro__:
        if cls.__module__.partition(".")[0] == "build123d" and cls.__name__.endswith("Joint"):
            return cls.__name__.removesuffix("Joint")
    return type(joint).__name__


def _checked(name: str, driven: Any) -> dict[str, float]:
    """Values by "angle" and "position", the three "angles" of a ball by "x", "y" and "z"."""
    if driven is None:
        return {}
    if not isinstance(driven, Mapping):
        raise InputError(f"driven is {driven!r} for {name!r}; expected {{'angle': degrees, 'position': length}}")
    found: dict[str, float] = {}
    for what, value in driven.items():
        if what not in ("angle", "angles", "position"):
            raise InputError(f"driven has {what!r} for {name!r}; expected 'angle', 'angles' or 'position'")
        if what == "angles":
            found.update(zip("xyz", vector(f"the angles of {name!r}", value, 3).tolist(), strict=True))
        else:
            found[what] = number(f"the {what} of {name!r}", value)
    return found


def _vector(value: Any) -> Array:
    return np.array([value.X, value.Y, value.Z])


def _frame(body: Body, joint: Any) -> Frame:
    """The joint's own frame on its part: that of a location, or of an axis."""
    relative = getattr(joint, "relative_location", None)
    location = joint.relative_axis.location if relative is None else relative
    pose = pose_of(location.wrapped, f"joint {joint.label!r}")
    return Frame(body, pose.position, rotation_matrix(pose.quaternion))


def _along(body: Body, joint: Any) -> Frame:
    """A frame at the origin of an axis, z along it."""
    return body.frame(_vector(joint.relative_axis.position), _vector(joint.relative_axis.direction))


def _reference(body: Body, joint: Any) -> Frame:
    """A frame at the origin of an axis, z along it, x at its reference of angles."""
    axis = joint.relative_axis
    return body.frame(_vector(axis.position), _vector(axis.direction), _vector(joint.angle_reference))
