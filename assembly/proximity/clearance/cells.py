"""A face as cells: parts of (u, v) with corners on the surface, and a bound of the face's distance from their hull.

A cell is a rectangle or a triangle of (u, v). Linear interpolation L of the corners over a triangle with the box
l_u x l_v differs from the surface by no more than

    |S - L| <= (M_uu l_u^2 + 2 M_uv l_u l_v + M_vv l_v^2) / 8,       M: bounds of |S_uu|, |S_uv|, |S_vv| over the box,

because each component of S - L is sum_i w_i (x_i - x)' H_i (x_i - x) / 2 with the weights w_i of the corners, and the
variance of u under these is l_u^2 / 4 at most. The M hold for every part of the cell as well: a cell that is halved
needs new points alone.

Where an edge of a triangle is a chord of a boundary curve c, the face may go on beyond it, by no more than (d_u, d_v) =
(dt^2 / 8) (max |c_u''|, max |c_v''|) in (u, v), which is M_u d_u + M_v d_v in space.

Where the face ends before a chord, what lies between is of that one triangle (`rims.py`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.meshing.trimmed_cells import BoundaryCells, TrimmedCells, parallelogram_cells, tube_cells
from assembly.geometry.recognition.elementary import elementary_form
from assembly.geometry.recognition.forms import Cone, Cylinder, Extrusion, Plane
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity.clearance.derivative_nets import surface_bounds
from assembly.proximity.clearance.records import FLAT, ROUNDED, RULED
from assembly.proximity.clearance.rims import Rims, no_rims, rims_of, straight_rims

__all__ = ["CellTable", "cells_of"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
# What evaluation may be off, in parts of the largest coordinate: Horner's rule in two directions and a quotient, about
# 4 (p + q) roundings; held against samples of doubled precision.
ROUNDING = 4e-15
# How far a face that counts as swept by a curve across straight lines may be from that, in parts of its largest
# coordinate; it is added to the radius.
EXACT = 1e-13
ROUNDED_UP = 1.0 + 1e-14
# Rounds of cutting chords in two whose curves may leave their triangles.
SPILLS = 12
# Rounds in which a grid of rectangles becomes finer.
ROUNDS = 12


@dataclass(frozen=True, eq=False)
class CellTable:
    """Cells of one face, n rows.

    Attributes
    ----------
    uv : (n, 4, 2)
        Parameters of the corners; of a triangle the last two are the same.
    second, first : (n, 3), (n, 2)
        Bounds of |S_uu|, |S_uv|, |S_vv| and of |S_u|, |S_v|.
    rims : Rims
    pad : (n,)
        What a radius is in any case.
    form : int
        FLAT, RULED or ROUNDED.
    ruling : (3,)
        The normal of a flat face, the direction of a ruled one's lines; else zero.
    """

    uv: Array
    second: Array
    first: Array
    rims: Rims
    pad: Array
    form: int
    ruling: Array

    def __len__(self) -> int:
        return len(self.uv)


def _sweep(surface: NurbsSurface) -> tuple[int, Array, float]:
    """Whether a surface is flat or swept along lines by a curve across them; its direction; by how much it is not."""
    form = elementary_form(surface)
    if isinstance(form, Plane):
        return FLAT, form.normal, 2.0 * form.deviation
    if isinstance(form, (Cylinder, Extrusion)):
        ruling = form.axis if isinstance(form, Cylinder) else form.direction
        off = min(_unevenness(surface, ruling, along) for along in (0, 1))
        if off <= EXACT * float(np.abs(surface.control_points).max()):
            return RULED, ruling, 2.0 * off
    if isinstance(form, Cone):
        # Its heights are interpolated exactly, so that all that cells lack is across its axis, as of a swept face.
        off = min(_uneven_heights(surface, form.axis, along) for along in (0, 1))
        if off <= EXACT * float(np.abs(surface.control_points).max()):
            return RULED, form.axis, 2.0 * off
    return ROUNDED, np.zeros(3), 0.0


def _unevenness(surface: NurbsSurface, ruling: Array, along: int) -> float:
    """How far a surface is from lines along a ruling that a parameter runs along at the same speed, side by side."""
    points = surface.control_points if along == 1 else surface.control_points.swapaxes(0, 1)
    ways = points - points[:, :1]
    beside = ways - (ways @ ruling)[..., None] * ruling
    return _uneven_heights(surface, ruling, along) + float(np.linalg.norm(beside, axis=-1).max())


def _uneven_heights(surface: NurbsSurface, ruling: Array, along: int) -> float:
    """How far heights along a ruling are from those of a linear function of one parameter."""
    points, weights = surface.control_points, surface.weights
    if along == 0:
        points, weights = points.swapaxes(0, 1), weights.T
    # A mean with weights that are off by a part of themselves is off by no more than that part of the way.
    unlike = (np.ptp(weights, axis=1) / weights.min(axis=1)).max()
    degree, knots = surface.degree[along], surface.knots[along]
    # Of a function that is linear the control values are those at averages of knots.
    at = np.convolve(knots[1:-1], np.full(degree, 1.0 / degree), mode="valid")
    part = (at - at[0]) / (at[-1] - at[0])
    heights = points @ ruling
    first, last = heights[0, [0, -1]]
    return float(np.abs(heights - first - (last - first) * part).max() + unlike * surface.size)


def _grid(surface: NurbsSurface, tolerance: float) -> Array:
    """Rectangles of an untrimmed face: lines are added in the costlier direction until all keep the tolerance."""
    breaks = surface.breaks()
    count = [np.ones(len(at) - 1, dtype=int) for at in breaks]
    for _ in range(ROUNDS):
        u, v = (_divided(at, many) for at, many in zip(breaks, count, strict=True))
        a, b = (g.ravel() for g in np.meshgrid(np.arange(len(u) - 1), np.arange(len(v) - 1), indexing="ij"))
        low, high = np.column_stack([u[a], v[b]]), np.column_stack([u[a + 1], v[b + 1]])
        m = surface_bounds(surface, low, high)[1]
        lu, lv = (high - low).T
        in_u, twist, in_v = 0.125 * m[:, 0] * lu**2, 0.25 * m[:, 1] * lu * lv, 0.125 * m[:, 2] * lv**2
        bad = in_u + twist + in_v > tolerance
        if not bad.any():
            break
        for d, (mine, other, index) in enumerate(((in_u, in_v, a), (in_v, in_u, b))):
            span = np.repeat(np.arange(len(count[d])), count[d])[index]
            short = bad & ((mine + 0.5 * twist > 0.45 * tolerance) | (mine >= other))
            for k in np.unique(span[short]):
                factor = np.sqrt(((mine + 0.5 * twist) / (0.5 * tolerance))[short & (span == k)].max())
                count[d][k] = int(np.ceil(count[d][k] * min(max(factor, 1.05), 4.0)))
    corners = [low, np.column_stack([high[:, 0], low[:, 1]]), high, np.column_stack([low[:, 0], high[:, 1]])]
    return np.stack(corners, axis=1)


def _divided(at: Array, many: Indices) -> Array:
    """The ends of spans, each of which is divided into so many parts."""
    parts = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(at[:-1], at[1:], many, strict=True)]
    return np.concatenate([*parts, at[-1:]])


def _trimmed(
    face: Face, form: int, tolerance: float, angle: float
) -> tuple[BoundaryCells, Rims, NDArray[np.bool_] | None]:
    """Triangles of a face that has a boundary, whose chords are cut in two as long as curves may leave triangles.

    Those curves that may leave theirs in the end come last.
    """
    whole = tube_cells(face, tolerance, angle) if form == RULED else parallelogram_cells(face)
    if whole is not None:
        return whole, straight_rims(whole), None
    made = TrimmedCells(face, tolerance, angle)
    for _ in range(SPILLS):
        cells = made.made()
        rims = rims_of(face, cells)
        wrong = rims.spills(cells.parameters)
        if not wrong.any():
            return cells, rims, None
        made.cut(np.unique(cells.segments[wrong]))
    return cells, rims, wrong


def cells_of(face: Face, tolerance: float, angle: float) -> CellTable:
    """The first cells of a face.

    Parameters
    ----------
    face : Face
    tolerance : float
        About how near to the face they are. Whatever comes out, its radii are bounds.
    angle : float
        About the most that the boundary turns from corner to corner [rad].
    """
    surface = face.surface
    form, ruling, off = _sweep(surface)
    if face.boundary:
        cells, rims, wrong = _trimmed(face, form, tolerance, angle)
        uv = np.concatenate([cells.parameters, cells.parameters[:, 2:]], axis=1)
    else:
        uv = _grid(surface, tolerance)
        rims, wrong = no_rims(len(uv)), None
    reach = rims.sag.max(axis=1) + rims.beside
    low, high = uv.min(axis=1) - reach, uv.max(axis=1) + reach
    for d in range(2):
        if not surface.closed[d]:
            low[:, d], high[:, d] = (
                np.maximum(low[:, d], surface.domain[d][0]),
                np.minimum(high[:, d], surface.domain[d][1]),
            )
    speeds = _even_speeds(surface) if form == FLAT else None
    if speeds is None:
        first, second = surface_bounds(surface, low, high)
    else:
        first, second = np.tile(speeds, (len(uv), 1)), np.zeros((len(uv), 3))
    far = float(np.abs(surface.control_points).max())
    pad = ROUNDING * far + off + (first * rims.beside).sum(axis=1)
    if wrong is not None:
        # What is cut off there is of other triangles: no farther from their borders than curves from chords.
        pad += (first[:, None] * rims.sag).sum(axis=2)[wrong].max()
    return CellTable(uv, second, first, rims, pad, form, ruling)


def _even_speeds(surface: NurbsSurface) -> Array | None:
    """|S_u| and |S_v| of a parallelogram, bounded from above; None of what is none."""
    if not surface.is_parallelogram:
        return None
    net = surface.control_points
    lengths = [np.linalg.norm(np.diff(net, axis=d), axis=-1).max() for d in (0, 1)]
    speeds: Array = np.array(lengths) / np.ptp(surface.domain, axis=1) * ROUNDED_UP
    return speeds
