"""Cones of directions (a unit axis and a half angle) around vectors and around other cones, rounded outward."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.bvh.normal_cones import (
    CONVEX,
    FULL,
    MARGIN,
    write_cones_of_cones,
    write_cones_of_vectors,
)

__all__ = ["CONVEX", "FULL", "MARGIN", "around_cones", "around_vectors", "between"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


def between(a: Array, b: Array) -> Array:
    """Angles between unit vectors (..., 3), accurate for small ones too."""
    return np.asarray(2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(a - b, axis=-1), 1.0)))


def around_vectors(vectors: Array, slack: Array, vanish: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Cones around vectors (n, k, 3) and so around their positive combinations.

    Parameters
    ----------
    vectors
    slack : (n,)
        How far each vector may be off the true one.
    vanish : (n,)
        Whether vectors that are zero are known to be, and count for nothing.

    Returns
    -------
    axis : (n, 3)
    half : (n,)
        `FULL` where a vector may as well be zero, or where the cone is too wide to be convex.
    """
    out = np.empty((len(vectors), 4))
    write_cones_of_vectors(np.ravel(vectors), slack, vanish, out)
    return out[:, :3], out[:, 3]


def around_cones(axis: Array, half: Array, begins: Indices) -> tuple[Array, Array]:
    """Cones around groups of cones, those from each begin to the next one."""
    cones = np.concatenate([axis, half[:, None]], axis=1)
    out = np.empty((len(begins), 4))
    write_cones_of_cones(cones, np.arange(len(cones)), begins, out)
    return out[:, :3], out[:, 3]
