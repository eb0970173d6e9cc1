"""Where a surface is farther than a tolerance from triangles whose corners lie on it, or turns too far along them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.meshing.border import cross, on_surface
from assembly.geometry.meshing.steps import unit

__all__ = ["Apart", "measured"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
# In parts of an edge: how far off its middle the surface may be at its middle parameters, along the surface.
_OBLIQUE = 0.3
# How much farther than the angle asked for a surface may turn along an edge, and what part of the tolerance is so
# little that it does not matter how far it turns.
_ARCHED, _UNSEEN = 1.5, 0.01


class Apart(NamedTuple):
    """Edges (k, 2) that are to be divided and triangles that are to get a point inside."""

    edges: Indices
    triangles: Indices


def measured(face: Face, parameters: Array, points: Array, triangles: Indices, tolerance: float, angle: float) -> Apart:
    """Where the surface is farther than a tolerance from triangles, or turns too far along them.

    The point of the surface at the middle parameters of an edge or a triangle is apart from its middle along the
    surface and across: across counts, and along as soon as the first is no more told apart from the second. At the
    last edges whatever is not along the edge counts.
    """
    n = len(points)
    pairs = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    keys, first, number = np.unique(pairs @ np.array([n, 1]), return_index=True, return_inverse=True)
    edges = np.column_stack(np.divmod(keys, n))
    number = number.reshape(-1, 3)
    corners = points[triangles]
    at = np.concatenate([parameters[edges].mean(axis=1), parameters[triangles].mean(axis=1)])
    middle = np.concatenate([points[edges].mean(axis=1), corners.mean(axis=1)])
    there, su, sv = on_surface(face.surface, at, 1)
    normal = unit(cross(su, sv))
    apart = there - middle
    across = np.abs((apart * normal).sum(axis=1))
    along = np.linalg.norm(apart, axis=1)
    ways = points[edges[:, 1]] - points[edges[:, 0]]
    length = np.linalg.norm(ways, axis=1)
    # Where facets end, none goes on across the projection of the normal. At a seam one does, from corners of the same
    # place.
    _, place = np.unique(points, axis=0, return_inverse=True)
    _, same, uses = np.unique(
        np.sort(place.reshape(-1)[pairs], axis=1) @ np.array([n, 1]), return_inverse=True, return_counts=True
    )
    last = np.flatnonzero(uses[same.reshape(-1)[first]] == 1)
    way = unit(ways[last])
    across[last] = np.linalg.norm(apart[last] - (apart[last] * way).sum(axis=1, keepdims=True) * way, axis=1)
    size = np.concatenate([length, length[number].max(axis=1)])
    # An arc that turns by an angle rises by an eighth of it, times its chord.
    arched = np.maximum(_ARCHED / 8.0 * angle * size, _UNSEEN * tolerance)
    bad = (across > np.minimum(tolerance, arched)) | (along > np.maximum(_OBLIQUE * size, tolerance))
    wrong, hollow = bad[: len(edges)] & (length > 0.0), bad[len(edges) :]
    # Facets that look inward, other than by the width of a hair.
    flat = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    longest = length[number].max(axis=1)
    turned = (flat * normal[len(edges) :]).sum(axis=1) < -tolerance * longest
    rank = np.where(wrong[number], length[number], 0.0)
    chosen = np.where(wrong[number].any(axis=1), rank.argmax(axis=1), -1)
    chosen = np.where((chosen < 0) & turned, length[number].argmax(axis=1), chosen)
    rows = np.flatnonzero(chosen >= 0)
    divided = np.unique(number[rows, chosen[rows]])
    return Apart(edges[divided], np.flatnonzero(hollow & (chosen < 0)))
