"""Lines u = constant and v = constant between which a surface is flat within a tolerance.

A cell of sides h and k in (u, v) is about (S_uu h^2 + 2 S_uv h k + S_vv k^2).n / 8 away from its corners' facets, n the
normal. Lines stand where the densities sqrt(S_uu.n / (8 tolerance)) and (S_uu.n / |S_u|) / angle, the larger one, have
grown by one; what that leaves out, twist and what lies between samples, is for whoever measures the facets.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.meshing.border import SPARE, cross, on_surface
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["Axis", "axes", "unit"]

Array = NDArray[np.float64]
# Parts of a span at whose middles the surface is looked at, and the most such places across the direction in question.
_MOST, _LEAST, _ACROSS = 12, 2, 24
# Normals that differ by more [rad] on the two sides of a knot make a crease; how far beside it, in parts of a span.
_CREASE, _BESIDE = 0.02, 1e-9


@dataclass(frozen=True, eq=False)
class Axis:
    """One direction of a rectangle in (u, v).

    Attributes
    ----------
    at, grown : (n,)
        A parameter, and the number of steps to there from the low end of the rectangle: both increase.
    lines : (k,)
        Parameters of lines, both ends of the rectangle among them.
    creases : (c,)
        Those lines, not the ends, along which the surface has an edge.
    """

    at: Array
    grown: Array
    lines: Array
    creases: Array

    def steps(self, t: Array) -> Array:
        """Parameters counted in steps."""
        result: Array = np.interp(t, self.at, self.grown)
        return result


def unit(vectors: Array) -> Array:
    """Unit vectors; zero stays zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    result: Array = np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0.0)
    return result


def _parts(breaks: Array, closed: bool, low: float, high: float) -> Array:
    """Ends of short parts between two parameters; a closed direction goes round as often as need be."""
    if closed:
        period = breaks[-1] - breaks[0]
        turns = np.arange(np.floor((low - breaks[0]) / period), np.ceil((high - breaks[0]) / period))
        breaks = np.unique(np.add.outer(turns * period, breaks))
    width = 1e-9 * (high - low)
    ends = np.concatenate([[low], breaks[(breaks > low + width) & (breaks < high - width)], [high]])
    parts = int(np.clip(3 * _MOST // (len(ends) - 1), _LEAST, _MOST))
    inner = ends[:-1, None] + np.arange(parts) * (np.diff(ends) / parts)[:, None]
    return np.append(inner.ravel(), high)


def _some(values: Array) -> Array:
    """Not more than a few, evenly taken."""
    return values[:: -(-len(values) // _ACROSS)]


def _grid(u: Array, v: Array) -> Array:
    return np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)


def _creases(surface: NurbsSurface, direction: int, low: float, high: float, across: Array) -> Array:
    """Parameters strictly between two at which normals jump."""
    knots, degree = surface.knots[direction], surface.degree[direction]
    breaks = surface.breaks()[direction]
    period = breaks[-1] - breaks[0]
    # At the ends of a closed direction knots are full whether there is an edge or not.
    full = np.array([np.count_nonzero(knots == b) >= degree for b in breaks])
    full[[0, -1]] = surface.closed[direction]
    turns = np.arange(-2, 3) if surface.closed[direction] else np.zeros(1)
    at = np.unique(np.add.outer(turns * period, breaks[full]))
    at = at[(at > low + 1e-9 * period) & (at < high - 1e-9 * period)]
    if not len(at):
        return np.empty(0)
    beside = _BESIDE * period * np.array([-1.0, 1.0])
    grid = _grid(np.add.outer(at, beside).ravel(), across)
    _, su, sv = on_surface(surface, grid if direction == 0 else grid[:, ::-1], 1)
    normals = unit(cross(su, sv)).reshape(len(at), 2, -1, 3)
    turned = np.arccos(np.clip((normals[:, 0] * normals[:, 1]).sum(axis=-1), -1.0, 1.0))
    # Of two knots nearly the same, one.
    found = at[turned.max(axis=1) > _CREASE]
    result: Array = found[np.diff(found, prepend=-np.inf) > 1e-9 * period]
    return result


def _even_axes(surface: NurbsSurface, ends: list[Array]) -> tuple[Axis, Axis]:
    """Those of a parallelogram, which has no lines but its sides."""
    first = on_surface(surface, np.array([[0.5 * (t[0] + t[1]) for t in ends]]), 1)[1:]
    speeds = [float(np.linalg.norm(way)) for way in first]
    extent = max(float((speed * np.diff(t)).sum()) for speed, t in zip(speeds, ends, strict=True))
    u, v = (
        Axis(t, np.concatenate([[0.0], np.cumsum(speed / extent * np.diff(t))]), t[[0, -1]], np.empty(0))
        for speed, t in zip(speeds, ends, strict=True)
    )
    return u, v


def axes(surface: NurbsSurface, box: Array, tolerance: float, angle: float) -> tuple[Axis, Axis]:
    """Both directions of a rectangle.

    Parameters
    ----------
    surface : NurbsSurface
    box : (2, 2)
        Low and high corner in (u, v); a closed direction may run beyond the domain.
    tolerance : float
        Distance of facets from the surface.
    angle : float
        The most that normals turn along a step [rad].
    """
    breaks = surface.breaks()
    ends = [_parts(breaks[d], surface.closed[d], box[0, d], box[1, d]) for d in (0, 1)]
    if surface.is_parallelogram:
        return _even_axes(surface, ends)
    middles = [0.5 * (t[:-1] + t[1:]) for t in ends]
    bends, speeds = [], []
    for d in (0, 1):
        few = _some(middles[1 - d])
        grid = _grid(middles[d], few)
        found = on_surface(surface, grid if d == 0 else grid[:, ::-1], 2)
        normals = unit(cross(found[1], found[2]))
        bend = np.abs((found[3 + 2 * d] * normals).sum(axis=1)).reshape(-1, len(few))
        bends.append(bend)
        speeds.append(np.linalg.norm(found[1 + d], axis=1).reshape(-1, len(few)))
    extent = max(float((speed.max(axis=1) * np.diff(t)).sum()) for speed, t in zip(speeds, ends, strict=True))
    # Bent by no more than rounding, as a plane in space is.
    bent = [bool(((b * np.diff(t)[:, None] ** 2) > 1e-12 * extent).any()) for b, t in zip(bends, ends, strict=True)]
    share = 0.5 * tolerance if all(bent) else tolerance
    result = []
    for d in (0, 1):
        width = np.diff(ends[d])
        turn = np.divide(bends[d], speeds[d], out=np.zeros_like(bends[d]), where=speeds[d] > 0.0)
        density = np.maximum(np.sqrt(bends[d] / (8.0 * share)), turn / angle).max(axis=1) * bent[d]
        least = np.maximum(speeds[d].max(axis=1), 1e-3 * speeds[d].max()) / extent
        needed = np.concatenate([[0.0], np.cumsum(density * width)])
        grown = np.concatenate([[0.0], np.cumsum(np.maximum(density, least) * width)])
        creases = _creases(surface, d, box[0, d], box[1, d], _some(middles[1 - d]))
        stops = np.concatenate([[box[0, d]], creases, [box[1, d]]])
        lines = [stops[:1]]
        for low, high in zip(stops[:-1], stops[1:], strict=True):
            count = max(int(np.ceil(np.ptp(np.interp([low, high], ends[d], needed)) - SPARE)), 1)
            begin, end = np.interp([low, high], ends[d], grown)
            reached = np.linspace(begin, end, count + 1)
            lines.append(np.append(np.interp(reached[1:-1], grown, ends[d]), high))
        result.append(Axis(ends[d], grown, np.concatenate(lines), creases))
    return result[0], result[1]
