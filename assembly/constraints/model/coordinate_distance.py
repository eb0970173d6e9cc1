"""An objective term that draws a joint's coordinate to a value: the spring of a hand that holds it."""

from __future__ import annotations

from math import cos, sin
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.constraint import Freedom
from assembly.constraints.model.expression import Expression, Tapes, derived_tapes
from assembly.constraints.program.primitives import SLIDE, TURN
from assembly.errors import InputError, number
from assembly.kinematics.pose import rotation_matrix

if TYPE_CHECKING:
    import casadi as ca

__all__ = ["CoordinateDistance", "checked_coordinate"]

Array = NDArray[np.float64]


def checked_coordinate(name: str, freedom: Freedom) -> Freedom:
    """A coordinate that a spring can draw.

    Raises
    ------
    InputError
        It is driven, neither a turn about an axis nor a way along one, or both bodies are fixed.
    """
    kind, joint = freedom.coordinate.kind, freedom.joint
    if kind not in (SLIDE, TURN):
        raise InputError(f"{name} is {freedom!r}; expected a turn about an axis or a way along one")
    if freedom.value is not None:
        raise InputError(f"{name} is {freedom!r}, which is driven; expected a coordinate without a value")
    if all(body.fixed for body in joint.bodies):
        raise InputError(f"{name} is {freedom!r} of two fixed bodies; expected one that moves")
    return freedom


class CoordinateDistance(Expression):
    """weight (s - target)^2 of a way s, weight length^2 4 sin^2((angle - target) / 2) of an angle.

    An angle is drawn the shorter way round, whatever turn it is on: with frames a and b, and the axes x_t and y_t that
    x_a and y_a are after a turn by the target, it is weight length^2 (|x_b - x_t|^2 + |y_b - y_t|^2) / 2.

    Parameters
    ----------
    freedom : Freedom
        A coordinate without a value: a way along an axis of frame a, or a turn about its z axis.
    target : float
        In the user's unit or radians. Settable between solves.
    weight : float
        Positive.
    """

    def __init__(self, freedom: Freedom, target: float, weight: float = 1.0) -> None:
        import casadi as ca

        self._freedom = checked_coordinate("freedom", freedom)
        self.target = target
        pair = freedom.coordinate.frames
        moving = pair.frame_a.body if pair.frame_b.body.fixed else pair.frame_b.body
        self._length = 0.5 * moving.size or 1.0
        self._known: tuple[tuple[bytes, ...], Tapes] | None = None
        poses = [ca.SX.sym("a", 7), ca.SX.sym("b", 7)]
        value = self._value(ca.vertcat(*poses), ca.SX(self.numbers))
        bodies = pair.frame_a.body, pair.frame_b.body
        super().__init__(ca.Function("coordinate", poses, [value]), bodies, weight=weight)

    @property
    def freedom(self) -> Freedom:
        """The coordinate that is drawn."""
        return self._freedom

    @property
    def length(self) -> float:
        """The lever of turns: half the size of the body that moves, 1 for a body without shape."""
        return self._length

    @property
    def target(self) -> float:
        """What the coordinate is drawn to."""
        return self._target

    @target.setter
    def target(self, value: float) -> None:
        self._target = number("target", value)

    @property
    def is_angle(self) -> bool:
        """Whether the coordinate is one."""
        return self.freedom.coordinate.kind == TURN

    @property
    def numbers(self) -> list[float]:
        """What the term reads of the target: cosine and sine of an angle."""
        return [cos(self.target), sin(self.target)] if self.is_angle else [self.target]

    @property
    def tapes(self) -> Tapes:
        """Value and derivatives; the target's numbers are the first constants. Made anew where frames are others."""
        import casadi as ca

        pair = self.freedom.coordinate.frames
        frames = tuple(part.tobytes() for f in (pair.frame_a, pair.frame_b) for part in (f.origin, f.axes))
        if self._known is None or self._known[0] != frames:
            numbers = self.numbers
            given = ca.SX.sym("target", len(numbers))
            self._known = frames, derived_tapes(lambda x: self._value(x, given), 2, 1, given, numbers)
        return self._known[1]

    def _value(self, x: ca.SX, target: ca.SX) -> ca.SX:
        """The term of weight one at the poses of both bodies, (14,)."""
        import casadi as ca

        coordinate, placed = self.freedom.coordinate, []
        for frame, pose in zip((coordinate.frames.frame_a, coordinate.frames.frame_b), (x[:7], x[7:]), strict=True):
            w, u = pose[3], pose[4:]
            turn = (w * w - ca.dot(u, u)) * ca.SX.eye(3) + 2 * u @ u.T + 2 * w * ca.skew(u)
            placed.append((pose[:3] + turn @ ca.SX(frame.origin), turn @ ca.SX(frame.axes)))
        (p_a, axes_a), (p_b, axes_b) = placed
        if not self.is_angle:
            return (ca.dot(axes_a[:, coordinate.component], p_b - p_a) - target) ** 2
        x_a, y_a, c, s = axes_a[:, 0], axes_a[:, 1], target[0], target[1]
        apart = ca.vertcat(axes_b[:, 0] - c * x_a - s * y_a, axes_b[:, 1] + s * x_a - c * y_a)
        return 0.5 * self.length**2 * ca.sumsqr(apart)

    def coordinate_at(self, q_a: Array, q_b: Array) -> tuple[float, Array]:
        """The coordinate, of an angle within a turn, and its axis in the world, bodies at poses (7,)."""
        coordinate = self.freedom.coordinate
        frames = coordinate.frames.frame_a, coordinate.frames.frame_b
        turns = [rotation_matrix(q[3:]) for q in (q_a, q_b)]
        axes_a, axes_b = (turn @ frame.axes for turn, frame in zip(turns, frames, strict=True))
        if self.is_angle:
            across = axes_a.T @ axes_b
            return float(np.arctan2(across[1, 0] - across[0, 1], across[0, 0] + across[1, 1])), axes_a[:, 2]
        p_a, p_b = (q[:3] + turn @ f.origin for q, turn, f in zip((q_a, q_b), turns, frames, strict=True))
        axis = axes_a[:, coordinate.component]
        return float(axis @ (p_b - p_a)), axis

    def __repr__(self) -> str:
        return f"CoordinateDistance({self.freedom!r}, target={self.target!r}, weight={self.weight:g})"
