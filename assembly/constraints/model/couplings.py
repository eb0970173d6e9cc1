"""Couplings: one coordinate of a joint follows one of another."""

from __future__ import annotations

from itertools import product
from typing import Any

from assembly.constraints.model.constraint import Coordinate, Equation, Freedom, RowConstraint, words
from assembly.constraints.model.joint import Joint, Offset
from assembly.constraints.program.primitives import SLIDE
from assembly.errors import InputError, bounded, number
from assembly.kinematics.body import Body

__all__ = ["Coupling", "Gear", "Linear", "RackPinion"]


def _turns(coordinate: Coordinate) -> bool:
    return coordinate.is_angle


def _slides(coordinate: Coordinate) -> bool:
    return coordinate.kind == SLIDE


def _freedom(name: str, value: Any, slides: bool) -> Freedom:
    """The coordinate itself, or the only one of a joint that turns, or slides."""
    fits, word = (_slides, "slides") if slides else (_turns, "is an angle")
    if isinstance(value, Freedom):
        if not fits(value.coordinate):
            raise InputError(f"{name} is {value!r}; expected a joint coordinate that {word}")
        return value
    if not isinstance(value, Joint):
        raise TypeError(f"{name} is {value!r}; expected a joint or one of its coordinates, joint.freedom(name)")
    fitting = [freedom for freedom in value.freedoms.values() if fits(freedom.coordinate)]
    if len(fitting) != 1:
        known = ", ".join(repr(freedom.name) for freedom in fitting) or "none"
        raise InputError(f"{name} is {value.name!r}; expected a joint with one coordinate that {word}; it has {known}")
    return fitting[0]


class Coupling(RowConstraint):
    """follower = ratio * leader + offset, between coordinates of joints; see its subclasses.

    A joint of the coupling need not be in the scene, its bodies must.
    """

    offset = Offset("Value of the follower where the leader is zero.")

    def __init__(self, leader: Freedom, follower: Freedom, factor: float, name: str | None, offset: float) -> None:
        if leader.coordinate is follower.coordinate:
            raise InputError(f"both sides are {leader!r}; expected two coordinates")
        bodies = dict.fromkeys((*leader.joint.bodies, *follower.joint.bodies))
        super().__init__(tuple(bodies), name, words(type(self)))
        self._leader = leader
        self._follower = follower
        self._factor = factor
        self.offset = offset

    @property
    def leader(self) -> Freedom:
        """The coordinate that is multiplied."""
        return self._leader

    @property
    def follower(self) -> Freedom:
        """The coordinate that follows."""
        return self._follower

    @property
    def meshing(self) -> tuple[tuple[Body, Body], ...]:
        """The pairs of bodies that may be in each other as wheels are: the one that turns in each of the two joints.

        Where the joints have a body in common, a frame or an arm, these are the others; where they have none, those
        that are not fixed, all of them.
        """
        first, second = ({id(body): body for body in side.joint.bodies} for side in (self._leader, self._follower))
        shared = first.keys() & second.keys()

        def turning(bodies: dict[int, Body]) -> list[Body]:
            return [body for key, body in bodies.items() if key not in shared and (shared or not body.fixed)]

        return tuple(product(turning(first), turning(second)))

    @property
    def equations(self) -> tuple[Equation, ...]:
        """The one row: follower - factor * leader = offset."""
        terms = ((1.0, self._follower.coordinate), (-self._factor, self._leader.coordinate))
        return (Equation(terms, (self, "offset")),)

    def __repr__(self) -> str:
        sides = ", ".join(f"{side.joint.name!r}.{side.name}" for side in (self._leader, self._follower))
        offset = f", offset={self.offset!r}" if self.offset else ""
        return f"{type(self).__name__}({sides}, {self._factor!r}, name={self.name!r}{offset})"


class Gear(Coupling):
    """Two angles keep a ratio: 1 row, angle_b = ratio * angle_a + offset.

    Parameters
    ----------
    a, b : Joint or Freedom
        Joints with one coordinate that is an angle, or such coordinates, `joint.freedom(name)`.
    ratio : float
        Turns of b per turn of a, not zero: -teeth_a / teeth_b for two wheels that mesh on the outside.
    name : str, optional
        "gear" and the bodies' names by default.
    offset : float
        angle_b where angle_a is zero [rad].

    Raises
    ------
    InputError, TypeError
        A joint with no such coordinate or with several, the same coordinate twice, ratio 0.
    """

    offset = Offset("angle_b where angle_a is zero [rad].")

    def __init__(
        self, a: Joint | Freedom, b: Joint | Freedom, ratio: float, name: str | None = None, offset: float = 0.0
    ) -> None:
        factor = number("ratio", ratio)
        if factor == 0.0:
            raise InputError("ratio is 0; expected the turns of b per turn of a, not zero")
        super().__init__(_freedom("a", a, slides=False), _freedom("b", b, slides=False), factor, name, offset)

    @property
    def ratio(self) -> float:
        """Turns of b per turn of a."""
        return self._factor


class Linear(Coupling):
    """Two slides keep a ratio: 1 row, takes away 1 degree of freedom, slide_b = ratio * slide_a + offset.

    Parameters
    ----------
    a, b : Joint or Freedom
        Joints with one coordinate that slides, or such coordinates, `joint.freedom(name)`.
    ratio : float
        Travel of b per travel of a, not zero; negative if they move in opposite directions.
    name : str, optional
        "linear" and the bodies' names by default.
    offset : float
        slide_b where slide_a is zero.

    Raises
    ------
    InputError, TypeError
        A joint with no such coordinate or with several, the same coordinate twice, ratio 0.
    """

    offset = Offset("slide_b where slide_a is zero.")

    def __init__(
        self, a: Joint | Freedom, b: Joint | Freedom, ratio: float, name: str | None = None, offset: float = 0.0
    ) -> None:
        factor = number("ratio", ratio)
        if factor == 0.0:
            raise InputError("ratio is 0; expected the travel of b per travel of a, not zero")
        super().__init__(_freedom("a", a, slides=True), _freedom("b", b, slides=True), factor, name, offset)

    @property
    def ratio(self) -> float:
        """Travel of b per travel of a."""
        return self._factor


class RackPinion(Coupling):
    """A rack slides as its pinion turns: 1 row, slide = radius * angle + offset.

    Parameters
    ----------
    pinion, rack : Joint or Freedom
        Joints with one coordinate that is an angle, and one that slides; or such coordinates, `joint.freedom(name)`.
    radius : float
        Travel of the rack per radian of the pinion, not zero; negative if the rack is on the other side.
    name : str, optional
        "rack-pinion" and the bodies' names by default.
    offset : float
        slide where the angle is zero.

    Raises
    ------
    InputError, TypeError
        A joint with no such coordinate or with several, radius 0.
    """

    offset = Offset("The slide where the angle is zero.")

    def __init__(
        self,
        pinion: Joint | Freedom,
        rack: Joint | Freedom,
        radius: float,
        name: str | None = None,
        offset: float = 0.0,
    ) -> None:
        factor = bounded("radius", radius)
        if factor == 0.0:
            raise InputError("radius is 0; expected the travel of the rack per radian of the pinion, not zero")
        super().__init__(
            _freedom("pinion", pinion, slides=False), _freedom("rack", rack, slides=True), factor, name, offset
        )

    @property
    def radius(self) -> float:
        """Travel of the rack per radian of the pinion."""
        return self._factor
