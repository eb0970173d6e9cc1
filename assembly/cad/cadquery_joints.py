"""Constraints of CadQuery as joints: what each kind requires.

With p, o points and d, n unit directions of the markers where the parts stand, and v the value:

| kind | what holds | joint |
|---|---|---|
| Point | the distance of p from o is abs(v); 0 without a value | Spherical, Distance |
| Axis | the angle between d and n is v; a half turn without a value | Parallel, Angle |
| Plane | Axis with v, and Point | Revolute; Angle and Spherical |
| PointInPlane | n . (p - o) = v | PointOnPlane |
| PointOnLine | the distance of p from the line is abs(v) | PointOnLine |
| FixedPoint | p = v | Spherical with the world |
| FixedAxis | d points along v | Parallel with the world |
| FixedRotation | the part is turned by v about the world's x, then y, then z axis | Parallel with the world |

CadQuery itself compares the square of the distance from a line over the assembly's size with v, which depends on the
size; its documentation calls v a distance, and so it is taken.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, fabs, fmod, pi, sin

import numpy as np
from numpy.typing import NDArray

from assembly.cad.locations import Vector, frame_on
from assembly.cad.markers import Marker, Requirement
from assembly.constraints.model.joint import Joint
from assembly.constraints.model.joints import Parallel, Revolute, Spherical
from assembly.constraints.model.placements import Angle, Distance, PointOnLine, PointOnPlane
from assembly.errors import InputError
from assembly.kinematics.body import Body
from assembly.kinematics.pose import direction

__all__ = ["Maker"]

Array = NDArray[np.float64]
# Angles that are nearer to 0 or a half turn are taken for that: radians of whole degrees are rounded, 540 say.
ANGLE_ROUNDING = 1e-14
ORIGIN = (0.0, 0.0, 0.0)


class Maker:
    """Makes joints of requirements."""

    def __init__(self) -> None:
        self._kinds: dict[str, Callable[[str, Requirement, tuple[Body, ...]], list[Joint]]] = {
            "Axis": self._axis,
            "FixedAxis": self._fixed_axis,
            "FixedPoint": self._fixed_point,
            "FixedRotation": self._fixed_rotation,
            "Point": self._point,
            "PointInPlane": self._point_in_plane,
            "PointOnLine": self._point_on_line,
        }

    def joints(self, name: str, requirements: tuple[Requirement, ...], bodies: tuple[Body, ...]) -> list[Joint]:
        """The joints of one constraint, whose name they have.

        Parameters
        ----------
        name
        requirements
            What the constraint stands for.
        bodies : (Body, Body)
            Of a constraint of one part the part and the world.
        """
        if len(requirements) == 2 and {item.kind for item in requirements} == {"Axis", "Point"}:
            axis, point = sorted(requirements, key=lambda item: item.kind)
            angle = _folded(axis.value)
            if not point.value and _is_straight(angle):
                a, b = (
                    frame_on(body, _place(at), _way(along))
                    for body, at, along in zip(bodies, point.markers, axis.markers, strict=True)
                )
                return [Revolute(a, b, name=name, axes="opposed" if angle > 1.0 else "aligned")]
        found: list[Joint] = []
        for item in requirements:
            if item.kind not in self._kinds:
                known = ", ".join(sorted(self._kinds))
                raise InputError(f"constraint {name!r} is of kind {item.kind!r}; expected Fixed, Plane, {known}")
            own = name if len(requirements) == 1 else f"{name}, {item.kind}"
            found += self._kinds[item.kind](own, item, bodies)
        return found

    def _axis(self, name: str, item: Requirement, bodies: tuple[Body, ...]) -> list[Joint]:
        a, b = (frame_on(body, ORIGIN, _way(marker)) for body, marker in zip(bodies, item.markers, strict=True))
        angle = _folded(item.value)
        if _is_straight(angle):
            return [Parallel(a, b, name=name, axes="opposed" if angle > 1.0 else "aligned")]
        return [Angle(a, b, angle, name=name)]

    def _point(self, name: str, item: Requirement, bodies: tuple[Body, ...]) -> list[Joint]:
        a, b = (body.point(*_place(marker)) for body, marker in zip(bodies, item.markers, strict=True))
        if not item.value:
            return [Spherical(a, b, name=name)]
        return [Distance(a, b, fabs(item.value), name=name)]

    def _point_in_plane(self, name: str, item: Requirement, bodies: tuple[Body, ...]) -> list[Joint]:
        point, plane = item.markers
        frame = frame_on(bodies[1], _place(plane), _way(plane))
        return [PointOnPlane(bodies[0].point(*_place(point)), frame, name=name, offset=item.value or 0.0)]

    def _point_on_line(self, name: str, item: Requirement, bodies: tuple[Body, ...]) -> list[Joint]:
        marker, line = item.markers
        point = bodies[0].point(*_place(marker))
        frame = frame_on(bodies[1], _place(line), _way(line))
        return [PointOnLine(point, frame, name=name, distance=fabs(item.value or 0.0))]

    def _fixed_point(self, name: str, item: Requirement, bodies: tuple[Body, ...]) -> list[Joint]:
        part, world = bodies
        return [Spherical(world.point(*item.value), part.point(*_place(item.markers[0])), name=name)]

    def _fixed_axis(self, name: str, item: Requirement, bodies: tuple[Body, ...]) -> list[Joint]:
        part, world = bodies
        x, y, z = direction(f"the value of {name!r}", item.value).tolist()
        return [Parallel(frame_on(world, ORIGIN, (x, y, z)), frame_on(part, ORIGIN, _way(item.markers[0])), name=name)]

    def _fixed_rotation(self, name: str, item: Requirement, bodies: tuple[Body, ...]) -> list[Joint]:
        part, world = bodies
        turned = _turned(item.value)
        return [Parallel(world.frame(z=turned[:, 2], x=turned[:, 0]), part.frame(), name=name, angle=0.0)]


def _folded(value: float | None) -> float:
    """An angle with the same cosine, from 0 to pi; a half turn where none is given."""
    if value is None:
        return pi
    angle = fabs(fmod(float(value), 2.0 * pi))
    return min(angle, 2.0 * pi - angle)


def _is_straight(angle: float) -> bool:
    return min(angle, pi - angle) <= ANGLE_ROUNDING


def _place(marker: Marker) -> Vector:
    assert marker.point is not None, "the kind has a point here"
    return marker.point


def _way(marker: Marker) -> Vector:
    assert marker.direction is not None, "the kind has a direction here"
    return marker.direction


def _turned(angles: Vector) -> Array:
    """Rotation (3, 3) about the world's x axis, then y, then z."""
    turn = np.eye(3)
    for k, angle in enumerate(angles):
        i, j = (k + 1) % 3, (k + 2) % 3
        about = np.eye(3)
        about[i, i] = about[j, j] = cos(angle)
        about[j, i], about[i, j] = sin(angle), -sin(angle)
        turn = about @ turn
    return turn
