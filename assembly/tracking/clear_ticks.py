"""Proofs of clearances in ticks: bodies are clear or touch at the poses, and on the way to them."""

from __future__ import annotations

from collections.abc import Generator
from functools import cached_property
from time import perf_counter_ns
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._record import place_of
from assembly.constraints.packing.corners import body_of
from assembly.constraints.packing.manager import is_of_surfaces
from assembly.proximity.clearance.answers import Answer, Contacts, Verdict, is_proven
from assembly.proximity.clearance.conforming import conforms
from assembly.proximity.clearance.kept_looks import NEVER, Until, run_through
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.proximity.clearance.touching import off_contacts
from assembly.proximity.features.solid_contact import TRACK, TRACKED_PAIR
from assembly.proximity.manager.records import MEMORY_HEADER, PAIR_MEMORY, PLACE_MEMORY, PLACE_NUMBER, PLACE_PAIR
from assembly.solve.clearance_proof import new_proof, nothing_known
from assembly.solve.loop.settings import HISTORY
from assembly.solve.near_contacts import near_contacts, opening_move
from assembly.solve.scene import Scene, Status
from assembly.solve.solution import Solution

if TYPE_CHECKING:
    from assembly.constraints.packing.scene import Packed

__all__ = ["ClearTicks", "Standing", "WayLimits"]

Array = NDArray[np.float64]
# Pairs of nodes that a tick looks at for a pair of bodies: at first, where faces that come to touch have to be opened
# if it takes more, and then.
QUICK, BUDGET = 500, 4000
# How deep the way of a contact that rolls may go in, in parts of the square of its length over the least radius: a
# chord of a curve of radius r is s^2 / (8 r) off it, there are two, and a contact may go farther than the bodies.
ROLLED = 1.0
# Parts of it that bodies are opened by, one after the other: opened by more, they may cross elsewhere.
OPENED = (1.0, 0.1, 0.01)
# The part of what is called touching that such a way may go in without being opened.
SLIGHTLY = 0.1
# It may go in by so much of the size in any case: directions that part bodies are then found at once.
ROOM = 1e-6
UNKNOWN = Answer(Verdict.UNDECIDED)
# Where the normal of a contact is among what is tracked of it.
NORMAL = slice(place_of(TRACKED_PAIR, "normal"), place_of(TRACKED_PAIR, "normal") + 3)
# Contacts that are nearer, in parts of the size, are remembered of a pose.
NEAR = 1e-2


class _Listed(NamedTuple):
    """What slots for contacts have: pairs of bodies, or -1; numbers; normals (k, 3) in the axes of first bodies."""

    pairs: Array
    numbers: Array
    normals: Array


class Standing:
    """Poses of the bodies in a state, and the contacts that are near there, found when they are first needed.

    Parameters
    ----------
    scene : Scene
    packed : Packed
    state : (k,)
        Nobody writes to it.
    """

    def __init__(self, scene: Scene, packed: Packed, state: Array) -> None:
        self.scene, self.packed, self._state = scene, packed, state
        self.q = state[: packed.contacts_at].reshape(-1, 7)
        self._relative: dict[int, tuple[Array, Array]] = {}
        self._near: dict[int, Contacts] | None = None
        self._ways: dict[int, float] = {}

    def near(self, proof: ClearanceProof) -> dict[int, Contacts]:
        """The contacts that are near, by the number of their pair."""
        if self._near is None:
            solution = Solution(self.scene, self.packed, self._state, Status.SOLVED, 0.0, np.empty((0, HISTORY)))
            self._near = near_contacts(solution, proof, NEAR * max(map(proof.size, range(len(proof.pairs)))))
        return self._near

    def relative(self, proof: ClearanceProof, k: int) -> tuple[Array, Array]:
        """The rotation and the shift of the second body of pair k, seen from the first."""
        if k not in self._relative:
            self._relative[k] = proof.relative(k, self.q)
        return self._relative[k]

    @cached_property
    def listed(self) -> _Listed:
        """The contacts that are listed."""
        packed, state = self.packed, self._state
        slots_at = packed.memory_at + MEMORY_HEADER + PAIR_MEMORY * len(packed.kept_pairs)
        slots = state[slots_at:][: PLACE_MEMORY * packed.clearance_rows].reshape(-1, PLACE_MEMORY)
        first = packed.contacts_at + TRACK * len(packed.contacts)
        tracked = state[first:][: TRACK * packed.clearance_rows].reshape(-1, TRACK)
        return _Listed(slots[:, PLACE_PAIR], slots[:, PLACE_NUMBER], tracked[:, NORMAL])

    def way_length(self, proof: ClearanceProof, k: int, before: Array) -> float:
        """How far points of the second body of pair k went from the poses (n, 7) of the last tick, at most."""
        if k not in self._ways:
            self._ways[k] = proof.way_length(k, before, self.q)
        return self._ways[k]

    def opened(self, proof: ClearanceProof, k: int, depth: float) -> Array:
        """The least move (6) of the second body of pair k, by no more than a depth, that opens its contacts."""
        return opening_move(proof, k, self.q, self.near(proof).get(k), depth)


class WayLimits(NamedTuple):
    """Limits of what is proven of ways of bodies that touch.

    Attributes
    ----------
    sampled : float
        How far bodies whose faces lie on each other may move in one way, in parts of their size.
    depth : float
        How deep a way may go in, in the unit of the scene.
    """

    sampled: float = np.inf
    depth: float = np.inf


class ClearTicks:
    """The proofs of the pairs that a tracker's clearances keep apart, from tick to tick.

    The pose of a tick is proven up to `touching`. On the straight way between two ticks bodies that touch overlap by an
    amount that is quadratic in its length. What is proven is the way of bodies that are moved apart by that amount at
    the last pose, and moved back at this one.

    Parameters
    ----------
    first : Solution
        Where the tracker begins.
    touching : float
        What bodies may be in each other and touch, in the unit of the scene.
    proof : ClearanceProof, optional
        That of the same pairs, whose last poses are forgotten.
    limits : WayLimits

    Attributes
    ----------
    doubtful : dict of int -> Answer
        If the last tick does not hold, or the first one: the pairs that are not proven.
    proved : bool
        Whether all pairs were proven clear, or touching, at the last tick that holds; else faces lie on each other.
    way_depth : float
        The largest overlap of bodies on the way to it.
    unlisted : frozenset of int
        Pairs whose contacts are not listed: what opens them is recognized from their faces.
    renewable : frozenset of int
        Pairs which may get other rows in this tick.
    in_the_way : list of int
        The pairs that the last tick does not hold of; not those without rows of which the way alone is not proven.
    """

    def __init__(
        self,
        first: Solution,
        touching: float,
        proof: ClearanceProof | None = None,
        limits: WayLimits | None = None,
    ) -> None:
        self._touching, self._limits = touching, limits or WayLimits()
        if proof is None:
            proof = new_proof(first._packed, first._scene.bodies)
            proof.fronts.counts.budget = BUDGET
        proof.forget_poses()
        # Wires are in each other by the distance of their spines, which no move has to open.
        proof.make_slimmer(touching if self._limits.depth == np.inf else 0.0)
        self._proof = proof
        # It tells of poses alone; made when it is first needed.
        self._judge: ClearanceProof | None = None
        pairs = first._packed.kept_pairs[: len(proof.pairs)]
        self._of_features = {k for k, pair in enumerate(pairs) if not is_of_surfaces(pair)}
        # A proof may have a pair the other way round.
        firsts = [first._scene.index(body_of(side)) for side, _ in pairs]
        self._turned = {k for k, one in enumerate(firsts) if one != proof.pairs[k][0]}
        self._at = Standing(first._scene, first._packed, first._state)
        # What is going on where its time was over.
        self._going: Generator[None, None, bool] | None = None
        self._moves, self._opened = np.zeros((len(proof.pairs), 6)), list[int]()
        self.way_depth, self._deepest = 0.0, 0.0
        self.unlisted, self.renewable, self.in_the_way = frozenset[int](), frozenset[int](), list[int]()
        answers = dict(enumerate(proof.look(first.q, touching)))
        left = [k for k, answer in answers.items() if not is_proven(answer)]
        for k in left:
            self._moves[k] = self._at.opened(proof, k, touching)
        if left:
            answers.update(zip(left, proof.look(first.q, touching, self._moves, which=left), strict=True))
            self._opened = self._those_opened()
        self.proved = all(map(is_proven, answers.values()))
        self.doubtful = self._not_known(answers, self._at)

    def holds(self, solution: Solution) -> bool:
        """Whether all pairs hold at the pose of a tick, and on the way there from the last one that did.

        The solution is of a state that nobody writes to. It takes what time it takes.
        """
        there = Standing(solution._scene, solution._packed, solution._state)
        return run_through(self._proving(there))

    @property
    def goes_on(self) -> bool:
        """Whether the time of the last tick was over before it was known whether its pose holds."""
        return self._going is not None

    def hold_at(self, there: Standing, until: Until = NEVER) -> bool | None:
        """As `holds`, of the poses of a tick; None where that is not known when the time is over.

        Then `go_on` goes on with what is not known.

        Parameters
        ----------
        there : Standing
        until : (int, int)
            The address of a clock, and the nanoseconds at which the time is over; (0, 0) for never.
        """
        self._going = self._proving(there)
        return self.go_on(until)

    def go_on(self, until: Until = NEVER) -> bool | None:
        """Go on with what was not known when the time was over; see `hold_at`.

        It makes progress that lasts, however little time it has.
        """
        assert self._going is not None
        self._take_time(until)
        try:
            next(self._going)
        except StopIteration as end:
            self._going = None
            return bool(end.value)
        finally:
            self._take_time(NEVER)
        return None

    def _take_time(self, until: Until) -> None:
        """Have looks of both proofs end when a time is over, those as well that go on."""
        self._proof.until = until
        if self._judge is not None:
            self._judge.until = until

    def _pause(self) -> Generator[None, None, None]:
        """Yield if the time is over."""
        _, end = self._proof.until
        if end and perf_counter_ns() > end:
            yield

    def _proving(self, there: Standing) -> Generator[None, None, bool]:
        """Find out whether all pairs hold at a pose and on the way there; it yields where the time is over."""
        proof, touching, moves = self._proof, self._touching, self._moves
        self._deepest, self.in_the_way = 0.0, []
        rolling, last = self._rolling(there), proof.last_poses()
        answers: dict[int, Answer] = {}
        if not rolling:
            # Contacts stay for many ticks, and so does what opens them.
            if (yield from proof.staying_clear(there.q, touching, moves, QUICK)):
                self._at, self.proved, self.way_depth = there, True, proof.way_depth()
                return True
            left = proof.not_clear()
        else:
            # Where a long way may not go in by its square, one along flat faces still may do.
            rolling = [k for k in rolling if self._may_go_in(k, there, OPENED[0])]
            others = [k for k in range(len(proof.pairs)) if k not in rolling]
            left = (yield from self._left_by(answers, others, there, moves, QUICK)) + rolling
        moves = moves.copy()
        for k in left:
            moves[k] = self._opening(there, k)
            yield from self._pause()
        changed = [k for k in left if k not in rolling and (moves[k] != self._moves[k]).any()]
        yield from self._left_by(answers, changed, there, moves, QUICK)
        if (yield from self._ask_rows(answers, left, there, moves)):
            proof.go_back(last)
            return False
        for part in OPENED:
            open_yet = [k for k in left if not (k in answers and is_proven(answers[k]))]
            may = [k for k in open_yet if self._may_go_in(k, there, part)]
            if may:
                found = yield from self._rolled(there, moves, may, part)
                answers.update(zip(may, found, strict=True))
        # What is much, and not deep: it takes more where bodies touch, which are opened in less.
        open_yet = [k for k in left if not (k in answers and is_proven(answers[k]))]
        yield from self._left_by(answers, open_yet, there, moves, BUDGET)
        self.doubtful = self._not_known(answers, there)
        if self.doubtful:
            self.in_the_way = list(self.doubtful)
            proof.go_back(last)
            return False
        self.proved = all(map(is_proven, answers.values()))
        self._at, self._moves = there, moves
        self.way_depth = max(self._deepest, proof.way_depth())
        yield from self._leave_closed([k for k in left if moves[k].any() and proof.is_of_wires(k)])
        self._opened = self._those_opened()
        return True

    def _ask_rows(
        self, answers: dict[int, Answer], left: list[int], there: Standing, moves: Array
    ) -> Generator[None, None, bool]:
        """Whether a tick is refused because of pairs that have no rows, or that may get others.

        Of the latter only if they are not clear at its pose, which another proof tells: this one goes on from the last
        pose. What would take long to prove is not tried before.
        """
        asked = [k for k in left if k in self.unlisted | self.renewable and not is_proven(answers.get(k, UNKNOWN))]
        if not asked:
            return False
        if self._judge is None:
            self._judge = new_proof(there.packed, there.scene.bodies)
            self._judge.until = self._proof.until
        found = yield from self._judge.looking(there.q, self._touching, moves, which=asked, budget=QUICK)
        self.in_the_way = [k for k, answer in zip(asked, found, strict=True) if answer.part < 1.0]
        refused = [k for k in asked if k in self.unlisted or k in self.in_the_way]
        self.doubtful = {k: answers.get(k, UNKNOWN) for k in refused}
        return bool(refused)

    def _opening(self, there: Standing, k: int) -> Array:
        """The move (6) that opens pair k at the pose of a tick."""
        if k not in self.unlisted:
            return there.opened(self._proof, k, self._touching)
        off = off_contacts(self._proof, k, there.q, self._touching, nothing_known)
        return np.zeros(6) if off is None else off

    def _those_opened(self) -> list[int]:
        """The pairs that a move opens."""
        opened: list[int] = np.flatnonzero(self._moves.any(axis=1)).tolist()
        return opened

    def _leave_closed(self, which: list[int]) -> Generator[None, None, None]:
        """Go on without moves that open pairs of wires, where these are proven to touch without."""
        if not which:
            return
        closed = self._moves.copy()
        closed[which] = 0.0
        answers = yield from self._proof.looking(self._at.q, self._touching, closed, which=which)
        for k, answer in zip(which, answers, strict=True):
            if is_proven(answer):
                self._moves[k] = 0.0
            else:
                yield from self._proof.looking(self._at.q, self._touching, self._moves, which=[k])

    def _left_by(
        self, answers: dict[int, Answer], which: list[int], there: Standing, moves: Array, budget: int
    ) -> Generator[None, None, list[int]]:
        """Which of some pairs the straight way is not proven of within a budget; what is proven is added to answers."""
        if which:
            found = yield from self._proof.looking(there.q, self._touching, moves, which, swept=True, budget=budget)
            answers.update(zip(which, found, strict=True))
        return [k for k in which if not is_proven(answers[k])]

    def _not_known(self, answers: dict[int, Answer], there: Standing) -> dict[int, Answer]:
        """The pairs that are not proven to be clear, or to touch, and whose faces do not lie on each other."""
        proof, q = self._proof, there.q
        return {
            k: answer
            for k, answer in answers.items()
            if not is_proven(answer)
            and not (
                answer.verdict is Verdict.UNDECIDED
                and conforms(proof, k, q, self._touching)
                and there.way_length(proof, k, self._at.q) <= self._limits.sampled * proof.size(k)
            )
        }

    def _rolling(self, there: Standing) -> list[int]:
        """The pairs that touch and go so far that the straight way goes in by what counts beside what is touching."""
        proof, begin = self._proof, self._at
        found = []
        for k in self._opened:
            if k in self.unlisted:
                continue
            way = there.way_length(proof, k, begin.q)
            most = SLIGHTLY * self._touching / ROLLED
            if way * way > most * proof.radius(k) and self._turns(k, there, most / way):
                found.append(k)
        return found

    def _turns(self, k: int, there: Standing, angle: float) -> bool:
        """Whether normals of pair k may turn by more than an angle on the way to a pose, as either body sees them.

        Along flat faces, and on them, they do not turn, and no way goes in. It is not known where contacts come and go,
        and of surfaces, whose normals are not kept.
        """
        before, after = self._at.listed, there.listed
        if k not in self._of_features or len(before.pairs) != len(after.pairs):
            return True
        mine = np.flatnonzero(after.pairs == k)
        same = (before.pairs[mine] == k) & (before.numbers[mine] == after.numbers[mine])
        if not len(mine) or not same.all():
            return True
        one, other = before.normals[mine], after.normals[mine]
        turned = np.abs(other - one).max(axis=1)
        if not (turned > angle).any():
            return False
        (first, _), (second, _) = (standing.relative(self._proof, k) for standing in (self._at, there))
        if k in self._turned:
            first, second = first.T, second.T
        return bool(((turned > angle) & (np.abs(other @ second - one @ first).max(axis=1) > angle)).any())

    def _may_go_in(self, k: int, there: Standing, part: float) -> bool:
        """Whether pair k may go in by a part of what it may if it touches all along."""
        return self._limits.depth == np.inf or self._roll_depth(k, there, part) <= self._limits.depth

    def _roll_depth(self, k: int, there: Standing, part: float) -> float:
        """A part of what the way of pair k may go in if it touches all along."""
        way = there.way_length(self._proof, k, self._at.q)
        return max(part * ROLLED * way * way / self._proof.radius(k), ROOM * self._proof.size(k))

    def _rolled(
        self, there: Standing, moves: Array, which: list[int], part: float
    ) -> Generator[None, None, list[Answer]]:
        """What is proven of pairs that are opened on the way, by a part of what it may go in."""
        proof, begin = self._proof, self._at
        before, after = self._moves.copy(), moves.copy()
        for k in which:
            depth = self._roll_depth(k, there, part)
            self._deepest = max(self._deepest, depth)
            for standing, opened in ((begin, before), (there, after)):
                move = standing.opened(proof, k, depth)
                if move.any():
                    opened[k] = move
                yield from self._pause()
        opened_at = yield from proof.looking(begin.q, self._touching, before, which=which, swept=True)
        known = [k for k, answer in zip(which, opened_at, strict=True) if is_proven(answer)]
        if known:
            ways = yield from proof.looking(there.q, self._touching, after, which=known, swept=True)
            known = [k for k, answer in zip(known, ways, strict=True) if is_proven(answer)]
        # Where the way is not known, a pose at its end that is clear is none that was come to.
        ends = yield from proof.looking(there.q, self._touching, moves, which=which, swept=True)
        return [
            answer if k in known or not is_proven(answer) else Answer(Verdict.UNDECIDED)
            for k, answer in zip(which, ends, strict=True)
        ]
