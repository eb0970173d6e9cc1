"""A first solve of a scene with clearances: from the start itself, and from other arrangements of the bodies.

Rows of clearances separate bodies that overlap slightly. From a start at which bodies are stuck in each other, or
joints are far from holding, they may fail. Then a solve also begins where bodies are put together (`put_together.py`),
seated (`seated.py`), parted (`parting.py`) or separated (`separation.py`). If all of these fail, and bodies cross at
the end, it begins where that end is parted. Moves are always measured from the user's poses.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.proximity.features.solid_contact import TRACK
from assembly.solve.clearance_proof import can_prove
from assembly.solve.interruption import Interruption
from assembly.solve.loop.settings import (
    ALLOWED_OVERLAP,
    COUNT,
    GATHER,
    ITERATIONS,
    NEVER,
    OBJECTIVE,
    SOLVED,
    UNSURE,
)
from assembly.solve.scene import Status
from assembly.solve.second_order.leave import Outcome
from assembly.solve.solution import Solution
from assembly.solve.start_proof import prove_start, prove_way
from assembly.studies.held_crossing import crosses_where_held
from assembly.studies.parting import parted
from assembly.studies.put_together import PutTogether, put_together
from assembly.studies.resting import Rest, beside_others, resting, resting_start
from assembly.studies.seated import Seat, seated
from assembly.studies.separation import separated
from assembly.studies.unhindered import Prove, clear_end, rows_from_start, unhindered_at

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["first_solve"]

Array = NDArray[np.float64]
# How often an end at which bodies cross is parted: no random scene is known that a third time would help.
PARTED_ENDS = 2


def first_solve(
    scene: Assembly,
    q: Array,
    settings: Array,
    starts: Mapping[str, ArrayLike] | None,
    options: dict[str, Any],
    interruption: Interruption,
) -> Solution:
    """The solution of a scene with clearances from poses q (n, 7), with settings made of options."""
    settings = settings.copy()
    if can_prove(scene.packed()):
        # Bodies are put together without clearances only, not by the initial assembly of the loop.
        settings[GATHER] = NEVER
    return _FirstSolve(scene, q, settings, starts, options, interruption).solution()


@dataclass(frozen=True, eq=False)
class _FirstSolve:
    """The request of a first solve; see `first_solve`."""

    scene: Assembly
    q: Array
    settings: Array
    starts: Mapping[str, ArrayLike] | None
    options: dict[str, Any]
    interruption: Interruption

    def solution(self) -> Solution:
        """The solution."""
        begin = perf_counter()
        scene = self.scene
        # What rests where it starts stays, whatever rows would do without clearances.
        stays = self._resting_start()
        if stays is not None:
            return stays
        alone = rows_from_start(scene, self.q, self.settings, self.starts, self.interruption)
        prove = partial(prove_way, scene.packed(), scene.bodies, self.q)
        # Whether a start that nothing has moved holds was asked before.
        is_new = bool(scene.objectives) or alone.state[scene.packed().results_at + COUNT] > 0.0
        found = self._clear_end(alone, partial(prove, may_jump=False)) if is_new else None
        found = found or self._where_it_stands(alone)
        if found is not None:
            found.seconds = perf_counter() - begin
            return found
        held = self._crossing_where_held(alone)
        if held is not None:
            return held
        together = put_together(scene, self.q, alone, self.starts, self.options, self.interruption)
        ways: list[Solution] = []
        rest = self._resting(self.q, prove, ways) if scene.objectives else None
        if not self._is_done(ways) and together is not None and not together.keeps_topology:
            ways += self._put_together(together)
        if not self._is_done(ways) and together is not None and together.is_asked and self.scene.objectives:
            ways += self._constraints_first()
        if not self._is_done(ways) and not self.scene.objectives:
            ways += self._where_faces_fit()
        if not self._is_done(ways) and rest is not None:
            ways += self._beside_others(rest, self.q)
        if not self._is_done(ways):
            ways.append(self.scene._solved(self.settings, self.q, self.starts, self.interruption))
            # A start that holds is not moved.
            if not (ways[-1].success and (ways[-1].q == self.q).all()) and not self.interruption.is_over():
                ways += self._from_apart(ways[-1].success)
        if not self._is_done(ways) and together is not None and together.keeps_topology:
            ways += self._put_together(together)
        failed = ways[-1]
        if not self._is_done(ways) and not self.options.get("keep_topology"):
            ways += self._from_parted_end(failed)
        solution = min((way for way in ways if way.success), key=lambda way: way.objective, default=failed)
        if len(ways) > 1:
            solution.seconds = perf_counter() - begin
        return solution

    def _resting_start(self) -> Solution | None:
        """The start, if an objective presses bodies onto each other there, and they rest."""
        if not self.scene.objectives:
            return None
        return resting_start(self.scene, self.q, self.settings, self.starts, self.interruption)

    def _crossing_where_held(self, alone: Outcome) -> Solution | None:
        """The end of rows without clearances, STALLED, where bodies cross there that constraints let not part."""
        if alone.code != SOLVED:
            return None
        poses = alone.state[: self.scene.packed().contacts_at].reshape(-1, 7).copy()
        if not crosses_where_held(self.scene, poses, self.settings, self.interruption):
            return None
        settings = self.settings.copy()
        settings[ITERATIONS] = 0.0
        solution = self.scene._solved(settings, poses, self.starts, self.interruption, reference=self.q)
        solution.status = Status.STALLED
        return solution

    def _is_done(self, ways: list[Solution]) -> bool:
        """Whether one of the attempts ended at a solution, or there is no time for another one."""
        return bool(ways) and (any(way.success for way in ways) or self.interruption.is_over())

    def _from(self, poses: Array, contacts: Array | None = None) -> Solution:
        """A solve that begins at other poses than the user's, with the pairs of contacts there if they are known."""
        rest = (self.settings, poses, self.starts, self.interruption)
        return self.scene._solved(*rest, reference=self.q, contacts=contacts)

    def _clear_end(self, alone: Outcome, prove: Prove) -> Solution | None:
        """The solution where rows have ended without clearances, if it is proven that no clearance pushes there."""
        return clear_end(self.scene, alone, self.settings, prove, self.interruption)

    def _where_it_stands(self, alone: Outcome) -> Solution | None:
        """The start, if it is a minimum without clearances, and clear: rows that have not moved alone do not tell."""
        if alone.code != UNSURE or alone.state[self.scene.packed().results_at + COUNT] > 0.0:
            return None
        there = self.scene._part(False, True)._from_start(self.q, self.starts, self.options, self.interruption)
        is_minimum = there.success and bool((there.q == self.q).all())
        return self._unhindered(self.q, True) if is_minimum else None

    def _where_it_fits(self, poses: Array, contacts: Array | None = None) -> Solution:
        """A solve that begins where bodies nearly fit.

        Without an objective, if the least move from the user's poses is not found, any pose at which rows hold is
        accepted.
        """
        solution = self._from(poses, contacts)
        if solution.success or self.scene.objectives or self.interruption.is_over():
            return solution
        return self._unhindered(poses, False) or self.scene._solved(
            self.settings, poses, self.starts, self.interruption
        )

    def _resting(self, poses: Array, prove: Prove, ways: list[Solution]) -> Rest | None:
        """Add the solution where an objective draws bodies onto what they fit near poses, if there is one.

        Returns how they rest where that is not proven to be clear.
        """
        if self.interruption.is_over():
            return None
        found = resting(self.scene, poses, self.q, prove, self.settings, self.starts, self.interruption)
        if isinstance(found, Solution):
            ways.append(found)
        return found if isinstance(found, Rest) else None

    def _beside_others(self, rest: Rest, poses: Array) -> list[Solution]:
        """The solution where bodies rest and others are in the way, if there is one."""
        found = beside_others(self.scene, rest, poses, self.q, self.settings, self.starts, self.interruption)
        return [] if found is None else [found]

    def _where_faces_fit(self) -> list[Solution]:
        """Without an objective, the solution where bodies that are stuck in each other fit; none where none do.

        Rows of clearances contradict each other there: from the start few solves arrive. What leans in its bore by more
        than its play is put straight, and that is the answer: how it would lean at the least move depends on all of its
        rows, for a difference of no more than the play. Faces that are all flat may touch at an edge at the least move.
        """
        seat = seated(self.scene, self.q, self._touching, self.interruption)
        if seat is not None and seat.has_bores:
            there = self._at_seat(seat)
            if there is not None:
                return [there]
        ways: list[Solution] = []
        self._resting(self.q, partial(prove_start, self.scene.packed(), self.scene.bodies), ways)
        if ways or seat is None or self.interruption.is_over():
            return ways
        return [self._where_it_fits(seat.poses)]

    def _at_seat(self, seat: Seat) -> Solution | None:
        """The solution where bodies fit, if that is proven; its move is that from the user's poses."""
        there = self._unhindered(seat.poses, False)
        if there is not None:
            packed, state = there._ended
            state[packed.results_at + OBJECTIVE] = seat.move / packed.unit
        return there

    def _constraints_first(self) -> list[Solution]:
        """A solve from where constraints hold and bodies are clear, ignoring the objective there.

        Far from there an objective draws bodies into each other before rows can keep them apart.
        """
        there = self.scene._part(True, False)._from_start(self.q, self.starts, self.options, self.interruption)
        if not there.success or self.interruption.is_over():
            return []
        solution = self._from(there.q.copy())
        solution.put_together = there.put_together
        return [solution] if solution.success else []

    def _put_together(self, together: PutTogether) -> list[Solution]:
        """The same, from where bodies were put together without clearances; nothing if that is not found.

        If bodies overlap there, some of their faces may nearly fit: then a solve begins where these do. An objective
        alone may draw bodies into each other in any case, so bodies without such faces are not put together by it.
        """
        if together.there is None or self.interruption.is_over():
            return []
        (poses, alone), packed = together.there, self.scene.packed()
        prove, contacts = partial(prove_start, packed, self.scene.bodies), None
        if alone is None:
            solution = self._unhindered(poses, True)
        else:
            solution = self._clear_end(alone, prove)
            contacts = alone.state[packed.contacts_at :][: TRACK * len(packed.contacts)]
        rests: list[Solution] = []
        rest = self._resting(poses, prove, rests) if solution is None else None
        solution = rests[0] if rests else solution
        if rest is not None and not self.interruption.is_over():
            besides = self._beside_others(rest, poses)
            solution = besides[0] if besides else None
        seat = None if solution else seated(self.scene, poses, self._touching, self.interruption)
        if seat is not None:
            solution = None if self.scene.objectives else self._at_seat(seat)
            solution = solution or self._where_it_fits(seat.poses)
        if together.is_asked and (solution is None or not solution.success) and not self.interruption.is_over():
            solution = self._where_it_fits(poses, contacts)
        if solution is None or not together.is_meant(self.scene, solution):
            return []
        solution.put_together = True
        return [solution]

    def _unhindered(self, poses: Array, is_minimum: bool) -> Solution | None:
        """The solution at poses, if rows hold and it is proven that no clearance pushes there.

        Poses that are no minimum without clearances are taken as they stand: moves are measured from these.
        """
        reference = self.q if is_minimum else None
        return unhindered_at(self.scene, poses, is_minimum, reference, self.settings, self.starts, self.interruption)

    @property
    def _touching(self) -> float:
        """The overlap that still counts as touching, a length."""
        return float(self.settings[ALLOWED_OVERLAP]) * self.scene.packed().scale

    def _seated(self, is_solved: bool) -> list[Solution]:
        """A solve from where bodies that are stuck in each other fit; none where no faces nearly fit."""
        seat = seated(self.scene, self.q, self._touching, self.interruption)
        if seat is None or self.interruption.is_over():
            return []
        return [self._from(seat.poses) if is_solved else self._where_it_fits(seat.poses)]

    def _from_apart(self, is_solved: bool) -> list[Solution]:
        """Solves from where bodies that are stuck in each other fit, or are parted; fewer where there is a solution."""
        touching = self._touching
        ways = self._seated(is_solved) if self.scene.objectives else []
        if self._is_done(ways):
            return ways
        apart = parted(self.scene, self.q, touching, self.interruption)
        if apart is not None:
            ways.append(self._from(apart))
        if not is_solved and not self._is_done(ways):
            poses = separated(self.scene, self.q, self.options, self.interruption)
            ways += [] if poses is None else [self._from(poses)]
        return ways

    def _from_parted_end(self, end: Solution) -> list[Solution]:
        """Solves from where the end of a solve at which bodies cross is parted, and once more from the end of that one.

        An objective may lead bodies through a thin one in one step. Near its minimum steps are short.
        """
        touching = self._touching
        ways: list[Solution] = []
        for _ in range(PARTED_ENDS):
            apart = parted(self.scene, end.q.copy(), touching, self.interruption)
            if apart is None:
                break
            end = self._from(apart)
            ways.append(end)
            if self._is_done(ways):
                break
        return ways
