"""How one solve is made of attempts: from its start, with more slots or rows if needed, and from other starts.

What is here is told apart by what is in the scene: corners of contacts, clearances, nearest axes, objectives.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from time import perf_counter
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.constraints.packing.corners import corners_of
from assembly.constraints.packing.scene import MOST_CROWDING, Packed
from assembly.packed_contents import PackedContents
from assembly.solve.attempts.attempts import attempt, load
from assembly.solve.attempts.postures import postures_from
from assembly.solve.interruption import Interruption
from assembly.solve.loop.settings import (
    ALLOWED_OVERLAP,
    GATHER,
    ITERATIONS,
    NEVER,
    PLACES,
    STRAYS,
)
from assembly.solve.scene import Status
from assembly.solve.scene_settings import scene_settings
from assembly.solve.solution import Solution

if TYPE_CHECKING:
    from assembly.assembly import Assembly
    from assembly.studies.resting import Rest

__all__ = ["Solving"]

Array = NDArray[np.float64]
# How a solve may end where solids come to lie on each other, and corners are not listed.
AT_KINKS = (Status.STALLED, Status.ITERATION_LIMIT, Status.INFEASIBLE, Status.CONTACT_LOST)


class Solving(PackedContents):
    """The solves that `Assembly.solve` is made of; see `Assembly`."""

    @property
    def _scene_itself(self) -> Assembly:
        """The assembly that this is of: nothing else is made from this class."""
        return cast("Assembly", self)

    def _tried_otherwise(
        self,
        solution: Solution,
        q0: ArrayLike | Solution | None,
        starts: Mapping[str, ArrayLike] | None,
        swept: bool,
        options: dict[str, Any],
        interruption: Interruption,
    ) -> Solution:
        """Try a failed solve again, with other axes or from other starts, where that may help."""
        if self._stays_near:
            return solution
        if solution.axes and not isinstance(q0, Solution) and not swept:
            from assembly.studies.nearest_axes import with_axes_of_the_rest

            solution = with_axes_of_the_rest(
                self._scene_itself, solution, self._given(q0), starts, options, interruption
            )
            if solution.success:
                return solution
        from assembly.studies.restarts import may_hold_elsewhere, restarted

        if may_hold_elsewhere(solution) and not interruption.is_over():
            given = q0 if isinstance(q0, Solution) else self._given(q0)
            settings = self._settings(options, interruption, warm=False)
            solution = restarted(self._scene_itself, solution, settings, given, interruption)
        return solution

    def _settings(self, options: dict[str, Any], interruption: Interruption, warm: bool) -> Array:
        """Settings of the loop."""
        settings = scene_settings(options, interruption, bool(self._objectives), warm)
        if options.get("keep_topology") and self.packed().keeps_apart:
            settings = settings.copy()
            settings[GATHER] = NEVER
        return settings

    def _from_start(
        self,
        q0: ArrayLike | Solution | None,
        starts: Mapping[str, ArrayLike] | None,
        options: dict[str, Any],
        interruption: Interruption,
    ) -> Solution:
        """A solve from this start only."""
        self._take_seats(q0, starts)
        settings = self._settings(options, interruption, isinstance(q0, Solution))
        solution = self._solved_or_standing(q0, settings, starts, options, interruption)
        # Asked of every solve: what a callback or a signal's handler raised is raised there.
        is_over = interruption.is_over()
        if solution.status in AT_KINKS and not self._corners and settings[ITERATIONS] > 0.0 and not is_over:
            return self._at_corners(solution, partial(self._from_start, q0, starts, options, interruption))
        return solution

    def _solved_or_standing(
        self,
        q0: ArrayLike | Solution | None,
        settings: Array,
        starts: Mapping[str, ArrayLike] | None,
        options: dict[str, Any],
        interruption: Interruption,
    ) -> Solution:
        """The same, without corners of contacts."""
        if not self.packed().keeps_apart or settings[ITERATIONS] == 0.0:
            return self._solved(settings, q0, starts, interruption)
        rest: Rest | None = None
        if isinstance(q0, Solution) and q0._rest is not None and self._objectives:
            from assembly.studies.resting import rests_again

            # Bodies that rest on joints do so still, as long as these push.
            found = rests_again(self._scene_itself, q0, settings, starts, interruption)
            if isinstance(found, Solution):
                return found
            rest = found
        if isinstance(q0, Solution) and (not self._objectives or not _is_pushed(q0)):
            from assembly.studies.unhindered import unhindered

            # If no clearance pushes, the other rows alone determine the solution.
            solution = unhindered(self._scene_itself, q0, settings, starts, interruption)
            if solution is not None:
                return solution
        if not self._objectives and not (isinstance(q0, Solution) and q0._lists is None):
            from assembly.studies.standing_start import standing_start

            # Nothing requires a move: if all holds at the start, that is the solution.
            solution = standing_start(self._scene_itself, q0, settings, starts, interruption)
            if solution is not None:
                return solution
        has_other_joint_rows = isinstance(q0, Solution) and self._handed_over(self.packed(), q0) is not None
        if isinstance(q0, Solution) and not has_other_joint_rows:
            return self._solved_beside(q0, rest, settings, starts, options, interruption)
        from assembly.studies.first_solve import first_solve

        # A coordinate that becomes driven may have far to go, as from poses.
        poses = q0.q if isinstance(q0, Solution) else self._given(q0)
        return first_solve(self._scene_itself, poses, settings, starts, options, interruption)

    def _solved_beside(
        self,
        last: Solution,
        rest: Rest | None,
        settings: Array,
        starts: Mapping[str, ArrayLike] | None,
        options: dict[str, Any],
        interruption: Interruption,
    ) -> Solution:
        """A solve from the last solution; where that fails, joints keep bodies that rest beside what is in the way."""
        solution = self._solved(settings, last, starts, interruption)
        if solution.success or rest is None:
            return solution
        from assembly.studies.resting import beside_others

        first, poses = self._settings(options, interruption, warm=False), last.q.copy()
        return beside_others(self._scene_itself, rest, poses, poses, first, starts, interruption) or solution

    def _at_corners(self, ended: Solution, again: Callable[[], Solution]) -> Solution:
        """A solve that begins again with the corners of contacts of solids listed; the earlier end if it fails.

        Solids that come to lie on each other touch at several corners, and the gap of their contact has a kink there.
        """
        packed = self._packed
        assert packed is not None
        if not corners_of(packed.contacts, packed.whole, packed.clearances, packed.clearance_pairs):
            return ended
        scene, self._corners = self._scene, True
        self._pack(packed)
        solution = again()
        if not solution.success:
            # The packing without corners is restored: their rows cost time.
            self._packed, self._scene, self._corners = packed, scene, False
            return ended
        solution.seconds += ended.seconds
        return solution

    def _turns_of(self, packed: Packed) -> Array | None:
        """Values near which the angles of a packed scene start; None where nothing is known of them."""
        if not self._turns_near:
            return None
        return np.array([self._turns_near.get(angle, 0.0) for angle in packed._angles])

    def _solved(
        self,
        settings: Array,
        q0: ArrayLike | Solution | None,
        starts: Mapping[str, ArrayLike] | None,
        interruption: Interruption,
        reference: Array | None = None,
        turns: Array | None = None,
        judges: bool = True,
        contacts: Array | None = None,
    ) -> Solution:
        """A solve from q0, with as many slots for contacts of clearances as it needs.

        Postures are measured from q0, or from a reference (n, 7). `turns` are values near which angles start, which
        determine their revolution counts. An intermediate solve needs no proof: then only the loop judges its end.
        `contacts` are the pairs of the given ones at q0 as a state has them, where these are known.
        """
        spent = 0.0
        if isinstance(q0, Solution):
            # It may need more slots, and another packed scene.
            q0._list_contacts()
        while True:
            packed = self.packed()
            turns = turns if not self._turns_near else self._turns_of(packed)
            may_grow = self._crowding < MOST_CROWDING and not isinstance(q0, Solution)
            if packed.clearance_rows and settings[PLACES] != may_grow:
                settings = settings.copy()
                settings[PLACES] = float(may_grow)
            start = partial(self._start, packed, q0, starts, turns, contacts)
            load(packed, start)
            begin = perf_counter()
            if reference is None:
                outcome = attempt(packed, settings, start, interruption, turns)
            else:
                with postures_from(packed, reference):
                    outcome = attempt(packed, settings, start, interruption, turns)
            spent += perf_counter() - begin
            if not (may_grow and packed.is_crowded(outcome.state)) or interruption.is_over():
                assert self._scene is not None
                code, state, history, order, fit = outcome
                status = Status.FITTED if fit is not None and fit.apart is not None else interruption.status(code)
                if status is not Status.SOLVED and self._objectives:
                    from assembly.solve.diagnosis.unbounded import Asked, has_strayed, status_of

                    constraints = tuple(item for item in self._constraints if item._is_asked)
                    asked = Asked(self.bodies, constraints, self._objectives)
                    status = status_of(status, asked, packed, settings, start, state, interruption)
                    ended_early = status is Status.ITERATION_LIMIT and has_strayed(packed, settings, state)
                    if ended_early and not interruption.is_over():
                        # It comes back, perhaps.
                        settings = settings.copy()
                        settings[STRAYS] = 0.0
                        continue
                solution = Solution(self._scene, packed, state, status, spent, history, order, fit)
                solution._touching = float(settings[ALLOWED_OVERLAP])
                if packed.keeps_apart and judges:
                    from assembly.solve.clearance_proof import judge_end

                    judge_end(solution, settings, interruption)
                return solution
            self._pack_with_more_places()


def _is_pushed(solution: Solution) -> bool:
    """Whether a contact of a clearance pushes at a solution.

    Where contacts were not even listed none does, unless bodies rest there.
    """
    if solution._lists is not None:
        return solution._rest is not None
    packed, state = solution._ended
    first = packed.multipliers_at + len(packed.contacts)
    return bool(state[first : first + packed.clearance_rows].any())
