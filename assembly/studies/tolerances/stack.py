"""Stacks of tolerances: worst case, root sum square, shift of the mean, and samples that are solved in full.

To first order a measure is f + sum d_i x_i with the derivatives d_i of the solution by its parameters, and x_i their
differences from their values, independent of each other. Its variance is the sum of d_i^2 sigma_i^2, and the farthest
it goes is the sum of |d_i| times the half widths. To second order its mean moves by half the sum of f_ii sigma_i^2.
Where the derivatives from below and above differ (a one-sided row at its bound), x_i moves the measure by a half of
each: with m = E|x_i| its mean moves by (d+ - d-) m / 2, and its mean square is (d+^2 + d-^2) sigma_i^2 / 2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.assembly import Assembly
from assembly.derivatives.implicit import sensitivity, several
from assembly.derivatives.measure import Measure
from assembly.derivatives.parameter import Parameter
from assembly.derivatives.response import values_set
from assembly.derivatives.result import Sensitivity
from assembly.errors import InputError, integer
from assembly.solve.solution import Solution
from assembly.studies.tolerances.distributions import Distribution, Normal, Uniform
from assembly.studies.tolerances.result import Samples, Tolerances

__all__ = ["tolerances"]

Array = NDArray[np.float64]
# [sigma] Steps of the differences of first derivatives that give second ones: of the second order and, by the half of
# it, of the fourth.
_STEP = 0.5


def tolerances(
    scene: Assembly,
    solution: Solution,
    of: Measure | Sequence[Measure],
    parameters: Mapping[Parameter, Distribution],
    *,
    samples: int = 0,
    seed: int = 0,
    limits: Mapping[Measure, tuple[float | None, float | None]] | None = None,
) -> Tolerances:
    """What scatter of parameters does to measures of a solution.

    Parameters
    ----------
    scene : Assembly
    solution : Solution
        A successful one of the scene as it is now.
    of : Measure or several
    parameters : mapping of Parameter -> Normal or Uniform
        How each scatters about its value, independent of the others.
    samples : int
        Sets of values that are drawn and solved in full, each from `solution`.
    seed : int
        Of the draws; the same seed gives the same bits.
    limits : mapping of Measure -> (lower, upper), optional
        What is accepted, None for a side without limit: `yields` says how many samples are within all of them.

    Returns
    -------
    Tolerances
        Print it for a table; `plot()` shows samples and contributions.

    Raises
    ------
    InputError, TypeError
        Arguments that cannot be used, a measure without a derivative, or one that a free motion changes.
    """
    measures: tuple[Measure, ...] = several("of", of, Measure)
    names, scatter = _scatter(parameters)
    count = integer("samples", samples, 0, 10**7)
    integer("seed", seed, 0, 2**63 - 1)
    bounds = _bounds(limits, measures, count)
    rates = _rates(scene, solution, measures, names)
    sigmas, widths, means = (
        np.array([getattr(each, what) for each in scatter]) for what in ("sigma", "half_width", "mean_of_absolute")
    )
    low, high = rates.shrinking, rates.growing
    shares = 0.5 * (low**2 + high**2) * sigmas**2 - (0.5 * (high - low) * means) ** 2
    # Each parameter at either end of its range, where it does most to either side.
    ends = np.stack([-low * widths, high * widths, np.zeros_like(low)])
    nominal = np.array([measure.value(solution) for measure in measures])
    worst = nominal[:, None] + np.column_stack([ends.min(axis=0).sum(axis=1), ends.max(axis=0).sum(axis=1)])
    # Where the two sides differ the mean moves by that much more than by what is bent.
    bent = np.where(low == high, _second_derivatives(scene, solution, measures, names, sigmas), 0.0)
    drawn = _sampled(scene, solution, measures, names, scatter, count, seed) if count else None
    return Tolerances(
        of=measures,
        parameters=names,
        distributions=scatter,
        nominal=nominal,
        derivatives=rates,
        variances=shares,
        worst=worst,
        mean_shift=(0.5 * (high - low) * means + 0.5 * bent * sigmas**2).sum(axis=1),
        samples=drawn,
        limits=bounds,
    )


def _scatter(parameters: Mapping[Parameter, Distribution]) -> tuple[tuple[Parameter, ...], tuple[Distribution, ...]]:
    if not isinstance(parameters, Mapping) or not parameters:
        raise TypeError(f"parameters is {parameters!r}; expected a mapping of Parameter to Normal or Uniform")
    for parameter, scatter in parameters.items():
        if not isinstance(parameter, Parameter):
            raise TypeError(f"parameters has the key {parameter!r}; expected a Parameter")
        if not isinstance(scatter, (Normal, Uniform)):
            raise TypeError(f"parameters[{parameter.name!r}] is {scatter!r}; expected Normal or Uniform")
    return tuple(parameters), tuple(parameters.values())


def _bounds(
    limits: Mapping[Measure, tuple[float | None, float | None]] | None, measures: Sequence[Measure], count: int
) -> Array:
    """Lower and upper limit of every measure, (m, 2)."""
    result = np.tile([-np.inf, np.inf], (len(measures), 1))
    if limits is None:
        return result
    if not isinstance(limits, Mapping):
        raise TypeError(f"limits is {limits!r}; expected a mapping of Measure to (lower, upper)")
    if not count:
        raise InputError("limits are given without samples; expected samples=..., of which those within are counted")
    for measure, pair in limits.items():
        place = next((k for k, other in enumerate(measures) if other is measure), None)
        if place is None:
            raise InputError(f"limits has the key {measure!r}; expected one of {list(measures)!r}")
        try:
            low, high = (end if end is None else float(end) for end in pair)
        except (TypeError, ValueError):
            raise InputError(f"limits[{measure.name!r}] is {pair!r}; expected (lower, upper)") from None
        result[place] = (-np.inf if low is None else low, np.inf if high is None else high)
        if not result[place, 0] < result[place, 1]:
            raise InputError(f"limits[{measure.name!r}] is {pair!r}; expected a lower limit below the upper one")
    return result


def _rates(
    scene: Assembly, solution: Solution, measures: Sequence[Measure], parameters: Sequence[Parameter]
) -> Sensitivity:
    """Derivatives on either side of all parameters."""
    rates = sensitivity(scene, solution, measures, parameters)
    loose = [measure.name for measure, is_loose in zip(measures, rates.undetermined, strict=True) if is_loose]
    if loose:
        raise InputError(
            f"measures {loose} change with a motion that the scene leaves free, or are forces that rows share; "
            "expected determined ones"
        )
    if not (np.isfinite(rates.shrinking).all() and np.isfinite(rates.growing).all()):
        reasons = "; ".join(f"{name}: {reason}" for name, reason in rates.reasons.items())
        raise InputError(f"of has measures without a derivative; {reasons}")
    return rates


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


def _sampled(
    scene: Assembly,
    solution: Solution,
    measures: Sequence[Measure],
    parameters: Sequence[Parameter],
    scatter: Sequence[Distribution],
    count: int,
    seed: int,
) -> Samples:
    """Measures of solves with drawn values; NaN where the scene cannot be solved with them."""
    rng = np.random.default_rng(seed)
    differences = np.column_stack([each.draw(rng, count) for each in scatter])
    inputs = np.array([parameter.value for parameter in parameters]) + differences
    values = np.full((count, len(measures)), np.nan)
    for row, drawn in zip(values, inputs, strict=True):
        try:
            with values_set(parameters, drawn):
                found = scene.solve(solution)
        except InputError:  # a value that the scene cannot have
            continue
        if found.success:
            row[:] = [measure.value(found) for measure in measures]
    return Samples(inputs, values)
