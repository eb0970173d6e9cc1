"""Boundary curves that leave the domain of their surface by no more than a tolerance.

The surface goes on beyond its end as its last span does, by blossoms of that (Piegl & Tiller, The NURBS Book, section
5.5): a plane, cylinder, cone, sphere or torus stays what it is, exactly. At a pole, and where weights or the normal
would change their sign, nothing goes on: there curves are moved onto the edge.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.splines import bezier
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.curve_parts import sampled
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["clipped", "extent", "rates", "widened"]

Array = NDArray[np.float64]
# Knots that a curve gets before it is moved onto an edge: its control points are near it then.
_REFINED = 16
# Places along an edge at which the surface is looked at.
_PLACES = 9
# Samples of a stretch of a curve, and steps of Newton's method from them: errors are squared, from a 64th of a stretch.
_SAMPLES, _STEPS = 65, 4
# Signs by which a least and a largest coordinate are both least.
_DOWNHILL = np.array([1.0, -1.0])


def extent(curve: NurbsCurve, axis: int) -> tuple[float, float]:
    """Least and largest coordinate of a curve itself, by Newton's method from samples, between their neighbors."""
    grid = sampled(curve.breaks(), _SAMPLES)
    values = curve.evaluate(grid)[:, axis]
    k = np.array([values.argmin(), values.argmax()])
    t, low, high = grid[k], grid[np.maximum(k - 1, 0)], grid[np.minimum(k + 1, grid.size - 1)]
    least, most = values[k].tolist()
    for _ in range(_STEPS):
        first, second = (row[:, axis] * _DOWNHILL for row in curve.evaluate(t, 2)[1:])
        low, high = np.where(first > 0.0, low, t), np.where(first > 0.0, t, high)
        ahead = t - np.divide(first, second, out=np.zeros(2), where=second > 0.0)
        t = np.where((second > 0.0) & (ahead >= low) & (ahead <= high), ahead, 0.5 * (low + high))
        a, b = curve.evaluate(t)[:, axis].tolist()
        least, most = min(least, a), max(most, b)
    return least, most


def rates(surface: NurbsSurface) -> Array:
    """How far a point goes at most for a step in u, and in v, of length one."""
    u, v = (np.linspace(*ends, _PLACES) for ends in surface.domain)
    _, su, sv = surface.evaluate(u[:, None], v[None], 1)
    return np.array([float(np.linalg.norm(su, axis=-1).max()), float(np.linalg.norm(sv, axis=-1).max())])


def widened(surface: NurbsSurface, curves: Sequence[NurbsCurve], slack: Array, tolerance: Array) -> NurbsSurface:
    """The surface, continued to where curves end that leave its domain by more than the slack, up to the tolerance.

    Parameters
    ----------
    surface
    curves : plane curves
    slack, tolerance : (2,)
        In u and in v.
    """
    given = np.concatenate([curve.control_points for curve in curves])
    for axis in (0, 1):
        if surface.closed[axis]:
            continue
        for high in (False, True):
            end = surface.domain[axis][high]
            sign = 1.0 if high else -1.0
            if (sign * (given[:, axis] - end)).max() <= slack[axis]:
                continue
            beyond = max(
                sign * extent(curve, axis)[high]
                for curve in curves
                if (sign * (curve.control_points[:, axis] - end)).max() > slack[axis]
            )
            over = beyond - sign * end
            if slack[axis] < over <= tolerance[axis]:
                surface = _continued(surface, axis, high, sign * beyond) or surface
    return surface


def _continued(surface: NurbsSurface, axis: int, high: bool, end: float) -> NurbsSurface | None:
    """The surface with another end of its domain; None where it does not go on."""
    if surface._pole_bits >> (2 * axis + int(high)) & 1:
        return None
    if not surface._is_clamped:
        surface = surface.elevate(surface.degree)
    p, row = surface.degree[axis], surface.knots[axis].copy()
    points = np.moveaxis(surface._homogeneous, axis, 0).copy()
    pieces = np.moveaxis(bezier.pieces(points, row, p), 0, 0)
    breaks = bezier.breaks(row, p)
    if high:
        span, (a, b) = pieces[-1], breaks[-2:]
        row[-p - 1 :] = end
        changed = range(len(points) - p, len(points))
    else:
        span, (a, b) = pieces[0], breaks[:2]
        row[: p + 1] = end
        changed = range(p)
    for k in changed:
        points[k] = _blossom(span, (row[k + 1 : k + p + 1] - a) / (b - a))
    if (points[..., 3] <= 0.0).any():
        return None
    knots = [surface.knots[0], surface.knots[1]]
    knots[axis] = row
    made = surface._from_homogeneous(np.moveaxis(points, 0, axis), knots, surface.degree)
    return made if _goes_on(surface, made, axis, high) else None


def _blossom(span: Array, values: Array) -> Array:
    """The polar form of a Bezier piece (p + 1, ...) at p values, by de Casteljau's steps."""
    row = span
    for value in values.tolist():
        row = (1.0 - value) * row[:-1] + value * row[1:]
    return np.asarray(row[0])


def _goes_on(surface: NurbsSurface, made: NurbsSurface, axis: int, high: bool) -> bool:
    """Whether the normals at a new end are near to those at the old one."""
    along = np.linspace(*surface.domain[1 - axis], _PLACES + 2)[1:-1]
    sides = []
    for one in (surface, made):
        at = np.full_like(along, one.domain[axis][high])
        _, su, sv = one.evaluate(*((at, along) if axis == 0 else (along, at)), 1)
        sides.append(np.cross(su, sv))
    return bool(((sides[0] * sides[1]).sum(axis=1) > 0.0).all())


def clipped(curve: NurbsCurve, axis: int, low: float, high: float) -> NurbsCurve:
    """A curve with what of it is beyond two values of a coordinate moved onto these."""
    p = curve.degree
    if p > 1:
        for value in np.linspace(*curve.domain, _REFINED + 1)[1:-1].tolist():
            if not np.any(curve.knots == value):
                curve = curve.insert_knot(value)
    points = curve.control_points.copy()
    points[:, axis] = np.clip(points[:, axis], low, high)
    return NurbsCurve(points, curve.knots, p, curve.weights, name=curve.name)
