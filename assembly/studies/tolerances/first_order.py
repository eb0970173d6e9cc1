"""What scatter of parameters does to measures of a solution, to first order, and what is bent."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from assembly.assembly import Assembly
from assembly.derivatives.implicit import sensitivity
from assembly.derivatives.measure import Measure
from assembly.derivatives.parameter import Parameter
from assembly.derivatives.response import values_set
from assembly.errors import InputError
from assembly.solve.solution import Solution
from assembly.studies.tolerances.distributions import Distribution

__all__ = ["FirstOrder"]

Array = NDArray[np.float64]
# [sigma] Steps of the differences of first derivatives that give second ones: of the second order and, by the half of
# it, of the fourth.
_STEP = 0.5


class FirstOrder(NamedTuple):
    """Derivatives of m measures by p parameters.

    Attributes
    ----------
    low, high : (m, p)
        First derivatives as a parameter shrinks, and as it grows.
    bent : (m, p)
        Second ones; zero where the two sides differ, NaN where they are not known.
    """

    low: Array
    high: Array
    bent: Array

    @classmethod
    def of(
        cls,
        scene: Assembly,
        solution: Solution,
        measures: Sequence[Measure],
        parameters: Sequence[Parameter],
        scatter: Sequence[Distribution],
    ) -> Self:
        """Those of a solution; raises where there are none."""
        rates = sensitivity(scene, solution, measures, parameters)
        loose = [measure.name for measure, is_loose in zip(measures, rates.undetermined, strict=True) if is_loose]
        if loose:
            raise InputError(
                f"measures {loose} change with a motion that the scene leaves free, or are forces that rows share; "
                "expected determined ones"
            )
        low, high = rates.shrinking, rates.growing
        if not (np.isfinite(low).all() and np.isfinite(high).all()):
            reasons = "; ".join(f"{name}: {reason}" for name, reason in rates.reasons.items())
            raise InputError(f"of has measures without a derivative; {reasons}")
        sigmas = np.array([each.sigma for each in scatter])
        bent = np.where(low == high, _second_derivatives(scene, solution, measures, parameters, sigmas), 0.0)
        return cls(low, high, bent)

    def variances(self, scatter: Sequence[Distribution]) -> Array:
        """What each parameter adds to the variances, (m, p)."""
        sigmas, means = (np.array([getattr(each, what) for each in scatter]) for what in ("sigma", "mean_of_absolute"))
        result: Array = 0.5 * (self.low**2 + self.high**2) * sigmas**2 - (0.5 * (self.high - self.low) * means) ** 2
        return result

    def reach(self, scatter: Sequence[Distribution]) -> Array:
        """How far the measures go down and up, (m, 2): each parameter at the end of its range that does most."""
        widths = np.array([each.half_width for each in scatter])
        ends = np.stack([-self.low * widths, self.high * widths, np.zeros_like(self.low)])
        return np.column_stack([ends.min(axis=0).sum(axis=1), ends.max(axis=0).sum(axis=1)])

    def mean_shift(self, scatter: Sequence[Distribution]) -> Array:
        """By how much the means move, (m,)."""
        sigmas, means = (np.array([getattr(each, what) for each in scatter]) for what in ("sigma", "mean_of_absolute"))
        result: Array = (0.5 * (self.high - self.low) * means + 0.5 * self.bent * sigmas**2).sum(axis=1)
        return result


def _second_derivatives(
    scene: Assembly, solution: Solution, measures: Sequence[Measure], parameters: Sequence[Parameter], sigmas: Array
) -> Array:
    """Second derivatives of measures along each parameter, (m, p); NaN where the scene cannot be solved beside it."""
    result = np.full((len(measures), len(parameters)), np.nan)
    for k, (parameter, sigma) in enumerate(zip(parameters, sigmas, strict=True)):
        step = _STEP * sigma
        slopes = [_beside(scene, solution, measures, parameter, part * step) for part in (-2, -1, 1, 2)]
        farther_below, below, above, farther_above = slopes
        near, far = (above - below) / (2.0 * step), (farther_above - farther_below) / (4.0 * step)
        result[:, k] = (4.0 * near - far) / 3.0
    return result


def _beside(
    scene: Assembly, solution: Solution, measures: Sequence[Measure], parameter: Parameter, step: float
) -> Array:
    """First derivatives (m,) with a parameter changed by a step; NaN where there are none."""
    none = np.full(len(measures), np.nan)
    try:
        with values_set([parameter], [parameter.value + step]):
            moved = scene.solve(solution)
            if not moved.success:
                return none
            slopes = sensitivity(scene, moved, measures, parameter)
    except InputError:  # a value that the scene cannot have
        return none
    found: Array = 0.5 * (slopes.shrinking[:, 0] + slopes.growing[:, 0])
    return found
