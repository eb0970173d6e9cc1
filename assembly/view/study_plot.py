"""Studies, drawn by matplotlib: a measure over parameters, or measures against each other with their front."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from assembly.errors import InputError
from assembly.studies.sweeps.result import Study

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_study"]


def plot_study(found: Study, measure: str | None, other: str | None, axes: Axes | None) -> Axes:
    """See `Study.plot`."""
    name = found.measures[0] if measure is None else measure
    for each in (name, *(() if other is None else (other,))):
        found._check_measure("measure", each.removeprefix("-") if isinstance(each, str) else each)
    if not found.success.any():
        raise InputError(f"no row has a solution: {found!r}; expected one at least to draw")
    try:
        from matplotlib import pyplot
    except ImportError:
        raise ImportError("plots need matplotlib, which is not installed; install the extra plot") from None
    if axes is None:
        axes = pyplot.subplots(layout="constrained")[1]
    if other is not None:
        _against(found, name, other, axes)
    elif len(found.plan.names) == 2:
        _map(found, name.removeprefix("-"), axes)
    else:
        _lines(found, name.removeprefix("-"), axes)
    return axes


def _label(found: Study, name: str) -> str:
    unit = dict(zip(found.measures, found.units, strict=True)).get(name, "")
    return f"{name} [{unit}]" if unit else name


def _map(found: Study, name: str, axes: Axes) -> None:
    """Colors over two parameters; white where there is no solution."""
    x, y = found.plan.names
    values = found.table[name]
    if found.plan.axes:
        lines = found.plan.axes
        order = [np.argsort(line, kind="stable") for line in lines]
        field = values.reshape(len(lines[0]), len(lines[1]))[np.ix_(*order)]
        drawn: Any = axes.pcolormesh(lines[0][order[0]], lines[1][order[1]], field.T, shading="nearest", cmap="viridis")
    else:
        held = found.success
        axes.plot(found.table[x][~held], found.table[y][~held], "x", color="lightgray", markersize=3.0)
        drawn = axes.scatter(found.table[x][held], found.table[y][held], c=values[held], s=8.0, cmap="viridis")
    axes.figure.colorbar(drawn, ax=axes, label=_label(found, name))
    axes.set_xlabel(x)
    axes.set_ylabel(y)


def _lines(found: Study, name: str, axes: Axes) -> None:
    """The measure over one parameter, or over the rows; it is broken where there is no solution."""
    one = len(found.plan.names) == 1
    x = found.table[found.plan.names[0]] if one else found.table["row"]
    order = np.argsort(x, kind="stable")
    axes.plot(x[order], found.table[name][order], "-" if one else ".", color="tab:blue", markersize=3.0)
    axes.set_xlabel(found.plan.names[0] if one else "row")
    axes.set_ylabel(_label(found, name))


def _against(found: Study, name: str, other: str, axes: Axes) -> None:
    """Dots of two measures, and the rows that no other is better than."""
    names = [each.removeprefix("-") for each in (name, other)]
    held = found.success
    axes.plot(*(found.table[each][held] for each in names), ".", color="lightgray", markersize=2.5)
    wanted: dict[str, list[str]] = {"minimize": [], "maximize": []}
    for asked, each in zip((name, other), names, strict=True):
        wanted["maximize" if asked.startswith("-") else "minimize"].append(each)
    front = np.sort(found.pareto(**wanted), order=names[0])
    axes.plot(*(front[each] for each in names), "o-", color="tab:red", markersize=4.0, linewidth=1.0, label="front")
    axes.set_xlabel(_label(found, names[0]))
    axes.set_ylabel(_label(found, names[1]))
    axes.legend(frameon=False)
