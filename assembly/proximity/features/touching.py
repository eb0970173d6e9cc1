"""Bodies that touch and do not cross: with flush faces, a search may find common points.

Where two flat faces lie on each other, the pair along which the bodies would come apart says little of how deep they
are in each other: a search may come to a pair along the faces. A move off the faces tells: bodies that so small a move
parts only touch.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.kinematics.pose import rotate

__all__ = ["flush_ways"]

Array = NDArray[np.float64]
Faces = tuple[Face, ...]
# Control points of a flat face are this near to a plane, in parts of its size.
_FLAT = 1e-12
# The sine of the angle between the normals of flush faces, at most.
_OPPOSED = 1e-6


@lru_cache(maxsize=256)
def _flat_faces(faces: Faces) -> tuple[Array, Array]:
    """A point of every flat face, and its outward normal."""
    points, normals = [], []
    for face in faces:
        net = face.surface.control_points.reshape(-1, 3)
        middle = net.mean(axis=0)
        size = float(np.abs(net - middle).max())
        normal = np.linalg.svd(net - middle, full_matrices=False)[2][2]
        if float(np.abs((net - middle) @ normal).max()) > _FLAT * size:
            continue
        (low_u, high_u), (low_v, high_v) = face.surface.domain
        outward = face.normal(0.5 * (low_u + high_u), 0.5 * (low_v + high_v))
        points.append(middle)
        normals.append(normal if float(normal @ outward) > 0.0 else -normal)
    return np.array(points).reshape(-1, 3), np.array(normals).reshape(-1, 3)


def flush_ways(a: Faces, q_a: Array, b: Faces, q_b: Array, reach: float) -> list[Array]:
    """Unit directions in which b moves off a, where flat faces of the two are in one plane but for a reach.

    Each by itself, and the way off all of them at once where there are several.
    """
    points_a, normals_a = _flat_faces(a)
    points_b, normals_b = _flat_faces(b)
    if not len(points_a) or not len(points_b):
        return []
    points_a, normals_a = rotate(q_a[3:], points_a) + q_a[:3], rotate(q_a[3:], normals_a)
    points_b, normals_b = rotate(q_b[3:], points_b) + q_b[:3], rotate(q_b[3:], normals_b)
    opposed = np.linalg.norm(normals_a[:, None] + normals_b[None, :], axis=-1) <= _OPPOSED
    between = points_b[None, :] - points_a[:, None]
    off = np.abs(np.einsum("ijk,ik->ij", between, normals_a))
    ways: list[Array] = []
    for k in np.flatnonzero((opposed & (off <= reach)).any(axis=1)).tolist():
        if not any(float(way @ normals_a[k]) > 1.0 - _OPPOSED for way in ways):
            ways.append(normals_a[k])
    total = np.sum(ways, axis=0) if len(ways) > 1 else np.zeros(3)
    length = float(np.linalg.norm(total))
    return [*ways, total / length] if length > 0.5 else ways
