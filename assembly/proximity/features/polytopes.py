"""Convex bodies of flat faces, and how deep two of them are in each other, exactly.

The depth along a unit vector n is h(n) = max over a of n.x - min over b of n.y: how far b is to be moved along n until
a plane is between the two. The differences x - y fill a convex polytope; its facets are facets of a, facets of b turned
around, and parallelograms of an edge of either. Where it has the origin inside, the nearest of its facets is the least
way out. So h is least at a normal of a face or across an edge of either, and at all other n it is no less.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays
from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.elementary import elementary_form
from assembly.geometry.recognition.forms import Plane
from assembly.proximity.brep.solid import solid_of

__all__ = ["Parting", "Polytope", "partings", "polytope_of"]

Array = NDArray[np.float64]
Faces = tuple[Face, ...]
# [size of a face] Planes of files are off by some 1e-11, and corners from them by some more [size of the body].
FLAT, CORNERS = 1e-10, 1e-9
# Bodies of more pairs of edges are searched in other ways: they are as fast there.
MOST = 2_000
# Numbers that are held at once.
ROOM = 2_000_000
# The sine below which edges are parallel: the facet that they make is thinner than rounding.
PARALLEL = 1e-12
# What rounding may make of depths, in parts of the coordinates.
ROUNDING = 1e-14


@dataclass(frozen=True, eq=False)
class Polytope(ReadOnlyArrays):
    """A convex body of flat faces.

    Attributes
    ----------
    corners : (n, 3)
        Its vertices, in the order of its topology.
    normals, heights : (f, 3), (f,)
        Of every face, in that order: its points have normal.x = height, all of the body no more.
    ends : (e, 2)
        The vertices of every edge.
    lines : (k, 3)
        Unit directions of its edges, each once.
    """

    corners: Array
    normals: Array
    heights: Array
    ends: NDArray[np.int64]
    lines: Array

    def has_inside(self, point: Array, radius: float) -> bool:
        """Whether a ball is inside."""
        return float((self.normals @ point - self.heights).max()) < -radius

    @cached_property
    def _edges(self) -> tuple[Array, Array, Array]:
        """Where edges begin and their ways to their ends (e, 3), and the squares of their lengths (e,)."""
        begin = self.corners[self.ends[:, 0]]
        way = self.corners[self.ends[:, 1]] - begin
        return begin, way, (way * way).sum(axis=1)

    def edge_at(self, point: Array, tolerance: float) -> int | None:
        """The nearest edge, if a point is as near to one as that."""
        begin, way, squares = self._edges
        off = point - begin
        part = np.minimum(np.maximum(np.einsum("ij,ij->i", off, way) / squares, 0.0), 1.0)
        off -= part[:, None] * way
        apart = np.einsum("ij,ij->i", off, off)
        nearest = int(apart.argmin())
        return nearest if apart[nearest] <= tolerance**2 else None


@lru_cache(maxsize=256)
def polytope_of(faces: Faces) -> Polytope | None:
    """A body as a polytope; None where it is none.

    Of a closed boundary in planes, with all vertices on or behind every one of these, every face is a face of what all
    planes leave.
    """
    topology = solid_of(faces)
    if not topology.is_closed or not all(edge.convex is True for edge in topology.edges):
        return None
    if any(edge.start is None or edge.end is None for edge in topology.edges) or len(topology.vertices) < 4:
        return None
    forms = [elementary_form(face.surface, FLAT * face.surface.size) for face in topology.faces]
    planes = [form for form in forms if isinstance(form, Plane)]
    if len(planes) < len(forms):
        return None
    senses = np.array([1.0 if face.sign > 0 else -1.0 for face in topology.faces])
    normals = np.array([plane.normal for plane in planes]) * senses[:, None]
    heights = (np.array([plane.point for plane in planes]) * normals).sum(axis=1)
    corners = np.array([vertex.point for vertex in topology.vertices])
    within = CORNERS * float(np.ptp(corners, axis=0).max())
    beyond = corners @ normals.T - heights
    of_face = [[number in vertex.faces for number in range(len(normals))] for vertex in topology.vertices]
    if beyond.max() > within or np.abs(beyond[np.array(of_face)]).max() > within:
        return None
    ends = np.array([(edge.start, edge.end) for edge in topology.edges], dtype=np.int64)
    return Polytope(corners, normals, heights, ends, _distinct(corners[ends[:, 1]] - corners[ends[:, 0]]))


def _distinct(ways: Array) -> Array:
    """Unit vectors along ways (n, 3), without those that are along others to rounding."""
    ways = ways / np.linalg.norm(ways, axis=1)[:, None]
    kept: list[Array] = []
    for way in ways:
        if not kept or np.linalg.norm(np.cross(np.array(kept), way), axis=1).min() > PARALLEL:
            kept.append(way)
    return np.array(kept)


class Parting(NamedTuple):
    """What parts two polytopes.

    Attributes
    ----------
    depth : float
        The second one is apart once it is moved by that, and by no less; where it is below zero, a plane is between the
        two, and they are apart by as much at least.
    normal : (3,)
        The unit vector of that move, in the axes of the first body.
    is_nested : bool
        Whether one of them has all corners of the other one inside, or on its boundary to within a length.
    """

    depth: float
    normal: Array
    is_nested: bool


def partings(a: Polytope, b: Polytope, turns: Array, shifts: Array, within: Sequence[float]) -> list[Parting] | None:
    """What parts two polytopes, the second one at x -> turn x + shift seen from the first, of many such places.

    Parameters
    ----------
    a, b : Polytope
    turns, shifts : (m, 3, 3), (m, 3)
    within : sequence of float
        Of every place the length to which corners count as inside.

    Returns
    -------
    list of Parting or None
        None of bodies that have too many edges.
    """
    if len(a.lines) * len(b.lines) > MOST:
        return None
    count = (len(a.normals) + len(b.normals) + 2 * len(a.lines) * len(b.lines)) * (len(a.corners) + len(b.corners))
    step = max(1, ROOM // count)
    found: list[Parting] = []
    for k in range(0, len(turns), step):
        found += _partings(a, b, turns[k : k + step], shifts[k : k + step], np.array(within[k : k + step]))
    return found


def _partings(a: Polytope, b: Polytope, turns: Array, shifts: Array, within: Array) -> list[Parting]:
    back = turns.transpose(0, 2, 1)
    corners = b.corners @ back + shifts[:, None]
    normals = b.normals @ back
    across = _across(a.lines, b.lines @ back, a.normals[0])
    own = np.broadcast_to(a.normals, (len(turns), *a.normals.shape))
    ways = np.concatenate([own, -normals, across, -across], axis=1)
    depths = (ways @ a.corners.T).max(axis=2) - (ways @ corners.transpose(0, 2, 1)).min(axis=2)
    # Of equal ones the first: a face rather than edges.
    off = ROUNDING * (np.abs(a.corners).max() + np.abs(corners).max(axis=(1, 2)))
    best = (depths <= depths.min(axis=1)[:, None] + off[:, None]).argmax(axis=1)
    beyond_a = (corners @ a.normals.T - a.heights).max(axis=(1, 2))
    heights = b.heights + (normals * shifts[:, None]).sum(axis=2)
    beyond_b = (a.corners @ normals.transpose(0, 2, 1) - heights[:, None]).max(axis=(1, 2))
    nested = np.minimum(beyond_a, beyond_b) <= within
    return [
        Parting(float(depths[k, number]), ways[k, number], bool(nested[k])) for k, number in enumerate(best.tolist())
    ]


def _across(ones: Array, others: Array, instead: Array) -> Array:
    """Unit vectors (m, n, 3) across lines (k, 3) of one body and (m, l, 3) of the other; where none is, another one."""
    x, y, z = (ones[None, :, None, axis] for axis in range(3))
    u, v, w = (others[:, None, :, axis] for axis in range(3))
    found = np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1).reshape(len(others), -1, 3)
    sizes = np.sqrt((found * found).sum(axis=2))[..., None]
    return np.asarray(np.where(sizes > PARALLEL, found / np.maximum(sizes, PARALLEL), instead))
