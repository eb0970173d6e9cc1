"""Options of following a branch."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

from assembly.errors import InputError, check_options, integer, number

__all__ = ["FollowOptions"]


@dataclass(frozen=True)
class FollowOptions:
    """Options of `asm.follow`. Arc lengths are of twists, lengths over the scene's size, and of the parameter.

    Attributes
    ----------
    first_step, largest_step, least_step : float
        Steps along the branch. Twice the largest one makes half the points; a branch on which a step of the least one
        finds no point ends as "lost".
    turn : float
        [rad] By how much the branch's direction may turn in a step: steps are as long as its curvature lets them.
        Two turning points within a step are not seen: a smaller turn sees closer ones.
    tolerance : float
        What rows, over the scene's size, may be off at a point.
    max_steps : int
        Steps in either direction from the start, after which the branch ends as "step limit".
    swept : bool
        Of a scene with clearances, whether the way between points is proven along the branch, as `Assembly.solve` does
        with `swept=True`. Without it the straight way from point to point is, from which the branch is off by an eighth
        of the square of a step, times its curvature.
    """

    first_step: float = 0.02
    largest_step: float = 0.2
    least_step: float = 1e-7
    turn: float = 0.12
    tolerance: float = 1e-12
    max_steps: int = 5000
    swept: bool = False

    def __post_init__(self) -> None:
        integer("max_steps", self.max_steps, 1, 10**9)
        if not isinstance(self.swept, bool):
            raise TypeError(f"swept is {self.swept!r}; expected True or False")
        highest = {"largest_step": 1e3, "first_step": self.largest_step, "least_step": self.first_step}
        for name, high in {**highest, "turn": 1.0, "tolerance": 1e-6}.items():
            value = number(name, getattr(self, name))
            if not 0.0 < value <= high:
                raise InputError(f"{name} is {value:g}; expected a number above 0 and at most {high:g}")

    @classmethod
    def of(cls, options: dict[str, Any]) -> FollowOptions:
        """Options from keyword arguments; an unknown name raises and lists the known ones."""
        check_options(options, [field.name for field in fields(cls)])
        return cls(**options)
