"""Convex hulls around the faces of a body, made of discs and points, and their extent along directions.

A hull is that of discs, and of points as discs without a radius, each with a ball of radius `pad` around it. Along a
unit vector n a disc with center c, axis a and radius r reaches to

    n.c + r |n - (n.a) a|,

a hull to the largest of these and `pad` more. A face is within each of its hulls: of control points, and of the circles
that a cylinder, a cone, a ball or a torus is made of. It reaches no farther than the least of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import product
from math import tan

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.equal_shapes import first_equal
from assembly.geometry.faces.face import Face
from assembly.proximity.clearance.hulls.discs import Discs
from assembly.proximity.clearance.hulls.face_hulls import hulls_of_face
from assembly.proximity.clearance.hulls.hollows import AnyHollow, FaceHulls, ForBalls, Hollow, depths_within
from assembly.proximity.clearance.hulls.pockets import bent_wall
from assembly.proximity.clearance.hulls.prism import Prism
from assembly.proximity.manifolds.elementary_faces import nearly_elementary

__all__ = ["BodyHulls", "hulls_of_body", "with_pockets"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
# Directions and axes of one body that are taken at most: of a body of very many faces others are not tried.
MOST = 40
# How far a cone may be beyond a hole that it goes through, in parts of the radius of that, and a ball, in parts of its
# own; its own is less by that.
NEARLY = 1e-9


@dataclass(frozen=True, eq=False)
class BodyHulls:
    """Hulls of a body of f faces, in some axes.

    Attributes
    ----------
    discs : Discs
        Of all hulls, one hull after another.
    first : (h,) of int
        Where each hull begins among the discs.
    pad : (h,)
    of_face : (f,) of int
        Where each face begins among the hulls.
    part_of : (f,) of int
        What is not convex counts as several faces, one for each part: the number of the whole face.
    points, owner : (p, 3), (p,) of int
        Points that are on faces, corners among them, and the face of each.
    hollows : tuple of (int, AnyHollow)
        Sets into whose inside no point of a face goes, with the face.
    directions : (d, 3)
        Normals of flat faces and axes, up to their senses.
    centers, axes : (r, 3)
        Lines that faces go around; the axis of a ball is zero.
    """

    discs: Discs
    first: Table
    pad: Array
    of_face: Table
    part_of: Table
    points: Array
    owner: Table
    hollows: tuple[tuple[int, AnyHollow], ...]
    directions: Array
    centers: Array
    axes: Array

    def reach(self, normals: Array) -> Array:
        """How far every face reaches along unit vectors (k, 3), at most: (f, k)."""
        rows = self.discs.reach(normals)
        return np.minimum.reduceat(np.maximum.reduceat(rows, self.first) + self.pad[:, None], self.of_face)

    def within(self, hollows: Sequence[AnyHollow]) -> Array:
        """How far faces are from the borders of hollows that they are within, at least: (h, f); below zero outside."""
        found = np.empty((len(hollows), len(self.of_face)))
        plain = [k for k, hollow in enumerate(hollows) if isinstance(hollow, Hollow)]
        found[plain] = self._of_faces(depths_within([hollows[k] for k in plain], self.discs))
        for k, hollow in enumerate(hollows):
            if isinstance(hollow, ForBalls):
                rows = np.full((1, len(self.discs.radii)), -np.inf)
                rows[0, self.is_ball] = hollow.depth_of(self.discs.centers[self.is_ball])
                found[k] = self._of_faces(rows)
            elif isinstance(hollow, Prism):
                # Of each side another one of a face's hulls may tell.
                found[k] = self._of_faces(hollow.depths(self.discs)).min(axis=0)
        return found

    def _of_faces(self, depths: Array) -> Array:
        """Of depths of discs (n, m) those of faces (n, f): of the hull that is deepest, where it is least deep."""
        of_hulls = np.minimum.reduceat(depths, self.first, axis=1) - self.pad
        return np.asarray(np.maximum.reduceat(of_hulls, self.of_face, axis=1))

    def discs_of(self, face: int) -> Discs:
        """The discs and points of all hulls of a face."""
        ends = np.append(self.first, len(self.discs.radii))
        last = self.of_face[face + 1] if face + 1 < len(self.of_face) else len(self.first)
        rows = slice(int(ends[self.of_face[face]]), int(ends[last]))
        return Discs(*(column[rows] for column in self.discs))

    def nearest(self, hollow: AnyHollow, face: int) -> Array:
        """The middle of the disc of a face (3,) that is nearest to the border of a hollow around it."""
        ends = np.append(self.first, len(self.discs.radii))
        last = self.of_face[face + 1] if face + 1 < len(self.of_face) else len(self.first)
        hulls = [slice(int(ends[k]), int(ends[k + 1])) for k in range(int(self.of_face[face]), int(last))]
        depths = [hollow.depth(Discs(*(column[rows] for column in self.discs))) for rows in hulls]
        # Of the hull that is nearest to the face.
        best = int(np.argmax([depth.min() for depth in depths]))
        return np.asarray(self.discs.centers[hulls[best]][depths[best].argmin()])

    def posed(self, turn: Array, shift: Array) -> BodyHulls:
        """The same in other axes: x -> turn x + shift."""
        return BodyHulls(
            self.discs.posed(turn, shift),
            self.first,
            self.pad,
            self.of_face,
            self.part_of,
            self.points @ turn.T + shift,
            self.owner,
            tuple((face, hollow.posed(turn, shift)) for face, hollow in self.hollows),
            self.directions @ turn.T,
            self.centers @ turn.T + shift,
            self.axes @ turn.T,
        )

    def scaled(self, part: float, shift: Array) -> BodyHulls:
        """The same after x -> (1 - part) x + shift."""
        left = 1.0 - part
        return BodyHulls(
            Discs(left * self.discs.centers + shift, self.discs.axes, left * self.discs.radii),
            self.first,
            left * self.pad,
            self.of_face,
            self.part_of,
            left * self.points + shift,
            self.owner,
            tuple((face, hollow.scaled(left, shift)) for face, hollow in self.hollows),
            self.directions,
            left * self.centers + shift,
            self.axes,
        )

    def facing(self, other: BodyHulls) -> BodyHulls:
        """What is of use beside another body: hollows for balls only where that has some."""
        return self if other.is_ball.any() else self._without_balls

    @cached_property
    def _without_balls(self) -> BodyHulls:
        return replace(self, hollows=tuple(own for own in self.hollows if not isinstance(own[1], ForBalls)))

    @cached_property
    def is_ball(self) -> NDArray[np.bool_]:
        """Whether each disc is a point, and all of its hull but for the radius around it: (m,)."""
        sizes = np.diff(np.append(self.first, len(self.discs.radii)))
        return np.asarray((np.repeat(sizes, sizes) == 1) & (self.discs.radii == 0.0))

    @cached_property
    def ball(self) -> tuple[Array, float]:
        """Center and radius of a ball around all of the body."""
        centers = self.discs.centers
        middle = 0.5 * (centers.min(axis=0) + centers.max(axis=0))
        beside = np.diff(np.append(self.first, len(centers)))
        away = np.linalg.norm(centers - middle, axis=1) + self.discs.radii + np.repeat(self.pad, beside)
        return middle, float(away.max())


def hulls_of_body(faces: tuple[Face, ...]) -> BodyHulls:
    """The hulls of a body's faces, in its own axes; equal shapes share them."""
    return _made_of(first_equal(faces))


def with_pockets(faces: tuple[Face, ...]) -> BodyHulls | None:
    """The same with pockets in faces on cylinders, and hulls of bent ends, which take longer to find; None without."""
    return _with_pockets(first_equal(faces))


@lru_cache(maxsize=256)
def _made_of(faces: tuple[Face, ...]) -> BodyHulls:
    return _joined(_by_face(faces))


@lru_cache(maxsize=256)
def _by_face(faces: tuple[Face, ...]) -> list[list[FaceHulls]]:
    return [hulls_of_face(face) for face in faces]


def _joined(by_face: list[list[FaceHulls]]) -> BodyHulls:
    found = [part for parts in by_face for part in parts]
    hulls = [hull for face in found for hull in face.hulls]
    sizes = [len(discs.radii) for discs, _ in hulls]
    counts = [len(face.hulls) for face in found]
    return BodyHulls(
        Discs(*(np.concatenate(column) for column in zip(*(discs for discs, _ in hulls), strict=True))),
        np.append(0, np.cumsum(sizes)[:-1]),
        np.array([pad for _, pad in hulls]),
        np.append(0, np.cumsum(counts)[:-1]),
        np.repeat(np.arange(len(by_face)), [len(parts) for parts in by_face]),
        np.concatenate([face.points for face in found]),
        np.repeat(np.arange(len(found)), [len(face.points) for face in found]),
        tuple(
            (number, hollow) for number, face in enumerate(found) for hollow in (*face.hollows, *_seats(face, found))
        ),
        distinct([face.direction for face in found if face.direction is not None]),
        *_lines(found),
    )


@lru_cache(maxsize=256)
def _with_pockets(faces: tuple[Face, ...]) -> BodyHulls | None:
    cut = [number for number, face in enumerate(faces) if face.outer is not None and not face.surface.is_parallelogram]
    forms = [nearly_elementary(face.surface) for face in faces] if cut else []
    by_face, is_more = [*_by_face(faces)], False
    for number in cut:
        bent = bent_wall(faces[number], forms[number], forms[:number] + forms[number + 1 :])
        if bent is not None:
            is_more = True
            by_face[number] = [
                part._replace(hollows=[*part.hollows, *bent.pockets], hulls=[*part.hulls, *bent.hulls])
                for part in by_face[number]
            ]
    return _joined(by_face) if is_more else None


def _seats(face: FaceHulls, others: list[FaceHulls]) -> list[Hollow]:
    """Cones and balls of other faces that go through a round hole of a flat face: it is beyond them as well."""
    if face.direction is None or face.line is not None:
        return []
    found = []
    holes = [hole for hole in face.hollows if isinstance(hole, Hollow)]
    cones = [cone for other in others for cone in other.hollows if isinstance(cone, Hollow) and cone.slope > 0.0]
    for hole, cone in product(holes, cones):
        away = hole.center - cone.center
        height = float(away @ cone.axis)
        lean = float(np.linalg.norm(np.cross(hole.axis, cone.axis)))
        off = float(np.linalg.norm(away - height * cone.axis)) + 4.0 * lean * (abs(height) + hole.radius)
        beyond = off + cone.radius + height * tan(cone.slope) - hole.radius
        if cone.is_wall and height > 0.0 and beyond < NEARLY * hole.radius:
            found.append(cone._replace(radius=cone.radius - max(beyond, 0.0)))
    balls = [ball for other in others for ball in other.hollows if isinstance(ball, Hollow) and not ball.axis.any()]
    for hole, ball in product(holes, balls):
        away = ball.center - hole.center
        height = float(away @ hole.axis)
        beside = hole.radius - float(np.linalg.norm(away - height * hole.axis))
        # How far the plane is from the middle of the ball, outside of its hole.
        off = float(np.hypot(height, max(beside, 0.0)))
        if ball.is_wall and off > (1.0 - NEARLY) * ball.radius:
            found.append(ball._replace(radius=min(ball.radius, off)))
    return found


def distinct(vectors: list[Array]) -> Array:
    """Vectors (n, 3) without those that are others, or others turned around; so many at most."""
    rows = np.array(vectors).reshape(-1, 3)
    kept: list[int] = []
    for k in range(len(rows)):
        mine = rows[kept]
        if not ((mine == rows[k]).all(axis=1) | (mine == -rows[k]).all(axis=1)).any():
            kept.append(k)
        if len(kept) == MOST:
            break
    return rows[kept]


def _lines(found: list[FaceHulls]) -> tuple[Array, Array]:
    """Centers and axes of what faces go around, each line once; so many at most."""
    lines: list[tuple[Array, Array]] = []
    for line in (face.line for face in found if face.line is not None):
        if len(lines) == MOST:
            break
        off = [(line[0] - center, axis) for center, axis in lines if (axis == line[1]).all()]
        if not any(np.linalg.norm(away - (away @ axis) * axis) == 0.0 for away, axis in off):
            lines.append(line)
    return np.array([line[0] for line in lines]).reshape(-1, 3), np.array([line[1] for line in lines]).reshape(-1, 3)
