"""Vertices of a body as elements of its tree.

At a vertex that holds an extremal pair no edge may lead the way of the normal: n.e <= 0 for the directions e of its
edges away from it. Where no such n exists there is no pair. Where two edges go on into each other n is orthogonal to
both, and among the normals that they have there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.brep.topology import Topology, Vertex
from assembly.proximity.bvh.cones import FULL, around_cones, around_vectors, between
from assembly.proximity.bvh.facet_elements import Elements

__all__ = ["vertex_elements"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
# Directions at a vertex: this near to a plane, or to each other's opposite, they are in it.
_PLANE, _TOLERANCE = 1e-4, 1e-5


def _away(topology: Topology, vertex: Vertex) -> Array | None:
    """Unit directions of the edges at a vertex away from it; None where one of them has none."""
    directions = []
    for index, side in vertex.edges:
        edge = topology.edges[index]
        face = topology.faces[edge.face_a]
        curve = face.boundary[edge.curve_a]
        low, high = curve.domain
        c, ct = curve.evaluate((low, high)[side], 1)
        at = [c[k] if face.surface.closed[k] else np.clip(c[k], *face.surface.domain[k]) for k in range(2)]
        _, su, sv = face.surface.evaluate(at[0], at[1], 1)
        rate = ct[0] * su + ct[1] * sv
        length = float(np.linalg.norm(rate))
        if length * (high - low) < 1e-6 * edge.length:
            return None
        directions.append((-1.0 if side else 1.0) * rate / length)
    return np.array(directions)


def _polar(directions: Array) -> Array | None:
    """Extreme rays of {n: n.e <= 0 for all directions e}; None where the directions lie in a plane."""
    if len(directions) < 3 or np.linalg.svd(directions, compute_uv=False)[2] < _PLANE:
        return None
    first, second = np.triu_indices(len(directions), 1)
    rays = np.cross(directions[first], directions[second])
    size = np.linalg.norm(rays, axis=1)
    rays = rays[size > _TOLERANCE] / size[size > _TOLERANCE, None]
    rays = np.concatenate([rays, -rays])
    return np.asarray(rays[(rays @ directions.T).max(axis=1) <= _TOLERANCE])


def _opposite(directions: Array) -> tuple[int, int] | None:
    """Two directions that are opposite, if there are any."""
    first, second = np.nonzero(between(directions[:, None], -directions) < _PLANE)
    return (int(first[0]), int(second[0])) if first.size else None


def vertex_elements(topology: Topology, edges: Elements) -> Elements:
    """The vertices that may hold an extremal pair; `edges` are the elements of the edges."""
    faces = len(topology.faces)
    result = []
    for number, vertex in enumerate(topology.vertices):
        axis, half = np.array([0.0, 0.0, 1.0]), FULL
        directions = _away(topology, vertex) if vertex.edges else None
        rays = None if directions is None else _polar(directions)
        if rays is not None:
            if len(rays) == 0:
                continue
            cone = around_vectors(rays[None], np.array([2.0 * _TOLERANCE]), np.array([False]))
            axis, half = cone[0][0], float(cone[1][0])
        elif directions is not None and (pair := _opposite(directions)) is not None:
            # Two edges go on smoothly into each other: the vertex has no other normals than they.
            ends = np.concatenate([_last(topology, edges, faces, *vertex.edges[k]) for k in pair])
            if ends.size == 0:
                continue
            cone = around_cones(edges.axis[ends], edges.half_angle[ends] + _PLANE, np.array([0]))
            axis, half = cone[0][0], float(cone[1][0])
        point = vertex.point[None]
        pad = topology.tolerance
        code = np.array([faces + len(topology.edges) + number])
        result.append(Elements(code, np.zeros((1, 4)), point - pad, point + pad, axis[None], np.array([half])))
    return Elements.joined(result)


def _last(topology: Topology, edges: Elements, faces: int, index: int, side: int) -> Indices:
    """The element at the start (side 0) or the end of an edge; none where it is concave there."""
    edge = topology.edges[index]
    t = topology.faces[edge.face_a].boundary[edge.curve_a].domain[side]
    return np.flatnonzero((edges.feature == faces + index) & (edges.parameters[:, side] == t))
