"""Edges of a body as elements of its tree: parts in t, boxes around them, and cones of their normals.

Where an edge holds an extremal pair the normal is between those of its two faces, if the edge is convex there; where it
is concave there is none. A part of the plane curve has a box in (u, v), over which the Bezier points of the surface
span its box in space, and those of the normal a cone. The part of the second face's curve that is the same part of the
edge is found by Newton's method at its ends, and made a little wider.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.proximity.brep.body_nets import nets_of
from assembly.proximity.brep.boundary_curves import Batch, Rim, survey_of
from assembly.proximity.brep.topology import Topology
from assembly.proximity.bvh.edge_measures import (
    EDGE_PART,
    EDGE_PART_DTYPE,
    EDGE_PLACE,
    EDGE_PLACE_DTYPE,
    measure_edge_parts,
)
from assembly.proximity.bvh.facet_elements import Elements

__all__ = ["edge_elements"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]
# Parts of an edge are no longer than this part of its face; every edge has so many at first, halved so often at most.
_PART, _FIRST, _HALVINGS = 0.25, 4, 6
# Cones around normals along a part for which there is room at first.
_CONES = 16
# How much wider parts are made that are found by Newton's method on the other face.
_WIDER = 0.05


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
        self.nets = nets_of(faces)
        places = np.array(sides)
        self.curve_a, self.curve_b = self.nets.first_curve[places[..., 0]] + places[..., 1]
        survey = survey_of(faces, topology.tolerance)
        self.batch_a, self.batch_b = (
            Batch(survey, [Rim(*place, curve, topology.tolerance) for place, curve in zip(side, row, strict=True)])
            for side, row in zip(sides, curves, strict=True)
        )
        survey.measure(self.batch_b.rims)
        self.wraps_b = np.array([rim.closed for rim in self.batch_b.rims], dtype=bool)
        self.domain_b = np.array([curve.domain for curve in curves[1]]).reshape(-1, 2)
        self.closed = np.array([edge.start is None for edge in edges])
        self.map_b = np.array([edge.map_b for edge in edges]).reshape(-1, 2)
        boxes = np.array([faces[face].surface.bounding_box() for face in self.face_a])
        self.longest = _PART * np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1)
        # Ends of the spans of the first faces' curves, those of all edges in a row.
        self.breaks = [self.nets.breaks[curve] for curve in self.curve_a]
        spans = np.array([at.size - 1 for at in self.breaks])
        self.first_span = np.cumsum(spans) - spans
        self.start = np.concatenate([at[:-1] for at in self.breaks])
        self.stop = np.concatenate([at[1:] for at in self.breaks])

    def first(self) -> _Parts:
        """The spans of all edges in equal parts."""
        edge, span, low, high = [], [], [], []
        for k, at in enumerate(self.breaks):
            count = -(-_FIRST // (at.size - 1))
            x = np.arange(count + 1) / count
            edge.append(np.full(count * (at.size - 1), k))
            span.append(np.repeat(self.first_span[k] + np.arange(at.size - 1), count))
            low.append(np.tile(x[:-1], at.size - 1))
            high.append(np.tile(x[1:], at.size - 1))
        return _Parts(*(np.concatenate(column) for column in (edge, span, low, high)))

    def parameters(self, parts: _Parts) -> Array:
        """t from and to, (n, 2)."""
        start, stop = self.start[parts.span], self.stop[parts.span]
        ends = [np.where(x == 1.0, stop, start + x * (stop - start)) for x in (parts.low, parts.high)]
        return np.stack(ends, axis=1)

    def measured(self, parts: _Parts) -> tuple[Elements, Array, Mask]:
        """Parts as elements; how far a face's normals turn over each, and which of them are concave."""
        t = self.parameters(parts)
        edge, nets = parts.edge, self.nets
        paired = self.face_b[edge] >= 0
        sides = np.column_stack(
            [
                self.face_a[edge],
                nets.curve_records(self.curve_a[edge]),
                parts.span - self.first_span[edge],
                self.face_b[edge],
                nets.curve_records(self.curve_b[edge]),
                self.closed[edge],
            ]
        )
        rows = np.zeros((len(edge), EDGE_PLACE))
        places = rows_of(EDGE_PLACE_DTYPE, rows)
        places.low, places.high = parts.low, parts.high
        places.low_b[paired], places.high_b[paired] = self._on_second(edge[paired], t[paired])
        places.along = self.batch_a.along(edge, t.mean(axis=1))[1]
        found = rows_of(EDGE_PART_DTYPE, self._measured(sides, rows))
        # Points of the second face's curve are as far off as two points that are one.
        pad = np.where(paired, self.topology.tolerance, 0.0)[:, None]
        feature = len(self.topology.faces) + edge
        parameters = np.concatenate([t, np.zeros_like(t)], axis=1)
        cone = np.array(found.axis), np.array(found.half_angle)
        elements = Elements(feature, parameters, found.low - pad, found.high + pad, *cone)
        return elements, found.turn, found.concave == 1.0

    def _measured(self, sides: Indices, places: Array) -> Array:
        """Rows EDGE_PART of rows EDGE_SIDES and EDGE_PLACE."""
        nets = self.nets
        out = np.empty((len(sides), EDGE_PART))
        room, need = 0, _CONES
        # Once more where a part runs through more pieces than there was room for.
        while need > room:
            room = need
            memory = np.empty((room, 4)), np.arange(room), nets.workspace()
            need = measure_edge_parts((nets.table, nets.pool), sides, places, *memory, out)
        return out

    def _on_second(self, edge: Indices, t: Array) -> tuple[Array, Array]:
        """From where to where parts of edges go on their second faces' curves, a little wider."""
        row = np.repeat(np.arange(len(edge)), 2)
        points, _, _ = self.batch_a.along(edge[row], t.ravel())
        ends = self._at_points(edge[row], t.ravel(), points).reshape(-1, 2)
        low, high = ends.min(axis=1), ends.max(axis=1)
        wider = _WIDER * (high - low) + 1e-9 * np.diff(self.domain_b[edge], axis=1)[:, 0]
        low, high = low - wider, high + wider
        held = ~self.closed[edge]
        low = np.where(held, np.maximum(low, self.domain_b[edge, 0]), low)
        high = np.where(held, np.minimum(high, self.domain_b[edge, 1]), high)
        return low, high

    def _at_points(self, edge: Indices, t: Array, points: Array) -> Array:
        """Where edges are at the same points on their second faces; beyond the domain of closed ones."""
        low, high = self.domain_b[edge].T
        guess = self.map_b[edge, 0] + self.map_b[edge, 1] * t
        found, _ = self.batch_b.nearest(edge, points, guess)
        turns = np.where(self.wraps_b[edge], np.round((guess - found) / (high - low)), 0.0)
        found = found + turns * (high - low)
        return np.asarray(np.where(self.closed[edge], found, np.clip(found, low, high)))


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
