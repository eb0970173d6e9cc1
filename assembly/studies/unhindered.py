"""A warm solve that no clearance hinders: rows are solved without clearances, which are then proven.

A mechanism whose links slide along each other lists hundreds of contacts, none of which pushes: joints alone determine
its motion. So rows without clearances are solved first, and bodies are proven to be clear, or to touch, at the pose
found, which is then the least move, or a minimum of the objective, with clearances, too. Whether clearances pushed at
the last solution is no criterion without an objective: where their contacts are redundant with joints, it is
undetermined which of them push. An objective draws bodies onto what is in their way, and rows without clearances are
then tried only from solutions at which none pushed.

Nor may bodies have passed through each other: the straight way from the last pose is proven with the same look. If it
cannot be proven, as for a pin that moves along an arc in its bore, the way has to be shorter than the bodies'
thickness. If any of this fails, the solve proceeds with clearances.

Where parts were put together without clearances it is the same, but for the way. A first solve begins so as well: the
way of bodies that are clear at the start has to be proven.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.solve.attempts.attempts import load, rows_alone
from assembly.solve.clearance_proof import PairAnswer, can_prove
from assembly.solve.interruption import Interruption
from assembly.solve.loop.settings import ALLOWED_OVERLAP, COUNT, FIT, SOLVED, UNSURE
from assembly.solve.scene import Status
from assembly.solve.second_order.leave import Fit, Outcome
from assembly.solve.solution import Solution
from assembly.solve.start_proof import is_for_proofs, prove_start, prove_way
from assembly.studies.standing_start import with_contacts

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["Prove", "clear_end", "rows_from_start", "unhindered", "unhindered_at"]

Array = NDArray[np.float64]
# Proves a scene's pairs at a state, for a given overlap that counts as touching; None if that fails.
Prove = Callable[[Array, float], Sequence[PairAnswer] | None]


def unhindered(
    scene: Assembly,
    last: Solution,
    settings: Array,
    starts: Mapping[str, ArrayLike] | None,
    interruption: Interruption,
) -> Solution | None:
    """The solution of a scene with clearances that is found without these, or None.

    Parameters
    ----------
    scene : Assembly
    last : Solution
        Where to start.
    settings : array
        Settings of the loop.
    starts : mapping of constraint name -> (4,), optional
    interruption : Interruption
    """
    packed = scene.packed()
    if scene._scene is None or not (can_prove(packed) and is_for_proofs(packed)):
        return None
    if not last.success or packed.corners:
        return None
    start = partial(scene._start, packed, last, starts)
    load(packed, start)
    begin = perf_counter()
    outcome = rows_alone(packed, interruption, settings, start())
    prove = partial(prove_way, packed, scene.bodies, last.q)
    return _where_clear(scene, outcome, begin, settings, prove, interruption)


def unhindered_at(
    scene: Assembly,
    poses: Array,
    is_minimum: bool,
    reference: Array | None,
    settings: Array,
    starts: Mapping[str, ArrayLike] | None,
    interruption: Interruption,
) -> Solution | None:
    """The same from poses (n, 7) at which rows hold, whatever objective there is.

    The way there is not proven. A minimum without clearances is a minimum. Moves are measured from a reference (n, 7),
    or from the poses.
    """
    packed = scene.packed()
    if scene._scene is None or packed.corners or not (can_prove(packed) and is_for_proofs(packed)):
        return None
    start = partial(scene._start, packed, poses, starts)
    load(packed, start)
    begin = perf_counter()
    outcome = rows_alone(packed, interruption, settings, start(), reference)
    if is_minimum and outcome.code == UNSURE and outcome.state[packed.results_at + COUNT] == 0.0:
        outcome = outcome._replace(code=SOLVED)
    prove = partial(prove_start, packed, scene.bodies)
    return _where_clear(scene, outcome, begin, settings, prove, interruption)


def rows_from_start(
    scene: Assembly,
    q: Array,
    settings: Array,
    starts: Mapping[str, ArrayLike] | None,
    interruption: Interruption,
) -> Outcome:
    """How rows end without clearances from poses (n, 7), with no initial assembly, whatever bodies do then."""
    packed = scene.packed()
    turns = scene._turns_of(packed)
    start = partial(scene._start, packed, q, starts, turns)
    load(packed, start)
    return rows_alone(packed, interruption, settings, start())


def clear_end(
    scene: Assembly, alone: Outcome, settings: Array, prove: Prove, interruption: Interruption
) -> Solution | None:
    """The solution where rows have ended without clearances, or None where there is none, or it is not proven."""
    packed = scene.packed()
    if scene._scene is None or packed.corners or not (can_prove(packed) and is_for_proofs(packed)):
        return None
    return _where_clear(scene, alone, perf_counter(), settings, prove, interruption)


def _where_clear(
    scene: Assembly,
    outcome: Outcome,
    begin: float,
    settings: Array,
    prove: Prove,
    interruption: Interruption,
) -> Solution | None:
    """The solution found without clearances, if there is one and bodies are proven to be clear there."""
    packed, (code, state, history, order, _) = scene.packed(), outcome
    if code != SOLVED or interruption.is_over():
        return None
    touching = float(settings[ALLOWED_OVERLAP])
    answers = prove(state, touching)
    if answers is None or scene._scene is None or interruption.is_over():
        return None
    solution = Solution(scene._scene, packed, state, Status.SOLVED, 0.0, history, order, Fit(float(settings[FIT])))
    solution._touching, solution._clear = touching, answers
    solution._lists = partial(with_contacts, scene)
    solution.seconds = perf_counter() - begin
    return solution
