"""The area that a tip reaches, drawn by matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError
from assembly.studies.reachable.result import Workspace

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_workspace"]

Array = NDArray[np.float64]


def plot_workspace(found: Workspace, values: Array | None, axes: Axes | None) -> Axes:
    """Cells colored by values (k,), and the boundary as dots; see `Workspace.plot`."""
    if found.grid.dimension != 2:
        raise InputError("the workspace is a volume; expected an area: draw its picture(values) as that of a body")
    if not len(found.cells):
        raise InputError("the workspace has no cells; expected some to draw")
    try:
        from matplotlib import pyplot
    except ImportError:
        raise ImportError("plots need matplotlib, which is not installed; install the extra plot") from None
    if axes is None:
        axes = pyplot.subplots()[1]
    low = found.cells.min(axis=0)
    field = np.full(found.cells.max(axis=0) - low + 1, np.nan)
    field[tuple((found.cells - low).T)] = 1.0 if values is None else values
    edges = [found.grid.size * (first + np.arange(count + 1)) for first, count in zip(low, field.shape, strict=True)]
    style = {"cmap": "Greys", "vmin": 0.0, "vmax": 4.0} if values is None else {"cmap": "viridis"}
    drawn = axes.pcolormesh(*edges, field.T, **style)
    if values is not None:
        axes.figure.colorbar(drawn, ax=axes)
    places = found.grid.size * found.grid.flat(found.boundary)
    axes.plot(*places.T, ".", color="black", markersize=1.5)
    axes.set_aspect("equal")
    return axes
