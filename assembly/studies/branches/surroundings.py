"""What clearances keep apart along a branch: contacts that are near, their gaps, and proofs of poses and of ways.

On a branch only the contacts that hold are rows of its equations. All others are listed by the contact manager at each
point, and their gaps are functions along the next step: where one closes, something happens. What is not listed is
proven not to touch, as for a tick of a tracker: a step whose way is not proven is made shorter, until what is in its
way is listed or the step is too short.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.scene import MOST_CROWDING, Packed
from assembly.proximity.clearance.answers import Answer, Verdict
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.solve.attempts.attempts import with_listed
from assembly.solve.clearance_proof import new_proof, owned_pairs, prove_end
from assembly.solve.interruption import CTRL_C
from assembly.solve.options import Options
from assembly.solve.scene import Status
from assembly.solve.solution import Solution
from assembly.studies.branches.curve import LostError, Place
from assembly.studies.branches.slots import (
    NOBODY,
    Meeting,
    copy_slots,
    ended_slots,
    gaps_of_slots,
    held_alone,
    meeting,
    rows_of_slots,
    wake,
)
from assembly.studies.seen_poses import SeenPoses
from assembly.tracking.clear_ticks import ClearTicks
from assembly.tracking.proven_pose import BUDGET, WayLimits

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["AT_BOUND", "CrowdedError", "Surroundings"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
# Gaps over the size that are closed.
AT_BOUND = 1e-9
# Poses of a swept branch, seen from other bodies, are off the straight ways that are proven by no more than this part
# of the size; bodies whose faces lie on each other go no farther than this part of theirs. As in swept solves.
STRAIGHT, SAMPLED_WAY = 1e-4, 5e-2


class CrowdedError(Exception):
    """More contacts are near than the scene has slots for."""


class Surroundings:
    """What is around the point of a branch from which the next step goes on.

    Parameters
    ----------
    scene : Assembly
    touching : float
        What bodies may be in each other and touch, in parts of the size.
    swept : bool
        Whether ways between points are proven along the branch; else straight ways are.

    Attributes
    ----------
    swept : bool
    proved : bool
        Whether it is proven of all places of the last step that bodies are clear or touch; else faces lie on each
        other.
    depth : float
        The largest overlap that bodies may have had on any way, in the scene's unit.
    untold : bool
        Whether the last place is one at which rows alone tell that bodies touch, as they may all along a circle.
    """

    def __init__(self, scene: Assembly, touching: float, swept: bool) -> None:
        self._scene, self._touching, self.swept = scene, touching, swept
        self._settings = CTRL_C.settings(CTRL_C.fill(Options(touching=touching).settings(warm=True)))
        self._known: object = None
        self._doubtful: dict[int, Answer] = {}
        self.proved, self.depth, self.untold = True, 0.0, False

    def begin(self, place: Place) -> bool:
        """Go on from a place with whatever its slots have; whether all is known to be clear there."""
        self._at = self._listed(place, place.state)
        is_clear = self._looks_at(self._at)
        self._doubtful = self._ticks.doubtful
        self.proved, self.untold = self._is_proven(self._at), False
        return is_clear

    @property
    def in_the_way(self) -> Meeting:
        """The first pair of bodies that was not known to be clear where a proof failed last."""
        for k, answer in self._doubtful.items():
            names = sorted(self._scene.bodies[number].name for number in self._ticks.last.proof.pairs[k])
            return Meeting(tuple(names), answer.place)
        return NOBODY

    @property
    def is_undecided(self) -> bool:
        """Whether the last proof that failed tells nothing of one pair, and all others are clear."""
        return [answer.verdict for answer in self._doubtful.values()] == [Verdict.UNDECIDED]

    def gaps(self, place: Place) -> Array:
        """By how much listed contacts are open at a place, over the size; of all rows (m,), infinite where none is.

        Raises
        ------
        LostError
            A contact ends in bodies that cross.
        """
        gaps = np.full(place.packed.rows, np.inf)
        found = gaps_of_slots(place.packed, self._at_poses(place))
        if found is None:
            raise LostError
        gaps[rows_of_slots(place.packed)] = found
        return gaps

    def anew(self, place: Place, row: int) -> tuple[float, Meeting]:
        """By how much the listed contact of a row is open at a place, over the size, once all is listed anew there.

        And which bodies meet there, and where.
        """
        there = self._listed(place, self._at_poses(place))
        gaps = gaps_of_slots(there.packed, there.state)
        gap = float("nan") if gaps is None else float(gaps[row - rows_of_slots(there.packed).start])
        return gap, meeting(there.packed, there.state, row)

    def holding(self, place: Place, rows: Flags) -> Place:
        """A place with those listed contacts alone as rows that are flagged (m,)."""
        return replace(place, state=held_alone(place.packed, self._at_poses(place), rows))

    def meeting(self, place: Place, row: int) -> Meeting:
        """Which bodies meet at the listed contact of a row, and where."""
        return meeting(place.packed, self._at_poses(place), row)

    def ended(self, place: Place, held: Flags) -> Flags:
        """Which contacts that hold (m,) have ended on the way to a place, as a corner that has left its face."""
        own = rows_of_slots(place.packed)
        rows = np.zeros(len(held), dtype=np.bool_)
        rows[own] = held[own] & ended_slots(place.packed, place.state)
        return rows

    def keeps(self, held: Flags, place: Place) -> bool:
        """Whether contacts that hold are those that are listed in their rows."""
        own = rows_of_slots(place.packed)
        listed = zip(place.packed.listed(self._at.state), place.packed.listed(place.state), strict=True)
        return all(now == before for (now, before), holds in zip(listed, held[own], strict=True) if holds)

    def goes_to(self, places: Sequence[Place]) -> bool:
        """Whether all is clear at places and on the straight ways from one to the next, from the last place on.

        The last one is then that from which the next step goes on; else it stays what it is.
        """
        at, proved, depth = self._at, True, self.depth
        for place in places:
            # Between contacts that hold bodies go around each other, and the straight way is in both.
            self._ticks.last.pushed = frozenset(pair for pair, _ in place.packed.listed(place.state) if pair >= 0)
            there = self._listed(place, self._at_poses(place))
            gaps = gaps_of_slots(there.packed, there.state)
            # A contact that was not listed where the step began may not have closed unseen.
            is_open = gaps is not None and not (gaps < -AT_BOUND).any()
            if not (is_open and self._holds(there)):
                self._doubtful = self._ticks.doubtful if is_open else {}
                if self._at is not at:
                    self._at = at
                    self._looks_at(at)
                return False
            self._at = there
            proved, depth = proved and self._is_proven(there), max(depth, self._ticks.way_depth)
        self.proved, self.depth = proved, depth
        return True

    def goes_untold(self, place: Place) -> bool:
        """Go to a place at which rows alone tell that bodies touch; whether they do."""
        there = self._listed(place, self._at_poses(place))
        gaps = gaps_of_slots(there.packed, there.state)
        if gaps is None or (gaps < -AT_BOUND).any():
            return False
        answers = prove_end(self._solution(there))
        if not all(pair.holds or pair.answer.verdict is Verdict.UNDECIDED for pair in answers):
            return False
        self._at, self.proved, self.untold = there, all(pair.proved for pair in answers), True
        return True

    def is_straight(self, before: Place, middle: Place, after: Place) -> bool:
        """Whether a pose in the middle of a step is on the straight way from its beginning to its end."""
        bend = SeenPoses(self._ticks.last.proof).bend(before.q, middle.q, after.q)
        return bend <= STRAIGHT * before.packed.scale

    def _at_poses(self, place: Place) -> Array:
        """The state with all that is listed, at the poses of a place and with the pairs of contacts there."""
        listed, packed = self._at, place.packed
        state = place.state.copy()
        if listed.packed.clearance_rows != packed.clearance_rows:
            raise LostError
        copy_slots(listed.packed, listed.state, packed, state)
        if listed.packed is packed:
            state[packed.memory_at :] = listed.state[packed.memory_at :]
        return state

    def _listed(self, place: Place, state: Array) -> Place:
        """A place with all contacts that are near listed; those that are listed keep their slots."""
        packed, state = place.packed, state.copy()
        poses = state[: packed.contacts_at].copy()
        state = with_listed(packed, CTRL_C, self._settings, state).state
        CTRL_C.is_over()
        if packed.is_crowded(state) and packed.crowding < MOST_CROWDING:
            raise CrowdedError
        state[: packed.contacts_at] = poses
        wake(packed, state)
        return replace(place, state=state)

    def _holds(self, there: Place) -> bool:
        """Whether all pairs are clear or touch at a place, and on the way there from the last one."""
        if _asked(there.packed) != self._known:
            # Faces or gaps are others there: of the way nothing can be told.
            return self._looks_at(there)
        return self._ticks.holds(self._solution(there))

    def _is_proven(self, there: Place) -> bool:
        """Whether the place to which proofs have gone is proven; of faces that lie on each other hulls may tell it.

        Not of the way there: swept branches are proven only where that is.
        """
        if self._ticks.proved or self.swept:
            return self._ticks.proved
        return all(pair.proved for pair in prove_end(self._solution(there)))

    def _looks_at(self, there: Place) -> bool:
        """Begin proofs at a place; whether all pairs are clear or touch there."""
        packed = there.packed
        limits = WayLimits(SAMPLED_WAY if self.swept else np.inf, STRAIGHT * packed.scale, of_pushed=self.swept)
        proof = self._proof(packed)
        self._ticks = ClearTicks(self._solution(there), self._touching * packed.scale, proof, limits)
        return not self._ticks.doubtful

    def _proof(self, packed: Packed) -> ClearanceProof:
        asked = _asked(packed)
        if asked == self._known:
            return self._ticks.last.proof
        self._known = asked
        proof = new_proof(packed, self._scene.bodies)
        proof.fronts.counts.budget = BUDGET
        return proof

    def _solution(self, place: Place) -> Solution:
        scene = self._scene._scene
        assert scene is not None
        return Solution(scene, place.packed, place.state, Status.SOLVED, 0.0, np.empty((0, 7)))


def _asked(packed: Packed) -> tuple[list[int], list[float]]:
    """What a proof is made of: faces of bodies, and least gaps."""
    return [id(face) for face in packed.faces], [item.minimum for item, _, _ in owned_pairs(packed)]
