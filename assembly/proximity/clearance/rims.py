"""Edges of triangles that are chords of a face's boundary curves, and whether the curves stay in their triangles.

Where the face ends before a chord, what is between curve and chord is no part of it: of that triangle alone, if the
curve does not leave it. Of a triangle p q r with the chord p q let f be linear, 0 on the side r p and 1 in q, so that
it is s on the chord's point s. The curve is off that by s (1 - s) dt^2 |c''| / 2 at most, and stays on that side if

    2 (area) >= (dt^2 / 2) (|r_v - p_v| max |c_u''| + |r_u - p_u| max |c_v''|),

and so for the other side.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.meshing.trimmed_cells import BoundaryCells
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity.clearance.derivative_nets import chord_bounds
from assembly.proximity.clearance.records import NONE

__all__ = ["Rims", "no_rims", "rims_of", "straight_rims"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Rims:
    """Chords of boundary curves, n rows.

    Attributes
    ----------
    curve : (n, 3)
        The boundary curve that edge k (corner k to k + 1) is a chord of, or -1.
    t, second : (n, 3, 2)
        Its parameters there, and bounds of |c_u''|, |c_v''|.
    hollow : (n, 3)
        1: that curve bends away from the material; -1: towards it; 0: not known.
    beside : (n, 2)
        How far ends of the chords are from the curves in (u, v).
    """

    curve: Indices
    t: Array
    second: Array
    hollow: Indices
    beside: Array

    @cached_property
    def sag(self) -> Array:
        """How far curves are from their chords in (u, v), at most (n, 3, 2)."""
        return np.asarray(0.125 * np.diff(self.t, axis=2) ** 2 * self.second)

    def spills(self, uv: Array) -> NDArray[np.bool_]:
        """Which curves (n, 3), but those that bend towards the material, may leave their triangles (n, 3, 2)."""
        if not self.second.any():
            return np.zeros(self.curve.shape, dtype=bool)
        p, q, r = uv, uv[:, [1, 2, 0]], uv[:, [2, 0, 1]]
        area = np.abs((q - p)[..., 0] * (r - p)[..., 1] - (q - p)[..., 1] * (r - p)[..., 0])
        sides = np.abs(np.stack([r - q, r - p]))[..., ::-1]
        asked = 4.0 * (sides * self.sag).sum(axis=-1).max(axis=0)
        return np.asarray((self.curve != NONE) & (self.hollow != -1) & (area < asked))


def no_rims(count: int) -> Rims:
    """Those of cells that have none."""
    return Rims(
        np.full((count, 3), NONE),
        np.zeros((count, 3, 2)),
        np.zeros((count, 3, 2)),
        np.zeros((count, 3), dtype=np.int64),
        np.zeros((count, 2)),
    )


def straight_rims(cells: BoundaryCells) -> Rims:
    """The chords of triangles whose boundary curves are lines along these chords."""
    number, border = cells.segments, cells.border
    found = no_rims(len(number))
    row, k = np.nonzero(number >= 0)
    found.curve[row, k], found.t[row, k] = border.curve[number[row, k]], border.t[number[row, k]]
    return found


def rims_of(face: Face, cells: BoundaryCells) -> Rims:
    """The chords of a face's triangles."""
    number, border = cells.segments, cells.border
    found = no_rims(len(number))
    rows, edges = np.nonzero(number >= 0)
    curves = border.curve[number[rows, edges]]
    for c, curve in enumerate(face.boundary):
        own = curves == c
        row, k = rows[own], edges[own]
        if not len(row):
            continue
        t = border.t[number[row, k]]
        found.curve[row, k], found.t[row, k] = c, t
        if curve.degree > 1:
            found.second[row, k], found.hollow[row, k] = chord_bounds(curve, t)
        apart = _displaced(face.surface, border.ends[number[row, k]], curve.evaluate(t.ravel()))
        np.maximum.at(found.beside, row, apart)
    return found


def _displaced(surface: NurbsSurface, ends: Array, true: Array) -> Array:
    """How far ends of chords (n, 2, 2) are from points (2 n, 2) of their curves, modulo periods: the larger, (n, 2).

    Ends may have been moved onto a line of the triangulation's grid.
    """
    apart = ends - true.reshape(ends.shape)
    for d in range(2):
        if surface.closed[d]:
            period = float(np.ptp(surface.domain[d]))
            apart[..., d] -= period * np.round(apart[..., d] / period)
    largest: Array = np.abs(apart).max(axis=1)
    return largest
