"""The range of a measure, and the poses at its ends."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf, isfinite, nan

from assembly._html import printed
from assembly.assembly import Assembly
from assembly.derivatives.measure import Measure
from assembly.solve.scene import Status
from assembly.solve.solution import Solution

__all__ = ["End", "Play"]


@dataclass(frozen=True, eq=False)
class End:
    """Where a measure is least, or most.

    Attributes
    ----------
    value : float
        In the user's units; infinite where the measure is unbounded, NaN where the end was not found.
    solution : Solution
        Of `scene`: the pose there; where the end was not found, what the last solve ended with.
    scene : Assembly
        The scene's bodies and constraints, with the measure as objective.
    """

    value: float
    solution: Solution = field(repr=False)
    scene: Assembly = field(repr=False)

    @property
    def status(self) -> Status:
        """How the solve of this end ended."""
        return self.solution.status

    @classmethod
    def of(cls, scene: Assembly, solution: Solution, value: float, sign: float) -> End:
        """An end of a scene whose objective is sign times the measure, where the measure is `value`."""
        if not solution.success:
            value = -sign * inf if solution.status is Status.UNBOUNDED else nan
        return cls(value, solution, scene)


@dataclass(frozen=True, eq=False)
class Play:
    """The range of a measure over poses at which constraints hold; print it.

    Attributes
    ----------
    measure : Measure
    nominal : float
        At the given solution.
    least, most : End
    """

    measure: Measure
    nominal: float
    least: End
    most: End

    @property
    def success(self) -> bool:
        """Whether both ends were found."""
        return isfinite(self.least.value) and isfinite(self.most.value)

    @property
    def width(self) -> float:
        """The greatest value minus the least one; infinite or NaN if an end is."""
        return self.most.value - self.least.value

    def _repr_html_(self) -> str:
        return printed(self)

    def __str__(self) -> str:
        lines = [
            f"{self.measure.name} [{self.measure.unit}]  {self.nominal:.8g}   "
            f"from {self.least.value:.8g} to {self.most.value:.8g}   play {self.width:.6g}"
        ]
        for name, end in (("least", self.least), ("most", self.most)):
            if not isfinite(end.value):
                what = "unbounded" if end.status is Status.UNBOUNDED else "not found"
                lines.append(f"  {name}: {what}, {end.status.name}: {end.solution.message}")
        return "\n".join(lines)
