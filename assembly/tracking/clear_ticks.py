"""Proofs of clearances in ticks: bodies are clear or touch at the poses, and on the way to them."""

from __future__ import annotations

from collections.abc import Generator

from assembly.proximity.clearance.answers import Answer
from assembly.proximity.clearance.kept_looks import NEVER, Until, run_through
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.proximity.clearance.records import CLEAR
from assembly.solve.solution import Solution
from assembly.tracking.proven_pose import ProvenPose, WayLimits
from assembly.tracking.standing import Standing
from assembly.tracking.tick_proof import TickProof

__all__ = ["ClearTicks"]


class ClearTicks:
    """The proofs of the pairs that a tracker's clearances keep apart, from tick to tick.

    The pose of a tick is proven up to `touching`. On the straight way between two ticks bodies that touch overlap by an
    amount that is quadratic in its length. What is proven is the way of bodies that are moved apart by that amount at
    the last pose, and moved back at this one.

    Parameters
    ----------
    first, touching, proof, limits
        As of `ProvenPose`.

    Attributes
    ----------
    last : ProvenPose
        That of the last tick that holds.
    doubtful : dict of int -> Answer
        If the last tick does not hold, or the first one: the pairs that are not proven.
    in_the_way : list of int
        The pairs that the last tick does not hold of; not those without rows of which the way alone is not proven.
    unlisted : frozenset of int
        Pairs whose contacts are not listed: what opens them is recognized from their faces.
    renewable : frozenset of int
        Pairs which may get other rows in this tick.
    """

    def __init__(
        self,
        first: Solution,
        touching: float,
        proof: ClearanceProof | None = None,
        limits: WayLimits | None = None,
    ) -> None:
        self.last = ProvenPose(first, touching, proof, limits or WayLimits())
        self.unlisted, self.renewable = frozenset[int](), frozenset[int]()
        self.doubtful: dict[int, Answer] = self.last.look_first()
        self.in_the_way: list[int] = []
        # The proof of a tick that is going on where its time was over.
        self._going: Generator[None, None, bool] | None = None

    @property
    def proved(self) -> bool:
        """Whether all pairs were proven at the last tick that holds; else faces lie on each other."""
        return self.last.proved

    @property
    def way_depth(self) -> float:
        """The largest overlap of bodies on the way to it."""
        return self.last.way_depth

    @property
    def goes_on(self) -> bool:
        """Whether the time of the last tick was over before it was known whether its pose holds."""
        return self._going is not None

    @property
    def begins_straight(self) -> bool:
        """Whether a tick's proof begins with the straight way, wherever it leads: no pair touches that may roll."""
        return self.unlisted.issuperset(self.last.opened)

    def holds(self, solution: Solution) -> bool:
        """Whether all pairs hold at the pose of a tick, and on the way there from the last one that did.

        The solution is of a state that nobody writes to. It takes what time it takes.
        """
        there = Standing(solution._scene, solution._packed, solution._state)
        return run_through(self._proving(there, None))

    def hold_at(self, there: Standing, until: Until = NEVER, code: int | None = None) -> bool | None:
        """As `holds`, of the poses of a tick; None where that is not known when the time is over.

        Then `go_on` goes on with what is not known.

        Parameters
        ----------
        there : Standing
        until : (int, int)
            The address of a clock, and the nanoseconds at which the time is over; (0, 0) for never.
        code : int, optional
            How `stay_clear` ended, of one who has called it where `begins_straight`.
        """
        if code == CLEAR:
            self.doubtful, self.in_the_way = {}, []
            self.last.stay_clear_to(there)
            return True
        self._going = self._proving(there, code)
        return self.go_on(until)

    def go_on(self, until: Until = NEVER) -> bool | None:
        """Go on with what was not known when the time was over; see `hold_at`.

        It makes progress that lasts, however little time it has.
        """
        assert self._going is not None
        self.last.take_time(until)
        try:
            next(self._going)
        except StopIteration as end:
            self._going = None
            return bool(end.value)
        finally:
            self.last.take_time(NEVER)
        return None

    def _proving(self, there: Standing, code: int | None) -> Generator[None, None, bool]:
        """The steps of a tick's proof, at the end of which it is known what does not hold."""
        tick = TickProof(self.last, there, self.unlisted, self.renewable)
        holds = yield from tick.steps(code)
        self.doubtful, self.in_the_way = tick.doubtful, tick.in_the_way
        return holds
