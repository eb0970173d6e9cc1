"""Triangles of faces, close enough that a picture of them looks round.

Each span of the surface becomes a grid of cells, as many as its tangents and normals turn in it and closer where they
turn faster: a straight leg of a wire costs one cell along, and a bend many. Corners lie on the surface and carry
its normals. A trimmed face is made of facets (`geometry/meshing/polygon.py`) that turn as little.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError
from assembly.geometry.faces.face import Face
from assembly.geometry.meshing.polygon import facets
from assembly.geometry.splines.surface import NurbsSurface
from assembly.kinematics.body import Body
from assembly.view.outline import extent, turning

__all__ = ["Mesh", "body_mesh", "face_mesh", "joined"]

Array = NDArray[np.float64]
# Degrees that tangents and normals may turn in a cell: shading hides 7.5, and outlines show 48 sides to a circle.
_ANGLE = 7.5
# Normals that differ by more on the two sides of a knot make an edge.
_CREASE = np.cos(np.deg2rad(1.0))
# How far inside a span, in parts of it, normals at its end are taken: the knot itself belongs to the next span.
_INSIDE = 1e-9
# Points nearer than this part of the surface's size are one point.
_COINCIDENT = 1e-12
# Samples along a span and, across it, in each span of the other direction.
_ALONG, _ACROSS = 13, 4


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with normals.

    Attributes
    ----------
    vertices, normals : (n, 3)
    triangles : (m, 3) of int
        Corners, counterclockwise seen from outside.
    colors : (n, 3), optional
        Red, green, blue from 0 to 1; NaN for vertices that have no color of their own.
    """

    vertices: Array
    normals: Array
    triangles: NDArray[np.int64]
    colors: Array | None = None

    def about(self, point: Array) -> Mesh:
        """The mesh moved so that a point comes to the origin."""
        return replace(self, vertices=self.vertices - point)

    def transformed(self, matrix: Array) -> Mesh:
        """The mesh moved by a homogeneous (4, 4) matrix whose scale may differ by axis; no mirror images."""
        linear = matrix[:3, :3]
        normals = self.normals @ np.linalg.inv(linear)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return replace(self, vertices=self.vertices @ linear.T + matrix[:3, 3], normals=normals)


def joined(meshes: list[Mesh]) -> Mesh:
    """Several meshes as one."""
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    triangles = [mesh.triangles + start for mesh, start in zip(meshes, starts[:-1], strict=True)]
    colors = None
    if any(mesh.colors is not None for mesh in meshes):
        none = (np.full_like(mesh.vertices, np.nan) if mesh.colors is None else mesh.colors for mesh in meshes)
        colors = np.concatenate(list(none))
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.normals for mesh in meshes]),
        np.concatenate(triangles),
        colors,
    )


def _colored(mesh: Mesh, color: tuple[float, float, float] | None) -> Mesh:
    return mesh if color is None else replace(mesh, colors=np.tile(color, (len(mesh.vertices), 1)))


def _unit(vectors: Array) -> Array:
    """Unit vectors; zero stays zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    result: Array = np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0.0)
    return result


def _normals(face: Face, u: Array, v: Array) -> Array:
    """Outward normals on the grid of u and v, also where a corner has shrunk to a point."""
    try:
        return face.normal(u[:, None], v[None, :])
    except InputError:
        # A corner without a normal; beside it there is one, and a picture cannot tell.
        inward = [0.5 * (low + high) for low, high in face.surface.domain]
        u, v = (middle + (1.0 - 1e-6) * (t - middle) for middle, t in zip(inward, (u, v), strict=True))
        return face.normal(u[:, None], v[None, :])


def _turning(surface: NurbsSurface, direction: int) -> tuple[Array, NDArray[np.bool_]]:
    """Degrees that tangents and normals turn, by span of a direction and part of it; which spans begin at an edge."""
    if direction == 1:
        return _turning(surface.transposed(), 0)
    along, across = surface.breaks()
    ends = np.column_stack([along[:-1], along[1:] - _INSIDE * np.diff(along)])
    u = np.linspace(ends[:, 0], ends[:, 1], _ALONG, axis=1)
    v = np.linspace(across[:-1], across[1:], _ACROSS, endpoint=False, axis=1).ravel()
    # Off the knots of v, so that every sample has one normal.
    v = v + 0.5 / _ACROSS * np.repeat(np.diff(across), _ACROSS)
    tangents = _unit(surface.evaluate(u.ravel()[:, None], v[None, :], 1)[1]).reshape(*u.shape, v.size, 3)
    normals = _normals(Face(surface), u.ravel(), v).reshape(tangents.shape)
    degrees = np.zeros((len(u), _ALONG - 1))
    for field in (tangents, normals):
        turned = np.linalg.norm(np.diff(field, axis=1), axis=-1)
        # The chord of an angle; a tangent that vanishes (at a pole) has no angle to the next.
        turned[(np.linalg.norm(field[:, 1:], axis=-1) == 0.0) | (np.linalg.norm(field[:, :-1], axis=-1) == 0.0)] = 0.0
        angle = np.rad2deg(2.0 * np.arcsin(np.minimum(0.5 * turned, 1.0)))
        degrees = np.maximum(degrees, angle.max(axis=-1))
    creased = np.zeros(len(u), dtype=bool)
    creased[1:] = ((normals[:-1, -1] * normals[1:, 0]).sum(axis=-1) < _CREASE).any(axis=-1)
    return degrees, creased


def _rows(
    breaks: Array, degrees: Array, cells: NDArray[np.int64], creased: NDArray[np.bool_]
) -> tuple[Array, Array, list[int]]:
    """Parameters of points, parameters of their normals, and the rows that begin a cell; edges have two rows."""
    # Cells of equal turning, but none a hundred times as long as another.
    turned = degrees + 0.05 * degrees.mean(axis=1, keepdims=True) + 1e-9
    reached = np.cumsum(np.pad(turned, ((0, 0), (1, 0))), axis=1) / turned.sum(axis=1, keepdims=True)
    points: list[float] = []
    normals: list[float] = []
    begins: list[int] = []
    for k, count in enumerate(cells):
        low, high = breaks[k : k + 2]
        at = np.interp(np.linspace(0.0, 1.0, count + 1), reached[k], np.linspace(low, high, _ALONG))
        at[[0, -1]] = low, high
        shared = 0 if k == 0 or creased[k] else 1
        begins.extend(range(len(points) - shared, len(points) - shared + count))
        points.extend(at[shared:])
        if k + 1 < len(cells):
            at[-1] = high - _INSIDE * (high - low)
        normals.extend(at[shared:])
    return np.array(points), np.array(normals), begins


# Meshes of faces that were drawn before, which bodies may share, by what else they depend on.
_known: WeakKeyDictionary[Face, dict[tuple[float, ...], Mesh]] = WeakKeyDictionary()
# Distance of a trimmed face's facets, in parts of its body's extent: that alone would show in an outline.
_TOLERANCE = 1e-3


def _kept(face: Face, key: tuple[float, ...], make: Callable[[], Mesh]) -> Mesh:
    meshes = _known.setdefault(face, {})
    if key not in meshes:
        meshes[key] = make()
    return meshes[key]


def face_mesh(face: Face, budget: int = 20_000) -> Mesh:
    """Triangles of a face, in body coordinates.

    Parameters
    ----------
    face : Face
    budget : int
        Vertices to stay below where the surface's spans allow it, at the cost of roundness; trimmed faces do not.

    Returns
    -------
    Mesh
        Its corners lie on the surface. A closed surface's mesh is closed: points that meet are equal to the last bit.

    Raises
    ------
    InputError
        A surface that has no normals.
    """
    return _face_mesh(face, budget, extent([face]), turning(1))


def _face_mesh(face: Face, budget: int, size: float, angle: float) -> Mesh:
    if face.outer is None and not face.holes:
        return _kept(face, (budget,), lambda: _grid_mesh(face, budget))
    return _kept(face, (size, angle), lambda: _facets_mesh(face, _TOLERANCE * size, angle))


def _facets_mesh(face: Face, tolerance: float, angle: float) -> Mesh:
    found = facets(face, tolerance, angle=angle)
    return Mesh(found.points, found.normals, found.triangles)


def _grid_mesh(face: Face, budget: int) -> Mesh:
    surface = face.surface
    turns = [_turning(surface, direction) for direction in (0, 1)]
    angle = _ANGLE
    while True:
        cells = [np.maximum(np.ceil(degrees.sum(axis=1) / angle), 1.0).astype(np.int64) for degrees, _ in turns]
        if (cells[0].sum() + 1) * (cells[1].sum() + 1) <= budget or max(c.max() for c in cells) == 1:
            break
        angle *= 1.2
    (u, normal_u, i), (v, normal_v, j) = (
        _rows(breaks, degrees, count, creased)
        for breaks, count, (degrees, creased) in zip(surface.breaks(), cells, turns, strict=True)
    )
    points = surface.evaluate(u[:, None], v[None, :])
    for axis, closed in enumerate(surface.closed):
        grid = np.swapaxes(points, 0, axis)
        if closed:
            grid[-1] = grid[0]
        for end in (0, -1):
            if np.ptp(grid[end], axis=0).max() <= _COINCIDENT * surface.size:
                grid[end] = grid[end, 0]
    a = np.add.outer(np.array(i) * v.size, np.array(j)).ravel()
    b, c, d = a + v.size, a + v.size + 1, a + 1
    triangles = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    vertices = points.reshape(-1, 3)
    # At a pole one triangle of each cell has shrunk to a line.
    sides = vertices[triangles] - vertices[np.roll(triangles, 1, axis=1)]
    triangles = triangles[(np.abs(sides).max(axis=2) > 0.0).all(axis=1)]
    normals = _normals(face, normal_u, normal_v).reshape(-1, 3)
    return Mesh(vertices, normals, triangles[:, :: face.sign])


def body_mesh(body: Body, budget: int = 20_000) -> Mesh | None:
    """Triangles of a body, its picture's or those of all its faces, in body coordinates; None without either."""
    picture = body.picture
    if picture is not None:
        return Mesh(picture.vertices, picture.normals, picture.triangles, picture.colors)
    if not body.faces:
        return None
    share = max(budget // len(body.faces), 100)
    faces = [side.face for side in body.faces]
    size, angle = extent(faces), turning(len(faces))
    return joined([_colored(_face_mesh(face, share, size, angle), face.color) for face in faces])
