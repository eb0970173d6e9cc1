"""Pairs of convex bodies of flat faces: what parts them, and where they are deepest in each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.contact import side_faces
from assembly.geometry.faces.equal_shapes import first_equal
from assembly.kinematics.body import Body
from assembly.kinematics.pose import rotation_of
from assembly.proximity.features.features import features_of
from assembly.proximity.features.polytopes import Parting, Polytope, partings, polytope_of
from assembly.studies.interference.depth import Depth, Two

__all__ = ["deepest", "partings_of"]

Array = NDArray[np.float64]
# Corners that are as far along a normal to this part of the size are all on the face or the edge that is farthest.
LEVEL = 1e-9
# The sine below which two edges are parallel.
PARALLEL = 1e-9


def _polytope(body: Body) -> Polytope | None:
    """A body as a polytope; equal shapes share one."""
    return polytope_of(first_equal(side_faces(body)))


def partings_of(pairs: Sequence[Two]) -> list[Parting | None]:
    """What parts two bodies, of each of many pairs; None where one of them is no polytope."""
    found: list[Parting | None] = [None] * len(pairs)
    alike: dict[tuple[int, int], list[int]] = {}
    known: dict[int, Polytope | None] = {}
    for k, two in enumerate(pairs):
        for body in two.bodies:
            if id(body) not in known:
                known[id(body)] = _polytope(body)
        first, second = (known[id(body)] for body in two.bodies)
        if first is not None and second is not None:
            alike.setdefault((id(first), id(second)), []).append(k)
    for numbers in alike.values():
        a, b = (known[id(body)] for body in pairs[numbers[0]].bodies)
        assert a is not None and b is not None
        q = np.array([pairs[k].q for k in numbers])
        turns = np.array([[rotation_of(row[3:]) for row in rows] for rows in q])
        back = turns[:, 0].transpose(0, 2, 1)
        shifts = (back @ (q[:, 1, :3] - q[:, 0, :3])[..., None])[..., 0]
        parted = partings(a, b, back @ turns[:, 1], shifts, [pairs[k].touching for k in numbers])
        if parted is not None:
            for k, one in zip(numbers, parted, strict=True):
                found[k] = one
    return found


def deepest(two: Two, parting: Parting) -> Depth:
    """Where two polytopes are deepest in each other, which are so deep as what parts them tells.

    The points are on the face, edge or vertex of either that is farthest along the normal, one over the other.
    """
    a, b = (_polytope(body) for body in two.bodies)
    assert a is not None and b is not None
    turns = [rotation_of(row[3:]) for row in two.q]
    n = turns[0] @ parting.normal
    sides = []
    for shape, turn, row, way in zip((a, b), turns, two.q, (n, -n), strict=True):
        corners = shape.corners @ turn.T + row[:3]
        heights = corners @ way
        on = np.flatnonzero(heights >= heights.max() - LEVEL * two.size)
        sides.append((shape, turn.T @ way, on, corners[on]))
    above = _above(sides[0][3], sides[1][3], n)
    # The one on a is up from that on b by the depth.
    height = float((sides[0][3] @ n).max())
    top = above + (height - float(above @ n)) * n
    names = [_name(body, side[0], side[1], side[2]) for body, side in zip(two.bodies, sides, strict=True)]
    return Depth(-parting.depth, np.array([top, top - parting.depth * n]), (names[0], names[1]))


def _name(body: Body, shape: Polytope, way: Array, on: NDArray[np.int64]) -> str:
    """The name of the feature that has these corners, the farthest ones along a direction."""
    names = features_of(side_faces(body))
    if len(on) == 1:
        return names[len(shape.normals) + len(shape.ends) + int(on[0])].name
    if len(on) == 2:
        number = np.flatnonzero(((shape.ends == on) | (shape.ends == on[::-1])).all(axis=1))
        if len(number):
            return names[len(shape.normals) + int(number[0])].name
    return names[int((shape.normals @ way).argmax())].name


def _above(one: Array, other: Array, n: Array) -> Array:
    """A point that two convex polygons, edges or points (k, 3) have in common as seen along a direction, in the middle.

    What rounding parts is taken as it comes.
    """
    if len(one) == 1 or len(other) == 1:
        return np.asarray(one[0] if len(one) == 1 else other[0])
    right = np.cross(n, np.eye(3)[np.abs(n).argmin()])
    right /= np.linalg.norm(right)
    axes = np.array([right, np.cross(n, right)])
    if len(one) > len(other):
        one, other = other, one
    subject, border = _around(one @ axes.T), _around(other @ axes.T)
    if len(border) == 2:
        found = _crossing(subject, border)
    else:
        for begin, end in zip(border, np.roll(border, -1, axis=0), strict=True):
            left = _left_of(subject, begin, end)
            subject = left if len(left) else subject
        found = subject.mean(axis=0)
    return np.asarray(found @ axes + float(one[0] @ n) * n)


def _around(points: Array) -> Array:
    """Corners of a convex polygon (k, 2) counterclockwise."""
    if len(points) == 2:
        return points
    off = points - points.mean(axis=0)
    return points[np.argsort(np.arctan2(off[:, 1], off[:, 0]), kind="stable")]


def _crossing(one: Array, other: Array) -> Array:
    """Where two edges (2, 2) cross; of parallel ones the middle of what they have in common."""
    way, along = one[1] - one[0], other[1] - other[0]
    turn = float(way[0] * along[1] - way[1] * along[0])
    off = other[0] - one[0]
    if abs(turn) > PARALLEL * float(np.linalg.norm(way) * np.linalg.norm(along)):
        return np.asarray(one[0] + float(off[0] * along[1] - off[1] * along[0]) / turn * way)
    ends = np.clip(np.sort((other - one[0]) @ way / float(way @ way)), 0.0, 1.0)
    return np.asarray(one[0] + 0.5 * float(ends.sum()) * way)


def _left_of(polygon: Array, begin: Array, end: Array) -> Array:
    """What of a convex polygon or an edge (k, 2) is to the left of a line, (j, 2)."""
    way, off = end - begin, polygon - begin
    sides = (way[0] * off[:, 1] - way[1] * off[:, 0]).tolist()
    found = []
    for k, side in enumerate(sides):
        if side >= 0.0:
            found.append(polygon[k])
        after = sides[(k + 1) % len(sides)]
        if (side < 0.0) != (after < 0.0):
            part = side / (side - after)
            found.append(polygon[k] + part * (polygon[(k + 1) % len(sides)] - polygon[k]))
    return np.array(found).reshape(-1, 2)
