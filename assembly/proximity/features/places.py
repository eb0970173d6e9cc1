"""Which feature of a body a point of one of its faces is on, and on which side of a closed body another point is."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from assembly._turn import in_child
from assembly.distance.bodies.packing import KeptTree, tree_of
from assembly.distance.bodies.query import Spot, place_of_spot
from assembly.errors import InputError
from assembly.geometry.faces.face import Face
from assembly.proximity.brep.solid import solid_of
from assembly.proximity.brep.topology import Edge, Topology
from assembly.proximity.features.features import Feature, features_of
from assembly.proximity.features.polytopes import polytope_of

__all__ = ["body_faces", "body_tree", "feature_at", "is_behind", "is_closed", "normals_at", "pieces_of", "shells_of"]

Array = NDArray[np.float64]
Faces = tuple[Face, ...]


def body_faces(faces: Faces) -> Faces:
    """The faces of a body's tree: one as it is, several as their topology has them, cut where others end."""
    return faces if len(faces) == 1 else solid_of(faces).faces


@lru_cache(maxsize=256)
def body_tree(faces: Faces) -> KeptTree:
    """The tree of a body."""
    return tree_of(body_faces(faces))


in_child(body_tree.cache_clear)


@lru_cache(maxsize=256)
def is_closed(faces: Faces) -> bool:
    """Whether a body bounds a region; a surface without a boundary does, which needs no topology."""
    return (len(faces) == 1 and not faces[0].boundary) or solid_of(faces).is_closed


@lru_cache(maxsize=256)
def shells_of(faces: Faces) -> tuple[Faces, ...]:
    """The faces of a body by parts that no edge joins; one face is one part."""
    return (faces,) if len(faces) == 1 else pieces_of(solid_of(faces))


def pieces_of(topology: Topology) -> tuple[Faces, ...]:
    """The faces of a topology by parts that no edge joins."""
    part = list(range(len(topology.faces)))
    for edge in topology.edges:
        if edge.face_b is not None:
            low, high = sorted((part[edge.face_a], part[edge.face_b]))
            part = [low if number == high else number for number in part]
    return tuple(
        tuple(face for face, number in zip(topology.faces, part, strict=True) if number == shell)
        for shell in sorted(set(part))
    )


def _parameters(faces: Faces, spot: Spot) -> tuple[int, float, float]:
    """The face of the topology on which a point is, and its (u, v)."""
    place = place_of_spot(body_tree(faces), spot)
    if place.curve < 0:
        return _smooth_part(faces, place.face, *place.parameters), *place.parameters
    face = body_faces(faces)[place.face]
    u, v = face.boundary[place.curve].evaluate(place.parameters[0]).tolist()
    for axis, x in enumerate((u, v)):
        low, high = face.surface.domain[axis]
        if not face.surface.closed[axis]:
            u, v = (min(max(x, low), high), v) if axis == 0 else (u, min(max(x, low), high))
    return _smooth_part(faces, place.face, u, v), u, v


def _smooth_part(faces: Faces, number: int, u: float, v: float) -> int:
    """The part of a face on which a point is: the topology has one face as several if it has creases."""
    parts = solid_of(faces).faces
    if len(faces) > 1 or len(parts) == 1:
        return number
    for k, part in enumerate(parts):
        (low_u, high_u), (low_v, high_v) = part.surface.domain
        if low_u <= u <= high_u and low_v <= v <= high_v and (not part.boundary or bool(part.contains(u, v))):
            return k
    return number


def _edge_at(topology: Topology, face: int, u: float, v: float) -> tuple[Edge, int, float] | None:
    """The edge of a face on which a point of it is: the edge, its number, and its parameter on that face's curve."""
    surface = topology.faces[face]
    if not surface.boundary or float(surface.space_distance(u, v)) > topology.tolerance:
        return None
    found = surface.nearest_on_boundary(u, v)
    number = topology.face_edges[face][int(found.curve)]
    return None if number is None else (topology.edges[number], number, float(found.t))


def feature_at(faces: Faces, spot: Spot, point: Array) -> Feature:
    """The vertex, the edge or the face on which a point of a body is, to the tolerance of its topology."""
    topology, names = solid_of(faces), features_of(faces)
    if topology.vertices:
        off = _vertex_points(faces) - point
        apart = np.einsum("ij,ij->i", off, off)
        nearest = int(apart.argmin())
        if apart[nearest] <= topology.tolerance**2:
            return names[len(topology.faces) + len(topology.edges) + nearest]
    place = place_of_spot(body_tree(faces), spot)
    if place.curve >= 0 and len(body_faces(faces)) == len(topology.faces):
        number = topology.face_edges[place.face][place.curve]
        return names[place.face] if number is None else names[len(topology.faces) + number]
    flat = polytope_of(faces)
    if flat is not None:
        edge = flat.edge_at(point, topology.tolerance)
        if edge is not None:
            return names[len(topology.faces) + edge]
        if place.curve < 0:
            return names[place.face]
    face, u, v = _parameters(faces, spot)
    found = _edge_at(topology, face, u, v)
    return names[face] if found is None else names[len(topology.faces) + found[1]]


@lru_cache(maxsize=256)
def _vertex_points(faces: Faces) -> Array:
    """The vertices of a body (n, 3)."""
    return np.array([vertex.point for vertex in solid_of(faces).vertices])


def _normal(face: Face, curve: int, t: float, closes: bool) -> Array | None:
    """The normal of a face at a point of its boundary, where it has one."""
    boundary = face.boundary[curve]
    low, high = boundary.domain
    t = low + (t - low) % (high - low) if closes else min(max(t, low), high)
    u, v = boundary.evaluate(t).tolist()
    try:
        return face.normal(u, v)
    except InputError:
        return None


def normals_at(faces: Faces, spot: Spot, feature: Feature | None = None) -> list[Array]:
    """Outward normals of the faces on which a point is that is on a feature, or within a face."""
    topology = solid_of(faces)
    number, u, v = _parameters(faces, spot)
    found: list[Array | None] = []
    if feature is None or feature.kind == "face":
        return [topology.faces[number].normal(u, v)]
    if feature.kind == "edge":
        at = _edge_at(topology, number, u, v)
        assert at is not None
        edge, _k, t = at
        m0, m1 = edge.map_b
        if edge.face_b is None or edge.curve_b is None:
            return [topology.faces[number].normal(u, v)]
        t_a, t_b = (t, m0 + m1 * t) if number == edge.face_a else ((t - m0) / m1, t)
        closes = edge.start is None
        found.append(_normal(topology.faces[edge.face_a], edge.curve_a, t_a, closes))
        found.append(_normal(topology.faces[edge.face_b], edge.curve_b, t_b, closes))
    else:
        for k, side in topology.vertices[feature.index].edges:
            edge = topology.edges[k]
            face = topology.faces[edge.face_a]
            found.append(_normal(face, edge.curve_a, face.boundary[edge.curve_a].domain[side], False))
            if edge.face_b is not None and edge.curve_b is not None:
                face = topology.faces[edge.face_b]
                end = edge.map_b[0] + edge.map_b[1] * topology.faces[edge.face_a].boundary[edge.curve_a].domain[side]
                found.append(_normal(face, edge.curve_b, end, False))
    return [normal for normal in found if normal is not None]


def is_behind(faces: Faces, spot: Spot, point: Array, way: Array) -> bool:
    """Whether a closed body has a point inside whose nearest point of it is here; `way` leads to that one.

    Of the faces that meet in an edge or a vertex, that one tells whose normal is nearest to being along the way.
    """
    off = [float(normal @ way) for normal in normals_at(faces, spot, feature_at(faces, spot, point))]
    return bool(off) and max(off, key=abs) < 0.0
