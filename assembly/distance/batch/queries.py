"""Many candidate paths against many obstacles at once, as in replanning a trajectory (Lakshmanan et al. 003, V-D)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.distance.batch import filter as collision_batch
from assembly.errors import InputError, number, positive, real_array
from assembly.geometry.splines.curve import NurbsCurve

__all__ = ["collisions"]

Array = NDArray[np.float64]


def collisions(
    curves: ArrayLike | Sequence[NurbsCurve],
    obstacles: Sequence[ArrayLike],
    clearance: float = 0.0,
    tolerance: float = 1e-10,
) -> NDArray[np.bool_]:
    """Which curves come within a clearance of which convex obstacles.

    Parameters
    ----------
    curves : (n, k, d) array, or a sequence of n NurbsCurve
        An array holds the control points of n Bezier curves of degree k - 1.
    obstacles : sequence of m (k, d) arrays
        Vertices of convex hulls, in any order; inside counts as meeting.
    clearance : float
        Zero or positive; zero asks whether they meet.
    tolerance : float
        Positive. Pieces of a curve that are shorter, or than 64 (degree + 1) 2^-52 of the largest coordinate, and not
        proven apart count as near.

    Returns
    -------
    (n, m) bool array
        False is a certificate: curve i is proven to be farther than the clearance from obstacle j. True: a point of
        the curve is within the clearance, or within the clearance and about the tolerance.

    Raises
    ------
    InputError, TypeError
        Curves or obstacles of other shapes or of another dimension, or an option that is not meant.
    """
    table, pool, count, dimension = _packed_curves(curves)
    points, hulls, boxes = _packed_obstacles(obstacles, dimension)
    gap = number("clearance", clearance)
    if gap < 0.0:
        raise InputError(f"clearance is {gap:g}; expected zero or a positive number")
    out = np.zeros((count, len(hulls)), dtype=np.int64)
    tolerance = positive("tolerance", tolerance)
    collision_batch.near_pairs(dimension + 1, (table, pool), (hulls, points, boxes), gap, tolerance, out)
    return np.asarray(out != collision_batch.APART)


def _packed_curves(curves: Any) -> tuple[NDArray[np.int64], Array, int, int]:
    """Rows of pieces, their homogeneous points, and the number and dimension of the curves."""
    if isinstance(curves, (list, tuple)) and any(isinstance(curve, NurbsCurve) for curve in curves):
        return _packed_splines(curves)
    points = curves
    fits = type(points) is np.ndarray and points.ndim == 3 and points.dtype == np.float64
    if not fits or not np.isfinite(points).all():
        # This goes through all entries to find the first wrong one: slow for a large array, so only if there is one.
        points = real_array("curves", curves, ("n", "k", "d"))
    n, k, d = points.shape
    if d not in (2, 3) or k < 2:
        raise InputError(f"curves has shape {points.shape}; expected (n, k, 2) or (n, k, 3) with k of at least 2")
    pool = np.zeros((n, k, 4))
    pool[..., :d], pool[..., 3] = points, 1.0
    numbers = np.arange(n)
    table = np.zeros((n, 4), dtype=np.int64)
    table[:, 0], table[:, 1], table[:, 3] = numbers, k - 1, 4 * k * numbers
    return table, pool.ravel(), n, d


def _packed_splines(curves: Sequence[NurbsCurve]) -> tuple[NDArray[np.int64], Array, int, int]:
    rows: list[tuple[int, int, int, int]] = []
    pool: list[Array] = []
    used = 0
    dimension = None
    for i, curve in enumerate(curves):
        if not isinstance(curve, NurbsCurve):
            raise TypeError(f"curves[{i}] is {curve!r}; expected a NurbsCurve like the others")
        d = curve.control_points.shape[1]
        if d != (dimension or d):
            raise InputError(f"curves[{i}] is {d}-D; expected {dimension}-D like the others")
        dimension = d
        pieces = curve.bezier_pieces()
        points = np.zeros((*pieces.shape[:2], 4))
        points[..., :d], points[..., 3] = pieces[..., :-1], pieces[..., -1]
        rational = bool((points[..., 3] != 1.0).any())
        for piece in points:
            rows.append((i, curve.degree, rational, used))
            pool.append(piece.ravel())
            used += piece.size
    return np.array(rows, dtype=np.int64), np.concatenate(pool), len(curves), dimension or 3


def _hold_points(obstacles: Any) -> bool:
    """Whether the first is no row of numbers: to give the vertices of one obstacle alone is the usual mistake."""
    if isinstance(obstacles, np.ndarray) and obstacles.ndim == 0:
        return False
    try:
        return len(obstacles) == 0 or np.ndim(obstacles[0]) == 2
    except ValueError:  # rows of several lengths: what is wrong with them is said with their number
        return True


def _packed_obstacles(obstacles: Any, dimension: int) -> tuple[Array, NDArray[np.int64], Array]:
    """Vertices of all in a row, place and number of each one's, and their boxes."""
    if not isinstance(obstacles, (list, tuple, np.ndarray)) or not _hold_points(obstacles):
        raise InputError("obstacles is no sequence of arrays of vertices (k, d); expected one array an obstacle")
    vertices: list[Array] = []
    hulls = np.zeros((len(obstacles), 2), dtype=np.int64)
    boxes = np.zeros((len(obstacles), 6))
    used = 0
    for j, obstacle in enumerate(obstacles):
        given = real_array(f"obstacles[{j}]", obstacle, ("k", dimension))
        points = np.zeros((len(given), 3))
        points[:, :dimension] = given
        vertices.append(points.ravel())
        hulls[j] = used, len(points)
        boxes[j, :3], boxes[j, 3:] = points.min(axis=0), points.max(axis=0)
        used += points.size
    return np.concatenate(vertices) if vertices else np.zeros(3), hulls, boxes
