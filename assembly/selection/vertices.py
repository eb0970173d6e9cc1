"""Vertices of a body, where edges end, selected by place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._read_only import read_only
from assembly.kinematics.body import Body
from assembly.kinematics.body_face import BodyFace
from assembly.kinematics.frame import Point
from assembly.proximity.brep.topology import Vertex
from assembly.selection.edges import BodyEdge, owners_of, topology_of_body
from assembly.selection.selection import Selection, checked_place

__all__ = ["BodyVertex", "Vertices", "vertices_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BodyVertex:
    """One vertex of a body.

    Attributes
    ----------
    body : Body
    index : int
        Among the vertices of the body.
    """

    body: Body
    index: int

    def __repr__(self) -> str:
        return f"{self.body.name}.vertices[{self.index}]"

    @property
    def _vertex(self) -> Vertex:
        return topology_of_body(self.body).vertices[self.index]

    @property
    def name(self) -> str:
        """Its number and place, to be read."""
        x, y, z = (np.round(self.center, 9) + 0.0).tolist()
        return f"vertex {self.index} at ({x:g}, {y:g}, {z:g})"

    @property
    def center(self) -> Array:
        """Where it is, (3,), in the body's coordinates."""
        return read_only(self._vertex.point)

    @property
    def centroid(self) -> Array:
        """The same."""
        return self.center

    @property
    def point(self) -> Point:
        """The point of the body there."""
        return self.body.point(*self.center.tolist())

    @property
    def edges(self) -> tuple[BodyEdge, ...]:
        """The edges that end there."""
        every = self.body.edges
        return tuple(every[k] for k in dict.fromkeys(k for k, _ in self._vertex.edges))

    @property
    def faces(self) -> tuple[BodyFace, ...]:
        """The faces that meet there."""
        owners = owners_of(self.body)
        return tuple(self.body.faces[k] for k in dict.fromkeys(owners[k] for k in self._vertex.faces))

    def at_least(self, point: Array) -> float:
        """What its distance of a point (3,) is at least."""
        return float(np.linalg.norm(point - self._vertex.point))

    def distance(self, point: ArrayLike) -> float:
        """How far a point (3,) in the body's coordinates is from it."""
        return float(np.linalg.norm(checked_place("point", point) - self.center))


class Vertices(Selection[BodyVertex]):
    """Vertices of a body: a tuple of `BodyVertex`; `vertices(">X and >Z")` and `vertices.near(point)` select."""

    _word = "vertex"
    _kinds: ClassVar[dict[str, tuple[str, ...]]] = {"vertex": ("VERTEX",)}

    def _kind(self, item: BodyVertex) -> str:
        return "vertex"

    def _direction(self, item: BodyVertex) -> Array | None:
        return None


def vertices_of(body: Body) -> Vertices:
    """The vertices of a body."""
    count = len(topology_of_body(body).vertices) if body.faces else 0
    return Vertices((BodyVertex(body, k) for k in range(count)), f"{body.name}.vertices")
