"""Random points and normals of a body against what its tree says encloses them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity.brep.boundary_curves import Batch, Rim, Survey
from assembly.proximity.brep.topology import Edge, Topology
from assembly.proximity.bvh.cones import FULL, between

if TYPE_CHECKING:
    from assembly.proximity.bvh.facet_tree import FacetTree

__all__ = ["edge_point", "largest_excess", "other_parameter", "triangle_distance"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
# Normals are not asked for where |Su x Sv| is below this part of |Su| |Sv|.
_SINGULAR = 1e-9
# Pairs of points and elements looked at together.
_PAIRS = 4_000_000


def triangle_distance(points: Array, triangles: Array) -> Array:
    """Distances of points (n, 3) from triangles (n, 3, 3), which may be segments or points."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    best = np.full(len(points), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        along = end - start
        square = (along**2).sum(axis=1)
        t = np.clip(((points - start) * along).sum(axis=1) / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(points - start - t[:, None] * along, axis=1))
    normal = np.cross(b - a, c - a)
    square = (normal**2).sum(axis=1)
    inside = square > 0.0
    for start, end in ((a, b), (b, c), (c, a)):
        inside &= (np.cross(end - start, points - start) * normal).sum(axis=1) >= 0.0
    height = np.abs(((points - a) * normal).sum(axis=1)) / np.sqrt(np.where(square > 0.0, square, 1.0))
    return np.where(inside, np.minimum(best, height), best)


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
    """Where an edge with two faces is at the same points on its second one."""
    assert edge.face_b is not None and edge.curve_b is not None
    a, b = topology.faces[edge.face_a], topology.faces[edge.face_b]
    points, _ = edge_point(a.surface, a.boundary[edge.curve_a], t)
    curve = b.boundary[edge.curve_b]
    survey, rim = Survey([b], topology.tolerance), Rim(0, edge.curve_b, curve, topology.tolerance)
    survey.measure([rim])
    guess = edge.map_b[0] + edge.map_b[1] * t
    return Batch(survey, [rim]).nearest(np.zeros(t.size, dtype=np.int64), points, guess)[0]


class _Checked:
    """What is measured of a tree."""

    def __init__(self, tree: FacetTree) -> None:
        self.tree = tree
        self.size = float(np.linalg.norm(tree.high.max(axis=0) - tree.low.min(axis=0)))
        self.excess = -np.inf
        self.parents = np.full(len(tree.nodes.child), -1)
        inner = np.flatnonzero(tree.nodes.child >= 0)
        for k in range(2):
            self.parents[tree.nodes.child[inner] + k] = inner
        leaves = np.flatnonzero(tree.nodes.child < 0)
        self.leaf = np.empty(len(leaves), dtype=np.int64)
        self.leaf[-1 - tree.nodes.child[leaves]] = leaves

    def take(self, excess: Array) -> None:
        self.excess = max(self.excess, float(np.max(excess, initial=-np.inf)))

    def points(self, element: Indices, points: Array) -> None:
        """Points in boxes, up to the root."""
        tree = self.tree
        self._in_boxes(points, tree.low[element], tree.high[element])
        at = self.leaf[element]
        while len(at):
            low, high = tree.nodes.low[at], tree.nodes.high[at]
            self._in_boxes(points, low, high)
            self.take((np.linalg.norm(points - 0.5 * (low + high), axis=1) - tree.nodes.radius[at]) / self.size)
            at, points = self.parents[at], points[self.parents[at] >= 0]
            at = at[at >= 0]

    def _in_boxes(self, points: Array, low: Array, high: Array) -> None:
        self.take(np.maximum(low - points, points - high) / self.size)

    def normals(self, element: Indices, normals: Array) -> None:
        """Unit normals in cones, up to the root."""
        tree = self.tree
        self._in_cones(normals, tree.axis[element], tree.half_angle[element])
        at = self.leaf[element]
        while len(at):
            self._in_cones(normals, tree.nodes.axis[at], tree.nodes.half_angle[at])
            at, normals = self.parents[at], normals[self.parents[at] >= 0]
            at = at[at >= 0]

    def _in_cones(self, normals: Array, axis: Array, half: Array) -> None:
        self.take(np.where(half < FULL, between(normals, axis) - half, -np.inf))


def largest_excess(tree: FacetTree, samples: int, seed: int) -> float:
    """The largest excess of points and normals; see `FacetTree.check_enclosure`."""
    checked = _Checked(tree)
    rng = np.random.default_rng(seed)
    for number in range(len(tree.topology.faces)):
        _check_face(checked, number, samples, rng)
    for number in range(len(tree.topology.edges)):
        _check_edge(checked, number, samples, rng)
    first = len(tree.topology.faces) + len(tree.topology.edges)
    vertices = np.flatnonzero(tree.feature >= first)
    for k in vertices:
        checked.points(np.array([k]), tree.topology.vertices[tree.feature[k] - first].point[None])
    return checked.excess


def _check_face(checked: _Checked, number: int, samples: int, rng: np.random.Generator) -> None:
    tree = checked.tree
    face = tree.topology.faces[number]
    u, v = (rng.uniform(*face.surface.domain[k], samples) for k in range(2))
    inside = face.contains(u, v)
    u, v = u[inside], v[inside]
    elements = np.flatnonzero(tree.feature == number)
    box = tree.parameters[elements]
    found = np.zeros(len(u), dtype=bool)
    for start in range(0, len(u), max(1, _PAIRS // max(1, len(elements)))):
        rows = slice(start, start + max(1, _PAIRS // max(1, len(elements))))
        x, y = u[rows, None], v[rows, None]
        within = (box[:, 0] <= x) & (x <= box[:, 1]) & (box[:, 2] <= y) & (y <= box[:, 3])
        point, hit = np.nonzero(within)
        found[rows] = within.any(axis=1)
        _check_patches(checked, face, elements[hit], u[rows][point], v[rows][point])
    if not found.all():
        checked.excess = np.inf


def _check_patches(checked: _Checked, face: Face, element: Indices, u: Array, v: Array) -> None:
    tree = checked.tree
    points, su, sv = face.surface.evaluate(u, v, 1)
    checked.points(element, points)
    corners = tree.corners[element]
    distance = np.minimum(
        triangle_distance(points, corners[:, [0, 1, 2]]), triangle_distance(points, corners[:, [0, 2, 3]])
    )
    checked.take((distance - tree.chord_error[element]) / checked.size)
    normals = face.sign * np.cross(su, sv)
    length = np.linalg.norm(normals, axis=1)
    regular = length > _SINGULAR * np.linalg.norm(su, axis=1) * np.linalg.norm(sv, axis=1)
    checked.normals(element[regular], normals[regular] / length[regular, None])


def _check_edge(checked: _Checked, number: int, samples: int, rng: np.random.Generator) -> None:
    """Points of an edge and, where it is convex, normals between those of its faces."""
    tree = checked.tree
    topology = tree.topology
    edge = topology.edges[number]
    face = topology.faces[edge.face_a]
    curve = face.boundary[edge.curve_a]
    t = rng.uniform(*curve.domain, samples)
    points, along = edge_point(face.surface, curve, t)
    elements = np.flatnonzero(tree.feature == len(topology.faces) + number)
    box = tree.parameters[elements]
    within = (box[:, 0] <= t[:, None]) & (t[:, None] <= box[:, 1])
    row, hit = np.nonzero(within)
    checked.points(elements[hit], points[row])
    if edge.face_b is None:
        if not within.any(axis=1).all():
            checked.excess = np.inf
        return
    assert edge.curve_b is not None
    other = topology.faces[edge.face_b]
    curve_b = other.boundary[edge.curve_b]
    at = other_parameter(topology, edge, t)
    a = _normals(face, curve.evaluate(t))
    b = _normals(other, curve_b.evaluate(at))
    convex = face.sign * (np.cross(a, b) * along).sum(axis=1) > 1e-9 * np.linalg.norm(along, axis=1)
    if not within[convex].any(axis=1).all():
        checked.excess = np.inf
    x = rng.uniform(size=(samples, 1))
    fan = (1.0 - x) * a + x * b
    fan /= np.maximum(np.linalg.norm(fan, axis=1, keepdims=True), 1e-3)
    chosen = convex[row]
    checked.normals(elements[hit][chosen], fan[row][chosen])


def _normals(face: Face, at: Array) -> Array:
    return np.asarray(face.normal(at[:, 0], at[:, 1]))
