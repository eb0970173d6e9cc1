"""What a pair of bodies is by its nearest points: clear, touching, crossing or enclosed, and whether that is proven."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.features.features import FeaturePair, FeatureStatus, closest_features, nearest_features
from assembly.proximity.features.touching import flush_ways
from assembly.studies.interference.axes import revolved_between
from assembly.studies.interference.bounds import Posed, boxes_apart, plane_between
from assembly.studies.interference.clash import Clash, Kind, Relation
from assembly.studies.interference.witness import Probe, common_point, is_inside, side_of_nearest
from assembly.tracking.manager import Manager

__all__ = ["Pair"]

Array = NDArray[np.float64]
# Bounds that agree to this part of the size are one number (`FeaturePair.lower`).
AGREED = 1e-9
# The most that may be called touching in parts of the larger body's size.
MOST_TOUCHING = 1e-3
# A ball larger than what is called touching has no room in a skin of this part of that about an axis.
SKIN = 1.0 / 3.0
# Parts of the way from the deepest place to the middle of what both bodies may have in common.
INWARD = (0.0, 0.01, 0.1, 0.5, 1.0)


@dataclass(frozen=True, eq=False)
class _Depth:
    """How deep two bodies are in each other: a negative gap, where, and on which faces."""

    gap: float
    points: Array
    faces: tuple[str, str]


@dataclass(eq=False)
class Pair:
    """Two bodies, and what is known of them.

    Attributes
    ----------
    a, b : Posed
    relation : Relation
    touching : float
        What they may be in each other and still touch, in the unit of the scene.
    """

    a: Posed
    b: Posed
    relation: Relation
    touching: float = field(repr=False)

    @cached_property
    def apart(self) -> float:
        """They are no nearer than this, by their boxes."""
        return boxes_apart(self.a, self.b)

    @cached_property
    def size(self) -> float:
        """The larger one's size."""
        return max(self.a.body.size, self.b.body.size)

    @cached_property
    def may_nest(self) -> bool:
        """Whether one may be wholly inside the other one, by their boxes."""
        return self._outer_first() != ()

    @cached_property
    def nearest(self) -> FeaturePair:
        """Their nearest points, or one that they have in common."""
        return nearest_features(self.a.body, self.b.body, self.a.row, self.b.row)

    @cached_property
    def distance(self) -> float:
        """Of those points."""
        return float(np.linalg.norm(self.nearest.points[1] - self.nearest.points[0]))

    @cached_property
    def plane(self) -> float:
        """How far apart the bodies are along the best normal: that of their nearest points, or of flat faces."""
        a, b = self.a, self.b
        ways = [self.nearest.normal, *flush_ways(a.faces, a.row, b.faces, b.row, self.touching)]
        if self.nearest.gap < 0.0:
            ways.append(-self.nearest.normal)
        return max(plane_between(a, b, way) for way in ways)

    @cached_property
    def revolved(self) -> float:
        """How far apart the bodies are about an axis that they share, so far as it matters."""
        return revolved_between(self.a, self.b, -SKIN * self.touching if self.meets else self.distance)

    @cached_property
    def bound(self) -> float:
        """No points of the two are nearer than this."""
        known = max(self.apart, self.nearest.lower, self.plane - self._rounding, 0.0)
        if self.meets or self.distance - known <= AGREED * self.size:
            return known
        return max(known, self.revolved)

    @property
    def _rounding(self) -> float:
        """By how much rounding may have a plane off."""
        return 4.0 * (self.a.rounding + self.b.rounding)

    @cached_property
    def only_touches(self) -> bool:
        """Whether a plane between the two, or a surface of revolution, proves that no more than a skin is in both."""
        if self.plane - self._rounding >= -self.touching:
            return True
        return self.revolved >= -SKIN * self.touching

    @property
    def meets(self) -> bool:
        """Whether points of the two are as near as what touches."""
        return self.nearest.status is FeatureStatus.CROSSING or self.distance <= self.touching

    def _outer_first(self) -> tuple[tuple[Posed, Posed, int], ...]:
        """The outer and the inner one, where that may be, and the place of the outer one."""
        both = (self.a, self.b, 0), (self.b, self.a, 1)
        return tuple(way for way in both if way[0].is_closed and way[0].may_enclose(way[1]))

    @cached_property
    def nested(self) -> int:
        """Of bodies whose surfaces are apart: -1 where one is in the other one, 1 where not, 0 where nobody knows."""
        sides = []
        for outer, inner, place in self._outer_first():
            side = side_of_nearest(outer, self.nearest, place)
            sides.append(side or is_inside(inner, outer, self.probe))
        return min((side for side in sides if side != 1), default=1)

    @property
    def probe(self) -> Probe:
        """A ball that tells inside from outside: larger than what is called touching."""
        return Probe(max(2.0 * self.touching, 1e-7 * self.size))

    def judged(self) -> Clash | None:
        """The row of the pair, or None where it takes a search for crossings to tell."""
        if self.meets:
            return self._row("touching", self._touching_gap, True) if self.only_touches else None
        if not self.bound > 0.0:
            return None
        if self.nested == 0:
            return None
        is_proved = self.distance - self.bound <= AGREED * self.size
        if self.nested < 0:
            return self._row("enclosed", -self.distance, True)
        return self._row("clear", self.distance, is_proved)

    @property
    def _touching_gap(self) -> float:
        """The gap of bodies that touch: along a plane between them, if there is one."""
        return self.plane if abs(self.plane) <= self.touching else 0.0

    def searched(self, crosses: bool) -> Clash:
        """The row of a pair of which a search has told whether it crosses."""
        if self.bound > 0.0:
            return self._row("enclosed", -self.distance, False) if crosses else self._row("clear", self.distance, False)
        depth = self._deepest() if crosses else None
        others = None if depth is None else self._inner_points(depth.points)
        if self.nearest.status is FeatureStatus.CROSSING:
            inside = common_point(self.a, self.b, self.nearest, others, self.probe)
            if inside is not None:
                return self._crossing(self._deepest() if depth is None else depth, inside)
        if depth is not None:
            return self._crossing(depth, None)
        return self._row("touching", 0.0, False) if self.meets else self._row("clear", self.distance, False)

    def unsearched(self) -> Clash:
        """The row of a pair that there was no time for."""
        known = max(self.apart, self.nearest.lower) if "nearest" in self.__dict__ else self.apart
        return Clash((self.a.body.name, self.b.body.name), "undecided", None, known, None, None, False, self.relation)

    def _row(self, kind: Kind, gap: float, proved: bool) -> Clash:
        """A row of the nearest points."""
        near = self.nearest
        bound = 0.0 if kind in ("touching", "crossing") else min(self.bound, self.distance)
        faces = near.features[0].name, near.features[1].name
        return Clash(self._names, kind, gap, bound, near.points, faces, proved, self.relation)

    def _crossing(self, depth: _Depth, inside: Array | None) -> Clash:
        """A row of where they are deepest in each other, and of a point that is inside of both, if one was found."""
        known = depth.gap, 0.0, depth.points, depth.faces, inside is not None, self.relation, inside
        return Clash(self._names, "crossing", *known)

    @property
    def _names(self) -> tuple[str, str]:
        return self.a.body.name, self.b.body.name

    def _deepest(self) -> _Depth:
        """How deep bodies that cross are in each other."""
        a, b = self.a, self.b
        part = min(self.touching / self.size, MOST_TOUCHING)
        pair = closest_features(a.body, b.body, a.row, b.row, touching=part)
        gap = min(pair.gap, 0.0) if pair.status is not FeatureStatus.CROSSING else -np.inf
        local = self._local()
        if local is not None and local.gap > gap:
            return local
        # A place where they cross is all that is known of some.
        return _Depth(gap if np.isfinite(gap) else 0.0, pair.points, (pair.features[0].name, pair.features[1].name))

    def _local(self) -> _Depth | None:
        """The deepest place where surfaces face each other from inside, of those that a contact manager lists."""
        a, b = self.a, self.b
        manager = Manager([a.body, b.body], touching=min(self.touching / self.size, MOST_TOUCHING))
        manager.update(np.stack([a.row, b.row]))
        deep = [contact for contact in manager.contacts if contact.gap < -self.touching]
        if not deep:
            return None
        found = min(deep, key=lambda contact: contact.gap)
        faces = self._face_at(a, found.points[0]), self._face_at(b, found.points[1])
        return _Depth(found.gap, found.points, faces)

    def _inner_points(self, points: Array) -> list[Array]:
        """Points that may be inside of both bodies, by where they are deepest and by where their boxes overlap."""
        low = np.maximum(self.a.box[0], self.b.box[0])
        high = np.minimum(self.a.box[1], self.b.box[1])
        middle, way = points.mean(axis=0), points[1] - points[0]
        inward = 0.5 * (low + high) - middle
        if float(way @ way) > 0.0:
            inward = inward - float(inward @ way) / float(way @ way) * way
        # Deepest points may be at the border of both faces, and what is between them beside the bodies.
        return [middle + part * inward for part in INWARD] + [0.75 * points[k] + 0.25 * points[1 - k] for k in (0, 1)]

    def _face_at(self, body: Posed, point: Array) -> str:
        """What of a body a point of its surface is on."""
        return self.probe.found(body, point).features[0].name
