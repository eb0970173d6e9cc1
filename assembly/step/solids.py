"""Faces as shapes of OCCT: trimmed faces, sewn to shells and solids.

Surfaces are written as what they are (`carriers`). A curve along a parameter is taken from the surface, and lines and
circles in planes are lines and circles, exactly; other curves in a plane, and curves on surfaces with our parameters,
keep their control points; any other is interpolated.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.curves import Circle, Line, curve_form
from assembly.geometry.recognition.nets import exactness
from assembly.geometry.seams.region_cuts import cut_in_two, cut_open
from assembly.geometry.seams.region_pieces import EDGE, POLE, SEAM, Piece, begun_at_pole
from assembly.geometry.seams.region_strips import area_of, corners_of, strip, winds
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.curve_parts import sampled
from assembly.geometry.splines.surface import NurbsSurface
from assembly.step.carriers import carrier_of, spline_curve
from assembly.step.crossings import crossings
from assembly.step.occt import occt, parts
from assembly.step.profiles import approximated
from assembly.step.turned_spheres import region_of

__all__ = ["Sewn", "sewn"]

Array = NDArray[np.float64]
# Deviation of edges that are interpolated, over the size of the surface.
FOLLOWED = 1e-10
# Tolerances of edges and of sewing, the latter over the size of the body.
EDGE_TOLERANCE, SEWING = 1e-7, (1e-8, 1e-7, 1e-6, 1e-5, 1e-4)
# Splines that go on over more than so many turns are cut.
ONCE = 1.0 + 1e-6


class _FaceBuilder:
    """One face on its way to OCCT."""

    def __init__(self, face: Face, surface: NurbsSurface, chains: list[list[Piece]]) -> None:
        o = occt()
        self.face = face
        self.surface = surface
        self.build = o.BRep_Builder()
        self.carrier = carrier_of(self.surface)
        self.chains = chains if self.carrier.plane is None else self._of_plane(chains)
        self.geometry = self.carrier.geometry
        self.made = o.TopoDS_Face()
        self.build.MakeFace(self.made, self.geometry, EDGE_TOLERANCE)
        self.corners: list[tuple[Array, Any]] = []

    def at(self, uv: Array) -> Array:
        """Points of the surface; parameters may be off the domain by rounding."""
        low, high = np.array(self.surface.domain).T
        uv = np.clip(uv, low, high)
        return self.surface.evaluate(uv[:, 0], uv[:, 1])

    def _of_plane(self, chains: list[list[Piece]]) -> list[list[Piece]]:
        """The same without seams and poles, which a disc about its center has in (u, v), and OCCT's plane has not."""
        left = [piece for chain in chains for piece in chain if piece.kind not in (SEAM, POLE)]
        if len(left) == sum(map(len, chains)):
            return chains
        begin, end = (self.at(np.array([piece.ends[k] for piece in left])) for k in (0, 1))
        unused, joined = list(range(len(left))), []
        while unused:
            chain = [unused.pop(0)]
            while unused:
                gaps = np.linalg.norm(begin[unused] - end[chain[-1]], axis=1)
                # Back at the start: no other piece begins nearer.
                if np.linalg.norm(begin[chain[0]] - end[chain[-1]]) <= gaps.min():
                    break
                chain.append(unused.pop(int(np.argmin(gaps))))
            joined.append([left[k] for k in chain])
        return joined

    @cached_property
    def is_affine(self) -> bool:
        """Whether points of a plane are linear in our parameters."""
        surface = self.surface
        if surface.degree != (1, 1) or surface.control_points.shape != (2, 2, 3) or np.ptp(surface.weights) > 0.0:
            return False
        net = surface.control_points
        twist = float(np.abs(net[1, 1] - net[1, 0] - net[0, 1] + net[0, 0]).max())
        return twist <= exactness(surface.size, float(np.abs(net).max()))

    def extended(self, uv: Array) -> Array:
        """Points of an affine plane at any parameters."""
        net = self.surface.control_points
        (u0, u1), (v0, v1) = self.surface.domain
        sides = np.array([(net[1, 0] - net[0, 0]) / (u1 - u0), (net[0, 1] - net[0, 0]) / (v1 - v0)])
        points: Array = net[0, 0] + (uv - [u0, v0]) @ sides
        return points

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
        if len(ends) > 2 or self.carrier.plane is not None:
            return None
        for axis in (0, 1):
            if ends[0, axis] != ends[1, axis]:
                continue
            there = self.carrier.at(ends)
            across = 1 - axis if self.carrier.swapped else axis
            there[:, across] = there[0, across]
            first, last = there[:, 1 - across]
            along = o.gp_Dir2d(*np.eye(2)[1 - across].tolist())
            start = np.zeros(2)
            start[across] = there[0, across]
            flat = o.Geom2d_Line(o.gp_Pnt2d(*start.tolist()), along)
            space = (self.geometry.UIso, self.geometry.VIso)[across](float(there[0, across]))
            return flat, space, float(min(first, last)), float(max(first, last)), bool(first > last)
        return None

    def _curve(self, curve: NurbsCurve) -> tuple[Any, Any, float, float, bool]:
        if self.carrier.plane is not None:
            return self._in_plane(curve, self.carrier.plane)
        low, high = curve.domain
        joints = self._joints(curve)
        space, _ = approximated(lambda t: self.at(curve.evaluate(t)), joints, FOLLOWED * self.surface.size)
        points, weights = space.cartesian
        if self.carrier.is_own:
            flat = spline_curve(curve.control_points, curve.weights, curve.knots, curve.degree)
        else:
            # Each parameter in parts of its own extent: one may be an angle, the other thousands of millimeters.
            extent = np.ptp(self.carrier.at(np.array(self.surface.domain).T), axis=0)
            mapped, _ = approximated(lambda t: self.carrier.at(curve.evaluate(t)) / extent, joints, FOLLOWED)
            points_flat, weights_flat = mapped.cartesian
            flat = spline_curve(extent * points_flat, weights_flat, mapped.knots, mapped.degree)
        return flat, spline_curve(points, weights, space.knots, space.degree), low, high, False

    def _joints(self, curve: NurbsCurve) -> Array:
        """Parameters between which a curve on the surface is smooth."""
        low, high = curve.domain
        breaks = curve.breaks()
        at = sampled(breaks, 17)
        cuts = crossings(curve.evaluate(at), at, curve.evaluate, self.surface.breaks())
        joints = np.unique(np.clip(np.append(breaks, cuts), low, high))
        return np.append(joints[:-1][np.diff(joints) > 1e-9 * (high - low)], high)

    def _in_plane(self, curve: NurbsCurve, plane: Array) -> tuple[Any, Any, float, float, bool]:
        """The same of a curve in a plane: a line or a circle if it is one."""
        o = occt()
        origin, axes = plane[0], plane[1:]
        low, high = curve.domain
        joints = self._joints(curve)
        if self.is_affine:
            points, weights = self.extended(curve.control_points), curve.weights
            knots, degree = curve.knots, curve.degree
        else:
            space, _ = approximated(lambda t: self.at(curve.evaluate(t)), joints, FOLLOWED * self.surface.size)
            (points, weights), knots, degree = space.cartesian, space.knots, space.degree
        inside = (points - origin) @ axes.T
        whole = NurbsCurve(np.column_stack([inside, np.zeros(len(inside))]), knots, degree, weights)
        # The points are rounded where they are in space, which may be far out.
        size, far = float(np.linalg.norm(np.ptp(inside, axis=0))), float(np.abs(points).max())
        form = curve_form([whole.bezier_pieces()], exactness(size, far))
        if isinstance(form, Line):
            way = inside[-1] - inside[0]
            length = float(np.linalg.norm(way))
            space_way = o.gp_Dir(*(way @ axes).tolist())
            flat = o.Geom2d_Line(o.gp_Pnt2d(*inside[0].tolist()), o.gp_Dir2d(*way.tolist()))
            start = o.gp_Pnt(*(origin + inside[0] @ axes).tolist())
            return flat, o.Geom_Line(start, space_way), 0.0, length, False
        if isinstance(form, Circle):
            at = sampled(whole.breaks(), 9)
            out = whole.evaluate(at)[:, :2] - form.center[:2]
            angles = np.unwrap(np.arctan2(out[:, 1], out[:, 0]))
            turn = float(angles[-1] - angles[0])
            if (np.diff(angles) * turn > 0.0).all() and abs(turn) < 2.0 * pi + 1e-9:
                return self._arc(form, out[0], min(abs(turn), 2.0 * pi), turn > 0.0, plane)
        flat = spline_curve(inside, weights, knots, degree)
        return flat, spline_curve(origin + inside @ axes, weights, knots, degree), low, high, False

    def _arc(
        self, form: Circle, start: Array, turn: float, left: bool, plane: Array
    ) -> tuple[Any, Any, float, float, bool]:
        """A circle in a plane from the direction where it starts, counterclockwise or clockwise."""
        o = occt()
        origin, axes = plane[0], plane[1:]
        x, center = start / np.linalg.norm(start), form.center[:2]
        sense = 1.0 if left else -1.0
        flat = o.Geom2d_Circle(o.gp_Ax2d(o.gp_Pnt2d(*center.tolist()), o.gp_Dir2d(*x.tolist())), form.radius, left)
        place = o.gp_Ax2(
            o.gp_Pnt(*(origin + center @ axes).tolist()),
            o.gp_Dir(*(sense * np.cross(*axes)).tolist()),
            o.gp_Dir(*(x @ axes).tolist()),
        )
        return flat, o.Geom_Circle(place, form.radius), 0.0, turn, False

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
                pair = (other[0], flat) if backwards != self.carrier.turned else (flat, other[0])
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
        # Where OCCT's normal is against ours, material is on the other side of its curves.
        turned = self.carrier.turned
        for chain in self.chains:
            wire = o.TopoDS_Wire()
            self.build.MakeWire(wire)
            for piece in chain[::-1] if turned else chain:
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
                self.build.Add(wire, edge.Oriented(o.TopAbs_REVERSED if back != turned else o.TopAbs_FORWARD))
            wire.Closed(True)
            self.build.Add(self.made, wire)
        return self.made.Oriented(o.TopAbs_REVERSED if self.face.reversed != turned else o.TopAbs_FORWARD)

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
    """A body as a shape of OCCT, and what became of each of its faces: several where it winds around its surface."""

    def __init__(self, shape: Any, faces: list[list[Any]], closed: bool) -> None:
        self.shape, self.faces, self.closed = shape, faces, closed


def _parts_of(face: Face) -> list[tuple[NurbsSurface, list[list[Piece]]]]:
    """A face on a surface that is cut open; in parts of half a turn where it goes round more than once as a spline.

    OCCT knows that angles go on. Of a spline it would take points of a second turn for those of the first.
    """
    region = region_of(face)
    surface, chains = cut_open(region)
    # OCCT draws lines along poles itself, and gives up the seam of many a face whose wire begins elsewhere.
    found = [(surface, [begun_at_pole(chain, surface) for chain in chains])]
    for axis in (0, 1):
        period = region.surface._periods[axis]
        if not period or surface.closed[axis]:
            continue
        low, high = surface.domain[axis]
        points = [piece.curve.control_points[:, axis] for chain in chains for piece in chain]
        if np.ptp(np.concatenate(points)) <= period * ONCE or not carrier_of(surface).is_own:
            continue
        count = int(np.ceil((high - low) / (0.5 * period)))
        at = np.linspace(low, high, count + 1)
        cut = []
        for whole, rest in found:
            for k, begin in enumerate(at[:-1].tolist()):
                below = rest
                if k < count - 1:
                    below, rest = cut_in_two(rest, whole, axis, float(at[k + 1]))
                part = strip(whole, axis, begin, float(at[k + 1]))
                for piece in (piece for chain in below for piece in chain if piece.kind == SEAM):
                    if piece.ends[0, axis] == piece.ends[1, axis]:
                        piece.kind = EDGE
                cut += [(part, group) for group in _grouped(below)]
        found = cut
    return found


def _grouped(chains: list[list[Piece]]) -> list[list[list[Piece]]]:
    """Outer chains, each with the holes in it."""
    corners = [corners_of(chain) for chain in chains]
    outer = [area_of(each) > 0.0 for each in corners]
    groups = []
    for k, chain in enumerate(chains):
        if outer[k]:
            holes = (h for h in range(len(chains)) if not outer[h] and winds(corners[k], corners[h][0]))
            groups.append([chain, *(chains[h] for h in holes)])
    return groups


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
    made: list[Any] = []
    owner: list[int] = []
    for k, face in enumerate(faces):
        for surface, chains in _parts_of(_in_millimeters(face, scale)):
            made.append(_FaceBuilder(face, surface, chains).result())
            owner.append(k)
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
    images: list[list[Any]] = [[] for _ in faces]
    for k, face in zip(owner, made, strict=True):
        images[k].append(sewing.Modified(face) if sewing.IsModified(face) else face)
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
    """The face in millimeters, with the same parameters."""
    if scale == 1.0:
        return face
    surface = face.surface.transformed(scale=scale)
    return Face(surface, face.outer, face.holes, name=face.name, reversed=face.reversed)
