"""Curves of a benchmark: what goes to the JSON, and pictures of it where matplotlib is installed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["curve", "draw", "exponent"]


def curve(
    title: str, x: str, y: str, lines: Mapping[str, Sequence[tuple[float, float]] | None], *, flat: bool = False
) -> dict[str, Any]:
    """A diagram with a line each of points (x, y), as it goes to the JSON.

    Parameters
    ----------
    title, x, y
        Heading, and what the axes show, with units; both are logarithmic.
    lines
        By name; None for one that is not installed. Points that are not positive and finite are kept in the JSON and
        left out of the picture.
    flat
        The axis of y is linear and begins at zero.
    """
    points = {name: None if line is None else [list(map(float, p)) for p in line] for name, line in lines.items()}
    return {"title": title, "x": x, "y": y, "flat": flat, "lines": points}


def exponent(counts: Iterable[float], seconds: Iterable[float]) -> float:
    """Of the power of counts that fits the times."""
    return float(np.polyfit(np.log(list(counts)), np.log(list(seconds)), 1)[0])


def draw(name: str, curves: Sequence[Mapping[str, Any]], folder: Path) -> list[Path]:
    """A picture a diagram, `name-k.png`; none where matplotlib is not installed."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        return []
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for k, diagram in enumerate(curves):
        figure = Figure(figsize=(6.4, 4.0), layout="constrained")
        axes = figure.add_subplot(xscale="log", yscale="linear" if diagram["flat"] else "log")
        for (who, line), marker in zip(diagram["lines"].items(), "osv^D<>pxP*+" * 2, strict=False):
            if line is None:
                continue
            kept = np.array([p for p in line if np.isfinite(p).all() and min(p) > 0.0]).reshape(-1, 2)
            axes.plot(kept[:, 0], kept[:, 1], marker=marker, markersize=4, linewidth=1.2, label=who)
        if diagram["flat"]:
            axes.set_ylim(bottom=0.0)
        axes.set(title=diagram["title"], xlabel=diagram["x"], ylabel=diagram["y"])
        axes.grid(visible=True, which="major", linewidth=0.3)
        axes.legend(fontsize=8)
        paths.append(folder / f"{name}-{k + 1}.png")
        figure.savefig(paths[-1], dpi=110)
    return paths
