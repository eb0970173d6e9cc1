"""Constraints of several bodies at once: a group that moves as one, and symmetry about a plane."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly._copies import OwnState
from assembly.constraints.model.constraint import Coordinate, Equation, FramePair, RowConstraint
from assembly.constraints.model.joint import SAME_AXIS, SAME_POINT
from assembly.constraints.model.joints import TWIST
from assembly.constraints.model.mate_features import (
    CenterLike,
    Mate,
    PlaneLike,
    one_feature,
    plane_frame,
    point_frame,
)
from assembly.constraints.program.primitives import SLIDE
from assembly.errors import InputError, items
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame
from assembly.kinematics.pose import Pose, rotation_matrix

__all__ = ["Group", "Symmetric"]

Array = NDArray[np.float64]


class Group(OwnState, RowConstraint):
    """Bodies that move as one: takes away 6 degrees of freedom for every body but one.

    They keep their relative poses, either those when the group is made or given ones.

    Parameters
    ----------
    bodies : sequence of Body
        Two or more, distinct. If one is fixed, none of them moves.
    name : str, optional
        "group" and the bodies' names by default.
    poses : sequence of Pose, optional
        Their relative poses, one pose per body; the bodies' own by default.

    Raises
    ------
    InputError
        Fewer than two bodies, the same one twice, poses that are not one a body.
    TypeError
        Something that is no body, or no pose.
    """

    _is_numbered = True

    def __init__(self, bodies: Iterable[Body], name: str | None = None, *, poses: Sequence[Pose] | None = None) -> None:
        members = items("bodies", bodies, "two bodies or more")
        for k, body in enumerate(members):
            if not isinstance(body, Body):
                raise TypeError(f"bodies[{k}] is {body!r}; expected a Body")
        if len(members) < 2:
            raise InputError(f"bodies is {[body.name for body in members]}; expected two or more")
        given = tuple(body.pose for body in members) if poses is None else items("poses", poses, "a pose a body")
        for k, pose in enumerate(given):
            if not isinstance(pose, Pose):
                raise TypeError(f"poses[{k}] is {pose!r}; expected a Pose")
        if len(given) != len(members):
            raise InputError(f"poses is {len(given)} poses; expected {len(members)}, one for each body")
        super().__init__(members, name, "group")
        self._poses: tuple[Pose, ...] = given
        base = next((k for k, body in enumerate(members) if body.fixed), 0)
        # Two fixed bodies need no rows: none of them moves.
        others = [k for k, body in enumerate(members) if k != base and not (body.fixed and members[base].fixed)]
        self._own = tuple(row for k in others for row in self._rows(base, k))

    def _shared(self) -> Iterable[object]:
        return self._bodies

    def _rows(self, base: int, k: int) -> list[Equation]:
        """Member k is fixed to the base as the two stand."""
        turn = rotation_matrix(self._poses[base].row[3:])
        origin = turn.T @ (self._poses[k].position - self._poses[base].position)
        axes = turn.T @ rotation_matrix(self._poses[k].row[3:])
        for array in (origin, axes):
            array.flags.writeable = False
        frames = FramePair(Frame(self._bodies[base], origin, axes), self._bodies[k].frame())
        return [Equation(((1.0, Coordinate(*which, frames)),)) for which in (*SAME_POINT, *SAME_AXIS, TWIST)]

    @property
    def poses(self) -> tuple[Pose, ...]:
        """The relative poses of the bodies."""
        return self._poses

    @property
    def equations(self) -> tuple[Equation, ...]:
        """Six rows for every body but one."""
        return self._own

    @property
    def removes(self) -> int:
        """How many degrees of freedom the group takes away."""
        return len(self._own)

    def __repr__(self) -> str:
        names = ", ".join(repr(body.name) for body in self._bodies)
        return f"Group({names}, name={self.name!r}; takes away {self.removes} degrees of freedom)"


class Symmetric(OwnState, Mate):
    """Two points are mirror images of each other in a plane: 3 rows, takes away 3 degrees of freedom.

    Parameters
    ----------
    a, b : Point, vertex, sphere or circle
        Of spheres and circles, their centers. Selections of a single one will do.
    plane : flat face, or Frame
        The mirror, on a third body.
    name : str, optional
        "symmetric" and the bodies' names by default.

    Raises
    ------
    InputError
        A face that is not flat or no sphere, a selection that is not a single thing, both points on one body.
    TypeError
        Something else.
    """

    def __init__(self, a: CenterLike, b: CenterLike, plane: PlaneLike, name: str | None = None) -> None:
        one, other, mirror = one_feature(a), one_feature(b), one_feature(plane)
        first, second = point_frame("a", one), point_frame("b", other)
        frame = plane_frame("plane", mirror)
        if first.body is second.body:
            raise InputError(f"a and b are both on body {first.body.name!r}; expected two bodies")
        if frame.body is first.body or frame.body is second.body:
            raise InputError(f"plane is on body {frame.body.name!r} of a or b; expected a third body")
        super().__init__((first.body, second.body, frame.body), name, "symmetric")
        self._own = _mirrored_points(frame, first, second)
        self._given: dict[str, Any] = {"a": one, "b": other, "plane": mirror}

    def _shared(self) -> Iterable[object]:
        return *self._bodies, *self._given.values()

    @property
    def equations(self) -> tuple[Equation, ...]:
        """Its three rows."""
        return self._own


def _mirrored_points(mirror: Frame, a: Frame, b: Frame) -> tuple[Equation, ...]:
    """Along the mirror the origins are at one place, across it at opposite heights."""
    pairs = FramePair(mirror, a), FramePair(mirror, b)
    return tuple(
        Equation(((1.0, Coordinate(SLIDE, k, pairs[0])), (sign, Coordinate(SLIDE, k, pairs[1]))))
        for k, sign in enumerate((-1.0, -1.0, 1.0))
    )
