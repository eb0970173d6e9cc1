"""Faces as shapes of OCCT: trimmed faces, sewn to shells and solids.

Surfaces become B-splines, flat rectangles planes. Boundary curves keep their curves in (u, v); a plane's parameters are
made lengths before. In space a curve along a parameter is taken from the surface and a curve in a plane is mapped with
it, both exactly; any other is interpolated.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.faces.loop import Loop
from assembly.geometry.seams.region_cuts import cut_open
from assembly.geometry.seams.region_pieces import POLE, SEAM, Piece
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.curve_parts import sampled
from assembly.geometry.splines.surface import NurbsSurface
from assembly.step.occt import occt, parts
from assembly.step.profiles import approximated
from assembly.step.trims import crossings

__all__ = ["Sewn", "sewn"]

Array = NDArray[np.float64]
# Deviation of edges that are interpolated, over the size of the surface.
FOLLOWED = 1e-10
# Tolerances of edges and of sewing, the latter over the size of the body.
EDGE_TOLERANCE, SEWING = 1e-7, (1e-8, 1e-7, 1e-6, 1e-5, 1e-4)
# Rounding of the axes of planes, which are orthonormal.
ORTHONORMAL = 1e-13


def _points(rows: Array) -> Any:
    """An array of points in space or in the plane."""
    o = occt()
    kind, single = (o.Points, o.gp_Pnt) if rows.shape[1] == 3 else (o.Points2d, o.gp_Pnt2d)
    array = kind(1, len(rows))
    for k, row in enumerate(rows.tolist(), 1):
        array.SetValue(k, single(*row))
    return array


def _reals(row: Array) -> Any:
    array = occt().Reals(1, len(row))
    for k, value in enumerate(row.tolist(), 1):
        array.SetValue(k, value)
    return array


def _knots(row: Array) -> tuple[Any, Any]:
    """Distinct knots and how often they count."""
    distinct, times = np.unique(row, return_counts=True)
    counts = occt().Integers(1, distinct.size)
    for k, count in enumerate(times.tolist(), 1):
        counts.SetValue(k, count)
    return _reals(distinct), counts


def spline_curve(points: Array, weights: Array, knots: Array, degree: int) -> Any:
    """A B-spline curve of OCCT, in space or in the plane."""
    o = occt()
    kind = o.Geom_BSplineCurve if points.shape[1] == 3 else o.Geom2d_BSplineCurve
    if np.ptp(weights) == 0.0:
        return kind(_points(points), *_knots(knots), degree)
    return kind(_points(points), _reals(weights), *_knots(knots), degree)


def _plane_axes(surface: NurbsSurface) -> Array | None:
    """x and y, (2, 3), of a surface origin + u x + v y where they are orthogonal; None of any other surface."""
    if surface.degree != (1, 1) or surface.control_points.shape != (2, 2, 3) or np.ptp(surface.weights) > 0.0:
        return None
    net = surface.control_points
    sides = np.array([net[1, 0] - net[0, 0], net[0, 1] - net[0, 0]])
    twist = np.abs(net[1, 1] - net[1, 0] - net[0, 1] + net[0, 0]).max()
    lengths = np.linalg.norm(sides, axis=1)
    if twist > ORTHONORMAL * surface.size or abs(sides[0] @ sides[1]) > ORTHONORMAL * lengths.prod():
        return None
    return sides / np.ptp(surface.domain, axis=1)[:, None] if lengths.all() else None


def occt_surface(surface: NurbsSurface) -> Any:
    """The same surface, with the same parameters."""
    o = occt()
    net = surface.control_points
    xy = _plane_axes(surface)
    if xy is not None and np.abs(np.linalg.norm(xy, axis=1) - 1.0).max() <= ORTHONORMAL:
        (u0, _), (v0, _) = surface.domain
        origin, normal = net[0, 0] - u0 * xy[0] - v0 * xy[1], np.cross(*xy)
        axes = (o.gp_Pnt(*origin.tolist()), o.gp_Dir(*normal.tolist()), o.gp_Dir(*xy[0].tolist()))
        return o.Geom_Plane(o.gp_Ax3(*axes))
    for row, degree in zip(surface.knots, surface.degree, strict=True):
        if row[0] != row[degree] or row[-1] != row[-degree - 1]:
            surface = surface.elevate(surface.degree)
            break
    net = surface.control_points
    n, m, _ = net.shape
    poles, weights = o.PointNet(1, n, 1, m), o.RealNet(1, n, 1, m)
    for i in range(n):
        for j in range(m):
            poles.SetValue(i + 1, j + 1, o.gp_Pnt(*net[i, j].tolist()))
            weights.SetValue(i + 1, j + 1, float(surface.weights[i, j]))
    (ku, cu), (kv, cv) = _knots(surface.knots[0]), _knots(surface.knots[1])
    return o.Geom_BSplineSurface(poles, weights, ku, kv, cu, cv, *surface.degree)


class _FaceBuilder:
    """One face on its way to OCCT."""

    def __init__(self, face: Face) -> None:
        o = occt()
        self.face = face
        self.surface, self.chains = cut_open(face)
        self.build = o.BRep_Builder()
        self.geometry = occt_surface(self.surface)
        self.axes = _plane_axes(self.surface) if isinstance(self.geometry, o.Geom_Plane) else None
        self.made = o.TopoDS_Face()
        self.build.MakeFace(self.made, self.geometry, EDGE_TOLERANCE)
        self.corners: list[tuple[Array, Any]] = []

    def at(self, uv: Array) -> Array:
        """Points of the surface; parameters may be off the domain by rounding."""
        low, high = np.array(self.surface.domain).T
        uv = np.clip(uv, low, high)
        return self.surface.evaluate(uv[:, 0], uv[:, 1])

    def vertex(self, uv: Array) -> Any:
        """The vertex at a corner of the boundary, one for all that are one point."""
        o = occt()
        point = self.at(uv[None])[0]
        for other, vertex in self.corners:
            if np.abs(point - other).max() <= 0.1 * EDGE_TOLERANCE:
                return vertex
        vertex = o.TopoDS_Vertex()
        self.build.MakeVertex(vertex, o.gp_Pnt(*point.tolist()), EDGE_TOLERANCE)
        self.corners.append((point, vertex))
        return vertex

    def _line(self, curve: NurbsCurve) -> tuple[Any, Any, float, float, bool] | None:
        """Curve in (u, v), curve in space, range, and whether it runs backwards, of a line along a parameter."""
        o = occt()
        ends = curve.control_points
        if len(ends) > 2:
            return None
        for axis in (0, 1):
            if ends[0, axis] != ends[1, axis]:
                continue
            first, last = ends[:, 1 - axis]
            along = o.gp_Dir2d(*np.eye(2)[1 - axis].tolist())
            start = np.zeros(2)
            start[axis] = ends[0, axis]
            flat = o.Geom2d_Line(o.gp_Pnt2d(*start.tolist()), along)
            space = (self.geometry.UIso, self.geometry.VIso)[axis](float(ends[0, axis]))
            return flat, space, float(min(first, last)), float(max(first, last)), bool(first > last)
        return None

    def _curve(self, curve: NurbsCurve) -> tuple[Any, Any, float, float, bool]:
        flat = spline_curve(curve.control_points, curve.weights, curve.knots, curve.degree)
        low, high = curve.domain
        if self.axes is not None:
            (u0, _), (v0, _) = self.surface.domain
            points = self.surface.control_points[0, 0] + (curve.control_points - [u0, v0]) @ self.axes
            return flat, spline_curve(points, curve.weights, curve.knots, curve.degree), low, high, False
        breaks = [curve.breaks()]
        at = sampled(breaks[0], 17)
        values = curve.evaluate(at)
        for axis, knots in enumerate(self.surface.breaks()):
            breaks.append(
                np.array(crossings(values[:, axis], at, lambda t, axis=axis: float(curve.evaluate(t)[axis]), knots))
            )
        joints = np.unique(np.clip(np.concatenate(breaks), low, high))
        joints = np.append(joints[:-1][np.diff(joints) > 1e-9 * (high - low)], high)
        space, _ = approximated(lambda t: self.at(curve.evaluate(t)), joints, FOLLOWED * self.surface.size)
        points, weights = space.cartesian
        return flat, spline_curve(points, weights, space.knots, space.degree), low, high, False

    def edge(self, piece: Piece, partner: Piece | None) -> tuple[Any, bool]:
        """The edge of a piece, and whether the piece runs against it; of a seam, of both its pieces."""
        o = occt()
        ends = piece.ends
        made = self._line(piece.curve) or self._curve(piece.curve)
        flat, space, low, high, backwards = made
        edge = o.TopoDS_Edge()
        if piece.kind == POLE:
            self.build.MakeEdge(edge)
            self.build.UpdateEdge(edge, flat, self.made, EDGE_TOLERANCE)
            self.build.Degenerated(edge, True)
        else:
            self.build.MakeEdge(edge, space, EDGE_TOLERANCE)
            if partner is None:
                self.build.UpdateEdge(edge, flat, self.made, EDGE_TOLERANCE)
            else:
                other = self._line(partner.curve)
                assert other is not None and other[4] != backwards, "the two sides of a seam run against each other"
                pair = (other[0], flat) if backwards else (flat, other[0])
                self.build.UpdateEdge(edge, *pair, self.made, EDGE_TOLERANCE)
        self.build.Range(edge, low, high)
        first, last = (ends[1], ends[0]) if backwards else (ends[0], ends[1])
        self.build.Add(edge, self.vertex(first).Oriented(o.TopAbs_FORWARD))
        self.build.Add(edge, self.vertex(last).Oriented(o.TopAbs_REVERSED))
        return edge, backwards

    def result(self) -> Any:
        """The face."""
        o = occt()
        seams: list[tuple[Piece, Any, bool]] = []
        for chain in self.chains:
            wire = o.TopoDS_Wire()
            self.build.MakeWire(wire)
            for piece in chain:
                if piece.kind == SEAM:
                    known = next(((edge, back) for other, edge, back in seams if other is piece), None)
                    if known is None:
                        partner = self._partner(piece)
                        edge, back = self.edge(piece, partner)
                        seams.append((partner, edge, not back))
                    else:
                        edge, back = known
                else:
                    edge, back = self.edge(piece, None)
                self.build.Add(wire, edge.Oriented(o.TopAbs_REVERSED if back else o.TopAbs_FORWARD))
            wire.Closed(True)
            self.build.Add(self.made, wire)
        return self.made.Oriented(o.TopAbs_REVERSED if self.face.reversed else o.TopAbs_FORWARD)

    def _partner(self, piece: Piece) -> Piece:
        """The piece on the other side of the domain that goes back along the same stretch of a seam."""
        a, b = piece.ends
        axis = int(a[0] != b[0])
        found = [
            (float(np.abs(other.ends[::-1, 1 - axis] - piece.ends[:, 1 - axis]).max()), id(other), other)
            for chain in self.chains
            for other in chain
            if other.kind == SEAM and other is not piece and other.ends[0, axis] == other.ends[1, axis] != a[axis]
        ]
        return min(found)[2]


class Sewn:
    """A body as a shape of OCCT, and what became of its faces."""

    def __init__(self, shape: Any, faces: list[Any], closed: bool) -> None:
        self.shape, self.faces, self.closed = shape, faces, closed


def sewn(faces: Sequence[Face], scale: float) -> Sewn:
    """Faces sewn together: a solid where they close, else a shell or several.

    Parameters
    ----------
    faces
        Of one body.
    scale : float
        Millimeters in our unit of length.
    """
    o = occt()
    made = [_FaceBuilder(_in_millimeters(face, scale)).result() for face in faces]
    size = scale * max(face.surface.size for face in faces)
    for part in SEWING:
        sewing = o.BRepBuilderAPI_Sewing(max(part * size, EDGE_TOLERANCE))
        for face in made:
            sewing.Add(face)
        sewing.Perform()
        if sewing.NbFreeEdges() == 0:
            break
    shape = sewing.SewedShape()
    closed = sewing.NbFreeEdges() == 0
    # A face alone is a shell, too: a body's name and color are then not those of its face.
    bare = parts(shape, o.TopAbs_FACE, o.TopAbs_SHELL)
    shells = parts(shape, o.TopAbs_SHELL) + [_shell_of(face, closed) for face in bare]
    if closed:
        solid = o.BRepBuilderAPI_MakeSolid()
        for shell in shells:
            solid.Add(o.as_shell(shell))
        shape = solid.Solid()
        # With the outside where the faces say, which a sewing may have turned as a whole.
        o.BRepLib.OrientClosedSolid_s(shape)
    elif len(shells) == 1:
        shape = shells[0]
    else:
        build, shape = o.BRep_Builder(), o.TopoDS_Compound()
        build.MakeCompound(shape)
        for shell in shells:
            build.Add(shape, shell)
    images = [sewing.Modified(face) if sewing.IsModified(face) else face for face in made]
    return Sewn(shape, images, closed)


def _shell_of(face: Any, closed: bool) -> Any:
    """A shell of one face."""
    o = occt()
    build, shell = o.BRep_Builder(), o.TopoDS_Shell()
    build.MakeShell(shell)
    build.Add(shell, face)
    shell.Closed(closed)
    return shell


def _in_millimeters(face: Face, scale: float) -> Face:
    """The face in millimeters, with the same parameters, but that those of a plane become lengths, as OCCT's are."""
    surface = face.surface if scale == 1.0 else face.surface.transformed(scale=scale)
    axes = _plane_axes(surface)
    factors = np.ones(2) if axes is None else np.linalg.norm(axes, axis=1)
    if np.abs(factors - 1.0).max() > ORTHONORMAL:
        knots = [factor * row for factor, row in zip(factors, surface.knots, strict=True)]
        surface = NurbsSurface(surface.control_points, knots, surface.degree, surface.weights)
        outer = None if face.outer is None else _stretched(face.outer, factors)
        holes = [_stretched(hole, factors) for hole in face.holes]
        return Face(surface, outer, holes, name=face.name, reversed=face.reversed)
    if surface is face.surface:
        return face
    return Face(surface, face.outer, face.holes, name=face.name, reversed=face.reversed)


def _stretched(loop: Loop, factors: Array) -> list[NurbsCurve]:
    """The curves of a loop, their u and v multiplied."""
    return [
        NurbsCurve(curve.control_points * factors, curve.knots, curve.degree, curve.weights, name=curve.name)
        for curve in loop.curves
    ]
