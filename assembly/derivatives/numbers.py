"""The numbers of a scene that may be set anew: where each is read, and how it is set."""

from __future__ import annotations

from abc import ABC, abstractmethod
from math import inf

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.constraint import Constraint, Freedom
from assembly.constraints.model.contact import Contact
from assembly.constraints.model.contact_place import ContactPlace
from assembly.constraints.model.objectives import FrameDistance, PointDistance
from assembly.errors import FARTHEST, InputError, check_coordinates
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.surface import NurbsSurface
from assembly.kinematics.body import BodyFace
from assembly.kinematics.changes import count_number
from assembly.kinematics.frame import Frame
from assembly.kinematics.parametric import Parametric
from assembly.kinematics.pose import Pose, skew

__all__ = [
    "ControlPoint",
    "ControlWeight",
    "FrameNumber",
    "FrameOrigin",
    "FrameTurn",
    "LeastGap",
    "Number",
    "PlaceNumber",
    "RowNumber",
    "ShapeNumber",
    "TargetNumber",
]

Array = NDArray[np.float64]
AXES = "xyz"
# Below this angle sin(a) / a and its kin are series.
SMALL = 1e-3


class Number(ABC):
    """A number of a scene.

    Attributes
    ----------
    name : str
        Its name in tables.
    unit : str
        "length", "rad", or "" of a number that has none, or one that nobody knows.
    """

    name: str
    unit: str = "length"

    @abstractmethod
    def get(self) -> float:
        """The number now."""

    @abstractmethod
    def set(self, value: float) -> None:
        """Set it, a finite number; what the scene cannot have raises an `InputError`."""

    def put(self, value: float) -> None:
        """The same for a while, of what is measured and not solved: what the scene cannot have may not raise."""
        self.set(value)


class RowNumber(Number):
    """The driven value or a limit of a coordinate, or the offset of a constraint: what bounds a row or equals it."""

    def __init__(self, owner: Freedom | Constraint, attribute: str) -> None:
        self.owner, self.attribute = owner, attribute
        if isinstance(owner, Freedom):
            suffix = "" if attribute == "value" else f" {attribute} limit"
            self.name = f"{owner.joint.name}.{owner.name}{suffix}"
            self.unit = "rad" if owner.coordinate.is_angle else "length"
        else:
            self.name = f"{owner.name}.{attribute}"
            (_, first), *_ = getattr(owner, "equations")[-1].terms  # noqa: B009  # of constraints that have rows
            self.unit = "rad" if first.is_angle else "length"
        self.get()

    def get(self) -> float:
        """The number now; what is driven or limited no more has none."""
        value = getattr(self.owner, self.attribute)
        if value is None or abs(value) == inf:
            what = "a driven value" if self.attribute == "value" else "a limit on this side"
            raise InputError(f"{self.name} is {value}; expected {what}")
        return float(value)

    def set(self, value: float) -> None:
        """Set it."""
        if not isinstance(self.owner, Freedom) or self.attribute == "value":
            setattr(self.owner, self.attribute, value)
        else:
            lower, upper = self.owner.lower, self.owner.upper
            self.owner.limits = (value, upper) if self.attribute == "lower" else (lower, value)
        count_number(self.owner)

    def put(self, value: float) -> None:
        """Set it for a while, beyond limits perhaps."""
        name = f"_{self.attribute}" if isinstance(self.owner, Freedom) else self.attribute
        setattr(self.owner, name, value)


class FrameNumber(Number):
    """A number of where a frame is on its body."""

    def __init__(self, frame: Frame, axis: int) -> None:
        self.frame, self.axis = frame, axis

    @abstractmethod
    def twist(self, turn: Array, scale: float) -> Array:
        """The twist (6,) of the frame a unit of the number, about the origin of its body, which is turned by (3, 3).

        World axes, lengths over a scale.
        """


class FrameOrigin(FrameNumber):
    """A coordinate of a frame's origin on its body."""

    def __init__(self, frame: Frame, axis: int) -> None:
        super().__init__(frame, axis)
        self.name = f"frame on {frame.body.name}.{AXES[axis]}"

    def get(self) -> float:
        """The number now."""
        return float(self.frame.origin[self.axis])

    def set(self, value: float) -> None:
        """Set it."""
        if not -FARTHEST <= value <= FARTHEST:
            check_coordinates(AXES[self.axis], [value])
        origin = self.frame.origin.copy()
        origin[self.axis] = value
        self.frame._move(origin)

    def twist(self, turn: Array, scale: float) -> Array:
        """The twist of the frame a unit of the number."""
        return np.concatenate([turn[:, self.axis] / scale, np.zeros(3)])


class FrameTurn(FrameNumber):
    """A component, in body axes, of the turn of a frame about its origin from where its axes were given."""

    unit = "rad"

    def __init__(self, frame: Frame, axis: int) -> None:
        super().__init__(frame, axis)
        self.name = f"frame on {frame.body.name}.turn {AXES[axis]}"

    def _turned(self) -> tuple[Array, Array]:
        """The axes that were given, and the turn since then."""
        given: tuple[Array, Array] = self.frame.__dict__.get("_turned", (self.frame.axes, np.zeros(3)))
        return given

    def get(self) -> float:
        """The number now."""
        return float(self._turned()[1][self.axis])

    def set(self, value: float) -> None:
        """Set it."""
        axes, turn = self._turned()
        turn = turn.copy()
        turn[self.axis] = value
        self.frame._stand(self.frame.origin, rotation_by(turn) @ axes)
        self.frame.__dict__["_turned"] = (axes, turn)

    def twist(self, turn: Array, scale: float) -> Array:
        """The twist of the frame a unit of the number."""
        velocity = turn @ turn_rates(self._turned()[1])[:, self.axis]
        return np.concatenate([-skew(velocity) @ (turn @ self.frame.origin) / scale, velocity])


class TargetNumber(Number):
    """A coordinate of the place that an objective draws a point or a frame to, in the world."""

    def __init__(self, term: PointDistance | FrameDistance, axis: int) -> None:
        self.term, self.axis = term, axis
        self.name = f"target of {term.bodies[0].name}.{AXES[axis]}"

    def get(self) -> float:
        """The number now."""
        return float(self.term._target[self.axis])

    def set(self, value: float) -> None:
        """Set it."""
        place = np.array(self.term._target)
        place[self.axis] = value
        if isinstance(self.term, PointDistance):
            self.term.target = place
        else:
            self.term.target = Pose(place, self.term.target.quaternion)
        count_number(self.term)


class PlaceNumber(Number):
    """A coordinate of the place of a face that a contact comes to, or what it weighs."""

    unit = ""

    def __init__(self, place: ContactPlace, axis: int | None) -> None:
        self.place, self.axis = place, axis
        self.name = f"{place.name} {'weight' if axis is None else 'uv'[axis]}"
        if axis is not None and place.target[axis] is None:
            raise InputError(f"{self.name} is open, target is {place.target}; expected the coordinate of the line")

    def get(self) -> float:
        """The number now."""
        value = self.place.weight if self.axis is None else self.place.target[self.axis]
        assert value is not None
        return value

    def set(self, value: float) -> None:
        """Set it."""
        if self.axis is None:
            self.place.weight = value
        else:
            self.place.target = [value if k == self.axis else part for k, part in enumerate(self.place.target)]


class LeastGap(Number):
    """The least gap of a clearance, or of a contact."""

    def __init__(self, owner: Clearance | Contact) -> None:
        self.owner = owner
        self.name = f"{owner.name}.minimum"

    def get(self) -> float:
        """The number now."""
        return self.owner.minimum

    def set(self, value: float) -> None:
        """Set it."""
        self.owner.minimum = value


class ShapeNumber(Number):
    """A number that a function turns into faces."""

    unit = ""

    def __init__(self, shape: Parametric, argument: str) -> None:
        if argument not in shape.numbers:
            known = ", ".join(map(repr, shape.numbers))
            raise InputError(f"field is {argument!r}; expected a number of the shape: {known}")
        self.shape, self.argument = shape, argument
        bodies = "-".join(body.name for body in shape.bodies)
        self.name = f"{bodies}.{argument}" if bodies else argument

    def get(self) -> float:
        """The number now."""
        return self.shape.numbers[self.argument]

    def set(self, value: float) -> None:
        """Set it."""
        self.shape.set(self.argument, value)


class _OfSurface(Number):
    """A number of the net of a body's face."""

    def __init__(self, face: BodyFace) -> None:
        self.face = face

    def _take(self, control_points: Array, weights: Array) -> None:
        old, surface = self.face.face, self.face.face.surface
        new = NurbsSurface(control_points, surface.knots, surface.degree, weights, name=surface.name)
        face = Face(new, old.outer, old.holes, name=old.name, reversed=old.reversed, color=old.color)
        faces = [face if side is self.face else side.face for side in self.face.body.faces]
        self.face.body._take_faces(faces)


class ControlPoint(_OfSurface):
    """A coordinate of a control point of a face's surface."""

    def __init__(self, face: BodyFace, index: tuple[int, int, int]) -> None:
        super().__init__(face)
        self.index = index
        i, j, k = index
        self.name = f"{face.body.name}.{face.name} control point {i},{j}.{AXES[k]}"

    def get(self) -> float:
        """The number now."""
        return float(self.face.face.surface.control_points[self.index])

    def set(self, value: float) -> None:
        """Set it."""
        surface = self.face.face.surface
        points = surface.control_points.copy()
        points[self.index] = value
        self._take(points, surface.weights)


class ControlWeight(_OfSurface):
    """A weight of a face's surface."""

    unit = ""

    def __init__(self, face: BodyFace, index: tuple[int, int]) -> None:
        super().__init__(face)
        self.index = index
        self.name = f"{face.body.name}.{face.name} weight {index[0]},{index[1]}"

    def get(self) -> float:
        """The number now."""
        return float(self.face.face.surface.weights[self.index])

    def set(self, value: float) -> None:
        """Set it."""
        surface = self.face.face.surface
        weights = surface.weights.copy()
        weights[self.index] = value
        self._take(surface.control_points, weights)


def rotation_by(turn: Array) -> Array:
    """The rotation by a vector (3,), its length the angle."""
    sine, cosine = _parts(turn)
    across = skew(turn)
    rotation: Array = np.eye(3) + sine * across + cosine * (across @ across)
    return rotation


def turn_rates(turn: Array) -> Array:
    """Columns: the angular velocities of that rotation a unit of each component of the vector, (3, 3)."""
    angle = float(np.linalg.norm(turn))
    _, cosine = _parts(turn)
    third = 1.0 / 6.0 - angle**2 / 120.0 if angle < SMALL else (angle - np.sin(angle)) / angle**3
    across = skew(turn)
    rates: Array = np.eye(3) + cosine * across + third * (across @ across)
    return rates


def _parts(turn: Array) -> tuple[float, float]:
    """sin(a) / a and (1 - cos(a)) / a^2 of a vector of length a."""
    angle = float(np.linalg.norm(turn))
    if angle < SMALL:
        return 1.0 - angle**2 / 6.0 + angle**4 / 120.0, 0.5 - angle**2 / 24.0 + angle**4 / 720.0
    return float(np.sin(angle)) / angle, 2.0 * float(np.sin(0.5 * angle)) ** 2 / angle**2
