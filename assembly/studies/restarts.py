"""A solve that failed, tried again from other starts: that all holds from another start is an answer.

The pose that a solve ends at may be one where a sum of violations is least and not zero, a branch on which limits
cannot hold, or have turns that contradict each other around a loop. Other starts are the end itself, with turns chosen
there, poses about it, and scattered ones. All of them are measured from where the user's bodies were, and of the
solutions found the one with the least objective is returned. A solve that did not fail pays nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.solid_contact import TRACK
from assembly.solve.rank import HELD
from assembly.solve.settings import GATHER, ITERATIONS, VIOLATION
from assembly.solve.solution import Solution, Status
from assembly.solve.starts import about, moving_rows, scattered

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["may_hold_elsewhere", "restarted"]

Array = NDArray[np.float64]
# How far about the end of a solve others start, in sizes of the scene and radians, and how many start scattered.
ABOUT, SCATTERED = (0.0, 0.03, 0.3), 16
# Steps of each.
STEPS = 100.0


class _Start(NamedTuple):
    """Poses (n, 7) of another start, and whether its bodies are gathered first."""

    q: Array
    gathers: bool


def may_hold_elsewhere(solution: Solution) -> bool:
    """Whether a solve ended where constraints do not hold, and not for want of steps or of a contact's pair."""
    ended = solution.status in (Status.INFEASIBLE, Status.STALLED)
    return ended and not solution._result(VIOLATION) <= HELD * solution._packed.scale


def restarted(scene: Assembly, failed: Solution, settings: Array, given: Array | Solution) -> Solution:
    """The solution with the least objective that is found from other starts, or the one that failed.

    Parameters
    ----------
    scene : Assembly
    failed : Solution
    settings : array
        Of a first solve.
    given : (n, 7) or Solution
        Where the solve that failed started.
    """
    if isinstance(given, Solution):
        packed = given._packed
        reference, turns = given.q, given._state[packed.angles_at : packed.multipliers_at : TRACK]
    else:
        reference, turns = given, None
    settings = settings.copy()
    settings[ITERATIONS] = min(settings[ITERATIONS], STEPS)
    seconds = failed.seconds
    for ways in _starts(failed):
        found: list[Solution] = []
        for start in ways:
            settings[GATHER] = 1.0 if start.gathers else 0.0
            solution = scene._solved(settings, start.q, None, reference, turns)
            seconds += solution.seconds
            if solution.success:
                found.append(solution)
        if found:
            best = min(found, key=lambda way: way.objective)
            best.restarted = True
            failed = best
            break
    failed.seconds = seconds
    return failed


def _starts(failed: Solution) -> Iterator[list[_Start]]:
    """Starts near the end of a solve, then scattered ones."""
    rng = np.random.default_rng(0)
    moving = moving_rows(failed._scene.bodies)
    size = failed._scene.scale
    yield [_Start(about(rng, failed.q, moving, size, reach), gathers=False) for reach in ABOUT]
    yield [_Start(scattered(rng, failed.q, moving, size), gathers=True) for _ in range(SCATTERED)]
