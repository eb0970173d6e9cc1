"""A failed solve tried again from other starts.

A failed solve may have ended at a local minimum of the violation, on a branch on which limits cannot hold, or with
revolution counts that contradict each other around a loop. Other starts are the end itself, with revolution counts
chosen there, poses about it, and scattered ones. Moves are always measured from the user's poses, and of the solutions
found the one with the least objective is returned. A solve that succeeds costs nothing more.
"""

from __future__ import annotations

from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.solve.attempts.starts import Spread, far_starts, near_starts
from assembly.solve.diagnosis.contradiction import is_certain
from assembly.solve.interruption import Interruption
from assembly.solve.loop.settings import GATHER, ITERATIONS, VIOLATION
from assembly.solve.scene import Status
from assembly.solve.solution import Solution

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["may_hold_elsewhere", "restarted"]

Array = NDArray[np.float64]
# Scattered starts of a round, and rounds.
SCATTERED, ROUNDS = 4, 2
# A violation, over the size, that rounding may leave where rows hold.
ROUNDED = 1e-12
# Steps of each start.
STEPS = 100.0


def may_hold_elsewhere(solution: Solution) -> bool:
    """Whether a solve ended where constraints do not hold, with enough steps and without a lost contact.

    With contacts or clearances it is not tried elsewhere: scattered bodies would come to be on other sides of each
    other, a ball under the floor that it is to touch, linked rings apart. Nor where equations contradict each other
    wherever bodies are.
    """
    if solution._packed.clearance_rows or solution._packed.contacts:
        return False
    ended = solution.status in (Status.INFEASIBLE, Status.STALLED)
    if not ended or is_certain(solution._packed):
        return False
    return not solution._result(VIOLATION) <= ROUNDED * solution._packed.scale


def restarted(
    scene: Assembly, failed: Solution, settings: Array, given: Array | Solution, interruption: Interruption
) -> Solution:
    """The solution with the least objective that is found from other starts, or the one that failed.

    Parameters
    ----------
    scene : Assembly
    failed : Solution
    settings : array
        Of a first solve.
    given : (n, 7) or Solution
        Where the solve that failed started.
    interruption : Interruption
        Asked by solves whether to go on.
    """
    if isinstance(given, Solution):
        packed = scene.packed()
        reference, turns = given.q, scene._begun_by(packed, given)[0][packed.angles]
    else:
        reference, turns = given, None
    settings = settings.copy()
    settings[ITERATIONS] = min(settings[ITERATIONS], STEPS)
    # From each start as it is, and with its bodies assembled if that fails: often one succeeds where the other does
    # not.
    settings[GATHER] = 0.0
    bodies, spread = failed._scene.bodies, Spread.of(failed._packed, failed.q)
    rounds = islice(far_starts(bodies, failed.q, spread, SCATTERED), ROUNDS)
    best, seconds = failed, failed.seconds
    for starts in (near_starts(bodies, failed.q, spread), *rounds):
        ends: list[Solution] = []
        for start in starts:
            ends.append(scene._solved(settings, start, None, interruption, reference, turns))
            if interruption.is_over():
                break
        seconds += sum(end.seconds for end in ends)
        found = [end for end in ends if end.success]
        if found:
            best = min(found, key=lambda end: end.objective)
            best.restarted = True
        if found or interruption.is_over():
            break
    best.seconds = seconds
    return best
