"""A start at which all constraints hold is the solution, returned in the time of one check.

Without an objective nothing requires a move. So before contacts of clearances are searched, joints and given contacts
are evaluated at the start, and the pairs that clearances keep apart are proven to be clear or to touch only
(`solve/start_proof.py`). Neither needs the facet trees of the contact manager, which are packed when an update first
needs them. Contacts that are near are listed when something first asks the solution for them.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.constraints.packing.scene import MORE_PLACES, MOST_CROWDING, Packed
from assembly.constraints.program.records import RESULTS
from assembly.proximity.features.solid_contact import TRACK
from assembly.solve.attempts.attempts import as_it_stands, load, with_listed
from assembly.solve.clearance_proof import can_prove
from assembly.solve.interruption import CTRL_C, Interruption
from assembly.solve.loop.settings import ALLOWED_OVERLAP, COUNT, FIT, PLACES, SOLVED
from assembly.solve.options import Options
from assembly.solve.result import Ended, Result
from assembly.solve.scene import Status
from assembly.solve.second_order.leave import Fit
from assembly.solve.solution import Solution
from assembly.solve.start_proof import is_for_proofs, prove_start

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["standing_start", "with_contacts"]

Array = NDArray[np.float64]


def standing_start(
    scene: Assembly,
    q0: ArrayLike | Solution | None,
    settings: Array,
    starts: Mapping[str, ArrayLike] | None,
    interruption: Interruption,
) -> Solution | None:
    """The start of a scene with clearances and no objective as its solution, or None if it is not one.

    Parameters
    ----------
    scene : Assembly
    q0 : (n, 7) or Solution, optional
        Where to start; a solution only if its contacts are not listed yet.
    settings : array
        Settings of the loop.
    starts : mapping of constraint name -> (4,), optional
    interruption : Interruption
    """
    packed = scene.packed()
    if not can_prove(packed) or not is_for_proofs(packed) or scene._scene is None:
        return None
    if isinstance(q0, Solution) and q0._ended.packed is not packed:
        return None
    start = partial(scene._start, packed, q0, starts)
    load(packed, start)
    begin = perf_counter()
    state = start()
    before = state[: packed.contacts_at].copy()
    code, state, history, *_ = as_it_stands(packed, interruption, settings, state)
    is_still = code == SOLVED and state[packed.results_at + COUNT] == 0.0 and (state[: len(before)] == before).all()
    if not is_still or interruption.is_over():
        return None
    touching = float(settings[ALLOWED_OVERLAP])
    answers = prove_start(packed, scene.bodies, state, touching)
    if answers is None or interruption.is_over():
        return None
    solution = Solution(scene._scene, packed, state, Status.SOLVED, 0.0, history, fit=Fit(float(settings[FIT])))
    solution._touching, solution._clear = touching, answers
    solution._lists = partial(with_contacts, scene)
    solution.seconds = perf_counter() - begin
    return solution


def with_contacts(scene: Assembly, solution: Result) -> Ended:
    """The end state of a start that was returned unchanged, with the contacts of clearances listed.

    If these need more slots the scene is packed with more, unless its rows have changed.
    """
    ended = solution._ended
    settings = CTRL_C.settings(CTRL_C.fill(Options(touching=solution._touching).settings()))
    packed = scene._packed_as(ended.packed) or ended.packed
    grows = packed.crowding < MOST_CROWDING
    while True:
        settings[PLACES] = float(grows)
        outcome = with_listed(packed.as_asked(solution._asked), CTRL_C, settings, _start_of(packed, ended))
        CTRL_C.is_over()
        if not (grows and packed.is_crowded(outcome.state)):
            return Ended(packed, _same_results(packed, outcome.state, ended))
        more = _with_more_places(scene, packed, solution)
        grows = more is not None and more.crowding < MOST_CROWDING
        packed = more or packed


def _with_more_places(scene: Assembly, packed: Packed, solution: Result) -> Packed | None:
    """The scene of a solution packed with more slots, if it still has the same rows."""
    if scene._packed_as(packed) is packed:
        more = scene._pack_with_more_places()
    else:
        there = solution._scene
        more = Packed(there.bodies, there.constraints, (), packed.crowding * MORE_PLACES)
        if not more.has_rows_of(packed):
            return None
    # Values and targets are not there yet.
    more.refresh()
    return more


def _start_of(packed: Packed, ended: Ended) -> Array:
    """The state of a packed scene that knows the poses, the contacts and the angles of another state."""
    before, known = ended
    state, given = packed.new_state(), TRACK * len(packed.contacts)
    state[: packed.contacts_at] = known[: before.contacts_at]
    state[packed.contacts_at : packed.angles_at] = np.nan
    state[packed.contacts_at :][:given] = known[before.contacts_at :][:given]
    state[packed.angles_at : packed.multipliers_at] = known[before.angles_at : before.multipliers_at]
    return state


def _same_results(packed: Packed, state: Array, ended: Ended) -> Array:
    """A state with the results of another one."""
    before, known = ended
    state[packed.results_at :][:RESULTS] = known[before.results_at :][:RESULTS]
    return state
