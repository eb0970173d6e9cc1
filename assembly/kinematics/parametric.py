"""Parametric: a shape that a function makes of numbers, which can be set."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from assembly.errors import InputError, number

if TYPE_CHECKING:
    from assembly.kinematics.body import Body

__all__ = ["Parametric"]


class Parametric:
    """A shape for bodies with numbers that can be set, made by a maker in `shapes` or a function of yours.

        wheel = asm.Body("wheel", asm.Parametric(asm.shapes.cylinder, radius=4.0, height=1.0))
        radius = asm.Parameter(wheel.shape, "radius")

    Parameters
    ----------
    build : callable
        Called with the numbers by name; returns what `Body` takes as a shape, with the same number of faces in the same
        order for all values.
    **numbers : float
        In any unit that `build` has.

    Raises
    ------
    InputError, TypeError
        No function, no numbers, or something that is no number.
    """

    def __init__(self, build: Callable[..., Any], **numbers: float) -> None:
        if not callable(build):
            raise TypeError(f"build is {build!r}; expected a function that makes faces of numbers")
        if not numbers:
            raise InputError("numbers are none; expected one at least, by the name of an argument of build")
        self._build = build
        self._numbers = {name: number(name, value) for name, value in numbers.items()}
        self._bodies: list[Body] = []

    @property
    def build(self) -> Callable[..., Any]:
        """What makes the faces."""
        return self._build

    @property
    def numbers(self) -> Mapping[str, float]:
        """The numbers by name."""
        return MappingProxyType(self._numbers)

    @property
    def bodies(self) -> tuple[Body, ...]:
        """The bodies that have this shape."""
        return tuple(self._bodies)

    def made(self) -> Any:
        """The shape for the present numbers."""
        return self._build(**self._numbers)

    def _belongs_to(self, body: Body) -> None:
        """Say that a body has this shape."""
        self._bodies.append(body)

    def set(self, name: str, value: float) -> None:
        """Set a number; the bodies get new faces, and whatever refers to a face refers to the new one.

        Frames and points that were taken from faces stay where they are.

        Raises
        ------
        InputError
            No such number, or one for which `build` makes no faces, or other faces by number or name.
        """
        if name not in self._numbers:
            raise InputError(f"name is {name!r}; expected one of {', '.join(map(repr, self._numbers))}")
        before = self._numbers[name]
        self._numbers[name] = number(name, value)
        try:
            made = self.made()
            replacements = [body._checked_faces(made) for body in self._bodies]
        except Exception:
            self._numbers[name] = before
            raise
        for body, faces in zip(self._bodies, replacements, strict=True):
            body._take_faces(faces)

    def __repr__(self) -> str:
        numbers = ", ".join(f"{name}={value!r}" for name, value in self._numbers.items())
        return f"Parametric({getattr(self._build, '__name__', self._build)}, {numbers})"
