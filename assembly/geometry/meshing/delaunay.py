"""Triangles between points in the plane that have given segments among their edges.

The Delaunay triangulation of the points comes first. A segment that is no edge of it is put in: the triangles it
crosses are taken out, and the two polygons beside it are filled with the triangles whose circumcircles hold no other
corner of the polygon (Anglada, An improved incremental algorithm for constructing restricted Delaunay triangulations,
Computers & Graphics 21, 1997).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from assembly.geometry.meshing.connected import mark_inside

__all__ = ["Triangulation", "inside", "triangulated"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Point = tuple[float, float]
# A frame around all points, in parts of their extents: no given segment is on the hull, where rounding decides.
_FRAME = 0.75
# Twelve points around the unit square.
_THIRDS = np.linspace(0.0, 1.0, 4)[:-1]
_SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
_RING = (_SQUARE[:, None] + _THIRDS[:, None] * (np.roll(_SQUARE, -1, axis=0) - _SQUARE)[:, None]).reshape(-1, 2)
# Of every corner of a triangle the next one.
_NEXT = [1, 2, 0]


class Triangulation(NamedTuple):
    """Triangles and what became of the segments.

    Attributes
    ----------
    triangles : (m, 3)
        Counterclockwise corners; numbers beyond the points are corners of a frame around them.
    edges : (k, 2)
        Edges that the segments consist of, in their direction.
    owner : (k,)
        The segment of each edge.
    blocked : list of int
        Segments that cross another, as far as found; some of their edges are missing.
    """

    triangles: Indices
    edges: Indices
    owner: Indices
    blocked: list[int]


def _side(p: Point, q: Point, r: Point) -> float:
    """Twice the area of a triangle, positive counterclockwise."""
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])


def _in_circle(p: Point, q: Point, r: Point, s: Point) -> bool:
    """Whether s is within the circle through p, q, r, counterclockwise."""
    (a, b), (c, d), (e, f) = ((t[0] - s[0], t[1] - s[1]) for t in (p, q, r))
    return (a * a + b * b) * (c * f - e * d) - (c * c + d * d) * (a * f - e * b) + (e * e + f * f) * (
        a * d - c * b
    ) > 0.0


class _Mesh:
    """Triangles by their directed edges: the third corner of the triangle on the left."""

    def __init__(self, points: Array, triangles: Indices, watched: Indices) -> None:
        self.points: list[Point] = [(x, y) for x, y in points.tolist()]
        self.third: dict[tuple[int, int], int] = {}
        # Where edges from a few corners lead, or once led.
        self.spokes: dict[int, list[int]] = {p: [] for p in watched.tolist()}
        for a, b, c in triangles.tolist():
            self.add(a, b, c)

    def add(self, a: int, b: int, c: int) -> None:
        self.third[a, b], self.third[b, c], self.third[c, a] = c, a, b
        for p, q in ((a, b), (b, c), (c, a)):
            if p in self.spokes:
                self.spokes[p].append(q)

    def remove(self, a: int, b: int, c: int) -> None:
        for edge in ((a, b), (b, c), (c, a)):
            del self.third[edge]

    def triangles(self) -> Indices:
        rows = [(a, b, c) for (a, b), c in self.third.items() if a < b and a < c]
        return np.array(rows, dtype=np.int64).reshape(-1, 3)

    def first(self, p: int, q: int) -> tuple[int, int] | int | None:
        """The edge opposite to p that the way to q crosses, or a corner on the way, or nothing."""
        at = self.points
        for a in self.spokes[p]:
            b = self.third.get((p, a), -1)
            if b < 0:
                continue
            right, left = _side(at[p], at[q], at[a]), _side(at[p], at[q], at[b])
            if right < 0.0 < left:
                return a, b
            for corner, side in ((a, right), (b, left)):
                way = np.subtract(at[q], at[p]) @ np.subtract(at[corner], at[p])
                if side == 0.0 and way > 0.0:
                    return corner
        return None

    def insert(self, p: int, q: int, fixed: dict[tuple[int, int], int]) -> tuple[int, list[int]]:
        """Make the way from p to q an edge, as far as the first corner on it.

        Returns that corner (-1: blocked) and the segments in the way.
        """
        start = self.first(p, q)
        if start is None:
            return -1, []
        if isinstance(start, int):
            return start, []
        a, b = start
        at = self.points
        left, right, crossed = [b], [a], [(p, a, b)]
        end = -1
        while end < 0:
            if (a, b) in fixed or (b, a) in fixed:
                return -1, [fixed[edge] for edge in ((a, b), (b, a)) if edge in fixed]
            c = self.third.get((b, a))
            if c is None:
                return -1, []
            crossed.append((b, a, c))
            side = 0.0 if c == q else _side(at[p], at[q], at[c])
            if side > 0.0:
                left.append(c)
                b = c
            elif side < 0.0:
                right.append(c)
                a = c
            else:
                end = c
        for triangle in crossed:
            self.remove(*triangle)
        self.fill(p, end, left)
        self.fill(end, p, right[::-1])
        return end, []

    def fill(self, p: int, q: int, chain: list[int]) -> None:
        """Triangulate the polygon on the left of the edge from p to q; the chain leads from p to q."""
        stack = [(p, q, chain)]
        at = self.points
        while stack:
            p, q, chain = stack.pop()
            if not chain:
                continue
            best = 0
            for k in range(1, len(chain)):
                if _in_circle(at[p], at[q], at[chain[best]], at[chain[k]]):
                    best = k
            self.add(p, q, chain[best])
            stack.append((p, chain[best], chain[:best]))
            stack.append((chain[best], q, chain[best + 1 :]))


def _framed(points: Array) -> Array:
    """The points and twelve more around them."""
    low, high = points.min(axis=0), points.max(axis=0)
    reach = _FRAME * max(float((high - low).max()), np.finfo(float).tiny)
    low, high = low - reach, high + reach
    return np.concatenate([points, low + _RING * (high - low)])


def triangulated(points: Array, segments: Indices, soft: Sequence[int] = ()) -> Triangulation:
    """Triangles between points (n, 2), all different, with segments (k, 2) from point to point among the edges.

    Parameters
    ----------
    soft : sequence of int
        Numbers of segments that give way to the others, and are not reported as blocked.
    """
    every = _framed(points)
    triangles = Delaunay(every).simplices.astype(np.int64)
    n = len(every)
    keys = (triangles * n + triangles[:, _NEXT]).ravel()
    wanted = segments[:, 0] * n + segments[:, 1]
    ordered = np.sort(keys)
    found = ordered[np.minimum(np.searchsorted(ordered, wanted), len(ordered) - 1)] == wanted
    if found.all():
        return Triangulation(triangles, segments, np.arange(len(segments)), [])
    mesh = _Mesh(every, triangles, np.unique(segments[~found]))
    pairs = [(int(a), int(b)) for a, b in segments]
    fixed = {pairs[k]: int(k) for k in np.flatnonzero(found)}
    yielding = set(soft)
    blocked: list[int] = []
    missing = [int(k) for k in np.flatnonzero(~found)]
    for k in sorted(missing, key=lambda k: k in yielding):
        p, q = pairs[k]
        passed: set[int] = set()
        while p != q:
            if p in passed:
                # Corners a rounding apart, each on the way from the other.
                blocked.extend([k] if k not in yielding else [])
                break
            passed.add(p)
            if (p, q) in mesh.third:
                fixed[p, q] = k
                break
            corner, others = mesh.insert(p, q, fixed)
            if corner < 0:
                blocked.extend(j for j in [k, *others] if k not in yielding and j not in yielding)
                break
            fixed[p, corner] = k
            p = corner
            if p not in mesh.spokes:
                mesh.spokes[p] = [b for a, b in mesh.third if a == p]
    edges = np.array(list(fixed), dtype=np.int64).reshape(-1, 2)
    return Triangulation(mesh.triangles(), edges, np.array(list(fixed.values()), dtype=np.int64), blocked)


def inside(triangles: Indices, count: int, border: Indices, hull: Indices) -> NDArray[np.bool_]:
    """Triangles on the left of a border (k, 2) of edges that closes up, or closes up with the hull.

    Parameters
    ----------
    triangles : (m, 3)
    count : int
        More than any number of a corner.
    border : (k, 2)
        Directed edges with the inside on the left.
    hull : (h, 2)
        Directed edges with nothing inside on their right; on the left, the border decides.
    """
    triangles = np.ascontiguousarray(triangles)
    keys = (triangles * count + triangles[:, _NEXT]).ravel()
    order = np.argsort(keys)
    result = np.empty(len(triangles), dtype=bool)
    sides = np.ascontiguousarray(border), np.ascontiguousarray(hull)
    mark_inside(triangles, count, *sides, keys[order], order, result)
    return result
