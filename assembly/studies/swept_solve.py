"""A solve from a solution with its way: it ends where something is in the way.

Everything that may change between solves, driven values, offsets, limits and targets, goes along a line from the values
of the start to the present ones. At parts of this way the scene is solved, each time from the last pose to which the
way is proven, and the straight way of bodies between the two is proven (`docs/certified.md`). That is the motion of the
mechanism as long as the two hardly differ in the middle. If anything fails, the step is halved, and the way ends when
it is too short to be halved.
"""

from __future__ import annotations

from collections.abc import Iterable
from copy import copy
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.asked import asked_between, asked_change
from assembly.constraints.packing.earlier import is_same_scene
from assembly.errors import InputError
from assembly.proximity.clearance.answers import Answer, Verdict
from assembly.proximity.clearance.proof import LEAST_SIZE, ClearanceProof
from assembly.solve.clearance_proof import can_prove, lent_proof
from assembly.solve.interruption import Interruption
from assembly.solve.loop.settings import OUT_OF_TIME
from assembly.solve.near_contacts import near_contacts
from assembly.solve.options import Options
from assembly.solve.scene import Status
from assembly.solve.solution import Solution
from assembly.solve.way import Way
from assembly.studies.obstacles import Obstacles
from assembly.studies.seen_poses import SeenPoses
from assembly.tracking.clear_ticks import ClearTicks
from assembly.tracking.proven_pose import WayLimits

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["swept_solve"]

Array = NDArray[np.float64]
# No requested value and no counted angle changes by more in one step: radians, parts of the size.
LONGEST = 0.25
# The way is known to this part of it, and of its longest step.
SHORTEST, LEAST_HALVED = 2.0**-20, 2.0**-10
# In the middle of a step points of a body, seen from another one, are off its straight way by no more, in parts of the
# size.
STRAIGHT = 1e-4
# Bodies whose faces lie on each other move no farther in one step, in parts of their size: nothing is proven in
# between.
SAMPLED_WAY = 5e-2
# Contacts that are open by less, in parts of the size, tell where a body is in the way.
NEAR = 1e-2


# Iterations of each solve on the way: after a short step rows hold after a few.
ITERATIONS = 30
# Parts of the way beyond its end at which obstacles are searched.
BEYOND = (2.0**-10, 2.0**-7, 2.0**-4)
UNKNOWN = np.full(3, np.nan)


class _Hindrance(NamedTuple):
    """Why a step is not taken.

    Attributes
    ----------
    reason : str
    pairs : dict of int -> Answer, optional
        The pairs of bodies that are in the way, and what is proven of them; None where that is not known yet.
    """

    reason: str
    pairs: dict[int, Answer] | None = None


def swept_solve(
    scene: Assembly, start: object, starts: object, options: dict[str, Any], interruption: Interruption
) -> Solution:
    """See `Assembly.solve`."""
    begin = perf_counter()
    if starts is not None:
        raise InputError(f"starts is {starts!r} with swept=True; expected None, contacts go on from q0")
    if not isinstance(start, Solution):
        raise InputError(f"q0 is {type(start).__name__!r} with swept=True; expected a Solution, where the way begins")
    start._list_contacts()
    packed = scene.packed()
    if not is_same_scene(start._ended.packed, packed):
        # What its way begins with, proofs and what was asked for, is of that scene.
        raise InputError("q0 is a solution of another assembly with swept=True, or before a change; expected its own")
    if not (start.success or start.way is not None):
        raise InputError(f"q0 is {start.status.name} with swept=True; expected a solution at which constraints hold")
    if not packed.keeps_apart:
        raise InputError("swept is True where no clearance keeps bodies apart; expected one, asm.Clearance()")
    if not can_prove(packed):
        low, high = LEAST_SIZE, 1.0 / LEAST_SIZE
        raise InputError(f"swept is True in a scene of size {packed.scale:g}; expected {low:g} to {high:g}")
    direct = scene._from_start(start, None, options, interruption)
    asked = packed.asked
    try:
        with lent_proof(packed, scene.bodies) as proof:
            solution = _Walk(scene, start, direct, proof, options, interruption).end()
    finally:
        packed.ask_for(asked)
    solution.seconds = perf_counter() - begin
    return solution


class _Walk:
    """The steps from a start to what is asked for."""

    def __init__(
        self,
        scene: Assembly,
        start: Solution,
        direct: Solution,
        proof: ClearanceProof,
        options: dict[str, Any],
        interruption: Interruption,
    ) -> None:
        self._scene, self._packed, self._direct, self._proof = scene, direct._packed, direct, proof
        most = min(Options.of(options).max_iterations, ITERATIONS)
        self._options, self._interruption = {**options, "max_iterations": most}, interruption
        self._start, self._asked = start, direct._asked
        self._ticks = self._ticks_from(start)
        if self._ticks.doubtful:
            named = self._named(self._ticks.doubtful)
            raise InputError(f"q0 is a solution with swept=True at which {named} are not clear; expected a clear one")
        self._is_proven, self._depth = self._ticks.proved, 0.0
        self._seen = SeenPoses(proof)

    def _ticks_from(self, at: Solution) -> ClearTicks:
        """The proof of ways, from a solution on."""
        touching = self._direct._touching * self._packed.scale
        return ClearTicks(at, touching, self._proof, WayLimits(SAMPLED_WAY, self._allowed))

    def end(self) -> Solution:
        """The solution for the present values, or the last one on the way there."""
        done, at = 0.0, self._start
        step = longest = self._longest_step()
        there = self._solved(at, step)
        while True:
            middle = self._solved(at, done + 0.5 * step)
            found = self._hindrance(at, middle, there)
            if self._interruption.is_over():
                return self._ended(self._interruption.status(OUT_OF_TIME), at, done, None)
            if found is None:
                done, at = done + step, there
                if done == 1.0:
                    return self._ended(at.status, at, done, None)
                # Parts are multiples of powers of two, and so 1 is reached exactly.
                if 2.0 * step <= longest and done % (2.0 * step) == 0.0:
                    step *= 2.0
                there = self._solved(at, done + step)
            elif step <= min(SHORTEST, LEAST_HALVED * longest):
                return self._ended(Status.BLOCKED, at, done, found)
            else:
                step, there = 0.5 * step, middle

    def _longest_step(self) -> float:
        """A power of two: in steps of it no requested value changes by more than is allowed."""
        change = asked_change(self._start._asked, self._asked, self._packed.asked_units)
        return float(2.0 ** np.floor(np.log2(LONGEST / change))) if change > LONGEST else 1.0

    def _solved(self, at: Solution, part: float) -> Solution:
        """The solution at a part of the way, from an earlier one; at its end the direct one, if it is the same."""
        if part == 1.0 and at is self._start:
            return self._direct
        asked = self._asked if part == 1.0 else asked_between(self._start._asked, self._asked, part)
        self._packed.ask_for(asked)
        solution = self._scene._from_start(at, None, self._options, self._interruption)
        is_direct = part == 1.0 and self._direct.success and solution.success
        return self._direct if is_direct and self._seen.apart(self._direct.q, solution.q) <= self._allowed else solution

    @property
    def _allowed(self) -> float:
        return STRAIGHT * self._packed.scale

    def _hindrance(self, at: Solution, middle: Solution, there: Solution) -> _Hindrance | None:
        """Why the way from one solution to another is not known to be clear; None where it is."""
        if not there.success:
            return _Hindrance(f"a solve beyond is {there.status.name}")
        # States that were packed with more places for contacts have their angles elsewhere.
        turned = there._state[there._packed.angles] - at._state[at._packed.angles]
        if not middle.success or np.abs(turned).max(initial=0.0) > LONGEST:
            return _Hindrance("constraints do not hold all along")
        off = self._seen.bend(at.q, middle.q, there.q)
        if off > self._allowed:
            return _Hindrance("the pose jumps", {})
        for k in np.flatnonzero(self._proof.fronts.pair.known != 1.0).tolist():
            if self._proof.way_length(k, at.q, there.q) > SAMPLED_WAY * self._proof.size(k):
                return _Hindrance("", {k: Answer(Verdict.UNDECIDED)})
        if not self._ticks.holds(there):
            return _Hindrance("", self._ticks.doubtful)
        self._is_proven = self._is_proven and self._ticks.proved
        self._depth = max(self._depth, self._ticks.way_depth, off)
        return None

    def _in_the_way(self, at: Solution, done: float) -> dict[int, Answer]:
        """The pairs of bodies that are in the way, and what is proven of them a little beyond."""
        obstacles = Obstacles(
            self._scene, at, self._proof, lambda: self._ticks_from(at), self._options, self._interruption
        )
        for beyond in BEYOND:
            self._packed.ask_for(asked_between(self._start._asked, self._asked, min(1.0, done + beyond)))
            pairs = obstacles.found()
            if pairs:
                return pairs
        return {}

    def _place(self, k: int, answer: Answer, at: Solution) -> Array:
        """Where a pair meets: at a contact that is nearly closed, or else where a crossing was found."""
        contacts = near_contacts(at, self._proof, NEAR * self._packed.scale).get(k)
        return answer.place if contacts is None else contacts.places[int(np.argmin(contacts.gaps))]

    def _names(self, pairs: Iterable[int]) -> tuple[tuple[str, str], ...]:
        bodies = self._scene.bodies
        return tuple((bodies[a].name, bodies[b].name) for a, b in (sorted(self._proof.pairs[k]) for k in pairs))

    def _named(self, pairs: Iterable[int]) -> str:
        return ", ".join(f"{a} and {b}" for a, b in self._names(pairs))

    def _ended(self, status: Status, at: Solution, part: float, found: _Hindrance | None) -> Solution:
        """A solution with what is known of the way to it."""
        # The start stays what it is.
        solution = copy(at) if status is not at.status or at is self._start else at
        solution.status = status
        solution._is_sampled = not self._is_proven
        if found is None:
            solution.way = Way(part, self._depth, (), UNKNOWN, "")
            return solution
        pairs = self._in_the_way(at, part) if found.pairs is None else found.pairs
        if not pairs:
            solution.way = Way(part, self._depth, (), UNKNOWN, found.reason)
            return solution
        first = next(iter(pairs))
        place = self._place(first, pairs[first], at)
        near = "" if np.isnan(place).any() else f" near ({', '.join(f'{value:.4g}' for value in place)})"
        reason = f"{self._named(pairs)} in each other's way{near}"
        solution.way = Way(part, self._depth, self._names(pairs), place, reason)
        return solution
