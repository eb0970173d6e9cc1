"""Edges and vertices of a body as elements of its tree: parts in t, boxes around them, and cones of their normals.

Where an edge holds an extremal pair the normal is between those of its two faces, if the edge is convex there; where it
is concave there is none. At a vertex no edge may lead the way of the normal: n.e <= 0 for the directions e of its edges
away from it; where no such n exists there is none.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.curve import NurbsCurve
from assembly.geometry.face import Face
from assembly.geometry.surface import NurbsSurface
from assembly.proximity.cones import FULL, around_cones, around_vectors, between
from assembly.proximity.edge_cells import box_hulls, box_parts, curve_boxes, interval_parts
from assembly.proximity.normal_nets import Nets, nets_of, restricted
from assembly.proximity.topology import Edge, Topology, Vertex

__all__ = ["Elements", "edge_elements", "edge_point", "other_parameter", "vertex_elements"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]
_ROUNDING = 1e-14
# Parts of an edge are no longer than this part of its face, and are halved so often at most.
_PART, _HALVINGS = 0.25, 6
# Steps of Newton's method to the same point on the other face, and how much wider the other parts are made.
_STEPS, _WIDER = 8, 0.05
# Directions at a vertex: this near to a plane, or to each other's opposite, they are in it.
_PLANE, _TOLERANCE = 1e-4, 1e-5


class Elements(NamedTuple):
    """Elements of a tree: feature, box of parameters (n, 4), box in space, cone (see `FacetTree`)."""

    feature: Indices
    parameters: Array
    low: Array
    high: Array
    axis: Array
    half_angle: Array

    def at(self, chosen: Indices | Mask) -> Elements:
        """Some of them."""
        return Elements(
            self.feature[chosen],
            self.parameters[chosen],
            self.low[chosen],
            self.high[chosen],
            self.axis[chosen],
            self.half_angle[chosen],
        )

    @staticmethod
    def joined(parts: Sequence[Elements]) -> Elements:
        """Several as one."""
        three = np.empty((0, 3))
        none = Elements(np.empty(0, dtype=np.int64), np.empty((0, 4)), three, three, three, np.empty(0))
        return Elements(*(np.concatenate(columns) for columns in zip(none, *parts, strict=True)))


def edge_point(surface: NurbsSurface, curve: NurbsCurve, t: Array) -> tuple[Array, Array]:
    """Points S(c(t)) of an edge and their derivatives, (n, 3) each."""
    low, high = curve.domain
    c, ct = curve.evaluate(np.clip(t, low, high), 1)
    at = []
    for k in range(2):
        start, stop = surface.domain[k]
        at.append(c[:, k] if surface.closed[k] else np.clip(c[:, k], start, stop))
    s, su, sv = surface.evaluate(at[0], at[1], 1)
    return s, ct[:, :1] * su + ct[:, 1:2] * sv


def other_parameter(topology: Topology, edge: Edge, t: Array) -> Array:
    """Where an edge with two faces is at the same points on its second one; beyond the domain of a closed curve."""
    assert edge.face_b is not None and edge.curve_b is not None
    a, b = topology.faces[edge.face_a], topology.faces[edge.face_b]
    points, _ = edge_point(a.surface, a.boundary[edge.curve_a], t)
    curve = b.boundary[edge.curve_b]
    low, high = curve.domain
    closed = edge.start is None
    at = edge.map_b[0] + edge.map_b[1] * t
    step = 0.05 * (high - low)
    for _ in range(_STEPS):
        inside = low + np.mod(at - low, high - low) if closed else np.clip(at, low, high)
        p, rate = edge_point(b.surface, curve, inside)
        square = (rate**2).sum(axis=1)
        move = ((points - p) * rate).sum(axis=1) / np.where(square > 0.0, square, 1.0)
        at = (at if closed else inside) + np.clip(move, -step, step)
    return np.asarray(at if closed else np.clip(at, low, high))


def _normals(nets: Nets, face: Face, boxes: Array, owner: Indices) -> tuple[Array, Array]:
    """Cones around the outward normals over boxes (n, 4) in (u, v), by the owners of the boxes, in their order."""
    parts = box_parts(face.surface, boxes)
    at = parts.span_u, parts.span_v
    net = restricted(nets.normals[at], parts.box)
    axis, half = around_vectors(net.reshape(len(net), -1, 3), nets.slack[at], nets.poles[at])
    begins = np.flatnonzero(np.diff(owner[parts.owner], prepend=-1))
    return around_cones(axis, half, begins)


class _Body:
    """A body with the nets of its faces."""

    def __init__(self, topology: Topology) -> None:
        self.topology = topology
        self.nets: dict[int, Nets] = {}

    def nets_of(self, number: int) -> Nets:
        if number not in self.nets:
            self.nets[number] = nets_of(self.topology.faces[number])
        return self.nets[number]

    def measured(self, index: int, cells: Array) -> tuple[Elements, Array, Mask]:
        """Parts (n, 2) of an edge as elements; by how much they turn, and which are concave."""
        edge = self.topology.edges[index]
        face = self.topology.faces[edge.face_a]
        curve = face.boundary[edge.curve_a]
        boxes = curve_boxes(curve, cells)
        xyz, owner = box_hulls(face.surface, boxes)
        begins = np.flatnonzero(np.diff(owner, prepend=-1))
        nets = self.nets_of(edge.face_a)
        # Points of the second face's curve are as far off as two points that are one.
        pad = _ROUNDING * nets.extent + (0.0 if edge.face_b is None else self.topology.tolerance)
        low = np.minimum.reduceat(xyz.min(axis=1), begins) - pad
        high = np.maximum.reduceat(xyz.max(axis=1), begins) + pad
        axis, half = _normals(nets, face, boxes, np.arange(len(cells)))
        turn, concave = half, np.zeros(len(cells), dtype=bool)
        if edge.face_b is None:
            half = np.full(len(cells), FULL)
        else:
            other, wide = self._other_normals(edge, cells)
            concave = self._concave(edge, cells, (axis, half), (other, wide))
            turn = np.maximum(half, wide)
            axis, half = _fan((axis, half), (other, wide))
        count = len(self.topology.faces)
        parameters = np.column_stack([cells, np.zeros_like(cells)])
        return Elements(np.full(len(cells), count + index), parameters, low, high, axis, half), turn, concave

    def _other_normals(self, edge: Edge, cells: Array) -> tuple[Array, Array]:
        """Cones around the second face's normals over parts of an edge."""
        assert edge.face_b is not None and edge.curve_b is not None
        face = self.topology.faces[edge.face_b]
        curve = face.boundary[edge.curve_b]
        ends = other_parameter(self.topology, edge, cells.ravel()).reshape(-1, 2)
        low, high = ends.min(axis=1), ends.max(axis=1)
        at = curve.breaks()
        wider = _WIDER * (high - low) + 1e-9 * (at[-1] - at[0])
        low, high = low - wider, high + wider
        if edge.start is not None:
            low, high = np.clip(low, at[0], at[-1]), np.clip(high, at[0], at[-1])
        owner, span, x0, x1 = interval_parts(low, high, at, edge.start is None)
        width = np.diff(at)[span]
        parts = np.column_stack([at[span] + x0 * width, at[span] + x1 * width])
        return _normals(self.nets_of(edge.face_b), face, curve_boxes(curve, parts), owner)

    def _concave(self, edge: Edge, cells: Array, a: tuple[Array, Array], b: tuple[Array, Array]) -> Mask:
        """Parts where the faces' normals are never parallel, and material bends toward the outside at the middle."""
        face = self.topology.faces[edge.face_a]
        _, along = edge_point(face.surface, face.boundary[edge.curve_a], cells.mean(axis=1))
        angle = between(a[0], b[0])
        apart = (angle > a[1] + b[1]) & (angle < np.pi - a[1] - b[1])
        return np.asarray(apart & (face.sign * (np.cross(a[0], b[0]) * along).sum(axis=1) < 0.0))


def _fan(a: tuple[Array, Array], b: tuple[Array, Array]) -> tuple[Array, Array]:
    """Cones around pairs of cones and what is between them."""
    count = len(a[0])
    axis = np.stack([a[0], b[0]], axis=1).reshape(-1, 3)
    half = np.stack([a[1], b[1]], axis=1).ravel()
    axis, half = around_cones(axis, half, 2 * np.arange(count))
    # Wider cones are not convex.
    return axis, np.where(half < 1.5, half, FULL)


def edge_elements(topology: Topology, angle: float) -> Elements:
    """Parts of all edges, but for those that are concave; halved while a face's normals turn by more than the angle."""
    body = _Body(topology)
    result = []
    for index, edge in enumerate(topology.edges):
        face = topology.faces[edge.face_a]
        at = face.boundary[edge.curve_a].breaks()
        cells = np.column_stack([at[:-1], at[1:]])
        low, high = face.surface.bounding_box()
        longest = _PART * float(np.linalg.norm(high - low))
        for halving in range(_HALVINGS + 1):
            elements, turn, concave = body.measured(index, cells)
            large = np.linalg.norm(elements.high - elements.low, axis=1) > longest
            more = ((turn > angle) | large) & ~concave & (halving < _HALVINGS)
            result.append(elements.at(~more & ~concave))
            if not more.any():
                break
            middle = cells[more].mean(axis=1)
            cells = np.concatenate(
                [np.column_stack([cells[more, 0], middle]), np.column_stack([middle, cells[more, 1]])]
            )
    return Elements.joined(result)


def _away(topology: Topology, vertex: Vertex) -> Array | None:
    """Unit directions of the edges at a vertex away from it; None where one of them has none."""
    directions = []
    for index, side in vertex.edges:
        edge = topology.edges[index]
        face = topology.faces[edge.face_a]
        curve = face.boundary[edge.curve_a]
        _, rate = edge_point(face.surface, curve, np.array(curve.domain)[[side]])
        length = float(np.linalg.norm(rate))
        low, high = curve.domain
        if length * (high - low) < 1e-6 * edge.length:
            return None
        directions.append((-1.0 if side else 1.0) * rate[0] / length)
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
