"""Boundaries of faces as files and makers give them: loops that need neither be joined nor turned nor moved.

On a surface that is open both ways and has no poles, a trim's table alone tells that such loops bound a face.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from assembly.geometry.faces.loop import NO_LENGTH, Loop
from assembly.geometry.faces.trim_making import measure_loops
from assembly.geometry.faces.trim_table import TrimTable, made_at_once
from assembly.geometry.splines.bezier import MAX_DEGREE
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.curve_packing import joined_curves
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["plain_boundary"]


def plain_boundary(
    surface: NurbsSurface, outer: Any, holes: Sequence[Any], slack: float
) -> tuple[list[Loop], tuple[NurbsCurve, ...], tuple[range, ...], TrimTable] | None:
    """The loops, the outer one first, their curves, which make a loop each, and the table; None where more is to do.

    Parameters
    ----------
    surface
    outer, holes
        As `Face` takes them.
    slack : float
        Control points that are nearer to the edge of the domain, as a part of it, may have to be moved there.
    """
    if surface._pole_bits or any(surface.closed):
        return None
    rows: list[tuple[NurbsCurve, ...]] = []
    for loop in (outer, *holes):
        if not isinstance(loop, (list, tuple)) or not loop:
            return None
        rows.append(tuple(loop))
    curves = tuple(curve for row in rows for curve in row)
    if not all(_is_plane(curve) for curve in curves):
        return None
    stops = np.cumsum([len(row) for row in rows]).tolist()
    ranges = tuple(range(a, b) for a, b in zip([0, *stops[:-1]], stops, strict=True))
    chains = np.array([(chain.start, chain.stop, 1) for chain in ranges], dtype=np.int64)
    given = joined_curves(curves)
    boxes = np.empty((len(rows), 5))
    if not measure_loops(*given, chains, NO_LENGTH, boxes):
        return None
    measured = boxes.tolist()
    for k, (low, high) in enumerate(surface.domain):
        near = 2.0 * slack * (high - low)
        for box in measured:
            if not (box[2 * k] > low + near and box[2 * k + 1] < high - near):
                return None
    table = made_at_once(given, chains, surface.domain)
    # Outside of a loop that runs clockwise there would be material.
    if table is None or table.crossed is not None or table.beyond[0][0] != 0.0:
        return None
    if (table.left != 1.0).any() or (table.right != 0.0).any():
        return None
    loops = [Loop.known(row, box[4]) for row, box in zip(rows, measured, strict=True)]
    # A hole that runs counterclockwise would bound a second piece, beside the face or inside another hole.
    if holes and (loops[0].is_clockwise or not all(loop.is_clockwise for loop in loops[1:])):
        return None
    return loops, curves, ranges, table


def _is_plane(curve: object) -> bool:
    """Whether it is a curve in (u, v) of which a table can be made."""
    return isinstance(curve, NurbsCurve) and curve.control_points.shape[1] == 2 and curve.degree <= MAX_DEGREE
