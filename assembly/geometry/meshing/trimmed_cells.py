"""Triangles of a trimmed face in (u, v), and which of their edges are chords of its boundary curves."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError, positive
from assembly.geometry.faces.face import Face
from assembly.geometry.meshing.border import Border, border
from assembly.geometry.meshing.polygon import TrimmedMesh

__all__ = ["BoundaryCells", "TrimmedCells", "parallelogram_cells", "tube_cells"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
# How far apart parameters of corners may be that count as the same, in parts of a period.
_SAME = 1e-12


@dataclass(frozen=True, eq=False)
class BoundaryCells:
    """Triangles of a trimmed face in (u, v), and which of their edges are chords of its boundary.

    Attributes
    ----------
    parameters : (m, 3, 2)
        Of the corners; beyond the domain of a closed direction where the face goes over a seam.
    segments : (m, 3)
        The segment of the border that an edge (corner k to k + 1) is, or -1.
    border : Border
    """

    parameters: Array
    segments: Indices
    border: Border


def parallelogram_cells(face: Face) -> BoundaryCells | None:
    """The two triangles of a face that is all of a parallelogram, as `TrimmedCells` makes them, or None."""
    if not face.surface.is_parallelogram or face.outer is not None or face.holes or len(face.boundary) != 4:
        return None
    (u0, u1), (v0, v1) = face.surface.domain
    corners = np.array([[u0, v0], [u1, v0], [u1, v1], [u0, v1]])
    t = np.array([curve.domain for curve in face.boundary])
    ends = np.stack([corners, corners[[1, 2, 3, 0]]], axis=1)
    rim = Border(face, np.arange(4), np.zeros(4, dtype=np.int64), t, ends)
    return BoundaryCells(corners[[[1, 3, 0], [3, 1, 2]]], np.array([[-1, 3, 0], [-1, 1, 2]]), rim)


def tube_cells(face: Face, tolerance: float, angle: float) -> BoundaryCells | None:
    """The triangles of a whole surface that is closed in one direction and straight in the other, or None.

    They stand between corners of the two boundary curves at the same parameters, as `TrimmedCells` makes them.
    """
    surface = face.surface
    if surface.closed[0] == surface.closed[1] or surface._pole_bits or face.outer is not None or face.holes:
        return None
    around = 0 if surface.closed[0] else 1
    rim = border(face, positive("tolerance", tolerance), min(positive("angle", angle), 0.25 * pi))
    low, high = surface.domain[1 - around]
    at_low, at_high = (np.flatnonzero((rim.ends[..., 1 - around] == end).all(axis=1)) for end in (low, high))
    # In the order of the parameter around, whichever way they lead.
    begins = rim.ends[..., around].min(axis=1)
    at_low, at_high = at_low[np.argsort(begins[at_low])], at_high[np.argsort(begins[at_high])]
    if len(at_low) + len(at_high) != len(rim.curve) or len(at_low) != len(at_high):
        return None
    at = np.append(begins[at_low], surface.domain[around][1])
    others = np.append(begins[at_high], at[-1])
    if np.abs(at - others).max() > _SAME * np.ptp(surface.domain[around]) or not (np.diff(at) > 0.0).all():
        return None
    corner = np.empty((2, len(at), 2))  # low and high
    corner[0, :, around], corner[1, :, around] = at, others
    corner[0, :, 1 - around], corner[1, :, 1 - around] = low, high
    start, end = corner[:, :-1], corner[:, 1:]
    # The diagonals lead from low u and high v to high u and low v, and so they do in parameters that are exchanged.
    first, second = np.stack([end[0], start[1], start[0]], axis=1), np.stack([start[1], end[0], end[1]], axis=1)
    none = np.full(len(at_low), -1)
    triangles = np.concatenate([first, second])
    segments = np.concatenate([np.column_stack([none, none, rows]) for rows in (at_low, at_high)])
    if around == 1:
        # Counterclockwise again.
        triangles, segments = triangles[:, [0, 2, 1]], segments[:, [2, 1, 0]]
    return BoundaryCells(triangles, segments, rim)


class TrimmedCells:
    """Triangles of a face that has a boundary, whose chords of it can be cut.

    Parameters
    ----------
    face : Face
    tolerance, angle : float
        See `facets`.
    """

    def __init__(self, face: Face, tolerance: float, angle: float) -> None:
        self._mesh = TrimmedMesh(face, positive("tolerance", tolerance), min(positive("angle", angle), 0.25 * pi))

    def made(self) -> BoundaryCells:
        """The triangles and their chords.

        At a pole there are some with two corners in it: they are beside others in (u, v), and what is over them is
        over no other.

        Raises
        ------
        InputError
            Chords of the boundary that are edges of no triangle: loops that cross or touch each other.
        """
        found, _, triangles = self._mesh.mesh()
        rim = self._mesh.rim
        n = len(found.parameters)
        used = np.zeros(n, dtype=bool)
        used[triangles] = True
        start, end = found.segments[: len(rim.curve)].T
        rows = np.flatnonzero(used[start] & used[end] & (start != end) & (rim.curve >= 0))
        keys = start[rows] * n + end[rows]
        order = np.argsort(keys, kind="stable")
        keys, rows = keys[order], rows[order]
        edges = triangles * n + np.roll(triangles, -1, axis=1)
        segments = np.full((len(triangles), 3), -1)
        if len(keys):
            # Of segments between the same corners the last.
            place = np.maximum(np.searchsorted(keys, edges, side="right") - 1, 0)
            segments = np.where(keys[place] == edges, rows[place], -1)
        missing = len(np.unique(keys)) - np.count_nonzero(segments >= 0)
        if missing:
            chords = f"{missing} chords of the boundary of {self._mesh.face!r}"
            raise InputError(f"{chords} are edges of no facet; expected loops apart")
        return BoundaryCells(found.parameters[triangles], segments, rim)

    def cut(self, segments: Indices) -> None:
        """Cut segments of the border in two."""
        self._mesh.rim = self._mesh.rim.split(segments)
