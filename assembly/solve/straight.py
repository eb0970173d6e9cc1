"""A solve that goes on from a solution by the loop alone, as nearly all of them do.

Whether `Assembly.solve` needs more than the loop (corners, slots for contacts, bodies put together, rows that disagree,
saddles, other starts) was asked in every solve, and took 2 of the 5 microseconds that a warm solve spends in Python.
Here it is asked once for a scene (`Packed.is_loop_alone`), and of the end only whether the loop arrived. If it did not,
the solve begins anew with everything it may need.
"""

from __future__ import annotations

from time import perf_counter

from assembly.constraints.model.constraint import structure_changes
from assembly.constraints.packing.earlier import with_numbers_of
from assembly.constraints.packing.scene import Packed
from assembly.solve.interruption import CTRL_C
from assembly.solve.loop.settings import SOLVED
from assembly.solve.scene import Scene
from assembly.solve.solution import Solution

__all__ = ["straight_from"]


def straight_from(begun: Solution, scene: Scene | None, packed: Packed | None) -> Solution | None:
    """The solution at which the loop arrives from another one, for a scene as it is packed; None if more may be needed.

    Parameters
    ----------
    begun : Solution
        Where to start.
    scene : Scene or None
        What the new solution speaks of; None, as `packed` is, where nothing is packed yet.
    packed : Packed or None
        How the scene was packed for its last solve.
    """
    if packed is None or scene is None:
        return None
    earlier, left = begun._ended
    if packed is not earlier and (packed.number_places is None or packed.number_places is not earlier.number_places):
        return None
    if not packed.is_loop_alone or begun._fit is not None or packed.stamp != structure_changes():
        return None
    spare = packed.workspaces
    try:
        workspace = spare.pop()
    except IndexError:
        # The loop is not there yet, or another thread is in it.
        return None
    try:
        begin = perf_counter()
        state = left.copy() if packed is earlier else with_numbers_of(packed, earlier, left)
        packed.refresh()
        if packed.has_coupled_angles:
            packed.start_angles(state, True)
        code = workspace.go_on(packed, state)
        # The next solve writes to the same memory.
        history = workspace.rows_of_history()
        seconds = perf_counter() - begin
    finally:
        spare.append(workspace)
    # What a signal's handler raised is raised here.
    if CTRL_C.is_over() or code != SOLVED:
        return None
    return Solution._arrived(scene, packed, state, seconds, history)
