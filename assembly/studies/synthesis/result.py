"""The result of a synthesis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly._html import printed
from assembly._read_only import ReadOnlyArrays
from assembly.derivatives.parameter import Parameter

__all__ = ["Synthesis"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Synthesis(ReadOnlyArrays):
    """Dimensions that were found, and what they do; print it for a table.

    Attributes
    ----------
    success : bool
        Whether stations solved anew with these dimensions, one from the other, have the same measures, bounds hold, and
        no dimension can be changed for the better, to first order.
    message : str
        The optimizer's own words, and what the check found.
    parameters : tuple of Parameter
    values : (p,)
        Of the parameters, in this order.
    cost : float
        Half the sum of squares of the residuals; the measure, the greatest of all stations; or what the function gives.
    residuals : (m,)
        Measures less what is wanted, times the weight, station after station; empty where nothing is wanted.
    measures : (n,)
        Of stations solved anew, one after the other: of each what is wanted or minimized, then what is bounded.
    violation : float
        By how much bounds are passed at most.
    evaluations : int
        Sets of dimensions that were tried.
    failures : tuple of str
        What was told of those that the scene has no solution with; steps to them were shortened.
    """

    success: bool
    message: str
    parameters: tuple[Parameter, ...]
    values: Array
    cost: float
    residuals: Array
    measures: Array
    violation: float
    evaluations: int
    failures: tuple[str, ...]

    @property
    def found(self) -> Mapping[Parameter, float]:
        """Values by parameter."""
        return dict(zip(self.parameters, self.values.tolist(), strict=True))

    def apply(self) -> None:
        """Give the scene's parameters the values that were found."""
        for parameter, value in self.found.items():
            parameter.value = value

    def _repr_html_(self) -> str:
        return printed(self)

    def __str__(self) -> str:
        width = max(len(parameter.name) for parameter in self.parameters)
        lines = [f"{p.name:<{width}}  {value:.12g} {p.unit}".rstrip() for p, value in self.found.items()]
        told = f"{self.evaluations} evaluations, {len(self.failures)} without a solution; cost {self.cost:.3g}"
        lines.append(told + ("" if not self.violation else f", bounds passed by {self.violation:.1e}"))
        lines.append(("found: " if self.success else "not found: ") + self.message)
        return "\n".join(lines)
