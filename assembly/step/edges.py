"""Edges of a solid: their numbers, what each forgives, and the faces that meet at them.

What is asked of OCCT is asked once an edge, and of faces on other sides only for edges that are loose.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from assembly.errors import InputError
from assembly.step.occt import occt, parts
from assembly.step.profiles import Unreadable, point
from assembly.step.projected import Side, is_loose
from assembly.step.surfaces import Patch, patch
from assembly.step.wires import Traced

__all__ = ["Edges", "Known"]

# What a file may forgive at most, over the size of the part: a tolerance of a meter makes no faces meet.
_FORGIVEN = 1e-2


class Known(NamedTuple):
    """What is known of an edge whichever face it is on.

    Attributes
    ----------
    name : str
        By its number.
    tolerance : float
        The largest of it and its vertices [mm].
    loose : bool
        Whether it has a tolerance of its own.
    """

    name: str
    tolerance: float
    loose: bool


class Edges:
    """The edges of a solid, by their numbers from 1, and the two faces that meet at each."""

    def __init__(self, shape: Any) -> None:
        o = occt()
        self.shape = shape
        self._map = o.ShapeMap()
        o.TopExp.MapShapes_s(shape, o.TopAbs_EDGE, self._map)
        self._known: dict[int, Known] = {}
        self._patches: dict[int, Patch | None] = {}

    def known(self, edge: Any) -> Known:
        """What is known of an edge."""
        number = self._map.FindIndex(edge)
        known = self._known.get(number)
        if known is None:
            o = occt()
            tolerance = o.BRep_Tool.Tolerance_s(edge)
            for vertex in (o.TopExp.FirstVertex_s(edge), o.TopExp.LastVertex_s(edge)):
                if not vertex.IsNull():
                    tolerance = max(tolerance, o.BRep_Tool.Tolerance_s(vertex))
            known = Known(f"edge {number}", tolerance, is_loose(edge))
            # What is not of the solid has no number.
            if number:
                self._known[number] = known
        return known

    def forgiven(self, tolerance: float, size: float) -> float:
        """A tolerance on a face of a size: at most a share of that or of the part's, whichever is larger."""
        if tolerance <= _FORGIVEN * size:
            return tolerance
        return min(tolerance, _FORGIVEN * max(size, self._size))

    @cached_property
    def _size(self) -> float:
        """Diagonal of the box around the vertices; zero where there are none."""
        o = occt()
        points = [point(o.BRep_Tool.Pnt_s(o.as_vertex(one))) for one in parts(self.shape, o.TopAbs_VERTEX)]
        return float(np.linalg.norm(np.ptp(np.array(points), axis=0))) if points else 0.0

    @cached_property
    def _faces(self) -> dict[int, list[tuple[int, Any]]]:
        """The faces of each edge with their numbers, made forward."""
        o = occt()
        found: dict[int, list[tuple[int, Any]]] = {}
        for k, face in enumerate(parts(self.shape, o.TopAbs_FACE)):
            forward = o.as_face(face.Oriented(o.TopAbs_FORWARD))
            for edge in parts(forward, o.TopAbs_EDGE):
                found.setdefault(self._map.FindIndex(edge), []).append((k, forward))
        return found

    def beyond(self, traced: Traced, face: Any) -> Side | None:
        """The surface, with the edge's curve on it, of the face on the other side of an edge; None if not just one."""
        o = occt()
        around = self._faces.get(self._map.FindIndex(traced.edge), [])
        others = [(k, one) for k, one in around if not one.IsSame(face)]
        if len(around) != 2 or len(others) != 1:
            return None
        ((k, other),) = others
        low, high = o.BRep_Tool.Range_s(traced.edge, other)
        flat = o.BRep_Tool.CurveOnSurface_s(traced.edge, other, low, high)
        if flat is None or not np.allclose((traced.low, traced.high), (low, high), rtol=1e-9, atol=0.0):
            return None
        if k not in self._patches:
            try:
                self._patches[k] = patch(o.BRep_Tool.Surface_s(other), o.BRepTools.UVBounds_s(other))
            except (Unreadable, InputError):
                self._patches[k] = None
        there = self._patches[k]
        return None if there is None else Side(flat, there, low, high)
