"""The proof of one tick: bodies are clear, or touch, at its pose and on the straight way there from the last one.

A pair of bodies is tried by what costs least first, and only what is not proven yet goes on to the next way:

1. the straight way, with what opened contacts at the last pose;
2. the same, with what opens the contacts of this pose;
3. the way of bodies that are opened farther at both poses, by parts of what a contact that rolls may go in;
4. the straight way, with many pairs of nodes.

To a pose at which bodies are not proven to be clear no way leads, and to seek one takes a budget at each of its parts.
So where 1 and 2 fail, a second proof looks at the end of a way before the way is tried.

The procedure is a generator. It yields where the time is over, and goes on where it was when it is resumed.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from time import perf_counter_ns

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.clearance.answers import Answer, Verdict, is_proven
from assembly.proximity.clearance.touching import off_contacts
from assembly.solve.clearance_proof import nothing_known
from assembly.tracking.proven_pose import BUDGET, QUICK, ProvenPose
from assembly.tracking.standing import Standing

__all__ = ["TickProof"]

Array = NDArray[np.float64]
# Parts of what a contact that rolls may go in that bodies are opened by, one after the other: opened by more, they may
# cross elsewhere.
OPENED = (1.0, 0.1, 0.01)
UNKNOWN = Answer(Verdict.UNDECIDED)


class TickProof:
    """The proof of a tick.

    Parameters
    ----------
    last : ProvenPose
        It becomes the pose of the tick where that is proven.
    there : Standing
        That pose.
    unlisted, renewable : frozenset of int
        Pairs whose contacts are not listed, and pairs that may get other rows in this tick.

    Attributes
    ----------
    doubtful : dict of int -> Answer
        If the tick does not hold: the pairs that are not proven.
    in_the_way : list of int
        Those of them that it does not hold of; not those without rows of which the way alone is not proven.
    """

    def __init__(self, last: ProvenPose, there: Standing, unlisted: frozenset[int], renewable: frozenset[int]) -> None:
        self._last, self._there = last, there
        self._unlisted, self._renewable = unlisted, renewable
        self._moves, self._deepest = last.moves, 0.0
        # What was found of pairs that were looked at on their own, and the pairs that the straight way left open.
        self._answers: dict[int, Answer] = {}
        self._left: list[int] = []
        self.doubtful: dict[int, Answer] = {}
        self.in_the_way: list[int] = []

    def steps(self, code: int | None = None) -> Generator[None, None, bool]:
        """Find out whether all pairs hold.

        Parameters
        ----------
        code : int, optional
            How `stay_clear` ended, of one who has called it for the straight way.
        """
        last, there, proof = self._last, self._there, self._last.proof
        rolling = last.rolling(there, self._unlisted)
        if not rolling:
            # Contacts stay for many ticks, and so does what opens them.
            if (yield from proof.staying_clear(there.q, last.touching, last.moves, QUICK, code)):
                last.stay_clear_to(there)
                return True
            before, self._left = proof.poses_before(), proof.not_clear()
        else:
            before = proof.last_poses()
            # Where a long way may not go in by its square, one along flat faces still may do.
            rolling = [k for k in rolling if last.may_go_in(k, there, OPENED[0])]
            yield from self._go_straight([k for k in range(len(proof.pairs)) if k not in rolling], QUICK)
            self._left = [*self._open_yet(range(len(proof.pairs)), rolling), *rolling]
        yield from self._open_contacts(rolling)
        if not (yield from self._get_rows()):
            yield from self._roll(self._open_yet(self._left), OPENED[0])
            clear = yield from self._clear_at(self._open_yet(self._left), self._moves)
            for part in OPENED[1:]:
                yield from self._roll(self._open_yet(clear), part)
            # What is much, and not deep: it takes more where bodies touch, which are opened in less.
            yield from self._go_straight(self._open_yet(clear), BUDGET)
            self.doubtful = last.not_known(self._answers, there)
            self.in_the_way = list(self.doubtful)
        if self.doubtful:
            proof.go_back(before)
            return False
        last.go_to(there, self._moves, self._answers, self._deepest)
        yield from self._close_wires()
        return True

    def _pause(self) -> Generator[None, None, None]:
        """Yield if the time is over."""
        _, end = self._last.proof.until
        if end and perf_counter_ns() > end:
            yield

    def _open_yet(self, which: Sequence[int], but: Sequence[int] = ()) -> list[int]:
        """Which of some pairs are not proven yet; not some others."""
        return [k for k in which if k not in but and not is_proven(self._answers.get(k, UNKNOWN))]

    def _go_straight(self, which: Sequence[int], budget: int) -> Generator[None, None, None]:
        """Look at the straight way of some pairs, within a budget of pairs of nodes."""
        if which:
            looks = self._last.proof.looking(
                self._there.q, self._last.touching, self._moves, which, swept=True, budget=budget
            )
            self._answers.update(zip(which, (yield from looks), strict=True))

    def _open_contacts(self, rolling: Sequence[int]) -> Generator[None, None, None]:
        """Find what opens the contacts of the pairs that are left, and look at their straight way once more."""
        self._moves = self._moves.copy()
        for k in self._left:
            self._moves[k] = self._opening(k)
            yield from self._pause()
        others = [k for k in self._left if k not in rolling]
        yield from self._go_straight([k for k in others if (self._moves[k] != self._last.moves[k]).any()], QUICK)

    def _opening(self, k: int) -> Array:
        """The move (6) that opens pair k at the pose of the tick."""
        proof, touching = self._last.proof, self._last.touching
        if k not in self._unlisted:
            return self._there.opened(proof, k, touching)
        off = off_contacts(proof, k, self._there.q, touching, nothing_known)
        return np.zeros(6) if off is None else off

    def _get_rows(self) -> Generator[None, None, bool]:
        """Whether the tick is refused because of pairs that have no rows, or that may get others.

        Of the latter only if they are not clear at its pose. What would take long to prove is not tried before.
        """
        asked = [k for k in self._open_yet(self._left) if k in self._unlisted | self._renewable]
        if not asked:
            return False
        looks = self._last.judge.looking(self._there.q, self._last.touching, self._moves, which=asked, budget=QUICK)
        found = yield from looks
        self.in_the_way = [k for k, answer in zip(asked, found, strict=True) if answer.part < 1.0]
        refused = [k for k in asked if k in self._unlisted or k in self.in_the_way]
        self.doubtful = {k: self._answers.get(k, UNKNOWN) for k in refused}
        return bool(refused)

    def _roll(self, which: Sequence[int], part: float) -> Generator[None, None, None]:
        """Look at those of some pairs that may go in by a part of what the way does, opened on the way by as much."""
        last, there, proof, touching = self._last, self._there, self._last.proof, self._last.touching
        which = [k for k in which if last.may_go_in(k, there, part)]
        if not which:
            return
        before, after = last.moves.copy(), self._moves.copy()
        for k in which:
            depth = last.roll_depth(k, there, part)
            self._deepest = max(self._deepest, depth)
            for standing, opened in ((last.at, before), (there, after)):
                move = standing.opened(proof, k, depth)
                if move.any():
                    opened[k] = move
                yield from self._pause()
        known = yield from self._clear_at(which, after)
        answers: dict[int, Answer] = {}
        # Where the way is not known, a pose at its end that is clear is none that was come to.
        for q, moves in ((last.at.q, before), (there.q, after), (there.q, self._moves)):
            found = yield from proof.looking(q, touching, moves, which=known, swept=True)
            answers = {k: answer for k, answer in zip(known, found, strict=True) if is_proven(answer)}
            known = list(answers)
        self._answers |= dict.fromkeys(which, UNKNOWN) | answers

    def _clear_at(self, which: Sequence[int], moves: Array) -> Generator[None, None, list[int]]:
        """Those of some pairs that are clear at the pose of the tick after moves (pairs, 6)."""
        if not which:
            return []
        q, touching = self._there.q, self._last.touching
        found = yield from self._last.judge.looking(q, touching, moves, which=which)
        answers = dict(zip(which, found, strict=True))
        clear = [k for k in which if is_proven(answers[k])]
        self._answers |= {k: answers[k] for k in which if k not in clear}
        return clear

    def _close_wires(self) -> Generator[None, None, None]:
        """Go on without moves that open pairs of wires, where these are proven to touch without."""
        last, proof, moves = self._last, self._last.proof, self._last.moves
        which = [k for k in self._left if moves[k].any() and proof.is_of_wires(k)]
        if not which:
            return
        closed = moves.copy()
        closed[which] = 0.0
        answers = yield from proof.looking(self._there.q, last.touching, closed, which=which)
        for k, answer in zip(which, answers, strict=True):
            if is_proven(answer):
                moves[k] = 0.0
            else:
                yield from proof.looking(self._there.q, last.touching, moves, which=[k])
        last.note_opened()
