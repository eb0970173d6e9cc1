"""Triangles that are drawn for a body that has no exact faces, or instead of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._read_only import ReadOnlyArrays
from assembly.errors import InputError

__all__ = ["PictureMesh"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PictureMesh(ReadOnlyArrays):
    """Triangles for pictures and for files of triangles. Nothing touches them: contacts are of exact faces.

    Attributes
    ----------
    vertices : (n, 3)
        In body coordinates. Triangles that share a vertex are shaded as one smooth surface; at an edge the vertex is
        there once for each side.
    triangles : (m, 3) of int
        Indices of vertices, counterclockwise seen from outside.
    colors : (n, 3), optional
        Red, green and blue of vertices, 0 to 1.

    Raises
    ------
    InputError
        Another shape, no triangle, indices of no vertex, numbers that are not finite.
    """

    vertices: Array
    triangles: NDArray[np.int64]
    colors: Array | None = None

    def __post_init__(self) -> None:
        vertices = _table("vertices", self.vertices, np.float64)
        if not np.isfinite(vertices).all():
            raise InputError("vertices hold numbers that are not finite; expected finite ones")
        triangles = _table("triangles", self.triangles, np.int64)
        if not len(triangles):
            raise InputError("triangles are none; expected one at least")
        wrong = triangles[(triangles < 0) | (triangles >= len(vertices))]
        if wrong.size:
            raise InputError(f"triangles hold {wrong[0]}; expected indices of {len(vertices)} vertices, from 0")
        colors = self.colors
        if colors is not None:
            colors = _table("colors", colors, np.float64)
            if len(colors) != len(vertices):
                raise InputError(f"colors are {len(colors)}; expected one for each of {len(vertices)} vertices")
            if not ((colors >= 0.0) & (colors <= 1.0)).all():
                raise InputError("colors hold numbers out of range; expected 0 to 1")
        self.__dict__.update(vertices=vertices, triangles=triangles, colors=colors)
        super().__post_init__()

    def __repr__(self) -> str:
        return f"PictureMesh({len(self.vertices)} vertices, {len(self.triangles)} triangles)"

    @property
    def normals(self) -> Array:
        """Unit normals at the vertices, (n, 3): the mean of those of the triangles there, weighted by their areas.

        A vertex of no triangle, or of triangles without area, has the normal (0, 0, 1).
        """
        corners = self.vertices[self.triangles]
        areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        sums = np.zeros_like(self.vertices)
        for k in range(3):
            np.add.at(sums, self.triangles[:, k], areas)
        lengths = np.linalg.norm(sums, axis=1, keepdims=True)
        result: Array = np.where(lengths > 0.0, sums / np.where(lengths > 0.0, lengths, 1.0), [0.0, 0.0, 1.0])
        return result

    def moved(self, turn: ArrayLike, shift: ArrayLike) -> PictureMesh:
        """The same, times a matrix (3, 3), which may scale and mirrors nothing, and then shifted by (3,)."""
        vertices = self.vertices @ np.asarray(turn, dtype=np.float64).T + np.asarray(shift, dtype=np.float64)
        return PictureMesh(vertices, self.triangles, self.colors)

    @classmethod
    def joined(cls, meshes: Sequence[PictureMesh]) -> PictureMesh:
        """Several meshes as one; vertices of those without colors are gray where others have some."""
        starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
        colors = None
        if any(mesh.colors is not None for mesh in meshes):
            gray = (np.full((len(mesh.vertices), 3), 0.6) if mesh.colors is None else mesh.colors for mesh in meshes)
            colors = np.concatenate(list(gray))
        return cls(
            np.concatenate([mesh.vertices for mesh in meshes]),
            np.concatenate([mesh.triangles + start for mesh, start in zip(meshes, starts[:-1], strict=True)]),
            colors,
        )


def _table(name: str, value: ArrayLike, kind: type[np.generic]) -> NDArray[Any]:
    """A copy of rows of three numbers."""
    try:
        given = np.asarray(value)
        rows: NDArray[Any] = given.astype(kind)
    except (TypeError, ValueError):
        raise InputError(f"{name} is {value!r}; expected rows of three numbers") from None
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise InputError(f"{name} has the shape {rows.shape}; expected (n, 3)")
    if kind is np.int64 and not np.array_equal(rows, given):
        raise InputError(f"{name} hold numbers that are not whole; expected indices")
    return rows
