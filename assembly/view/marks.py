"""Meshes that stand for what has no surface: balls, rods, arrows, crosses."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.view.mesh import Mesh, face_mesh, joined

__all__ = ["arrow", "ball", "cross", "rod", "rods", "stick"]

Array = NDArray[np.float64]
# Vertices of a mark, which is small.
_BUDGET = 400


@lru_cache(maxsize=2)
def ball(budget: int = _BUDGET) -> Mesh:
    """A ball of radius one about the origin, of so many vertices at most."""
    return face_mesh(Face(shapes.sphere(1.0)), budget)


@lru_cache(maxsize=1)
def stick() -> Mesh:
    """A round rod of radius one from the origin to (0, 0, 1), to be scaled."""
    return _raised(face_mesh(Face(shapes.cylinder(1.0, 1.0)), _BUDGET), 0.5)


def _raised(mesh: Mesh, height: float) -> Mesh:
    return Mesh(mesh.vertices + [0.0, 0.0, height], mesh.normals, mesh.triangles)


@lru_cache(maxsize=8)
def arrow(low: float, high: float, radius: float, head: float) -> Mesh:
    """An arrow along the z axis from one height to another, with a head of that radius and 2.5 radii long."""
    tip = min(2.5 * head, 0.5 * (high - low))
    shaft = face_mesh(Face(shapes.cylinder(radius, high - tip - low)), _BUDGET)
    cone = face_mesh(Face(shapes.cone(head, tip)), _BUDGET)
    return joined([_raised(shaft, 0.5 * (low + high - tip)), _raised(cone, high - 0.5 * tip)])


def rod(start: Array, end: Array, radius: float) -> Mesh:
    """A round rod between two points."""
    axis = end - start
    length = float(np.linalg.norm(axis))
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([radius * across, radius * np.cross(axis / length, across), axis])
    matrix[:3, 3] = start
    return stick().transformed(matrix)


def rods(points: Array, pairs: list[tuple[int, int]], radius: float) -> Mesh:
    """Rods between pairs of points, with a ball at every point so that they join without a gap."""
    matrix = np.diag([radius, radius, radius, 1.0])
    parts = [rod(points[i], points[j], radius) for i, j in pairs]
    for point in points:
        matrix[:3, 3] = point
        parts.append(ball().transformed(matrix))
    return joined(parts)


@lru_cache(maxsize=2)
def cross(arm: float, radius: float) -> Mesh:
    """Three rods through the origin, along the coordinate axes."""
    return joined([rod(-way, way, radius) for way in arm * np.eye(3)])
