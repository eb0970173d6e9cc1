"""The kind of a pair of bodies: from their nearest points and, where these meet, from what is proven.

Nearest points that are apart tell all (`assembly.proximity.distance`). Bodies that have points in common touch or
cross: a look at the pair tells which (`assembly/solve/crossings.py`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.contact import side_faces
from assembly.proximity.clearance.answers import Answer, Verdict
from assembly.proximity.clearance.body_cells import has_cells
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.proximity.features.body_distance import Beyond, BodyDistance, DistanceStatus, beyond, distance_at
from assembly.proximity.features.features import faces_of
from assembly.proximity.features.polytopes import Parting
from assembly.solve.crossings import PairLook
from assembly.studies.interference.clash import Clash, Kind, Relation
from assembly.studies.interference.depth import Depth, Two, common_point
from assembly.studies.interference.flat_bodies import deepest

__all__ = ["NearPair"]

Array = NDArray[np.float64]
# Bounds of a distance that agree to this part of the size are one number, and nearest points are sought to it.
AGREED = 1e-9
# Pairs of parts that a search for them, or a proof of a bound, may look at; and a search where a proof does not agree
# with what was found: beside a bore whose points are all equally near, a shoulder may be nearer than these.
BUDGET = 20_000
MOST = 200_000
# Parts of a gap that are tried as bounds.
PARTS = (0.99, 0.9, 0.75, 0.5)

# What is told of bodies that a shorter move than what is called touching parts.
TOUCHES = PairLook(Answer(Verdict.TOUCHING), False, True)


@dataclass(eq=False)
class NearPair:
    """Two bodies, and what is known of them.

    Attributes
    ----------
    two : Two
    relation : Relation
    parting : Parting, optional
        What parts them, if they are convex and of flat faces.
    """

    two: Two
    relation: Relation = field(repr=False)
    parting: Parting | None = field(default=None, repr=False)

    def beyond(self, margin: float) -> Beyond:
        """Whether the two are farther apart than a margin, and whether one may be inside of the other one."""
        least = max(margin, self.two.touching)
        if self.parting is not None and self.parting.depth <= self.two.touching:
            # A plane is between them, or nearly. Of those nearer to each other their nearest points tell all.
            if -self.parting.depth > least or self.parting.depth >= -self.two.touching:
                return Beyond(-self.parting.depth > least, False)
        return beyond(*self.two.bodies, self.two.q, least, BUDGET)

    @property
    def nearest(self) -> BodyDistance:
        """Their nearest points."""
        return self._found[0]

    @property
    def bound(self) -> float:
        """No points of the two surfaces are nearer than this."""
        return self._found[1]

    @cached_property
    def _found(self) -> tuple[BodyDistance, float]:
        """Nearest points, and a bound.

        A search among points of which very many are nearest has no room to end: there radii may tell, or at least of
        most of the gap. Where they do not tell all of it, points that the search did not come to may be nearer.
        """
        near = self._search(BUDGET)
        bound = self._bound(near)
        if near.converged or near.upper <= self.two.touching or self._agree(near, bound):
            return near, bound
        near = self._search(MOST)
        return near, max(bound, self._bound(near))

    def _search(self, budget: int) -> BodyDistance:
        faces = faces_of("a", self.two.a), faces_of("b", self.two.b)
        return distance_at(faces, self.two.q, AGREED * self.two.size, budget)

    def _agree(self, near: BodyDistance, bound: float) -> bool:
        return near.upper - bound <= AGREED * self.two.size

    def normal(self) -> Array | None:
        """From the first body to the second where they touch; None where they do not, or it is not known."""
        return self.nearest.normal if self.nearest.upper <= self.two.touching else None

    @property
    def _agreed(self) -> bool:
        return self._agree(self.nearest, self.bound)

    @property
    def is_told(self) -> bool:
        """Whether nearest points tell what the pair is: they are apart, and so it is known whether one is inside."""
        return self.nearest.converged and self.nearest.upper > self.two.touching

    @property
    def look(self) -> PairLook | None:
        """What a look would tell, where what parts the two tells it as well: that they only touch."""
        if self.parting is None or self.parting.depth > self.two.touching or not self.two.touching > 0.0:
            return None
        return TOUCHES

    def overlap(self) -> Clash | None:
        """The row of bodies that cross as what parts them tells, and how deep; None where it does not tell it."""
        parting, two = self.parting, self.two
        if parting is None or parting.is_nested or not parting.depth > max(two.touching, AGREED * two.size):
            return None
        depth = deepest(two, parting)
        inside = common_point(two, depth.points)
        return Clash(self._names, "crossing", depth.gap, 0.0, depth.points, depth.faces, True, self.relation, inside)

    def _bound(self, near: BodyDistance) -> float:
        """What the search has proven, or radii."""
        if near.converged or near.upper <= self.two.touching:
            return near.lower
        if not all(has_cells(side_faces(body)) for body in self.two.bodies):
            return near.lower
        proof = ClearanceProof([side_faces(body) for body in self.two.bodies], [(0, 1)], [0.0])
        for length in (near.upper - AGREED * self.two.size, *(part * near.upper for part in PARTS)):
            if length > near.lower and proof.is_apart(0, self.two.q, length, BUDGET):
                return length
        return near.lower

    def told(self) -> Clash:
        """The row of a pair whose nearest points tell what it is."""
        near = self.nearest
        if near.status is DistanceStatus.ENCLOSED:
            return self._row("enclosed", -near.upper, True)
        return self._row("clear", near.upper, True)

    def looked(self, look: PairLook) -> Clash:
        """The row of a pair of which a look tells what it is, but of one that crosses."""
        near = self.nearest
        if look.answer.verdict is Verdict.ENCLOSED or (look.crosses and self.bound > 0.0):
            return self._row("enclosed", -near.upper, look.proved)
        if near.upper <= self.two.touching:
            # What is no farther apart than points are sought to has points in common.
            gap = near.upper if near.upper > AGREED * self.two.size else 0.0
            return self._row("touching", gap, look.proved)
        return self._row("clear", near.upper, look.proved and self._agreed)

    def is_deep(self, look: PairLook) -> bool:
        """Whether surfaces cross."""
        return bool(look.crosses) and look.answer.verdict is not Verdict.ENCLOSED and not self.bound > 0.0

    def crossing(self, look: PairLook, depth: Depth) -> Clash:
        """The row of bodies that cross: where they are deepest in each other."""
        inside = common_point(self.two, depth.points)
        proved = inside is not None or look.answer.verdict is Verdict.CROSSING
        return Clash(self._names, "crossing", depth.gap, 0.0, depth.points, depth.faces, proved, self.relation, inside)

    def unsearched(self, bound: float) -> Clash:
        """The row of a pair that there was no time for."""
        known = max(bound, self.nearest.lower) if "_found" in self.__dict__ else bound
        return Clash(self._names, "undecided", None, known, None, None, False, self.relation)

    def _row(self, kind: Kind, gap: float, proved: bool) -> Clash:
        """A row of the nearest points."""
        near = self.nearest
        bound = 0.0 if kind == "touching" else min(self.bound, near.upper)
        faces = near.features[0].name, near.features[1].name
        return Clash(self._names, kind, gap, bound, near.points, faces, proved, self.relation)

    @property
    def _names(self) -> tuple[str, str]:
        return self.two.a.name, self.two.b.name
