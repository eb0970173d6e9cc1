"""Faces as shapes of OCCT: trimmed faces, sewn to shells and solids.

Surfaces are written as what they are (`carriers`), and so are edges (`laid_edges`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.seams.region_cuts import cut_in_two, cut_open
from assembly.geometry.seams.region_pieces import EDGE, POLE, SEAM, Piece, begun_at_pole
from assembly.geometry.seams.region_strips import area_of, corners_of, strip, winds
from assembly.geometry.splines.surface import NurbsSurface
from assembly.step.carriers import carrier_of
from assembly.step.laid_edges import EdgeCurves
from assembly.step.occt import occt, parts
from assembly.step.turned_spheres import region_of

__all__ = ["Sewn", "sewn"]

Array = NDArray[np.float64]
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
        self.curves = EdgeCurves(surface, self.carrier)
        self.chains = chains if self.carrier.plane is None else self._of_plane(chains)
        self.geometry = self.carrier.geometry
        self.made = o.TopoDS_Face()
        self.build.MakeFace(self.made, self.geometry, EDGE_TOLERANCE)
        self.corners: list[tuple[Array, Any]] = []

    def _of_plane(self, chains: list[list[Piece]]) -> list[list[Piece]]:
        """The same without seams and poles, which a disc about its center has in (u, v), and OCCT's plane has not."""
        left = [piece for chain in chains for piece in chain if piece.kind not in (SEAM, POLE)]
        if len(left) == sum(map(len, chains)):
            return chains
        begin, end = (self.curves.at(np.array([piece.ends[k] for piece in left])) for k in (0, 1))
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

    def vertex(self, uv: Array) -> Any:
        """The vertex at a corner of the boundary, one for all that are one point."""
        o = occt()
        point = self.curves.at(uv[None])[0]
        for other, vertex in self.corners:
            if np.abs(point - other).max() <= 0.1 * EDGE_TOLERANCE:
                return vertex
        vertex = o.TopoDS_Vertex()
        self.build.MakeVertex(vertex, o.gp_Pnt(*point.tolist()), EDGE_TOLERANCE)
        self.corners.append((point, vertex))
        return vertex

    def edge(self, piece: Piece, partner: Piece | None) -> tuple[Any, bool]:
        """The edge of a piece, and whether the piece runs against it; of a seam, of both its pieces."""
        o = occt()
        ends = piece.ends
        flat, space, low, high, backwards = self.curves.of(piece.curve)
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
                other = self.curves.line(partner.curve)
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
