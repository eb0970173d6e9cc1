"""How deep two bodies are in each other that cross: where, on which faces, and a ball that is inside of both.

Several places may tell. How bodies would come apart is known from the pair that closes as they do so
(`assembly.proximity.closest_features`), and from flat faces that look at each other. Of bodies that are not convex a
contact manager lists places where surfaces face each other from inside: a press fit is as deep as its radii differ, not
as its pin is long, though only that move parts the two. The least of these is the depth.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.contact import side_faces
from assembly.geometry import shapes
from assembly.geometry.faces.equal_shapes import first_equal
from assembly.geometry.faces.face import Face
from assembly.kinematics.body import Body
from assembly.kinematics.pose import IDENTITY_ROW, rotation_matrix
from assembly.proximity.brep.solid import solid_of
from assembly.proximity.clearance.body_cells import cells_of_body, has_cells
from assembly.proximity.clearance.round_faces import round_of
from assembly.proximity.clearance.touching import recognized
from assembly.proximity.features.body_distance import BodyDistance, DistanceStatus, distance
from assembly.proximity.features.features import FeatureStatus, closest_features, features_of
from assembly.proximity.features.polytopes import polytope_of
from assembly.solve.crossings import posed_box
from assembly.tracking.manager import Manager

__all__ = ["Depth", "Two", "common_point", "depth_of"]

Array = NDArray[np.float64]
# The most that may be called touching in parts of the larger body's size.
MOST_TOUCHING = 1e-3
# What is in front of a plane by less, in parts of the size, is in it.
IN_PLANE = 1e-9
# Flat faces along which a way out is tried.
MOST_TRIED = 4
# Parts of the way from the deepest place to the middle of what both bodies may have in common, and from one point to
# the other one.
INWARD = (0.0, 0.01, 0.1, 0.5, 1.0)
BETWEEN = (0.25, 0.75)
# A ball of this radius, in parts of a body's size, has its middle on the face that it meets.
TINY = 1e-9


@dataclass(frozen=True, eq=False)
class Depth:
    """How deep bodies are in each other: a gap that is not above zero, the points (2, 3), and what these are on."""

    gap: float
    points: Array
    faces: tuple[str, str]


@dataclass(frozen=True, eq=False)
class Two:
    """Two bodies at poses.

    Attributes
    ----------
    a, b : Body
    q : (2, 7)
    size : float
        The larger one's.
    touching : float
        What they may be in each other and still touch.
    """

    a: Body
    b: Body
    q: Array
    size: float
    touching: float

    @property
    def bodies(self) -> tuple[Body, Body]:
        """Both."""
        return self.a, self.b

    @property
    def part(self) -> float:
        """What touches, in parts of that."""
        return min(self.touching / self.size, MOST_TOUCHING)


def depth_of(two: Two, crosses: Callable[[Array], bool]) -> Depth:
    """How deep bodies that cross are in each other.

    Parameters
    ----------
    two : Two
    crosses : callable
        Whether they do so where the second one is at another pose (7,).
    """
    found = _way_apart(two)
    known = all(has_cells(side_faces(body)) for body in two.bodies)
    if not known or not all(_is_convex(side_faces(body)) for body in two.bodies):
        local = _listed(two)
        if local is not None and local.gap > found.gap:
            found = local
        flat = _along_flat_faces(two, found.gap, crosses) if known else None
        found = found if flat is None else flat
    return found if np.isfinite(found.gap) else Depth(0.0, found.points, found.faces)


def _way_apart(two: Two) -> Depth:
    """The pair along which they come apart; where none is known, a point that they have in common and no gap."""
    pair = closest_features(two.a, two.b, *two.q, touching=two.part)
    gap = min(pair.gap, 0.0) if pair.status is not FeatureStatus.CROSSING else -np.inf
    return Depth(gap, pair.points, (pair.features[0].name, pair.features[1].name))


@lru_cache(maxsize=256)
def _is_convex(faces: tuple[Face, ...]) -> bool:
    """Whether a body seems convex: by its edges, and of faces that are flat, or cylinders and balls from outside."""
    topology = solid_of(faces)
    flat = set(recognized(cells_of_body(faces)).flat.tolist())
    for number, face in enumerate(topology.faces):
        found = None if number in flat else round_of(face)
        if number not in flat and (found is None or not found.outward or found.ring > 0.0):
            return False
    return topology.is_closed and all(edge.convex is True for edge in topology.edges)


def _listed(two: Two) -> Depth | None:
    """The deepest place where surfaces face each other from inside, of those that a contact manager lists."""
    manager = Manager(two.bodies, touching=two.part)
    manager.update(two.q)
    deep = [contact for contact in manager.contacts if contact.gap < -two.touching]
    if not deep:
        return None
    found = min(deep, key=lambda contact: contact.gap)
    return Depth(found.gap, found.points, _names(two, found.points))


def _along_flat_faces(two: Two, gap: float, crosses: Callable[[Array], bool]) -> Depth | None:
    """The shallowest pair of flat faces that face each other from inside, along which bodies come apart; None if none.

    It is sought among those that are less deep than a gap, and tells where bodies conform otherwise, so that no search
    finds them apart before a pin is out of all of its hole.
    """
    a, b = (recognized(cells_of_body(side_faces(body))) for body in two.bodies)
    turns = [rotation_matrix(row[3:]) for row in two.q]
    points, normals = (
        [getattr(one, name) @ turn.T for one, turn in zip((a, b), turns, strict=True)] for name in ("points", "normals")
    )
    between = points[1] + two.q[1, :3] - points[0][:, None] - two.q[0, :3]
    depths = -(between * normals[0][:, None]).sum(axis=2)
    opposed = np.linalg.norm(normals[0][:, None] + normals[1], axis=2) * two.size <= two.touching
    rows, columns = np.nonzero(opposed & (depths > two.touching) & (depths < -gap - two.touching))
    order = np.argsort(depths[rows, columns], kind="stable")[:MOST_TRIED]
    for i, j in zip(rows[order].tolist(), columns[order].tolist(), strict=True):
        off = two.q[1].copy()
        off[:3] += depths[i, j] * normals[0][i]
        if not crosses(off):
            found = _between_flat_faces(two, (int(a.flat[i]), int(b.flat[j])), float(depths[i, j]), normals[0][i])
            if found is not None:
                return found
    return None


def _between_flat_faces(two: Two, faces: tuple[int, int], depth: float, normal: Array) -> Depth | None:
    """The pair of two flat faces that lie over each other: their nearest points once they are apart by the depth."""
    sides = [solid_of(side_faces(body)).faces[k] for body, k in zip(two.bodies, faces, strict=True)]
    q = two.q.copy()
    q[1, :3] += 2.0 * depth * normal
    near = distance(*sides, poses=(q[0], q[1]), tolerance=TINY * two.size)
    if near.upper > depth + IN_PLANE * two.size:
        return None
    points = near.points - np.array([np.zeros(3), 2.0 * depth * normal])
    one, other = (features_of(side_faces(body))[k].name for body, k in zip(two.bodies, faces, strict=True))
    return Depth(-depth, points, (one, other))


def common_point(two: Two, points: Array) -> Array | None:
    """A point around which a ball, larger than what is called touching, is inside of both; None where none is found.

    Parameters
    ----------
    two : Two
    points : (2, 3)
        Where they are deepest in each other.
    """
    radius = max(2.0 * two.touching, 1e-7 * two.size)
    for point in _inner_points(two, points):
        if all(_has_inside(body, row, point, radius) for body, row in zip(two.bodies, two.q, strict=True)):
            return point
    return None


def _inner_points(two: Two, points: Array) -> Iterator[Array]:
    """Points that may be inside of both bodies, by where they are deepest and by where their boxes overlap."""
    boxes = np.array([posed_box(body, row) for body, row in zip(two.bodies, two.q, strict=True)])
    middle, way = points.mean(axis=0), points[1] - points[0]
    inward = 0.5 * (boxes[:, 0].max(axis=0) + boxes[:, 1].min(axis=0)) - middle
    square = float(way @ way)
    if square > 0.0:
        inward = inward - float(inward @ way) / square * way
    # Deepest points may be at the border of both faces, and what is between them beside the bodies.
    yield from (middle + part * inward for part in INWARD)
    yield from (points[0] + part * way for part in BETWEEN)


def _has_inside(body: Body, row: Array, point: Array, radius: float) -> bool:
    """Whether a ball is wholly inside of a body."""
    if not solid_of(side_faces(body)).is_closed:
        return False
    flat = polytope_of(first_equal(side_faces(body)))
    if flat is not None:
        return flat.has_inside(rotation_matrix(row[3:]).T @ (point - row[:3]), radius)
    return _to_ball(body, row, point, radius).status is DistanceStatus.ENCLOSED


def _to_ball(body: Body, row: Array, point: Array, radius: float) -> BodyDistance:
    at = np.array([*point, *IDENTITY_ROW[3:]])
    return distance(body, _ball(radius), poses=(row, at), tolerance=0.1 * radius)


@lru_cache(maxsize=16)
def _ball(radius: float) -> Face:
    """A ball of that radius, kept: what is known of its face is kept with it."""
    return Face(shapes.sphere(radius))


def _names(two: Two, points: Array) -> tuple[str, str]:
    """What of the bodies points of their surfaces are on."""
    one, other = (
        _to_ball(body, row, point, TINY * body.size).features[0].name
        for body, row, point in zip(two.bodies, two.q, points, strict=True)
    )
    return one, other
