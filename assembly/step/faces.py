"""Faces of OCCT as trimmed NURBS faces."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError
from assembly.geometry.faces.boundary import OVERSHOOT
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface
from assembly.step.occt import occt, parts
from assembly.step.profiles import Unreadable, point
from assembly.step.projected import Side
from assembly.step.surfaces import Patch, patch
from assembly.step.trims import Edge, chained, edge_curve, head_to_tail

__all__ = ["Edges", "Read", "read_face"]

Array = NDArray[np.float64]
# OCCT stands for "unbounded" with numbers beyond this one.
_FAR = 1e50
# What a file may forgive at most, over the size of the part: a tolerance of a meter makes no faces meet.
_FORGIVEN = 1e-2


@dataclass(frozen=True)
class Read:
    """A face, and what was not exact about it [mm]: of its surface, and of the ends of its edges."""

    face: Face
    deviation: float
    gap: float


def _is_boundary(edge: Any) -> bool:
    o = occt()
    return edge.Orientation() in (o.TopAbs_FORWARD, o.TopAbs_REVERSED)


def _edges(wire: Any, face: Any) -> tuple[list[Any], bool]:
    """Edges of a wire, and whether each begins where the one before ends."""
    o = occt()
    walk = o.BRepTools_WireExplorer(wire, face)
    found = []
    while walk.More():
        found.append(o.as_edge(walk.Current()))
        walk.Next()
    every = [o.as_edge(edge) for edge in parts(wire, o.TopAbs_EDGE) if _is_boundary(edge)]
    # Where vertices are not shared the walk ends early.
    return (found, True) if len(found) == len(every) else (every, False)


def _is_seam(edge: Any, face: Any) -> bool:
    return bool(occt().BRep_Tool.IsClosed_s(edge, face))


class Edges:
    """The edges of a solid, by their numbers from 1, and the two faces that meet at each."""

    def __init__(self, shape: Any) -> None:
        o = occt()
        self.shape = shape
        self._map = o.ShapeMap()
        o.TopExp.MapShapes_s(shape, o.TopAbs_EDGE, self._map)
        self._patches: dict[int, Patch | None] = {}

    def index(self, edge: Any) -> int:
        """The number of an edge."""
        return int(self._map.FindIndex(edge))

    @cached_property
    def _faces(self) -> dict[int, list[Any]]:
        """The faces of each edge, made forward."""
        o = occt()
        found: dict[int, list[Any]] = {}
        for face in parts(self.shape, o.TopAbs_FACE):
            forward = o.as_face(face.Oriented(o.TopAbs_FORWARD))
            for edge in parts(forward, o.TopAbs_EDGE):
                found.setdefault(self.index(edge), []).append(forward)
        return found

    def bounded(self, edge: Edge, where: Patch) -> Edge:
        """An edge of a face, its tolerance at most a share of the size of the part or the face, whichever is larger."""
        if edge.tolerance <= _FORGIVEN * where.surface.size:
            return edge
        return replace(edge, tolerance=min(edge.tolerance, _FORGIVEN * max(where.surface.size, self._size)))

    @cached_property
    def _size(self) -> float:
        """Diagonal of the box around the vertices; zero where there are none."""
        o = occt()
        points = [point(o.BRep_Tool.Pnt_s(o.as_vertex(one))) for one in parts(self.shape, o.TopAbs_VERTEX)]
        return float(np.linalg.norm(np.ptp(np.array(points), axis=0))) if points else 0.0

    def beyond(self, edge: Any, face: Any) -> Side | None:
        """The surface, with the edge's curve on it, of the face on the other side of an edge; None if not just one."""
        o = occt()
        around = self._faces[self.index(edge)]
        others = [one for one in around if not one.IsSame(face)]
        if len(around) != 2 or len(others) != 1:
            return None
        low, high = o.BRep_Tool.Range_s(edge, others[0])
        flat = o.BRep_Tool.CurveOnSurface_s(edge, others[0], low, high)
        if flat is None or not np.allclose(o.BRep_Tool.Range_s(edge, face), (low, high), rtol=1e-9, atol=0.0):
            return None
        key = hash(others[0])
        if key not in self._patches:
            try:
                self._patches[key] = patch(o.BRep_Tool.Surface_s(others[0]), o.BRepTools.UVBounds_s(others[0]))
            except (Unreadable, InputError):
                self._patches[key] = None
        there = self._patches[key]
        return None if there is None else Side(flat, there)


def _loop(wire: Any, face: Any, where: Patch, edges: Edges) -> tuple[list[Edge], float] | None:
    """The boundary curves of a wire; None where nothing is left of it but seams and poles."""
    o = occt()
    row, ordered = _edges(wire, face)
    seams = [edge for edge in row if _is_seam(edge, face)]
    bare = all(o.BRep_Tool.Degenerated_s(edge) or _is_seam(edge, face) for edge in row)
    if not row or (bare and len(seams) % 2 == 0):
        return None
    curves = [edge_curve(edge, face, where, f"edge {edges.index(edge)}", edges.beyond) for edge in row]
    curves = [edges.bounded(edge, where) for edge in curves]
    return chained(curves if ordered else head_to_tail(curves, where), where)


def _scaled(where: Patch, scale: float) -> tuple[NurbsSurface, Array]:
    """The surface in another unit, and the factors of u and v that go with it."""
    factors = np.array([scale if along.is_length else 1.0 for along in (where.u, where.v)])
    surface = where.surface
    if scale == 1.0:
        return surface, factors
    knots = [factor * row for factor, row in zip(factors, surface.knots, strict=True)]
    return NurbsSurface(scale * surface.control_points, knots, surface.degree, surface.weights), factors


def read_face(face: Any, edges: Edges, name: str | None, scale: float = 1.0) -> Read:
    """A face of OCCT, its surface and its loops.

    Parameters
    ----------
    face
        TopoDS_Face.
    edges
        Those of the solid, with their numbers.
    name : str, optional
    scale : float
        Our unit of length in a millimeter.

    Raises
    ------
    Unreadable
        Saying why.
    """
    o = occt()
    forward = o.as_face(face.Oriented(o.TopAbs_FORWARD))
    surface = o.BRep_Tool.Surface_s(forward)
    if surface is None:
        raise Unreadable("it has no surface")
    box = o.BRepTools.UVBounds_s(forward)
    if not all(isfinite(x) and abs(x) < _FAR for x in box):
        raise Unreadable("it has no boundary, and its surface no end")
    try:
        where = patch(surface, box)
        made_surface, factors = _scaled(where, scale)
        outermost = o.BRepTools.OuterWire_s(forward)
        outer: list[NurbsCurve] | None = None
        holes: list[list[NurbsCurve]] = []
        gap, deviation = 0.0, where.deviation
        # What the file says of its edges and vertices, and at least what faces forgive by themselves.
        tolerance = OVERSHOOT * made_surface.size
        for wire in parts(forward, o.TopAbs_WIRE):
            made = _loop(o.as_wire(wire), forward, where, edges)
            if made is None:
                continue
            gap = max(gap, made[1])
            deviation = max(deviation, max(edge.deviation for edge in made[0]))
            tolerance = max(tolerance, scale * max(edge.tolerance for edge in made[0]))
            loop = [edge.nurbs(factors) for edge in made[0]]
            if wire.IsSame(outermost):
                outer = loop
            else:
                holes.append(loop)
        reverse = face.Orientation() == o.TopAbs_REVERSED
        made_face = Face(made_surface, outer, holes, name=name, reversed=reverse, tolerance=tolerance)
        if outer is None and not holes:
            # The edge of a surface that is damaged may bound no face, which is otherwise found when it is asked for.
            made_face.boundary  # noqa: B018
        return Read(made_face, deviation, gap)
    except InputError as error:
        raise Unreadable(str(error)) from error
