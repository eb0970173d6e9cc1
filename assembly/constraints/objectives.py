"""What is wished for: terms whose sum a solve makes small."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.errors import InputError, positive, real_array, vector
from assembly.kinematics.body import Body, Point

__all__ = ["Objective", "PointDistance", "Posture"]

Array = NDArray[np.float64]


class Objective:
    """A term of the objective; see its subclasses."""

    weight: float
    bodies: tuple[Body, ...] = ()


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
        self.point = point
        self.bodies = (point.body,)
        self.weight = positive("weight", weight)
        self.target = target

    @property
    def target(self) -> Array:
        """Where the point is drawn to, world coordinates (3,); a copy."""
        return self._target.copy()

    @target.setter
    def target(self, value: ArrayLike) -> None:
        self._target = vector("target", value)

    def __repr__(self) -> str:
        return f"PointDistance({self.point!r}, target={self._target.tolist()}, weight={self.weight:g})"


class Posture(Objective):
    """weight sum_b |x - x0|^2 + s^2 4 sin^2(angle / 2): bodies stay close to where they were.

    x0 and the angle are taken from the reference; s is half the body's size, so that a turn counts about as much
    as it moves the body's points. This is the objective of a solve that is given none.

    Parameters
    ----------
    reference : (n, 7), optional
        Poses in the order of the assembly's bodies; where each solve starts by default.
    weight : float
        Positive.
    """

    def __init__(self, reference: ArrayLike | None = None, weight: float = 1.0) -> None:
        self.weight = positive("weight", weight)
        self.reference: Array | None = None
        if reference is not None:
            rows = real_array("reference", reference, ("n", 7))
            norms = np.linalg.norm(rows[:, 3:], axis=1)
            if np.abs(norms - 1.0).max() > 1e-2:
                raise InputError(f"reference has quaternions of norms {norms.tolist()}; expected unit quaternions")
            rows[:, 3:] /= norms[:, None]
            self.reference = rows

    def __repr__(self) -> str:
        return f"Posture(weight={self.weight:g})"
