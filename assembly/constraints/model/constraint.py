"""What all constraints have in common, and the rows of which joints and couplings are made.

A row is sum_i coefficient_i coordinate_i = value (one-sided: >= value) with one or two coordinates. A coordinate is
one number that tells how a frame on one body stands to a frame on another (`constraints/program/primitives.py`).
"""

from __future__ import annotations

import re
from collections.abc import Container, Sequence
from dataclasses import dataclass
from math import inf, pi
from typing import TYPE_CHECKING, Any

import numpy as np

from assembly.constraints.program.primitives import ANGLE, COINCIDENT, DISTANCE, RADIUS, SLIDE
from assembly.errors import FARTHEST, InputError, KnownSettings, number, text
from assembly.kinematics.body import Body
from assembly.kinematics.changes import count_edit
from assembly.kinematics.frame import Frame

if TYPE_CHECKING:
    from assembly.constraints.model.joint import Joint

__all__ = [
    "Bounds",
    "Constraint",
    "Coordinate",
    "Equation",
    "FramePair",
    "Freedom",
    "RowConstraint",
    "count_change",
    "structure_changes",
    "words",
]

Bounds = tuple[float | None, float | None]

# Values that a coordinate can take: at 0 and pi are kinks, which no row can hold, farther lengths may overflow.
_RANGES = {SLIDE: (-FARTHEST, FARTHEST), DISTANCE: (0.0, FARTHEST), RADIUS: (0.0, FARTHEST), ANGLE: (0.0, pi)}
_EXPECTED = {
    SLIDE: f"a length between {-FARTHEST:g} and {FARTHEST:g}",
    DISTANCE: f"a distance above zero; points that coincide are Spherical, and none is above {FARTHEST:g}",
    RADIUS: f"a distance above zero; a point on a line is PointOnLine without one, and none is above {FARTHEST:g}",
    ANGLE: "an angle between 0 and pi, both excluded; axes along each other are Parallel, axes='aligned' or 'opposed'",
}
# What other arguments may be, by these: as a name it is an argument in the wrong place.
_CHOICES = {"aligned": "axes", "opposed": "axes", "nearest": "axes", "inside": "side", "outside": "side"}
_changes = 0


def structure_changes() -> int:
    """How often any constraint gained or lost a row since the program began.

    A scene packed at another count may lack rows: a value became driven or free, a limit appeared or went. Values
    that only changed do not count.
    """
    return _changes


def count_change() -> None:
    """Say that a constraint has other rows now."""
    global _changes
    _changes += 1


def words(cls: type) -> str:
    """The name of a class as a default name says it: "revolute", "point-on-line"."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "-", cls.__name__).lower()


class Constraint(KnownSettings):
    """Something that must hold between bodies; see its subclasses.

    `enabled` is settable: False leaves the constraint in its scene, and asks for nothing.

    Parameters
    ----------
    bodies : tuple of Body
        Distinct.
    name : str or None
        Not empty; by default the kind and the bodies' names, as in "revolute ground-crank".
    kind : str
        How the default name begins; may be empty.

    Raises
    ------
    InputError
        The same body twice, or a name that is no string or empty.
    """

    # Copies and pickles of before it could be set have none of their own.
    _enabled = True
    # Whether names by default get a number where an assembly has them; whether this is one, which may get it yet.
    _is_numbered = False
    _may_be_renamed = False

    def __init__(self, bodies: tuple[Body, ...], name: str | None, kind: str = "") -> None:
        for k, body in enumerate(bodies):
            if any(body is other for other in bodies[:k]):
                raise InputError(f"body {body.name!r} is named twice; expected distinct bodies")
        self._bodies = bodies
        self._name = f"{kind} {'-'.join(body.name for body in bodies)}".lstrip() if name is None else text("name", name)
        choice = _CHOICES.get(self._name)
        if choice and hasattr(type(self), choice):
            raise InputError(f"name is {name!r}, which {choice} may be; expected {choice}={name!r}, or another name")
        self._may_be_renamed = name is None and self._is_numbered

    @property
    def name(self) -> str:
        """Name of the constraint."""
        return self._name

    def _named_beside(self, taken: Container[str]) -> None:
        """Take a name for good that is none of others, by a number, if it may be."""
        if self._may_be_renamed:
            name, count = self._name, 2
            while self._name in taken:
                self._name, count = f"{name} {count}", count + 1
            self._may_be_renamed = False

    @property
    def bodies(self) -> tuple[Body, ...]:
        """Bodies that the constraint names, distinct."""
        return self._bodies

    @property
    def enabled(self) -> bool:
        """Whether scenes ask for it."""
        return self._enabled

    @enabled.setter
    def enabled(self, value: bool) -> None:
        if not isinstance(value, (bool, np.bool_)):
            raise InputError(f"enabled is {value!r}; expected True or False")
        self._enabled = bool(value)
        count_edit()

    @property
    def _is_asked(self) -> bool:
        """Whether a solve asks for it: it is enabled, and not of bodies that are all fixed."""
        return self._enabled and not (self._bodies and all(body.fixed for body in self._bodies))


class RowConstraint(Constraint):
    """A constraint of rows that are sums of coordinates: a joint, a coupling, a group, a symmetry."""

    @property
    def equations(self) -> tuple[Equation, ...]:
        """Its rows now."""
        raise NotImplementedError  # every kind has them


@dataclass(frozen=True, eq=False)
class FramePair:
    """Two frames on two bodies; of an opposed joint, frame b is already turned by pi about its x axis."""

    frame_a: Frame
    frame_b: Frame

    def __repr__(self) -> str:
        return f"FramePair({self.frame_a.body.name!r}, {self.frame_b.body.name!r})"


@dataclass(frozen=True, eq=False)
class Coordinate:
    """One number that tells how frame b stands to frame a; kinds and components as in
    `constraints/program/primitives.py`.
    """

    kind: int
    component: int
    frames: FramePair

    @property
    def is_angle(self) -> bool:
        """Whether the number has no unit of length: radians, or the cosine that a dot product is."""
        return self.kind not in (COINCIDENT, SLIDE, DISTANCE, RADIUS)


@dataclass(frozen=True, eq=False)
class Equation:
    """One row: the sum of coefficient * coordinate over the terms equals the value, or is not below it.

    The row has the unit of its first term; where another term has another unit, its coefficient makes up for it.

    Parameters
    ----------
    terms : tuple of (float, Coordinate)
        One or two.
    source : (owner, attribute), optional
        Where the value is read from; 0 without.
    one_sided : bool
        >= instead of =.
    is_drive : bool
        Whether a driven value or a limit asks for this row, and not the joint itself.
    """

    terms: tuple[tuple[float, Coordinate], ...]
    source: tuple[Constraint | Freedom, str] | None = None
    one_sided: bool = False
    is_drive: bool = False

    def current(self) -> float:
        """The right-hand side now, in the user's units: the driven value, the lower limit, minus the upper limit."""
        if self.source is None:
            return 0.0
        owner, name, sign = self.place()
        return sign * float(getattr(owner, name))

    def ask_for(self, value: float) -> None:
        """Set what `current` reads. The value is taken as it is, limits of a driven coordinate or not."""
        if self.source is not None:
            owner, name, sign = self.place()
            setattr(owner, name, sign * value)

    def place(self) -> tuple[Constraint | Freedom, str, float]:
        """Where the value is kept: owner, attribute, and the sign it has there. For who reads it in every solve."""
        assert self.source is not None
        owner, attribute = self.source
        name = f"_{attribute}" if isinstance(owner, Freedom) else attribute
        return owner, name, -1.0 if attribute == "upper" else 1.0

    @property
    def value(self) -> float:
        """The same as `current()`."""
        return self.current()


def _bound(name: str, value: Any, unbounded: float) -> float:
    """A limit as a number; None and the infinity on its side are no limit."""
    if value is None or (isinstance(value, (float, np.floating)) and value == unbounded):
        return unbounded
    return number(name, value)


class Freedom:
    """One way in which a joint lets its bodies move: free, driven to a value, or kept within limits.

    Lengths are in the user's unit, angles in radians; angles go on past a whole turn.
    """

    def __init__(
        self,
        joint: Joint,
        name: str,
        coordinate: Coordinate,
        value: float | None,
        limits: Sequence[float | None] | None,
        argument: str | None = None,
        limits_argument: str = "limits",
    ) -> None:
        self._joint = joint
        self._name = name
        self._coordinate = coordinate
        # What messages call the value. A coordinate under another name is what its joint holds, not a drive of it.
        self._argument = argument or name
        self._limits_argument = limits_argument
        self._is_own = argument is not None
        self._range = _RANGES.get(coordinate.kind, (-inf, inf))
        self._value, (self._lower, self._upper) = self._checked(value, *self._read(limits))

    @property
    def joint(self) -> Joint:
        """The joint that has the coordinate."""
        return self._joint

    @property
    def name(self) -> str:
        """Name of the coordinate in its joint: "angle", "slide" ..."""
        return self._name

    @property
    def coordinate(self) -> Coordinate:
        """The number that is free."""
        return self._coordinate

    @property
    def value(self) -> float | None:
        """The driven value; None where it is free. Settable between solves."""
        return self._value

    @value.setter
    def value(self, value: float | None) -> None:
        low, high = self._range
        # What nearly always comes, without the price of every check; NaN and infinities fail the comparisons.
        if type(value) is float and self._value is not None:
            if low < value < high and self._lower <= value <= self._upper:
                self._value = value
                return
        self._set(value, self._lower, self._upper)

    @property
    def limits(self) -> Bounds | None:
        """(lower, upper), None for a side without limit; None without limits. Settable between solves."""
        if self._lower == -inf and self._upper == inf:
            return None
        return None if self._lower == -inf else self._lower, None if self._upper == inf else self._upper

    @limits.setter
    def limits(self, value: Sequence[float | None] | None) -> None:
        self._set(self._value, *self._read(value))

    @property
    def lower(self) -> float:
        """The lower limit, -inf without."""
        return self._lower

    @property
    def upper(self) -> float:
        """The upper limit, inf without."""
        return self._upper

    @property
    def equations(self) -> tuple[Equation, ...]:
        """The driving row, or else a one-sided row for each limit; a driven coordinate is within its limits anyway."""
        driven, below, above = self._rows
        rows = []
        if driven:
            rows.append(Equation(((1.0, self._coordinate),), (self, "value"), is_drive=not self._is_own))
        if below:
            rows.append(Equation(((1.0, self._coordinate),), (self, "lower"), one_sided=True, is_drive=True))
        if above:
            rows.append(Equation(((-1.0, self._coordinate),), (self, "upper"), one_sided=True, is_drive=True))
        return tuple(rows)

    def __repr__(self) -> str:
        return f"Freedom({self._joint.name!r}, {self._name!r}{self.settings()})"

    def settings(self) -> str:
        """Value and limits as they are written in a call: ", angle=0.5", or "" where there are none."""
        text = "" if self._value is None else f", {self._argument}={self._value!r}"
        return text if self.limits is None else f"{text}, {self._limits_argument}={self.limits!r}"

    @property
    def _rows(self) -> tuple[bool, bool, bool]:
        """Which rows there are: a limit that the coordinate cannot pass needs none."""
        if self._value is not None:
            return True, False, False
        return False, self._lower > self._range[0], self._upper < self._range[1]

    def _read(self, limits: Sequence[float | None] | None) -> tuple[float, float]:
        if limits is None:
            return -inf, inf
        try:
            if isinstance(limits, (str, bytes)):
                raise TypeError
            lower, upper = limits
        except (TypeError, ValueError):
            raise InputError(
                f"{self._limits_argument} is {limits!r}; expected (lower, upper), None for a side without limit"
            ) from None
        return _bound(f"{self._limits_argument}[0]", lower, -inf), _bound(f"{self._limits_argument}[1]", upper, inf)

    def _checked(self, value: Any, lower: float, upper: float) -> tuple[float | None, tuple[float, float]]:
        low, high = self._range
        if lower > upper:
            raise InputError(f"{self._limits_argument} is ({lower:g}, {upper:g}); expected lower <= upper")
        if not (lower < high and upper > low):
            raise InputError(
                f"{self._limits_argument} is ({lower:g}, {upper:g}); "
                f"expected limits that leave values between {low:g} and {high:g}"
            )
        if value is None:
            if self._is_own and lower <= low and upper >= high:
                raise InputError(f"{self._argument} is None without limits; expected a number or limits that bind")
            return None, (lower, upper)
        target = number(self._argument, value)
        if not low < target < high:
            raise InputError(f"{self._argument} is {target!r}; expected {_EXPECTED[self._coordinate.kind]}")
        if not lower <= target <= upper:
            raise InputError(
                f"{self._argument} is {target!r} with {self._limits_argument} ({lower:g}, {upper:g}); "
                "expected a value within the limits"
            )
        return target, (lower, upper)

    def _set(self, value: float | None, lower: float, upper: float) -> None:
        before = self._rows
        self._value, (self._lower, self._upper) = self._checked(value, lower, upper)
        if self._rows != before:
            count_change()
