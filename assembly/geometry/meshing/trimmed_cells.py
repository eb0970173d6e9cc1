"""Triangles of a trimmed face in (u, v), and which of their edges are chords of its boundary curves."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError, positive
from assembly.geometry.faces.face import Face
from assembly.geometry.meshing.border import Border
from assembly.geometry.meshing.polygon import TrimmedMesh

__all__ = ["BoundaryCells", "TrimmedCells", "parallelogram_cells"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


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
    border = Border(face, np.arange(4), np.zeros(4, dtype=np.int64), t, ends)
    return BoundaryCells(corners[[[1, 3, 0], [3, 1, 2]]], np.array([[-1, 3, 0], [-1, 1, 2]]), border)


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
        border = self._mesh.rim
        n = len(found.parameters)
        used = np.zeros(n, dtype=bool)
        used[triangles] = True
        start, end = found.segments[: len(border.curve)].T
        rows = np.flatnonzero(used[start] & used[end] & (start != end) & (border.curve >= 0))
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
        return BoundaryCells(found.parameters[triangles], segments, border)

    def cut(self, segments: Indices) -> None:
        """Cut segments of the border in two."""
        self._mesh.rim = self._mesh.rim.split(segments)
