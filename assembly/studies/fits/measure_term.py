"""A measure as an objective that is exact: a CasADi function of the poses of its bodies.

A distance d and an angle between axes have a kink at zero. Their term is sqrt(d^2 + e^2), which grows with d and so is
least and most where d is; the same with the sine of the angle. Angles around an axis are taken from near where they
are, and all angles are times half the scene's size: so a unit of any term is about a unit of length.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca

from assembly.constraints.model.constraint import Coordinate
from assembly.constraints.model.expression import Expression
from assembly.constraints.program.primitives import ANGLE, AZIMUTH, DISTANCE, RADIUS, SLIDE, TURN
from assembly.derivatives.measure import Measure, place_of
from assembly.errors import InputError
from assembly.kinematics.body import Body

__all__ = ["MeasureTerm"]

# Below this, in parts of the scene's size and in sines, a distance and an angle count as at their kink: their terms
# are round there. Half as much, and steps near a distance of zero are shorter; twice as much, and terms are flatter.
_ROUND = 1e-3
_KINDS = (ANGLE, AZIMUTH, DISTANCE, RADIUS, SLIDE, TURN)


class MeasureTerm:
    """sign times a measure, as an objective of a scene of a size.

    Attributes
    ----------
    unit : float
        Of the term in units of the measure: 1, of angles half the scene's size.
    turns : bool
        Whether the measure is an angle that goes on past whole turns.

    Raises
    ------
    InputError
        A measure of gaps, forces or the objective, one that no motion changes, or one of a coordinate without a term.
    """

    def __init__(self, measure: Measure, size: float) -> None:
        self._measure, self._round = measure, _ROUND * size
        self.unit = 0.5 * size if measure.unit == "rad" else 1.0
        self.turns = measure.kind == "coordinate" and measure.thing.coordinate.kind in (TURN, AZIMUTH)
        if measure.kind == "coordinate":
            sides: tuple[Any, ...] = (measure.thing.coordinate.frames.frame_a, measure.thing.coordinate.frames.frame_b)
            if measure.thing.coordinate.kind not in _KINDS:
                raise InputError(f"of is {measure!r}, of a coordinate that has no play; expected a slide or an angle")
        elif measure.kind in ("place", "distance"):
            sides = measure.thing if measure.kind == "distance" else (measure.thing,)
        else:
            raise InputError(f"of is {measure!r}; expected a place, a distance or a coordinate of a joint")
        self.bodies: list[Body] = list(dict.fromkeys(place_of(side)[0] for side in sides))
        if all(body.fixed for body in self.bodies):
            raise InputError(f"of is {measure!r}, of fixed bodies alone; expected one that a motion changes")
        self._sides = sides

    def objective(self, sign: float, center: float = 0.0) -> Expression:
        """The term; angles are taken from `center`, their value at a pose nearby."""
        poses = [ca.SX.sym(f"q{k}", 7) for k in range(len(self.bodies))]
        value = sign * self.unit * self._value(poses, center)
        return Expression(ca.Function("measure", poses, [value]), self.bodies)

    def _value(self, poses: Sequence[Any], center: float) -> Any:
        places = [self._world(side, poses) for side in self._sides]
        if self._measure.kind == "place":
            return places[0][self._measure.axis]
        apart = places[1] - places[0]
        if self._measure.kind == "distance":
            return ca.sqrt(ca.dot(apart, apart) + self._round**2)
        return self._coordinate(self._measure.thing.coordinate, apart, poses, center)

    def _coordinate(self, coordinate: Coordinate, apart: Any, poses: Sequence[Any], center: float) -> Any:
        frames = coordinate.frames
        a, b = (self._turn(frame, poses) for frame in (frames.frame_a, frames.frame_b))
        if coordinate.kind == SLIDE:
            return ca.dot(a(coordinate.component), apart)
        if coordinate.kind in (DISTANCE, RADIUS):
            off = apart if coordinate.kind == DISTANCE else ca.vertcat(ca.dot(a(0), apart), ca.dot(a(1), apart))
            return ca.sqrt(ca.dot(off, off) + self._round**2)
        if coordinate.kind == ANGLE:
            across = ca.cross(a(2), b(2))
            return ca.atan2(ca.sqrt(ca.dot(across, across) + _ROUND**2), ca.dot(a(2), b(2)))
        if coordinate.kind == TURN:
            sine, cosine = ca.dot(a(1), b(0)) - ca.dot(a(0), b(1)), ca.dot(a(0), b(0)) + ca.dot(a(1), b(1))
        else:
            sine, cosine = (ca.dot(a(k), b(coordinate.component)) for k in (1, 0))
        c, s = ca.cos(center), ca.sin(center)
        return ca.atan2(sine * c - cosine * s, cosine * c + sine * s)

    def _world(self, side: Any, poses: Sequence[Any]) -> Any:
        body, place = place_of(side)
        pose = poses[self.bodies.index(body)]
        return pose[:3] + _turned(pose, place)

    def _turn(self, frame: Any, poses: Sequence[Any]) -> Callable[[int], Any]:
        pose = poses[self.bodies.index(frame.body)]
        return lambda k: _turned(pose, frame.axes[:, k])


def _turned(pose: Any, vector: Any) -> Any:
    """A vector (3,) of a body in the axes of the world, by p + 2 u x (u x p + w p)."""
    w, u, p = pose[3], pose[4:], ca.DM(vector)
    return p + 2.0 * ca.cross(u, ca.cross(u, p) + w * p)
