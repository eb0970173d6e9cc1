"""Triangles of faces, close enough that a picture of them looks round.

Each span of the surface becomes a grid of cells, as many as its tangents and normals turn in it and closer where they
turn faster: a straight leg of a wire costs one cell along, and a bend many. Corners lie on the surface and carry
its normals. A trimmed face is made of facets (`geometry/meshing/polygon.py`) that turn as little.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError
from assembly.geometry.faces.face import Face
from assembly.geometry.meshing.polygon import facets
from assembly.geometry.splines.surface import NurbsSurface
from assembly.kinematics.body import Body
from assembly.view.outline import ANGLE, extent, turning

__all__ = ["Mesh", "body_mesh", "face_mesh", "joined"]

Array = NDArray[np.float64]
# Factor by which cells are made larger, again and again, until a body has few enough vertices.
_COARSER = 1.2
# A knot is a sharp edge where the normals on its two sides differ by more.
_CREASE = np.cos(np.deg2rad(1.0))
# An edge of a mesh is drawn where the normals on its two sides differ by more.
_FEATURE = np.cos(np.deg2rad(10.0))
# Vertices nearer to each other than this part of a mesh's size are at one place.
_WELDED = 1e-6
# Normals at the end of a span are taken this part of the span inside: the knot itself belongs to the next span.
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
    creases : (k, 2) of int
        Vertices at the ends of edges along which a surface has two normals, as the teeth of a gear do.
    """

    vertices: Array
    normals: Array
    triangles: NDArray[np.int64]
    colors: Array | None = None
    creases: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))

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
        np.concatenate([mesh.creases + start for mesh, start in zip(meshes, starts[:-1], strict=True)]),
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
        # A corner may have no normal; the one beside it looks the same.
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
    for rows in (tangents, normals):
        turned = np.linalg.norm(np.diff(rows, axis=1), axis=-1)
        # The chord of an angle; a tangent that vanishes (at a pole) has no angle to the next.
        turned[(np.linalg.norm(rows[:, 1:], axis=-1) == 0.0) | (np.linalg.norm(rows[:, :-1], axis=-1) == 0.0)] = 0.0
        angle = np.rad2deg(2.0 * np.arcsin(np.minimum(0.5 * turned, 1.0)))
        degrees = np.maximum(degrees, angle.max(axis=-1))
    creased = np.zeros(len(u), dtype=bool)
    creased[1:] = ((normals[:-1, -1] * normals[1:, 0]).sum(axis=-1) < _CREASE).any(axis=-1)
    return degrees, creased


def _rows(
    breaks: Array, degrees: Array, cells: NDArray[np.int64], creased: NDArray[np.bool_]
) -> tuple[Array, Array, list[int]]:
    """Parameters of points, parameters of their normals, and the rows that begin a cell; edges have two rows."""
    # Along each cell the surface turns by the same angle, but no cell is a hundred times as long as another.
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


# Caches, by face: meshes, by what else they depend on, and the angles by which surfaces turn. Bodies may share faces.
_known: WeakKeyDictionary[Face, dict[tuple[float, ...], Mesh]] = WeakKeyDictionary()
_turns: WeakKeyDictionary[Face, list[tuple[Array, NDArray[np.bool_]]]] = WeakKeyDictionary()
# Largest distance of facets from a trimmed face, in parts of its body's extent; it would be visible in an outline only.
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
    if _is_whole(face):
        return _grid_mesh(face, _fitting([face], budget, ANGLE))
    return _facets_mesh(face, _TOLERANCE * extent([face]), turning(1))


def _is_whole(face: Face) -> bool:
    """Whether a face is all of its surface."""
    return face.outer is None and not face.holes


def _facets_mesh(face: Face, tolerance: float, angle: float) -> Mesh:
    def make() -> Mesh:
        found = facets(face, tolerance, angle=angle)
        return Mesh(found.points, found.normals, found.triangles)

    return _kept(face, (tolerance, angle), make)


def _turns_of(face: Face) -> list[tuple[Array, NDArray[np.bool_]]]:
    if face not in _turns:
        _turns[face] = [_turning(face.surface, direction) for direction in (0, 1)]
    return _turns[face]


def _cells(face: Face, angle: float) -> list[NDArray[np.int64]]:
    """How many cells each span has, in either direction, that turn by an angle [deg] at most."""
    return [
        np.maximum(np.ceil(degrees.sum(axis=1) / angle - 1e-9), 1.0).astype(np.int64) for degrees, _ in _turns_of(face)
    ]


def _fitting(faces: list[Face], budget: int, angle: float) -> float:
    """The angle [deg], or a larger one, by which the grids of all these faces together stay below a budget of vertices.

    A flat face needs four vertices wherever it is, so that a dome among them has nearly all.
    """
    while True:
        cells = [_cells(face, angle) for face in faces]
        if sum(int((u.sum() + 1) * (v.sum() + 1)) for u, v in cells) <= budget:
            return angle
        if all(each.max() == 1 for pair in cells for each in pair):
            return angle
        angle *= _COARSER


def _grid_mesh(face: Face, angle: float) -> Mesh:
    return _kept(face, (angle,), lambda: _new_grid(face, angle))


def _new_grid(face: Face, angle: float) -> Mesh:
    surface, turns, cells = face.surface, _turns_of(face), _cells(face, angle)
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
    edges = _creases(vertices, normals, triangles) if any(creased.any() for _, creased in turns) else None
    made = Mesh(vertices, normals, triangles[:, :: face.sign])
    return made if edges is None else replace(made, creases=edges)


def _creases(vertices: Array, normals: Array, triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Edges (k, 2) that two triangles share with other normals, at both ends, of the one than of the other."""
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    place = np.unique(np.round(vertices / (_WELDED * size)), axis=0, return_inverse=True)[1].reshape(-1)
    sides = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    sides = np.where((place[sides[:, 0]] > place[sides[:, 1]])[:, None], sides[:, ::-1], sides)
    sides = sides[np.lexsort(place[sides].T)]
    same = (place[sides[1:]] == place[sides[:-1]]).all(axis=1)
    alike = (normals[sides[1:]] * normals[sides[:-1]]).sum(axis=2)
    found: NDArray[np.int64] = sides[1:][same & (alike < _FEATURE).all(axis=1)]
    return found


def body_mesh(body: Body, budget: int = 20_000, angle: float = ANGLE) -> Mesh | None:
    """Triangles of a body, its picture's or those of all its faces, in body coordinates; None without either.

    Tangents and normals turn by the angle [deg] in a cell at most, or by more in all of them alike where the vertices
    were more than the budget; trimmed faces do not count.
    """
    picture = body.picture
    if picture is not None:
        return Mesh(picture.vertices, picture.normals, picture.triangles, picture.colors)
    if not body.faces:
        return None
    faces = [side.face for side in body.faces]
    whole = [face for face in faces if _is_whole(face)]
    coarse = _fitting(whole, budget, angle) if whole else angle
    tolerance, facet = _TOLERANCE * extent(faces), turning(len(faces), angle)
    made = (_grid_mesh(face, coarse) if _is_whole(face) else _facets_mesh(face, tolerance, facet) for face in faces)
    return joined([_colored(mesh, face.color) for mesh, face in zip(made, faces, strict=True)])
