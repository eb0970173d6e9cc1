"""Plane curves that profiles are made of: circles, arcs, polygons, exact and with knots that are lengths.

`asm.curves` has them beside the curves that are given by formulas.
"""

from __future__ import annotations

from math import cos, hypot, pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.errors import InputError, extent, number, real_array, vector
from assembly.geometry.splines.bezier import full_knots
from assembly.geometry.splines.curve import NurbsCurve

__all__ = ["arc", "arc_through", "circle", "polygon", "segment"]

Array = NDArray[np.float64]


def segment(start: ArrayLike, end: ArrayLike) -> NurbsCurve:
    """A straight line in the plane; its parameter is the length."""
    points = np.array([start, end], dtype=float)
    length = hypot(*(points[1] - points[0]).tolist())
    return NurbsCurve(points, [0.0, 0.0, length, length], 1)


def arc_through(center: ArrayLike, radius: float, start: float, sweep: float) -> NurbsCurve:
    """A circular arc in the plane, in quarters; its parameter runs over the length (exact at its breaks)."""
    quarters = max(1, round(abs(sweep) / (0.5 * pi)))
    step = sweep / quarters
    angles = start + 0.5 * step * np.arange(2 * quarters + 1)
    weights = np.where(np.arange(angles.size) % 2, cos(0.5 * step), 1.0)
    points = np.column_stack([np.cos(angles), np.sin(angles)]) / weights[:, None]
    if abs(sweep) == 2.0 * pi:
        points[-1] = points[0]
    knots = full_knots(np.linspace(0.0, radius * abs(sweep), quarters + 1), 2)
    return NurbsCurve(radius * points + np.asarray(center, dtype=float), knots, 2, weights)


def circle(radius: float, center: ArrayLike = (0.0, 0.0)) -> NurbsCurve:
    """A circle in the plane, counterclockwise from its point at +x; its parameter is the arc length.

    Parameters
    ----------
    radius : float
    center : (2,)
    """
    return arc_through(vector("center", center, 2), extent("radius", radius), 0.0, 2.0 * pi)


def arc(radius: float, start: float, end: float, center: ArrayLike = (0.0, 0.0)) -> NurbsCurve:
    """An arc of a circle in the plane, clockwise if `end` is less than `start`; its parameter is the arc length.

    Parameters
    ----------
    radius : float
    start, end : float
        Angles from the x axis, less than a whole turn apart [rad].
    center : (2,)

    Raises
    ------
    InputError
        Equal angles, or angles that differ by a whole turn or more.
    """
    first, last = number("start", start), number("end", end)
    sweep = last - first
    if not 1e-9 <= abs(sweep) < 2.0 * pi:
        raise InputError(f"start and end are {first:g} and {last:g}; expected angles less than a whole turn apart")
    return arc_through(vector("center", center, 2), extent("radius", radius), first, sweep)


def polygon(points: ArrayLike) -> NurbsCurve:
    """A closed polygon in the plane; its parameter is the arc length.

    Parameters
    ----------
    points : (n, 2)
        Three or more corners, none of them twice in a row; the first is not repeated at the end.

    Raises
    ------
    InputError
        Fewer than three corners, or sides without length.
    """
    corners = real_array("points", points, ("n", 2))
    if len(corners) < 3:
        raise InputError(f"points is {corners.tolist()}; expected three corners or more")
    closed = np.concatenate([corners, corners[:1]])
    sides = np.linalg.norm(np.diff(closed, axis=0), axis=1)
    if not (sides > 0.0).all():
        k = int(np.argmin(sides))
        raise InputError(f"points[{k}] is {corners[k].tolist()}, as the next one; expected sides that have a length")
    at = np.concatenate([[0.0], np.cumsum(sides)])
    return NurbsCurve(closed, np.concatenate([at[:1], at, at[-1:]]), 1)
