"""Effects of scatter of parameters on measures of a solution, to first order, and curvature."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from assembly.assembly import Assembly
from assembly.constraints.program.contact import TOUCHING
from assembly.derivatives.implicit import sensitivity
from assembly.derivatives.measure import Measure
from assembly.derivatives.parameter import Parameter
from assembly.derivatives.response import values_set
from assembly.errors import InputError
from assembly.solve.second_order.dense import PUSHING
from assembly.solve.solution import Solution
from assembly.studies.tolerances.distributions import Distribution

__all__ = ["FirstOrder"]

Array = NDArray[np.float64]
# [sigma] Steps of the differences of first derivatives that give second ones: of the second order and, by the half of
# it, of the fourth.
_STEP = 0.5
# Where a stop is reached within these steps they are shortened by this factor, so often. Solves leave 1e-13 or so,
# which over the shortest step is little.
_SHORTEN, _SHORTER = 0.2, 4


class FirstOrder(NamedTuple):
    """Derivatives of m measures by p parameters.

    Attributes
    ----------
    low, high : (m, p)
        First derivatives as a parameter shrinks, and as it grows.
    bent : (m, p)
        Second ones; where a one-sided row is at its bound the mean of those on either side. NaN where they are not
        known: the scene cannot be solved beside the solution, or a stop is reached next to it.
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
                f"measures {loose} change with a motion that the scene leaves free, or are forces that "
                "redundant rows share; "
                "expected determined ones"
            )
        low, high = rates.shrinking, rates.growing
        if not (np.isfinite(low).all() and np.isfinite(high).all()):
            reasons = "; ".join(f"{name}: {reason}" for name, reason in rates.reasons.items())
            raise InputError(f"of has measures without a derivative; {reasons}")
        sigmas = np.array([each.sigma for each in scatter])
        beside = [_Beside(scene, solution, measures, parameter) for parameter in parameters]
        bent = [
            each.second_derivatives(_STEP * sigma, low[:, k], high[:, k])
            for k, (each, sigma) in enumerate(zip(beside, sigmas, strict=True))
        ]
        return cls(low, high, np.column_stack(bent))

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


class _Slopes(NamedTuple):
    """First derivatives (m,) by a parameter, and which one-sided rows are at their bounds."""

    each: Array
    stops: bytes


class _Beside:
    """First derivatives of measures by one parameter, of scenes solved beside a solution."""

    def __init__(self, scene: Assembly, solution: Solution, measures: Sequence[Measure], parameter: Parameter) -> None:
        self._scene, self._solution, self._measures, self._parameter = scene, solution, measures, parameter

    def second_derivatives(self, step: float, low: Array, high: Array) -> Array:
        """Second derivatives (m,) from first ones within two steps; `low` and `high` are those at the solution.

        On one side of a stop each: differences over it would have what both sides differ by, over the step.
        """
        stops, is_at_stop = _stops(self._solution)
        for _ in range(_SHORTER):
            found = [self._at(part * step) for part in (-2, -1, 1, 2)]
            if any(each is None for each in found):
                break
            farther_below, below, above, farther_above = (each.each for each in found if each is not None)
            reached = [each.stops for each in found if each is not None]
            if is_at_stop and reached[0] == reached[1] and reached[2] == reached[3]:
                before = (3.0 * low - 4.0 * below + farther_below) / (2.0 * step)
                after = (4.0 * above - 3.0 * high - farther_above) / (2.0 * step)
                return 0.5 * (before + after)
            if not is_at_stop and set(reached) == {stops}:
                near, far = (above - below) / (2.0 * step), (farther_above - farther_below) / (4.0 * step)
                return (4.0 * near - far) / 3.0
            step *= _SHORTEN
        return np.full(len(self._measures), np.nan)

    def _at(self, step: float) -> _Slopes | None:
        """With the parameter changed by a step; None where there are none."""
        parameter = self._parameter
        try:
            with values_set([parameter], [parameter.value + step]):
                moved = self._scene.solve(self._solution)
                if not moved.success:
                    return None
                slopes = sensitivity(self._scene, moved, self._measures, parameter)
        except InputError:  # a value that the scene cannot have
            return None
        each: Array = 0.5 * (slopes.shrinking[:, 0] + slopes.growing[:, 0])
        return _Slopes(each, _stops(moved)[0]) if np.isfinite(each).all() else None


def _stops(solution: Solution) -> tuple[bytes, bool]:
    """Which one-sided rows of a solution are at their bounds, and whether one of them is there without a force."""
    packed, state = solution._packed, solution._state
    touching = packed.one_sided & (np.abs(state[packed.residuals_at :][: packed.rows]) <= TOUCHING)
    forces = state[packed.multipliers_at :][: packed.rows]
    without = touching & (packed.is_implicit | (forces >= -PUSHING))
    listed = np.array(packed.listed(state) if packed.clearance_rows else [], dtype=np.int64)
    return touching.tobytes() + listed.tobytes(), bool(without.any())
