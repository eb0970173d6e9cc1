"""Proof by hulls of faces that a point of one body is inside of another one, so that they cross.

A segment does not meet a face that both of its ends are beyond along one direction, nor one that is around a convex
hollow which both are in. Of every body some points are known to be inside: straight below a point of a face, with
nothing of the boundary between. So whatever a segment that meets no face joins to one of these is inside as well.

That the points of the other body are samples makes it no guess: each of them is a point of that, and what is told of
it is proven. Bodies that cross elsewhere only are not told of.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.equal_shapes import first_equal
from assembly.geometry.faces.face import Face
from assembly.proximity.clearance.answers import Answer, Verdict
from assembly.proximity.clearance.hulls.body_hulls import BodyHulls, hulls_of_body
from assembly.proximity.clearance.hulls.discs import Discs
from assembly.proximity.clearance.hulls.hollows import ForBalls, depths_within

__all__ = ["Marked", "crossing_by_hulls", "marked"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
# Points of a face each way, and of a curve of its boundary.
GRID, ALONG = 6, 9
# How far below a face a point inside is looked for, in parts of the body's extent along its normal.
BELOW = (0.4, 0.15, 0.05)
# Points inside of a body that are kept.
INNER = 24
# [size] What points of faces may be off.
ROUNDING = 1e-11
# Numbers that are compared at most for one direction of one pair: cells tell more quickly of bodies of many faces.
MOST = 3_000_000


class Marked(NamedTuple):
    """Points of a body, in its own axes.

    Attributes
    ----------
    boundary : (p, 3)
        On its faces.
    inner : (c, 3)
        Inside of it for certain.
    beyond : (c, f, k)
        Whether each of these is beyond a face along a direction, and, behind these, in one of its hollows.
    normals : (k, 3)
        The directions.
    reach : (f, k)
        How far every face reaches along them.
    """

    boundary: Array
    inner: Array
    beyond: NDArray[np.float32]
    normals: Array
    reach: Array


def marked(faces: tuple[Face, ...]) -> Marked:
    """Points on a body and inside of it; equal shapes share them."""
    return _marked(first_equal(faces))


@lru_cache(maxsize=256)
def _marked(faces: tuple[Face, ...]) -> Marked:
    hulls = hulls_of_body(faces)
    normals = np.concatenate([hulls.directions, -hulls.directions, np.eye(3), -np.eye(3)])
    reach = hulls.reach(normals)
    size = hulls.ball[1]
    points, outward, owner = _points_in_faces(faces)
    inner = _below(hulls, (normals, reach), (points, outward, owner), ROUNDING * size)
    inner = inner[_spread(inner)]
    beyond = _depths(hulls, inner, normals, reach) > ROUNDING * size
    boundary = np.concatenate([hulls.points, points, *(_on_edges(face) for face in faces)])
    return Marked(boundary, inner, beyond.astype(np.float32), normals, reach)


def crossing_by_hulls(
    shapes: tuple[tuple[Face, ...], tuple[Face, ...]], turn: Array, shift: Array, touching: float
) -> Answer | None:
    """That two bodies cross by more than `touching`, or None where hulls do not tell it.

    Parameters
    ----------
    shapes : (faces, faces)
    turn, shift : (3, 3), (3,)
        The second body is at turn x + shift in the axes of the first.
    touching : float

    Returns
    -------
    Answer or None
        A point of either is inside of the other one at its place, in the axes of the first body, and farther from the
        boundary of that than the depth. One of the bodies has a point that is outside of the other one.
    """
    first, second = marked(shapes[0]), marked(shapes[1])
    found = _deepest(shapes[0], (second.boundary @ turn.T + shift), touching)
    if found is None:
        found = _deepest(shapes[1], (first.boundary - shift) @ turn, touching)
        if found is None:
            return None
        found = found[0], turn @ found[1] + shift
    return Answer(Verdict.CROSSING, depth=found[0], place=found[1])


def _deepest(faces: tuple[Face, ...], points: Array, least: float) -> tuple[float, Array] | None:
    """Of points (p, 3) of another body one that is inside of this one, farther from its boundary than a length.

    None as well where none of them is outside of it.
    """
    hulls, mine = hulls_of_body(faces), marked(faces)
    if not len(mine.inner):
        return None
    rounding = ROUNDING * (hulls.ball[1] + float(np.abs(points).max()))
    over = points @ mine.normals.T - mine.reach.max(axis=0)
    is_within = (over < -least - rounding).all(axis=1)
    if not is_within.any() or not (over > rounding).any():
        return None
    within = points[is_within]
    if len(within) * mine.beyond.size > MOST * len(mine.inner):
        return None
    depths = _depths(hulls, within, mine.normals, mine.reach)
    far = depths.max(axis=2).min(axis=1) - rounding
    order = np.argsort(-far, kind="stable")
    deep = order[far[order] > least]
    beyond = (depths[deep] > rounding).astype(np.float32)
    for k, row in zip(deep.tolist(), beyond, strict=True):
        if ((mine.beyond * row).any(axis=2)).all(axis=1).any():
            return float(far[k]), within[k]
    return None


def _depths(hulls: BodyHulls, points: Array, normals: Array, reach: Array) -> Array:
    """How far points (p, 3) are beyond every face along directions, and in its hollows: (p, f, k + most hollows)."""
    along = (points @ normals.T)[:, None] - reach
    hollows: list[list[Array]] = [[] for _ in reach]
    convex = [(face, hollow) for face, hollow in hulls.hollows if not isinstance(hollow, ForBalls)]
    depths = depths_within([hollow for _, hollow in convex], Discs.of_points(points))
    for (face, _), depth in zip(convex, depths, strict=True):
        hollows[face].append(depth)
    columns = np.full((len(points), len(reach), max((len(own) for own in hollows), default=0)), -np.inf)
    for face, own in enumerate(hollows):
        for column, depth in enumerate(own):
            columns[:, face, column] = depth
    return np.concatenate([along, columns], axis=2)


def _points_in_faces(faces: tuple[Face, ...]) -> tuple[Array, Array, NDArray[np.int64]]:
    """Points in faces, not at their boundaries: (p, 3), with outward normals and the faces' numbers."""
    steps = (np.arange(GRID) + 0.5) / GRID
    points, normals, owner = [np.zeros((0, 3))], [np.zeros((0, 3))], [np.zeros(0, dtype=np.int64)]
    for number, face in enumerate(faces):
        low, high = (np.array([side[k] for side in face.surface.domain]) for k in (0, 1))
        if face.outer is not None and not any(face.surface.closed):
            ends = np.concatenate([_uv(curve.bezier_pieces()) for curve in face.boundary])
            low, high = np.maximum(low, ends.min(axis=0)), np.minimum(high, ends.max(axis=0))
        u, v = (grid.ravel() for grid in np.meshgrid(*(low + (high - low) * steps[:, None]).T, indexing="ij"))
        if face.boundary:
            inside = face.locate(u, v) > 0
            u, v = u[inside], v[inside]
        points.append(np.asarray(face.surface.evaluate(u, v)).reshape(-1, 3))
        normals.append(face.normal(u, v).reshape(-1, 3))
        owner.append(np.full(len(u), number))
    return np.concatenate(points), np.concatenate(normals), np.concatenate(owner)


def _uv(pieces: Array) -> Array:
    """The control points (n, 2) of pieces of a curve of (u, v)."""
    net = pieces.reshape(-1, 3)
    return np.asarray(net[:, :2] / net[:, 2:])


def _on_edges(face: Face) -> Array:
    """Points of a face's boundary (n, 3)."""
    if not face.boundary:
        return np.zeros((0, 3))
    low, high = (np.array([side[k] for side in face.surface.domain]) for k in (0, 1))
    uv = np.concatenate([curve.evaluate(np.linspace(*curve.domain, ALONG)) for curve in face.boundary])[:, :2]
    # Rounding may leave an end a little beyond that of the domain; directions that are closed wrap.
    uv = np.where(face.surface.closed, uv, np.clip(uv, low, high))
    return np.asarray(face.surface.evaluate(uv[:, 0], uv[:, 1])).reshape(-1, 3)


def _below(
    hulls: BodyHulls, along: tuple[Array, Array], of_faces: tuple[Array, Array, NDArray[np.int64]], rounding: float
) -> Array:
    """Points straight below points of faces such that nothing of the boundary is between: inside for certain.

    The face itself has to be on one side of the two: it is flat, or around a convex body.
    """
    (normals, reach), (points, outward, owner) = along, of_faces
    found = [np.zeros((0, 3))]
    at_face = _depths(hulls, points, normals, reach)
    # Of its own face the upper end is a point.
    beyond = np.where((owner[:, None] == hulls.part_of)[..., None], at_face > -rounding, at_face > rounding)
    extent = np.array([np.ptp(hulls.points @ way) for way in outward])
    left: Flags = np.ones(len(points), dtype=np.bool_)
    for part in BELOW:
        lower = points - part * extent[:, None] * outward
        meets_none: Flags = np.any((_depths(hulls, lower, normals, reach) > rounding) & beyond, axis=2).all(axis=1)
        found.append(lower[left & meets_none])
        left = left & ~meets_none
    return np.concatenate(found)


def _spread(points: Array) -> list[int]:
    """The numbers of some points that are far from each other."""
    if not len(points):
        return []
    kept, near = [0], np.linalg.norm(points - points[0], axis=1)
    while len(kept) < min(INNER, len(points)) and near.max() > 0.0:
        kept.append(int(near.argmax()))
        near = np.minimum(near, np.linalg.norm(points - points[kept[-1]], axis=1))
    return kept
