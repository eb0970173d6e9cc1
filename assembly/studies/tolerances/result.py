"""Effects of tolerances, as a table and a plot."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly._html import printed
from assembly._read_only import ReadOnlyArrays
from assembly.derivatives.measure import Measure
from assembly.derivatives.parameter import Parameter
from assembly.derivatives.result import Sensitivity
from assembly.errors import InputError
from assembly.studies.fits.result import Play
from assembly.studies.tolerances.distributions import Distribution

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Samples", "Tolerances"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Samples(ReadOnlyArrays):
    """Sets of values that were drawn, and what came of them.

    Attributes
    ----------
    inputs : (k, p)
        Values of the parameters.
    values : (k, m)
        Measures; NaN where the scene could not be solved.
    """

    inputs: Array
    values: Array

    @property
    def failed(self) -> int:
        """How many could not be solved."""
        return int(np.isnan(self.values).any(axis=1).sum())


@dataclass(frozen=True, eq=False)
class Tolerances(ReadOnlyArrays):
    """What scatter of p parameters does to m measures; print it for a table.

    Attributes
    ----------
    of : tuple of Measure
    parameters : tuple of Parameter
    distributions : tuple of Normal or Uniform
    nominal : (m,)
        The measures with all parameters at their values.
    derivatives : Sensitivity
    variances : (m, p)
        What each parameter adds to a measure's variance, to first order.
    worst : (m, 2)
        Least and most of each measure, to first order, with all parameters at the worse ends of their ranges.
    mean_shift : (m,)
        By how much the means are off the nominal values, to second order; NaN where that is not known.
    samples : Samples or None
    limits : (m, 2)
        What is accepted; infinite without a limit.
    ranges : tuple of Play
        With play: the range of each measure, `nominal` being somewhere in it; else empty.
    play_variances : (m,)
        What play adds to the variances: that of a uniform distribution over the range.
    """

    of: tuple[Measure, ...]
    parameters: tuple[Parameter, ...]
    distributions: tuple[Distribution, ...]
    nominal: Array
    derivatives: Sensitivity = field(repr=False)
    variances: Array
    worst: Array
    mean_shift: Array
    samples: Samples | None = field(repr=False)
    limits: Array = field(repr=False)
    ranges: tuple[Play, ...] = field(repr=False)
    play_variances: Array

    @property
    def sigma(self) -> Array:
        """Standard deviations of the measures by root sum square, (m,)."""
        result: Array = np.sqrt(self._total)
        return result

    @property
    def contributions(self) -> Array:
        """Shares of the parameters in the variances, (m, p); with that of play rows sum to one."""
        total = self._total[:, None]
        result: Array = np.divide(self.variances, total, out=np.zeros_like(self.variances), where=total > 0.0)
        return result

    @property
    def play_contributions(self) -> Array:
        """Shares of play in the variances, (m,)."""
        total = self._total
        result: Array = np.divide(self.play_variances, total, out=np.zeros_like(total), where=total > 0.0)
        return result

    def shares(self, k: int) -> list[tuple[str, float]]:
        """Names of the parameters, and play where it counts, with their shares in measure k; the largest first."""
        named = [(parameter.name, float(self.contributions[k, i])) for i, parameter in enumerate(self.parameters)]
        if self.ranges:
            named.append(("play", float(self.play_contributions[k])))
        return sorted(named, key=lambda item: -item[1])

    @property
    def _total(self) -> Array:
        result: Array = self.variances.sum(axis=1) + self.play_variances
        return result

    @property
    def mean(self) -> Array:
        """Means of the samples that were solved, (m,)."""
        result: Array = np.nanmean(self._drawn.values, axis=0)
        return result

    @property
    def sampled_sigma(self) -> Array:
        """Standard deviations of the samples that were solved, (m,)."""
        result: Array = np.nanstd(self._drawn.values, axis=0, ddof=1)
        return result

    @property
    def yields(self) -> float:
        """Share of the samples that are within all limits; one that could not be solved is not."""
        values = self._drawn.values
        within = (values >= self.limits[:, 0]) & (values <= self.limits[:, 1])
        return float(within.all(axis=1).mean())

    @property
    def _drawn(self) -> Samples:
        if self.samples is None:
            raise InputError("no samples were drawn; expected tolerances(..., samples=1000), say")
        return self.samples

    def __str__(self) -> str:
        lines = []
        for k, measure in enumerate(self.of):
            low, high = self.worst[k]
            shift = "not known" if np.isnan(self.mean_shift[k]) else f"{self.mean_shift[k]:.3g}"
            lines.append(
                f"{measure.name} [{measure.unit}]  {self.nominal[k]:.8g}   sigma {self.sigma[k]:.6g}   "
                f"worst {low:.8g} to {high:.8g}   mean shift {shift}"
            )
            if self.samples is not None:
                lines.append(f"  samples: mean {self.mean[k]:.8g}   sigma {self.sampled_sigma[k]:.6g}")
            shares = self.shares(k)
            width = max(len(name) for name, _ in shares)
            lines += [f"  {name:<{width}}  {100.0 * share:6.2f} %" for name, share in shares]
            if self.ranges:
                low, high = self.ranges[k].least.value, self.ranges[k].most.value
                lines.append(f"  play from {low:.8g} to {high:.8g}")
        if self.samples is not None:
            count = len(self.samples.values)
            lines.append(f"{count} samples, {self.samples.failed} without a solution")
            if np.isfinite(self.limits).any():
                lines.append(f"within the limits: {100.0 * self.yields:.2f} %")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return printed(self)

    def plot(self) -> Figure:
        """Histograms of the samples, and bars of the contributions, one row per measure, by matplotlib.

        Raises
        ------
        ImportError
            Without matplotlib, of the extra `plot`.
        """
        from assembly.view.tolerance_plot import plot_tolerances

        return plot_tolerances(self)
