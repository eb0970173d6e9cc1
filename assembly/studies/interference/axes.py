"""What keeps a pin and its bore apart for certain: surfaces of revolution about an axis that both have.

About an axis every face lies between two radii and between two heights. Of two faces either the one is farther from the
axis than the other one, or above it, or below it; by how much they are no nearer to each other. That is the separation
of two bodies where it holds of all pairs of their faces.

Where it is not positive but at least -t, the bodies have no more in common than a skin: the inner one is within what
its faces sweep around the axis, for from any point beside that the way outward meets none of them; the outer one is
outside of the same swept by t less, where no face of it is, and neither is the axis.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.proximity.bvh.normal_nets import bezier_product
from assembly.studies.interference.bounds import ROUNDING, Posed, flat_map

__all__ = ["revolved_between"]

Array = NDArray[np.float64]
# A face is a cylinder whose normals and radii agree to this part of its size; what is proven does not rest on it.
ROUND = 1e-7
# Samples along either parameter of a face.
SAMPLES = 7
# Axes are tried whose sines are below this, and whose distance is below this part of the smaller radius.
PARALLEL, BESIDE = 1e-2, 0.9


class Axis(NamedTuple):
    """The axis of a cylinder, its radius, and whether the material is within, as of a pin."""

    point: Array
    direction: Array
    radius: float
    is_convex: bool


@lru_cache(maxsize=1024)
def _axis_of(face: Face) -> Axis | None:
    """The axis of a face that is a cylinder, in its own axes."""
    (low_u, high_u), (low_v, high_v) = face.surface.domain
    part = (np.arange(SAMPLES) + 0.5) / SAMPLES
    u, v = np.meshgrid(low_u + (high_u - low_u) * part, low_v + (high_v - low_v) * part)
    points = face.surface.evaluate(u.ravel(), v.ravel())
    normals = face.normal(u.ravel(), v.ravel())
    turns, across = np.linalg.svd(normals, full_matrices=False)[1:]
    if turns[2] > ROUND * turns[0] or turns[1] < 0.1 * turns[0]:
        return None
    # In the plane across: p = c + r n.
    plane = across[:2]
    flat, outward = points @ plane.T, normals @ plane.T
    rows = np.concatenate([np.tile(np.eye(2), (len(flat), 1)), outward.reshape(-1, 1)], axis=1)
    center, *_ = np.linalg.lstsq(rows, flat.ravel(), rcond=None)
    if np.abs(rows @ center - flat.ravel()).max() > ROUND * face.surface.size:
        return None
    return Axis(center[:2] @ plane, across[2], abs(float(center[2])), bool(center[2] > 0.0))


def _axes(body: Posed, convex: bool) -> list[Axis]:
    """The axes of a body's pins or bores in the world, each once."""
    found: list[Axis] = []
    for face in body.faces:
        axis = _axis_of(face)
        if axis is None or axis.is_convex != convex:
            continue
        placed = axis._replace(point=body.placed(axis.point[None])[0], direction=body.rotation @ axis.direction)
        if not any(_beside(placed, other, ROUND, ROUND) for other in found):
            found.append(placed)
    return found


def _beside(a: Axis, b: Axis, sine: float, part: float) -> bool:
    """Whether two axes are parallel and near each other."""
    if np.linalg.norm(np.cross(a.direction, b.direction)) > sine:
        return False
    off = b.point - a.point
    return bool(np.linalg.norm(off - (off @ a.direction) * a.direction) <= part * min(a.radius, b.radius))


def _range(pieces: Array) -> tuple[float, float]:
    """Rational Bezier pieces (..., m, n, 3), x y w, are at least and at most so far from the origin.

    The square of the distance is a rational Bezier patch as well, between the least and the largest of its points: of
    arcs about the origin these are one. The hull of its control points is farther off, where a piece is straight.
    """
    flat, weight = pieces[..., :2], pieces[..., 2:]
    if pieces.shape[-3] * pieces.shape[-2] == 2:
        # Straight lines are their hulls.
        ends = (flat / weight).reshape(-1, 2, 2)
        return min(map(_hull_distance, ends)), float(np.linalg.norm(ends, axis=2).max())
    square = bezier_product(flat, flat).sum(axis=-1) / bezier_product(weight, weight)[..., 0]
    slack = ROUNDING * float(square.max())
    least = np.sqrt(np.maximum(square.min(axis=(-2, -1)) - slack, 0.0)).ravel()
    hulls = (flat / weight).reshape(len(least), -1, 2)
    low = min(max(float(one), _hull_distance(hull)) for one, hull in zip(least, hulls, strict=True))
    return low, float(np.sqrt(float(square.max()) + slack))


def _hull_distance(points: Array) -> float:
    """The hull of points (n, 2) is no nearer to the origin than this."""
    way = points[np.argmin(np.linalg.norm(points, axis=1))]
    # The nearest point may be between two: their normals, as well.
    ends = points[np.argsort(np.arctan2(points[:, 1], points[:, 0]))]
    sides = np.diff(ends, axis=0, append=ends[:1])
    ways = np.concatenate([[way, points.mean(axis=0)], np.stack([sides[:, 1], -sides[:, 0]], axis=1)])
    lengths = np.linalg.norm(ways, axis=1)
    ways = ways[lengths > 0.0] / lengths[lengths > 0.0, None]
    along = points @ np.concatenate([ways, -ways]).T
    return float(along.min(axis=0).max(initial=0.0))


@lru_cache(maxsize=1024)
def _boundary_pieces(face: Face) -> tuple[Array, ...]:
    """The Bezier pieces of every boundary curve of a face, which are asked for about every axis."""
    return tuple(curve.bezier_pieces() for curve in face.boundary)


def _reach_of(face: Face, to_axis: Array, shift: Array) -> tuple[float, float]:
    """The least and the largest distance of a face from the z axis, to which (p - shift) @ to_axis takes its points."""
    across = to_axis[:, :2]
    affine = flat_map(face)
    if affine is None:
        points = face.surface.bezier_pieces()
        flat = (points[..., :3] - points[..., 3:] * shift) @ across
        return _range(np.concatenate([flat, points[..., 3:]], axis=-1))
    # Distances from an axis are convex over a plane: the largest is on the boundary, and the least, unless the axis
    # goes through the face.
    origin, edges = affine
    start, sides = (origin - shift) @ across, edges @ across
    ranges = []
    for points in _boundary_pieces(face):
        flat = points[..., :2] @ sides + points[..., 2:] * start
        ranges.append(_range(np.concatenate([flat, points[..., 2:]], axis=-1)[:, :, None]))
    low, high = min(one[0] for one in ranges), max(one[1] for one in ranges)
    if abs(float(np.linalg.det(sides))) <= ROUND * float(np.abs(sides).max()) ** 2:
        return 0.0, high
    u, v = np.linalg.solve(sides.T, -start).tolist()
    return (0.0 if int(face.locate(u, v)) >= 0 else low), high


class _Reaches:
    """Of every face of a body: the least and the largest distance from an axis, and how far it goes along it.

    By hulls at first; the true ones where they are asked for.
    """

    def __init__(self, body: Posed, axis: Axis) -> None:
        direction = axis.direction / np.linalg.norm(axis.direction)
        side = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
        side /= np.linalg.norm(side)
        frame = np.stack([side, np.cross(direction, side), direction], axis=1)
        # From the body's axes: p -> (R p + t - c) F.
        self._body, self._to_axis = body, body.rotation.T @ frame
        self._shift = (axis.point - body.row[:3]) @ body.rotation
        nets = [(net - axis.point) @ frame for net in body.nets]
        self.low = np.array([_hull_distance(net[:, :2]) for net in nets]) - body.rounding
        self.high = np.array([np.linalg.norm(net[:, :2], axis=1).max() for net in nets]) + body.rounding
        self.bottom = np.array([net[:, 2].min() for net in nets]) - body.rounding
        self.top = np.array([net[:, 2].max() for net in nets]) + body.rounding

    def refine(self, faces: NDArray[np.bool_]) -> None:
        """Know the distances of some faces better."""
        for k in np.flatnonzero(faces).tolist():
            low, high = _reach_of(self._body.faces[k], self._to_axis, self._shift)
            self.low[k] = max(self.low[k], low - self._body.rounding)
            self.high[k] = min(self.high[k], high + self._body.rounding)


def _candidates(a: Posed, b: Posed) -> Iterator[tuple[Posed, Posed, Axis]]:
    """The inner body, the outer one and the axis of a pin of the inner one that is in a bore of the outer one."""
    for inner, outer in ((a, b), (b, a)):
        bores = _axes(outer, convex=False)
        for axis in _axes(inner, convex=True) if bores else ():
            if any(_beside(axis, bore, PARALLEL, BESIDE) for bore in bores):
                yield inner, outer, axis


def _separation(f: _Reaches, g: _Reaches) -> Array:
    """How far apart the faces of an inner body and those of an outer one are, at least, a row a face of the inner."""
    beside = g.low[None, :] - f.high[:, None]
    above = np.maximum(g.bottom[None, :] - f.top[:, None], f.bottom[:, None] - g.top[None, :])
    separation: Array = np.maximum(beside, above)
    return separation


def revolved_between(a: Posed, b: Posed, enough: float) -> float:
    """How far apart two bodies are about an axis that they share; negative where they are in each other by so much.

    Positive, no points of their surfaces are nearer than this. Minus infinity where they share no axis, or none that is
    free of the outer one.

    Parameters
    ----------
    a, b : Posed
    enough : float
        Faces that are known to be so far apart are not looked at more closely, and no other axis is tried.
    """
    best = -np.inf
    for inner, outer, axis in _candidates(a, b):
        f, g = _Reaches(inner, axis), _Reaches(outer, axis)
        near = _separation(f, g) < enough
        f.refine(np.asarray(near.any(axis=1)))
        g.refine(np.asarray(near.any(axis=0) | (g.low <= 0.0)))
        if g.low.min() > 0.0:
            best = max(best, float(_separation(f, g).min()))
        if best >= enough:
            break
    return best
