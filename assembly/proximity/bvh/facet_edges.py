"""Edges of a body as elements of its tree: parts in t, boxes around them, and cones of their normals.

Where an edge holds an extremal pair the normal is between those of its two faces, if the edge is convex there; where it
is concave there is none. A part of the plane curve has a box in (u, v), over which the Bezier points of the surface
span its box in space, and those of the normal a cone. The part of the second face's curve that is the same part of the
edge is found by Newton's method at its ends, and made a little wider.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.splines.curve import NurbsCurve
from assembly.proximity.brep.boundary_curves import Batch, Rim, Survey
from assembly.proximity.brep.edge_cells import box_hulls, box_parts, interval_parts
from assembly.proximity.brep.topology import Topology
from assembly.proximity.bvh.cones import CONVEX, FULL, MARGIN, around_cones, around_vectors, between
from assembly.proximity.bvh.facet_elements import Elements
from assembly.proximity.bvh.normal_nets import Nets, nets_of, restricted, restriction

__all__ = ["edge_elements"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]
# Parts of an edge are no longer than this part of its face; every edge has so many at first, halved so often at most.
_PART, _FIRST, _HALVINGS = 0.25, 4, 6
# How much wider parts are made that are found by Newton's method on the other face.
_WIDER = 0.05


class _Curves:
    """Plane curves as Bezier pieces, all spans of all curves in a row."""

    def __init__(self, curves: Sequence[NurbsCurve]) -> None:
        self.breaks = [curve.breaks() for curve in curves]
        counts = np.array([at.size - 1 for at in self.breaks], dtype=np.int64)
        self.first = np.cumsum(counts) - counts
        self.start = np.concatenate([at[:-1] for at in self.breaks])
        self.stop = np.concatenate([at[1:] for at in self.breaks])
        sizes = np.array([np.abs(curve.control_points).max(axis=0) for curve in curves])
        self.slack = MARGIN * np.repeat(sizes, counts, axis=0)
        degrees = np.repeat([curve.degree for curve in curves], counts)
        pieces = [piece for curve in curves for piece in curve.bezier_pieces()]
        self.groups = [
            (degrees == degree, np.stack([pieces[k] for k in np.flatnonzero(degrees == degree)]))
            for degree in np.unique(degrees)
        ]

    def boxes(self, span: Indices, low: Array, high: Array) -> Array:
        """Boxes (n, 4) in (u, v) around parts from low to high of the unit intervals of spans."""
        result = np.empty((len(span), 4))
        for members, pieces in self.groups:
            rows = np.flatnonzero(members[span])
            if rows.size:
                place = (np.cumsum(members) - 1)[span[rows]]
                points = restriction(pieces.shape[1] - 1, low[rows], high[rows]) @ pieces[place]
                plane = points[..., :2] / points[..., 2:]
                slack = self.slack[span[rows]]
                result[rows, ::2] = plane.min(axis=1) - slack
                result[rows, 1::2] = plane.max(axis=1) + slack
        return result


class _Parts(NamedTuple):
    """Parts of edges: which edge, its span, and from where to where in the span's unit interval."""

    edge: Indices
    span: Indices
    low: Array
    high: Array

    def at(self, chosen: Mask) -> _Parts:
        """Some of them."""
        return _Parts(self.edge[chosen], self.span[chosen], self.low[chosen], self.high[chosen])

    def halved(self) -> _Parts:
        """Both halves of each."""
        middle = 0.5 * (self.low + self.high)
        low, high = np.concatenate([self.low, middle]), np.concatenate([middle, self.high])
        return _Parts(np.tile(self.edge, 2), np.tile(self.span, 2), low, high)


class _Edges:
    """All edges of a body, measured together."""

    def __init__(self, topology: Topology) -> None:
        self.topology = topology
        faces, edges = topology.faces, topology.edges
        self.face_a = np.array([edge.face_a for edge in edges], dtype=np.int64)
        self.face_b = np.array([-1 if edge.face_b is None else edge.face_b for edge in edges], dtype=np.int64)
        # A free edge is its own other one: a place in the arrays that nobody asks for.
        sides = [
            [(edge.face_a, edge.curve_a) for edge in edges],
            [
                (edge.face_a, edge.curve_a)
                if edge.face_b is None or edge.curve_b is None
                else (edge.face_b, edge.curve_b)
                for edge in edges
            ],
        ]
        curves = [[faces[face].boundary[index] for face, index in side] for side in sides]
        self.curves_a, self.curves_b = _Curves(curves[0]), _Curves(curves[1])
        survey = Survey(faces, topology.tolerance)
        self.batch_a, self.batch_b = (
            Batch(survey, [Rim(*place, curve, topology.tolerance) for place, curve in zip(side, row, strict=True)])
            for side, row in zip(sides, curves, strict=True)
        )
        survey.measure(self.batch_b.rims)
        self.wraps_b = np.array([rim.closed for rim in self.batch_b.rims], dtype=bool)
        self.domain_b = np.array([curve.domain for curve in curves[1]]).reshape(-1, 2)
        self.closed = np.array([edge.start is None for edge in edges])
        self.map_b = np.array([edge.map_b for edge in edges]).reshape(-1, 2)
        self.sign = np.array([faces[face].sign for face in self.face_a], dtype=float)
        boxes = [faces[face].surface.bounding_box() for face in self.face_a]
        self.longest = _PART * np.array([np.linalg.norm(high - low) for low, high in boxes])
        self.nets: dict[int, Nets] = {
            face: nets_of(faces[face]) for face in np.unique([*self.face_a, *self.face_b]).tolist() if face >= 0
        }

    def first(self) -> _Parts:
        """The spans of all edges in equal parts."""
        edge, span, low, high = [], [], [], []
        for k, at in enumerate(self.curves_a.breaks):
            count = -(-_FIRST // (at.size - 1))
            x = np.arange(count + 1) / count
            edge.append(np.full(count * (at.size - 1), k))
            span.append(np.repeat(self.curves_a.first[k] + np.arange(at.size - 1), count))
            low.append(np.tile(x[:-1], at.size - 1))
            high.append(np.tile(x[1:], at.size - 1))
        return _Parts(*(np.concatenate(column) for column in (edge, span, low, high)))

    def parameters(self, parts: _Parts) -> Array:
        """t from and to, (n, 2)."""
        curves = self.curves_a
        start, stop = curves.start[parts.span], curves.stop[parts.span]
        ends = [np.where(x == 1.0, stop, start + x * (stop - start)) for x in (parts.low, parts.high)]
        return np.stack(ends, axis=1)

    def measured(self, parts: _Parts) -> tuple[Elements, Array, Mask]:
        """Parts as elements; how far a face's normals turn over each, and which of them are concave."""
        t = self.parameters(parts)
        edge, paired = parts.edge, self.face_b[parts.edge] >= 0
        count = len(edge)
        boxes = self.curves_a.boxes(parts.span, parts.low, parts.high)
        owner, other_boxes = self._others(edge[paired], t[paired])
        both = np.flatnonzero(paired)
        axis, half = self._normals(
            np.concatenate([self.face_a[edge], self.face_b[edge[both][owner]]]),
            np.concatenate([boxes, other_boxes]),
            np.concatenate([2 * np.arange(count), 2 * both[owner] + 1]),
        )
        # One cone a part, or two where there is another face.
        sides = 1 + paired
        begins = np.cumsum(sides) - sides
        turn = np.maximum.reduceat(half, begins)
        concave = np.zeros(count, dtype=bool)
        one, other = begins[paired], begins[paired] + 1
        concave[paired] = self._concave(edge[paired], t[paired], (axis[one], half[one]), (axis[other], half[other]))
        axis, half = around_cones(axis, half, begins)
        half = np.where(paired & (half < CONVEX), half, FULL)
        low, high = self._hulls(edge, boxes)
        # Points of the second face's curve are as far off as two points that are one.
        pad = np.where(paired, self.topology.tolerance, 0.0)[:, None]
        low, high = low - pad, high + pad
        feature = len(self.topology.faces) + edge
        elements = Elements(feature, np.concatenate([t, np.zeros_like(t)], axis=1), low, high, axis, half)
        return elements, turn, concave

    def _others(self, edge: Indices, t: Array) -> tuple[Indices, Array]:
        """Boxes around the second face's curve over parts of edges, and the part each belongs to."""
        row = np.repeat(np.arange(len(edge)), 2)
        points, _, _ = self.batch_a.along(edge[row], t.ravel())
        ends = self._at_points(edge[row], t.ravel(), points).reshape(-1, 2)
        low, high = ends.min(axis=1), ends.max(axis=1)
        wider = _WIDER * (high - low) + 1e-9 * np.diff(self.domain_b[edge], axis=1)[:, 0]
        low, high = low - wider, high + wider
        held = ~self.closed[edge]
        low = np.where(held, np.maximum(low, self.domain_b[edge, 0]), low)
        high = np.where(held, np.minimum(high, self.domain_b[edge, 1]), high)
        owners, spans, starts, stops = [], [], [], []
        for k in np.unique(edge).tolist():
            mine = np.flatnonzero(edge == k)
            owner, span, x0, x1 = interval_parts(low[mine], high[mine], self.curves_b.breaks[k], bool(self.closed[k]))
            owners.append(mine[owner])
            spans.append(self.curves_b.first[k] + span)
            starts.append(x0)
            stops.append(x1)
        if not owners:
            return np.empty(0, dtype=np.int64), np.empty((0, 4))
        boxes = self.curves_b.boxes(np.concatenate(spans), np.concatenate(starts), np.concatenate(stops))
        return np.concatenate(owners), boxes

    def _at_points(self, edge: Indices, t: Array, points: Array) -> Array:
        """Where edges are at the same points on their second faces; beyond the domain of closed ones."""
        low, high = self.domain_b[edge].T
        guess = self.map_b[edge, 0] + self.map_b[edge, 1] * t
        found, _ = self.batch_b.nearest(edge, points, guess)
        turns = np.where(self.wraps_b[edge], np.round((guess - found) / (high - low)), 0.0)
        found = found + turns * (high - low)
        return np.asarray(np.where(self.closed[edge], found, np.clip(found, low, high)))

    def _normals(self, face: Indices, boxes: Array, owner: Indices) -> tuple[Array, Array]:
        """Cones around outward normals over boxes (n, 4) in (u, v) of faces; one an owner, in the order of owners."""
        axes, halves, owners = [], [], []
        for number in np.unique(face).tolist():
            mine = np.flatnonzero(face == number)
            nets = self.nets[number]
            parts = box_parts(self.topology.faces[number].surface, boxes[mine])
            at = parts.span_u, parts.span_v
            net = restricted(nets.normals[at], parts.box)
            axis, half = around_vectors(net.reshape(len(net), -1, 3), nets.slack[at], nets.poles[at])
            axes.append(axis)
            halves.append(half)
            owners.append(owner[mine[parts.owner]])
        whose = np.concatenate(owners)
        order = np.argsort(whose, kind="stable")
        begins = np.flatnonzero(np.diff(whose[order], prepend=-1))
        return around_cones(np.concatenate(axes)[order], np.concatenate(halves)[order], begins)

    def _hulls(self, edge: Indices, boxes: Array) -> tuple[Array, Array]:
        """Boxes in space around the first faces' surfaces over boxes (n, 4) in (u, v)."""
        low, high = np.empty((len(edge), 3)), np.empty((len(edge), 3))
        face = self.face_a[edge]
        for number in np.unique(face).tolist():
            mine = np.flatnonzero(face == number)
            xyz, owner = box_hulls(self.topology.faces[number].surface, boxes[mine])
            begins = np.flatnonzero(np.diff(owner, prepend=-1))
            pad = MARGIN * self.nets[number].extent
            low[mine] = np.minimum.reduceat(xyz.min(axis=1), begins) - pad
            high[mine] = np.maximum.reduceat(xyz.max(axis=1), begins) + pad
        return low, high

    def _concave(self, edge: Indices, t: Array, a: tuple[Array, Array], b: tuple[Array, Array]) -> Mask:
        """Parts where the faces' normals are never parallel, and material bends toward the outside at the middle."""
        _, along, _ = self.batch_a.along(edge, t.mean(axis=1))
        angle = between(a[0], b[0])
        apart = (angle > a[1] + b[1]) & (angle < np.pi - a[1] - b[1])
        return np.asarray(apart & (self.sign[edge] * (np.cross(a[0], b[0]) * along).sum(axis=1) < 0.0))


def edge_elements(topology: Topology, angle: float) -> Elements:
    """Parts of all edges, but for those that are concave; halved while a face's normals turn by more than the angle."""
    result: list[Elements] = []
    if not topology.edges:
        return Elements.joined(result)
    edges = _Edges(topology)
    parts = edges.first()
    for halving in range(_HALVINGS + 1):
        elements, turn, concave = edges.measured(parts)
        large = np.linalg.norm(elements.high - elements.low, axis=1) > edges.longest[parts.edge]
        more = ((turn > angle) | large) & ~concave & (halving < _HALVINGS)
        result.append(elements.at(~more & ~concave))
        if not more.any():
            break
        parts = parts.at(more).halved()
    return Elements.joined(result)
