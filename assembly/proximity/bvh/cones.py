"""Cones of directions (a unit axis and a half angle) around vectors and around other cones, rounded outward.

A circular cone of less than 90 degrees is convex: one around the Bezier vectors of a normal is one around the normal.
"""

from __future__ import annotations

from math import pi

import numpy as np
from numpy.typing import NDArray

__all__ = ["FULL", "around_cones", "around_vectors", "between"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
# All directions.
FULL = pi
# Wider cones around vectors are not convex, or nearly so: nothing is known of combinations of the vectors.
CONVEX = 1.5
# Rounding of a unit vector, of an angle and of a box, in parts of its extent.
MARGIN = 1e-14
# Steps of the axis towards the direction that is farthest off; the k-th goes 1 / (k + 2) of the way.
_STEPS = 8


def between(a: Array, b: Array) -> Array:
    """Angles between unit vectors (..., 3), accurate for small ones too."""
    return np.asarray(2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(a - b, axis=-1), 1.0)))


def _unit(vectors: Array) -> Array:
    """Unit vectors; (0, 0, 1) for what is nearly zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(length > 1e-3, vectors / np.maximum(length, 1e-3), [0.0, 0.0, 1.0])


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
    length = np.linalg.norm(vectors, axis=2)
    counts = (length > 0.0) | ~vanish[:, None]
    unit = vectors / np.where(length > 0.0, length, 1.0)[..., None]
    low = np.where(counts[..., None], unit, 1.0).min(axis=1)
    high = np.where(counts[..., None], unit, -1.0).max(axis=1)
    axis = _unit(0.5 * (low + high))
    # How far the true direction may be off, and how far the vector's own is.
    sine = np.where(counts, np.minimum(slack[:, None], length) / np.maximum(length, 1e-300), 0.0)
    angle = np.where(counts, between(unit, axis[:, None]) + np.arcsin(sine), 0.0)
    half = angle.max(axis=1) + 2.0 * MARGIN
    sure = counts.any(axis=1) & (half < CONVEX) & (np.where(counts, length, 1.0) > 0.0).all(axis=1)
    return axis, np.where(sure, half, FULL)


def around_cones(axis: Array, half: Array, begins: Indices) -> tuple[Array, Array]:
    """Cones around groups of cones, those from each begin to the next one."""
    sizes = np.diff(np.append(begins, len(axis)))
    low, high = np.minimum.reduceat(axis, begins), np.maximum.reduceat(axis, begins)
    middle = _unit(0.5 * (low + high))
    best, least = middle, np.full(len(begins), np.inf)
    for step in range(_STEPS):
        reach = between(axis, np.repeat(middle, sizes, axis=0)) + half
        wide = np.maximum.reduceat(reach, begins)
        better = wide < least
        best, least = np.where(better[:, None], middle, best), np.minimum(wide, least)
        # The first of each group that reaches as far.
        hits = np.flatnonzero(reach >= np.repeat(wide, sizes))
        owner = np.searchsorted(begins, hits, side="right") - 1
        far = hits[np.unique(owner, return_index=True)[1]]
        middle = _unit(middle + (axis[far] - middle) / (step + 3.0))
    return best, np.where(least < FULL, np.minimum(least + 2.0 * MARGIN, FULL), FULL)
