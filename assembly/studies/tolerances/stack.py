"""Stacks of tolerances: worst case, root sum square, shift of the mean, and samples that are solved.

To first order a measure is f + sum d_i x_i with the derivatives d_i of the solution by its parameters, and x_i their
differences from their values, independent of each other. Its variance is the sum of d_i^2 sigma_i^2, and the farthest
it goes is the sum of |d_i| times the half widths. To second order its mean moves by half the sum of f_ii sigma_i^2.
Where the derivatives from below and above differ (a one-sided row at its bound), x_i moves the measure by a half of
each: with m = E|x_i| its mean moves by (d+ - d-) m / 2, and its mean square is (d+^2 + d-^2) sigma_i^2 / 2.

With play a measure is a + u (b - a), from the least a to the most b of its range, u anywhere between 0 and 1. Both ends
have derivatives; a mean of the two is that of the middle. The variance has (b - a)^2 / 12 besides, the worst case goes
from the worst of a to that of b.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from assembly._progress import Advance, Progress, checked_progress, watched
from assembly._turn import in_turn
from assembly.assembly import Assembly
from assembly.derivatives.implicit import sensitivity, several
from assembly.derivatives.measure import Measure
from assembly.derivatives.parameter import Parameter
from assembly.derivatives.response import values_set
from assembly.errors import InputError, integer
from assembly.solve.solution import Solution
from assembly.studies.fits import End, Play
from assembly.studies.fits import play as range_of
from assembly.studies.tolerances.distributions import Distribution, Normal, Uniform
from assembly.studies.tolerances.first_order import FirstOrder
from assembly.studies.tolerances.result import Samples, Tolerances

__all__ = ["tolerances"]

Array = NDArray[np.float64]


@in_turn
def tolerances(
    scene: Assembly,
    solution: Solution,
    of: Measure | Sequence[Measure],
    parameters: Mapping[Parameter, Distribution],
    *,
    samples: int = 0,
    seed: int = 0,
    limits: Mapping[Measure, tuple[float | None, float | None]] | None = None,
    play: bool = False,
    progress: Progress = False,
) -> Tolerances:
    """Compute what scatter of parameters does to measures of a solution.

    Parameters
    ----------
    scene : Assembly
    solution : Solution
        A successful one of the scene as it is now.
    of : Measure or several
    parameters : mapping of Parameter -> Normal or Uniform
        How each scatters about its value, independent of the others.
    samples : int
        Number of sets of values that are drawn and solved, each from `solution`.
    seed : int
        Of the draws; the same seed gives the same bits.
    limits : mapping of Measure -> (lower, upper), optional
        Accepted ranges, None for a side without limit: `yields` is the share of samples within all of them.
    play : bool
        Whether parts are loose in their fits as well (`asm.play`): a measure is uniformly distributed over its range,
        and dimensions move both ends of the range. Objectives of the scene do not count then.
    progress : bool or callable
        True shows a progress bar; a function is called with the numbers of finished and of all samples.

    Returns
    -------
    Tolerances
        Print it for a table; `plot()` shows samples and contributions.

    Raises
    ------
    InputError, TypeError
        Arguments that cannot be used, a measure without a derivative, or one that a free motion changes; with play an
        end of a range that is unbounded or not found.
    """
    measures: tuple[Measure, ...] = several("of", of, Measure)
    names, scatter = _scatter(parameters)
    count = integer("samples", samples, 0, 10**7)
    integer("seed", seed, 0, 2**63 - 1)
    bounds = _bounds(limits, measures, count)
    _check_flags(play, progress)
    nominal = np.array([measure.value(solution) for measure in measures])
    rng = np.random.default_rng(seed)
    inputs = _drawn(names, scatter, rng, count)
    ranges = _ranges(scene, solution, measures) if play else ()
    if play:
        low, high = [each.least for each in ranges], [each.most for each in ranges]
        least, most = (_joined(side, measures, names, scatter) for side in (low, high))
        first = _between(least, most)
        bottom, top = (np.array([end.value for end in side]) for side in (low, high))
        ends = _sampled_ends((low, high), measures, names, inputs, progress)
        values = ends[0] + rng.uniform(size=ends[0].shape) * (ends[1] - ends[0])
    else:
        first = least = most = FirstOrder.of(scene, solution, measures, names, scatter)
        bottom = top = nominal
        values = _watched(scene, solution, measures, names, inputs, progress)
    return Tolerances(
        of=measures,
        parameters=names,
        distributions=scatter,
        nominal=nominal,
        derivatives=sensitivity(scene, solution, measures, names),
        variances=first.variances(scatter),
        worst=np.column_stack([bottom + least.reach(scatter)[:, 0], top + most.reach(scatter)[:, 1]]),
        mean_shift=0.5 * (bottom + top) - nominal + first.mean_shift(scatter),
        samples=Samples(inputs, values) if count else None,
        limits=bounds,
        ranges=ranges,
        play_variances=(top - bottom) ** 2 / 12.0,
    )


def _check_flags(play: bool, progress: Progress) -> None:
    if not isinstance(play, (bool, np.bool_)):
        raise TypeError(f"play is {play!r}; expected True or False")
    checked_progress(progress)


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


def _between(least: FirstOrder, most: FirstOrder) -> FirstOrder:
    """Derivatives of the middles of ranges."""
    return FirstOrder(*(0.5 * (low + high) for low, high in zip(least, most, strict=True)))


def _joined(
    side: Sequence[End], measures: Sequence[Measure], parameters: Sequence[Parameter], scatter: Sequence[Distribution]
) -> FirstOrder:
    """Derivatives of each measure at an end of its range."""
    each = [
        FirstOrder.of(end.scene, end.solution, [measure], parameters, scatter)
        for end, measure in zip(side, measures, strict=True)
    ]
    return FirstOrder(*(np.vstack(parts) for parts in zip(*each, strict=True)))


def _ranges(scene: Assembly, solution: Solution, measures: Sequence[Measure]) -> tuple[Play, ...]:
    """The range of every measure; raises for an end that was not found."""
    found = tuple(range_of(scene, solution, measure) for measure in measures)
    for each in found:
        if not each.success:
            raise InputError(f"of has a measure without a range; expected one with two ends\n{each}")
    return found


def _drawn(
    parameters: Sequence[Parameter], scatter: Sequence[Distribution], rng: np.random.Generator, count: int
) -> Array:
    """Values of the parameters, (count, p)."""
    differences = np.column_stack([each.draw(rng, count) for each in scatter])
    result: Array = np.array([parameter.value for parameter in parameters]) + differences
    return result


def _sampled(
    scene: Assembly,
    solution: Solution,
    measures: Sequence[Measure],
    parameters: Sequence[Parameter],
    inputs: Array,
    advance: Advance,
) -> Array:
    """Measures (k, m) of solves with drawn values; NaN where the scene cannot be solved with them."""
    values = np.full((len(inputs), len(measures)), np.nan)
    for row, drawn in zip(values, inputs, strict=True):
        advance(1)
        try:
            with values_set(parameters, drawn):
                found = scene.solve(solution)
        except InputError:  # a value that the scene cannot have
            continue
        if found.success:
            row[:] = [measure.value(found) for measure in measures]
    return values


def _watched(
    scene: Assembly,
    solution: Solution,
    measures: Sequence[Measure],
    parameters: Sequence[Parameter],
    inputs: Array,
    progress: Progress,
) -> Array:
    """The same, watched."""
    with watched(progress, "tolerances", len(inputs), "solve") as advance:
        return _sampled(scene, solution, measures, parameters, inputs, advance)


def _sampled_ends(
    sides: Sequence[Sequence[End]],
    measures: Sequence[Measure],
    parameters: Sequence[Parameter],
    inputs: Array,
    progress: Progress,
) -> list[Array]:
    """The same at both ends of the ranges."""
    with watched(progress, "tolerances", 2 * len(measures) * len(inputs), "solve") as advance:
        return [
            np.hstack(
                [
                    _sampled(end.scene, end.solution, [measure], parameters, inputs, advance)
                    for end, measure in zip(side, measures, strict=True)
                ]
            )
            for side in sides
        ]
