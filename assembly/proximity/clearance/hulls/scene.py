"""What hulls of faces tell of all pairs of bodies of a scene at poses, before anything else is made of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.clearance.answers import Answer, Verdict
from assembly.proximity.clearance.hulls.body_hulls import BodyHulls, hulls_of_body, with_pockets
from assembly.proximity.clearance.hulls.crossing import crossing_by_hulls
from assembly.proximity.clearance.hulls.pair import ROUNDING, answer_by_hulls
from assembly.proximity.clearance.hulls.planes import normal_between

__all__ = ["HullAnswers"]

Array = NDArray[np.float64]


class HullAnswers:
    """What hulls of faces tell of pairs at poses; each pair is asked when its answer is first needed, and once.

    Parameters
    ----------
    shapes : sequence of tuple of Face
        Of every body its faces.
    pairs : sequence of (int, int)
        Numbers of bodies.
    minimum : sequence of float
        Of every pair, what its gap is to be at least.
    q : (n, 7)
        One row per body.
    touching : float
        How far a point of a body may be taken to have the gap so large; what crosses by no more is not told to cross.
    is_silent : bool
        Whether nothing is told of any pair.
    last : HullAnswers, optional
        Of the same shapes, pairs and lengths at other poses: what is known of pairs of bodies that stay is so here, and
        by so much less of those that have moved by rounding.

    Attributes
    ----------
    looked : dict of int to Answer, optional
        What looks have told of the other pairs, by their numbers, once somebody has asked.
    """

    def __init__(
        self,
        shapes: Sequence[tuple[Face, ...]],
        pairs: Sequence[tuple[int, int]],
        minimum: Sequence[float],
        q: Array,
        touching: float,
        is_silent: bool = False,
        last: HullAnswers | None = None,
    ) -> None:
        self._shapes, self._pairs, self._minimum = shapes, pairs, minimum
        self._q, self._touching, self._is_silent = q, touching, is_silent
        self.looked: dict[int, Answer] | None = None
        self._held: dict[int, Answer | None] = {}
        self._crossings: dict[int, Answer | None] = {}
        if last is not None:
            self._take_from(last)

    def _take_from(self, last: HullAnswers) -> None:
        """Take what is known of pairs of bodies that have stayed, or have moved by no more than rounding."""
        way = np.where((self._q == last._q).all(axis=1), 0.0, np.inf)
        for body in () if self._is_silent else self._hulls:
            if way[body] > 0.0:
                way[body] = self._rounded_way(last, body)
        for k, (one, other) in enumerate(self._pairs):
            by = float(way[one] + way[other])
            if by == 0.0:
                for mine, theirs in ((self._held, last._held), (self._crossings, last._crossings)):
                    mine.update({k: theirs[k]} if k in theirs else {})
            elif by < np.inf:
                found = _after_a_move(last._held.get(k), by, float(self._minimum[k]), self._touching)
                self._held.update({} if found is None else {k: found})

    def _rounded_way(self, last: HullAnswers, body: int) -> float:
        """How far points of a body have gone at most, infinite where that is more than rounding."""
        center, radius = self._hulls[body].ball
        extent = float(np.linalg.norm(center)) + radius
        shift, turn = np.split(self._q[body] - last._q[body], [3])
        way = float(np.linalg.norm(shift) + 2.0 * np.linalg.norm(turn) * extent)
        return way if way <= ROUNDING * (float(np.linalg.norm(self._q[body, :3])) + extent) else np.inf

    def held(self, k: int) -> Answer | None:
        """That a pair is clear or touches, or None where hulls do not tell it."""
        if k not in self._held:
            self._held[k] = self._ask_whether_it_holds(k)
        return self._held[k]

    def crossing(self, k: int) -> Answer | None:
        """That a pair crosses, or None where hulls do not tell it."""
        if k not in self._crossings:
            self._crossings[k] = None if self.held(k) else self._ask_whether_it_crosses(k)
        return self._crossings[k]

    def all_held(self) -> list[Answer] | None:
        """That all pairs are clear or touch, or None at the first of which hulls do not tell it."""
        return _all(self.held(k) for k in range(len(self._pairs)))

    def told_or_crossing(self) -> dict[int, Answer]:
        """The pairs that are told to be clear, to touch or to cross, by their numbers."""
        answers = ((k, self.held(k) or self.crossing(k)) for k in range(len(self._pairs)))
        return {k: answer for k, answer in answers if answer is not None}

    def parted(self, k: int) -> bool:
        """Whether a plane is told to be between the bodies of a pair."""
        if self._is_silent:
            return False
        if self._apart[k] > 0.0:
            return True
        one, other = self._pairs[k]
        return normal_between(self._hulls[one], self._hulls[other].posed(*self._relative(k))) is not None

    def told(self) -> dict[int, Answer]:
        """The pairs that are told to be clear or to touch, by their numbers."""
        answers = ((k, self.held(k)) for k in range(len(self._pairs)))
        return {k: answer for k, answer in answers if answer is not None}

    def any_touches(self) -> bool:
        """Whether any pair is told to touch or to cross: then not all are clear."""
        return any(self._touches(k) for k in range(len(self._pairs)))

    def _touches(self, k: int) -> bool:
        held = self.held(k)
        return self.crossing(k) is not None if held is None else held.verdict is not Verdict.CLEAR

    def any_crosses(self) -> bool:
        """Whether any pair is told to cross."""
        return any(self.crossing(k) is not None for k in range(len(self._pairs)))

    @cached_property
    def _hulls(self) -> dict[int, BodyHulls]:
        """The hulls of the bodies of all pairs."""
        bodies = sorted({body for pair in self._pairs for body in pair})
        return {body: hulls_of_body(self._shapes[body]) for body in bodies}

    @cached_property
    def _turns(self) -> dict[int, Array]:
        return {body: rotation_matrix(self._q[body, 3:]) for body in self._hulls}

    @cached_property
    def _apart(self) -> Array:
        """Of every pair, how far balls around the bodies are from each other."""
        middle, radius = np.zeros((len(self._q), 3)), np.zeros(len(self._q))
        for body, made in self._hulls.items():
            center, radius[body] = made.ball
            middle[body] = self._turns[body] @ center + self._q[body, :3]
        a, b = np.array(self._pairs, dtype=np.int64).reshape(-1, 2).T
        apart = np.linalg.norm(middle[b] - middle[a], axis=1) - radius[a] - radius[b]
        # What is told of a pair is to depend on these two bodies alone.
        far = np.abs(middle).max(axis=1) + radius
        return np.asarray(apart - ROUNDING * np.maximum(far[a], far[b]))

    def _relative(self, k: int) -> tuple[Array, Array]:
        """Where the second body of a pair is in the axes of the first."""
        one, other = self._pairs[k]
        turn = self._turns[one]
        return turn.T @ self._turns[other], (self._q[other, :3] - self._q[one, :3]) @ turn

    def _ask_whether_it_holds(self, k: int) -> Answer | None:
        if self._is_silent:
            return None
        (one, other), least = self._pairs[k], float(self._minimum[k])
        if self._apart[k] > least:
            return Answer(Verdict.CLEAR, float(self._apart[k]))
        return self._answer(k, self._hulls[one], self._hulls[other]) or self._answer_by_pockets(k)

    def _answer(self, k: int, first: BodyHulls, second: BodyHulls) -> Answer | None:
        posed = second.facing(first).posed(*self._relative(k))
        return answer_by_hulls(first.facing(second), posed, float(self._minimum[k]), self._touching)

    def _answer_by_pockets(self, k: int) -> Answer | None:
        self._crossings[k] = self._ask_whether_it_crosses(k)
        if self._crossings[k] is not None:
            return None
        found = [with_pockets(self._shapes[body]) for body in self._pairs[k]]
        if found == [None, None]:
            return None
        hulls = [own or self._hulls[body] for own, body in zip(found, self._pairs[k], strict=True)]
        return self._answer(k, *hulls)

    def _ask_whether_it_crosses(self, k: int) -> Answer | None:
        one, other = self._pairs[k]
        if self._is_silent or self._apart[k] > 0.0:
            return None
        found = crossing_by_hulls((self._shapes[one], self._shapes[other]), *self._relative(k), self._touching)
        return found and replace(found, place=self._turns[one] @ found.place + self._q[one, :3])


def _after_a_move(answer: Answer | None, by: float, least: float, touching: float) -> Answer | None:
    """What an answer that a pair holds is worth after a move of its bodies by a length; None where it is nothing."""
    if answer is None:
        return None
    bound, depth = answer.bound - by, answer.depth
    if answer.verdict is Verdict.CLEAR:
        return replace(answer, bound=bound) if bound > least else None
    # What is taken so far to be clear is taken back by that much, too.
    return replace(answer, bound=bound, depth=depth + by) if depth + by <= touching else None


def _all(answers: Iterator[Answer | None]) -> list[Answer] | None:
    """The answers, or None at the first that is none."""
    found = []
    for answer in answers:
        if answer is None:
            return None
        found.append(answer)
    return found
