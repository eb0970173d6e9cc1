"""Edges of a body, where two faces meet or one ends, selected by kind, size and place."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, ClassVar, Literal, Self
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._read_only import read_only
from assembly.errors import InputError, positive
from assembly.geometry.faces.smooth_faces import has_creases, smooth_faces
from assembly.kinematics.body import Body
from assembly.kinematics.body_face import BodyFace
from assembly.kinematics.frame import Frame
from assembly.proximity.brep.solid import solid_of
from assembly.proximity.brep.topology import Edge, Topology
from assembly.selection.edge_forms import EdgeForm, form_of_points
from assembly.selection.nearness import distance_to_boundary, finer
from assembly.selection.selection import Selection, are_parallel, is_about, shown

if TYPE_CHECKING:
    from assembly.selection.vertices import BodyVertex

__all__ = ["BodyEdge", "Edges", "edges_of", "owners_of", "topology_of_body"]

Array = NDArray[np.float64]
# Samples of a smooth part of an edge, by which it is told what it is.
_SAMPLES = 9
# Gauss points of a smooth part, by which its centroid is found.
_GAUSS = np.polynomial.legendre.leggauss(8)


@dataclass(frozen=True, eq=False)
class BodyEdge:
    """One edge of a body, and what it is, in the body's coordinates.

    An edge is a line or a circle where no point of it is farther from one than 1e-6 of the body's size, as far as
    samples tell: points of a body's edges that are nearer than that are one.

    Attributes
    ----------
    body : Body
    index : int
        Among the edges of the body.
    """

    body: Body
    index: int

    def __repr__(self) -> str:
        return f"{self.body.name}.edges[{self.index}]"

    @property
    def name(self) -> str:
        """Its number and the names of its faces, to be read."""
        return f"edge {self.index} ({' | '.join(repr(face.name) for face in self.faces)})"

    @property
    def _topology(self) -> Topology:
        return topology_of_body(self.body)

    @property
    def _edge(self) -> Edge:
        return self._topology.edges[self.index]

    @cached_property
    def faces(self) -> tuple[BodyFace, ...]:
        """The faces that meet there, or the one that ends."""
        owners = owners_of(self.body)
        sides = [k for k in (self._edge.face_a, self._edge.face_b) if k is not None]
        return tuple(dict.fromkeys(self.body.faces[owners[k]] for k in sides))

    @property
    def vertices(self) -> tuple[BodyVertex, ...]:
        """Where it ends; () where it is closed smoothly."""
        every = self.body.vertices
        return tuple(every[k] for k in dict.fromkeys((self._edge.start, self._edge.end)) if k is not None)

    @property
    def length(self) -> float:
        """Its length in space, to some five digits."""
        return self._edge.length

    @property
    def is_convex(self) -> bool | None:
        """Whether material bends away at it; None where faces go smoothly into each other, and of a free edge."""
        return self._edge.convex

    def at(self, t: ArrayLike) -> Array:
        """Points (n, 3) at parameters (n,) of the boundary curve of its first face; see `domain`."""
        face = self._topology.faces[self._edge.face_a]
        u, v = face.boundary[self._edge.curve_a].evaluate(np.atleast_1d(np.asarray(t, dtype=float))).T
        return np.asarray(face.surface.evaluate(u, v))

    @property
    def domain(self) -> tuple[float, float]:
        """Where its parameter begins and ends."""
        breaks = self._breaks
        return float(breaks[0]), float(breaks[-1])

    @cached_property
    def _breaks(self) -> Array:
        """Its ends, and places between them no two of which have more than about a knot of the surface between them."""
        face = self._topology.faces[self._edge.face_a]
        return finer(face.boundary[self._edge.curve_a].breaks(), face.surface)

    @cached_property
    def _form(self) -> EdgeForm | None:
        parts = [np.linspace(a, b, _SAMPLES) for a, b in pairwise(self._breaks)]
        return form_of_points(self.at(np.unique(np.concatenate(parts))), self._topology.tolerance)

    @property
    def kind(self) -> Literal["line", "circle", "spline"]:
        """Line, circle (or an arc of one), or spline where it is another curve."""
        if self._form is None:
            return "spline"
        return "line" if self._form.kind == "line" else "circle"

    @property
    def axis(self) -> Array:
        """The direction of a line, or that across the plane of a circle, (3,); its largest component is positive."""
        return self._formed("axis").axis

    @property
    def radius(self) -> float:
        """Radius of a circle."""
        if self.kind != "circle":
            raise InputError(f"{self.name} of body {self.body.name!r} is a {self.kind} and has no radius")
        return self._formed("radius").radius

    @property
    def center(self) -> Array:
        """Center of a circle, middle of a line, (3,); else the centroid."""
        return self.centroid if self._form is None else self._form.center

    @cached_property
    def centroid(self) -> Array:
        """The mean of its points by length, (3,); of a spline to some six digits."""
        form = self._form
        if form is not None and (form.kind == "line" or self._edge.start is None):
            return form.center
        if form is not None:
            ends = self.at(self.domain) - form.center
            closed = np.linalg.norm(ends[1] - ends[0]) <= self._topology.tolerance
            # sin(a / 2) / (a / 2) of the radius from the center, toward the middle of the arc of angle a.
            bend = 0.5 * self.length / form.radius
            between = self.at([0.5 * sum(self.domain)])[0] - form.center
            toward = ends[0] + ends[1]
            if not np.linalg.norm(toward) > 1e-6 * form.radius:
                toward = between
            toward = toward if toward @ between > 0.0 else -toward
            away = 0.0 if closed else form.radius * np.sin(bend) / bend
            return read_only(np.asarray(form.center + away * toward / np.linalg.norm(toward)))
        breaks = self._breaks
        nodes, weights = _GAUSS
        half = 0.5 * np.diff(breaks)
        t = (breaks[:-1] + half)[:, None] + half[:, None] * nodes
        points = self.at(t.ravel())
        step = 1e-6 * float(np.ptp(breaks))
        low, high = np.maximum(t.ravel() - step, breaks[0]), np.minimum(t.ravel() + step, breaks[-1])
        speed = np.linalg.norm(self.at(high) - self.at(low), axis=1) / (high - low)
        w = (half[:, None] * weights).ravel() * speed
        return read_only(np.asarray(w @ points / w.sum()))

    def frame(self) -> Frame:
        """The frame at its center: z is a line's direction, or across a circle's plane.

        Where a circle bounds a plane that it lies in, z is the outward normal of that plane.
        """
        form = self._formed("frame")
        axis = form.axis
        if form.kind == "circle":
            for face in self.faces:
                if face.kind == "plane" and are_parallel(face.normal, axis):
                    axis = face.normal
                    break
        return self.body.frame(form.center, axis)

    def at_least(self, point: Array) -> float:
        """What its distance of a point (3,) is at least: it is on all of its faces, to the tolerance of points."""
        return max(face.at_least(point) for face in self.faces) - self._topology.tolerance

    def distance(self, point: ArrayLike) -> float:
        """How far a point (3,) in the body's coordinates is from it; proven, as the distance of a face is."""
        return distance_to_boundary(self._topology.faces[self._edge.face_a], self._edge.curve_a, point)

    def _formed(self, what: str) -> EdgeForm:
        if self._form is None:
            raise InputError(
                f"{self.name} of body {self.body.name!r} is a spline and has no {what}; expected a line or a circle"
            )
        return self._form


class Edges(Selection[BodyEdge]):
    """Edges of a body: a tuple of `BodyEdge`, and what selects among them; see `Faces`."""

    _word = "edge"
    _have_sense = False
    _kinds: ClassVar[dict[str, tuple[str, ...]]] = {
        "line": ("LINE",),
        "circle": ("CIRCLE",),
        "spline": ("SPLINE", "BSPLINE", "BEZIER", "OTHER"),
    }

    def circles(self, radius: float | None = None, axis: ArrayLike | None = None) -> Self:
        """Circles and arcs of them, with this radius, in planes across this direction."""
        asked, along = None if radius is None else positive("radius", radius), is_about("axis", axis)

        def fits(edge: BodyEdge) -> bool:
            if edge.kind != "circle" or (asked is not None and not self._equal(edge.radius, asked)):
                return False
            return along is None or are_parallel(edge.axis, along)

        return self._chosen(fits, f".circles{shown(radius=radius, axis=axis)}")

    def lines(self, direction: ArrayLike | None = None) -> Self:
        """Straight edges, along this direction in either sense."""
        along = is_about("direction", direction)
        return self._chosen(
            lambda edge: edge.kind == "line" and (along is None or are_parallel(edge.axis, along)),
            f".lines{shown(direction=direction)}",
        )

    def of(self, *faces: BodyFace) -> Self:
        """Those that all of these faces have."""
        for face in faces:
            if not isinstance(face, BodyFace):
                raise TypeError(f"face is {face!r}; expected a face of a body")
            if self and face not in self[0].body.faces:
                raise InputError(f"face is {face!r}; expected one of body {self[0].body.name!r}, whose edges these are")
        return self._chosen(
            lambda edge: all(face in edge.faces for face in faces), f".of({', '.join(map(repr, faces))})"
        )

    def longest(self) -> Self:
        """The longest; of several that are as long, to five digits, the first."""
        if not self:
            return self._chosen(lambda edge: True, ".longest()")
        lengths = np.array([edge.length for edge in self])
        first = int(np.argmax(lengths >= lengths.max() * (1.0 - 1e-5)))
        return type(self)((self[first],), f"{self._said}.longest()", self)

    def _kind(self, item: BodyEdge) -> str:
        return item.kind

    def _direction(self, item: BodyEdge) -> Array | None:
        return item.axis if item.kind == "line" else None

    def _described(self, item: BodyEdge) -> str:
        size = f", radius {item.radius:.6g}" if item.kind == "circle" else ""
        return f"{item.name}: {item.kind}{size}"


# Topologies and owners of bodies: to look them up by all faces takes as long as a body has faces, for each edge.
_KNOWN: WeakKeyDictionary[Body, tuple[Topology, list[int]]] = WeakKeyDictionary()


def _known(body: Body) -> tuple[Topology, list[int]]:
    known = _KNOWN.get(body)
    if known is None:
        parts = [len(smooth_faces(side.face)) if has_creases(side.face) else 1 for side in body.faces]
        owners = [k for k, count in enumerate(parts) for _ in range(count)]
        known = _KNOWN[body] = solid_of(tuple(side.face for side in body.faces)), owners
    return known


def topology_of_body(body: Body) -> Topology:
    """Faces, edges and vertices of a body with a shape; faces with creases count as several."""
    return _known(body)[0]


def owners_of(body: Body) -> list[int]:
    """Which face of the body each face of its topology is, or is a part of."""
    return _known(body)[1]


def edges_of(body: Body) -> Edges:
    """The edges of a body; `body.edges` keeps them, and what is known of them."""
    count = len(topology_of_body(body).edges) if body.faces else 0
    return Edges((BodyEdge(body, k) for k in range(count)), f"{body.name}.edges")
