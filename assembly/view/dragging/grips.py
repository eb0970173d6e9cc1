"""Hands of people: what each holds, by the mouse or by a joint's coordinate, and where it draws it now.

A coordinate is dragged by a hand on the body that it moves: from where the body is, the hand is ahead by what the
coordinate lacks, a turn about the joint's axis or a way along one. So everything else the joint leaves free stays free.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.assembly import Assembly
from assembly.constraints.model.constraint import Freedom
from assembly.constraints.model.joint import Joint
from assembly.constraints.program.primitives import SLIDE, TURN
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame, Point
from assembly.kinematics.pose import Pose
from assembly.view.dragging.pointer import Pointer
from assembly.view.motion import rotations

__all__ = ["Coordinate", "Grip", "coordinate_of"]

Array = NDArray[np.float64]
# Radians that a hand turns a body ahead: a spring of turns is weaker again beyond a right angle.
_AHEAD = 1.0


class Coordinate:
    """A joint's coordinate at poses, and the pose that lacks nothing of a value.

    Parameters
    ----------
    name : str
        As in "hinge.angle".
    joint : Joint
    freedom : Freedom
        A turn about the z axis of the joint's first frame, or a way along an axis of it.
    bodies : list of Body
        Of the scene.
    """

    def __init__(self, name: str, joint: Joint, freedom: Freedom, bodies: list[Body]) -> None:
        self.name = name
        self._frames = joint.frame_a, joint.frame_b
        self._is_angle, self._axis = freedom.coordinate.kind == TURN, freedom.coordinate.component
        self._rows = tuple(bodies.index(frame.body) for frame in self._frames)
        # The second body is held, or the first where the second stands still.
        self._first = joint.frame_b.body.fixed
        self.body = self._frames[0 if self._first else 1].body
        self._near: float | None = None

    def value(self, q: Array) -> float:
        """At poses (n, 7); angles go on from the last ones that were asked about."""
        (p_a, axes_a), (p_b, axes_b) = self._placed(q)
        if not self._is_angle:
            return float(axes_a[:, self._axis] @ (p_b - p_a))
        across = axes_a.T @ axes_b
        value = float(np.arctan2(across[1, 0] - across[0, 1], across[0, 0] + across[1, 1]))
        if self._near is not None:
            value += 2.0 * np.pi * round((self._near - value) / (2.0 * np.pi))
        self._near = value
        return value

    def begin_at(self, value: float) -> None:
        """Have angles go on from one."""
        self._near = value

    def _placed(self, q: Array) -> list[tuple[Array, Array]]:
        placed = []
        for frame, row in zip(self._frames, self._rows, strict=True):
            turn = rotations(q[row, 3:])
            placed.append((q[row, :3] + turn @ frame.origin, turn @ frame.axes))
        return placed

    def target(self, wanted: float, q: Array) -> Array:
        """Where the body (7,) lacks nothing of a value, all else as at poses (n, 7)."""
        (p_a, axes_a), (p_b, _) = self._placed(q)
        lack = wanted - self.value(q)
        row = q[self._rows[0 if self._first else 1]]
        sense = -1.0 if self._first else 1.0
        if not self._is_angle:
            return np.concatenate([row[:3] + sense * lack * axes_a[:, self._axis], row[3:]])
        turn = Pose.from_axis_angle(axes_a[:, 2], sense * float(np.clip(lack, -_AHEAD, _AHEAD)))
        pivot = p_a if self._first else p_b
        moved = turn @ Pose(row[:3] - pivot, row[3:])
        return np.concatenate([moved.position + pivot, moved.quaternion])


def coordinate_of(scene: Assembly, name: str, freedom: Freedom) -> Coordinate | None:
    """The coordinate of that name, if a hand can drag it: free, a turn or a way, of a body that moves."""
    joint = next(
        each
        for each in scene.constraints
        if isinstance(each, Joint) and any(f"{each.name}.{free}" == name for free in each.freedoms)
    )
    kind = freedom.coordinate.kind
    # With opposed axes the angle has the other sign.
    if freedom.value is not None or kind not in (SLIDE, TURN) or (kind == TURN and joint.axes != "aligned"):
        return None
    if all(body.fixed for body in joint.bodies):
        return None
    return Coordinate(name, joint, freedom, list(scene.bodies))


@dataclass
class Grip:
    """What somebody holds.

    Attributes
    ----------
    client : int
    hand : int
        Of the tracker.
    follow : Point, Frame or Body
    pointer : Pointer
        Where the mouse is, or, of one number, what the coordinate is to be.
    drag : int
        Which of all drags this is.
    coordinate : Coordinate, optional
    """

    client: int
    hand: int
    follow: Point | Frame | Body
    pointer: Pointer
    drag: int
    coordinate: Coordinate | None = None

    @property
    def body(self) -> Body:
        """The body that is held."""
        return self.follow if isinstance(self.follow, Body) else self.follow.body

    def target(self, now: float, q: Array) -> Array:
        """Where it is drawn to at a time, bodies at q (n, 7): (3,) of a point, (7,) of a frame."""
        target = self.pointer.at(now)
        return target if self.coordinate is None else self.coordinate.target(float(target[0]), q)

    def point(self, row: Array) -> Array:
        """Where it is held, (3,), the body at (7,)."""
        at = self.follow.coordinates if isinstance(self.follow, Point) else np.zeros(3)
        return Pose(row[:3], row[3:]).apply(at)
