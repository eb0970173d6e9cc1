"""Parameter: a name for a number of a scene, which is set through it and by which solutions are derived."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.constraint import Constraint, Freedom
from assembly.constraints.model.contact import Contact
from assembly.constraints.model.contact_place import ContactPlace
from assembly.constraints.model.joint import Joint
from assembly.constraints.model.objectives import FrameDistance, PointDistance
from assembly.derivatives.numbers import (
    AXES,
    ControlPoint,
    ControlWeight,
    FrameOrigin,
    FrameTurn,
    LeastGap,
    Number,
    PlaceNumber,
    RowNumber,
    ShapeNumber,
    TargetNumber,
)
from assembly.errors import InputError, KnownSettings, number, positive, text
from assembly.kinematics.body import Body, BodyFace
from assembly.kinematics.frame import Frame
from assembly.kinematics.parametric import Parametric

__all__ = ["Parameter"]

Thing = (
    Joint
    | Freedom
    | Constraint
    | Frame
    | PointDistance
    | FrameDistance
    | BodyFace
    | Body
    | Parametric
    | Callable[..., Any]
)


class Parameter(KnownSettings):
    """A number of a scene that can be set, and with respect to which solutions can be differentiated.

    | thing | field, index |
    |---|---|
    | a joint | the name of a driven coordinate; "limits" or "angle_limits", 0 or 1; "offset"; "value" |
    | a coordinate, `joint.freedom("angle")` | "value", "lower", "upper" |
    | a coupling | "offset" |
    | a frame, `joint.frame_a` | "origin" or "turn", "x", "y" or "z": in the axes of its body |
    | `PointDistance`, `FrameDistance` | "target", "x", "y" or "z" |
    | `ContactPlace` | "target", "u" or "v"; "weight" |
    | `Clearance`, `Contact` | "minimum" |
    | `Parametric`, or a body with such a shape | the name of one of its numbers |
    | a face of a body, `body.face("top")` | "control_points", (i, j, "z"); "weights", (i, j) |
    | a function that makes faces of a number | the number: `asm.Body("ball", parameter.shape)` |

    A turn of a frame is a rotation vector by which the axes are turned about the frame's origin from their original
    direction.

    Parameters
    ----------
    thing, field, index
        As in the table.
    name : str, optional
        Its name in tables.
    step : float, optional
        For numbers that make faces: the step of differences; by default five thousandths of the value, or of the body.

    Raises
    ------
    InputError, TypeError
        A thing without such a number, a value that is free, an index out of range.
    """

    def __init__(
        self, thing: Thing, field: Any = None, index: Any = None, *, name: str | None = None, step: float | None = None
    ) -> None:
        self._number = _number_of(thing, field, index)
        self._name = self._number.name if name is None else text("name", name)
        self._step = None if step is None else positive("step", step)

    @property
    def name(self) -> str:
        """Its name in tables."""
        return self._name

    @property
    def unit(self) -> str:
        """Its unit: "length", "rad", or "" if it is unknown or there is none."""
        return self._number.unit

    @property
    def step(self) -> float | None:
        """The step of differences, if given."""
        return self._step

    @property
    def shape(self) -> Parametric:
        """For a number from which a function makes faces: the shape for a `Body`."""
        if not isinstance(self._number, ShapeNumber):
            raise InputError(f"parameter {self.name!r} makes no faces; expected one of a function, or of a Parametric")
        return self._number.shape

    @property
    def value(self) -> float:
        """The present number. Settable; the scene is solved with it from then on, and is not packed again."""
        return self._number.get()

    @value.setter
    def value(self, value: float) -> None:
        self._number.set(number(self.name, value))

    def __repr__(self) -> str:
        try:
            return f"Parameter({self.name!r}, value={self.value!r})"
        except InputError:
            return f"Parameter({self.name!r}, value=None)"


def _number_of(thing: Thing, field: Any, index: Any) -> Number:
    """The number that a thing, a field and an index name."""
    if isinstance(thing, Frame):
        kinds = {"origin": FrameOrigin, "turn": FrameTurn}
        if field not in kinds:
            raise InputError(f"field is {field!r}; expected 'origin' or 'turn' of a frame")
        base = getattr(thing, "base", thing)
        return kinds[field](base, _axis(index))
    if isinstance(thing, (PointDistance, FrameDistance)):
        _expect(field, "target")
        return TargetNumber(thing, _axis(index))
    if isinstance(thing, ContactPlace):
        if field not in ("target", "weight"):
            raise InputError(f"field is {field!r}; expected 'target' or 'weight' of a place")
        if field == "target" and index not in ("u", "v"):
            raise InputError(f"index is {index!r}; expected 'u' or 'v' of a target")
        return PlaceNumber(thing, "uv".index(index) if field == "target" else None)
    if isinstance(thing, (Clearance, Contact)):
        _expect(field, "minimum")
        return LeastGap(thing)
    if isinstance(thing, Freedom):
        if field not in ("value", "lower", "upper"):
            raise InputError(f"field is {field!r}; expected 'value', 'lower' or 'upper' of a joint coordinate")
        return RowNumber(thing, field)
    if isinstance(thing, Constraint):
        return _of_constraint(thing, field, index)
    if isinstance(thing, (Parametric, Body)):
        return ShapeNumber(thing if isinstance(thing, Parametric) else thing.shape, field)
    if isinstance(thing, BodyFace):
        return _of_face(thing, field, index)
    if callable(thing):
        return ShapeNumber(Parametric(_OfOneNumber(thing), value=number("value", field)), "value")
    raise TypeError(f"thing is {thing!r}; expected a joint, a frame, a term, a clearance, a shape or a function")


class _OfOneNumber:
    """A function of one number as one of `value`; pickle knows it where it knows the function."""

    def __init__(self, build: Callable[..., Any]) -> None:
        self._of_number = build

    def __call__(self, value: float) -> Any:
        return self._of_number(value)


def _of_constraint(thing: Constraint, field: Any, index: Any) -> Number:
    """A number of a joint or a coupling."""
    if isinstance(thing, Joint) and isinstance(field, str):
        if field in thing.freedoms:
            return RowNumber(thing.freedom(field), "value")
        if field == "value" and len(thing.freedoms) == 1:
            return RowNumber(thing.freedom(), "value")
        if field.endswith("limits"):
            if index not in (0, 1):
                raise InputError(f"index is {index!r}; expected 0 for the lower limit or 1 for the upper one")
            return RowNumber(thing.freedom(field[:-7] or None), ("lower", "upper")[index])
    if field == "offset" and hasattr(thing, "offset"):
        return RowNumber(thing, "offset")
    freedoms = [*thing.freedoms, "limits"] if isinstance(thing, Joint) and thing.freedoms else []
    known = ", ".join(map(repr, [*freedoms, *(["offset"] if hasattr(thing, "offset") else [])]))
    raise InputError(f"field is {field!r}; expected one of {thing.name!r}: {known or 'it has none'}")


def _of_face(thing: BodyFace, field: Any, index: Any) -> Number:
    """A number of the net of a face."""
    shape = thing.face.surface.control_points.shape
    expected = {"control_points": 3, "weights": 2}
    if field not in expected:
        raise InputError(f"field is {field!r}; expected 'control_points' or 'weights' of a face")
    size = expected[field]
    if not isinstance(index, tuple) or len(index) != size:
        raise InputError(f"index is {index!r}; expected (i, j, axis) of a control point, (i, j) of a weight")
    for k, (i, most) in enumerate(zip(index[:2], shape, strict=False)):
        if isinstance(i, bool) or not isinstance(i, (int, np.integer)) or not 0 <= i < most:
            raise InputError(f"index[{k}] is {i!r}; expected an integer from 0 to {most - 1}")
    if size == 3:
        return ControlPoint(thing, (int(index[0]), int(index[1]), _axis(index[2])))
    return ControlWeight(thing, (int(index[0]), int(index[1])))


def _axis(index: Any) -> int:
    """A coordinate, by its letter or its number."""
    if isinstance(index, str) and len(index) == 1 and index in AXES:
        return AXES.index(index)
    if isinstance(index, (int, np.integer)) and not isinstance(index, bool) and 0 <= index <= 2:
        return int(index)
    raise InputError(f"index is {index!r}; expected 'x', 'y' or 'z'")


def _expect(field: Any, known: str) -> None:
    if field != known:
        raise InputError(f"field is {field!r}; expected {known!r}")
