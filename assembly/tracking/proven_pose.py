"""The last pose of a tracker that is proven, and what the straight way from there to another one may go in by."""

from __future__ import annotations

from collections.abc import Set as AbstractSet
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.corners import body_of
from assembly.constraints.packing.manager import is_of_surfaces
from assembly.proximity.clearance.answers import Answer, Verdict, is_proven
from assembly.proximity.clearance.conforming import conforms
from assembly.proximity.clearance.kept_looks import Until
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.solve.clearance_proof import new_proof
from assembly.solve.solution import Solution
from assembly.tracking.standing import Standing

__all__ = ["BUDGET", "QUICK", "ProvenPose", "WayLimits"]

Array = NDArray[np.float64]
# Pairs of nodes that a tick looks at for a pair of bodies: at first, where faces that come to touch have to be opened
# if it takes more, and then.
QUICK, BUDGET = 500, 4000
# How deep the way of a contact that rolls may go in, in parts of the square of its length over the least radius: a
# chord of a curve of radius r is s^2 / (8 r) off it, there are two, and a contact may go farther than the bodies.
ROLLED = 1.0
# The part of what is called touching that such a way may go in without being opened.
SLIGHTLY = 0.1
# It may go in by so much of the size in any case: directions that part bodies are then found at once.
ROOM = 1e-6


class WayLimits(NamedTuple):
    """Limits of what is proven of ways of bodies that touch.

    Attributes
    ----------
    sampled : float
        How far bodies whose faces lie on each other may move in one way, in parts of their size.
    depth : float
        How deep a way may go in, in the unit of the scene.
    of_pushed : bool
        Whether `depth` limits ways of the pairs in `ProvenPose.pushed` as well.
    """

    sampled: float = np.inf
    depth: float = np.inf
    of_pushed: bool = True


class ProvenPose:
    """The last pose that is proven, from which proofs of ticks go on.

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
    proof, touching, limits
    at : Standing
        The pose.
    moves : (pairs, 6)
        What opens contacts of every pair there.
    opened : list of int
        The pairs that these open.
    proved : bool
        Whether all pairs were proven clear, or touching; else faces lie on each other.
    way_depth : float
        The largest overlap of bodies on the way to it.
    pushed : frozenset of int
        Pairs that contacts hold together, for `limits.of_pushed`.
    """

    def __init__(self, first: Solution, touching: float, proof: ClearanceProof | None, limits: WayLimits) -> None:
        self.touching, self.limits = touching, limits
        if proof is None:
            proof = new_proof(first._packed, first._scene.bodies)
            proof.fronts.counts.budget = BUDGET
        proof.forget_poses()
        # Wires are in each other by the distance of their spines, which no move has to open.
        self._slimmer = 0.0 if limits.of_pushed and limits.depth < np.inf else touching
        proof.make_slimmer(self._slimmer)
        self.proof, self._has_wires = proof, proof.has_wires
        self._judge: ClearanceProof | None = None
        pairs = first._packed.kept_pairs[: len(proof.pairs)]
        self._of_features = {k for k, pair in enumerate(pairs) if not is_of_surfaces(pair)}
        # A proof may have a pair the other way round.
        firsts = [first._scene.index(body_of(side)) for side, _ in pairs]
        self._turned = {k for k, one in enumerate(firsts) if one != proof.pairs[k][0]}
        self.at = Standing(first._scene, first._packed, first._state)
        self.moves, self.opened = np.zeros((len(proof.pairs), 6)), list[int]()
        self.proved, self.way_depth = True, 0.0
        self.pushed = frozenset[int]()

    @property
    def judge(self) -> ClearanceProof:
        """A second proof, which tells of poses alone: the first one goes on from the last pose."""
        if self._judge is None:
            self._judge = new_proof(self.at.packed, self.at.scene.bodies)
            self._judge.make_slimmer(self._slimmer)
            self._judge.fronts.counts.budget = self.proof.fronts.counts.budget
            self._judge.until = self.proof.until
        return self._judge

    def take_time(self, until: Until) -> None:
        """Have looks of both proofs end when a time is over, those as well that go on."""
        self.proof.until = until
        if self._judge is not None:
            self._judge.until = until

    def look_first(self) -> dict[int, Answer]:
        """Look at the pose with which the tracker begins; the pairs that are not known to be clear there."""
        proof, q, touching = self.proof, self.at.q, self.touching
        answers = dict(enumerate(proof.look(q, touching)))
        left = [k for k, answer in answers.items() if not is_proven(answer)]
        for k in left:
            self.moves[k] = self.at.opened(proof, k, touching)
        if left:
            answers.update(zip(left, proof.look(q, touching, self.moves, which=left), strict=True))
            self.note_opened()
        self.proved = all(map(is_proven, answers.values()))
        return self.not_known(answers, self.at)

    def stay_clear_to(self, there: Standing) -> None:
        """Go on from a pose to which all pairs stayed clear, with what opens them."""
        # Of others the straight way goes in by nothing.
        self.at, self.proved, self.way_depth = there, True, self.proof.way_depth() if self._has_wires else 0.0

    def go_to(self, there: Standing, moves: Array, answers: dict[int, Answer], deepest: float) -> None:
        """Go on from another pose, with other moves (pairs, 6), by what was found of pairs that did not stay clear."""
        self.at, self.moves[:] = there, moves
        self.proved = all(map(is_proven, answers.values()))
        self.way_depth = max(deepest, self.proof.way_depth())
        self.note_opened()

    def note_opened(self) -> None:
        """Note which pairs the moves open."""
        self.opened = np.flatnonzero(self.moves.any(axis=1)).tolist()

    def not_known(self, answers: dict[int, Answer], there: Standing) -> dict[int, Answer]:
        """The pairs that are not proven to be clear, or to touch, and whose faces do not lie on each other."""
        return {
            k: answer
            for k, answer in answers.items()
            if not is_proven(answer)
            and not (
                answer.verdict is Verdict.UNDECIDED
                and conforms(self.proof, k, there.q, self.touching)
                and self._way_length(k, there) <= self.limits.sampled * self.proof.size(k)
            )
        }

    def rolling(self, there: Standing, unlisted: AbstractSet[int]) -> list[int]:
        """The pairs that touch and go so far that the straight way goes in by what counts beside what is touching.

        Not those whose contacts are not listed.
        """
        found = []
        for k in self.opened:
            if k in unlisted:
                continue
            way = self._way_length(k, there)
            most = SLIGHTLY * self.touching / ROLLED
            if way * way > most * self.proof.radius(k) and self._turns(k, there, most / way):
                found.append(k)
        return found

    def _way_length(self, k: int, there: Standing) -> float:
        return there.way_length(self.proof, k, self.at.q)

    def _turns(self, k: int, there: Standing, angle: float) -> bool:
        """Whether normals of pair k may turn by more than an angle on the way to a pose, as either body sees them.

        Along flat faces, and on them, they do not turn, and no way goes in. It is not known where contacts come and go,
        and of surfaces, whose normals are not kept.
        """
        before, after = self.at.listed, there.listed
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
        (first, _), (second, _) = (standing.relative(self.proof, k) for standing in (self.at, there))
        if k in self._turned:
            first, second = first.T, second.T
        return bool(((turned > angle) & (np.abs(other @ second - one @ first).max(axis=1) > angle)).any())

    def may_go_in(self, k: int, there: Standing, part: float) -> bool:
        """Whether pair k may go in by a part of what it may if it touches all along."""
        if k in self.pushed and not self.limits.of_pushed:
            return True
        return self.limits.depth == np.inf or self.roll_depth(k, there, part) <= self.limits.depth

    def roll_depth(self, k: int, there: Standing, part: float) -> float:
        """A part of what the way of pair k may go in if it touches all along."""
        way = self._way_length(k, there)
        return max(part * ROLLED * way * way / self.proof.radius(k), ROOM * self.proof.size(k))
