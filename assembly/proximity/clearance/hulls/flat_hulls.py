"""Hulls of flat faces, in triangles where these are polygons that are not convex, and their holes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.curves import Circle, curve_form
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity.clearance.hulls.boundary_pieces import BoundaryPieces, boundary_pieces
from assembly.proximity.clearance.hulls.discs import Discs
from assembly.proximity.clearance.hulls.hollows import AnyHollow, FaceHulls, Hollow, Ring, parts_of_one
from assembly.proximity.clearance.hulls.prism import Prism
from assembly.proximity.clearance.hulls.sheet import Sheet
from assembly.proximity.clearance.hulls.triangles import triangles_of
from assembly.proximity.manifolds.flat_map import FlatMap

__all__ = ["hole_of_ring", "hulls_of_flat"]

Array = NDArray[np.float64]
# Of every curve of a boundary the circle that it is on, or None.
Boundary = list[Circle | None]
# How far a corner of a polygon that counts as convex may be beyond its sides, in parts of the face's size.
CONVEX = 1e-13
# How near to a circle an arc of a boundary is, in parts of the face's size; it is added to or taken from its radius.
NEARLY = 1e-10


def hulls_of_flat(face: Face, flat: FlatMap, normal: Array, points: Array) -> list[FaceHulls]:
    """What is known of a flat face: in triangles where it is a polygon that is not convex."""
    corners = _corners(face, flat)
    if corners is not None and not face.holes:
        inward = _inward(corners, normal)
        if (inward @ corners.T - (inward * corners).sum(axis=1)[:, None] < -CONVEX * face.surface.size).any():
            triangles = [(Discs.of_points(corners[list(rows)]), flat.off) for rows in triangles_of(corners, normal)]
            return parts_of_one([FaceHulls([triangle], [], points, normal, None) for triangle in triangles])
    tolerance = NEARLY * face.surface.size
    arcs = [flat.circle([curve], tolerance) for curve in face.boundary] if face.outer is not None or face.holes else []
    hollows = _holes(face, flat, normal, arcs)
    if face.outer is not None:
        # For balls, which planes do not part from it where they are in a hole or beside it.
        hollows.append(Sheet.of(face, flat, normal, arcs))
    return [FaceHulls(_of_flat(face, flat, arcs), hollows, points, normal, None)]


def _whole(face: Face, flat: FlatMap, chain: range, arcs: Boundary) -> Circle | None:
    """The circle that all of a chain of a boundary is."""
    if len(chain) == 1:
        return arcs[chain[0]]
    if any(arcs[k] is None for k in chain):
        return None
    return flat.circle([face.boundary[k] for k in chain], NEARLY * face.surface.size)


def _corners(face: Face, flat: FlatMap) -> Array | None:
    """The corners in space (n, 3) of what goes around a flat face, or None where that has parts that are bent."""
    if face.outer is None:
        return None
    curves = [face.boundary[k] for k in face.chains[0]]
    if any(curve.degree > 1 for curve in curves):
        return None
    # Each curve ends where the next one begins.
    return np.concatenate([flat.points(curve)[::2] for curve in curves])


def _inward(corners: Array, normal: Array) -> Array:
    """Unit vectors to the left of a polygon's sides (n, 3), seen against its normal; zero of one without length."""
    ways = np.cross(normal, np.roll(corners, -1, axis=0) - corners)
    lengths = np.linalg.norm(ways, axis=1)
    return np.asarray(ways / np.where(lengths > 0.0, lengths, 1.0)[:, None])


def _of_flat(face: Face, flat: FlatMap, arcs: Boundary) -> list[tuple[Discs, float]]:
    """Hulls of a flat face: of the control points of what goes around it, or of its circles and what is not round."""
    surface = face.surface
    if face.outer is None:
        return [(Discs.of_points(surface.control_points.reshape(-1, 3)), 0.0)]
    whole = _whole(face, flat, face.chains[0], arcs)
    if whole is not None:
        return [(_disc(whole), whole.deviation + flat.off)]
    nets = [flat.points(face.boundary[k]) for k in face.chains[0]]
    circles = [arcs[k] for k in face.chains[0]]
    hulls = [(Discs.of_points(np.concatenate(nets)), flat.off)]
    if any(circle is not None for circle in circles):
        parts = [
            Discs.of_points(net) if circle is None else _disc(circle) for net, circle in zip(nets, circles, strict=True)
        ]
        pad = max(circle.deviation for circle in circles if circle is not None) + flat.off
        hulls.append((Discs(*(np.concatenate(column) for column in zip(*parts, strict=True))), pad))
    return hulls


def _disc(circle: Circle) -> Discs:
    return Discs(circle.center[None], circle.axis[None], np.array([circle.radius]))


def _holes(face: Face, flat: FlatMap, normal: Array, arcs: Boundary) -> list[AnyHollow]:
    """Convex sets in the holes of a flat face: what is within all sides, and the largest disc about an arc's middle."""
    found: list[AnyHollow] = []
    size = face.surface.size
    for chain in face.chains[1:] if face.holes else ():
        whole = _whole(face, flat, chain, arcs)
        if whole is not None:
            found += _disc_hole(whole.center, normal, whole.radius - whole.deviation - flat.off, size)
            continue
        found += _prisms(boundary_pieces(face, flat, normal, chain, arcs), normal, size)
        circle = next((arcs[k] for k in chain if arcs[k] is not None), None)
        if circle is None or not _is_beside(face, flat, circle.center):
            continue
        # All of the boundary is beyond, so that the disc is wholly in the hole.
        curves = zip(face.boundary, arcs, strict=True)
        least = min(_distance(flat, curve, arc, circle.center) for curve, arc in curves)
        found += _disc_hole(circle.center, normal, least - flat.off, size)
    return found


def _disc_hole(center: Array, normal: Array, radius: float, size: float) -> list[Hollow | Prism | Ring]:
    """What goes through a disc in a flat face of a size, and balls that lie on its rim."""
    if not radius > 0.0:
        return []
    beyond = np.array([[0.0, radius], [0.0, radius + size]])
    return [Hollow(center, normal, radius), Ring(center, normal, beyond, 0.0)]


def hole_of_ring(surface: NurbsSurface, normal: Array) -> list[Hollow | Prism | Ring]:
    """The hole of a flat ring that a line drew: circles about one center, of control points in the same directions."""
    tolerance = NEARLY * surface.size
    for way, other in ((0, 1), (1, 0)):
        if not surface.closed[way] or surface.degree[other] != 1:
            continue
        pieces = np.moveaxis(surface.bezier_pieces(), (way, way + 2), (0, 2))
        net, weights = np.moveaxis(surface.control_points, way, 0), np.moveaxis(surface.weights, way, 0)
        if np.ptp(weights, axis=1).any():
            continue
        for first, step in ((0, 1), (-1, -1)):
            circle = curve_form([pieces[:, first, :, first]], tolerance)
            if not isinstance(circle, Circle):
                continue
            # Each line of control points leads straight away from the center.
            off = (net - circle.center)[:, ::step]
            grown = (off * off[:, :1]).sum(axis=2) / (off[:, :1] ** 2).sum(axis=2)
            if np.abs(off - grown[0, :, None] * off[:, :1]).max() <= tolerance and (np.diff(grown[0]) > 0.0).all():
                return _disc_hole(circle.center, normal, circle.radius - circle.deviation - tolerance, surface.size)
    return []


def _prisms(pieces: BoundaryPieces | None, normal: Array, size: float) -> list[Prism]:
    """Convex sets in a hole of straight sides and hollow arcs.

    One is what is within all sides, and within arcs along all their normals: from a point of that, all of the boundary
    is seen to go around the same way, so that the point is in the hole; where the hole is convex, that is all of it.
    Of a polygon there are others as well, for every side what is within those sides which it is within and which are
    within it, if no side leads through that.
    """
    # A hole goes around clockwise.
    if pieces is None or (pieces.clockwise < 0.0).any():
        return []
    begins, ends = pieces.begins, pieces.ends
    inward = np.cross(ends - begins, normal)
    inward /= np.linalg.norm(inward, axis=1)[:, None]
    borders = (inward * begins).sum(axis=1)
    arcs = pieces.arcs._replace(radii=pieces.arcs.radii - pieces.off)
    sets = np.ones((1, len(inward)), dtype=bool)
    if not len(arcs.radii):
        of_ends = np.stack([begins @ inward.T, ends @ inward.T]) - borders
        is_within = of_ends.min(axis=0) >= -CONVEX * size
        if not is_within.all():
            sets = np.unique(is_within & is_within.T, axis=0)
            sets = sets[[not _is_crossed(of_ends[:, :, rows], CONVEX * size) for rows in sets]]
    return [Prism(normal, inward[rows], borders[rows] + pieces.off, arcs) for rows in sets]


def _is_crossed(depths: Array, least: float) -> bool:
    """Whether segments, of whose ends the depths (2, m, n) in half spaces are given, lead deeper than a length into
    what is in all of these.
    """
    first, last = depths[0] - least, depths[1] - least
    with np.errstate(divide="ignore", invalid="ignore"):
        at = first / (first - last)
    enters = np.where((first <= 0.0) & (last > 0.0), at, 0.0).max(axis=1)
    leaves = np.where((first > 0.0) & (last <= 0.0), at, 1.0).min(axis=1)
    return bool((((first > 0.0) | (last > 0.0)).all(axis=1) & (enters < leaves)).any())


def _is_beside(face: Face, flat: FlatMap, point: Array) -> bool:
    """Whether a point of a flat face's plane is none of the face."""
    ways = np.column_stack([flat.along, flat.across])
    u, v = np.linalg.lstsq(ways, point - flat.origin, rcond=None)[0].tolist()
    return bool(face.locate(u, v) < 0)


def _distance(flat: FlatMap, curve: NurbsCurve, circle: Circle | None, center: Array) -> float:
    """How far a boundary curve, an arc or not, is from a point of a face's plane, at least; 0 where nobody knows."""
    net = flat.points(curve)
    if curve.degree == 1:
        begin, way = net[:-1], np.diff(net, axis=0)
        squared = np.maximum((way**2).sum(axis=1), np.finfo(float).tiny)
        part = np.clip(((center - begin) * way).sum(axis=1) / squared, 0.0, 1.0)
        return float(np.linalg.norm(begin + part[:, None] * way - center, axis=1).min())
    if circle is None:
        return 0.0
    return max(abs(circle.radius - float(np.linalg.norm(circle.center - center))) - circle.deviation, 0.0)
