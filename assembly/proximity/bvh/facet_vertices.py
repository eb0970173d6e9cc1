"""Vertices of a body as elements of its tree.

At a vertex that holds an extremal pair no edge may lead the way of the normal: n.e <= 0 for the directions e of its
edges away from it. Where no such n exists there is no pair. Where two edges go on into each other n is orthogonal to
both, and among the normals that they have there.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.brep.boundary_curves import Batch, Rim, cross, survey_of
from assembly.proximity.brep.topology import Topology
from assembly.proximity.bvh.cones import FULL, around_cones, around_vectors, between
from assembly.proximity.bvh.facet_elements import Elements

__all__ = ["vertex_elements"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
# Directions at a vertex: this near to a plane, or to each other's opposite, they are in it.
_PLANE, _TOLERANCE = 1e-4, 1e-5


class _Ends(NamedTuple):
    """Ends of edges at vertices, those of a vertex in a row.

    Attributes
    ----------
    first : (vertices + 1,) of int
        Where those of each vertex begin.
    directions : (n, 3)
        Unit directions of the edges away from the vertices.
    known : (vertices,) of bool
        Whether a vertex has edges that all have a direction.
    """

    first: Indices
    directions: Array
    known: NDArray[np.bool_]


def _ends_of(topology: Topology) -> _Ends:
    """The ends of all edges at their vertices."""
    counts = np.array([len(vertex.edges) for vertex in topology.vertices], dtype=np.int64)
    first = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(counts)])
    ends = np.array([end for vertex in topology.vertices for end in vertex.edges], dtype=np.int64).reshape(-1, 2)
    if not len(ends):
        return _Ends(first, np.empty((0, 3)), np.zeros(len(counts), dtype=bool))
    curves = [topology.faces[edge.face_a].boundary[edge.curve_a] for edge in topology.edges]
    rims = [
        Rim(edge.face_a, edge.curve_a, curve, topology.tolerance)
        for edge, curve in zip(topology.edges, curves, strict=True)
    ]
    domains = np.array([curve.domain for curve in curves])
    lengths = np.array([edge.length for edge in topology.edges])
    index, side = ends.T
    survey = survey_of(topology.faces, topology.tolerance)
    _, rate, _ = Batch(survey, rims).along(np.ascontiguousarray(index), domains[index, side])
    size = np.linalg.norm(rate, axis=1)
    regular = size * (domains[index, 1] - domains[index, 0]) >= 1e-6 * lengths[index]
    directions = np.where(side == 1, -1.0, 1.0)[:, None] * rate / np.where(regular, size, 1.0)[:, None]
    known = np.array([bool(regular[a:b].all()) and b > a for a, b in itertools.pairwise(first.tolist())], dtype=bool)
    return _Ends(first, directions, known)


def _polars(ends: _Ends) -> dict[int, tuple[Array, float] | None]:
    """Cones around {n: n.e <= 0 for all directions e} at vertices where these are not in a plane; None: there is no n.

    Vertices with equally many edges are looked at together.
    """
    result: dict[int, tuple[Array, float] | None] = {}
    counts = np.diff(ends.first)
    for count in np.unique(counts[ends.known & (counts >= 3)]).tolist():
        vertices = np.flatnonzero(ends.known & (counts == count))
        directions = ends.directions[ends.first[vertices][:, None] + np.arange(count)]
        solid = np.linalg.svd(directions, compute_uv=False)[:, 2] >= _PLANE
        vertices, directions = vertices[solid], directions[solid]
        # The extreme rays are among the normals of planes through two directions.
        one, other = np.triu_indices(count, 1)
        rays = cross(directions[:, one], directions[:, other])
        size = np.linalg.norm(rays, axis=2)
        rays = rays / np.where(size > 0.0, size, 1.0)[..., None]
        rays = np.concatenate([rays, -rays], axis=1)
        held = (rays @ directions.transpose(0, 2, 1)).max(axis=2) <= _TOLERANCE
        held &= np.tile(size > _TOLERANCE, 2)
        axis, half = around_vectors(
            np.where(held[..., None], rays, 0.0),
            np.full(len(rays), 2.0 * _TOLERANCE),
            np.ones(len(rays), dtype=bool),
        )
        for k, (vertex, some) in enumerate(zip(vertices.tolist(), held.any(axis=1).tolist(), strict=True)):
            result[vertex] = (axis[k], float(half[k])) if some else None
    return result


def _opposite(directions: Array) -> tuple[int, int] | None:
    """Two directions that are opposite, if there are any."""
    first, second = np.nonzero(between(directions[:, None], -directions) < _PLANE)
    return (int(first[0]), int(second[0])) if first.size else None


def vertex_elements(topology: Topology, edges: Elements) -> Elements:
    """The vertices that may hold an extremal pair; `edges` are the elements of the edges."""
    faces = len(topology.faces)
    ends = _ends_of(topology)
    polars = _polars(ends)
    numbers, axes, halves = [], [], []
    for number, vertex in enumerate(topology.vertices):
        axis, half = np.array([0.0, 0.0, 1.0]), FULL
        if number in polars:
            cone = polars[number]
            if cone is None:
                continue
            axis, half = cone
        elif ends.known[number]:
            pair = _opposite(ends.directions[ends.first[number] : ends.first[number + 1]])
            if pair is not None:
                # Two edges go on smoothly into each other: the vertex has no other normals than they.
                last = np.concatenate([_last(topology, edges, faces, *vertex.edges[k]) for k in pair])
                if last.size == 0:
                    continue
                around = around_cones(edges.axis[last], edges.half_angle[last] + _PLANE, np.array([0]))
                axis, half = around[0][0], float(around[1][0])
        numbers.append(number)
        axes.append(axis)
        halves.append(half)
    if not numbers:
        return Elements.joined([])
    points = np.array([topology.vertices[number].point for number in numbers])
    pad = topology.tolerance
    code = faces + len(topology.edges) + np.array(numbers)
    return Elements(code, np.zeros((len(code), 4)), points - pad, points + pad, np.array(axes), np.array(halves))


def _last(topology: Topology, edges: Elements, faces: int, index: int, side: int) -> Indices:
    """The element at the start (side 0) or the end of an edge; none where it is concave there."""
    edge = topology.edges[index]
    t = topology.faces[edge.face_a].boundary[edge.curve_a].domain[side]
    return np.flatnonzero((edges.feature == faces + index) & (edges.parameters[:, side] == t))
