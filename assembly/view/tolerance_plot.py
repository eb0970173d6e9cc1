"""Tolerances, drawn by matplotlib: histograms of measures, and contributions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from assembly.studies.tolerances.result import Tolerances

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["plot_tolerances"]

# Bars of a histogram; the normal curve is drawn to so many sigmas, at so many points.
_BARS, _REACH, _POINTS = 40, 4.0, 200


def plot_tolerances(found: Tolerances) -> Figure:
    """See `Tolerances.plot`."""
    try:
        from matplotlib import pyplot
    except ImportError:
        raise ImportError("plots need matplotlib, which is not installed; install the extra plot") from None
    count = len(found.of)
    figure, axes = pyplot.subplots(count, 2, figsize=(9.0, 3.2 * count), squeeze=False, layout="constrained")
    for k in range(count):
        _scatter(found, k, axes[k, 0])
        _shares(found, k, axes[k, 1])
    return figure


def _scatter(found: Tolerances, k: int, axes: Axes) -> None:
    """The normal curve of the root sum square, and the samples where there are some."""
    sigma, middle = found.sigma[k], found.nominal[k]
    if found.samples is not None:
        values = found.samples.values[:, k]
        axes.hist(values[np.isfinite(values)], bins=_BARS, density=True, color="tab:blue", alpha=0.6, label="samples")
    if sigma > 0.0:
        x = middle + sigma * np.linspace(-_REACH, _REACH, _POINTS)
        density = np.exp(-0.5 * ((x - middle) / sigma) ** 2) / (sigma * np.sqrt(2.0 * np.pi))
        axes.plot(x, density, color="black", linewidth=1.0, label="root sum square")
    for end in (*found.worst[k], *found.limits[k][np.isfinite(found.limits[k])]):
        axes.axvline(end, color="tab:red" if end in found.limits[k] else "gray", linestyle="--", linewidth=1.0)
    axes.set_xlabel(f"{found.of[k].name} [{found.of[k].unit}]")
    axes.legend(frameon=False)


def _shares(found: Tolerances, k: int, axes: Axes) -> None:
    """Bars of what each parameter adds, and play, the most first."""
    names, shares = zip(*found.shares(k), strict=True)
    axes.barh(names, [100.0 * share for share in shares], color="tab:blue")
    axes.invert_yaxis()
    axes.set_xlabel("contribution [%]")
