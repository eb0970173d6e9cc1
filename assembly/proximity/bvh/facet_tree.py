"""A body as facets in a tree of boxes and normal cones: the broad phase before Newton's method.

Faces become patches with two facets each and a proven chord error (`proximity/bvh/facet_patches.py`), edges and
vertices
elements with the normals between their faces (`proximity/bvh/facet_edges.py`, `proximity/bvh/facet_vertices.py`). The
tree
halves the elements at the median along the longest extent of their middles; every node has a box and a ball around its
elements and a cone around their normals.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays, read_only
from assembly._record import rows_of
from assembly.errors import InputError, integer, positive
from assembly.geometry.faces.face import Face
from assembly.proximity.brep.solid import solid_of
from assembly.proximity.brep.topology import Topology
from assembly.proximity.bvh.facet_check import largest_excess
from assembly.proximity.bvh.facet_edges import edge_elements
from assembly.proximity.bvh.facet_elements import Elements
from assembly.proximity.bvh.facet_patches import patches_by_angle, patches_by_count
from assembly.proximity.bvh.facet_vertices import vertex_elements
from assembly.proximity.bvh.tree_nodes import LEAF, LEAF_DTYPE, NODE_ROW, NODE_ROW_DTYPE, write_nodes

__all__ = ["FacetTree", "Nodes"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
# Most patches that may be asked for, and the widest and narrowest cone.
_MOST = 1_000_000
_NARROWEST, _WIDEST = 0.005, 1.5


class Nodes(NamedTuple):
    """The nodes of a tree: the root is the first one, the children of a node follow each other.

    Attributes
    ----------
    child : (m,) of int
        The first of the two children, or -1 - element.
    low, high : (m, 3)
        Boxes around the elements below.
    radius : (m,)
        Of a ball about the middle of the box, around what the elements below hold of the body.
    axis, half_angle : (m, 3), (m,)
        Cones around their outward normals.
    """

    child: Indices
    low: Array
    high: Array
    radius: Array
    axis: Array
    half_angle: Array


@dataclass(frozen=True, eq=False)
class FacetTree(ReadOnlyArrays):
    """Facets, edges and vertices of a body in a tree. Made by `FacetTree.of`.

    Elements are patches first, then parts of edges, then vertices.

    Attributes
    ----------
    topology : Topology
        The body.
    feature : (n,) of int
        The feature of each element: faces first, then edges, then vertices.
    parameters : (n, 4)
        Box of an element: u from and to, v from and to; of an edge t from and to, then zeros; of a vertex zeros.
    low, high : (n, 3)
        Box around the element, body axes.
    axis, half_angle : (n, 3), (n,)
        Cone around the outward normals of the element: of an edge or a vertex all those between its faces. A half
        angle of pi stands for all directions, where nothing narrower is proven.
    corners : (k, 4, 3)
        Of the patches, on the surface, counterclockwise in (u, v).
    chord_error : (k,)
        No point of the surface over a patch is farther from its two facets.
    nodes : Nodes
    """

    topology: Topology = field(repr=False)
    feature: Indices = field(repr=False)
    parameters: Array = field(repr=False)
    low: Array = field(repr=False)
    high: Array = field(repr=False)
    axis: Array = field(repr=False)
    half_angle: Array = field(repr=False)
    corners: Array = field(repr=False)
    chord_error: Array = field(repr=False)
    nodes: Nodes = field(repr=False)

    @staticmethod
    def of(faces: tuple[Face, ...], *, angle: float = 0.2, count: int | None = None) -> FacetTree:
        """The tree of a body's faces, found once.

        Parameters
        ----------
        faces : tuple of Face
        angle : float
            Patches are halved until their normals are within so much of a direction [rad], but for poles and creases.
        count : int, optional
            How many patches instead, those with the largest chord error halved first; at least one a Bezier piece.

        Raises
        ------
        InputError
            No faces, an angle or a count out of range.
        TypeError
            Something that is not a tuple of faces.
        """
        if not isinstance(faces, tuple) or not all(isinstance(face, Face) for face in faces):
            raise TypeError(f"faces is {faces!r}; expected a tuple of Face")
        if not faces:
            raise InputError("faces is empty; expected at least one Face")
        angle = positive("angle", angle)
        if not _NARROWEST <= angle <= _WIDEST:
            raise InputError(f"angle is {angle:g}; expected {_NARROWEST:g} to {_WIDEST:g} rad")
        return _tree_of(faces, angle, None if count is None else integer("count", count, 1, _MOST))

    @property
    def offset(self) -> float:
        """The largest chord error: facets thickened by it contain the body's faces."""
        return float(self.chord_error.max(initial=0.0))

    @property
    def least_radius(self) -> float:
        """About the smallest radius of curvature: widths of patches over the angles by which their normals turn."""
        turns = self.half_angle[: len(self.corners)]
        sides = np.linalg.norm(self.corners - np.roll(self.corners, 1, axis=1), axis=2)
        # Where a side is a point, at a pole, the others tell.
        sizes = 0.5 * np.where(sides > 1e-9 * sides.max(), sides, np.inf).min(axis=1)
        curved = (turns > 1e-3) & (turns < 0.5 * np.pi)
        return float((sizes[curved] / turns[curved]).min(initial=np.inf))

    @property
    def triangles(self) -> Array:
        """The facets (m, 3, 3), two a patch, counterclockwise in (u, v); read-only."""
        return read_only(self.corners[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3))

    def check_enclosure(self, samples: int = 1000, seed: int = 0) -> float:
        """The largest excess of random points and normals over what encloses them; it holds where it is not positive.

        Points on every face (within its trim) and edge, and every vertex, against boxes, cones, facets with their
        chord errors, and all nodes above; lengths in parts of the body's size, angles in radians. Infinite where a
        point is in no element.

        Parameters
        ----------
        samples : int
            About how many on every feature.
        seed : int
        """
        return largest_excess(self, integer("samples", samples, 1, _MOST), seed)

    def __repr__(self) -> str:
        faces, rest = len(self.corners), len(self.feature) - len(self.corners)
        return f"FacetTree({2 * faces} facets, {rest} elements of edges and vertices, offset {self.offset:.3g})"


@lru_cache(maxsize=128)
def _tree_of(faces: tuple[Face, ...], angle: float, count: int | None) -> FacetTree:
    topology = solid_of(faces)
    patches = patches_by_angle(topology.faces, angle) if count is None else patches_by_count(topology.faces, count)
    measures = patches.measures
    of_patches = Elements(
        patches.face, patches.parameters, measures.low, measures.high, measures.axis, measures.half_angle
    )
    edges = edge_elements(topology, angle)
    elements = Elements.joined([of_patches, edges, vertex_elements(topology, edges)])
    corners, chord_error = np.array(measures.corners), np.array(measures.chord_error)
    nodes = _nodes_of(elements, corners, chord_error)
    for array in (*elements, corners, chord_error, *nodes):
        array.flags.writeable = False
    return FacetTree(topology, *elements, corners, chord_error, nodes)


def _nodes_of(elements: Elements, corners: Array, chord_error: Array) -> Nodes:
    """Nodes over elements, of which the first have corners."""
    count, patches = len(elements.low), len(corners)
    rows = np.empty((count, LEAF))
    leaves = rows_of(LEAF_DTYPE, rows)
    leaves.cone[:, :3], leaves.cone[:, 3] = elements.axis, elements.half_angle
    leaves.low, leaves.high = elements.low, elements.high
    leaves.middle = 0.5 * (elements.low + elements.high)
    # Every element is within a distance of the hull of four points: its corners, or its middle.
    leaves.points = leaves.middle[:, None]
    leaves.points[:patches] = corners
    leaves.beyond = 0.5 * np.linalg.norm(elements.high - elements.low, axis=1)
    leaves.beyond[:patches] = chord_error
    total = 2 * count - 1
    child, out = np.empty(total, dtype=np.int64), np.empty((total, NODE_ROW))
    write_nodes(rows, np.empty((2, count), dtype=np.int64), np.empty((total, 2), dtype=np.int64), child, out)
    nodes = rows_of(NODE_ROW_DTYPE, out)
    return Nodes(child, *(np.array(nodes[name]) for name in ("low", "high", "radius", "axis", "half_angle")))
