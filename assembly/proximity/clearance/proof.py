"""What is known of pairs of bodies at poses: clear, touching, crossing, one within the other, or undecided; proven."""

from __future__ import annotations

from collections.abc import Generator, Sequence

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.geometry.faces.face import Face
from assembly.kinematics.pose import rotation_of
from assembly.proximity.clearance.answers import Answer, Verdict
from assembly.proximity.clearance.hulls.scene import HullAnswers
from assembly.proximity.clearance.inside import UNCLEAR, winding_of
from assembly.proximity.clearance.kept_looks import KeptLooks, run_through
from assembly.proximity.clearance.pair_looks import BEGUN_ANEW, ON_WAY
from assembly.proximity.clearance.records import (
    BY_BORE_B,
    BY_PLANE,
    BY_SLEEVE,
    CLEAR,
    CROSSING,
    LEFT_OPEN,
    NODES,
    PARTED,
)

__all__ = ["LEAST_SIZE", "ClearanceProof", "stayed_answers"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
# Of smaller bodies, and of larger ones than one over it, nothing is proven: products of six lengths are no numbers.
LEAST_SIZE = 1e-30
# What rounding may take from the room in a bore, in parts of coordinates.
ROUNDING = 4e-15
# Poses whose answers are kept.
REMEMBERED = 4
# Pairs of nodes of a look after which hulls are asked.
SHORT = 500
# Places in the stack of a ray.
STACK = 4096


class ClearanceProof(KeptLooks):
    """The proofs of pairs of bodies, kept from look to look; made as `BodyPairs` are."""

    def __init__(
        self,
        shapes: Sequence[tuple[Face, ...]],
        pairs: Sequence[tuple[int, int]],
        minimum: Sequence[float],
    ) -> None:
        super().__init__(shapes, pairs, minimum)
        self._stack = np.zeros(STACK, dtype=np.int64)
        self._way_depth, self._slimmer = self.fronts.pair.way_depth, self.fronts.pair.slimmer
        self._soonest, self._travelled = self.fronts.pair.soonest, self.fronts.pair.travelled
        self._needed = self.fronts.pair.needed
        # What two wires may be slimmer at most, and other bodies not at all.
        self._slimmest = np.array([self.radius(k) if self.is_of_wires(k) else 0.0 for k in range(len(self.pairs))])
        # What opened contacts at the last look of a solve.
        self.moves = np.zeros((len(self.pairs), 6))
        self._stood: dict[tuple[bytes, float], list[Answer]] = {}
        # Whether the last way of a solve was not proven, but short.
        self.has_jumped = False

    def as_they_stand(self, q: Array, touching: float) -> list[Answer]:
        """What is proven of all pairs at poses (n, 7); the last few poses are looked at once.

        Several ways to solve a scene begin with this question, at the same start. No look tells that bodies touch: it
        would spend its whole budget there, so that hulls are asked first of pairs of which a short one does not tell.
        """
        known = self._stood.get((q.tobytes(), touching))
        if known is not None:
            return known
        found = self.look(q, touching, budget=SHORT)
        left = [k for k, answer in enumerate(found) if answer.verdict is Verdict.UNDECIDED]
        by_hulls = [k for k in left if not self.is_of_wires(k)]
        least = self.minimum[by_hulls].tolist()
        told = HullAnswers(self.faces, [self.pairs[k] for k in by_hulls], least, q, touching).told()
        for place, answer in told.items():
            found[by_hulls[place]] = answer
            left.remove(by_hulls[place])
        for k, answer in zip(left, self.look(q, touching, which=left), strict=True):
            found[k] = answer
        self._remember(q, touching, found)
        return found

    def look_from(self, q: Array, touching: float) -> list[Answer]:
        """The same by looks alone, in any case: ways lead on from these poses."""
        found = self.look(q, touching)
        self._remember(q, touching, found)
        return found

    def _remember(self, q: Array, touching: float, found: list[Answer]) -> None:
        """Keep what is proven of all pairs at poses, in the place of the oldest."""
        while len(self._stood) >= REMEMBERED:
            self._stood.pop(next(iter(self._stood)))
        self._stood[q.tobytes(), touching] = found

    def look(
        self,
        q: Array,
        touching: float,
        moves: Array | None = None,
        which: Sequence[int] | None = None,
        swept: bool = False,
        budget: int | None = None,
    ) -> list[Answer]:
        """What is proven at poses.

        Parameters
        ----------
        q : (n, 7)
            One row per body.
        touching : float
            Cells that cross by no more are not said to.
        moves : (pairs, 6), optional
            Of every pair, a move of its second body before it is looked at: a translation, and a small rotation about
            its origin, in world axes.
        which : sequence of int, optional
            The pairs that are looked at; all by default.
        swept : bool
            Whether the way from the last look is to be proven as well, of pairs that were clear there.
        budget : int, optional
            Of each pair, the pairs of nodes after which it stays undecided, where that is not to be the usual number.
        """
        return run_through(self.looking(q, touching, moves, which, swept, budget))

    def looking(
        self,
        q: Array,
        touching: float,
        moves: Array | None = None,
        which: Sequence[int] | None = None,
        swept: bool = False,
        budget: int | None = None,
    ) -> Generator[None, None, list[Answer]]:
        """As `look`, piece by piece: it yields whenever the time of `until` is over, and goes on when it is resumed."""
        rows = list(range(len(self.pairs)) if which is None else which)
        moved = np.zeros((len(self.pairs), 6)) if moves is None else np.ascontiguousarray(moves, dtype=float)
        tasks = yield from self._looked(q, touching, moved, rows, swept, budget)
        return [self._answer(k, q, moved[k], tasks[k] >= ON_WAY) for k in rows]

    def go_along(self, q: Array, touching: float, moves: Array, which: Sequence[int]) -> None:
        """As `look` with `swept`, of which nobody asks what is proven: the next look goes on from there."""
        tasks = run_through(self._looked(q, touching, moves, which, True, None))
        for k in which:
            # Of a pair that is clear all the way nothing is left to be found out.
            if tasks[k] < ON_WAY or self._codes[k] != CLEAR:
                self._answer(k, q, moves[k], tasks[k] >= ON_WAY)

    def make_slimmer(self, depth: float) -> None:
        """From now on two wires may be in each other by a depth, and on ways by the square of their length as well.

        By no more than the thinner one's radius: what passes through the other one is in it by both radii.
        """
        asked = np.minimum(depth, self._slimmest)
        if not np.array_equal(self._slimmer, asked):
            self._begun[self._slimmer != asked] = False
            self._slimmer[:] = asked
            self.forget_poses()

    def way_depth(self) -> float:
        """How far wires may be in each other on the ways of the last looks, at most."""
        return max(self._way_depth.tolist(), default=0.0)

    def clear_answers(self, q: Array, moves: Array) -> list[Answer]:
        """What is proven of all pairs at poses (n, 7) at which they stayed clear, after moves (pairs, 6)."""
        return stayed_answers(*self.clear_bounds(q, moves))

    def clear_bounds(self, q: Array, moves: Array) -> tuple[Array, Array]:
        """Of pairs that stayed clear, bounds after moves (pairs, 6), and by how much bodies were moved, or slimmer."""
        needed, slimmer = self._needed, self._slimmer
        bounds = self._soonest - self._travelled + needed - slimmer
        # Only of pairs with nodes in bores of second bodies: one pair after the other takes longer.
        for k in np.flatnonzero(bounds == -np.inf).tolist():
            bounds[k] = self.bound(k)
        depths = np.where(bounds > needed, 0.0, slimmer)
        if np.count_nonzero(moves):
            for k in np.flatnonzero(moves.any(axis=1)).tolist():
                depths[k] += self.move_length(k, q, moves[k])
        return bounds, depths

    def not_clear(self) -> list[int]:
        """The pairs of which `stays_clear` did not find that they do, where it looked at any; else all."""
        return np.flatnonzero((self._codes != CLEAR) | (self.fronts.pair.known != 1.0)).tolist()

    def is_at(self, q: Array) -> bool:
        """Whether all pairs were clear at their last looks, and these were at poses (n, 7)."""
        return self._at == q.tobytes() and bool((self.fronts.pair.known == 1.0).all())

    @property
    def has_wires(self) -> bool:
        """Whether both bodies of any pair are round wires."""
        return bool(self._slimmest.any())

    @property
    def has_looked(self) -> bool:
        """Whether any pair was looked at since the proof was made."""
        return bool(self._begun.any())

    def forget_poses(self) -> None:
        """From now on no way leads from the last poses."""
        self.fronts.pair.known = 0.0

    def begin_anew(self) -> None:
        """Have the next looks find all anew, and forget what opened contacts."""
        self._begun[:] = False
        self.moves[:] = 0.0
        self.forget_poses()

    def is_apart(self, k: int, q: Array, distance: float, budget: int, moves: Array | None = None) -> bool:
        """Whether it is proven, within a budget, that bodies of pair k are farther apart and none is in the other.

        After the pair's move of `moves` (pairs, 6) if they are given; the distance is not below zero.
        """
        needed, budgets, slimmer = self.fronts.pair.needed, self.fronts.counts.budget, self.fronts.pair.slimmer
        before, needed[k] = float(needed[k]), distance
        depth, slimmer[k] = float(slimmer[k]), 0.0
        usual, budgets[k] = int(budgets[k]), budget
        tasks = np.zeros(len(self.pairs), dtype=np.int64)
        tasks[k] = BEGUN_ANEW
        moved = np.zeros((len(self.pairs), 6)) if moves is None else moves
        run_through(self._look(q, 0.0, moved, tasks, None))
        found = self._codes[k] == CLEAR and self.nested(k) is False
        # Gaps of this front are those over another length.
        needed[k], budgets[k], self._begun[k], slimmer[k] = before, usual, False, depth
        self.fronts.pair.known[k] = 0.0
        return bool(found)

    def plane_between(self, k: int, q: Array, moves: Array | None = None) -> Array | None:
        """The normal, from the first body to the second, of a plane that parts the boxes around both bodies of pair k.

        In the scene's axes; after the pair's move of `moves` (pairs, 6) if they are given. None where no plane is
        found. What is in a bore of the other body is apart from it, too, but by no plane.
        """
        if not self.is_apart(k, q, 0.0, 1, moves) or rows_of(NODES, self.fronts.nodes[k])[0].how != BY_PLANE:
            return None
        normal: Array = rows_of(PARTED, self.fronts.parted[k])[0].normal
        return rotation_of(q[self.pairs[k][0], 3:]) @ normal

    def bound(self, k: int) -> float:
        """A lower bound of the distance of pair k at its last look, where that ended clear."""
        pair = self.fronts.pair
        needed, travelled = float(pair.needed[k] - pair.slimmer[k]), float(pair.travelled[k])
        soonest = float(pair.soonest[k])
        if soonest > -np.inf:
            return soonest - travelled + needed
        count = int(self.fronts.counts.count[k])
        # Nodes in bores of the second body never keep a gap: they are asked at every pose, and so at this one.
        expiry = self.fronts.parted[k, :count].view(PARTED)[:, 0]["expiry"]
        links = self.fronts.nodes[k, :count].view(NODES)[:, 0]
        if (links["how"] >= BY_SLEEVE).any():
            return needed
        in_bore = links["how"] == BY_BORE_B
        kept = float(expiry[~in_bore].min(initial=np.inf)) - travelled + needed
        turn, shift = pair.turn[k].reshape(3, 3), pair.shift[k]
        within = self.forest.room_in_bores(links["b"][in_bore], links["a"][in_bore], turn.T, -shift @ turn)
        # The look that ended clear has found the least gap kept.
        return max(min(kept, within - ROUNDING * float(pair.far[k])), needed)

    def _answer(self, k: int, q: Array, move: Array, swept: bool) -> Answer:
        pair, code = self.fronts.pair, int(self._codes[k])
        part = float(pair.part[k])
        if code == CROSSING:
            place = rotation_of(q[self.pairs[k][0], 3:]) @ pair.place[k] + q[self.pairs[k][0], :3]
            return Answer(Verdict.CROSSING, depth=float(pair.depth[k]), place=place, part=part)
        if code != CLEAR:
            return Answer(Verdict.UNDECIDED, part=part)
        nested = False if swept else self.nested(k)
        # From a pose within another body, or that is not told from one, no way to a clear one is proven.
        pair.known[k] = float(nested is False)
        if nested is None:
            return Answer(Verdict.UNDECIDED, part=part)
        bound = self.bound(k)
        if nested:
            # Of a body within another one cells are many, and other ones than where it is beside it.
            self._begun[k] = False
            return Answer(Verdict.ENCLOSED, bound, bound)
        far = self.move_length(k, q, move)
        if not bound > pair.needed[k]:
            far += float(pair.slimmer[k])
        if far > 0.0:
            return Answer(Verdict.TOUCHING, bound - far, far, swept=swept)
        return Answer(Verdict.CLEAR, bound, swept=swept)

    def left(self, k: int) -> tuple[np.recarray, np.recarray]:
        """The pairs of nodes that a look at pair k left open: PARTED and NODES of each."""
        count = int(self.fronts.counts.next_count[k])
        parted, nodes = (rows[:count] for rows in self.fronts.left)
        rows = rows_of(PARTED, parted)
        is_open = rows.expiry == -np.inf
        links = rows_of(NODES, nodes)
        is_open &= links.how == LEFT_OPEN
        return rows[is_open], links[is_open]

    def nested(self, k: int) -> bool | None:
        """Whether a body of pair k, just found clear, is within the other one; None where no ray tells.

        One point of every connected part of a boundary is enough.
        """
        # The pose that a look found clear is the last one.
        turn, shift = self.fronts.pair.turn[k].reshape(3, 3), self.fronts.pair.shift[k]
        a, b = (self._number[body] for body in self.pairs[k])
        for outer, inner, rotation, place in ((a, b, turn, shift), (b, a, turn.T, -shift @ turn)):
            if not self.forest.cells[outer].is_closed:
                continue
            for points in self.forest.shells(inner):
                side = self._winding(outer, points @ rotation.T + place)
                if side != 0:
                    return None if side == UNCLEAR else True
        return False

    def _winding(self, body: int, points: Array) -> int:
        """Whether points of a boundary that does not cross a body's are within that: 1, 0, or UNCLEAR."""
        found = np.full(len(points), UNCLEAR)
        while True:
            asked = winding_of(self.forest.arrays, self.forest.roots[body], points, self._stack, found)
            if found[asked - 1] != UNCLEAR or not self.forest.is_full or not self.forest.grow():
                return int(found[asked - 1])


def stayed_answers(bounds: Array, depths: Array) -> list[Answer]:
    """Answers to pairs that stayed clear, by bounds after moves, and how far these go."""
    return [
        Answer(Verdict.TOUCHING, bound - depth, depth, swept=True)
        if depth > 0.0
        else Answer(Verdict.CLEAR, bound, swept=True)
        for bound, depth in zip(bounds.tolist(), depths.tolist(), strict=True)
    ]
