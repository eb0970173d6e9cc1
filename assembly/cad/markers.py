"""What CadQuery's solver reads of its constraints: points, directions, planes and lines on the parts.

`constraint.toPODs()` makes them of shapes, in a tenth of a millisecond each, which is most of the time that a solve
takes. They are kept with the constraint, and made anew where its shapes have moved.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

from assembly.cad.locations import Vector
from assembly.errors import InputError

__all__ = ["Marker", "Requirement", "requirements_of"]


@dataclass(frozen=True)
class Marker:
    """A point (3,), a unit direction (3,), or both, in the part's coordinates; neither of a whole part."""

    point: Vector | None = None
    direction: Vector | None = None


@dataclass(frozen=True, eq=False)
class Requirement:
    """One of the simple constraints that a constraint stands for: its kind, its markers, its value."""

    kind: str
    markers: tuple[Marker, ...]
    value: Any


@dataclass(frozen=True)
class _Read:
    """What was read of a constraint, and of what."""

    signature: tuple[Any, ...]
    shapes: tuple[Any, ...]
    places: tuple[Any, ...]
    requirements: tuple[Requirement, ...]

    def is_of(self, constraint: Any) -> bool:
        return (
            self.signature == _signature(constraint)
            and all(arg.wrapped.IsEqual(shape) for arg, shape in zip(constraint.args, self.shapes, strict=True))
            and all(place.wrapped is was for place, was in zip(constraint.sublocs, self.places, strict=True))
        )


_READ: WeakKeyDictionary[Any, _Read] = WeakKeyDictionary()


def requirements_of(constraint: Any) -> tuple[Requirement, ...]:
    """The simple constraints of a CadQuery constraint; the same object as long as nothing of it has changed."""
    known = _READ.get(constraint)
    if known is not None and known.is_of(constraint):
        return known.requirements
    found = tuple(
        Requirement(kind, tuple(_marker(marker) for marker in markers), value)
        for markers, kind, value in constraint.toPODs()
    )
    # Shapes may be moved in place: copies are kept, which share all but the location.
    shapes = tuple(arg.wrapped.Located(arg.wrapped.Location()) for arg in constraint.args)
    places = tuple(place.wrapped for place in constraint.sublocs)
    _READ[constraint] = _Read(_signature(constraint), shapes, places, found)
    return found


def _signature(constraint: Any) -> tuple[Any, ...]:
    return constraint.kind, constraint.param, tuple(constraint.objects), len(constraint.args)


def _marker(marker: Any) -> Marker:
    kind = type(marker).__name__
    if marker is None:
        return Marker()
    if kind == "gp_Pnt":
        return Marker(point=_numbers(marker))
    if kind == "gp_Dir":
        return Marker(direction=_numbers(marker))
    if kind == "gp_Pln":
        axis = marker.Axis()
        return Marker(_numbers(axis.Location()), _numbers(axis.Direction()))
    if kind == "gp_Lin":
        return Marker(_numbers(marker.Location()), _numbers(marker.Direction()))
    raise InputError(f"a constraint has a marker {marker!r}; expected a point, a direction, a plane or a line")


def _numbers(triple: Any) -> Vector:
    return triple.X(), triple.Y(), triple.Z()
