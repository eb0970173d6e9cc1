"""The length or area of a workspace's boundary that each of its places stands for.

Points around the boundary are counted, each for the place nearest to it, by a hat of their height over the tangent
plane there: a Dirac function, smeared over half a cell to either side. What the boundary's curvature adds on one side
it takes away on the other. Where pieces of the boundary meet at an angle, a point counts for the nearest place of
either piece, if its projection on the tangent plane there is on the boundary: at a corner that goes into the set not
behind the other piece, at one that goes out not before it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from assembly.studies.reachable.content import SIDE, cells_beside, sample_points, steps_around
from assembly.studies.reachable.grid import Grid

__all__ = ["Boundary", "boundary_shares"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
# [cells] How far from the boundary points count, less the farther they are.
_BAND = 0.5
# Places nearest to a point that are looked at, and [cells] how far they may be: the boundary has one at least a cell.
_NEAR, _FAR = 12, 2.0
# Cosine of the angle from which on normals are of two pieces: neighbors on a circle of two cells differ by less.
_ALIKE = 0.9
# What is behind a corner's plane by this part of its distance, or more, is no smooth boundary beside it.
_SHARP = 0.1
# [cells] Places that are nearer are one. Their own error is 1e-6 at most; normals of one are alike to this as well.
_ONE = 1e-3


class Boundary(NamedTuple):
    """Places of a boundary in units of cells along the axes of a grid.

    Attributes
    ----------
    places, normals : (m, d)
    counts : (m,) bool
        Whether a place stands for a part of the boundary.
    """

    places: Array
    normals: Array
    counts: NDArray[np.bool_]

    @classmethod
    def of(cls, grid: Grid, places: Array, normals: Array, targets: Array) -> Boundary:
        """From places, normals and the targets that the tip was drawn to, (m, 3) of the world.

        Where the tip came nearer to a target on another way, a place may be in the middle of the set. Of places that
        were found several times one counts; of those at a corner that goes out, which is the nearest place to all that
        is before it, none does.
        """
        flat, sides = grid.flat(places), normals @ grid.axes.T
        lengths = np.linalg.norm(targets - places, axis=1) / grid.size
        _, which = np.unique(targets, axis=0, return_inverse=True)
        least = np.full(which.max() + 1, np.inf)
        np.minimum.at(least, which.ravel(), lengths)
        counts = lengths <= least[which.ravel()] + _ONE
        for first, second in cKDTree(flat).query_pairs(_ONE, output_type="ndarray").tolist():
            if counts[first] and np.abs(sides[first] - sides[second]).max() <= _ONE:
                counts[second] = False
        known = cls(flat, sides, counts)
        counts[counts] = ~_at_corners(known, np.flatnonzero(counts))
        return known


def _at_corners(boundary: Boundary, own: Indices) -> NDArray[np.bool_]:
    """Which of places (m,) are at a corner that goes out.

    On a smooth boundary two places are as far behind each other's tangent planes; a corner is on the planes of the
    places beside it, and these are behind its own.
    """
    places = boundary.places[own]
    count = min(_NEAR, len(own))
    distances, order = cKDTree(places).query(places, k=count, distance_upper_bound=_FAR)
    distances, order = distances.reshape(-1, count), order.reshape(-1, count)
    near, known = own[np.where(np.isfinite(distances), order, order[:, :1])], np.isfinite(distances)
    here = np.broadcast_to(own[:, None], near.shape)
    behind = -_heights(boundary, boundary.places[near], here)
    ahead = -_heights(boundary, boundary.places[here], near)
    found = known & (behind > _SHARP * distances) & (np.abs(ahead) < _SHARP * behind)
    # Others at the same corner.
    found |= known & (distances < _ONE) & ((boundary.normals[near] * boundary.normals[here]).sum(axis=2) < 1.0 - _ONE)
    return np.asarray(found.any(axis=1))


def boundary_shares(grid: Grid, reached: Indices, boundary: Boundary) -> Array:
    """The length or area that each place of a boundary stands for, (m,), from the cells (k, d) reached.

    It is off by the square of the cell.
    """
    result = np.zeros(len(boundary.counts))
    own = np.flatnonzero(boundary.counts)
    near, cut = cells_beside(reached)
    # Cells that are next to those through which the boundary goes, as well.
    beside = np.concatenate([cut, near])
    band = np.unique((beside[:, None] + steps_around(grid.dimension)).reshape(-1, grid.dimension), axis=0)
    points = sample_points(grid, band)
    tree = cKDTree(boundary.places[own])
    count = min(_NEAR, len(own))
    distances, order = tree.query(points, k=count, distance_upper_bound=_FAR)
    distances, order = distances.reshape(-1, count), order.reshape(-1, count)
    inside = np.isfinite(distances[:, 0])
    points, order, known = points[inside], order[inside], np.isfinite(distances[inside])
    candidates = own[np.where(known, order, order[:, :1])]
    first = candidates[:, 0]
    weights = _hats(boundary, points, first)
    may_be = np.flatnonzero(_beside_others(boundary, own)[first])
    unlike = ~_are_alike(boundary, candidates[may_be], first[may_be])
    mixed = may_be[unlike.any(axis=1)]
    candidates, points = candidates[mixed], points[mixed]
    weights[mixed] *= _on_it(boundary, points, first[mixed], candidates)
    second = _nearest(boundary, candidates, unlike[unlike.any(axis=1)], points)
    more = _hats(boundary, points, second) * _on_it(boundary, points, second, candidates)
    each = grid.size ** (grid.dimension - 1) / SIDE[grid.dimension] ** grid.dimension
    result += each * np.bincount(first, weights, len(result))
    result += each * np.bincount(second, more, len(result))
    return result


def _heights(boundary: Boundary, points: Array, places: Indices) -> Array:
    """How far points (k, d) are before the tangent planes at places (k,)."""
    result: Array = ((points - boundary.places[places]) * boundary.normals[places]).sum(axis=-1)
    return result


def _hats(boundary: Boundary, points: Array, places: Indices) -> Array:
    """What points (k, d) count for the boundary at places (k,)."""
    height = _heights(boundary, points, places)
    result: Array = np.maximum(0.0, 1.0 - np.abs(height) / _BAND) / _BAND
    return result


def _beside_others(boundary: Boundary, own: Indices) -> NDArray[np.bool_]:
    """Which of all places have one of another piece so near that a point may have both as candidates."""
    result = np.zeros(len(boundary.counts), dtype=bool)
    pairs = own[cKDTree(boundary.places[own]).query_pairs(2.0 * _FAR, output_type="ndarray")]
    unlike = (boundary.normals[pairs[:, 0]] * boundary.normals[pairs[:, 1]]).sum(axis=1) <= _ALIKE
    result[pairs[unlike].ravel()] = True
    return result


def _are_alike(boundary: Boundary, candidates: Indices, places: Indices) -> NDArray[np.bool_]:
    """Whether normals at candidates (k, c) are like those at places (k,)."""
    normals = boundary.normals
    return np.asarray((normals[candidates] @ normals[places][:, :, None])[:, :, 0] > _ALIKE)


def _nearest(boundary: Boundary, candidates: Indices, others: NDArray[np.bool_], points: Array) -> Indices:
    """Of those candidates (k, c) that are told, the nearest to points (k, d)."""
    distances = ((boundary.places[candidates] - points[:, None]) ** 2).sum(axis=2)
    nearest = np.argmin(np.where(others, distances, np.inf), axis=1)
    result: Indices = np.take_along_axis(candidates, nearest[:, None], axis=1)[:, 0]
    return result


def _on_it(boundary: Boundary, points: Array, places: Indices, candidates: Indices) -> Array:
    """Which parts (k,) of what points (k, d) stand for are on the boundary, by their projections on the planes at
    places (k,).

    The nearest candidate of another piece says so, in space of two others: a place of the boundary that is before the
    plane there is at a corner that goes into the set. A point stands for what is half a step to either side of it.
    """
    feet = points - _heights(boundary, points, places)[:, None] * boundary.normals[places]
    step = 1.0 / SIDE[points.shape[1]]
    result, others = np.ones(len(points)), ~_are_alike(boundary, candidates, places)
    for _ in range(points.shape[1] - 1):
        other = _nearest(boundary, candidates, others, feet)
        height, place_height = _heights(boundary, feet, other), _heights(boundary, boundary.places[places], other)
        cosines = (boundary.normals[other] * boundary.normals[places]).sum(axis=1)
        past = height / (step * np.sqrt(np.maximum(1.0 - cosines**2, _ONE)))
        parts = np.clip(0.5 + np.where(place_height > _ONE, past, -past), 0.0, 1.0)
        result *= np.where(others.any(axis=1), parts, 1.0)
        others &= ~_are_alike(boundary, candidates, other)
    return result
