"""Facets of a face: triangles within its trim, no farther from it than a tolerance.

The boundary becomes a polygon (`geometry/meshing/border.py`) on one sheet of (u, v) (`geometry/meshing/unroll.py`), the
surface a grid of points (`geometry/meshing/steps.py`), and both a triangulation that has the polygon among its edges
(`geometry/meshing/delaunay.py`),
in parameters counted in steps. Then every triangle is measured: the surface at the middles of its edges and of itself,
against the facet, along the surface's normal. Points go where it is too far, until it is nowhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from assembly.errors import InputError, positive
from assembly.geometry.faces.face import Face
from assembly.geometry.meshing.border import Border, border, cross, on_surface, pole_sides
from assembly.geometry.meshing.delaunay import inside, triangulated
from assembly.geometry.meshing.facet_gaps import Apart, measured
from assembly.geometry.meshing.steps import Axis, axes
from assembly.geometry.meshing.unroll import Sheet, crossed, unrolled

__all__ = ["Facets", "TrimmedMesh", "facets"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
# Rounds of measuring, and of parting chords that cross each other.
_ROUNDS, _PARTINGS = 30, 12
_MOST_POINTS = 4_000_000
# Points of the grid nearer to the boundary than this part of a step are left out.
_NEAR = 0.4
# Oblique axes: of the two diagonals of a cell one is the shorter, and the triangulation has no choice.
_OBLIQUE_AXES = np.array([[1.0, 0.0], [0.15, 1.0]])
# Normals of a corner between two sides of a crease are taken this far inside each triangle, in parts of it.
_INWARD = 1e-6


@dataclass(frozen=True, eq=False)
class Facets:
    """Triangles whose corners lie on a face.

    Attributes
    ----------
    points, normals : (n, 3)
        Normals are unit and outward. Corners that meet at a seam, a pole or a crease of the surface are several.
    triangles : (m, 3) of int
        Corners, counterclockwise seen from outside.
    parameters : (n, 2)
        Of the points, in (u, v); beyond the domain of a closed direction where the face goes over a seam.
    """

    points: Array
    normals: Array
    triangles: Indices
    parameters: Array

    @property
    def area(self) -> float:
        """Of all triangles."""
        a, b, c = np.moveaxis(self.points[self.triangles], 1, 0)
        return float(0.5 * np.linalg.norm(cross(b - a, c - a), axis=1).sum())


def facets(face: Face, tolerance: float, *, angle: float = 0.25 * pi) -> Facets:
    """Triangles within the trim of a face.

    Parameters
    ----------
    face : Face
    tolerance : float
        The most that facets and face are apart, either way, in the unit of the points; for the facets of one face
        it is measured at the middles of all triangles and of their edges.
    angle : float
        About the most that the boundary, or the normal, turns from corner to corner [rad].

    Raises
    ------
    InputError
        A tolerance or an angle that is not positive, a tolerance that needs millions of facets, or a surface that has
        no normals.
    """
    if not isinstance(face, Face):
        raise TypeError(f"face is {face!r}; expected a Face")
    reach, turn = positive("tolerance", tolerance), min(positive("angle", angle), 0.25 * pi)
    # A closed surface within a loop along its seam is whole, too.
    if (face.outer is None and not face.holes) or not face.boundary:
        return _untrimmed(face, reach, turn)
    return TrimmedMesh(face, reach, turn).facets()


def _too_many(tolerance: float) -> InputError:
    return InputError(f"tolerance is {tolerance:g}; expected one that needs less than {_MOST_POINTS} points")


class _Line:
    """A side of the sheet, its opposite if both are one line in space, or a crease, with corners on it.

    Parameters
    ----------
    direction : int
        Of the coordinate that is constant.
    values : list of float
        One, or two: a line of which two sides of the sheet are made.
    corners : (k,)
        The other coordinate of corners, besides those where the boundary comes to the line.
    hull : bool
        Whether the face ends here as far as the sheet shows it, or goes on.
    """

    def __init__(self, direction: int, values: list[float], corners: Array, hull: bool) -> None:
        self.direction = direction
        self.values = values
        self.corners = corners
        self.hull = hull

    def linked(self, ends: Array, axis: Axis) -> tuple[Array, Array]:
        """Ends of the border, those on the line equal to the last bit on both sides, and all corners in order."""
        d = self.direction
        reach = 1e-9 * (axis.at[-1] - axis.at[0])
        on = np.isin(ends[..., d], self.values)
        met = np.sort(ends[on][:, 1 - d])
        met = met[np.diff(met, prepend=-np.inf) > reach]
        own = self.corners
        if len(met):
            ends = ends.copy()
            at = ends[on]
            nearest = np.clip(np.searchsorted(met, at[:, 1 - d] + reach) - 1, 0, len(met) - 1)
            at[:, 1 - d] = met[nearest]
            ends[on] = at
            steps, reached = axis.steps(met), axis.steps(own)
            k = np.clip(np.searchsorted(steps, reached), 1, max(len(met) - 1, 1))
            near = np.minimum(np.abs(reached - steps[k - 1]), np.abs(steps[np.minimum(k, len(met) - 1)] - reached))
            end = np.isin(own, axis.at[[0, -1]])
            own = own[(near > _NEAR) | (end & (near > 1e-9 * axis.grown[-1]))]
        return ends, np.union1d(met, own)


def _outline(sheet: Sheet, grid: tuple[Axis, Axis]) -> list[_Line]:
    """Cuts, poles beside them, and creases."""
    lines = []
    for d in (0, 1):
        if sheet.cut[d]:
            lines.append(_Line(d, sheet.box[:, d].tolist(), grid[1 - d].lines, True))
        for value in grid[d].creases:
            lines.append(_Line(d, [float(value)], grid[1 - d].lines, False))
    lines.extend(_Line(d, [float(sheet.box[end, d])], grid[1 - d].lines, True) for d, end in sheet.poles)
    return lines


def _clear(points: Array, segments: Array) -> NDArray[np.bool_]:
    """Which points (n, 2) are not near segments (k, 2, 2), in steps."""
    clear = np.ones(len(points), dtype=bool)
    if not len(points):
        return clear
    middle, half = segments.mean(axis=1), 0.5 * np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    tree = cKDTree(points)
    for (start, end), near in zip(segments, tree.query_ball_point(middle, half + _NEAR), strict=True):
        to, way = points[near] - start, end - start
        part = np.clip(to @ way / max(way @ way, np.finfo(float).tiny), 0.0, 1.0)
        clear[near] &= ((to - part[:, None] * way) ** 2).sum(axis=1) > _NEAR**2
    return clear


class Vertices(NamedTuple):
    """Corners of all kinds, and the segments that are to be edges: of the border first, then of lines."""

    parameters: Array
    segments: Indices
    line: Indices  # of each segment after the border's, the number of its line


class TrimmedMesh:
    """A triangulation of a trimmed face that becomes finer."""

    def __init__(self, face: Face, tolerance: float, angle: float) -> None:
        self.face = face
        self.tolerance, self.angle = tolerance, angle
        self.poles = [divmod(side, 2) for side in pole_sides(face.surface)]
        sheet = unrolled(border(face, tolerance, angle))
        self.grid = axes(face.surface, sheet.box, tolerance, angle)
        self.rim: Border = sheet.border
        for d in (0, 1):
            for value in self.grid[d].creases:
                self.rim = crossed(self.rim, d, float(value))
        self.sheet = sheet
        self.lines = _outline(sheet, self.grid)
        self.inner = self._grid_points()

    def _steps(self, parameters: Array) -> Array:
        return np.stack([self.grid[d].steps(parameters[..., d]) for d in (0, 1)], axis=-1)

    def _grid_points(self) -> Array:
        u, v = (
            lines[~np.isin(lines, creases)] if len(lines) and len(creases) else lines
            for lines, creases in ((axis.lines[1:-1], axis.creases) for axis in self.grid)
        )
        if u.size * v.size > _MOST_POINTS:
            raise _too_many(self.tolerance)
        if not u.size * v.size:
            return np.empty((0, 2))
        points = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
        return points[_clear(self._steps(points), self._steps(self.rim.ends))]

    def _vertices(self) -> Vertices:
        ends = self.rim.ends
        on_lines = []
        for line in self.lines:
            ends, corners = line.linked(ends, self.grid[1 - line.direction])
            on_lines.append(corners)
        # Sides that two lines share: what one has moved, the others find moved.
        self.rim = Border(self.rim.face, self.rim.curve, self.rim.chain, self.rim.t, ends)
        parts, segments, owners = [ends.reshape(-1, 2)], [np.arange(2 * len(ends)).reshape(-1, 2)], []
        count = 2 * len(ends)
        for number, (line, corners) in enumerate(zip(self.lines, on_lines, strict=True)):
            for k, value in enumerate(line.values):
                points = np.empty((len(corners), 2))
                points[:, line.direction], points[:, 1 - line.direction] = value, corners
                chain = np.arange(count, count + len(corners))
                # Counterclockwise around the box.
                high = value == self.sheet.box[1, line.direction] if len(line.values) == 1 else k == 1
                if high == (line.direction == 1):
                    chain = chain[::-1]
                segments.append(np.column_stack([chain[:-1], chain[1:]]))
                owners.append(np.full(len(chain) - 1, number))
                parts.append(points)
                count += len(corners)
        parts.append(self.inner)
        points, place = np.unique(np.concatenate(parts), axis=0, return_inverse=True)
        joined = place.reshape(-1)[np.concatenate(segments)]
        return Vertices(points, joined, np.concatenate([np.empty(0, dtype=np.int64), *owners]))

    def _triangles(self) -> tuple[Vertices, Indices, Indices, Indices]:
        """Corners, triangles inside, and edges of the border and of lines with their owners."""
        for parting in range(_PARTINGS + 1):
            found = self._vertices()
            k = len(self.rim.curve)
            hull = np.array([line.hull for line in self.lines], dtype=bool)[found.line]
            soft = (np.flatnonzero(~hull) + k).tolist()
            mesh = triangulated(self._steps(found.parameters) @ _OBLIQUE_AXES, found.segments, soft)
            crossing = np.unique(np.array([j for j in mesh.blocked if j < k], dtype=np.int64))
            if not len(crossing) or parting == _PARTINGS:
                break
            self.rim = self.rim.split(crossing)
        n = len(found.parameters)
        if not len(crossing):
            of_border = mesh.owner < k
            walls = mesh.edges[(~of_border) & np.append(np.zeros(k, dtype=bool), hull)[mesh.owner]]
            kept = mesh.triangles[inside(mesh.triangles, n + 12, mesh.edges[of_border], walls)]
            if (kept < n).all():
                return found, kept, mesh.edges, mesh.owner
        # Curves that touch, or a boundary with a gap: which side a triangle is on is asked of the true boundary.
        real = mesh.triangles[(mesh.triangles < n).all(axis=1)]
        at = found.parameters[real].mean(axis=1)
        within = self.face.locate(at[:, 0], at[:, 1]) > 0
        return found, real[within], mesh.edges, mesh.owner

    def _points(self, parameters: Array) -> Array:
        """In space; both sides of a cut, and all of a pole, equal to the last bit."""
        at = parameters.copy()
        for d in (0, 1):
            if self.sheet.cut[d]:
                at[at[:, d] == self.sheet.box[1, d], d] = self.sheet.box[0, d]
        points = on_surface(self.face.surface, at)[0]
        for d, end in self.poles:
            low, high = self.face.surface.domain[d]
            on = np.abs(parameters[:, d] - (low, high)[end]) <= 1e-12 * (high - low)
            if on.any():
                points[on] = points[np.argmax(on)]
        return points

    def _divide(self, found: Vertices, apart: Indices, edges: Indices, owner: Indices) -> None:
        """Put a corner on each of some edges."""
        n = len(found.parameters)
        keys = np.sort(edges, axis=1) @ np.array([n + 12, 1])
        order = np.argsort(keys)
        wanted = apart @ np.array([n + 12, 1])
        place = np.minimum(np.searchsorted(keys[order], wanted), len(keys) - 1)
        known = keys[order][place] == wanted
        segment = owner[order][place]
        k = len(self.rim.curve)
        middle = found.parameters[apart].mean(axis=1)
        self.inner = np.concatenate([self.inner, middle[~known]])
        for row, at in zip(segment[known & (segment >= k)] - k, middle[known & (segment >= k)], strict=True):
            line = self.lines[found.line[row]]
            line.corners = np.union1d(line.corners, at[1 - line.direction])
        self.rim = self.rim.split(np.unique(segment[known & (segment < k)]))

    def mesh(self) -> tuple[Vertices, Array, Indices]:
        """Corners, where they are in space, and triangles, of which those at poles may have sides of no length."""
        for _ in range(_ROUNDS):
            found, triangles, edges, owner = self._triangles()
            if len(found.parameters) > _MOST_POINTS:
                raise _too_many(self.tolerance)
            points = self._points(found.parameters)
            if self.face.surface.is_parallelogram:
                # Facets are in it.
                break
            solid = _solid(points, triangles)
            apart = measured(self.face, found.parameters, points, solid, self.tolerance, self.angle)
            if not len(apart.edges) and not len(apart.triangles):
                break
            self._divide(found, apart.edges, edges, owner)
            self.inner = np.concatenate([self.inner, found.parameters[solid[apart.triangles]].mean(axis=1)])
        return found, points, triangles

    def facets(self) -> Facets:
        """The facets with normals."""
        found, points, triangles = self.mesh()
        triangles = _solid(points, triangles)
        return _finished(self.face, found.parameters, points, triangles, any(len(a.creases) for a in self.grid))


def _solid(points: Array, triangles: Indices) -> Indices:
    """Those triangles whose corners are three points."""
    corners = points[triangles]
    sides = np.abs(corners - np.roll(corners, 1, axis=1)).max(axis=2)
    solid: Indices = triangles[(sides > 0.0).all(axis=1)]
    return solid


def _finished(face: Face, parameters: Array, points: Array, triangles: Indices, creased: bool) -> Facets:
    """Facets with normals, without points that no triangle has; where the surface has creases, by sides of them."""
    used, place = np.unique(triangles, return_inverse=True)
    triangles = place.reshape(-1, 3)
    parameters, points = parameters[used], points[used]
    if not creased:
        normals = _normals(face, parameters, parameters.mean(axis=0))
        return Facets(points, normals, triangles[:, :: face.sign], parameters)
    middles = np.repeat(parameters[triangles].mean(axis=1), 3, axis=0)
    corner = triangles.ravel()
    normals = _normals(face, parameters[corner] + _INWARD * (middles - parameters[corner]), middles)
    # Corners of one point whose normals are the same to two digits are one.
    rows = np.column_stack([corner, np.round(50.0 * normals)])
    _, first, number = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    chosen = corner[first]
    return Facets(points[chosen], normals[first], number.reshape(-1, 3)[:, :: face.sign], parameters[chosen])


def _normals(face: Face, parameters: Array, inward: Array) -> Array:
    """Outward normals; where a corner of the surface has none, of a point beside it."""
    surface = face.surface
    at = [
        column if closed else np.clip(column, *ends)
        for column, closed, ends in zip(parameters.T, surface.closed, surface.domain, strict=True)
    ]
    try:
        return face.normal(at[0], at[1])
    except InputError:
        beside = parameters + _INWARD * (inward - parameters)
        return face.normal(beside[:, 0], beside[:, 1])


def _untrimmed(face: Face, tolerance: float, angle: float) -> Facets:
    """A grid over the whole domain, halved until it is near enough."""
    surface = face.surface
    box = np.array(surface.domain).T
    grid = axes(surface, box, tolerance, angle)
    u, v = (axis.lines for axis in grid)
    while True:
        if u.size * v.size > _MOST_POINTS:
            raise _too_many(tolerance)
        parameters = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1)
        points = surface.evaluate(parameters[..., 0], parameters[..., 1])
        for axis, closed in enumerate(surface.closed):
            side = np.swapaxes(points, 0, axis)
            if closed:
                side[-1] = side[0]
        for pole in pole_sides(surface):
            axis, end = divmod(pole, 2)
            side = np.swapaxes(points, 0, axis)
            side[-end] = side[-end, 0]
        a = np.add.outer(np.arange(u.size - 1) * v.size, np.arange(v.size - 1)).ravel()
        b, c, d = a + v.size, a + v.size + 1, a + 1
        triangles = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
        vertices = points.reshape(-1, 3)
        corners = vertices[triangles]
        sides = np.abs(corners - np.roll(corners, 1, axis=1)).max(axis=2)
        triangles = triangles[(sides > 0.0).all(axis=1)]
        apart = measured(face, parameters.reshape(-1, 2), vertices, triangles, tolerance, angle)
        if not len(apart.edges) and not len(apart.triangles):
            break
        u, v = _halved(u, v, apart, triangles)
    creased = any(len(axis.creases) for axis in grid)
    return _finished(face, parameters.reshape(-1, 2), vertices, triangles, creased)


def _halved(u: Array, v: Array, apart: Apart, triangles: Indices) -> tuple[Array, Array]:
    """Lines with new ones in the middles of cells that have edges, or triangles, to divide."""
    new: list[list[Array]] = [[], []]
    pairs = [apart.edges, triangles[apart.triangles][:, [0, 1]], triangles[apart.triangles][:, [0, 2]]]
    for pair in pairs:
        i, j = np.divmod(np.sort(pair, axis=1), v.size)
        for d, (lines, index) in enumerate(((u, i), (v, j))):
            low = np.unique(index.min(axis=1)[index[:, 0] != index[:, 1]])
            new[d].append(0.5 * (lines[low] + lines[low + 1]))
    # Two arrays, u and v; to mypy a tuple of a generator has any length.
    in_u, in_v = (np.union1d(lines, np.concatenate(added)) for lines, added in zip((u, v), new, strict=True))
    return in_u, in_v
