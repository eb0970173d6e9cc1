"""Objective terms: a solve minimizes their sum."""

from __future__ import annotations

from collections.abc import Iterable
from operator import is_

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._read_only import read_only
from assembly.errors import InputError, KnownSettings, check_coordinates, extent, items, positive, vector
from assembly.geometry.faces.face import Face
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame, Point
from assembly.kinematics.pose import Pose, axes_quaternion, multiply, pose_rows
from assembly.kinematics.pose import direction as unit_direction

__all__ = ["FrameDistance", "Objective", "PointDistance", "Posture", "Weight"]

Array = NDArray[np.float64]


class Objective(KnownSettings):
    """A term of the objective; see its subclasses."""

    def __init__(self, bodies: tuple[Body, ...], weight: float) -> None:
        self._bodies = bodies
        self._weight = positive("weight", weight)

    @property
    def bodies(self) -> tuple[Body, ...]:
        """Bodies that the term names."""
        return self._bodies

    @property
    def weight(self) -> float:
        """Factor of the term, positive."""
        return self._weight


class PointDistance(Objective):
    """weight |p - target|^2: a point of a body is drawn to a place in the world.

    The square is smooth where the target is reached.

    Parameters
    ----------
    point : Point
        `body.point(x, y, z)`.
    target : (3,)
        World coordinates. Settable between solves.
    weight : float
        Positive.
    """

    def __init__(self, point: Point, target: ArrayLike, weight: float = 1.0) -> None:
        if not isinstance(point, Point):
            raise TypeError(f"point is {point!r}; expected a point of a body, body.point(x, y, z)")
        super().__init__((point.body,), weight)
        self._point = point
        self.target = target

    @property
    def point(self) -> Point:
        """The point that is drawn."""
        return self._point

    @property
    def target(self) -> Array:
        """Where the point is drawn to, world coordinates (3,), read-only: set it anew."""
        return read_only(self._target)

    @target.setter
    def target(self, value: ArrayLike) -> None:
        target = vector("target", value)
        check_coordinates("target", target.tolist())
        self._target = target

    def __repr__(self) -> str:
        return f"PointDistance({self.point!r}, target={self._target.tolist()}, weight={self.weight:g})"


class Posture(Objective):
    """weight sum_b |x - x0|^2 + s^2 4 sin^2(angle / 2): bodies stay close to where they were.

    x0 and the angle are relative to the reference; s is half the body's size, so that a rotation counts about as much
    as it moves the body's points. A solve without an objective minimizes this.

    Parameters
    ----------
    reference : (n, 7), optional
        Poses in the order of the assembly's bodies; where each solve starts by default.
    weight : float
        Positive.
    """

    def __init__(self, reference: ArrayLike | None = None, weight: float = 1.0) -> None:
        super().__init__((), weight)
        self._reference = None if reference is None else pose_rows("reference", reference)

    @property
    def reference(self) -> Array | None:
        """Poses to stay close to, (n, 7), read-only; None where each solve starts."""
        return None if self._reference is None else read_only(self._reference)

    def __repr__(self) -> str:
        return f"Posture(weight={self.weight:g})"


class FrameDistance(Objective):
    """weight (|p - p_t|^2 + length^2 4 sin^2(angle / 2)): a frame of a body is drawn to a pose in the world.

    p is the frame's origin, p_t that of the target; the angle is that of the turn from the frame's axes to the
    target's. This is the rigid grasp of a hand.

    Parameters
    ----------
    frame : Frame or Body
        `body.frame(...)`; of a body the frame at its origin.
    target : Pose
        Where the frame is drawn to. Settable between solves.
    length : float
        The lever of rotations: a rotation counts as the motion of a point this far from the origin. By default half the
        body's size, 1 for a body without shape.
    weight : float
        Positive.
    """

    def __init__(self, frame: Frame | Body, target: Pose, length: float | None = None, weight: float = 1.0) -> None:
        if isinstance(frame, Body):
            frame = frame.frame()
        if not isinstance(frame, Frame):
            raise TypeError(f"frame is {frame!r}; expected a frame of a body, body.frame(...), or a body")
        super().__init__((frame.body,), weight)
        self._frame = frame
        self._length = 0.5 * frame.body.size or 1.0 if length is None else extent("length", length)
        self._axes = frame.axes
        # Axes of a frame, and the turn from these to the body's.
        self._back: tuple[Array | None, Array] = None, np.empty(0)
        self.target = target

    @property
    def frame(self) -> Frame:
        """The frame that is drawn."""
        return self._frame

    @property
    def length(self) -> float:
        """The lever of rotations."""
        return self._length

    @property
    def target(self) -> Pose:
        """Where the frame is drawn to."""
        return self._pose

    @target.setter
    def target(self, value: Pose) -> None:
        if not isinstance(value, Pose):
            raise TypeError(f"target is {value!r}; expected a Pose")
        check_coordinates("target.position", value.position.tolist())
        self._pose = value
        self._target = value.position
        self._body_quaternion = self.body_quaternion_of(self._pose)

    @property
    def body_quaternion(self) -> Array:
        """The quaternion of the body whose frame is at the target, read-only."""
        if self._axes is not self._frame.axes:
            # The frame was placed anew.
            self._axes = self._frame.axes
            self._body_quaternion = self.body_quaternion_of(self._pose)
        return read_only(self._body_quaternion)

    def body_quaternion_of(self, target: Pose) -> Array:
        """The quaternion of the body whose frame is at a target: after the turn from the frame's axes to the body's."""
        axes = self._frame.axes
        if self._back[0] is not axes:
            w, x, y, z = axes_quaternion(axes).tolist()
            self._back = axes, np.array([w, -x, -y, -z])
        return multiply(target.quaternion, self._back[1])

    def __repr__(self) -> str:
        return f"FrameDistance({self._frame!r}, target={self._pose!r}, length={self._length:g}, weight={self.weight:g})"


class Weight(Objective):
    """-weight sum_b mass_b (direction . center_b): the potential energy of bodies that are pulled one way.

    Where it is minimized, bodies come to rest as low as joints, contacts and clearances let them.

    Parameters
    ----------
    bodies : Body or iterable of Body
        Distinct and closed; their masses are `body.mass`.
    direction : (3,)
        Where they are pulled, in the axes of the world; any length.
    weight : float
        Positive: what a unit of mass is pulled with, 9.81 say.

    Raises
    ------
    InputError, TypeError
        No body, a body twice, one that encloses nothing, or a direction of no length.
    """

    def __init__(
        self, bodies: Body | Iterable[Body], direction: ArrayLike = (0.0, 0.0, -1.0), weight: float = 1.0
    ) -> None:
        pulled = items("bodies", bodies, "a Body or several") if not isinstance(bodies, Body) else (bodies,)
        for body in pulled:
            if not isinstance(body, Body):
                raise TypeError(f"bodies holds {body!r}; expected Body")
        if not pulled or len(set(map(id, pulled))) < len(pulled):
            raise InputError(f"bodies are {[body.name for body in pulled]}; expected distinct bodies, one at least")
        super().__init__(tuple(pulled), weight)
        self._direction = unit_direction("direction", direction)
        self._faces: list[Face] = []
        self._densities: list[float] = []
        self._points = self._points_of_now()

    @property
    def direction(self) -> Array:
        """Where bodies are pulled, a unit vector (3,), read-only."""
        return read_only(self._direction)

    @property
    def points(self) -> tuple[tuple[float, Array], ...]:
        """Mass and center of mass, in body coordinates, of every body."""
        # Numbers of shapes, and densities, may be set anew.
        faces = [side.face for body in self.bodies for side in body.faces]
        same = len(faces) == len(self._faces) and all(map(is_, faces, self._faces))
        if not same or self._densities != [body.density for body in self.bodies]:
            self._points = self._points_of_now()
        return self._points

    def _points_of_now(self) -> tuple[tuple[float, Array], ...]:
        """The same, and of which faces and densities."""
        self._faces = [side.face for body in self.bodies for side in body.faces]
        self._densities = [body.density for body in self.bodies]
        return tuple((body.mass, read_only(body.center_of_mass)) for body in self.bodies)

    @property
    def mass(self) -> float:
        """Of all bodies."""
        return float(sum(mass for mass, _ in self.points))

    def __repr__(self) -> str:
        names = ", ".join(body.name for body in self.bodies)
        return f"Weight([{names}], direction={self._direction.tolist()}, weight={self.weight:g})"
