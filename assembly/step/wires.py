"""Wires of a face of OCCT: their edges in order, the curves these have in (u, v), and where in (u, v) they are.

OCCT finds the extent of a face in (u, v) anew for each of its wires and once more for all, from curves that are asked
for again. Of wires of straight lines it is that of their ends.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from assembly.step.occt import occt, parts

if TYPE_CHECKING:
    from assembly.step.edges import Known

__all__ = ["Box", "Pair", "Traced", "Wire", "bounds", "outermost", "wires_of"]

Pair = tuple[float, float]
# u_min, u_max, v_min, v_max.
Box = tuple[float, float, float, float]


class Traced(NamedTuple):
    """An edge on a face.

    Attributes
    ----------
    edge
        TopoDS_Edge.
    curve
        Geom2d_Curve, or None where it has none on the face.
    low, high : float
        The interval of that.
    line : (start, end), optional
        Its ends, where it is a straight line.
    seam : bool
        Whether the face has the edge on both sides.
    """

    edge: Any
    curve: Any
    low: float
    high: float
    line: tuple[Pair, Pair] | None
    seam: bool


@dataclass(eq=False)
class Wire:
    """A wire on a face, which is taken forward.

    Attributes
    ----------
    wire, face
        TopoDS_Wire, TopoDS_Face.
    edges : list of Traced
        Those that bound the face.
    ordered : bool
        Whether each begins where the one before ends.
    whole : bool
        Whether the wire has no others.
    is_outer : bool, optional
        Whether it is around the face, where that is known.
    known : list of edges.Known
        What is known of its edges, once that was asked.
    """

    wire: Any
    face: Any
    edges: list[Traced]
    ordered: bool
    whole: bool
    is_outer: bool | None = None
    known: list[Known] = field(default_factory=list)

    @cached_property
    def box(self) -> Box:
        """Its extent."""
        ends = [end for traced in self.edges if traced.line is not None for end in traced.line]
        if not self.whole or not ends or len(ends) < 2 * len(self.edges):
            box: Box = occt().BRepTools.UVBounds_s(self.face, self.wire)
            return box
        us, vs = zip(*ends, strict=True)
        return min(us), max(us), min(vs), max(vs)

    @property
    def is_bare(self) -> bool:
        """Whether nothing is left of it but seams and poles."""
        degenerated = occt().BRep_Tool.Degenerated_s
        return sum(traced.seam for traced in self.edges) % 2 == 0 and all(
            traced.seam or degenerated(traced.edge) for traced in self.edges
        )


def wires_of(face: Any, surface: Any = None) -> list[Wire]:
    """The wires of a face, which is taken forward, and its surface where it is known."""
    o = occt()
    # A plane has no seams.
    closes = type(surface or o.BRep_Tool.Surface_s(face)) is not o.Geom_Plane
    return [_wire(o.as_wire(wire), face, closes) for wire in parts(face, o.TopAbs_WIRE)]


def _wire(wire: Any, face: Any, closes: bool) -> Wire:
    o = occt()
    walk = o.BRepTools_WireExplorer(wire, face)
    found = []
    while walk.More():
        found.append(walk.Current())
        walk.Next()
    if len(found) == wire.NbChildren():
        return Wire(wire, face, _traced(found, face, closes), ordered=True, whole=True)
    sides = (o.TopAbs_FORWARD, o.TopAbs_REVERSED)
    every = [o.as_edge(edge) for edge in parts(wire, o.TopAbs_EDGE) if edge.Orientation() in sides]
    # Where vertices are not shared the walk ends early.
    ordered = len(found) == len(every)
    return Wire(wire, face, _traced(found if ordered else every, face, closes), ordered, whole=False)


def _traced(edges: list[Any], face: Any, closes: bool) -> list[Traced]:
    o = occt()
    tool, straight = o.BRep_Tool, o.Geom2d_Line
    interval, drawn, is_closed = tool.Range_s, tool.CurveOnSurface_s, tool.IsClosed_s
    found = []
    for edge in edges:
        low, high = interval(edge, face)
        curve = drawn(edge, face, low, high)
        line = None
        if type(curve) is straight:
            (x, y), (dx, dy) = curve.Location().Coord(), curve.Direction().Coord()
            line = (x + low * dx, y + low * dy), (x + high * dx, y + high * dy)
        found.append(Traced(edge, curve, low, high, line, closes and is_closed(edge, face)))
    return found


def bounds(wires: list[Wire], surface: Any, face: Any) -> Box:
    """The extent of a face with these wires on a surface."""
    o = occt()
    # OCCT keeps to the ends of other surfaces.
    endless = isinstance(surface, (o.Geom_Plane, o.Geom_CylindricalSurface, o.Geom_ConicalSurface))
    drawn = all(wire.edges and all(traced.curve is not None for traced in wire.edges) for wire in wires)
    if not (wires and endless and drawn):
        box: Box = o.BRepTools.UVBounds_s(face)
        return box
    lows_u, highs_u, lows_v, highs_v = zip(*(wire.box for wire in wires), strict=True)
    return min(lows_u), max(highs_u), min(lows_v), max(highs_v)


def outermost(wires: list[Wire], surface: Any, face: Any) -> int:
    """Which of the wires is around the others: as OCCT has it, the last one with the box of the one before in its own.

    None of one or no wire: 0. Where it is known that none is: -1.
    """
    o = occt()
    if any(wire.is_outer is not None for wire in wires):
        return next((k for k, wire in enumerate(wires) if wire.is_outer), -1)
    if len(wires) < 2:
        return 0
    if not isinstance(surface, (o.Geom_Plane, o.Geom_CylindricalSurface, o.Geom_ConicalSurface)):
        found = o.BRepTools.OuterWire_s(face)
        return next((k for k, wire in enumerate(wires) if wire.wire.IsSame(found)), -1)
    best = 0
    for k, wire in enumerate(wires):
        (a, b, c, d), (p, q, r, s) = wire.box, wires[best].box
        if a <= p and b >= q and c <= r and d >= s:
            best = k
    return best
