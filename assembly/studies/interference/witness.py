"""Points that are certainly inside of bodies: a small ball around them meets no face, and its nearest one faces away.

A ball that meets no face of a closed body is inside of it or outside, as a whole. The nearest point of the body tells:
where it is within a face, the ball is on the side of that face on which the segment between the two is. Where it is on
an edge that segment is between the outward normals of its two faces, or between these turned back: the ball is outside
of an edge that stands out, and inside at one that leads in.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain, islice, product

import numpy as np
from numpy.typing import NDArray

from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.curve import NurbsCurve
from assembly.kinematics.pose import IDENTITY_ROW, rotate
from assembly.proximity.brep.solid import solid_of
from assembly.proximity.features.features import FeaturePair, FeatureStatus, nearest_features
from assembly.studies.interference.bounds import Posed

__all__ = ["Probe", "common_point", "is_inside", "side_of_nearest"]

Array = NDArray[np.float64]
# How far into both bodies a point is looked for, in parts of the smaller one's size, the farthest first.
DEPTHS = (0.03, 0.003, 0.0003)
# Faces whose outward normals oppose each other by more than this have no common inside beside their points.
OPPOSED = 0.05
# Points of a body that are asked whether they are inside another one.
ASKED = 6
# How often, and at how many points of a curve, the one at a point is looked for.
ROUNDS, SAMPLES = 3, 65
# Along either parameter of a face: points below which one is looked for, and how many of all are asked.
GRID, MOST = 5, 400
# Directions from a common point in which both bodies may go on.
AROUND = np.array([way for way in product((-1.0, 0.0, 1.0), repeat=3) if any(way)])


def outward_normal(body: Posed, pair: FeaturePair, side: int) -> Array | None:
    """The outward normal of a body in the world at its point of a pair, where that is within a face."""
    feature = pair.features[side]
    if feature.kind != "face":
        return None
    u, v = pair.parameters[side].tolist()
    normal: Array = rotate(body.row[3:], solid_of(body.faces).faces[feature.index].normal(u, v))
    return normal


def _between_faces(body: Posed, pair: FeaturePair, side: int) -> Array | None:
    """The direction between the outward normals of the two faces of an edge, where a point of a pair is on one."""
    feature = pair.features[side]
    topology = solid_of(body.faces)
    edge = topology.edges[feature.index] if feature.kind == "edge" else None
    if edge is None or edge.face_b is None or edge.curve_b is None:
        return None
    point = (pair.points[side] - body.row[:3]) @ body.rotation
    total = np.zeros(3)
    for number, curve in ((edge.face_a, edge.curve_a), (edge.face_b, edge.curve_b)):
        face = topology.faces[number]
        total += face.normal(*_parameters_at(face, face.boundary[curve], point))
    length = float(np.linalg.norm(total))
    return body.rotation @ total / length if length > OPPOSED else None


def _parameters_at(face: Face, curve: NurbsCurve, point: Array) -> tuple[float, float]:
    """(u, v) of the point of a boundary curve that is nearest to a point of it, to some digits."""
    low, high = curve.domain
    for _ in range(ROUNDS):
        t = np.linspace(low, high, SAMPLES)
        at = curve.evaluate(t)
        nearest = int(np.linalg.norm(face.surface.evaluate(at[:, 0], at[:, 1]) - point, axis=1).argmin())
        low, high = t[max(nearest - 1, 0)], t[min(nearest + 1, SAMPLES - 1)]
    return float(at[nearest, 0]), float(at[nearest, 1])


def side_of_nearest(body: Posed, pair: FeaturePair, side: int) -> int:
    """On which side of a body the point of the other one is: 1 outside, -1 inside, 0 where the pair does not tell.

    The pair's points are the nearest ones and apart.
    """
    if pair.status is not FeatureStatus.APART or not pair.lower > 0.0:
        return 0
    way = outward_normal(body, pair, side)
    if way is None:
        way = _between_faces(body, pair, side)
    if way is None:
        return 0
    between = pair.points[1 - side] - pair.points[side]
    off = float(way @ between)
    return int(np.sign(off)) if abs(off) > OPPOSED * float(np.linalg.norm(between)) else 0


@dataclass(frozen=True, eq=False)
class Probe:
    """A ball that is put at points to see on which side of bodies they are.

    Attributes
    ----------
    radius : float
    """

    radius: float

    def side(self, body: Posed, point: Array) -> int:
        """1 where the ball is outside of a closed body, -1 where it is inside, 0 where it meets it or nothing tells."""
        low, high = body.box
        if ((point < low) | (point > high)).any():
            return 1
        return side_of_nearest(body, self.found(body, point), 0)

    def found(self, body: Posed, point: Array) -> FeaturePair:
        """The nearest points of a body and of the ball around a point."""
        at = np.array(IDENTITY_ROW)
        at[:3] = point
        return nearest_features(body.body, _ball(self.radius), body.row, at)


@lru_cache(maxsize=16)
def _ball(radius: float) -> Face:
    """A ball of that radius, kept: what is known of its face is kept with it."""
    return Face(shapes.sphere(radius))


def is_inside(inner: Posed, outer: Posed, probe: Probe) -> int:
    """Where a body is whose surface does not meet that of a closed one: -1 inside, 1 outside, 0 where nothing tells."""
    samples = inner.samples
    for point in samples[:: max(len(samples) // ASKED, 1)]:
        side = probe.side(outer, point)
        if side != 0:
            return side
    return 0


def _ways(a: Posed, b: Posed, pair: FeaturePair, all_around: bool) -> Iterator[Array]:
    """Directions from a common point that may lead into both bodies: of two faces the one between their normals."""
    normals = outward_normal(a, pair, 0), outward_normal(b, pair, 1)
    if normals[0] is not None and normals[1] is not None:
        total = normals[0] + normals[1]
        length = float(np.linalg.norm(total))
        if length > OPPOSED:
            yield -total / length
        return
    if not all_around:
        return
    inward = [-normal for normal in normals if normal is not None]
    for way in AROUND / np.linalg.norm(AROUND, axis=1)[:, None]:
        if all(float(way @ n) > 0.1 for n in inward):
            yield way


def _below_faces(one: Posed, other: Posed) -> Iterator[Array]:
    """Points below faces of a body, within the box around the other one."""
    size = min(one.body.size, other.body.size)
    part = (np.arange(GRID) + 0.5) / GRID
    for face in one.faces:
        (low_u, high_u), (low_v, high_v) = face.surface.domain
        u, v = np.meshgrid(low_u + (high_u - low_u) * part, low_v + (high_v - low_v) * part)
        within = face.contains(u, v)
        points, normals = one.placed(face.surface.evaluate(u, v)[within]), face.normal(u, v)[within] @ one.rotation.T
        near = ((other.box[0] <= points) & (points <= other.box[1])).all(axis=1)
        for depth in DEPTHS:
            yield from (points - depth * size * normals)[near]


def common_point(a: Posed, b: Posed, pair: FeaturePair, others: Iterable[Array] | None, probe: Probe) -> Array | None:
    """A point around which a ball is inside of two closed bodies, or None where none is found.

    Parameters
    ----------
    a, b : Posed
    pair : FeaturePair
        With a point that their surfaces have in common.
    others : iterable of (3,), or None
        Points that may be inside of both, asked first; None where they are not known to cross, and only two faces at
        an angle are worth a search.
    probe : Probe
    """
    if not (a.is_closed and b.is_closed):
        return None
    size = min(a.body.size, b.body.size)
    beside = (pair.points[0] + depth * size * way for way in _ways(a, b, pair, others is not None) for depth in DEPTHS)
    below: Iterable[Array] = () if others is None else islice(chain(_below_faces(a, b), _below_faces(b, a)), MOST)
    points: Iterable[Array] = chain(others or (), beside, below)
    for point in points:
        if probe.side(a, point) == -1 and probe.side(b, point) == -1:
            return point
    return None
